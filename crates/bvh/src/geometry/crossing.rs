//! Crossings: where a ray passes through a surface, each passage once.
//!
//! A ray through an edge or a vertex, in the plane of a triangle or from a point of the surface has no definite number
//! of crossings. So another ray is counted: that from `o + δ`, where `δ = (ε, ε², ε³)` and ε is positive and smaller
//! than every number in question (simulation of simplicity: Edelsbrunner and Mücke, ACM Transactions on Graphics 9(1),
//! 1990). δ depends neither on the triangles nor on the ray. So the ray is the same for all triangles.
//!
//! With `P = p - o` and `Q = q - o`, an edge from p to q has the edge function `E(p, q) = d . (P x Q)`. The line passes
//! through a triangle if E has the same sign at its three edges; their sum is `d . n`, with n = `(b - a) x (c - a)`,
//! and its sign is the side. For the moved ray,
//!
//! - `E' = d . ((P - δ) x (Q - δ)) = E + δ . (d x (q - p))`. If E is 0, the sign is that of the first component of
//!   `d x (q - p)` that is not 0. All are 0 only where the edge is parallel to d, or its ends are equal. Its triangles
//!   are then segments, seen along d, and no line along d passes through the inside of a segment: no crossing.
//!   E'(q, p) is -E'(p, q), so both triangles of an edge see the line on the same side of it.
//! - A crossing lies at `t' = n . (a - o - δ) / n . d`. If the unmoved t is `t_min`, then t' lies beyond it where the
//!   first component of n that is not 0 has the opposite sign of `n . d`. The same decides at `t_max`.
//!
//! Every sign is exact, and none is 0 for a triangle that is crossed. So the answers are those of exact arithmetic for
//! one real ray, whose line meets no edge and whose origin lies on no triangle. For such a ray, crossings of a closed
//! surface alternate between entering and leaving if it does not intersect itself; their number is odd exactly if
//! the origin is inside; and leaving ones less entering ones are the winding number of the surface around the
//! origin (Jordan, Brouwer). Triangles without area are crossed by no moved ray, and change nothing.
//!
//! A point on the surface is therefore at the place that is infinitesimally farther along +x, then along +y, then
//! +z. Of closed surfaces that fill a volume without overlap, each point is in exactly one.
//!
//! Crossings are ordered by t'. Only triangles in the same plane are crossed at equal t'; they are ordered by id.

use std::cmp::Ordering;

use glam::DVec3;
use num_bigint::BigInt;
use num_traits::Signed;

use super::distance::{Distance, Vector, cross, dot, integers, minus};
use super::exact::{
    PlaneDistance, TOLERANCE, is_ray, is_within, plane_distance, triple_product, weight_error,
};
use super::expansion::{Expansion, two_sum};
use super::lanes::Triangle4;
use super::simd::Doubles;
use super::woop::WoopTest;
use super::{AnalyticShape, Corner, Ray, Stored};

/// The side of a surface on which a ray passes through it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Side {
    /// Through the front, against the normal: of a triangle that is counter-clockwise seen from the ray's origin.
    Entering,
    /// Through the back, along the normal.
    Leaving,
}

/// A ray prepared for crossings.
pub(crate) struct LineTest {
    pub(crate) ray: Ray,
    woop: WoopTest,
}

impl LineTest {
    /// Prepares a ray.
    #[inline(always)]
    pub(crate) fn new(ray: &Ray) -> Self {
        LineTest { ray: *ray, woop: WoopTest::new(ray) }
    }

    /// Where and on which side the moved ray crosses a triangle, between `t_min` and `t_max`. t is that of the unmoved
    /// ray, good to [`TOLERANCE`].
    #[inline]
    pub(crate) fn cross_triangle(&self, corners: &[DVec3; 3]) -> Option<(f64, Side)> {
        let sheared = self.woop.sheared(corners);
        let (weights, error) = (sheared.weights(), weight_error(&sheared));
        let side = self.side(corners, weights, error)?;
        let t = match plane_distance(&self.ray, corners) {
            PlaneDistance::At(t) => t,
            PlaneDistance::Behind => return None,
            PlaneDistance::Undecided => return self.cross_exactly(corners, side),
        };
        match is_within(&self.ray, t) {
            Some(is_within) => is_within.then_some((t, side)),
            None => self.cross_exactly(corners, side),
        }
    }

    /// Where and on which side the moved ray crosses another shape.
    pub(crate) fn cross_shape(&self, shape: &AnalyticShape) -> [Option<(f64, Side)>; 2] {
        shape.crossings(&self.ray)
    }

