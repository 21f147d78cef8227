//! A first look: the picture of the pixels' centres, and how far it is from the truth by a few squares of four samples a pixel.
//!
//! Many targets are loose, and one ray a pixel reaches them. A ray through the centre is the quickest there is, and closer to the truth
//! than one or two samples of the filter: at a straight edge at distance d, where the truth is F(d), its mean square error is that of
//! (1 - F(|d|))^2, that of one sample F (1 - F). For a Gaussian filter these are in a ratio of 0.41, integrated over d.
//!
//! What the squares were sampled by is part of whatever comes after.

use super::Target;
use super::halves::{Level, Range, about_displayed, fall_of_variance, joined, summed};
use super::survey::{Draws, Sum};
use super::taker::Taker;
use crate::error::{Error, Result};
use crate::metrics::displayed;

/// Samples of the squares.
const PROBED: u32 = 4;

/// By how much the error of centres may be underestimated: what is taken for noise is judged by few pixels, and by half as much
/// too large is not made up for by half as much too small.
const MARGIN_OF_CENTRES: f64 = 1.1;

/// How much lower than the target an error has to be that is expected of two to four samples by what centres get wrong.
const MARGIN_OF_EXPECTED: f64 = 1.05;

/// The share of what the samples from two to four bring, on a log scale, that the third brings: less than half, being
/// out of balance.
const THIRD: f64 = 0.35;

/// What came of it.
pub enum Look {
    /// So many samples are enough: 0 for the centres.
    Enough(u32, Range),
    /// Four are not, or may not be; expected of them is an error of so much.
    Beyond(Range),
}

/// Pictures of the samples that were taken so far, where they were.
pub struct Probe {
    /// The pixels' centres.
    pub centres: Vec<[f32; 3]>,
    /// Of the first sample, the second, and the two after: whole pictures, black where nothing was taken.
    parts: [Vec<[f32; 3]>; 3],
    /// Of each square, whether it was.
    taken: Vec<bool>,
    /// What lies between them there.
    sums: Apart,
}

/// Sums over squares, in displayed values.
#[derive(Default, Clone, Copy)]
struct Apart {
    /// Of the squares of what lies between the first sample and the second.
    one: f64,
    /// Between the mean of these and that of the two after.
    two: f64,
    /// Between the centre and the mean of all four.
    centre: f64,
}

impl Probe {
    /// Takes the centres, and samples of some squares until it is clear whether these are enough.
    pub fn new(taker: &mut Taker, target: Target) -> Result<(Self, Look)> {
        let centres = taker.take_centres()?;
        let (squares, values) = (taker.squares, taker.values);
        let black = || vec![[0.0; 3]; centres.len()];
        let parts = [black(), black(), black()];
        let mut probe = Probe { centres, parts, taken: vec![false; squares.count()], sums: Apart::default() };
        // Edges are where centres are wrong.
        let grey: Vec<f32> = probe
            .centres
            .iter()
            .map(|pixel| pixel.map(|c| about_displayed(c, values)).iter().sum())
            .collect();
        let width = squares.width() as usize;
        let contrast = |row: std::ops::Range<usize>| {
            let beside = summed(&grey[row.start..row.end - 1], &grey[row.start + 1..row.end], |a, b| {
                target.metric.guess(a - b)
            });
            // There is no row above the first.
            let above = row.start.max(width)..row.end.max(width);
            beside
                + summed(&grey[above.start - width..above.end - width], &grey[above], |a, b| {
                    target.metric.guess(a - b)
                })
        };
        let draws = Draws::new(&squares.guesses(contrast));
        let measure = |chosen: &[usize]| {
            probe.take(taker, chosen)?;
            Ok::<_, Error>(probe.measured(taker, target, chosen))
        };
        let range =
            |sum: &Sum| Range::of(sum, |amount| MARGIN_OF_CENTRES * target.metric.of(amount, &squares));
        let is_clear = |[sum]: &[Sum; 1]| target.is_clear(&range(sum));
        let [sum] = draws.survey(measure, is_clear)?;
        let look = verdict(range(&sum), &probe.sums, target);
        Ok((probe, look))
    }

