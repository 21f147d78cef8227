//! Films of numbered pictures that exist, such as the frames of a farm: `kiln animate frame_####.png -o film.mp4`.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use super::{Command, Reporter, recorder, summary, timed};
use kiln::animation::{FileNames, FrameData, FrameList, VideoFormat, VideoSpec, in_order};
use kiln::error::{Error, Result};
use kiln::files::{folder_of, read_file, unreadable};
use kiln::film::rounding::Rounding;
use kiln::film::write::{Format, OutputImage, PngForm};
use kiln::film::{ColourPipeline, Film, Window, read};
use kiln::job::PictureOptions;

/// Frames per second of films of pictures, which do not state theirs.
const FPS: f64 = 30.0;

/// The pattern of inputs that are pictures rather than files to render, if they are.
///
/// # Errors
/// [`Error::Usage`] for several pictures, which the shell makes of `*.png`, in the order of letters.
pub(super) fn pattern(inputs: &[PathBuf]) -> Result<Option<&Path>> {
    let Some(first) = inputs.first().filter(|first| Format::from_path(first).is_ok()) else {
        return Ok(None);
    };
    if inputs.len() > 1 {
        let what = format!("{}: several pictures", first.display());
        return Err(Error::usage(what, "name them by one pattern, such as 'frame_####.png'"));
    }
    Ok(Some(first))
}

/// The pictures of a pattern, in order: those of `list`, or all that exist, without a gap.
///
/// # Errors
/// [`Error::Usage`] for a name without a place for the number, [`Error::Input`] for none and for a missing one.
pub(super) fn files(pattern: &Path, list: Option<&FrameList>) -> Result<Vec<PathBuf>> {
    let hint = "name all frames, such as frame_####.png";
    if Format::from_path(pattern)? == Format::Exr {
        return Err(linear(pattern));
    }
    let names = FileNames::parse(pattern).map_err(|what| Error::usage(what, "give the name one ####"))?;
    let Some(names) = names else {
        return Err(Error::usage(format!("{}: one picture is no film", pattern.display()), hint));
    };
    let numbers = match list {
        Some(list) => list.frames().to_vec(),
        None => {
            let (found, other) = names.existing().map_err(|e| unreadable(folder_of(pattern), &e))?;
            if let Some(other) = other {
                let what = format!("the number in `{other}` has other digits");
                return Err(Error::input(pattern, what, "give the name a # for each digit"));
            }
            let (Some(&first), Some(&last)) = (found.first(), found.last()) else {
                return Err(Error::input(
                    pattern,
                    "no such frame",
                    "each # is a digit of its number; check the folder",
                ));
            };
            if let Some(gap) = (first..=last).find(|number| found.binary_search(number).is_err()) {
                let hint = format!("render it, or give --frames: the others are {first} to {last}");
                return Err(Error::input(names.of(gap).as_path(), "no such file", hint));
            }
            found
        }
    };
    Ok(numbers.into_iter().map(|number| names.of(number)).collect())
}

fn linear(file: &Path) -> Error {
    let hint = "render the frames as .png, with --exposure and --tone-map";
    Error::input(file, "linear light, not colours of a display", hint)
}

