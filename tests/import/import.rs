//! Import: the scenes of OBJ, glTF, PLY, STL and scene files, and the errors and warnings of unusual or broken ones.
//!
//! Fixtures are in `assets/import`; files with unusual bytes are written by the tests.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use crate::common::borders::Folder;
use crate::common::gltf::{FLOAT, Model, UNSIGNED_SHORT, data_uri, png};
use crate::common::{self, repository};
use glam::{DVec2, DVec3};
use kiln::bvh::Layout;
use kiln::effects::{Choices, Plan};
use kiln::error::{Error, Warnings};
use kiln::film::{Colour, ColourPipeline, Window};
use kiln::render::{RenderControl, render};
use kiln::scene::Numerics;
use kiln::scene::{
    Camera, Degrees, Falloff, Focus, ImportOptions, Interpolation, Lens, LightKind, Material, Mesh, Minify,
    Projection, ReadingOptions, Scene, Shape, Wrap,
};
use kiln::shading::ShadingMode;
use kiln::world::{View, World};
use serde_json::{Value, json};

/// The message of an error, with the file name without its folder.
fn message(e: &Error) -> String {
    let text = e.to_string();
    match text.split_once(": ") {
        Some((place, rest)) => format!("{}: {rest}", Path::new(place).file_name().unwrap().to_string_lossy()),
        None => text,
    }
}

/// The scene of a file, and the warnings, with file names without their folder.
fn load(file: &Path) -> (Scene, Vec<String>) {
    let mut warnings = Warnings::default();
    let scene = kiln::import::load(&[file.to_owned()], &mut warnings)
        .unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let folder = format!("{}/", file.parent().expect("files lie in folders").display());
    (scene, warnings.messages().iter().map(|m| m.replace(&folder, "")).collect())
}

fn fixture(name: &str) -> (Scene, Vec<String>) {
    load(&repository("assets/import").join(name))
}

fn mesh(scene: &Scene, object: usize) -> &Mesh {
    match &scene.objects[object].shape {
        Shape::Mesh(mesh) => mesh,
        Shape::Placed(placed) => &placed.mesh,
        Shape::Analytic(_) => panic!("object {object} is a sphere"),
    }
}

fn triangles(mesh: &Mesh) -> Vec<[DVec3; 3]> {
    mesh.triangles.iter().map(|t| t.map(|i| mesh.positions[i as usize])).collect()
}

/// Unit normals at the corners of each triangle; zero where there is no vertex normal.
fn normals(mesh: &Mesh) -> Vec<[DVec3; 3]> {
    let normals = mesh.normals.as_ref().expect("the mesh has normals");
    let indices = normals.triangles.as_ref().unwrap_or(&mesh.triangles);
    indices
        .iter()
        .map(|t| t.map(|i| normals.values[i as usize].try_normalize().unwrap_or(DVec3::ZERO)))
        .collect()
}

fn area(triangles: &[[DVec3; 3]]) -> f64 {
    triangles.iter().map(|[a, b, c]| (*b - *a).cross(*c - *a).length() / 2.0).sum()
}

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// Asserts equality up to a few rounding errors of f32, the precision of the files, for numbers of about 1.
#[track_caller]
fn assert_near(a: DVec3, b: DVec3) {
    assert!((a - b).abs().max_element() <= 1e-6, "{a} is not {b}");
}

/// The albedo that an orthographic camera along -z sees in the rectangle from `min` to `max`, row by row from the top.
fn seen(scene: Scene, min: [f64; 2], max: [f64; 2], size: [u32; 2]) -> Vec<[u8; 3]> {
    let middle = v((min[0] + max[0]) / 2.0, (min[1] + max[1]) / 2.0, 0.0);
    let camera = Camera {
        name: "test".into(),
        position: middle + v(0.0, 0.0, 100.0),
        target: middle,
        up: DVec3::Y,
        projection: Projection::Orthographic,
        view_height: max[1] - min[1],
        view_width: Some(max[0] - min[0]),
        viewpoint_distance: 100.0,
        lens: None,
    };
    let pipeline = ColourPipeline::Display;
    let world = World::prepare(scene, pipeline, Layout::default(), Numerics::default());
    let choices = Choices { shading: ShadingMode::Flat, ..Choices::default() };
    let plan = Plan::new(&world, &choices).expect("no effect is asked for");
    let view = View::new(&camera, Projection::Orthographic, size).expect("the camera has a direction");
    let window = Window { x: 0, y: 0, width: size[0], height: size[1] };
    let control = RenderControl { cancel: &AtomicBool::new(false), progress: &|_, _| {}, time_stages: false };
    let (film, _) = render(&world, &view, &plan, window, |_, _| true, &control).expect("nobody interrupts");
    film.to_rgb8(pipeline).chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()
}

// ---------------------------------------------------------------------------------------------------------------- OBJ

#[test]
fn obj_materials_pictures_and_usemtl() {
    let (scene, warnings) = fixture("materials.obj");
    assert_eq!(warnings, [""; 0]);
    // One object for each run of faces of one material: none, textured, red, textured.
    let names: Vec<&str> =
        scene.objects.iter().map(|o| scene.materials[o.material.0 as usize].name()).collect();
    assert_eq!(names, ["default", "pictured", "red", "pictured"]);
    let counts: Vec<usize> = scene.objects.iter().map(|o| o.shape.primitive_count()).collect();
    assert_eq!(counts, [1, 2, 2, 1]);
    let phong = |object: usize| match &scene.materials[scene.objects[object].material.0 as usize] {
        Material::Phong(m) => m.clone(),
        other => panic!("{other:?}"),
    };
    // k_s is the largest of Ks; k_a = k_d = 1.
    let pictured = phong(1);
    assert_eq!(pictured.colour, Colour::Display(DVec3::ONE));
    let (specular, shininess) = (pictured.specular, pictured.shininess);
    assert_eq!((pictured.ambient, pictured.diffuse, specular, shininess), (1.0, 1.0, 0.3, 32.0));
    assert!(pictured.texture.is_some() && pictured.glaze.is_none());
    let red = phong(2);
    assert_eq!(red.colour, Colour::Display(v(0.5, 0.25, 0.0)));
    assert_eq!((red.specular, red.shininess, red.texture), (0.0, 10.0, None));
    // The default material is grey, 204 of 255.
    assert_eq!(phong(0).colour, Colour::from_u8([204; 3]));
}

#[test]
fn obj_pictures_stand_upright() {
    let (mut scene, _) = fixture("materials.obj");
    let image = &scene.images[0];
    assert_eq!((image.width, image.height), (2, 2));
    let texels = [[255u8, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]];
    assert_eq!(image.pixels, texels.into_iter().collect());
    // vt 0 0 is the lower left corner of the texture, (0, 1) if v is counted from the top.
    let uvs = &mesh(&scene, 1).uvs[0];
    let first = uvs.triangles.as_ref().unwrap_or(&mesh(&scene, 1).triangles)[0][0];
    assert_eq!(uvs.values[first as usize], DVec2::new(0.0, 1.0));
    // Four pixels over the unit square: each ray hits the centre of a texel, so that bilinear interpolation returns its
    // colour.
    scene.objects.remove(0);
    scene.objects.truncate(2);
    let picture = seen(scene.clone(), [0.0, 0.0], [1.0, 1.0], [2, 2]);
    assert_eq!(picture, [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]]);
    // The untextured square beside it: 0.5 * 255 = 127.5 rounds up to 128, 0.25 * 255 = 63.75 to 64.
    assert_eq!(seen(scene, [1.0, 0.0], [2.0, 1.0], [1, 1]), [[128, 64, 0]]);
}

#[test]
fn obj_concave_polygons_keep_their_area_and_negative_indices_count_back() {
    let (scene, warnings) = fixture("l.obj");
    assert_eq!(warnings, [""; 0]);
    let all = triangles(mesh(&scene, 0));
    // A hexagon has 4 triangles, an arrow head 2. The area of the L is 3 sqrt(2), that of the arrow head 6 - 2. A fan
    // from the first corner would have a larger area in both cases.
    assert_eq!((scene.objects.len(), all.len()), (1, 6));
    assert!((area(&all[..4]) - 3.0 * 2f64.sqrt()).abs() < 1e-12, "{}", area(&all[..4]));
    assert!((area(&all[4..]) - 4.0).abs() < 1e-12, "{}", area(&all[4..]));
}

#[test]
fn obj_bow_ties_are_drawn_and_said() {
    let text = "v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 1 0\nf 1 2 3 4\n";
    let (scene, warnings) = Folder::new().load("tie.obj", text);
    assert_eq!(scene.primitive_count(), 2);
    assert_eq!(warnings, ["tie.obj: 1 polygon(s) cross themselves and were cut into fans"]);
}

#[test]
fn obj_normals_are_taken_where_given_and_left_to_the_triangle_where_not() {
    let folder = Folder::new();
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    let (scene, _) = folder.load("none.obj", format!("{square}f 1 2 3 4\n"));
    assert!(mesh(&scene, 0).normals.is_none());
    let (scene, _) = folder.load("given.obj", format!("{square}vn 0 0 2\nvn 0.6 0 0.8\nf 1//1 2//2 3//-1\n"));
    assert_eq!(normals(mesh(&scene, 0)), [[DVec3::Z, v(0.6, 0.0, 0.8), v(0.6, 0.0, 0.8)]]);
}

#[test]
fn obj_faces_without_normals_among_faces_with_them_use_their_own() {
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0.6 0 0.8\nvn 0 0.6 0.8\n";
    let (bent, own) = (v(0.6, 0.0, 0.8), DVec3::ZERO);
    let folder = Folder::new();
    let (scene, _) = folder.load("after.obj", format!("{square}f 1//1 2//1 3//1\nf 1 3 4\n"));
    assert_eq!(normals(mesh(&scene, 0)), [[bent; 3], [own; 3]]);
    let (scene, _) = folder.load("before.obj", format!("{square}f 1 3 4\nf 1 2 3 4\nf 1//1 2//1 3//1\n"));
    assert_eq!(normals(mesh(&scene, 0)), [[own; 3], [own; 3], [own; 3], [bent; 3]]);
    // Lines are not faces, and vertex indices continue from object to object.
    let lines = "l 1 2\nl 1 2 3\nl 1 2 3 4\np 1 2 3\n";
    let (scene, warnings) =
        folder.load("objects.obj", format!("{square}f 1 2 3\n{lines}o b\nf 1//1 2//1 3//1\nf 1 2 3\n"));
    assert_eq!(normals(mesh(&scene, 1)), [[bent; 3], [own; 3]]);
    assert_eq!((mesh(&scene, 0).triangles.len(), scene.primitive_count()), (1, 3));
    assert_eq!(warnings, ["objects.obj: points and lines are not drawn"]);
}

#[test]
fn obj_vertex_colours_on_all_or_some_vertices() {
    let folder = Folder::new();
    let colours = |scene: &Scene| {
        let mesh = mesh(scene, 0);
        let colours = mesh.colours.as_ref().expect("the mesh has colours");
        assert!(colours.triangles.is_none());
        mesh.triangles[0].map(|i| colours.values[i as usize])
    };
    let (scene, _) = folder.load("all.obj", "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 0.5\nf 1 2 3\n");
    // The sRGB transfer function at 0.5: ((0.5 + 0.055) / 1.055)^2.4 = 0.214041.
    let [a, b, c] = colours(&scene);
    assert_eq!((a, b), (DVec3::X, DVec3::Y));
    assert_near(c, v(0.0, 0.0, 0.214_041));
    // White where a vertex has no colour.
    let (scene, warnings) = folder.load("some.obj", "v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0 0 0 1\nf 1 2 3\n");
    assert_eq!(colours(&scene), [DVec3::X, DVec3::ONE, DVec3::Z]);
    assert_eq!(warnings, [""; 0]);
}

/// The triangle of each of the unusual but valid files below.
const TRIANGLE: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

