//! Rendering of sample ranges, with accumulated statistics.

use std::time::Instant;

use super::split_image::{Halves, SplitImage};
use super::{ErrorTarget, Metric, SampledImage, StopReason};
use kiln::effects::id;
use kiln::effects::random::other_seed;
use kiln::error::{Error, Result};
use kiln::film::{ColourPipeline, Film};
use kiln::job::RenderJob;
use kiln::metrics::Values;
use kiln::render::{RenderControl, Statistics};
use kiln::scene::Sampling;

/// The number of pixels whose centre ray hits an object other than the ground; of all pixels where there are none, or
/// where the background is an environment.
fn subject_pixels(job: &RenderJob, control: &RenderControl) -> Result<usize> {
    let all = job.window.area();
    if job.world.shows_environment() {
        return Ok(all);
    }
    Ok(job.subject(control)?.into_iter().filter(|is_shown| *is_shown).count())
}

/// Renders ranges of the picture's samples, and accumulates their statistics.
pub(crate) struct IncrementalSampler<'a> {
    job: &'a mut RenderJob,
    control: &'a RenderControl<'a>,
    start: Instant,
    sampling: Sampling,
    /// Encoding of the film.
    pub values: Values,
    /// The number of pixels that mean errors are of.
    pub subject_pixels: usize,
    statistics: Option<Statistics>,
}

impl<'a> IncrementalSampler<'a> {
    pub(crate) fn new(job: &'a mut RenderJob, control: &'a RenderControl<'a>) -> Result<Self> {
        let sampling = job.plan_settings.sampling;
        let values = match job.pipeline() {
            ColourPipeline::Linear => Values::Linear,
            ColourPipeline::Display | ColourPipeline::U8 => Values::Display,
        };
        let start = Instant::now();
        let subject_pixels = subject_pixels(job, control)?;
        job.set_sampling(sampling.part(0, 1))?;
        if !job.plan.takes_samples() {
            let effect = id::ANTIALIASING;
            let what = format!("an error or a time is reached by samples, and there is no {effect}");
            let hint = format!("leave out --without {effect}, or --accuracy and --budget");
            return Err(Error::usage(what, hint));
        }
        Ok(IncrementalSampler { job, control, start, sampling, values, subject_pixels, statistics: None })
    }

    /// Width of the picture in pixels.
    pub(crate) fn width(&self) -> usize {
        self.job.window.width as usize
    }

    /// Mean of the samples `from..to` of each half.
    pub(crate) fn render_samples(&mut self, from: u32, to: u32) -> Result<Halves> {
        let mut halves = Halves::default();
        let seed = self.sampling.seed;
        for (half, seed) in halves.iter_mut().zip([seed, other_seed(seed)]) {
            self.job.set_sampling(Sampling { seed, ..self.sampling.part(from, to) })?;
            let (film, statistics): (Film, _) = self.job.render(self.control)?;
            match &mut self.statistics {
                Some(sum) => sum.add(&statistics),
                none => *none = Some(statistics),
            }
            half.extend(film.rows());
        }
        Ok(halves)
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.statistics.as_ref().is_none_or(|statistics| statistics.non_finite.is_empty())
    }

    /// Seconds so far.
    pub(crate) fn seconds(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    /// Number of samples that fit into the remaining time, if `samples` take `spent` seconds.
    pub(crate) fn samples_in_time(&self, samples: u32, spent: f64, target: &ErrorTarget) -> f64 {
        let left = target.seconds.map(|seconds| (seconds - self.seconds()).max(0.0));
        left.map_or(f64::INFINITY, |left| 0.9 * left * f64::from(samples) / spent)
    }

    /// Sets the job's sampling to that of the picture, and returns it.
    pub(crate) fn finish(
        self,
        image: SplitImage,
        estimate: (Metric, f64),
        reason: StopReason,
    ) -> Result<SampledImage> {
        let SplitImage { pixels, samples, .. } = image;
        self.job.set_sampling(Sampling { first: None, total: None, ..self.sampling.part(0, samples) })?;
        let Some(statistics) = self.statistics else {
            let hint = String::new();
            return Err(Error::Failed { what: "nothing was rendered".into(), hint });
        };
        Ok(SampledImage { pixels, statistics, samples, estimate, reason })
    }
}
