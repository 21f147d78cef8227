//! Reconstruction filters.
//!
//! The value of a pixel is the integral of the picture around its centre, weighted by the filter. Sample positions are
//! distributed with density proportional to the filter's absolute value ("filter importance sampling": Ernst,
//! Stamminger and Greiner 2006; Pharr, Jakob and Humphreys, Physically Based Rendering, 4th edition, section 8.8). All
//! samples then have equal weight up to sign, and pixels do not share samples.
//!
//! All filters are separable, with the same function of x and y, symmetric, and of unit integral.

use serde::{Deserialize, Serialize};

/// Shapes of reconstruction filters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FilterShape {
    /// Constant within the radius.
    Box,
    /// Falls linearly to 0 at the radius.
    Tent,
    /// A normal distribution of standard deviation `radius / 3`, shifted down to reach 0 at the radius.
    #[default]
    Gaussian,
    /// Mitchell and Netravali, Reconstruction Filters in Computer Graphics (SIGGRAPH 1988), with B = C = 1/3: negative
    /// from 4/7 of its radius on, which sharpens edges.
    Mitchell,
}

names!(FilterShape { Box = "box", Tent = "tent", Gaussian = "gaussian", Mitchell = "mitchell" });

impl FilterShape {
    /// Default radius in pixels: the pixel itself, its bilinear neighbourhood, a standard deviation of half a pixel (as
    /// in pbrt-v4), the paper's support of four pixels.
    pub fn default_radius(self) -> f64 {
        match self {
            FilterShape::Box => 0.5,
            FilterShape::Tent => 1.0,
            FilterShape::Gaussian => 1.5,
            FilterShape::Mitchell => 2.0,
        }
    }
}

/// Range of filter radii in pixels. Smaller filters place all samples at one point; larger ones only blur.
pub const RADII: std::ops::RangeInclusive<f64> = 0.01..=32.0;

/// Number of intervals in the table of quantiles.
const STEPS: usize = 2048;

/// A filter with its tables for sampling.
#[derive(Debug, Clone)]
pub struct ReconstructionFilter {
    shape: FilterShape,
    /// Quantiles of the filter's absolute value on one side of the centre, at equal steps from 0 to 1, in pixels.
    quantiles: Box<[f32; STEPS + 1]>,
    /// Integral of the absolute value of the filter along one axis.
    absolute: f64,
    /// Distance beyond which the filter is negative, in pixels.
    sign_change: f64,
}

impl ReconstructionFilter {
    /// A filter of a shape and a radius in pixels, clamped to [`RADII`].
    pub fn new(shape: FilterShape, radius: f64) -> Self {
        let radius = if radius.is_nan() { shape.default_radius() } else { radius };
        let radius = radius.clamp(*RADII.start(), *RADII.end());
        let (quantiles, half) = quantiles(shape);
        let quantiles = Box::new(std::array::from_fn(|step| (quantiles[step] * radius) as f32));
        let sign_change = match shape {
            FilterShape::Mitchell => MITCHELL_ZERO * radius,
            _ => f64::INFINITY,
        };
        ReconstructionFilter { shape, quantiles, absolute: half / half_integral(shape), sign_change }
    }

    /// Whether the filter has negative lobes.
    pub fn is_signed(&self) -> bool {
        self.shape == FilterShape::Mitchell
    }

    /// Mean sign of samples: the integral of the filter over that of its absolute value, in the plane.
    pub fn mean_sign(&self) -> f64 {
        self.absolute.powi(-2)
    }

    /// Half the width of a box filter, in pixels, within which all places are equally likely; `None` for other shapes.
    pub fn box_radius(&self) -> Option<f64> {
        (self.shape == FilterShape::Box).then(|| f64::from(self.quantiles[STEPS]))
    }

    /// Maps two random numbers in [0, 1) to a sample position relative to the pixel's centre, in pixels, and the
    /// sample's sign. Monotone in both numbers, so that stratification is preserved.
    #[inline(always)]
    pub fn sample(&self, u: [f32; 2]) -> ([f64; 2], f64) {
        let [x, y] = u.map(|u| self.quantile(f64::from(u)));
        (([x, y]), self.sign(x) * self.sign(y))
    }

    #[inline(always)]
    fn sign(&self, x: f64) -> f64 {
        if x.abs() > self.sign_change { -1.0 } else { 1.0 }
    }

    #[inline(always)]
    fn quantile(&self, u: f64) -> f64 {
        let v = 2.0 * u - 1.0;
        let place = v.abs() * STEPS as f64;
        let step = (place as usize).min(STEPS - 1);
        let (low, high) = (f64::from(self.quantiles[step]), f64::from(self.quantiles[step + 1]));
        (low + (high - low) * (place - step as f64)).copysign(v)
    }
}

/// Zero of the filter of Mitchell and Netravali of radius 1: beyond half the radius, with B = C = 1/3, the filter is
/// `(2 - t)^2 (8 - 7 t) / 18` at `t` = 2 x.
const MITCHELL_ZERO: f64 = 4.0 / 7.0;

/// The filter of radius 1 at `x` >= 0, not normalised.
fn profile(shape: FilterShape, x: f64) -> f64 {
    if x > 1.0 {
        return 0.0;
    }
    match shape {
        FilterShape::Box => 1.0,
        FilterShape::Tent => 1.0 - x,
        // The radius is three standard deviations.
        FilterShape::Gaussian => (-4.5 * x * x).exp() - (-4.5f64).exp(),
        FilterShape::Mitchell => {
            let t = 2.0 * x;
            if t < 1.0 {
                (7.0 * t - 12.0) * t * t + 16.0 / 3.0
            } else {
                (2.0 - t).powi(2) * (8.0 - 7.0 * t) / 3.0
            }
        }
    }
}

