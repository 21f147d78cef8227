//! Rays and what they hit.

use glam::DVec3;

/// A ray: the points `origin + t * direction` with `t_min < t < t_max`, open at both ends. All its numbers are ones
/// that f32 can hold, except the ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: DVec3,
    /// Where it goes; of length 1 up to the rounding to f32, so that t is a distance.
    pub direction: DVec3,
    /// What lies at or before this is not hit.
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

/// Direction components smaller than this share of the largest are taken as 0. It is far below what rounding to f32
/// has done to the direction already (2^-25 of the largest), and keeps the reciprocals of the box test finite.
const SMALLEST_COMPONENT: f64 = 1.0 / (1u128 << 100) as f64;

impl Ray {
    /// A ray whose origin and direction are rounded to the nearest f32 numbers. Zeros are positive zeros.
    ///
    /// `direction` must be finite and not zero, `origin` finite.
    #[inline]
    pub fn new(origin: DVec3, direction: DVec3, t_min: f64, t_max: f64) -> Self {
        let direction = direction.as_vec3().as_dvec3();
        let floor = direction.abs().max_element() * SMALLEST_COMPONENT;
        let flush = |c: f64| if c.abs() < floor { 0.0 } else { c + 0.0 };
        let ray = Ray {
            origin: origin.as_vec3().as_dvec3(),
            direction: DVec3::new(flush(direction.x), flush(direction.y), flush(direction.z)),
            t_min,
            t_max,
        };
        debug_assert!(
            ray.origin.is_finite() && ray.direction.is_finite(),
            "a ray that is not finite: {ray:?}"
        );
        debug_assert!(floor > 0.0, "a ray without direction: {ray:?}");
        ray
    }

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
    fn rays_hold_f32_numbers_and_no_negative_zero() {
        let ray = Ray::new(DVec3::splat(0.1), DVec3::new(-0.0, -1.0, 1e-40), 0.0, 1.0);
        assert_eq!(ray.origin, DVec3::splat(f64::from(0.1f32)));
        assert_eq!(ray.direction.to_array().map(f64::to_bits), [0.0, -1.0, 0.0].map(f64::to_bits));
    }

    #[test]
    fn ties_go_to_the_lowest_id() {
        let hit = |t, prim| Hit { t, prim: PrimId(prim), slot: SlotId(0), weights: [0.0; 2] };
        assert!(hit(1.0, 5).is_before(&hit(2.0, 1)));
        assert!(hit(1.0, 1).is_before(&hit(1.0, 2)));
        assert!(!hit(1.0, 2).is_before(&hit(1.0, 2)));
    }
}
