//! PLY files made by hand, whole and damaged.

use super::*;
use crate::import::dependencies::Files;
use crate::scene::Shape;

fn read_bytes(bytes: Vec<u8>) -> Result<(Mesh, Warnings)> {
    let mut warnings = Warnings::default();
    let mut scene = read(
        &Source { file: "a.ply".into(), bytes, files: Files::default(), options: Default::default() },
        &mut warnings,
    )?;
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

#[test]
fn files_that_are_cut_off_are_errors_at_every_length() {
    for encoding in ["ascii", "binary_little_endian"] {
        let whole = file(encoding, "\n");
        // ASCII data is complete without the last terminator.
        let end = whole.len() - usize::from(encoding == "ascii");
        for length in 0..end {
            assert!(read_bytes(whole[..length].to_vec()).is_err(), "{encoding}, {length} bytes");
        }
    }
}
