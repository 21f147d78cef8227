//! Pictures in memory, for programs: the options of `kiln render` by name, and its picture.

use std::borrow::Borrow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::names::option_named;
use super::output::{check_alpha, check_bits_of, check_memory_of, render_image};
use super::prepare::note_rest_pose;
use kiln::error::{Error, Result, Warnings};
use kiln::files::InputFiles;
use kiln::film::write::{ALPHA, Channel, Format, OutputImage, encode, write_picture};
use kiln::film::{ColourPipeline, DisplayTransform, Window};
use kiln::job::{
    self, Findings, Metadata, PictureOptions, PictureUse, RenderJob, RenderSettings, Session, warn_of_unused,
};
use kiln::render::RenderControl;
use kiln::render::aov::{self, AovSelection};
use kiln::scene::animation::Moment;
use kiln::scene::{BitDepth, GivenValue, Scene};

pub use super::names::{by_name, error_by_name};

/// Options from names and values: `tone_map` is `--tone-map`, and `with_` is `--with`. `None` is as if an option were not
/// given.
///
/// # Errors
/// [`Error::Usage`]. [`error_by_name`] names options as they are here.
pub fn parse_options(given: Vec<(String, Option<GivenValue>)>) -> Result<PictureOptions> {
    let mut options = PictureOptions::default();
    for (name, value) in given {
        let option = option_named(&name)?;
        let wrong = |why| match &value {
            Some(GivenValue::Texts(texts)) => {
                format!("invalid value '{}' for '{name}': {why}", texts.join(","))
            }
            _ => format!("`{name}` {why}"),
        };
        options.set(&option, value.clone()).map_err(|why| Error::usage(wrong(why), ""))?;
    }
    options.settings()?;
    Ok(options)
}

