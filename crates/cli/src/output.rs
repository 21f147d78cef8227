//! Rendering of a job, and output of its picture to a file or standard output.

use std::path::{Path, PathBuf};

use crate::sample_count::{self, ErrorTarget, StopReason};
use kiln::animation::FileNames;
use kiln::error::{Error, Result, Warnings};
use kiln::farm::{Shard, shard_name, shard_state, write_shard};
use kiln::files::{WholeFile, describe};
use kiln::film::check::{self, FileState};
use kiln::film::write::{self, Format, OutputImage, encode, write_picture};
use kiln::film::{self, Film, Window};
use kiln::job::{RenderJob, metadata};
use kiln::limits;
use kiln::render::aov::{self, AovSelection};
use kiln::render::{RenderControl, Statistics};
use kiln::scene::{BitDepth, PictureSettings, Samples, shell_quoted};

/// Destination of the picture.
pub(crate) enum OutputTarget {
    File(PathBuf, Format),
    /// File for one shard of the tiles of a picture of that format.
    Shard(PathBuf, Format, Shard),
    StandardOutput,
}

impl OutputTarget {
    /// Checks the name, before any work is done.
    pub(crate) fn new(output: &Path) -> Result<Self> {
        if output == Path::new("-") {
            return Ok(OutputTarget::StandardOutput);
        }
        let format = Format::from_path(output)?;
        if FileNames::is_pattern(output) {
            let what =
                format!("{}: a pattern for several files, and this is a single picture", output.display());
            let hint = "give a plain file name, or --frames for an animation";
            return Err(Error::usage(what, hint));
        }
        Ok(OutputTarget::File(output.to_owned(), format))
    }

    /// The target for one shard of the picture's tiles.
    pub(crate) fn shard(self, shard: Shard) -> Result<Self> {
        match self {
            OutputTarget::File(file, format) => {
                Ok(OutputTarget::Shard(shard_name(&file, shard), format, shard))
            }
            _ => Err(Error::usage(
                "a shard of a picture needs a file name",
                "give --output a name, such as still.png",
            )),
        }
    }

    /// The picture's format.
    pub(crate) fn format(&self) -> Format {
        match self {
            OutputTarget::File(_, format) | OutputTarget::Shard(_, format, _) => *format,
            OutputTarget::StandardOutput => Format::Png,
        }
    }

    /// The format that determines the film's pixel type: shards store the pixels as `f32`, like EXR.
    pub(crate) fn film_format(&self) -> Format {
        if let OutputTarget::Shard(..) = self { Format::Exr } else { self.format() }
    }

    /// The file name; `-` for standard output.
    pub(crate) fn file(&self) -> &Path {
        match self {
            OutputTarget::File(file, _) | OutputTarget::Shard(file, ..) => file,
            OutputTarget::StandardOutput => Path::new("-"),
        }
    }

    /// Checks that a file can be made in the folder, before time is spent on rendering.
    ///
    /// # Errors
    /// Those of [`WholeFile::create`].
    pub(crate) fn check_writable(&self) -> Result<()> {
        match self {
            OutputTarget::File(file, _) | OutputTarget::Shard(file, ..) => WholeFile::create(file).map(drop),
            OutputTarget::StandardOutput => Ok(()),
        }
    }

    /// State of the existing file.
    pub(crate) fn existing(&self) -> FileState {
        match self {
            OutputTarget::File(file, format) => check::state_of(file, *format),
            OutputTarget::Shard(file, _, shard) => shard_state(file, *shard),
            OutputTarget::StandardOutput => FileState::Missing,
        }
    }
}

/// Checks that the folder of an output file exists.
pub(crate) fn check_folder(output: &Path) -> Result<()> {
    let folder = output.parent().filter(|folder| !folder.as_os_str().is_empty());
    if folder.is_some_and(|folder| !folder.is_dir()) {
        let folder = folder.unwrap_or(output).to_string_lossy();
        let what = format!(
            "cannot be written: its folder does not exist; make it with mkdir -p {}",
            shell_quoted(&folder)
        );
        return Err(Error::output(output, what));
    }
    Ok(())
}

/// Checks that existing files of that name can be recognised, so that they can be skipped.
///
/// # Errors
/// [`Error::Usage`] for JPEG and standard output.
pub(crate) fn check_skipping(output: &Path, format: Format) -> Result<()> {
    if format == Format::Jpeg {
        let what = format!("{}: a JPEG has no fingerprint and no checksum", output.display());
        return Err(Error::usage(what, "with --skip-existing, name a file that ends in .png or .exr"));
    }
    if output == Path::new("-") {
        return Err(Error::usage("--skip-existing needs an output file", "leave --skip-existing out"));
    }
    Ok(())
}

