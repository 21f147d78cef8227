//! Import of scene files: objects, cameras and lights; faults with their line and advice.

use crate::common::borders::Folder;
use crate::common::gltf::Model;
use crate::helpers::*;
use glam::DVec3;
use kiln::error::Warnings;
use kiln::film::Colour;
use kiln::scene::{Falloff, LightKind, Material, Scene};
use serde_json::json;

#[test]
fn scene_file_materials_are_of_one_model() {
    let material = |keys: &str| {
        let text = format!(
            "[material.m]\ncolour = '#ff0000'\n{keys}\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\nmaterial = 'm'\n"
        );
        Folder::new().load("a.toml", text.as_bytes()).0.materials
    };
    let fails = |keys: &str| {
        let e =
            Folder::new().fails("a.toml", format!("[material.m]\ncolour = '#ff0000'\n{keys}\n").as_bytes());
        (message(&e), e.hint().to_owned())
    };
    assert!(matches!(&material("metallic = 1\nroughness = 0.25")[0], Material::MetallicRoughness(m)
        if (m.metallic, m.roughness) == (1.0, 0.25) && m.layers == Default::default()));
    assert!(matches!(&material("emission = '#ffffff'\nemission_intensity = 3")[0], Material::Phong(m)
        if m.emission == Colour::Linear(v(3.0, 3.0, 3.0))));
    let one = "give the keys of one model: Phong or metallic-roughness";
    for (keys, what, hint) in [
        (
            "roughness = 0\nglaze = {}",
            "material `m` has `glaze` beside `roughness`, `metallic` or `layers`",
            one,
        ),
        ("roughness = 1.5", "`roughness` is 1.5", "give a number from 0 to 1"),
        ("layers = { ior = 0.9 }", "`ior` is 0.9", "give a number from 1, or 0"),
        ("layers = { attenuation_distance = 0 }", "`attenuation_distance` is 0", "give a distance above 0"),
        ("layers = { anisotropy = 2 }", "`anisotropy` is 2", "give a number from 0 to 1"),
        (
            "layers = { anisotropy_rotation = inf }",
            "`anisotropy_rotation` is inf",
            "give an angle in degrees",
        ),
    ] {
        assert_eq!(fails(keys), (format!("a.toml:1: {what}"), hint.to_owned()), "{keys}");
    }
}

#[test]
fn scene_files_number_their_objects_in_the_order_written() {
    let folder = Folder::new();
    folder.write("two.obj", format!("{OBJ_TRIANGLE}o first\nf 1 2 3\no second\nf 1 2 3\n"));
    let text = "
[[sphere]]
name = 'a'
centre = [0, 0, 0]
radius = 1
[[triangles]]
name = 'b'
vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
[[sphere]]
name = 'c'
centre = [0, 0, 0]
radius = 1
[[mesh]]
file = 'two.obj'
[[triangles]]
name = 'f'
vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
[[sphere]]
centre = [0, 0, 0]
radius = 1
";
    let (scene, warnings) = folder.load("order.toml", text);
    let names: Vec<&str> = scene.objects.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["a", "b", "c", "first", "second", "f", "sphere 6"]);
    assert_eq!(warnings, [""; 0]);
}

#[test]
fn scene_files_place_meshes() {
    let folder = Folder::new();
    folder.write("a.mtl", "newmtl own\nKd 0 1 0\n");
    folder.write("a.obj", format!("mtllib a.mtl\nusemtl own\n{OBJ_TRIANGLE}f 1 2 3\n"));
    let text = "
[material.red]
colour = '#ff0000'
[material.grey]
colour = [128, 128, 128]
[[mesh]]
file = 'a.obj'
scale = 2
rotate = [0, 0, 90]
translate = [10, 0, 0]
material = 'red'
[[mesh]]
file = 'a.obj'
scale = [1, 3, 1]
rotate = [90, 90, 90]
";
    let (scene, _) = folder.load("a.toml", text);
    // Scaled: (2,0,0) and (0,2,0); a rotation by 90 degrees about z takes x to y and y to -x; then a translation by
    // (10, 0, 0).
    let [a, b, c] = triangles(mesh(&scene, 0))[0];
    assert_near(a, v(10.0, 0.0, 0.0));
    assert_near(b, v(10.0, 2.0, 0.0));
    assert_near(c, v(8.0, 0.0, 0.0));
    // (1,0,0): about x stays, about y to (0,0,-1), about z stays. (0,3,0): about x to (0,0,3), about y to (3,0,0),
    // about z to (0,3,0). In the other order they would go to (0,0,-1) and (0,-3,0).
    let [_, b, c] = triangles(mesh(&scene, 1))[0];
    assert_near(b, v(0.0, 0.0, -1.0));
    assert_near(c, v(0.0, 3.0, 0.0));
    let material = |i: usize| &scene.materials[scene.objects[i].material.0 as usize];
    let Material::Phong(red) = material(0) else { panic!("{:?}", scene.materials) };
    assert_eq!((red.name.as_str(), red.colour), ("red", Colour::from_u8([255, 0, 0])));
    assert_eq!(material(1).name(), "own");
    let grey = scene.materials.iter().find(|m| m.name() == "grey");
    let Some(Material::Phong(grey)) = grey else { panic!("{:?}", scene.materials) };
    assert_eq!(grey.colour, Colour::from_u8([128; 3]));
}

