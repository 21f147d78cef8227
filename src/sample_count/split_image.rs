//! A picture with the means of the two halves of its samples, and the error estimated from their difference;
//! derivation: [`super`].

use super::Metric;
use super::incremental_sampler::IncrementalSampler;
use crate::metrics::{displayed, mean_flip, mean_over};

/// Bounds of r, see [`super`].
const VARIANCE_RATIOS: (f64, f64) = (0.353_553_390_593_273_8, 0.5);

/// Rows of the parts of a picture that are measured, one after the other: FLIP takes 160 bytes a pixel.
const ROWS: usize = 64;

/// A picture with the means of the two halves of its samples.
pub(crate) struct SplitImage {
    /// Samples per pixel.
    pub samples: u32,
    /// Mean of the samples.
    pub pixels: Vec<[f32; 3]>,
    halves: [Vec<[f32; 3]>; 2],
    /// Mean square difference of the halves, in film values clamped to 0 to 1.
    difference: f64,
    /// RMS error relative to the RMS difference of the halves.
    error_ratio: f64,
}

impl SplitImage {
    /// A picture of two samples. Their r is that of independent samples.
    pub(crate) fn new(a: Vec<[f32; 3]>, b: Vec<[f32; 3]>) -> Self {
        SplitImage::of_halves(1, None, [a, b])
    }

    /// The picture of twice as many samples; `more` is the mean of the second half.
    pub(crate) fn doubled_with(self, more: Vec<[f32; 3]>) -> Self {
        SplitImage::of_halves(self.samples, Some(self.difference), [self.pixels, more])
    }

    /// `before` is the mean square difference before the last doubling.
    fn of_halves(samples: u32, before: Option<f64>, halves: [Vec<[f32; 3]>; 2]) -> Self {
        let [a, b] = &halves;
        let clamped = |c: f64| c.clamp(0.0, 1.0);
        let difference = mean_over(a, b, |a, b| (clamped(a) - clamped(b)).powi(2));
        let error_ratio = error_ratio(variance_ratio(before, difference));
        let pixels = weighted_mean(a, samples, b, samples);
        SplitImage { samples: 2 * samples, pixels, halves, difference, error_ratio }
    }

    /// Adds `of_more` samples with the mean `more`.
    pub(crate) fn extend_with(&mut self, more: &[[f32; 3]], of_more: u32) {
        self.pixels = weighted_mean(&self.pixels, self.samples, more, of_more);
        self.samples += of_more;
    }

    /// Estimated RMS error in film values; above 0.
    pub(crate) fn rms_error(&self) -> f64 {
        (self.error_ratio * self.difference.sqrt()).max(f64::MIN_POSITIVE)
    }

    /// Estimated error of display values.
    pub(crate) fn error(&self, metric: Metric, sampler: &IncrementalSampler) -> f64 {
        let width = sampler.width();
        let [pixels, a, b] =
            [&self.pixels, &self.halves[0], &self.halves[1]].map(|pixels| pixels.chunks(ROWS * width));
        type Rows<'a> = &'a [[f32; 3]];
        let of_part = |(shown, (a, b)): (Rows, (Rows, Rows))| {
            let [shown, a, b] = [shown, a, b].map(|pixels| displayed(pixels, sampler.values));
            let displaced = displaced(&shown, [&a, &b], self.error_ratio);
            match metric {
                Metric::Flip => mean_flip(&shown, &displaced, width as u32) * shown.len() as f64,
                Metric::Rmse => mean_over(&shown, &displaced, |a, b| (a - b) * (a - b)) * shown.len() as f64,
                Metric::Max => {
                    let pairs = shown.as_flattened().iter().zip(displaced.as_flattened());
                    pairs.map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
                }
            }
        };
        let errors: Vec<f64> = pixels.zip(a.zip(b)).map(of_part).collect();
        let mean = errors.iter().sum::<f64>() / sampler.subject_pixels as f64;
        match metric {
            Metric::Flip => mean,
            Metric::Rmse => mean.sqrt(),
            Metric::Max => errors.into_iter().fold(0.0, f64::max),
        }
    }
}

/// Mean of two means of `of_a` and `of_b` samples.
fn weighted_mean(a: &[[f32; 3]], of_a: u32, b: &[[f32; 3]], of_b: u32) -> Vec<[f32; 3]> {
    let (of_a, of_b) = (f64::from(of_a), f64::from(of_b));
    let mean = |a: f32, b: f32| ((f64::from(a) * of_a + f64::from(b) * of_b) / (of_a + of_b)) as f32;
    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| mean(a[c], b[c]))).collect()
}

/// RMS error relative to the RMS difference of the halves, by r.
fn error_ratio(r: f64) -> f64 {
    (r / (4.0 * (1.0 - r))).sqrt()
}

/// r, see [`super`]. `before` and `now` are the mean square differences of the halves before and after a doubling.
fn variance_ratio(before: Option<f64>, now: f64) -> f64 {
    let measured = before.filter(|&before| before > 0.0).map_or(VARIANCE_RATIOS.1, |before| now / before);
    measured.clamp(VARIANCE_RATIOS.0, VARIANCE_RATIOS.1)
}

/// `shown` plus `ratio` times the difference of the halves, clamped to 0 to 1.
fn displaced(shown: &[[f32; 3]], [a, b]: [&[[f32; 3]]; 2], ratio: f64) -> Vec<[f32; 3]> {
    let ratio = ratio as f32;
    let pixel =
        |i: usize| std::array::from_fn(|c| (shown[i][c] + ratio * (a[i][c] - b[i][c])).clamp(0.0, 1.0));
    (0..shown.len()).map(pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_ratio_follows_from_the_variance_ratio() {
        // Independent halves: the RMS error of their mean is half of their RMS difference.
        let ratio = |before, now| error_ratio(variance_ratio(before, now));
        assert_eq!(ratio(None, 1.0), 0.5);
        assert_eq!(ratio(Some(2.0), 1.0), 0.5);
        // Ratios outside the bounds are clamped.
        assert_eq!(ratio(Some(1.0), 1.0), 0.5);
        // r / (4 (1 - r)) of 2^-1.5 is 0.136729.
        assert!((ratio(Some(10.0), 1.0).powi(2) - 0.136_729).abs() < 1e-6);
    }

    #[test]
    fn means_are_weighted_by_sample_count() {
        // (4 * 1 + 2 * 4) / 6 = 2.
        assert_eq!(weighted_mean(&[[1.0; 3]], 4, &[[4.0; 3]], 2), [[2.0; 3]]);
    }

    #[test]
    fn displaced_values_are_clamped() {
        let (a, b) = ([[1.0, 0.5, 0.0]], [[0.0, 0.25, 1.0]]);
        assert_eq!(displaced(&[[0.75; 3]], [&a, &b], 0.5), [[1.0, 0.875, 0.25]]);
    }
}
