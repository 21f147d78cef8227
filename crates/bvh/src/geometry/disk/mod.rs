//! Analytic disks and their intersection tests: in f64 for one ray and for one in each lane here, in f32 in `fast`,
//! exactly in `exact`.
//!
//! The ray's line meets the plane at `t = -(n . f) / (n . d)`, with f from the centre to the origin, and the disk if
//! `m = f + t d` is not longer than the radius.
//!
//! # Errors (`watertight`, `double`)
//! Let u = 2^-53, and |f| and |m| the largest coordinates. `n . f` is off by less than 4u of the sum of its terms'
//! absolute values, `n . d` by 3u, so t by less than 12u of their part that is not cancelled: where the ray is nearly
//! parallel to the plane, t may be off by any amount. But m is the point of the line at the t that was computed, and
//! its height over the plane, `n . f + t n . d`, is the rounding of both products: less than 16u (|f| + |t d|). So a
//! ray hits if a point of it that is so near to the plane lies within the radius, up to 4u (|f| + |t d|). The distance
//! is then clamped to the interval in which the ray is inside the disk's bounds; on a disk with the normal of an axis
//! it is that of the plane, to 2 ulp. Rays parallel to the plane miss, as computed.

mod exact;

use glam::{DVec3, Vec3Swizzles};

use super::analytic::SHAPE_NUMBERS;
use super::bounds::{BoundsInterval, clamp_to_bounds};
use super::distance::Distance;
use super::fast;
use super::lanes::{HitN, RayN, dot};
use super::simd::{Doubles, Floats};
use super::spawn::SurfacePoint;
use super::{Bounds, Precision, Ray, Side};

/// A disk, flat and seen from both sides.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Disk {
    /// Its centre.
    pub centre: DVec3,
    /// The normal of its front, of length 1.
    pub normal: DVec3,
    /// Its radius, positive.
    pub radius: f64,
}

/// The methods are those of [`AnalyticShape`](super::AnalyticShape).
impl Disk {
    /// Half the size of its bounds: the radius times the sine of the angle between axis and normal, and the rounding of
    /// this and of the bounds. 0 along an axis that is the normal.
    #[inline(always)]
    fn half_size(&self) -> DVec3 {
        let squares = self.normal * self.normal;
        let sum = self.normal.dot(self.normal);
        let sines = ((squares.yzx() + squares.zxy()) / sum).map(f64::sqrt);
        let slack = f64::EPSILON * (self.centre.abs() + 2.0 * self.radius);
        self.radius * sines + DVec3::select(sines.cmpgt(DVec3::ZERO), slack, DVec3::ZERO)
    }

    pub(super) fn name(&self) -> &'static str {
        "disk"
    }

    pub(super) fn bounds(&self) -> Bounds {
        let half = self.half_size();
        Bounds::rounded_out(self.centre - half, self.centre + half)
    }

    #[inline(always)]
    pub(super) fn bounding_sphere(&self) -> (DVec3, f64) {
        (self.centre, self.radius)
    }

    pub(super) fn is_bounding_sphere(&self) -> bool {
        false
    }

    pub(super) fn is_closed(&self) -> bool {
        false
    }

    /// The point of the rim farthest out, or the centre if all are.
    pub(super) fn support(&self, out: DVec3) -> (DVec3, f64) {
        let along = out - self.normal * self.normal.dot(out);
        (self.centre + along.try_normalize().unwrap_or(DVec3::ZERO) * self.radius, 0.0)
    }

    pub(super) fn direction_mut(&mut self) -> Option<&mut DVec3> {
        Some(&mut self.normal)
    }

    /// The radius is stored in f64 in every tier, but a disk whose radius rounds to 0 is left out.
    pub(super) fn rounded(&self, precision: Precision) -> Option<Self> {
        let [centre, normal] = [self.centre, self.normal].map(|v| v.map(|x| Precision::Double.round(x)));
        (precision.round(self.radius) > 0.0).then_some(Disk { centre, normal, radius: self.radius })
    }

    pub(super) fn recentred(&self, origin: DVec3, scale: f64) -> Self {
        Disk { centre: (self.centre - origin) * scale, radius: self.radius * scale, ..*self }
    }

    #[inline(always)]
    pub(super) fn hit_in_f64(&self, ray: &Ray) -> Option<f64> {
        let (d, f) = (ray.direction, ray.origin - self.centre);
        let t = -(self.normal.dot(f) / self.normal.dot(d));
        let from_centre = f + d * t;
        // NaN and infinite distances, of rays parallel to the plane, give NaN or more than the radius.
        let is_inside = from_centre.dot(from_centre) <= self.radius * self.radius;
        if !is_inside {
            return None;
        }
        let half = self.half_size();
        clamp_to_bounds(self.centre - half, self.centre + half, ray, t)
            .filter(|&t| ray.t_min < t && t < ray.t_max)
    }

    #[inline(always)]
    pub(super) fn hit_exactly(&self, ray: &Ray) -> Option<f64> {
        exact::hit(ray, self)
    }

    /// By the same operations in f32, without clamping.
    #[inline(always)]
    pub(super) fn hit_in_f32<F: Floats>(&self, origin: &[F; 3], d: &[F; 3], ends: [F; 2]) -> (u32, F) {
        let [x, y, z] = self.centre.as_vec3().to_array().map(F::splat);
        let normal = self.normal.as_vec3().to_array().map(F::splat);
        let f = fast::minus(origin, &[x, y, z]);
        let zero = F::splat(0.0);
        let t = (zero - fast::dot(&normal, &f)) / fast::dot(&normal, d);
        let from_centre = [d[0].mul_add(t, f[0]), d[1].mul_add(t, f[1]), d[2].mul_add(t, f[2])];
        let radius = F::splat(self.radius as f32);
        let met = fast::dot(&from_centre, &from_centre).le(radius * radius);
        (met & ends[0].lt(t) & t.lt(ends[1]), t)
    }

    pub(super) fn crossings(&self, ray: &Ray) -> [Option<(f64, Side)>; 2] {
        [exact::crossing(ray, self), None]
    }

    pub(super) fn exact_crossing(&self, ray: &Ray, _: Side) -> Option<Distance> {
        exact::to_plane(ray, self)
    }

    pub(super) fn exact_distance(&self, ray: &Ray) -> Option<Distance> {
        exact::distance(ray, self)
    }

    #[inline(always)]
    pub(super) fn numbers(&self) -> [f64; SHAPE_NUMBERS] {
        let ([x, y, z], [nx, ny, nz]) = (self.centre.to_array(), self.normal.to_array());
        [x, y, z, self.radius, nx, ny, nz]
    }

    #[inline(always)]
    pub(super) fn surface(&self, point: DVec3) -> (SurfacePoint, DVec3) {
        let from_centre = point - self.centre;
        let in_plane = from_centre - self.normal * self.normal.dot(from_centre);
        // At most 1; `min` takes the other number instead of a NaN.
        let share = (self.radius / in_plane.length()).min(1.0);
        (SurfacePoint::new(self.centre + in_plane * share, self.centre.abs() + self.radius), self.normal)
    }

    pub(super) fn normal_derivative(&self, _: DVec3, _: DVec3) -> DVec3 {
        DVec3::ZERO
    }

    pub(super) fn area(&self) -> f64 {
        std::f64::consts::PI * self.radius * self.radius
    }

    pub(super) fn volume(&self) -> f64 {
        0.0
    }
}

