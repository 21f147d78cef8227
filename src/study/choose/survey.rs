//! The error of a picture from a few squares of it. What is to be measured costs as much as rendering, and of a large picture some
//! squares say as well how large it is.
//!
//! Squares are drawn with chances p in proportion to a rough guess of their share, so the mean of `value / p` over those drawn is the
//! sum over all, whatever the guess was (Hansen and Hurwitz, On the Theory of Sampling from Finite Populations, 1943), and the
//! better the guess, the less it scatters. Drawn are the points of the additive recurrence of the golden ratio, which is spread more
//! evenly than chance: the standard error that is given is that of chance, and too large rather than too small.

use std::collections::HashMap;

use rayon::prelude::*;

use crate::film::TILE;

/// The side of a square in pixels.
pub const SIDE: u32 = 2 * TILE;

/// How many squares are drawn at a time.
const BATCH: usize = 12;

/// How often at most; where it is not clear by then, it is close enough to what was asked to be either.
const BATCHES: usize = 4;

/// The share of the mean guess that every square has at least: a guess of nothing may be wrong.
const LEAST_SHARE: f64 = 0.25;

/// So many standard errors to one side the truth is rarely beyond: one time in twenty.
const SURE: f64 = 1.645;

/// The squares of a picture.
#[derive(Debug, Clone, Copy)]
pub struct Squares {
    width: u32,
    height: u32,
}

impl Squares {
    /// Of a picture of so many pixels.
    pub fn new(width: u32, height: u32) -> Self {
        Squares { width, height }
    }

    fn across(&self) -> u32 {
        self.width.div_ceil(SIDE)
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        (self.across() * self.height.div_ceil(SIDE)) as usize
    }

    /// How many pixels they cover together.
    pub fn pixels(&self) -> f64 {
        f64::from(self.width) * f64::from(self.height)
    }

    /// How wide the picture is in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// The square that a pixel is in, counted from the picture's top left corner.
    pub fn at(&self, x: u32, y: u32) -> usize {
        (y / SIDE * self.across() + x / SIDE) as usize
    }

    /// Its pixels' numbers, row by row, in a picture of rows.
    pub fn rows(&self, square: usize) -> impl Iterator<Item = std::ops::Range<usize>> + use<> {
        let (x, y) = (square as u32 % self.across() * SIDE, square as u32 / self.across() * SIDE);
        let (width, right, bottom) = (self.width, (x + SIDE).min(self.width), (y + SIDE).min(self.height));
        (y..bottom).map(move |y| (y as usize * width as usize + x as usize)..(y * width + right) as usize)
    }

    /// The part of a picture in it, row by row.
    pub fn cut(&self, square: usize, pixels: &[[f32; 3]]) -> Vec<[f32; 3]> {
        self.rows(square).flat_map(|row| pixels[row].iter().copied()).collect()
    }

    /// How wide it is in pixels.
    pub fn width_of(&self, square: usize) -> u32 {
        SIDE.min(self.width - square as u32 % self.across() * SIDE)
    }

    /// A guess for each.
    pub fn guesses(&self, of_row: impl Fn(std::ops::Range<usize>) -> f64 + Sync) -> Vec<f64> {
        (0..self.count()).into_par_iter().map(|square| self.rows(square).map(&of_row).sum()).collect()
    }
}

/// Squares in the order that they are drawn in.
pub struct Draws {
    /// The chance of each.
    chances: Vec<f64>,
    /// The sum of the chances of each and of all before.
    up_to: Vec<f64>,
}

impl Draws {
    /// By a guess for each square, from 0 upwards.
    pub fn new(guesses: &[f64]) -> Self {
        let mean = guesses.iter().sum::<f64>() / guesses.len() as f64;
        let least = if mean > 0.0 { LEAST_SHARE * mean } else { 1.0 };
        let total: f64 = guesses.iter().map(|guess| guess + least).sum();
        let chances: Vec<f64> = guesses.iter().map(|guess| (guess + least) / total).collect();
        let mut sum = 0.0;
        let up_to = chances.iter().map(|chance| {
            sum += chance;
            sum
        });
        Draws { up_to: up_to.collect(), chances }
    }

    /// The square that is drawn after so many.
    fn nth(&self, index: usize) -> usize {
        const GOLDEN: f64 = 0.618_033_988_749_894_8;
        let at = (0.5 + index as f64 * GOLDEN).fract();
        self.up_to.partition_point(|&up_to| up_to <= at).min(self.chances.len() - 1)
    }

