//! Rendering: tiles in parallel, each through the stages of the plan.
//!
//! `render_tile` takes a tile from rays to pixels. A pixel depends on its own rays alone, so the picture has the same
//! bits for any number of threads, any order of tiles and any crop.

pub mod aov;
mod cryptomatte;
mod features;
mod statistics;
mod thread_clock;

use statistics::StageCost;
pub use statistics::{EffectCost, StageTime, Statistics, grouped};
pub use thread_clock::HAS_THREAD_TIME;
use thread_clock::ThreadClock;

use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::effects::Plan;
use crate::effects::recorder::Recorder;
use crate::effects::tile::{RenderContext, Tile};
use crate::error::{Error, Result};
use crate::film::{self, ColourPipeline, DisplayTransform, Film, FilmTile, Pixel, Window};
use crate::world::{View, World, simd};

/// Cancellation and progress of a render.
pub struct RenderControl<'a> {
    /// Set to cancel the render; it stops within a tile.
    pub cancel: &'a AtomicBool,
    /// Called after every tile, from any thread, with the number of finished tiles and of all tiles.
    pub progress: &'a (dyn Fn(usize, usize) + Sync),
    /// Whether the processor time of each stage is measured ([`Statistics::stages`]), which makes short renders a few
    /// percent slower.
    pub time_stages: bool,
}

/// No cancellation, no progress, no times.
impl Default for RenderControl<'_> {
    fn default() -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        RenderControl { cancel: &NEVER, progress: &|_, _| (), time_stages: false }
    }
}

/// [`render_displayed`] without exposure and tone map.
///
/// # Errors
/// As [`render_displayed`].
pub fn render<P: Pixel>(
    world: &World,
    view: &View,
    plan: &Plan,
    window: Window,
    is_selected: impl Fn(usize, Window) -> bool,
    control: &RenderControl,
) -> Result<(Film<P>, Statistics)> {
    let context = RenderContext { world, view, display: DisplayTransform::default(), is_displayed: true };
    render_displayed(&context, plan, window, is_selected, control)
}

/// Renders the part `window` of the picture of the context's view, on the current rayon pool. Only the tiles that `is_selected`
/// accepts, by their index and pixels, are rendered; the others stay black. Display values are those after `context.display`.
///
/// # Errors
/// [`Error::Interrupted`] when cancelled, [`Error::Memory`] where there is not enough memory for the picture.
pub fn render_displayed<P: Pixel>(
    context: &RenderContext,
    plan: &Plan,
    window: Window,
    is_selected: impl Fn(usize, Window) -> bool,
    control: &RenderControl,
) -> Result<(Film<P>, Statistics)> {
    let mut film = Film::new(window)?;
    let idle: Mutex<Vec<Box<Worker>>> = Mutex::new(Vec::new());
    let done = AtomicUsize::new(0);
    let mut tiles = film.tiles_mut();
    let mut places = 0..;
    tiles.retain(|tile| places.next().is_some_and(|place| is_selected(place, tile.window)));
    let total = tiles.len();
    tiles.into_par_iter().for_each(|mut tile| {
        if control.cancel.load(Ordering::Relaxed) {
            return;
        }
        let taken = idle.lock().ok().and_then(|mut idle| idle.pop());
        let mut worker = taken.unwrap_or_else(|| {
            Box::new(Worker::new(plan, context, P::HAS_ALPHA || context.world.backdrop.is_some()))
        });
        render_tile(plan, context, &mut tile, &mut worker, control);
        if let Ok(mut idle) = idle.lock() {
            idle.push(worker);
        }
        (control.progress)(1 + done.fetch_add(1, Ordering::Relaxed), total);
    });
    if control.cancel.load(Ordering::Relaxed) {
        return Err(Error::Interrupted);
    }
    let workers = idle.into_inner().unwrap_or_default();
    let statistics = Statistics::gather(plan, &workers, control.time_stages);
    Ok((film, statistics))
}

/// Renders a pixel of the picture of [`render_displayed`], with a record of the samples whose index is in `traced`.
pub fn record_pixel<P: Pixel>(
    context: &RenderContext,
    plan: &Plan,
    [x, y]: [u32; 2],
    traced: Range<u32>,
) -> (P, Recorder) {
    let mut worker = Worker::new(plan, context, P::HAS_ALPHA || context.world.backdrop.is_some());
    worker.tile.recorder = Some(Box::new(Recorder::new([x, y], traced)));
    let mut pixel = P::zeroed();
    let window = Window { x, y, width: 1, height: 1 };
    let mut tile = FilmTile { window, pixels: std::slice::from_mut(&mut pixel) };
    render_tile(plan, context, &mut tile, &mut worker, &RenderControl::default());
    (pixel, worker.tile.recorder.map_or_else(Recorder::default, |recorder| *recorder))
}

