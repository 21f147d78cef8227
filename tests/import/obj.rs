//! Import of OBJ and MTL files: scenes, errors and warnings of usual, unusual and broken ones.

use crate::common::borders::Folder;
use crate::common::gltf::Model;
use crate::common::repository;
use crate::helpers::*;
use glam::{DVec2, DVec3};
use kiln::error::Warnings;
use kiln::film::Colour;
use kiln::scene::TextureSlot::{BaseColour, Emission, MetallicRoughness, Opacity};
use kiln::scene::{Material, Object, Scene, Wrap};
use serde_json::json;

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
    assert!(pictured.textures[BaseColour].is_some() && pictured.glaze.is_none());
    let red = phong(2);
    assert_eq!(red.colour, Colour::Display(v(0.5, 0.25, 0.0)));
    assert_eq!((red.specular, red.shininess, red.textures[BaseColour]), (0.0, 10.0, None));
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

/// "The first file listed is searched first" (appendix B1, `mtllib`), also on several lines; in a file, the last
/// counts.
#[test]
fn the_first_library_that_has_a_material_counts() {
    let folder = Folder::new();
    folder.write("a.mtl", "newmtl one\nKd 0 0 1\nnewmtl one\nKd 1 0 0\n");
    folder.write("b.mtl", "newmtl one\nKd 0 1 0\nnewmtl two\nKd 0 1 0\n");
    let faces = format!("{OBJ_TRIANGLE}usemtl one\nf 1 2 3\nusemtl two\nf 1 2 3\n");
    for libraries in
        ["mtllib a.mtl b.mtl", "mtllib a.mtl\nmtllib b.mtl", "mtllib gone.mtl a.mtl\nmtllib b.mtl"]
    {
        let (scene, _) = folder.load("a.obj", format!("{libraries}\n{faces}"));
        let colour = |object: &Object| match &scene.materials[object.material.0 as usize] {
            Material::Phong(material) => material.colour,
            other => panic!("{other:?}"),
        };
        let colours: Vec<Colour> = scene.objects.iter().map(colour).collect();
        assert_eq!(colours, [Colour::Display(DVec3::X), Colour::Display(DVec3::Y)], "{libraries}");
    }
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
    assert_eq!((material.colour, material.textures[BaseColour]), (Colour::Display(DVec3::X), None));
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
    assert_eq!(pixels(maps.textures[MetallicRoughness]), [[255, 60, 90]; 2]);
    assert_eq!(pixels(maps.textures[Emission]), [[30; 3]]);
    assert_eq!(pixels(material(2).textures[MetallicRoughness]), [[255, 60, 255]; 2]);
    assert_eq!((material(2).metallic, material(2).roughness), (0.5, 1.0));
}

/// `illum` 4, 6, 7 and 9 are glass if the index is above 1, unless `Tf` is 0. Blender writes `illum 9` with `d` below 1
/// and without `Tf` for alpha. Maya writes `illum 4` for all materials, no `d`, and 1 - transparency as `Tf`: the
/// complement of the filter, and the opacity with an index of 1.
#[test]
fn mtl_of_glass() {
    for (lines, glass) in [
        ("illum 7\nNi 1.5\nTf 0.9 0.8 0.7", Some((1.5, [0.9, 0.8, 0.7]))),
        ("illum 4\nNi 1.33", Some((1.33, [1.0; 3]))),
        ("illum 4\nNi 1.6\nTf 1.00 1.00 1.00", None),
        ("illum 4\nNi 1.6\nTf 0.00 0.00 0.00", Some((1.6, [1.0; 3]))),
        ("illum 4\nNi 1.6\nTf 0.25 0.5 0.75", Some((1.6, [0.75, 0.5, 0.25]))),
        ("illum 4\nNi 1.5\nd 0.5\nTf 1 1 1", Some((1.5, [1.0; 3]))),
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
        assert!(phong.refraction.is_none() || phong.opacity.is_none(), "{lines}");
        let found = phong.refraction.map(|glass| (glass.ior, glass.filter));
        assert_eq!(found, glass.map(|(ior, filter)| (ior, Colour::Linear(filter.into()))), "{lines}");
    }
}

