//! [`ProjectedTriangles`]: four triangles projected to the (u, v) plane of a packet's frustum, and the blocks of rays
//! that their bounds there overlap. The f64 helpers at the end are shared with [`super::edge_functions`].

use super::frustum::Frustum;
use super::rays::{BLOCKS, PACKET};
use crate::geometry::lanes::{LANES4, MASK4};
use crate::geometry::simd::{Doubles, Simd, Vector};
use crate::geometry::{Corner, Tier, Triangle4};

/// Least and greatest u, least and greatest v of every block of rays.
pub(crate) type BlockBounds = [[[f32; BLOCKS]; 2]; 2];

/// Four triangles relative to the apex of a frustum.
pub(crate) struct ProjectedTriangles<S: Simd> {
    /// Corners relative to the apex, each as coordinates on the axes of u, v and depth.
    pub corners: [[S::D4; 3]; 3],
    /// Projected corners, each as (u, v).
    pub points: [[S::D4; 2]; 3],
    /// A lower bound of each triangle's depth.
    pub nearest: [f32; LANES4],
    /// Conservative intervals of u and v; infinite if a corner is not beyond the apex.
    bounds: [[[f32; LANES4]; 2]; 2],
    /// The triangles that overlap the frustum, as bits.
    pub overlapping: u32,
}

impl<S: Simd> ProjectedTriangles<S> {
    #[inline(always)]
    pub(crate) fn new<T: Tier>(triangles: &Triangle4<T::Corner>, frustum: &Frustum) -> Self {
        let zero = S::D4::splat(0.0);
        let mut corners = [[zero; 3]; 3];
        let (mut least, mut most) = ([zero; 2], [zero; 2]);
        let (mut nearest, mut farthest) = (zero, zero);
        let mut points = [[zero; 2]; 3];
        let (spread, depth) = (S::D4::splat(frustum.spread), S::D4::splat(f64::from(frustum.max_depth)));
        for (k, corner) in corners.iter_mut().enumerate() {
            for (place, coordinate) in corner.iter_mut().enumerate() {
                let axis = frustum.axes[place];
                let (at, apex) =
                    (T::Corner::load::<S::D4>(&triangles.corners[k][axis]), S::D4::splat(frustum.apex[axis]));
                let flipped = place == 2 && frustum.flipped;
                *coordinate = if flipped { apex - at } else { at - apex };
            }
            let (at, error) = match frustum.shear {
                None => perspective::<S>(corner, spread),
                Some(shear) => parallel::<S>(corner, shear, frustum.reach),
            };
            for place in 0..2 {
                let (low, high) = (at[place] - error[place], at[place] + error[place]);
                least[place] = if k == 0 { low } else { low.min(least[place]) };
                most[place] = if k == 0 { high } else { high.max(most[place]) };
            }
            points[k] = at;
            nearest = if k == 0 { corner[2] } else { corner[2].min(nearest) };
            farthest = if k == 0 { corner[2] } else { corner[2].max(farthest) };
        }
        // A corner that is not clearly beyond the apex has no projection.
        let clear = if frustum.shear.is_some() { MASK4 } else { (spread + spread).lt(nearest) };
        let [[first_u, last_u], [first_v, last_v]] = frustum.intervals;
        let mut across = least[0].le(splat::<S>(last_u)) & splat::<S>(first_u).le(most[0]);
        across &= least[1].le(splat::<S>(last_v)) & splat::<S>(first_v).le(most[1]);
        let start = S::D4::splat(f64::from(frustum.min_depth)) - spread;
        let in_depth = start.le(farthest) & nearest.le(depth);
        let [low_u, low_v] = [to_f32::<S>(below::<S>(least[0])), to_f32::<S>(below::<S>(least[1]))];
        let [high_u, high_v] = [to_f32::<S>(above::<S>(most[0])), to_f32::<S>(above::<S>(most[1]))];
        let mut bounds = [[low_u, high_u], [low_v, high_v]];
        let mut unbounded = !clear & MASK4;
        while unbounded != 0 {
            let lane = unbounded.trailing_zeros() as usize % LANES4;
            unbounded &= unbounded - 1;
            for bounds in &mut bounds {
                (bounds[0][lane], bounds[1][lane]) = (f32::NEG_INFINITY, f32::INFINITY);
            }
        }
        ProjectedTriangles {
            corners,
            points,
            nearest: to_f32::<S>(below::<S>(nearest)),
            bounds,
            overlapping: in_depth & (across | !clear & MASK4),
        }
    }

