//! `kiln bench`: ray throughput and number of wrong results of kiln and other libraries.

pub(crate) mod json;
mod text;

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args;

use super::super::arguments::inputs_help;
use super::super::{WarningPrinter, pool, print};
use super::with_progress;
use crate::bench::generate::Family;
use crate::bench::speed::{self, RaySets, Settings, SpeedRow, ViewSetup, Viewpoint, engines, measure, page};
use crate::bench::{Engine, Label, Mesh, Unavailable};
use crate::error::{Error, Result, Warnings};
use crate::files::write_whole;
use crate::import;
use crate::scene::ImportOptions;
use crate::world::recenter;

#[derive(Args)]
pub(crate) struct Arguments {
    /// Files to put into one scene; a bumpy sphere, if not given.
    #[arg(value_name = "INPUT", help = format!("{}; a bumpy sphere, if not given", inputs_help("Files to put into one scene")))]
    inputs: Vec<PathBuf>,
    #[command(flatten)]
    pub import: ImportOptions,
    /// Rounds that count, after one to warm up; in each of them all engines take turns
    #[arg(long, allow_hyphen_values = true, value_name = "N", default_value_t = 5, value_parser = crate::cli::numbers::whole(1..=1000u32))]
    runs: u32,
    /// Threads to build and to cast rays on
    #[arg(long, allow_hyphen_values = true, value_name = "N", default_value_t = 1, value_parser = crate::cli::numbers::whole(1..=u16::MAX))]
    threads: u16,
    /// An engine to time, or `/` and its layout, tier or preset after it; all that are there, if not given
    #[arg(long, value_name = "NAME")]
    engine: Vec<String>,
    /// Pixels along each side of the picture that rays are cast for
    #[arg(long, allow_hyphen_values = true, value_name = "N", default_value_t = 1024, value_parser = crate::cli::numbers::whole(16..=8192u32))]
    size: u32,
    /// Where it is seen from: by the scene's camera or else from outside, from outside, or from its middle
    #[arg(long, value_name = "PLACE", default_value = "scene", value_parser = Viewpoint::NAMES)]
    from: String,
    /// Triangles of the bumpy sphere, about
    #[arg(long, value_name = "N", default_value_t = 1_000_000, conflicts_with = "inputs",
          value_parser = crate::cli::numbers::whole(100..=20_000_000u32))]
    triangles: u32,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Write a page with plots, which needs nothing besides itself
    #[arg(long, value_name = "FILE.html")]
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
    let (mesh, setup) = subject(arguments)?;
    let timed = pool(Some(arguments.threads))?;
    let rows = with_progress(None, "timing", interrupted, |control| {
        let ray_sets = RaySets::new(&mesh, &setup);
        let settings = Settings { runs: arguments.runs, pool: &timed, check: true };
        measure(&engines, &mesh, &ray_sets, &settings, control)
    })?;
    let subject = name(arguments);
    let report = Report { rows: &rows, absent: &absent, subject: &subject, runs: arguments.runs };
    if let Some(file) = &arguments.page {
        let html = page(&rows, &absent, &subject, arguments.runs)?;
        write_whole(file, |out| out.write_all(html.as_bytes()))?;
    }
    print(&if arguments.json { super::report(&subject, json::rows(&report)) } else { text::tables(&report) })
}

/// Name of the mesh and viewpoint.
fn name(arguments: &Arguments) -> String {
    let files: Vec<String> = arguments
        .inputs
        .iter()
        .map(|file| file.file_name().unwrap_or(file.as_os_str()).to_string_lossy().into_owned())
        .collect();
    let place = if arguments.from == "scene" { String::new() } else { format!(", from {}", arguments.from) };
    if files.is_empty() { format!("a bumpy sphere{place}") } else { format!("{}{place}", files.join(" ")) }
}

/// The mesh and the viewpoint.
fn subject(arguments: &Arguments) -> Result<(Mesh, ViewSetup)> {
    let from = Viewpoint::named(&arguments.from).unwrap_or_default();
    if arguments.inputs.is_empty() {
        let mesh = Family::Sphere.mesh(arguments.triangles as usize);
        let setup = speed::view_setup(&speed::scene(&mesh), from, arguments.size)?;
        return Ok((mesh, setup));
    }
    let mut warnings = Warnings::default();
    let mut scene = import::load_with(&arguments.inputs, &arguments.import, &mut warnings)?;
    recenter(&mut scene);
    let triangles = speed::triangles(&scene);
    if triangles.spheres > 0 {
        warnings.note(format!("{} sphere(s) left out: triangles alone are compared", triangles.spheres));
    }
    WarningPrinter::default().print(&warnings, true);
    if triangles.mesh.triangles.is_empty() {
        let hint = "`kiln info` says what the files hold; without INPUT a mesh is made";
        let what = "there is no triangle in it to cast rays at";
        return Err(Error::input(arguments.inputs[0].as_path(), what, hint));
    }
    let setup = speed::view_setup(&scene, from, arguments.size)?;
    Ok((triangles.mesh, setup))
}

pub(crate) type Chosen = (Vec<Engine>, Vec<Unavailable>);

/// Engines selected by name: `kiln`, or `kiln/bvh2/exact` for a layout and tier; all without a name.
pub(crate) fn chosen(typed: &[String], threads: usize) -> Result<Chosen> {
    let (mut present, mut absent) = engines(threads);
    if typed.is_empty() {
        return Ok((present, absent));
    }
    for name in typed {
        let engine = name.split('/').next().unwrap_or(name);
        if let Some(Unavailable { name, reason, remedy }) = absent.iter().find(|absent| absent.name == engine)
        {
            return Err(Error::Failed { what: format!("{name}: {reason}"), hint: (*remedy).into() });
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