/// Values that programs write in a sense of their own, as kiln reads them, each with a note.
#[test]
fn mtl_values_of_exporters() {
    let four = std::fs::read(repository("assets/import/four.png")).expect("the fixture is there");
    let load = |mtl: &str| {
        let folder = Folder::new();
        folder.write("four.png", &four);
        folder.write("a.mtl", mtl);
        let mut warnings = Warnings::default();
        let obj = format!("mtllib a.mtl\n{OBJ_TRIANGLE}vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n");
        folder.write("a.obj", obj);
        let scene = kiln::import::load(&[folder.0.path().join("a.obj")], &mut warnings).expect("a scene");
        (scene.materials, [warnings.messages(), warnings.notes()].concat().join("\n"))
    };
    let colours = |mtl: &str, said: &str| {
        let (materials, notes) = load(mtl);
        assert!(if said.is_empty() { notes.is_empty() } else { notes.contains(said) }, "{mtl}: {notes}");
        let colour = |material: &Material| match material {
            Material::Phong(m) => (m.colour, m.specular, m.emission),
            Material::MetallicRoughness(m) => (m.base_colour, 0.0, m.emission),
        };
        materials.iter().map(colour).collect::<Vec<_>>()
    };
    // Maya and Google Poly: the texture, in both models; without the image as without Kd, 0.8.
    let (black, display) =
        ("a.mtl: `Kd 0 0 0` beside map_Kd is read as white", |c| Colour::Display(v(c, c, c)));
    assert_eq!(colours("newmtl a\nKd 0.00 0.00 0.00\nmap_Kd four.png\n", black)[0].0, display(1.0));
    let physically_based = colours("newmtl a\nKd 0 0 0\nPr 1\nmap_Kd four.png\n", black);
    assert_eq!(physically_based[0].0, Colour::Linear(DVec3::ONE));
    assert_eq!(colours("newmtl a\nKd 0 0 0\nmap_Kd gone.png\n", black)[0].0, display(0.8));
    assert_eq!(colours("newmtl a\nKd 0 0 0\nmap_d four.png\n", "")[0].0, display(0.0));
    assert_eq!(
        colours("newmtl a\nKd 0.5 0 0\nmap_Kd four.png\n", "")[0].0,
        Colour::Display(v(0.5, 0.0, 0.0))
    );
    // Bytes: of all materials, if Kd is whole in all; else where it is above 2. Others are divided where above 1.
    let bytes = "a.mtl: colours above 1 are read on a scale of 0 to 255: material `a`";
    let orange = Colour::Display(v(255.0, 128.0, 0.0) / 255.0);
    let mtl = "newmtl a\nKd 255 128 0\nKs 0 51 0\nNs 9\nKe 0 0 255\nnewmtl b\nKd 1 0 0\nKs 1 1 1\nNs 9\n";
    let found = colours(mtl, &format!("{bytes} and 1 more"));
    assert_eq!(found[0], (orange, 0.2, Colour::Display(DVec3::Z)));
    assert_eq!((found[1].0, found[1].1), (Colour::Display(DVec3::X / 255.0), 1.0));
    let found = colours("newmtl a\nKd 255 128 0\nnewmtl b\nKd 1 0.5 0\n", bytes);
    assert_eq!([found[0].0, found[1].0], [orange, Colour::Display(v(1.0, 0.5, 0.0))]);
    let found = colours("newmtl a\nKd 1.5 0.5 0\nKs 2 2 2\nNs 9\nKe 17 12 4\n", "");
    assert_eq!((found[0].0, found[0].1), (Colour::Display(v(1.5, 0.5, 0.0)), 2.0));
    assert_eq!(found[0].2, Colour::Display(v(17.0, 12.0, 4.0)));
    // Maya's transparency without refraction; its opaque materials of an index of 1 need no note.
    let maya = "a.mtl: `Tf` of `illum 4` without `d` is read as 1 - transparency";
    let (materials, notes) = load("newmtl a\nillum 4\nKd 1 0 0\nTf 0.25 0.50 0.75\nNi 1.00\n");
    assert_eq!(materials[0].opacity().map(|opacity| opacity.factor), Some(0.5));
    assert!(notes.contains(maya), "{notes}");
    let (materials, notes) = load("newmtl a\nillum 4\nKd 1 0 0\nTf 1.00 1.00 1.00\nNi 1.00\n");
    assert_eq!((materials[0].opacity(), notes.as_str()), (None, ""));
    assert!(load("newmtl a\nTr 1\n").1.contains("a.mtl: `Tr 1` is read as opaque"));
}

