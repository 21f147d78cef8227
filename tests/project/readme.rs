//! The pages (README.md, ARCHITECTURE.md, CONTRIBUTING.md and those of `docs`): commands and scenes on them run,
//! options are complete, links, paths and commands in code spans exist.

use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};

use crate::common::repository;
use assert_cmd::Command;

/// Longest line, in characters, outside tables and fences.
const LONGEST_LINE: usize = 120;

/// Longest README, in lines.
const LONGEST_README: usize = 150;

/// Most words of the pages for users: README.md and `docs` without [`NOT_FOR_USERS`].
const MOST_WORDS: usize = 22_000;

/// The pages for those who change kiln.
const NOT_FOR_USERS: [&str; 3] = ["docs/decisions.md", "docs/internals.md", "docs/tests.md"];

/// A page by its path in the repository.
struct Page {
    path: String,
    text: String,
}

fn read_page(path: &str) -> Page {
    let text = std::fs::read_to_string(repository(path)).unwrap_or_else(|e| panic!("{path}: {e}"));
    Page { path: path.to_owned(), text }
}

/// The file names of `docs`, without those in folders.
fn doc_names() -> Vec<String> {
    let entries = std::fs::read_dir(repository("docs")).expect("the folder docs");
    let names = entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned());
    let mut names: Vec<String> = names.filter(|name| name.ends_with(".md")).collect();
    names.sort();
    names
}

fn pages() -> Vec<Page> {
    let roots = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"].map(str::to_owned);
    let pages = doc_names().into_iter().map(|name| format!("docs/{name}"));
    roots.into_iter().chain(pages).map(|path| read_page(&path)).collect()
}

/// The contents of the fenced blocks of a language.
fn fences<'a>(text: &'a str, language: &str) -> Vec<&'a str> {
    let opening = format!("```{language}\n");
    text.split(opening.as_str()).skip(1).filter_map(|rest| rest.split("```").next()).collect()
}

/// The only fence of a language in a page.
fn fence(path: &str, language: &str) -> String {
    let page = read_page(path);
    let [block] = fences(&page.text, language)[..] else { panic!("{path} has one fence of {language}") };
    block.to_owned()
}

/// The text with fenced blocks left out.
fn prose(text: &str) -> String {
    text.split("```").step_by(2).collect()
}

/// The contents of code spans outside fences.
fn code_spans(text: &str) -> Vec<String> {
    prose(text).split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// The commands of `sh` fences, without comments, with continued lines joined.
fn shell_lines(text: &str) -> Vec<String> {
    let blocks = fences(text, "sh").into_iter().map(|block| block.replace("\\\n", " "));
    blocks
        .flat_map(|block| {
            block.lines().map(|l| l.split(" #").next().unwrap_or("").trim().to_owned()).collect::<Vec<_>>()
        })
        .filter(|line| !line.is_empty())
        .collect()
}

fn kiln() -> Command {
    Command::new(assert_cmd::cargo::cargo_bin!("kiln"))
}

// Fences.

#[test]
fn the_first_two_commands_are_the_main_job_and_the_tests() {
    let lines = shell_lines(&read_page("README.md").text);
    assert_eq!(
        lines[..2],
        [
            "cargo run --release -- render scenes/assignment.toml --samples 16 -o assignment.png",
            "cargo test --release"
        ]
    );
}

#[test]
fn the_scene_file_renders() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = fence("docs/scene-files.md", "toml");
    // The mesh is shown as a comment, because there is no such file; with one there, it must be right too.
    let with_mesh: String =
        scene.lines().map(|l| format!("{}\n", l.strip_prefix("# ").unwrap_or(l))).collect();
    let mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    std::fs::write(folder.path().join("model.obj"), mesh).expect("the mesh is written");
    for (name, text) in [("plain.toml", scene), ("mesh.toml", with_mesh.replace("model.glb", "model.obj"))] {
        std::fs::write(folder.path().join(name), text).expect("the scene is written");
        kiln()
            .current_dir(folder.path())
            .args(["render", name, "-o", "out.png", "--size", "64x48", "--strict"])
            .assert()
            .success();
    }
}

