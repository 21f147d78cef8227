//! Results as an HTML page with plots, self-contained in one file.

use std::fmt::Write;

use super::super::Unavailable;
use super::super::envelope::processor;
use super::super::html::{self, escaped};
use super::super::plot::{Bar, bars, short};
use super::{Kind, NAMES, SpeedRow};
use crate::error::Result;
use crate::timing::{Clock, Quartiles};

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;color:#222;max-width:960px;margin:2em auto;padding:0 1em}\
h1{font-size:1.6em}h2{font-size:1.2em;margin-top:2em}svg{max-width:100%;height:auto}\
table{border-collapse:collapse;font-size:13px;width:100%}th,td{padding:.25em .5em;border-bottom:1px solid #ddd;text-align:right}\
.left{text-align:left}.wrong{color:#b00;font-weight:600}.scroll{overflow-x:auto}\
code{background:#f2f2f2;padding:.1em .3em}p.note{color:#555}";

/// The HTML page of the results for `subject` from `runs` rounds.
///
/// # Errors
/// [`Error::Failed`](crate::error::Error::Failed) if a plot cannot be drawn.
pub fn page(rows: &[SpeedRow], absent: &[Unavailable], subject: &str, runs: u32) -> Result<String> {
    let title = format!("kiln bench: {}", escaped(subject));
    let mut html = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <title>{title}</title><style>{STYLE}</style></head><body>\n<h1>{title}</h1>\n"
    );
    if let Some(row) = rows.first() {
        let _ = writeln!(
            html,
            "<p>{} triangles; kiln {}; {}; {} thread(s), timed by {} time; {} rounds in which all take turns, after one to warm \
             up. Bars are medians, the dark lines reach from the lower to the upper quartile. Compare within this page only.</p>",
            row.triangles,
            env!("CARGO_PKG_VERSION"),
            escaped(&processor()),
            row.threads,
            Clock::name(row.threads),
            runs
        );
    }
    for (kind, heading, about) in KINDS {
        let plot = bars("million rays a second (longer is better)", &of_kind(rows, kind))?;
        let count = rows.first().map_or(0, |row| row.rays[kind as usize]);
        let _ = writeln!(html, "<h2>{heading}</h2>\n<p class=\"note\">{about} {count} rays.</p>\n{plot}");
    }
    let built = rows.iter().map(|row| bar(row, row.build_ms, 0)).collect::<Vec<_>>();
    let plot = bars("milliseconds (shorter is better)", &built)?;
    let _ = writeln!(
        html,
        "<h2>Building</h2>\n<p class=\"note\">From triangles in memory to ready for rays.</p>\n{plot}"
    );
    html += &table(rows);
    for Unavailable { name, reason, remedy } in absent {
        let _ = writeln!(html, "<p>{name}: not timed: {}; {}</p>", escaped(reason), escaped(remedy));
    }
    html += "</body></html>\n";
    Ok(html)
}

/// Kinds of rays with their heading and description.
const KINDS: [(Kind, &str, &str); 4] = [
    (
        Kind::Primary,
        "Primary rays",
        "From a camera through the pixels of a picture, tile by tile: the closest hit.",
    ),
    (
        Kind::Shadow,
        "Shadow rays",
        "From what those hit to a point light, in the same order: whether anything is in the way.",
    ),
    (
        Kind::Diffuse,
        "Diffuse rays",
        "From what those hit, cosine-distributed about the normal: the closest hit.",
    ),
    (Kind::Random, "Random rays", "From a random point of the bounds towards another: the closest hit."),
];

fn of_kind(rows: &[SpeedRow], kind: Kind) -> Vec<Bar> {
    let measured = rows.iter().filter_map(|row| Some((row, row.mrays_per_s(kind)?)));
    measured.map(|(row, speed)| bar(row, speed, row.wrong.map_or(0, |wrong| wrong[kind as usize]))).collect()
}

fn bar(row: &SpeedRow, value: Quartiles, wrong: u64) -> Bar {
    let label = &row.label;
    let parts = [Some(label.engine), Some(label.layout), label.tier, label.preset];
    Bar {
        name: parts.into_iter().flatten().collect::<Vec<_>>().join(" "),
        colour: NAMES.iter().position(|name| *name == label.engine).unwrap_or(NAMES.len()),
        value,
        warning: if wrong > 0 { format!("✗ {wrong} wrong") } else { String::new() },
    }
}

fn table(rows: &[SpeedRow]) -> String {
    let kinds = Kind::ALL.map(Kind::name).join("|");
    let titles =
        format!("<engine|<layout|<tier|<preset|isa|build ms|nodes|depth|SAH|B/triangle|tests|{kinds}|wrong");
    let dash = || "–".to_owned();
    let row = |row: &SpeedRow| {
        let (label, facts) = (&row.label, &row.facts);
        let names =
            [label.engine, label.layout, label.tier.unwrap_or("–"), label.preset.unwrap_or("–"), label.isa];
        let mut cells = names.map(escaped).to_vec();
        cells.push(short(row.build_ms.median));
        cells.push(facts.nodes.map_or_else(dash, |nodes| nodes.to_string()));
        cells.push(facts.depth.map_or_else(dash, |depth| depth.to_string()));
        cells.push(facts.sah_cost.map_or_else(dash, short));
        cells.push(row.bytes_per_triangle().map_or_else(dash, short));
        let tests = row.tests_per_ray(Kind::Primary).map(|tests| tests.map(short).join(" + "));
        cells.push(tests.unwrap_or_else(dash));
        let speed = |kind| row.mrays_per_s(kind).map_or_else(dash, |speed| short(speed.median));
        cells.extend(Kind::ALL.map(speed));
        let wrong = row.all_wrong().unwrap_or(0);
        let class = if wrong > 0 { " class=\"wrong\"" } else { "" };
        let cells = cells.into_iter().map(|cell| ("", cell)).chain([(class, wrong.to_string())]);
        (String::new(), cells.collect())
    };
    "<h2>Numbers</h2>\n<p class=\"note\">Wrong: answers that differ from those of exact arithmetic. \
     SAH: inner nodes entered and primitives tested by a random line through the bounds, on average. \
     Tests: boxes + primitives of a primary ray, on average.</p>\n"
        .to_owned()
        + &html::table(&titles, rows.iter().map(row))
}