#[test]
fn obj_files_that_are_odd_in_their_bytes() {
    let odd: [(&str, &[u8]); 9] = [
        ("a byte order mark", b"\xEF\xBB\xBFv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("CRLF", b"v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n"),
        ("tabs", b"v\t0\t0\t0\nv\t1 0 0\nv 0  1\t0\nf\t1\t2\t3\n"),
        ("a continued line", b"v 0 0 0\nv 1 \\\n0 0\nv 0 1 0\nf 1 2 \\\n3\n"),
        ("a continued line in CRLF", b"v 0 0 0\r\nv 1 \\\r\n0 0\r\nv 0 1 0\r\nf 1 2 \\\r\n3\r\n"),
        ("comments behind faces", b"v 0 0 0 # origin\nv 1 0 0\nv 0 1 0\nf 1 2 3 # the one\n"),
        ("Latin-1 in a comment", b"# gr\xFCn\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("no end to the last line", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3"),
        ("leading spaces", b"  v 0 0 0\n v 1 0 0\n\tv 0 1 0\n   f 1 2 3\n"),
    ];
    for (what, bytes) in odd {
        let (scene, warnings) = Folder::new().load("odd.obj", bytes);
        assert_eq!(scene.primitive_count(), 1, "{what}");
        assert_eq!(triangles(mesh(&scene, 0)), [TRIANGLE], "{what}");
        assert_eq!(warnings, [""; 0], "{what}");
    }
    // UTF-16 in both byte orders, UTF-8 and Latin-1.
    let text = "o gr\u{fc}n\nv 0 0 0\r\nv 1 0 0\nv 0 1 0\nf 1 2 3";
    let units = |bytes: fn(u16) -> [u8; 2]| -> Vec<u8> {
        "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(bytes).collect()
    };
    let latin: Vec<u8> = text.chars().map(|c| u32::from(c) as u8).collect();
    for bytes in [units(u16::to_le_bytes), units(u16::to_be_bytes), latin, format!("\u{feff}{text}").into()] {
        let (scene, warnings) = Folder::new().load("odd.obj", bytes);
        assert_eq!((scene.objects[0].name.as_str(), warnings), ("gr\u{fc}n", vec![]));
        assert_eq!(triangles(mesh(&scene, 0)), [TRIANGLE]);
    }
}

#[test]
fn obj_names_behind_tabs_and_spaces() {
    let folder = Folder::new();
    folder.write("my colours.mtl", "newmtl\tdark red\r\nKd\t0.5 0 0\r\n");
    let text = "mtllib\tmy colours.mtl\r\nv 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nusemtl\tdark red\r\nf 1 2 3\r\n";
    let (scene, warnings) = folder.load("tabs.obj", text);
    assert_eq!(warnings, [""; 0]);
    let material = &scene.materials[scene.objects[0].material.0 as usize];
    assert_eq!(material.name(), "dark red");
}

const OBJ_TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

#[test]
fn obj_without_its_mtl_is_grey_and_says_which_file_is_missing() {
    let folder = Folder::new();
    let (scene, warnings) = folder.load("a.obj", format!("mtllib gone.mtl\n{OBJ_TRIANGLE}f 1 2 3\n"));
    assert_eq!(warnings, ["a.obj: materials left out: gone.mtl: no such file"]);
    let Material::Phong(material) = &scene.materials[0] else { panic!("{:?}", scene.materials) };
    assert_eq!(material.colour, Colour::from_u8([204; 3]));
}

#[test]
fn obj_with_an_unknown_material_is_grey_and_says_which() {
    let folder = Folder::new();
    folder.write("a.mtl", "newmtl red\nKd 1 0 0\n");
    let text = format!("mtllib a.mtl\n{OBJ_TRIANGLE}usemtl red\nf 1 2 3\nusemtl rad\nf 1 2 3\nf 1 2 3\n");
    let (scene, warnings) = folder.load("a.obj", text);
    assert_eq!(warnings, ["a.obj: material `rad` is not defined; drawn in grey"]);
    let names: Vec<&str> =
        scene.objects.iter().map(|o| scene.materials[o.material.0 as usize].name()).collect();
    assert_eq!(names, ["red", "default"]);
}

#[test]
fn obj_without_its_picture_keeps_its_geometry_and_colour() {
    let folder = Folder::new();
    folder.write("damaged.png", b"\x89PNG\r\n\x1a\nnot really");
    folder.write("a.mtl", "newmtl a\nKd 1 0 0\nmap_Kd gone.png\nnewmtl b\nKd 0 1 0\nmap_Kd damaged.png\n");
    let text = format!("mtllib a.mtl\n{OBJ_TRIANGLE}usemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\n");
    let (scene, warnings) = folder.load("a.obj", text);
    assert_eq!(scene.primitive_count(), 2);
    assert_eq!(warnings[0], "gone.png: texture left out: no such file");
    assert!(warnings[1].starts_with("damaged.png: texture left out: "), "{warnings:?}");
    let Material::Phong(material) = &scene.materials[0] else { panic!("{:?}", scene.materials) };
    assert_eq!((material.colour, material.texture), (Colour::Display(DVec3::X), None));
}

#[test]
fn obj_pictures_lie_beside_the_mtl_or_beside_the_obj() {
    let folder = Folder::new();
    let png = std::fs::read(repository("assets/import/four.png")).expect("the fixture is there");
    std::fs::create_dir(folder.0.path().join("sub")).expect("a folder can be made");
    folder.write("sub/a.mtl", "newmtl a\nmap_Kd one.png\nnewmtl b\nmap_Kd two.png\n");
    folder.write("sub/one.png", &png);
    folder.write("two.png", &png);
    let (scene, warnings) =
        folder.load("a.obj", format!("mtllib sub\\a.mtl\n{OBJ_TRIANGLE}vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n"));
    assert_eq!((scene.images.len(), warnings), (2, vec![]));
}

/// Blender's export of a Principled BSDF with "PBR extensions": values are linear, a map replaces its number, and `Tf`
/// is the weight of the transmission. Grey maps of roughness and metallic become the green and blue channel of one
/// image of the larger size.
#[test]
fn mtl_of_physically_based_materials() {
    let folder = Folder::new();
    let grey = |name: &str, width, value| {
        let image = image::GrayImage::from_pixel(width, 1, image::Luma([value]));
        image.save(folder.0.path().join(name)).expect("a file");
    };
    grey("r.png", 2, 60);
    grey("m.png", 1, 90);
    grey("e.png", 1, 30);
    let mtl = "newmtl numbers\nKd 0.5 0.25 0.125\nKs 0.5 0.5 0.5\nKe 2 0 0\nNi 1.45\nd 1\nillum 2\nPr 0.3\nPm 0.75\nPs 0.2\n\
        Pc 0.6\nPcr 0.05\naniso 0\nTf 0.9 0.9 0.9\n\
        newmtl maps\nKd 0.8 0.8 0.8\nNi 1\nmap_Pr r.png\nmap_Pm m.png\nmap_Ke e.png\n\
        newmtl one\nKd 1 1 1\nPm 0.5\nmap_Pr r.png\n";
    folder.write("a.mtl", mtl);
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl numbers\nf 1/1 2/1 3/1\n";
    let (scene, warnings) = folder.load("a.obj", format!("mtllib a.mtl\n{corners}"));
    assert_eq!(warnings, [""; 0]);
    let material = |index: usize| match &scene.materials[index] {
        Material::MetallicRoughness(material) => material,
        Material::Phong(phong) => panic!("{phong:?}"),
    };
    let linear = |r, g, b| Colour::Linear(v(r, g, b));
    let numbers = material(0);
    assert_eq!((numbers.base_colour, numbers.emission), (linear(0.5, 0.25, 0.125), linear(2.0, 0.0, 0.0)));
    assert_eq!((numbers.metallic, numbers.roughness), (0.75, 0.3));
    let layers = &numbers.layers;
    assert_eq!((layers.ior, layers.clearcoat, layers.clearcoat_roughness), (1.45, 0.6, 0.05));
    assert_eq!((layers.sheen_colour, layers.sheen_roughness), (linear(0.2, 0.2, 0.2), 0.5));
    assert!((layers.transmission - 0.9).abs() < 1e-15 && layers.volume.is_some());
    let maps = material(1);
    assert_eq!((maps.metallic, maps.roughness, maps.emission), (1.0, 1.0, linear(1.0, 1.0, 1.0)));
    // An index of 1 on an opaque surface is ignored.
    assert_eq!((maps.layers.ior, maps.layers.transmission), (1.5, 0.0));
    let pixels = |texture: Option<kiln::scene::Texture>| {
        scene.images[texture.expect("a texture").image.0 as usize].pixels.iter().collect::<Vec<_>>()
    };
    assert_eq!(pixels(maps.metallic_roughness_texture), [[255, 60, 90]; 2]);
    assert_eq!(pixels(maps.emission_texture), [[30; 3]]);
    assert_eq!(pixels(material(2).metallic_roughness_texture), [[255, 60, 255]; 2]);
    assert_eq!((material(2).metallic, material(2).roughness), (0.5, 1.0));
}

/// `illum` 4, 6, 7 and 9 are glass if the index is above 1. For materials that are not glass, Maya writes `illum 4`
/// with an index of 1, and Blender `illum 9` with `d` below 1 and without `Tf`.
#[test]
fn mtl_of_glass() {
    for (lines, glass) in [
        ("illum 7\nNi 1.5\nTf 0.9 0.8 0.7", Some((1.5, [0.9, 0.8, 0.7]))),
        ("illum 4\nNi 1.33", Some((1.33, [1.0; 3]))),
        ("illum 6\nNi 1.5\nd 0.1\nTf 1 1 1", Some((1.5, [1.0; 3]))),
        ("illum 9\nNi 1.45\nd 0.5", None),
        ("illum 4\nNi 1\nTf 1 1 1", None),
        ("illum 7\nNi 1.5\nTf 0 0 0", None),
        ("illum 2\nNi 1.5\nTf 1 1 1", None),
        ("illum 7", None),
    ] {
        let folder = Folder::new();
        folder.write("a.mtl", format!("newmtl a\nKd 1 0 0\n{lines}\n"));
        let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n";
        let (scene, _) = folder.load("a.obj", format!("mtllib a.mtl\n{corners}"));
        let Material::Phong(phong) = &scene.materials[0] else { panic!("{lines}") };
        let found = phong.refraction.map(|glass| (glass.ior, glass.filter));
        assert_eq!(found, glass.map(|(ior, filter)| (ior, Colour::Linear(filter.into()))), "{lines}");
    }
}

/// `-s 2 0.5 -o 0.25 -1` takes the coordinates (0.5, 0.5) to (1.25, -0.75), which is 1.75 from the top. `-clamp on` holds
/// the edge of the picture; `-bm` scales the slopes of a bump map.
#[test]
fn mtl_options_of_maps() {
    let folder = Folder::new();
    folder.write(
        "four.png",
        std::fs::read(repository("assets/import/four.png")).expect("the fixture is there"),
    );
    let bump = image::GrayImage::from_fn(4, 4, |x, _| image::Luma([60 * x as u8]));
    bump.save(folder.0.path().join("bump.png")).expect("a file");
    let mtl = "newmtl moved\nmap_Kd -clamp on -s 2 0.5 -o 0.25 -1 four.png\nmap_bump -bm 3 -s 2 0.5 -o 0.25 -1 bump.png\n\
        newmtl plain\nmap_Kd -mm 0.1 1 four.png\nbump bump.png\nmap_d -s 2 four.png\nmap_Ks four.png\nrefl -type sphere a.png\n";
    folder.write("a.mtl", mtl);
    let faces = "vt 0.5 0.5\nusemtl moved\nf 1/1 2/1 3/1\nusemtl plain\nf 1/1 2/1 3/1\n";
    let obj = format!("mtllib a.mtl\n{OBJ_TRIANGLE}{faces}");
    let (scene, warnings) = folder.load("a.obj", &obj);
    assert_eq!(
        warnings,
        [
            "a.mtl:5: the option -mm of `map_Kd` is left out",
            "a.obj: material `plain` has maps of several -s or -o; drawn with those of the first",
        ]
    );
    let uvs = |object| mesh(&scene, object).uvs[0].values.clone();
    assert_eq!((uvs(0), uvs(1)), (vec![DVec2::new(1.25, 1.75)], vec![DVec2::new(0.5, 0.5)]));
    let phong = |object: usize| match &scene.materials[scene.objects[object].material.0 as usize] {
        Material::Phong(phong) => phong,
        other => panic!("{other:?}"),
    };
    let wrap = |object| phong(object).texture.expect("a texture").sampler.wrap_u;
    assert_eq!((wrap(0), wrap(1)), (Wrap::ClampToEdge, Wrap::Repeat));
    let slope = |object| phong(object).normal_map.expect("a normal map").scale;
    assert_eq!(slope(0), 3.0 * slope(1));
    let mut warnings = Warnings::default();
    let file = folder.0.path().join("a.obj");
    kiln::import::load(&[file], &mut warnings).expect("it was read before");
    assert!(
        warnings.notes().iter().any(|note| note.ends_with("a.mtl: not used: map_Ks, refl")),
        "{warnings:?}"
    );
}

#[test]
fn mtl_files_in_one_line_in_any_encoding() {
    let folder = Folder::new();
    folder.write("a.mtl", b"newmtl gr\xFCn\nKd 0 1 0\n");
    let utf16 = |text: &str| text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
    folder.write("b.mtl", utf16("\u{feff}newmtl rot\r\nKd 1 0 0\r\n"));
    folder.write("c d.mtl", "newmtl blau\nKd 0 0 1\n");
    let faces = "usemtl gr\u{fc}n\nf 1 2 3\nusemtl rot\nf 1 2 3\nusemtl blau\nf 1 2 3\n";
    let (scene, warnings) =
        folder.load("a.obj", format!("mtllib a.mtl  b.mtl\nmtllib c d.mtl\n{OBJ_TRIANGLE}{faces}"));
    assert_eq!(warnings, [""; 0]);
    let colour = |object: &kiln::scene::Object| match &scene.materials[object.material.0 as usize] {
        Material::Phong(phong) => phong.colour,
        other => panic!("{other:?}"),
    };
    let colours: Vec<Colour> = scene.objects.iter().map(colour).collect();
    assert_eq!(colours, [DVec3::Y, DVec3::X, DVec3::Z].map(Colour::Display));
    // Without any file, every name is unknown.
    let (scene, warnings) = folder.load("b.obj", format!("{OBJ_TRIANGLE}usemtl rot\nf 1 2 3\n"));
    assert_eq!(
        (scene.primitive_count(), warnings),
        (1, vec!["b.obj: material `rot` is not defined; drawn in grey".into()])
    );
}

#[test]
fn mtl_lines_that_others_stumble_over() {
    let folder = Folder::new();
    // One number is the value of all three channels (MTL text, "Kd r g b": g and b are optional).
    folder.write(
        "a.mtl",
        "newmtl a\nKd 0.5\nKs xyz 1 1\nNs 20 # dull\nKe nan 0 0\nKa spectral f.rfl\nd -halo 0.25\n",
    );
    let (scene, warnings) = folder.load("a.obj", format!("mtllib a.mtl\n{OBJ_TRIANGLE}usemtl a\nf 1 2 3\n"));
    let Material::Phong(material) = &scene.materials[0] else { panic!("{:?}", scene.materials) };
    assert_eq!(material.colour, Colour::Display(DVec3::splat(0.5)));
    assert_eq!((material.specular, material.shininess), (0.0, 20.0));
    assert_eq!(material.opacity.map(|opacity| opacity.factor), Some(0.25));
    assert_eq!(
        warnings,
        [
            "a.mtl:3: `Ks` left out: an invalid value",
            "a.mtl:5: `Ke` left out: an invalid value",
            "a.mtl:6: `Ka` left out: an invalid value",
            "a.mtl:7: the option -halo of `d` is left out",
        ]
    );
}

#[test]
fn a_bad_mtl_line_loses_only_itself() {
    let folder = Folder::new();
    folder.write("a.mtl", "newmtl a\nKd 1 0 0\nmap_Kd\nmap_Ns\nnewmtl b\nKd 0 1 0\nnewmtl\n");
    let obj = format!("mtllib a.mtl\n{OBJ_TRIANGLE}usemtl a\nf 1 2 3\nusemtl\nusemtl b\nf 1 2 3\n");
    let (scene, warnings) = folder.load("a.obj", obj);
    let names: Vec<&str> = scene.materials.iter().map(Material::name).collect();
    assert_eq!(names, ["a", "b"]);
    assert_eq!(warnings.len(), 3, "{warnings:?}");
    assert_eq!(warnings[0], "a.mtl:3: `map_Kd` left out: an invalid value");
}

#[test]
fn obj_triangles_that_cannot_be_drawn_are_counted() {
    // Faces 2 and 3 have a vertex that is not finite, face 6 one beyond 1e18, and face 5 has two equal corners, which
    // is reported by a note. Face 4 (collinear) is kept.
    let text = format!(
        "{OBJ_TRIANGLE}v nan 0 0\nv 0 inf 0\nv 2 0 0\nv 1e19 0 0\n\
         f 1 2 3\nf 1 2 4\nf 1 2 5\nf 1 2 6\nf 1 2 2\nf 1 3 7\n"
    );
    let (scene, warnings) = Folder::new().load("a.obj", text);
    assert_eq!(triangles(mesh(&scene, 0))[0], TRIANGLE);
    assert_eq!(scene.primitive_count(), 2);
    assert_eq!(
        warnings,
        [
            "a.obj: left out 2 triangle(s) with a vertex that is not a finite number",
            "a.obj: left out 1 primitive(s) with a coordinate beyond 1e18",
        ]
    );
}

#[test]
fn obj_faults_name_their_line() {
    // Three vertices on lines 1 to 3; the error is on line 4, or on line 5 after a continued line.
    for (rest, expected) in [
        ("# \nf 1 x 3\n", "a.obj:5: corner 2 of `f` is not v, v/vt, v//vn or v/vt/vn"),
        ("v 1\n", "a.obj:4: `v` with 1 of 2 numbers"),
        ("v 1 2 1.0D+00\nf 1 2 3\n", "a.obj:4: number 3 of `v` cannot be read"),
        ("v 1 2 +-\n", "a.obj:4: number 3 of `v` cannot be read"),
        ("v 1 2 3 1 red 0\n", "a.obj:4: number 5 of `v` cannot be read"),
        ("vn 0 1\n", "a.obj:4: `vn` with 2 of 3 numbers"),
    ] {
        let e = Folder::new().fails("a.obj", format!("{OBJ_TRIANGLE}{rest}"));
        assert_eq!(message(&e), expected);
        assert!(!e.hint().is_empty());
    }
}

#[test]
fn obj_indices_of_nothing_are_left_out() {
    // Three vertices on lines 1 to 3, a valid face on line 4, then these lines; expected warning, and number of their
    // faces that are kept.
    for (rest, expected, kept) in [
        ("f 1 2 4\n", "a.obj:5: vertex 4 does not exist; the file has 3", 0),
        ("f 1 2 -4\n", "a.obj:5: vertex -4 does not exist; the file has 3", 0),
        ("f 1 2 3 9\n", "a.obj:5: vertex 9 does not exist; the file has 3", 0),
        ("f 1/1 2/1 3/2\nvt 0 0\n", "a.obj:5: texture coordinate 2 does not exist; the file has 1", 1),
        ("f 1//1 2//1 3//2\nvn 0 0 1\n", "a.obj:5: normal 2 does not exist; the file has 1", 1),
        (
            "f 1/1/1 2/1/1 3/1/1 1/1/9\nvt 0 0\nvn 0 0 1\n",
            "a.obj:5: normal 9 does not exist; the file has 1",
            1,
        ),
        ("f 1 \\\n2 3\nf 1 2 9\n", "a.obj:7: vertex 9 does not exist; the file has 3", 1),
        ("f 1 2 -4\nf 1 2 9\nf 3 2 1\n", "a.obj:5: vertex -4 does not exist; the file has 3", 1),
        ("f 1 2 0\n", "a.obj:5: vertex 0 does not exist; the file has 3", 0),
        ("f 1 2 3000000000\n", "a.obj:5: vertex 3000000000 does not exist; the file has 3", 0),
        ("f 1 2 -3000000000\n", "a.obj:5: vertex -3000000000 does not exist; the file has 3", 0),
        ("f 1/1 2/1 3/1\n", "a.obj:5: texture coordinate 1 does not exist; the file has 0", 1),
        // The index times 3 is 2^64 - 1, at which a bounds check of tobj overflows.
        (
            "vn 0 0 1\nf 1//1 2//1 3//6148914691236517206\n",
            "a.obj:6: normal 6148914691236517206 does not exist; the file has 1",
            1,
        ),
    ] {
        let (scene, warnings) = Folder::new().load("a.obj", format!("{OBJ_TRIANGLE}f 1 2 3\n{rest}"));
        assert!(warnings[0].starts_with(expected), "{rest}: {warnings:?}");
        // A polygon of four corners, two of them equal, is one triangle.
        assert_eq!(scene.primitive_count(), 1 + kept, "{rest}");
    }
}

/// Keywords in any case, number formats of other C libraries, vertices without z.
#[test]
fn obj_of_other_programs() {
    let text = "V 0 0\nV 1,0 0\nv 0 1\nv nan -nan 1.#IND\nVT 0 0\nF 1/1 2/1 3/1\nf 1 2 4\n";
    let (scene, warnings) = Folder::new().load("a.obj", text);
    assert_eq!(triangles(mesh(&scene, 0)), [TRIANGLE]);
    assert_eq!(
        warnings,
        [
            "a.obj:2: a decimal comma is read as a point",
            "a.obj:1: a vertex without z; z = 0",
            "a.obj: left out 1 triangle(s) with a vertex that is not a finite number",
        ]
    );
}

/// Vertex colours without a material, drawn flat.
#[test]
fn colours_are_those_of_the_file() {
    let triangle = |colour: &str| {
        let [a, b, c] = ["0 0 0", "2 0 0", "0 2 0"].map(|p| format!("v {p} {colour}\n"));
        Folder::new().load("a.obj", format!("{a}{b}{c}f 1 2 3\n")).0
    };
    let drawn = |scene: Scene| seen(scene, [0.2, 0.2], [0.6, 0.6], [1, 1])[0];
    // Values of 0 to 255 as they are, 0.5 as 0.5 * 255 = 127.5, and no colour as the default grey 204.
    assert_eq!(drawn(triangle("200 100 50")), [200, 100, 50]);
    assert_eq!(drawn(triangle("0 0 2")), [0, 0, 2]);
    assert_eq!(drawn(triangle("1 0.2 0")), [255, 51, 0]);
    assert_eq!(drawn(triangle("1 1 0")), [255, 255, 0]);
    assert_eq!(drawn(triangle("")), [204, 204, 204]);
    // A value above 1 by rounding does not make the others those of 0 to 255: 0.2 * 255 = 51.
    assert_eq!(drawn(triangle("1.0000001 0.2 0"))[1], 51);
    // ZBrush's comments: mask, red, green and blue of each vertex.
    let paint = "#MRGB ffc86432ffc86432\n#MRGB ffc86432\n";
    let (scene, warnings) =
        Folder::new().load("a.obj", format!("v 0 0 0\nv 2 0 0\nv 0 2 0\n{paint}f 1 2 3\n"));
    assert_eq!((drawn(scene), warnings), ([200, 100, 50], Vec::new()));
    // A mesh without colours beside one with colours.
    let text = "v 0 0 0 255 0 0\nv 2 0 0 255 0 0\nv 0 2 0 255 0 0\nv 0 0 0\nv 2 0 0\nv 0 2 0\no a\nf 1 2 3\no b\nf 4 5 6\n";
    let (mut scene, _) = Folder::new().load("a.obj", text);
    scene.objects.remove(0);
    assert_eq!(drawn(scene), [204, 204, 204]);
}

/// `illum 0` is the colour itself, `illum 1` has no highlight, nor has `Ns 0`; for both models of MTL.
#[test]
fn illumination_models_of_mtl() {
    let material = |lines: &str| {
        let folder = Folder::new();
        folder.write("a.mtl", format!("newmtl a\nKd 0.5 0.25 0.75\nKs 1 1 1\n{lines}"));
        let (mut scene, _) = folder.load("a.obj", format!("mtllib a.mtl\n{OBJ_TRIANGLE}usemtl a\nf 1 2 3\n"));
        scene.materials.remove(0)
    };
    let phong = |lines: &str| match material(lines) {
        Material::Phong(m) => m.specular,
        other => panic!("{other:?}"),
    };
    let other = |lines: &str| match material(lines) {
        Material::MetallicRoughness(m) => m,
        other => panic!("{other:?}"),
    };
    assert_eq!([phong("illum 1\nNs 10\n"), phong("illum 2\nNs 10\n"), phong("Ns 10\n")], [0.0, 1.0, 1.0]);
    // The highlight fades as the exponent goes to 0, whatever the model.
    assert_eq!([phong("Ns 0\n"), phong("illum 3\nNs 0\n"), phong("Ns 0.25\n")], [0.0, 0.0, 0.25]);
    // An emitting material is not unlit, in either model.
    assert_eq!(phong("illum 0\nKe 1 1 1\nNs 10\n"), 0.0);
    let unlit = other("illum 0\nd 0.5\n");
    assert_eq!((unlit.unlit, unlit.base_colour), (true, Colour::Display(v(0.5, 0.25, 0.75))));
    assert_eq!(unlit.opacity.map(|opacity| opacity.factor), Some(0.5));
    assert!(other("Pr 0.5\nillum 0\n").unlit && !other("Pr 0.5\nillum 0\nKe 1 1 1\n").unlit);
    assert_eq!([1, 2].map(|model| other(&format!("Pr 0.5\nillum {model}\n")).layers.specular), [0.0, 1.0]);
}

/// Keywords of MTL in any case, with a note.
#[test]
fn mtl_words_in_any_case() {
    let folder = Folder::new();
    folder.write("a.mtl", "NEWMTL a\nkd 1 0 0\nKS 0 0 0\nns 10\nILLUM 2\nMAP_KD four.png\nD 0.5\n");
    folder.write("four.png", std::fs::read(repository("assets/import/four.png")).expect("a picture"));
    let obj = format!("MTLLIB a.mtl\n{OBJ_TRIANGLE}vt 0 0\nUSEMTL \"a\" # b\nF 1/1 2/1 3/1\n");
    let (scene, warnings) = folder.load("a.obj", obj);
    assert_eq!(warnings, [""; 0]);
    let Material::Phong(m) = &scene.materials[0] else { panic!("{:?}", scene.materials) };
    assert_eq!((m.colour, m.shininess, m.texture.is_some()), (Colour::Display(v(1.0, 0.0, 0.0)), 10.0, true));
    assert_eq!(m.opacity.map(|opacity| opacity.factor), Some(0.5));
}

/// A face without texture coordinates is drawn in the colour of its material, beside faces that have some.
#[test]
fn obj_faces_without_texture_coordinates() {
    let folder = Folder::new();
    folder.write("a.mtl", "newmtl a\nKd 1 0.2 0\nmap_Kd four.png\nbump four.png\n");
    folder.write("four.png", std::fs::read(repository("assets/import/four.png")).expect("a picture"));
    let squares = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    for right in ["f 2 5 6 3", "f 2 5 6\nf 2 6 3", "f 2/1 5/2 6/3 3", "f 2/9 5/9 6/9 3/9"] {
        let text = format!("mtllib a.mtl\n{squares}usemtl a\nf 1/1 2/2 3/3 4/4\n{right}\n");
        let (scene, _) = folder.load("a.obj", text);
        // Kd without the texture: 255, 0.2 * 255 = 51, 0.
        let drawn = seen(scene, [1.0, 0.0], [2.0, 1.0], [4, 4]);
        assert!(drawn.iter().all(|pixel| *pixel == [255, 51, 0]), "{right}: {drawn:?}");
    }
}

// --------------------------------------------------------------------------------------------------------------- glTF

#[test]
fn gltf_with_a_buffer_whose_name_holds_a_space() {
    let (scene, warnings) = fixture("square.gltf");
    assert_eq!(warnings, [""; 0]);
    let (a, b, c, d) = (v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(1.0, 1.0, 0.0), v(0.0, 1.0, 0.0));
    assert_eq!(triangles(mesh(&scene, 0)), [[a, b, c], [a, c, d]]);
    assert_eq!(scene.objects[0].name, "square");
    assert!(mesh(&scene, 0).normals.is_none(), "without NORMAL the shading is flat");
}

/// gltf-json 1.4.1 panics at the first of them.
#[test]
fn gltf_primitives_that_name_what_is_not_there() {
    let mut model = Model::triangle();
    model.primitive()["attributes"]["POSITION"] = json!(99);
    assert_eq!(message(&model.fails()), "a.gltf: mesh 0, primitive 0: POSITION is accessor 99; there are 1");
    for (key, value) in
        [("indices", json!(99)), ("material", json!(99)), ("attributes", json!({"NORMAL": 7}))]
    {
        let mut model = Model::triangle();
        model.primitive()[key] = value;
        assert!(message(&model.fails()).starts_with("a.gltf: not a usable glTF file: meshes[0]"), "{key}");
    }
}

/// Sizes that are claimed without bytes in the file: accessors without a buffer view, one accessor used by many
/// primitives, and sizes in the headers of images.
#[test]
fn gltf_sizes_are_checked_before_memory_is_allocated() {
    let sparse = json!({ "count": 1, "indices": { "bufferView": 0, "componentType": 5123 }, "values": { "bufferView": 0 } });
    let claim =
        |count: u64| json!({ "componentType": FLOAT, "count": count, "type": "VEC3", "sparse": sparse });
    let mut positions = Model::triangle();
    positions.json["accessors"][0] = claim(1 << 28);
    positions.json["accessors"][0]["min"] = json!([0, 0, 0]);
    positions.json["accessors"][0]["max"] = json!([1, 1, 0]);
    let mut places = Model::triangle().with("extensionsUsed", json!(["EXT_mesh_gpu_instancing"]));
    places.json["accessors"].as_array_mut().expect("a list").push(claim(1 << 26));
    places.json["nodes"][0]["extensions"] =
        json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 1 } } });
    for model in [positions, places] {
        let e = model.fails();
        assert!(message(&e).starts_with("a.gltf: reading its meshes needs "), "{e}");
        assert!(message(&e).ends_with("; the limit for sizes in a file is 4.0 GiB"), "{e}");
        assert!(!e.hint().is_empty());
    }
    if cfg!(target_os = "linux") {
        let mut shared = Model::triangle();
        let many = shared.floats(&vec![[0f32; 3]; 1 << 16]);
        // 2^16 positions of 32 bytes, and 2^16 indices of 16, 2^18 times: 768 GiB.
        shared.json["meshes"][0]["primitives"] =
            json!(vec![json!({ "attributes": { "POSITION": many } }); 1 << 18]);
        let e = message(&shared.fails());
        assert!(e.starts_with("a.gltf: reading its meshes needs 768.0 GiB of memory; "), "{e}");
    }
    let uri = data_uri("image/png", &common::oversized_images::png(60_000, 60_000));
    let picture = Model::triangle().with("images", json!([{ "uri": uri }]));
    let e = picture.fails();
    assert!(message(&e).starts_with("a.gltf: image 0: a picture of 60000 x 60000 pixels needs "), "{e}");
}