/// A mesh far from the origin that a scene file moves back to it keeps all digits.
#[test]
fn meshes_are_checked_where_they_are_placed() {
    let folder = Folder::new();
    folder.write("far.obj", "v 5000000 0 0\nv 5000000.01 0 0\nv 5000000 0.01 0\nf 1 2 3\n");
    let scene = "[[mesh]]\nfile = 'far.obj'\ntranslate = [-5000000, 0, 0]\n";
    let (scene, warnings) = folder.load("a.toml", scene);
    assert_eq!((scene.primitive_count(), warnings.len()), (1, 0));
    assert_near(mesh(&scene, 0).positions[1], v(0.01, 0.0, 0.0));
}

#[test]
fn scene_files_decide_on_cameras_and_lights_not_their_meshes() {
    let folder = Folder::new();
    let model = Model::triangle()
        .with("scenes", json!([{ "nodes": [0, 1] }]))
        .with("nodes", json!([{ "mesh": 0 }, { "camera": 0 }]))
        .with("cameras", json!([{ "type": "perspective", "perspective": { "yfov": 1, "znear": 0.1 } }]));
    folder.write("a.glb", model.binary());
    let (scene, _) = folder.load("a.toml", "[[mesh]]\nfile = 'a.glb'\n");
    assert_eq!((scene.cameras.len(), scene.objects.len()), (0, 1));
}

