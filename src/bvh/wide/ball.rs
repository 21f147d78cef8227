//! A sphere as a packet sees it: which of the rays can meet it.

use super::frustum::Frustum;
use super::node::WIDTH;
use crate::geometry::simd::Simd;
use crate::geometry::{Sphere, round_up};

/// A sphere seen from an apex, in f32.
///
/// A ray passes its centre c at the distance |m| / |D|, where D = (u, v, 1) is how the ray goes on and m = (c - P) x D for any
/// of its points P. That is the apex, or where rays that run the same way cross the plane of depth 0, to which the centre is then
/// carried; either way m = (e_v, -e_u, e_u D_v - e_v D_u) for an e that is linear in u and v. A ray meets the sphere where |m|
/// is at most the radius times |D|.
///
/// How far m may be off: with u = 2^-24, M a bound on |c| (1 + |D_u| + |D_v|) and on where the rays start, each component of e is off by
/// 9 u M at most (its terms by 8 u of themselves, their difference by u), so the third of m by 17 u M (|D_u| + |D_v|), and m by 18 u M
/// (1 + |D_u| + |D_v|); a radius that is larger by 32 u of that stands here. What the tier may find beyond the radius (a few
/// roundings of f64 of the way to the centre), and that a ray passes the apex on a side by `spread` on each axis, are in it as well:
/// the spread is more than what rays to one end can be off by. The squares and their sums are off by 20 u of themselves, for
/// which 64 u stand.
pub struct Ball<S: Simd> {
    /// Where the centre is across, and what u and v are multiplied by: its depth, or 1.
    across: [S::F8; 2],
    along: S::F8,
    /// How the rays go on, where all go on alike.
    shear: Option<[S::F8; 2]>,
    /// The square of the radius, and more.
    reach: S::F8,
    /// Where f32 cannot hold what it takes: every ray may meet it.
    is_beyond: bool,
}

/// 32 u.
const RADIUS_SLACK: f64 = 16.0 * f32::EPSILON as f64;

/// 1 + 64 u.
const SQUARE_MARGIN: f64 = 1.0 + 32.0 * f32::EPSILON as f64;

/// The least normal number of f32: what smaller ones may be off by, and more.
const UNDERFLOW: f64 = f32::MIN_POSITIVE as f64;

/// Twice the squares of products of what is less are finite in f32.
const LARGEST: f64 = 1e18;

impl<S: Simd> Ball<S> {
    #[inline(always)]
    pub fn new(sphere: &Sphere, frustum: &Frustum) -> Self {
        let mut centre = [0.0; 3];
        for (place, side) in centre.iter_mut().enumerate() {
            let axis = frustum.axes[place];
            let side_of = sphere.centre[axis] - frustum.apex[axis];
            *side = if place == 2 && frustum.downwards { -side_of } else { side_of };
        }
        let [x, y, depth] = centre;
        let (across, along, steepest) = match frustum.shear {
            None => {
                let [[low_u, high_u], [low_v, high_v]] = frustum.slopes;
                let (u, v) = (low_u.abs().max(high_u.abs()), low_v.abs().max(high_v.abs()));
                ([x, y], depth, f64::from(u) + f64::from(v))
            }
            Some([u, v]) => ([x - u * depth, y - v * depth], 1.0, u.abs() + v.abs()),
        };
        let aside = 1.0 + steepest;
        let size = (x.abs() + y.abs() + depth.abs()) * aside + frustum.size;
        let tiny = UNDERFLOW * (1.0 + depth.abs()) * aside;
        let radius = sphere.radius + 2.0 * frustum.spread + size * aside * RADIUS_SLACK + tiny;
        let largest = (size + radius) * aside;
        let mut shear = None;
        if let Some([u, v]) = frustum.shear {
            shear = Some([S::f8_splat(u as f32), S::f8_splat(v as f32)]);
        }
        Ball {
            across: [S::f8_splat(across[0] as f32), S::f8_splat(across[1] as f32)],
            along: S::f8_splat(along as f32),
            shear,
            reach: S::f8_splat(round_up(radius * radius * SQUARE_MARGIN + UNDERFLOW)),
            is_beyond: largest.is_nan() || largest >= LARGEST,
        }
    }

    /// The rays of a block that may meet it, as bits.
    #[inline(always)]
    pub fn meets(&self, u: [f32; WIDTH], v: [f32; WIDTH]) -> u32 {
        if self.is_beyond {
            return u32::MAX >> (u32::BITS as usize - WIDTH);
        }
        let (u, v) = (S::f8(u), S::f8(v));
        let (e_u, e_v) =
            (S::mul_sub(self.along, u, self.across[0]), S::mul_sub(self.along, v, self.across[1]));
        let [d_u, d_v] = match self.shear {
            None => [u, v],
            Some(shear) => shear,
        };
        let turn = S::mul_sub(e_u, d_v, S::f8_mul(e_v, d_u));
        let square = S::mul_add(turn, turn, S::mul_add(e_u, e_u, S::f8_mul(e_v, e_v)));
        let length = S::mul_add(d_u, d_u, S::mul_add(d_v, d_v, S::f8_splat(1.0)));
        S::f8_le(square, S::f8_mul(self.reach, length))
    }
}
