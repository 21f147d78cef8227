//! The side of a triangle's plane on which rays start, in f64 with error bounds.

use super::lanes::RayN;
use super::simd::Doubles;

/// The plane of a triangle in each lane.
///
/// For a point o, H = n . (A - o) with n = (B - A) x (C - A) is the signed distance to the plane times twice the area.
/// In max norms, let M = |A - o|, p = |B - A| and q = |C - A|: no corner is farther from o than M, M + p and M + q.
/// H as computed here is off by less than 48 u M p q: six products of three differences, with 8 roundings each.
/// The tier's test has the sign of H if that is above 168 u M (M + p) (M + q) (see `side` in `geometry::woop_n`);
/// u = 2^-53.
pub(crate) struct TrianglePlane<D> {
    corner: [D; 3],
    normal: [D; 3],
    /// p and q.
    sizes: [D; 2],
}

/// 256 u, more than the sum of both bounds.
const SIDE_SLACK: f64 = 128.0 * f64::EPSILON;

/// 2^-36: see [`TrianglePlane::behind`].
const SLOPE_SLACK: f64 = 1.0 / (1u64 << 36) as f64;

/// The numbers of a plane: A, n, p and q.
pub(crate) const PLANE_NUMBERS: usize = 8;

/// A, n, p and q of the plane of a triangle.
#[inline(always)]
pub(crate) fn plane_of([a, b, c]: &[[f64; 3]; 3]) -> [f64; PLANE_NUMBERS] {
    let minus = |p: &[f64; 3], q: &[f64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    let size = |p: &[f64; 3]| p[0].abs().max(p[1].abs()).max(p[2].abs());
    let (p, q) = (minus(b, a), minus(c, a));
    let normal = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
    [a[0], a[1], a[2], normal[0], normal[1], normal[2], size(&p), size(&q)]
}

impl<D: Doubles> TrianglePlane<D> {
    /// One plane in all lanes, with its normal times `sign`.
    #[inline(always)]
    pub(crate) fn new(corners: &[[f64; 3]; 3], sign: f64) -> Self {
        let [ax, ay, az, x, y, z, p, q] = plane_of(corners);
        TrianglePlane {
            corner: [D::splat(ax), D::splat(ay), D::splat(az)],
            normal: [D::splat(x * sign), D::splat(y * sign), D::splat(z * sign)],
            sizes: [D::splat(p), D::splat(q)],
        }
    }

    /// A plane for each lane, from the numbers of [`plane_of`].
    #[inline(always)]
    pub(crate) fn of_numbers([ax, ay, az, x, y, z, p, q]: [D; PLANE_NUMBERS]) -> Self {
        TrianglePlane { corner: [ax, ay, az], normal: [x, y, z], sizes: [p, q] }
    }

    /// H, its error bound, and M.
    #[inline(always)]
    fn height(&self, origins: &[D; 3]) -> [D; 3] {
        let nothing = D::splat(0.0);
        let (mut height, mut reach) = (nothing, nothing);
        for ((&corner, &normal), &origin) in self.corner.iter().zip(&self.normal).zip(origins) {
            let to_corner = corner - origin;
            height = normal * to_corner + height;
            reach = to_corner.abs().max(reach);
        }
        let [p, q] = [reach + self.sizes[0], reach + self.sizes[1]];
        [height, reach * D::splat(SIDE_SLACK) * (p * q), reach]
    }

    /// The rays that certainly start where H is positive, and those that certainly start on the other side.
    #[inline(always)]
    pub(crate) fn sides(&self, origins: [D; 3]) -> [u32; 2] {
        let [height, error, _] = self.height(&origins);
        [error.lt(height), height.lt(D::splat(0.0) - error)]
    }

    /// The rays, of unit direction, whose triangle the tier certainly misses because it lies behind the origin.
    ///
    /// The distance to the plane is H over n . d. Where |n . d| is above 2^-36 of the square of the largest coordinate of a
    /// corner relative to the origin, the depth that the tier computes is off by less than 2^-7 of that coordinate: it is near
    /// 0, and the sign of H decides ([`super::woop::NEAR`]), or it has the right sign. So does the sum of the tier's edge
    /// functions, whose error is below 2^-44 of the square.
    #[inline(always)]
    pub(crate) fn behind(&self, rays: &RayN<D>) -> u32 {
        let zero = D::splat(0.0);
        let [height, error, reach] = self.height(&rays.origin);
        let [x, y, z] = self.normal;
        let [dx, dy, dz] = rays.direction;
        let along = x * dx + y * dy + z * dz;
        let farthest = reach + self.sizes[0] + self.sizes[1];
        let least = farthest * farthest * D::splat(SLOPE_SLACK);
        let below = error.lt(height) & along.lt(zero - least);
        let above = height.lt(zero - error) & least.lt(along);
        below | above
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::expansion::Expansion;
    use crate::geometry::sign_of_determinant;
    use crate::geometry::simd::{Portable, Simd, Vector};
    use crate::geometry::{PreparedRay, Ray, Tier, Watertight};
    use glam::DVec3;

    type D = <Portable as Simd>::D;

    /// The sign of H in exact arithmetic.
    fn exact([a, b, c]: &[[f64; 3]; 3], o: DVec3) -> i32 {
        let side = |p: &[f64; 3], q: &[f64; 3]| [0, 1, 2].map(|k| Expansion::difference(p[k], q[k]));
        sign_of_determinant(&[side(a, &o.to_array()), side(b, a), side(c, a)])
    }

    #[test]
    fn a_side_that_is_sure_is_right() {
        let mut state = 7u64;
        let mut unit = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
        };
        let (mut sure, mut unsure, mut behind, mut hits) = (0, 0, 0, 0);
        for i in 0..20_000 {
            let away = [0.0, 3.0, 1e3][i % 3];
            let mut corner = || [away + unit(), away + unit(), away + unit()].map(|x| f64::from(x as f32));
            let corners = [corner(), corner(), corner()];
            let [a, b, c] = corners.map(DVec3::from);
            // In the plane up to f64's rounding, or off it by a few units in the last place of f64 or f32.
            let beside = [0.0, 1e-16, 1e-15, 1e-13, 1e-7][i / 3 % 5] * (away + 1.0) * unit();
            let (v, w) = (unit(), unit());
            let origin = a + v * (b - a) + w * (c - a) + beside * (b - a).cross(c - a).normalize();
            let plane = TrianglePlane::<D>::new(&corners, 1.0);
            let [before, beyond] = plane.sides(origin.to_array().map(D::splat));
            match exact(&corners, origin) {
                sign if before & 1 != 0 => assert!(sign > 0, "{corners:?} {origin:?}"),
                sign if beyond & 1 != 0 => assert!(sign < 0, "{corners:?} {origin:?}"),
                _ => unsure += 1,
            }
            sure += i32::from((before | beyond) & 1 != 0);
            // What is certainly behind is no hit of the tier.
            let direction = DVec3::new(unit(), unit(), unit()).normalize();
            let ray = Ray { origin, direction, t_min: 0.0, t_max: f64::INFINITY };
            let lanes = RayN {
                origin: origin.to_array().map(D::splat),
                direction: direction.to_array().map(D::splat),
                t_min: D::splat(0.0),
                t_max: D::splat(f64::INFINITY),
            };
            let numbers = TrianglePlane::<D>::of_numbers(plane_of(&corners).map(D::splat));
            let tier = [a, b, c].map(DVec3::as_vec3);
            let is_hit = Watertight::hit_triangle(&PreparedRay::new(&ray), &ray, &tier).is_some();
            let is_behind = numbers.behind(&lanes) & 1 != 0;
            assert!(!(is_hit && is_behind), "{corners:?} {ray:?}");
            behind += i32::from(is_behind);
            hits += i32::from(is_hit);
        }
        assert!(sure > 2000 && unsure > 2000, "{sure} sure, {unsure} not");
        assert!(behind > 1000 && hits > 500, "{behind} behind, {hits} hits");
        assert_eq!(D::LANES, 4);
    }
}
