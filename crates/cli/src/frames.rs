//! Rendering of animation frames to pictures, with one load of the inputs.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use clap::Args;

use super::arguments::Arguments;
use super::message::Message;
use super::output;
use super::prepare::{Reporter, timed};
use super::progress::{Mode, Progress};
use crate::options::parser;
use kiln::animation::{AnimationJob, FileNames, FrameList, FrameRequest, in_order};
use kiln::error::{Error, Result, Warnings};
use kiln::farm::Shard;
use kiln::film::TILE;
use kiln::film::check::state_of;
use kiln::film::write::{self, Format, OutputImage, write_picture};
use kiln::job::metadata::fingerprint_of;
use kiln::job::{Findings, Metadata, RenderJob, RenderSettings};
use kiln::limits;
use kiln::render::aov::AovSelection;
use kiln::render::{RenderControl, Statistics};
use kiln::scene::Seconds;
use kiln::scene::option::group;

/// A number above 0.
fn above_zero(text: &str) -> std::result::Result<f64, String> {
    let number = text.trim().parse().ok().filter(|number: &f64| *number > 0.0 && number.is_finite());
    number.ok_or_else(|| "give frames per second above 0, such as 24".to_owned())
}

/// Frame rate and duration that override the scene's.
#[derive(Args, Clone)]
pub(crate) struct LengthArguments {
    /// Frames per second [default: the scene's, or 30; 15 of a turntable as .gif or .png film]
    #[arg(long, help_heading = group::ANIMATION, allow_hyphen_values = true, value_name = "N", value_parser = above_zero)]
    pub fps: Option<f64>,
    /// Duration in seconds [default: the scene's, or 10; 5 of a turntable as .gif or .png film]
    #[arg(long, help_heading = group::ANIMATION, allow_hyphen_values = true, value_name = "S", value_parser = parser::<Seconds>())]
    pub duration: Option<Seconds>,
}

/// Memory limit in bytes of the pictures in flight, if there are more than two.
const MOST_BYTES: usize = 1 << 29;

/// Renders every frame by `make`, several in parallel, and passes the results to `take` in order of frames. `channels`
/// is the number of AOV channels of a picture, `bytes_per_pixel` its memory per pixel.
pub(crate) fn render_all<T: Send>(
    animation: &AnimationJob,
    pool: &rayon::ThreadPool,
    (channels, bytes_per_pixel): (u64, u64),
    interrupted: &AtomicBool,
    progress: &Progress,
    make: &(dyn Fn(i32, &RenderJob, &RenderControl) -> Result<T> + Sync),
    take: &mut (dyn FnMut(i32, T) -> Result<()> + Send),
) -> Result<()> {
    let window = animation.picture.window;
    let across = |size: u32| size.div_ceil(TILE) as usize;
    let tiles = across(window.width) * across(window.height);
    let (done, total) = (AtomicUsize::new(0), tiles * animation.frames.len());
    let count = |_: usize, _: usize| {
        progress.steps(1 + done.fetch_add(1, Ordering::Relaxed), total, ("frames", tiles));
    };
    let control = RenderControl { cancel: interrupted, progress: &count, time_stages: false };
    output::check_memory_of(window, channels, bytes_per_pixel)?;
    // One more than the number of threads, so that no thread idles at the end of a frame; fewer if memory is limited.
    let each = window.area().saturating_mul(bytes_per_pixel.max(12) as usize);
    let most = (MOST_BYTES / each).clamp(2, 1 + pool.current_num_threads()).min(animation.frames.len());
    let bytes = |count: usize| limits::product(&[window.area() as u64, bytes_per_pixel, count as u64]);
    let in_flight = (2..=most).rev().find(|&count| limits::check(bytes(count)).is_ok()).unwrap_or(1);
    let make = |frame| make(frame, &animation.frame(frame)?, &control);
    in_order(pool, &animation.frames, in_flight, interrupted, &make, take)
}

/// What the frames so far warn of.
#[derive(Default)]
pub(crate) struct FrameFindings(Mutex<Option<Findings>>);

impl FrameFindings {
    /// Adds a frame. Whether it is clipped is found out for the first alone.
    pub(crate) fn add(
        &self,
        frame: i32,
        (picture, statistics): (&OutputImage, &Statistics),
        animation: &AnimationJob,
        job: &RenderJob,
        control: &RenderControl,
    ) -> Result<()> {
        let found = match animation.frames.iter().min() == Some(&frame) {
            true => Findings::of(job, picture, statistics, control)?,
            false => Findings::new(job, statistics),
        };
        let found = found.of_frame(frame);
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match &mut *all {
            Some(all) => all.add(found),
            None => *all = Some(found),
        }
        Ok(())
    }

    /// Warns of what was found.
    fn warn(&self, warnings: &mut Warnings) {
        let all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.iter().for_each(|findings| findings.warn(warnings));
    }
}

