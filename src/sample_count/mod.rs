//! Sample counts for targets: rendering with as many samples as an error or a time limit requires, with an estimate of
//! the remaining error.
//!
//! The reference ("truth") is the antialiased picture: the limit of the same filter, effects, bounces and numerics for
//! ever more samples. First the pixel centres are rendered and a few error tiles are sampled, which is sufficient for
//! many targets (`pilot`). Then the number of samples of the whole picture is doubled until the target is reached. Each
//! doubling renders the next range of the sample sequence; the means of both halves are kept, and the error is
//! estimated from their difference without further rays (`split_error`), on error tiles selected by importance sampling
//! (`tile_error`).
//!
//! Mean errors are those of the pixels whose centre ray hits an object other than the ground, so that a large
//! background does not hide a jagged object; of all pixels where there are none, or where an environment is seen.
//!
//! Let v(n) be the variance of the mean of n samples, r = v(2n) / v(n), and A and B the means of the halves of 2n
//! samples. From v(2n) = (v(n) + cov) / 2 and E|A - B|^2 = 2 (v(n) - cov) follows v(2n) = E|A - B|^2 * r / (4 (1 - r)).
//! Independent samples have r = 1/2; samples stratified over edges have r = 2^(-3/2) (Mitchell, Consequences of
//! Stratified Sampling in Graphics, SIGGRAPH 1996, section 3). r is measured as the ratio of E|A - B|^2 of successive
//! doublings, and clamped to these bounds. Other metrics than the mean square are evaluated between the picture and the
//! picture plus sqrt(r / (4 (1 - r))) (A - B).

mod incremental_sampler;
mod pilot;
mod split_error;
mod tile_error;

use crate::error::Result;
use crate::job::RenderJob;
use crate::metrics::mean_flip;
use crate::render::{RenderControl, Statistics};
use incremental_sampler::IncrementalSampler;
use pilot::{Pilot, PilotResult};
use split_error::{ErrorRange, SplitImage};
use tile_error::ErrorTiles;

/// Maximum number of samples per pixel.
const MAX_SAMPLES: u32 = 1 << 14;

/// Safety factor by which an estimate must be below the bound.
const MARGIN: f64 = 1.05;

/// Safety factor for the largest error, which depends on a few pixels whose halves may agree by chance.
const MARGIN_OF_MAX: f64 = 1.5;

/// Factor by which 50 % more samples reduce an error at least. The exponent -3/4 of stratified samples gives 0.74; but
/// sample counts other than powers of two are stratified less evenly.
const HALF_MORE_FACTOR: f64 = 0.87;

/// Factor between the smallest probable and the extrapolated error. If even the former exceeds the bound, the error is
/// not measured.
const MEASURE_FACTOR: f64 = 0.8;

/// Like [`MEASURE_FACTOR`], for an error predicted by the pilot.
const PREDICTION_FACTOR: f64 = 0.5;

/// Error metric between display values (1 is white) before rounding to 8 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Metric {
    /// Mean LDR-FLIP.
    Flip,
    /// Root mean square difference over pixels and channels.
    Rmse,
    /// Largest channel difference.
    Max,
}

impl Metric {
    /// All metrics.
    pub const ALL: [Metric; 3] = [Metric::Flip, Metric::Rmse, Metric::Max];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Metric::Flip => "FLIP",
            Metric::Rmse => "RMSE",
            Metric::Max => "MAX",
        }
    }

    /// Contribution of a part of the picture to the error, see [`Metric::error_of_total`].
    fn contribution(self, a: &[[f32; 3]], b: &[[f32; 3]], width: u32) -> f64 {
        match self {
            Metric::Flip => mean_flip(a, b, width) * a.len() as f64,
            Metric::Rmse => sum_of_squares(a, b),
            Metric::Max => {
                let difference = |(a, b): (&f32, &f32)| f64::from((a - b).abs());
                a.as_flattened().iter().zip(b.as_flattened()).map(difference).fold(0.0, f64::max)
            }
        }
    }

    /// Error from the sum of the contributions of all parts, or from their maximum for [`Metric::Max`].
    fn error_of_total(self, total: f64, tiles: &ErrorTiles) -> f64 {
        match self {
            Metric::Flip => total / tiles.subject_pixels(),
            Metric::Rmse => (total / (3.0 * tiles.subject_pixels())).sqrt(),
            Metric::Max => total,
        }
    }

    /// Approximate contribution of a channel difference; FLIP has the exponent 0.7.
    #[inline(always)]
    fn weight(self, difference: f32) -> f32 {
        let root = difference.abs().sqrt();
        if self == Metric::Flip { root * root.sqrt() } else { difference * difference }
    }

    fn margin(self) -> f64 {
        if self == Metric::Max { MARGIN_OF_MAX } else { MARGIN }
    }
}

