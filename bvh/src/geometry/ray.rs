//! [`Ray`], [`Hit`] and the indices of primitives.

use std::num::NonZeroU32;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

/// A ray: the points `origin + t * direction` with `t_min < t < t_max`, open at both ends. Origin and direction are
/// rounded to the precision of its tier by [`super::Precision::ray`].
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Ray {
    /// Its origin.
    pub origin: DVec3,
    /// Its direction, of length 1 up to rounding, so that t is a distance.
    pub direction: DVec3,
    /// Hits are beyond this. Not negative: the margins of the box tests are valid for t >= 0 only.
    pub t_min: f64,
    /// Hits are before this.
    pub t_max: f64,
}

/// A primitive's index in the scene description, at most `u32::MAX - 1`. Decides between hits at equal distance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PrimId(pub u32);

/// The id of no primitive.
pub(crate) const NO_PRIMITIVE: u32 = u32::MAX;

/// A primitive's index in an acceleration structure. Stored plus 1, so that `Option<Hit>` is no larger than [`Hit`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SlotId(NonZeroU32);

impl SlotId {
    /// The slot of an index, at most `u32::MAX - 1`.
    #[inline(always)]
    pub const fn new(index: u32) -> Self {
        debug_assert!(index < u32::MAX);
        SlotId(NonZeroU32::MIN.saturating_add(index))
    }

    /// Its index.
    #[inline(always)]
    pub const fn index(self) -> u32 {
        self.0.get() - 1
    }
}

/// The result of an intersection test. The surface interaction is computed from it once, for the closest hit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance along the ray: directions have length 1 (see [`Ray::direction`]).
    pub t: f64,
    /// The primitive.
    pub prim: PrimId,
    /// The slot of its geometry.
    pub slot: SlotId,
    /// The barycentrics v and w of the point: the weights of the triangle's second and third corner. That of the first
    /// is u = 1 - v - w. Meaningless on other shapes: [`crate::bvh::Accelerator::primitive`] of the slot returns which.
    pub barycentrics: [f64; 2],
}

impl Ray {
    /// The point at `t`.
    #[inline]
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + t * self.direction
    }
}

impl Hit {
    /// Whether this hit is nearer than `other`, or equally near with the lower primitive id.
    #[inline]
    pub fn is_before(&self, other: &Hit) -> bool {
        self.t < other.t || (self.t == other.t && self.prim < other.prim)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_hit_takes_no_room() {
        assert_eq!(size_of::<Option<Hit>>(), size_of::<Hit>());
        assert_eq!([0, 7, u32::MAX - 1].map(|index| SlotId::new(index).index()), [0, 7, u32::MAX - 1]);
    }
}
