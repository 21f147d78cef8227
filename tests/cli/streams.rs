//! Standard input and output, pipes and devices, the schema, completions and help.

use std::process::Command;

use serde_json::Value;

use crate::common::gltf::Model;
use crate::helpers::{SCENE, check_error};
use crate::workshop::{Workshop, text};

#[test]
fn standard_output_carries_the_picture_and_only_that() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.succeed("render scene.toml -o a.png");
    let output = workshop.run("render scene.toml -o -");
    assert_eq!(output.status.code(), Some(0));
    assert!(output.stdout == workshop.bytes("a.png"), "the bytes are those of the file");
}

#[test]
fn standard_input_carries_a_scene_file_or_a_glb() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.succeed("render scene.toml -o a.png");
    let output = workshop.run_with("render - -o b.png", SCENE.as_bytes());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(workshop.pixels("a.png") == workshop.pixels("b.png"));
    let output = workshop.run_with("info - --json", &Model::triangle().binary());
    let report: Value = serde_json::from_slice(&output.stdout).expect("it is JSON");
    assert_eq!((&report["triangles"], &report["inputs"][0]), (&1.into(), &"-".into()));
    // Formats without a signature.
    let obj = "mtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let output = workshop.run_with("info - --json", obj.as_bytes());
    let report: Value = serde_json::from_slice(&output.stdout).expect("it is JSON");
    assert_eq!(report["triangles"], 1);
    // Errors in standard input name the file `-`.
    let output = workshop.run_with("info -", b"[image]\nwidht = 1\n");
    assert_eq!(output.status.code(), Some(3));
    assert_eq!(check_error(&text(&output.stderr)).0, "-:2: unknown key `widht`");
}

#[test]
fn schema_names_every_key_of_a_scene_file() {
    let output = Workshop::with("scene.toml", SCENE).run("schema");
    assert_eq!(output.status.code(), Some(0));
    let schema: Value = serde_json::from_slice(&output.stdout).expect("it is JSON");
    for key in ["image", "camera", "ambient", "light", "material", "sphere", "triangles", "mesh", "effects"] {
        assert!(schema["properties"][key].is_object(), "{key}");
    }
}

#[test]
fn completions_help_and_version() {
    let workshop = Workshop::with("scene.toml", SCENE);
    for shell in ["bash", "zsh", "fish"] {
        let output = workshop.run(&format!("completions {shell}"));
        assert_eq!(output.status.code(), Some(0));
        let said = text(&output.stdout);
        assert!(said.contains("kiln") && said.contains("orthographic"), "{shell}");
    }
    for arguments in ["--help", "help render", "--version"] {
        let output = workshop.run(arguments);
        assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), String::new()), "{arguments}");
        assert!(!output.stdout.is_empty());
    }
}

/// Pipes and devices are refused as input: they may have no end.
#[cfg(unix)]
#[test]
fn only_regular_files_are_read() {
    let shop = Workshop::with("scene.toml", SCENE);
    let made = Command::new("mkfifo").args([shop.path("pipe.bin"), shop.path("pipe.obj")]).status();
    assert!(made.is_ok_and(|status| status.success()), "mkfifo");
    std::os::unix::fs::symlink("/dev/zero", shop.path("zero.obj")).expect("a link");
    shop.write(
        "a.gltf",
        r#"{"asset": {"version": "2.0"}, "buffers": [{"byteLength": 36, "uri": "pipe.bin"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "nodes": [{"mesh": 0}]}"#,
    );
    for (file, said) in [
        ("pipe.obj", "pipe.obj: is a pipe, not a regular file"),
        ("zero.obj", "zero.obj: is a device, not a regular file"),
        ("a.gltf", "a.gltf: buffer 0: pipe.bin: is a pipe, not a regular file"),
    ] {
        assert_eq!(shop.fail(&format!("info {file}"), 3).0, said);
        assert_eq!(shop.fail(&format!("render {file} -o a.png --progress none"), 3).0, said);
    }
    shop.write("scene.toml", "[[mesh]]\nfile = 'pipe.obj'\n");
    let (said, _) = shop.fail("info scene.toml", 3);
    assert!(said.starts_with("scene.toml:1: mesh pipe.obj: is a pipe"), "{said}");
}

/// Files that state a length of 0 but have contents, such as those of /proc, are refused.
#[cfg(target_os = "linux")]
#[test]
fn files_longer_than_they_say_are_not_read() {
    let shop = Workshop::with("scene.toml", SCENE);
    std::os::unix::fs::symlink("/proc/self/status", shop.path("long.obj")).expect("a link");
    let (said, _) = shop.fail("info long.obj", 3);
    assert!(said.starts_with("long.obj: is longer than the 0 bytes"), "{said}");
}

/// Output is renamed over its target, so that a pipe or device would be replaced: they are refused as output.
#[cfg(unix)]
#[test]
fn pipes_and_devices_are_not_replaced() {
    use std::os::unix::fs::FileTypeExt;
    let shop = Workshop::with("scene.toml", SCENE);
    shop.write("small.toml", "[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n");
    assert!(Command::new("mkfifo").arg(shop.path("pipe.png")).status().is_ok_and(|made| made.success()));
    let said = shop.fail("render small.toml -o pipe.png --size 8x8 --progress none", 4).0;
    assert_eq!(said, "pipe.png: is a device or a pipe; name a file");
    let kind = std::fs::metadata(shop.path("pipe.png")).expect("still there").file_type();
    assert!(kind.is_fifo());
}