#[test]
fn gltf_binary_and_byte_order_mark() {
    let folder = Folder::new();
    let (scene, _) = folder.load("a.glb", Model::triangle().binary());
    assert_eq!(triangles(mesh(&scene, 0)), [TRIANGLE]);
    let (scene, _) = folder.load("b.gltf", format!("\u{FEFF}{}", Model::triangle().text()));
    assert_eq!(triangles(mesh(&scene, 0)), [TRIANGLE]);
}

#[test]
fn gltf_nodes_move_turn_and_stretch_what_they_hold() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let mut model = Model::triangle();
    let normals_at = model.floats(&[[0.6, 0.0, 0.8], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]]);
    model.primitive()["attributes"]["NORMAL"] = json!(normals_at);
    // The outer node rotates by 90 degrees about z and translates by (10, 0, 0); the inner one scales by (2, 3, 1).
    model.json["nodes"] = json!([
        { "children": [1], "translation": [10, 0, 0], "rotation": [0, 0, half, half] },
        { "name": "inner", "mesh": 0, "scale": [2, 3, 1] },
    ]);
    let (scene, warnings) = model.load();
    assert_eq!(warnings, [""; 0]);
    // (x, y, z) -> scaled (2x, 3y, z) -> rotated (-3y, 2x, z) -> translated (10 - 3y, 2x, z).
    let [a, b, c] = triangles(mesh(&scene, 0))[0];
    assert_near(a, v(10.0, 0.0, 0.0));
    assert_near(b, v(10.0, 2.0, 0.0));
    assert_near(c, v(7.0, 0.0, 0.0));
    // Normals by the inverse transpose: (0.6, 0, 0.8) -> (0.3, 0, 0.8) -> rotated (0, 0.3, 0.8), of length sqrt(0.73).
    let [n, z, _] = normals(mesh(&scene, 0))[0];
    assert_near(n, v(0.0, 0.3, 0.8) / 0.73f64.sqrt());
    assert_near(z, DVec3::Z);
}

