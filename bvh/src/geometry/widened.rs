//! The box test of instances, for rays that are known up to an error: boxes are enlarged by it.

use glam::{DVec3, Vec3A};

use super::PRUNE_MARGIN;
use super::bounds::{greater, lesser, round_down, round_up};

/// An f32 ray whose points are off by up to a given distance on each axis.
///
/// The lower plane of each axis is tested with an origin moved up, the upper plane with an origin moved down. For
/// either sign of the direction this enlarges the box by that distance.
pub(crate) struct WidenedBoxTest {
    /// The origin, moved up on every axis.
    above: Vec3A,
    /// The origin, moved down on every axis.
    below: Vec3A,
    /// Reciprocals of the direction; infinite where it is 0.
    inverse: Vec3A,
}

impl WidenedBoxTest {
    /// Prepares a ray whose points are off by up to `error` on each axis. No coordinate of a hit is larger than 1 +
    /// `error`.
    ///
    /// Rounding origin and direction to f32 moves a point of the ray by at most u of its distance from the origin and
    /// u of the origin, that is by u (1 + error + 2 |origin|) with u = 2^-24; moving the origin rounds by u of both
    /// again. 2^-21 of each is above that.
    #[inline]
    pub(crate) fn new(origin: DVec3, direction: DVec3, error: DVec3) -> Self {
        const ROUNDING: f64 = 4.0 * f32::EPSILON as f64;
        let error = error + (origin.abs() + error + 1.0) * ROUNDING;
        WidenedBoxTest {
            above: (origin + error).as_vec3a(),
            below: (origin - error).as_vec3a(),
            inverse: direction.as_vec3a().recip(),
        }
    }

    /// The distance at which the ray enters the box from `min` to `max`; `None` if it misses the box, enters it
    /// beyond `t_max` or has it behind its origin.
    #[inline(always)]
    pub(crate) fn enters(&self, min: Vec3A, max: Vec3A, t_max: f32) -> Option<f32> {
        let to_min = (min - self.above) * self.inverse;
        let to_max = (max - self.below) * self.inverse;
        // NaN falls through, as in [`super::SingleBoxTest`].
        let near = lesser(to_max, to_min);
        let far = greater(to_min, to_max);
        let enter = greater(near, Vec3A::ZERO).max_element();
        let leave = lesser(far, Vec3A::splat(t_max)).min_element();
        (enter <= leave * PRUNE_MARGIN).then_some(enter)
    }
}

/// An f32 distance beyond which no box around a hit at `t` is entered; `t` may be negative.
#[inline]
pub(crate) fn prune_distance(t: f64) -> f32 {
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
            let test = WidenedBoxTest::new(origin + error * DVec3::from(moved), direction, error);
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
