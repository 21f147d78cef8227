//! `make-accuracy`: the tables and pictures of what accuracy costs.

use std::fmt::Write as _;
use std::path::Path;

use crate::run::{Kiln, Result, output};

/// Make the tables and pictures of README.md and docs/accuracy.md
///
/// Writes the table of errors of the assignment scene and of a bunny (KILN_MODELS names its folder), the pictures of a
/// hard scene in two tiers, the plot docs/pictures/study.svg and assets/study/assignment.csv. Takes some minutes.
#[derive(clap::Args)]
pub struct Options {
    /// Rounds of time measurement of the study
    #[arg(long, default_value = "7")]
    rounds: String,
}

/// Size of the pictures of the tables.
const SIZE: &str = "256x256";

/// The head of a table and the pages that have it.
const HEAD: &str = "error | type | error then | time |";
const PAGES: [&str; 2] = ["README.md", "docs/accuracy.md"];

/// The table of the errors of a picture, as `kiln explain` prints it.
fn table(kiln: &Kiln, name: &str, scene: &str) -> Result<String> {
    let arguments = ["explain", scene, "--size", SIZE, "--measure", "--rounds", "1"];
    let printed = String::from_utf8(output(&mut kiln.command(&arguments))?.stdout)?;
    let mut lines = printed.lines().skip_while(|line| !line.starts_with("cause  "));
    lines.next().ok_or("kiln explain printed no table of errors")?;
    let mut table = format!("| {name} | {HEAD}\n| --- | --- | --- | --- | --- |\n");
    for line in lines.take_while(|line| !line.is_empty()) {
        let cells: Vec<&str> = line.split("  ").map(str::trim).filter(|cell| !cell.is_empty()).collect();
        let [cause, now, options, then, time, ..] = cells[..] else {
            return Err(format!("a row of errors has other columns: {line}").into());
        };
        writeln!(table, "| {cause} | {now} | `{options}` | {then} | {} |", time.replace("x ", "× "))?;
    }
    Ok(table)
}

/// Replaces a table in the pages that have one with its first line.
fn into_pages(table: &str) -> Result<()> {
    let head = table.lines().next().unwrap_or_default();
    let mut is_found = false;
    for file in PAGES {
        let page = std::fs::read_to_string(file)?;
        let Some(start) = page.find(head) else { continue };
        let old = page[start..].split_inclusive('\n').take_while(|line| line.starts_with('|'));
        let end = start + old.map(str::len).sum::<usize>();
        std::fs::write(file, format!("{}{table}{}", &page[..start], &page[end..]))?;
        is_found = true;
    }
    if is_found { Ok(()) } else { Err(format!("no page has the line {head}").into()) }
}

/// Makes the tables, the pictures and the plot.
pub fn run(kiln: &Kiln, options: &Options) -> Result<()> {
    let models =
        std::env::var("KILN_MODELS").map_err(|_| "KILN_MODELS does not name the folder of the bunny")?;
    into_pages(&table(kiln, "assignment", "scenes/assignment.toml")?)?;
    into_pages(&table(kiln, "bunny", &format!("{models}/stanford-bunny.obj"))?)?;
    for tier in ["fast", "watertight"] {
        let picture = format!("docs/pictures/needle-fan-{tier}.png");
        let options = ["--numerics", tier, "--size", "384x288"];
        kiln.render(Path::new("scenes/hard/needle-fan.toml"), &options, Path::new(&picture))?;
    }
    let folder = tempfile::tempdir()?;
    let study = ["study", "scenes/assignment.toml", "--size", "128x128", "--progress", "none", "--rounds"];
    output(kiln.command(&study).arg(&options.rounds).arg("-o").arg(folder.path()))?;
    std::fs::copy(folder.path().join("study.csv"), "assets/study/assignment.csv")?;
    std::fs::copy(folder.path().join("study.svg"), "docs/pictures/study.svg")?;
    Ok(())
}