#[test]
fn gltf_mirrored_nodes_keep_the_outside_outside() {
    let mut model = Model::triangle();
    let normals_at = model.floats(&[[0.6, 0.0, 0.8]; 3]);
    model.primitive()["attributes"]["NORMAL"] = json!(normals_at);
    model.json["nodes"] = json!([{ "mesh": 0, "scale": [-2, 1, 1] }]);
    let (scene, _) = model.load();
    assert_eq!(triangles(mesh(&scene, 0)), [[DVec3::ZERO, v(-2.0, 0.0, 0.0), DVec3::Y]]);
    // A mirror at x = 0 with a scale of 2 along x takes the direction (0.6, 0, 0.8) of a normal to (-0.3, 0, 0.8). It
    // still points towards +z; the cofactor matrix without the sign of the determinant would reverse it.
    assert_near(normals(mesh(&scene, 0))[0][0], v(-0.3, 0.0, 0.8) / 0.73f64.sqrt());
}

#[test]
fn gltf_nodes_given_as_matrices_in_column_order() {
    // Columns: x -> (0, 2, 0), y -> (-1, 0, 0), z -> (0, 0, 1), then the translation (5, 6, 7).
    let matrix = json!([0, 2, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]);
    let (scene, _) = Model::triangle().with("nodes", json!([{ "mesh": 0, "matrix": matrix }])).load();
    assert_eq!(triangles(mesh(&scene, 0)), [[v(5.0, 6.0, 7.0), v(5.0, 8.0, 7.0), v(4.0, 6.0, 7.0)]]);
}

#[test]
fn gltf_base_colour_factor_picture_and_vertex_colours() {
    let png = std::fs::read(repository("assets/import/four.png")).expect("the fixture is there");
    let folder = Folder::new();
    folder.write("four.png", png);
    let mut model = Model::square();
    model.attribute("COLOR_0", &[[1.0, 1.0, 0.25]; 4]);
    let pbr = json!({ "baseColorFactor": [1, 0.5, 1, 1], "baseColorTexture": { "index": 0 } });
    let material = json!({ "name": "m", "pbrMetallicRoughness": pbr });
    let (scene, warnings) =
        folder.load("a.gltf", model.with_texture("four.png", &json!({}), &material).text());
    assert_eq!(warnings, [""; 0]);
    let Material::MetallicRoughness(material) = &scene.materials[0] else { panic!("{:?}", scene.materials) };
    assert_eq!(material.base_colour, Colour::Linear(v(1.0, 0.5, 1.0)));
    // The defaults of glTF.
    assert_eq!((material.metallic, material.roughness), (1.0, 1.0));
    assert_eq!(mesh(&scene, 0).colours.as_ref().expect("it has colours").values, [v(1.0, 1.0, 0.25); 4]);
    // In display values the factor 0.5 is 0.735357 (sRGB, IEC 61966-2-1) and the vertex colour 0.25 is 0.537099:
    // 255 * 0.735357 = 187.5, 255 * 0.537099 = 136.96.
    let [red, green, blue, white] = seen(scene, [0.0, 0.0], [1.0, 1.0], [2, 2])[..] else {
        panic!("four pixels were asked for")
    };
    assert_eq!((red, blue), ([255, 0, 0], [0, 0, 137]));
    assert_eq!((green, white), ([0, 188, 0], [255, 188, 137]));
}

/// A texture without an image, and one of a set of coordinates that the mesh lacks.
#[test]
fn gltf_textures_that_cannot_be_drawn_are_named() {
    let folder = Folder::new();
    folder.write("half.png", half_transparent_png());
    for (texture, set, expected) in [
        (
            json!({}),
            0,
            "a.gltf: texture left out: it names no image, or only one of a format that is not read",
        ),
        (json!({ "source": 0 }), 1, "a.gltf: `node 0` lacks the texture coordinates of its material `m`"),
    ] {
        let pbr = json!({ "baseColorTexture": { "index": 0, "texCoord": set } });
        let material = json!({ "name": "m", "pbrMetallicRoughness": pbr });
        let model = Model::square().with_texture("half.png", &json!({}), &material);
        let model = model.with("nodes", json!([{ "mesh": 0 }])).with("textures", json!([texture]));
        let (_, warnings) = folder.load("a.gltf", model.text());
        assert!(warnings.len() == 1 && warnings[0].contains(expected), "{warnings:?}");
    }
}

/// A PNG of 2 by 1 white pixels whose alpha is 0 on the left and 204 (0.8) on the right.
fn half_transparent_png() -> Vec<u8> {
    png(2, &[[255, 255, 255, 0], [255, 255, 255, 204]])
}

/// The opacity is the product of factor, texture and vertex alpha (glTF 2.0, section 3.9.4); `MASK` compares it with
/// the cutoff, 0.5 if not given, and `OPAQUE` ignores all of it.
#[test]
fn gltf_alpha_of_factor_picture_and_vertices() {
    let folder = Folder::new();
    folder.write("half.png", half_transparent_png());
    let load = |mode: &str, vertex_alpha: f32, cutoff: Option<f64>| {
        let mut model = Model::square();
        model.attribute("COLOR_0", &[[1.0, 1.0, 1.0, vertex_alpha]; 4]);
        let pbr = json!({ "baseColorFactor": [1, 1, 1, 0.5], "baseColorTexture": { "index": 0 } });
        let mut material = json!({ "pbrMetallicRoughness": pbr, "alphaMode": mode });
        if let Some(cutoff) = cutoff {
            material["alphaCutoff"] = json!(cutoff);
        }
        let nearest = json!({ "magFilter": 9728, "minFilter": 9728 });
        let model = model.with_texture("half.png", &nearest, &material);
        let (scene, warnings) = folder.load("a.gltf", model.text());
        assert_eq!(warnings, [""; 0]);
        Scene { background: Some(Colour::from_u8([0; 3])), ..scene }
    };
    let scene = load("OPAQUE", 0.5, None);
    assert!(scene.materials[0].opacity().is_none() && mesh(&scene, 0).alphas.is_none());
    assert_eq!(scene.images.len(), 1);
    // The background is black: the left half shows it, the right half is 0.5 * 0.8 * 0.5 of white, 0.2 * 255 = 51 in
    // display values.
    let scene = load("BLEND", 0.5, None);
    assert_eq!(mesh(&scene, 0).alphas.as_ref().expect("alphas").values, [0.5; 4]);
    let quarters = |scene| seen(scene, [0.0, 0.0], [1.0, 1.0], [2, 2]);
    assert_eq!(quarters(scene), [[0; 3], [51; 3], [0; 3], [51; 3]]);
    // 0.5 * 0.8 = 0.4 is below 0.5 and above 0.39.
    assert_eq!(quarters(load("MASK", 1.0, None)), [[0; 3]; 4]);
    assert_eq!(quarters(load("MASK", 1.0, Some(0.39))), [[0; 3], [255; 3], [0; 3], [255; 3]]);
}

/// `d` is the opacity; `Tr` is its complement and used if there is no `d`, but 1 means opaque; `map_d` is a factor, the alpha channel of
/// the image or its grey values if it has none.
#[test]
fn obj_opacity_of_numbers_and_pictures() {
    let folder = Folder::new();
    folder.write("half.png", half_transparent_png());
    let mtl = "newmtl a\nd 0.25\nTr 0.25\nnewmtl b\nTr 0.25\nnewmtl c\nmap_d half.png\nnewmtl e\nd 1\nTr 0\n\
               newmtl f\nd 0\nnewmtl g\nTr 1\n";
    folder.write("a.mtl", mtl);
    let faces: String =
        ["a", "b", "c", "e", "f", "g"].map(|name| format!("usemtl {name}\nf 1/1 2/1 3/1\n")).concat();
    let obj = format!("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n{faces}");
    let (scene, warnings) = folder.load("a.obj", obj);
    assert_eq!(warnings, ["a.obj: material `f` has the opacity 0 (`d`) and cannot be seen"]);
    let opacity = |i: usize| scene.materials[i].opacity();
    let factors: Vec<Option<f64>> = (0..6).map(|i| opacity(i).map(|o| o.factor)).collect();
    assert_eq!(factors, [Some(0.25), Some(0.75), Some(1.0), None, Some(0.0), None]);
    let texture = opacity(2).and_then(|o| o.texture).expect("map_d is a texture");
    assert_eq!(scene.images[texture.image.0 as usize].pixels, [[0u8; 3], [204; 3]].into_iter().collect());
}