/// Text of a scene file, its error message and, for some, a part of the hint. The line is that of the key for errors of
/// syntax and type, and that of the section's header for values that are invalid together.
const FAULTS: &[(&str, &str, &str)] = &[
    // Syntax.
    ("[image\n", "1: ", ""),
    ("\n[image]\nwidth = 1\nwidth = 2\n", "4: `width` is given twice", "keep one"),
    ("[image]\nheigth = 1\n", "2: unknown key `heigth`", "did you mean `height`?"),
    ("\n\n[imag]\n", "3: unknown key `imag`", "did you mean `image`?"),
    (
        "[image]\nzzz = 1\n",
        "2: unknown key `zzz`",
        "known here: width, height, look, azimuth, elevation, zoom, fov, numerics, shading",
    ),
    ("[image]\ncolour = 'lineal'\n", "2: unknown value `lineal`", "did you mean `linear`?"),
    ("\n[[sphere]]\nradius = 1\n", "2: missing key `centre`", "`centre = ...`"),
    ("[[sphere]]\ncentre = [0, 0]\nradius = 1\n", "2: `centre` is [0, 0], expected 3 numbers", "[0, 0, 0]"),
    ("[[sphere]]\ncentre = [0, 0, 0]\nradius = 'big'\n", "3: `radius` is 'big', expected a number", "1.5"),
    ("[image]\nwidth = -1\n", "2: `width` is -1, expected a whole number", ""),
    ("[image]\nbackground = 'reddish'\n", "2: `background` is 'reddish', expected a colour", "#rrggbb"),
    (
        "[image]\n\nbackground = [1, 2, 256]\n",
        "3: `background` is [1, 2, 256], expected a colour",
        "from 0 to 255",
    ),
    (
        "[[mesh]]\nfile = 'a.obj'\nscale = [1, 2]\n",
        "3: `scale` is [1, 2], expected a number or [x, y, z]",
        "",
    ),
    // `[image]`.
    ("[image]\nwidth = 0\nheight = 5\n", "2: `width` is 0", "from 1 to 65535"),
    ("# about the [image]\n\n[image]\nwidth = 5\n", "3: `width` or `height` is missing", "both or neither"),
    ("\n[ambient]\nintensity = -1\n", "2: `intensity` is -1", "0 or more"),
    ("[ambient]\nintensity = nan\n", "1: `intensity` is NaN", "0 or more"),
    // Cameras.
    (
        "[[camera]]\nname = 'a'\nposition = [0, 0, 0]\nlook_at = [0, 0, 1]\n\
         [[camera]]\nname = 'a'\nposition = [0, 0, 0]\nlook_at = [0, 0, 1]\n",
        "5: a second camera named `a`",
        "its own name",
    ),
    ("\n[[camera]]\nposition = [0, inf, 0]\nlook_at = [0, 0, 1]\n", "2: `position` holds inf", "finite"),
    ("[[camera]]\nposition = [0, 0, 0]\nlook_at = [nan, 0, 1]\n", "1: `look_at` holds NaN", "finite"),
    (
        "[[camera]]\nposition = [0, 0, 0]\nlook_at = [0, 0, 1]\nup = [0, -inf, 0]\n",
        "1: `up` holds -inf",
        "finite",
    ),
    (
        "[[camera]]\nposition = [1, 2, 3]\nlook_at = [1, 2, 3]\n",
        "1: camera `camera 0` looks at itself",
        "move",
    ),
    (
        "[[camera]]\nposition = [0, 0, 0]\nlook_at = [0, 0, 1]\nup = [0, 0, 0]\n",
        "1: camera `camera 0` has no up",
        "",
    ),
    (
        "[[camera]]\nposition = [0, 0, 0]\nlook_at = [0, 0, 1]\nviewing_rectangle = [0, 1]\nviewpoint_distance = 1\n",
        "1: camera `camera 0` has a viewing rectangle or distance that is not above 0",
        "above 0",
    ),
    (
        "[[camera]]\nposition = [0, 0, 0]\nlook_at = [0, 0, 1]\nvertical_fov = 180\n",
        "1: camera `camera 0` has a field of view of 180 degrees",
        "below 180",
    ),
    (
        "[[camera]]\nposition = [0, 0, 0]\nlook_at = [0, 0, 1]\nvertical_fov = 40\nviewpoint_distance = 1\n",
        "1: camera `camera 0` says too much or too little of its lens",
        "`vertical_fov` alone",
    ),
    ("[image]\nclamp = 0\n", "2: `clamp` is 0", "give a radiance above 0"),
    // Lights.
    ("[[light]]\ntype = 'pint'\n", "2: unknown value `pint`", "did you mean `point`?"),
    ("[[light]]\ntype = 'point'\n", "1: light `light 0` is not placed", "a point light has a `position`"),
    (
        "\n[[light]]\nname = 'sun'\ntype = 'directional'\nposition = [0, 0, 0]\n",
        "2: light `sun` is not placed",
        "a directional light has a `direction`",
    ),
    (
        "[[light]]\ntype = 'spot'\ndirection = [0, -1, 0]\n",
        "1: light `light 0` is not placed",
        "a spot has a `position`, and a",
    ),
    (
        "[[light]]\ntype = 'spot'\nposition = [0, 1, 0]\n",
        "1: light `light 0` is not placed",
        "and a `direction` or a point",
    ),
    (
        "[[light]]\ntype = 'spot'\nposition = [0, 1, 0]\nlook_at = [0, 0, 0]\ndirection = [0, -1, 0]\n",
        "1: light `light 0` is not placed",
        "either a `direction` or a point to `look_at`",
    ),
    (
        "[[light]]\ntype = 'spot'\nposition = [0, 1, 0]\nlook_at = [0, 1, 0]\n",
        "1: `look_at` is where the light is",
        "another point",
    ),
    (
        "[[light]]\ntype = 'spot'\nposition = [0, 1, 0]\nlook_at = [0, nan, 0]\n",
        "1: `look_at` holds NaN",
        "finite",
    ),
    (
        "[[light]]\ntype = 'spot'\nposition = [0, 1, 0]\nlook_at = [0, 0, 0]\nouter_cone_angle = 90.5\n",
        "1: `outer_cone_angle` is 90.5",
        "degrees from the axis, above 0 and at most 90",
    ),
    (
        "[[light]]\ntype = 'spot'\nposition = [0, 1, 0]\nlook_at = [0, 0, 0]\nouter_cone_angle = 0\n",
        "1: `outer_cone_angle` is 0",
        "above 0",
    ),
    (
        "[[light]]\ntype = 'spot'\nposition = [0, 1, 0]\nlook_at = [0, 0, 0]\ninner_cone_angle = 50\n",
        "1: `inner_cone_angle` is 50, and `outer_cone_angle` 45",
        "at most the outer angle",
    ),
    (
        "[[light]]\ntype = 'spot'\nposition = [0, 1, 0]\nlook_at = [0, 0, 0]\ninner_cone_angle = -1\n",
        "1: `inner_cone_angle` is -1",
        "0 or more",
    ),
    (
        "[[light]]\ntype = 'point'\nposition = [0, 1, 0]\nlook_at = [0, 0, 0]\n",
        "1: light `light 0` has a `look_at`",
        "only a spot, a rectangle or a disk has `look_at`",
    ),
    (
        "[[light]]\ntype = 'directional'\ndirection = [0, 1, 0]\nouter_cone_angle = 3\n",
        "1: light `light 0` has a `outer_cone_angle`",
        "only a spot has",
    ),
    (
        "[[light]]\ntype = 'directional'\ndirection = [0, 1, 0]\nangle = 180.5\n",
        "1: `angle` is 180.5",
        "that of the sun is 0.53",
    ),
    (
        "[[light]]\ntype = 'directional'\ndirection = [0, 1, 0]\nfalloff = 'inverse-square'\n",
        "1: light `light 0` has a `falloff`",
        "only a point light or a spot has `falloff`",
    ),
    (
        "[[light]]\ntype = 'sphere'\nposition = [0, 1, 0]\nradius = 1\nfalloff = 'inverse-square'\n",
        "1: light `light 0` has a `falloff`",
        "falls with distance by itself",
    ),
    (
        "[[light]]\ntype = 'sphere'\nposition = [0, 1, 0]\n",
        "1: light `light 0` is not placed",
        "a sphere has a `position` and a `radius`",
    ),
    (
        "[[light]]\ntype = 'disk'\nposition = [0, 1, 0]\nradius = 1\n",
        "1: light `light 0` is not placed",
        "a `radius` and a `direction` or a point to `look_at`",
    ),
    (
        "[[light]]\ntype = 'sphere'\nposition = [0, 1, 0]\nradius = 0\n",
        "1: `radius` holds 0",
        "a light without size is a `point` or a `spot`",
    ),
    (
        "[[light]]\ntype = 'point'\nposition = [0, 1, 0]\nradius = 1\n",
        "1: light `light 0` has a `radius`",
        "only a sphere or a disk has `radius`",
    ),
    (
        "[[light]]\ntype = 'rectangle'\nposition = [0, 1, 0]\nsize = [1, 1]\n",
        "1: light `light 0` is not placed",
        "a `size` and a `direction` or a point to `look_at`",
    ),
    (
        "[[light]]\ntype = 'rectangle'\nposition = [0, 1, 0]\nlook_at = [0, 0, 0]\nsize = [1, inf]\n",
        "1: `size` holds inf",
        "from 1e-100 to 1e100",
    ),
    (
        "[[light]]\ntype = 'rectangle'\nposition = [0, 1, 0]\nlook_at = [0, 0, 0]\nsize = [1, 1]\nup = [0, 0, 0]\n",
        "1: `up` has no length",
        "leave it out",
    ),
    ("[[light]]\ntype = 'point'\nposition = [nan, 0, 0]\n", "1: `position` holds NaN", "finite"),
    ("[[light]]\ntype = 'directional'\ndirection = [inf, 0, 0]\n", "1: `direction` holds inf", "finite"),
    (
        "[[light]]\ntype = 'directional'\ndirection = [0, 0, 0]\n",
        "1: `direction` has no length",
        "travels in",
    ),
    (
        "[[light]]\ntype = 'point'\nposition = [0, 0, 0]\nintensity = -2\n",
        "1: `intensity` is -2",
        "0 or more",
    ),
    // Materials.
    ("[material.a]\ncolour = '#000000'\nambient = -1\n", "1: `ambient` is -1", "0 or more"),
    ("[material.a]\ncolour = '#000000'\ndiffuse = inf\n", "1: `diffuse` is inf", "0 or more"),
    ("[material.a]\ncolour = '#000000'\nspecular = -0.5\n", "1: `specular` is -0.5", "0 or more"),
    (
        "[material.a]\ncolour = '#000000'\n\n[material.b]\ncolour = '#000000'\nshininess = nan\n",
        "4: `shininess` is NaN",
        "",
    ),
    ("[material.a]\ncolour = '#000000'\nglaze = { weight = -1 }\n", "1: `glaze.weight` is -1", "0 or more"),
    (
        "[material.a]\ncolour = '#000000'\nglaze = { weight = 0.5, own_weight = 0.75 }\n",
        "1: the glaze of `a` adds light: its weights sum to 1.25",
        "at most 1",
    ),
    ("[material.a]\nambient = 1\n", "1: missing key `colour`", ""),
    (
        "[material.a]\ncolour = '#000000'\nglaze = { bounces = 20000000 }\n",
        "1: the glaze of `a` asks for 20000000 bounces",
        "at most 4096",
    ),
    ("[image]\nwidth = 4000000000\nheight = 3\n", "2: `width` is 4000000000", "from 1 to 65535"),
    (
        "[[light]]\nname = 'a'\ntype = 'point'\nposition = [0, 1e120, 0]\n",
        "1: light `a` is beyond 1e100",
        "directional",
    ),
    // Objects.
    ("[[sphere]]\ncentre = [nan, 0, 0]\nradius = 1\n", "1: `centre` holds NaN", "finite"),
    ("\n\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 0\n", "3: a sphere of radius 0", "above 0"),
    ("[[sphere]]\ncentre = [0, 0, 0]\nradius = inf\n", "1: a sphere of radius inf", "above 0"),
    ("[[disk]]\ncentre = [0, 0, 0]\nnormal = [0, 1, 0]\nradius = -1\n", "1: a disk of radius -1", "above 0"),
    (
        "[[disk]]\ncentre = [0, 0, 0]\nnormal = [0, 0, 0]\nradius = 1\n",
        "1: `normal` has no length",
        "direction",
    ),
    ("[[disk]]\ncentre = [0, 0, 0]\nnormal = [0, nan, 0]\nradius = 1\n", "1: `normal` holds NaN", "finite"),
    ("[[disk]]\ncentre = [0, 0, 0]\nradius = 1\n", "1: missing key `normal`", "`normal = ...`"),
    (
        "[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\nmaterial = 'red'\n",
        "1: there is no material `red`",
        "add [material.red]",
    ),
    (
        "[material.barn-red]\ncolour = '#ff0000'\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\nmaterial = 'barn-rad'\n",
        "3: there is no material `barn-rad`",
        "did you mean `barn-red`?",
    ),
    ("[[triangles]]\nvertices = [[0, 0, inf]]\n", "1: `vertices` holds inf", "finite"),
    (
        "[[triangles]]\nvertices = [[0, 0, 0], [1, 0, 0]]\n",
        "1: 2 vertices without indices do not make whole triangles",
        "three vertices",
    ),
    (
        "\n[[triangles]]\nvertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nindices = [[0, 1, 3]]\n",
        "2: index 3 is out of range: there are 3 vertices, counted from 0",
        "correct `indices`",
    ),
    (
        "\n[[mesh]]\nfile = 'b.toml'\n",
        "2: `b.toml` is not a mesh",
        "name a mesh: .obj, .gltf, .glb, .ply, .stl, .off or .3mf",
    ),
    ("[[mesh]]\nfile = 'a.obj'\ntranslate = [0, 0, nan]\n", "1: `translate` holds NaN", "finite"),
    ("[[mesh]]\nfile = 'a.obj'\nrotate = [inf, 0, 0]\n", "1: `rotate` holds inf", "finite"),
    ("[[mesh]]\nfile = 'a.obj'\nscale = inf\n", "1: `scale` holds inf", "finite"),
    ("[[mesh]]\nfile = 'a.obj'\nscale = [1, 0, 1]\n", "1: `scale` is 0", "give other factors"),
    ("\n[[mesh]]\nfile = 'gone.obj'\n", "2: mesh FOLDER/gone.obj: no such file", "check the name"),
    ("[[mesh]]\nfile = 'a.3ds'\n", "1: mesh FOLDER/a.3ds: not a kind of file that kiln reads", "convert"),
    ("[[mesh]]\nfile = 'a.obj'\nmaterial = 'red'\n", "1: there is no material `red`", "add [material.red]"),
];

