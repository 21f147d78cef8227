//! Origins of secondary rays: shadow, reflection and every other ray that leaves a surface.
//!
//! A secondary ray must start in the free space in front of the surface, or it hits that surface again (acne) or
//! starts behind a neighbouring one (a leak). Offsetting the hit point along the normal (pbrt, 4th edition, section
//! 6.8) is not enough at an edge of a concave corner: there the offset point lies on or behind the neighbouring face.
//! So the hit point is moved twice:
//! 1. within its triangle, until it is e R from every edge ([`edge_distance`]), or half the inradius if that is less,
//!    and
//! 2. along the geometric normal by h R ([`origin_offset`]).
//!
//! A ray that meets an edge exactly may report the face that is hidden there behind the other one; then the point
//! within that face is hidden, too. The points of the incoming ray before the hit are free. If a face separates the
//! one e R before the hit from the moved point, that one is used ([`SurfacePoint::before_hit`]). It must
//! be 2^-45 R in front of that face, so that rounding errors decide nothing: R of both triangles, whichever is larger.
//!
//! R is the largest coordinate of the triangle's corners. Both distances are relative to the coordinates that the
//! point was computed from, so they hold at every scale.
//!
//! | tier | corners | e | h | h / errors | dihedral angle | angle before the hit |
//! | --- | --- | --- | --- | --- | --- | --- |
//! | `watertight` | f32 | 2^-23 | 2^-40 | 189 | 2^-16.9 | 2^-16.9 |
//! | `double`, `exact` | f64 | 2^-29 | 2^-46 | 2.9 | 2^-16.5 | 2^-15.4 |
//!
//! With corners in f32, no smaller e is of use: details are no smaller than their spacing, 2^-23 R. With corners in f64
//! they may be, as those of a city at the coordinates of a map, and both distances are as small as the errors allow.
//!
//! # What this guarantees (`watertight`, `double`, `exact`)
//! Let u = 2^-53. The hit point is off by less than 8 u R: four roundings of the convex combination, each at most u R
//! per axis, and three of the barycentrics' sum. The triangle test sees each corner moved by at most 8 u times its
//! distance from the origin (the difference from the origin rounds by 2 u, the shear by 2 u, their product by u and
//! the last difference by 2 u), so by 16 u R for the corners of this triangle. Each coordinate of the origin is rounded
//! by another u R. In Euclidean norm, these 25 u R per axis are less than 43.4 u R = 2^-47.5 R. The origin is 2^13 u R
//! above the plane, or 2^7 u R with corners in f64, so it is in front of its own triangle, also as the test sees it.
//!
//! A face that shares an edge with the triangle at a dihedral angle a is e R tan a above the point; the
//! origin is in front of that face, too, as long as that exceeds h R plus the errors above: for every a >
//! 2^-16.9, 0.0005 degrees, or (2^-46 + 2^-47.5) / 2^-29 < 2^-16.5. The same holds for a face that shares one corner
//! only, if it rises at the angle a from the triangle's plane in the direction from the corner to the moved point.
//! Before the hit, the origin is e R sin b in front of every face that the incoming ray met at an angle b: more than
//! 2^-45 R for every b > 2^-21.9, or 2^-16. If the ray met the triangle itself at less than h / e = 2^-17, it is lower
//! by h R, which is enough for b > 2^-16.9, or (2^-45 + 2^-46) / 2^-29 < 2^-15.4.
//! If the ray is shorter than 2 e R, half its length takes the place of e R.
//!
//! Then the origin lies inside the closed mesh that the test sees, whose edges have no gaps, and no ray leaves that
//! mesh without a hit.
//!
//! The point moves by e R at most near an edge, and by 2 e R / sin(a / 2) near a corner of angle a.
//!
//! Exceptions:
//! - In triangles with an inradius below 2 e R the point keeps half the inradius from the edges, and the
//!   bound on the dihedral angle grows by the same factor.
//! - Surfaces that share no corner with the triangle and lie closer than 2 h R are jumped.
//!
//! The tier `fast` rounds the origin to f32, away from the surface, and guarantees nothing at edges.

use glam::DVec3;

use super::{Numerics, Triangle};

