//! Pictures in memory, for programs: the options of `kiln render` by name, and its picture.

use std::borrow::Borrow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{ArgAction, FromArgMatches};

use super::arguments::{self, Arguments};
use super::names::{argument, command, name_of, unknown};
use super::output::{check_alpha, check_bits_of, check_memory_of, render_image};
use super::prepare::note_rest_pose;
use super::usage_error;
use crate::error::{Error, Result, Warnings};
use crate::files::InputFiles;
use crate::film::write::{ALPHA, Channel, Format, OutputImage, encode, write_picture};
use crate::film::{ColourPipeline, DisplayTransform, Window};
use crate::job::{self, Findings, Metadata, RenderJob, RenderSettings, Session};
use crate::render::RenderControl;
use crate::render::aov::{self, AovSelection};
use crate::scene::{BitDepth, ImportOptions, Scene};

pub use super::names::{by_name, error_by_name};

/// The value of an option.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// As if the option were not given.
    Default,
    /// On or off.
    Switch(bool),
    /// As typed.
    Text(String),
    /// The parts of a value, or the values of an option that may be repeated.
    List(Vec<String>),
}

/// Options of `kiln render` that concern the inputs and the picture.
pub struct Options(Arguments);

impl Options {
    /// Parses options by name: `tone_map` is `--tone-map`, and `with_` is `--with`.
    ///
    /// # Errors
    /// [`Error::Usage`], as for the command. [`error_by_name`] names options as they are here.
    pub fn parse(options: &[(String, Value)]) -> Result<Self> {
        let command = command();
        let mut words = vec!["kiln".to_owned()];
        for (name, value) in options {
            let argument =
                argument(&command, |long| name_of(long) == *name).ok_or_else(|| unknown(&command, name))?;
            let (long, action) = (argument.get_long().unwrap_or_default(), argument.get_action());
            let is_switch = !action.takes_values();
            let may_lack_value = argument.get_num_args().is_some_and(|count| count.min_values() == 0);
            match value {
                Value::Default => {}
                Value::Switch(true) if is_switch || may_lack_value => words.push(format!("--{long}")),
                Value::Switch(false) if is_switch => {}
                Value::Switch(false) if may_be_false(argument) => words.push(format!("--{long}=false")),
                Value::Switch(is_on) => {
                    let given = if *is_on { "True" } else { "False" };
                    return Err(Error::usage(format!("`{name}` takes a value, not {given}"), ""));
                }
                _ if is_switch => {
                    return Err(Error::usage(format!("`{name}` is on or off"), "give True or False"));
                }
                Value::Text(text) if argument.get_value_delimiter().is_some() => {
                    words.extend(text.split(',').map(|part| format!("--{long}={}", part.trim())));
                }
                Value::Text(text) => words.push(format!("--{long}={text}")),
                Value::List(parts) if matches!(action, ArgAction::Append) => {
                    words.extend(parts.iter().map(|part| format!("--{long}={part}")));
                }
                Value::List(parts) => words.push(format!("--{long}={}", parts.join(","))),
            }
        }
        let parsed = command.try_get_matches_from(words);
        let parsed = parsed.and_then(|matches| Arguments::from_arg_matches(&matches));
        let arguments = parsed.map_err(|e| {
            let (what, hint) = usage_error(&e);
            Error::usage(what, hint)
        })?;
        arguments::check(&arguments)?;
        Ok(Options(arguments))
    }

    /// Options of the inputs.
    pub fn import(&self) -> ImportOptions {
        self.0.reading()
    }

    /// Whether there are options of the inputs.
    pub fn has_import(&self) -> bool {
        self.0.import != ImportOptions::default()
    }

    /// These options with this camera.
    ///
    /// # Errors
    /// [`Error::Usage`] if they have a view.
    pub fn with_camera(&self, camera: &str) -> Result<Self> {
        if self.0.view.is_some() {
            return Err(Error::usage("both a camera and the option --view", "give one of the two"));
        }
        let mut arguments = self.0.clone();
        arguments.camera = Some(camera.to_owned());
        Ok(Options(arguments))
    }

    /// The AOVs of these names, and the settings of a picture with them.
    fn with_aovs(&self, aovs: &[String]) -> Result<(AovSelection, RenderSettings)> {
        let settings = RenderSettings { aovs: aovs.to_vec(), ..self.0.settings()? };
        Ok((AovSelection::new(aovs)?, settings))
    }