/// Target of the sample count: an error bound, a time limit or both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorTarget {
    /// Metric and its upper bound.
    pub accuracy: Option<(Metric, f64)>,
    /// Time limit for rendering in seconds.
    pub seconds: Option<f64>,
}

/// A picture rendered to a target.
pub struct SampledImage {
    /// Pixels in the encoding of the pipeline; row 0 is the top row.
    pub pixels: Vec<[f32; 3]>,
    /// Sum of the statistics of all renders.
    pub statistics: Statistics,
    /// Samples per pixel; 1 is the pixel centre.
    pub samples: u32,
    /// Metric of the target, otherwise FLIP, and the estimated error.
    pub estimate: (Metric, f64),
    /// Why sampling stopped.
    pub reason: StopReason,
}

/// Why sampling stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopReason {
    /// The error is below the bound.
    Reached,
    /// The time limit was reached.
    Time,
    /// The maximum number of samples was reached.
    MaxSamples,
    /// Pixels are not finite, so that no error can be estimated.
    NotFinite,
}

impl SampledImage {
    /// Sample count, estimated error and stop reason in one line.
    pub fn summary(&self, target: &ErrorTarget) -> String {
        let (metric, error) = self.estimate;
        if self.reason == StopReason::NotFinite {
            return format!("{} samples a pixel: no estimate of a picture that is not finite", self.samples);
        }
        let bound = target.accuracy.map(|(_, value)| format!("; asked for {value}")).unwrap_or_default();
        let why = match (self.reason, target.seconds) {
            (StopReason::Time, Some(seconds)) => format!("; more do not fit into {seconds} s"),
            (StopReason::MaxSamples, _) => "; there are no more".into(),
            _ => String::new(),
        };
        let name = metric.name();
        let samples = match self.samples {
            1 => "1 sample a pixel, through its centre".into(),
            samples => format!("{samples} samples a pixel"),
        };
        format!("{samples}: {name} to the truth is about {error:.2e}{bound}{why}")
    }
}

/// Sum of the squared channel differences of two images.
fn sum_of_squares(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    pairs.map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2)).sum()
}

/// Upper bound of an error.
#[derive(Debug, Clone, Copy)]
struct ErrorBound {
    metric: Metric,
    value: f64,
}

impl ErrorBound {
    fn is_met(&self, error: &ErrorRange) -> bool {
        error.high * self.metric.margin() <= self.value
    }

    /// Whether the bound is certainly met or certainly exceeded.
    fn is_decided(&self, error: &ErrorRange) -> bool {
        self.is_met(error) || error.low * self.metric.margin() > self.value
    }

    /// Whether a predicted error is so far above the bound that it need not be measured.
    fn is_far_exceeded(&self, expected: &ErrorRange) -> bool {
        expected.low * PREDICTION_FACTOR > self.value
    }
}

/// Upper bound of the memory for rendering to a target, in bytes per pixel: nine images of 12 bytes. Measured by peak
/// memory: up to 90.
pub const BYTES_PER_PIXEL: u64 = 108;

