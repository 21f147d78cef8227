//! Where shadow and glaze rays start.
//!
//! A secondary ray must start on the outer side of the surface it leaves, or it hits that surface again (acne), and no
//! further out than it must, or it jumps through what lies close by (leaks). pbrt (4th edition, section 6.8) moves the
//! point along the geometric normal by a bound on its error. Here the point is computed in f64, so that the bound is
//! tiny, and the one large rounding, to the f32 numbers of a ray, is made away from the surface on every axis; what
//! remains is at most two f32 steps a coordinate. No constant is involved, so it holds at every scale.

use glam::DVec3;

use super::bounds::round_towards;

/// Bound on the rounding of a sum of three products in f64, with room for that of its weights: γ8 is 8 * 2^-53.
const RELATIVE_ERROR: f64 = 4.0 * f64::EPSILON;

/// A point of a surface and how far off it may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// The point.
    pub position: DVec3,
    /// For each axis, a bound on the distance to the surface it should lie on.
    pub error: DVec3,
}

impl SurfacePoint {
    /// The point of a triangle with the given barycentric coordinates.
    pub fn on_triangle(corners: [DVec3; 3], weights: [f64; 3]) -> Self {
        let [a, b, c] = [0, 1, 2].map(|k| corners[k] * weights[k]);
        SurfacePoint { position: a + b + c, error: RELATIVE_ERROR * (a.abs() + b.abs() + c.abs()) }
    }

    /// The point of a sphere in direction `normal` from its centre.
    pub fn on_sphere(centre: DVec3, radius: f64, normal: DVec3) -> Self {
        let arm = normal * radius;
        SurfacePoint { position: centre + arm, error: RELATIVE_ERROR * (centre.abs() + arm.abs()) }
    }

    /// The nearest start, in f32 numbers, that is certain to lie on the side of the surface that `normal` (of length 1)
    /// points to.
    #[inline]
    pub fn origin_towards(&self, normal: DVec3) -> DVec3 {
        let out = self.position + normal * normal.abs().dot(self.error);
        let (x, y) = (round_towards(out.x, normal.x), round_towards(out.y, normal.y));
        DVec3::new(f64::from(x), f64::from(y), f64::from(round_towards(out.z, normal.z)))
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
                let origin = point.origin_towards(side);
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