/// The greatest [`edge_distance`]: 2^-23, the spacing of f32 numbers.
pub const EDGE_DISTANCE: f64 = 1.0 / (1u32 << 23) as f64;

/// The greatest [`origin_offset`]: 2^-40. Above the errors, so that f64 decides on which side of its own triangle a ray
/// starts; below [`EDGE_DISTANCE`] by the smallest guaranteed dihedral angle.
pub const ORIGIN_OFFSET: f64 = 1.0 / (1u64 << 40) as f64;

/// The share of both in tiers with corners in f64.
const SHARE_IN_F64: f64 = 1.0 / 64.0;

/// Of both, in a tier.
const fn share(numerics: Numerics) -> f64 {
    if matches!(numerics, Numerics::Double | Numerics::Exact) { SHARE_IN_F64 } else { 1.0 }
}

/// The distance of origins from the edges of their triangle, relative to the largest coordinate of its corners.
#[inline(always)]
pub const fn edge_distance(numerics: Numerics) -> f64 {
    EDGE_DISTANCE * share(numerics)
}

/// The height of origins above their triangle, relative to the same.
#[inline(always)]
pub const fn origin_offset(numerics: Numerics) -> f64 {
    ORIGIN_OFFSET * share(numerics)
}

/// A point on a surface, from which secondary rays start, and the coordinates that its error is relative to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// The point.
    pub position: DVec3,
    /// The point that is offset: `position`, or near an edge a point farther inside the triangle or before the hit.
    pub start: DVec3,
    /// The largest coordinate that it was computed from, per axis.
    pub reach: DVec3,
}

impl SurfacePoint {
    /// The point of a triangle with the given barycentrics, moved away from the edges.
    #[inline(always)]
    pub fn on_triangle(corners: [DVec3; 3], barycentrics: [f64; 3], numerics: Numerics) -> Self {
        let point = Self::in_triangle(corners, barycentrics);
        if EdgeTest::new(corners, numerics).is_near(barycentrics) {
            point.moved_inwards(corners, barycentrics, numerics)
        } else {
            point
        }
    }

    /// [`SurfacePoint::on_triangle`] for a point that is not near an edge ([`EdgeTest`]).
    #[inline(always)]
    pub fn in_triangle(corners: [DVec3; 3], barycentrics: [f64; 3]) -> Self {
        Self::new(point_at(corners, barycentrics), reach_of(corners))
    }

    #[cold]
    fn moved_inwards(self, corners: [DVec3; 3], barycentrics: [f64; 3], numerics: Numerics) -> Self {
        let distance = edge_distance(numerics) * self.reach.max_element();
        let barycentrics = interior_barycentrics(corners, barycentrics, distance);
        SurfacePoint { start: point_at(corners, barycentrics), ..self }
    }

    /// The same point with origins before the hit, on the side of the unit vector `normal`, for an incoming ray of
    /// length `distance`. `view` is the unit direction towards that ray's origin. The secondary rays' origins lie on
    /// the incoming ray unless it is lower above the surface there than [`origin_offset`].
    pub fn before_hit(self, view: DVec3, distance: f64, normal: DVec3, numerics: Numerics) -> Self {
        let reach = self.reach.max_element();
        let shift = (edge_distance(numerics) * reach).min(0.5 * distance);
        let height = (shift * view.dot(normal)).min(origin_offset(numerics) * reach);
        SurfacePoint { start: self.position + (view * shift - normal * height), ..self }
    }

