//! Where shadow and glaze rays start.
//!
//! A secondary ray must start on the outer side of the surface it leaves, or it hits that surface again (acne), and no
//! further out than it must, or it jumps through what lies close by (leaks). pbrt (4th edition, section 6.8) moves the
//! point along the geometric normal by a bound on its error, and rounds away from the surface. So here, in every tier; the
//! point is computed in f64, so what the bound has to cover is mostly the error of the test that the new ray will put to
//! the surface it leaves: tiny in the tiers that decide in f64, where the one large step is the rounding to the numbers
//! of the tier, at most two of theirs on each axis. No constant is involved, so it holds at every scale.

use glam::DVec3;

use super::Numerics;

/// A point of a surface, and the sizes that its error is relative to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// The point.
    pub position: DVec3,
    /// For each axis, the largest coordinate that it was computed from.
    pub reach: DVec3,
}

impl SurfacePoint {
    /// The point of a triangle with the given barycentric coordinates.
    #[inline(always)]
    pub fn on_triangle(corners: [DVec3; 3], weights: [f64; 3]) -> Self {
        let [a, b, c] = corners;
        SurfacePoint {
            position: a * weights[0] + b * weights[1] + c * weights[2],
            reach: a.abs().max(b.abs()).max(c.abs()),
        }
    }

    /// The point of a sphere in direction `normal` from its centre.
    #[inline(always)]
    pub fn on_sphere(centre: DVec3, radius: f64, normal: DVec3) -> Self {
        SurfacePoint { position: centre + normal * radius, reach: centre.abs() + radius }
    }

    /// The nearest start, in the numbers of a tier, that lies on the side of the surface that `normal` (of length 1) points
    /// to; or on it, where it is a plane through zero along an axis: a distance of 0 does not count.
    #[inline(always)]
    pub fn origin_towards(&self, normal: DVec3, numerics: Numerics) -> DVec3 {
        let error = numerics.surface_error() * normal.abs().dot(self.reach);
        numerics.precision().round_towards(self.position + normal * error, normal)
    }
}

impl Numerics {
    /// How far a point may lie beside its surface and be taken for one of it, relative to the coordinates of that
    /// surface. A bound on the point's own rounding and on that of a test that starts from it.
    ///
    /// In f32 it is pbrt's γ7, rounded up to 8 u. In f64 it is 2^-44, well above the 8 u that the point is off by; tests
    /// that start so near a triangle look at the side of its plane ([`super::woop`]), whose error is of that order.
    #[inline(always)]
    fn surface_error(self) -> f64 {
        match self {
            Numerics::Fast => 4.0 * f64::from(f32::EPSILON),
            Numerics::Watertight | Numerics::Double | Numerics::Exact => 256.0 * f64::EPSILON,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// On the right side of the plane, and within two f32 steps of the point on every axis.
        #[test]
        fn starts_outside_and_close(
            corners in prop::array::uniform3(prop::array::uniform3(-1.0f32..1.0)),
            moved in prop::array::uniform3(-1e5f32..1e5),
            weights in (0.0f64..1.0, 0.0f64..1.0),
            scale in -30i32..30,
        ) {
            let s = (scale as f32).exp2();
            let corners = corners.map(|c| {
                DVec3::from([0, 1, 2].map(|k| f64::from((c[k] + moved[k]) * s)))
            });
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            prop_assume!(normal.length() > f64::from(s * s) * 1e-3);
            let normal = normal.normalize();
            let (u, v) = if weights.0 + weights.1 > 1.0 { (1.0 - weights.0, 1.0 - weights.1) } else { weights };
            let point = SurfacePoint::on_triangle(corners, [1.0 - u - v, u, v]);
            for side in [normal, -normal] {
                let origin = point.origin_towards(side, Numerics::Watertight);
                // Exact differences, so this sign is as good as the normal.
                prop_assert!((origin - corners[0]).dot(side) > 0.0);
                for k in 0..3 {
                    let step = f64::from((point.position[k] as f32).abs().next_up()) - f64::from((point.position[k] as f32).abs());
                    prop_assert!((origin[k] - point.position[k]).abs() <= 2.0 * step);
                }
            }
        }
    }
}
