//! What the README shows, runs.

mod common;

use assert_cmd::Command;
use common::repository;

/// The contents of the fenced blocks of a language.
fn fences<'a>(text: &'a str, language: &str) -> Vec<&'a str> {
    let opening = format!("```{language}\n");
    text.split(opening.as_str()).skip(1).filter_map(|rest| rest.split("```").next()).collect()
}

fn readme() -> String {
    std::fs::read_to_string(repository("README.md")).expect("there is a README")
}

#[test]
fn the_first_two_commands_are_the_main_job_and_the_tests() {
    let readme = readme();
    let lines: Vec<&str> = fences(&readme, "sh").into_iter().flat_map(str::lines).take(2).collect();
    assert_eq!(
        lines,
        ["cargo run --release -- render scenes/assignment.toml -o assignment.png", "cargo test --release"]
    );
}

#[test]
fn the_scene_file_renders() {
    let readme = readme();
    let folder = tempfile::tempdir().expect("a folder");
    let [scene] = fences(&readme, "toml")[..] else { panic!("one scene file is shown") };
    // The mesh is shown as a comment, because there is no such file; with one there, it must be right too.
    let with_mesh: String =
        scene.lines().map(|l| format!("{}\n", l.strip_prefix("# ").unwrap_or(l))).collect();
    let mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    std::fs::write(folder.path().join("model.obj"), mesh).expect("the mesh is written");
    for (name, text) in
        [("plain.toml", scene.to_owned()), ("mesh.toml", with_mesh.replace("model.glb", "model.obj"))]
    {
        std::fs::write(folder.path().join(name), text).expect("the scene is written");
        Command::cargo_bin("kiln")
            .expect("the command is built with the tests")
            .current_dir(folder.path())
            .args(["render", name, "-o", "out.png", "--size", "64x48", "--strict"])
            .assert()
            .success();
    }
}

/// The animation that is shown moves what the scene file that is shown has.
#[test]
fn the_animation_moves_the_scene() {
    let readme = readme();
    let [scene] = fences(&readme, "toml")[..] else { panic!("one scene file is shown") };
    let animation = fences(&readme, "text").into_iter().find(|text| text.starts_with("[animation]"));
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("scene.toml");
    std::fs::write(&file, format!("{scene}\n{}", animation.expect("an animation is shown")))
        .expect("it is written");
    Command::cargo_bin("kiln")
        .expect("the command is built with the tests")
        .current_dir(folder.path())
        .args([
            "animate",
            "scene.toml",
            "-o",
            "f_###.png",
            "--size",
            "32x24",
            "--frames",
            "0-300:100",
            "--strict",
        ])
        .assert()
        .success();
    let pictures: Vec<Vec<u8>> = [0, 100, 200, 300]
        .map(|frame| std::fs::read(folder.path().join(format!("f_{frame:03}.png"))).expect("a frame"))
        .into();
    assert!(pictures.windows(2).all(|w| w[0] != w[1]));
}

/// Every option that the README's table names is one that `kiln render --help` names, and the other way round.
#[test]
fn the_options_are_the_commands_options() {
    let help = Command::cargo_bin("kiln")
        .expect("the command is built with the tests")
        .args(["render", "--help"])
        .output()
        .expect("help");
    let help = String::from_utf8_lossy(&help.stdout).into_owned();
    let options = |text: &str| -> std::collections::BTreeSet<String> {
        let words = text.split(|c: char| !(c.is_ascii_lowercase() || c == '-'));
        words.filter(|w| w.len() > 3 && w.starts_with("--")).map(str::to_owned).collect()
    };
    let readme = readme();
    let table =
        readme.split("| option of").nth(1).and_then(|t| t.split("\n\n").next()).expect("a table of options");
    let (mut known, shown) = (options(&help), options(table));
    known.remove("--help");
    known.remove("--output");
    assert_eq!(shown, known);
}

#[test]
fn the_library_example_is_the_one_that_is_tested() {
    let readme = readme();
    let [shown] = fences(&readme, "rust")[..] else { panic!("one example is shown") };
    let source = std::fs::read_to_string(repository("src/lib.rs")).expect("the crate");
    let documented: Vec<&str> = source
        .lines()
        .skip_while(|line| *line != "//! # As a library")
        .skip_while(|line| *line != "//! ```")
        .skip(1)
        .take_while(|line| *line != "//! ```")
        .map(|line| line.trim_start_matches("//!").trim_start())
        .filter(|line| !line.starts_with("# "))
        .collect();
    let shown: Vec<&str> = shown.lines().map(str::trim_start).collect();
    assert_eq!(shown, documented);
}