/// By default the look smooths meshes of formats that say nothing of normals that are missing; in glTF they are flat.
#[test]
fn meshes_without_normals_are_smooth_by_default() {
    let folder = Folder::new();
    let obj = folder.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let glb = folder.write("a.glb", Model::triangle().binary());
    let has_normals = |file: &Path, smooths_meshes, degrees: Option<f64>| {
        let reading = ReadingOptions { smooth: degrees.map(Degrees::clamped), ..ReadingOptions::default() };
        let options = ImportOptions { reading, smooths_meshes, ..ImportOptions::default() };
        let scene =
            kiln::import::load_with(&[file.to_owned()], &options, &mut Warnings::default()).expect("a scene");
        scene.objects[0].shape.mesh().expect("a mesh").normals.is_some()
    };
    assert!(has_normals(&obj, true, None) && !has_normals(&obj, false, None));
    assert!(!has_normals(&obj, true, Some(0.0)) && has_normals(&obj, false, Some(30.0)));
    assert!(!has_normals(&glb, true, None) && has_normals(&glb, true, Some(30.0)));
}

#[test]
fn gltf_without_its_picture_keeps_its_geometry() {
    let mut model = Model::triangle();
    model.json["images"] =
        json!([{ "uri": "gone.png" }, { "uri": "../out.png" }, { "uri": "data:image/png;base64,AAAA" }]);
    model.json["textures"] = json!([{ "source": 0 }, { "source": 1 }, { "source": 2 }]);
    model.json["materials"] = json!([{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }]);
    model.primitive()["material"] = json!(0);
    let (scene, warnings) = model.load();
    assert_eq!(scene.primitive_count(), 1);
    assert_eq!(warnings[0], "gone.png: texture left out: no such file");
    assert_eq!(
        warnings[1],
        "a.gltf: image 1: texture left out: `../out.png` is outside the file's folder; --allow-outside-references reads it, too"
    );
    assert!(warnings[2].starts_with("a.gltf: image 2: texture left out: "), "{warnings:?}");
    assert_eq!(warnings.len(), 3);
}

/// glTF 2.0, section 3.8.4: 9728 NEAREST, 9729 LINEAR, 9984 to 9987 with MIPMAP; without a value the filter is not set.
/// A normal map has its scale, and tangents are computed for a mesh without them: on this triangle u increases along +x
/// and the texture's upward direction is +y.
#[test]
fn gltf_samplers_and_normal_maps() {
    use Interpolation::{Linear, Nearest};
    let minify = |within, between| Some(Minify { within, between });
    for (filters, magnify, minify) in [
        (json!({}), None, None),
        (json!({ "magFilter": 9728, "minFilter": 9728 }), Some(Nearest), minify(Nearest, None)),
        (json!({ "magFilter": 9729, "minFilter": 9729 }), Some(Linear), minify(Linear, None)),
        (json!({ "minFilter": 9984 }), None, minify(Nearest, Some(Nearest))),
        (json!({ "minFilter": 9985 }), None, minify(Linear, Some(Nearest))),
        (json!({ "minFilter": 9986 }), None, minify(Nearest, Some(Linear))),
        (json!({ "minFilter": 9987 }), None, minify(Linear, Some(Linear))),
    ] {
        let folder = Folder::new();
        folder.write("n.png", png(1, &[[128, 128, 255, 255]]));
        let mut model = Model::triangle();
        model.attribute("TEXCOORD_0", &[[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]]);
        let material = json!({ "normalTexture": { "index": 0, "scale": 0.5 } });
        let (scene, warnings) =
            folder.load("a.gltf", model.with_texture("n.png", &filters, &material).text());
        assert_eq!(warnings, [""; 0]);
        let map = scene.materials[0].normal_map().expect("a normal map");
        assert_eq!(map.scale, 0.5);
        assert_eq!((map.texture.sampler.magnify, map.texture.sampler.minify), (magnify, minify));
        let tangents = mesh(&scene, 0).tangents.as_ref().expect("tangents");
        assert_eq!(tangents.values, [glam::DVec4::new(1.0, 0.0, 0.0, 1.0); 3]);
        assert_eq!(normals(mesh(&scene, 0)), [[DVec3::Z; 3]]);
    }
}

/// Checks that the rectangle that a camera sees at a distance has its corners at those of the picture.
fn assert_sees(camera: &Camera, aspect: [u32; 2], rectangle: [DVec3; 2]) {
    let view = View::new(camera, camera.projection, aspect).expect("the camera has a direction");
    let size = DVec2::from(aspect.map(f64::from));
    let [lower_left, upper_right] = rectangle;
    for (point, expected) in [(lower_left, DVec2::new(0.0, size.y)), (upper_right, DVec2::new(size.x, 0.0))] {
        let (pixel, before) = view.project(point);
        assert!(
            before && (pixel - expected).abs().max_element() < 1e-4,
            "{point} is seen at {pixel}, not {expected}"
        );
    }
}

#[test]
fn gltf_cameras_see_the_same_rectangle() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    // A vertical angle of view of 90 degrees and an aspect ratio of 2; at (1, 2, 3), rotated by 90 degrees about y, so
    // that the camera looks along -x with -z to its right.
    let model = Model::triangle()
        .with("scenes", json!([{ "nodes": [0, 1, 2] }]))
        .with(
            "nodes",
            json!([
                { "mesh": 0 },
                { "name": "wide", "camera": 0, "translation": [1, 2, 3], "rotation": [0, half, 0, half] },
                { "name": "flat", "camera": 1, "translation": [0, 0, 10] },
            ]),
        )
        .with(
            "cameras",
            json!([
                { "type": "perspective",
                  "perspective": { "yfov": std::f64::consts::FRAC_PI_2, "aspectRatio": 2, "znear": 0.1 } },
                { "type": "orthographic",
                  "orthographic": { "xmag": 3, "ymag": 1.5, "znear": 0.1, "zfar": 100 } },
            ]),
        );
    let (scene, warnings) = model.load();
    assert_eq!(warnings, [""; 0]);
    let names: Vec<&str> = scene.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["wide", "flat"]);
    // At distance 5 its view is 10 units high and 20 wide: from the middle (-4, 2, 3), y goes from -3 to 7 and z
    // from 13 on the left to -7 on the right.
    assert_eq!(scene.cameras[0].projection, Projection::Perspective);
    assert_sees(&scene.cameras[0], [200, 100], [v(-4.0, -3.0, 13.0), v(-4.0, 7.0, -7.0)]);
    // xmag and ymag are half the width and half the height, at any distance.
    assert_eq!(scene.cameras[1].projection, Projection::Orthographic);
    assert_sees(&scene.cameras[1], [200, 100], [v(-3.0, -1.5, 4.0), v(3.0, 1.5, -7.0)]);
}

/// Blender exports a camera's custom properties as extras; other extras are not the lens's, and what is wrong is left out.
#[test]
fn gltf_cameras_have_the_lens_of_their_extras() {
    let camera = |extras: serde_json::Value| {
        let perspective = json!({ "yfov": 1.0, "znear": 0.1 });
        Model::triangle()
            .with("scenes", json!([{ "nodes": [0, 1] }]))
            .with("nodes", json!([{ "mesh": 0 }, { "name": "c", "camera": 0, "translation": [0, 0, 9] }]))
            .with("cameras", json!([{ "type": "perspective", "perspective": perspective, "extras": extras }]))
            .load()
    };
    let (scene, warnings) = camera(
        json!({ "aperture_radius": 0.5, "focus_at": [0, 1, 2], "blades": 7, "blade_rotation": 5, "owner": "me" }),
    );
    assert_eq!(warnings, [""; 0]);
    let lens = Lens { radius: 0.5, focus: Focus::Point(v(0.0, 1.0, 2.0)), blades: 7, blade_rotation: 5.0 };
    assert_eq!(scene.cameras[0].lens, Some(lens));
    let (scene, warnings) = camera(json!({ "owner": "me" }));
    assert_eq!((scene.cameras[0].lens, warnings.len()), (None, 0));
    for (wrong, why) in
        [(json!({ "f_stop": "wide" }), "invalid type"), (json!({ "f_stop": 0 }), "no f-number")]
    {
        let (scene, warnings) = camera(wrong);
        assert_eq!(scene.cameras[0].lens, None);
        assert!(warnings.len() == 1 && warnings[0].contains(why), "{warnings:?}");
    }
}

#[test]
fn gltf_punctual_lights() {
    let lights = json!({ "lights": [
        { "type": "point", "name": "a", "intensity": 10, "color": [1, 0.5, 0], "range": 7 },
        { "type": "directional", "intensity": 3 },
        { "type": "spot", "spot": { "innerConeAngle": 0.25, "outerConeAngle": 0.5 } },
    ] });
    let light = |i: u32| json!({ "KHR_lights_punctual": { "light": i } });
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let model = Model::triangle()
        .with("scenes", json!([{ "nodes": [0, 1, 2, 3] }]))
        .with(
            "nodes",
            json!([
                { "mesh": 0 },
                { "name": "lamp", "translation": [1, 2, 3], "extensions": light(0) },
                // A rotation by 90 degrees about x takes -z to +y, one about -x to -y, downwards.
                { "name": "sun", "rotation": [-half, 0, 0, half], "extensions": light(1) },
                { "name": "spot", "translation": [0, 5, 0], "rotation": [half, 0, 0, half], "extensions": light(2) },
            ]),
        )
        .with("extensions", json!({ "KHR_lights_punctual": lights }))
        .with("extensionsUsed", json!(["KHR_lights_punctual"]))
        .with("extensionsRequired", json!(["KHR_lights_punctual"]));
    let (scene, warnings) = model.load();
    assert_eq!(warnings, [""; 0]);
    let [lamp, sun, spot] = &scene.lights[..] else { panic!("{:?}", scene.lights) };
    // A diffuse surface reflects 1/pi of the candela or lux that reach it.
    let pi = std::f64::consts::PI;
    assert_eq!((lamp.name.as_str(), lamp.intensity), ("lamp", 10.0 / pi));
    assert_eq!(lamp.colour, Colour::Linear(v(1.0, 0.5, 0.0)));
    let falloff = Falloff::InverseSquare { range: Some(7.0) };
    assert_eq!(lamp.kind, LightKind::Point { position: v(1.0, 2.0, 3.0), falloff });
    let LightKind::Directional { direction, .. } = sun.kind else { panic!("{sun:?}") };
    assert_near(direction, -DVec3::Y);
    assert_eq!(sun.intensity, 3.0 / pi);
    let LightKind::Spot { position, direction, falloff, inner_angle, outer_angle } = spot.kind else {
        panic!("{spot:?}")
    };
    assert_near(position, v(0.0, 5.0, 0.0));
    assert_near(direction, DVec3::Y);
    assert_eq!((falloff, inner_angle, outer_angle), (Falloff::InverseSquare { range: None }, 0.25, 0.5));
}

#[test]
fn gltf_strips_and_fans_keep_their_sides() {
    let strip = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
    let fan = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    // A unit square each, whose two triangles face +z: their area vectors are (0, 0, 0.5).
    for (mode, positions) in [(5, strip), (6, fan)] {
        let mut model = Model::triangle();
        let positions = model.floats(&positions);
        *model.primitive() = json!({ "attributes": { "POSITION": positions }, "mode": mode });
        let (scene, _) = model.load();
        let sides: Vec<DVec3> =
            triangles(mesh(&scene, 0)).iter().map(|[a, b, c]| (*b - *a).cross(*c - *a) / 2.0).collect();
        assert_eq!(sides, [v(0.0, 0.0, 0.5); 2], "mode {mode}");
    }
}

#[test]
fn gltf_points_and_lines_are_said_to_be_left_out() {
    for mode in 0..4 {
        let mut model = Model::triangle();
        model.primitive()["mode"] = json!(mode);
        let (scene, warnings) = model.load();
        assert_eq!(
            (scene.primitive_count(), warnings),
            (0, vec!["a.gltf: it: points and lines are not drawn".into()])
        );
    }
}

