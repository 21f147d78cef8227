//! Welch's t-test of each pixel: whether two estimates with independent noise converge to the same picture (Jung, Hanika and
//! Dachsbacher, Detecting Bias in Monte Carlo Renderers using Welch's t-test, JCGT 9(2), 2020; Welch, The Generalization of
//! "Student's" Problem when several different Population Variances are Involved, Biometrika 34, 1947).
//!
//! If the expected values are equal and means are normally distributed, the p-values of the pixels are uniform from 0 to 1; a
//! difference makes small ones more frequent. Channels are tested one by one, since those of a pixel depend on each other. Samples
//! of heavy tails bend the histogram also where nothing is wrong, so a control, two pictures of the same estimator, comes first;
//! blocks of pixels, whose means are closer to normal, bend it less.

mod estimate;

pub use estimate::{CHANNELS, Estimate};

use serde::{Deserialize, Serialize};

use super::distributions::{chi_squared_upper, normal_two_sided, student_two_sided};
use crate::error::{Error, Result};

/// Bins of the histogram of p-values.
pub const BINS: usize = 20;

/// The level of p-values whose frequency is reported.
pub const LOW: f64 = 0.01;

/// The probability that equal estimators are reported as different, if the assumptions hold.
pub const SIGNIFICANCE: f64 = 0.001;

/// The expected count of a bin from which the chi-squared distribution describes the statistic (Cochran, The chi-squared test of
/// goodness of fit, 1952).
const MIN_EXPECTED: f64 = 5.0;

/// The result for two pictures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TTest {
    /// Width of both in pixels.
    pub width: u32,
    /// Height of both in pixels.
    pub height: u32,
    /// Side in pixels of the blocks that are tested.
    pub block: u32,
    /// The least probability at which a channel is not reported as different: [`SIGNIFICANCE`] divided by the number of tests
    /// (Bonferroni).
    pub threshold: f64,
    /// Whether no test finds a difference.
    pub passed: bool,
    /// The result of each channel.
    pub channels: Vec<ChannelTest>,
}

/// The result for a channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelTest {
    /// The name, R, G or B.
    pub channel: String,
    /// Blocks that were tested.
    pub tested: u64,
    /// Blocks without variance in both pictures and with equal values, which are left out.
    pub left_out: u64,
    /// Blocks without variance in both pictures and with different values. Their p-value is 0.
    pub certain: u64,
    /// The p-values of the tested blocks in bins of equal width from 0 to 1.
    pub histogram: [u64; BINS],
    /// The share of p-values below [`LOW`].
    pub below_low: f64,
    /// Pearson's statistic of the histogram against a uniform one.
    pub chi_squared: f64,
    /// The probability of a statistic at least as great if p-values are uniform; `None` where there are too few.
    pub uniform: Option<f64>,
    /// The mean of the second picture less that of the first, over all pixels.
    pub difference: f64,
    /// The standard error of `difference`.
    pub standard_error: f64,
    /// The probability of a difference at least as great if the expected values are equal.
    pub equal_means: f64,
}

impl TTest {
    /// Tests squares of `block` pixels a side; the last of a row or column may be smaller.
    ///
    /// # Errors
    /// [`Error::Usage`] if the sizes differ, or the noise of both is from the same random numbers.
    pub fn between(a: &Estimate, b: &Estimate, block: u32) -> Result<Self> {
        let (width, height) = (a.width, a.height);
        if (width, height) != (b.width, b.height) {
            let what = format!("{width} x {height} pixels against {} x {}", b.width, b.height);
            return Err(Error::usage(format!("sizes differ: {what}"), "compare pictures of one size"));
        }
        if let Some(seed) = a.seed.filter(|_| a.seed == b.seed) {
            let what = format!("both pictures have the seed {seed}, so their noise is not independent");
            return Err(Error::usage(what, "render one of them with another `--seed`"));
        }
        let block = block.max(1);
        let channels: Vec<ChannelTest> = (0..3).map(|c| test_channel(a, b, c, block)).collect();
        let tests = channels.iter().map(|channel| 1 + usize::from(channel.uniform.is_some())).sum::<usize>();
        let threshold = SIGNIFICANCE / tests as f64;
        let passed = channels.iter().all(|channel| {
            channel.certain == 0
                && channel.equal_means >= threshold
                && channel.uniform.is_none_or(|p| p >= threshold)
        });
        Ok(TTest { width, height, block, threshold, passed, channels })
    }
}

