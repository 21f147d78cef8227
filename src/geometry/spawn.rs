//! Origins of secondary rays: shadow, reflection and every other ray that leaves a surface.
//!
//! A secondary ray must start in the free space in front of the surface, or it hits that surface again (acne) or starts behind a
//! neighbouring one (a leak). Offsetting the hit point along the normal (pbrt, 4th edition, section 6.8) is not enough at an
//! edge of a concave corner: there the offset point lies on or behind the neighbouring face. So the point is moved twice:
//! 1. within its triangle, until it is at least [`EDGE_DISTANCE`] R from every edge, and
//! 2. along the geometric normal by [`ORIGIN_OFFSET`] R,
//!
//! where R is the largest coordinate of the triangle's corners. Both are shares of the coordinates that the point was computed from,
//! so they hold at every scale.
//!
//! # What this guarantees (`watertight`, `double`, `exact`)
//! Let u = 2^-53. The hit point is off by less than 8 u R: four roundings of the convex combination, of which each axis has R at most,
//! and three of the weights' sum. A triangle test sees each corner moved by at most 8 u times its distance from the origin
//! (moving it to the origin rounds by 2 u, the shear by 2 u, their product by u and the difference by 2 u), so by 16 u R for the corners of
//! this triangle. The origin is 2^13 u R above the plane, more than 150 times both together in Euclidean norm, so it is in front of
//! its own triangle, also as a test sees it.
//!
//! A neighbouring face that shares an edge with the triangle at a dihedral angle a rises to EDGE_DISTANCE R tan a above the
//! point; the origin is in front of that face, too, as long as that is more than ORIGIN_OFFSET R and the errors above: for
//! every a > 2^-16.9, 0.0005 degrees. The same holds for a face that shares one corner only, with the angle between the
//! two planes' directions at that corner. Then the origin lies inside the closed mesh that the test sees, whose
//! edges have no gaps, and no ray can leave that mesh without a hit.
//!
//! The point moves towards the centroid: by about EDGE_DISTANCE R in a triangle as wide as it is long, by more in one that is longer than
//! wide, and by half the way at most.
//!
//! Where it does not hold: triangles thinner than 6 EDGE_DISTANCE R have no point that far from all edges, and the bound on the
//! angle grows by as much as they are thinner; surfaces that share no corner with the triangle and lie closer than 2
//! ORIGIN_OFFSET R are jumped.
//!
//! The tier `fast` rounds the origin to f32, away from the surface, and promises nothing at edges.

use glam::DVec3;

use super::{Numerics, Triangle};

/// How far origins are kept from the edges of their triangle, relative to the largest coordinate of its corners: 2^-23, the spacing of
/// f32 numbers.
pub const EDGE_DISTANCE: f64 = 1.0 / (1u32 << 23) as f64;

/// How far origins are moved along the normal, relative to the same: 2^-40. Above the errors (2^-49), so that f64 decides cheaply on which
/// side of its own triangle a ray starts; below [`EDGE_DISTANCE`] by the smallest dihedral angle that is guaranteed.
pub const ORIGIN_OFFSET: f64 = 1.0 / (1u64 << 40) as f64;

/// A point on a surface, and the magnitudes that its error is relative to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// The point.
    pub position: DVec3,
    /// The point moved within its triangle to at least [`EDGE_DISTANCE`] from the edges: where secondary rays leave.
    pub interior: DVec3,
    /// For each axis, the largest coordinate that it was computed from.
    pub reach: DVec3,
}

impl SurfacePoint {
    /// The point of a triangle with the given barycentric coordinates.
    #[inline(always)]
    pub fn on_triangle(corners: [DVec3; 3], weights: [f64; 3]) -> Self {
        let [a, b, c] = corners;
        let reach = a.abs().max(b.abs()).max(c.abs());
        let at = |weights: [f64; 3]| a * weights[0] + b * weights[1] + c * weights[2];
        let position = at(weights);
        let interior = interior_weights(corners, weights, EDGE_DISTANCE * reach.max_element());
        SurfacePoint { position, interior: interior.map_or(position, at), reach }
    }

    /// The point of a sphere in direction `normal` from its centre.
    #[inline(always)]
    pub fn on_sphere(centre: DVec3, radius: f64, normal: DVec3) -> Self {
        let position = centre + normal * radius;
        SurfacePoint { position, interior: position, reach: centre.abs() + radius }
    }

    /// The same point moved by `offset`.
    #[inline(always)]
    pub fn moved(self, offset: DVec3) -> Self {
        SurfacePoint { position: self.position + offset, interior: self.interior + offset, ..self }
    }

    /// The origin of a ray that leaves the surface on the side that `normal` (of length 1) points to.
    #[inline(always)]
    pub fn origin_towards(&self, normal: DVec3, numerics: Numerics) -> DVec3 {
        if numerics == Numerics::Fast {
            let error = FAST_ERROR * normal.abs().dot(self.reach);
            return round_away(self.interior + normal * error, normal);
        }
        self.interior + normal * (ORIGIN_OFFSET * self.reach.max_element())
    }
}

