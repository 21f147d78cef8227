//! Floating-point filter: decides clear cases in f64, so that only doubtful ones need exact arithmetic.

use glam::DVec3;
use kiln::bvh::Ray;

/// How the line of a ray passes a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Passage {
    /// Certainly beside it.
    Beside,
    /// Certainly through its inside.
    Through,
    /// Too close to an edge to tell.
    Doubtful,
}

/// Half the distance from 1 to the next f64.
pub const U: f64 = f64::EPSILON / 2.0;

/// The triple products of the direction with each edge's two ends, seen from the origin, and a bound on the error of
/// each.
///
/// `d . (p x q)` in f64 takes seven roundings from the given numbers to each of its six terms (two differences, a
/// product, a difference, a product, two sums), so it is off by at most 7u / (1 - 7u) times the sum of the terms'
/// sizes, and that sum itself, computed, is short of its value by at most the same share. 16u covers both.
pub fn edges(ray: &Ray, corners: &[DVec3; 3]) -> [(f64, f64); 3] {
    let [a, b, c] = corners.map(|corner| corner - ray.origin());
    let d = ray.direction();
    let edge = |p: DVec3, q: DVec3| {
        let (mut sum, mut size) = (0.0, 0.0);
        for (k, i, j) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
            let (left, right) = (p[i] * q[j], p[j] * q[i]);
            sum += d[k] * (left - right);
            size += d[k].abs() * (left.abs() + right.abs());
        }
        // Where a term may have underflowed or overflowed, nothing is certain.
        let error = if size > 1e-270 && size < 1e290 { 16.0 * U * size } else { f64::INFINITY };
        (sum, error)
    };
    [edge(b, c), edge(c, a), edge(a, b)]
}

/// How the line of `ray` passes the triangle.
pub fn passage(ray: &Ray, corners: &[DVec3; 3]) -> Passage {
    let signs =
        edges(ray, corners).map(|(sum, error)| if sum.abs() > error { sum.signum() as i32 } else { 0 });
    if signs.contains(&1) && signs.contains(&-1) {
        Passage::Beside
    } else if signs.contains(&0) {
        Passage::Doubtful
    } else {
        Passage::Through
    }
}
