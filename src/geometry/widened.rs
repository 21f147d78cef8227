//! The box test for rays that are known up to an error: every box is met as if it were larger by that.

use glam::{DVec3, Vec3A};

use super::PRUNE_MARGIN;
use super::bounds::{greater, lesser, round_down, round_up};

/// A ray in f32 that may lie beside the true one, by a given distance on each axis.
///
/// Planes on the near side are tested with an origin that is moved towards them, those on the far side with one that is
/// moved away. Whichever way the ray runs, the least plane of an axis then sees the origin moved up, and the greatest the
/// origin moved down.
pub struct WidenedBoxTest {
    /// The origin, moved up on every axis.
    above: Vec3A,
    /// The origin, moved down on every axis.
    below: Vec3A,
    /// Reciprocals of the direction; infinite where it is 0.
    inverse: Vec3A,
}

impl WidenedBoxTest {
    /// A ray from `origin` in `direction` that may lie `aside` of what is meant, on each axis, wherever it meets a box; no
    /// coordinate of what it is to find in the boxes is larger than 1 + `aside`.
    ///
    /// Rounding the origin and the direction to f32 moves a point of the ray by no more than u of its distance from the
    /// origin and u of the origin, so by u (1 + aside + 2 |origin|); moving the origin rounds by u of both again. 2^-21 of
    /// each is above that.
    #[inline]
    pub fn new(origin: DVec3, direction: DVec3, aside: DVec3) -> Self {
        const ROUNDING: f64 = 4.0 * f32::EPSILON as f64;
        let aside = aside + (origin.abs() + aside + 1.0) * ROUNDING;
        WidenedBoxTest {
            above: (origin + aside).as_vec3a(),
            below: (origin - aside).as_vec3a(),
            inverse: direction.as_vec3a().recip(),
        }
    }

    /// Where the ray enters the box from `min` to `max`, or `None` if it misses it or enters it beyond `t_max`. What lies
    /// behind the origin is missed.
    #[inline(always)]
    pub fn enters(&self, min: Vec3A, max: Vec3A, t_max: f32) -> Option<f32> {
        let to_min = (min - self.above) * self.inverse;
        let to_max = (max - self.below) * self.inverse;
        // As in [`super::SingleBoxTest`]: what is not a number falls through.
        let near = lesser(to_max, to_min);
        let far = greater(to_min, to_max);
        let enter = greater(near, Vec3A::ZERO).max_element();
        let leave = lesser(far, Vec3A::splat(t_max)).min_element();
        (enter <= leave * PRUNE_MARGIN).then_some(enter)
    }
}

/// An f32 number beyond which no box around a hit at `t` is entered.
#[inline]
pub fn prune_distance(t: f64) -> f32 {
    let t = round_up(t);
    if t > 0.0 { t * PRUNE_MARGIN } else { round_down(f64::from(t)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{BoxTest, Precision, SingleBoxTest};
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        /// A ray that is moved by less than it may lie aside meets every box that it met before: also along axes, and on
        /// planes.
        #[test]
        fn a_ray_that_lies_aside_misses_nothing(
            corners in prop::array::uniform2(prop::array::uniform3(-4i32..=4)),
            inside in prop::array::uniform3(0i32..=4),
            direction in prop::array::uniform3(prop_oneof![Just(0.0f64), Just(1.0), -1.0f64..1.0, -1e-9f64..1e-9]),
            from in -4.0f64..4.0,
            aside in prop::array::uniform3(0.0f64..1e-3),
            moved in prop::array::uniform3(-1.0f64..=1.0),
        ) {
            let direction = DVec3::from(direction);
            prop_assume!(direction.abs().max_element() > 1e-3);
            let [a, b] = corners.map(|c| DVec3::from(c.map(f64::from)) / 4.0);
            let (min, max) = (a.min(b), a.max(b));
            // A point of the box, faces and corners included, and a ray through it.
            let point = min + (max - min) * DVec3::from(inside.map(f64::from)) / 4.0;
            let origin = point - direction * from;
            let aside = DVec3::from(aside);
            let test = WidenedBoxTest::new(origin + aside * DVec3::from(moved), direction, aside);
            let entered = test.enters(min.as_vec3a(), max.as_vec3a(), f32::INFINITY);
            if from >= 0.0 {
                prop_assert!(entered.is_some());
                prop_assert!(test.enters(min.as_vec3a(), max.as_vec3a(), prune_distance(from)).is_some());
            }
            // And it meets no more than a box that is larger by twice that and by its own rounding.
            let grown = aside * 2.0 + (origin.abs() + 1.0) * 1e-5;
            let ray = Precision::Single.ray(origin, direction, 0.0, f64::INFINITY);
            let wide = SingleBoxTest::new(&ray).enters((min - grown).as_vec3a(), (max + grown).as_vec3a(), f32::INFINITY);
            prop_assert!(entered.is_none() || wide.is_some());
        }
    }
}
