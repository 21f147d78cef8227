//! The triangle test of the tiers that do not leak.
//!
//! Woop, Benthin and Wald, Watertight Ray/Triangle Intersection, JCGT 2(1) 2013, section 3, carried out in f64: the
//! vertices are sheared so that the ray is the third axis, and the hit is decided by three edge functions
//! `p.x * q.y - p.y * q.x` in the plane.
//!
//! Why f64 throughout rather than f32 with a fallback: rounding is monotone, so the rounded difference of two rounded
//! products has the sign of the exact difference or is zero. With zero on the inside, a hit between two triangles that
//! share an edge cannot be lost, in any precision; in f64 the sheared vertices are moreover within a few 2^-53 of exact,
//! relative on each axis to their distance from the ray's origin, so hits are decided as for the true triangles except
//! within that of an edge. No FMA: it would break the symmetry between the two sides of an edge.

use glam::DVec3;

use super::bounds::hold;
use super::{Corner, Ray, TriangleHit};

/// A ray made ready for triangles.
pub struct WoopTest {
    origin: DVec3,
    /// The axis that the ray runs along most.
    along: Along,
    /// The two shears, and the reciprocal of the direction along that axis.
    pub shear: [f64; 3],
}

#[derive(Clone, Copy)]
enum Along {
    X,
    Y,
    Z,
}

/// A triangle seen along a ray: its corners from the ray's origin, axes turned so that the ray runs along the third,
/// and what is left of them across the ray.
pub struct Sheared {
    /// The corners.
    pub corners: [DVec3; 3],
    /// How far they lie aside of the ray.
    pub aside: [[f64; 2]; 3],
}

impl WoopTest {
    /// Prepares `ray`.
    #[inline]
    pub fn new(ray: &Ray) -> Self {
        let (d, length) = (ray.direction, ray.direction.abs());
        let (along, turned) = if length.x >= length.y && length.x >= length.z {
            (Along::X, DVec3::new(d.y, d.z, d.x))
        } else if length.y >= length.z {
            (Along::Y, DVec3::new(d.z, d.x, d.y))
        } else {
            (Along::Z, d)
        };
        let reciprocal = 1.0 / turned.z;
        let shear = [turned.x * reciprocal, turned.y * reciprocal, reciprocal];
        WoopTest { origin: ray.origin, along, shear }
    }

    /// The axes turned so that the ray runs along the last; written out, they stay in registers.
    #[inline(always)]
    pub fn turned(&self, v: DVec3) -> DVec3 {
        match self.along {
            Along::X => DVec3::new(v.y, v.z, v.x),
            Along::Y => DVec3::new(v.z, v.x, v.y),
            Along::Z => v,
        }
    }

    /// The triangle seen along the ray.
    #[inline(always)]
    pub fn sheared<C: Corner>(&self, [a, b, c]: &[C; 3]) -> Sheared {
        let from_origin = |corner: &C| self.turned(corner.raise() - self.origin);
        let corners = [from_origin(a), from_origin(b), from_origin(c)];
        let aside = |v: DVec3| [v.x - self.shear[0] * v.z, v.y - self.shear[1] * v.z];
        Sheared { corners, aside: corners.map(aside) }
    }

    /// Where `ray`, for which this was made, hits the triangle within the ray's ends.
    #[inline(always)]
    pub fn hit<C: Corner>(&self, ray: &Ray, corners: &[C; 3]) -> Option<TriangleHit> {
        let sheared = self.sheared(corners);
        let [weight_a, weight_b, weight_c] = sheared.weights();
        let inside = (weight_a >= 0.0 && weight_b >= 0.0 && weight_c >= 0.0)
            || (weight_a <= 0.0 && weight_b <= 0.0 && weight_c <= 0.0);
        let sum = weight_a + weight_b + weight_c;
        if !inside || sum == 0.0 {
            return None;
        }
        let share = 1.0 / sum;
        // A convex combination of the corners' depths: its error is relative to the triangle, not to the scene.
        let [a, b, c] = sheared.corners;
        let t = (weight_a * a.z + weight_b * b.z + weight_c * c.z) * share * self.shear[2];
        let [min, max] = C::span(corners);
        let t = hold(min, max, ray, t);
        (ray.t_min < t && t < ray.t_max)
            .then_some(TriangleHit { t, weights: [weight_b * share, weight_c * share] })
    }
}

impl Sheared {
    /// The edge functions, each proportional to the weight of the corner opposite.
    #[inline(always)]
    pub fn weights(&self) -> [f64; 3] {
        let [[ax, ay], [bx, by], [cx, cy]] = self.aside;
        [cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax]
    }
}
