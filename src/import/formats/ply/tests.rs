//! PLY files made by hand, whole and damaged.

use crate::import::formats::ply::*;
use crate::scene::{Shape, TextureSlot};

fn read_bytes(bytes: Vec<u8>) -> Result<(Mesh, Warnings)> {
    let mut warnings = Warnings::default();
    let mut scene = read(&Source::of("a.ply", bytes), &mut warnings)?;
    let Some(Shape::Mesh(mesh)) = scene.objects.pop().map(|object| object.shape) else { panic!("one mesh") };
    Ok((mesh, warnings))
}

/// A value of an element: as text, and as bytes, most significant first.
type Value = (String, Vec<u8>);

/// A unit square and a triangle beside it, with properties and elements that are skipped, in any encoding and line end.
fn file(encoding: &str, end: &str) -> Vec<u8> {
    let header = format!(
        "ply\nformat {encoding} 1.0\ncomment made by hand\nelement camera 1\nproperty list uchar short shape\n\
         element vertex 5\nproperty double x\nproperty float y\nproperty int z\nproperty list ushort char tags\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nproperty char alpha\n\
         property short nx\nproperty uint ny\nproperty float nz\n\
         element face 2\nproperty uchar flags\nproperty list uchar uint vertex_indices\nelement nothing 7\nend_header\n"
    );
    let mut out = header.replace('\n', end).into_bytes();
    let int = |n: i64, size: usize| (n.to_string(), n.to_be_bytes()[8 - size..].to_vec());
    let float = |x: f32| (x.to_string(), x.to_be_bytes().to_vec());
    let double = |x: f64| (x.to_string(), x.to_be_bytes().to_vec());
    let mut line = |values: Vec<Value>| {
        let words: Vec<&str> = values.iter().map(|(word, _)| word.as_str()).collect();
        match encoding {
            "ascii" => out.extend(format!("{}{end}", words.join(" ")).bytes()),
            "binary_big_endian" => out.extend(values.iter().flat_map(|(_, bytes)| bytes)),
            _ => out.extend(values.iter().flat_map(|(_, bytes)| bytes.iter().rev())),
        }
    };
    line(vec![int(2, 1), int(-3, 2), int(4, 2)]);
    for (x, y) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (-2.5, 0.5)] {
        let tags = [int(1, 2), int(-1, 1)];
        let colour = [int(255, 1), int(51, 1), int(0, 1), int(-1, 1)];
        let normal = [int(-1, 2), int(4_000_000_000, 4), float(0.25)];
        line([double(x), float(y), int(-7, 4)].into_iter().chain(tags).chain(colour).chain(normal).collect());
    }
    line(vec![int(9, 1), int(4, 1), int(0, 4), int(1, 4), int(2, 4), int(3, 4)]);
    line(vec![int(9, 1), int(3, 1), int(0, 4), int(3, 4), int(4, 4)]);
    out
}

/// Corner (0, 0) of the file is the lower left of the image, where v of the scene is 1.
#[test]
fn texture_coordinates_of_vertices() {
    for [u, v] in [["u", "v"], ["s", "t"], ["texture_u", "texture_v"]] {
        let text = format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
             property float {u}\nproperty float {v}\nelement face 1\nproperty list uchar int vertex_indices\n\
             end_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 0.75\n3 0 1 2\n"
        );
        let (mesh, warnings) = read_bytes(text.into_bytes()).expect("a mesh");
        let uvs = [[0.0, 1.0], [1.0, 1.0], [0.0, 0.25]].map(DVec2::from_array);
        assert_eq!(mesh.uvs[0].values, uvs);
        assert!(warnings.is_empty());
    }
}

