//! Rendering: tiles in parallel, each through the stages of the plan.
//!
//! The whole way from a tile to its pixels is `render_tile`. Every pixel depends on nothing but its own rays, so the
//! picture is the same to the bit for any number of threads, any order of tiles and any part of the picture.

pub mod aov;
mod statistics;

pub use statistics::{Bill, StageTime, Statistics, grouped};

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;

use rayon::prelude::*;

use crate::effects::Plan;
use crate::effects::tile::{Context, Tile};
use crate::error::{Error, Result};
use crate::film::{self, ColourPipeline, Film, FilmTile, Pixel, Window};
use crate::world::{View, World, widely};

/// How a running render is watched and stopped.
pub struct RenderControl<'a> {
    /// Set by anyone to stop the render within a tile.
    pub cancel: &'a AtomicBool,
    /// Called after every tile, from any thread, with the tiles done and all tiles.
    pub progress: &'a (dyn Fn(usize, usize) + Sync),
    /// Whether [`Statistics::stages`] has the time of each stage. Reading the clock costs a few hundredths of a quick render.
    pub time_stages: bool,
}

/// Nothing is watched, and nothing stops the render.
impl Default for RenderControl<'_> {
    fn default() -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        RenderControl { cancel: &NEVER, progress: &|_, _| (), time_stages: false }
    }
}

/// Renders the part `window` of the picture that `view` was made for, on the current rayon pool, onto a film of any pixels. Only the
/// tiles that `is_selected` accepts, by their place in the order of tiles and by the pixels they cover, are rendered; the others stay black.
///
/// # Errors
/// [`Error::Interrupted`] when cancelled, [`Error::Failed`] where there is not enough memory for the picture.
pub fn render<P: Pixel>(
    world: &World,
    view: &View,
    plan: &Plan,
    window: Window,
    is_selected: impl Fn(usize, Window) -> bool,
    control: &RenderControl,
) -> Result<(Film<P>, Statistics)> {
    let mut film = Film::new(window)?;
    let context = Context { world, view };
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
        let mut worker = taken.unwrap_or_else(|| Box::new(Worker::new(plan)));
        render_tile(plan, &context, &mut tile, &mut worker, control);
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

/// What a thread keeps from tile to tile.
struct Worker {
    tile: Tile,
    /// Time spent in each stage.
    times: Vec<std::time::Duration>,
    /// Pixels that are not numbers: their columns and rows.
    non_finite: Vec<(u32, u32)>,
}

impl Worker {
    fn new(plan: &Plan) -> Self {
        Worker {
            tile: Tile::default(),
            times: vec![Default::default(); plan.steps().len()],
            non_finite: Vec::new(),
        }
    }
}

/// A tile: every stage of the plan in order, again while there are samples to take, then the pixels.
fn render_tile<P: Pixel>(
    plan: &Plan,
    context: &Context,
    film: &mut FilmTile<P>,
    worker: &mut Worker,
    control: &RenderControl,
) {
    let Worker { tile, times, non_finite } = worker;
    tile.start(film.window);
    let now = || control.time_stages.then(Instant::now);
    let mut last = now();
    loop {
        plan.run(tile, context, |step| {
            let now = now();
            if let (Some(last), Some(now)) = (last, now) {
                times[step] += now - last;
            }
            last = now;
        });
        if !tile.again {
            break;
        }
        if control.cancel.load(Ordering::Relaxed) {
            return;
        }
    }
    let colours = &tile.pixels;
    non_finite.extend(widely(
        #[inline(always)]
        || film::non_finite(film.window, colours),
    ));
    // Pipelines are told apart once, not for every pixel.
    match context.world.pipeline {
        ColourPipeline::Linear => P::develop(colours, ColourPipeline::Linear, film.pixels),
        _ => widely(
            #[inline(always)]
            || P::develop(colours, ColourPipeline::Display, film.pixels),
        ),
    }
}
