//! Pilot: the picture of pixel centres, and its error estimated from a few error tiles with four samples per pixel.
//!
//! Pixel centres suffice for loose targets. They cost the least and are closer to the reference than one or two samples
//! of the filter: at a straight edge at distance d, where the reference is F(d), their mean square error is (1 -
//! F(|d|))^2, that of one sample F (1 - F). For a Gaussian filter the ratio of both, integrated over d, is 0.41.
//!
//! The samples of the tiles are part of the pictures that are rendered afterwards.

use super::ErrorBound;
use super::incremental_sampler::IncrementalSampler;
use super::split_error::{
    ErrorRange, SplitImage, approximate_display, sum_pairs, variance_ratio, weighted_mean,
};
use super::tile_error::{Estimate, TileDistribution};
use crate::error::{Error, Result};
use crate::metrics::displayed;

/// Samples per pixel of the selected tiles.
const PILOT_SAMPLES: u32 = 4;

/// Safety factor for the error of the centres: noise is estimated from few pixels, and its errors do not cancel out.
const MARGIN_OF_CENTRES: f64 = 1.1;

/// Safety factor for the errors of two and three samples, which are predicted from that of the centres.
const MARGIN_OF_EXPECTED: f64 = 1.05;

/// Fraction, on a logarithmic scale, of the error reduction from two to four samples that the third sample contributes:
/// less than half, as three samples are not balanced.
const THIRD: f64 = 0.35;

/// Result of the pilot.
pub(crate) enum PilotResult {
    /// Sufficient number of samples, 0 for pixel centres, with their error.
    Enough(u32, ErrorRange),
    /// Four samples may be insufficient; their predicted error.
    Insufficient(ErrorRange),
}

/// Samples of the pilot.
pub(crate) struct Pilot {
    /// Picture of the pixel centres.
    pub centres: Vec<[f32; 3]>,
    /// Means of sample 0, sample 1, and samples 2 and 3: whole pictures, black outside the sampled tiles.
    parts: [Vec<[f32; 3]>; 3],
    /// Whether each tile was sampled.
    sampled: Vec<bool>,
    sums: DifferenceSums,
}

/// Sums of squared differences over the sampled tiles, in display values.
#[derive(Default, Clone, Copy)]
struct DifferenceSums {
    /// Between samples 0 and 1.
    single: f64,
    /// Between the mean of samples 0 and 1 and that of samples 2 and 3.
    pair: f64,
    /// Between the centres and the mean of the four samples.
    centre: f64,
}

impl Pilot {
    /// Renders the pixel centres, then samples tiles until it is decided whether the centres meet the bound.
    pub(crate) fn new(sampler: &mut IncrementalSampler, bound: ErrorBound) -> Result<(Self, PilotResult)> {
        let centres = sampler.render_centres()?;
        let (tiles, values) = (sampler.tiles, sampler.values);
        let black = || vec![[0.0; 3]; centres.len()];
        let parts = [black(), black(), black()];
        let mut pilot =
            Pilot { centres, parts, sampled: vec![false; tiles.count()], sums: DifferenceSums::default() };
        // Pixel centres are wrong at edges, so tiles are weighted by contrast.
        let grey: Vec<f32> = pilot
            .centres
            .iter()
            .map(|pixel| pixel.map(|c| approximate_display(c, values)).iter().sum())
            .collect();
        let width = tiles.width() as usize;
        let contrast = |row: std::ops::Range<usize>| {
            let beside = sum_pairs(&grey[row.start..row.end - 1], &grey[row.start + 1..row.end], |a, b| {
                bound.metric.weight(a - b)
            });
            // Row 0 has no row above.
            let above = row.start.max(width)..row.end.max(width);
            beside
                + sum_pairs(&grey[above.start - width..above.end - width], &grey[above], |a, b| {
                    bound.metric.weight(a - b)
                })
        };
        let distribution = TileDistribution::new(&tiles.weights(contrast));
        let measure = |selected: &[usize]| {
            pilot.sample_tiles(sampler, selected)?;
            Ok::<_, Error>(pilot.measure_centres(sampler, bound, selected))
        };
        let range = |sum: &Estimate| {
            ErrorRange::of(sum, |total| MARGIN_OF_CENTRES * bound.metric.error_of_total(total, &tiles))
        };
        let is_decided = |[sum]: &[Estimate; 1]| bound.is_decided(&range(sum));
        let [sum] = distribution.estimate(measure, is_decided)?;
        let result = pilot_result(range(&sum), &pilot.sums, bound);
        Ok((pilot, result))
    }

