//! Bounds of the part of a triangle between two planes of an axis, for spatial splits.

use glam::DVec3;

use crate::geometry::Bounds;

/// The relative error of a computed point of an edge, times 2 for the rounding of the bounds of the error.
///
/// With u = 2^-53 and corners p and q, one of them on either side of the plane, the point is p + (q - p) s with
/// s = (at - p_i) / (q_i - p_i) between 0 and 1. On axis k let M = max(|p_k|, |q_k|). The product is the true one times
/// five factors 1 + δ, |δ| ≤ u: of the difference q_k - p_k, of the two differences and the quotient of s, and its own.
/// So it is off by at most γ5 · 2M, with γ5 = 5u / (1 - 5u). The sum, at most M (1 + 11u) in magnitude, rounds by u of
/// itself. All together, that is less than 11.1u · M; the error added to or subtracted from the point rounds by less
/// than 1.1u · M. 16u is above both together, and above the 2^-1075 · 2M of an s that
/// underflows.
const ERROR: f64 = 8.0 * f64::EPSILON;

/// The box ([`Bounds::of_triangles`]) of the part of the triangle between the planes `low` and `high` of an axis, both
/// included, up to the error of its computation, which it allows for; inverted if there is no such part.
///
/// It contains each point of the exact triangle between the planes. Points of the edges within the planes are
/// computed in f64, and widened by [`ERROR`] and, for underflow, by the least normal number. Corners are exact.
pub(super) fn between(corners: &[DVec3; 3], axis: usize, low: f32, high: f32) -> Bounds {
    let planes = [f64::from(low), f64::from(high)];
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for i in 0..3 {
        let (p, q) = (corners[i], corners[(i + 1) % 3]);
        if planes[0] <= p[axis] && p[axis] <= planes[1] {
            (min, max) = (min.min(p), max.max(p));
        }
        for at in planes {
            if (p[axis] < at && at < q[axis]) || (q[axis] < at && at < p[axis]) {
                let point = p + (q - p) * ((at - p[axis]) / (q[axis] - p[axis]));
                let error = p.abs().max(q.abs()) * ERROR + f64::MIN_POSITIVE;
                (min, max) = (min.min(point - error), max.max(point + error));
            }
        }
    }
    let reach = corners.iter().fold(DVec3::ZERO, |most, corner| most.max(corner.abs())).max_element();
    (min[axis], max[axis]) = (min[axis].max(planes[0]), max[axis].min(planes[1]));
    Bounds::of_triangles([min, max], reach)
}
