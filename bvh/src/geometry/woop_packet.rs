//! The rays of a packet prepared for the watertight triangle test (`woop`), a vector at once.

use glam::DVec3;

use super::lanes::HitN;
use super::numerics::{PreparedPacket, PreparedRay};
use super::simd::{Doubles, Simd};
use super::woop::{MajorAxis, WoopTest};
use super::{BATCH, Corner, Ray, Rays, Triangle4};

impl PreparedRay for WoopTest {
    #[inline(always)]
    fn new(ray: &Ray) -> Self {
        WoopTest::new(ray)
    }

    #[inline(always)]
    fn prepare_packet<'a, D: Doubles>(rays: Rays, packet: &'a mut PreparedPacket) -> &'a mut [Self] {
        let nothing = WoopTest::of_parts(MajorAxis::X, [DVec3::ZERO; 2], [0.0; 3], [0.0; 2]);
        packet.woop.resize(BATCH, nothing);
        for first in (0..rays.len()).step_by(D::LANES) {
            prepare_lanes::<D>(rays, first, &mut packet.woop[first..first + D::LANES]);
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

/// Prepares a ray for each lane, from index `first` on; see [`Rays::lanes`].
#[inline(always)]
fn prepare_lanes<D: Doubles>(rays: Rays, first: usize, tests: &mut [WoopTest]) {
    let lanes = rays.lanes::<D>(first);
    let [x, y, z] = lanes.direction;
    let one = D::splat(1.0);
    let inverse = [(one / x).array(), (one / y).array(), (one / z).array()];
    let direction = [x.array(), y.array(), z.array()];
    let [x, y, z] = [x.abs(), y.abs(), z.abs()];
    let [x_first, y_first] = [y.le(x) & z.le(x), z.le(y)];
    let [x, y, z] = lanes.origin;
    let origin = [x.array(), y.array(), z.array()];
    let (t_min, t_max) = (lanes.t_min.array(), lanes.t_max.array());
    for (lane, test) in tests.iter_mut().enumerate() {
        let major = MajorAxis::of_order(x_first >> lane & 1 != 0, y_first >> lane & 1 != 0);
        // By index: a match on the axis would be mispredicted.
        let [u, v, w] = major.axes();
        *test = WoopTest::of_parts(
            major,
            [
                DVec3::new(origin[u][lane], origin[v][lane], origin[w][lane]),
                DVec3::new(direction[u][lane], direction[v][lane], direction[w][lane]),
            ],
            [inverse[u][lane], inverse[v][lane], inverse[w][lane]],
            [t_min[lane], t_max[lane]],
        );
    }
}