/// The working set of a thread, reused for many tiles.
struct Worker {
    tile: Tile,
    /// What each stage of the plan took.
    costs: Vec<StageCost>,
    /// Columns and rows of the pixels that are not finite.
    non_finite: Vec<(u32, u32)>,
}

impl Worker {
    fn new(plan: &Plan, context: &RenderContext, has_alpha: bool) -> Self {
        Worker {
            tile: Tile::for_picture(context, has_alpha),
            costs: vec![StageCost::default(); plan.stages().len()],
            non_finite: Vec::new(),
        }
    }
}

/// Composites the light of a tile with the backdrop and unlit surfaces, each by its coverage. Stores film values in the
/// pixels of the tile.
fn composite(context: &RenderContext, has_alpha: bool, tile: &mut Tile) {
    let Tile { pixels, coverage, shown, .. } = tile;
    let backdrop = context.world.backdrop.filter(|_| !has_alpha);
    let is_kept = context.is_displayed && !context.display.is_identity();
    if backdrop.is_none() && shown.is_none() {
        return;
    }
    for (i, pixel) in pixels.iter_mut().enumerate() {
        let covered = coverage.as_ref().map_or(1.0, |coverage| f64::from(coverage[i]));
        let [r, g, b, part] = shown.as_ref().map_or([0.0; 4], |shown| shown[i]);
        let behind = backdrop.filter(|_| covered < 1.0);
        if behind.is_none() && part == 0.0 || has_alpha && covered == 0.0 {
            continue;
        }
        let (light, own) = (Vec3::from(*pixel).as_dvec3(), DVec3::new(r.into(), g.into(), b.into()));
        *pixel = if is_kept {
            let lit = covered - f64::from(part).clamp(0.0, covered);
            let displayed = own + behind.unwrap_or_default() * (1.0 - covered);
            let all = context.display.composite(light - own * context.display.white(), lit, displayed);
            // Colours of pictures with an alpha channel are unassociated.
            DisplayTransform::keep(if has_alpha { all / covered } else { all })
        } else {
            context.display.over(light, covered, behind.unwrap_or_default()).as_vec3().to_array()
        };
    }
}

/// Renders a tile: runs the stages of the plan, repeatedly while more samples are needed, then converts the pixels for
/// the film.
fn render_tile<P: Pixel>(
    plan: &Plan,
    context: &RenderContext,
    film: &mut FilmTile<P>,
    worker: &mut Worker,
    control: &RenderControl,
) {
    let Worker { tile, costs, non_finite } = worker;
    tile.start(film.window);
    let mut clock = control.time_stages.then(|| (ThreadClock::start(), plan.rays_cast(tile)));
    loop {
        plan.run(tile, context, |stage, tile| {
            if let Some((clock, before)) = &mut clock {
                let cast = plan.rays_cast(tile);
                costs[stage].add(clock.lap(), std::mem::replace(before, cast), cast);
            }
        });
        if !tile.needs_more_samples {
            break;
        }
        if control.cancel.load(Ordering::Relaxed) {
            return;
        }
    }
    tile.record(Recorder::add_filtered);
    if let Some(coverage) = &mut tile.coverage {
        coverage.iter_mut().for_each(|part| *part = part.clamp(0.0, 1.0));
        P::set_alpha(film.pixels, coverage);
    }
    composite(context, P::HAS_ALPHA, tile);
    let colours = &tile.pixels;
    non_finite.extend(simd!(film::non_finite(film.window, colours)));
    // Pipeline and identity are passed as constants, so that the loop has no branch on them. `U8` develops as `Display` does.
    let (window, none) = (film.window, DisplayTransform::default());
    match context.world.pipeline {
        pipeline if context.display.rounding().is_dithered => {
            P::develop(colours, window, pipeline, context.display, film.pixels);
        }
        ColourPipeline::Linear if context.display.is_identity() => {
            P::develop(colours, window, ColourPipeline::Linear, none, film.pixels);
        }
        ColourPipeline::Linear => {
            P::develop(colours, window, ColourPipeline::Linear, context.display, film.pixels);
        }
        _ => simd!(P::develop(colours, window, ColourPipeline::Display, none, film.pixels)),
    }
}