    /// Takes the samples of some squares.
    fn take(&mut self, taker: &mut Taker, chosen: &[usize]) -> Result<()> {
        chosen.iter().for_each(|&square| self.taken[square] = true);
        let is_new = |square: usize| chosen.binary_search(&square).is_ok();
        for (part, stretch) in self.parts.iter_mut().zip([(0, 1), (1, 2), (2, PROBED)]) {
            taker.take_some(stretch, &is_new, part)?;
        }
        Ok(())
    }

    /// How far the centres of squares are off.
    fn measured(&mut self, taker: &Taker, target: Target, chosen: &[usize]) -> Vec<[f64; 1]> {
        let cut = |square: usize| {
            let of = |pixels: &[[f32; 3]]| taker.squares.cut(square, pixels);
            let [first, second, more] = [&self.parts[0], &self.parts[1], &self.parts[2]].map(|part| of(part));
            let both = joined(&first, 1, &second, 1);
            let all = joined(&both, 2, &more, 2);
            let shown = [of(&self.centres), all, first, second, both, more];
            shown.map(|pixels| displayed(&pixels, taker.values))
        };
        let cuts: Vec<[Vec<[f32; 3]>; 6]> = chosen.iter().map(|&square| cut(square)).collect();
        for [centre, all, first, second, both, more] in &cuts {
            self.sums.one += super::squares_between(first, second);
            self.sums.two += super::squares_between(both, more);
            self.sums.centre += super::squares_between(centre, all);
        }
        let of_four = variance_of_four(&self.sums);
        let amount = |(&square, [centre, all, _, _, both, more]): (&usize, &[Vec<[f32; 3]>; 6])| {
            let width = taker.squares.width_of(square) as usize;
            let truth = without_noise(centre, all, [both, more], (width, of_four));
            [target.metric.amount(centre, &truth, width as u32)]
        };
        chosen.iter().zip(&cuts).map(amount).collect()
    }

    /// The centres of all pixels.
    pub fn into_centres(self) -> Vec<[f32; 3]> {
        self.centres
    }

    /// The picture of two or three samples a pixel, of four where they were taken.
    pub fn into_few(mut self, taker: &mut Taker, samples: u32) -> Result<Vec<[f32; 3]>> {
        let mut pixels = joined(&self.parts[0], 1, &self.parts[1], 1);
        pixels = joined(&pixels, 2, &self.parts[2], 2);
        let taken = std::mem::take(&mut self.taken);
        taker.take_some((0, samples), &|square| !taken[square], &mut pixels)?;
        Ok(pixels)
    }

    /// The picture of four samples a pixel, and its halves.
    pub fn into_four(self, taker: &mut Taker) -> Result<Level> {
        let Probe { parts: [first, second, mut more], taken, sums, .. } = self;
        let mut both = joined(&first, 1, &second, 1);
        taker.take_some((0, 2), &|square| !taken[square], &mut both)?;
        taker.take_some((2, PROBED), &|square| !taken[square], &mut more)?;
        let fall = fall_of_variance(Some(sums.one), sums.two);
        Ok(Level::of_two(both, fall).joined_by(more))
    }
}

/// The truth as far as it is known: the centres moved towards the mean of four samples, by less where these are as far off
/// themselves, as their halves say. Judged pixel by pixel by those around: where a surface is even, four samples are noise
/// and centres are none, at an edge it is the other way round.
fn without_noise(
    centre: &[[f32; 3]],
    all: &[[f32; 3]],
    [both, more]: [&[[f32; 3]]; 2],
    (width, of_four): (usize, f64),
) -> Vec<[f32; 3]> {
    let squares = |a: &[[f32; 3]], b: &[[f32; 3]]| {
        let of_pixel = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f32>();
        around(&a.iter().zip(b).map(of_pixel).collect::<Vec<_>>(), width)
    };
    let (off, noise) = (squares(centre, all), squares(both, more));
    let pixel = |i: usize| {
        let noise = of_four as f32 * noise[i];
        let share = if off[i] > noise { (1.0 - noise / off[i]).sqrt() } else { 0.0 };
        std::array::from_fn(|c| centre[i][c] + share * (all[i][c] - centre[i][c]))
    };
    (0..centre.len()).map(pixel).collect()
}

