//! The frames of an animation as pictures, from one load of the inputs.

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use clap::Args;

use super::arguments::Arguments;
use super::prepare::timed;
use super::progress::{Mode, Progress};
use super::statistics::Seconds;
use super::{Printer, output};
use crate::animation::{AnimationJob, FileNames, FrameList, FrameRequest, in_order};
use crate::effects::RayKind;
use crate::error::{Error, Result, Warnings};
use crate::film::check::look;
use crate::film::write::{self, Format, write_picture};
use crate::film::{Share, TILE};
use crate::import;
use crate::job::metadata::fingerprint_of;
use crate::job::{Metadata, RenderJob, RenderSettings};
use crate::limits;
use crate::render::aov::AovSelection;
use crate::render::{RenderControl, Statistics};

/// How long an animation is, against what the scene says.
#[derive(Args, Default)]
pub struct LengthArguments {
    /// Frames a second [default: the scene's, or 30]
    #[arg(long, allow_hyphen_values = true, value_name = "N")]
    pub fps: Option<f64>,
    /// Seconds from beginning to end [default: the scene's, or 10]
    #[arg(long, allow_hyphen_values = true, value_name = "S")]
    pub duration: Option<f64>,
}

/// Reads the inputs and prepares what all frames share. `show` is called with the name of each phase and the warnings so far.
pub fn load_and_prepare(
    arguments: &Arguments,
    settings: &RenderSettings,
    request: &FrameRequest,
    seconds: &mut Seconds,
    warnings: &mut Warnings,
    show: &mut dyn FnMut(&str, &Warnings),
) -> Result<AnimationJob> {
    show("loading", warnings);
    let scene = timed(&mut seconds.load, || import::load(&arguments.inputs, warnings))?;
    show("preparing", warnings);
    AnimationJob::prepare(scene, settings, request, warnings, |said| show("building", said))
}

/// The most bytes that more than two pictures in flight may take together.
const MOST_BYTES: usize = 1 << 29;

/// Makes a picture of every frame, several at once, and hands them over in order. `make` is given the frame's job, and the control
/// of its tiles. A picture has so many channels beside its own, and takes so many bytes for each pixel.
pub fn make_all<T: Send>(
    animation: &AnimationJob,
    pool: &rayon::ThreadPool,
    (channels, bytes_per_pixel): (u64, u64),
    interrupted: &AtomicBool,
    progress: &Progress,
    make: &(dyn Fn(i32, &RenderJob, &RenderControl) -> Result<T> + Sync),
    take: &mut (dyn FnMut(i32, T) -> Result<()> + Send),
) -> Result<()> {
    let window = animation.resolved.window;
    let across = |size: u32| size.div_ceil(TILE) as usize;
    let tiles = across(window.width) * across(window.height);
    let (done, total) = (AtomicUsize::new(0), tiles * animation.frames.len());
    let count = |_: usize, _: usize| {
        progress.steps(1 + done.fetch_add(1, Ordering::Relaxed), total, ("frames", tiles));
    };
    let control = RenderControl { cancel: interrupted, progress: &count, time_stages: false };
    output::check_memory_of(window, channels, bytes_per_pixel)?;
    // One more than threads, so that none waits while a frame ends; fewer where memory holds fewer.
    let each = window.area().saturating_mul(bytes_per_pixel.max(12) as usize);
    let most = (MOST_BYTES / each).clamp(2, 1 + pool.current_num_threads()).min(animation.frames.len());
    let bytes = |count: usize| limits::product(&[window.area() as u64, bytes_per_pixel, count as u64]);
    let in_flight = (2..=most).rev().find(|&count| limits::check(bytes(count)).is_ok()).unwrap_or(1);
    let make = |frame| make(frame, &animation.frame(frame)?, &control);
    in_order(pool, &animation.frames, in_flight, interrupted, &make, take)
}

/// What is noticed of frames, for warnings at the end.
#[derive(Default)]
pub struct Noticed(Mutex<(u64, usize, Option<i32>)>);

impl Noticed {
    /// Looks at a frame's statistics.
    pub fn look(&self, frame: i32, statistics: &Statistics) {
        let Ok(mut noticed) = self.0.lock() else { return };
        let (hits, non_finite, first) = &mut *noticed;
        *hits += statistics.rays(RayKind::PRIMARY).hit;
        if statistics.non_finite.0 > 0 {
            *non_finite += statistics.non_finite.0;
            *first = Some(first.map_or(frame, |first| first.min(frame)));
        }
    }

    /// Frames that show less than was asked for do not pass in silence.
    pub fn warn(&self, arguments: &Arguments, warnings: &mut Warnings) {
        let Ok(noticed) = self.0.lock() else { return };
        let (hits, non_finite, first) = *noticed;
        if let Some(first) = first {
            warnings
                .push(format!("{non_finite} pixel(s) are not finite numbers, the first in frame {first}"));
        }
        if hits == 0 && arguments.crop.is_none() {
            warnings.push("nothing is in any frame: no primary ray hits anything; try `--camera auto`");
        }
    }
}