/// A texture takes the place of the colours of vertices; where there is none, they are drawn.
#[test]
fn obj_textures_instead_of_colours() {
    let folder = Folder::new();
    image::RgbImage::from_pixel(1, 1, image::Rgb([200, 100, 50]))
        .save(folder.0.path().join("t.png"))
        .expect("a file");
    folder.write("a.mtl", "newmtl a\nKd 1 1 1\nmap_Kd t.png\nnewmtl b\nKd 1 1 1\nmap_Kd gone.png\n");
    let grey = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"].map(|p| format!("v {p} 0.2 0.4 0.6\n")).concat();
    for (faces, expected) in [
        ("usemtl a\nf 1/1 2/1 3/1 4/1", [200, 100, 50]),
        ("usemtl a\nf 1 2 3 4\nf 1/1 1/1 1/1", [51, 102, 153]),
        ("usemtl b\nf 1/1 2/1 3/1 4/1", [51, 102, 153]),
        ("f 1/1 2/1 3/1 4/1", [51, 102, 153]),
    ] {
        folder.write("a.obj", format!("mtllib a.mtl\n{grey}vt 0 0\n{faces}\n"));
        let mut warnings = Warnings::default();
        let scene = kiln::import::load(&[folder.0.path().join("a.obj")], &mut warnings).expect("a scene");
        let is_said = warnings.notes().concat().contains("a.obj: colours of textured faces are left out");
        let has_texture =
            scene.objects.iter().any(|object| object.material.0 == 0 && faces.contains("usemtl a"));
        assert_eq!(is_said, has_texture, "{faces}");
        assert_eq!(seen(scene, [0.2, 0.2], [0.8, 0.8], [1, 1]), [expected], "{faces}");
    }
}

/// Textures of the formats without or beside PNG and JPEG, of OBJ, PLY and glTF. The image is 2 by 2: red and green
/// above, blue and white below.
#[test]
fn textures_of_tga_bmp_and_gif() {
    let colours = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255; 3]];
    // TGA: blue, green, red; from the bottom and from the left, unless bits 5 and 4 of the descriptor say otherwise.
    let tga = |kind: u8, depth: u8, descriptor: u8, packets: &[(&[u8], [usize; 2])]| {
        let mut bytes = vec![3, 0, kind, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 2, 0, depth, descriptor];
        bytes.extend(b"id ");
        for (packet, pixels) in packets {
            let pixel = |&i: &usize| {
                let [r, g, b] = colours[i];
                [b, g, r, 255].into_iter().take(usize::from(depth) / 8).collect::<Vec<_>>()
            };
            bytes.extend(*packet);
            bytes.extend(pixels.iter().flat_map(pixel));
        }
        bytes
    };
    let raw = |rows: [[usize; 2]; 2]| rows.map(|row| (&[] as &[u8], row));
    let encoded = |format| {
        let image = image::RgbImage::from_raw(2, 2, colours.concat()).expect("four pixels");
        let mut bytes = std::io::Cursor::new(Vec::new());
        image::DynamicImage::from(image).write_to(&mut bytes, format).expect("memory");
        bytes.into_inner()
    };
    let folder = Folder::new();
    for (name, bytes) in [
        ("bottom.tga", tga(2, 24, 0, &raw([[2, 3], [0, 1]]))),
        ("top.tga", tga(2, 24, 0x20, &raw([[0, 1], [2, 3]]))),
        ("right.tga", tga(2, 24, 0x30, &raw([[1, 0], [3, 2]]))),
        ("alpha.tga", tga(2, 32, 0x28, &raw([[0, 1], [2, 3]]))),
        // A packet of two pixels for each row.
        ("runs.tga", tga(10, 32, 8, &[(&[1], [2, 3]), (&[1], [0, 1])])),
        ("a.bmp", encoded(image::ImageFormat::Bmp)),
        ("a.gif", encoded(image::ImageFormat::Gif)),
        // Contents decide.
        ("gif.png", encoded(image::ImageFormat::Gif)),
    ] {
        folder.write(name, &bytes);
        folder.write("a.mtl", format!("newmtl a\nmap_Kd {name}\n"));
        let obj = format!("mtllib a.mtl\n{OBJ_TRIANGLE}vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n");
        let ply = format!(
            "ply\nformat ascii 1.0\ncomment TextureFile {name}\nelement vertex 3\nproperty float x\nproperty float y\n\
             property float z\nproperty float s\nproperty float t\nelement face 1\nproperty list uchar int vertex_index\n\
             end_header\n0 0 0 0 0\n1 0 0 0 0\n0 1 0 0 0\n3 0 1 2\n"
        );
        let gltf = Model::square().with_texture(name, &json!({}), &json!({})).text();
        for (file, text) in [("a.obj", obj), ("a.ply", ply), ("a.gltf", gltf)] {
            let (scene, warnings) = folder.load(file, text);
            assert_eq!(warnings, [""; 0], "{file}, {name}");
            let texels: Vec<_> = scene.images[0].pixels.iter().collect();
            assert_eq!(texels, colours.map(|colour: [u8; 3]| colour.map(u16::from)), "{file}, {name}");
        }
    }
    // Sizes are checked before memory is allocated; images that end early are left out.
    let mut large = tga(10, 32, 0, &[]);
    large[12..16].fill(255);
    let mut flat = encoded(image::ImageFormat::Gif);
    flat[6..10].fill(255);
    let mut frame = encoded(image::ImageFormat::Gif);
    let descriptor = frame.iter().position(|&byte| byte == b',').expect("an image descriptor");
    frame[descriptor + 5..descriptor + 9].fill(255);
    for (name, bytes) in [("large.tga", large), ("flat.gif", flat), ("frame.gif", frame)] {
        folder.write(name, &bytes);
        folder.write("a.mtl", format!("newmtl a\nmap_Kd {name}\n"));
        let obj = format!("mtllib a.mtl\n{OBJ_TRIANGLE}vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n");
        folder.write("a.obj", obj);
        let scene = kiln::import::load(&[folder.0.path().join("a.obj")], &mut Warnings::default());
        match (name, scene) {
            ("frame.gif", scene) => assert!(scene.expect("a scene").images.is_empty()),
            (_, scene) => {
                assert!(scene.expect_err(name).to_string().contains("65535 x 65535 pixels needs"), "{name}");
            }
        }
    }
}