/// Output settings of a series of frames, one file each.
pub(crate) struct FrameSeries {
    pub names: FileNames,
    pub format: Format,
    /// AOVs of each pixel.
    pub selection: AovSelection,
    /// AOV names as typed.
    pub aovs: Vec<String>,
    /// Shard of the frames that this process renders.
    pub shard: Shard,
    /// Whether complete existing files with the same settings are kept.
    pub skip_existing: bool,
    pub progress: Mode,
    pub strict: bool,
}

/// File names of the frames. A single frame may have a name without a number.
pub(crate) fn file_names(output: &Path, list: &FrameList) -> Result<FileNames> {
    let names = FileNames::parse(output).map_err(|what| Error::usage(what, "give the name one ####"))?;
    match names {
        Some(names) => Ok(names),
        None if list.frames().len() == 1 => Ok(FileNames::single(output)),
        None => {
            let what = format!("{}: one name for {} frames", output.display(), list.frames().len());
            Err(Error::usage(what, "give the name a place for their number, such as frame_####.png"))
        }
    }
}

/// Renders frames to one file each.
pub(crate) fn write_frames(
    arguments: &Arguments,
    length: &LengthArguments,
    list: Option<&FrameList>,
    pictures: &FrameSeries,
    interrupted: &AtomicBool,
) -> Result<()> {
    let pool = super::pool(arguments.options.thread_count())?;
    let mut reporter = Reporter::new(pictures.progress);
    let is_there = |frame: i32, metadata: &Metadata| {
        let found = || state_of(&pictures.names.of(frame), pictures.format);
        pictures.skip_existing && found().is(fingerprint_of(metadata), Some(frame))
    };
    let settings = RenderSettings { aovs: pictures.aovs.clone(), ..arguments.options.settings()? };
    let request = FrameRequest {
        fps: length.fps,
        duration: length.duration.map(Seconds::get),
        list,
        shard: pictures.shard,
        is_displayed: pictures.format != Format::Exr,
        film: None,
        is_there: &is_there,
    };
    let animation = pool.install(|| reporter.load_animation(arguments, &settings, &request))?;
    reporter.check_outputs(animation.frames.iter().map(|&frame| pictures.names.of(frame)))?;
    let picture = animation.picture.settings.picture;
    output::check_bits_of(picture.bits, pictures.format)?;
    output::check_alpha(picture.is_transparent(), ".jpg", pictures.format != Format::Jpeg)?;
    let first = first_frame(&mut reporter, &pool, &animation, interrupted)?;
    let skipped = match animation.skipped {
        0 => String::new(),
        n => format!("; {n} existed"),
    };
    let Some(first) = first else {
        reporter.progress.finish(&format!("no frame to render{skipped}"));
        return Ok(());
    };
    let findings = FrameFindings::default();
    let first_effects_on = first.plan.effects_on().count();
    let needs = |effects_on: usize| {
        let channels = pictures.selection.channel_count(effects_on) as u64;
        let bytes = output::bytes_per_pixel(pictures.format, &pictures.selection, channels, &picture)
            + write::bytes_per_pixel(pictures.format, channels);
        (channels, bytes)
    };
    let make = |frame: i32, job: &RenderJob, control: &RenderControl| {
        let effects_on = job.plan.effects_on().count();
        // A light that is dark at first may add to the effects.
        if effects_on > first_effects_on {
            let (channels, bytes) = needs(effects_on);
            output::check_memory_of(job.window, channels, bytes)?;
        }
        let (picture, statistics) = output::render_image(job, pictures.format, &pictures.selection, control)?;
        findings.add(frame, (&picture, &statistics), &animation, job, control)?;
        let file = pictures.names.of(frame);
        write_picture(&picture, &job.metadata, pictures.format, &file)?;
        Message::Frame(frame, &file).print();
        Ok(())
    };
    let mut took = 0.0;
    let needs = needs(first_effects_on);
    timed(&mut took, || {
        render_all(&animation, &pool, needs, interrupted, &reporter.progress, &make, &mut |_, ()| Ok(()))
    })?;
    finish(&mut reporter, &findings, pictures.strict)?;
    let ends = [animation.frames.first(), animation.frames.last()].map(|frame| *frame.unwrap_or(&0));
    let [first, last] = ends.map(|frame| pictures.names.of(frame).display().to_string());
    reporter.progress.finish(&format!(
        "wrote {} frame(s), {first} to {last}, in {took:.2} s{skipped}",
        animation.frames.len()
    ));
    Ok(())
}

/// The job of the first frame to render, with the exposure of all frames, and warnings about it.
pub(crate) fn first_frame(
    reporter: &mut Reporter,
    pool: &rayon::ThreadPool,
    animation: &AnimationJob,
    interrupted: &AtomicBool,
) -> Result<Option<RenderJob>> {
    let control = RenderControl { cancel: interrupted, ..RenderControl::default() };
    let first = pool.install(|| animation.first(&control, &mut reporter.warnings))?;
    reporter.show();
    Ok(first)
}

/// Prints the warnings about the frames. With `strict`, warnings are an error.
pub(crate) fn finish(reporter: &mut Reporter, findings: &FrameFindings, strict: bool) -> Result<()> {
    findings.warn(&mut reporter.warnings);
    reporter.progress.clear();
    reporter.show();
    reporter.check(strict, "the frames were")
}
