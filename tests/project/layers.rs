//! Layers: a module of `src` and `crates/bvh/src` uses modules below it only.

use std::path::Path;

use crate::common;
use kiln::effects::{EFFECTS, RayKind};

/// The modules, from the bottom up.
const MODULES: &[&str] = &[
    "threads",
    "geometry",
    "bvh",
    "detail",
    "error",
    "limits",
    "files",
    "film",
    "farm",
    "scene",
    "import",
    "metrics",
    "world",
    "shading",
    "effects",
    "render",
    "job",
    "animation",
];

/// The folders with the sources of both packages.
const SOURCES: [&str; 2] = ["crates/bvh/src", "src"];

fn module_of(file: &Path) -> String {
    let inside = SOURCES.iter().find_map(|source| file.strip_prefix(common::repository(source)).ok());
    let inside = inside.expect("a source file");
    let first = inside.components().next().expect("a name").as_os_str().to_string_lossy().into_owned();
    first.trim_end_matches(".rs").to_owned()
}

fn files(folder: &Path, found: &mut Vec<std::path::PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder of src") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
}

/// The name at the beginning of a path.
fn first_name(path: &str) -> &str {
    path.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or("")
}

/// The modules that a file's text refers to by `crate::MODULE`, or by as many `super::` as lead from its own module, `depth` below
/// the crate, to the crate. A module in braces, such as that of tests, is one further down.
fn modules_used(text: &str, depth: usize) -> Vec<&str> {
    let mut found = Vec::new();
    // The ends of the modules in braces around the line.
    let mut ends: Vec<String> = Vec::new();
    for line in text.lines().filter(|line| !line.trim_start().starts_with("//")) {
        let code = line.trim_start();
        if code.ends_with('{')
            && (code.starts_with("mod ") || code.starts_with("pub") && code.contains(" mod "))
        {
            ends.push(format!("{}}}", &line[..line.len() - code.len()]));
        } else if ends.last().is_some_and(|end| end == line) {
            ends.pop();
        }
        found.extend(line.split("crate::").skip(1).map(first_name));
        let mut rest = line;
        while let Some(start) = rest.find("super::") {
            let (mut count, mut path) = (0, &rest[start..]);
            while let Some(after) = path.strip_prefix("super::") {
                (count, path) = (count + 1, after);
            }
            if count >= depth + ends.len() {
                found.push(first_name(path));
            }
            rest = path;
        }
    }
    found
}

/// The number of modules from the crate to that of a file.
fn depth_of(file: &Path) -> usize {
    let inside = SOURCES.iter().find_map(|source| file.strip_prefix(common::repository(source)).ok());
    let is_folder = file.file_name().is_some_and(|name| name == "mod.rs");
    inside.map_or(0, |inside| inside.components().count() - usize::from(is_folder))
}

#[test]
fn paths_that_lead_to_the_crate_are_seen() {
    let text = "use super::world::World;\nuse super::super::scene;\n// super::super::job\nmod tests {\n    \
                use super::super::super::job::RenderJob;\n    use super::super::x;\n    use crate::film;\n";
    assert_eq!(modules_used(text, 2), ["scene", "job", "film"]);
    assert_eq!(modules_used("use super::world::World;", 1), ["world"]);
}