/// Of each pixel, the sum over those up to two beside, above and below.
fn around(plane: &[f32], width: usize) -> Vec<f32> {
    const REACH: usize = 2;
    let height = plane.len() / width;
    let window = |at: usize, size: usize| at.saturating_sub(REACH)..(at + REACH + 1).min(size);
    let of_row = |i: usize| plane[i / width * width..][window(i % width, width)].iter().sum::<f32>();
    let rows: Vec<f32> = (0..plane.len()).map(of_row).collect();
    (0..plane.len()).map(|i| window(i / width, height).map(|y| rows[y * width + i % width]).sum()).collect()
}

/// The mean square error of four samples, in parts of the difference of their halves.
fn variance_of_four(sums: &Apart) -> f64 {
    let r = fall_of_variance(Some(sums.one), sums.two);
    r / (4.0 * (1.0 - r))
}

/// What is enough, by how far the centres are off and how samples compare to them.
fn verdict(centres: Range, sums: &Apart, target: Target) -> Look {
    if target.is_enough(&centres) {
        return Look::Enough(0, centres);
    }
    let r = fall_of_variance(Some(sums.one), sums.two);
    let four = variance_of_four(sums) * sums.two;
    let centre = (sums.centre - four).max(f64::MIN_POSITIVE);
    let of_four = (four / centre).sqrt();
    let of_two = (four / r / centre).sqrt();
    let of_three = of_two * (of_four / of_two).powf(THIRD);
    for (samples, of) in [(2, of_two), (3, of_three)] {
        let error = centres.times(of);
        if target.is_enough(&error.times(MARGIN_OF_EXPECTED)) {
            return Look::Enough(samples, error);
        }
    }
    Look::Beyond(centres.times(of_four))
}

#[cfg(test)]
mod tests {
    use super::super::Metric;
    use super::*;

    fn enough(centres: f64, sums: &Apart, value: f64) -> Option<u32> {
        match verdict(Range::exactly(centres), sums, Target { metric: Metric::Rmse, value }) {
            Look::Enough(samples, _) => Some(samples),
            Look::Beyond(_) => None,
        }
    }

    #[test]
    fn the_fewest_samples_that_are_enough_are_chosen() {
        // Independent samples of variance 1: one from the next is 2 apart, two from two 1, their mean has 1/4. Centres at a mean
        // square error of 1 are 1 + 1/4 from that mean. So two samples have 0.71 of the error, four 0.5, three 0.63.
        let sums = Apart { one: 2.0, two: 1.0, centre: 1.25 };
        assert_eq!(enough(0.1, &sums, 0.12), Some(0));
        assert_eq!(enough(0.1, &sums, 0.08), Some(2));
        assert_eq!(enough(0.1, &sums, 0.07), Some(3));
        assert_eq!(enough(0.1, &sums, 0.05), None);
    }

    #[test]
    fn what_is_noise_is_no_error_of_the_centres() {
        // Four samples of 0.4 whose halves, 0.2 and 0.6, are 0.4 apart are off by 0.2 themselves, of independent samples (1/4 of the
        // square). Centres at 0.5 are no further off than that, centres at 0.9 are: 0.5^2 - 0.2^2 = 0.21 of 0.25.
        let even = |value: f32| vec![[value; 3]; 12];
        let truth =
            |centre| without_noise(&even(centre), &even(0.4), [&even(0.2), &even(0.6)], (4, 0.25))[5][1];
        assert_eq!(truth(0.5), 0.5);
        assert!((truth(0.9) - (0.9 - 0.5 * 0.84f32.sqrt())).abs() < 1e-6, "{}", truth(0.9));
    }

    #[test]
    fn the_error_of_four_follows_from_the_halves() {
        let sums = Apart { one: 2.0, two: 1.0, centre: 1.25 };
        assert!((variance_of_four(&sums) - 0.25).abs() < 1e-12);
        let Look::Beyond(four) =
            verdict(Range::exactly(0.1), &sums, Target { metric: Metric::Rmse, value: 0.01 })
        else {
            panic!("a tenth of it is not enough")
        };
        assert!((four.middle - 0.05).abs() < 1e-12, "{four:?}");
    }
}
