//! The light that the limits of a path-traced picture leave out: those on bounces, and the clamp.
//!
//! The same samples are rendered with the limits and without. Random numbers depend on pixel, sample, generation and
//! seed, not on limits, so both paths of a sample are the same up to the vertex at which a limit ends one: where none
//! does, their difference is 0. Beyond it, Russian roulette alone ends paths, which is unbiased.

use std::fmt;
use std::sync::Arc;

use glam::DVec3;

use kiln::effects::random::other_seed;
use kiln::effects::{PathSettings, PlanSettings, id};
use kiln::error::Result;
use kiln::film::colour::luminance;
use kiln::job::RenderJob;
use kiln::render::RenderControl;
use kiln::scene::Sampling;

/// The most samples of a pixel in each half of the measurement: shares are those of the picture, not of single pixels.
const MAX_SAMPLES: u32 = 32;

/// The light left out of a picture, over all light: that of the picture without limits. In luminance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightLeftOut {
    /// By the limits on bounces: light beyond them without a clamp.
    pub by_depth: Share,
    /// By the clamp: of light within the limits on bounces.
    pub by_clamp: Share,
}

/// A share of the light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Share {
    /// The estimate.
    pub mean: f64,
    /// Its standard error.
    pub error: f64,
}

impl fmt::Display for Share {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = usize::from(self.error < 0.005) + usize::from(self.error < 0.0005);
        write!(f, "{:.digits$} ± {:.digits$} %", 100.0 * self.mean, 100.0 * self.error)
    }
}

/// Measures the light left out of a picture by two halves of its samples, with different seeds. All pixels take the
/// same number of samples, also where the picture is adaptive. `None` for a picture without paths.
///
/// # Errors
/// As [`RenderJob::render`].
pub fn measure(job: &RenderJob, control: &RenderControl) -> Result<Option<LightLeftOut>> {
    if !job.plan.transport.traces_paths() {
        return Ok(None);
    }
    let sampling = job.plan_settings.sampling;
    let count = (sampling.samples_taken() / 2).clamp(1, MAX_SAMPLES);
    let half = |seed| Half::render(job, Sampling { seed, ..sampling.part(0, count) }, control);
    let halves = [half(sampling.seed)?, half(other_seed(sampling.seed))?];
    Ok(Some(LightLeftOut { by_depth: share(&halves, 0), by_clamp: share(&halves, 1) }))
}

/// The same picture without limits on bounces and without a clamp. Paths take the same random numbers, and Russian
/// roulette starts at the same vertex.
///
/// # Errors
/// As [`RenderJob::with_plan_settings`].
pub fn without_limits(job: &RenderJob) -> Result<RenderJob> {
    let mut settings = PlanSettings { clamp: None, ..job.plan_settings.clone() };
    settings.with.push(id::PATH.with_value(PathSettings::MAX_DEPTH));
    settings.path.depth_specular = None;
    settings.path.roulette_from = settings.path.roulette_from.min(job.plan.bounce_limits().first());
    job.with_plan_settings(settings)
}

/// The luminance of each pixel by half of the samples: of all light, of that within the limits on bounces, and of that
/// clamped as in the picture.
struct Half([Vec<f64>; 3]);

impl Half {
    fn render(job: &RenderJob, sampling: Sampling, control: &RenderControl) -> Result<Self> {
        let luminances = |job: &RenderJob| -> Result<Vec<f64>> {
            let (film, _) = job.render::<[f32; 3]>(control)?;
            Ok(film.rows().map(|pixel| luminance(DVec3::from(pixel.map(f64::from)))).collect())
        };
        let settings = PlanSettings { sampling, ..job.plan_settings.clone() };
        let mut job = job.with_plan_settings(settings.clone())?;
        // A backdrop is no light.
        if let Some(world) = job.world.without_backdrop() {
            job.world = Arc::new(world);
        }
        let all = luminances(&without_limits(&job)?)?;
        let unclamped = job.with_plan_settings(PlanSettings { clamp: None, ..settings })?;
        let within_depth = luminances(&unclamped)?;
        let of_picture = match job.plan_settings.clamp {
            Some(_) => luminances(&job)?,
            None => within_depth.clone(),
        };
        Ok(Half([all, within_depth, of_picture]))
    }

    /// What a pixel has in a picture and lacks in the next one.
    fn lost(&self, picture: usize, pixel: usize) -> f64 {
        self.0[picture][pixel] - self.0[picture + 1][pixel]
    }
}

/// What all pixels have in a picture of each half and lack in the next one, over all light.
///
/// Halves and pixels are independent of each other. So with the difference d of a pixel between the halves, d^2 is an
/// unbiased estimate of the variance of their sum, and the sum of all d^2 that of the sum over pixels. For the share r,
/// d is that of what the pixel lacks minus r times its light (the derivative of a ratio).
fn share(halves: &[Half; 2], picture: usize) -> Share {
    let pixels = 0..halves[0].0[0].len();
    let all: f64 = halves.iter().flat_map(|half| &half.0[0]).sum();
    let lost: f64 = halves.iter().flat_map(|half| pixels.clone().map(|i| half.lost(picture, i))).sum();
    // Without light nothing is lost.
    let all = all.max(f64::MIN_POSITIVE);
    let mean = lost / all;
    let deviation = |half: &Half, i: usize| half.lost(picture, i) - mean * half.0[0][i];
    let squares = pixels.map(|i| (deviation(&halves[0], i) - deviation(&halves[1], i)).powi(2));
    Share { mean, error: squares.sum::<f64>().sqrt() / all }
}