    /// A point of a surface without edges, computed from coordinates of at most `reach` on each axis.
    #[inline(always)]
    pub fn new(position: DVec3, reach: DVec3) -> Self {
        SurfacePoint { position, start: position, reach }
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
        self.start + normal * (origin_offset(numerics) * self.reach.max_element())
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

/// Tests whether points of a triangle may be nearer than [`edge_distance`] R to an edge.
pub struct EdgeTest {
    /// Four times the squared area.
    area_squared: f64,
    /// The square of that distance, times the squared length of the longest edge.
    bound: f64,
}

impl EdgeTest {
    /// The test of a triangle's points.
    #[inline(always)]
    pub fn new(corners: [DVec3; 3], numerics: Numerics) -> Self {
        let triangle = Triangle(corners);
        let distance = edge_distance(numerics) * reach_of(corners).max_element();
        EdgeTest {
            area_squared: triangle.normal().length_squared(),
            bound: distance * distance * triangle.longest_edge_squared(),
        }
    }

    /// Whether the point with these barycentrics may be near an edge. `false` is certain.
    #[inline(always)]
    pub fn is_near(&self, [a, b, c]: [f64; 3]) -> bool {
        // A weight is the distance to the opposite edge over the height above it; that is least above the longest edge.
        let smallest = a.min(b).min(c);
        !(smallest > 0.0 && smallest * smallest * self.area_squared >= self.bound)
    }
}

/// The largest coordinate of the corners, per axis.
#[inline(always)]
pub fn reach_of([a, b, c]: [DVec3; 3]) -> DVec3 {
    a.abs().max(b.abs()).max(c.abs())
}

/// The point of a triangle with the given barycentrics.
#[inline(always)]
pub fn point_at([a, b, c]: [DVec3; 3], barycentrics: [f64; 3]) -> DVec3 {
    a * barycentrics[0] + b * barycentrics[1] + c * barycentrics[2]
}

/// Barycentrics of the point moved to `distance` from every edge, or to half the inradius if that is less.
///
/// Near one edge the point moves perpendicular to it. Near two, at their corner, it moves to where both distances
/// are right.
fn interior_barycentrics(corners: [DVec3; 3], barycentrics: [f64; 3], distance: f64) -> [f64; 3] {
    let area = Triangle(corners).normal().length();
    let sides = [(1, 2), (2, 0), (0, 1)];
    let lengths = sides.map(|(i, j)| (corners[i] - corners[j]).length());
    // `area` is twice the triangle's, so the inradius is `area` over the perimeter. Without an area the first quotient
    // is infinite or NaN.
    let perimeter = lengths.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let per_length = (distance / area).min(0.5 / perimeter);
    let least = lengths.map(|length| length * per_length);
    let mut moved = barycentrics;
    for (k, (i, j)) in (0..).zip(sides) {
        let lacking = least[k] - moved[k];
        if lacking > 0.0 {
            // The foot of the altitude divides the edge in this proportion.
            let edge = corners[i] - corners[j];
            let share = (corners[k] - corners[j]).dot(edge) / edge.length_squared();
            moved[k] += lacking;
            moved[i] -= lacking * share;
            moved[j] -= lacking * (1.0 - share);
        }
    }
    let nearest = (0..3).max_by(|&i, &j| barycentrics[i].total_cmp(&barycentrics[j])).unwrap_or(0);
    let (one, other) = ((nearest + 1) % 3, (nearest + 2) % 3);
    // The sum is 1 up to the last place: an error in it would move the point out of the plane.
    moved[nearest] = 1.0 - moved[one] - moved[other];
    if (0..3).all(|k| moved[k] >= least[k] * (1.0 - EDGE_DISTANCE)) {
        return moved;
    }
    let mut moved = least;
    moved[nearest] = 1.0 - least[one] - least[other];
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::expansion::Expansion;
    use crate::geometry::sign_of_determinant;
    use proptest::prelude::*;

    /// Distances of a point from the lines through the edges, positive inside.
    fn distances(corners: [DVec3; 3], p: DVec3) -> [f64; 3] {
        let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        [(1, 2), (2, 0), (0, 1)].map(|(i, j)| {
            let along = (corners[j] - corners[i]).normalize();
            n.cross(along).dot(p - corners[i])
        })
    }

    /// The most that a point moves for a distance of 1 from the edges: 1, or 2 / sin(a / 2) if it may lie within
    /// `near` of two edges, at a corner of angle a.
    fn most_moved(corners: [DVec3; 3], p: DVec3, near: f64) -> f64 {
        let [ab, bc, ca] = [0, 1, 2].map(|k| (corners[(k + 1) % 3] - corners[k]).normalize());
        let [to_bc, to_ca, to_ab] = distances(corners, p).map(|distance| distance < near);
        let at_corner = [(to_ca && to_ab, ab, -ca), (to_ab && to_bc, bc, -ab), (to_bc && to_ca, ca, -bc)];
        let most = |(is_near, one, other): (bool, DVec3, DVec3)| {
            if is_near { 2.0 / (one.angle_between(other) / 2.0).sin() } else { 1.0 + 1e-6 }
        };
        at_corner.map(most).into_iter().fold(1.0, f64::max)
    }

    /// A triangle of 1 by 0.01, 1000 from the origin: near the long edge the point moves perpendicular to that edge,
    /// not towards the centroid.
    #[test]
    fn in_a_long_triangle_points_stay_where_they_are() {
        let corners = [[1000.0, 0.0, 0.0], [1001.0, 0.0, 0.0], [1000.0, 0.01, 0.0]].map(DVec3::from);
        let point = SurfacePoint::on_triangle(corners, [0.5, 0.5, 0.0], Numerics::Watertight);
        let expected = point.position + DVec3::Y * EDGE_DISTANCE * 1001.0;
        assert!(point.start.distance(expected) < 1e-12, "{} {expected}", point.start);
    }

    proptest! {
        /// In front of the plane by the offset, and as far from the edges as guaranteed, also for points on edges and
        /// corners, and for barycentrics that rounding made negative.
        #[test]
        fn origins_are_in_front_and_away_from_edges(
            corners in prop::array::uniform3(prop::array::uniform3(-1.0f64..1.0)),
            moved in prop::array::uniform3(-1e3f64..1e3),
            barycentrics in prop::array::uniform2(prop_oneof![Just(0.0), Just(1.0), Just(1e-17), Just(-1e-17), 0.0f64..1.0]),
            scale in -30i32..30,
        ) {
            let s = f64::from(scale).exp2();
            let corners = corners.map(|c| (DVec3::from(c) + DVec3::from(moved)) * s);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            prop_assume!(normal.length() > s * s * 1e-2);
            let normal = normal.normalize();
            let [v, w] = barycentrics;
            prop_assume!(v + w <= 1.0);
            for numerics in Numerics::STRICT {
                let point = SurfacePoint::on_triangle(corners, [1.0 - v - w, v, w], numerics);
                let (r, e) = (point.reach.max_element(), edge_distance(numerics));
                for (k, distance) in distances(corners, point.start).into_iter().enumerate() {
                    prop_assert!(distance >= e * r * (1.0 - 1e-5), "edge {}: {}", k, distance / r);
                }
                let hit = corners[0] * (1.0 - v - w) + corners[1] * v + corners[2] * w;
                prop_assert!(point.position == hit);
                // 4: for the three roundings of each coordinate.
                let moved = point.start.distance(hit) - 4.0 * f64::EPSILON * r;
                let most = most_moved(corners, hit, 2.0 * e * r);
                prop_assert!(moved <= e * r * most, "{}", moved / r);
                // Exactly in front: the sign of ((b - a) x (c - a)) . (a - origin).
                for (side, behind) in [(normal, -1), (-normal, 1)] {
                    let origin = point.origin_towards(side, numerics);
                    let row = |p: DVec3, q: DVec3| [0, 1, 2].map(|k| Expansion::difference(p[k], q[k]));
                    let [a, b, c] = corners;
                    let sign = sign_of_determinant(&[row(a, origin), row(b, a), row(c, a)]);
                    prop_assert_eq!(sign, behind, "{}", (origin - a).dot(side) / r);
                }
            }
        }
    }

    #[test]
    fn a_triangle_without_area_has_finite_points() {
        let line = [DVec3::ZERO, DVec3::X, DVec3::X * 3.0];
        for barycentrics in [[1.0, 0.0, 0.0], [0.0, 0.5, 0.5]] {
            let point = SurfacePoint::on_triangle(line, barycentrics, Numerics::Exact).start;
            assert!(point.is_finite() && (0.0..=3.0).contains(&point.x), "{point}");
        }
        let point = SurfacePoint::on_triangle([DVec3::ONE; 3], [1.0, 0.0, 0.0], Numerics::Exact).start;
        assert!((point - DVec3::ONE).abs().max_element() <= 2.0 * f64::EPSILON, "{point}");
    }
}