/// The mesh that the README puts beside the assignment is in sight: it covers a fiftieth of the picture, or more.
#[test]
fn a_mesh_beside_the_assignment_is_in_sight() {
    let readme = read_page("README.md").text;
    let (_, rest) = readme.split_once("`printf '").expect("a command");
    let scene = rest.split('\'').next().expect("its text").replace("\\n", "\n");
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::copy(repository("assets/import/l.obj"), folder.path().join("model.obj")).expect("a mesh");
    std::fs::write(folder.path().join("mesh.toml"), scene).expect("the scene is written");
    let render = |inputs: &[&str]| {
        let mut command = kiln();
        command.current_dir(folder.path()).arg("render").arg(repository("scenes/assignment.toml"));
        command.args(inputs).args(["-o", "out.png", "--size", "64x64", "--strict"]).assert().success();
        kiln::film::read::read_picture(&folder.path().join("out.png")).expect("a picture").values
    };
    let (alone, both) = (render(&[]), render(&["mesh.toml"]));
    let count = alone.iter().zip(&both).filter(|(a, b)| a != b).count();
    assert!(count > 64 * 64 / 50, "{count} pixels");
}

/// The animation that is shown moves what the scene file that is shown has.
#[test]
fn the_animation_moves_the_scene() {
    let scene = fence("docs/scene-files.md", "toml");
    let animation = fence("docs/animation.md", "toml");
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("scene.toml"), format!("{scene}\n{animation}")).expect("it is written");
    kiln()
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

#[test]
fn the_library_examples_are_those_that_are_tested() {
    let page = std::fs::read_to_string(repository("docs/library.md")).expect("the page");
    let source = std::fs::read_to_string(repository("src/lib.rs")).expect("the crate");
    let documented: Vec<&str> = source.lines().skip_while(|line| *line != "//! # As a library").collect();
    // Every second part between fences is an example.
    let examples = documented.split(|line| *line == "//! ```").skip(1).step_by(2);
    let documented: Vec<String> = examples
        .map(|lines| {
            let lines = lines.iter().map(|line| line.trim_start_matches("//!").trim_start());
            lines.filter(|line| !line.starts_with("# ")).collect::<Vec<_>>().join("\n")
        })
        .collect();
    let shown: Vec<String> = fences(&page, "rust")
        .iter()
        .map(|example| example.lines().map(str::trim_start).collect::<Vec<_>>().join("\n"))
        .collect();
    assert_eq!(shown, documented);
}

/// A scene or an example on another page would not be tested by the tests above.
#[test]
fn no_other_page_has_a_scene_or_an_example() {
    for page in pages() {
        let counts = ["toml", "rust"].map(|language| fences(&page.text, language).len());
        let expected = match page.path.as_str() {
            "docs/scene-files.md" | "docs/animation.md" => [1, 0],
            "docs/library.md" => [0, 3],
            _ => [0, 0],
        };
        assert_eq!(counts, expected, "{}", page.path);
    }
}

// Options.

