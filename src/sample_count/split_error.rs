//! Error estimate from the difference of the two halves of a picture's samples; derivation: [`super`].

use super::Metric;
use super::tile_error::{ErrorTiles, Estimate, TileDistribution};
use crate::metrics::{Values, displayed, mean_over};

/// Bounds of r, see [`super`].
pub(crate) const VARIANCE_RATIOS: (f64, f64) = (0.353_553_390_593_273_8, 0.5);

/// A picture with the means of the two halves of its samples.
pub(crate) struct SplitImage {
    /// Samples per pixel.
    pub samples: u32,
    /// Mean of the samples.
    pub pixels: Vec<[f32; 3]>,
    halves: [Vec<[f32; 3]>; 2],
    /// Mean square difference of the halves, in film values clamped to 0 to 1.
    difference: Option<f64>,
    /// RMS error relative to the RMS difference of the halves.
    error_ratio: f64,
    /// r of the last doubling.
    variance_ratio: f64,
}

impl SplitImage {
    /// A picture of one sample.
    pub(crate) fn of_one(pixels: Vec<[f32; 3]>) -> Self {
        SplitImage {
            samples: 1,
            pixels,
            halves: Default::default(),
            difference: None,
            error_ratio: 0.0,
            variance_ratio: VARIANCE_RATIOS.1,
        }
    }

    /// A picture of two samples; `variance_ratio` is r from two to four samples.
    pub(crate) fn of_two(pixels: Vec<[f32; 3]>, variance_ratio: f64) -> Self {
        SplitImage { samples: 2, variance_ratio, ..SplitImage::of_one(pixels) }
    }

    /// The picture of twice as many samples; `more` is the mean of the second half.
    pub(crate) fn doubled_with(self, more: Vec<[f32; 3]>) -> Self {
        let pixels = weighted_mean(&self.pixels, self.samples, &more, self.samples);
        let clamped = |c: f64| c.clamp(0.0, 1.0);
        let difference = mean_over(&self.pixels, &more, |a, b| (clamped(a) - clamped(b)).powi(2));
        let ratio = if self.difference.is_some() {
            variance_ratio(self.difference, difference)
        } else {
            self.variance_ratio
        };
        let error_ratio = error_ratio(ratio);
        SplitImage {
            variance_ratio: ratio,
            samples: 2 * self.samples,
            pixels,
            halves: [self.pixels, more],
            difference: Some(difference),
            error_ratio,
        }
    }

    /// Adds `of_more` samples with the mean `more`.
    pub(crate) fn extended_with(&mut self, more: &[[f32; 3]], of_more: u32) {
        self.pixels = weighted_mean(&self.pixels, self.samples, more, of_more);
        self.samples += of_more;
    }

    /// Estimated RMS error in film values; above 0.
    pub(crate) fn rms_error(&self) -> f64 {
        (self.error_ratio * self.difference.unwrap_or(0.0).sqrt()).max(f64::MIN_POSITIVE)
    }

    /// Estimates the error on error tiles, until `is_decided` returns `true` for the estimate.
    pub(crate) fn error(
        &self,
        (metric, values): (Metric, Values),
        tiles: &ErrorTiles,
        is_decided: impl Fn(&ErrorRange) -> bool,
    ) -> ErrorRange {
        let [a, b] = &self.halves;
        if metric == Metric::Max {
            // A maximum cannot be estimated from a few tiles.
            let displaced = self.displaced([&self.pixels, a, b].map(|pixels| displayed(pixels, values)));
            return ErrorRange::exact(
                metric
                    .error_of_total(metric.contribution(&displaced[0], &displaced[1], tiles.width()), tiles),
            );
        }
        let weights = tiles.weights(|row| {
            let (a, b) = (a[row.clone()].as_flattened(), b[row].as_flattened());
            sum_pairs(a, b, |a, b| {
                metric.weight(approximate_display(a, values) - approximate_display(b, values))
            })
        });
        let measure = |selected: &[usize]| {
            let one = |&tile: &usize| {
                let cut = [&self.pixels, a, b].map(|pixels| displayed(&tiles.extract(tile, pixels), values));
                let [shown, displaced] = self.displaced(cut);
                [metric.contribution(&shown, &displaced, tiles.width_of(tile))]
            };
            Ok::<_, std::convert::Infallible>(selected.iter().map(one).collect())
        };
        let range = |sum: &Estimate| ErrorRange::of(sum, |total| metric.error_of_total(total, tiles));
        match TileDistribution::new(&weights)
            .estimate(measure, |[sum]: &[Estimate; 1]| is_decided(&range(sum)))
        {
            Ok([sum]) => range(&sum),
        }
    }

