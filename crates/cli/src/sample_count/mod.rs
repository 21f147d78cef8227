//! Sample counts for targets: rendering with as many samples as an error or a time limit requires, with an estimate of
//! the remaining error.
//!
//! The reference ("truth") is the antialiased picture: the limit of the same filter, effects, bounces and numerics for
//! ever more samples. The number of samples is doubled until the target is reached. Each doubling renders the next
//! ranges of two sample sequences, and the error is estimated from the difference of their means, without further rays.
//!
//! Mean errors are those of the pixels whose centre ray hits an object other than the ground, so that a large
//! background does not hide a jagged object; of all pixels where there are none, or where an environment is seen.
//!
//! The sequences are independent. So the means A and B of the halves are, too, and the variance of the picture (A + B)
//! / 2 is E|A - B|^2 / 4, however the samples of a half are stratified. Errors of display values are those between the
//! picture and A or B, which are (A - B) / 2 away.

mod incremental_sampler;
mod split_image;

use incremental_sampler::IncrementalSampler;
use kiln::error::Result;
use kiln::job::RenderJob;
use kiln::render::{RenderControl, Statistics};
use split_image::SplitImage;

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
const NEAR_FACTOR: f64 = 0.8 * HALF_MORE_FACTOR;

/// Error metric between display values (1 is white) before rounding to 8 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub enum Metric {
    /// Mean LDR-FLIP.
    Flip,
    /// Root mean square difference over pixels and channels.
    Rmse,
    /// Largest channel difference.
    Max,
}

kiln::names!(Metric { Flip = "FLIP", Rmse = "RMSE", Max = "MAX" });

impl Metric {
    fn margin(self) -> f64 {
        if self == Metric::Max { MARGIN_OF_MAX } else { MARGIN }
    }
}

/// Target of the sample count: an error bound, a time limit or both.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
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
    /// Samples per pixel, at least 2.
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
        let samples = self.samples;
        format!("{samples} samples a pixel: {name} to the truth is about {error:.2e}{bound}{why}")
    }
}

/// Upper bound of the memory for rendering to a target, in bytes per pixel: nine images of 12 bytes.
pub const BYTES_PER_PIXEL: u64 = 108;

/// Renders to a target on the current rayon pool. Sets the job's sampling to that of the returned picture.
///
/// # Errors
/// Those of [`RenderJob::render`]; [`kiln::error::Error::Usage`] if antialiasing is off.
pub fn render(job: &mut RenderJob, target: &ErrorTarget, control: &RenderControl) -> Result<SampledImage> {
    let mut sampler = IncrementalSampler::new(job, control)?;
    let metric = target.accuracy.map_or(Metric::Flip, |(metric, _)| metric);
    let is_met = |error: f64| target.accuracy.is_some_and(|(metric, bound)| error * metric.margin() <= bound);
    let mut image = SplitImage::new(sampler.render_samples(0, 1)?, 1);
    // The last measured error, and the RMS error of the picture that it is of.
    let mut last: Option<[f64; 2]> = None;
    let (error, reason) = loop {
        if !sampler.is_finite() {
            break (f64::NAN, StopReason::NotFinite);
        }
        let (samples, spent) = (image.samples, sampler.seconds());
        let measure = |image: &SplitImage| image.error(metric, &sampler);
        // FLIP costs as much as some samples, so it is measured only if the bound may be met, provided that it falls
        // like the RMS error; perceived errors fall more slowly, or hardly faster.
        let is_near = last.is_none_or(|[error, rms]| {
            metric != Metric::Flip || is_met(error * image.rms_error() / rms * NEAR_FACTOR)
        });
        let measured = (target.accuracy.is_some() && is_near).then(|| measure(&image));
        last = measured.map(|error| [error, image.rms_error()]).or(last);
        if let Some(error) = measured.filter(|error| is_met(*error)) {
            break (error, StopReason::Reached);
        }
        let error = || measured.unwrap_or_else(|| measure(&image));
        if samples >= MAX_SAMPLES {
            break (error(), StopReason::MaxSamples);
        }
        let fit = sampler.samples_in_time(samples, spent, target);
        let is_last = measured.is_some_and(|error| is_met(error * HALF_MORE_FACTOR));
        if !is_last && f64::from(samples) <= fit {
            image = image.extended_with(&sampler.render_samples(samples / 2, samples)?, samples / 2);
            continue;
        }
        let error = error();
        // Measuring has taken time, too.
        let fit = sampler.samples_in_time(samples, spent, target);
        let few = samples / 2;
        let reason = if is_last && f64::from(few) <= fit { StopReason::Reached } else { StopReason::Time };
        // Of each half.
        let rest = if reason == StopReason::Reached { few.div_ceil(2) } else { fit as u32 / 2 };
        if rest > 0 {
            image = image.extended_with(&sampler.render_samples(samples / 2, samples / 2 + rest)?, rest);
        }
        // Fewer samples reduce the error proportionally less.
        let gain = (1.0 - HALF_MORE_FACTOR) * f64::from((2 * rest).min(few)) / f64::from(few);
        break (error * (1.0 - gain), reason);
    };
    sampler.finish(image, (metric, error), reason)
}