/// Renders to a target on the current rayon pool. Sets the job's sampling to that of the returned picture.
///
/// # Errors
/// Those of [`RenderJob::render`]; [`crate::error::Error::Usage`] if antialiasing is off.
pub fn render(job: &mut RenderJob, target: &ErrorTarget, control: &RenderControl) -> Result<SampledImage> {
    let mut sampler = IncrementalSampler::new(job, control)?;
    let bound = target.accuracy.map(|(metric, value)| ErrorBound { metric, value });
    // A maximum cannot be estimated from a few tiles.
    let Some(bound) = bound.filter(|bound| bound.metric != Metric::Max) else {
        let first = sampler.render_samples(0, 1)?;
        let second = sampler.render_samples(1, 2)?;
        return refine(sampler, target, SplitImage::of_one(first).doubled_with(second), None);
    };
    let (pilot, result) = Pilot::new(&mut sampler, bound)?;
    if !sampler.is_finite() {
        return sampler.finish(pilot.into_centres(), 1, (bound.metric, f64::NAN), StopReason::NotFinite);
    }
    match result {
        PilotResult::Enough(0, error) => {
            sampler.finish(pilot.into_centres(), 1, (bound.metric, error.estimate), StopReason::Reached)
        }
        PilotResult::Enough(samples, error) if sampler.has_time_for(samples, target) => {
            let pixels = pilot.into_few(&mut sampler, samples)?;
            let reason = if sampler.is_finite() { StopReason::Reached } else { StopReason::NotFinite };
            sampler.finish(pixels, samples, (bound.metric, error.estimate), reason)
        }
        PilotResult::Insufficient(error) if sampler.has_time_for(4, target) => {
            let image = pilot.into_four(&mut sampler)?;
            let is_far = bound.is_far_exceeded(&error);
            let last = is_far.then(|| (error.estimate, image.rms_error()));
            refine(sampler, target, image, last)
        }
        PilotResult::Enough(_, error) | PilotResult::Insufficient(error) => {
            // Fewer than four samples are hardly better than the pixel centres, which are rendered already.
            sampler.finish(pilot.into_centres(), 1, (bound.metric, 2.0 * error.estimate), StopReason::Time)
        }
    }
}

/// Adds samples to `image` until the target is reached. `last` is the last measured or predicted error and the RMS
/// error estimate of the image that it belongs to.
fn refine(
    mut sampler: IncrementalSampler,
    target: &ErrorTarget,
    mut image: SplitImage,
    mut last: Option<(f64, f64)>,
) -> Result<SampledImage> {
    let metric = target.accuracy.map_or(Metric::Flip, |(metric, _)| metric);
    let bound = target.accuracy.map(|(metric, value)| ErrorBound { metric, value });
    let is_met = |error: &ErrorRange| bound.is_some_and(|bound| bound.is_met(error));
    let (tiles, values) = (sampler.tiles, sampler.values);
    // Whether 50 % more samples suffice must be decided, too.
    let is_decided = |range: &ErrorRange| {
        bound.is_none_or(|bound| {
            bound.is_met(range)
                || bound.is_decided(range) && bound.is_decided(&range.scaled(HALF_MORE_FACTOR))
        })
    };
    let measure = |image: &SplitImage| image.error((metric, values), &tiles, is_decided);
    let (error, reason) = loop {
        let samples = image.samples;
        if !sampler.is_finite() {
            break (f64::NAN, StopReason::NotFinite);
        }

        // Measuring costs as much as some samples, so the error is measured only if the bound may be met, provided that
        // it falls like the RMS error; perceived errors fall more slowly, or hardly faster.
        let extrapolated =
            |(error, rms): (f64, f64)| ErrorRange::exact(error * image.rms_error() / rms * HALF_MORE_FACTOR);
        let is_near = |last: Option<(f64, f64)>| {
            last.is_none_or(|last| is_met(&extrapolated(last).scaled(MEASURE_FACTOR)))
        };
        let measured = (bound.is_some() && is_near(last)).then(|| measure(&image));
        if let Some(error) = measured {
            last = Some((error.estimate, image.rms_error()));
        }
        if let Some(error) = measured.filter(is_met) {
            break (error.estimate, StopReason::Reached);
        }
        if samples >= MAX_SAMPLES {
            break (measured.unwrap_or_else(|| measure(&image)).estimate, StopReason::MaxSamples);
        }
        let fit = sampler.samples_in_time(samples, target);
        let few = (samples / 2).max(1);
        let is_last = measured.is_some_and(|error| is_met(&error.scaled(HALF_MORE_FACTOR)));
        if !is_last && f64::from(samples) <= fit {
            let more = sampler.render_samples(samples, 2 * samples)?;
            image = image.doubled_with(more);
            continue;
        }
        let error = measured.unwrap_or_else(|| measure(&image));
        let reason = if is_last && f64::from(few) <= fit { StopReason::Reached } else { StopReason::Time };
        let rest = if reason == StopReason::Reached { few } else { fit as u32 };
        if rest > 0 {
            let more = sampler.render_samples(samples, samples + rest)?;
            image.extended_with(&more, rest);
        }
        // Fewer samples reduce the error proportionally less.
        let gain = (1.0 - HALF_MORE_FACTOR) * f64::from(rest.min(few)) / f64::from(few);
        break (error.estimate * (1.0 - gain), reason);
    };
    let SplitImage { pixels, samples, .. } = image;
    sampler.finish(pixels, samples, (metric, error), reason)
}
