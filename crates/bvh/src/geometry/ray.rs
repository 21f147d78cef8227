//! [`Ray`], [`Hit`] and the indices of primitives.

use std::num::NonZeroU32;

use glam::DVec3;

/// A ray: the points `origin + t * direction` with `t_min < t < t_max`, open at both ends.
///
/// [`Bvh::ray`](crate::bvh::Bvh::ray) and its relatives check and normalise what they make a ray of, and round it to the
/// precision of their tier. Each tier takes the rays of every other: `fast` rounds all rays to f32 itself, and f32 numbers
/// are exact in f64. [`super::Precision::ray`] and [`Ray::unchecked`] leave that to their caller. Numbers of a ray cannot
/// be changed, but for the ends by [`Ray::between`], which checks them:
///
/// ```compile_fail,E0616
/// # use kiln_bvh::Bvh;
/// let mut ray = Bvh::new([([0.0; 3], 1.0).into()]).unwrap().ray([0.0; 3], [1.0; 3]).unwrap();
/// ray.t_min = -1.0;
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Its origin.
    pub(crate) origin: DVec3,
    /// Its direction, of length 1 up to rounding, so that t is a distance.
    pub(crate) direction: DVec3,
    /// Hits are beyond this. Not negative: the margins of the box tests are valid for t >= 0 only.
    pub(crate) t_min: f64,
    /// Hits are before this.
    pub(crate) t_max: f64,
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
    /// Distance along the ray: directions have length 1 ([`Ray::direction`]).
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
    /// A ray of these numbers as they are. The caller ensures that they are finite but for `t_max`, that `t_min` is not
    /// negative, and that `direction` has length 1, or takes t in units of its length, from 2^-400 to 2^400. NaN is not
    /// refused: queries of another ray return any hits or none, without a panic.
    ///
    /// Up to those lengths nothing overflows or underflows: a direction is multiplied by two coordinates, below 2^129
    /// and with digits down to 2^-303 (coordinates below 2^-250 count as 0, and another 53 digits of those are computed).
    #[inline(always)]
    pub const fn unchecked(origin: DVec3, direction: DVec3, t_min: f64, t_max: f64) -> Self {
        Ray { origin, direction, t_min, t_max }
    }

    /// Its origin.
    #[inline(always)]
    pub const fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Its direction, of length 1 up to rounding, so that t is a distance.
    #[inline(always)]
    pub const fn direction(&self) -> DVec3 {
        self.direction
    }

    /// Hits are beyond this, which is not negative.
    #[inline(always)]
    pub const fn t_min(&self) -> f64 {
        self.t_min
    }

    /// Hits are before this.
    #[inline(always)]
    pub const fn t_max(&self) -> f64 {
        self.t_max
    }

    /// Its numbers in the order of [`Ray::unchecked`].
    #[inline(always)]
    pub(super) fn numbers(&self) -> [f64; 8] {
        let Ray { origin, direction, t_min, t_max } = self;
        [origin.x, origin.y, origin.z, direction.x, direction.y, direction.z, *t_min, *t_max]
    }

    /// The ray of [`Ray::numbers`].
    #[inline(always)]
    pub(super) fn of_numbers([x, y, z, dx, dy, dz, t_min, t_max]: [f64; 8]) -> Self {
        Ray { origin: DVec3::new(x, y, z), direction: DVec3::new(dx, dy, dz), t_min, t_max }
    }

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
