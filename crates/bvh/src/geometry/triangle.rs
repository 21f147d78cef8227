//! [`Triangle`]: bounds, normal and exact degeneracy. The intersection tests are in the files of the tiers.

use glam::{DVec3, Vec3Swizzles};

use super::expansion::Expansion;
use super::spawn::ORIGIN_OFFSET;
use super::{Bounds, Corner};

/// Three corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangle(pub [DVec3; 3]);

/// A ray's intersection with a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TriangleHit {
    /// Distance along the ray.
    pub t: f64,
    /// The barycentrics v and w, of the second and third corner; u is 1 - v - w.
    pub barycentrics: [f64; 2],
}

impl Triangle {
    /// An f32 box of the triangle that holds every hit on it: the smallest one, but for planes near 0.
    #[inline]
    pub fn bounds(&self) -> Bounds {
        DVec3::bounds(&self.0)
    }

    /// The normal (b - a) x (c - a), whose length is twice the area.
    #[inline(always)]
    pub fn normal(&self) -> DVec3 {
        let [a, b, c] = self.0;
        (b - a).cross(c - a)
    }

    /// The unit normal, to 2^-10 radians or better. `None` for a triangle thinner than [`ORIGIN_OFFSET`] times its
    /// largest coordinate, of which 2^-53 is the rounding of the edges.
    #[inline(always)]
    pub fn unit_normal(&self) -> Option<DVec3> {
        let (normal, is_reliable) = self.unit_normal_unchecked();
        is_reliable.then_some(normal)
    }

    /// [`Triangle::unit_normal`] without a branch, and whether it is `Some`.
    #[inline(always)]
    pub fn unit_normal_unchecked(&self) -> (DVec3, bool) {
        let [a, b, c] = self.0;
        let (normal, reach) = (self.normal(), a.abs().max(b.abs()).max(c.abs()).max_element());
        let area_squared = normal.length_squared();
        let least = ORIGIN_OFFSET * reach;
        let is_reliable = area_squared > least * least * self.longest_edge_squared();
        (normal / area_squared.sqrt(), is_reliable)
    }

    /// The square of the length of the longest edge.
    #[inline(always)]
    pub fn longest_edge_squared(&self) -> f64 {
        let [ab, bc, ca] = self.edges().map(DVec3::length_squared);
        ab.max(bc).max(ca)
    }

    #[inline(always)]
    fn edges(&self) -> [DVec3; 3] {
        let [a, b, c] = self.0;
        [b - a, c - b, a - c]
    }

    /// Whether the corners are exactly collinear.
    pub fn is_degenerate(&self) -> bool {
        let [a, b, c] = self.0;
        let (u, v) = (b - a, c - a);
        let permanent = u.abs().dot(v.abs().yzx()) + u.abs().dot(v.abs().zxy());
        // Each component of the cross product is off by at most 4 roundings of its share of the permanent.
        if u.cross(v).abs().max_element() > 4.0 * f64::EPSILON * permanent {
            return false;
        }
        let side = |p: DVec3, k: usize| Expansion::difference(p[k], a[k]);
        let component = |i: usize, j: usize| side(b, i) * side(c, j) - side(b, j) * side(c, i);
        [(1, 2), (2, 0), (0, 1)].into_iter().all(|(i, j)| component(i, j).sign() == 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_on_a_line_are_degenerate_and_nothing_else_is() {
        let degenerate = |corners| Triangle(corners).is_degenerate();
        let p = DVec3::new(3.0, -7.0, 1e6);
        let d = DVec3::new(1.0, 2.0, -5.0);
        assert!(degenerate([p, p + d, p + 3.0 * d]));
        assert!(degenerate([p, p, p + d]) && degenerate([p; 3]));
        // One ulp beside the line, where the f64 cross product of the differences is lost to rounding.
        let a = DVec3::new(1.0, 1.0, 0.0);
        let b = a * 2f64.powi(60);
        assert!(degenerate([DVec3::ZERO, a, b]));
        assert!(!degenerate([DVec3::ZERO, a, DVec3::new(b.x, b.y.next_up(), 0.0)]));
        assert!(!degenerate([DVec3::ZERO, DVec3::X * 1e-60, DVec3::Y * 1e-60]));
    }
}
