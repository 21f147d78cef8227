//! The tier `double`: rays, corners and box tests in f64.
//!
//! Tests and guarantees are those of [`watertight`](super::Watertight), without rounding the scene to f32. Boxes are
//! stored in f32, rounded outwards, and tested in f64.

use glam::DVec3;

use super::bounds::DoubleBoxTest;
use super::lanes::HitN;
use super::simd::Doubles;
use super::woop::WoopTest;
use super::{AnalyticShape, Ray, Tier, Triangle4, TriangleHit};
use crate::geometry::Numerics;

/// f64 geometry, decided in f64.
pub(crate) struct Double;

impl Tier for Double {
    const NUMERICS: Numerics = Numerics::Double;
    type Corner = DVec3;
    type Boxes = DoubleBoxTest;
    type Prepared = WoopTest;
    const HAS_RAY_N: bool = true;

    #[inline(always)]
    fn hit_triangle(test: &WoopTest, ray: &Ray, corners: &[DVec3; 3]) -> Option<TriangleHit> {
        test.hit(ray, corners)
    }

    #[inline(always)]
    fn hit_triangle4<D: Doubles>(test: &WoopTest, triangles: &Triangle4<DVec3>) -> HitN<D> {
        test.hit_triangle4(triangles)
    }

    #[inline(always)]
    fn hit_analytic(ray: &Ray, shape: &AnalyticShape) -> Option<f64> {
        shape.hit(ray)
    }
}