/// Of a strip, every second triangle is turned, so that all have the orientation of the first; -1 begins a new strip.
#[test]
fn triangle_strips() {
    let text = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
                element tristrips 1\nproperty list int int vertex_indices\nend_header\n\
                0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n9 0 1 2 3 4 -1 2 3 4\n";
    let (mesh, _) = read_bytes(text.into()).expect("a mesh");
    assert_eq!(mesh.triangles, [[0, 1, 2], [2, 1, 3], [2, 3, 4], [2, 3, 4]]);
    let fault = read_bytes(text.replace("3 4 -1", "3 5 -1").into()).expect_err("no such vertex");
    assert!(fault.to_string().contains("vertex 5 does not exist"), "{fault}");
}

#[test]
fn texture_coordinates_of_faces_are_named() {
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                element face 1\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n\
                0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 1 0 0 1\n";
    let (mesh, warnings) = read_bytes(text.into()).expect("a mesh");
    assert_eq!(mesh.triangles.len(), 1);
    assert!(format!("{warnings:?}").contains("texcoord"));
}

#[test]
fn every_encoding_and_line_end_says_the_same() {
    let positions = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (-2.5, 0.5)];
    // 51 / 255 = 0.2, which sRGB decodes to ((0.2 + 0.055) / 1.055)^2.4.
    let colour = DVec3::new(1.0, (0.255f64 / 1.055).powf(2.4), 0.0);
    let expected = Mesh {
        positions: positions.map(|(x, y)| DVec3::new(x, y, -7.0)).into(),
        triangles: vec![[0, 1, 2], [0, 2, 3], [0, 3, 4]],
        normals: Some(Attribute::per_position(vec![DVec3::new(-1.0, 4e9, 0.25); 5])),
        colours: Some(Attribute::per_position(vec![colour; 5])),
        ..Mesh::default()
    };
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for end in ["\n", "\r\n", "\r"] {
            let (mesh, warnings) = read_bytes(file(encoding, end)).expect("a whole file");
            assert_eq!(mesh, expected, "{encoding}, {end:?}");
            assert!(warnings.is_empty(), "{warnings:?}");
        }
    }
    // 16-bit integer channels, and floating-point channels from 0 to 1: 0.2 again. Also alternative names of properties
    // and of the list.
    for (scalar, value) in [("ushort", "13107"), ("float", "0.2")] {
        let text = format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
             property {scalar} diffuse_red\nproperty {scalar} diffuse_green\nproperty {scalar} diffuse_blue\n\
             element face 1\nproperty list uchar int vertex_index\nend_header\n\n\
             0 0 0 {value} 0 0\n1 0 0 0 0 0\n0 1 0 0 0 0\n3 0 1 2"
        );
        let colours = read_bytes(text.into()).expect("a whole file").0.colours.expect("colours").values;
        assert!((colours[0] - DVec3::X * colour.y).abs().max_element() < 1e-15, "{colours:?}");
    }
}

/// A truncated file is read up to the last complete element, with a warning; a truncated header is an error. Vertices
/// and triangles are the first ones of the whole file.
#[test]
fn files_that_are_cut_off_are_read_as_far_as_they_go() {
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let whole = file(encoding, "\n");
        let header = whole.windows(10).position(|word| word == b"end_header").expect("a header") + 11;
        let (expected, _) = read_bytes(whole.clone()).expect("a whole file");
        // ASCII data is complete without the last terminator.
        let end = whole.len() - usize::from(encoding == "ascii");
        for length in 0..end {
            let read = read_bytes(whole[..length].to_vec());
            if length < header {
                assert!(read.is_err(), "{encoding}, {length} bytes");
                continue;
            }
            let (mesh, warnings) = read.unwrap_or_else(|e| panic!("{encoding}, {length} bytes: {e}"));
            assert!(mesh.positions.len() <= 5 && mesh.triangles.len() <= 3);
            // The last number of ASCII data may be truncated.
            let whole_rows = if encoding == "ascii" { mesh.positions.len().saturating_sub(1) } else { 5 };
            let count = mesh.positions.len().min(whole_rows);
            assert_eq!(mesh.positions[..count], expected.positions[..count], "{encoding}, {length} bytes");
            if encoding != "ascii" {
                assert_eq!(mesh.triangles[..], expected.triangles[..mesh.triangles.len()]);
                assert!(warnings.messages()[0].contains("ends after"), "{warnings:?}");
            }
        }
        let (mesh, warnings) = read_bytes(whole[..end - 2].to_vec()).expect("a mesh");
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]], "{encoding}");
        let what = "a.ply: ends after 1 of 2 elements (face); the complete elements are drawn";
        assert_eq!(warnings.messages(), [what], "{encoding}");
        let (_, warnings) = read_bytes([&whole[..], b"more"].concat()).expect("a mesh");
        assert_eq!(warnings.messages(), ["a.ply: left out 4 byte(s) after the last element"], "{encoding}");
    }
    // A declared number beyond any file size.
    let text =
        String::from_utf8(file("ascii", "\n")).expect("ASCII").replace("face 2", "face 18446744073709551615");
    assert_eq!(read_bytes(text.into()).expect("a mesh").0.triangles.len(), 3);
}

