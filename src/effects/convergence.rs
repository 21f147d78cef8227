//! The error estimate of adaptive sampling, and when it is evaluated.
//!
//! The samples of a pixel are kept in groups. Each group is a stretch of the pixel's sequence whose length is a power of two, and
//! so as evenly distributed over the pixel as the sequence guarantees. The variance between the groups' values thus includes the
//! stratification within a group, which the variance of single samples does not. Among the groups, the variance of the mean of n
//! stratified samples at an edge falls as n^(-3/2) (Mitchell, Consequences of Stratified Sampling in Graphics, SIGGRAPH 1996,
//! section 3), and that of scrambled Sobol points does, too. Where a pixel holds more detail than samples, the error is
//! underestimated by a factor of up to 1.7.
//!
//! A feature that all samples of a pixel missed does not show in their variance. The estimate therefore also uses the first
//! samples of the eight pixels around it ([`FirstSamples`]): their deviation bounds what may pass through the pixel unseen
//! ([`missed_variance`]). First samples are taken for every pixel of the tile and its apron
//! ([`super::region::SampledRegion`]), and nothing else is read from a neighbour. So the result depends on the pixel's place and
//! the settings, not on which other pixels are rendered.

use glam::{DVec3, Vec4};

use crate::scene::Sampling;

/// The default of [`Criterion::min_samples`]. With its neighbours a pixel then has 36 samples in three by three pixels, which few
/// edges pass between.
const DEFAULT_MIN_SAMPLES: u32 = 4;

/// From this many samples on, pixels are tested also halfway between two doublings. With fewer samples the error estimate is too
/// uncertain: the more tests, the likelier one of them ends a pixel by an underestimate.
const HALF_STEPS_FROM: u32 = 32;

/// The convergence criterion of a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criterion {
    /// The standard error of the displayed value, 1 being white, up to which a pixel has converged.
    pub max_error: f64,
    /// Samples that every pixel takes before it is tested.
    pub min_samples: u32,
}

impl Criterion {
    /// The criterion of the settings, with defaults.
    pub fn new(sampling: &Sampling) -> Self {
        let most = sampling.max_samples();
        Criterion {
            // No error is below 0: without a noise level no pixel converges.
            max_error: sampling.noise.unwrap_or(-1.0),
            min_samples: sampling.min_samples.unwrap_or(DEFAULT_MIN_SAMPLES).min(most),
        }
    }

    /// The next sample count above `taken` at which pixels are tested: `min_samples`, its doubles, from 32 on also halfway
    /// between them, and `most`.
    pub fn next_test(&self, taken: u32, most: u32) -> u32 {
        let mut count = self.min_samples;
        while count <= taken {
            let between = count.saturating_add(count / 2);
            if between > taken && count >= HALF_STEPS_FROM {
                count = between;
                break;
            }
            count = count.saturating_mul(2);
        }
        count.min(most)
    }
}

/// The most groups of a pixel. When all are full, they are merged in pairs.
const GROUPS: usize = 8;

/// The samples of one pixel in groups of equal size. In f32, whose rounding is far below the errors that are estimated.
#[derive(Debug, Clone, Copy, Default)]
pub struct SampleGroups {
    /// For each group, the sums of signed colours and of signs.
    sums: [Vec4; GROUPS],
    /// The samples in a group: 2 to this power.
    power: u32,
    taken: u32,
}

impl SampleGroups {
    /// Adds the next sample, whose filter weight has this sign.
    #[inline(always)]
    pub fn add(&mut self, colour: [f32; 3], sign: f32) {
        if self.taken >> self.power == GROUPS as u32 {
            self.merge_pairs();
        }
        let [r, g, b] = colour;
        self.sums[(self.taken >> self.power) as usize % GROUPS] += Vec4::new(r, g, b, 1.0) * sign;
        self.taken += 1;
    }

    fn merge_pairs(&mut self) {
        for i in 0..GROUPS / 2 {
            self.sums[i] = self.sums[2 * i] + self.sums[2 * i + 1];
        }
        self.sums[GROUPS / 2..].fill(Vec4::ZERO);
        self.power += 1;
    }

