//! Tests of the viewer that need no window.

use std::process::Command;

use crate::common;

/// Prefixes of the names of crates that only the window needs.
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

/// The crates that a package depends on with the given features.
fn crates(package: &str, features: &[&str]) -> Vec<String> {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.current_dir(common::repository("")).args(["tree", "--offline", "--locked", "--edges", "normal"]);
    cargo
        .args(["--prefix", "none", "--format", "{p}", "--no-default-features", "--package", package])
        .args(features);
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
    let plain = crates("kiln-cli", &[]);
    assert!(plain.iter().any(|name| name == "obvhs"), "{plain:?}");
    assert_eq!(windowing(&plain), [""; 0]);
    // Only the crates of this build are certain to be on the machine.
    if cfg!(feature = "video") {
        assert_eq!(windowing(&crates("kiln-cli", &["--features", "video"])), [""; 0]);
    }
    // The prefixes match crates of a build with the window.
    if cfg!(feature = "viewer") {
        let with = crates("kiln-cli", &["--features", "viewer"]);
        for name in ["eframe", "egui", "glutin", "winit"] {
            assert!(windowing(&with).contains(&name), "{name}");
        }
    }
}

/// Ray queries alone.
#[test]
fn ray_queries_need_few_crates() {
    let mut plain = crates("kiln-bvh", &[]);
    plain.retain(|name| !name.is_empty());
    plain.sort_unstable();
    plain.dedup();
    assert!(plain.len() <= 30, "{}: {plain:?}", plain.len());
}

/// Without a display, and with one that does not respond, the window fails with one line and a hint.
#[cfg(all(feature = "viewer", target_os = "linux"))]
#[test]
fn without_a_display_that_is_said() {
    let view = |display: Option<&str>| {
        let mut kiln = assert_cmd::Command::new(assert_cmd::cargo::cargo_bin!("kiln"));
        for name in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
            kiln.env_remove(name);
        }
        if let Some(display) = display {
            kiln.env("DISPLAY", display);
        }
        let done =
            kiln.arg("view").arg(common::repository("scenes/assignment.toml")).assert().code(1).stdout("");
        String::from_utf8_lossy(&done.get_output().stderr).into_owned()
    };
    let none = view(None);
    assert!(none.starts_with("kiln: error: there is no display to open a window on"), "{none}");
    assert!(none.contains("\nhint: `kiln render` makes pictures without a window"), "{none}");
    assert_eq!(none.lines().count(), 2, "{none}");
    // A display number that does not exist.
    let silent = view(Some(":54321"));
    assert!(silent.starts_with("kiln: error: no window can be opened: "), "{silent}");
    assert_eq!(silent.lines().count(), 2, "{silent}");
}

#[cfg(not(feature = "viewer"))]
#[test]
fn without_a_window_that_is_said() {
    let mut kiln = assert_cmd::Command::new(assert_cmd::cargo::cargo_bin!("kiln"));
    let done = kiln
        .args(["view", "scenes/assignment.toml", "--size", "640x480", "--help"])
        .assert()
        .code(2)
        .stdout("");
    let error = String::from_utf8_lossy(&done.get_output().stderr).into_owned();
    assert!(error.starts_with("kiln: error: this build has no viewer\nhint: "), "{error}");
    assert!(error.contains("--features full"), "{error}");
}