/// Checks that the memory limit suffices for a picture, before it is rendered.
///
/// # Errors
/// [`Error::Memory`] with the required size.
pub(crate) fn check_memory(
    job: &RenderJob,
    target: &OutputTarget,
    selection: &AovSelection,
    has_accuracy: bool,
) -> Result<()> {
    let channels = selection.channel_count(job.plan.effects_on().count()) as u64;
    let writing = match target {
        // Written tile by tile.
        OutputTarget::Shard(..) => 0,
        // The encoded file is held in memory; at worst it is slightly larger than its pixels.
        OutputTarget::StandardOutput => 3,
        OutputTarget::File(_, format) => write::bytes_per_pixel(*format, channels),
    };
    let sampling = if has_accuracy { sample_count::BYTES_PER_PIXEL } else { 0 };
    let format = target.film_format();
    let each = bytes_per_pixel(format, selection, channels, &job.settings.picture).max(sampling) + writing;
    check_memory_of(job.window, channels, each)
}

/// Maximum bytes per pixel of a picture during rendering.
pub(crate) fn bytes_per_pixel(
    format: Format,
    selection: &AovSelection,
    channels: u64,
    picture: &PictureSettings,
) -> u64 {
    let is_transparent = picture.is_transparent();
    match format {
        Format::Exr => {
            // Colours and alpha are rendered together and split.
            let alpha = if is_transparent { 16 + 12 } else { 0 };
            4 * (3 + channels) + alpha + if channels > 0 { selection.bytes_per_pixel() } else { 0 }
        }
        // With alpha or 16 bits, the picture is kept in `f32` first.
        Format::Png if is_transparent => 16 + 2 * 12 + 8 + 8,
        Format::Png if picture.display().rounding.is_16_bit => 12 + 6,
        Format::Png | Format::Jpeg => 3,
    }
}

/// Checks that the memory limit suffices for a picture of `bytes_each` per pixel. `channels` is named in the error.
///
/// # Errors
/// [`Error::Memory`] with the required size.
pub(crate) fn check_memory_of(window: Window, channels: u64, bytes_each: u64) -> Result<()> {
    let Window { width, height, .. } = window;
    let bytes = limits::product(&[width.into(), height.into(), bytes_each]);
    let with = match channels {
        0 => String::new(),
        count => format!(" with {count} more channels"),
    };
    limits::check(bytes)
        .map_err(|excess| film::too_large(&format!("a picture of {width} x {height} pixels{with}"), &excess))
}

/// Renders the picture in the pixel type of its format, with the AOV channels of an EXR.
pub(crate) fn render_image(
    job: &RenderJob,
    format: Format,
    selection: &AovSelection,
    control: &RenderControl,
) -> Result<(OutputImage, Statistics)> {
    render_film(job, (format, format != Format::Exr), selection, control)
}

/// Renders the picture of a target. Shards hold `f32` pixels, which `kiln merge` develops.
pub(crate) fn render_target(
    job: &RenderJob,
    target: &OutputTarget,
    selection: &AovSelection,
    control: &RenderControl,
) -> Result<(OutputImage, Statistics)> {
    render_film(job, (target.film_format(), target.format() != Format::Exr), selection, control)
}

fn render_film(
    job: &RenderJob,
    (format, is_displayed): (Format, bool),
    selection: &AovSelection,
    control: &RenderControl,
) -> Result<(OutputImage, Statistics)> {
    if format != Format::Exr {
        return job.render_image(control);
    }
    let (film, alpha, statistics) = job.render_float(is_displayed, control)?;
    let mut channels = aov::channels(&job.aov_source(Some(&film)), selection, control)?;
    channels.extend(alpha);
    Ok((OutputImage::Float(film, channels, job.exr_attributes(selection)), statistics))
}

/// Checks that a picture with a transparent background can be written. `target` says what it is.
///
/// # Errors
/// [`Error::Usage`] for anything but PNG and OpenEXR.
pub(crate) fn check_alpha(is_transparent: bool, target: &str, has_alpha: bool) -> Result<()> {
    without_alpha(is_transparent && !has_alpha, target, "write .png or .exr, or give --background a colour")
}