    fn displaced(&self, [picture, a, b]: [Vec<[f32; 3]>; 3]) -> [Vec<[f32; 3]>; 2] {
        let displaced = displaced(&picture, [&a, &b], self.error_ratio);
        [picture, displaced]
    }
}

/// Estimate of an error, with its 5 % and 95 % quantiles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ErrorRange {
    pub low: f64,
    pub estimate: f64,
    pub high: f64,
}

impl ErrorRange {
    /// An exactly known error.
    pub(crate) fn exact(value: f64) -> Self {
        ErrorRange { low: value, estimate: value, high: value }
    }

    /// Applies a monotonic function to an estimated sum.
    pub(crate) fn of(sum: &Estimate, error: impl Fn(f64) -> f64) -> Self {
        ErrorRange {
            low: error(sum.lower_bound()),
            estimate: error(sum.value),
            high: error(sum.upper_bound()),
        }
    }

    pub(crate) fn scaled(self, factor: f64) -> Self {
        ErrorRange { low: self.low * factor, estimate: self.estimate * factor, high: self.high * factor }
    }
}

/// Mean of two means of `of_a` and `of_b` samples.
pub(crate) fn weighted_mean(a: &[[f32; 3]], of_a: u32, b: &[[f32; 3]], of_b: u32) -> Vec<[f32; 3]> {
    let (of_a, of_b) = (f64::from(of_a), f64::from(of_b));
    let mean = |a: f32, b: f32| ((f64::from(a) * of_a + f64::from(b) * of_b) / (of_a + of_b)) as f32;
    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| mean(a[c], b[c]))).collect()
}

/// Approximate display value, at a tenth of the cost of sRGB.
#[inline(always)]
pub(crate) fn approximate_display(c: f32, values: Values) -> f32 {
    let c = c.clamp(0.0, 1.0);
    if values == Values::Linear { c.sqrt() } else { c }
}

/// Sum of `f` over pairs, with eight accumulators for vectorisation.
#[inline(always)]
pub(crate) fn sum_pairs(a: &[f32], b: &[f32], f: impl Fn(f32, f32) -> f32) -> f64 {
    let mut sums = [0.0; 8];
    let ((a, rest_of_a), (b, rest_of_b)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    for (a, b) in a.iter().zip(b) {
        for i in 0..8 {
            sums[i] += f(a[i], b[i]);
        }
    }
    let rest = rest_of_a.iter().zip(rest_of_b).map(|(&a, &b)| f(a, b)).sum::<f32>();
    f64::from(sums.iter().sum::<f32>() + rest)
}

/// RMS error relative to the RMS difference of the halves, by r.
fn error_ratio(r: f64) -> f64 {
    (r / (4.0 * (1.0 - r))).sqrt()
}

/// r, see [`super`]. `before` and `now` are the mean square differences of the halves before and after a doubling.
pub(crate) fn variance_ratio(before: Option<f64>, now: f64) -> f64 {
    let measured = before.filter(|&before| before > 0.0).map_or(VARIANCE_RATIOS.1, |before| now / before);
    measured.clamp(VARIANCE_RATIOS.0, VARIANCE_RATIOS.1)
}

/// `shown` plus `ratio` times the difference of the halves, clamped to 0 to 1.
pub(crate) fn displaced(shown: &[[f32; 3]], [a, b]: [&[[f32; 3]]; 2], ratio: f64) -> Vec<[f32; 3]> {
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
    fn sums_include_the_remainder() {
        // 1 + 2 + … + 20 = 210.
        let a: Vec<f32> = (1..=20).map(|i| i as f32).collect();
        assert_eq!(sum_pairs(&a, &[0.0; 20], |a, b| a - b), 210.0);
    }

    #[test]
    fn displaced_values_are_clamped() {
        let (a, b) = ([[1.0, 0.5, 0.0]], [[0.0, 0.25, 1.0]]);
        assert_eq!(displaced(&[[0.75; 3]], [&a, &b], 0.5), [[1.0, 0.875, 0.25]]);
    }
}
