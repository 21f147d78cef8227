//! `kiln bench`: how fast kiln and other libraries answer rays, and how many of their answers are wrong.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args;

use super::super::{Printer, pool, print};
use super::{aligned, grouped, watched};
use crate::bench::speed::{self, From, Kind, Questions, Row, Settings, contenders, measure};
use crate::bench::{Absent, Spread};
use crate::error::{Error, Result, Warnings};
use crate::import;
use crate::world::bring_into_range;

#[derive(Args)]
pub struct Arguments {
    /// Files to put into one scene: .toml, .obj, .gltf, .glb
    #[arg(value_name = "INPUT")]
    inputs: Vec<PathBuf>,
    /// Rounds that count, after one to warm up; in each of them all engines take turns
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: u32,
    /// Threads to build and to cast rays on
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..))]
    threads: u16,
    /// An engine to time, or `/` and its layout, tier or preset after it; all that are there, if not given
    #[arg(long, value_name = "NAME")]
    engine: Vec<String>,
    /// Pixels along each side of the picture that rays are cast for
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(16..=8192))]
    size: u32,
    /// Where it is seen from: by the scene's camera or else from outside, from outside, or from its middle
    #[arg(long, value_name = "PLACE", default_value = "scene", value_parser = From::NAMES)]
    from: String,
}

pub fn run(arguments: &Arguments, interrupted: &AtomicBool) -> Result<()> {
    let (contenders, absent) = chosen(&arguments.engine, usize::from(arguments.threads))?;
    let mut warnings = Warnings::default();
    let mut scene = import::load(&arguments.inputs, &mut warnings)?;
    bring_into_range(&mut scene);
    let triangles = speed::triangles(&scene);
    if triangles.spheres > 0 {
        warnings.note(format!("{} sphere(s) left out: triangles alone are compared", triangles.spheres));
    }
    if triangles.too_small > 0 {
        warnings.push(format!("{} triangle(s) too small for f32; left out", triangles.too_small));
    }
    Printer::default().print(&warnings, true);
    let eye = speed::eye(&scene, From::named(&arguments.from).unwrap_or_default(), arguments.size)?;
    drop(scene);
    let timed = pool(Some(arguments.threads))?;
    let rows = watched(None, "timing", interrupted, |watch| {
        let questions = Questions::new(&triangles.mesh, &eye);
        let settings = Settings { runs: arguments.runs, pool: &timed };
        measure(&contenders, &triangles.mesh, &questions, &settings, watch)
    })?;
    print(&as_text(&rows, &absent, arguments))
}

type Chosen = (Vec<Box<dyn speed::Contender>>, Vec<Absent>);

/// The contenders that are asked for: `kiln`, or `kiln/bvh2/exact` for those of that layout and tier.
fn chosen(asked: &[String], threads: usize) -> Result<Chosen> {
    let (mut present, mut absent) = contenders(threads);
    if asked.is_empty() {
        return Ok((present, absent));
    }
    for name in asked {
        let engine = name.split('/').next().unwrap_or(name);
        if let Some(Absent { name, reason, remedy }) = absent.iter().find(|absent| absent.name == engine) {
            return Err(Error::Failed { what: format!("{name}: {reason}"), hint: (*remedy).into() });
        }
        if !present.iter().any(|contender| is_meant(&contender.label(), name)) {
            let hint = format!("engines are {}; without --engine, all are listed", speed::NAMES.join(", "));
            return Err(Error::usage(format!("no engine is called `{name}`"), hint));
        }
    }
    present.retain(|contender| asked.iter().any(|name| is_meant(&contender.label(), name)));
    absent.clear();
    Ok((present, absent))
}

fn is_meant(label: &speed::Label, name: &str) -> bool {
    let mut parts = name.split('/');
    let known = [Some(label.layout), label.tier, label.preset];
    parts.next() == Some(label.engine) && parts.all(|part| known.contains(&Some(part)))
}

fn as_text(rows: &[Row], absent: &[Absent], arguments: &Arguments) -> String {
    let titles = ["engine", "layout", "tier", "preset", "build ms", "B/tri"];
    let kinds = Kind::ALL.map(Kind::name);
    let titles = titles.into_iter().chain(kinds).chain(["wrong"]);
    let mut lines = vec![titles.map(str::to_owned).collect::<Vec<_>>()];
    for row in rows {
        let label = &row.label;
        let rate = |rate: &Option<Spread>| rate.map_or("-".into(), |spread| with_spread(&spread));
        let bytes = row.facts.bytes.map(|bytes| bytes as f64 / row.triangles as f64);
        let mut line: Vec<String> =
            [label.engine, label.layout, label.tier.unwrap_or("-"), label.preset.unwrap_or("-")]
                .map(str::to_owned)
                .to_vec();
        line.push(few(row.build_ms.median));
        line.push(bytes.map_or("-".into(), few));
        line.extend(row.mrays_per_s.iter().map(rate));
        line.push(grouped(row.wrong.iter().sum()));
        lines.push(line);
    }
    let mut text = String::new();
    if let Some(row) = rows.first() {
        let rays: Vec<String> = Kind::ALL
            .iter()
            .map(|&kind| format!("{} {}", grouped(row.rays[kind as usize] as u64), kind.name()))
            .collect();
        text += &format!(
            "{} triangles; rays: {}.\nMillion rays a second on {} thread(s): medians of {} rounds, half the distance of the \
             quartiles in per cent.\n\n",
            grouped(row.triangles as u64),
            rays.join(", "),
            row.threads,
            arguments.runs
        );
    }
    text += &aligned(&lines, 4);
    for Absent { name, reason, remedy } in absent {
        text += &format!("\n{name}: not timed: {reason}; {remedy}");
    }
    if !absent.is_empty() {
        text.push('\n');
    }
    text
}

/// With three digits.
fn few(x: f64) -> String {
    match x {
        _ if x >= 99.95 => grouped(x.round() as u64),
        _ if x >= 9.995 => format!("{x:.1}"),
        _ => format!("{x:.2}"),
    }
}

fn with_spread(spread: &Spread) -> String {
    let half = (spread.upper - spread.lower) / 2.0 / spread.median * 100.0;
    format!("{} ±{half:.0}%", few(spread.median))
}
