//! `make-study`: the published study of the assignment scene.

use std::path::Path;

use serde_json::Value;

use crate::run::{Kiln, Result, json, output};

/// Make the published study of the assignment scene
///
/// Writes assets/study/assignment.csv and docs/pictures/study.svg. Takes some minutes.
#[derive(clap::Args)]
pub struct Options {
    /// Rounds of time measurement
    #[arg(long, default_value = "7")]
    rounds: String,
    /// Size of the picture
    #[arg(long, default_value = "128x128")]
    size: String,
}

const PAGE: &str = "docs/accuracy.md";

/// The study of a scene: made, or from an earlier run.
pub fn study(kiln: &Kiln, scene: &str, folder: &Path, options: &[&str]) -> Result<Value> {
    if !folder.join("study.svg").exists() {
        output(kiln.command(&["study", scene, "--progress", "none"]).args(options).arg("-o").arg(folder))?;
    }
    json(&folder.join("study.json"))
}

/// Replaces the table of the page that begins with the line `head`.
pub fn into_page(head: &str, table: &str) -> Result<()> {
    let page = std::fs::read_to_string(PAGE)?;
    let start = page.find(head).ok_or_else(|| format!("{PAGE} lacks the line {head}"))?;
    let old: usize =
        page[start..].split_inclusive('\n').take_while(|line| line.starts_with('|')).map(str::len).sum();
    std::fs::write(PAGE, format!("{}{table}\n{}", &page[..start], &page[start + old..]))?;
    Ok(())
}

/// Makes the study and copies the files.
pub fn run(kiln: &Kiln, options: &Options) -> Result<()> {
    let folder = tempfile::tempdir()?;
    let settings = ["--rounds", &options.rounds, "--size", &options.size];
    study(kiln, "scenes/assignment.toml", folder.path(), &settings)?;
    std::fs::copy(folder.path().join("study.csv"), "assets/study/assignment.csv")?;
    std::fs::copy(folder.path().join("study.svg"), "docs/pictures/study.svg")?;
    Ok(())
}
