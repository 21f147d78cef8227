//! Origins of secondary rays: shadow, reflection and every other ray that leaves a surface.
//!
//! A secondary ray must start in the free space in front of the surface, or it hits that surface again (acne) or
//! starts behind a neighbouring one (a leak). Offsetting the hit point along the normal (pbrt, 4th edition, section
//! 6.8) is not enough at an edge of a concave corner: there the offset point lies on or behind the neighbouring face.
//! Only the points of the incoming ray before the hit are known to be free. So the origin is
//! - farther than [`EDGE_DISTANCE`] R from the edges of the triangle: the hit point, moved along the geometric normal
//!   by [`ORIGIN_OFFSET`] R;
//! - nearer: the point of the incoming ray EDGE_DISTANCE R before the hit, or halfway if the ray is shorter than
//!   twice that, moved along the normal up to a height of ORIGIN_OFFSET R.
//!
//! R is the largest coordinate of the triangle's corners. Both distances are relative to the coordinates that the
//! point was computed from, so they hold at every scale.
//!
//! # What this guarantees (`watertight`, `double`, `exact`)
//! Let u = 2^-53. The hit point is off by less than 8 u R: four roundings of the convex combination, each at most u R
//! per axis, and three of the weights' sum. The triangle test sees each corner moved by at most 8 u times its
//! distance from the origin (the difference from the origin rounds by 2 u, the shear by 2 u, their product by u and
//! the last difference by 2 u), so by 16 u R for the corners of this triangle. The origin is 2^13 u R above the
//! plane, more than 150 times both together in Euclidean norm, so it is in front of its own triangle, also as the
//! test sees it.
//!
//! *Far from the edges*, a face that shares an edge with the triangle at a dihedral angle a is EDGE_DISTANCE R tan a
//! above the point; the origin is in front of that face, too, as long as that exceeds ORIGIN_OFFSET R plus the errors
//! above: for every a > 2^-16.9, 0.0005 degrees. The same holds for a face that shares one corner only, with the
//! angle between the two planes' directions at that corner.
//!
//! *Near an edge*, the incoming ray came from in front of every face at the point. At an angle b to such a face, the
//! origin is EDGE_DISTANCE R sin b in front of it: above the errors for b > 2^-25, 2e-6 degrees. That holds for each
//! face at the point, whatever its dihedral angle and width, also if the hit was on the edge of a face hidden by its
//! neighbour. The offset along the normal is 0 if the ray meets the triangle itself at more than 2^-17; at less, it
//! must meet faces that lean over the triangle at more than that.
//!
//! Then the origin lies inside the closed mesh that the test sees, whose edges have no gaps, and no ray leaves that
//! mesh without a hit.
//!
//! Exceptions:
//! - Surfaces that share no corner with the triangle and lie closer than 2 ORIGIN_OFFSET R are jumped.
//! - A ray that passes the border of a face's bounding box within 2^-49 R, less than 2^-23 R from its origin along an
//!   axis, may be rejected by the box tests (`DOUBLE_MARGIN`). That takes a fold sharper than about
//!   30 degrees, or a spike with such an opening angle, and a ray aimed that closely at another edge of the
//!   neighbouring face.
//!
//! The tier `fast` rounds the origin to f32, away from the surface, and guarantees nothing at edges.

use glam::DVec3;

use super::{Numerics, Triangle};

/// The distance to an edge below which a point is near it, relative to the largest coordinate of the triangle's
/// corners: 2^-23, the spacing of f32 numbers.
pub const EDGE_DISTANCE: f64 = 1.0 / (1u32 << 23) as f64;

/// The least height of an origin above its triangle, relative to the same: 2^-40. Above the errors (2^-49), so that
/// f64 decides on which side of its own triangle a ray starts; below [`EDGE_DISTANCE`] by the smallest guaranteed
/// dihedral angle.
pub const ORIGIN_OFFSET: f64 = 1.0 / (1u64 << 40) as f64;

/// A point on a surface, from which secondary rays start, and the coordinates that its error is relative to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// The point.
    pub position: DVec3,
    /// The point that is offset: `position`, or near an edge the point of the incoming ray before it.
    pub start: DVec3,
    /// The largest coordinate that it was computed from, per axis.
    pub reach: DVec3,
}

impl SurfacePoint {
    /// The point of a triangle with the given barycentric coordinates, hit by a ray of length `distance`. `view` is
    /// the unit direction towards the ray's origin.
    #[inline(always)]
    pub fn on_triangle(corners: [DVec3; 3], weights: [f64; 3], view: DVec3, distance: f64) -> Self {
        let [a, b, c] = corners;
        let reach = a.abs().max(b.abs()).max(c.abs());
        let position = a * weights[0] + b * weights[1] + c * weights[2];
        let near = EDGE_DISTANCE * reach.max_element();
        let shift = if is_near_edge(corners, weights, near) { near.min(0.5 * distance) } else { 0.0 };
        SurfacePoint { position, start: position + view * shift, reach }
    }

    /// The point of a sphere in direction `normal` from its centre.
    #[inline(always)]
    pub fn on_sphere(centre: DVec3, radius: f64, normal: DVec3) -> Self {
        let position = centre + normal * radius;
        SurfacePoint { position, start: position, reach: centre.abs() + radius }
    }