    /// Measures several values at once, each the sum over a square; `measure` is told the squares of a batch that were not
    /// measured before. Draws until `is_clear` says of their sums that it is, and returns these.
    ///
    /// # Errors
    /// Those of `measure`.
    pub fn survey<const N: usize, E>(
        &self,
        mut measure: impl FnMut(&[usize]) -> Result<Vec<[f64; N]>, E>,
        is_clear: impl Fn(&[Sum; N]) -> bool,
    ) -> Result<[Sum; N], E> {
        let mut known: HashMap<usize, [f64; N]> = HashMap::new();
        let mut drawn: Vec<usize> = Vec::new();
        loop {
            // Where a further batch would be about all there are, all are measured, and nothing is left to chance.
            let is_all = drawn.len() + BATCH >= self.chances.len();
            let next: Vec<usize> = match is_all {
                true => (0..self.chances.len()).collect(),
                false => (drawn.len()..drawn.len() + BATCH).map(|index| self.nth(index)).collect(),
            };
            let mut new: Vec<usize> =
                next.iter().copied().filter(|square| !known.contains_key(square)).collect();
            new.sort_unstable();
            new.dedup();
            let values = measure(&new)?;
            known.extend(new.iter().copied().zip(values));
            if is_all {
                let sum = |n: usize| next.iter().map(|square| known[square][n]).sum();
                return Ok(std::array::from_fn(|n| Sum { value: sum(n), deviation: 0.0 }));
            }
            drawn.extend(next);
            let sums = std::array::from_fn(|n| {
                Sum::of(drawn.iter().map(|&square| known[&square][n] / self.chances[square]))
            });
            if is_clear(&sums) || drawn.len() >= BATCH * BATCHES {
                return Ok(sums);
            }
        }
    }
}

/// An estimate of a sum over all squares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sum {
    /// It.
    pub value: f64,
    /// Its standard error.
    pub deviation: f64,
}

impl Sum {
    fn of(estimates: impl Iterator<Item = f64> + Clone) -> Self {
        let count = estimates.clone().count() as f64;
        let mean = estimates.clone().sum::<f64>() / count;
        let squares: f64 = estimates.map(|one| (one - mean).powi(2)).sum();
        Sum { value: mean, deviation: (squares / (count * (count - 1.0))).sqrt() }
    }

    /// What it hardly exceeds.
    pub fn at_most(&self) -> f64 {
        self.value + SURE * self.deviation
    }

    /// What it hardly falls below.
    pub fn at_least(&self) -> f64 {
        (self.value - SURE * self.deviation).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_cover_every_pixel_once() {
        let squares = Squares::new(70, 33);
        assert_eq!(squares.count(), 6);
        let mut seen = vec![0; 70 * 33];
        for square in 0..squares.count() {
            for row in squares.rows(square) {
                assert_eq!(row.len(), squares.width_of(square) as usize);
                for pixel in row {
                    assert_eq!(squares.at(pixel as u32 % 70, pixel as u32 / 70), square);
                    seen[pixel] += 1;
                }
            }
        }
        assert!(seen.iter().all(|&count| count == 1));
    }

    #[test]
    fn a_guess_in_proportion_leaves_nothing_to_chance() {
        // All chances in proportion to what is measured: each draw says the sum. The least share is given to the values, too.
        let values: Vec<f64> = (0..200).map(f64::from).collect();
        let least = LEAST_SHARE * values.iter().sum::<f64>() / 200.0;
        let measured =
            |squares: &[usize]| Ok::<_, ()>(squares.iter().map(|&s| [values[s] + least]).collect());
        let [sum] = Draws::new(&values).survey(measured, |_| true).unwrap();
        let expected = values.iter().sum::<f64>() + 200.0 * least;
        assert!((sum.value / expected - 1.0).abs() < 1e-12 && sum.deviation < 1e-9 * expected, "{sum:?}");
    }

    #[test]
    fn a_wrong_guess_is_off_by_its_standard_error() {
        let value = |square: usize| if square.is_multiple_of(3) { 5.0 } else { 1.0 };
        let measured = |squares: &[usize]| Ok::<_, ()>(squares.iter().map(|&s| [value(s)]).collect());
        let total: f64 = (0..600).map(value).sum();
        let [sum] = Draws::new(&vec![1.0; 600]).survey(measured, |_| false).unwrap();
        assert!((sum.value - total).abs() < 3.0 * sum.deviation && sum.deviation > 0.0, "{sum:?} of {total}");
    }

    #[test]
    fn of_few_squares_all_are_measured() {
        let mut asked = Vec::new();
        let measured = |squares: &[usize]| {
            asked.extend_from_slice(squares);
            Ok::<_, ()>(squares.iter().map(|&s| [s as f64]).collect())
        };
        let sums = Draws::new(&[0.0; 10]).survey(measured, |_| false).unwrap();
        assert_eq!(sums, [Sum { value: 45.0, deviation: 0.0 }]);
        assert_eq!(asked, (0..10).collect::<Vec<_>>());
    }
}