    /// Whether there are options of the picture.
    ///
    /// # Errors
    /// As those of [`Options::parse`].
    pub fn has_picture(&self) -> Result<bool> {
        Ok(self.0.threads.is_some() || self.0.settings()? != Options::parse(&[])?.0.settings()?)
    }
}

/// Whether `false` is a value of an option.
fn may_be_false(argument: &clap::Arg) -> bool {
    argument.get_possible_values().iter().any(|value| value.get_name() == "false")
}

/// A rendered picture.
pub struct Picture {
    image: OutputImage,
    /// The AOVs of pictures of integers; others have them among their channels.
    channels: Vec<Channel>,
    metadata: Metadata,
    pipeline: ColourPipeline,
    display: DisplayTransform,
    /// Files that the scene was read from.
    inputs: InputFiles,
}

/// Renders a scene as `kiln render` does, with the same warnings. `format` decides the type of the pixels: f32 for
/// OpenEXR, else display values of 8 bits or, by option, of 16.
///
/// # Errors
/// As those of the command.
pub fn render(
    scene: Scene,
    options: &Options,
    format: Format,
    aovs: &[String],
    control: &RenderControl,
    warnings: &mut Warnings,
) -> Result<Picture> {
    let (selection, settings) = options.with_aovs(aovs)?;
    super::pool(options.0.threads)?.install(|| {
        note_rest_pose(&scene, warnings);
        let inputs = files_read(&scene, &settings);
        let session = Session::still(scene)?;
        let resolved = session.resolve(&settings, warnings)?;
        let job = session.into_job(&resolved, true, control, warnings)?;
        picture_of(job, inputs, &selection, format, control, warnings)
    })
}

/// A scene prepared for pictures by many cameras, see [`Session`].
pub struct PreparedScene(Session);

impl PreparedScene {
    /// Prepares a scene.
    ///
    /// # Errors
    /// As [`Session::still`].
    pub fn new(scene: Arc<Scene>) -> Result<Self> {
        Session::still(scene).map(PreparedScene)
    }

    /// The scene in its own coordinates.
    pub fn scene(&self) -> &Scene {
        self.0.scene()
    }

    /// The picture of [`render`] with these options.
    ///
    /// # Errors
    /// As [`render`].
    pub fn render(
        &self,
        options: &Options,
        format: Format,
        aovs: &[String],
        control: &RenderControl,
        warnings: &mut Warnings,
    ) -> Result<Picture> {
        let (selection, settings) = options.with_aovs(aovs)?;
        super::pool(options.0.threads)?.install(|| {
            let PreparedScene(session) = self;
            note_rest_pose(session.scene(), warnings);
            let resolved = session.resolve(&settings, warnings)?;
            let picture = session.first_picture(&resolved)?;
            let job = session.job(&picture, true, control)?;
            session.warn(&picture, &job, warnings);
            let inputs = files_read(session.scene(), &settings);
            picture_of(job, inputs, &selection, format, control, warnings)
        })
    }

    /// The AOVs of [`PreparedScene::render`] without its picture: no light is traced for them, but for the AOVs of
    /// effects and variances.
    ///
    /// # Errors
    /// As [`render`].
    pub fn aovs(
        &self,
        options: &Options,
        aovs: &[String],
        control: &RenderControl,
        warnings: &mut Warnings,
    ) -> Result<Aovs> {
        let (selection, settings) = options.with_aovs(aovs)?;
        super::pool(options.0.threads)?.install(|| {
            let PreparedScene(session) = self;
            note_rest_pose(session.scene(), warnings);
            let resolved = session.resolve_only(&settings, false)?;
            session.warn_of_resolved(&resolved, &settings, warnings)?;
            let picture = session.first_picture(&resolved.into())?;
            let exposed = match selection.depends_on_exposure(&picture.job.plan) {
                true => Some(session.job(&picture, false, control)?),
                false => None,
            };
            let job = exposed.as_ref().unwrap_or(&picture.job);
            session.warn(&picture, job, warnings);
            job::warn_of_indices(job, warnings);
            let count = selection.channel_count(job.plan.effects_on().count()) as u64;
            check_memory_of(job.window, count, 2 * 4 * count + selection.bytes_per_pixel())?;
            let channels = aov::channels(&job.aov_source(None), &selection, control)?;
            Ok(Aovs { window: job.window, channels })
        })
    }
}

/// AOVs of a region of a picture.
pub struct Aovs {
    /// The region.
    pub window: Window,
    channels: Vec<Channel>,
}

