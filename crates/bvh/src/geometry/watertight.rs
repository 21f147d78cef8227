//! The tier `watertight`, the default: f32 corners, f64 rays, hits decided in f64.
//!
//! Two triangles that share an edge compute its edge function from the same two points with opposite signs; a sign is
//! right or zero, and zero counts as inside for both, so no ray passes between them ([`super::woop`]). A hit's
//! distance is clamped to its primitive's own bounds, so no box around it is pruned before it.

use glam::Vec3;

use super::woop::WoopTest;
use super::{Numerics, Ray, Tier, TriangleHit};

/// f32 geometry, decided in f64.
pub(crate) struct Watertight;

impl Tier for Watertight {
    const NUMERICS: Numerics = Numerics::Watertight;
    type Corner = Vec3;
    type Prepared = WoopTest;
    const HAS_RAY_N: bool = true;

    #[inline(always)]
    fn hit_triangle(test: &WoopTest, ray: &Ray, corners: &[Vec3; 3]) -> Option<TriangleHit> {
        test.hit(ray, corners)
    }
}