const SQUARE: &str = "property float x\nproperty float y\nproperty float z";

/// An ASCII file of a unit square as two triangles: properties of vertices and faces, and their values in rows.
fn square(comments: &str, vertex: [&str; 2], face: [&str; 2], values: [&str; 2]) -> Vec<u8> {
    let rows: Vec<String> =
        ["0 0 0", "1 0 0", "1 1 0", "0 1 0"].iter().map(|row| format!("{row} {}", vertex[1])).collect();
    format!(
        "ply\r\nformat ascii 1.0\n{comments}element vertex 4\n{SQUARE}\n{}element face 2\n\
         property list uchar int vertex_index\n{}end_header\n{}\n3 0 1 2 {}\n3 0 2 3 {}\n",
        vertex[0],
        face[0],
        rows.join("\n"),
        values[0],
        values[1]
    )
    .into_bytes()
}

fn declared(scalar: &str, names: &[&str]) -> String {
    names.iter().map(|name| format!("property {scalar} {name}\n")).collect()
}

/// 51 of 255, 13107 of 65535 and 0.2 are the same display value, ((0.2 + 0.055) / 1.055)^2.4 in linear light.
#[test]
fn colours_of_vertices_and_faces_by_every_name_and_type() {
    let linear = DVec3::new((0.255f64 / 1.055).powf(2.4), 0.0, 1.0);
    for names in [["red", "green", "blue", "alpha"], ["r", "g", "b", "a"], ["Red", "Green", "Blue", "Alpha"]]
    {
        for (scalar, row) in [
            ("uchar", "51 0 255 51"),
            ("uint8", "51 0 255 51"),
            ("int", "51 0 255 51"),
            ("ushort", "13107 0 65535 13107"),
            ("float", "0.2 0 1 0.2"),
            ("double", "0.2 0 1 0.2"),
            ("float", "51 0 255 51"),
        ] {
            let properties = declared(scalar, &names);
            let of_vertices = square("", [&properties, row], ["", ""], ["", ""]);
            let of_faces = square("", ["", ""], [&properties, ""], [row, row]);
            for (bytes, count) in [(of_vertices, 4), (of_faces, 2)] {
                let (mesh, warnings) = read_bytes(bytes).expect("a square");
                let colours = mesh.colours.expect("colours");
                assert_eq!(colours.values.len(), count, "{scalar} {names:?}");
                for colour in colours.values {
                    assert!((colour - linear).length() < 1e-6, "{scalar} {row}: {colour}");
                }
                let alphas = mesh.alphas.expect("opacities").values;
                assert!(alphas.iter().all(|alpha| (alpha - 0.2).abs() < 1e-6), "{scalar} {row}: {alphas:?}");
                assert!(warnings.is_empty(), "{warnings:?}");
            }
        }
    }
}

