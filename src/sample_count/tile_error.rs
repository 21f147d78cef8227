//! Importance sampling of error tiles: estimates the error of a picture from a few of its tiles, as measuring all of
//! them costs as much as rendering.
//!
//! Tiles are drawn with probabilities p proportional to an approximation of their contributions. The mean of `value /
//! p` is an unbiased estimate of the sum (Hansen and Hurwitz, On the Theory of Sampling from Finite Populations, 1943);
//! its variance falls with the error of the approximation. The sample points are the additive recurrence of the golden
//! ratio, which is more even than random points; the standard error given is that of random points, which is an upper
//! bound in practice.

use std::collections::HashMap;

use rayon::prelude::*;

use crate::film::TILE;

/// Side of an error tile in pixels.
const SIDE: u32 = 2 * TILE;

/// Number of tiles drawn at a time.
const BATCH: usize = 12;

/// Maximum number of batches. If the result is undecided by then, the error is close to the bound.
const MAX_BATCHES: usize = 4;

/// Added to each weight, relative to the mean weight: tiles with the weight 0 may have an error.
const MIN_WEIGHT: f64 = 0.25;

/// 95 % quantile of the normal distribution in standard deviations.
const QUANTILE_95: f64 = 1.645;

/// Partition of a picture into error tiles, squares of 2 x 2 render tiles.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ErrorTiles {
    width: u32,
    height: u32,
    /// The number of pixels that mean errors are of.
    subject_pixels: f64,
}

impl ErrorTiles {
    pub(crate) fn new(width: u32, height: u32) -> Self {
        ErrorTiles { width, height, subject_pixels: f64::from(width) * f64::from(height) }
    }

    /// The same with mean errors over `subject_pixels` pixels, at least 1, of which all errors are.
    pub(crate) fn with_subject(self, subject_pixels: usize) -> Self {
        ErrorTiles { subject_pixels: subject_pixels.max(1) as f64, ..self }
    }

    fn across(&self) -> u32 {
        self.width.div_ceil(SIDE)
    }

    /// Number of tiles.
    pub(crate) fn count(&self) -> usize {
        (self.across() * self.height.div_ceil(SIDE)) as usize
    }

    /// Number of pixels that mean errors are of.
    pub(crate) fn subject_pixels(&self) -> f64 {
        self.subject_pixels
    }

    /// Width of the picture in pixels.
    pub(crate) fn width(&self) -> u32 {
        self.width
    }

    /// Index of the tile of a pixel.
    pub(crate) fn index_of(&self, x: u32, y: u32) -> usize {
        (y / SIDE * self.across() + x / SIDE) as usize
    }

    /// Pixel index ranges of the rows of a tile.
    pub(crate) fn rows(&self, tile: usize) -> impl Iterator<Item = std::ops::Range<usize>> + use<> {
        let (x, y) = (tile as u32 % self.across() * SIDE, tile as u32 / self.across() * SIDE);
        let (width, right, bottom) = (self.width, (x + SIDE).min(self.width), (y + SIDE).min(self.height));
        (y..bottom).map(move |y| (y as usize * width as usize + x as usize)..(y * width + right) as usize)
    }

    /// The pixels of a tile.
    pub(crate) fn extract(&self, tile: usize, pixels: &[[f32; 3]]) -> Vec<[f32; 3]> {
        self.rows(tile).flat_map(|row| pixels[row].iter().copied()).collect()
    }

    /// Width of a tile in pixels.
    pub(crate) fn width_of(&self, tile: usize) -> u32 {
        SIDE.min(self.width - tile as u32 % self.across() * SIDE)
    }

    /// Weight of each tile, the sum of `of_row` over its rows.
    pub(crate) fn weights(&self, of_row: impl Fn(std::ops::Range<usize>) -> f64 + Sync) -> Vec<f64> {
        (0..self.count()).into_par_iter().map(|tile| self.rows(tile).map(&of_row).sum()).collect()
    }
}

/// Discrete distribution of error tiles.
pub(crate) struct TileDistribution {
    probabilities: Vec<f64>,
    /// Cumulative distribution function.
    cumulative: Vec<f64>,
}

impl TileDistribution {
    /// Weights are 0 or more.
    pub(crate) fn new(weights: &[f64]) -> Self {
        let mean = weights.iter().sum::<f64>() / weights.len() as f64;
        let minimum = if mean > 0.0 { MIN_WEIGHT * mean } else { 1.0 };
        let total: f64 = weights.iter().map(|weight| weight + minimum).sum();
        let probabilities: Vec<f64> = weights.iter().map(|weight| (weight + minimum) / total).collect();
        let mut sum = 0.0;
        let cumulative = probabilities.iter().map(|probability| {
            sum += probability;
            sum
        });
        TileDistribution { cumulative: cumulative.collect(), probabilities }
    }

    /// The tile of sample point `index`.
    fn sample(&self, index: usize) -> usize {
        const GOLDEN: f64 = 0.618_033_988_749_894_8;
        let at = (0.5 + index as f64 * GOLDEN).fract();
        self.cumulative.partition_point(|&cumulative| cumulative <= at).min(self.probabilities.len() - 1)
    }