/// Error of a point and of a triangle test in f32, relative to the coordinates of the triangle: γ7 (pbrt, 4th edition, section 6.8.1),
/// rounded up to 8 units of 2^-24.
const FAST_ERROR: f64 = 4.0 * f32::EPSILON as f64;

/// Each coordinate rounded to f32, in the direction of `normal` on its axis; to the nearest where that is 0.
#[inline(always)]
fn round_away(point: DVec3, normal: DVec3) -> DVec3 {
    use super::bounds::round_towards;
    let [x, y, z] = [0, 1, 2].map(|axis| f64::from(round_towards(point[axis], normal[axis])));
    DVec3::new(x, y, z)
}

/// Barycentric coordinates moved towards the centroid until the point is `distance` from every edge, or half as far as the centroid
/// is where the triangle is too thin for that. `None` where it is far enough from them already.
#[inline(always)]
fn interior_weights(corners: [DVec3; 3], weights: [f64; 3], distance: f64) -> Option<[f64; 3]> {
    const CENTROID: f64 = 1.0 / 3.0;
    let triangle = Triangle(corners);
    let [a, b, c] = weights;
    let smallest = a.min(b).min(c);
    // A weight is the distance from the opposite edge over the height on it, which is least on the longest edge.
    let (longest_squared, area_squared) =
        (triangle.longest_edge_squared(), triangle.normal().length_squared());
    if smallest > 0.0 && smallest * smallest * area_squared >= distance * distance * longest_squared {
        return None;
    }
    // Without an area the quotient is infinite or NaN.
    let least = (distance * (longest_squared / area_squared).sqrt()).min(CENTROID / 2.0);
    let share = ((least - smallest) / (CENTROID - smallest).max(CENTROID / 2.0)).max(0.0);
    Some(weights.map(|weight| weight + share * (CENTROID - weight)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Distances of a point from the lines through the edges, positive inside.
    fn distances(corners: [DVec3; 3], p: DVec3) -> [f64; 3] {
        let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        [(1, 2), (2, 0), (0, 1)].map(|(i, j)| {
            let along = (corners[j] - corners[i]).normalize();
            n.cross(along).dot(p - corners[i])
        })
    }

    proptest! {
        /// In front of the plane by the offset, and as far from the edges as promised: also for points on edges and corners, and for
        /// weights that rounding made negative.
        #[test]
        fn origins_are_in_front_and_away_from_edges(
            corners in prop::array::uniform3(prop::array::uniform3(-1.0f64..1.0)),
            moved in prop::array::uniform3(-1e3f64..1e3),
            weights in prop::array::uniform2(prop_oneof![Just(0.0), Just(1.0), Just(1e-17), Just(-1e-17), 0.0f64..1.0]),
            scale in -30i32..30,
        ) {
            let s = f64::from(scale).exp2();
            let corners = corners.map(|c| (DVec3::from(c) + DVec3::from(moved)) * s);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            prop_assume!(normal.length() > s * s * 1e-2);
            let normal = normal.normalize();
            let [v, w] = weights;
            prop_assume!(v + w <= 1.0);
            let point = SurfacePoint::on_triangle(corners, [1.0 - v - w, v, w]);
            let r = point.reach.max_element();
            for (k, distance) in distances(corners, point.interior).into_iter().enumerate() {
                prop_assert!(distance >= EDGE_DISTANCE * r * (1.0 - 1e-6), "edge {}: {}", k, distance / r);
            }
            let hit = corners[0] * (1.0 - v - w) + corners[1] * v + corners[2] * w;
            // The share of the way to the centroid is at most 6 distances over the least height.
            let heights = distances(corners, (corners[0] + corners[1] + corners[2]) / 3.0).map(|d| 3.0 * d);
            let least = heights.into_iter().fold(f64::INFINITY, f64::min);
            prop_assert!(point.position == hit);
            prop_assert!(point.interior.distance(hit) <= 6.0 * EDGE_DISTANCE * r / least * 4.0 * s);
            for numerics in [Numerics::Watertight, Numerics::Double, Numerics::Exact] {
                for side in [normal, -normal] {
                    let height = (point.origin_towards(side, numerics) - corners[0]).dot(side);
                    prop_assert!((height / (ORIGIN_OFFSET * r) - 1.0).abs() < 1.0 / 64.0, "{}", height / r);
                }
            }
        }
    }

    #[test]
    fn a_triangle_without_area_has_finite_points() {
        let line = [DVec3::ZERO, DVec3::X, DVec3::X * 3.0];
        for weights in [[1.0, 0.0, 0.0], [0.0, 0.5, 0.5]] {
            let point = SurfacePoint::on_triangle(line, weights).interior;
            assert!(point.is_finite() && (0.0..=3.0).contains(&point.x), "{point}");
        }
        let point = SurfacePoint::on_triangle([DVec3::ONE; 3], [1.0, 0.0, 0.0]).interior;
        assert!((point - DVec3::ONE).abs().max_element() <= 2.0 * f64::EPSILON, "{point}");
    }
}
