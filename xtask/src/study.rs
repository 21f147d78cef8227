//! `make-study`: the published studies, and the table of tiers in docs/accuracy.md.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::run::{Kiln, Result, json, list, mean, median, number, output, two_digits};

/// Make the published studies: the assignment scene, and time and errors of the tiers in it and in scenes/hard
///
/// Writes assets/study/assignment.csv and tiers.csv, docs/pictures/study.svg, and the table of tiers in docs/accuracy.md.
/// Takes some minutes; with --keep DIR it continues where it was interrupted.
#[derive(clap::Args)]
pub struct Options {
    /// Rounds of time measurement
    #[arg(long, default_value = "7")]
    rounds: String,
    /// Size of the pictures of the hard scenes
    #[arg(long, default_value = "64x64")]
    size: String,
    /// Size of the assignment's picture
    #[arg(long, default_value = "128x128")]
    assignment_size: String,
    /// Folder that keeps the studies; those that exist are used
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
}

const TIERS: [&str; 4] = ["fast", "watertight", "double", "exact"];
const PAGE: &str = "docs/accuracy.md";
/// The page explains the columns below the table.
const HEAD: &str = "| from | to | time | pictures | rays | leaks | error of t |";
const COLUMNS: &str = "scene,tier,width,height,picture_ms_lower,picture_ms,picture_ms_upper,rmse,max,flip,differing,\
    non_finite_pixels,rays,false_hits,false_misses,wrong_primitives,t_ulps_median,t_ulps_999,t_ulps_worst,\
    leaks_per_million";

/// A scene's row and geometry of one tier, parts of `study.json`.
struct Tier {
    row: Value,
    geometry: Value,
}

/// The study of a scene: made, or from an earlier run.
pub fn study(kiln: &Kiln, scene: &str, folder: &Path, options: &[&str]) -> Result<Value> {
    if !folder.join("study.svg").exists() {
        output(kiln.command(&["study", scene, "--progress", "none"]).args(options).arg("-o").arg(folder))?;
    }
    json(&folder.join("study.json"))
}

/// The tiers of a study, in the order of [`TIERS`].
fn tiers(made: &Value) -> Result<Vec<Tier>> {
    let find = |tier: &str| {
        let row =
            list(&made["rows"]).iter().find(|row| row["knob"] == "numerics" && row["setting"] == tier)?;
        let geometry = list(&made["geometry"]).iter().find(|found| found["numerics"] == tier)?;
        Some(Tier { row: row.clone(), geometry: geometry.clone() })
    };
    TIERS.iter().map(|tier| find(tier).ok_or_else(|| format!("the study lacks {tier}").into())).collect()
}

/// A time with three decimals, as in tiers.csv.
fn milliseconds(time: &Value) -> Result<f64> {
    Ok(format!("{:.3}", number(time)?).parse()?)
}

/// A field of tiers.csv; empty for a value that is missing.
fn cell(value: &Value) -> String {
    match value.as_f64() {
        Some(x) if value.is_f64() => two_digits(&format!("{x:?}")),
        Some(_) => value.to_string(),
        None => String::new(),
    }
}

/// A line of tiers.csv.
fn line(scene: &str, tier: &str, made: &Value, found: &Tier) -> Result<String> {
    let (row, geometry) = (&found.row, &found.geometry);
    let mut fields =
        vec![scene.to_owned(), tier.to_owned(), made["size"][0].to_string(), made["size"][1].to_string()];
    for part in ["lower", "median", "upper"] {
        fields.push(format!("{:?}", milliseconds(&row["trace_ms"][part])?));
    }
    fields.extend(["rmse", "max", "flip", "differing"].map(|part| cell(&row["twin"][part])));
    fields.push(cell(&row["non_finite"]));
    fields
        .extend(["rays", "false_hits", "false_misses", "wrong_primitives"].map(|part| cell(&geometry[part])));
    fields.extend([0, 1, 2].map(|at| cell(&geometry["t_ulps"][at])));
    fields.push(cell(&geometry["leaks_per_million"]));
    Ok(fields.join(","))
}