    /// The variance of the mean of all samples, per channel; infinite for fewer than two groups. `mean` is the mean of the
    /// samples without their signs, `mean_sign` the expected sign ([`crate::film::Filter::mean_sign`]).
    pub fn variance(&self, mean: DVec3, mean_sign: f64) -> DVec3 {
        let full = (self.taken >> self.power) as usize;
        if full < 2 {
            return DVec3::INFINITY;
        }
        let scale = 1.0 / (f64::from(1 << self.power) * mean_sign);
        let value = |sum: &Vec4| (sum.truncate().as_dvec3() - mean * f64::from(sum.w)) * scale;
        let groups = &self.sums[..full];
        let count = full as f64;
        let middle = groups.iter().map(value).sum::<DVec3>() / count;
        let squares: DVec3 =
            groups.iter().map(|group| (value(group) - middle) * (value(group) - middle)).sum();
        // Independent groups would give the groups' variance over their count; stratified ones give its power 3/2.
        squares / ((count - 1.0) * count * count.sqrt())
    }

    /// The variance of a single sample, per channel, estimated from the groups; 0 for fewer than two.
    fn sample_variance(&self, mean: DVec3, mean_sign: f64) -> DVec3 {
        let full = (self.taken >> self.power) as usize;
        if full < 2 {
            return DVec3::ZERO;
        }
        let count = full as f64;
        self.variance(mean, mean_sign) * (count * count.sqrt() * f64::from(1 << self.power))
    }
}

/// Mean and variance, per channel, of the first samples of a pixel.
#[derive(Debug, Clone, Copy)]
pub struct FirstSamples {
    mean: Vec4,
    variance: Vec4,
}

impl FirstSamples {
    /// From the samples of `groups`; the parameters are those of [`SampleGroups::variance`].
    pub fn new(groups: &SampleGroups, mean: DVec3, mean_sign: f64) -> Self {
        let variance = groups.sample_variance(mean, mean_sign);
        FirstSamples { mean: mean.as_vec3().extend(0.0), variance: variance.as_vec3().extend(0.0) }
    }

    /// The mean square deviation, per channel, of samples of the pixels `near` from this pixel's mean. `near` includes this
    /// pixel. Pixels that are not finite are left out.
    #[inline(always)]
    pub fn deviation<'a>(&self, near: impl IntoIterator<Item = &'a FirstSamples>) -> Vec4 {
        let (mut sum, mut count) = (Vec4::ZERO, 0.0f32);
        for other in near {
            let off = other.mean - self.mean;
            let square = off * off + other.variance;
            if square.is_finite() {
                sum += square;
                count += 1.0;
            }
        }
        sum / count.max(1.0)
    }
}

/// The factor of [`missed_variance`].
const WEIGHT: f64 = 10.0;

/// The variance of a pixel's value, per channel, from features that its `taken` samples missed, where the first samples around it
/// have the mean square deviation `around`.
///
/// An edge of height h cuts off a part a of the pixel, with a uniformly distributed. n random samples all miss that part with
/// probability (1 - a)^n, so the mean square of what they miss is the integral of (h a)^2 (1 - a)^n, which is 2 h^2 / n^3 for
/// large n, and twice that for both sides. With n stratified samples and a part within one stratum it is the integral of
/// (h a)^2 (1 - n a), which is h^2 / (12 n^3), and twice that. A line that crosses a square of three by three pixels crosses the
/// middle one with probability 1/3 (Cauchy and Crofton), and `around` is then about 0.4 h^2. So the factor of `around` / n^3 is 0.14
/// to 3.3 on average. `WEIGHT` is larger because a missed edge costs more than additional samples. Measurements:
/// docs/decisions.md.
pub fn missed_variance(around: Vec4, taken: u32) -> DVec3 {
    around.truncate().as_dvec3() * (WEIGHT / f64::from(taken).powi(3))
}

/// The standard error of the displayed value, 1 being white: half the difference between the values displayed for one standard
/// error above and one below `value`, the largest of the three channels. `displayed` gives display values, 0 to 1.
pub fn displayed_error(value: DVec3, error: DVec3, displayed: impl Fn(DVec3) -> DVec3) -> f64 {
    let difference = (displayed(value + error) - displayed(value - error)) / 2.0;
    // A tone map may lower a channel as all of them rise.
    difference.to_array().into_iter().map(f64::abs).fold(0.0, f64::max)
}