/// Writes the film.
pub(super) fn film(
    command: &Command,
    files: &[PathBuf],
    format: VideoFormat,
    is_stream: bool,
    interrupted: &AtomicBool,
) -> Result<()> {
    let pool = crate::pool(command.arguments.options.thread_count())?;
    let mut reporter = Reporter::new(command.progress);
    warn_of_settings(command, &mut reporter);
    reporter.phase("reading");
    let Frame { size, form, .. } = Frame::read(files.first().map_or(Path::new(""), PathBuf::as_path))?;
    let fps = command.length.fps.unwrap_or(FPS);
    let spec = VideoSpec { size, fps, frames: files.len(), form };
    let mut recorder = recorder(command, format, spec, is_stream)?;
    let done = AtomicUsize::new(0);
    let make = |place: i32| {
        let file = &files[place as usize];
        let frame = Frame::read(file)?;
        if (frame.size, frame.form) != (size, form) {
            let what = format!(
                "{} x {} pixels, of another size or kind than the first frame",
                frame.size[0], frame.size[1]
            );
            return Err(Error::input(file.as_path(), what, "make all frames by one command"));
        }
        let converted = format.convert(&frame.picture);
        reporter.progress.steps(1 + done.fetch_add(1, Ordering::Relaxed), files.len(), ("pictures", 1));
        converted
    };
    let mut take = |_, frame: FrameData| recorder.add(frame);
    let places: Vec<i32> = (0..files.len() as i32).collect();
    let mut took = 0.0;
    let in_flight = 1 + pool.current_num_threads();
    timed(&mut took, || in_order(&pool, &places, in_flight, interrupted, &make, &mut take))?;
    recorder.finish()?;
    reporter.progress.clear();
    reporter.show();
    reporter.check(command.strict, "the film was")?;
    reporter.progress.finish(&summary(command, spec, took));
    Ok(())
}

/// Warns of options of rendering. The number of threads is used here, too.
fn warn_of_settings(command: &Command, reporter: &mut Reporter) {
    let options = PictureOptions { threads: None, ..command.arguments.options.0.clone() };
    let duration = command.length.duration.map(|_| "duration".to_owned());
    for name in options.entries().into_iter().map(|(name, _)| name).chain(duration) {
        reporter.warnings.push(format!("--{name} changes nothing: the frames are pictures that exist"));
    }
}

/// A decoded frame.
struct Frame {
    picture: OutputImage,
    size: [u32; 2],
    form: PngForm,
}

impl Frame {
    /// Reads a PNG, JPEG or WebP.
    ///
    /// # Errors
    /// [`Error::Input`] for other files and for pictures in linear light.
    fn read(file: &Path) -> Result<Self> {
        let bytes = read_file(file).map_err(|e| unreadable(file, &e))?;
        let decoded = read::decode(&bytes, |_| 16).map_err(|e| e.into_error(file))?;
        let size = [decoded.width(), decoded.height()];
        let has_alpha = decoded.color().has_alpha();
        let is_16_bit = match decoded.color().bytes_per_pixel() / decoded.color().channel_count() {
            1 => false,
            2 => true,
            _ => return Err(linear(file)),
        };
        let window = Window { x: 0, y: 0, width: size[0], height: size[1] };
        let picture = match (is_16_bit, has_alpha) {
            (false, false) => OutputImage::Rgb8(colours(window, decoded.into_rgb8().as_raw())?, PIPELINE),
            (true, false) => OutputImage::Rgb16(colours(window, decoded.into_rgb16().as_raw())?, PIPELINE),
            (false, true) => {
                let alpha = decoded.to_rgba8().pixels().map(|pixel| pixel.0[3]).collect();
                OutputImage::Rgba8(colours(window, decoded.into_rgb8().as_raw())?, alpha, PIPELINE)
            }
            (true, true) => {
                let alpha = decoded.to_rgba16().pixels().map(|pixel| pixel.0[3]).collect();
                OutputImage::Rgba16(colours(window, decoded.into_rgb16().as_raw())?, alpha, PIPELINE)
            }
        };
        let form = PngForm::new(has_alpha, Rounding { is_16_bit, is_dithered: false }, PIPELINE);
        Ok(Frame { picture, size, form })
    }
}

/// Values of files are displayed as they are.
const PIPELINE: ColourPipeline = ColourPipeline::Display;

fn colours<T: bytemuck::Pod>(window: Window, values: &[T]) -> Result<Film<[T; 3]>>
where
    [T; 3]: kiln::film::Pixel + bytemuck::Pod,
{
    Film::from_rows(window, bytemuck::cast_slice(values))
}