/// Integral of [`profile`] from 0 to 1.
fn half_integral(shape: FilterShape) -> f64 {
    (0..STEPS).map(|step| simpson(|x| profile(shape, x), step)).sum()
}

/// Quantiles of the absolute value of [`profile`] at [`STEPS`] equal steps, and its integral.
fn quantiles(shape: FilterShape) -> (Vec<f64>, f64) {
    let absolute = |x: f64| profile(shape, x).abs();
    let mut sums = vec![0.0];
    for step in 0..STEPS {
        sums.push(sums[step] + simpson(absolute, step));
    }
    let all = sums[STEPS];
    let mut step = 0;
    let quantile = |share: usize| {
        let wanted = all * share as f64 / STEPS as f64;
        while step + 1 < STEPS && sums[step + 1] < wanted {
            step += 1;
        }
        // Within a step the filter is taken as linear, from a to b: the positive root of (b - a) / 2 s^2 + a s = rest.
        let [a, b] = [step, step + 1].map(|i| absolute(i as f64 / STEPS as f64));
        let rest = (wanted - sums[step]) * STEPS as f64;
        let root = (a * a + 2.0 * (b - a) * rest).max(0.0).sqrt();
        let within = if a + root > 0.0 { 2.0 * rest / (a + root) } else { 1.0 };
        (step as f64 + within.clamp(0.0, 1.0)) / STEPS as f64
    };
    let mut quantiles: Vec<f64> = (0..STEPS).map(quantile).collect();
    quantiles.push(1.0);
    (quantiles, all)
}

/// Simpson's rule over one of [`STEPS`] equal intervals of 0 to 1.
fn simpson(f: impl Fn(f64) -> f64, step: usize) -> f64 {
    let h = 1.0 / STEPS as f64;
    let x = step as f64 * h;
    (f(x) + 4.0 * f(x + h / 2.0) + f(x + h)) * h / 6.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn usual() -> [ReconstructionFilter; 4] {
        FilterShape::ALL.map(|shape| ReconstructionFilter::new(shape, shape.default_radius()))
    }

    /// A filter of the default radius and unit integral along one axis, by the distance from the centre.
    fn value(shape: FilterShape) -> impl Fn(f64) -> f64 {
        let radius = shape.default_radius();
        let integral = 2.0 * half_integral(shape) * radius;
        move |x| profile(shape, (x / radius).abs()) / integral
    }

    /// The integral of `x^power` times `f` within the default radius along one axis, by the midpoint rule.
    fn moment(shape: FilterShape, power: i32, f: impl Fn(f64) -> f64) -> f64 {
        let n = 100_000;
        let radius = shape.default_radius();
        let h = 2.0 * radius / f64::from(n);
        (0..n).map(|i| (f64::from(i) + 0.5) * h - radius).map(|x| x.powi(power) * f(x) * h).sum()
    }

    #[test]
    fn samples_have_the_moments_of_their_filter() {
        // At the midpoints of n equal parts of 0 to 1 the mean of sign * x^k is the moment over the integral of the
        // absolute value, up to the table's steps.
        let n = 1 << 16;
        for filter in usual() {
            let value = value(filter.shape);
            let places: Vec<f64> =
                (0..n).map(|i| filter.quantile((f64::from(i) + 0.5) / f64::from(n))).collect();
            for power in 0..=4 {
                let mean: f64 =
                    places.iter().map(|&x| filter.sign(x) * x.powi(power)).sum::<f64>() / f64::from(n);
                let exact = moment(filter.shape, power, &value) * filter.mean_sign().sqrt();
                let largest = filter.shape.default_radius().powi(power).max(1.0);
                assert!(
                    (mean - exact).abs() < 1e-4 * largest,
                    "{} {power}: {mean} {exact}",
                    filter.shape.name()
                );
            }
            assert!(places.is_sorted() && places.iter().all(|x| x.abs() <= filter.shape.default_radius()));
        }
    }

    #[test]
    fn mitchells_lobes_weigh_what_they_should() {
        // With unit integral, a negative lobe is (2 - t)^2 (8 - 7 t) / 18 from 8/7 to 2; with y = 2 - t from 0 to a =
        // 6/7 it is y^2 (7 y - 6) / 18, whose integral is (7 a^4 / 4 - 2 a^3) / 18. There are two lobes; the integral
        // of the absolute value is 1 minus twice their sum.
        let a = 6.0f64 / 7.0;
        let negative = 2.0 * (7.0 / 4.0 * a.powi(4) - 2.0 * a.powi(3)) / 18.0;
        let mitchell = ReconstructionFilter::new(FilterShape::Mitchell, 2.0);
        let value = value(FilterShape::Mitchell);
        assert!((moment(FilterShape::Mitchell, 0, |x| value(x).min(0.0)) - negative).abs() < 1e-8);
        assert!((mitchell.mean_sign() - (1.0 - 2.0 * negative).powi(-2)).abs() < 1e-6);
        // Zero where the sign changes, the paper's values at the centre and one pixel off: (6 - 2B) / 6 and B / 6.
        assert!(value(8.0 / 7.0).abs() < 1e-12);
        assert!((value(0.0) - 8.0 / 9.0).abs() < 1e-9);
        assert!((value(1.0) - 1.0 / 18.0).abs() < 1e-9);
    }

    #[test]
    fn others_are_never_negative() {
        for filter in usual().iter().filter(|filter| !filter.is_signed()) {
            assert!((filter.mean_sign() - 1.0).abs() < 1e-12, "{}", filter.shape.name());
            assert_eq!(filter.sample([0.0, 0.999_999]).1, 1.0);
        }
    }
}
