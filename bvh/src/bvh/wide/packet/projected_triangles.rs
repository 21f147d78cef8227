//! [`ProjectedTriangles`]: the triangles of one or two leaves projected to the (u, v) plane of a packet's frustum, and
//! the blocks of rays that their bounds there overlap. The f64 helpers at the end are shared with
//! [`super::edge_functions`].

use super::frustum::Frustum;
use super::rays::{BLOCKS, OfBlock};
use crate::geometry::lanes::LANES4;
use crate::geometry::simd::{Doubles, Floats, Simd, Vector};
use crate::geometry::{Corner, PACKET, Tier, Triangle4};

/// Least and greatest u, least and greatest v of every block of rays.
pub(crate) type BlockBounds = [[[f32; BLOCKS]; 2]; 2];

/// A triangle in each lane of [`Simd::D`], relative to the apex of a frustum: those of one leaf, or of two.
pub(crate) struct ProjectedTriangles<S: Simd> {
    /// Corners relative to the apex, each as coordinates on the axes of u, v and depth.
    pub corners: [[S::D; 3]; 3],
    /// Projected corners, each as (u, v).
    pub points: [[S::D; 2]; 3],
    /// A lower bound of each triangle's depth.
    pub nearest: OfBlock<S>,
    /// Conservative intervals of u and v; infinite if a corner is not beyond the apex.
    bounds: [[OfBlock<S>; 2]; 2],
    /// The triangles that overlap the frustum, as bits.
    pub overlapping: u32,
}

