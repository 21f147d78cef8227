//! The frames of an animation, each made ready for its picture by itself, from one load of the inputs.

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use clap::Args;
use rayon::prelude::*;

use super::arguments::Arguments;
use super::picture;
use super::prepare::{self, Described, Ready, timed};
use super::progress::{Mode, Progress};
use super::statistics::Seconds;
use super::{Printer, develop};
use crate::animation::{FileNames, FrameList, Moment, Stage, in_order};
use crate::effects::{Plan, RayKind, check_scene};
use crate::error::{Error, Result, Warnings};
use crate::film::check::look;
use crate::film::write::{self, FRAME, Format, Metadata, write_picture};
use crate::film::{ColourPipeline, Share, TILE, Window};
use crate::import;
use crate::limits;
use crate::render::aov::Wanted;
use crate::render::{Clock, Statistics, Watch};
use crate::scene::animation::Timeline;
use crate::world::View;

/// How long an animation is, against what the scene says.
#[derive(Args, Default)]
pub struct LengthArguments {
    /// Frames a second [default: the scene's, or 30]
    #[arg(long, allow_hyphen_values = true, value_name = "N")]
    fps: Option<f64>,
    /// Seconds from beginning to end [default: the scene's, or 10]
    #[arg(long, allow_hyphen_values = true, value_name = "S")]
    duration: Option<f64>,
}

/// Which frames are wanted, and of what length the animation is.
pub struct Asked<'a> {
    pub length: &'a LengthArguments,
    /// All there are, where none are named.
    pub list: Option<&'a FrameList>,
    /// The share of them that is this process's.
    pub share: Share,
    /// Layers beside the picture.
    pub layers: &'a [String],
    /// Whether a frame of these settings needs no making, because it is there.
    pub is_there: &'a (dyn Fn(i32, &Metadata) -> bool + Sync),
}

impl<'a> Asked<'a> {
    /// All frames of a list.
    pub fn all(length: &'a LengthArguments, list: Option<&'a FrameList>) -> Self {
        Asked { length, list, share: Share::ALL, layers: &[], is_there: &|_, _| false }
    }
}

/// An animation that is ready for its frames.
pub struct Frames {
    /// `None` where there is nothing to do.
    stage: Option<Stage>,
    timeline: Timeline,
    frames: Vec<i32>,
    /// Frames that were there already.
    skipped: usize,
    /// What all frames have in common; the scene is in the stage.
    shared: Described,
    /// How many effects the first frame has on; a light that is dark at first may add to them.
    effects_on: usize,
}

/// The most bytes that more than two pictures in flight may take together.
const MOST_BYTES: usize = 1 << 29;