#[test]
fn gltf_skins_are_posed_as_their_joints_stand() {
    let mut model = Model::triangle();
    // Joint 0 is at its bind pose; joint 1 was bound at (0, 1, 0) and is at (0, 3, 0), which moves its vertices by
    // (0, 2, 0). The third vertex has a weight of 1/2 for each joint.
    let joints = model.shorts(&[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0], "VEC4", 3);
    let weights = model.floats(&[[1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0]]);
    let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let mut bound = identity;
    bound[13] = -1.0;
    let inverse = model.floats::<16>(&[identity, bound]);
    let attributes = &mut model.primitive()["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    model.json["skins"] = json!([{ "joints": [1, 2], "inverseBindMatrices": inverse }]);
    // The transform of the node itself is ignored for a skinned mesh (glTF 2.0, section 3.7.3.3).
    model.json["nodes"] = json!([
        { "mesh": 0, "skin": 0, "translation": [100, 0, 0] }, { "children": [2] }, { "translation": [0, 3, 0] },
    ]);
    model.json["scenes"] = json!([{ "nodes": [0, 1] }]);
    let (scene, warnings) = model.load();
    assert_eq!(warnings, [""; 0]);
    // (0,0,0) stays; (1,0,0) moves to (1,2,0); (0,1,0) by half of (0,2,0) to (0,2,0).
    assert_eq!(triangles(mesh(&scene, 0)), [[DVec3::ZERO, v(1.0, 2.0, 0.0), v(0.0, 2.0, 0.0)]]);
}

#[test]
fn gltf_uris_that_cannot_be_followed() {
    let length = Model::triangle().bytes.len();
    for (uri, expected) in [
        ("gone.bin", "no such file"),
        ("%FF.bin", "a.gltf: buffer 0: `%FF.bin` does not decode to a file name"),
        ("../a.bin", "a.gltf: buffer 0: `../a.bin` is outside the file's folder"),
        ("/etc/hostname", "a.gltf: buffer 0: `/etc/hostname` is outside the file's folder"),
        ("%2e%2e/a.bin", "a.gltf: buffer 0: `../a.bin` is outside the file's folder"),
        ("https://example.org/a.bin", "kiln reads local files only"),
        ("data:application/octet-stream;base64,AAAA", "a.gltf: buffer 0: has 3 bytes; byteLength is 36"),
        ("data:application/octet-stream;base64,!", "a damaged data URI"),
        ("data:;base64", "a data URI without a comma"),
        ("a/../../b", "a.gltf: buffer 0: `a/../../b` is outside the file's folder"),
    ] {
        let e = Model::triangle().with("buffers", json!([{ "byteLength": length, "uri": uri }])).fails();
        assert!(message(&e).contains(expected), "{uri}: {e}");
        assert!(!e.hint().is_empty());
    }
}

#[test]
fn gltf_accessors_that_reach_outside_are_errors() {
    // 36 bytes hold three positions; a fourth is outside of the buffer.
    let mut model = Model::triangle();
    model.json["accessors"][0]["count"] = json!(4);
    assert_eq!(message(&model.fails()), "a.gltf: accessor 0: its elements do not lie inside its buffer view");
    // A view that is longer than its buffer.
    let mut model = Model::triangle();
    model.json["bufferViews"][0]["byteOffset"] = json!(4);
    assert_eq!(message(&model.fails()), "a.gltf: it, primitive 0: its positions lie outside their buffer");
    let mut model = Model::triangle();
    let indices = model.shorts(&[0, 1, 2], "SCALAR", 30);
    model.primitive()["indices"] = json!(indices);
    assert_eq!(message(&model.fails()), "a.gltf: accessor 1: its elements do not lie inside its buffer view");
}

#[test]
fn gltf_numbers_that_make_no_sense_are_errors_and_no_panic() {
    for (key, value) in [
        ("count", json!(0)),
        ("count", json!(u64::MAX)),
        ("count", json!(u64::MAX / 12)),
        ("byteOffset", json!(u64::MAX)),
        ("type", json!("VEC2")),
    ] {
        let mut model = Model::triangle();
        model.json["accessors"][0][key] = value.clone();
        let e = model.fails();
        assert!(message(&e).starts_with("a.gltf: "), "{key} = {value}: {e}");
    }
    for (key, value) in
        [("byteOffset", json!(u64::MAX)), ("byteLength", json!(u64::MAX)), ("byteStride", json!(4))]
    {
        let mut model = Model::triangle();
        model.json["bufferViews"][0][key] = value.clone();
        let e = model.fails();
        assert!(message(&e).starts_with("a.gltf: "), "{key} = {value}: {e}");
    }
}

/// glTF 2.0, section 3.7.2.1, says which types an attribute may have; the `gltf` crate panics on some of the others and
/// reads garbage from the rest.
#[test]
fn gltf_attributes_of_types_that_the_format_does_not_give_are_not_used() {
    const BYTE: u32 = 5120;
    const UNSIGNED_INT: u32 = 5125;
    for (semantic, component, kind, bytes) in [
        ("NORMAL", FLOAT, "SCALAR", 4),
        ("TEXCOORD_0", UNSIGNED_INT, "VEC2", 4),
        ("TEXCOORD_0", FLOAT, "VEC3", 4),
        ("COLOR_0", BYTE, "VEC3", 1),
        ("COLOR_0", UNSIGNED_INT, "VEC4", 4),
        ("COLOR_0", FLOAT, "VEC2", 4),
        ("JOINTS_0", FLOAT, "VEC4", 4),
        ("WEIGHTS_0", BYTE, "VEC4", 1),
    ] {
        let mut model = Model::triangle();
        let lanes = kind.chars().last().and_then(|c| c.to_digit(10)).unwrap_or(1) as usize;
        let accessor = model.accessor(vec![0; 3 * lanes * bytes], component, 3, kind);
        model.primitive()["attributes"][semantic] = json!(accessor);
        let (scene, warnings) = model.load();
        let expected = format!("a.gltf: mesh 0, primitive 0: {semantic} of type ");
        let [warning] = warnings.as_slice() else { panic!("{warnings:?}") };
        assert!(warning.starts_with(&expected) && warning.ends_with(" is not glTF; not used"), "{warning}");
        let expected = Mesh { positions: TRIANGLE.to_vec(), triangles: vec![[0, 1, 2]], ..Mesh::default() };
        assert_eq!(*mesh(&scene, 0), expected);
    }
    for (component, bytes) in [(FLOAT, 12), (5122, 6)] {
        let mut model = Model::triangle();
        let indices = model.accessor(vec![0; bytes], component, 3, "SCALAR");
        model.primitive()["indices"] = json!(indices);
        let expected = "a.gltf: mesh 0, primitive 0: its indices are not unsigned integers";
        assert_eq!(message(&model.fails()), expected);
    }
    let model = Model::triangle().with("images", json!([{}]));
    assert_eq!(message(&model.fails()), "a.gltf: image 0: has neither `uri` nor `bufferView`");
}

#[test]
fn gltf_sparse_accessors_cannot_ask_for_the_moon() {
    let mut model = Model::triangle();
    let sparse = json!({ "count": 1, "indices": { "bufferView": 0, "componentType": UNSIGNED_SHORT },
        "values": { "bufferView": 0 } });
    let accessor = model.json["accessors"][0].as_object_mut().expect("an object");
    accessor.remove("bufferView");
    accessor.insert("sparse".into(), sparse);
    accessor.insert("count".into(), json!(1u64 << 40));
    assert!(message(&model.fails()).starts_with("a.gltf: reading its meshes needs "));
}

#[test]
fn gltf_indices_out_of_range() {
    // A vertex that is not finite: its triangle is left out and counted.
    let mut model = Model::triangle();
    let indices = model.shorts(&[0, 1, 2, 0, 1, 3], "SCALAR", 6);
    model.primitive()["indices"] = json!(indices);
    let (scene, warnings) = model.load();
    assert_eq!(triangles(mesh(&scene, 0)), [TRIANGLE]);
    assert_eq!(warnings, ["a.gltf: it: left out 1 triangle(s) with an index out of range"]);
    // Any other value that is not finite is an error.
    let e = Model::triangle().with("nodes", json!([{ "mesh": 7 }])).fails();
    assert_eq!(
        message(&e),
        "a.gltf: not a usable glTF file: nodes[0].mesh refers to an item that does not exist"
    );
}

#[test]
fn gltf_nodes_that_contain_themselves_are_an_error() {
    let cycles = [
        json!([{ "mesh": 0, "children": [0] }]),
        json!([{ "mesh": 0, "children": [1] }, { "children": [2] }, { "children": [1] }]),
        // Two references at every level: a walk of every path would take 2^depth steps.
        json!([{ "mesh": 0, "children": [1, 1] }, { "children": [0, 0] }]),
    ];
    for nodes in cycles {
        let e = Model::triangle().with("nodes", nodes.clone()).fails();
        assert!(message(&e).ends_with("the node is its own ancestor"), "{nodes}: {e}");
    }
}

#[test]
fn gltf_nodes_with_several_parents_are_drawn_once_and_do_not_hang() {
    // A chain of forty nodes, each of them twice a child of the one before: there are 2^40 paths to the last one.
    let mut nodes: Vec<Value> = (1..40).map(|next| json!({ "children": [next, next] })).collect();
    nodes.push(json!({ "name": "last", "mesh": 0 }));
    let (scene, warnings) = Model::triangle().with("nodes", json!(nodes)).load();
    assert_eq!(triangles(mesh(&scene, 0)), [TRIANGLE]);
    assert_eq!(scene.objects.len(), 1);
    assert!(
        warnings.contains(&"a.gltf: node 39 is in the scene more than once; drawn once".into()),
        "{warnings:?}"
    );
}

#[test]
fn gltf_long_chains_of_nodes_are_no_cycle() {
    // Each of 3000 nodes translates by (0, 0, 1).
    let mut nodes: Vec<Value> =
        (1..3000).map(|next| json!({ "children": [next], "translation": [0, 0, 1] })).collect();
    nodes.push(json!({ "mesh": 0, "translation": [0, 0, 1] }));
    let (scene, _) = Model::triangle().with("nodes", json!(nodes)).load();
    assert_eq!(triangles(mesh(&scene, 0))[0][0], v(0.0, 0.0, 3000.0));
}

#[test]
fn gltf_that_requires_what_kiln_does_not_read_says_what_to_do() {
    let model = Model::triangle()
        .with("extensionsUsed", json!(["KHR_mesh_quantization", "VENDOR_thing", "VENDOR_other"]))
        .with("extensionsRequired", json!(["KHR_mesh_quantization", "VENDOR_thing", "VENDOR_other"]));
    let e = model.fails();
    assert_eq!(
        message(&e),
        "a.gltf: requires glTF extensions that kiln does not read: VENDOR_thing, VENDOR_other"
    );
    assert!(e.hint().contains("--ignore-required-extensions"), "{}", e.hint());
    // An unknown extension that is used but not required is left out with a warning.
    let (_, warnings) = Model::triangle().with("extensionsUsed", json!(["VENDOR_thing"])).load();
    assert_eq!(warnings, ["a.gltf: extension VENDOR_thing is not used"]);
}

#[test]
fn gltf_material_extensions_are_read_within_their_ranges() {
    let extensions = json!({
        "KHR_materials_ior": { "ior": 1.33 },
        "KHR_materials_specular": { "specularFactor": 0.5, "specularColorFactor": [1, 2, 0.25] },
        "KHR_materials_transmission": { "transmissionFactor": 7, "transmissionTexture": { "index": 9 } },
        "KHR_materials_volume": { "thicknessFactor": 0.1, "attenuationColor": [0.5, 1, 3], "attenuationDistance": 4 },
        "KHR_materials_clearcoat": { "clearcoatFactor": 0.25, "clearcoatRoughnessFactor": -1 },
        "KHR_materials_sheen": { "sheenColorFactor": [0.1, 0.2, 0.3], "sheenRoughnessFactor": 0.75 },
    });
    let names: Vec<&String> = extensions.as_object().expect("an object").keys().collect();
    let model = Model::triangle()
        .with(
            "materials",
            json!([{ "extensions": extensions }, { "extensions": { "KHR_materials_ior": { "ior": 0.5 } } }]),
        )
        .with("extensionsUsed", json!(names))
        .with("extensionsRequired", json!(names));
    let (scene, warnings) = model.load();
    let layers = |index: usize| match &scene.materials[index] {
        Material::MetallicRoughness(material) => material.layers.clone(),
        Material::Phong(_) => panic!("a metallic-roughness material"),
    };
    let linear = |r, g, b| Colour::Linear(v(r, g, b));
    let expected = kiln::scene::Layers {
        ior: 1.33,
        specular: 0.5,
        specular_colour: linear(1.0, 2.0, 0.25),
        transmission: 1.0,
        volume: Some(kiln::scene::Volume {
            attenuation_colour: linear(0.5, 1.0, 1.0),
            attenuation_distance: 4.0,
        }),
        clearcoat: 0.25,
        clearcoat_roughness: 0.0,
        sheen_colour: linear(0.1, 0.2, 0.3),
        sheen_roughness: 0.75,
    };
    assert_eq!(layers(0), expected);
    // An index below 1 is invalid and replaced by the default of the format, 1.5.
    assert_eq!(layers(1), kiln::scene::Layers::default());
    assert_eq!(
        warnings,
        ["a.gltf: material without a name: its transmissionTexture does not exist; left out"]
    );
}

/// Alpha channels become grey images, one for all materials that read it. A slot whose factor is 0 has no texture, nor
/// has the thickness, which is measured by rays.
#[test]
fn gltf_textures_of_extensions() {
    use kiln::scene::TextureSlot::{
        Clearcoat, ClearcoatRoughness, Occlusion, SheenColour, SheenRoughness, Specular, SpecularColour,
    };
    let folder = Folder::new();
    folder.write("a.png", png(1, &[[1, 2, 3, 4]]));
    image::RgbImage::from_pixel(1, 1, image::Rgb([1, 2, 3]))
        .save(folder.0.path().join("b.png"))
        .expect("a file");
    let by = |index: u32| json!({ "index": index });
    let extensions = json!({
        "KHR_materials_specular": { "specularTexture": by(0), "specularColorTexture": by(0) },
        "KHR_materials_transmission": { "transmissionFactor": 0, "transmissionTexture": by(0) },
        "KHR_materials_volume": { "thicknessFactor": 1, "thicknessTexture": by(0) },
        "KHR_materials_clearcoat": {
            "clearcoatFactor": 1, "clearcoatTexture": by(1), "clearcoatNormalTexture": by(1),
            "clearcoatRoughnessFactor": 1, "clearcoatRoughnessTexture": { "index": 1, "texCoord": 1 },
        },
        "KHR_materials_sheen": {
            "sheenColorFactor": [1, 1, 1], "sheenColorTexture": by(0),
            "sheenRoughnessFactor": 1, "sheenRoughnessTexture": by(0),
        },
    });
    // Without an alpha channel the specular factor is 1.
    let other = json!({ "KHR_materials_specular": { "specularTexture": by(1) } });
    let occlusion = |set: u32| json!({ "index": 1, "texCoord": set, "strength": 0.25 });
    let model = Model::triangle()
        .with("images", json!([{ "uri": "a.png" }, { "uri": "b.png" }]))
        .with("textures", json!([{ "source": 0 }, { "source": 1 }]))
        .with(
            "materials",
            json!([
                { "name": "m", "extensions": extensions, "occlusionTexture": occlusion(1) },
                { "extensions": other },
                { "occlusionTexture": occlusion(1) },
            ]),
        )
        .with("extensionsUsed", json!(extensions.as_object().expect("an object").keys().collect::<Vec<_>>()));
    let (scene, warnings) = folder.load("a.gltf", model.text());
    let of = |f: &kiln::scene::FurtherTexture| (f.slot, f.texture.image.0, f.texture.coordinates);
    let found: Vec<_> = scene.materials[0].further_textures().iter().map(of).collect();
    // Occlusion, on set 1, comes before the extensions; set 0 is the second one that the material uses.
    let expected = [
        (Occlusion, 1, 0),
        (Specular, 2, 1),
        (SpecularColour, 0, 1),
        (Clearcoat, 1, 1),
        (ClearcoatRoughness, 1, 0),
        (SheenColour, 0, 1),
        (SheenRoughness, 2, 1),
    ];
    assert_eq!(found, expected);
    assert_eq!(scene.images[2].pixels, [[4u8; 3]].into_iter().collect());
    assert!(scene.images[2].name.ends_with("image 0, alpha") && scene.images.len() == 3);
    assert!(scene.materials[1].further_textures().is_empty());
    // The only texture, so that the first coordinates of the mesh are of its set.
    let Material::MetallicRoughness(occluded) = &scene.materials[2] else { panic!("{:?}", scene.materials) };
    assert_eq!((occluded.further_textures.len(), occluded.occlusion_strength), (1, 0.25));
    assert_eq!(warnings, ["a.gltf: 1 material(s) have a normal map of their clear coat; not used",]);
}

/// KHR_materials_pbrSpecularGlossiness takes precedence over the core model; the glossiness in the alpha channel
/// becomes roughness: 255 - 0.5 x 100 = 205.
#[test]
fn gltf_specular_glossiness_becomes_metallic_roughness() {
    let folder = Folder::new();
    folder.write("a.png", png(1, &[[1, 2, 3, 100]]));
    let name = "KHR_materials_pbrSpecularGlossiness";
    let value = json!({
        "diffuseFactor": [0.5, 2, 0.25, 1], "diffuseTexture": { "index": 0 }, "specularFactor": [0.1, 0.2, 0.3],
        "glossinessFactor": 0.5, "specularGlossinessTexture": { "index": 0 },
    });
    let pbr = json!({ "baseColorFactor": [0, 0, 0, 1], "metallicFactor": 1 });
    let model = Model::triangle()
        .with("images", json!([{ "uri": "a.png" }]))
        .with("textures", json!([{ "source": 0 }]))
        .with(
            "materials",
            json!([
                { "pbrMetallicRoughness": pbr, "extensions": { name: value } },
                { "extensions": { name: {} } },
            ]),
        )
        .with("extensionsUsed", json!([name]))
        .with("extensionsRequired", json!([name]));
    let (scene, warnings) = folder.load("a.gltf", model.text());
    assert_eq!(warnings, [""; 0]);
    let [Material::MetallicRoughness(m), Material::MetallicRoughness(plain)] = &scene.materials[..2] else {
        panic!("{:?}", scene.materials)
    };
    assert_eq!(m.base_colour, Colour::Linear(v(0.5, 1.0, 0.25)));
    assert_eq!(m.base_colour_texture.map(|t| t.image.0), Some(0));
    assert_eq!((m.metallic, m.roughness, m.layers.ior, m.layers.specular), (0.0, 1.0, 0.0, 1.0));
    assert_eq!(m.layers.specular_colour, Colour::Linear(v(0.1, 0.2, 0.3)));
    assert_eq!(m.further_textures[0].slot, kiln::scene::TextureSlot::SpecularColour);
    let roughness = m.metallic_roughness_texture.expect("the glossiness, converted").image.0;
    assert_eq!(scene.images[roughness as usize].pixels, [[205u8; 3]].into_iter().collect());
    // All defaults of the extension are 1: a mirror.
    assert_eq!((plain.metallic, plain.roughness, plain.layers.ior), (0.0, 0.0, 0.0));
    assert_eq!(plain.layers.specular_colour, Colour::Linear(DVec3::ONE));
}

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
    ] {
        assert_eq!(fails(keys), (format!("a.toml:1: {what}"), hint.to_owned()), "{keys}");
    }
}

