//! The tier `watertight`, the default: corners are f32 numbers, rays f64, and what they meet is decided in f64.
//!
//! Two triangles that share an edge see the same two numbers for its ends and opposite signs for its edge function; a
//! sign is right or zero, and zero counts as inside for both, so no ray passes between them ([`super::woop`]). A hit's
//! distance is held within its primitive's own box, so that no box around it can be pruned before it.

use glam::Vec3;

use super::bounds::DoubleBoxTest;
use super::bundle::{FourHits, Gathered, RAYS, WoopBundle};
use super::simd::Simd;
use super::woop::WoopTest;
use super::{Quad, Ray, Sphere, Tier, TriangleHit};
use crate::scene::Numerics;

/// f32 geometry, decided in f64.
pub struct Watertight;

impl Tier for Watertight {
    const NUMERICS: Numerics = Numerics::Watertight;
    type Corner = Vec3;
    type Boxes = DoubleBoxTest;
    type Prepared = WoopTest;
    const HAS_BUNDLES: bool = true;

    #[inline(always)]
    fn hit_bundle<S: Simd>(bundle: &WoopBundle, corners: &[[f64; 3]; 3], ahead: bool) -> FourHits {
        bundle.hit::<S>(corners, ahead)
    }

    #[inline(always)]
    fn hit_each<S: Simd>(bundle: &WoopBundle, triangles: &[(&Quad<Vec3>, usize); RAYS]) -> FourHits {
        bundle.hit_each::<S, _>(triangles)
    }

    #[inline]
    fn prepare(ray: &Ray) -> WoopTest {
        WoopTest::new(ray)
    }

    #[inline(always)]
    fn hit_triangle(test: &WoopTest, ray: &Ray, corners: &[Vec3; 3]) -> Option<TriangleHit> {
        test.hit(ray, corners)
    }

    #[inline(always)]
    fn hit_quad<S: Simd>(test: &WoopTest, quad: &Quad<Vec3>) -> FourHits {
        test.hit_quad::<S, _>(quad)
    }

    #[inline(always)]
    fn hit_sphere(ray: &Ray, sphere: &Sphere) -> Option<f64> {
        sphere.hit(ray)
    }

    #[inline(always)]
    fn hit_sphere_by_four<S: Simd>(rays: &Gathered<S>, sphere: &Sphere) -> FourHits {
        sphere.hit_by_four(rays)
    }
}
