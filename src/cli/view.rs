//! `kiln view`: the window.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;

use super::arguments::{self, Arguments};
use crate::effects::{Choices, check_scene};
use crate::error::{Error, Result, Warnings};
use crate::import::{self, FileRead};
use crate::job::RenderSettings;
use crate::job::camera::{Viewpoint, nothing_to_look_at};
use crate::scene::Scene;
use crate::viewer::{self, CameraSource, Opened, Settings, Start};

#[derive(Args)]
pub struct Command {
    #[command(flatten)]
    what: Arguments,
    /// Write what happens in the window, and when, to a file: a line of JSON each
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Measure the pauses of the interface for so many seconds, print the longest, and close the window
    #[arg(long, allow_hyphen_values = true, value_name = "SECONDS", value_parser = crate::cli::numbers::whole(1..=3600u16))]
    pauses: Option<u16>,
}

pub fn run(command: &Command) -> Result<()> {
    let Command { what, trace, pauses } = command;
    arguments::check(what)?;
    viewer::display::check()?;
    if what.crop.is_some() {
        return Err(Error::usage("--crop has no meaning in a window", "leave it out"));
    }
    if what.inputs.iter().any(|input| input == Path::new("-")) {
        return Err(Error::usage(
            "a window cannot show standard input",
            "give a file, which it can read again",
        ));
    }
    if let Some(missing) = what.inputs.iter().find(|input| !input.exists()) {
        return Err(Error::input(missing.as_path(), "no such file", "check the name and the folder"));
    }
    let threads = super::pool(what.threads)?;
    let own = what.clone();
    viewer::run(Start {
        inputs: what.inputs.clone(),
        open: Box::new(move |inputs, warnings| open(&own, inputs, warnings)),
        size: what.size,
        threads,
        trace: trace.clone(),
        pauses: pauses.map(|seconds| Duration::from_secs(seconds.into())),
        remembers: pauses.is_none(),
    })
}

/// Reads files, and finds out how they are first looked at: as `kiln render` would show them.
fn open(
    arguments: &Arguments,
    inputs: &[PathBuf],
    warnings: &mut Warnings,
) -> (Result<Opened>, Vec<FileRead>) {
    let (scene, files) = import::load_and_list(inputs, warnings);
    (scene.and_then(|scene| look(arguments, inputs, scene)), files)
}

/// How a scene is first looked at.
fn look(arguments: &Arguments, inputs: &[PathBuf], mut scene: Scene) -> Result<Opened> {
    let mut arguments = arguments.clone();
    if arguments.inputs != inputs {
        // Files that were dropped onto the window have other cameras.
        (arguments.camera, arguments.view) = (None, None);
        arguments.inputs = inputs.to_vec();
    }
    check_scene(&scene.effects)?;
    import::check_drawable(&scene)?;
    if scene.bounds().is_none() {
        return Err(nothing_to_look_at(&scene));
    }
    let asked = arguments.settings()?;
    let viewpoint = Viewpoint::of(&asked.camera, &scene, None)?;
    let size = viewpoint.size(&asked, &scene);
    let camera_source = match viewpoint {
        Viewpoint::Fitted(view) => CameraSource::Fitted(view),
        Viewpoint::Camera(camera) => match scene.cameras.iter().position(|own| *own == *camera) {
            Some(index) => CameraSource::Scene(index),
            None => CameraSource::Free(camera.into_owned()),
        },
    };
    let RenderSettings { projection, preset, shading, sampling, with, without, .. } = asked;
    let settings = Settings {
        choices: Choices {
            shading,
            sampling: sampling.or(scene.sampling),
            scene: std::mem::take(&mut scene.effects),
            with,
            without,
            even_idle: false,
        },
        numerics: asked.numerics.or(scene.numerics).unwrap_or_default(),
        pipeline: asked.colour.or(scene.colour).unwrap_or_default(),
    };
    Ok(Opened { scene, camera_source, projection, size, settings, preset })
}
