//! Compressed meshes and textures of glTF beside the same model without compression. `assets/import/codecs/make.mjs`
//! made the files by the reference encoders.
#![cfg(feature = "codecs")]

use glam::DVec3;
use kiln::scene::{DecodedImage, Mesh, Scene, Shape};

use crate::common::borders::Folder;
use crate::common::gltf::Model;
use crate::common::repository;

fn load(name: &str) -> Scene {
    let file = repository(&format!("assets/import/codecs/{name}.glb"));
    let mut warnings = kiln::error::Warnings::default();
    let scene = kiln::import::load(&[file], &mut warnings).unwrap_or_else(|e| panic!("{name}: {e}"));
    assert_eq!(warnings.messages(), [] as [&str; 0], "{name}");
    scene
}

fn mesh(scene: &Scene) -> &Mesh {
    let Shape::Mesh(mesh) = &scene.objects[0].shape else { panic!("{:?}", scene.objects[0].name) };
    mesh
}

/// The triangles of a mesh by the vertices of `plain` that are nearest to their corners, each from its least vertex on,
/// sorted; the attributes of matching vertices differ by at most the steps of the encoders' defaults.
fn triangles(mesh: &Mesh, plain: &Mesh) -> Vec<[usize; 3]> {
    // 14 bits of a range of 2, rounded.
    let step = 2.0 / f64::from((1 << 14) - 1);
    let nearest = |index: u32| {
        let at = mesh.positions[index as usize];
        let distance = |i: &usize| (plain.positions[*i] - at).abs().max_element();
        let vertex = (0..plain.positions.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let vertex = vertex.expect("a vertex");
        assert!(distance(&vertex) <= step, "{at} is not a vertex");
        let (i, v) = (index as usize, vertex);
        let values = |mesh: &Mesh, i: usize| {
            let normal: DVec3 = mesh.normals.as_ref().expect("normals").values[i];
            let colour = mesh.colours.as_ref().expect("colours").values[i];
            (
                normal.normalize(),
                colour,
                mesh.uvs[0].values[i],
                mesh.alphas.as_ref().expect("alphas").values[i],
            )
        };
        let (is, expected) = (values(mesh, i), values(plain, v));
        // 8 bits for a normal's octahedron, whose steps are at most twice as long on the sphere; 12 for coordinates.
        assert!((is.0 - expected.0).length() < 2.0 * 2.0 / 127.0, "{} {}", is.0, expected.0);
        assert!((is.1 - expected.1).abs().max_element() <= 1.0 / 255.0, "{} {}", is.1, expected.1);
        assert!((is.2 - expected.2).abs().max_element() <= 1.0 / 4095.0, "{} {}", is.2, expected.2);
        assert_eq!(is.3, expected.3);
        vertex
    };
    let mut triangles: Vec<[usize; 3]> = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(nearest);
            *[[a, b, c], [b, c, a], [c, a, b]].iter().min().expect("three")
        })
        .collect();
    triangles.sort_unstable();
    triangles
}

#[test]
fn compressed_meshes() {
    let plain = load("plain");
    let expected = triangles(mesh(&plain), mesh(&plain));
    assert_eq!(expected.len(), 8 * 6 * 2);
    for name in ["meshopt", "draco", "draco-sequential"] {
        assert_eq!(triangles(mesh(&load(name)), mesh(&plain)), expected, "{name}");
    }
}

/// The greatest difference of two images in steps of 255.
fn difference(a: &DecodedImage, b: &DecodedImage) -> u16 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let pairs = a.pixels.iter().flatten().zip(b.pixels.iter().flatten());
    pairs.map(|(a, b)| a.abs_diff(b)).max().unwrap_or(0)
}

/// Images of colours and of alpha. An ETC1S block of 4 x 4 texels has one hue in four intensities; within a block of the
/// texture red and green change independently by 3 x 17, which is the greatest error.
#[test]
fn compressed_textures() {
    let plain = load("plain");
    for (name, most) in [("webp", 0), ("uastc", 6), ("etc1s", 51)] {
        let scene = load(name);
        assert_eq!(scene.images.len(), 2, "{name}");
        for (image, expected) in scene.images.iter().zip(&plain.images) {
            let found = difference(image, expected);
            assert!(found <= most, "{name}, {}: {found}", image.name);
        }
    }
}