/// Checks that a file of this format holds the bits per channel that are asked for.
///
/// # Errors
/// As [`check_bits`].
pub(crate) fn check_bits_of(bits: Option<BitDepth>, format: Format) -> Result<()> {
    match format {
        Format::Png => check_bits(bits, ".png", &PNG_BITS),
        Format::Jpeg => check_bits(bits, ".jpg", &[BitDepth::Eight]),
        Format::Exr => check_bits(bits, ".exr", &[BitDepth::Sixteen, BitDepth::ThirtyTwo]),
    }
}

/// The bits per channel of PNG, animated or not.
pub(crate) const PNG_BITS: [BitDepth; 2] = [BitDepth::Eight, BitDepth::Sixteen];

/// Checks that a file holds the bits per channel that are asked for. `target` says what it is.
///
/// # Errors
/// [`Error::Usage`] that names the bits that it holds.
pub(crate) fn check_bits(bits: Option<BitDepth>, target: &str, holds: &[BitDepth]) -> Result<()> {
    let Some(bits) = bits.filter(|bits| !holds.contains(bits)) else { return Ok(()) };
    let held: Vec<&str> = holds.iter().map(|bits| bits.name()).collect();
    let held = held.join(" or ");
    let what = format!("{target} has {held} bits per channel, not {}", bits.name());
    Err(Error::usage(
        what,
        format!("give --bits {held}, or another kind of file: .png has 8 or 16, .exr 16 or 32"),
    ))
}

/// Checks that a picture of `--accuracy` or `--budget` has no transparent background.
///
/// # Errors
/// [`Error::Usage`] otherwise.
pub(crate) fn check_accuracy_alpha(is_transparent: bool, has_accuracy: bool) -> Result<()> {
    let hint = "give --samples or --noise in its place, or give --background a colour";
    without_alpha(is_transparent && has_accuracy, "a picture of --accuracy or --budget", hint)
}

fn without_alpha(is_asked_for: bool, target: &str, hint: &str) -> Result<()> {
    if is_asked_for {
        return Err(Error::usage(
            format!("{target} has no alpha channel for a transparent background"),
            hint,
        ));
    }
    Ok(())
}

/// Renders with the number of samples that the requested accuracy or budget needs, and reports it as a note or warning.
pub(crate) fn render_to_accuracy(
    job: &mut RenderJob,
    target: &ErrorTarget,
    format: Format,
    control: &RenderControl,
    warnings: &mut Warnings,
) -> Result<(OutputImage, Statistics)> {
    // No progress: the total number of tiles is unknown, as samples are added in several renders.
    let control = RenderControl { progress: &|_, _| (), ..*control };
    let sampled = sample_count::render(job, target, &control)?;
    match sampled.reason {
        StopReason::Time if target.accuracy.is_some() => warnings.push(sampled.summary(target)),
        StopReason::MaxSamples | StopReason::NotFinite => warnings.push(sampled.summary(target)),
        _ => warnings.note(sampled.summary(target)),
    }
    let samples = Some(Samples::clamped(job.plan_settings.sampling.max_samples()));
    metadata::replace(&mut job.metadata, &PictureSettings { samples, ..job.settings.picture });
    if let Some(ev) = job.metered_exposure() {
        metadata::set_auto_exposure(&mut job.metadata, ev);
    }
    let (window, pipeline) = (job.window, job.pipeline());
    let picture = match format {
        Format::Exr => {
            let film = Film::from_rows(window, &sampled.pixels)?;
            OutputImage::Float(film, Vec::new(), job.exr_attributes(&AovSelection::new(&[])?))
        }
        _ => {
            let display = job.display_transform(&control)?;
            let film = Film::from_rows(window, &sampled.pixels)?;
            OutputImage::displayed(&film, None, pipeline, display)?
        }
    };
    Ok((picture, sampled.statistics))
}

/// Writes the picture to its target.
pub(crate) fn write(picture: &OutputImage, job: &RenderJob, target: &OutputTarget) -> Result<()> {
    let metadata = &job.metadata;
    match (target, picture) {
        (OutputTarget::Shard(file, _, shard), OutputImage::Float(film, channels, attributes)) => {
            let display = job.display_transform(&RenderControl::default())?;
            write_shard((film, channels, attributes), (job.pipeline(), display), metadata, *shard, file)
        }
        (OutputTarget::File(file, format) | OutputTarget::Shard(file, format, _), _) => {
            write_picture(picture, metadata, *format, file)
        }
        (OutputTarget::StandardOutput, _) => {
            let mut bytes = Vec::new();
            let fail = |e| Error::output(Path::new("-"), describe(&e));
            encode(picture, metadata, Format::Png, &mut bytes).map_err(fail)?;
            std::io::Write::write_all(&mut std::io::stdout().lock(), &bytes).map_err(fail)
        }
    }
}
