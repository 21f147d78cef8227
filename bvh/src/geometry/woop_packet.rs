//! The rays of a packet prepared for the watertight triangle test (`woop`), a vector at once.

use super::lanes::HitN;
use super::numerics::{PreparedPacket, PreparedRay};
use super::simd::{Doubles, Simd};
use super::woop::WoopTest;
use super::woop_n::PreparedEachN;
use super::{BATCH, Corner, Ray, Rays, Triangle4};

impl PreparedRay for WoopTest {
    #[inline(always)]
    fn new(ray: &Ray) -> Self {
        WoopTest::new(ray)
    }

    #[inline(always)]
    fn prepare_packet<'a, D: Doubles>(rays: Rays, packet: &'a mut PreparedPacket) -> &'a mut [Self] {
        packet.woop.resize(BATCH, WoopTest::default());
        for first in (0..rays.len()).step_by(D::LANES) {
            let each = PreparedEachN::new(&rays.lanes::<D>(first));
            for (lane, test) in packet.woop[first..first + D::LANES].iter_mut().enumerate() {
                *test = each.ray(lane);
            }
        }
        &mut packet.woop
    }

    #[inline(always)]
    fn may_hit4<C: Corner, S: Simd>(&self, four: &Triangle4<C>) -> u32 {
        WoopTest::may_hit4::<C, S::D4>(self, four)
    }

    #[inline(always)]
    fn hit_triangle4<C: Corner, S: Simd, const EARLY: bool>(&self, four: &Triangle4<C>) -> HitN<S::D4> {
        WoopTest::hit_triangle4::<C, S::D4, EARLY>(self, four)
    }
}