/// The output of `kiln COMMAND --help`, or nothing for a command that is not in this build.
fn help(command: &str) -> String {
    if command == "view" && !cfg!(feature = "viewer") {
        return String::new();
    }
    let output = kiln().args(command.split_whitespace()).arg("--help").output().expect("help");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The commands that a help lists.
fn subcommands(help: &str) -> Vec<String> {
    let lines = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let lines = lines.take_while(|line| !line.is_empty()).filter_map(|line| line.strip_prefix("  "));
    let names = lines.filter(|line| !line.starts_with(' ')).filter_map(|line| line.split(' ').next());
    names.filter(|name| *name != "help").map(str::to_owned).collect()
}

/// Every command as it is typed: `render`, …, `bench leaks`, ….
fn commands() -> Vec<String> {
    let mut all = subcommands(&help(""));
    all.extend(subcommands(&help("bench")).iter().map(|name| format!("bench {name}")));
    all
}

/// The long options in a text.
fn options(text: &str) -> BTreeSet<String> {
    let words = text.split(|c: char| !(c.is_ascii_lowercase() || c == '-'));
    words.filter(|w| w.len() > 3 && w.starts_with("--")).map(str::to_owned).collect()
}

/// The options that a help defines: their lines are indented by two or six, those of descriptions by more. Without
/// those that every command has.
fn defined_options(help: &str) -> BTreeSet<String> {
    let lines = help.lines().filter(|l| l.starts_with("  -") || l.starts_with("      --"));
    let heads = lines.filter_map(|line| line.split('<').next()?.trim().split("  ").next());
    let mut found: BTreeSet<String> = heads.flat_map(options).collect();
    found.remove("--help");
    found.remove("--version");
    found.remove("--memory-limit");
    found.remove("--limit");
    found
}

/// The options in the first column of the tables below a heading of the second level.
fn documented_options(page: &str, heading: &str) -> BTreeSet<String> {
    let section = page.split("\n## ").find_map(|section| section.strip_prefix(&format!("{heading}\n")));
    let rows = section.unwrap_or("").lines().filter_map(|line| line.strip_prefix("| "));
    rows.filter_map(|row| row.split(" | ").next()).flat_map(options).collect()
}

/// Every option that `kiln COMMAND --help` defines is in the tables of the page, and the other way round.
#[test]
fn the_options_are_the_commands_options() {
    let page = read_page("docs/command-line.md").text;
    let shared = documented_options(&page, "Picture options");
    assert!(shared.contains("--camera") && shared.contains("--colour"), "{shared:?}");
    let commands = commands();
    assert!(commands.contains(&"render".to_owned()) && commands.contains(&"bench leaks".to_owned()));
    for command in commands {
        let known = defined_options(&help(&command));
        if known.is_empty() && command == "view" {
            continue;
        }
        let mut shown = documented_options(&page, &format!("`kiln {command}`"));
        if known.contains("--camera") {
            shown.extend(shared.iter().cloned());
        }
        assert_eq!(shown, known, "kiln {command}");
    }
}

/// What is wrong with a command line of kiln: a command or an option that there is not.
fn faults_of_command(line: &str, commands: &[String]) -> Option<String> {
    let line = line.split(" | ").next()?;
    let words: Vec<&str> = line.split_whitespace().skip(1).collect();
    let first = *words.first()?;
    if first.starts_with('-') || first == "help" {
        return None;
    }
    let two = words.iter().take(2).copied().collect::<Vec<_>>().join(" ");
    let command = if commands.contains(&two) { two } else { first.to_owned() };
    if !commands.contains(&command) {
        return Some(format!("`{line}`: kiln has no command {command}"));
    }
    let mut known = defined_options(&help(&command));
    if known.is_empty() && command == "view" {
        return None;
    }
    known.extend(["--memory-limit", "--limit"].map(str::to_owned));
    let unknown = options(line).into_iter().find(|option| !known.contains(option))?;
    Some(format!("`{line}`: kiln {command} has no option {unknown}"))
}

#[test]
fn commands_have_their_options() {
    let commands = commands();
    let mut faults = Vec::new();
    let mut count = 0;
    for page in pages() {
        let lines = shell_lines(&page.text).into_iter().chain(code_spans(&page.text));
        for line in lines.filter(|line| line.starts_with("kiln ")) {
            count += 1;
            faults.extend(faults_of_command(&line, &commands).map(|fault| format!("{}: {fault}", page.path)));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert!(count > 30, "{count} commands were found");
}

#[test]
fn a_wrong_command_is_noticed() {
    let commands = commands();
    let faulty = |line: &str| faults_of_command(line, &commands).is_some();
    assert!(!faulty("kiln render a.obj -o a.png --size 2x2 --memory-limit 1G"));
    assert!(faulty("kiln render a.obj --sise 2x2"));
    assert!(faulty("kiln rendr a.obj"));
    assert!(!faulty("kiln bench leaks --rays 10") && faulty("kiln bench leaks --triangles 10"));
}

// Registries.

#[test]
fn every_effect_and_aov_has_a_row() {
    let (effects, aovs) = (read_page("docs/effects.md").text, read_page("docs/aovs.md").text);
    let render = help("render");
    let in_row = |page: &str, name: &str| {
        let mut cells = page.lines().filter_map(|line| line.strip_prefix("| ")?.split(" | ").next());
        cells.any(|cell| cell.split(", ").any(|part| part == format!("`{name}`")))
    };
    for effect in kiln::effects::EFFECTS {
        assert!(in_row(&effects, effect.name()), "docs/effects.md has no row for {}", effect.name());
    }
    for aov in kiln::render::aov::AOVS {
        assert!(in_row(&aovs, aov.name), "docs/aovs.md has no row for {}", aov.name);
        // The help wraps lines at the width of the terminal, so that only the start of a summary is on its line.
        let start: String = aov.summary.chars().take(20).collect();
        let is_listed = render.lines().any(|line| {
            line.trim_start().strip_prefix(aov.name).is_some_and(|rest| rest.trim_start().starts_with(&start))
        });
        assert!(is_listed, "`kiln render --help` does not list {}", aov.name);
    }
    assert!(!in_row(&effects, "no-such-effect"));
}

#[test]
fn every_page_is_in_the_index() {
    let index = read_page("docs/README.md").text;
    for name in doc_names().iter().filter(|name| *name != "README.md") {
        assert!(index.contains(&format!("]({name})")), "docs/README.md does not list {name}");
    }
}

/// The rows of the table of a page that begins with `head`, without times, which differ from run to run.
fn errors_in(page: &str, head: &str) -> Vec<Vec<String>> {
    let text = read_page(page).text;
    let rows = text.lines().skip_while(|line| !line.starts_with(head)).skip(2);
    let cells = |row: &str| row.split('|').skip(1).take(4).map(|cell| cell.trim().replace('`', "")).collect();
    rows.take_while(|line| line.starts_with('|')).map(cells).collect()
}

/// The errors of the assignment on both pages are those that kiln measures.
#[test]
fn the_price_of_accuracy_is_measured() {
    let head = "| assignment | error |";
    let shown = errors_in("README.md", head);
    assert_eq!(shown, errors_in("docs/accuracy.md", head));
    let command = "explain scenes/assignment.toml --size 256x256 --measure --rounds 1";
    let output = kiln().current_dir(repository(".")).args(command.split(' ')).output().expect("kiln runs");
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    let rows = printed.lines().skip_while(|line| !line.starts_with("cause  ")).skip(1);
    let cells = |row: &str| {
        let cells = row.split("  ").map(str::trim).filter(|cell| !cell.is_empty());
        cells.take(4).map(str::to_owned).collect::<Vec<_>>()
    };
    let measured: Vec<Vec<String>> = rows.take_while(|line| !line.is_empty()).map(cells).collect();
    assert!(measured.len() >= 3, "{printed}");
    assert_eq!(shown, measured);
}

// Links and paths.

/// The anchor that a heading gets, by GitHub and by mdBook.
fn anchor(heading: &str) -> String {
    let kept = heading.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.collect::<String>().trim().to_lowercase().replace(' ', "-")
}

fn anchors(text: &str) -> BTreeSet<String> {
    let lines = prose(text);
    let headings = lines.lines().filter(|line| line.starts_with('#'));
    headings.map(|line| anchor(line.trim_start_matches('#').trim())).collect()
}

/// A path without `..` and `.`.
fn normal(path: &Path) -> PathBuf {
    let mut found = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => drop(found.pop()),
            Component::CurDir => {}
            other => found.push(other),
        }
    }
    found
}

/// The links of a page to files of the repository that there are not, or to headings that they do not have.
fn broken_links(page: &Page) -> Vec<String> {
    let folder = Path::new(&page.path).parent().unwrap_or(Path::new(""));
    let text = prose(&page.text);
    let targets = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    let inside = targets.filter(|target| !target.contains("://"));
    let broken = |target: &&str| {
        let (file, heading) = target.split_once('#').unwrap_or((target, ""));
        let file = if file.is_empty() { PathBuf::from(&page.path) } else { normal(&folder.join(file)) };
        let path = repository(&file.to_string_lossy());
        // Other files than text have no headings.
        let has = |heading: &str| {
            let text = std::fs::read_to_string(&path).unwrap_or_default();
            heading.is_empty() || anchors(&text).contains(heading)
        };
        !(path.exists() && has(heading))
    };
    inside.filter(broken).map(|target| format!("{}: the link to {target} is broken", page.path)).collect()
}

#[test]
fn links_lead_somewhere() {
    let others = [
        "assets/farm/README.md",
        "scenes/course/README.md",
        "scenes/effects/README.md",
        "scenes/hard/README.md",
    ]
    .map(read_page);
    let faults: Vec<String> = pages().iter().chain(&others).flat_map(broken_links).collect();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn a_broken_link_is_noticed() {
    let links = |text: &str| broken_links(&Page { path: "docs/x.md".into(), text: text.into() }).len();
    assert_eq!(
        links(
            "[a](README.md) [b](../README.md#licence) [c](https://example.com/x) ![d](pictures/window.png)"
        ),
        0
    );
    assert_eq!(links("[a](no-such-page.md) [b](../README.md#no-such-heading) ![c](pictures/none.png)"), 3);
    assert_eq!(links("```text\n[a](no-such-page.md)\n```"), 0);
    assert_eq!(anchor("`kiln bench leaks`"), "kiln-bench-leaks");
}

fn files_below(folder: &Path, found: &mut Vec<String>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files_below(&path, found);
        } else {
            found.push(path.to_string_lossy().replace('\\', "/"));
        }
    }
}

