//! The window, as far as it can be known without one: `tests/viewer/run` opens it.

mod common;

use std::process::Command;

/// What a window takes, by the beginnings of crates' names.
const WINDOWING: [&str; 14] = [
    "accesskit",
    "arboard",
    "eframe",
    "egui",
    "glow",
    "glutin",
    "khronos",
    "raw-window-handle",
    "smithay",
    "softbuffer",
    "wayland",
    "winit",
    "x11",
    "xkb",
];

/// The crates that kiln is built of, with the features that are given.
fn crates(features: &[&str]) -> Vec<String> {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.current_dir(common::repository("")).args(["tree", "--offline", "--locked", "--edges", "normal"]);
    cargo.args(["--prefix", "none", "--format", "{p}", "--no-default-features"]).args(features);
    let done = cargo.output().expect("cargo runs");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let text = String::from_utf8(done.stdout).expect("names");
    text.lines().filter_map(|line| line.split(' ').next()).map(str::to_owned).collect()
}

fn windowing(crates: &[String]) -> Vec<&str> {
    let is_windowing = |name: &&str| WINDOWING.iter().any(|start| name.starts_with(start));
    crates.iter().map(String::as_str).filter(is_windowing).collect()
}

#[test]
fn without_the_feature_no_windowing_crate_is_built() {
    let plain = crates(&[]);
    assert!(plain.iter().any(|name| name == "obvhs"), "{plain:?}");
    assert_eq!(windowing(&plain), [""; 0]);
    // Only what this build has is sure to be on the machine.
    if cfg!(feature = "video") {
        assert_eq!(windowing(&crates(&["--features", "video"])), [""; 0]);
    }
    // The names are those that there would be.
    if cfg!(feature = "viewer") {
        let with = crates(&["--features", "viewer"]);
        for name in ["eframe", "egui", "glutin", "winit"] {
            assert!(windowing(&with).contains(&name), "{name}");
        }
    }
}