/// The AOVs of these names, and the settings of a picture with them.
fn with_aovs(options: &PictureOptions, aovs: &[String]) -> Result<(AovSelection, RenderSettings)> {
    let settings = RenderSettings { aovs: aovs.to_vec(), ..options.settings()? };
    Ok((AovSelection::new(aovs)?, settings))
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
    options: &PictureOptions,
    format: Format,
    aovs: &[String],
    control: &RenderControl,
    warnings: &mut Warnings,
) -> Result<Picture> {
    let (selection, settings) = with_aovs(options, aovs)?;
    super::in_pool(options.thread_count(), || {
        note_rest_pose(&scene, warnings);
        let (inputs, used) = (files_read(&scene, options), use_of(&scene));
        let session = Session::still(scene)?;
        let resolved = session.resolve(&settings, warnings)?;
        warn_of_unused(options, &resolved.plan_settings, used, warnings);
        let job = session.into_job(&resolved, true, control, warnings)?;
        picture_of(job, inputs, &selection, format, control, warnings)
    })?
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
        options: &PictureOptions,
        format: Format,
        aovs: &[String],
        control: &RenderControl,
        warnings: &mut Warnings,
    ) -> Result<Picture> {
        let (selection, settings) = with_aovs(options, aovs)?;
        super::in_pool(options.thread_count(), || {
            let PreparedScene(session) = self;
            note_rest_pose(session.scene(), warnings);
            let resolved = session.resolve(&settings, warnings)?;
            warn_of_unused(options, &resolved.plan_settings, use_of(session.scene()), warnings);
            let job = session.first_job(&resolved, true, control, warnings)?;
            picture_of(job, files_read(session.scene(), options), &selection, format, control, warnings)
        })?
    }

    /// The AOVs of [`PreparedScene::render`] without its picture: no light is traced for them, but for the AOVs of
    /// effects and variances.
    ///
    /// # Errors
    /// As [`render`].
    pub fn aovs(
        &self,
        options: &PictureOptions,
        aovs: &[String],
        control: &RenderControl,
        warnings: &mut Warnings,
    ) -> Result<Aovs> {
        let (selection, settings) = with_aovs(options, aovs)?;
        super::in_pool(options.thread_count(), || {
            let PreparedScene(session) = self;
            note_rest_pose(session.scene(), warnings);
            let resolved = session.resolve_only(&settings, false)?;
            session.warn_of_resolved(&resolved, &settings, warnings)?;
            let used = PictureUse { is_rounded: false, ..use_of(session.scene()) };
            warn_of_unused(options, &resolved.plan_settings, used, warnings);
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
        })?
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
fn files_read(scene: &Scene, options: &PictureOptions) -> InputFiles {
    let environment = options.environment.environment.iter().map(PathBuf::from);
    scene.files_read.iter().cloned().chain(environment).collect()
}

/// What pictures of a scene are used for: those of floating-point values are rounded when they are saved as .png or .jpg.
fn use_of(scene: &Scene) -> PictureUse {
    PictureUse { time: Some(Moment::of_still(scene).seconds), is_rounded: true }
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

    fn parse(options: &[(&str, GivenValue)]) -> Result<PictureOptions> {
        let named = |(name, value): &(&str, GivenValue)| ((*name).to_owned(), Some(value.clone()));
        parse_options(options.iter().map(named).collect())
    }

    #[test]
    fn options_are_those_of_the_command() {
        let text = |text: &str| GivenValue::from(text);
        let list = |parts: &[&str]| GivenValue::Texts(parts.iter().map(|&part| part.into()).collect());
        let options = parse(&[
            ("size", list(&["64", "48"])),
            ("tone_map", text("agx")),
            ("with_", list(&["shadows", "glaze=2"])),
            ("without", text("normal-maps, textures")),
            ("crop", list(&["1", "2", "3", "4"])),
            ("draft", GivenValue::Switch(false)),
            ("ground", GivenValue::Switch(false)),
            ("exposure", text("-1.5")),
            ("hide", text("lid, left")),
            ("material", text("pot={ colour = '#f00', metallic = 1 }")),
        ])
        .expect("valid options");
        let settings = options.settings().expect("valid settings");
        assert_eq!(settings.picture.size(), Some([64, 48]));
        assert_eq!(settings.with, ["shadows", "glaze=2"]);
        assert_eq!(settings.without, ["normal-maps", "textures"]);
        assert_eq!(settings.crop.map(|crop| [crop.x, crop.y, crop.width, crop.height]), Some([1, 2, 3, 4]));
        assert_eq!((settings.picture.look, settings.picture.ground), (None, Some(false)));
        assert!(options.has_picture());
        // Names of objects and tables of materials have commas.
        let import = options.reading();
        assert_eq!((import.hide, import.materials.len()), (vec!["lid, left".to_owned()], 1));
        let off = parse(&[("draft", GivenValue::Switch(false))]).expect("valid options");
        assert_eq!(off, PictureOptions::default());
        let up = parse(&[("up", text("Z")), ("smooth", GivenValue::Switch(true))]).expect("valid options");
        assert!(up.import.up.is_some() && !up.has_picture());
        assert_eq!(up.text("smooth").as_deref(), Some("30"));
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
            |name: &str, value: GivenValue| error_by_name(&parse(&[(name, value)]).expect_err("a mistake"));
        let unknown = "unknown option `sampels`; did you mean `samples`?";
        assert_eq!(mistake("sampels", GivenValue::from("4")), unknown);
        let unset = parse_options(vec![("sampels".to_owned(), None)]).map_err(|e| error_by_name(&e));
        assert_eq!(unset, Err(unknown.to_owned()));
        assert_eq!(
            mistake("samples", GivenValue::from("0")),
            "invalid value '0' for 'samples': give a number of samples from 1 to 65536"
        );
        let given = |name: &str, text: &str| mistake(name, GivenValue::from(text));
        assert_eq!(given("tone_map", "agxx"), "invalid value 'agxx' for 'tone_map': did you mean `agx`?");
        assert_eq!(given("draft", "yes"), "invalid value 'yes' for 'draft': give true or false");
        for (name, is_on, said) in [
            ("fov", true, "True"),
            ("with_", true, "True"),
            ("fov", false, "False"),
            ("smooth", false, "False"),
        ] {
            // The option after it is not its value.
            let given = [(name, GivenValue::Switch(is_on)), ("size", GivenValue::from("8x8"))];
            let mistake = error_by_name(&parse(&given).expect_err("a mistake"));
            assert_eq!(mistake, format!("`{name}` takes a value, not {said}"));
        }
        for name in [
            "help",
            "width",
            "look",
            "tone-map",
            "output",
            "inputs",
            "limit",
            "samples__",
            "samples_",
            "with__",
            "",
            "_",
        ] {
            assert!(
                mistake(name, GivenValue::Switch(true)).starts_with(&format!("unknown option `{name}`; ")),
                "{name}"
            );
        }
    }

    #[test]
    fn options_that_change_nothing_have_the_warnings_of_the_command() {
        let scene = kiln::import::load_bytes(
            b"[[sphere]]\ncentre = [0, 0, 0]\nradius = 1".to_vec(),
            &Default::default(),
            &mut Warnings::default(),
        );
        let scene = Arc::new(scene.expect("a scene"));
        let text = GivenValue::from;
        let options = parse(&[
            ("size", text("8x8")),
            ("min_samples", text("8")),
            ("same_grain", GivenValue::Switch(true)),
        ]);
        let options = options.expect("valid options");
        let control = RenderControl::default();
        let (mut single, mut prepared) = (Warnings::default(), Warnings::default());
        render(Scene::clone(&scene), &options, Format::Png, &[], &control, &mut single).expect("a picture");
        let scene = PreparedScene::new(scene).expect("a scene");
        scene.render(&options, Format::Png, &[], &control, &mut prepared).expect("a picture");
        for warnings in [single, prepared] {
            assert_eq!(
                warnings.messages(),
                [
                    "--min-samples changes nothing without --noise",
                    "--same-grain changes nothing in a picture at time 0"
                ]
            );
        }
    }
}