/// Each file with bytes of its binary part changed: drawn or refused, without a panic.
#[test]
fn damaged_codes_are_drawn_or_refused() {
    for name in ["meshopt", "draco", "draco-sequential", "uastc", "etc1s", "webp"] {
        let bytes = std::fs::read(repository(&format!("assets/import/codecs/{name}.glb"))).expect("the file");
        let json = u32::from_le_bytes(bytes[12..16].try_into().expect("four bytes")) as usize;
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("damaged.glb");
        for at in (20 + json + 8..bytes.len()).step_by(37) {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0xff;
            std::fs::write(&file, &damaged).expect("the file is written");
            let mut warnings = kiln::error::Warnings::default();
            let _ = kiln::import::load(std::slice::from_ref(&file), &mut warnings);
        }
    }
}

/// Twenty bytes that claim to be 16 x 4194320 texels, or whose place overflows: refused, not decoded.
#[test]
fn textures_that_claim_too_much_are_left_out() {
    let original = std::fs::read(repository("assets/import/codecs/etc1s.glb")).expect("the file");
    let identifier = original.windows(8).position(|bytes| bytes == b"\xABKTX 20\xBB").expect("a KTX2 image");
    // The height; the offset of the first level (KTX File Format Specification 2.0, section 3).
    for (at, claim) in [(24, &4_194_320u32.to_le_bytes()[..]), (80, &u64::MAX.to_le_bytes())] {
        let mut bytes = original.clone();
        bytes[identifier + at..identifier + at + claim.len()].copy_from_slice(claim);
        let (scene, warnings) = Folder::new().load("a.glb", bytes);
        assert_eq!((scene.images.len(), warnings.len()), (0, 1));
        let end = "image 0: texture left out: not a KTX2 picture of Basis Universal, or damaged";
        assert!(warnings[0].ends_with(end), "{warnings:?}");
    }
}

/// The length of a binary file counts its header of 12 bytes.
#[test]
fn a_binary_file_shorter_than_its_header_is_refused() {
    for length in [0u32, 11] {
        let mut bytes = Model::triangle().binary();
        bytes[8..12].copy_from_slice(&length.to_le_bytes());
        assert!(Folder::new().fails("a.glb", bytes).to_string().contains("not a usable glTF file"));
    }
    assert!(
        Folder::new().fails("a.glb", b"glTF\x02\0\0\0\x0b\0").to_string().contains("not a usable glTF file")
    );
}

/// A buffer that only takes what compressed views are decoded to needs neither bytes nor `fallback`; its file may be
/// missing.
#[test]
fn buffers_of_compressed_views_alone() {
    let bytes = std::fs::read(repository("assets/import/codecs/meshopt.glb")).expect("the file");
    let length = u32::from_le_bytes(bytes[12..16].try_into().expect("four bytes")) as usize;
    let json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + length]).expect("JSON");
    let expected = load("meshopt");
    for uri in [None, Some("gone.bin"), Some("data:,short")] {
        let mut json = json.clone();
        let buffer = json["buffers"][1].as_object_mut().expect("a buffer");
        buffer.remove("extensions").expect("`fallback`");
        buffer.extend(uri.map(|uri| ("uri".to_owned(), uri.into())));
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let rest = &bytes[20 + length..];
        let size = (20 + text.len() + rest.len()) as u32;
        let head = [&bytes[..8], &size.to_le_bytes(), &(text.len() as u32).to_le_bytes(), b"JSON"].concat();
        let (scene, warnings) = Folder::new().load("a.glb", [&head, &text, rest].concat());
        assert_eq!((mesh(&scene), warnings), (mesh(&expected), Vec::new()), "{uri:?}");
    }
    // Where a view is read as it is, the buffer must be there.
    let mut json = json;
    json["buffers"][1].as_object_mut().expect("a buffer").remove("extensions");
    let views = json["bufferViews"].as_array_mut().expect("a list");
    views[1].as_object_mut().expect("a view").remove("extensions").expect("a compressed view");
    let e = Folder::new().fails("a.gltf", json.to_string()).to_string();
    assert!(e.contains("the binary part of the file is missing"), "{e}");
}