/// A second element `face` continues the first: face 3 of a strip of three triangles is blue. Colours of another type
/// would need a scale of their own.
#[test]
fn faces_of_two_elements() {
    let face =
        |properties: &str| format!("element face 1\nproperty list uchar int vertex_index\n{properties}");
    let colours = declared("uchar", &["red", "green", "blue"]);
    let rows = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
    let text = |first: &str, second: &str, values: [&str; 2]| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 4\n{SQUARE}\n{first}{second}end_header\n{rows}{}\n{}\n",
            values[0], values[1]
        )
        .into_bytes()
    };
    let faces = ["4 0 1 2 3 255 0 0", "3 1 2 3 0 0 255"];
    let (mesh, warnings) = read_bytes(text(&face(&colours), &face(&colours), faces)).expect("two faces");
    let of_faces = mesh.colours.expect("colours");
    assert_eq!(of_faces.values, [DVec3::X, DVec3::Z]);
    assert_eq!(of_faces.triangles.expect("of faces"), [[0; 3], [0; 3], [1; 3]]);
    assert!(warnings.is_empty(), "{warnings:?}");
    // Faces without colours, of lists of different types, and an empty element.
    let lists = face("").replace("uchar int", "int uint");
    let (mesh, _) = read_bytes(text(&face(""), &lists, ["4 0 1 2 3", "3 1 2 3"])).expect("two faces");
    assert_eq!((mesh.triangles.len(), mesh.colours), (3, None));
    let empty = "element face 0\n";
    let (mesh, _) = read_bytes(text(&face(&colours), empty, [faces[0], ""])).expect("a face");
    assert_eq!(mesh.colours.expect("colours").values, [DVec3::X]);
    for other in ["", &declared("float", &["red", "green", "blue"]), "property list int float texcoord\n"] {
        let fault = read_bytes(text(&face(&colours), &face(other), faces)).expect_err("two types");
        let what = "a.ply:12: a second element `face` with other colours or texture coordinates";
        assert_eq!(fault.to_string(), what, "{other}");
    }
    // Strips have no colours.
    let strips = face("").replace("face", "tristrips");
    let (mesh, warnings) =
        read_bytes(text(&face(&colours), &strips, [faces[0], "3 1 2 3"])).expect("a face and a strip");
    assert_eq!((mesh.triangles.len(), mesh.colours), (3, None));
    let what = "a.ply: colours of faces are left out, because triangle strips have none";
    assert_eq!(warnings.messages(), [what]);
}

/// Elements without properties have no bytes, however many they are.
#[test]
fn elements_without_bytes_take_no_time() {
    for (name, is_read) in [("tristrips", true), ("other", true), ("vertex", false), ("face", false)] {
        let text = format!(
            "ply\nformat binary_little_endian 1.0\nelement {name} 18446744073709551615\nend_header\n"
        );
        assert_eq!(read_bytes(text.into_bytes()).is_ok(), is_read, "{name}");
    }
}

/// Only what is scaled is noted: bytes of alpha beside colours from 0 to 1 are not.
#[test]
fn scaled_colours_are_noted() {
    let floats = declared("float", &["red", "green", "blue"]);
    let [bytes, alpha] = ["uchar", "float"].map(|scalar| floats.clone() + &declared(scalar, &["alpha"]));
    for (properties, row, expected) in [
        (&bytes, "1 0.5 0 128", &[] as &[&str]),
        (&bytes, "255 128 0 128", &["a.ply: colours up to 255 are read on a scale of 0 to 255"]),
        (&alpha, "1 0.5 0 128", &["a.ply: opacities up to 128 are read on a scale of 0 to 255"]),
        (&floats, "1.001 0.5 0", &[]),
        (&floats, "2 0 0", &["a.ply: colours up to 2 are read on a scale of 0 to 255"]),
        (&floats, "inf 1 0.5", &[]),
    ] {
        let (_, warnings) = read_bytes(square("", [properties, row], ["", ""], ["", ""])).expect("a square");
        assert_eq!(warnings.notes(), expected, "{row}");
    }
}