#[test]
fn environments_are_read_or_refused() {
    let scene =
        |section: &str| Folder::new().load("a.toml", format!("[environment]\n{section}\n").as_bytes()).0;
    let environment = |section: &str| scene(section).environment.expect("an environment");
    let sky = environment("sky = true\nrotation = 180\nintensity = 2\nhide = true");
    assert_eq!(sky.source, kiln::scene::EnvironmentSource::Sky);
    assert_eq!((sky.rotation, sky.intensity, sky.is_hidden), (std::f64::consts::PI, 2.0, true));
    let fails = |section: &str| {
        let e = Folder::new().fails("a.toml", format!("[environment]\n{section}\n").as_bytes());
        (message(&e), e.hint().to_owned())
    };
    let one = "give one of `file`, `sky = true` and `colour`";
    for section in ["", "sky = true\ncolour = '#808080'"] {
        assert_eq!(
            fails(section),
            ("a.toml:1: an environment without one source".to_owned(), one.to_owned())
        );
    }
    let (missing, _) = fails("file = 'no.hdr'");
    assert!(missing.starts_with("no.hdr: "), "{missing}");
    let e = kiln::import::environment("#12345", &mut Warnings::default()).expect_err("five digits");
    assert!(matches!(e, Error::Usage { .. }), "{e:?}");
    assert_eq!(e.to_string(), "`#12345` is neither a colour nor a file");
}

/// An 8-bit image is an environment, decoded from sRGB, with a note: 188 is ((188 / 255 + 0.055) / 1.055)^2.4 = 0.5029.
#[test]
fn environments_of_eight_bits() {
    let folder = Folder::new();
    let file = folder.0.path().join("a.png");
    image::RgbImage::from_pixel(2, 1, image::Rgb([188; 3])).save(&file).expect("a file");
    let mut warnings = Warnings::default();
    let source = kiln::import::environment(file.to_str().expect("UTF-8"), &mut warnings).expect("an image");
    let kiln::scene::EnvironmentSource::Image(image) = source else { panic!("{source:?}") };
    assert!((image.pixels[0][0] - 0.5029).abs() < 1e-4, "{:?}", image.pixels);
    assert!(warnings.notes()[0].contains("no light brighter than white"), "{:?}", warnings.notes());
}

#[test]
fn gltf_that_is_something_else() {
    for bytes in [&b"not json"[..], b"", b"glTF\x02\0\0\0\xFF\xFF\xFF\xFF", b"{}"] {
        let e = Folder::new().fails("a.gltf", bytes);
        assert!(message(&e).starts_with("a.gltf: not a usable glTF file"), "{e}");
    }
}

