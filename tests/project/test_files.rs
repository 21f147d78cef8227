//! The folders of `tests` that have a `main.rs`: each file is a module of its binary. A file without a `mod` line would
//! not run.

use std::collections::BTreeSet;
use std::path::Path;

use crate::common::repository;

/// The names in a folder.
fn names(folder: &Path) -> BTreeSet<String> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect()
}

/// The modules of the folder itself, without those of `tests/common`, that a `main.rs` declares, as file names.
fn declared(main: &str) -> BTreeSet<String> {
    let modules = main.lines().filter_map(|line| line.strip_prefix("mod ")?.strip_suffix(';'));
    modules.filter(|name| !["common", "workshop"].contains(name)).map(|name| format!("{name}.rs")).collect()
}

#[test]
fn every_test_file_is_a_module_of_its_binary() {
    let folder = repository("tests");
    let mut count = 0;
    for name in names(&folder) {
        assert!(
            !name.ends_with(".rs"),
            "tests/{name} is a binary by itself; move it into one of the folders"
        );
        let Ok(main) = std::fs::read_to_string(folder.join(&name).join("main.rs")) else { continue };
        let mut files = names(&folder.join(&name));
        files.retain(|file| file.ends_with(".rs") && file != "main.rs");
        assert_eq!(files, declared(&main), "tests/{name}/main.rs declares the files beside it");
        count += files.len();
    }
    assert!(count > 40, "{count} files were found");
}

#[test]
fn declared_modules_are_found() {
    let main = "//! Both.\n\n#[path = \"../common/mod.rs\"]\nmod common;\n\nmod a;\n// mod b;\nmod c;\n";
    assert_eq!(declared(main), ["a.rs", "c.rs"].map(str::to_owned).into());
}