    /// The side on which the moved line passes through a triangle. `weights` are good to `error`.
    #[inline(always)]
    fn side(&self, corners: &[DVec3; 3], weights: [f64; 3], error: f64) -> Option<Side> {
        let [a, b, c] = weights;
        let (least, most) = (a.min(b).min(c), a.max(b).max(c));
        // An edge function is its weight times the direction along the major axis. The edges run against the triangle.
        let positive = if least > error {
            true
        } else if most < -error {
            false
        } else if least < -error && most > error {
            return None;
        } else {
            return self.side_exactly(corners, weights, error);
        };
        Some(if positive == (self.woop.sign > 0.0) { Side::Entering } else { Side::Leaving })
    }

    #[cold]
    fn side_exactly(&self, corners: &[DVec3; 3], weights: [f64; 3], error: f64) -> Option<Side> {
        is_ray(&self.ray).then_some(())?;
        let sign = |k: usize| {
            let (p, q) = (corners[(k + 2) % 3], corners[(k + 1) % 3]);
            match weights[k] {
                weight if weight.abs() > error => (weight * self.woop.sign).signum() as i32,
                _ => self.edge_sign(p, q),
            }
        };
        match [sign(0), sign(1), sign(2)] {
            [1, 1, 1] => Some(Side::Entering),
            [-1, -1, -1] => Some(Side::Leaving),
            _ => None,
        }
    }

    /// The sign of the moved line's edge function; 0 for an edge parallel to the ray.
    fn edge_sign(&self, p: DVec3, q: DVec3) -> i32 {
        let d = self.ray.direction;
        if let Some(sign) = edge_sign_of_few_digits(&self.ray, p, q) {
            return sign;
        }
        let along = |k: usize, factor: f64| Expansion::difference(q[k], p[k]).scaled(factor);
        match triple_product(&self.ray, p, q).sign() {
            0 => first_sign(&[(1, 2), (2, 0), (0, 1)].map(|(i, j)| along(j, d[i]) - along(i, d[j]))),
            sign => sign,
        }
    }

    #[cold]
    fn cross_exactly(&self, corners: &[DVec3; 3], side: Side) -> Option<(f64, Side)> {
        let distance = Distance::to_triangle(&self.ray, corners)?.distance;
        let is_beyond = |t: f64| {
            t < f64::INFINITY
                && distance.cmp(&Distance::of(t)).then_with(|| {
                    let along = first_sign(&normal(corners));
                    if side == Side::Leaving { 0.cmp(&along) } else { along.cmp(&0) }
                }) == Ordering::Greater
        };
        (is_beyond(self.ray.t_min) && !is_beyond(self.ray.t_max)).then(|| (distance.to_f64(), side))
    }

    /// The triangles that the moved line may pass through.
    #[inline(always)]
    pub(crate) fn may_cross4<C: Corner, D: Doubles>(&self, four: &Triangle4<C>) -> u32 {
        self.woop.may_cross4::<C, D>(four)
    }
}

/// [`LineTest::edge_sign`] in integers of 128 bits; `None` if the coordinates have too many digits. An order of
/// magnitude faster than expansions, and rays that meet edges exactly have few digits more often than not.
fn edge_sign_of_few_digits(ray: &Ray, p: DVec3, q: DVec3) -> Option<i32> {
    let is_exact = |v: DVec3| (0..3).all(|k| two_sum(v[k], -ray.origin[k]).1 == 0.0);
    (is_exact(p) && is_exact(q)).then_some(())?;
    let ([p, q], digits) = few_digits([p - ray.origin, q - ray.origin])?;
    let ([d], of_direction) = few_digits([ray.direction])?;
    // Three sums of two products of three numbers.
    (2 * digits + of_direction + 3 < i128::BITS).then_some(())?;
    let axes = [(0, 1, 2), (1, 2, 0), (2, 0, 1)];
    let edge: i128 = axes.iter().map(|&(k, i, j)| d[k] * (p[i] * q[j] - p[j] * q[i])).sum();
    let moved = axes.map(|(_, i, j)| d[i] * (q[j] - p[j]) - d[j] * (q[i] - p[i]));
    let first = std::iter::once(edge).chain(moved).find(|&sign| sign != 0);
    Some(first.unwrap_or(0).signum() as i32)
}

/// Vectors as integers, times a common power of two, and their number of binary digits; `None` for more than 53.
fn few_digits<const N: usize>(vectors: [DVec3; N]) -> Option<([[i128; 3]; N], u32)> {
    const DIGITS: i32 = f64::MANTISSA_DIGITS as i32;
    let largest = vectors.iter().fold(0.0, |most: f64, v| most.max(v.abs().max_element()));
    let exponent = (largest.to_bits() >> (DIGITS - 1)) as i32 - 1023;
    // The largest is from 2^(DIGITS - 1) up to 2^DIGITS. It is infinite or NaN for subnormal numbers and 0.
    let scaled = vectors.map(|v| v * f64::from(DIGITS - 1 - exponent).exp2());
    scaled.iter().all(|v| v.is_finite() && v.trunc() == *v).then_some(())?;
    let integers = scaled.map(|v| v.to_array().map(|x| x as i64));
    let zeros = integers.as_flattened().iter().fold(0, |all, x| all | x).trailing_zeros();
    Some((integers.map(|v| v.map(|x| i128::from(x >> zeros))), DIGITS as u32 - zeros))
}

