//! What the halves of a picture's samples say of how far it is off: see [`super`].

use super::Metric;
use super::survey::{Draws, Squares, Sum};
use crate::metrics::{Values, displayed, mean_over};

/// The range of r, see [`super`].
pub const RATIOS: (f64, f64) = (0.353_553_390_593_273_8, 0.5);

/// A picture of so many samples, and its halves.
pub struct Level {
    /// Samples a pixel.
    pub samples: u32,
    /// Their mean.
    pub pixels: Vec<[f32; 3]>,
    halves: [Vec<[f32; 3]>; 2],
    /// The mean square of the difference of its halves, in the film's numbers up to 1.
    apart: Option<f64>,
    /// By which share of that difference it is off.
    share: f64,
    /// r up to this many samples.
    fall: f64,
}

impl Level {
    /// A picture of one sample.
    pub fn of_one(pixels: Vec<[f32; 3]>) -> Self {
        Level { samples: 1, pixels, halves: Default::default(), apart: None, share: 0.0, fall: RATIOS.1 }
    }

    /// A picture of two samples, and r from two to four where it was measured.
    pub fn of_two(pixels: Vec<[f32; 3]>, fall: f64) -> Self {
        Level { samples: 2, fall, ..Level::of_one(pixels) }
    }

    /// The picture of twice as many samples, by another half.
    pub fn joined_by(self, more: Vec<[f32; 3]>) -> Self {
        let pixels = joined(&self.pixels, self.samples, &more, self.samples);
        let held = |c: f64| c.clamp(0.0, 1.0);
        let apart = mean_over(&self.pixels, &more, |a, b| (held(a) - held(b)).powi(2));
        let fall = if self.apart.is_some() { fall_of_variance(self.apart, apart) } else { self.fall };
        let share = share_of_difference(fall);
        Level {
            fall,
            samples: 2 * self.samples,
            pixels,
            halves: [self.pixels, more],
            apart: Some(apart),
            share,
        }
    }

    /// The picture with some samples more.
    pub fn extended_by(&mut self, more: &[[f32; 3]], of_more: u32) {
        self.pixels = joined(&self.pixels, self.samples, more, of_more);
        self.samples += of_more;
    }

    /// How far it is off: root mean square, in the film's numbers.
    pub fn off(&self) -> f64 {
        // Not 0, to be divided by.
        (self.share * self.apart.unwrap_or(0.0).sqrt()).max(f64::MIN_POSITIVE)
    }

    /// The estimate of an error; `is_clear` says whether it is sure enough, from what it is at least, is and is at most.
    pub fn error(
        &self,
        (metric, values): (Metric, Values),
        squares: &Squares,
        is_clear: impl Fn(&Range) -> bool,
    ) -> Range {
        let [a, b] = &self.halves;
        if metric == Metric::Max {
            // A largest value is not one of a few squares.
            let moved = self.moved([&self.pixels, a, b].map(|pixels| displayed(pixels, values)));
            return Range::exactly(metric.of(metric.amount(&moved[0], &moved[1], squares.width()), squares));
        }
        let guesses = squares.guesses(|row| {
            let (a, b) = (a[row.clone()].as_flattened(), b[row].as_flattened());
            summed(a, b, |a, b| metric.guess(about_displayed(a, values) - about_displayed(b, values)))
        });
        let measure = |chosen: &[usize]| {
            let one = |&square: &usize| {
                let cut = [&self.pixels, a, b].map(|pixels| displayed(&squares.cut(square, pixels), values));
                let [shown, moved] = self.moved(cut);
                [metric.amount(&shown, &moved, squares.width_of(square))]
            };
            Ok::<_, std::convert::Infallible>(chosen.iter().map(one).collect())
        };
        let range = |sum: &Sum| Range::of(sum, |amount| metric.of(amount, squares));
        match Draws::new(&guesses).survey(measure, |[sum]: &[Sum; 1]| is_clear(&range(sum))) {
            Ok([sum]) => range(&sum),
        }
    }

    fn moved(&self, [picture, a, b]: [Vec<[f32; 3]>; 3]) -> [Vec<[f32; 3]>; 2] {
        let moved = moved(&picture, [&a, &b], self.share);
        [picture, moved]
    }
}