/// A number with two significant digits below 100, else a whole number with separators of thousands.
fn few(x: f64) -> String {
    if x < 100.0 {
        let rounded = format!("{x:.1e}").parse::<f64>().unwrap_or(x);
        return if rounded == 0.0 || rounded >= 1e-4 {
            rounded.to_string()
        } else {
            two_digits(&format!("{rounded:?}"))
        };
    }
    let digits = format!("{x:.0}");
    let groups: Vec<&str> =
        digits.as_bytes().rchunks(3).rev().filter_map(|group| str::from_utf8(group).ok()).collect();
    groups.join(",")
}

/// What one tier gets wrong in all scenes.
fn wrongs(of: &[&Tier]) -> [f64; 4] {
    let known =
        |get: fn(&Tier) -> &Value| of.iter().filter_map(|tier| get(tier).as_f64()).collect::<Vec<f64>>();
    let sum = |field: &str| of.iter().filter_map(|tier| tier.geometry[field].as_f64()).sum::<f64>();
    let pictures = known(|tier| &tier.row["twin"]["max"]).iter().filter(|max| **max >= 1.0 / 255.0).count();
    let found = sum("false_hits") + sum("false_misses") + sum("wrong_primitives");
    let leaks = mean(&known(|tier| &tier.geometry["leaks_per_million"]));
    [pictures as f64, 1e6 * found / sum("rays"), leaks, median(known(|tier| &tier.geometry["t_ulps"][2]))]
}

/// The table of the page: time of each tier relative to the one before it, and the errors of both.
fn table(scenes: &BTreeMap<String, Vec<Tier>>) -> Result<String> {
    let mut text = format!("{HEAD}\n| --- | --- | --- | --- | --- | --- | --- |");
    for after in 1..TIERS.len() {
        let before = after - 1;
        let time = |tier: &Tier| milliseconds(&tier.row["trace_ms"]["median"]);
        let ratios: Result<Vec<f64>> =
            scenes.values().map(|of| Ok(time(&of[after])? / time(&of[before])?)).collect();
        let mut ratios = ratios?;
        ratios.sort_by(f64::total_cmp);
        let quartile = |quarter: usize| ratios[(ratios.len() * quarter / 4).min(ratios.len() - 1)];
        let [old, new] =
            [before, after].map(|tier| wrongs(&scenes.values().map(|of| &of[tier]).collect::<Vec<_>>()));
        let change = |column: usize| format!("{} → {}", few(old[column]), few(new[column]));
        text += &format!(
            "\n| `{}` | `{}` | × {:.2} ({:.2} to {:.2}) | {} of {} | {} | {} | {} |",
            TIERS[before],
            TIERS[after],
            quartile(2),
            quartile(1),
            quartile(3),
            change(0),
            scenes.len(),
            change(1),
            change(2),
            change(3),
        );
    }
    Ok(text)
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

/// Makes the studies and writes the files.
pub fn run(kiln: &Kiln, options: &Options) -> Result<()> {
    let temporary = tempfile::tempdir()?;
    let folder = options.keep.as_deref().unwrap_or(temporary.path());
    let (mut scenes, mut lines) = (BTreeMap::new(), COLUMNS.to_owned() + "\n");
    let mut add = |name: &str, made: &Value| -> Result<()> {
        let found = tiers(made)?;
        for (tier, found) in TIERS.iter().zip(&found) {
            lines += &line(name, tier, made, found)?;
            lines.push('\n');
        }
        scenes.insert(name.to_owned(), found);
        Ok(())
    };
    let own = folder.join("assignment");
    let size = ["--rounds", &options.rounds, "--size", &options.assignment_size];
    add("assignment", &study(kiln, "scenes/assignment.toml", &own, &size)?)?;
    std::fs::copy(own.join("study.csv"), "assets/study/assignment.csv")?;
    std::fs::copy(own.join("study.svg"), "docs/pictures/study.svg")?;
    let files =
        std::fs::read_dir("scenes/hard")?.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()));
    let mut files = files.collect::<Result<Vec<String>>>()?;
    files.sort();
    for name in files.iter().filter_map(|file| file.strip_suffix(".toml")) {
        println!("{name}");
        // Only the tiers are published.
        let settings = ["--rounds", &options.rounds, "--size", &options.size, "--knob", "numerics"];
        add(name, &study(kiln, &format!("scenes/hard/{name}.toml"), &folder.join(name), &settings)?)?;
    }
    std::fs::write("assets/study/tiers.csv", lines)?;
    let table = table(&scenes)?;
    println!("{table}");
    into_page(HEAD, &table)
}