/// The sign of the first number that is not 0.
pub(super) fn first_sign(numbers: &[Expansion; 3]) -> i32 {
    numbers.iter().map(Expansion::sign).find(|&sign| sign != 0).unwrap_or(0)
}

/// `(b - a) x (c - a)`, exactly.
fn normal(&[a, b, c]: &[DVec3; 3]) -> [Expansion; 3] {
    let side = |p: DVec3, k: usize| Expansion::difference(p[k], a[k]);
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| side(b, i) * side(c, j) - side(b, j) * side(c, i))
}

/// The order of two crossings of a moved ray, given t, side and primitive of each; equal for triangles in the same
/// plane.
pub(crate) fn order_of_crossings(ray: &Ray, crossings: [(f64, Side, &Stored<DVec3>); 2]) -> Ordering {
    let [a, b] = crossings;
    if (a.0 - b.0).abs() > 4.0 * TOLERANCE * a.0.abs().max(b.0.abs()) {
        return a.0.total_cmp(&b.0);
    }
    if let [(_, _, Stored::Triangle(a)), (_, _, Stored::Triangle(b))] = crossings {
        return if is_same_plane(a, b) { Ordering::Equal } else { order_of_triangles(ray, a, b) };
    }
    let exact = |(_, side, primitive): (f64, Side, &Stored<DVec3>)| match primitive {
        Stored::Triangle(corners) => Distance::to_triangle(ray, corners).map(|crossing| crossing.distance),
        Stored::Analytic(shape) => shape.exact_crossing(ray, side),
    };
    let is_triangle = |primitive: &Stored<DVec3>| matches!(primitive, Stored::Triangle(_));
    // Both have been crossed, so there are distances. Where they are equal, shapes come before triangles.
    let order = exact(a).zip(exact(b)).map_or(Ordering::Equal, |(a, b)| a.cmp(&b));
    order.then(is_triangle(a.2).cmp(&is_triangle(b.2)))
}

/// Whether triangles with an area are obviously in the same plane: one of constant x, y or z, or all corners are the same.
/// Models have many of both.
fn is_same_plane(a: &[DVec3; 3], b: &[DVec3; 3]) -> bool {
    let is_constant = |k: usize| a.iter().chain(b).all(|corner| corner[k] == a[0][k]);
    (0..3).any(is_constant) || a.iter().all(|corner| b.contains(corner))
}

#[cold]
fn order_of_triangles(ray: &Ray, a: &[DVec3; 3], b: &[DVec3; 3]) -> Ordering {
    let points = [ray.origin, ray.direction, a[0], a[1], a[2], b[0], b[1], b[2]];
    let mut numbers = [0.0; 24];
    numbers.iter_mut().enumerate().for_each(|(i, number)| *number = points[i / 3][i % 3]);
    let numbers = integers(numbers);
    let vector = |i: usize| -> Vector { [0, 1, 2].map(|k| numbers[3 * i + k].clone()) };
    let (origin, direction) = (vector(0), vector(1));
    // The numerator of t, the components of -n, which move it, and the denominator, made positive.
    let plane = |first: usize| -> ([BigInt; 4], BigInt) {
        let [a, b, c] = [0, 1, 2].map(|i| minus(&vector(first + i), &origin));
        let normal = cross(&minus(&b, &a), &minus(&c, &a));
        let across = dot(&normal, &direction);
        let sign = across.signum();
        let height = dot(&normal, &a) * &sign;
        let [x, y, z] = normal.map(|component| -component * &sign);
        ([height, x, y, z], across * sign)
    };
    let ((a, across_a), (b, across_b)) = (plane(2), plane(5));
    let orders = a.iter().zip(&b).map(|(a, b)| (a * &across_b).cmp(&(b * &across_a)));
    orders.fold(Ordering::Equal, Ordering::then)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn triangles_of_an_obvious_plane_have_no_order(
            points in prop::array::uniform8(prop::array::uniform3(-1.0..1.0f64)),
            kind in 0..3usize,
        ) {
            let [a, b, c, d, e, f, origin, direction] = points.map(DVec3::from);
            let flat = |v: DVec3| DVec3::new(0.1 * v.x, 0.7, v.z);
            // Turned, or of one constant coordinate, or neither.
            let (one, other) = match kind {
                0 => ([a, b, c], [c, b, a]),
                1 => ([a, b, c].map(flat), [d, e, f].map(flat)),
                _ => ([a, b, c], [d, e, f]),
            };
            let ray = Ray { origin, direction, t_min: 0.0, t_max: f64::INFINITY };
            prop_assert_eq!(is_same_plane(&one, &other), kind < 2);
            if kind < 2 {
                prop_assert_eq!(order_of_triangles(&ray, &one, &other), Ordering::Equal);
            }
        }
    }
}
