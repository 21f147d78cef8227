//! The side of a triangle's plane that rays start on, where f32 cannot tell: rays to a light start right before what they light.

use crate::geometry::bundle::{Gathered, RAYS};
use crate::geometry::simd::Simd;

/// The plane of a triangle, seen from an apex.
///
/// How far a point o is before it, times twice the triangle's area, is H = n . (A - o), with n = (B - A) x (C - A). With R = |A - o| +
/// |B - A| + |C - A|, sums of sizes, no corner is farther from o than R. The differences are off by one rounding of f64, so n by 4 of |B - A|
/// |C - A|, H by 9 of R^3; what the tier finds of a ray's distance to the triangle, times how fast the ray nears the plane, is off by
/// fewer than 41 of that (see [`Edges`](super::edges::Edges)), and 64 stand for both.
pub struct Plane {
    corner: [f64; 3],
    /// n, turned so that the apex is before the plane.
    normal: [f64; 3],
    /// |B - A| + |C - A|
    size: f64,
}

/// 64 roundings of f64.
const SLACK: f64 = 32.0 * f64::EPSILON;

impl Plane {
    /// Of a triangle; `sign` is that of H at the apex.
    #[inline(always)]
    pub fn new([a, b, c]: &[[f64; 3]; 3], sign: f64) -> Self {
        let minus = |p: &[f64; 3], q: &[f64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
        let size = |p: &[f64; 3]| p[0].abs() + p[1].abs() + p[2].abs();
        let (p, q) = (minus(b, a), minus(c, a));
        let normal = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
        Plane {
            corner: *a,
            normal: [normal[0] * sign, normal[1] * sign, normal[2] * sign],
            size: size(&p) + size(&q),
        }
    }

    /// Which of four rays start surely before the plane, as the apex does, and which surely beyond it.
    #[inline(always)]
    pub fn sides<S: Simd>(&self, rays: &Gathered<S>) -> [u32; 2] {
        let (mut height, mut reach) = (S::d4_splat(0.0), S::d4_splat(self.size));
        for axis in 0..3 {
            let to_corner = S::d4_sub(S::d4_splat(self.corner[axis]), rays.origin[axis]);
            height = S::d4_add(S::d4_mul(S::d4_splat(self.normal[axis]), to_corner), height);
            reach = S::d4_add(S::d4_abs(to_corner), reach);
        }
        let off = S::d4_mul(S::d4_mul(reach, S::d4_splat(SLACK)), S::d4_mul(reach, reach));
        let nothing = S::d4_splat(0.0);
        [S::d4_lt(off, height), S::d4_lt(height, S::d4_sub(nothing, off))]
    }
}

/// The lanes of four rays, as bits.
pub const FOUR: u32 = (1 << RAYS) - 1;