/// Whether a code span names a file of the repository that there is not: a path in one of its folders, or a source file
/// by the end of its path. Patterns name none.
fn names_no_file(span: &str, sources: &[String]) -> bool {
    let Some(path) = span.split_whitespace().find(|word| word.contains('/') || word.ends_with(".rs")) else {
        return false;
    };
    if path.contains(['*', '…', '#', '%', '<', ':']) || path.contains("NAME") {
        return false;
    }
    let in_folder = [
        "tests/",
        "benches/",
        "assets/",
        "scenes/",
        "docs/",
        "src/",
        "crates/",
        "xtask/",
        ".ci/",
        "examples/",
    ];
    if in_folder.iter().any(|folder| path.starts_with(folder)) {
        return !repository(path).exists();
    }
    path.ends_with(".rs") && !sources.iter().any(|source| source.ends_with(&format!("/{path}")))
}

/// The test binaries that a command runs by `--test NAME` and that do not exist, and the modules `NAME::` that none of
/// them has.
fn missing_tests(command: &str) -> Vec<String> {
    let words = || command.split_whitespace();
    let binaries: Vec<&str> =
        words().zip(words().skip(1)).filter(|pair| pair.0 == "--test").map(|pair| pair.1).collect();
    if binaries.is_empty() {
        return Vec::new();
    }
    let is_file = |binary: &str, name: &str| repository(&format!("tests/{binary}/{name}.rs")).is_file();
    let absent = binaries.iter().copied().filter(|binary| !is_file(binary, "main"));
    let modules = words().filter_map(|word| word.strip_suffix("::"));
    let unknown = modules.filter(|module| !binaries.iter().any(|binary| is_file(binary, module)));
    absent.chain(unknown).map(str::to_owned).collect()
}

