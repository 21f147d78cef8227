//! The error estimate of adaptive sampling, and when it is evaluated.
//!
//! The error of a pixel's mean is estimated from its neighbours, as if the pixel were like these: from the means of as
//! many samples of each ([`SampleEstimate`]). Its own samples must not decide how many of them there are
//! ([`super::samples`]).
//!
//! How the variance of a pixel's mean falls with the number n of its samples depends on the integrand ([`Integrand`]):
//!
//! - Where a sample is a function of its film position, as with edges and textures, samples are stratified. They are
//!   kept in groups ([`SampleGroups`]), each a stretch of the pixel's sequence whose length is a power of two, and so
//!   as evenly distributed over the pixel as the sequence guarantees. The variance between the groups' values thus
//!   includes the stratification within a group, which the variance of single samples does not. Among the groups, the
//!   variance of the mean falls as n^(-3/2) (Mitchell, Consequences of Stratified Sampling in Graphics, SIGGRAPH 1996,
//!   section 3), and that of scrambled Sobol points does, too. Where a pixel holds more detail than samples, the error
//!   is underestimated by a factor of up to 1.7.
//! - Where it also depends on random numbers, as with ambient occlusion, soft shadows and paths, nothing but 1/n is
//!   certain: the variance is that of single samples over n, which bounds it from above, pooled with that of the groups
//!   over their count.
//!
//! What no sample has shown has no variance. Four terms bound it, from first samples ([`FirstSamples`]): their
//! deviation among the neighbours, for features that may pass through the pixel unseen ([`missed_variance`]); their
//! variance, to which that of few samples is pooled; their number, for events that are too rare to have been seen
//! ([`unseen_variance`]); and, where the plan has light that few samples find, the variance of isolated pixels in a
//! wider neighbourhood ([`FirstSamples::isolated_variance`]).
//!
//! First samples are taken for every pixel of the tile and its apron ([`super::region::SampledRegion`]). So the result
//! depends on the pixel's place and the settings, not on which other pixels are rendered.

use glam::{DVec3, Vec4};

use super::variance::SampleVariance;
use crate::scene::Sampling;

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
        Criterion {
            // No error is below 0: without a noise level no pixel converges.
            max_error: sampling.noise.unwrap_or(-1.0),
            min_samples: sampling.min_samples(),
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

/// What the samples of a pixel are a function of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Integrand {
    /// The film position, of stratified samples.
    Stratified,
    /// Also random numbers; or the positions are independent.
    Random,
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

    /// The pixel's value, like [`super::samples::SampleSum::value`].
    fn value(&self, mean: DVec3, mean_sign: f64) -> DVec3 {
        if mean_sign == 1.0 || self.taken == 0 {
            return mean;
        }
        let all = self.sums.iter().sum::<Vec4>();
        mean + (all.truncate().as_dvec3() - mean * f64::from(all.w)) / (f64::from(self.taken) * mean_sign)
    }

    /// The number of groups that are full.
    fn full(&self) -> u32 {
        self.taken >> self.power
    }

    /// The variance of the mean of all samples, per channel, where nothing but the samples within a group is
    /// stratified; infinite for fewer than two groups. `mean` is the mean of the samples without their signs,
    /// `mean_sign` the expected sign ([`crate::film::ReconstructionFilter::mean_sign`]).
    fn independent_variance(&self, mean: DVec3, mean_sign: f64) -> DVec3 {
        let full = self.full() as usize;
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
        squares / ((count - 1.0) * count)
    }
}

/// Mean and variance, per channel, of the first samples of a pixel.
#[derive(Debug, Clone, Copy)]
pub struct FirstSamples {
    mean: Vec4,
    /// Unbiased; 0 for one sample.
    variance: Vec4,
}

impl From<&SampleVariance> for FirstSamples {
    fn from(samples: &SampleVariance) -> Self {
        let variance = samples.unbiased().unwrap_or(DVec3::ZERO);
        FirstSamples { mean: samples.mean().as_vec3().extend(0.0), variance: variance.as_vec3().extend(0.0) }
    }
}

/// Statistics of the first samples around a pixel.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Neighbourhood {
    /// The mean square deviation, per channel, of a sample from the mean of all.
    pub deviation: Vec4,
    /// The mean variance, per channel, of a sample within its pixel.
    pub variance: Vec4,
    /// The part of the mean variance in a wider neighbourhood that isolated pixels have.
    pub isolated: Vec4,
}