impl Aovs {
    /// The AOVs by name, each with its channels.
    pub fn by_name(self) -> Vec<(String, Vec<Channel>)> {
        channels_by_name(self.channels)
    }
}

/// The files that a picture of a scene is made of.
fn files_read(scene: &Scene, settings: &RenderSettings) -> InputFiles {
    let environment = settings.environment.environment.iter().map(PathBuf::from);
    scene.files_read.iter().cloned().chain(environment).collect()
}

/// Renders the picture of a job.
fn picture_of(
    job: RenderJob,
    inputs: InputFiles,
    selection: &AovSelection,
    format: Format,
    control: &RenderControl,
    warnings: &mut Warnings,
) -> Result<Picture> {
    let channels = selection.channel_count(job.plan.effects_on().count()) as u64;
    // Colours and alpha are rendered together, split, and copied.
    check_memory_of(job.window, channels, 2 * (4 * (4 + channels) + 12) + selection.bytes_per_pixel())?;
    check_bits_of(job.settings.picture.bits, format)?;
    let none = AovSelection::new(&[])?;
    let in_film = if format == Format::Exr { selection } else { &none };
    let (image, statistics) = render_image(&job, format, in_film, control)?;
    Findings::of(&job, &image, &statistics, control)?.warn(warnings);
    let (channels, display) = match &image {
        OutputImage::Float(..) => (Vec::new(), job.display_transform(control)?),
        _ => (aov::channels(&job.aov_source(None), selection, control)?, DisplayTransform::default()),
    };
    let pipeline = job.pipeline();
    Ok(Picture { image, channels, metadata: job.metadata, pipeline, display, inputs })
}

/// Channels by the name of their AOV.
fn channels_by_name<C: Borrow<Channel>>(channels: impl IntoIterator<Item = C>) -> Vec<(String, Vec<C>)> {
    let mut all: Vec<(String, Vec<C>)> = Vec::new();
    for channel in channels {
        let name = aov::name_of(&channel.borrow().name);
        match all.last_mut() {
            Some((last, channels)) if last == name => channels.push(channel),
            _ => all.push((name.to_owned(), vec![channel])),
        }
    }
    all
}

impl Picture {
    /// The picture: f32 values, or display values.
    pub fn image(&self) -> &OutputImage {
        &self.image
    }

    /// The alpha channel of f32 pictures.
    pub fn alpha(&self) -> Option<&Channel> {
        self.float_channels().iter().find(|channel| channel.name == ALPHA)
    }

    /// The AOVs by name, each with its channels.
    pub fn aovs(&self) -> Vec<(String, Vec<&Channel>)> {
        let channels = self.channels.iter().chain(self.float_channels());
        channels_by_name(channels.filter(|channel| channel.name != ALPHA))
    }

    fn float_channels(&self) -> &[Channel] {
        if let OutputImage::Float(_, channels, _) = &self.image { channels } else { &[] }
    }

    /// What made the picture: names and values.
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// The picture as the contents of a file of this format: f32 pictures of all formats, others of PNG and JPEG.
    ///
    /// # Errors
    /// [`Error::Usage`] for a format that cannot hold the picture, [`Error::Memory`] if there is not enough memory.
    pub fn encoded(&self, format: Format) -> Result<Vec<u8>> {
        let converted = self.converted(format)?;
        let (image, mut bytes) = (converted.as_ref().unwrap_or(&self.image), Vec::new());
        encode(image, &self.metadata, format, &mut bytes).map_err(|e| Error::output(Path::new("-"), e))?;
        Ok(bytes)
    }

    /// Writes the picture to a file as [`Picture::encoded`], in this format, or that of its name.
    ///
    /// # Errors
    /// [`Error::Output`]; [`Error::Usage`] for a format that cannot hold the picture, or for a file that the scene was
    /// read from.
    pub fn write(&self, file: &Path, format: Option<Format>) -> Result<()> {
        if file.as_os_str().is_empty() {
            return Err(Error::usage("no name of a file", "name one that ends in .png, .jpg or .exr"));
        }
        let format = format.map_or_else(|| Format::from_path(file), Ok)?;
        self.inputs.check(file)?;
        let converted = self.converted(format)?;
        write_picture(converted.as_ref().unwrap_or(&self.image), &self.metadata, format, file)
    }