impl Frames {
    /// Reads the inputs and prepares what all frames take.
    pub fn new(
        arguments: &Arguments,
        asked: &Asked,
        seconds: &mut Seconds,
        warnings: &mut Warnings,
        show: &mut dyn FnMut(&str, &Warnings),
    ) -> Result<Self> {
        show("loading", warnings);
        let mut scene = timed(&mut seconds.load, || import::load(&arguments.inputs, warnings))?;
        show("preparing", warnings);
        import::check_drawable(&arguments.inputs, &scene)?;
        check_scene(&scene.effects)?;
        let is_turntable = scene.animation.is_none();
        let (camera, size) = picture::choose_for_frames(arguments, &mut scene)?;
        let Some(animation) = &mut scene.animation else { unreachable!("a turntable at least") };
        if is_turntable {
            warnings.note("nothing in the scene moves by itself; the camera goes once round");
        }
        let length = asked.length;
        animation.fps = length.fps.unwrap_or(animation.fps);
        animation.duration = length.duration.unwrap_or(animation.duration);
        let timeline = Timeline::new(animation.fps, animation.duration, animation.repeat).map_err(|_| {
            let what = format!("{} seconds at {} frames a second", animation.duration, animation.fps);
            Error::usage(what, "give --duration and --fps above 0, and at most a million frames")
        })?;
        let list = asked.list.cloned().unwrap_or_else(|| FrameList::range(0, timeline.last()));
        if let Some(frame) = list.frames().iter().find(|&&frame| frame < 0 || frame > timeline.last()) {
            let what =
                format!("frame {frame} is not in the animation: its frames are 0 to {}", timeline.last());
            return Err(Error::usage(what, "give other --frames, or a longer animation"));
        }
        let mut shared = prepare::settle(arguments, scene, None, camera, size)?;
        prepare::fingerprint_layers(&mut shared.settings, asked.layers);
        let mine = list.frames().iter().enumerate().filter(|(place, _)| asked.share.has(*place));
        let mine: Vec<i32> = mine.map(|(_, &frame)| frame).collect();
        // Looking takes reading every picture to its end.
        let to_do = mine.par_iter().filter(|&&frame| !(asked.is_there)(frame, &shared.settings));
        let frames: Vec<i32> = to_do.copied().collect();
        let skipped = mine.len() - frames.len();
        if frames.is_empty() {
            return Ok(Frames { stage: None, timeline, frames, skipped, shared, effects_on: 0 });
        }
        let scene = std::mem::take(&mut shared.scene);
        prepare::check_memory(&scene, &shared.choices, shared.numerics)?;
        if scene.lights.is_empty() && shared.choices.shading.uses_lights() {
            warnings.note(prepare::HEADLIGHT);
        }
        show("building", warnings);
        let lit = shared.choices.shading.uses_lights();
        let Described { camera, pipeline, structure, numerics, .. } = &shared;
        let stage =
            timed(&mut seconds.build, || Stage::new(scene, camera, lit, *pipeline, *structure, *numerics))?;
        let mut frames = Frames { stage: Some(stage), timeline, frames, skipped, shared, effects_on: 0 };
        // Errors and warnings of the first frame come before any is rendered.
        let first = frames.ready(frames.frames()[0])?;
        frames.effects_on = first.plan.effects_on().count();
        prepare::note_range(first.range.as_ref(), warnings);
        prepare::warn_of_the_world(&first.world, &first.plan, &first.choices, warnings);
        Ok(frames)
    }

    /// The frames that are to be made, in order.
    pub fn frames(&self) -> &[i32] {
        &self.frames
    }

    /// What made the frames.
    pub fn settings(&self) -> &Metadata {
        &self.shared.settings
    }

    /// Frames and times.
    pub fn timeline(&self) -> Timeline {
        self.timeline
    }

    /// The numbers that light is added up in.
    pub fn pipeline(&self) -> ColourPipeline {
        self.shared.pipeline
    }

    /// The part of the picture that is rendered.
    pub fn window(&self) -> Window {
        self.shared.window
    }

    /// Everything that the picture of a frame takes: the same, to the bit, whichever other frames there are.
    pub fn ready(&self, frame: i32) -> Result<Ready> {
        let Some(stage) = &self.stage else { unreachable!("there is a frame to make") };
        let Moment { world, camera, range, .. } = stage.at(self.timeline.time(frame))?;
        let Described { projection, size, window, choices, pipeline, settings, .. } = &self.shared;
        let view = View::new(&camera, *projection, *size)?;
        let plan = Plan::new(&world, choices)?;
        let mut settings = settings.clone();
        settings.push((FRAME.to_owned(), frame.to_string()));
        let (choices, pipeline, window) = (choices.clone(), *pipeline, *window);
        Ok(Ready { world, range, view, window, plan, choices, pipeline, share: Share::ALL, settings })
    }