impl Neighbourhood {
    /// The statistics of the pixels `near`. Pixels that are not finite are left out.
    #[inline(always)]
    pub fn new<'a>(near: impl Iterator<Item = &'a FirstSamples> + Clone) -> Self {
        let finite = near.filter(|first| first.mean.is_finite() && first.variance.is_finite());
        let scale = 1.0 / finite.clone().count().max(1) as f32;
        let mean = finite.clone().map(|first| first.mean).sum::<Vec4>() * scale;
        let variance = finite.clone().map(|first| first.variance).sum::<Vec4>() * scale;
        let squares = finite.map(|first| (first.mean - mean) * (first.mean - mean)).sum::<Vec4>();
        Neighbourhood { deviation: squares * scale + variance, variance, isolated: Vec4::ZERO }
    }
}

/// The radius of the square of pixels whose first samples are read for light that few samples find.
pub const RARE_LIGHT_RADIUS: u32 = 7;

/// The radius of the square of pixels whose first samples the test of a pixel reads.
pub fn neighbourhood_radius(has_rare_light: bool) -> u32 {
    // Whether a pixel is isolated depends on those around it.
    if has_rare_light { RARE_LIGHT_RADIUS + 1 } else { 1 }
}

impl FirstSamples {
    /// The variance of a pixel whose first samples vary more than half as much as those of all pixels `around` it
    /// together; 0 for others. Rare events, such as light of a small lamp through a lens, appear in isolated pixels;
    /// edges also in the pixels beside them.
    pub fn isolated_variance<'a>(&self, around: impl IntoIterator<Item = &'a FirstSamples>) -> Vec4 {
        let of_others: f32 = around.into_iter().map(|other| other.variance.element_sum()).sum();
        let own = self.variance.element_sum();
        if 2.0 * own > of_others && own.is_finite() { self.variance } else { Vec4::ZERO }
    }
}

/// The weight of the neighbourhood's variance in [`SampleEstimate::variance_of_mean`], in samples: that of the eight
/// neighbours, one sample each.
const PRIOR_SAMPLES: f32 = 8.0;

/// The weight in [`SampleEstimate::variance_of_mean`] of the variance of isolated pixels, in samples. Where events have
/// the probability p and none is seen, a pixel takes more samples the larger p is, so that n p is 5 to 14 and hardly
/// any ends without one.
const ISOLATED_SAMPLES: f32 = 64.0;

/// The weight in [`SampleEstimate::variance_of_mean`] of samples that are not stratified, in groups: half of all
/// groups.
const PRIOR_GROUPS: f32 = 4.0;

/// A pixel's value, and the variance of a mean of as many samples.
#[derive(Debug, Clone, Copy, Default)]
pub struct SampleEstimate {
    /// The value of the pixel.
    value: Vec4,
    /// The variance of a sample; infinite for one.
    variance: Vec4,
    /// The variance of the mean where nothing but the samples within a group is stratified; infinite for one group.
    between: Vec4,
    samples: u32,
    /// Groups that are full.
    groups: u32,
}

impl SampleEstimate {
    /// The estimate from samples in both forms. `mean_sign` is the expected sign of the filter's weights.
    pub fn new(samples: &SampleVariance, groups: &SampleGroups, mean_sign: f64) -> Self {
        let mean = samples.mean();
        let variance = samples.unbiased().unwrap_or(DVec3::INFINITY) / (mean_sign * mean_sign);
        let [value, variance, between] =
            [groups.value(mean, mean_sign), variance, groups.independent_variance(mean, mean_sign)]
                .map(|v| v.as_vec3().extend(0.0));
        SampleEstimate { value, variance, between, samples: samples.count(), groups: groups.full() }
    }

    /// The number of samples.
    pub fn count(&self) -> u32 {
        self.samples
    }

    /// The variance of the mean, per channel; infinite for one sample.
    #[inline(always)]
    pub fn variance_of_mean(&self, integrand: Integrand, around: &Neighbourhood) -> Vec4 {
        match integrand {
            // Independent groups would give the groups' variance over their count; stratified ones give its power 3/2.
            Integrand::Stratified => self.between / (self.groups as f32).sqrt(),
            Integrand::Random => self.random_variance(around),
        }
    }

    /// [`SampleEstimate::variance_of_mean`] for [`Integrand::Random`].
    ///
    /// The variance of few samples is often far too low: that of four rays to a light of which a tenth is visible is 0
    /// in two of three pixels. It is pooled with that around, as the mean of a posterior with a conjugate prior (Gelman
    /// and others, Bayesian Data Analysis, 3rd edition, section 2.6). The larger of the own and the pooled variance
    /// counts, because an underestimate ends a pixel and an overestimate is corrected by further samples.
    ///
    /// Stratification shows in the groups: their variance over their count has the mean of the true variance or a
    /// larger one, as the samples of a group are stratified and two groups are no less alike than independent ones. It
    /// is that of eight numbers at most, so it is pooled in turn, with the variance of samples that are not stratified,
    /// which bounds it from above.
    #[inline(always)]
    fn random_variance(&self, around: &Neighbourhood) -> Vec4 {
        let (samples, degrees) = (self.samples as f32, self.samples.saturating_sub(1) as f32);
        let pooled = (self.variance * degrees + around.variance * PRIOR_SAMPLES) / (degrees + PRIOR_SAMPLES);
        let rare = around.isolated * (ISOLATED_SAMPLES / (degrees + ISOLATED_SAMPLES));
        let random = (self.variance.max(pooled) + rare) / samples;
        // Groups of one sample are not stratified.
        if self.groups == self.samples {
            return random;
        }
        let degrees = self.groups.saturating_sub(1) as f32;
        (self.between * degrees + random * PRIOR_GROUPS) / (degrees + PRIOR_GROUPS)
    }
}

