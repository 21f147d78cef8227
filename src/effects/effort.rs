//! How certain a pixel's value is, and when it is looked at.
//!
//! A pixel judges by its own samples alone, so what it becomes does not depend on which others are rendered. Its samples come
//! in groups, each a stretch of the sequence whose length is a power of two and which lies as evenly over the pixel as the
//! sequence promises. How far the groups' values lie apart says how uncertain their mean is: the evenness within a group is
//! counted, which the variance of single samples does not see. How evenly the groups lie among themselves is what theory says of
//! edges: the variance of the mean of n stratified samples falls as n^(-3/2) (Mitchell, Consequences of Stratified Sampling in
//! Graphics, SIGGRAPH 1996, section 3); scrambled Sobol sequences were measured to do the same. Where a
//! pixel holds more detail than samples, this is up to 1.7 times too sure of itself.

use glam::{DVec3, Vec4};

use crate::film::ColourPipeline;
use crate::scene::Sampling;

/// Samples that every pixel takes first: so many that an edge through the pixel is seldom missed.
const USUAL_FLOOR: u32 = 16;

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

    /// The next count of samples, above `taken`, at which pixels are looked at again: at the floor, then at 3/2, 2, 3, 4, 6, ...
    /// times the floor, and at the most.
    pub fn next_look(&self, taken: u32, most: u32) -> u32 {
        let mut step = self.floor;
        while step <= taken {
            let between = step.saturating_add(step / 2);
            if between > taken && step > 1 {
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

    /// The standard error of the mean of all samples, per channel; infinite for fewer than two groups. `mean` is the plain mean of
    /// the samples, `mean_sign` that of their signs in the long run.
    pub fn standard_error(&self, mean: DVec3, mean_sign: f64) -> DVec3 {
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
        let variance = squares / ((count - 1.0) * count.powf(1.5));
        DVec3::new(variance.x.sqrt(), variance.y.sqrt(), variance.z.sqrt())
    }
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
