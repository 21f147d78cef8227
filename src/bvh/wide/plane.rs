//! The side of a triangle's plane that rays start on, where f32 cannot tell: rays to a light start right before what they light.

use crate::geometry::bundle::{Gathered, RAYS};
use crate::geometry::simd::Simd;

/// The plane of a triangle, seen from an apex.
///
/// How far a point o is before it, times twice the triangle's area, is H = n . (A - o), with n = (B - A) x (C - A). In max norms, let M = |A - o|,
/// p = |B - A| and q = |C - A|: no corner is farther from o than M, M + p and M + q. H as computed here is off by less than 48 u M p q: six
/// products of three differences, 8 roundings on the way of each.
/// The tier's test has the sign of H where that is above 168 u M (M + p) (M + q) (see `side` in `geometry::bundle`); u = 2^-53.
pub struct Plane {
    corner: [f64; 3],
    /// n, turned so that the apex is before the plane.
    normal: [f64; 3],
    /// p and q.
    sizes: [f64; 2],
}

/// 256 u, more than the sum of both.
const SLACK: f64 = 128.0 * f64::EPSILON;

impl Plane {
    /// Of a triangle; `sign` is that of H at the apex.
    #[inline(always)]
    pub fn new([a, b, c]: &[[f64; 3]; 3], sign: f64) -> Self {
        let minus = |p: &[f64; 3], q: &[f64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
        let size = |p: &[f64; 3]| p[0].abs().max(p[1].abs()).max(p[2].abs());
        let (p, q) = (minus(b, a), minus(c, a));
        let normal = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
        Plane {
            corner: *a,
            normal: [normal[0] * sign, normal[1] * sign, normal[2] * sign],
            sizes: [size(&p), size(&q)],
        }
    }

    /// Which of four rays start surely before the plane, as the apex does, and which surely beyond it.
    #[inline(always)]
    pub fn sides<S: Simd>(&self, rays: &Gathered<S>) -> [u32; 2] {
        let nothing = S::d4_splat(0.0);
        let (mut height, mut reach) = (nothing, nothing);
        for axis in 0..3 {
            let to_corner = S::d4_sub(S::d4_splat(self.corner[axis]), rays.origin[axis]);
            height = S::d4_add(S::d4_mul(S::d4_splat(self.normal[axis]), to_corner), height);
            reach = S::d4_max(S::d4_abs(to_corner), reach);
        }
        let [p, q] = self.sizes.map(|size| S::d4_add(reach, S::d4_splat(size)));
        let off = S::d4_mul(S::d4_mul(reach, S::d4_splat(SLACK)), S::d4_mul(p, q));
        [S::d4_lt(off, height), S::d4_lt(height, S::d4_sub(nothing, off))]
    }
}

/// The lanes of four rays, as bits.
pub const FOUR: u32 = (1 << RAYS) - 1;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ray;
    use crate::geometry::expansion::Expansion;
    use crate::geometry::simd::Portable;
    use glam::DVec3;

    /// The sign of H in exact arithmetic.
    fn exact(corners: &[[f64; 3]; 3], o: DVec3) -> i32 {
        let [a, b, c] = corners;
        let side = |p: &[f64; 3], q: &[f64; 3], k: usize| Expansion::difference(p[k], q[k]);
        let o = o.to_array();
        let term = |(k, i, j): (usize, usize, usize)| {
            side(a, &o, k) * (side(b, a, i) * side(c, a, j) - side(b, a, j) * side(c, a, i))
        };
        let terms = [(0, 1, 2), (1, 2, 0), (2, 0, 1)].map(term);
        terms.into_iter().fold(Expansion::default(), |sum, term| sum + term).sign()
    }

    #[test]
    fn a_side_that_is_sure_is_right() {
        let mut state = 7u64;
        let mut unit = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
        };
        let (mut sure, mut unsure) = (0, 0);
        for i in 0..20_000 {
            let away = [0.0, 3.0, 1e3][i % 3];
            let mut corner = || [away + unit(), away + unit(), away + unit()];
            let corners = [corner(), corner(), corner()];
            let [a, b, c] = corners.map(DVec3::from);
            // In the plane as far as f64 has it, or beside it by some of its last places, or by what f32 leaves.
            let beside = [0.0, 1e-16, 1e-15, 1e-13, 1e-7][i / 3 % 5] * (away + 1.0) * unit();
            let (v, w) = (unit(), unit());
            let origin = a + v * (b - a) + w * (c - a) + beside * (b - a).cross(c - a).normalize();
            let ray = Ray { origin, direction: DVec3::X, t_min: 0.0, t_max: 1.0 };
            let [before, beyond] = Plane::new(&corners, 1.0).sides::<Portable>(&Gathered::new(&[ray], 0));
            match exact(&corners, origin) {
                sign if before & 1 != 0 => assert!(sign > 0, "{corners:?} {origin:?}"),
                sign if beyond & 1 != 0 => assert!(sign < 0, "{corners:?} {origin:?}"),
                _ => unsure += 1,
            }
            sure += i32::from((before | beyond) & 1 != 0);
        }
        assert!(sure > 2000 && unsure > 2000, "{sure} sure, {unsure} not");
    }
}
