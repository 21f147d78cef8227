//! Results as an HTML page with plots, self-contained in one file.

use super::super::Unavailable;
use super::super::envelope::processor;
use super::super::html::{self, STYLE, escaped, filled};
use super::super::plot::{Bar, bars, three_digits};
use super::{Kind, NAMES, SpeedRow};
use crate::timing::{Clock, Quartiles};

/// The HTML page of the results for `subject` from `runs` rounds.
pub fn page(rows: &[SpeedRow], absent: &[Unavailable], subject: &str, runs: u32) -> String {
    let facts = rows.first().map(|row| {
        format!(
            "<p>{} triangles; kiln {}; {}; {} thread(s), timed by {} time; {runs} rounds in which all take turns, after one to warm \
             up. Bars are medians, the dark lines reach from the lower to the upper quartile. Compare within this page only.</p>\n",
            row.triangles,
            env!("CARGO_PKG_VERSION"),
            escaped(&processor()),
            row.threads,
            Clock::name(row.threads),
        )
    });
    let plots = KINDS.map(|(kind, heading, about)| {
        let plot = bars("million rays a second (longer is better)", &of_kind(rows, kind));
        let count = rows.first().map_or(0, |row| row.rays[kind as usize]);
        format!("<h2>{heading}</h2>\n<p class=\"note\">{about} {count} rays.</p>\n{plot}")
    });
    let built: Vec<Bar> = rows.iter().map(|row| bar(row, row.build_ms, 0)).collect();
    let unavailable = absent.iter().map(|absent| format!("<p>{}</p>\n", escaped(&absent.to_string())));
    let parts = [
        ("title", format!("kiln bench: {}", escaped(subject))),
        ("style", STYLE.to_owned()),
        ("facts", facts.unwrap_or_default()),
        ("plots", plots.concat()),
        ("building", bars("milliseconds (shorter is better)", &built)),
        ("table", table(rows)),
        ("unavailable", unavailable.collect()),
    ];
    filled(include_str!("page.html"), &parts)
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
        cells.push(three_digits(row.build_ms.median));
        cells.push(facts.nodes.map_or_else(dash, |nodes| nodes.to_string()));
        cells.push(facts.depth.map_or_else(dash, |depth| depth.to_string()));
        cells.push(facts.sah_cost.map_or_else(dash, three_digits));
        cells.push(row.bytes_per_triangle().map_or_else(dash, three_digits));
        let tests = row.tests_per_ray(Kind::Primary).map(|tests| tests.map(three_digits).join(" + "));
        cells.push(tests.unwrap_or_else(dash));
        let speed = |kind| row.mrays_per_s(kind).map_or_else(dash, |speed| three_digits(speed.median));
        cells.extend(Kind::ALL.map(speed));
        let wrong = row.all_wrong().unwrap_or(0);
        let class = if wrong > 0 { " class=\"bad\"" } else { "" };
        let cells = cells.into_iter().map(|cell| ("", cell)).chain([(class, wrong.to_string())]);
        (String::new(), cells.collect())
    };
    html::table(&titles, rows.iter().map(row))
}