/// An alpha of 0 at all vertices is opaque, since some exporters do not use it; so is one of 255.
#[test]
fn alpha_throughout_is_none() {
    let properties = declared("uchar", &["red", "green", "blue", "alpha"]);
    for (row, notes) in [("1 2 3 255", 0), ("1 2 3 0", 1)] {
        let (mesh, warnings) =
            read_bytes(square("", [&properties, row], ["", ""], ["", ""])).expect("a square");
        assert!(mesh.colours.is_some() && mesh.alphas.is_none());
        assert_eq!((warnings.messages().len(), warnings.notes().len()), (0, notes), "{warnings:?}");
    }
}

/// Meshes with vertex or face colours get a white material.
#[test]
fn colours_are_not_multiplied() {
    let properties = declared("uchar", &["red", "green", "blue"]);
    let colour = |bytes: Vec<u8>| {
        let scene = read(&Source::of("a.ply", bytes), &mut Warnings::default()).expect("a square");
        let Material::Phong(material) = &scene.materials[scene.objects[0].material.0 as usize] else {
            panic!("Phong")
        };
        material.colour
    };
    let white = Colour::Display(DVec3::ONE);
    assert_eq!(colour(square("", [&properties, "200 100 50"], ["", ""], ["", ""])), white);
    assert_eq!(colour(square("", ["", ""], [&properties, ""], ["200 100 50", "1 2 3"])), white);
    assert_eq!(colour(square("", ["", ""], ["", ""], ["", ""])), Colour::from_u8([204; 3]));
}

/// Reads a file beside the images `a b.png`, red and green, and `c.png`, green and red.
fn textured_scene(bytes: Vec<u8>) -> (Scene, Warnings) {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, pixels) in [("a b.png", [255, 0, 0, 0, 255, 0]), ("c.png", [0, 255, 0, 255, 0, 0])] {
        let image = image::RgbImage::from_raw(2, 1, pixels.into()).expect("two pixels");
        image.save(folder.path().join(name)).expect("written");
    }
    let source = Source::of(folder.path().join("a.ply"), bytes);
    let mut warnings = Warnings::default();
    let scene = read(&source, &mut warnings).expect("a square");
    (scene, warnings)
}

fn texture_and_mesh(scene: &Scene, object: usize) -> (Option<[u16; 3]>, &Mesh) {
    let object = &scene.objects[object];
    let Material::Phong(material) = &scene.materials[object.material.0 as usize] else { panic!("Phong") };
    let Shape::Mesh(mesh) = &object.shape else { panic!("a mesh") };
    (
        material.textures[TextureSlot::BaseColour]
            .map(|texture| scene.images[texture.image.0 as usize].pixels.get(0)),
        mesh,
    )
}

