//! Results as text tables.

use std::fmt::Write;

use super::super::{grouped, quartiles, table, three_digits};
use super::Report;
use kiln::error::printable;
use kiln_lab::bench::speed::{Kind, SpeedRow, best};
use kiln_lab::timing::{Clock, Quartiles};

/// Tables of throughput, of build and memory, and of the fastest engines.
pub(crate) fn tables(report: &Report) -> String {
    let mut text = String::new();
    if let Some(row) = report.rows.first() {
        let count = |kind: Kind| format!("{} {}", grouped(row.rays[kind as usize] as u64), kind.name());
        let _ = writeln!(text, "{}: {} triangles", printable(report.subject), grouped(row.triangles as u64));
        let _ = writeln!(text, "rays: {}", Kind::ALL.map(count).join(", "));
        let _ = writeln!(
            text,
            "Million rays a second on {} thread(s) by {} time: median of {} rounds ± half the distance of its quartiles.\n",
            row.threads,
            Clock::name(row.threads),
            report.runs
        );
        text += &speeds(report.rows);
        text.push('\n');
        text += &structures(report.rows);
        text += &comparison(report.rows);
    }
    for absent in report.absent {
        let _ = writeln!(text, "\n{absent}");
    }
    text
}

fn name(row: &SpeedRow) -> Vec<String> {
    let label = &row.label;
    [label.engine, label.layout, label.tier.unwrap_or("-"), label.preset.unwrap_or("-")]
        .map(str::to_owned)
        .to_vec()
}

/// Columns that identify a row.
const NAMES: [&str; 4] = ["engine", "layout", "tier", "preset"];

fn speeds(rows: &[SpeedRow]) -> String {
    let line = |row: &SpeedRow| {
        let mut line = name(row);
        line.push(with_spread(&row.build_ms));
        line.extend(Kind::ALL.map(|kind| or_dash(row.mrays_per_s(kind), |spread| with_spread(&spread))));
        line.push(or_dash(row.all_wrong(), grouped));
        line
    };
    let kinds = Kind::ALL.map(Kind::name);
    table(
        NAMES.into_iter().chain(["build ms"]).chain(kinds).chain(["wrong"]),
        rows.iter().map(line),
        NAMES.len(),
    )
}

fn structures(rows: &[SpeedRow]) -> String {
    let line = |row: &SpeedRow| {
        let (mut line, facts) = (name(row), &row.facts);
        line.push(row.label.isa.to_owned());
        line.push(or_dash(facts.nodes, grouped));
        line.push(or_dash(facts.depth, |depth| depth.to_string()));
        line.push(or_dash(facts.sah_cost, three_digits));
        line.push(or_dash(row.bytes_per_triangle(), three_digits));
        line.extend([Kind::Primary, Kind::Diffuse].map(|kind| {
            or_dash(row.tests_per_ray(kind), |[nodes, prims]| {
                format!("{} + {}", three_digits(nodes), three_digits(prims))
            })
        }));
        line
    };
    let titles = ["isa", "nodes", "depth", "SAH", "B/tri", "primary tests", "diffuse tests"];
    let mut text = table(NAMES.into_iter().chain(titles), rows.iter().map(line), NAMES.len());
    text +=
        "B/tri: bytes of the structure and its triangles; tests: boxes + primitives of a ray, on average.\n";
    text
}

/// Comparison of kiln in its default tier with two rows of each other library, per kind of ray: the fastest, and the
/// fastest without a wrong answer in the run, if that is another.
fn comparison(rows: &[SpeedRow]) -> String {
    let mut engines: Vec<&str> =
        rows.iter().map(|row| row.label.engine).filter(|name| *name != "kiln").collect();
    engines.dedup();
    let mut lines = Vec::new();
    for kind in Kind::ALL {
        let Some(own) = best(rows, "kiln", kind) else { continue };
        for engine in &engines {
            let fastest = best(rows, engine, kind);
            let right = best(rows.iter().filter(|row| row.all_wrong() == Some(0)), engine, kind);
            let is_other = |row: &&SpeedRow| fastest.is_none_or(|fastest| fastest.label != row.label);
            for other in fastest.into_iter().chain(right.filter(is_other)) {
                let Some(ratio) = own.ratio(other, kind) else { continue };
                let times = quartiles(ratio);
                let wrong = or_dash(other.all_wrong(), grouped);
                let other = format!("{engine} {}", words(other));
                lines.push(vec![kind.name().to_owned(), words(own), other, wrong, times]);
            }
        }
    }
    if lines.is_empty() {
        return String::new();
    }
    let titles = ["rays", "kiln", "the fastest of another library", "wrong", "times as fast"];
    format!(
        "\nkiln in its default tier beside the fastest of each library, and beside its fastest without a wrong answer in this \
         run,\nround by round: median (quartiles).\n\n{}",
        table(titles, lines, 3)
    )
}

/// Layout, tier and preset of a row.
fn words(row: &SpeedRow) -> String {
    let label = &row.label;
    let words = [Some(label.layout), label.tier, label.preset];
    words.into_iter().flatten().collect::<Vec<_>>().join(" ")
}

fn or_dash<T>(value: Option<T>, show: impl Fn(T) -> String) -> String {
    value.map_or("-".into(), show)
}

fn with_spread(spread: &Quartiles) -> String {
    let half = (spread.upper - spread.lower) / 2.0 / spread.median * 100.0;
    format!("{} ±{half:.0}%", three_digits(spread.median))
}
