//! A picture with the means of the two halves of its samples, and the error estimated from their difference;
//! derivation: [`super`].

use super::Metric;
use super::incremental_sampler::IncrementalSampler;
use kiln::metrics::{displayed, mean_flip, mean_over};

/// Rows of the parts of a picture that are measured, one after the other: FLIP takes 160 bytes a pixel.
const ROWS: usize = 64;

/// A picture with the means of the two halves of its samples.
pub(crate) struct SplitImage {
    /// Samples per pixel.
    pub samples: u32,
    /// Mean of the samples.
    pub pixels: Vec<[f32; 3]>,
    halves: Halves,
}

/// The pixels of both halves.
pub(crate) type Halves = [Vec<[f32; 3]>; 2];

impl SplitImage {
    /// A picture of which each half has `of_half` samples.
    pub(crate) fn new(halves: Halves, of_half: u32) -> Self {
        let [a, b] = &halves;
        SplitImage { samples: 2 * of_half, pixels: weighted_mean(a, 1, b, 1), halves }
    }

    /// The picture with `of_more` samples more in each half.
    pub(crate) fn extended_with(self, more: &Halves, of_more: u32) -> Self {
        let of_half = self.samples / 2;
        let halves = [0, 1].map(|i| weighted_mean(&self.halves[i], of_half, &more[i], of_more));
        SplitImage::new(halves, of_half + of_more)
    }

    /// Estimated RMS error in film values; above 0.
    pub(crate) fn rms_error(&self) -> f64 {
        let clamped = |c: f64| c.clamp(0.0, 1.0);
        let [a, b] = &self.halves;
        let difference = mean_over(a, b, |a, b| (clamped(a) - clamped(b)).powi(2));
        (0.5 * difference.sqrt()).max(f64::MIN_POSITIVE)
    }

    /// Estimated error of display values.
    pub(crate) fn error(&self, metric: Metric, sampler: &IncrementalSampler) -> f64 {
        let width = sampler.width();
        let [pixels, a, b] =
            [&self.pixels, &self.halves[0], &self.halves[1]].map(|pixels| pixels.chunks(ROWS * width));
        type Rows<'a> = &'a [[f32; 3]];
        let of_part = |(shown, (a, b)): (Rows, (Rows, Rows))| {
            let [shown, a, b] = [shown, a, b].map(|pixels| displayed(pixels, sampler.values));
            let displaced = displaced(&shown, [&a, &b]);
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

/// The display values of the half that is farther from those of the picture, `shown`, by pixels and channels. They are
/// half of the difference of the halves away, but where display values are clipped: there the brighter half may have
/// the same as the picture.
fn displaced(shown: &[[f32; 3]], [a, b]: [&[[f32; 3]]; 2]) -> Vec<[f32; 3]> {
    let farther = |shown: f32, a: f32, b: f32| if (a - shown).abs() > (b - shown).abs() { a } else { b };
    (0..shown.len()).map(|i| std::array::from_fn(|c| farther(shown[i][c], a[i][c], b[i][c]))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_weighted_by_sample_count() {
        // (4 * 1 + 2 * 4) / 6 = 2.
        assert_eq!(weighted_mean(&[[1.0; 3]], 4, &[[4.0; 3]], 2), [[2.0; 3]]);
    }

    /// Halves of 0 and 3 have the mean 1.5, of which 1 is displayed: 0 is off by 1, 3 by nothing.
    #[test]
    fn clipped_halves_do_not_hide_errors() {
        let (a, b) = ([[0.0, 0.25, 1.0]], [[1.0, 0.75, 0.0]]);
        assert_eq!(displaced(&[[1.0, 0.5, 0.4]], [&a, &b]), [[0.0, 0.75, 1.0]]);
    }
}