#[test]
fn images_by_coordinates_of_vertices_and_corners() {
    let red = Some([255, 0, 0]);
    for [u, v] in [["s", "t"], ["u", "v"], ["texture_u", "texture_v"], ["tx", "ty"]] {
        let properties = declared("float", &[u, v]);
        let (scene, warnings) = textured_scene(square(
            "comment TextureFile a b.png\n",
            [&properties, "0.25 0.75"],
            ["", ""],
            ["", ""],
        ));
        let (first, mesh) = texture_and_mesh(&scene, 0);
        assert_eq!((first, mesh.uvs[0].values[0]), (red, DVec2::new(0.25, 0.25)), "{u}");
        assert!(warnings.is_empty(), "{warnings:?}");
    }
    // Corners: two faces of two images, and one of them without coordinates.
    let list = "property list uchar float texcoord\nproperty int texnumber\n";
    let comments = "comment TextureFile a b.png\ncomment TextureFile c.png\n";
    let faces = ["6 0 0 1 0 1 1 1", "6 0 0 1 1 0 1 0"];
    let (scene, warnings) = textured_scene(square(comments, ["", ""], [list, ""], faces));
    assert!(warnings.is_empty(), "{warnings:?}");
    let (first, mesh) = texture_and_mesh(&scene, 0);
    assert_eq!((scene.objects.len(), first), (2, red));
    let [a, b, c] =
        mesh.uvs[0].triangles.as_ref().expect("corners")[0].map(|i| mesh.uvs[0].values[i as usize]);
    assert_eq!([a, b, c], [[0.0, 1.0], [1.0, 0.0], [0.0, 0.0]].map(DVec2::from_array));
    let (second, mesh) = texture_and_mesh(&scene, 1);
    assert_eq!((second, mesh.triangles.len()), (Some([0, 255, 0]), 1));
    let faces = ["6 0 0 1 0 1 1 1", "0 -1"];
    let (scene, _) = textured_scene(square(comments, ["", ""], [list, ""], faces));
    assert_eq!(texture_and_mesh(&scene, 0).0, None);
    assert_eq!(texture_and_mesh(&scene, 1).0, Some([0, 255, 0]));
}

#[test]
fn images_without_coordinates_or_files_are_said() {
    let properties = declared("float", &["s", "t"]);
    let (scene, warnings) =
        textured_scene(square("comment TextureFile c.png\n", ["", ""], ["", ""], ["", ""]));
    assert!(
        texture_and_mesh(&scene, 0).0.is_none() && format!("{warnings:?}").contains("no texture coordinates")
    );
    let missing = "comment TextureFile d.png\n";
    let (scene, warnings) = textured_scene(square(missing, [&properties, "0 0"], ["", ""], ["", ""]));
    assert!(
        texture_and_mesh(&scene, 0).0.is_none() && format!("{warnings:?}").contains("d.png"),
        "{warnings:?}"
    );
}

