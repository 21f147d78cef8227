//! The house: a room may use what stands below it, never what stands above.

use std::path::Path;

use crate::common;

/// The rooms, from the bottom up.
const ROOMS: &[&str] = &[
    "error",
    "limits",
    "film",
    "scene",
    "import",
    "geometry",
    "bvh",
    "world",
    "shading",
    "effects",
    "render",
    "job",
    "animation",
    "bench",
    "study",
    "viewer",
    "cli",
];

fn room_of(file: &Path) -> String {
    let source = common::repository("src");
    let inside = file.strip_prefix(source).expect("a file of src");
    let first = inside.components().next().expect("a name").as_os_str().to_string_lossy().into_owned();
    first.trim_end_matches(".rs").to_owned()
}

fn files(folder: &Path, found: &mut Vec<std::path::PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder of src") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files(&path, found);
        } else {
            found.push(path);
        }
    }
}

/// The rooms that a file's text refers to by `crate::ROOM`.
fn rooms_used(text: &str) -> Vec<&str> {
    let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    let paths = code.flat_map(|line| line.split("crate::").skip(1));
    paths.map(|path| path.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or("")).collect()
}

#[test]
fn dependencies_point_down() {
    let mut all = Vec::new();
    files(&common::repository("src"), &mut all);
    let level = |room: &str| ROOMS.iter().position(|r| *r == room);
    let mut faults = Vec::new();
    for file in all {
        let room = room_of(&file);
        if room == "lib" || room == "main" {
            continue;
        }
        let own = level(&room).unwrap_or_else(|| panic!("{room} is not in the list of rooms"));
        let text = std::fs::read_to_string(&file).expect("a source file");
        for used in rooms_used(&text) {
            match level(used) {
                Some(other) if other <= own => {}
                Some(_) => faults.push(format!("{} uses {used}, which stands above {room}", file.display())),
                None => faults.push(format!("{} uses {used}, which is not a room", file.display())),
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// The table of modules in ARCHITECTURE.md has every room, from the top down.
#[test]
fn the_map_lists_every_room() {
    let page = std::fs::read_to_string(common::repository("ARCHITECTURE.md")).expect("there is a map");
    let section = page.split("\n## Modules").nth(1).and_then(|rest| rest.split("\n## ").next());
    let rows = section.expect("a section on modules").lines();
    let mut listed: Vec<&str> =
        rows.filter_map(|row| row.strip_prefix("| `")?.split_once('`')).map(|row| row.0).collect();
    listed.reverse();
    assert_eq!(listed, ROOMS);
}

#[test]
fn uses_are_found() {
    let text =
        "use crate::film::Film;\n// crate::cli is not used here\nlet x = crate::error::Error::Interrupted;";
    assert_eq!(rooms_used(text), ["film", "error"]);
}
