//! What every command that makes pictures is told.

use std::path::{Path, PathBuf};

use clap::Args;

use super::picture::is_inline;
use super::sampling::SamplingArguments;
use crate::bvh::Preset;
use crate::effects::check_names;
use crate::error::{Error, Result};
use crate::film::{ColourPipeline, Window};
use crate::import::{all_endings, inline_camera, names_on_standard_input};
use crate::scene::{Camera, Numerics, Projection};
use crate::shading::ShadingMode;

/// The help of `INPUT`: `what` they are for, and the formats that there are.
pub fn inputs_help(what: &str) -> String {
    let (endings, names) = (all_endings(), names_on_standard_input());
    format!("{what}: {endings}; `-` for a {names} on standard input")
}

/// What there is to see, and how: what every command that makes pictures is told.
#[derive(Args, Clone)]
pub struct Arguments {
    /// Files to put into one scene.
    #[arg(required = true, value_name = "INPUT", help = inputs_help("Files to put into one scene"))]
    pub inputs: Vec<PathBuf>,
    /// A camera of the scene by name or by number, `auto` for one that fits, or one of your own in the words of scene files:
    /// '{ position = [0, 1, 6], look_at = [0, 1, 0], vertical_fov = 40 }'
    #[arg(long, value_name = "NAME|INDEX|auto|{...}")]
    pub camera: Option<String>,
    /// A camera that fits the scene, from a standard side
    #[arg(long, conflicts_with = "camera", value_parser = ["front", "back", "left", "right", "top", "bottom", "iso"])]
    pub view: Option<String>,
    /// Replace the camera's projection
    #[arg(long, value_parser = ["perspective", "orthographic"])]
    projection: Option<String>,
    /// Size of the picture in pixels
    #[arg(long, allow_hyphen_values = true, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,
    /// Render only this part of the picture: left, top, width and height in pixels
    #[arg(long, allow_hyphen_values = true, value_name = "X,Y,W,H", value_parser = parse_crop)]
    pub crop: Option<Window>,
    /// Threads to work on [default: all that this process may use; SLURM_CPUS_PER_TASK where that is less]
    #[arg(long, allow_hyphen_values = true, value_name = "N", value_parser = crate::cli::numbers::whole(1..=u16::MAX))]
    pub threads: Option<u16>,
    /// How exactly it is decided what a ray hits [default: the scene's, or watertight]
    #[arg(long, value_name = "TIER", value_parser = ["fast", "watertight", "double", "exact"])]
    numerics: Option<String>,
    /// How much work is spent on building the tree that rays go through; the picture does not depend on it
    #[arg(long, value_name = "PRESET", value_parser = Preset::ALL.map(Preset::name), default_value = Preset::default().name())]
    bvh: String,
    /// How far shading goes; below `phong` that term is shown alone, without effects
    #[arg(long, value_parser = ["flat", "ambient", "diffuse", "phong"], default_value = "phong")]
    shading: String,
    #[command(flatten)]
    pub sampling: SamplingArguments,
    /// Have an effect that would be off; may be given several times
    #[arg(long, value_name = "EFFECT")]
    pub with: Vec<String>,
    /// Do without an effect; may be given several times
    #[arg(long, value_name = "EFFECT")]
    pub without: Vec<String>,
    /// The numbers light is added up in [default: the scene's, or linear]
    #[arg(long, value_parser = ["display", "u8", "linear"])]
    colour: Option<String>,
}

fn parse_size(text: &str) -> std::result::Result<[u32; 2], String> {
    let (width, height) = text.split_once(['x', 'X']).ok_or("give it as WIDTHxHEIGHT, such as 640x480")?;
    let number = |s: &str| match s.parse::<u32>() {
        Ok(n) if (1..=65_535).contains(&n) => Ok(n),
        _ => Err(format!("`{s}` is not a number of pixels from 1 to 65535")),
    };
    Ok([number(width)?, number(height)?])
}

fn parse_crop(text: &str) -> std::result::Result<Window, String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|s| s.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, width, height]) if width > 0 && height > 0 => Ok(Window { x, y, width, height }),
        _ => Err("give it as X,Y,WIDTH,HEIGHT in pixels, width and height above 0".into()),
    }
}

/// Whether names and inputs are such as can be used at all.
pub fn check(arguments: &Arguments) -> Result<()> {
    check_names(&arguments.with, &arguments.without)?;
    if let Some(camera) = arguments.camera.as_deref().filter(|typed| is_inline(typed)) {
        inline_camera(camera)?;
    }
    if arguments.inputs.iter().filter(|input| *input == Path::new("-")).count() > 1 {
        return Err(Error::usage("standard input can be read once", "give `-` once"));
    }
    Ok(())
}

// The parser lets nothing else through than the names below.
impl Arguments {
    /// How far shading goes.
    pub fn shading(&self) -> ShadingMode {
        ShadingMode::ALL.into_iter().find(|mode| mode.name() == self.shading).unwrap_or_default()
    }

    /// The colour pipeline that the user wants instead of the scene's.
    pub fn colour(&self) -> Option<ColourPipeline> {
        let pipelines = [ColourPipeline::Display, ColourPipeline::U8, ColourPipeline::Linear];
        pipelines.into_iter().find(|p| Some(p.name()) == self.colour.as_deref())
    }

    /// The tier that the user wants instead of the scene's.
    pub fn numerics(&self) -> Option<Numerics> {
        Numerics::ALL.into_iter().find(|tier| Some(tier.name()) == self.numerics.as_deref())
    }

    /// How much work is spent on building.
    pub fn preset(&self) -> Preset {
        Preset::named(&self.bvh).unwrap_or_default()
    }

    /// The projection that the user wants instead of the camera's own.
    pub fn projection(&self) -> Option<Projection> {
        let projections = [Projection::Perspective, Projection::Orthographic];
        projections.into_iter().find(|p| Some(p.name()) == self.projection.as_deref())
    }

    /// What made the picture, for its metadata; nothing that differs between two runs of the same.
    pub fn settings(
        &self,
        camera: &Camera,
        projection: Projection,
        [width, height]: [u32; 2],
        pipeline: ColourPipeline,
        numerics: Numerics,
    ) -> Vec<(String, String)> {
        // Without their folders: the same scene is the same picture wherever it lies.
        let name =
            |input: &PathBuf| input.file_name().unwrap_or(input.as_os_str()).to_string_lossy().into_owned();
        let inputs: Vec<String> = self.inputs.iter().map(name).collect();
        // One in braces as it was typed: its name would say nothing.
        let inline = self.camera.as_deref().filter(|typed| is_inline(typed)).map(str::trim);
        let mut settings = vec![
            ("Software".to_owned(), format!("kiln {}", env!("CARGO_PKG_VERSION"))),
            ("kiln:inputs".into(), inputs.join(" ")),
            ("kiln:camera".into(), inline.unwrap_or(&camera.name).to_owned()),
            ("kiln:projection".into(), projection.name().into()),
            ("kiln:size".into(), format!("{width}x{height}")),
            ("kiln:colour".into(), pipeline.name().into()),
            ("kiln:numerics".into(), numerics.name().into()),
            ("kiln:shading".into(), self.shading.clone()),
        ];
        if let Some(Window { x, y, width, height }) = self.crop {
            settings.push(("kiln:crop".into(), format!("{x},{y},{width},{height}")));
        }
        for (key, names) in [("kiln:with", &self.with), ("kiln:without", &self.without)] {
            if !names.is_empty() {
                settings.push((key.into(), names.join(" ")));
            }
        }
        settings
    }
}