/// Sums over pixels of what a test of the difference of their means takes.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    pixels: f64,
    difference: f64,
    /// The squared standard errors of the means.
    variance: f64,
    /// The squares of those, divided by their degrees of freedom.
    weighted: f64,
    /// The rounding of the means to `f32`.
    rounding: f64,
}

impl Sums {
    fn add_pixel(&mut self, a: &Estimate, b: &Estimate, channel: usize, pixel: usize) {
        let mean = |estimate: &Estimate| f64::from(estimate.means[channel][pixel]);
        self.pixels += 1.0;
        self.difference += mean(b) - mean(a);
        self.rounding += f64::from(f32::EPSILON) * (mean(a).abs() + mean(b).abs());
        for estimate in [a, b] {
            let count = f64::from(estimate.counts[pixel]);
            let variance = f64::from(estimate.variances[channel][pixel]) / count;
            self.variance += variance;
            self.weighted += variance * variance / (count - 1.0);
        }
    }

    fn add(&mut self, other: &Sums) {
        self.pixels += other.pixels;
        self.difference += other.difference;
        self.variance += other.variance;
        self.weighted += other.weighted;
        self.rounding += other.rounding;
    }

    /// Whether the means vary by no more than they are rounded.
    fn is_constant(&self) -> bool {
        self.variance.sqrt() <= self.rounding
    }

    /// The probability of a difference at least as great if the expected values are equal: Welch's statistic with the degrees of
    /// freedom of Welch and Satterthwaite (Satterthwaite, An Approximate Distribution of Estimates of Variance Components, 1946),
    /// for the sum of any number of means. For variances so small that squares underflow, the normal distribution.
    fn p_value(&self) -> f64 {
        if self.is_constant() {
            return f64::from(u8::from(self.difference.abs() <= self.rounding));
        }
        let t = self.difference / self.variance.sqrt();
        let degrees = self.variance * self.variance / self.weighted;
        if degrees.is_finite() { student_two_sided(t, degrees) } else { normal_two_sided(t) }
    }
}

fn test_channel(a: &Estimate, b: &Estimate, channel: usize, block: u32) -> ChannelTest {
    let (width, height) = (a.width, a.height);
    let (mut histogram, mut low, mut left_out, mut certain) = ([0; BINS], 0, 0, 0);
    let mut whole = Sums::default();
    for top in (0..height).step_by(block as usize) {
        for left in (0..width).step_by(block as usize) {
            let mut sums = Sums::default();
            for y in top..height.min(top.saturating_add(block)) {
                let row = y as usize * width as usize;
                for x in left..width.min(left.saturating_add(block)) {
                    sums.add_pixel(a, b, channel, row + x as usize);
                }
            }
            whole.add(&sums);
            let p = sums.p_value();
            if sums.is_constant() && p > 0.0 {
                left_out += 1;
                continue;
            }
            certain += u64::from(sums.is_constant());
            low += u64::from(p < LOW);
            histogram[((p * BINS as f64) as usize).min(BINS - 1)] += 1;
        }
    }
    let tested: u64 = histogram.iter().sum();
    let expected = tested as f64 / BINS as f64;
    let squares = histogram.iter().map(|&count| (count as f64 - expected) * (count as f64 - expected));
    let chi_squared = if tested == 0 { 0.0 } else { squares.sum::<f64>() / expected };
    let uniform = (expected >= MIN_EXPECTED).then(|| chi_squared_upper(chi_squared, (BINS - 1) as f64));
    ChannelTest {
        channel: CHANNELS[channel].into(),
        tested,
        left_out,
        certain,
        histogram,
        below_low: if tested == 0 { 0.0 } else { low as f64 / tested as f64 },
        chi_squared,
        uniform,
        difference: whole.difference / whole.pixels,
        standard_error: whole.variance.sqrt() / whole.pixels,
        equal_means: whole.p_value(),
    }
}

#[cfg(test)]
mod tests;
