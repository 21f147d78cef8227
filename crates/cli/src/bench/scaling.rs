//! `kiln bench scaling`: build time, memory and ray throughput against the number of triangles.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args;
use serde_json::Value;

use super::super::{pool, print};
use super::speed::{Report, chosen, json};
use super::{grouped, table, three_digits, with_progress};
use kiln::error::Result;
use kiln::files::{check_writable, write_whole};
use kiln::scene::option::group;
use kiln_lab::bench::speed::{self, Kind, ScalingStep, Settings, scaling, sizes};
use kiln_lab::timing::Clock;

#[derive(Args)]
#[command(next_help_heading = group::MEASUREMENT)]
pub(crate) struct Arguments {
    /// Number of triangles of the largest mesh; the others have a tenth, a hundredth and so on, down to 1000
    #[arg(long, value_name = "N", default_value_t = 10_000_000,
          value_parser = crate::numbers::whole(1000..=100_000_000u32))]
    largest: u32,
    /// Number of timed rounds after a warm-up round
    #[arg(long, allow_hyphen_values = true, value_name = "N", default_value_t = 5, value_parser = crate::numbers::whole(1..=1000u32))]
    runs: u32,
    /// Number of threads for building and tracing
    #[arg(long, help_heading = group::LIMITS, allow_hyphen_values = true, value_name = "N", default_value_t = 1, value_parser = crate::numbers::whole(1..=u16::MAX))]
    threads: u16,
    /// Engine to measure, named as by `kiln bench`; may be repeated [default: the default layout of kiln, and Embree]
    #[arg(long, value_name = "NAME")]
    engine: Vec<String>,
    /// Width and height in pixels of the picture that rays are generated for
    #[arg(long, allow_hyphen_values = true, value_name = "N", default_value_t = 512, value_parser = crate::numbers::whole(16..=8192u32))]
    size: u32,
    /// Print JSON
    #[arg(long, help_heading = group::OUTPUT)]
    json: bool,
    /// Write a plot as SVG
    #[arg(long, help_heading = group::OUTPUT, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments, interrupted: &AtomicBool) -> Result<()> {
    let threads = usize::from(arguments.threads);
    let engines = match arguments.engine.as_slice() {
        [] => speed::defaults(threads),
        typed => chosen(typed, threads)?.0,
    };
    arguments.plot.iter().try_for_each(|file| check_writable(file))?;
    let timed = pool(Some(arguments.threads))?;
    let steps = with_progress(None, "timing", interrupted, |control| {
        let settings = Settings { runs: arguments.runs, pool: &timed, check: false };
        scaling(&engines, &sizes(arguments.largest as usize), arguments.size, &settings, control)
    })?;
    if let Some(file) = &arguments.plot {
        let svg = speed::scaling_plot(&steps);
        write_whole(file, |out| out.write_all(svg.as_bytes()))?;
    }
    print(&if arguments.json {
        super::report("generated meshes", as_json(&steps, arguments))
    } else {
        as_text(&steps, arguments)
    })
}

fn as_json(steps: &[ScalingStep], arguments: &Arguments) -> Value {
    let rows = steps.iter().flat_map(|step| {
        let report =
            Report { rows: &step.rows, absent: &[], subject: step.family.name(), runs: arguments.runs };
        let Value::Array(mut rows) = json::rows(&report) else { return Vec::new() };
        for row in &mut rows {
            row["peak_bytes"] = step.peak_bytes.into();
        }
        rows
    });
    rows.collect()
}

fn as_text(steps: &[ScalingStep], arguments: &Arguments) -> String {
    let titles = ["mesh", "engine", "layout", "triangles", "build ms", "ns/tri", "B/tri", "build peak"];
    let titles = titles.into_iter().chain(Kind::ALL.map(Kind::name));
    let mut lines = Vec::new();
    for step in steps {
        for row in &step.rows {
            let dash = || "-".to_owned();
            let mut line =
                [step.family.name(), row.label.engine, row.label.layout].map(str::to_owned).to_vec();
            line.push(grouped(row.triangles as u64));
            line.push(three_digits(row.build_ms.median));
            line.push(three_digits(row.build_ms.median * 1e6 / row.triangles as f64));
            line.push(row.bytes_per_triangle().map_or_else(dash, three_digits));
            line.push(row.build_peak_bytes.map_or_else(dash, mebibytes));
            let speed = |kind| row.mrays_per_s(kind).map_or_else(dash, |spread| three_digits(spread.median));
            line.extend(Kind::ALL.map(speed));
            lines.push(line);
        }
    }
    let mut text = format!(
        "Generated meshes: a bumpy sphere, a soup of triangles, a long thin tube on a spool; {} thread(s), {} time, medians of {}.\n\
         Build peak: memory that building took at once, with the structure itself; rays: million a second.\n\n{}",
        arguments.threads,
        Clock::name(usize::from(arguments.threads)),
        crate::numbers::counted(arguments.runs as usize, "round", "rounds"),
        table(titles, lines, 3)
    );
    if let Some(peak) = steps.iter().filter_map(|step| step.peak_bytes).max() {
        text += &format!(
            "\nThe most memory that the whole process held, with the mesh, the rays and all structures: {}\n",
            mebibytes(peak)
        );
    }
    text
}

fn mebibytes(bytes: u64) -> String {
    format!("{} MiB", grouped(bytes / (1 << 20)))
}
