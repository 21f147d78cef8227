//! Options shared by all commands that render.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::effects::{check_names, id};
use crate::error::{Error, Result};
use crate::import::{all_endings, inline_camera, names_on_standard_input};
use crate::job::{CameraChoice, Look, RenderSettings};
use crate::scene::{ImportOptions, OptionValue, PictureSettings, Side};
use crate::world::StandardView;

/// Help text of `INPUT`: purpose and readable formats.
pub(crate) fn inputs_help(purpose: &str) -> String {
    let (endings, names) = (all_endings(), names_on_standard_input());
    format!("{purpose}: {endings}; `-` for a {names} on standard input")
}

/// Inputs, camera and render settings: options of all commands that render.
#[derive(Args, Clone)]
pub(crate) struct Arguments {
    /// Files to put into one scene.
    #[arg(required = true, value_name = "INPUT", help = inputs_help("Files to put into one scene"))]
    pub inputs: Vec<PathBuf>,
    /// A camera of the scene by name or by number, `auto` for one that fits, or one of your own in the words of scene
    /// files: '{ position = [0, 1, 6], look_at = [0, 1, 0], vertical_fov = 40 }'
    #[arg(long, value_name = "NAME|INDEX|auto|{...}")]
    pub camera: Option<String>,
    /// A camera that fits the scene, from a standard side
    #[arg(long, conflicts_with = "camera", value_parser = ["front", "back", "left", "right", "top", "bottom", "iso"])]
    pub view: Option<String>,
    /// Size of the picture in pixels
    #[arg(long, allow_hyphen_values = true, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,
    /// Threads to work on [default: all that this process may use; SLURM_CPUS_PER_TASK where that is less]
    #[arg(long, allow_hyphen_values = true, value_name = "N", value_parser = crate::cli::numbers::whole(1..=u16::MAX))]
    pub threads: Option<u16>,
    /// The most bounces of a path, 0 to 1000; 0 shows lights alone, 1 adds direct light [default: 8]
    #[arg(long, allow_hyphen_values = true, value_name = "N", value_parser = crate::cli::numbers::whole(0..=1000u16))]
    depth: Option<u16>,
    #[command(flatten)]
    pub settings: RenderSettings,
    #[command(flatten)]
    pub import: ImportOptions,
    /// Files without a scene file as fast as possible: one sample a pixel, a headlight, no ground
    #[arg(long)]
    draft: bool,
}

fn parse_size(text: &str) -> std::result::Result<[u32; 2], String> {
    let (width, height) = text.split_once(['x', 'X']).ok_or("give it as WIDTHxHEIGHT, such as 640x480")?;
    Ok([Side::parse(width)?.get(), Side::parse(height)?.get()])
}

/// Checks names and inputs before any file is read.
pub(crate) fn check(arguments: &Arguments) -> Result<()> {
    check_names(&arguments.settings.with, &arguments.settings.without)?;
    if arguments.inputs.iter().filter(|input| *input == Path::new("-")).count() > 1 {
        return Err(Error::usage("standard input can be read once", "give `-` once"));
    }
    Ok(())
}

impl Arguments {
    /// The render settings.
    ///
    /// # Errors
    /// [`Error::Usage`] for an invalid inline camera.
    pub(crate) fn settings(&self) -> Result<RenderSettings> {
        let view = StandardView::ALL.into_iter().find(|view| Some(view.name()) == self.view.as_deref());
        let camera = match (view, self.camera.as_deref()) {
            (Some(view), _) => CameraChoice::Fitted(view),
            (None, None) => CameraChoice::Default,
            (None, Some("auto")) => CameraChoice::Fitted(StandardView::Auto),
            (None, Some(text)) if text.trim_start().starts_with('{') => {
                CameraChoice::Given(inline_camera(text)?)
            }
            (None, Some(name)) => CameraChoice::Named(name.to_owned()),
        };
        let size = self.size.map(PictureSettings::of_size).unwrap_or_default();
        let mut settings = self.settings.clone();
        settings.with.extend(self.depth.map(|depth| id::PATH.with_value(depth)));
        let (picture, look) =
            (size.or(settings.picture), if self.draft { Look::Draft } else { Look::Studio });
        Ok(RenderSettings { camera, picture, look, ..settings })
    }
}