/// A disk in each lane.
pub(crate) struct DiskN<D> {
    centre: [D; 3],
    radius: D,
    normal: [D; 3],
}

/// The methods are those of [`ShapeN`](super::ShapeN).
impl<D: Doubles> DiskN<D> {
    /// The disks of the given [`Disk::numbers`].
    #[inline(always)]
    pub(super) fn new(number: impl Fn(usize) -> D) -> Self {
        DiskN {
            centre: [number(0), number(1), number(2)],
            radius: number(3),
            normal: [number(4), number(5), number(6)],
        }
    }

    /// The heights of the origins over the planes and of the directions, with the sums of absolute values that they are
    /// off by less than 2^-50 of, and the vectors from the centres.
    #[inline(always)]
    fn heights(&self, rays: &RayN<D>) -> ([[D; 2]; 2], [D; 3]) {
        let mut f = rays.origin;
        for (f, &centre) in f.iter_mut().zip(&self.centre) {
            *f = *f - centre;
        }
        let (n, d) = (&self.normal, &rays.direction);
        let size = |v: &[D; 3]| (n[0] * v[0]).abs() + (n[1] * v[1]).abs() + (n[2] * v[2]).abs();
        ([[dot(n, &f), size(&f)], [dot(n, d), size(d)]], f)
    }

    #[inline(always)]
    pub(super) fn behind(&self, rays: &RayN<D>) -> u32 {
        let (zero, slack) = (D::splat(0.0), D::splat(16.0 * f64::EPSILON));
        let ([[height, size], [along, of_along]], _) = self.heights(rays);
        let sure = (size * slack).lt(height.abs()) & (of_along * slack).lt(along.abs());
        sure & zero.lt(height * along)
    }

    /// The hits, by the same operations in the same order as [`Disk::hit_in_f64`].
    #[inline(always)]
    pub(super) fn hit(&self, rays: &RayN<D>) -> HitN<D> {
        let ([[height, _], [along, _]], f) = self.heights(rays);
        let t = height / along * D::splat(-1.0);
        let mut from_centre = f;
        for (from_centre, &d) in from_centre.iter_mut().zip(&rays.direction) {
            *from_centre = *from_centre + d * t;
        }
        let met = dot(&from_centre, &from_centre).le(self.radius * self.radius);
        if met == 0 {
            return HitN::NONE;
        }
        // As `Disk::half_size`.
        let sum = dot(&self.normal, &self.normal);
        let mut half = self.normal;
        for (axis, half) in half.iter_mut().enumerate() {
            let [a, b] = [self.normal[(axis + 1) % 3], self.normal[(axis + 2) % 3]];
            let sine = ((a * a + b * b) / sum).sqrt();
            let slack = D::splat(f64::EPSILON) * (self.centre[axis].abs() + D::splat(2.0) * self.radius);
            let zero = D::splat(0.0);
            *half = self.radius * sine + D::select(zero.lt(sine), slack, zero);
        }
        let interval = BoundsInterval::new(&self.centre, &half, rays);
        let t = interval.clamp(t);
        let within = interval.passes & rays.t_min.lt(t) & t.lt(rays.t_max);
        let undecided = met & !interval.sure;
        HitN { hit: met & interval.sure & within, undecided, t: t.array(), ..HitN::NONE }
    }
}

#[cfg(test)]
mod tests;
