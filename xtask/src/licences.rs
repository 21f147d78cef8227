//! `third-party-licences`: the licence texts for the released archives.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::run::{Result, list, output};

/// Print the licence texts of the crates that are linked into the released binaries, each text once
///
/// Downloads the sources of the crates. Build and development dependencies are left out. A crate without a licence file is
/// listed with its licence expression, authors and repository.
#[derive(clap::Args)]
pub struct Options {
    /// Target triples, such as x86_64-unknown-linux-gnu
    #[arg(required = true, value_name = "TARGET")]
    targets: Vec<String>,
    /// Cargo.toml of the package whose crates are listed
    #[arg(long, value_name = "FILE", default_value = "Cargo.toml")]
    manifest: PathBuf,
}

/// How the names of licence files begin, in lower case.
const NAMES: [&str; 6] = ["license", "licence", "unlicense", "copying", "copyright", "notice"];
/// Licence files outside the root of their crate: crate, folder, and how the names of the files end.
const ELSEWHERE: [(&str, &str, &str); 2] =
    [("openh264-sys2", "upstream", "LICENSE"), ("epaint_default_fonts", "fonts", ".txt")];

/// A field of a package.
fn text<'a>(package: &'a Value, field: &str) -> &'a str {
    package[field].as_str().unwrap_or("None")
}

/// The packages that the default features of a package need at run time on a target, without kiln's own.
fn linked(manifest: &Path, target: &str) -> Result<Vec<Value>> {
    let mut command = Command::new("cargo");
    command.args(["metadata", "--locked", "--format-version", "1", "--filter-platform", target]);
    let done = output(command.arg("--manifest-path").arg(manifest))?;
    let mut metadata: Value = serde_json::from_slice(&done.stdout)?;
    let nodes: HashMap<&str, &Value> =
        list(&metadata["resolve"]["nodes"]).iter().map(|node| (text(node, "id"), node)).collect();
    let root = text(&metadata["resolve"], "root");
    let (mut found, mut rest) = (HashSet::new(), vec![root]);
    while let Some(id) = rest.pop() {
        if found.insert(id.to_owned()) {
            let deps = list(&nodes[id]["deps"]).iter();
            let normal = deps.filter(|dep| list(&dep["dep_kinds"]).iter().any(|kind| kind["kind"].is_null()));
            rest.extend(normal.map(|dep| text(dep, "pkg")));
        }
    }
    let Value::Array(packages) = metadata["packages"].take() else { return Err("no packages".into()) };
    let is_linked = |package: &Value| found.contains(text(package, "id")) && !package["source"].is_null();
    Ok(packages.into_iter().filter(is_linked).collect())
}

/// The files of a folder whose name is wanted, sorted.
fn files(folder: &Path, wanted: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut found: Vec<PathBuf> = entries
        .filter(|entry| wanted(&entry.file_name().to_string_lossy()))
        .map(|entry| entry.path())
        .filter(|path| path.is_file())
        .collect();
    found.sort();
    found
}

/// The different texts of a package's licence files.
fn texts(package: &Value) -> Result<Vec<String>> {
    let folder = Path::new(text(package, "manifest_path")).parent().ok_or("a manifest without a folder")?;
    let mut all = files(folder, |name| NAMES.iter().any(|start| name.to_lowercase().starts_with(start)));
    for (_, inner, end) in ELSEWHERE.iter().filter(|file| file.0 == text(package, "name")) {
        let more = files(&folder.join(inner), |name| name.ends_with(end));
        if more.is_empty() {
            let file = file!();
            return Err(format!("{}: no {inner}/*{end}; correct ELSEWHERE in {file}", title(package)).into());
        }
        all.extend(more);
    }
    let mut texts = Vec::new();
    for file in all {
        let bytes = std::fs::read(file)?;
        let read =
            String::from_utf8_lossy(&bytes).replace("\r\n", "\n").replace('\r', "\n").trim().to_owned();
        if !texts.contains(&read) {
            texts.push(read);
        }
    }
    Ok(texts)
}

fn title(package: &Value) -> String {
    format!("{} {} ({})", text(package, "name"), text(package, "version"), text(package, "license"))
}

/// Prints the crates without a licence file, then each text below the crates that have it.
pub fn run(options: &Options) -> Result<()> {
    let mut packages = BTreeMap::new();
    for target in &options.targets {
        for package in linked(&options.manifest, target)? {
            packages.insert(["name", "version", "id"].map(|field| text(&package, field).to_owned()), package);
        }
    }
    let mut by_text: Vec<(String, Vec<String>)> = Vec::new();
    println!("kiln contains the following crates. Their licences:\n\nCrates without a licence file:");
    for package in packages.values() {
        let found = texts(package)?;
        if found.is_empty() {
            let names: Vec<&str> = list(&package["authors"]).iter().filter_map(Value::as_str).collect();
            let authors = if names.is_empty() { "authors not named".into() } else { names.join(", ") };
            println!("{}: {authors}; {}", title(package), text(package, "repository"));
        }
        for text in found {
            match by_text.iter_mut().find(|entry| entry.0 == text) {
                Some(entry) => entry.1.push(title(package)),
                None => by_text.push((text, vec![title(package)])),
            }
        }
    }
    for (text, titles) in by_text {
        println!("\n{}\n{}\n\n{text}", "-".repeat(80), titles.join("\n"));
    }
    Ok(())
}
