//! `kiln bench`: ray throughput and number of wrong results of kiln and other libraries.

pub(crate) mod json;
mod text;

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args;

use super::super::{pool, print};
use super::subject::Subject;
use super::with_progress;
use kiln::error::{Error, Result};
use kiln::files::{check_writable, write_whole};
use kiln::scene::option::group;
use kiln_lab::bench::speed::{self, RaySets, Settings, SpeedRow, engines, measure, page};
use kiln_lab::bench::{Engine, Label, Unavailable};

#[derive(Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub subject: Subject,
    /// Number of timed rounds after a warm-up round
    #[arg(long, help_heading = group::MEASUREMENT, allow_hyphen_values = true, value_name = "N", default_value_t = 5, value_parser = crate::numbers::whole(1..=1000u32))]
    runs: u32,
    /// Number of threads for building and tracing
    #[arg(long, help_heading = group::LIMITS, allow_hyphen_values = true, value_name = "N", default_value_t = 1, value_parser = crate::numbers::whole(1..=u16::MAX))]
    threads: u16,
    /// Engine to measure, such as kiln, embree/high or kiln/bvh8/exact (layout, tier or preset after `/`); may be repeated
    /// [default: all that are available]
    #[arg(long, help_heading = group::MEASUREMENT, value_name = "NAME")]
    engine: Vec<String>,
    /// Print JSON
    #[arg(long, help_heading = group::OUTPUT)]
    json: bool,
    /// Write a self-contained HTML page with plots
    #[arg(long, help_heading = group::OUTPUT, value_name = "FILE.html")]
    page: Option<PathBuf>,
}

/// Results of a benchmark, for its output formats.
pub(crate) struct Report<'a> {
    pub rows: &'a [SpeedRow],
    pub absent: &'a [Unavailable],
    /// Name of the measured mesh.
    pub subject: &'a str,
    /// Number of measured rounds.
    pub runs: u32,
}

pub(crate) fn run(arguments: &Arguments, interrupted: &AtomicBool) -> Result<()> {
    let (engines, absent) = chosen(&arguments.engine, usize::from(arguments.threads))?;
    let (_, mesh, setup) = arguments.subject.load()?;
    arguments.page.iter().try_for_each(|file| check_writable(file))?;
    let timed = pool(Some(arguments.threads))?;
    let rows = with_progress(None, "timing", interrupted, |control| {
        let ray_sets = RaySets::new(&mesh, &setup);
        let settings = Settings { runs: arguments.runs, pool: &timed, check: true };
        measure(&engines, &mesh, &ray_sets, &settings, control)
    })?;
    let subject = arguments.subject.name();
    let report = Report { rows: &rows, absent: &absent, subject: &subject, runs: arguments.runs };
    let json = super::report(&subject, json::rows(&report));
    if let Some(file) = &arguments.page {
        write_whole(file, |out| out.write_all(page(&json).as_bytes()))?;
    }
    print(&if arguments.json { json } else { text::tables(&report) })
}

pub(crate) type Chosen = (Vec<Engine>, Vec<Unavailable>);

/// Engines selected by name: `kiln`, or `kiln/bvh8/exact` for a layout and tier; all without a name.
pub(crate) fn chosen(typed: &[String], threads: usize) -> Result<Chosen> {
    let (mut present, mut absent) = engines(threads);
    if typed.is_empty() {
        return Ok((present, absent));
    }
    for name in typed {
        let engine = name.split('/').next().unwrap_or(name);
        if let Some(absent) = absent.iter().find(|absent| absent.name == engine) {
            return Err(absent.error());
        }
        if !present.iter().any(|engine| is_selected(&engine.label, name)) {
            let hint = format!("engines are {}; without --engine, all are listed", speed::NAMES.join(", "));
            return Err(Error::usage(format!("no engine is called `{name}`"), hint));
        }
    }
    present.retain(|engine| typed.iter().any(|name| is_selected(&engine.label, name)));
    absent.clear();
    Ok((present, absent))
}

fn is_selected(label: &Label, name: &str) -> bool {
    let mut parts = name.split('/');
    let known = [Some(label.layout), label.tier, label.preset];
    parts.next() == Some(label.engine) && parts.all(|part| known.contains(&Some(part)))
}
