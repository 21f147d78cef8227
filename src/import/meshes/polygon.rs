//! Triangulation of polygons.
//!
//! Convex quadrilaterals, by far the most common polygons, are split along a diagonal; all others are triangulated by
//! `earcut` (ear clipping with z-order hashing) in the plane of the polygon.
//!
//! Ear clipping takes slightly more than linear time while there is an ear to clip. A self-intersecting polygon may
//! have none; `earcut` then tests every diagonal against every edge, in cubic time, and its result does not cover the
//! polygon. Polygons of more than [`MAX_UNCHECKED_CORNERS`] corners are therefore searched for crossings first, within
//! a work limit ([`MAX_PAIRS_PER_EDGE`]), and are split into a fan if there are any.

use std::collections::HashSet;
use std::path::Path;

use glam::{DVec2, DVec3};

use crate::error::Warnings;
use crate::scene::Mesh;

/// Maximum number of corners of polygons that are not searched for crossings; cubic time is at most 64^3 steps.
const MAX_UNCHECKED_CORNERS: usize = 64;

/// Maximum number of edge pairs compared, per edge of a polygon. The sweep compares an edge with the active ones, at
/// most half of the others: the limit decides all polygons of up to 16,384 corners, and larger ones unless thousands of
/// edges overlap throughout along every sweep axis.
const MAX_PAIRS_PER_EDGE: usize = 8192;

/// Maximum number of corners for `earcut`, which addresses its nodes by 32 bits: 48 bytes each, and half as many again
/// at splits, are at most 2^32 bytes for 59 million corners.
const MAX_CORNERS: usize = 1 << 25;

/// Minimum depth at which edges count as crossing, relative to the size of the polygon. Shallower crossings change its
/// area by less than this; the result must match the area within 1e-6.
const DEPTH: f64 = 1e-9;

/// Result of a triangulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Cut {
    /// Triangles that cover the polygon.
    Whole,
    /// A fan, because the polygon intersects itself or repeats an edge.
    SelfIntersecting,
    /// A fan, because the polygon exceeds [`MAX_PAIRS_PER_EDGE`] or [`MAX_CORNERS`].
    Intricate,
}

/// Counts of polygons of a file that were split into fans.
#[derive(Debug, Default)]
pub(crate) struct Cuts {
    self_intersecting: usize,
    intricate: usize,
}

impl Cuts {
    /// Counts a polygon.
    pub(crate) fn count(&mut self, cut: Cut) {
        self.self_intersecting += usize::from(cut == Cut::SelfIntersecting);
        self.intricate += usize::from(cut == Cut::Intricate);
    }

    /// Adds other counts.
    pub(crate) fn add(&mut self, other: &Cuts) {
        self.self_intersecting += other.self_intersecting;
        self.intricate += other.intricate;
    }

    /// Adds warnings for the polygons of `file` that were split into fans.
    pub(crate) fn warn(&self, file: &Path, warnings: &mut Warnings) {
        let (file, Cuts { self_intersecting, intricate }) = (file.display(), self);
        if *self_intersecting > 0 {
            warnings.push(format!(
                "{file}: {self_intersecting} polygon(s) cross themselves and were cut into fans"
            ));
        }
        if *intricate > 0 {
            let what = "have too many corners, or long edges side by side, to be cut exactly";
            warnings.push(format!(
                "{file}: {intricate} polygon(s) {what}, and were cut into fans; cut them before"
            ));
        }
    }
}

/// Triangulates polygons; reuses its buffers.
#[derive(Default)]
pub(crate) struct Triangulator {
    earcut: earcut::Earcut<f64>,
    flat: Vec<[f64; 2]>,
    out: Vec<u32>,
}

impl Triangulator {
    /// A triangulator with empty buffers.
    pub(crate) fn new() -> Self {
        Triangulator { earcut: earcut::Earcut::new(), flat: Vec::new(), out: Vec::new() }
    }

