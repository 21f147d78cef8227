//! Options shared by all commands that render.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::effects::{check_names, id};
use crate::error::{Error, Result};
use crate::import::{all_endings, inline_camera};
use crate::job::{CameraChoice, RenderSettings};
use crate::scene::option::group;
use crate::scene::{ImportOptions, Look, OptionValue, PictureSettings, Side};
use crate::world::StandardView;

/// Help text of `INPUT`: purpose and readable formats.
pub(crate) fn inputs_help(purpose: &str) -> String {
    format!("{purpose}: {}; `-` reads one of them from standard input", all_endings())
}

/// Inputs, camera and render settings: options of all commands that render.
#[derive(Args, Clone)]
pub(crate) struct Arguments {
    /// Input files, combined into one scene.
    #[arg(required = true, value_name = "INPUT", help = inputs_help("Input files, combined into one scene"))]
    pub inputs: Vec<PathBuf>,
    /// Camera of the scene by name or index from 0, `auto` for one that frames the scene, or the keys of a camera in scene
    /// files: '{ position = [0, 1, 6], look_at = [0, 1, 0], vertical_fov = 40 }' [default: the scene's first, else auto]
    #[arg(long, help_heading = group::CAMERA, display_order = 1, value_name = "NAME|INDEX|auto|{...}")]
    pub camera: Option<String>,
    /// Standard view that frames the scene [default without a camera: from 35° to the right of the front and 20° above]
    #[arg(long, help_heading = group::CAMERA, display_order = 0, conflicts_with = "camera", value_parser = ["front", "back", "left", "right", "top", "bottom", "iso"])]
    pub view: Option<String>,
    /// Picture width and height in pixels [default: the scene's, else 1024x1024]
    #[arg(long, help_heading = group::OUTPUT, display_order = 1, allow_hyphen_values = true, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,
    #[command(flatten)]
    pub import: ImportOptions,
    #[command(flatten)]
    pub settings: RenderSettings,
    /// Maximum bounces of a path, 0 to 1000; 0 is emission only, 1 adds direct light [default: 8]
    #[arg(long, help_heading = group::QUALITY, display_order = 4, allow_hyphen_values = true, value_name = "N", value_parser = crate::cli::numbers::whole(0..=1000u16))]
    pub depth: Option<u16>,
    /// Fast preview of meshes: one sample per pixel, a headlight and a dark background instead of the default look
    #[arg(long, help_heading = group::LOOK, display_order = 2)]
    pub draft: bool,
    /// Number of threads [default: all that this process may use, or SLURM_CPUS_PER_TASK if less]
    #[arg(long, help_heading = group::LIMITS, display_order = 0, allow_hyphen_values = true, value_name = "N", value_parser = crate::cli::numbers::whole(1..=u16::MAX))]
    pub threads: Option<u16>,
}

fn parse_size(text: &str) -> std::result::Result<[u32; 2], String> {
    let (width, height) =
        text.split_once(['x', 'X', ',']).ok_or("give it as WIDTHxHEIGHT, such as 640x480")?;
    Ok([Side::parse(width)?.get(), Side::parse(height)?.get()])
}

/// Checks names and inputs before any file is read.
pub(crate) fn check(arguments: &Arguments) -> Result<()> {
    let RenderSettings { with, without, .. } = &arguments.settings;
    check_names(with, without)?;
    if let Some(depth) = arguments.depth
        && without.iter().any(|name| name == id::PATH.name())
    {
        let what = format!("both --depth {depth} and --without {}", id::PATH);
        return Err(Error::usage(what, "give one of the two"));
    }
    if arguments.inputs.iter().filter(|input| *input == Path::new("-")).count() > 1 {
        return Err(Error::usage("standard input can be read once", "give `-` once"));
    }
    Ok(())
}

impl Arguments {
    /// The choices of importers.
    pub(crate) fn reading(&self) -> ImportOptions {
        let is_draft = self.draft || self.settings.picture.look == Some(Look::Draft);
        ImportOptions { smooths_meshes: !is_draft, ..self.import.clone() }
    }

    /// The render settings.
    ///
    /// # Errors
    /// [`Error::Usage`] for an invalid inline camera.
    pub(crate) fn settings(&self) -> Result<RenderSettings> {
        let view = StandardView::ALL.into_iter().find(|view| Some(view.name()) == self.view.as_deref());
        let size = self.size.map(PictureSettings::of_size).unwrap_or_default();
        let camera = match (view, self.camera.as_deref()) {
            (Some(view), _) => CameraChoice::Fitted(view),
            (None, None) if self.settings.look_at.is_none() => CameraChoice::Default,
            (None, None) => CameraChoice::Fitted(StandardView::Auto),
            (None, Some("auto")) => CameraChoice::Fitted(StandardView::Auto),
            (None, Some(text)) if text.trim_start().starts_with('{') => {
                CameraChoice::Given(inline_camera(text, size.size())?)
            }
            (None, Some(name)) => CameraChoice::Named(name.to_owned()),
        };
        let mut settings = self.settings.clone();
        settings.with.extend(self.depth.map(|depth| id::PATH.with_value(depth)));
        settings.depth = self.depth;
        let look = self.draft.then_some(Look::Draft);
        let picture = PictureSettings { look, ..size.or(settings.picture) };
        Ok(RenderSettings { camera, picture, mesh_look: Look::Studio, ..settings })
    }
}
