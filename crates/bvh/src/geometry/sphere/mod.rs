//! Analytic spheres and their intersection tests: in f64 for one ray and for four here, in f32 in `fast`, exactly in
//! `exact`.
//!
//! The textbook discriminant `(d.e)^2 - (d.d)(e.e - r^2)` cancels for small or distant spheres. Haines, Günther and
//! Akenine-Möller (Ray Tracing Gems, chapter 7, 2019) use the distance from the centre to the ray's nearest point
//! instead, and compute the root that cancels from the product of both.

mod exact;
mod fast;

use glam::DVec3;

use super::analytic::SHAPE_NUMBERS;
use super::bounds::{BoundsInterval, clamp_to_bounds};
use super::distance::Distance;
use super::lanes::{HitN, RayN, dot};
use super::simd::{Doubles, Floats};
use super::spawn::SurfacePoint;
use super::{Bounds, Precision, Ray, Side};

/// A sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Sphere {
    /// Its centre.
    pub centre: DVec3,
    /// Its radius, positive.
    pub radius: f64,
}

/// The methods are those of [`AnalyticShape`](super::AnalyticShape).
impl Sphere {
    /// Bounds of the sphere in f64, widened by the rounding of the sums.
    #[inline(always)]
    fn bounds_f64(&self) -> [DVec3; 2] {
        let reach = DVec3::splat(self.radius) + f64::EPSILON * (self.centre.abs() + self.radius);
        [self.centre - reach, self.centre + reach]
    }

    pub(super) fn name(&self) -> &'static str {
        "sphere"
    }

    pub(super) fn bounds(&self) -> Bounds {
        let [min, max] = self.bounds_f64();
        Bounds::rounded_out(min, max)
    }

    #[inline(always)]
    pub(super) fn bounding_sphere(&self) -> (DVec3, f64) {
        (self.centre, self.radius)
    }

    /// The radius is stored in f64 in every tier, but a sphere whose radius rounds to 0 is left out.
    pub(super) fn rounded(&self, precision: Precision) -> Option<Self> {
        let centre = self.centre.map(|c| Precision::Double.round(c));
        (precision.round(self.radius) > 0.0).then_some(Sphere { centre, radius: self.radius })
    }

    pub(super) fn recentred(&self, origin: DVec3, scale: f64) -> Self {
        Sphere { centre: (self.centre - origin) * scale, radius: self.radius * scale }
    }

    #[inline(always)]
    pub(super) fn hit_exactly(&self, ray: &Ray) -> Option<f64> {
        exact::hit(ray, self)
    }

    #[inline(always)]
    pub(super) fn hit_in_f32<F: Floats>(
        &self,
        origin: &[F; 3],
        direction: &[F; 3],
        ends: [F; 2],
    ) -> (u32, F) {
        fast::hit_n(self, origin, direction, ends)
    }

    pub(super) fn exact_distance(&self, ray: &Ray) -> Option<Distance> {
        exact::distance(ray, self)
    }

    pub(super) fn crossings(&self, ray: &Ray) -> [Option<(f64, Side)>; 2] {
        exact::crossings(ray, self)
    }

    pub(super) fn exact_crossing(&self, ray: &Ray, side: Side) -> Option<Distance> {
        let [near, far] = exact::roots(ray, self)?;
        Some(if side == Side::Entering { near } else { far })
    }

    #[inline(always)]
    pub(super) fn hit_in_f64(&self, ray: &Ray) -> Option<f64> {
        let (d, f) = (ray.direction, ray.origin - self.centre);
        let a = d.dot(d);
        let b = -f.dot(d);
        let nearest = f + d * (b / a);
        let discriminant = self.radius * self.radius - nearest.dot(nearest);
        if discriminant < 0.0 {
            return None;
        }
        let q = b + (a * discriminant).sqrt().copysign(b);
        let c = f.dot(f) - self.radius * self.radius;
        let (t0, t1) = (c / q, q / a);
        let [min, max] = self.bounds_f64();
        let within = |t: f64| clamp_to_bounds(min, max, ray, t).filter(|&t| ray.t_min < t && t < ray.t_max);
        within(t0.min(t1)).or_else(|| within(t0.max(t1)))
    }

    pub(super) fn is_bounding_sphere(&self) -> bool {
        true
    }

    #[inline(always)]
    pub(super) fn numbers(&self) -> [f64; SHAPE_NUMBERS] {
        let [x, y, z] = self.centre.to_array();
        [x, y, z, self.radius, 0.0, 0.0, 0.0]
    }

    #[inline(always)]
    pub(super) fn surface(&self, point: DVec3) -> (SurfacePoint, DVec3) {
        let normal = (point - self.centre).try_normalize().unwrap_or(DVec3::Y);
        (SurfacePoint::new(self.centre + normal * self.radius, self.centre.abs() + self.radius), normal)
    }

    pub(super) fn area(&self) -> f64 {
        4.0 * std::f64::consts::PI * self.radius * self.radius
    }

    pub(super) fn volume(&self) -> f64 {
        4.0 / 3.0 * std::f64::consts::PI * self.radius.powi(3)
    }

    pub(super) fn is_closed(&self) -> bool {
        true
    }

    pub(super) fn support(&self, _: DVec3) -> (DVec3, f64) {
        (self.centre, self.radius)
    }

    pub(super) fn direction_mut(&mut self) -> Option<&mut DVec3> {
        None
    }

    pub(super) fn normal_derivative(&self, _: DVec3, step: DVec3) -> DVec3 {
        step * (1.0 / self.radius)
    }
}

