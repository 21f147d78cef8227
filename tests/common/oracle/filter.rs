//! What f64 can tell for certain, so that exact arithmetic is left with the doubtful cases.

use glam::DVec3;
use kiln::geometry::Ray;

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
const U: f64 = f64::EPSILON / 2.0;

/// The triple products of the direction with each edge's two ends, seen from the origin, and a bound on the error of each.
///
/// `d . (p x q)` in f64 takes seven roundings from the given numbers to each of its six terms (two differences, a product,
/// a difference, a product, two sums), so it is off by at most 7u / (1 - 7u) times the sum of the terms' sizes, and that
/// sum itself, computed, is short of its value by at most the same share. 16u covers both.
fn edges(ray: &Ray, corners: &[DVec3; 3]) -> [(f64, f64); 3] {
    let [a, b, c] = corners.map(|corner| corner - ray.origin);
    let d = ray.direction;
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

/// Whether a decision in f64 by Woop, Benthin and Wald's test must be the exact one: the line keeps clear of the lines
/// through the edges, and the origin of the triangle's plane.
///
/// With `m` the size of a corner seen from the origin (its largest coordinate), and `u` as above:
/// a sheared coordinate `x - s z` has |s| <= 1 up to rounding, so its size is at most 2m, and its error at most
/// `u m` (the difference x) `+ (u + 2u + u) m` (the difference z, the shear, which is a reciprocal and a product, and
/// their product) `+ 2u m` (the subtraction) = 7u m. An edge function `x y' - y x'` of two corners then has an error of at
/// most `2 (2 * 7 * 2 + 4) u m m' + 8u m m'` = 72u m m'. It is the triple product over the largest component of the
/// direction. The triple product here is itself off by at most what [`edges`] says. The sum of all three edge functions
/// and the sum for the distance stay clear of 0 where every summand has the same sign and the corners do not lie around the
/// origin's depth; for the others the plane's own distance must be larger than its error.
pub fn is_clear(ray: &Ray, corners: &[DVec3; 3]) -> bool {
    let relative = corners.map(|corner| corner - ray.origin);
    let [a, b, c] = relative.map(|corner| corner.abs().max_element());
    let length = ray.direction.abs().max_element();
    let margins = [b * c, c * a, a * b].map(|product| 96.0 * U * length * product);
    let edges = edges(ray, corners);
    let clear = edges.iter().zip(margins).all(|((sum, error), margin)| sum.abs() > error + margin);
    // The distance is the volume of the three corners over the sum of the edges. Woop's has an error of at most three edge
    // functions' times the depths, and so has this volume.
    let volume = relative[0].dot(relative[1].cross(relative[2]));
    clear && volume.abs() > 512.0 * U * a * b * c
}

/// A bound on the error of the distance that Woop, Benthin and Wald's test computes in f64 for a ray that hits; infinite
/// where the test cannot know it.
///
/// The distance is a mean of the corners' depths `z`, weighted by the edge functions. With `e` the error of each weight
/// (see [`is_clear`]) and `s` the sum of the three, the mean moves by at most `3 e (greatest z - least z) / (s - 3 e)`; the
/// sums and products add 8u times the greatest depth.
pub fn distance_error(ray: &Ray, corners: &[DVec3; 3]) -> f64 {
    let relative = corners.map(|corner| corner - ray.origin);
    let size = relative.iter().map(|corner| corner.abs().max_element()).fold(0.0, f64::max);
    let length = ray.direction.abs();
    let axis = if length.x >= length.y && length.x >= length.z {
        0
    } else if length.y >= length.z {
        1
    } else {
        2
    };
    let depths = relative.map(|corner| corner[axis]);
    let [least, greatest] = [
        depths.iter().copied().fold(f64::INFINITY, f64::min),
        depths.iter().copied().fold(-f64::INFINITY, f64::max),
    ];
    let sums = edges(ray, corners);
    let share = |of: fn(&(f64, f64)) -> f64| sums.iter().map(of).sum::<f64>() / length[axis];
    let (sum, unsure) = (share(|e| e.0).abs(), share(|e| e.1));
    let error = 72.0 * U * size * size;
    let rest = sum - unsure - 3.0 * error;
    if rest <= 0.0 {
        return f64::INFINITY;
    }
    (3.0 * error * (greatest - least) / rest + 8.0 * U * size) / length[axis]
}