impl<S: Simd> ProjectedTriangles<S> {
    #[inline(always)]
    pub(crate) fn new<'a, T: Tier>(
        leaf: impl Fn(usize) -> &'a Triangle4<T::Corner>,
        frustum: &Frustum,
    ) -> Self {
        let zero = S::D::splat(0.0);
        let mut corners = [[zero; 3]; 3];
        let (mut least, mut most) = ([zero; 2], [zero; 2]);
        let (mut nearest, mut farthest) = (zero, zero);
        let mut points = [[zero; 2]; 3];
        let (spread, depth) = (S::D::splat(frustum.spread), S::D::splat(f64::from(frustum.max_depth)));
        for (k, corner) in corners.iter_mut().enumerate() {
            for (place, coordinate) in corner.iter_mut().enumerate() {
                let axis = frustum.axes[place];
                let at = T::Corner::gather::<S::D>(
                    #[inline(always)]
                    |lane| leaf(lane / LANES4).corners[k][axis][lane % LANES4],
                );
                let apex = S::D::splat(frustum.apex[axis]);
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
        let clear = if frustum.shear.is_some() { S::D::ALL } else { (spread + spread).lt(nearest) };
        let [[first_u, last_u], [first_v, last_v]] = frustum.intervals;
        let mut across = least[0].le(splat::<S>(last_u)) & splat::<S>(first_u).le(most[0]);
        across &= least[1].le(splat::<S>(last_v)) & splat::<S>(first_v).le(most[1]);
        let start = S::D::splat(f64::from(frustum.min_depth)) - spread;
        let in_depth = start.le(farthest) & nearest.le(depth);
        let unbounded = !clear & S::D::ALL;
        let mut bounds = [[S::F::ZEROS; 2]; 2];
        for (place, [low, high]) in bounds.iter_mut().enumerate() {
            *low = unless::<S>(unbounded, f32::NEG_INFINITY, below::<S>(least[place]));
            *high = unless::<S>(unbounded, f32::INFINITY, above::<S>(most[place]));
        }
        ProjectedTriangles {
            corners,
            points,
            nearest: to_f32::<S>(below::<S>(nearest)),
            bounds,
            overlapping: in_depth & (across | unbounded),
        }
    }

    /// The blocks of rays that a triangle's bounds overlap, nearer than `depths` of the blocks, as bits.
    #[inline(always)]
    pub(crate) fn blocks(&self, lane: usize, block_bounds: &BlockBounds, depths: &[f32; BLOCKS]) -> u32 {
        let [u, v] = &self.bounds;
        let bounds = [[u[0][lane], u[1][lane]], [v[0][lane], v[1][lane]]];
        overlapped::<S>(self.nearest[lane], bounds, block_bounds, depths)
    }
}

/// The blocks of rays that intervals of u and v overlap, whose depths are not below `nearest`, as bits.
#[inline(always)]
pub(crate) fn overlapped<S: Simd>(
    nearest: f32,
    bounds: [[f32; 2]; 2],
    block_bounds: &BlockBounds,
    depths: &[f32; BLOCKS],
) -> u32 {
    let mut blocks = 0;
    for first in (0..PACKET / S::F::LANES).step_by(S::F::LANES) {
        let mut mask = S::F::splat(nearest).le(S::F::load_slice(&depths[first..]));
        for ([least, most], [low, high]) in block_bounds.iter().zip(bounds) {
            let (least, most) = (S::F::load_slice(&least[first..]), S::F::load_slice(&most[first..]));
            mask &= least.le(S::F::splat(high)) & S::F::splat(low).le(most);
        }
        blocks |= mask << first;
    }
    blocks
}

/// A corner's (u, v) as seen from the apex, and its error.
#[inline(always)]
fn perspective<S: Simd>(corner: &[S::D; 3], spread: S::D) -> ([S::D; 2], [S::D; 2]) {
    let share = S::D::splat(1.0) / corner[2];
    // For a ray that passes the apex at a distance, the corner is moved by that distance: across, and in depth, which
    // changes a slope by that share of itself, at most twice that at the depths that count.
    let lateral = spread * share;
    let relative = S::D::splat(SLOPE_SLACK) + (lateral + lateral);
    let (u, v) = (corner[0] * share, corner[1] * share);
    let error_u = u.abs() * relative + lateral;
    let error_v = v.abs() * relative + lateral;
    ([u, v], [error_u, error_v])
}

/// A corner's (u, v), moved along parallel rays to the plane of depth 0, and its error.
#[inline(always)]
fn parallel<S: Simd>(corner: &[S::D; 3], shear: [f64; 2], reach: f64) -> ([S::D; 2], [S::D; 2]) {
    let back_u = S::D::splat(shear[0]) * corner[2];
    let back_v = S::D::splat(shear[1]) * corner[2];
    let (u, v) = (corner[0] - back_u, corner[1] - back_v);
    let largest = corner[0].abs().max(corner[1].abs()).max(corner[2].abs());
    let roundings = (largest + S::D::splat(reach)) * S::D::splat(PRODUCT_SLACK);
    let error_u = u.abs() * S::D::splat(SLOPE_SLACK) + roundings;
    let error_v = v.abs() * S::D::splat(SLOPE_SLACK) + roundings;
    ([u, v], [error_u, error_v])
}

/// The relative error of a corner's slope in f64 and a ray's in f32: 8 u with u = 2^-24.
const SLOPE_SLACK: f64 = 4.0 * f32::EPSILON as f64;

/// 32 roundings of f64.
pub(crate) const PRODUCT_SLACK: f64 = 16.0 * f64::EPSILON;

/// A bound on underflow to f32: its least normal number.
pub(crate) const UNDERFLOW: f64 = f32::MIN_POSITIVE as f64;

/// An f32 in all f64 lanes.
#[inline(always)]
fn splat<S: Simd>(x: f32) -> S::D {
    S::D::splat(f64::from(x))
}

/// a b - c d
#[inline(always)]
pub(crate) fn difference_of_products<S: Simd>(a: S::D, b: S::D, c: S::D, d: S::D) -> S::D {
    a * b - c * d
}

/// |x| + |y| + |z|
#[inline(always)]
pub(crate) fn norm1<S: Simd>(v: &[S::D; 3]) -> S::D {
    v[0].abs() + v[1].abs() + v[2].abs()
}

/// Numbers that, rounded to f32, are not above `x`: rounding is off by u of `x`, or by underflow.
#[inline(always)]
pub(crate) fn below<S: Simd>(x: S::D) -> S::D {
    x - rounding::<S>(x)
}

/// Numbers that, rounded to f32, are not below `x`.
#[inline(always)]
pub(crate) fn above<S: Simd>(x: S::D) -> S::D {
    x + rounding::<S>(x)
}

#[inline(always)]
fn rounding<S: Simd>(x: S::D) -> S::D {
    x.abs() * S::D::splat(f64::from(f32::EPSILON)) + S::D::splat(UNDERFLOW)
}

/// `value` in the lanes of a mask, in the others `x` rounded to f32. Without a branch: empty lanes are in the mask.
#[inline(always)]
fn unless<S: Simd>(mask: u32, value: f32, x: S::D) -> OfBlock<S> {
    S::F::select(mask, S::F::splat(value), S::D::to_floats(x, x)).array()
}

/// Rounded to f32, in the first half of the lanes.
#[inline(always)]
pub(crate) fn to_f32<S: Simd>(x: S::D) -> OfBlock<S> {
    S::D::to_floats(x, x).array()
}