    /// The picture in the pixels of a format; `None` if it has them.
    fn converted(&self, format: Format) -> Result<Option<OutputImage>> {
        let converted = if format == Format::Exr { None } else { self.displayed()? };
        let image = converted.as_ref().unwrap_or(&self.image);
        check_alpha(image.is_rgba(), ".jpg", format != Format::Jpeg)?;
        let bits = matches!(image, OutputImage::Rgb16(..)).then_some(BitDepth::Sixteen);
        check_bits_of(bits, format)?;
        if format == Format::Exr && !matches!(image, OutputImage::Float(..)) {
            let what = "OpenEXR holds f32 values, and the picture has integers";
            return Err(Error::usage(what, "render with float values, or write a .png file"));
        }
        Ok(converted)
    }

    /// The picture in display values; `None` if it is.
    fn displayed(&self) -> Result<Option<OutputImage>> {
        let OutputImage::Float(film, ..) = &self.image else { return Ok(None) };
        let alpha = self.alpha().map(|alpha| alpha.values.as_slice());
        OutputImage::displayed(film, alpha, self.pipeline, self.display).map(Some)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(options: &[(&str, Value)]) -> Result<Options> {
        let named: Vec<_> = options.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect();
        Options::parse(&named)
    }

    #[test]
    fn options_are_those_of_the_command() {
        let text = |text: &str| Value::Text(text.into());
        let list = |parts: &[&str]| Value::List(parts.iter().map(|&part| part.into()).collect());
        let options = parse(&[
            ("size", list(&["64", "48"])),
            ("tone_map", text("agx")),
            ("with_", list(&["shadows", "glaze=2"])),
            ("without", text("normal-maps, textures")),
            ("crop", list(&["1", "2", "3", "4"])),
            ("draft", Value::Switch(false)),
            ("ground", Value::Switch(false)),
            ("exposure", text("-1.5")),
            ("hide", text("lid, left")),
            ("material", text("pot={ colour = '#f00', metallic = 1 }")),
        ])
        .expect("valid options");
        let settings = options.0.settings().expect("valid settings");
        assert_eq!(settings.picture.size(), Some([64, 48]));
        assert_eq!(settings.with, ["shadows", "glaze=2"]);
        assert_eq!(settings.without, ["normal-maps", "textures"]);
        assert_eq!(settings.crop.map(|crop| [crop.x, crop.y, crop.width, crop.height]), Some([1, 2, 3, 4]));
        assert_eq!((settings.picture.look, settings.picture.ground), (None, Some(false)));
        assert_eq!(options.has_picture(), Ok(true));
        // Names of objects and tables of materials have commas.
        let import = options.import();
        assert_eq!((import.hide, import.materials.len()), (vec!["lid, left".to_owned()], 1));
        assert!(!parse(&[("draft", Value::Switch(false))]).expect("valid options").has_import());
        let up = parse(&[("up", text("z"))]).expect("valid options");
        assert!(up.has_import() && up.has_picture() == Ok(false));
    }

    #[test]
    fn too_large_pictures_are_errors_of_memory() {
        let window = Window { x: 0, y: 0, width: u32::MAX, height: u32::MAX };
        let error = check_memory_of(window, 0, 1 << 20).expect_err("too large");
        assert!(matches!(error, Error::Memory { .. }), "{error}");
    }

    #[test]
    fn mistakes_get_the_message_of_the_command() {
        let mistake =
            |name: &str, value: Value| error_by_name(&parse(&[(name, value)]).err().expect("a mistake"));
        let unknown = "unknown option `sampels`; did you mean `samples`?";
        assert_eq!(mistake("sampels", Value::Text("4".into())), unknown);
        assert_eq!(mistake("sampels", Value::Default), unknown);
        assert_eq!(
            mistake("samples", Value::Text("0".into())),
            "invalid value '0' for 'samples': give a number of samples from 1 to 65536"
        );
        for (name, is_on, said) in [
            ("fov", true, "True"),
            ("with_", true, "True"),
            ("fov", false, "False"),
            ("smooth", false, "False"),
        ] {
            // The option after it is not its value.
            let given = [(name, Value::Switch(is_on)), ("size", Value::Text("8x8".into()))];
            let mistake = error_by_name(&parse(&given).err().expect("a mistake"));
            assert_eq!(mistake, format!("`{name}` takes a value, not {said}"));
        }
        for name in ["help", "version", "output", "inputs", "samples__", "samples_", "with__", "", "_"] {
            assert!(
                mistake(name, Value::Switch(true)).starts_with(&format!("unknown option `{name}`; ")),
                "{name}"
            );
        }
    }
}