/// Faces and strips before vertices are read as those after them, by text and by bytes.
#[test]
fn elements_in_any_order() {
    let vertices = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
    let faces = "element face 2\nproperty list uchar int vertex_indices\nproperty uchar red\n\
                 property uchar green\nproperty uchar blue\n";
    let strips = "element tristrips 1\nproperty list int int vertex_indices\n";
    let bytes = |values: &[&[u8]]| values.concat();
    let ints = |values: &[i32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let corners = [0f32, 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.].map(f32::to_le_bytes);
    let binary = [
        corners.as_flattened().to_vec(),
        bytes(&[&[3], &ints(&[0, 1, 2]), &[255, 0, 0], &[3], &ints(&[0, 2, 3]), &[0, 0, 255]]),
        ints(&[3, 0, 1, 3]),
    ];
    let text = [
        b"0 0 0\n1 0 0\n1 1 0\n0 1 0\n".to_vec(),
        b"3 0 1 2 255 0 0\n3 0 2 3 0 0 255\n".to_vec(),
        b"3 0 1 3\n".to_vec(),
    ];
    let heads = [vertices, faces, strips];
    for (encoding, rows) in [("ascii", text), ("binary_little_endian", binary)] {
        let of = |order: &[usize]| {
            let head: String = order.iter().map(|&i| heads[i]).collect();
            let head = format!("ply\nformat {encoding} 1.0\n{head}end_header\n").into_bytes();
            let rows: Vec<u8> = order.iter().flat_map(|&i| rows[i].clone()).collect();
            read_bytes([head, rows].concat()).expect("a square")
        };
        let (square, _) = of(&[0, 1]);
        assert_eq!((square.triangles.len(), square.colours.is_some()), (2, true));
        assert_eq!(of(&[1, 0]), (square, Warnings::default()), "{encoding}");
        let with_strips = of(&[0, 1, 2]);
        for order in [[1, 0, 2], [1, 2, 0]] {
            assert_eq!(of(&order), with_strips, "{encoding} {order:?}");
        }
    }
}

/// A triangle with `lines` in its header, and `rows` after its vertices.
fn triangle(lines: &str, rows: &str) -> Vec<u8> {
    format!(
        "ply\nformat ascii 1.0\n{lines}element vertex 3\n{SQUARE}\nelement face 1\n\
         property list uchar int vertex_index\nend_header\n{rows}"
    )
    .into()
}

#[test]
fn header_lines_that_are_no_statements() {
    let rows = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let (mesh, warnings) =
        read_bytes(triangle("made by X\ncomment a\nunits mm\n", rows)).expect("a triangle");
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
    let what = "a.ply: 2 line(s) that are no statements of PLY headers are skipped; the first is line 3";
    assert_eq!(warnings.messages(), [what]);
    // Lines that may be meant as statements change where values lie.
    for line in
        ["Element camera 1", "elements 3", "PROPERTY float w", "properties", "end header", "formats ascii"]
    {
        let e = read_bytes(triangle(&format!("{line}\n"), rows)).map(drop).expect_err("not a header");
        assert_eq!(e.to_string(), "a.ply:3: not a statement of PLY headers", "{line}");
    }
}

/// Blank lines and comments between rows; values over several lines, or of several elements on one.
#[test]
fn rows_of_text() {
    let (expected, _) = read_bytes(triangle("", "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")).expect("a triangle");
    for rows in [
        "# points\n0 0 0\n\ncomment 1 2 3\n1 0 0\n \n0 1 0\nobj_info x\n# faces\n3 0 1 2\n\n# the end\n\n",
        "0 0 0\n1 0 0\n0 1 0\n3\n0 1 2\n",
        "0 0\n0\n1 0 0 0 1 0\n3 0 1\n# the last\n2",
    ] {
        let (mesh, warnings) = read_bytes(triangle("", rows)).unwrap_or_else(|e| panic!("{rows}: {e}"));
        assert_eq!(mesh, expected, "{rows}");
        assert!(warnings.is_empty(), "{rows}: {warnings:?}");
    }
    // Too few values are the fault by lines, and too many are left out by lines.
    let few = read_bytes(triangle("", "0 0 0\n1 0\n0 1 0\n3 0 1 2\n")).map(drop).expect_err("a fault");
    assert_eq!(few.to_string(), "a.ply:11: fewer values than the header says");
}

/// Two vertices on a line, all on one line, and a second element of faces that ends early.
#[test]
fn lines_with_several_elements_and_late_faces() {
    let head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    for rows in ["0 0 0 1 0 0\n0 1 0\n3 0 1 2\n", "0 0 0 1 0 0 0 1 0\n3 0 1 2\n", "0 0 0 1 0 0 0 1 0 3 0 1 2"]
    {
        let (mesh, warnings) = read_bytes(format!("{head}{rows}").into_bytes()).expect("a triangle");
        assert_eq!((mesh.triangles, warnings), (vec![[0, 1, 2]], Warnings::default()), "{rows}");
    }
    let faces = "element face 1\nproperty list uchar int vertex_indices\n";
    let vertices = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
    let cut = format!(
        "ply\nformat ascii 1.0\n{faces}{vertices}{faces}end_header\n\
         3 0 1 2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1"
    );
    let (mesh, warnings) = read_bytes(cut.into_bytes()).expect("a triangle");
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
    assert!(warnings.messages()[0].contains("ends after 0 of 1 elements (face)"), "{warnings:?}");
    let binary =
        format!("ply\nformat binary_little_endian 1.0\n{vertices}propery uchar q\n{faces}end_header\n");
    let error = read_bytes(binary.into_bytes()).map(drop).expect_err("an unknown layout");
    assert!(error.to_string().contains("not a statement of PLY headers"), "{error}");
}
