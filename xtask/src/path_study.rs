//! `make-path-study`: the table of path tracing in docs/accuracy.md.

use std::path::PathBuf;

use serde_json::Value;

use crate::run::{Kiln, Result, list, number};
use crate::study::{into_page, study};

/// Make the table of path tracing in docs/accuracy.md, from studies of a room and of a corner under the sky
///
/// Takes some minutes; with --keep DIR it continues where it was interrupted.
#[derive(clap::Args)]
pub struct Options {
    /// Rounds of time measurement
    #[arg(long, default_value = "5")]
    rounds: String,
    /// Size of the pictures
    #[arg(long, default_value = "128x96")]
    size: String,
    /// Folder that keeps the studies; those that exist are used
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
}

/// Name, scene and options of each study.
const SCENES: [(&str, &str, &[&str]); 2] = [
    ("room", "scenes/effects/path.toml", &[]),
    ("sky", "scenes/effects/ambient-occlusion.toml", &["--environment", "sky"]),
];

/// The parameters, as the study names them.
const PARAMETERS: [&str; 7] =
    ["path bounces", "indirect light", "roulette", "clamp", "light technique", "light samples", "samples"];

/// The row that times are relative to.
const BASE: (&str, &str) = ("indirect light", "paths");

const HEAD: &str = "| parameter | setting | time, room | relMSE | FLIP | time, sky | relMSE | FLIP |";

/// Parameter, setting and row of one setting.
fn named(row: &Value) -> (&str, String, &Value) {
    let text = |name: &str| row[name].as_str().unwrap_or_default();
    // The intensity is fitted to the scene, and the samples of all rows but those of `samples` are the same.
    let setting = text("setting").trim_end_matches(" (16 samples)");
    let setting = if setting.ends_with("ambient occlusion") { "ambient occlusion" } else { setting };
    (text("parameter"), setting.to_owned(), row)
}

/// Parameter, setting and row of each setting, in the order of [`PARAMETERS`].
fn rows(made: &Value) -> Vec<(&str, String, &Value)> {
    let all: Vec<_> = list(&made["rows"]).iter().map(named).collect();
    PARAMETERS.iter().flat_map(|name| all.iter().filter(move |row| row.0 == *name).cloned()).collect()
}

/// Time relative to paths, relMSE and FLIP, as cells of the table.
fn cells(row: &Value, base: f64) -> Result<String> {
    let time = number(&row["trace_ms"]["median"])? / base;
    let [relative, flip] = ["rel_mse", "flip"].map(|name| number(&row["limit"][name]));
    Ok(format!("{time:.2} | {:.1e} | {:.3}", relative?, flip?))
}

/// Makes the studies and writes the table.
pub fn run(kiln: &Kiln, options: &Options) -> Result<()> {
    let temporary = tempfile::tempdir()?;
    let folder = options.keep.as_deref().unwrap_or(temporary.path());
    let mut made = Vec::new();
    for (name, scene, own) in SCENES {
        println!("{name}");
        let mut arguments = vec!["--rounds", &options.rounds, "--size", &options.size, "--samples", "16"];
        arguments.extend(own);
        arguments.extend(PARAMETERS.iter().flat_map(|parameter| ["--parameter", parameter]));
        made.push(study(kiln, scene, &folder.join(name), &arguments)?);
    }
    let studies: Vec<_> = made.iter().map(rows).collect();
    let base = |rows: &[(&str, String, &Value)]| {
        let found = rows.iter().find(|row| (row.0, row.1.as_str()) == BASE);
        found.map_or(Err("a study lacks paths".into()), |row| number(&row.2["trace_ms"]["median"]))
    };
    let bases = studies.iter().map(|rows| base(rows)).collect::<Result<Vec<f64>>>()?;
    let mut names: Vec<(&str, &str)> = Vec::new();
    for parameter in PARAMETERS {
        let of_all = studies.iter().flatten().filter(|row| row.0 == parameter);
        for (parameter, setting, _) in of_all {
            if !names.contains(&(*parameter, setting.as_str())) {
                names.push((*parameter, setting.as_str()));
            }
        }
    }
    let mut table = format!("{HEAD}\n|{}", " --- |".repeat(8));
    for (parameter, setting) in names {
        table += &format!("\n| {parameter} | {setting} |");
        for (rows, base) in studies.iter().zip(&bases) {
            let row = rows.iter().find(|row| (row.0, row.1.as_str()) == (parameter, setting));
            let cells = row.map(|row| cells(row.2, *base)).transpose()?;
            table += &format!(" {} |", cells.as_deref().unwrap_or("– | – | –"));
        }
    }
    println!("{table}");
    into_page(HEAD, &table)
}
