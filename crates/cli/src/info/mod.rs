//! `kiln info`: contents, defects, sizes, cost and warnings of files.

mod contents;
mod geometry;
mod lights;
mod materials;
mod objects;
mod rendering;

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::arguments::inputs_help;
use super::{json_text, print};
use crate::options::Table;
use kiln::effects::check_scene;
use kiln::error::{Error, Result, Warnings, printable};
use kiln::import::{self, FileNames};
use kiln::limits;
use kiln::scene::mesh::topology::Topology;
use kiln::scene::option::group;
use kiln::scene::{ImportOptions, Scene};
use rendering::{Memory, Rendering};

#[derive(Args)]
pub(crate) struct Arguments {
    /// Files to describe, as one scene.
    #[arg(required = true, value_name = "INPUT", help = inputs_help("Files to describe, as one scene"))]
    inputs: Vec<PathBuf>,
    /// Print JSON
    #[arg(long, help_heading = group::OUTPUT)]
    json: bool,
    #[command(flatten)]
    pub import: Table<ImportOptions>,
    /// Build the acceleration structure of large scenes too, to measure its time and memory instead of estimating them
    #[arg(long, help_heading = group::MEASUREMENT)]
    build: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let mut warnings = Warnings::default();
    let scene = import::load_with(&arguments.inputs, &arguments.import, &mut warnings)?;
    check_scene(&scene.effects)?;
    let drawable = import::check_drawable(&scene);
    let after_loading = Memory::now();
    let topology = Topology::of_scene(&scene);
    let (mut report, mut lines) = (Value::Null, Lines::default());
    if arguments.json {
        check_memory(&scene)?;
        report = contents::to_json(&arguments.inputs, &scene, &topology);
    }
    let names = FileNames::of(&arguments.inputs);
    contents::add_sizes(&mut lines, &names, &scene);
    objects::add(&mut lines, &scene, &topology);
    geometry::add(&mut lines, &scene, &topology);
    contents::add_names(&mut lines, &names, &scene);
    let rendering = Rendering::of(scene, arguments.build, &after_loading);
    rendering.add(&mut lines, &names);
    rendering.add_to_json(&mut report);
    let all = [&warnings, rendering.warnings()];
    for text in all.into_iter().flat_map(Warnings::messages) {
        lines.add("warning", names.shorten(text));
    }
    for text in all.into_iter().flat_map(Warnings::notes) {
        lines.add("note", names.shorten(text));
    }
    report["warnings"] = json!(warnings.messages());
    report["notes"] = json!(warnings.notes());
    // By the importers and by a render without options.
    report["left_out"] = all.into_iter().flat_map(Warnings::all_left_out).cloned().collect();
    if arguments.json {
        print(&json_text(&report))?;
    } else {
        print(&lines.0)?;
    }
    // The contents are printed before the error.
    drawable
}

/// Checks the memory limit for the JSON of the objects: its values and their text, measured with 40,000 objects.
fn check_memory(scene: &Scene) -> Result<()> {
    const OBJECT: u64 = 4200;
    let count = scene.objects.len() as u64;
    limits::check(limits::product(&[count, OBJECT])).map_err(|excess| Error::Memory {
        what: format!("the JSON of {count} objects {excess}"),
        hint: format!("leave --json out, or {}", excess.remedy()),
    })
}

/// Lines of text, each with a label.
#[derive(Default)]
struct Lines(String);

impl Lines {
    fn add(&mut self, label: &str, value: impl std::fmt::Display) {
        let _ = writeln!(self.0, "{label:<12}{}", printable(&value.to_string()));
    }
}