    /// Renders the samples of the selected tiles.
    fn sample_tiles(&mut self, sampler: &mut IncrementalSampler, selected: &[usize]) -> Result<()> {
        selected.iter().for_each(|&tile| self.sampled[tile] = true);
        let is_new = |tile: usize| selected.binary_search(&tile).is_ok();
        for (part, range) in self.parts.iter_mut().zip([(0, 1), (1, 2), (2, PILOT_SAMPLES)]) {
            sampler.render_tiles(range, &is_new, part)?;
        }
        Ok(())
    }

    /// Error contributions of the centres of the selected tiles.
    fn measure_centres(
        &mut self,
        sampler: &IncrementalSampler,
        bound: ErrorBound,
        selected: &[usize],
    ) -> Vec<[f64; 1]> {
        let cut = |tile: usize| {
            let of = |pixels: &[[f32; 3]]| sampler.tiles.extract(tile, pixels);
            let [first, second, more] = [&self.parts[0], &self.parts[1], &self.parts[2]].map(|part| of(part));
            let both = weighted_mean(&first, 1, &second, 1);
            let all = weighted_mean(&both, 2, &more, 2);
            let shown = [of(&self.centres), all, first, second, both, more];
            shown.map(|pixels| displayed(&pixels, sampler.values))
        };
        let cuts: Vec<[Vec<[f32; 3]>; 6]> = selected.iter().map(|&tile| cut(tile)).collect();
        for [centre, all, first, second, both, more] in &cuts {
            self.sums.single += super::sum_of_squares(first, second);
            self.sums.pair += super::sum_of_squares(both, more);
            self.sums.centre += super::sum_of_squares(centre, all);
        }
        let variance_factor = variance_of_four(&self.sums);
        let contribution = |(&tile, [centre, all, _, _, both, more]): (&usize, &[Vec<[f32; 3]>; 6])| {
            let width = sampler.tiles.width_of(tile) as usize;
            let truth = estimate_truth(centre, all, [both, more], (width, variance_factor));
            [bound.metric.contribution(centre, &truth, width as u32)]
        };
        selected.iter().zip(&cuts).map(contribution).collect()
    }

    /// The picture of the pixel centres.
    pub(crate) fn into_centres(self) -> Vec<[f32; 3]> {
        self.centres
    }

    /// The picture of two or three samples per pixel, with four in the sampled tiles.
    pub(crate) fn into_few(
        mut self,
        sampler: &mut IncrementalSampler,
        samples: u32,
    ) -> Result<Vec<[f32; 3]>> {
        let mut pixels = weighted_mean(&self.parts[0], 1, &self.parts[1], 1);
        pixels = weighted_mean(&pixels, 2, &self.parts[2], 2);
        let sampled = std::mem::take(&mut self.sampled);
        sampler.render_tiles((0, samples), &|tile| !sampled[tile], &mut pixels)?;
        Ok(pixels)
    }

    /// The picture of four samples per pixel, with its halves.
    pub(crate) fn into_four(self, sampler: &mut IncrementalSampler) -> Result<SplitImage> {
        let Pilot { parts: [first, second, mut more], sampled, sums, .. } = self;
        let mut both = weighted_mean(&first, 1, &second, 1);
        sampler.render_tiles((0, 2), &|tile| !sampled[tile], &mut both)?;
        sampler.render_tiles((2, PILOT_SAMPLES), &|tile| !sampled[tile], &mut more)?;
        let ratio = variance_ratio(Some(sums.single), sums.pair);
        Ok(SplitImage::of_two(both, ratio).doubled_with(more))
    }
}

/// Estimate of the reference: an interpolation between the centres and the mean of four samples. The weight of the
/// latter falls with their noise, estimated from their halves in a window around each pixel: on a uniform surface the
/// samples have noise and the centres have none, at an edge the centres are wrong.
fn estimate_truth(
    centre: &[[f32; 3]],
    all: &[[f32; 3]],
    [both, more]: [&[[f32; 3]]; 2],
    (width, variance_factor): (usize, f64),
) -> Vec<[f32; 3]> {
    let squared_error = |a: &[[f32; 3]], b: &[[f32; 3]]| {
        let of_pixel = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f32>();
        window_sums(&a.iter().zip(b).map(of_pixel).collect::<Vec<_>>(), width)
    };
    let (deviation, noise) = (squared_error(centre, all), squared_error(both, more));
    let pixel = |i: usize| {
        let noise = variance_factor as f32 * noise[i];
        let weight = if deviation[i] > noise { (1.0 - noise / deviation[i]).sqrt() } else { 0.0 };
        std::array::from_fn(|c| centre[i][c] + weight * (all[i][c] - centre[i][c]))
    };
    (0..centre.len()).map(pixel).collect()
}

