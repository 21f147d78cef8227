//! The tier `double`: rays and corners in f64.
//!
//! Tests and guarantees are those of [`watertight`](super::Watertight), without rounding the scene to f32.

use glam::DVec3;

use super::woop::WoopTest;
use super::{Numerics, Ray, Tier, TriangleHit};

/// f64 geometry, decided in f64.
pub(crate) struct Double;

impl Tier for Double {
    const NUMERICS: Numerics = Numerics::Double;
    type Corner = DVec3;
    type Prepared = WoopTest;
    const HAS_RAY_N: bool = true;

    #[inline(always)]
    fn hit_triangle(test: &WoopTest, ray: &Ray, corners: &[DVec3; 3]) -> Option<TriangleHit> {
        test.hit(ray, corners)
    }
}
