//! [`Beam`]: interval arithmetic over a batch of rays, for the box tests at the top of a tree.

use glam::{DVec3, Vec3A};

use super::bounds::{PRUNE_MARGIN, round_down};
use super::{Bounds, Rays};

/// The intervals that contain the origins, reciprocal directions and ends of a set of rays.
///
/// The box test is that of a single ray ([`super::SingleBoxTest`]) on intervals, in the same f32 arithmetic, after
/// the bounds of the intervals were rounded outwards. Rounding is monotone, so the computed intervals contain each
/// ray's computed f32 numbers: the beam enters every box that one of the rays enters. The same holds for f64 rays,
/// whose own test is within the f32 margin.
pub struct Beam {
    origin: [Vec3A; 2],
    /// Least and greatest reciprocal of the directions, for axes of kind [`Axis::Along`].
    inverse: [Vec3A; 2],
    axes: [Axis; 3],
    t_min: f32,
    t_max: f32,
}

/// The directions of a beam's rays along one axis.
#[derive(Clone, Copy, PartialEq)]
enum Axis {
    /// All positive (`false`) or all negative (`true`).
    Along(bool),
    /// All 0.
    Across,
    /// Different signs: this axis rejects no box.
    Mixed,
}

impl Beam {
    /// The beam of the given rays; `None` without rays. `t_max` is at least the largest `t_max` of the rays.
    pub fn new(rays: Rays, t_max: f32) -> Option<Self> {
        let first = (!rays.is_empty()).then(|| rays.get(0))?;
        let mut origin = [first.origin; 2];
        let mut inverse = [first.direction.recip(); 2];
        let mut t_min = first.t_min;
        for ray in rays.iter().skip(1) {
            let (o, i) = (ray.origin, ray.direction.recip());
            origin = [origin[0].min(o), origin[1].max(o)];
            inverse = [inverse[0].min(i), inverse[1].max(i)];
            t_min = t_min.min(ray.t_min);
        }
        let outwards = |[least, greatest]: [DVec3; 2]| {
            let Bounds { min, max } = Bounds::rounded_out(least, greatest);
            [Vec3A::from(min), Vec3A::from(max)]
        };
        let (origin, inverse) = (outwards(origin), outwards(inverse));
        let axes = [0, 1, 2].map(|axis| {
            // Directions have no -0, so a zero gives +infinity.
            let (least, greatest) = (inverse[0][axis], inverse[1][axis]);
            if least == f32::INFINITY {
                Axis::Across
            } else if greatest < 0.0 || (least > 0.0 && greatest.is_finite()) {
                Axis::Along(greatest < 0.0)
            } else {
                Axis::Mixed
            }
        });
        Some(Beam { origin, inverse, axes, t_min: round_down(t_min), t_max })
    }

    /// A lower bound of the distance at which any ray enters the box from `min` to `max`; `None` if none does.
    pub fn enters(&self, min: Vec3A, max: Vec3A) -> Option<f32> {
        let (mut enter, mut leave) = (self.t_min, self.t_max);
        for axis in 0..3 {
            let (near, far) = match self.axes[axis] {
                Axis::Mixed => continue,
                Axis::Across => {
                    if min[axis] > self.origin[1][axis] || max[axis] < self.origin[0][axis] {
                        return None;
                    }
                    continue;
                }
                Axis::Along(false) => (min[axis], max[axis]),
                Axis::Along(true) => (max[axis], min[axis]),
            };
            let distances = |plane: f32| {
                let (a, b) = (plane - self.origin[0][axis], plane - self.origin[1][axis]);
                let (i, j) = (self.inverse[0][axis], self.inverse[1][axis]);
                [a * i, a * j, b * i, b * j]
            };
            enter = enter.max(distances(near).into_iter().fold(f32::INFINITY, f32::min));
            leave = leave.min(distances(far).into_iter().fold(f32::NEG_INFINITY, f32::max));
        }
        (enter <= leave * PRUNE_MARGIN).then_some(enter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{BoxTest, DoubleBoxTest, Precision, RayBuffer, SingleBoxTest};
    use proptest::prelude::*;

    fn component() -> impl Strategy<Value = f64> {
        prop_oneof![Just(0.0), Just(-0.0), Just(1.0), Just(-1.0), -1.0f64..1.0, -1e-9f64..1e-9]
    }

    fn vector() -> impl Strategy<Value = DVec3> {
        [component(), component(), component()].prop_map(DVec3::from)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        #[test]
        fn a_box_that_a_ray_enters_the_beam_enters(
            rays in prop::collection::vec((vector(), vector()), 1..6),
            spread in 0.0f64..1.0,
            min in vector(),
            size in prop::array::uniform3(prop_oneof![Just(0.0f64), 0.0f64..1.0]),
            t_max in prop_oneof![Just(f64::INFINITY), 0.0f64..3.0],
        ) {
            // Often coherent: directions near the first.
            let lead = rays[0].1;
            let (min, max) = (min.as_vec3a(), (min + DVec3::from(size)).as_vec3a());
            for precision in [Precision::Single, Precision::Double] {
                let rays: RayBuffer = rays.iter().filter_map(|&(origin, direction)| {
                    let direction = (lead + spread * direction).try_normalize()?;
                    Some(precision.ray(origin, direction, 0.0, t_max))
                }).collect();
                prop_assume!(!rays.is_empty());
                let beam = Beam::new(rays.rays(), t_max as f32).expect("rays");
                for ray in rays.rays().iter() {
                    let at = match precision {
                        Precision::Single => SingleBoxTest::new(&ray).enters(min, max, t_max as f32),
                        Precision::Double => DoubleBoxTest::new(&ray).enters(min, max, t_max as f32),
                    };
                    if let Some(at) = at {
                        let beam_at = beam.enters(min, max);
                        prop_assert!(beam_at.is_some_and(|b| b <= at * PRUNE_MARGIN), "{:?} {:?}", ray, beam_at);
                    }
                }
            }
        }
    }

    #[test]
    fn a_narrow_beam_misses_what_lies_beside_it() {
        let rays: RayBuffer = (0..16)
            .map(|i| {
                Precision::Single.ray(
                    DVec3::ZERO,
                    DVec3::new(f64::from(i + 1) / 100.0, 0.1, 1.0).normalize(),
                    0.0,
                    1e9,
                )
            })
            .collect();
        let beam = Beam::new(rays.rays(), f32::INFINITY).expect("rays");
        let unit_box =
            |x: f32, y: f32, z: f32| beam.enters(Vec3A::new(x, y, z), Vec3A::new(x + 1.0, y + 1.0, z + 1.0));
        assert!(unit_box(0.0, 0.5, 10.0).is_some());
        assert!(unit_box(3.0, 0.5, 10.0).is_none());
        assert!(unit_box(0.0, 2.0, 10.0).is_none());
        assert!(unit_box(0.0, -0.5, -10.0).is_none());
    }
}