    /// The blocks of rays that a triangle's bounds overlap, nearer than `depths` of the blocks, as bits.
    #[inline(always)]
    pub(crate) fn blocks(&self, lane: usize, block_bounds: &BlockBounds, depths: &[f32; BLOCKS]) -> u32 {
        let mut blocks = 0;
        for first in (0..PACKET / S::F::LANES).step_by(S::F::LANES) {
            let mut mask = S::F::splat(self.nearest[lane]).le(S::F::load_slice(&depths[first..]));
            for ([least, most], bounds) in block_bounds.iter().zip(&self.bounds) {
                let (low, high) = (S::F::splat(bounds[0][lane]), S::F::splat(bounds[1][lane]));
                let (least, most) = (S::F::load_slice(&least[first..]), S::F::load_slice(&most[first..]));
                mask &= least.le(high) & low.le(most);
            }
            blocks |= mask << first;
        }
        blocks
    }
}

/// A corner's (u, v) as seen from the apex, and its error.
#[inline(always)]
fn perspective<S: Simd>(corner: &[S::D4; 3], spread: S::D4) -> ([S::D4; 2], [S::D4; 2]) {
    let share = S::D4::splat(1.0) / corner[2];
    // For a ray that passes the apex at a distance, the corner is moved by that distance: across, and in depth, which
    // changes a slope by that share of itself, at most twice that at the depths that count.
    let lateral = spread * share;
    let relative = S::D4::splat(SLOPE_SLACK) + (lateral + lateral);
    let (u, v) = (corner[0] * share, corner[1] * share);
    let error_u = u.abs() * relative + lateral;
    let error_v = v.abs() * relative + lateral;
    ([u, v], [error_u, error_v])
}

/// A corner's (u, v), moved along parallel rays to the plane of depth 0, and its error.
#[inline(always)]
fn parallel<S: Simd>(corner: &[S::D4; 3], shear: [f64; 2], reach: f64) -> ([S::D4; 2], [S::D4; 2]) {
    let back_u = S::D4::splat(shear[0]) * corner[2];
    let back_v = S::D4::splat(shear[1]) * corner[2];
    let (u, v) = (corner[0] - back_u, corner[1] - back_v);
    let largest = corner[0].abs().max(corner[1].abs()).max(corner[2].abs());
    let roundings = (largest + S::D4::splat(reach)) * S::D4::splat(PRODUCT_SLACK);
    let error_u = u.abs() * S::D4::splat(SLOPE_SLACK) + roundings;
    let error_v = v.abs() * S::D4::splat(SLOPE_SLACK) + roundings;
    ([u, v], [error_u, error_v])
}

/// The relative error of a corner's slope in f64 and a ray's in f32: 8 u with u = 2^-24.
const SLOPE_SLACK: f64 = 4.0 * f32::EPSILON as f64;

/// 32 roundings of f64.
pub(crate) const PRODUCT_SLACK: f64 = 16.0 * f64::EPSILON;

/// A bound on underflow to f32: its least normal number.
pub(crate) const UNDERFLOW: f64 = f32::MIN_POSITIVE as f64;

/// An f32 in four f64 lanes.
#[inline(always)]
fn splat<S: Simd>(x: f32) -> S::D4 {
    S::D4::splat(f64::from(x))
}

/// a b - c d
#[inline(always)]
pub(crate) fn difference_of_products<S: Simd>(a: S::D4, b: S::D4, c: S::D4, d: S::D4) -> S::D4 {
    a * b - c * d
}

/// |x| + |y| + |z|
#[inline(always)]
pub(crate) fn norm1<S: Simd>(v: &[S::D4; 3]) -> S::D4 {
    v[0].abs() + v[1].abs() + v[2].abs()
}

/// Numbers that, rounded to f32, are not above `x`: rounding is off by u of `x`, or by underflow.
#[inline(always)]
pub(crate) fn below<S: Simd>(x: S::D4) -> S::D4 {
    x - rounding::<S>(x)
}

/// Numbers that, rounded to f32, are not below `x`.
#[inline(always)]
pub(crate) fn above<S: Simd>(x: S::D4) -> S::D4 {
    x + rounding::<S>(x)
}

#[inline(always)]
fn rounding<S: Simd>(x: S::D4) -> S::D4 {
    x.abs() * S::D4::splat(f64::from(f32::EPSILON)) + S::D4::splat(UNDERFLOW)
}

/// Rounded to f32.
#[inline(always)]
pub(crate) fn to_f32<S: Simd>(x: S::D4) -> [f32; LANES4] {
    let [a, b, c, d, ..] = S::D4::to_floats(x, x).array();
    [a, b, c, d]
}
