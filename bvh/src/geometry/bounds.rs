//! Bounding boxes in f32, directed rounding, and the conservative box tests in f32 and f64.

use glam::{DVec3, Vec3, Vec3A};

use super::Ray;
use super::lanes::RayN;
use super::simd::Doubles;

/// An axis-aligned f32 box, borders included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Least corner.
    pub min: Vec3,
    /// Greatest corner.
    pub max: Vec3,
}

impl Bounds {
    /// The smallest f32 box around the f64 box from `min` to `max`.
    pub fn rounded_out(min: DVec3, max: DVec3) -> Self {
        Bounds { min: per_axis(min, round_down), max: per_axis(max, round_up) }
    }

    /// The smallest box around both.
    pub fn union(self, other: Self) -> Self {
        Bounds { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The box of what both contain; inverted on an axis on which they are apart.
    pub fn intersection(self, other: Self) -> Self {
        Bounds { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// Half the surface area.
    pub fn half_area(&self) -> f32 {
        let size = self.max - self.min;
        size.x * size.y + size.y * size.z + size.z * size.x
    }

    /// The unit in the last place of the largest coordinate.
    pub fn ulp(&self) -> f32 {
        let largest = self.min.abs().max(self.max.abs()).max_element();
        largest.next_up() - largest
    }

    /// This box, enlarged by `below` at its lower and `above` at its upper planes.
    pub fn grown(self, below: Vec3, above: Vec3) -> Self {
        Bounds { min: self.min - below, max: self.max + above }
    }
}

/// `t` clamped to the interval in which `ray` is inside the box from `min` to `max`; `None` if there is no such
/// interval, up to [`DOUBLE_MARGIN`].
///
/// The distances of the planes take one subtraction, one reciprocal and one multiplication each, so they are good to
/// 2 ulp even where the primitive test cancels. A node that contains this box then contains the hit, whatever the
/// error of `t`; and on an axis-aligned triangle the result is the distance of the plane.
#[inline(always)]
pub(crate) fn clamp_to_bounds(min: DVec3, max: DVec3, ray: &Ray, t: f64) -> Option<f64> {
    let inverse = ray.direction.recip();
    let downwards = inverse.cmplt(DVec3::ZERO);
    let near = (DVec3::select(downwards, max, min) - ray.origin) * inverse;
    let far = (DVec3::select(downwards, min, max) - ray.origin) * inverse;
    // NaN, from a ray in a plane of the box (0 times infinity), is never taken. Other distances on an axis of zero
    // direction are infinite and do not clamp.
    let up = |t: f64, bound: f64| if bound > t { bound } else { t };
    let down = |t: f64, bound: f64| if bound < t { bound } else { t };
    let enter = up(up(up(f64::NEG_INFINITY, near.x), near.y), near.z);
    let leave = down(down(down(f64::INFINITY, far.x), far.y), far.z);
    (enter <= leave * DOUBLE_MARGIN).then(|| up(down(t, leave), enter))
}

/// The interval in which the ray in each lane is inside the bounds there, for [`clamp_to_bounds`] in f64.
pub(super) struct BoundsInterval<D> {
    enter: D,
    leave: D,
    /// The rays that have one, up to [`DOUBLE_MARGIN`].
    pub passes: u32,
    /// The rays that this is sure of: those without a direction component of 0.
    pub sure: u32,
}

impl<D: Doubles> BoundsInterval<D> {
    /// For bounds of the given centres and half sizes, by the operations of [`clamp_to_bounds`].
    #[inline(always)]
    pub(super) fn new(centre: &[D; 3], half: &[D; 3], rays: &RayN<D>) -> Self {
        let (mut enter, mut leave) = (D::splat(f64::NEG_INFINITY), D::splat(f64::INFINITY));
        let mut sure = D::ALL;
        for axis in 0..3 {
            let inverse = D::splat(1.0) / rays.direction[axis];
            sure &= inverse.abs().lt(D::splat(f64::INFINITY));
            let low = (centre[axis] - half[axis] - rays.origin[axis]) * inverse;
            let high = (centre[axis] + half[axis] - rays.origin[axis]) * inverse;
            enter = low.min(high).max(enter);
            leave = low.max(high).min(leave);
        }
        BoundsInterval { enter, leave, passes: enter.le(leave * D::splat(DOUBLE_MARGIN)), sure }
    }

    /// Distances clamped to it.
    #[inline(always)]
    pub(super) fn clamp(&self, t: D) -> D {
        self.enter.max(self.leave.min(t))
    }
}

fn per_axis(v: DVec3, f: impl Fn(f64) -> f32) -> Vec3 {
    Vec3::new(f(v.x), f(v.y), f(v.z))
}

/// `x` rounded to f32, upwards if `side` is above 0, downwards if below, to nearest if it is 0.
///
/// Without branches on the numbers, which would be mispredicted.
#[inline(always)]
pub(crate) fn round_towards(x: f64, side: f64) -> f32 {
    let y = x as f32;
    if y == 0.0 {
        return if side > 0.0 { round_up(x) } else { round_down(x) };
    }
    let short = (x - f64::from(y)) * side > 0.0;
    let larger = (side > 0.0) == (y > 0.0);
    let step = if larger { 1 } else { u32::MAX };
    f32::from_bits(y.to_bits().wrapping_add(if short { step } else { 0 }))
}

/// The largest f32 that is not above `x`.
#[inline(always)]
pub(crate) fn round_down(x: f64) -> f32 {
    -round_up(-x)
}

/// The smallest f32 that is not below `x`.
#[inline(always)]
pub fn round_up(x: f64) -> f32 {
    let y = x as f32;
    let bits = y.to_bits();
    // The next number up. `y < x` excludes NaN, +infinity and -0.
    let next = if y.is_sign_negative() { bits.wrapping_sub(1) } else { bits + 1 };
    if f64::from(y) < x { f32::from_bits(next) } else { y }
}

/// The margin of the f32 box test: at least (1 + 2 γ3) (1 + u) for f32 with u = 2^-24 (Ize, Robust BVH Ray Traversal,
/// JCGT 2(2) 2013).
///
/// A computed distance to a plane is the true one times at most three factors of 1 ± u (subtract, reciprocal,
/// multiply), so either end of the overlap may be off by γ3, and one end that is moved by 2 γ3 absorbs both; the last
/// factor is for the rounding of that move itself.
pub(crate) const PRUNE_MARGIN: f32 = 1.0 + 4.0 * f32::EPSILON;

/// The margin of the f64 box test. Ize's derivation requires 1 + 3.5 ε. The rest is for primitive tests that see
/// corners moved by up to 2^-50 of their distance to the ray's origin (see [`super::woop`]): it covers hits from
/// 2^-24 of that distance on, and secondary rays start farther from edges than that
/// ([`super::spawn::EDGE_DISTANCE`]). [`PRUNE_MARGIN`] is wider than f32 requires by 2^-24, so a box entered with
/// this margin is entered in f32, too.
pub(crate) const DOUBLE_MARGIN: f64 = 1.0 + 1.0 / (1u32 << 26) as f64;

/// An f32 distance beyond which no box around a hit at `t` is entered; `t` may be negative.
#[inline]
pub(crate) fn prune_distance(t: f64) -> f32 {
    let t = round_up(t);
    if t > 0.0 { t * PRUNE_MARGIN } else { round_down(f64::from(t)) }
}

/// A ray prepared for boxes with f32 planes.
pub trait BoxTest {
    /// Prepares `ray`.
    fn new(ray: &Ray) -> Self;

    /// The distance at which the ray enters the box from `min` to `max`; `None` if it misses the box or enters it
    /// beyond `t_max`. Conservative: the exact ray meets no other box before `t_max`.
    fn enters(&self, min: Vec3A, max: Vec3A, t_max: f32) -> Option<f32>;
}

/// The box test in f32, for f32 rays, and for rays whose points are off by up to a given distance on each axis.
///
/// The lower plane of each axis is then tested with an origin moved up, the upper plane with an origin moved down. For
/// either sign of the direction this enlarges the box by that distance.
#[derive(Clone, Copy)]
pub struct SingleBoxTest {
    /// The origin, moved up on every axis.
    above: Vec3A,
    /// The origin, moved down on every axis.
    below: Vec3A,
    /// Reciprocals of the direction; infinite where it is 0.
    inverse: Vec3A,
    t_min: Vec3A,
}

impl SingleBoxTest {
    /// Prepares a ray whose points are off by up to `error` on each axis. No coordinate of a hit is larger than 1 +
    /// `error`.
    ///
    /// Rounding origin and direction to f32 moves a point of the ray by at most u of its distance from the origin and
    /// u of the origin, that is by u (1 + error + 2 |origin|) with u = 2^-24; moving the origin rounds by u of both
    /// again. 2^-21 of each is above that.
    #[inline]
    pub(crate) fn widened(origin: DVec3, direction: DVec3, error: DVec3) -> Self {
        const ROUNDING: f64 = 4.0 * f32::EPSILON as f64;
        let error = error + (origin.abs() + error + 1.0) * ROUNDING;
        SingleBoxTest {
            above: (origin + error).as_vec3a(),
            below: (origin - error).as_vec3a(),
            inverse: direction.as_vec3a().recip(),
            t_min: Vec3A::ZERO,
        }
    }

    /// The distances at which the ray enters and leaves the box from `min` to `max`, clamped to `t_min` and `t_max`,
    /// the second with its margin. The ray misses the box if the first is larger.
    #[inline(always)]
    pub fn span(&self, min: Vec3A, max: Vec3A, t_max: f32) -> [f32; 2] {
        let to_min = (min - self.above) * self.inverse;
        let to_max = (max - self.below) * self.inverse;
        // NaN, from a ray in a plane of the box (0 times infinity), must not decide: the order of the operands, here
        // and below, lets such a lane fall through to `t_min` and `t_max`.
        let near = lesser(to_max, to_min);
        let far = greater(to_min, to_max);
        let enter = greater(near, self.t_min).max_element();
        let leave = lesser(far, Vec3A::splat(t_max)).min_element();
        [enter, leave * PRUNE_MARGIN]
    }
}

impl BoxTest for SingleBoxTest {
    #[inline]
    fn new(ray: &Ray) -> Self {
        let origin = ray.origin.as_vec3a();
        SingleBoxTest {
            above: origin,
            below: origin,
            inverse: ray.direction.as_vec3a().recip(),
            t_min: Vec3A::splat(round_down(ray.t_min)),
        }
    }

    #[inline(always)]
    fn enters(&self, min: Vec3A, max: Vec3A, t_max: f32) -> Option<f32> {
        let [enter, leave] = self.span(min, max, t_max);
        (enter <= leave).then_some(enter)
    }
}

/// The box test in f64, for f64 rays.
pub struct DoubleBoxTest {
    origin: DVec3,
    inverse: DVec3,
    t_min: f64,
}

impl BoxTest for DoubleBoxTest {
    #[inline]
    fn new(ray: &Ray) -> Self {
        DoubleBoxTest { origin: ray.origin, inverse: ray.direction.recip(), t_min: ray.t_min }
    }

    #[inline(always)]
    fn enters(&self, min: Vec3A, max: Vec3A, t_max: f32) -> Option<f32> {
        let to_min = (min.as_dvec3() - self.origin) * self.inverse;
        let to_max = (max.as_dvec3() - self.origin) * self.inverse;
        // NaN falls through, as in f32.
        let axis = |to_min: f64, to_max: f64, [enter, leave]: [f64; 2]| {
            let near = if to_max < to_min { to_max } else { to_min };
            let far = if to_min > to_max { to_min } else { to_max };
            [if near > enter { near } else { enter }, if far < leave { far } else { leave }]
        };
        let span = axis(to_min.x, to_max.x, [self.t_min, f64::from(t_max)]);
        let span = axis(to_min.y, to_max.y, span);
        let [enter, leave] = axis(to_min.z, to_max.z, span);
        // Rounding to f32 is a quarter of the margin of the distances that this is compared with.
        (enter <= leave * DOUBLE_MARGIN).then_some(enter as f32)
    }
}

/// `a < b ? a : b` per lane: `b` if either is NaN.
#[inline(always)]
fn lesser(a: Vec3A, b: Vec3A) -> Vec3A {
    // `minps` of SSE has these semantics; elsewhere `min` treats NaN differently.
    if cfg!(target_feature = "sse2") { a.min(b) } else { Vec3A::select(a.cmplt(b), a, b) }
}

/// `a > b ? a : b` per lane: `b` if either is NaN.
#[inline(always)]
fn greater(a: Vec3A, b: Vec3A) -> Vec3A {
    if cfg!(target_feature = "sse2") { a.max(b) } else { Vec3A::select(a.cmpgt(b), a, b) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Precision;
    use proptest::prelude::*;

    fn enters(ray: &Ray, b: Bounds, t_max: f32) -> Option<f32> {
        let double = DoubleBoxTest::new(ray).enters(b.min.into(), b.max.into(), t_max);
        let single = SingleBoxTest::new(ray).enters(b.min.into(), b.max.into(), t_max);
        // The f32 margin is wider: f32 enters every box that f64 enters.
        assert!(double.is_none() || single.is_some());
        double.and(single)
    }

    #[test]
    fn the_margin_is_what_ize_derives() {
        let u = f64::from(f32::EPSILON) / 2.0;
        let gamma3 = 3.0 * u / (1.0 - 3.0 * u);
        let least = (1.0 + 2.0 * gamma3) * (1.0 + u) * DOUBLE_MARGIN;
        assert!(f64::from(PRUNE_MARGIN) >= least);
        assert!(f64::from(PRUNE_MARGIN.next_down()) < least);
    }

    #[test]
    fn rounding_is_directed_everywhere() {
        let f32_max = f64::from(f32::MAX);
        for x in [0.1, 1.0, 1e-46, 1e-40, 1.5e38, f32_max, f32_max * 1.5, 0.0, f64::INFINITY] {
            for x in [x, -x] {
                let (down, up) = (round_down(x), round_up(x));
                assert!(f64::from(down) <= x && x <= f64::from(up), "{x}");
                assert!(down == up || down.next_up() == up, "{x}: {down} {up}");
                assert_eq!(down == up, f64::from(x as f32) == x);
                assert_eq!(round_towards(x, 0.3), up);
                assert_eq!(round_towards(x, -1e-9), down);
            }
        }
    }

    #[test]
    fn nan_selects_the_second_operand() {
        let (nan, one) = (Vec3A::splat(f32::NAN), Vec3A::ONE);
        assert_eq!((lesser(nan, one), greater(nan, one)), (one, one));
        assert!(lesser(one, nan).is_nan() && greater(one, nan).is_nan());
        assert_eq!((lesser(one, 2.0 * one), greater(one, 2.0 * one)), (one, 2.0 * one));
    }

    #[test]
    fn a_ray_in_a_face_is_inside() {
        let b = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
        for (origin, direction) in [
            (DVec3::new(0.0, 0.5, -1.0), DVec3::Z),
            (DVec3::new(1.0, 0.5, -1.0), DVec3::Z),
            (DVec3::new(1.0, 1.0, 2.0), -DVec3::Z),
            (DVec3::new(0.0, 0.0, 2.0), -DVec3::Z),
        ] {
            let ray = Precision::Single.ray(origin, direction, 0.0, f64::INFINITY);
            assert_eq!(enters(&ray, b, f32::INFINITY), Some(1.0), "{origin} {direction}");
            let outside = Precision::Single.ray(
                origin * DVec3::new(3.0, 1.0, 1.0) + DVec3::X * 1e-6,
                direction,
                0.0,
                f64::INFINITY,
            );
            assert_eq!(enters(&outside, b, f32::INFINITY).is_some(), origin.x == 0.0);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        /// A ray moved by less than its error enters every box that it entered before, also along axes and in planes.
        #[test]
        fn a_ray_off_by_its_error_misses_nothing(
            corners in prop::array::uniform2(prop::array::uniform3(-4i32..=4)),
            inside in prop::array::uniform3(0i32..=4),
            direction in prop::array::uniform3(prop_oneof![Just(0.0f64), Just(1.0), -1.0f64..1.0, -1e-9f64..1e-9]),
            from in -4.0f64..4.0,
            error in prop::array::uniform3(0.0f64..1e-3),
            moved in prop::array::uniform3(-1.0f64..=1.0),
        ) {
            let direction = DVec3::from(direction);
            prop_assume!(direction.abs().max_element() > 1e-3);
            let [a, b] = corners.map(|c| DVec3::from(c.map(f64::from)) / 4.0);
            let (min, max) = (a.min(b), a.max(b));
            // A point of the box, faces and corners included, and a ray through it.
            let point = min + (max - min) * DVec3::from(inside.map(f64::from)) / 4.0;
            let origin = point - direction * from;
            let error = DVec3::from(error);
            let test = SingleBoxTest::widened(origin + error * DVec3::from(moved), direction, error);
            let entered = test.enters(min.as_vec3a(), max.as_vec3a(), f32::INFINITY);
            if from >= 0.0 {
                prop_assert!(entered.is_some());
                prop_assert!(test.enters(min.as_vec3a(), max.as_vec3a(), prune_distance(from)).is_some());
            }
            // And it enters no more than a box enlarged by twice the error and its own rounding.
            let grown = error * 2.0 + (origin.abs() + 1.0) * 1e-5;
            let ray = Precision::Single.ray(origin, direction, 0.0, f64::INFINITY);
            let wide = SingleBoxTest::new(&ray).enters((min - grown).as_vec3a(), (max + grown).as_vec3a(), f32::INFINITY);
            prop_assert!(entered.is_none() || wide.is_some());
        }
    }
}