    /// Calls `emit` with the corner indices of each triangle of the polygon. If a covering triangulation is not found
    /// within the work limits, the polygon is split into a fan. A polygon with non-finite corners is split into a fan and
    /// counts as [`Cut::Whole`], since the check of the vertices warns of it.
    pub(crate) fn triangulate(&mut self, corners: &[DVec3], mut emit: impl FnMut([usize; 3])) -> Cut {
        let n = corners.len();
        if n <= 3 {
            if n == 3 {
                emit([0, 1, 2]);
            }
            return Cut::Whole;
        }
        if !corners.iter().all(|corner| corner.is_finite()) {
            (1..n - 1).for_each(|i| emit([0, i, i + 1]));
            return Cut::Whole;
        }
        let normal = newell_normal(corners);
        if n == 4 && is_convex(corners, normal) {
            emit([0, 1, 2]);
            emit([0, 2, 3]);
            return Cut::Whole;
        }
        self.flat.clear();
        self.flat.extend(corners.iter().map(|&p| project(p, normal).to_array()));
        self.out.clear();
        let found = match n {
            _ if n > MAX_CORNERS => Cut::Intricate,
            _ if n > MAX_UNCHECKED_CORNERS => find_crossing(&self.flat),
            _ => Cut::Whole,
        };
        if found != Cut::Whole {
            (1..n - 1).for_each(|i| emit([0, i, i + 1]));
            return found;
        }
        self.earcut.earcut(self.flat.iter().copied(), &[], &mut self.out);
        let area = |a: usize, b: usize, c: usize| {
            let [a, b, c] = [a, b, c].map(|i| DVec2::from(self.flat[i]));
            (b - a).perp_dot(c - a)
        };
        let whole: f64 = (1..n - 1).map(|i| area(0, i, i + 1)).sum::<f64>().abs();
        let cut: f64 =
            self.out.chunks_exact(3).map(|t| area(t[0] as usize, t[1] as usize, t[2] as usize).abs()).sum();
        // Both areas are sums of n rounded terms; for a self-intersecting polygon they differ in the leading digits.
        let covers = self.out.len() >= 3 && (cut - whole).abs() <= whole * 1e-6;
        if covers {
            self.out.chunks_exact(3).for_each(|t| emit([t[0] as usize, t[1] as usize, t[2] as usize]));
        } else {
            (1..n - 1).for_each(|i| emit([0, i, i + 1]));
        }
        if covers { Cut::Whole } else { Cut::SelfIntersecting }
    }
}

/// Makes triangles of the polygons of a file.
#[derive(Default)]
pub(crate) struct Polygons {
    triangulator: Triangulator,
    cuts: Cuts,
    too_small: usize,
    corners: Vec<DVec3>,
}

impl Polygons {
    /// Adds the triangles of a polygon, given by indices of positions, to a mesh. Calls `each` with the corners of each
    /// triangle. Returns their number.
    pub(crate) fn add(
        &mut self,
        mesh: &mut Mesh,
        polygon: &[u32],
        mut each: impl FnMut([usize; 3]),
    ) -> usize {
        let before = mesh.triangles.len();
        self.too_small += usize::from(polygon.len() < 3);
        self.corners.clear();
        self.corners.extend(polygon.iter().map(|&index| mesh.positions[index as usize]));
        self.cuts.count(self.triangulator.triangulate(&self.corners, |triangle| {
            mesh.triangles.push(triangle.map(|i| polygon[i]));
            each(triangle);
        }));
        mesh.triangles.len() - before
    }

    /// Adds warnings for the polygons of `file` that were left out or split into fans.
    pub(crate) fn warn(&self, file: &Path, warnings: &mut Warnings) {
        if self.too_small > 0 {
            let what = format!("left out {} face(s) of fewer than three corners", self.too_small);
            warnings.left_out(format!("{}: {what}", file.display()));
        }
        self.cuts.warn(file, warnings);
    }
}

