//! Boxes that hold what they should, and a box test that misses none of them.

use glam::{DVec3, Vec3, Vec3A};

use super::Ray;

/// An axis-aligned box of f32 numbers, both ends included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Least corner.
    pub min: Vec3,
    /// Greatest corner.
    pub max: Vec3,
}

impl Bounds {
    /// The smallest f32 box that holds the box from `min` to `max`.
    pub fn rounded_out(min: DVec3, max: DVec3) -> Self {
        Bounds { min: per_axis(min, round_down), max: per_axis(max, round_up) }
    }

    /// This box, larger by `ulps` units in the last place of its largest coordinate on every side.
    pub fn grown(self, ulps: f32) -> Self {
        let largest = self.min.abs().max(self.max.abs()).max_element();
        let by = Vec3::splat((largest.next_up() - largest) * ulps);
        Bounds { min: self.min - by, max: self.max + by }
    }

    /// Moves a distance along `ray` into the part of the ray that passes through this box.
    #[inline(always)]
    pub fn hold(&self, ray: &Ray, t: f64) -> f64 {
        hold(self.min.as_dvec3(), self.max.as_dvec3(), ray, t)
    }
}

/// Moves a distance along `ray` into the part of the ray that passes through the box from `min` to `max`.
///
/// The distances of the box's planes come from one exact subtraction (for f32 planes), one reciprocal and one
/// multiplication each, so they are good to 2 ulp of f64 even where the hit's own formula cancels. A box test that
/// contains this box then contains the hit, whatever was lost in computing it; and on an axis-aligned triangle the
/// plane's own distance is taken.
#[inline(always)]
pub fn hold(min: DVec3, max: DVec3, ray: &Ray, t: f64) -> f64 {
    let inverse = ray.direction.recip();
    let downwards = inverse.cmplt(DVec3::ZERO);
    let near = (DVec3::select(downwards, max, min) - ray.origin) * inverse;
    let far = (DVec3::select(downwards, min, max) - ray.origin) * inverse;
    // What is not a number is never taken: a ray that runs in a plane of the box (0 times infinity). Along an axis that
    // the ray does not move on the others are infinite, and hold nothing.
    let up = |t: f64, bound: f64| if bound > t { bound } else { t };
    let down = |t: f64, bound: f64| if bound < t { bound } else { t };
    down(down(down(up(up(up(t, near.x), near.y), near.z), far.x), far.y), far.z)
}

fn per_axis(v: DVec3, f: impl Fn(f64) -> f32) -> Vec3 {
    Vec3::new(f(v.x), f(v.y), f(v.z))
}