#[test]
fn dependencies_point_down() {
    let mut all = Vec::new();
    SOURCES.iter().for_each(|source| files(&common::repository(source), &mut all));
    let level = |module: &str| MODULES.iter().position(|r| *r == module);
    let mut faults = Vec::new();
    for file in all {
        let module = module_of(&file);
        if module == "lib" {
            continue;
        }
        let own = level(&module).unwrap_or_else(|| panic!("{module} is not in the list of modules"));
        let text = std::fs::read_to_string(&file).expect("a source file");
        for used in modules_used(&text, depth_of(&file)) {
            match level(used) {
                Some(other) if other <= own => {}
                Some(_) => faults.push(format!("{} uses {used}, which is above {module}", file.display())),
                None => faults.push(format!("{} uses {used}, which is not a module", file.display())),
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// The table of modules in ARCHITECTURE.md has every module, from the top down.
#[test]
fn the_map_lists_every_module() {
    let page = std::fs::read_to_string(common::repository("ARCHITECTURE.md")).expect("the map");
    let section = page.split("\n## Modules").nth(1).and_then(|rest| rest.split("\n## ").next());
    let rows = section.expect("a section on modules").lines();
    let mut listed: Vec<&str> =
        rows.filter_map(|row| row.strip_prefix("| `")?.split_once('`')).map(|row| row.0).collect();
    listed.reverse();
    assert_eq!(listed, MODULES);
}

#[test]
fn uses_are_found() {
    let text =
        "use crate::film::Film;\n// crate::cli is not used here\nlet x = crate::error::Error::Interrupted;";
    assert_eq!(modules_used(text, 2), ["film", "error"]);
}

/// Strings that equal an effect's name outside its own file: file, string. They name something else.
const NOT_EFFECTS: &[(&str, &str)] = &[
    // A property of a Phong material.
    ("import/formats/scene_file/metallic_roughness.rs", "glaze"),
    // The images of a file.
    ("cli/statistics.rs", "textures"),
    ("cli/info/contents.rs", "textures"),
    ("cli/info/materials.rs", "textures"),
    ("cli/info/rendering.rs", "textures"),
    ("import/formats/gltf/document.rs", "textures"),
    // The name of an image.
    ("import/formats/gltf/look.rs", "alpha"),
    // The channel of an image.
    ("cli/compare.rs", "alpha"),
    ("job/pixel/text.rs", "alpha"),
    // A property of vertices and faces.
    ("import/formats/ply.rs", "alpha"),
    // An attribute of items and components.
    ("import/formats/threemf/model.rs", "path"),
    // A transport.
    ("scene/option/transport.rs", "path"),
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

/// Whether a file of `src` is that of an effect, or in its folder.
fn is_of_effect(inside: &str, effect: &str) -> bool {
    let module = effect.replace('-', "_");
    inside.strip_prefix("effects/").is_some_and(|file| file.split(['/', '.']).any(|part| part == module))
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
        // The registry and the modules of a transport: `cfg(kiln_without = ...)` takes a literal. Files of unit tests
        // say what users type.
        if ["effects/mod.rs", "effects/whitted/mod.rs"].contains(&&*inside) || inside.ends_with("/tests.rs") {
            continue;
        }
        let text = std::fs::read_to_string(&file).expect("a source file");
        for string in strings(&text) {
            for (name, effect) in &names {
                let is_exception = NOT_EFFECTS.contains(&(inside.as_str(), string.as_str()));
                if refers_to(&string, name) && !is_of_effect(&inside, effect) && !is_exception {
                    faults.push(format!("{inside}: \"{string}\" names the effect `{effect}`: use its `id`, or list the string in NOT_EFFECTS with what it is"));
                }
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Whether source text outside unit tests has a path into the module of an effect.
fn uses_effect(text: &str, module: &str) -> bool {
    let code = text.split("#[cfg(test)]\nmod").next().unwrap_or("");
    let code = code.lines().filter(|line| !line.trim_start().starts_with("//"));
    let parents = ["super", "effects", "self", "whitted"];
    let paths = parents.map(|parent| format!("{parent}::{module}::"));
    code.into_iter().any(|line| paths.iter().any(|path| line.contains(path.as_str())))
}

/// So every build without the file of one effect (`kiln_without`) compiles.
#[test]
fn effects_are_used_by_the_registry_alone() {
    let mut all = Vec::new();
    files(&common::repository("src"), &mut all);
    let mut faults = Vec::new();
    for file in all.iter().filter(|file| !file.ends_with("tests.rs")) {
        let inside = file.strip_prefix(common::repository("src")).expect("a file of src");
        let inside = inside.to_string_lossy().replace('\\', "/");
        let text = std::fs::read_to_string(file).expect("a source file");
        for effect in EFFECTS {
            let module = effect.name().replace('-', "_");
            if !is_of_effect(&inside, effect.name()) && uses_effect(&text, &module) {
                faults.push(format!("{inside} uses the effect `{}`", effect.name()));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    let text =
        "use super::glaze::A;\n// crate::effects::path::B\n#[cfg(test)]\nmod tests { super::alpha::C }";
    assert!(uses_effect(text, "glaze") && !uses_effect(text, "path") && !uses_effect(text, "alpha"));
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
