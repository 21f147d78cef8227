//! Estimates of hits on a triangle.

use super::{DIRECTION, Errors, Estimate, MAX_COORDINATE, RaysInF32, U, UNDERFLOW, splat};
use crate::geometry::bounds::round_up;
use crate::geometry::fast::{cross, dot, minus};
use crate::geometry::simd::Floats;

/// A triangle for [`TriangleInF32::estimate`]. For rays o + t d, with edges p and q from corner a and n = p x q, the test
/// computes (Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, 1997)
///
/// ```text
/// s = o - a,  c = s x d,  v = q . c,  w = -p . c,  sum = -n . d,  u = sum - v - w,  t = n . s / sum
/// ```
///
/// where v, w and u have the sign of `sum` if the ray's line crosses the triangle.
///
/// # Errors
/// With P, Q and N for the largest components of p, q and n:
/// - s is off by 2 u S: the origin, the corner (in tiers with corners in f64) and the difference are rounded.
/// - c is off by 9 u S, or 10 without fused operations, times the largest direction; no component exceeds 2 S.
/// - v is off by 54 u Q S at most: each of three products by 11 u Q S, and by six roundings of sums up to 6 Q S. w alike.
/// - `sum` is off by 15 u N, and by 2^-48 P Q, since n is a difference of products in f64.
/// - u is off by what these are, and by two roundings of numbers up to 3 N + 6 (P + Q) S. So all three are off by less than
///   80 u (P + Q) S + 24 u N.
/// - n . s is off by 18 u N S, and by 3 * 2^-48 P Q S.
///
/// The tier computes the same edge functions as sheared ones, divided by the largest component of the direction. Their
/// error ([`crate::geometry::woop`]) is less than 132 * 2^-53 of the square of the largest coordinate of a corner relative to the
/// origin, which is at most S + P + Q. Its distance is a mean of the corners' depths by these weights. Times `sum`, it is
/// off by 3 * 132 * 2^-53 of the cube of that, and by 100 * 2^-53 for the roundings of the mean. A ray that is certainly
/// inside meets no sliver in the sense of the tier, because it is inside by more than the error of f64.
pub(crate) struct TriangleInF32 {
    corner: [f32; 3],
    p: [f32; 3],
    q: [f32; 3],
    normal: [f32; 3],
    /// The largest coordinate of the corner, P + Q, and N.
    sizes: [f64; 3],
}

/// The largest share of `sum` that its error may be where a distance is computed.
const MAX_SUM_ERROR: f32 = 1.0 / 128.0;

impl TriangleInF32 {
    pub(crate) fn new([a, b, c]: &[[f64; 3]; 3]) -> Self {
        let minus = |x: &[f64; 3], y: &[f64; 3]| [x[0] - y[0], x[1] - y[1], x[2] - y[2]];
        let (p, q) = (minus(b, a), minus(c, a));
        let normal = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
        let size = |x: &[f64; 3]| x[0].abs().max(x[1].abs()).max(x[2].abs());
        let sizes = [size(a), size(&p) + size(&q), size(&normal)];
        let f32s = |x: [f64; 3]| x.map(|x| x as f32);
        TriangleInF32 { corner: f32s(*a), p: f32s(p), q: f32s(q), normal: f32s(normal), sizes }
    }

    /// Whether its coordinates are not too large for f32.
    pub(crate) fn is_supported(&self) -> bool {
        self.sizes[0] + self.sizes[1] <= f64::from(MAX_COORDINATE)
    }

    /// The bounds of the errors of u, v and w, of `sum`, and of n . s, for origins whose coordinates are at most `reach`.
    #[inline(always)]
    pub(crate) fn errors(&self, reach: f64) -> Errors {
        let [corner, edges, normal] = self.sizes;
        let s = reach + corner;
        // P Q is at most a quarter of the square of P + Q.
        let [roundings, product, farthest] = [2f64.powi(-48), edges * edges / 4.0, s + edges];
        let weight = 80.0 * U * edges * s + 24.0 * U * normal + 2f64.powi(-45) * farthest * farthest;
        let sum = 16.0 * U * normal + roundings * product;
        let height =
            24.0 * U * normal * s + 4.0 * roundings * product * s + 2f64.powi(-42) * farthest.powi(3);
        Errors([weight * DIRECTION, sum * DIRECTION, height, 0.0].map(|error| round_up(error + UNDERFLOW)))
    }

    /// Estimates the hits of the rays.
    #[inline(always)]
    pub(crate) fn estimate<F: Floats>(&self, errors: &Errors, rays: &RaysInF32<F>) -> Estimate<F> {
        let zero = F::splat(0.0);
        let d = &rays.direction;
        let s = minus(&rays.origin, &splat(&self.corner));
        let c = cross(&s, d);
        let normal = splat(&self.normal);
        let v = dot(&splat(&self.q), &c);
        let w = zero - dot(&splat(&self.p), &c);
        let sum = zero - dot(&normal, d);
        let u = sum - v - w;
        let [weight_error, sum_error, height_error, _] = errors.splat();
        let (least, most) = (u.min(v).min(w), u.max(v).max(w));
        let possible = (zero - weight_error).le(least) | most.le(weight_error);
        if possible == 0 {
            return Estimate { possible: 0, certain: 0, near: zero, far: zero };
        }
        let inside = weight_error.lt(least) | most.lt(zero - weight_error);
        let inverse = F::splat(1.0) / sum;
        let size = inverse.abs();
        let t = dot(&normal, &s) * inverse;
        let share = sum_error * size;
        let steady = inside & share.le(F::splat(MAX_SUM_ERROR));
        // Where `share` is at most 1 / 128, the error of a quotient is at most 128 / 127 of what a bound of first order gives.
        let relative = share + F::splat(16.0 * U as f32);
        let error = height_error.mul_add(size, t.abs() * relative) * F::splat(1.02);
        let (near, far) = (t - error, t + error);
        Estimate {
            possible: possible & !(steady & far.le(rays.t_min)),
            certain: steady & rays.t_min.lt(near),
            near,
            far,
        }
    }
}
