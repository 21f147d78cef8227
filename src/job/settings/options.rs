//! [`PictureOptions`]: the options of pictures and their inputs, as given, and the settings that they stand for.

use crate::bvh::Preset;
use crate::effects::EFFECTS;
use crate::effects::{check_names, id};
use crate::error::{Error, Result};
use crate::film::Window;
use crate::import::inline_camera;
use crate::job::{CameraChoice, EnvironmentSettings, RenderSettings};
use crate::scene::OptionValue;
use crate::scene::option::group;
use crate::scene::option::{options, ranged};
use crate::scene::{Bounces, Counted, ImportOptions, Look, PictureSettings, Projection, Side};
use crate::world::StandardView;

options! {
    /// Options of pictures and their inputs, as given: those of all commands that render, and of Python.
    #[derive(Debug, Clone, Default, PartialEq)]
    pub struct PictureOptions {
        /// Camera of the scene by name or index from 0, `auto` for one that frames the scene, or the keys of a camera in scene
        /// files: '{ position = [0, 1, 6], look_at = [0, 1, 0], vertical_fov = 40 }' [default: the scene's first, else auto]
        [of(group::CAMERA).order(1).value_name("NAME|INDEX|auto|{...}")] camera: Option<String>,
        /// Standard view that frames the scene [default without a camera: from 35° to the right of the front and 20° above]
        [of(group::CAMERA).order(0)] view: Option<StandardView>,
        /// Picture width and height in pixels, or the side of a square [default: the scene's, else 1024x1024]
        [of(group::OUTPUT).order(1).hyphens().value_name("WxH")] size: Option<[Side; 2]>,
        /// How the inputs are read.
        [flatten] import: ImportOptions,
        /// Object that an automatic camera frames, by name [default: all objects]
        [of(group::CAMERA).order(2).value_name("OBJECT")] look_at: Option<String>,
        /// Projection [default: the camera's]
        [of(group::CAMERA)] projection: Option<Projection>,
        /// Render only this rectangle of the picture: left, top, width and height in pixels
        [of(group::OUTPUT).hyphens().value_name("X,Y,W,H")] crop: Option<Window>,
        /// Light from infinitely far away.
        [flatten] environment: EnvironmentSettings,
        /// Effects to turn on, as `NAME` or `NAME=VALUE`.
        [of(group::LOOK).order(910).value_name("EFFECT").help(with_help())] with: Vec<String>,
        /// Turn an effect off, by its name as for --with; may be repeated
        [of(group::LOOK).order(911).value_name("EFFECT")] without: Vec<String>,
        /// Options that scene files have, too.
        [flatten] picture: PictureSettings,
        /// Build preset of the acceleration structure: build time against render time, for the same picture [default:
        /// balanced]
        [of(group::LIMITS).order(1).value_name("PRESET")] bvh: Option<Preset>,
        /// Maximum bounces of a path, 0 to 1000; 0 is emission only, 1 adds direct light [default: 8]
        [of(group::QUALITY).order(4).hyphens().value_name("N")] depth: Option<Bounces>,
        /// Fast preview of meshes: one sample per pixel, a headlight and a dark background instead of the default look
        [of(group::LOOK).order(2)] draft: bool,
        /// Number of threads [default: all that this process may use, or SLURM_CPUS_PER_TASK if less]
        [of(group::LIMITS).order(0).hyphens().value_name("N")] threads: Option<Threads>,
    }
}

ranged! {
    /// A number of threads.
    Threads(u16, "u16") in 1..=u16::MAX, "give a whole number from 1 to 65535";
}

/// The help of `--with`: the names of all effects.
fn with_help() -> String {
    let effects = EFFECTS.iter().map(|effect| match &effect.value {
        Some(value) => format!("{}[={}]", effect.id, value.placeholder),
        None => effect.id.to_string(),
    });
    format!(
        "Turn an effect on (described by `kiln explain`); may be repeated: {}",
        effects.collect::<Vec<_>>().join(", ")
    )
}

/// Names that may be separated by commas.
fn separated(names: &[String]) -> Vec<String> {
    names.iter().flat_map(|names| names.split(',')).map(|name| name.trim().to_owned()).collect()
}

impl PictureOptions {
    /// Whether there are options of the picture.
    pub fn has_picture(&self) -> bool {
        self.entries().len() > self.import.entries().len()
    }

    /// The options as words of the command line, unquoted.
    pub fn words(&self) -> Vec<String> {
        let limit = |(kind, most): (Counted, u64)| ("limit".to_owned(), format!("{}={most}", kind.name()));
        let words = |(name, value): (String, String)| match PictureOptions::kind(&name) {
            Some(kind) if kind == <bool as OptionValue>::kind() && value == "true" => {
                vec![format!("--{name}")]
            }
            // Options that are on or off take no separate value, and one with a hyphen would be parsed as an option.
            _ if value.starts_with('-') || value == "false" => vec![format!("--{name}={value}")],
            _ => vec![format!("--{name}"), value],
        };
        self.entries().into_iter().chain(self.import.limits.changed().map(limit)).flat_map(words).collect()
    }

    /// The number of threads.
    pub fn thread_count(&self) -> Option<u16> {
        self.threads.map(Threads::get)
    }

    /// The choices of importers.
    pub fn reading(&self) -> ImportOptions {
        let is_draft = self.draft || self.picture.look == Some(Look::Draft);
        ImportOptions { smooths_meshes: !is_draft, ..self.import.clone() }
    }

    /// The render settings.
    ///
    /// # Errors
    /// [`Error::Usage`] for an invalid inline camera, unknown effects, and options that exclude each other.
    pub fn settings(&self) -> Result<RenderSettings> {
        let (mut with, without) = (separated(&self.with), separated(&self.without));
        check_names(&with, &without)?;
        let depth = self.depth.map(Bounces::get);
        if let Some(depth) = depth
            && without.iter().any(|name| name == id::PATH.name())
        {
            let what = format!("both --depth {depth} and --without {}", id::PATH);
            return Err(Error::usage(what, "give one of the two"));
        }
        with.extend(depth.map(|depth| id::PATH.with_value(depth)));
        let size = self.size.map(|size| PictureSettings::of_size(size.map(Side::get))).unwrap_or_default();
        let camera = match (self.view, self.camera.as_deref()) {
            (Some(_), Some(_)) => {
                return Err(Error::usage("both --camera and --view", "give one of the two"));
            }
            (Some(view), None) => CameraChoice::Fitted(view),
            (None, None) if self.look_at.is_none() => CameraChoice::Default,
            (None, None | Some("auto")) => CameraChoice::Fitted(StandardView::Auto),
            (None, Some(text)) if text.trim_start().starts_with('{') => {
                CameraChoice::Given(inline_camera(text, size.size())?)
            }
            (None, Some(name)) => CameraChoice::Named(name.to_owned()),
        };
        let look = self.draft.then_some(Look::Draft);
        Ok(RenderSettings {
            camera,
            look_at: self.look_at.clone(),
            projection: self.projection,
            crop: self.crop,
            environment: self.environment.clone(),
            with,
            without,
            depth,
            mesh_look: Look::Studio,
            picture: PictureSettings { look, ..size.or(self.picture) },
            preset: self.bvh.unwrap_or_default(),
            ..RenderSettings::default()
        })
    }
}