/// Whether a polygon repeats an edge in the same direction, or two of its edges cross deeper than [`DEPTH`]. Touching
/// edges, and edges passed once in each direction (bridges to holes), do not count.
///
/// Plane sweep: each edge is compared with the active edges, which began before it and have not ended. The sweep axis
/// is the one of x, y and the perpendicular of the dominant edge direction along which edges overlap least.
fn find_crossing(corners: &[[f64; 2]]) -> Cut {
    let n = corners.len();
    let points = || corners.iter().map(|&p| DVec2::from(p));
    let (min, max) = points().fold((DVec2::MAX, DVec2::MIN), |(min, max), p| (min.min(p), max.max(p)));
    let size = (max - min).max_element();
    if !(size > 0.0 && size.is_finite()) {
        // Coincident corners and non-finite sizes are handled without a search.
        return if size == 0.0 { Cut::SelfIntersecting } else { Cut::Intricate };
    }
    let depth = size * DEPTH;
    let cell = |p: DVec2| ((p - min) / depth).round().to_array().map(|c| c as i64);
    let edges = points().zip(points().cycle().skip(1));
    let mut passed = HashSet::with_capacity(n);
    // Edge directions with doubled angles, weighted by length: half the angle of the sum is the dominant direction (as
    // of principal axes).
    let mut doubled = DVec2::ZERO;
    for (a, b) in edges.clone() {
        let (from, to) = (cell(a), cell(b));
        if from != to && !passed.insert((from, to)) {
            return Cut::SelfIntersecting;
        }
        let edge = b - a;
        if edge != DVec2::ZERO {
            doubled += edge.rotate(edge) / edge.length();
        }
    }
    drop(passed);
    let across = DVec2::from_angle(doubled.to_angle() / 2.0).perp();
    // Mean number of edges over a point of the axis: sum of edge lengths over the polygon's extent.
    let overlaps = |axis: DVec2| {
        let (min, max) = points()
            .map(|p| axis.dot(p))
            .fold((f64::MAX, f64::MIN), |(min, max), along| (min.min(along), max.max(along)));
        let lengths: f64 = edges.clone().map(|(a, b)| axis.dot(b - a).abs()).sum();
        if max > min { lengths / (max - min) } else { f64::INFINITY }
    };
    let axes = [DVec2::X, DVec2::Y, across].map(|axis| (overlaps(axis), axis));
    let axis = axes.into_iter().min_by(|(a, _), (b, _)| a.total_cmp(b)).map_or(DVec2::X, |(_, axis)| axis);
    let swept = |p: DVec2| DVec2::new(axis.dot(p), axis.perp_dot(p));
    let mut edges: Vec<[DVec2; 2]> = edges.map(|(a, b)| [swept(a), swept(b)]).collect();
    edges.sort_unstable_by(|[a, b], [c, d]| a.x.min(b.x).total_cmp(&c.x.min(d.x)));
    let mut active: Vec<[DVec2; 2]> = Vec::new();
    let mut pairs = 0;
    for edge in edges {
        let start = edge[0].x.min(edge[1].x);
        active.retain(|[a, b]| a.x.max(b.x) >= start);
        pairs += active.len();
        if pairs > MAX_PAIRS_PER_EDGE * n {
            return Cut::Intricate;
        }
        if active.iter().any(|other| cross(edge, *other, depth)) {
            return Cut::SelfIntersecting;
        }
        active.push(edge);
    }
    Cut::Whole
}

/// Whether the end points of each edge lie on both sides of the other, farther than `depth` from it.
fn cross([a, b]: [DVec2; 2], [c, d]: [DVec2; 2], depth: f64) -> bool {
    if a.y.max(b.y) < c.y.min(d.y) || c.y.max(d.y) < a.y.min(b.y) {
        return false;
    }
    let apart = |a: DVec2, b: DVec2, c: DVec2, d: DVec2| {
        let (side, least) = (b - a, depth * (b - a).length());
        let (c, d) = (side.perp_dot(c - a), side.perp_dot(d - a));
        c.abs() > least && d.abs() > least && (c > 0.0) != (d > 0.0)
    };
    apart(a, b, c, d) && apart(c, d, a, b)
}

/// Twice the area vector of a polygon (Newell's method); its direction is the normal of the best-fitting plane.
fn newell_normal(corners: &[DVec3]) -> DVec3 {
    let origin = corners[0];
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(&a, &b)| (a - origin).cross(b - origin)).sum()
}

fn is_convex(corners: &[DVec3], normal: DVec3) -> bool {
    let n = corners.len();
    (0..n).all(|i| {
        let [a, b, c] = [corners[i], corners[(i + 1) % n], corners[(i + 2) % n]];
        (b - a).cross(c - b).dot(normal) > 0.0
    })
}

/// Projects along the dominant axis of the normal, keeping the orientation.
fn project(p: DVec3, normal: DVec3) -> DVec2 {
    let a = normal.abs();
    if a.x >= a.y && a.x >= a.z {
        DVec2::new(p.y, p.z)
    } else if a.y >= a.z {
        DVec2::new(p.z, p.x)
    } else {
        DVec2::new(p.x, p.y)
    }
}

#[cfg(test)]
mod tests;