    /// Estimates the sums of `N` values over all tiles. Draws batches of tiles until `is_decided` returns `true` for
    /// the estimates. `measure` returns the values of tiles that were not measured before, in ascending order.
    ///
    /// # Errors
    /// Those of `measure`.
    pub(crate) fn estimate<const N: usize, E>(
        &self,
        mut measure: impl FnMut(&[usize]) -> Result<Vec<[f64; N]>, E>,
        is_decided: impl Fn(&[Estimate; N]) -> bool,
    ) -> Result<[Estimate; N], E> {
        let mut known: HashMap<usize, [f64; N]> = HashMap::new();
        let mut drawn: Vec<usize> = Vec::new();
        loop {
            // If the next batch reaches the number of tiles, all are measured, which is exact.
            let is_all = drawn.len() + BATCH >= self.probabilities.len();
            let next: Vec<usize> = match is_all {
                true => (0..self.probabilities.len()).collect(),
                false => (drawn.len()..drawn.len() + BATCH).map(|index| self.sample(index)).collect(),
            };
            let mut new: Vec<usize> = next.iter().copied().filter(|tile| !known.contains_key(tile)).collect();
            new.sort_unstable();
            new.dedup();
            let values = measure(&new)?;
            known.extend(new.iter().copied().zip(values));
            if is_all {
                let sum = |n: usize| next.iter().map(|tile| known[tile][n]).sum();
                return Ok(std::array::from_fn(|n| Estimate { value: sum(n), deviation: 0.0 }));
            }
            drawn.extend(next);
            let sums = std::array::from_fn(|n| {
                Estimate::of(drawn.iter().map(|&tile| known[&tile][n] / self.probabilities[tile]))
            });
            if is_decided(&sums) || drawn.len() >= BATCH * MAX_BATCHES {
                return Ok(sums);
            }
        }
    }
}

/// Estimate of a sum over all tiles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Estimate {
    pub value: f64,
    /// Standard error.
    pub deviation: f64,
}

impl Estimate {
    fn of(estimates: impl Iterator<Item = f64> + Clone) -> Self {
        let count = estimates.clone().count() as f64;
        let mean = estimates.clone().sum::<f64>() / count;
        let sum_of_squares: f64 = estimates.map(|one| (one - mean).powi(2)).sum();
        Estimate { value: mean, deviation: (sum_of_squares / (count * (count - 1.0))).sqrt() }
    }

    /// 95 % quantile.
    pub(crate) fn upper_bound(&self) -> f64 {
        self.value + QUANTILE_95 * self.deviation
    }

    /// 5 % quantile, 0 or more.
    pub(crate) fn lower_bound(&self) -> f64 {
        (self.value - QUANTILE_95 * self.deviation).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_every_pixel_once() {
        let tiles = ErrorTiles::new(70, 33);
        assert_eq!(tiles.count(), 6);
        let mut seen = vec![0; 70 * 33];
        for tile in 0..tiles.count() {
            for row in tiles.rows(tile) {
                assert_eq!(row.len(), tiles.width_of(tile) as usize);
                for pixel in row {
                    assert_eq!(tiles.index_of(pixel as u32 % 70, pixel as u32 / 70), tile);
                    seen[pixel] += 1;
                }
            }
        }
        assert!(seen.iter().all(|&count| count == 1));
    }

    #[test]
    fn proportional_weights_have_no_variance() {
        // Probabilities proportional to the values: each draw gives the sum. The minimum weight is added to the values,
        // too.
        let values: Vec<f64> = (0..200).map(f64::from).collect();
        let least = MIN_WEIGHT * values.iter().sum::<f64>() / 200.0;
        let measured = |tiles: &[usize]| Ok::<_, ()>(tiles.iter().map(|&s| [values[s] + least]).collect());
        let [sum] = TileDistribution::new(&values).estimate(measured, |_| true).unwrap();
        let expected = values.iter().sum::<f64>() + 200.0 * least;
        assert!((sum.value / expected - 1.0).abs() < 1e-12 && sum.deviation < 1e-9 * expected, "{sum:?}");
    }

    #[test]
    fn wrong_weights_are_within_the_standard_error() {
        let value = |tile: usize| if tile.is_multiple_of(3) { 5.0 } else { 1.0 };
        let measured = |tiles: &[usize]| Ok::<_, ()>(tiles.iter().map(|&s| [value(s)]).collect());
        let total: f64 = (0..600).map(value).sum();
        let [sum] = TileDistribution::new(&vec![1.0; 600]).estimate(measured, |_| false).unwrap();
        assert!((sum.value - total).abs() < 3.0 * sum.deviation && sum.deviation > 0.0, "{sum:?} of {total}");
    }

    #[test]
    fn few_tiles_are_all_measured() {
        let mut measured_tiles = Vec::new();
        let measured = |tiles: &[usize]| {
            measured_tiles.extend_from_slice(tiles);
            Ok::<_, ()>(tiles.iter().map(|&s| [s as f64]).collect())
        };
        let sums = TileDistribution::new(&[0.0; 10]).estimate(measured, |_| false).unwrap();
        assert_eq!(sums, [Estimate { value: 45.0, deviation: 0.0 }]);
        assert_eq!(measured_tiles, (0..10).collect::<Vec<_>>());
    }
}
