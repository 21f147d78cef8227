//! The tier `naive`: f32 throughout, not watertight.
//!
//! Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, Journal of Graphics Tools 2(1) 1997, without
//! the threshold on small determinants that it suggests, which depends on scale. Its two barycentrics are
//! rounded independently, so two triangles disagree on their shared edge, and rays pass between them.
//!
//! Box tests are conservative, and a hit's distance is clamped to its primitive's own bounds, so hits do not depend
//! on the acceleration structure. Triangles are not split in this tier ([`Tier::IS_TIGHT`]).

use glam::{Vec3, Vec3A};

use super::bounds::{BoxTest, SingleBoxTest, round_up};
use super::numerics::{PreparedPacket, PreparedRay};
use super::simd::Doubles;
use super::{Corner, Ray, Rays, Tier, TriangleHit};
use crate::geometry::Numerics;

/// f32 geometry, decided in f32.
pub(crate) struct Naive;

/// A ray in f32.
#[derive(Clone, Copy)]
pub(crate) struct FastTest {
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
    pub(super) boxes: SingleBoxTest,
}

impl PreparedRay for FastTest {
    #[inline(always)]
    fn new(ray: &Ray) -> Self {
        FastTest {
            origin: ray.origin.as_vec3(),
            direction: ray.direction.as_vec3(),
            boxes: SingleBoxTest::new(ray),
        }
    }

    #[inline(always)]
    fn prepare_packet<'a, D: Doubles>(rays: Rays, packet: &'a mut PreparedPacket) -> &'a [Self] {
        packet.fast.clear();
        packet.fast.extend(rays.iter().map(|ray| FastTest::new(&ray)));
        &packet.fast
    }
}

impl Tier for Naive {
    const NUMERICS: Numerics = Numerics::Naive;
    const IS_TIGHT: bool = false;
    type Corner = Vec3;
    type Boxes = SingleBoxTest;
    type Prepared = FastTest;

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
        Some(TriangleHit { t, barycentrics: [f64::from(v), f64::from(w)] })
    }
}

/// A distance clamped to the interval in which the ray is inside a primitive's bounds; `None` if there is none, or if
/// the result is not between `t_min` and `t_max`.
#[inline(always)]
pub(super) fn within(test: &SingleBoxTest, ray: &Ray, t: f32, [min, max]: [Vec3A; 2]) -> Option<f64> {
    let [enter, leave] = test.span(min, max, round_up(ray.t_max));
    if enter > leave || t.is_nan() {
        return None;
    }
    let t = f64::from(t.min(leave).max(enter));
    (ray.t_min < t && t < ray.t_max).then_some(t)
}