/// Sum over the 5 x 5 pixels around each pixel.
fn window_sums(plane: &[f32], width: usize) -> Vec<f32> {
    const REACH: usize = 2;
    let height = plane.len() / width;
    let window = |at: usize, size: usize| at.saturating_sub(REACH)..(at + REACH + 1).min(size);
    let of_row = |i: usize| plane[i / width * width..][window(i % width, width)].iter().sum::<f32>();
    let rows: Vec<f32> = (0..plane.len()).map(of_row).collect();
    (0..plane.len()).map(|i| window(i / width, height).map(|y| rows[y * width + i % width]).sum()).collect()
}

/// Variance of the mean of four samples relative to the mean square difference of their halves.
fn variance_of_four(sums: &DifferenceSums) -> f64 {
    let r = variance_ratio(Some(sums.single), sums.pair);
    r / (4.0 * (1.0 - r))
}

/// The smallest sufficient sample count, from the error of the centres and the ratio of the samples' errors to it.
fn pilot_result(centres: ErrorRange, sums: &DifferenceSums, bound: ErrorBound) -> PilotResult {
    if bound.is_met(&centres) {
        return PilotResult::Enough(0, centres);
    }
    let r = variance_ratio(Some(sums.single), sums.pair);
    let four = variance_of_four(sums) * sums.pair;
    let centre = (sums.centre - four).max(f64::MIN_POSITIVE);
    let of_four = (four / centre).sqrt();
    let of_two = (four / r / centre).sqrt();
    let of_three = of_two * (of_four / of_two).powf(THIRD);
    for (samples, of) in [(2, of_two), (3, of_three)] {
        let error = centres.scaled(of);
        if bound.is_met(&error.scaled(MARGIN_OF_EXPECTED)) {
            return PilotResult::Enough(samples, error);
        }
    }
    PilotResult::Insufficient(centres.scaled(of_four))
}

#[cfg(test)]
mod tests {
    use super::super::Metric;
    use super::*;

    fn enough(centres: f64, sums: &DifferenceSums, value: f64) -> Option<u32> {
        match pilot_result(ErrorRange::exact(centres), sums, ErrorBound { metric: Metric::Rmse, value }) {
            PilotResult::Enough(samples, _) => Some(samples),
            PilotResult::Insufficient(_) => None,
        }
    }

    #[test]
    fn the_fewest_samples_that_are_enough_are_chosen() {
        // Independent samples of variance 1: the mean square difference of single samples is 2, of pairs 1; the mean of
        // four has the variance 1/4. Centres with the mean square error 1 differ from it by 1 + 1/4. So two samples
        // have 0.71 of the error of the centres, three 0.63, four 0.5.
        let sums = DifferenceSums { single: 2.0, pair: 1.0, centre: 1.25 };
        assert_eq!(enough(0.1, &sums, 0.12), Some(0));
        assert_eq!(enough(0.1, &sums, 0.08), Some(2));
        assert_eq!(enough(0.1, &sums, 0.07), Some(3));
        assert_eq!(enough(0.1, &sums, 0.05), None);
    }

    #[test]
    fn noise_of_samples_is_not_an_error_of_the_centres() {
        // Four independent samples with the mean 0.4 and halves 0.2 and 0.6 have the standard error 0.2 (1/4 of the
        // squared difference). Centres at 0.5 are within it; centres at 0.9 are not: 0.5^2 - 0.2^2 = 0.21 of 0.25.
        let uniform = |value: f32| vec![[value; 3]; 12];
        let truth = |centre| {
            estimate_truth(&uniform(centre), &uniform(0.4), [&uniform(0.2), &uniform(0.6)], (4, 0.25))[5][1]
        };
        assert_eq!(truth(0.5), 0.5);
        assert!((truth(0.9) - (0.9 - 0.5 * 0.84f32.sqrt())).abs() < 1e-6, "{}", truth(0.9));
    }

    #[test]
    fn the_error_of_four_follows_from_the_halves() {
        let sums = DifferenceSums { single: 2.0, pair: 1.0, centre: 1.25 };
        assert!((variance_of_four(&sums) - 0.25).abs() < 1e-12);
        let PilotResult::Insufficient(four) =
            pilot_result(ErrorRange::exact(0.1), &sums, ErrorBound { metric: Metric::Rmse, value: 0.01 })
        else {
            panic!("four samples are not sufficient")
        };
        assert!((four.estimate - 0.05).abs() < 1e-12, "{four:?}");
    }
}
