//! [`ProjectedSphere`]: a conservative f32 test of a packet's rays against the bounding sphere of an analytic shape.

use glam::DVec3;

use super::frustum::Frustum;
use super::projected_triangles::UNDERFLOW;
use crate::geometry::round_up;
use crate::geometry::simd::{Floats, Simd, Vector};

/// A sphere relative to the apex of a frustum, in f32.
///
/// A ray passes the centre c at the distance |m| / |D|, with the direction D = (u, v, 1) and the moment m = (c - P) x
/// D of any point P of the ray. P is the apex, or for parallel rays the point of depth 0, to which the centre is then
/// moved along the rays; either way m = (e_v, -e_u, e_u D_v - e_v D_u) for an e that is linear in u and v. A ray
/// meets the sphere if |m| is at most the radius times |D|.
///
/// Error of m, with u = 2^-24 and M a bound on |c| (1 + |D_u| + |D_v|) and on the origins of the rays: each component
/// of e is off by at most 9 u M (its terms by 8 u of themselves, their difference by u), so the third component of m
/// by 17 u M (|D_u| + |D_v|), and m by 18 u M (1 + |D_u| + |D_v|). The radius is enlarged by 32 u of that. This
/// includes the error of the tier's test (a few roundings of f64 of the distance to the centre) and that a ray passes
/// the apex by up to `spread` on each axis, which is more than the deviation of rays with a common end. The squares
/// and their sums are off by 20 u of themselves; 64 u are added.
pub(crate) struct ProjectedSphere<S: Simd> {
    /// The centre across, and the factor of u and v: its depth, or 1 for parallel rays.
    across: [S::F; 2],
    depth: S::F,
    /// The common direction of parallel rays.
    shear: Option<[S::F; 2]>,
    /// The square of the enlarged radius.
    radius_squared: S::F,
    /// Whether the test may overflow: then every ray may meet the sphere.
    overflows: bool,
}

/// 32 u.
const RADIUS_SLACK: f64 = 16.0 * f32::EPSILON as f64;

/// 1 + 64 u.
const SQUARE_MARGIN: f64 = 1.0 + 32.0 * f32::EPSILON as f64;

/// Below this, twice the square of a product is finite in f32.
const LARGEST: f64 = 1e18;

impl<S: Simd> ProjectedSphere<S> {
    #[inline(always)]
    pub(crate) fn new((centre, radius): (DVec3, f64), frustum: &Frustum) -> Self {
        let mut relative = [0.0; 3];
        for (place, coordinate) in relative.iter_mut().enumerate() {
            let axis = frustum.axes[place];
            let from_apex = centre[axis] - frustum.apex[axis];
            *coordinate = if place == 2 && frustum.flipped { -from_apex } else { from_apex };
        }
        let [x, y, depth] = relative;
        let (across, factor, steepest) = match frustum.shear {
            None => {
                let [[low_u, high_u], [low_v, high_v]] = frustum.intervals;
                let (u, v) = (low_u.abs().max(high_u.abs()), low_v.abs().max(high_v.abs()));
                ([x, y], depth, f64::from(u) + f64::from(v))
            }
            Some([u, v]) => ([x - u * depth, y - v * depth], 1.0, u.abs() + v.abs()),
        };
        let length = 1.0 + steepest;
        let size = (x.abs() + y.abs() + depth.abs()) * length + frustum.reach;
        let tiny = UNDERFLOW * (1.0 + depth.abs()) * length;
        let radius = radius + 2.0 * frustum.spread + size * length * RADIUS_SLACK + tiny;
        let largest = (size + radius) * length;
        let mut shear = None;
        if let Some([u, v]) = frustum.shear {
            shear = Some([S::F::splat(u as f32), S::F::splat(v as f32)]);
        }
        ProjectedSphere {
            across: [S::F::splat(across[0] as f32), S::F::splat(across[1] as f32)],
            depth: S::F::splat(factor as f32),
            shear,
            radius_squared: S::F::splat(round_up(radius * radius * SQUARE_MARGIN + UNDERFLOW)),
            overflows: largest.is_nan() || largest >= LARGEST,
        }
    }

    /// The rays of a block that may meet the sphere, as bits.
    #[inline(always)]
    pub(crate) fn possible(&self, u: S::F, v: S::F) -> u32 {
        if self.overflows {
            return S::F::ALL;
        }
        let (e_u, e_v) = (self.depth.mul_sub(u, self.across[0]), self.depth.mul_sub(v, self.across[1]));
        let [d_u, d_v] = match self.shear {
            None => [u, v],
            Some(shear) => shear,
        };
        let turn = e_u.mul_sub(d_v, e_v * d_u);
        let square = turn.mul_add(turn, e_u.mul_add(e_u, e_v * e_v));
        let length = d_u.mul_add(d_u, d_v.mul_add(d_v, S::F::splat(1.0)));
        square.le(self.radius_squared * length)
    }
}
