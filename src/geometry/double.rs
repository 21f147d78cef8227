//! The tier `double`: rays, corners and box tests in f64, from the numbers of the files on.
//!
//! The tests are those of `watertight`, and hold the same guarantees for the same reasons; what f32 did to the scene and
//! to the rays is gone. Boxes are kept in f32, rounded outwards, and tested in f64.

use glam::DVec3;

use super::bounds::DoubleBoxTest;
use super::bundle::{FourHits, Gathered, RAYS, WoopBundle};
use super::simd::Simd;
use super::woop::WoopTest;
use super::{Quad, Ray, Sphere, Tier, TriangleHit};
use crate::scene::Numerics;

/// f64 geometry, decided in f64.
pub struct Double;

impl Tier for Double {
    const NUMERICS: Numerics = Numerics::Double;
    type Corner = DVec3;
    type Boxes = DoubleBoxTest;
    type Prepared = WoopTest;
    const HAS_BUNDLES: bool = true;

    #[inline(always)]
    fn hit_bundle<S: Simd>(bundle: &WoopBundle, corners: &[[f64; 3]; 3], ahead: bool) -> FourHits {
        bundle.hit::<S>(corners, ahead)
    }

    #[inline(always)]
    fn hit_each<S: Simd>(bundle: &WoopBundle, triangles: &[(&Quad<DVec3>, usize); RAYS]) -> FourHits {
        bundle.hit_each::<S, _>(triangles)
    }

    #[inline]
    fn prepare(ray: &Ray) -> WoopTest {
        WoopTest::new(ray)
    }

    #[inline(always)]
    fn hit_triangle(test: &WoopTest, ray: &Ray, corners: &[DVec3; 3]) -> Option<TriangleHit> {
        test.hit(ray, corners)
    }

    #[inline(always)]
    fn hit_quad<S: Simd>(test: &WoopTest, quad: &Quad<DVec3>) -> FourHits {
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