/// Tiles of a texture are refused by name, unless a file has the name.
#[test]
fn udim_tiles_are_refused_by_name() {
    let folder = Folder::new();
    let said = |folder: &Folder, name: &str| {
        folder.write("a.mtl", format!("newmtl a\nmap_Kd {name}\n"));
        let obj = format!("mtllib a.mtl\n{OBJ_TRIANGLE}vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n");
        folder.load("a.obj", obj).1.concat()
    };
    for name in
        ["t.<UDIM>.png", "t.%(UDIM)d.png", "t_<UVTILE>.png", "t_u<U>_v<V>.png", "t_u1_v2.png", "u1_v1.png"]
    {
        let expected =
            format!("a.obj: texture left out: `{name}`: UDIM tiles are not read; bake them into one image");
        assert_eq!(said(&folder, name), expected);
    }
    assert_eq!(said(&folder, "menu2_v3.png"), "menu2_v3.png: texture left out: no such file");
    let uri = "t.%3CUDIM%3E.png";
    let (_, warnings) =
        folder.load("a.gltf", Model::square().with_texture(uri, &json!({}), &json!({})).text());
    assert!(warnings.concat().contains("image 0: texture left out: `t.<UDIM>.png`: UDIM tiles are not read"));
    folder.write("t_u1_v1.png", std::fs::read(repository("assets/import/four.png")).expect("a picture"));
    assert_eq!(said(&folder, "t_u1_v1.png"), "");
}

/// `-s 2 0.5 -o 0.25 -1` takes the coordinates (0.5, 0.5) to (1.25, -0.75), which is 1.75 from the top. `-clamp on`
/// holds the edge of the picture; `-bm` scales the slopes of a bump map.
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
    let wrap = |object| phong(object).textures[BaseColour].expect("a texture").sampler.wrap_u;
    assert_eq!((wrap(0), wrap(1)), (Wrap::ClampToEdge, Wrap::Repeat));
    let slope = |object| phong(object).textures.normal_scale;
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
    // Faces 2 and 3 have a vertex that is not finite, and face 6 one beyond 1e18. Faces 4 (collinear) and 5 (two equal
    // corners) are kept, so that the indices of others are those of the file.
    let text = format!(
        "{OBJ_TRIANGLE}v nan 0 0\nv 0 inf 0\nv 2 0 0\nv 1e19 0 0\n\
         f 1 2 3\nf 1 2 4\nf 1 2 5\nf 1 2 6\nf 1 2 2\nf 1 3 7\n"
    );
    let (scene, warnings) = Folder::new().load("a.obj", text);
    assert_eq!(triangles(mesh(&scene, 0))[0], TRIANGLE);
    assert_eq!(scene.primitive_count(), 3);
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
    assert_eq!(
        (m.colour, m.shininess, m.textures[BaseColour].is_some()),
        (Colour::Display(v(1.0, 0.0, 0.0)), 10.0, true)
    );
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

/// `d` is the opacity; `Tr` is its complement and used if there is no `d`, but 1 means opaque; `map_d` is a factor, the
/// alpha channel of the image or its grey values if it has none.
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
    let texture = scene.materials[2].textures()[Opacity].expect("map_d is a texture");
    assert_eq!(scene.images[texture.image.0 as usize].pixels, [[0u8; 3], [204; 3]].into_iter().collect());
}

#[test]
fn obj_faces_of_two_corners_are_reported() {
    let (scene, warnings) = Folder::new().load("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2\n");
    assert_eq!(scene.primitive_count(), 1);
    assert_eq!(warnings, ["a.obj:5: a face of 2 corner(s); such faces are not drawn"]);
}
