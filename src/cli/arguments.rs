//! Options shared by all commands that render.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::PossibleValue;

use super::sampling::SamplingArguments;
use crate::bvh::Preset;
use crate::effects::{check_names, id};
use crate::error::{Error, Result};
use crate::film::tone::{Exposure, ToneMap};
use crate::film::{ColourPipeline, DisplaySettings, Share, Window};
use crate::import::{all_endings, inline_camera, names_on_standard_input};
use crate::job::{Background, CameraChoice, EnvironmentSettings, Look, RenderSettings};
use crate::limits::Limits;
use crate::scene::file::ColourValue;
use crate::scene::{
    ClipChoice, ClipTime, ImportOptions, Numerics, Projection, Transport, UpAxis, check_clamp,
};
use crate::shading::ShadingMode;
use crate::world::StandardView;

/// Help text of `INPUT`: purpose and readable formats.
pub(crate) fn inputs_help(purpose: &str) -> String {
    let (endings, names) = (all_endings(), names_on_standard_input());
    format!("{purpose}: {endings}; `-` for a {names} on standard input")
}

/// Options of all commands that read input files.
#[derive(Args, Clone)]
pub(crate) struct ReadingArguments {
    /// Read glTF files that require extensions which kiln does not read; what depends on them is missing or wrong
    #[arg(long)]
    ignore_required_extensions: bool,
    /// Read files that meshes reference outside of their folder, such as `../wood.png` of a material: for meshes that
    /// are trusted. Scene files may name any file
    #[arg(long)]
    allow_outside_references: bool,
    /// The limits of `--limit`, an option of all commands.
    #[arg(skip)]
    pub limits: Limits,
}

impl ReadingArguments {
    /// The import options of the input files.
    pub(crate) fn options(&self) -> ImportOptions {
        ImportOptions {
            ignore_required_extensions: self.ignore_required_extensions,
            allow_outside_references: self.allow_outside_references,
            limits: self.limits,
            ..ImportOptions::default()
        }
    }
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
    #[arg(long, value_name = "TIER", value_parser = tiers())]
    numerics: Option<String>,
    /// How much work is spent on building the tree that rays go through; the picture does not depend on it
    #[arg(long, value_name = "PRESET", value_parser = Preset::ALL.map(Preset::name), default_value = Preset::default().name())]
    bvh: String,
    /// How far shading goes; below `phong` that term is shown alone, without effects
    #[arg(long, value_parser = ["flat", "ambient", "diffuse", "phong"], default_value = "phong")]
    shading: String,
    /// How light is transported: `whitted` shades surfaces by the lights that they see, `path` traces paths (indirect light,
    /// soft shadows) [default: what the scene calls for]
    #[arg(long, value_parser = Transport::ALL.map(Transport::name))]
    transport: Option<String>,
    /// The most bounces of a path, 0 to 1000; 0 shows lights alone, 1 adds direct light [default: 8]
    #[arg(long, allow_hyphen_values = true, value_name = "N", value_parser = crate::cli::numbers::whole(0..=1000u16))]
    depth: Option<u16>,
    /// Limit the radiance that a path adds at each surface beyond the first; 1 is white. It removes fireflies, and
    /// darkens indirect light [default: the scene's, or none]
    #[arg(long, allow_hyphen_values = true, value_name = "RADIANCE", value_parser = |text: &str| crate::cli::numbers::number(text, "a radiance above 0, such as 10").and_then(check_clamp))]
    clamp: Option<f64>,
    /// Light from infinitely far away: an equirectangular .hdr or .exr image, `sky`, or one colour. It is the background, too,
    /// and paths are traced
    #[arg(long, value_name = "FILE|sky|#rrggbb")]
    environment: Option<String>,
    /// Turn the environment about +y by this many degrees, counterclockwise seen from above
    #[arg(long, allow_hyphen_values = true, value_name = "DEG", value_parser = parse_degrees)]
    environment_rotation: Option<f64>,
    /// Show the background instead of the environment
    #[arg(long)]
    hide_environment: bool,
    /// Pose what the clips of the input files animate at this time, in seconds; before the first and after the last
    /// keyframe, their values hold [default: at rest]
    #[arg(long, allow_hyphen_values = true, value_name = "SECONDS", value_parser = parse_seconds)]
    time: Option<f64>,
    /// The clip, by its name or its number from 0 [default: the first]
    #[arg(long, value_name = "NAME|INDEX")]
    clip: Option<String>,
    /// The variant of the materials of glTF files, by its name (KHR_materials_variants) [default: the file's materials]
    #[arg(long, value_name = "NAME")]
    variant: Option<String>,
    #[command(flatten)]
    pub reading: ReadingArguments,
    /// The axis that points up in the files, but scene files [default: y]
    #[arg(long, allow_hyphen_values = true, value_name = "AXIS", value_parser = UpAxis::ALL.map(UpAxis::name))]
    up: Option<String>,
    /// Shade meshes without normals smoothly, but for edges where triangles turn by more than this many degrees; in files
    /// that are no scene files [default without a number: 30]
    #[arg(long, value_name = "DEG", num_args = 0..=1, default_missing_value = "30", value_parser = parse_crease)]
    smooth: Option<f64>,
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
    /// Multiply light by 2^EV before it is shown, in .png, .jpg, films and the window; `auto` computes it
    /// from the picture [default: the scene's, or 0]
    #[arg(long, allow_hyphen_values = true, value_name = "EV|auto")]
    exposure: Option<Exposure>,
    /// How light above white is brought into the range of a display, in the same outputs [default: the scene's, or none]
    #[arg(long, value_name = "CURVE", value_parser = ToneMap::ALL.map(ToneMap::name))]
    tone_map: Option<String>,
    /// The light of a scene that has none: a headlight, or none [default: the scene's, or head]
    #[arg(long, value_parser = ["head", "none"])]
    light: Option<String>,
    /// Put a grey square under the scene, at its lowest point; a camera that fits does not look at it
    #[arg(long)]
    ground: bool,
    /// What rays that hit nothing see; `transparent` gives .png and .exr an alpha channel [default: the scene's; a light grey for files that have none]
    #[arg(long, value_name = "COLOUR|transparent", value_parser = parse_background)]
    background: Option<Background>,
    /// Files without a scene file as fast as possible: one sample a pixel, a headlight, no ground
    #[arg(long)]
    draft: bool,
}

