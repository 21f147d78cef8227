//! The watertight triangle test (`woop`) of one ray and four triangles, and the rays of a packet prepared for it.

use super::lanes::{HitN, Triangle4};
use super::numerics::{PreparedPacket, PreparedRay};
use super::simd::{Doubles, Simd, Vector};
use super::woop::WoopTest;
use super::woop_n::{PreparedEachN, ShearedN, edges, hit_lanes, may_hit, sheared_corners};
use super::{BATCH, Corner, Ray, Rays};

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

    /// See [`may_hit`].
    #[inline(always)]
    fn may_hit4<C: Corner, S: Simd>(&self, four: &Triangle4<C>) -> u32 {
        may_hit::<S::D4>(&self.relative_corners4(four), &self.shears(), S::D4::splat(self.sign))
    }

    #[inline(always)]
    fn may_hit_two<C: Corner, S: Simd>([a, b]: [&Self; 2], [p, q]: [&Triangle4<C>; 2]) -> u32 {
        let (axes_of_a, axes_of_b) = (a.major.axes(), b.major.axes());
        let both = |x: f64, y: f64| S::halves(x, y);
        let (x, y) = (a.origin, b.origin);
        let origin: [S::D; 3] = [both(x.x, y.x), both(x.y, y.y), both(x.z, y.z)];
        let mut moved = [origin; 3];
        for ((of_a, of_b), moved) in p.corners.iter().zip(&q.corners).zip(&mut moved) {
            for place in 0..3 {
                let corners = C::eight::<S>(&of_a[axes_of_a[place]], &of_b[axes_of_b[place]]);
                moved[place] = corners - origin[place];
            }
        }
        let shear = [both(a.shear[0], b.shear[0]), both(a.shear[1], b.shear[1])];
        may_hit::<S::D>(&moved, &shear, both(a.sign, b.sign))
    }

    /// With the bits of [`WoopTest::hit`]. `EARLY`: see [`hit_lanes`].
    #[inline(always)]
    fn hit_triangle4<C: Corner, S: Simd, const EARLY: bool>(&self, four: &Triangle4<C>) -> HitN<S::D4> {
        let ray = ShearedN {
            shear: self.shears(),
            sign: S::D4::splat(self.sign),
            inverse: splat(self.inverse),
            t_min: S::D4::splat(self.t_min),
            t_max: S::D4::splat(self.t_max),
        };
        hit_lanes::<S::D4, EARLY>(&self.relative_corners4(four), &ray, self.zero_direction_mask, false)
    }
}

impl WoopTest {
    /// The corners of four triangles relative to the ray's origin, axes permuted.
    #[inline(always)]
    fn relative_corners4<C: Corner, D: Doubles>(&self, four: &Triangle4<C>) -> [[D; 3]; 3] {
        let axes = self.major.axes();
        let origin: [D; 3] = splat(self.origin.to_array());
        let mut moved = [origin; 3];
        for (corner, moved) in four.corners.iter().zip(&mut moved) {
            for place in 0..3 {
                moved[place] = C::load::<D>(&corner[axes[place]]) - origin[place];
            }
        }
        moved
    }

    #[inline(always)]
    fn shears<D: Doubles>(&self) -> [D; 2] {
        [D::splat(self.shear[0]), D::splat(self.shear[1])]
    }

    /// The triangles that the exact line of the ray, moved by less than any number or not, may pass through.
    #[inline(always)]
    pub(crate) fn may_cross4<C: Corner, D: Doubles>(&self, four: &Triangle4<C>) -> u32 {
        let corners = self.relative_corners4::<C, D>(four);
        let (mut reach, mut lateral) = (D::splat(0.0), D::splat(0.0));
        let sheared = sheared_corners(&corners, &self.shears());
        for (corner, xy) in corners.iter().zip(&sheared) {
            reach = corner[0].abs().max(corner[1].abs()).max(corner[2].abs()).max(reach);
            lateral = xy[0].abs().max(xy[1].abs()).max(lateral);
        }
        let [(a, _), (b, _), (c, _)] = edges(&sheared);
        let (least, most) = (a.min(b).min(c), a.max(b).max(c));
        // As `weight_error` of the tier `exact`. Coordinates of empty lanes are NaN.
        let rounding = D::splat(4.0 * f64::EPSILON) * reach;
        let error = D::splat(24.0 * f64::EPSILON) * reach * (lateral + rounding);
        a.le(a) & !(least.lt(D::splat(0.0) - error) & error.lt(most)) & D::ALL
    }
}

/// Three numbers, each in all lanes. Without `array::map`, which is not always inlined.
#[inline(always)]
fn splat<D: Doubles>([x, y, z]: [f64; 3]) -> [D; 3] {
    [D::splat(x), D::splat(y), D::splat(z)]
}