/// An error, and the bounds that it hardly leaves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    pub least: f64,
    pub middle: f64,
    pub most: f64,
}

impl Range {
    /// One that is known.
    pub fn exactly(value: f64) -> Self {
        Range { least: value, middle: value, most: value }
    }

    /// That of what is summed up.
    pub fn of(sum: &Sum, error: impl Fn(f64) -> f64) -> Self {
        Range { least: error(sum.at_least()), middle: error(sum.value), most: error(sum.at_most()) }
    }

    /// Of so many times the error.
    pub fn times(self, factor: f64) -> Self {
        Range { least: self.least * factor, middle: self.middle * factor, most: self.most * factor }
    }
}

/// The mean of two means of so many.
pub fn joined(a: &[[f32; 3]], of_a: u32, b: &[[f32; 3]], of_b: u32) -> Vec<[f32; 3]> {
    let (of_a, of_b) = (f64::from(of_a), f64::from(of_b));
    let mean = |a: f32, b: f32| ((f64::from(a) * of_a + f64::from(b) * of_b) / (of_a + of_b)) as f32;
    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| mean(a[c], b[c]))).collect()
}

/// About what a display shows, at a tenth of the cost.
#[inline(always)]
pub fn about_displayed(c: f32, values: Values) -> f32 {
    let c = c.clamp(0.0, 1.0);
    if values == Values::Linear { c.sqrt() } else { c }
}

/// The sum of `f` of both, in eight sums side by side that vector instructions can add to.
#[inline(always)]
pub fn summed(a: &[f32], b: &[f32], f: impl Fn(f32, f32) -> f32) -> f64 {
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

/// By which share of the difference of its halves a picture is off, by r.
fn share_of_difference(r: f64) -> f64 {
    (r / (4.0 * (1.0 - r))).sqrt()
}

/// r, see [`super`]. `before` and `now` are the mean squares of the difference of both halves at half as many samples, and at these.
pub fn fall_of_variance(before: Option<f64>, now: f64) -> f64 {
    let measured = before.filter(|&before| before > 0.0).map_or(RATIOS.1, |before| now / before);
    measured.clamp(RATIOS.0, RATIOS.1)
}

/// A picture moved by a share of a difference.
pub fn moved(shown: &[[f32; 3]], [a, b]: [&[[f32; 3]]; 2], share: f64) -> Vec<[f32; 3]> {
    let share = share as f32;
    let pixel =
        |i: usize| std::array::from_fn(|c| (shown[i][c] + share * (a[i][c] - b[i][c])).clamp(0.0, 1.0));
    (0..shown.len()).map(pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_follows_from_how_variance_falls() {
        // Independent halves: the mean of two is off by half of what lies between them, on average.
        let share = |before, now| share_of_difference(fall_of_variance(before, now));
        assert_eq!(share(None, 1.0), 0.5);
        assert_eq!(share(Some(2.0), 1.0), 0.5);
        // Variance that does not fall at all is not believed, nor one that falls faster than theory says.
        assert_eq!(share(Some(1.0), 1.0), 0.5);
        // r / (4 (1 - r)) of 2^-1.5 is 0.136729.
        assert!((share(Some(10.0), 1.0).powi(2) - 0.136_729).abs() < 1e-6);
    }

    #[test]
    fn means_are_joined_by_how_many_they_are_of() {
        // (4 * 1 + 2 * 4) / 6 = 2.
        assert_eq!(joined(&[[1.0; 3]], 4, &[[4.0; 3]], 2), [[2.0; 3]]);
    }

    #[test]
    fn sums_side_by_side_are_of_all() {
        // 1 + 2 + … + 20 = 210.
        let a: Vec<f32> = (1..=20).map(|i| i as f32).collect();
        assert_eq!(summed(&a, &[0.0; 20], |a, b| a - b), 210.0);
    }

    #[test]
    fn a_picture_stays_on_the_display_when_moved() {
        let (a, b) = ([[1.0, 0.5, 0.0]], [[0.0, 0.25, 1.0]]);
        assert_eq!(moved(&[[0.75; 3]], [&a, &b], 0.5), [[1.0, 0.875, 0.25]]);
    }
}
