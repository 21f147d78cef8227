//! How certain a pixel's value is, and when it is looked at.
//!
//! A pixel's samples come in groups, each a stretch of the sequence whose length is a power of two and which lies as evenly over the
//! pixel as the sequence promises. How far the groups' values lie apart says how uncertain their mean is: the evenness within a group
//! is counted, which the variance of single samples does not see. How evenly the groups lie among themselves is what theory says of
//! edges: the variance of the mean of n stratified samples falls as n^(-3/2) (Mitchell, Consequences of Stratified Sampling in
//! Graphics, SIGGRAPH 1996, section 3); scrambled Sobol sequences were measured to do the same. Where a pixel
//! holds more detail than samples, this is up to 1.7 times too sure of itself.
//!
//! What a pixel's own samples have all missed they cannot tell. So it also looks at the first samples of the eight pixels around
//! it ([`First`]): where those lie apart, a feature passes by of which the pixel may have a part that it has not seen ([`unseen`]). They are
//! computed for every pixel, also for those of other tiles and beyond a crop ([`super::samples::Field`]), and nothing else is
//! taken from a neighbour: so what becomes of a pixel depends on its place and the settings, not on which others are rendered.

use glam::{DVec3, Vec4};

use crate::film::ColourPipeline;
use crate::scene::Sampling;

/// Samples that every pixel takes first. With its neighbours' they are 36 within three pixels: few edges pass through all of them.
const USUAL_FLOOR: u32 = 4;

/// From so many samples on pixels are looked at more often than at every doubling. Of fewer the error is known too badly: a pixel that
/// is looked at often is stopped by the first look that errs.
const OFTEN_FROM: u32 = 32;

/// When a pixel is done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Adaptive {
    /// The standard error of the displayed value, 1 being white, below which a pixel is done.
    pub level: f64,
    /// Samples that every pixel takes first.
    pub floor: u32,
}

impl Adaptive {
    /// What the settings say, and the usual where they say nothing.
    pub fn new(sampling: &Sampling) -> Self {
        let most = sampling.most_samples();
        Adaptive {
            // Below 0 there is no error.
            level: sampling.noise.unwrap_or(-1.0),
            floor: sampling.min_samples.unwrap_or(USUAL_FLOOR).min(most),
        }
    }

    /// The next count of samples, above `taken`, at which pixels are looked at again: at the floor, at its doubles, from 32 on also halfway
    /// between them, and at the most.
    pub fn next_look(&self, taken: u32, most: u32) -> u32 {
        let mut step = self.floor;
        while step <= taken {
            let between = step.saturating_add(step / 2);
            if between > taken && step >= OFTEN_FROM {
                step = between;
                break;
            }
            step = step.saturating_mul(2);
        }
        step.min(most)
    }
}

/// How many groups there are at most; when they are full, two and two become one.
const GROUPS: usize = 8;

/// The samples of one pixel in groups of one size. In f32, whose rounding is far below any error that is asked for.
#[derive(Debug, Clone, Copy, Default)]
pub struct Groups {
    /// Sums of signed colours, and of signs.
    sums: [Vec4; GROUPS],
    /// Samples a group: 2 to this power.
    power: u32,
    taken: u32,
}

impl Groups {
    /// Takes in the next sample, which counts with a sign.
    #[inline(always)]
    pub fn add(&mut self, colour: [f32; 3], sign: f32) {
        if self.taken >> self.power == GROUPS as u32 {
            self.pair_up();
        }
        let [r, g, b] = colour;
        self.sums[(self.taken >> self.power) as usize % GROUPS] += Vec4::new(r, g, b, 1.0) * sign;
        self.taken += 1;
    }

    fn pair_up(&mut self) {
        for i in 0..GROUPS / 2 {
            self.sums[i] = self.sums[2 * i] + self.sums[2 * i + 1];
        }
        self.sums[GROUPS / 2..].fill(Vec4::ZERO);
        self.power += 1;
    }

    /// The variance of the mean of all samples, per channel; infinite for fewer than two groups. `mean` is the plain mean of
    /// the samples, `mean_sign` that of their signs in the long run.
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
        // Of independent groups the mean's variance would be theirs over their count; it falls by the power 3/2 where ever more
        // samples of a scrambled Sobol sequence meet edges.
        squares / ((count - 1.0) * count * count.sqrt())
    }

    /// The variance of a single sample, per channel, as far as the groups tell: 0 for fewer than two.
    fn spread(&self, mean: DVec3, mean_sign: f64) -> DVec3 {
        let full = (self.taken >> self.power) as usize;
        if full < 2 {
            return DVec3::ZERO;
        }
        let count = full as f64;
        self.variance(mean, mean_sign) * (count * count.sqrt() * f64::from(1 << self.power))
    }
}

/// What a pixel's first samples tell its neighbours: their mean, and the variance of one.
#[derive(Debug, Clone, Copy)]
pub struct First {
    mean: Vec4,
    variance: Vec4,
}

impl First {
    /// Of samples with this plain mean. `mean_sign` is the mean of their signs in the long run.
    pub fn new(groups: &Groups, mean: DVec3, mean_sign: f64) -> Self {
        let variance = groups.spread(mean, mean_sign);
        First { mean: mean.as_vec3().extend(0.0), variance: variance.as_vec3().extend(0.0) }
    }

    /// The mean square, per channel, of what a sample of the pixels `near` this one, itself among them, is off this one's mean. Pixels
    /// that are not finite are left out.
    #[inline(always)]
    pub fn spread<'a>(&self, near: impl IntoIterator<Item = &'a First>) -> Vec4 {
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

/// How much a feature that passes by a pixel is taken to weigh in it unseen ([`unseen`]).
const WEIGHT: f64 = 10.0;

/// The variance of a pixel's value, per channel, that may be hidden from its `taken` samples, where the first samples around it are
/// off by `around` in the mean square.
///
/// Of an edge of height h that cuts off a part a of the pixel, any a alike, n samples at random see nothing with a chance of
/// (1 - a)^n: the mean square of what they miss is the integral of (h a)^2 (1 - a)^n, 2 h^2 / n^3 for large n, and twice that for
/// both sides. Of n samples, one in each n-th of the pixel, and a part within one n-th, it is that of (h a)^2 (1 - n a), h^2 / (12 n^3),
/// and twice that. A line that crosses a square of three by three pixels crosses the one in the middle with a chance of a third
/// (Cauchy and Crofton), and the mean square around it is then 0.4 h^2 or so. So the weight is between 0.14 and 3.3 on
/// average. It is larger, because one edge that is missed costs more than many looks at nothing: between 1.6 and 15, larger weights
/// had the smaller error in the same time on the scenes that were measured, from 5 on by little.
pub fn unseen(around: Vec4, taken: u32) -> DVec3 {
    around.truncate().as_dvec3() * (WEIGHT / f64::from(taken).powi(3))
}

/// The standard error of what is displayed of a value: the largest of the three channels', 1 being white. Half of what lies
/// between what is displayed one standard error above and one below the value.
pub fn displayed_error(value: DVec3, error: DVec3, pipeline: ColourPipeline) -> f64 {
    let channel = |value: f64, error: f64| {
        (pipeline.displayed(value + error) - pipeline.displayed(value - error)) / 2.0
    };
    let channels = value.to_array().into_iter().zip(error.to_array());
    channels.map(|(value, error)| channel(value, error)).fold(0.0, f64::max)
}