    /// The point moved by `offset`.
    #[inline(always)]
    pub fn moved(self, offset: DVec3) -> Self {
        SurfacePoint { position: self.position + offset, start: self.start + offset, ..self }
    }

    /// The origin of a ray that leaves the surface on the side of the unit vector `normal`.
    #[inline(always)]
    pub fn origin_towards(&self, normal: DVec3, numerics: Numerics) -> DVec3 {
        if numerics == Numerics::Fast {
            let error = FAST_ERROR * normal.abs().dot(self.reach);
            return round_away(self.start + normal * error, normal);
        }
        let height = (self.start - self.position).dot(normal);
        self.start + normal * (ORIGIN_OFFSET * self.reach.max_element() - height).max(0.0)
    }
}

/// Error of a point and of a triangle test in f32, relative to the coordinates of the triangle: γ7 (pbrt, 4th
/// edition, section 6.8.1), rounded up to 8 units of 2^-24.
const FAST_ERROR: f64 = 4.0 * f32::EPSILON as f64;

/// Each coordinate rounded to f32 in the direction of `normal`; to nearest if that component is 0.
#[inline(always)]
fn round_away(point: DVec3, normal: DVec3) -> DVec3 {
    use super::bounds::round_towards;
    let [x, y, z] = [0, 1, 2].map(|axis| f64::from(round_towards(point[axis], normal[axis])));
    DVec3::new(x, y, z)
}

/// Whether a point of a triangle may be nearer than `distance` to an edge. `false` is certain, `true` is not.
#[inline(always)]
fn is_near_edge(corners: [DVec3; 3], [a, b, c]: [f64; 3], distance: f64) -> bool {
    let triangle = Triangle(corners);
    let smallest = a.min(b).min(c);
    // A weight is the distance to the opposite edge over the height above it, which is least above the longest edge.
    let (longest_squared, area_squared) =
        (triangle.longest_edge_squared(), triangle.normal().length_squared());
    !(smallest > 0.0 && smallest * smallest * area_squared >= distance * distance * longest_squared)
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
        /// In front of the plane by the offset at least and, near an edge, on the ray unless that grazes the plane;
        /// also for points on edges and corners, and for weights that rounding made negative.
        #[test]
        fn origins_are_in_front_and_near_edges_on_the_ray(
            corners in prop::array::uniform3(prop::array::uniform3(-1.0f64..1.0)),
            moved in prop::array::uniform3(-1e3f64..1e3),
            weights in prop::array::uniform2(prop_oneof![Just(0.0), Just(1.0), Just(1e-17), Just(-1e-17), 0.0f64..1.0]),
            (rise, turn, distance) in (prop_oneof![Just(1e-9), 1e-6f64..1.0], -3.0f64..3.0, prop_oneof![Just(1e-5), Just(1e3)]),
            scale in -30i32..30,
        ) {
            let s = f64::from(scale).exp2();
            let corners = corners.map(|c| (DVec3::from(c) + DVec3::from(moved)) * s);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            prop_assume!(normal.length() > s * s * 1e-2);
            let normal = normal.normalize();
            let [v, w] = weights;
            prop_assume!(v + w <= 1.0);
            let (along, aside) = normal.any_orthonormal_pair();
            let view = (rise * normal + turn.cos() * along + turn.sin() * aside).normalize();
            let point = SurfacePoint::on_triangle(corners, [1.0 - v - w, v, w], view, distance * s);
            let r = point.reach.max_element();
            prop_assert_eq!(point.position, corners[0] * (1.0 - v - w) + corners[1] * v + corners[2] * w);
            let least = distances(corners, point.position).into_iter().fold(f64::INFINITY, f64::min);
            let on_ray = point.position + view * (EDGE_DISTANCE * r).min(0.5 * distance * s);
            let is_near = least < 0.99 * EDGE_DISTANCE * r;
            prop_assert!(point.start == on_ray || !is_near && point.start == point.position);
            for numerics in [Numerics::Watertight, Numerics::Double, Numerics::Exact] {
                let origin = point.origin_towards(normal, numerics);
                let height = (origin - corners[0]).dot(normal) / (ORIGIN_OFFSET * r);
                prop_assert!(height >= 1.0 - 1.0 / 64.0, "{}", height);
                let rise = (point.start - point.position).dot(normal) / (ORIGIN_OFFSET * r);
                prop_assert!(rise < 1.0 || origin == point.start, "{}", rise);
                prop_assert!((height - rise.max(1.0)).abs() < 1.0 / 64.0, "{} {}", height, rise);
            }
        }
    }

    #[test]
    fn a_triangle_without_area_has_points_on_the_ray() {
        let line = [DVec3::ZERO, DVec3::X, DVec3::X * 3.0];
        for (weights, at) in [([1.0, 0.0, 0.0], DVec3::ZERO), ([0.0, 0.5, 0.5], DVec3::X * 2.0)] {
            let point = SurfacePoint::on_triangle(line, weights, DVec3::Y, 9.0);
            assert_eq!((point.position, point.start), (at, at + DVec3::Y * 3.0 * EDGE_DISTANCE));
        }
        // A ray from nearby stays on its way.
        let point = SurfacePoint::on_triangle(line, [1.0, 0.0, 0.0], DVec3::Y, 1e-9);
        assert_eq!(point.start, DVec3::Y * 0.5e-9);
    }
}
