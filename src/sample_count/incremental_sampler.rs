//! Rendering of sample ranges and error tiles, with accumulated statistics.

use std::time::Instant;

use super::tile_error::ErrorTiles;
use super::{ErrorTarget, Metric, SampledImage, StopReason};
use crate::effects::id;
use crate::error::{Error, Result};
use crate::film::{ColourPipeline, Film, TILE, Window};
use crate::job::RenderJob;
use crate::metrics::Values;
use crate::render::aov::{self, AovSelection};
use crate::render::{RenderControl, Statistics};
use crate::scene::Sampling;

/// The number of pixels whose centre ray hits an object other than the ground; of all pixels where there are none, or where
/// the background is an environment.
fn subject_pixels(job: &RenderJob, control: &RenderControl) -> Result<usize> {
    let world = &job.world;
    let all = job.window.area();
    if world.environment.as_ref().is_some_and(|environment| !environment.is_hidden) {
        return Ok(all);
    }
    let objects = aov::channels(&job.aov_source(None), &AovSelection::new(&["object".to_owned()])?, control)?;
    let ground = world.ground.map(|index| index as f32);
    let is_subject = |&&object: &&f32| object >= 0.0 && Some(object) != ground;
    let count = objects[0].values.iter().filter(is_subject).count();
    Ok(if count == 0 { all } else { count })
}

/// Renders ranges of the picture's samples, and accumulates their statistics.
pub(crate) struct IncrementalSampler<'a> {
    job: &'a mut RenderJob,
    control: &'a RenderControl<'a>,
    start: Instant,
    sampling: Sampling,
    /// Encoding of the film.
    pub values: Values,
    pub tiles: ErrorTiles,
    statistics: Option<Statistics>,
}

impl<'a> IncrementalSampler<'a> {
    pub(crate) fn new(job: &'a mut RenderJob, control: &'a RenderControl<'a>) -> Result<Self> {
        let sampling = job.choices.sampling;
        let values = match job.pipeline() {
            ColourPipeline::Linear => Values::Linear,
            ColourPipeline::Display | ColourPipeline::U8 => Values::Display,
        };
        let tiles = ErrorTiles::new(job.window.width, job.window.height);
        let start = Instant::now();
        let tiles = tiles.with_subject(subject_pixels(job, control)?);
        job.set_sampling(sampling.part(0, 1))?;
        if !job.plan.takes_samples() {
            let effect = id::ANTIALIASING;
            let what = format!("an error or a time is reached by samples, and there is no {effect}");
            let hint = format!("leave out --without {effect}, or --accuracy and --budget");
            return Err(Error::usage(what, hint));
        }
        Ok(IncrementalSampler { job, control, start, sampling, values, tiles, statistics: None })
    }

    /// Renders the pixel centres.
    pub(crate) fn render_centres(&mut self) -> Result<Vec<[f32; 3]>> {
        let mut pixels = self.black();
        self.render(
            Sampling { seed: self.sampling.seed, sampler: self.sampling.sampler, ..Sampling::default() },
            &|_| true,
            &mut pixels,
        )?;
        Ok(pixels)
    }

    /// Mean of the samples `from..to` of the whole picture.
    pub(crate) fn render_samples(&mut self, from: u32, to: u32) -> Result<Vec<[f32; 3]>> {
        let mut pixels = self.black();
        self.render_tiles((from, to), &|_| true, &mut pixels)?;
        Ok(pixels)
    }

    /// Writes the mean of the samples `from..to` of the selected error tiles to `pixels`; other pixels stay unchanged.
    pub(crate) fn render_tiles(
        &mut self,
        (from, to): (u32, u32),
        selected: &(dyn Fn(usize) -> bool + Sync),
        pixels: &mut [[f32; 3]],
    ) -> Result<()> {
        self.render(self.sampling.part(from, to), selected, pixels)
    }

    pub(crate) fn black(&self) -> Vec<[f32; 3]> {
        vec![[0.0; 3]; self.job.window.area()]
    }

    fn render(
        &mut self,
        sampling: Sampling,
        selected: &(dyn Fn(usize) -> bool + Sync),
        pixels: &mut [[f32; 3]],
    ) -> Result<()> {
        self.job.set_sampling(sampling)?;
        let (window, tiles) = (self.job.window, self.tiles);
        let is_selected = |tile: Window| selected(tiles.index_of(tile.x - window.x, tile.y - window.y));
        let (film, statistics): (Film, _) =
            self.job.render_selected(|_, tile| is_selected(tile), self.control)?;
        match &mut self.statistics {
            Some(sum) => sum.add(&statistics),
            none => *none = Some(statistics),
        }
        for (y, row) in (0..).zip(pixels.chunks_mut(window.width as usize)) {
            for (i, (own, part)) in (0..).zip(row.chunks_mut(TILE as usize).zip(film.row(y))) {
                if selected(tiles.index_of(i * TILE, y)) {
                    own.copy_from_slice(part);
                }
            }
        }
        Ok(())
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.statistics.as_ref().is_none_or(|statistics| statistics.non_finite.0 == 0)
    }

    /// Number of samples that fit into the remaining time, if the time so far was that of `samples`.
    pub(crate) fn samples_in_time(&self, samples: u32, target: &ErrorTarget) -> f64 {
        let spent = self.start.elapsed().as_secs_f64();
        let left = target.seconds.map(|seconds| (seconds - spent).max(0.0));
        left.map_or(f64::INFINITY, |left| 0.9 * left * f64::from(samples) / spent)
    }

    /// Whether `samples` fit into the remaining time after the pilot, which costs about two samples.
    pub(crate) fn has_time_for(&self, samples: u32, target: &ErrorTarget) -> bool {
        f64::from(samples) <= self.samples_in_time(2, target)
    }

    /// Sets the job's sampling to `samples`, and returns the picture.
    pub(crate) fn finish(
        self,
        pixels: Vec<[f32; 3]>,
        samples: u32,
        estimate: (Metric, f64),
        reason: StopReason,
    ) -> Result<SampledImage> {
        let Sampling { seed, sampler, .. } = self.sampling;
        self.job.set_sampling(match samples {
            1 => Sampling { seed, sampler, ..Sampling::default() },
            samples => Sampling { first: None, total: None, ..self.sampling.part(0, samples) },
        })?;
        let Some(statistics) = self.statistics else {
            let hint = String::new();
            return Err(Error::Failed { what: "nothing was rendered".into(), hint });
        };
        Ok(SampledImage { pixels, statistics, samples, estimate, reason })
    }
}
