//! Estimates of hits on an analytic shape, by its bounding sphere.

use super::{Errors, Estimate, MAX_COORDINATE, RaysInF32, U, UNDERFLOW, splat};
use crate::geometry::AnalyticShape;
use crate::geometry::bounds::{round_down, round_up};
use crate::geometry::fast::{dot, minus};
use crate::geometry::simd::Floats;

/// More than what squares and their sums lose to underflow.
const SQUARE_UNDERFLOW: f64 = f32::MIN_POSITIVE as f64;

/// A shape by its bounding sphere, for [`ShapeInF32::estimate`]. Rays that certainly miss the sphere miss the shape;
/// only if the sphere is the shape, some hit it for certain. With f = o - centre, the ray's line passes the centre
/// nearest at t = -f . d / d . d, at a distance of m = |f + t d|, and meets the sphere half a chord before and after
/// that.
///
/// # Errors
/// f is off by 2 u S, t by 42 u S, f + t d by 55 u S on each axis, so m by less than 100 u S, and its square by 8 u of itself
/// besides. The square of half the chord is then off by 200 u S r + (100 u S)^2 + 8 u r^2, half the chord itself by that
/// over its computed value. The tier's roundings are those of f64, 2^-29 of these. Squares of less than 2^-125 underflow by
/// 2^-147 in sum ([`SQUARE_UNDERFLOW`]).
pub(crate) struct ShapeInF32 {
    centre: [f32; 3],
    radius: f64,
    /// The square of the radius.
    square: f32,
    /// The largest coordinate of the centre.
    size: f64,
    /// The lanes that may be certain hits: all or none.
    decided: u32,
}

impl ShapeInF32 {
    pub(crate) fn new(shape: &AnalyticShape) -> Self {
        let (centre, radius) = shape.bounding_sphere();
        let decided = if shape.is_bounding_sphere() { u32::MAX } else { 0 };
        let size = centre.abs().max_element();
        let centre = centre.to_array().map(|x| x as f32);
        let square = (radius * radius) as f32;
        ShapeInF32 { centre, radius, square, size, decided }
    }

    /// The largest coordinate of the bounding sphere.
    pub(crate) fn reach(&self) -> f64 {
        self.size + self.radius
    }

    /// See [`TriangleInF32::is_supported`].
    pub(crate) fn is_supported(&self) -> bool {
        self.reach() <= f64::from(MAX_COORDINATE)
    }

    /// The errors of t and of the square of half the chord, and the squares of m beyond which rays certainly miss and
    /// below which lines certainly meet the sphere, for origins whose coordinates are at most `reach`.
    #[inline(always)]
    pub(crate) fn errors(&self, reach: f64) -> Errors {
        let r = self.radius;
        let error = 100.0 * U * (reach + self.size) + UNDERFLOW;
        let margin = 16.0 * U;
        let outside = (r + error).powi(2) * (1.0 + margin) + SQUARE_UNDERFLOW;
        let inside = (r - error).max(0.0).powi(2) * (1.0 - margin) - SQUARE_UNDERFLOW;
        let of_square = 2.0 * error * r + error * error + margin * r * r + SQUARE_UNDERFLOW;
        Errors([round_up(error), round_up(of_square), round_up(outside), round_down(inside)])
    }

    /// Estimates the hits of the rays.
    #[inline(always)]
    pub(crate) fn estimate<F: Floats>(&self, errors: &Errors, rays: &RaysInF32<F>) -> Estimate<F> {
        let [of_nearest, of_square, outside, inside] = errors.splat();
        let (zero, d) = (F::splat(0.0), &rays.direction);
        let f = minus(&rays.origin, &splat(&self.centre));
        let nearest = zero - dot(&f, d) * rays.inverse_square;
        let mut m = f;
        for (m, &d) in m.iter_mut().zip(d) {
            *m = nearest.mul_add(d, *m);
        }
        let square = dot(&m, &m);
        let possible = square.le(outside);
        if possible == 0 {
            return Estimate { possible: 0, certain: 0, near: zero, far: zero };
        }
        let inside = square.lt(inside);
        let half = ((F::splat(self.square) - square) * rays.inverse_square).max(zero).sqrt();
        let size = nearest.abs() + half;
        // 1 / d . d is at most 1 / 0.9.
        let of_half = of_square * F::splat(1.2) / half;
        let error = size.mul_add(F::splat(16.0 * U as f32), of_nearest + of_half);
        let (first, second) = (nearest - half, nearest + half);
        let is_first = rays.t_min.lt(first - error);
        let is_behind = (first + error).le(rays.t_min);
        let is_second = is_behind & rays.t_min.lt(second - error);
        let is_beyond = is_behind & (second + error).le(rays.t_min);
        let t = F::select(is_first, first, second);
        let certain = inside & (is_first | is_second) & self.decided;
        Estimate { possible: possible & !(inside & is_beyond), certain, near: t - error, far: t + error }
    }
}
