//! `kiln view`: opens the viewer.

use std::path::{Path, PathBuf};

use clap::Args;

use super::arguments::{self, Arguments};
use kiln::animation::play_clip;
use kiln::error::{Error, Result, Warnings};
use kiln::files::hint_for_missing;
use kiln::import::{self, FileRead};
use kiln::job::camera::Viewpoint;
use kiln::job::{PictureOptions, PictureUse, RenderSettings, Session, warn_of_unused};
use kiln::scene::animation::Moment;
use kiln::scene::{ImportOptions, PictureSettings, Scene, Side};
use kiln_viewer::{CameraSource, Opened, Start};

#[derive(Args)]
#[command(mut_arg("inputs", |inputs| inputs.required(false).help(inputs_help())))]
pub(crate) struct Command {
    #[command(flatten)]
    pub arguments: Arguments,
}

fn inputs_help() -> String {
    arguments::inputs_help("Input files, combined into one scene; without any, the window waits for one")
}

pub(crate) fn run(command: &Command) -> Result<()> {
    let arguments = &command.arguments;
    arguments::check(arguments)?;
    kiln_viewer::display::check()?;
    if arguments.options.crop.is_some() {
        return Err(Error::usage("the viewer shows the whole picture, without --crop", "leave it out"));
    }
    if arguments.inputs.iter().any(|input| input == Path::new("-")) {
        return Err(Error::usage(
            "a window cannot show standard input",
            "give a file, which it can read again",
        ));
    }
    if let Some(missing) = arguments.inputs.iter().find(|input| !input.exists()) {
        return Err(Error::input(missing.as_path(), "no such file", hint_for_missing(missing)));
    }
    let threads = super::pool(arguments.options.thread_count())?;
    let own = arguments.clone();
    kiln_viewer::run(Start {
        inputs: arguments.inputs.clone(),
        open: Box::new(move |inputs, options, warnings| open(&own, inputs, options, warnings)),
        size: arguments.options.size.map(|size| size.map(Side::get)),
        threads,
    })
}

/// Loads files, with the initial camera and settings that `kiln render` would use. Returns also all files read or
/// looked for.
pub(super) fn open(
    arguments: &Arguments,
    inputs: &[PathBuf],
    chosen: Option<&ImportOptions>,
    warnings: &mut Warnings,
) -> (Result<Opened>, Vec<FileRead>) {
    // Like camera options, these do not apply to files that were dropped onto the window, but for the first.
    let is_own = arguments.inputs.is_empty() || arguments.inputs == inputs;
    let mut options = match chosen {
        Some(options) => options.clone(),
        None if is_own => arguments.options.reading(),
        None => ImportOptions { smooths_meshes: true, ..ImportOptions::default() },
    };
    // What is hidden in the window may be gone from files that have changed.
    let mut shown = [Vec::new(), Vec::new()];
    if chosen.is_some() {
        shown = [&mut options.isolate, &mut options.hide].map(std::mem::take);
    }
    let (scene, files) = import::load_and_list(inputs, &options, warnings);
    let scene = scene.and_then(|mut scene| {
        if chosen.is_some() {
            let is_there = |name: &String| scene.objects.iter().any(|object| object.is_named(name));
            shown.iter_mut().for_each(|names| names.retain(is_there));
            if scene.set_visible(&shown[0], &shown[1]).is_ok() {
                [scene.import_options.isolate, scene.import_options.hide] = shown;
            }
        }
        // The bar plays a clip, unless a moment of it is asked for.
        let is_still = scene.import_options.time.is_some();
        if !is_still && inputs.iter().all(|input| input != Path::new("-")) {
            let clip = scene.import_options.clip();
            // Scenes with tracks play no clips.
            scene.import_options.clips.clear();
            play_clip(&mut scene, &clip)?;
        }
        initial_view(arguments, inputs, scene, warnings)
    });
    (scene, files)
}