/// `x` rounded to f32 upwards where `side` is above 0, downwards where it is below, and to the nearest where it is 0.
///
/// Without branches on the numbers: they are as good as random.
#[inline]
pub fn round_towards(x: f64, side: f64) -> f32 {
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
#[inline]
pub fn round_down(x: f64) -> f32 {
    -round_up(-x)
}

/// The smallest f32 that is not below `x`.
#[inline]
pub fn round_up(x: f64) -> f32 {
    let y = x as f32;
    let bits = y.to_bits();
    // One step up, for numbers below something: never NaN, +infinity or -0.
    let next = if y.is_sign_negative() { bits.wrapping_sub(1) } else { bits + 1 };
    if f64::from(y) < x { f32::from_bits(next) } else { y }
}

/// The margin of the box test: at least (1 + 2 γ3) (1 + u) for f32 with u = 2^-24 (Ize, Robust BVH Ray Traversal, JCGT
/// 2(2) 2013).
///
/// A computed distance to a plane is the true one times at most three factors of 1 ± u (subtract, reciprocal,
/// multiply), so either end of the overlap may be off by γ3, and one end that is moved by 2 γ3 absorbs both; the last
/// factor is for the rounding of that move itself.
pub const PRUNE_MARGIN: f32 = 1.0 + 4.0 * f32::EPSILON;

/// A ray made ready for boxes, in f32.
pub struct BoxTest {
    origin: Vec3A,
    /// Reciprocals of the direction; infinite where it is 0.
    inverse: Vec3A,
    t_min: Vec3A,
}

impl BoxTest {
    /// Prepares `ray`, whose origin and direction must be f32 numbers.
    #[inline]
    pub fn new(ray: &Ray) -> Self {
        BoxTest {
            origin: ray.origin.as_vec3a(),
            inverse: Vec3A::from(ray.direction.as_vec3()).recip(),
            t_min: Vec3A::splat(round_down(ray.t_min)),
        }
    }

    /// Where the ray enters the box from `min` to `max`, or `None` if it misses it or enters it beyond `t_max`. Never
    /// misses a box that the exact ray meets before `t_max`.
    #[inline(always)]
    pub fn enters(&self, min: Vec3A, max: Vec3A, t_max: f32) -> Option<f32> {
        let to_min = (min - self.origin) * self.inverse;
        let to_max = (max - self.origin) * self.inverse;
        // Where the ray runs in a plane of the box (0 times infinity) there is no number, and that plane must not tell:
        // the order of the operands, here and below, lets such a lane fall through to `t_min` and `t_max`.
        let near = lesser(to_max, to_min);
        let far = greater(to_min, to_max);
        let enter = greater(near, self.t_min).max_element();
        let leave = lesser(far, Vec3A::splat(t_max)).min_element();
        (enter <= leave * PRUNE_MARGIN).then_some(enter)
    }
}

/// For each lane `a` if it is less than `b`, and `b` otherwise: also where one of them is not a number.
#[inline(always)]
fn lesser(a: Vec3A, b: Vec3A) -> Vec3A {
    // One instruction of SSE does just this; elsewhere `min` treats what is not a number otherwise.
    if cfg!(target_feature = "sse2") { a.min(b) } else { Vec3A::select(a.cmplt(b), a, b) }
}

/// For each lane `a` if it is greater than `b`, and `b` otherwise: also where one of them is not a number.
#[inline(always)]
fn greater(a: Vec3A, b: Vec3A) -> Vec3A {
    if cfg!(target_feature = "sse2") { a.max(b) } else { Vec3A::select(a.cmpgt(b), a, b) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn enters(ray: &Ray, b: Bounds, t_max: f32) -> Option<f32> {
        BoxTest::new(ray).enters(b.min.into(), b.max.into(), t_max)
    }

    #[test]
    fn the_margin_is_what_ize_derives() {
        let u = f64::from(f32::EPSILON) / 2.0;
        let gamma3 = 3.0 * u / (1.0 - 3.0 * u);
        let least = (1.0 + 2.0 * gamma3) * (1.0 + u);
        assert!(f64::from(PRUNE_MARGIN) >= least);
        assert!(f64::from(PRUNE_MARGIN.next_down()) < least);
    }

    #[test]
    fn boxes_round_outwards() {
        let b = Bounds::rounded_out(DVec3::splat(0.1), DVec3::splat(0.1));
        assert!(f64::from(b.min.x) <= 0.1 && f64::from(b.max.x) >= 0.1);
        assert_eq!(b.min.x.next_up(), b.max.x);
        let exact = Bounds::rounded_out(DVec3::splat(0.5), DVec3::splat(0.5));
        assert_eq!((exact.min, exact.max), (Vec3::splat(0.5), Vec3::splat(0.5)));
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
    fn what_is_not_a_number_gives_the_second() {
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
            let ray = Ray::new(origin, direction, 0.0, f64::INFINITY);
            assert_eq!(enters(&ray, b, f32::INFINITY), Some(1.0), "{origin} {direction}");
            let outside =
                Ray::new(origin * DVec3::new(3.0, 1.0, 1.0) + DVec3::X * 1e-6, direction, 0.0, f64::INFINITY);
            assert_eq!(enters(&outside, b, f32::INFINITY).is_some(), origin.x == 0.0);
        }
    }

    proptest! {
        /// Rays aimed at points of a box, corners and edges included, enter it: the exact point is in the box and on
        /// the exact ray whenever the ray is built backwards from it with numbers that need no rounding.
        #[test]
        fn no_box_is_missed(
            min in prop::array::uniform3(-1000i32..1000),
            size in prop::array::uniform3(0i32..64),
            corner in prop::array::uniform3(0i32..=2),
            step in prop::array::uniform3(-512i32..512),
            scale in -20i32..20,
        ) {
            prop_assume!(step != [0; 3]);
            let s = f64::from(scale).exp2();
            let v = |a: [i32; 3]| DVec3::from(a.map(f64::from)) * s;
            let target = v([0, 1, 2].map(|k| 2 * min[k] + corner[k] * size[k])) / 2.0;
            let direction = v(step);
            let ray = Ray { origin: target - direction, direction, t_min: 0.0, t_max: f64::INFINITY };
            // Every number is a small integer times a power of two: exact in f32.
            prop_assert_eq!(ray.origin, ray.origin.as_vec3().as_dvec3());
            let b = Bounds::rounded_out(v(min), v([0, 1, 2].map(|k| min[k] + size[k])));
            // The target is at t = 1, so the box is entered by then.
            prop_assert!(enters(&ray, b, 1.0).is_some());
            prop_assert!(enters(&ray, b, f32::INFINITY).is_some());
        }
    }
}
