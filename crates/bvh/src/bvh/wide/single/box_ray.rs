//! [`BoxRay`]: the test of one ray against the eight boxes of a node. Used by the single-ray traversal, by streams and
//! by instances.
//!
//! The distance to a plane is `plane * inverse - offset` with `offset = origin * inverse`: one fused multiply-add.
//! Without further care this is off by the rounding of the offset, which loses rays. So the offset is moved by more
//! than its rounding towards the side that enlarges the box ([`WIDENING`]), which leaves factors of 1 ± u, two for
//! the reciprocal and one for the result, and the margin absorbs those ([`MARGIN`]). A ray with a direction component
//! of 0 has no such offset on that axis: for those rays the origin is moved instead, and distances are `(plane -
//! origin) * inverse`. Instruction sets without fused multiply-add use that form for every ray. Both forms test f64
//! rays against the f32 boxes.

use crate::bvh::wide::layout::{Node, WIDTH};
use crate::geometry::simd::{Floats, Side, Simd, Vector};
use crate::geometry::{PRUNE_MARGIN, Ray, round_down};
use glam::{DVec3, Vec3};

/// The factor by which the distance at which a ray leaves a box is enlarged: [`PRUNE_MARGIN`], and 8 u for the
/// different arithmetic here.
pub(crate) const MARGIN: f32 = PRUNE_MARGIN + 4.0 * f32::EPSILON;

/// The share of itself by which an offset is moved. It is off by up to 2 u (an f64 origin is rounded, then
/// multiplied); this is 4 u. Underflow is covered by adding the least normal number.
pub(crate) const WIDENING: f32 = 2.0 * f32::EPSILON;

/// The factor by which the error of a ray is enlarged, 1 + 8 u: rounding it to f32, adding it to the widening, and
/// adding that to the origin take 3 u.
const ERROR_MARGIN: f64 = 1.0 + 4.0 * f32::EPSILON as f64;

/// Largest direction components for which distances to planes stay far from the limits of f32.
pub(crate) const LENGTHS: std::ops::RangeInclusive<f64> = 1.0 / 1024.0..=1024.0;

/// A ray prepared for the boxes of nodes, in one cache line.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[repr(align(64))]
pub(crate) struct BoxRay {
    /// Reciprocals of the direction; infinite where it is 0.
    inverse: [f32; 3],
    /// The nearer of each axis's planes.
    near: [Side; 3],
    /// For each axis the widened offsets of the near and the far plane, or the widened origins.
    offsets: [[f32; 2]; 3],
    /// Boxes that end before this distance are not entered.
    pub t_min: f32,
    /// The factor from distances along the ray to distances of boxes.
    scale: f64,
}

/// The greatest power of two that is not above `x`, but at least the least normal number.
#[cold]
fn power_of_two_below(x: f64) -> f64 {
    f64::from_bits(x.max(f64::MIN_POSITIVE).to_bits() & 0x7ff0_0000_0000_0000)
}

