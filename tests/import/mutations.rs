//! Damaged files: bytes of valid ones changed at random. Each is imported and drawn, or refused; none panics. The same
//! cases every time; `fuzz/` searches on.

use std::path::Path;

use kiln::error::Warnings;
use kiln::job;
use kiln::render::RenderControl;

use crate::common::{Numbers, repository};

/// Texts that numbers are replaced by.
const NUMBERS: [&str; 12] = [
    "0",
    "-1",
    "1e308",
    "-1e-320",
    "nan",
    "4294967296",
    "18446744073709551616",
    "1e400",
    "",
    "2147483647",
    "0.5.5",
    "\u{7}",
];

/// A copy with one to four changes.
fn mutated(bytes: &[u8], numbers: &mut Numbers) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=numbers.below(4) {
        if bytes.is_empty() {
            break;
        }
        let place = numbers.below(bytes.len());
        let end = (place + 1 + numbers.below(40)).min(bytes.len());
        match numbers.below(6) {
            0 => bytes[place] ^= 1 << numbers.below(8),
            1 => bytes[place] = numbers.below(256) as u8,
            2 => drop(bytes.drain(place..end)),
            3 => {
                let chunk = bytes[place..end].to_vec();
                let at = numbers.below(bytes.len());
                bytes.splice(at..at, chunk);
            }
            4 => bytes.truncate(place),
            _ => {
                // The next number after the place.
                let Some(start) = (place..bytes.len()).find(|&i| bytes[i].is_ascii_digit()) else { continue };
                let length = bytes[start..].iter().take_while(|b| b.is_ascii_digit() || **b == b'.').count();
                bytes.splice(start..start + length, numbers.one_of(&NUMBERS).bytes());
            }
        }
    }
    bytes
}

/// A binary glTF file with the JSON alone.
fn binary_gltf(json: &[u8]) -> Vec<u8> {
    let mut json = json.to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend((json.len() as u32 + 20).to_le_bytes());
    file.extend((json.len() as u32).to_le_bytes());
    file.extend(b"JSON");
    file.extend(json);
    file
}

/// A triangle in binary PLY.
fn binary_ply() -> Vec<u8> {
    let xyz = "property float x\nproperty float y\nproperty float z";
    let faces = "element face 1\nproperty list uchar int vertex_indices";
    let header =
        format!("ply\nformat binary_little_endian 1.0\nelement vertex 3\n{xyz}\n{faces}\nend_header\n");
    let corners: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let indices = [3u8, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0];
    [header.as_bytes(), corners.map(f32::to_le_bytes).as_flattened(), &indices].concat()
}

/// A triangle in binary STL.
fn binary_stl() -> Vec<u8> {
    let facet: [f32; 12] = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    [&[b' '; 80][..], &1u32.to_le_bytes(), facet.map(f32::to_le_bytes).as_flattened(), &[0; 2]].concat()
}

/// Imports a file and draws it at 4 x 4 pixels.
fn draws(file: &Path) -> Result<(), kiln::error::Error> {
    let mut warnings = Warnings::default();
    let settings = kiln::scene::PictureSettings::of_size([4, 4]).into();
    let job = kiln::import::load(&[file.to_owned()], &mut warnings)
        .and_then(|scene| job::prepare(scene, &settings, &mut warnings));
    job.and_then(|job| job.render::<[f32; 3]>(&RenderControl::default())).map(drop)
}

#[test]
fn damaged_files_are_drawn_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str| std::fs::read(repository(name)).unwrap();
    let gltf = read("assets/import/square.gltf");
    let scene = read("scenes/effects/glaze.toml");
    for name in ["materials.mtl", "square two.bin"] {
        std::fs::write(folder.path().join(name), read(&format!("assets/import/{name}"))).unwrap();
    }
    for (name, bytes, drawn) in [
        ("l.obj", read("assets/import/l.obj"), "l.obj"),
        ("materials.mtl", read("assets/import/materials.mtl"), "materials.obj"),
        ("materials.obj", read("assets/import/materials.obj"), "materials.obj"),
        ("square.glb", binary_gltf(&gltf), "square.glb"),
        ("square.gltf", gltf, "square.gltf"),
        ("square.ply", read("assets/import/square.ply"), "square.ply"),
        ("tetrahedron.stl", read("assets/import/tetrahedron.stl"), "tetrahedron.stl"),
        ("square.off", read("assets/import/square.off"), "square.off"),
        ("tetrahedron.3mf", read("assets/import/tetrahedron.3mf"), "tetrahedron.3mf"),
        ("binary.ply", binary_ply(), "binary.ply"),
        ("binary.stl", binary_stl(), "binary.stl"),
        ("glaze.toml", scene, "glaze.toml"),
    ] {
        let (file, drawn_file) = (folder.path().join(name), folder.path().join(drawn));
        if name == "materials.mtl" {
            std::fs::write(&drawn_file, read("assets/import/materials.obj")).unwrap();
        }
        std::fs::write(&file, &bytes).unwrap();
        draws(&drawn_file).unwrap_or_else(|error| panic!("{name} is valid: {error}"));
        let mut numbers = Numbers::new(1);
        let mut refused = 0;
        let count = 400;
        for case in 0..count {
            let damaged = mutated(&bytes, &mut numbers);
            std::fs::write(&file, &damaged).unwrap();
            let result = std::panic::catch_unwind(|| draws(&drawn_file).is_ok());
            let result = result.unwrap_or_else(|_| {
                panic!("case {case} of {name} panics:\n{}", String::from_utf8_lossy(&damaged))
            });
            refused += usize::from(!result);
        }
        // Some damage shows and some does not, or the cases say nothing.
        assert!(refused < count, "{name}: {refused} of {count} refused");
        std::fs::write(&file, &bytes).unwrap();
    }
}