/// A sphere in each lane.
pub(crate) struct SphereN<D> {
    centre: [D; 3],
    radius: D,
}

/// The methods are those of [`ShapeN`](super::analytic::ShapeN).
impl<D: Doubles> SphereN<D> {
    /// The spheres of the given [`Sphere::numbers`].
    #[inline(always)]
    pub(super) fn new(number: impl Fn(usize) -> D) -> Self {
        SphereN { centre: [number(0), number(1), number(2)], radius: number(3) }
    }

    /// What the rays are decided by is off by less than 2^-49 of the sums of absolute values. A line that meets the
    /// sphere does so within its bounds, which then lie behind the origin, too.
    #[inline(always)]
    pub(super) fn behind(&self, rays: &RayN<D>) -> u32 {
        let mut f = rays.origin;
        for (f, &centre) in f.iter_mut().zip(&self.centre) {
            *f = *f - centre;
        }
        let [squares, square] = [dot(&f, &f), self.radius * self.radius];
        let d = &rays.direction;
        let slack = D::splat(16.0 * f64::EPSILON);
        let sizes = (f[0] * d[0]).abs() + (f[1] * d[1]).abs() + (f[2] * d[2]).abs();
        let outside = ((squares + square) * slack).lt(squares - square);
        outside & (sizes * slack).lt(dot(&f, d))
    }

    /// The hits, by the same operations in the same order as [`Sphere::hit_in_f64`].
    #[inline(always)]
    pub(super) fn hit(&self, rays: &RayN<D>) -> HitN<D> {
        let &SphereN { centre, radius } = self;
        let d = rays.direction;
        let mut f = rays.origin;
        for (f, centre) in f.iter_mut().zip(centre) {
            *f = *f - centre;
        }
        let a = dot(&d, &d);
        // Times -1 instead of subtracted from 0: `hit_in_f64` gets -0 for 0.
        let b = dot(&f, &d) * D::splat(-1.0);
        let share = b / a;
        let mut nearest = f;
        for (nearest, d) in nearest.iter_mut().zip(d) {
            *nearest = *nearest + d * share;
        }
        let square = radius * radius;
        let discriminant = square - dot(&nearest, &nearest);
        let met = !discriminant.lt(D::splat(0.0)) & D::ALL;
        if met == 0 {
            return HitN::NONE;
        }
        let q = b + (a * discriminant).sqrt().copysign(b);
        let c = dot(&f, &f) - square;
        let (t0, t1) = (c / q, q / a);
        // As `Sphere::bounds_f64`.
        let mut reach = centre;
        for reach in &mut reach {
            *reach = radius + D::splat(f64::EPSILON) * (reach.abs() + radius);
        }
        let interval = BoundsInterval::new(&centre, &reach, rays);
        // NaN roots have no order: they are left to it.
        let sure = interval.sure & (t0.le(t1) | t1.le(t0));
        let clamped = [interval.clamp(t0.min(t1)), interval.clamp(t0.max(t1))];
        let mut within = [met & sure & interval.passes; 2];
        for (within, clamped) in within.iter_mut().zip(clamped) {
            *within &= rays.t_min.lt(clamped) & clamped.lt(rays.t_max);
        }
        let [first, second] = within;
        let mut hits = HitN::<D> { hit: first, undecided: met & !sure, t: clamped[0].array(), ..HitN::NONE };
        let far = second & !first;
        if far != 0 {
            hits.hit |= far;
            let from_inside = clamped[1].array();
            for lane in 0..D::LANES {
                if far >> lane & 1 != 0 {
                    hits.t[lane] = from_inside[lane];
                }
            }
        }
        hits
    }
}