impl BoxRay {
    /// Prepares a ray. `fused` requires a direction without zeros; `fast`: without widening.
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, fused: bool, fast: bool) -> Self {
        Self::widened(ray, Vec3::ZERO, fused, fast)
    }

    /// Prepares a ray from t = 0 on whose points are off by up to `error` on each axis, for the form that is not fused.
    ///
    /// Where the exact point at t lies in a box, the ray's point at t lies in the box enlarged by `error`. A lower
    /// plane p then moves to p - `error`, and (p - `error`) - `origin` = p - (`origin` + `error`): the origins, which
    /// are moved by more than their rounding, are moved by `error` as well, up for lower planes and down for upper
    /// ones. [`ERROR_MARGIN`] makes up for the rounding of `error` and of these sums, and leaves 4 u of `error`.
    ///
    /// Any component of the direction may be 0, or round to 0 or to a subnormal number in f32 with any reciprocal: the
    /// ray's point then moves by less than 2^-126 t along that axis. That must be less than 4 u of `error`. So the
    /// origin lies within the enlarged planes wherever the point does, and the axis excludes nothing.
    #[inline(always)]
    pub(crate) fn with_error(ray: &Ray, error: DVec3) -> Self {
        Self::widened(ray, (error * ERROR_MARGIN).as_vec3(), false, false)
    }

    #[inline(always)]
    fn widened(ray: &Ray, error: Vec3, fused: bool, fast: bool) -> Self {
        let longest = ray.direction.abs().max_element();
        // Directions that are far from length 1 are scaled by a power of two, which is exact.
        let (scale, direction) = if LENGTHS.contains(&longest) {
            (1.0, ray.direction)
        } else {
            let scale = power_of_two_below(longest);
            (scale, ray.direction / scale)
        };
        let (direction, origin) = (direction.as_vec3(), ray.origin.as_vec3());
        let inverse = direction.recip();
        let offset = if fused { origin * inverse } else { origin };
        // A subnormal origin is off by half its last place, times `inverse`. The least normal number covers that:
        // processors are slow at subnormal ones.
        let underflow = if fused { inverse.abs() } else { Vec3::ZERO };
        let widening = offset.abs() * WIDENING + (underflow + 1.0) * f32::MIN_POSITIVE + error;
        let widening = if fast { Vec3::ZERO } else { widening };
        let (greatest, least) = (offset + widening, offset - widening);
        let mut prepared = BoxRay {
            inverse: inverse.to_array(),
            near: [Side::new(false); 3],
            offsets: [[0.0; 2]; 3],
            t_min: round_down(ray.t_min * scale),
            scale,
        };
        for axis in 0..3 {
            let downwards = inverse[axis] < 0.0;
            prepared.near[axis] = Side::new(downwards);
            // The near plane is moved nearer, the far plane farther.
            let swapped = downwards && !fused;
            prepared.offsets[axis] =
                if swapped { [least[axis], greatest[axis]] } else { [greatest[axis], least[axis]] };
        }
        prepared
    }

    /// A ray without zeros in its direction, which needs no scaling, from its prepared numbers.
    #[inline(always)]
    pub(crate) fn of_parts(inverse: [f32; 3], offsets: [[f32; 2]; 3], t_min: f32) -> Self {
        let [x, y, z] = inverse;
        let near = [Side::of_sign(x), Side::of_sign(y), Side::of_sign(z)];
        BoxRay { inverse, near, offsets, t_min, scale: 1.0 }
    }

    /// The distance beyond which no box around a hit at `t` is entered. Computed entry distances are at most 4 u too
    /// far, and rounding `t` takes u.
    #[inline(always)]
    pub(crate) fn prune_distance(&self, t: f64) -> f32 {
        prune_distance(t * self.scale)
    }

    /// The distance along the ray of a distance of boxes.
    #[inline(always)]
    pub(crate) fn along_ray(&self, at: f32) -> f64 {
        f64::from(at) / self.scale
    }

    /// The distances at which the ray enters and leaves the boxes of `node`, clamped to `t_min` and `t_max`, the
    /// second with its margin. A box may be entered if the first is not larger. Conservative: every box that contains
    /// a point of the exact ray between `t_min` and `t_max` is entered. `fast`, for rays prepared so: without margins.
    #[inline(always)]
    pub(crate) fn span<S: Simd, const FUSED: bool>(
        &self,
        node: &Node,
        t_max: f32,
        fast: bool,
    ) -> (S::F8, S::F8) {
        let mut enter = S::F8::splat(self.t_min);
        let mut leave = S::F8::splat(t_max);
        for axis in 0..3 {
            let (near, inverse) = (self.near[axis], S::F8::splat(self.inverse[axis]));
            let [near_offset, far_offset] = self.offsets[axis];
            let far_offset = if fast { near_offset } else { far_offset };
            // NaN, from a ray in a plane of the box, is never taken.
            let planes = &node.planes[axis];
            let at_near = distances::<S::F8, FUSED>(S::planes(planes, near), inverse, near_offset);
            let at_far = distances::<S::F8, FUSED>(S::planes(planes, near.other()), inverse, far_offset);
            enter = at_near.max(enter);
            leave = at_far.min(leave);
        }
        (enter, if fast { leave } else { leave * S::F8::splat(MARGIN) })
    }

    /// The places of `node` whose boxes the ray enters, as bits, and the entry distances.
    #[inline(always)]
    pub(crate) fn enter<S: Simd, const FUSED: bool>(
        &self,
        node: &Node,
        t_max: f32,
        fast: bool,
    ) -> (u32, [f32; WIDTH]) {
        let (enter, leave) = self.span::<S, FUSED>(node, t_max, fast);
        (enter.le(leave) & node.present, enter.array())
    }
}

/// [`BoxRay::prune_distance`] of a ray that needs no scaling.
#[inline(always)]
pub(crate) fn prune_distance(t: f64) -> f32 {
    (t as f32).max(f32::MIN_POSITIVE) * MARGIN
}