fn parse_background(text: &str) -> std::result::Result<Background, String> {
    if text == "transparent" {
        return Ok(Background::Transparent);
    }
    ColourValue::of_digits(text)
        .map(|colour| Background::Colour(colour.0))
        .ok_or_else(|| "give a colour as #rrggbb, such as #ffffff, or transparent".into())
}

/// The names of the tiers, and the former name of one.
fn tiers() -> [PossibleValue; 4] {
    let value = |tier: Numerics| PossibleValue::new(tier.name());
    let [naive, others @ ..] = Numerics::ALL.map(value);
    let [watertight, double, exact] = others;
    [naive.alias("fast"), watertight, double, exact]
}

fn parse_size(text: &str) -> std::result::Result<[u32; 2], String> {
    let (width, height) = text.split_once(['x', 'X']).ok_or("give it as WIDTHxHEIGHT, such as 640x480")?;
    let number = |s: &str| match s.parse::<u32>() {
        Ok(n) if (1..=65_535).contains(&n) => Ok(n),
        _ => Err(format!("`{s}` is not a number of pixels from 1 to 65535")),
    };
    Ok([number(width)?, number(height)?])
}

fn parse_seconds(text: &str) -> std::result::Result<f64, String> {
    let seconds = crate::cli::numbers::number::<f64>(text, "seconds, such as 1.5")?;
    if seconds.is_finite() { Ok(seconds) } else { Err("give seconds, such as 1.5".into()) }
}

fn parse_degrees(text: &str) -> std::result::Result<f64, String> {
    let degrees = crate::cli::numbers::number::<f64>(text, "a number of degrees")?;
    if degrees.is_finite() { Ok(degrees) } else { Err("give a number of degrees".into()) }
}

fn parse_crease(text: &str) -> std::result::Result<f64, String> {
    let degrees = crate::cli::numbers::number::<f64>(text, "degrees from 0 to 180")?;
    if (0.0..=180.0).contains(&degrees) { Ok(degrees) } else { Err("give degrees from 0 to 180".into()) }
}

