//! The tier `fast`: f32 throughout, not watertight.
//!
//! Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, Journal of Graphics Tools 2(1) 1997, without
//! the threshold on small determinants that it suggests, which depends on scale. Its two barycentric coordinates are
//! rounded independently, so two triangles disagree on their shared edge, and rays pass between them.
//!
//! Box tests are conservative, and a hit's distance is clamped to its primitive's own bounds, so hits do not depend
//! on the acceleration structure. Triangles are not split in this tier ([`Tier::IS_TIGHT`]).

use glam::{Vec3, Vec3A};

use super::bounds::{BoxTest, SingleBoxTest, round_up};
use super::{Corner, Ray, Sphere, Tier, TriangleHit};
use crate::geometry::Numerics;

/// f32 geometry, decided in f32.
pub struct Fast;

/// A ray in f32.
#[derive(Clone, Copy)]
pub struct FastTest {
    origin: Vec3,
    direction: Vec3,
    boxes: SingleBoxTest,
}

impl Tier for Fast {
    const NUMERICS: Numerics = Numerics::Fast;
    const IS_TIGHT: bool = false;
    type Corner = Vec3;
    type Boxes = SingleBoxTest;
    type Prepared = FastTest;

    #[inline]
    fn prepare(ray: &Ray) -> FastTest {
        FastTest {
            origin: ray.origin.as_vec3(),
            direction: ray.direction.as_vec3(),
            boxes: SingleBoxTest::new(ray),
        }
    }

    #[inline(always)]
    fn hit_triangle(test: &FastTest, ray: &Ray, &[a, b, c]: &[Vec3; 3]) -> Option<TriangleHit> {
        let (to_b, to_c) = (b - a, c - a);
        let p = test.direction.cross(to_c);
        let share = 1.0 / to_b.dot(p);
        let from_a = test.origin - a;
        let v = from_a.dot(p) * share;
        // NaN fails, too.
        if !(0.0..=1.0).contains(&v) {
            return None;
        }
        let q = from_a.cross(to_b);
        let w = test.direction.dot(q) * share;
        if !(w >= 0.0 && v + w <= 1.0) {
            return None;
        }
        let t = to_c.dot(q) * share;
        let [min, max] = Vec3::span(&[a, b, c]);
        let t = within(&test.boxes, ray, t, [min.as_vec3a(), max.as_vec3a()])?;
        Some(TriangleHit { t, weights: [f64::from(v), f64::from(w)] })
    }

    /// Haines, Günther and Akenine-Möller's form (see [`super::sphere`]) in f32.
    #[inline(always)]
    fn hit_sphere(ray: &Ray, sphere: &Sphere) -> Option<f64> {
        let test = Self::prepare(ray);
        let (d, f) = (test.direction, test.origin - sphere.centre.as_vec3());
        let radius = sphere.radius as f32;
        let a = d.dot(d);
        let b = -f.dot(d);
        let nearest = f + d * (b / a);
        let discriminant = radius * radius - nearest.dot(nearest);
        if discriminant < 0.0 || discriminant.is_nan() {
            return None;
        }
        let q = b + (a * discriminant).sqrt().copysign(b);
        let c = f.dot(f) - radius * radius;
        let (t0, t1) = (c / q, q / a);
        let b = sphere.bounds();
        let within = |t: f32| within(&test.boxes, ray, t, [b.min.into(), b.max.into()]);
        within(t0.min(t1)).or_else(|| within(t0.max(t1)))
    }
}

/// A distance clamped to the interval in which the ray is inside a primitive's bounds; `None` if there is none, or if
/// the result is not between `t_min` and `t_max`.
#[inline(always)]
fn within(test: &SingleBoxTest, ray: &Ray, t: f32, [min, max]: [Vec3A; 2]) -> Option<f64> {
    let [enter, leave] = test.span(min, max, round_up(ray.t_max));
    if enter > leave || t.is_nan() {
        return None;
    }
    let t = f64::from(t.min(leave).max(enter));
    (ray.t_min < t && t < ray.t_max).then_some(t)
}