/// Pictures of frames, one file each.
pub struct Pictures {
    pub names: FileNames,
    pub format: Format,
    /// What else is kept of each pixel.
    pub wanted: AovSelection,
    /// The names of what else is kept.
    pub layers: Vec<String>,
    /// The frames that are this process's.
    pub share: Share,
    /// Whether frames that are there, whole and of the same settings, are left as they are.
    pub skip_existing: bool,
    pub progress: Mode,
    pub strict: bool,
}

/// The names of the files that frames go to. One frame may have a name of its own.
pub fn file_names(output: &Path, list: &FrameList) -> Result<FileNames> {
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

/// Renders frames, each into a file of its own.
pub fn write_pictures(
    arguments: &Arguments,
    length: &LengthArguments,
    list: Option<&FrameList>,
    pictures: &Pictures,
    interrupted: &AtomicBool,
) -> Result<()> {
    let pool = super::pool(arguments.threads)?;
    let mut report = Report::new(pictures.progress);
    let is_there = |frame: i32, metadata: &Metadata| {
        let found = || look(&pictures.names.of(frame), pictures.format);
        pictures.skip_existing && found().is(fingerprint_of(metadata), Some(frame))
    };
    let settings = RenderSettings { layers: pictures.layers.clone(), ..arguments.settings()? };
    let request = FrameRequest {
        fps: length.fps,
        duration: length.duration,
        list,
        share: pictures.share,
        is_there: &is_there,
    };
    let animation = report.load(&pool, arguments, &settings, &request)?;
    let skipped = match animation.skipped {
        0 => String::new(),
        n => format!("; {n} were there"),
    };
    if animation.frames.is_empty() {
        report.progress.finish(&format!("no frame to render{skipped}"));
        return Ok(());
    }
    let noticed = Noticed::default();
    let needs = |effects_on: usize| {
        let channels = pictures.wanted.channel_count(effects_on) as u64;
        let bytes = output::bytes_per_pixel(pictures.format, &pictures.wanted, channels)
            + write::bytes_per_pixel(pictures.format, channels);
        (channels, bytes)
    };
    let make = |frame: i32, job: &RenderJob, control: &RenderControl| {
        let effects_on = job.plan.effects_on().count();
        if effects_on > animation.effects_on {
            let (channels, bytes) = needs(effects_on);
            output::check_memory_of(job.window, channels, bytes)?;
        }
        let (picture, statistics) = output::render_plainly(job, pictures.format, &pictures.wanted, control)?;
        noticed.look(frame, &statistics);
        write_picture(&picture, &job.metadata, pictures.format, &pictures.names.of(frame))
    };
    let mut took = 0.0;
    let needs = needs(animation.effects_on);
    timed(&mut took, || {
        make_all(&animation, &pool, needs, interrupted, &report.progress, &make, &mut |_, ()| Ok(()))
    })?;
    report.end(arguments, &noticed, pictures.strict)?;
    let ends = [animation.frames.first(), animation.frames.last()].map(|frame| *frame.unwrap_or(&0));
    let [first, last] = ends.map(|frame| pictures.names.of(frame).display().to_string());
    report.progress.finish(&format!(
        "wrote {} frame(s), {first} to {last}, in {took:.2} s{skipped}",
        animation.frames.len()
    ));
    Ok(())
}

/// What is said of an animation while it is made.
pub struct Report {
    pub progress: Progress,
    pub seconds: Seconds,
    pub warnings: Warnings,
    printer: Printer,
    with_notes: bool,
}

impl Report {
    pub fn new(mode: Mode) -> Self {
        Report {
            progress: Progress::new(mode),
            seconds: Seconds::default(),
            warnings: Warnings::default(),
            printer: Printer::default(),
            with_notes: mode != Mode::None,
        }
    }

    /// Makes frames ready and says what there is to say of that.
    pub fn load(
        &mut self,
        pool: &rayon::ThreadPool,
        arguments: &Arguments,
        settings: &RenderSettings,
        request: &FrameRequest,
    ) -> Result<AnimationJob> {
        let Report { progress, seconds, warnings, printer, with_notes } = self;
        let mut show = |phase: &str, said: &Warnings| {
            progress.pause(|| printer.print(said, *with_notes));
            progress.phase(phase);
        };
        // Building is work for the pool, too; what is shown stays on this thread.
        let animation = {
            let show = Mutex::new(&mut show);
            pool.install(|| {
                load_and_prepare(arguments, settings, request, seconds, warnings, &mut |phase, said| {
                    if let Ok(mut show) = show.lock() {
                        show(phase, said);
                    }
                })
            })?
        };
        progress.pause(|| printer.print(warnings, *with_notes));
        progress.phase("rendering");
        Ok(animation)
    }

    /// Says what was noticed of the frames. With `strict`, warnings are an error.
    pub fn end(&mut self, arguments: &Arguments, noticed: &Noticed, strict: bool) -> Result<()> {
        noticed.warn(arguments, &mut self.warnings);
        self.progress.clear();
        self.printer.print(&self.warnings, self.with_notes);
        if strict && !self.warnings.is_empty() {
            return Err(Error::Failed {
                what: format!("{} warning(s), and --strict was given", self.warnings.messages().len()),
                hint: "the frames were written; mend what the warnings name, or leave --strict out".into(),
            });
        }
        Ok(())
    }
}