#[test]
fn paths_exist() {
    let mut sources = Vec::new();
    ["src", "crates"].iter().for_each(|folder| files_below(&repository(folder), &mut sources));
    let mut faults = Vec::new();
    for page in pages() {
        for span in code_spans(&page.text).into_iter().chain(shell_lines(&page.text)) {
            if names_no_file(&span, &sources) {
                faults.push(format!("{}: `{span}`", page.path));
            }
            let missing = missing_tests(&span).into_iter();
            faults.extend(missing.map(|test| format!("{}: there is no test {test}", page.path)));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert_eq!(missing_tests("cargo test --test accel --test none oracle:: golden::"), ["none", "golden"]);
    assert!(names_no_file("tests/none.rs", &sources) && names_no_file("bvh/none.rs", &sources));
    assert!(
        !names_no_file("benches/povray/compare-povray --size 3", &sources)
            && !names_no_file("lib.rs", &sources)
    );
}

// Form.

#[test]
fn the_pages_for_users_are_short() {
    let for_users = doc_names().into_iter().map(|name| format!("docs/{name}")).chain(["README.md".into()]);
    let for_users = for_users.filter(|path| !NOT_FOR_USERS.contains(&path.as_str()));
    let words: usize = for_users.map(|path| read_page(&path).text.split_whitespace().count()).sum();
    assert!(words <= MOST_WORDS, "{words} words");
}

#[test]
fn the_readme_and_lines_are_short() {
    assert!(read_page("README.md").text.lines().count() <= LONGEST_README);
    // That page is wrapped a little wider, with the proofs that it cites.
    for page in pages().iter().filter(|page| page.path != "docs/closed-meshes.md") {
        for line in prose(&page.text).lines().filter(|line| !line.starts_with('|')) {
            let length = line.chars().count();
            assert!(length <= LONGEST_LINE, "{}: {length} characters: {line}", page.path);
        }
    }
}
