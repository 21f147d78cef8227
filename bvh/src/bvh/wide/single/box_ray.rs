//! [`BoxRay`]: the test of one ray against the eight boxes of a node. Used by the single-ray traversal and by streams.
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
use glam::Vec3;

/// The factor by which the distance at which a ray leaves a box is enlarged: [`PRUNE_MARGIN`], and 8 u for the different
/// arithmetic here.
pub(crate) const MARGIN: f32 = PRUNE_MARGIN + 4.0 * f32::EPSILON;

/// The share of itself by which an offset is moved. It is off by up to 2 u (an f64 origin is rounded, then
/// multiplied); this is 4 u. Underflow is covered by adding the least normal number.
pub(crate) const WIDENING: f32 = 2.0 * f32::EPSILON;

/// Largest direction components for which distances to planes stay far from the limits of f32.
pub(crate) const LENGTHS: std::ops::RangeInclusive<f64> = 1.0 / 1024.0..=1024.0;

/// A ray prepared for the boxes of nodes.
#[derive(Debug, Clone, Copy, PartialEq)]
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
        let widening = offset.abs() * WIDENING + (underflow + 1.0) * f32::MIN_POSITIVE;
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