fn parse_crop(text: &str) -> std::result::Result<Window, String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|s| s.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, width, height]) if width > 0 && height > 0 => Ok(Window { x, y, width, height }),
        _ => Err("give it as X,Y,WIDTH,HEIGHT in pixels, width and height above 0".into()),
    }
}

/// Checks names and inputs before any file is read.
pub(crate) fn check(arguments: &Arguments) -> Result<()> {
    check_names(&arguments.with, &arguments.without)?;
    if arguments.inputs.iter().filter(|input| *input == Path::new("-")).count() > 1 {
        return Err(Error::usage("standard input can be read once", "give `-` once"));
    }
    Ok(())
}

/// The value whose name was typed. The parser accepts only names of `all`.
fn named<T: Copy>(all: &[T], name: impl Fn(T) -> &'static str, typed: Option<&str>) -> Option<T> {
    all.iter().copied().find(|&value| Some(name(value)) == typed)
}

impl Arguments {
    /// Whether the background is transparent.
    pub(crate) fn is_transparent(&self) -> bool {
        self.background == Some(Background::Transparent)
    }

    /// The clip that is asked for.
    pub(crate) fn clip(&self) -> ClipChoice {
        self.clip.clone().map_or(ClipChoice::First, ClipChoice::Named)
    }

    /// Whether frames do not play a clip, but show one moment.
    pub(crate) fn is_still(&self) -> bool {
        self.time.is_some()
    }

    /// The import options of the input files.
    pub(crate) fn import_options(&self) -> ImportOptions {
        let is_posed = self.time.is_some() || self.clip.is_some();
        ImportOptions {
            pose: is_posed.then(|| ClipTime { clip: self.clip(), time: self.time.unwrap_or(0.0) }),
            variant: self.variant.clone(),
            smooth: self.smooth.map(f64::to_radians),
            up: named(&UpAxis::ALL, UpAxis::name, self.up.as_deref()),
            ..self.reading.options()
        }
    }

    /// The render settings.
    ///
    /// # Errors
    /// [`Error::Usage`] for an invalid inline camera.
    pub(crate) fn settings(&self) -> Result<RenderSettings> {
        let view = named(&StandardView::ALL, StandardView::name, self.view.as_deref());
        let camera = match (view, self.camera.as_deref()) {
            (Some(view), _) => CameraChoice::Fitted(view),
            (None, None) => CameraChoice::Default,
            (None, Some("auto")) => CameraChoice::Fitted(StandardView::Auto),
            (None, Some(text)) if text.trim_start().starts_with('{') => {
                CameraChoice::Given(inline_camera(text)?)
            }
            (None, Some(name)) => CameraChoice::Named(name.to_owned()),
        };
        let projections = [Projection::Perspective, Projection::Orthographic];
        let pipelines = [ColourPipeline::Display, ColourPipeline::U8, ColourPipeline::Linear];
        let depth = self.depth.map(|depth| id::PATH.with_value(depth));
        Ok(RenderSettings {
            camera,
            projection: named(&projections, Projection::name, self.projection.as_deref()),
            size: self.size,
            longest_side: None,
            crop: self.crop,
            share: Share::ALL,
            sampling: self.sampling.settings(),
            numerics: self.numerics.as_deref().and_then(Numerics::named),
            preset: Preset::named(&self.bvh).unwrap_or_default(),
            shading: named(&ShadingMode::ALL, ShadingMode::name, Some(&self.shading)).unwrap_or_default(),
            transport: named(&Transport::ALL, Transport::name, self.transport.as_deref()),
            clamp: self.clamp,
            environment: EnvironmentSettings {
                source: self.environment.clone(),
                rotation: self.environment_rotation,
                hide: self.hide_environment,
            },
            with: self.with.iter().cloned().chain(depth).collect(),
            without: self.without.clone(),
            colour: named(&pipelines, ColourPipeline::name, self.colour.as_deref()),
            aovs: Vec::new(),
            display: DisplaySettings {
                exposure: self.exposure,
                tone_map: named(&ToneMap::ALL, ToneMap::name, self.tone_map.as_deref()),
            },
            headlight: self.light.as_deref().map(|light| light == "head"),
            ground: self.ground.then_some(true),
            background: self.background,
            look: if self.draft { Look::Draft } else { Look::Studio },
        })
    }
}