/// The value of a pixel and the variance of its mean, per channel, by the estimates of pixels around it: the mean of
/// their values, and the root of the mean fourth power of their variances, in which the larger ones count for more, as
/// an edge crosses few of them. Pixels that are not finite are left out; without others the variance is infinite.
#[inline(always)]
pub fn value_and_variance<'a>(
    near: impl Iterator<Item = &'a SampleEstimate>,
    integrand: Integrand,
    around: &Neighbourhood,
) -> (DVec3, DVec3) {
    let (mut values, mut powers, mut count) = (Vec4::ZERO, DVec3::ZERO, 0u16);
    for estimate in near {
        let variance = estimate.variance_of_mean(integrand, around);
        if variance.is_finite() && estimate.value.is_finite() {
            // In f64: fourth powers of dim light underflow in f32.
            let variance = variance.truncate().as_dvec3();
            let square = variance * variance;
            (values, powers, count) = (values + estimate.value, powers + square * square, count + 1);
        }
    }
    if count == 0 {
        return (DVec3::ZERO, DVec3::INFINITY);
    }
    let (values, powers) = (values.truncate().as_dvec3() / f64::from(count), powers / f64::from(count));
    (values, DVec3::from(powers.to_array().map(|power| power.sqrt().sqrt())))
}

/// The variance of the mean of `taken` samples of a pixel from events that none of `observed` samples of its neighbours
/// has shown. Its own may have: they are not looked at.
///
/// The probability p of an event that has not happened in n samples is taken to be 1 / (2 (n + 1)), its posterior mean
/// by Jeffreys' prior, the beta distribution of parameters 1/2 and 1/2 (Gelman and others, Bayesian Data Analysis, 3rd
/// edition, section 2.8). Such an event may take away the light of the pixel, `value`, or add as much as is missing to
/// what is displayed as white, `white`: p (1 - p) of the larger square is the variance of a sample.
pub fn unseen_variance(value: DVec3, white: f64, observed: u32, taken: u32) -> DVec3 {
    let light = value.clamp(DVec3::ZERO, DVec3::splat(white));
    let change = light.max(white - light);
    let probability = 1.0 / (2.0 * (f64::from(observed) + 1.0));
    change * change * (probability * (1.0 - probability) / f64::from(taken))
}

/// Whether the displayed error of a value, and the root of the mean fourth power of the errors at the values of the
/// pixels `near` it, are at most `max_error`: the mean of a lamp and of what is beside it is displayed as white, whatever
/// the error.
pub fn is_displayed_within<'a>(
    max_error: f64,
    (value, variance): (DVec3, DVec3),
    near: impl Iterator<Item = &'a SampleEstimate> + Clone,
    displayed: impl Fn(DVec3) -> DVec3,
) -> bool {
    // Without variance, as on a background, the error is 0; this saves the conversion to display values.
    if variance == DVec3::ZERO {
        return true;
    }
    let error = DVec3::from(variance.to_array().map(f64::sqrt));
    let at = |value: DVec3| displayed_error(value, error, &displayed);
    at(value) <= max_error && {
        let count = near.clone().count() as f64;
        near.map(|near| at(near.value.truncate().as_dvec3()).powi(4)).sum::<f64>()
            <= count * max_error.powi(4)
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

/// The standard error of the displayed value, 1 being white: the larger of the differences to the values displayed for
/// one standard error above and one below `value`, the largest of the three channels. `displayed` gives display values,
/// 0 to 1. Half the difference of the two would count for half where one of them is clipped, as in black pixels.
pub fn displayed_error(value: DVec3, error: DVec3, displayed: impl Fn(DVec3) -> DVec3) -> f64 {
    let middle = displayed(value);
    let differences = [displayed(value + error) - middle, displayed(value - error) - middle];
    // A tone map may lower a channel as all of them rise.
    differences.into_iter().flat_map(|difference| difference.to_array()).map(f64::abs).fold(0.0, f64::max)
}