/// Initial camera and settings of a scene.
fn initial_view(
    arguments: &Arguments,
    inputs: &[PathBuf],
    scene: Scene,
    warnings: &mut Warnings,
) -> Result<Opened> {
    let mut arguments = arguments.clone();
    if !arguments.inputs.is_empty() && arguments.inputs != inputs {
        // Camera options do not apply to files that were dropped onto the window.
        let PictureOptions { camera, view, look_at, picture, .. } = &mut *arguments.options;
        (*camera, *view, *look_at) = (None, None, None);
        *picture = PictureSettings { azimuth: None, elevation: None, zoom: None, fov: None, ..*picture };
        arguments.inputs = inputs.to_vec();
    }
    let requested = arguments.options.settings()?;
    let session = Session::playing(scene)?;
    let scene = session.scene();
    // A clip may begin with nothing to see.
    let picture = if scene.bounds().is_some() || !scene.plays_clips() {
        let resolved = session.resolve_only(&requested, false)?;
        // What is about the look are notes of the picture, which may get another.
        session.warn_of_camera(&resolved, &requested, warnings)?;
        let time = scene.animation.is_none().then(|| Moment::of_still(scene).seconds);
        let used = PictureUse { time, is_rounded: true };
        warn_of_unused(&arguments.options, &resolved.plan_settings, used, warnings);
        resolved.settings.picture
    } else {
        session.look(&requested)?.0.picture
    };
    let viewpoint = Viewpoint::of(&requested.camera, scene)?;
    let camera_source = match viewpoint {
        // While the clips play, all of them stay in the picture.
        Viewpoint::Fitted(view) if scene.plays_clips() => CameraSource::FittedAt(view, None),
        Viewpoint::Fitted(view) => CameraSource::Fitted(view),
        Viewpoint::OfScene(index) => CameraSource::Scene(index),
        Viewpoint::Given(camera) => CameraSource::Free(camera),
    };
    let (numerics, colour) = (Some(picture.numerics()), Some(picture.pipeline()));
    let projection = requested.projection;
    let picture = PictureSettings { numerics, colour, ..requested.picture };
    let settings = RenderSettings { picture, ..requested };
    Ok(Opened { session: session.into(), camera_source, projection, settings })
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use kiln::scene::{UpAxis, UpChoice};

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        arguments: Arguments,
    }

    /// What is chosen in the window replaces the options of the command line, which files of others do not get.
    #[test]
    fn files_are_read_with_the_options_of_the_window() {
        let [own, other] = ["assets/import/l.obj", "assets/import/materials.obj"]
            .map(|file| vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(file)]);
        let mut arguments = Line::parse_from(["kiln", "--up", "z", "a.obj"]).arguments;
        arguments.inputs = own.clone();
        let turned = |up| ImportOptions { up, smooths_meshes: true, ..ImportOptions::default() };
        for (inputs, chosen, up) in [
            (&own, None, Some(UpChoice::Axis(UpAxis::Z))),
            (&own, Some(turned(Some(UpChoice::Axis(UpAxis::X)))), Some(UpChoice::Axis(UpAxis::X))),
            (&other, None, None),
        ] {
            let (opened, _) = open(&arguments, inputs, chosen.as_ref(), &mut Warnings::default());
            let opened = opened.unwrap_or_else(|e| panic!("{e}"));
            let expected = import::load_and_list(inputs, &turned(up), &mut Warnings::default()).0;
            assert_eq!(opened.scene().bounds(), expected.unwrap_or_else(|e| panic!("{e}")).bounds());
            assert_eq!(opened.scene().import_options, turned(up));
        }
        // Names that the file no longer has are dropped.
        let hidden = ImportOptions { hide: vec!["gone".into()], ..turned(None) };
        let (opened, _) = open(&arguments, &own, Some(&hidden), &mut Warnings::default());
        assert_eq!(opened.unwrap_or_else(|e| panic!("{e}")).scene().import_options, turned(None));
    }
}