// -------------------------------------------------------------------------------------------------------- scene files

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
        "only a spot or a rectangle has `look_at`",
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
        "[[light]]\ntype = 'sphere'\nposition = [0, 1, 0]\nradius = 0\n",
        "1: `radius` holds 0",
        "a light without size is a `point` or a `spot`",
    ),
    (
        "[[light]]\ntype = 'point'\nposition = [0, 1, 0]\nradius = 1\n",
        "1: light `light 0` has a `radius`",
        "only a sphere has `radius`",
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

/// An ASCII PLY file with `count` vertices, from its fourth line on `rest`: line 7.
fn ply(count: &str, rest: &str) -> String {
    let xyz = "property float x\nproperty float y\nproperty float z";
    format!("ply\nformat ascii 1.0\nelement vertex {count}\n{xyz}\n{rest}")
}

#[test]
fn faults_of_ply_files_have_their_line_and_advice() {
    let folder = Folder::new();
    let one = |text: &str| format!("ply\nelement vertex 1\n{text}\n");
    let faces = |text: &str| {
        ply("3", &format!("element face 1\nproperty {text}\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"))
    };
    let cases = [
        (String::new(), "a.ply:1: a PLY file begins with `ply`", "as PLY"),
        ("plyx\n".into(), "a.ply:1: a PLY file begins with `ply`", "as PLY"),
        ("ply".into(), "a.ply:1: the header does not end with a line `end_header`", "again"),
        ("ply\nend_header\n".into(), "a.ply:2: the header has no line `format`", "again"),
        (
            "ply\nformat asci 1.0\n".into(),
            "a.ply:2: not a format of PLY files after `format`",
            "correct the header",
        ),
        ("ply\nelement vertex -1\n".into(), "a.ply:2: `element` without a number of elements", "correct"),
        ("ply\nproperty int x\n".into(), "a.ply:2: a property before the first element", "correct"),
        ("ply\nelements 3\n".into(), "a.ply:2: not a statement of PLY headers", "correct"),
        (one("property list int"), "a.ply:3: a property without a type or a name", "correct"),
        (one("property half x"), "a.ply:3: `property` of a type that PLY files do not have", "correct"),
        (
            one("property list half int x"),
            "a.ply:3: `property` of a type that PLY files do not have",
            "correct",
        ),
        (one("format ascii 1.0\nend_header"), "a.ply:2: its vertices have no `x`, `y` and `z`", "again"),
        // Three digits and three separators each, the last of which may be missing; three lines of six bytes and that
        // one.
        (ply("2", "end_header\n1e 0 0\n0 0 0\n"), "a.ply:8: not a number", "again"),
        (ply("2", "end_header\n0 0\n0 0 0 0 0\n"), "a.ply:8: fewer values than the header says", "again"),
        (ply("0", "element vertex 1\nend_header\n"), "a.ply:7: its vertices have no", "again"),
        (
            ply("1", "element vertex 0\nproperty int x\nend_header\n0 0 0\n"),
            "a.ply:7: a second element `vertex`",
            "again",
        ),
        (
            faces("list uchar int vertex_index"),
            "a.ply:13: vertex 3 does not exist; there are 3 before the faces, counted from 0",
            "again",
        ),
        (faces("list uchar int vertices"), "a.ply:7: its faces have no `vertex_indices`", "again"),
    ];
    for (text, expected, hint) in cases {
        let e = folder.fails("a.ply", &text);
        let said = e.to_string().replace(&format!("{}/", folder.0.path().display()), "");
        assert!(
            said.starts_with(expected) && said.lines().count() == 1,
            "{text}\nsaid {said}\nnot  {expected}"
        );
        assert!(e.hint().contains(hint), "{text}\nhint {}", e.hint());
    }
    // Errors in binary data name the byte: after 3 f32 a vertex, the list's length and an index.
    let text = faces("list uchar int vertex_index").replace("ascii", "binary_little_endian");
    let header = text.find("end_header\n").expect("a header") + "end_header\n".len();
    let mut bytes = text.as_bytes()[..header].to_vec();
    bytes.extend([0; 36]);
    bytes.extend([3, 9, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    let e = folder.fails("a.ply", &bytes);
    let place = format!("a.ply: byte {}: vertex 9 does not exist", header + 36 + 1 + 3 * 4);
    assert!(e.to_string().contains(&place), "{e}");
}

/// Files with fewer elements than declared: the complete ones are used, with a warning.
#[test]
fn ply_files_that_are_shorter_than_their_header() {
    let folder = Folder::new();
    for (count, rows, there) in
        [("4", "0 0 0\n0 0 0\n0 0 0\n", 3), ("18446744073709551615", "0 0 0\n", 1), ("2", "0 0 0 0 0 0\n", 1)]
    {
        let (_, warnings) = folder.load("a.ply", ply(count, &format!("end_header\n{rows}")));
        let what = format!(
            "a.ply: ends after {there} of {count} elements (vertex); the complete elements are drawn"
        );
        assert_eq!(warnings[0], what);
    }
}

#[test]
fn ply_and_stl_become_meshes_as_obj_does() {
    let (scene, warnings) = fixture("square.ply");
    assert_eq!(warnings, [""; 0]);
    let square = mesh(&scene, 0);
    assert_eq!(square.triangles, [[0, 1, 2], [0, 2, 3], [4, 5, 6]]);
    assert_eq!(scene.objects[0].name, "square");
    let colours = &square.colours.as_ref().expect("colours").values;
    assert_eq!(colours[1..4], [DVec3::Y, DVec3::Z, DVec3::ONE]);
    // The same in OBJ: the same mesh and material.
    let folder = Folder::new();
    let obj = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0 1 1 1\nv 2 0 0 1 0 0\nv 3 0 0 1 0 0\nv 2 1 0 1 0 0\n\
               f 1 2 3 4\nf 5 6 7\n";
    let (of_obj, _) = folder.load("square.obj", obj);
    assert_eq!(mesh(&of_obj, 0), square);
    let material = |scene: &Scene| format!("{:?}", scene.materials[scene.objects[0].material.0 as usize]);
    assert_eq!(material(&of_obj), material(&scene));

    let (scene, warnings) = fixture("tetrahedron.stl");
    assert_eq!((warnings.len(), scene.objects[0].name.as_str()), (0, "tetrahedron"));
    let tetrahedron = mesh(&scene, 0);
    assert_eq!((tetrahedron.positions.len(), tetrahedron.triangles.len()), (4, 4));
    // Every edge has one triangle on each side.
    let edges = tetrahedron.triangles.iter().flat_map(|[a, b, c]| [(a, b), (b, c), (c, a)]);
    let mut passed: Vec<_> = edges.map(|(a, b)| if a < b { (a, b, 1) } else { (b, a, -1) }).collect();
    passed.sort_unstable();
    assert!(passed.chunks(2).all(|pair| pair[0].2 + pair[1].2 == 0), "{passed:?}");

    // In a scene file, together with other objects.
    let fixtures = repository("assets/import").display().to_string();
    let toml =
        format!("[[mesh]]\nfile = '{fixtures}/square.ply'\n[[mesh]]\nfile = '{fixtures}/tetrahedron.stl'\n");
    assert_eq!(folder.load("a.toml", toml).0.primitive_count(), 3 + 4);
}

/// Colours of faces are linear in a scene: red and blue are 1, 0, 0 and 0, 0, 1 in any encoding.
#[test]
fn off_and_3mf_become_meshes() {
    let (scene, warnings) = fixture("square.off");
    assert_eq!(warnings, [""; 0]);
    let square = mesh(&scene, 0);
    assert_eq!(square.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(square.colours.as_ref().expect("colours").values, [DVec3::X, DVec3::Z]);
    assert_eq!(seen(scene, [0.0, 0.0], [1.0, 1.0], [2, 2])[3], [255, 0, 0]);

    let (scene, warnings) = fixture("tetrahedron.3mf");
    assert_eq!((warnings, scene.objects[0].name.as_str()), (Vec::new(), "tetrahedron"));
    // Twice as large, and moved by 5 in x.
    assert_eq!(scene.bounds(), Some((v(5.0, 0.0, 0.0), v(7.0, 2.0, 2.0))));
    assert_eq!(mesh(&scene, 0).colours.as_ref().expect("colours").values.len(), 1);
}

/// Standard input has no name, so its first bytes tell the format.
#[test]
fn formats_are_known_by_their_first_word() {
    let body = "3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let read = |text: &str| {
        kiln::import::load_bytes(
            text.as_bytes().to_vec(),
            &ImportOptions::default(),
            &mut Warnings::default(),
        )
    };
    for head in ["OFF\n", "off\n", "# by hand\n\n  # again\r\nOFF # x\n", "\u{feff}Off\n", "OFF", "cOff#x\n"]
    {
        let scene = read(&format!("{head}{body}")).unwrap_or_else(|e| panic!("{head}: {e}"));
        assert_eq!(scene.primitive_count(), 1, "{head}");
    }
    let fault = |text: &str| read(text).expect_err("it is no mesh").to_string();
    assert!(fault("# x\n4OFF\n").contains("not three-dimensional"), "{}", fault("4OFF\n"));
    let [header, rows] =
        ["element face 1\nproperty list uchar int vertex_index\n", "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"];
    let of_ply = ply("3", &format!("{header}end_header\n{rows}")).replacen("ply\n", "ply  \n", 1);
    assert_eq!(read(&of_ply).expect("a triangle").primitive_count(), 1);
    assert!(fault(&of_ply.replacen("ply", "PLY", 1)).contains("begins with `ply`"));
    assert_eq!(read("\u{feff}{\"asset\": {\"version\": \"2.0\"}}").expect("no mesh").primitive_count(), 0);
    // Scene files may begin with a comment, too, and keys may begin with the word.
    assert!(fault("# x\noffset = 1\n").contains("offset"), "{}", fault("# x\noffset = 1\n"));
}

/// A 3MF file of one part.
fn three_mf(resources: &str, build: &str) -> Vec<u8> {
    let text = format!("<model><resources>{resources}</resources><build>{build}</build></model>");
    let mut out = Vec::new();
    let mut archive = rawzip::ZipArchiveWriter::new(&mut out);
    let method = rawzip::CompressionMethod::DEFLATE;
    let start = archive.new_file("3D/3dmodel.model").compression_method(method).start();
    let (mut entry, config) = start.expect("a name");
    let encoder = flate2::write::DeflateEncoder::new(&mut entry, flate2::Compression::fast());
    let mut writer = config.wrap(encoder);
    writer.write_all(text.as_bytes()).expect("memory");
    let (encoder, descriptor) = writer.finish().expect("memory");
    encoder.finish().expect("memory");
    entry.finish(descriptor).expect("memory");
    archive.finish().expect("memory");
    out
}

/// Lists of a 3MF file are refused before they exceed the memory limit, of which 64 MiB are left. A reference takes
/// 168 bytes, and an empty object as much: 400,000 take 64 MiB.
#[test]
fn lists_of_3mf_files_are_checked_before_memory_is_allocated() {
    let folder = Folder::new();
    let mesh = "<object id=\"1\"><mesh/></object>";
    let many = |text: &str| text.repeat(400_000);
    let components = many("<component objectid=\"1\"/>");
    let objects: String = (0..400_000).map(|id| format!("<object id=\"{id}\"><mesh/></object>")).collect();
    for (resources, build) in [
        (mesh.to_owned(), many("<item objectid=\"1\"/>")),
        (format!("{mesh}<object id=\"2\"><components>{components}</components></object>"), String::new()),
        (objects, String::new()),
    ] {
        let file = folder.write("a.3mf", three_mf(&resources, &build));
        let kiln = std::process::Command::new(env!("CARGO_BIN_EXE_kiln"))
            .args(["info", "--memory-limit", "128M"])
            .arg(&file)
            .output()
            .expect("kiln runs");
        let said = String::from_utf8_lossy(&kiln.stderr);
        assert_eq!(kiln.status.code(), Some(3), "{said}");
        assert!(said.contains("a.3mf: 3D/3dmodel.model: more than "), "{said}");
        assert!(said.contains(" of 128 MiB are left (--memory-limit)"), "{said}");
    }
}

#[test]
fn what_ply_and_stl_files_lack_is_said() {
    let folder = Folder::new();
    let (scene, warnings) = folder.load("a.ply", ply("1", "end_header\n0 0 0\n"));
    assert_eq!(scene.primitive_count(), 0);
    assert_eq!(warnings, ["a.ply: 1 vertices without faces; points are not drawn"]);
    let two = "element face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0 1\n1 0 0\nnan 1 0\n2 0 1 7\n";
    let (_, warnings) = folder.load("a.ply", ply("3", two));
    assert_eq!(
        warnings,
        [
            "a.ply: 2 line(s) have surplus values, which are left out",
            "a.ply: 3 vertices without faces; points are not drawn",
            "a.ply: left out 1 face(s) of fewer than three corners",
        ]
    );
    let (scene, warnings) = folder.load("a.stl", "solid a\n");
    assert_eq!(scene.primitive_count(), 0);
    assert_eq!(warnings, ["a.stl: ends without `endsolid`, so it may not be whole"]);
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
        [[light]]\ntype = 'rectangle'\nposition = [0, 3, 0]\nlook_at = [4, 0, 0]\nsize = [2, 1]\n";
    let (scene, warnings) = Folder::new().load("a.toml", text);
    assert_eq!(warnings, [""; 0]);
    let kinds: Vec<&LightKind> = scene.lights.iter().map(|light| &light.kind).collect();
    let [sun, ball, panel] = kinds[..] else { panic!("{kinds:?}") };
    assert_eq!(*sun, LightKind::Directional { direction: -DVec3::Y, angle: 0.5f64.to_radians() });
    assert_eq!(*ball, LightKind::Sphere { position: DVec3::new(1.0, 2.0, 3.0), radius: 0.25 });
    let LightKind::Rectangle { position, direction, up, size } = *panel else { panic!("{panel:?}") };
    assert_eq!((position, up, size), (DVec3::Y * 3.0, DVec3::Y, [2.0, 1.0]));
    assert!((direction - DVec3::new(0.8, -0.6, 0.0)).length() < 1e-15, "{direction}");
    // They are ignored when a camera is fitted.
    assert_eq!(scene.bounds(), None);
}

#[test]
fn every_importer_has_a_row_in_the_docs_and_a_fixture() {
    let page =
        std::fs::read_to_string(repository("docs/command-line.md")).expect("the page of the command line");
    let mut files = Vec::new();
    for folder in ["assets/import", "scenes"] {
        let entries = std::fs::read_dir(repository(folder)).expect("a folder of fixtures");
        files.extend(entries.map(|entry| entry.expect("an entry").path()));
    }
    for importer in kiln::import::IMPORTERS {
        let endings: Vec<String> = importer.endings.iter().map(|ending| format!("`.{ending}`")).collect();
        let row = format!("\n| {} | {} | ", importer.name, endings.join(", "));
        assert!(page.contains(&row), "docs/command-line.md has no row {row:?}");
        let is_its = |file: &&PathBuf| {
            file.extension().is_some_and(|e| importer.endings.iter().any(|ending| e == *ending))
        };
        let fixture = files.iter().find(is_its);
        let fixture = fixture.unwrap_or_else(|| panic!("no fixture of {} in assets/import", importer.name));
        assert!(load(fixture).0.primitive_count() > 0, "{} is empty", fixture.display());
    }
}

#[test]
fn inputs_that_are_not_there_or_not_known() {
    let folder = Folder::new();
    let fails = |name: &str| {
        let file = folder.0.path().join(name);
        kiln::import::load(&[file], &mut Warnings::default()).expect_err("it cannot be read")
    };
    assert_eq!(message(&fails("gone.obj")), "gone.obj: no such file");
    folder.write("a.3ds", "MM");
    let e = fails("a.3ds");
    assert_eq!(message(&e), "a.3ds: not a kind of file that kiln reads");
    assert!(e.hint().contains(".toml, .obj, .gltf, .glb, .ply, .stl, .off, .3mf"), "{}", e.hint());
    std::fs::create_dir(folder.0.path().join("folder.obj")).expect("the folder can be made");
    assert_eq!(message(&fails("folder.obj")), "folder.obj: is a folder");
}

#[test]
fn obj_faces_of_two_corners_are_reported() {
    let (scene, warnings) = Folder::new().load("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2\n");
    assert_eq!(scene.primitive_count(), 1);
    assert_eq!(warnings, ["a.obj:5: a face of 2 corner(s); such faces are not drawn"]);
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
    let mut options = kiln::scene::ImportOptions::default();
    options.reading.variant = Some("red".into());
    let scene = kiln::import::load_with(&[file], &options, &mut Warnings::default()).expect("a scene");
    assert_eq!(scene.materials[scene.objects[0].material.0 as usize].name(), "painted");
}

/// The display window of an OpenEXR file is the picture: 0 beside the data window, which may reach beyond it.
#[test]
fn exr_files_are_placed_by_their_windows() {
    use exr::prelude::WritableImage;
    use exr::prelude::{Encoding, Image, IntegerBounds, Layer, LayerAttributes, SpecificChannels, Vec2};
    let folder = Folder::new();
    let file = folder.0.path().join("a.exr");
    // Two pixels, 1 and 2, the first at (x, y).
    let red = |at: (i32, i32), display: IntegerBounds| {
        let attributes = LayerAttributes { layer_position: Vec2(at.0, at.1), ..LayerAttributes::default() };
        let channels = SpecificChannels::rgb(|at: Vec2<usize>| (at.x() as f32 + 1.0, 0.0f32, 0.0f32));
        let mut image = Image::from_layer(Layer::new((2, 1), attributes, Encoding::UNCOMPRESSED, channels));
        image.attributes.display_window = display;
        image.write().to_file(&file).expect("the file is written");
        let read = kiln::film::read::read_picture(&file).map_err(|e| e.to_string())?;
        Ok::<_, String>((read.width, read.height, read.values.iter().map(|[r, ..]| *r).collect::<Vec<_>>()))
    };
    let window = |x: i32, y: i32, width: usize, height: usize| IntegerBounds::new((x, y), (width, height));
    assert_eq!(red((5, -3), window(5, -3, 2, 1)), Ok((2, 1, vec![1.0, 2.0])));
    assert_eq!(red((1, 1), window(0, 0, 4, 2)), Ok((4, 2, vec![0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 0.0])));
    assert_eq!(red((-1, 0), window(0, 0, 2, 1)), Ok((2, 1, vec![2.0, 0.0])));
    assert_eq!(red((0, 0), window(0, 0, 1, 1)), Ok((1, 1, vec![1.0])));
    assert_eq!(red((7, 9), window(0, 0, 2, 1)), Ok((2, 1, vec![0.0, 0.0])));
    // Outside of an opaque data window the picture is transparent.
    red((1, 1), window(0, 0, 4, 2)).expect("a picture");
    let alpha = kiln::film::read::read_picture(&file).map(|read| read.alpha);
    assert_eq!(alpha.unwrap(), Some(vec![0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0]));
    red((5, -3), window(5, -3, 2, 1)).expect("a picture");
    assert_eq!(kiln::film::read::read_picture(&file).map(|read| read.alpha).unwrap(), None);
    let huge = red((0, 0), window(0, 0, 1 << 20, 1 << 20)).expect_err("too large");
    assert!(huge.contains("a picture of 1048576 x 1048576 pixels"), "{huge}");
}