#[test]
fn scene_file_faults_have_their_line_and_advice() {
    let folder = Folder::new();
    folder.write("a.obj", format!("{OBJ_TRIANGLE}f 1 2 3\n"));
    folder.write("a.3ds", "MM");
    let path = folder.0.path().display().to_string();
    let mut wrong = Vec::new();
    for (text, expected, hint) in FAULTS {
        let e = folder.fails("a.toml", text);
        let said = e.to_string().replace(&path, "FOLDER");
        if !said.starts_with(&format!("FOLDER/a.toml:{expected}")) || !e.hint().contains(hint) {
            wrong.push(format!("{text}  said {said}\n  hint {}\n  not  {expected} | {hint}", e.hint()));
        }
        assert_eq!(said.lines().count(), 1, "{said}");
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn faults_in_a_mesh_of_a_scene_file_name_the_place_in_the_mesh() {
    let folder = Folder::new();
    folder.write("bad.obj", format!("{OBJ_TRIANGLE}f 1 2 x\n"));
    let e = folder.fails("a.toml", "[[mesh]]\nfile = 'bad.obj'\n");
    assert_eq!(message(&e), "bad.obj:4: corner 3 of `f` is not v, v/vt, v//vn or v/vt/vn");
}

/// Names in hints are sorted. The order of a hash map would differ from run to run, and from map to map.
#[test]
fn hints_list_materials_in_order() {
    let folder = Folder::new();
    let materials =
        ["pear", "kiwi", "fig", "apple"].map(|name| format!("[material.{name}]\ncolour = '#ff0000'\n"));
    let sphere = "[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\nmaterial = 'zzz'\n";
    for _ in 0..8 {
        let e = folder.fails("a.toml", materials.concat() + sphere);
        assert_eq!(e.hint(), "known here: apple, fig, kiwi, pear");
    }
}

#[test]
fn a_spot_of_a_scene_file() {
    let folder = Folder::new();
    let spot = |text: &str| {
        let (scene, _) =
            folder.load("a.toml", format!("[[light]]\ntype = 'spot'\nposition = [1, 5, 2]\n{text}"));
        scene.lights[0].clone()
    };
    // From (1, 5, 2) to (1, 2, 6): (0, -3, 4) / 5.
    let light = spot("look_at = [1, 2, 6]\ninner_cone_angle = 30\nouter_cone_angle = 60\nintensity = 2\n");
    let LightKind::Spot { position, direction, falloff, inner_angle, outer_angle } = light.kind else {
        panic!("{light:?}")
    };
    assert_eq!((position, falloff, light.intensity), (DVec3::new(1.0, 5.0, 2.0), Falloff::None, 2.0));
    assert!((direction - DVec3::new(0.0, -0.6, 0.8)).length() < 1e-15, "{direction}");
    assert_eq!((inner_angle, outer_angle), (30f64.to_radians(), 60f64.to_radians()));
    let light = spot("direction = [0, -1e-300, 0]\nfalloff = 'inverse-square'\ncolour = '#ff0000'\n");
    let LightKind::Spot { direction, falloff, inner_angle, outer_angle, .. } = light.kind else {
        panic!("{light:?}")
    };
    assert_eq!((direction, falloff), (-DVec3::Y, Falloff::InverseSquare { range: None }));
    assert_eq!((inner_angle, outer_angle), (0.0, 45f64.to_radians()));
}

#[test]
fn lights_with_a_size_of_a_scene_file() {
    let text = "[[light]]\ntype = 'directional'\ndirection = [0, -2, 0]\nangle = 0.5\n\
        [[light]]\ntype = 'sphere'\nposition = [1, 2, 3]\nradius = 0.25\n\
        [[light]]\ntype = 'rectangle'\nposition = [0, 3, 0]\nlook_at = [4, 0, 0]\nsize = [2, 1]\n\
        [[light]]\ntype = 'disk'\nposition = [0, 3, 0]\ndirection = [0, -7, 0]\nradius = 0.5\n";
    let (scene, warnings) = Folder::new().load("a.toml", text);
    assert_eq!(warnings, [""; 0]);
    let kinds: Vec<&LightKind> = scene.lights.iter().map(|light| &light.kind).collect();
    let [sun, ball, panel, disk] = kinds[..] else { panic!("{kinds:?}") };
    assert_eq!(*sun, LightKind::Directional { direction: -DVec3::Y, angle: 0.5f64.to_radians() });
    assert_eq!(*ball, LightKind::Sphere { position: DVec3::new(1.0, 2.0, 3.0), radius: 0.25 });
    let LightKind::Rectangle { position, direction, up, size } = *panel else { panic!("{panel:?}") };
    assert_eq!((position, up, size), (DVec3::Y * 3.0, DVec3::Y, [2.0, 1.0]));
    assert!((direction - DVec3::new(0.8, -0.6, 0.0)).length() < 1e-15, "{direction}");
    let position = DVec3::Y * 3.0;
    assert_eq!(*disk, LightKind::Disk { position, direction: DVec3::NEG_Y, radius: 0.5 });
    // They are ignored when a camera is fitted.
    assert_eq!(scene.bounds(), None);
}

/// A scene file passes on the variants of its meshes, so that one can be chosen.
#[test]
fn variants_of_meshes_of_scene_files_can_be_chosen() {
    let folder = Folder::new();
    let mut model = Model::triangle();
    model.json["extensionsUsed"] = json!(["KHR_materials_variants"]);
    model.json["extensions"] = json!({ "KHR_materials_variants": { "variants": [{ "name": "red" }] } });
    model.json["materials"] = json!([{ "name": "plain" }, { "name": "painted" }]);
    let mappings = json!({ "KHR_materials_variants": { "mappings": [{ "material": 1, "variants": [0] }] } });
    model.primitive()["material"] = json!(0);
    model.primitive()["extensions"] = mappings;
    folder.write("a.gltf", model.text());
    let file = folder.write("a.toml", "[[mesh]]\nfile = 'a.gltf'\n");
    let options = kiln::scene::ImportOptions { variant: Some("red".into()), ..Default::default() };
    let scene = kiln::import::load_with(&[file], &options, &mut Warnings::default()).expect("a scene");
    assert_eq!(scene.materials[scene.objects[0].material.0 as usize].name(), "painted");
}

/// `color` is `colour` in every key and in inline tables, but not in names that the user chose; `fov` is `vertical_fov`.
#[test]
fn keys_have_a_second_spelling() {
    let file = |key: &str| {
        format!(
            "[image]\nbackground = 'red'\n[environment]\n{key} = 'blue'\n[[light]]\ntype = 'point'\nposition = [0, 9, 0]\n\
             {key} = 'green'\n[material.\"my-color\"]\n{key} = [1, 2, 3]\nroughness = 1\n\
             layers = {{ sheen_{key} = 'red', specular_{key} = 'gold' }}\n\
             [[sphere]]\ncentre = [0, 0, 0]\nradius = 1\nmaterial = 'my-color'\n"
        )
    };
    let [british, american] =
        ["colour", "color"].map(|key| Folder::new().load("a.toml", file(key).as_bytes()));
    let text = |scene: &Scene| {
        let Scene { materials, lights, environment, picture, .. } = scene;
        format!("{materials:?} {lights:?} {environment:?} {:?}", picture.background)
    };
    assert_eq!(text(&british.0), text(&american.0));
    let camera = |key: &str| {
        let file = format!("[[camera]]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\n{key} = 20\n");
        Folder::new().load("a.toml", file.as_bytes()).0.cameras[0].clone()
    };
    assert_eq!(camera("fov"), camera("vertical_fov"));
}

/// Whole numbers 0 and 1 are a colour from 0 to 255 all the same, and a note says that it is dark.
#[test]
fn colours_from_0_to_1_are_noted() {
    let notes = |colour: &str| {
        let folder = Folder::new();
        let file = folder.write("a.toml", format!("[material.a]\ncolour = {colour}\n"));
        let mut warnings = Warnings::default();
        kiln::import::load(&[file], &mut warnings).expect("a scene");
        warnings.notes().to_vec()
    };
    let said = notes("[1, 0, 1]");
    assert!(
        said[0]
            .ends_with("a.toml:2: a colour in numbers from 0 to 1 is nearly black: white is [255, 255, 255]"),
        "{said:?}"
    );
    for colour in ["[0, 0, 0]", "[1, 2, 0]", "'#010101'", "[255, 255, 0]"] {
        assert_eq!(notes(colour), [""; 0], "{colour}");
    }
}