/// The distances to eight planes of one axis.
#[inline(always)]
fn distances<F: Floats, const FUSED: bool>(planes: F, inverse: F, offset: f32) -> F {
    let offset = F::splat(offset);
    if FUSED { planes.mul_sub(inverse, offset) } else { (planes - offset) * inverse }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::wide::layout::Child;
    use crate::geometry::simd::{InstructionSet, with_simd};
    use crate::geometry::{Bounds, Precision};
    use proptest::prelude::*;

    /// The entry distance of a ray into a box; `None` if it is not entered. With `FUSED`, for a ray that is prepared
    /// so, by fused multiply-add where the machine has it.
    fn enters<const FUSED: bool>(ray: &BoxRay, [min, max]: [DVec3; 2], t_max: f64) -> Option<f64> {
        let mut node = Node::EMPTY;
        node.set(3, Bounds::rounded_out(min, max), Child::node(1));
        let t_max = ray.prune_distance(t_max);
        fn enter<S: Simd, const FUSED: bool>(_: S, ray: &BoxRay, node: &Node, t_max: f32) -> (u32, f32) {
            let (mask, at) = ray.enter::<S, FUSED>(node, t_max, false);
            (mask, at[3])
        }
        let [(mask, at), others @ ..] = InstructionSet::supported()
            .map(|set| with_simd!(set, simd => simd.run(|| enter::<_, FUSED>(simd, ray, &node, t_max))));
        // Fused multiply-add rounds once.
        let same = others.iter().all(|&other| (mask, at) == other);
        assert!(same || FUSED && mask == others[0].0 && others[0] == others[1]);
        let at = if FUSED { others[0].1 } else { at };
        assert_eq!(mask & !(1 << 3), 0, "an empty place");
        (mask != 0).then(|| ray.along_ray(at))
    }

    #[test]
    fn a_ray_in_a_face_is_inside() {
        let cube = [DVec3::ZERO, DVec3::ONE];
        for (origin, direction) in [
            (DVec3::new(0.0, 0.5, -1.0), DVec3::Z),
            (DVec3::new(1.0, 0.5, -1.0), DVec3::Z),
            (DVec3::new(1.0, 1.0, 2.0), -DVec3::Z),
            (DVec3::new(0.0, 0.0, 2.0), -DVec3::Z),
        ] {
            let entered = |origin: DVec3| {
                let ray = Precision::Single.ray(origin, direction, 0.0, f64::INFINITY);
                enters::<false>(&BoxRay::new(&ray, false, false), cube, f64::INFINITY)
            };
            // At 1, less the widening of 4 u of coordinates up to 2, and rounding.
            let at = entered(origin).expect("entered");
            assert!((1.0 - 8.0 * f64::from(f32::EPSILON)..=1.0).contains(&at), "{origin} {direction}: {at}");
            let outside = origin * DVec3::new(3.0, 1.0, 1.0) + DVec3::X * 1e-6;
            assert_eq!(entered(outside).is_some(), origin.x == 0.0);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        /// A ray moved by less than its error enters every box that it entered before, in time; also along axes, in
        /// planes, with components that f32 cannot hold, and with directions of any length.
        #[test]
        fn a_ray_off_by_its_error_misses_nothing(
            corners in prop::array::uniform2(prop::array::uniform3(-4i32..=4)),
            inside in prop::array::uniform3(0i32..=4),
            mut direction in prop::array::uniform3(prop_oneof![
                Just(0.0f64), Just(-0.0), Just(1.0), -1.0f64..1.0, -1e-9f64..1e-9, -1e-37f64..1e-37, -1e-44f64..1e-44
            ]),
            (axis, large) in (0usize..3, prop_oneof![Just(1.0f64), Just(-1.0), 0.001f64..1.0]),
            length in (-40i32..=40).prop_map(|exponent| f64::from(exponent).exp2()),
            from in -4.0f64..4.0,
            error in prop::array::uniform3((-20f64..-10.0).prop_map(f64::exp2)),
            moved in prop::array::uniform3(prop_oneof![Just(-1.0f64), Just(1.0), -1.0f64..=1.0]),
        ) {
            direction[axis] = large;
            let direction = DVec3::from(direction);
            let [a, b] = corners.map(|c| DVec3::from(c.map(f64::from)) / 4.0);
            let whole = [a.min(b), a.max(b)];
            // A point of the box, faces and corners included, and a ray through it.
            let point = whole[0] + (whole[1] - whole[0]) * DVec3::from(inside.map(f64::from)) / 4.0;
            let origin = point - direction * from;
            let error = DVec3::from(error);
            // 0.999: the origin is rounded, too.
            let off = origin + error * DVec3::from(moved) * 0.999;
            let ray = |origin, direction| Ray { origin, direction, t_min: 0.0, t_max: f64::INFINITY };
            let test = BoxRay::with_error(&ray(off, direction * length), error);
            let entered = enters::<false>(&test, whole, f64::INFINITY);
            if from >= 0.0 {
                // Three factors of 1 + u.
                let latest = from / length * (1.0 + 2.0 * f64::from(f32::EPSILON));
                prop_assert!(entered.is_some_and(|at| at <= latest), "{entered:?}, {latest}");
                prop_assert!(enters::<false>(&test, whole, from / length).is_some());
            }
            // The same of rays as they are, by fused multiply-add.
            if from >= 0.0 && direction.abs().min_element() >= 1e-9 {
                let exact = BoxRay::new(&ray(origin, direction), true, false);
                let latest = from * (1.0 + 2.0 * f64::from(f32::EPSILON));
                prop_assert!(enters::<true>(&exact, whole, from).is_some_and(|at| at <= latest));
            }
            // And it enters no more than a box enlarged by twice the error and its own rounding.
            let grown = error * 2.0 + (origin.abs() + 1.0) * 1e-5;
            let wide = BoxRay::new(&Precision::Single.ray(origin, direction, 0.0, f64::INFINITY), false, false);
            let larger = [whole[0] - grown, whole[1] + grown];
            prop_assert!(entered.is_none() || enters::<false>(&wide, larger, f64::INFINITY).is_some());
        }
    }
}