    /// Makes a picture of every frame, several at once, and hands them over in order. `make` is given what is ready, and the watch
    /// for its tiles. A picture has so many channels beside its own, and takes so many bytes for each pixel.
    pub fn make_all<T: Send>(
        &self,
        pool: &rayon::ThreadPool,
        (channels, bytes_a_pixel): (u64, u64),
        interrupted: &AtomicBool,
        progress: &Progress,
        make: &(dyn Fn(i32, &Ready, &Watch) -> Result<T> + Sync),
        take: &mut (dyn FnMut(i32, T) -> Result<()> + Send),
    ) -> Result<()> {
        let window = self.window();
        let across = |size: u32| size.div_ceil(TILE) as usize;
        let tiles = across(window.width) * across(window.height);
        let (done, total) = (AtomicUsize::new(0), tiles * self.frames().len());
        let count = |_: usize, _: usize| {
            progress.steps(1 + done.fetch_add(1, Ordering::Relaxed), total, ("frames", tiles));
        };
        let watch = Watch { cancel: interrupted, progress: &count };
        develop::check_memory_of(window, channels, bytes_a_pixel)?;
        // One more than threads, so that none waits while a frame ends; fewer where memory holds fewer.
        let each = window.area().saturating_mul(bytes_a_pixel.max(12) as usize);
        let most = (MOST_BYTES / each).clamp(2, 1 + pool.current_num_threads()).min(self.frames.len());
        let bytes = |count: usize| limits::product(&[window.area() as u64, bytes_a_pixel, count as u64]);
        let in_flight = (2..=most).rev().find(|&count| limits::check(bytes(count)).is_ok()).unwrap_or(1);
        let make = |frame| make(frame, &self.ready(frame)?, &watch);
        in_order(pool, self.frames(), in_flight, interrupted, &make, take)
    }
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
    pub wanted: Wanted,
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
    let is_there = |frame: i32, settings: &Metadata| {
        let found = || look(&pictures.names.of(frame), pictures.format);
        pictures.skip_existing && found().is(prepare::fingerprint_of(settings), Some(frame))
    };
    let (share, layers) = (pictures.share, &pictures.layers);
    let asked = Asked { length, list, share, layers, is_there: &is_there };
    let frames = report.load(&pool, arguments, &asked)?;
    let skipped = match frames.skipped {
        0 => String::new(),
        n => format!("; {n} were there"),
    };
    if frames.frames().is_empty() {
        report.progress.finish(&format!("no frame to render{skipped}"));
        return Ok(());
    }
    let noticed = Noticed::default();
    let needs = |effects_on: usize| {
        let channels = pictures.wanted.channel_count(effects_on) as u64;
        let bytes = develop::bytes_a_pixel(pictures.format, &pictures.wanted, channels)
            + write::bytes_a_pixel(pictures.format, channels);
        (channels, bytes)
    };
    let make = |frame: i32, ready: &Ready, watch: &Watch| {
        let effects_on = ready.plan.effects_on().count();
        if effects_on > frames.effects_on {
            let (channels, bytes) = needs(effects_on);
            develop::check_memory_of(ready.window, channels, bytes)?;
        }
        let (picture, statistics) =
            develop::render_plainly(ready, pictures.format, &pictures.wanted, watch, Clock::Stopped)?;
        noticed.look(frame, &statistics);
        write_picture(&picture, &ready.settings, pictures.format, &pictures.names.of(frame))
    };
    let mut took = 0.0;
    let needs = needs(frames.effects_on);
    timed(&mut took, || {
        frames.make_all(&pool, needs, interrupted, &report.progress, &make, &mut |_, ()| Ok(()))
    })?;
    report.end(arguments, &noticed, pictures.strict)?;
    let ends = [frames.frames().first(), frames.frames().last()].map(|frame| *frame.unwrap_or(&0));
    let [first, last] = ends.map(|frame| pictures.names.of(frame).display().to_string());
    report.progress.finish(&format!(
        "wrote {} frame(s), {first} to {last}, in {took:.2} s{skipped}",
        frames.frames().len()
    ));
    Ok(())
}

/// Progress, warnings and times of an animation.
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
    pub fn load(&mut self, pool: &rayon::ThreadPool, arguments: &Arguments, asked: &Asked) -> Result<Frames> {
        let Report { progress, seconds, warnings, printer, with_notes } = self;
        let mut show = |phase: &str, said: &Warnings| {
            progress.pause(|| printer.print(said, *with_notes));
            progress.phase(phase);
        };
        // Building is work for the pool, too; what is shown stays on this thread.
        let frames = {
            let show = Mutex::new(&mut show);
            pool.install(|| {
                Frames::new(arguments, asked, seconds, warnings, &mut |phase, said| {
                    if let Ok(mut show) = show.lock() {
                        show(phase, said);
                    }
                })
            })?
        };
        progress.pause(|| printer.print(warnings, *with_notes));
        progress.phase("rendering");
        Ok(frames)
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
