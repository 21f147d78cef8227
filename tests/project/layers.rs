//! The house: a room may use what stands below it, never what stands above.

use std::path::Path;

use crate::common;
use kiln::effects::{EFFECTS, RayKind};

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

/// Strings that equal an effect's name outside its own file: file, string. They name something else.
const NOT_EFFECTS: &[(&str, &str)] = &[
    // A property of a Phong material.
    ("viewer/inspect.rs", "glaze"),
    // The images of a file.
    ("cli/info.rs", "textures"),
    // A kind of ray of the benchmark.
    ("bench/speed/rays.rs", "shadow"),
];

/// The string literals of a source text outside comments and unit tests.
fn strings(text: &str) -> Vec<String> {
    let code = text.split("#[cfg(test)]\nmod").next().unwrap_or("");
    let code: String =
        code.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
    let code = code.replace("'\"'", "").replace("'\\\"'", "");
    let mut found = Vec::new();
    let mut rest = code.as_str();
    while let Some(start) = rest.find('"') {
        let mut literal = String::new();
        let mut chars = rest[start + 1..].char_indices();
        let mut end = rest.len();
        while let Some((at, c)) = chars.next() {
            match c {
                '"' => {
                    end = start + 1 + at + 1;
                    break;
                }
                '\\' => literal.extend(chars.next().map(|(_, c)| c)),
                _ => literal.push(c),
            }
        }
        found.push(literal);
        rest = &rest[end..];
    }
    found
}

/// Whether a string is a name, `NAME=VALUE`, or an option with it.
fn refers_to(text: &str, name: &str) -> bool {
    let is_name = |text: &str| text.split(['=', ' ', ',']).next() == Some(name);
    let begins = text.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('='));
    begins || ["--with ", "--without "].iter().any(|option| text.split(option).skip(1).any(is_name))
}

/// Other files refer to effects by `effects::id` and by the fields of `Effect` and `RayKind`.
#[test]
fn effects_are_named_in_their_own_files_alone() {
    let effects = EFFECTS.iter().map(|effect| (effect.name(), effect.name()));
    let rays = EFFECTS.iter().flat_map(|effect| effect.rays.iter().map(|kind| (kind.name, effect.name())));
    let names: Vec<(&str, &str)> = effects.chain(rays).collect();
    assert!(RayKind::all().skip(1).all(|kind| names.iter().any(|(name, _)| *name == kind.name)));
    let mut all = Vec::new();
    files(&common::repository("src"), &mut all);
    let mut faults = Vec::new();
    for file in all {
        let inside = file.strip_prefix(common::repository("src")).expect("a file of src");
        let inside = inside.to_string_lossy().replace('\\', "/");
        // The registry: `cfg(kiln_without = ...)` takes a literal. Files of unit tests say what users type.
        if inside == "effects/mod.rs" || inside.ends_with("/tests.rs") {
            continue;
        }
        let text = std::fs::read_to_string(&file).expect("a source file");
        for string in strings(&text) {
            for (name, effect) in &names {
                let own = format!("effects/{}.rs", effect.replace('-', "_"));
                let is_exception = NOT_EFFECTS.contains(&(inside.as_str(), string.as_str()));
                if refers_to(&string, name) && inside != own && !is_exception {
                    faults.push(format!("{inside}: \"{string}\" names the effect `{effect}`"));
                }
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn strings_and_names_are_found() {
    let text = "let a = \"glaze\"; // no \n// \"comment\"\nlet b = '\"'; c(\"x \\\"y\\\"\");\n#[cfg(test)]\nmod t { \"z\" }";
    assert_eq!(strings(text), ["glaze", "x \"y\""]);
    for text in ["glaze", "glaze=3", "leave out --without glaze, or so", "--with glaze=2"] {
        assert!(refers_to(text, "glaze"), "{text}");
    }
    for text in ["glazed", "no glaze", "--without glazes", ""] {
        assert!(!refers_to(text, "glaze"), "{text}");
    }
}
