//! Rays and what they hit.

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

/// A ray: the points `origin + t * direction` with `t_min < t < t_max`, open at both ends. Its origin
/// and its direction are numbers of the tier that it is made for: see [`super::Precision::ray`].
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Ray {
    /// Where it starts.
    pub origin: DVec3,
    /// Where it goes; of length 1 up to that rounding, so that t is a distance.
    pub direction: DVec3,
    /// What lies at or before this is not hit. Not negative: boxes are tested with margins that hold on that side of 0 only.
    pub t_min: f64,
    /// What lies at or beyond this is not hit.
    pub t_max: f64,
}

/// A primitive by its place in the description; decides between hits at the same distance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PrimId(pub u32);

/// A primitive by its place in an acceleration structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SlotId(pub u32);

/// The least that is known of a hit; the rest is computed once, for the hit that counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance along the ray, in units of its direction's length.
    pub t: f64,
    /// What was hit.
    pub prim: PrimId,
    /// Where its geometry is kept.
    pub slot: SlotId,
    /// On a triangle, the barycentric coordinates of its second and third corner; 0 on a sphere.
    pub weights: [f64; 2],
}

impl Ray {
    /// The point at `t`.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + t * self.direction
    }
}

impl Hit {
    /// Whether this hit comes before `other`: nearer, or as near and of a lower id.
    #[inline]
    pub fn is_before(&self, other: &Hit) -> bool {
        self.t < other.t || (self.t == other.t && self.prim < other.prim)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ties_go_to_the_lowest_id() {
        let hit = |t, prim| Hit { t, prim: PrimId(prim), slot: SlotId(0), weights: [0.0; 2] };
        assert!(hit(1.0, 5).is_before(&hit(2.0, 1)));
        assert!(hit(1.0, 1).is_before(&hit(1.0, 2)));
        assert!(!hit(1.0, 2).is_before(&hit(1.0, 2)));
    }
}
