//! [`ProjectedTriangles`]: the triangles of one or two leaves projected to the (u, v) plane of a packet's frustum, and
//! the blocks of rays that their bounds there overlap. The helpers at the end are shared with
//! [`super::edge_functions`].

use std::ops::Index;

use super::frustum::Frustum;
use super::rays::{BLOCKS, OfBlock};
use crate::bvh::wide::layout::WIDTH;
use crate::geometry::lanes::LANES4;
use crate::geometry::simd::{Doubles, Floats, Simd, Vector};
use crate::geometry::{Corner, PACKET, Triangle4};

/// Least and greatest u, least and greatest v of every block of rays.
pub(crate) type BlockBounds = [[[f32; BLOCKS]; 2]; 2];

/// The arithmetic of a projection: [`InF64`] or [`InF32`].
pub(crate) trait Arithmetic<S: Simd>: Sized {
    /// A number for each triangle.
    type V: Vector;
    /// An f32 for each triangle.
    type Array: Index<usize, Output = f32>;
    /// Whether bounds allow for errors.
    const IS_BOUNDED: bool;

    /// A number in all lanes.
    fn splat(x: f64) -> Self::V;
    /// The absolute value.
    fn abs(x: Self::V) -> Self::V;
    /// The coordinates of corner `k` on an axis, of the triangles of two leaves, or as many as there are lanes.
    fn corners<C: Corner>(leaves: [&Triangle4<C>; 2], k: usize, axis: usize) -> Self::V;
    /// Rounded to f32.
    fn to_f32(x: Self::V) -> Self::Array;
    /// `value` in the lanes of a mask, in the others `x` rounded to f32. Without a branch: empty lanes are in the mask.
    fn unless(mask: u32, value: f32, x: Self::V) -> Self::Array;
}

/// f64, with bounds on errors.
pub(crate) struct InF64;

/// f32, without.
pub(crate) struct InF32;

impl<S: Simd> Arithmetic<S> for InF64 {
    type V = S::D;
    type Array = OfBlock<S>;
    const IS_BOUNDED: bool = true;

    #[inline(always)]
    fn splat(x: f64) -> S::D {
        S::D::splat(x)
    }

    #[inline(always)]
    fn abs(x: S::D) -> S::D {
        x.abs()
    }

    #[inline(always)]
    fn corners<C: Corner>(leaves: [&Triangle4<C>; 2], k: usize, axis: usize) -> S::D {
        C::gather::<S::D>(
            #[inline(always)]
            |lane| leaves[lane / LANES4].corners[k][axis][lane % LANES4],
        )
    }

    #[inline(always)]
    fn to_f32(x: S::D) -> OfBlock<S> {
        S::D::to_floats(x, x).array()
    }

    #[inline(always)]
    fn unless(mask: u32, value: f32, x: S::D) -> OfBlock<S> {
        S::F::select(mask, S::F::splat(value), S::D::to_floats(x, x)).array()
    }
}

impl<S: Simd> Arithmetic<S> for InF32 {
    type V = S::F8;
    type Array = [f32; WIDTH];
    const IS_BOUNDED: bool = false;

    #[inline(always)]
    fn splat(x: f64) -> S::F8 {
        S::F8::splat(x as f32)
    }

    #[inline(always)]
    fn abs(x: S::F8) -> S::F8 {
        x.abs()
    }

    #[inline(always)]
    fn corners<C: Corner>([low, high]: [&Triangle4<C>; 2], k: usize, axis: usize) -> S::F8 {
        C::pair::<S>(&low.corners[k][axis], &high.corners[k][axis])
    }

    #[inline(always)]
    fn to_f32(x: S::F8) -> [f32; WIDTH] {
        x.array()
    }

    #[inline(always)]
    fn unless(mask: u32, value: f32, x: S::F8) -> [f32; WIDTH] {
        S::F8::select(mask, S::F8::splat(value), x).array()
    }
}

/// A triangle in each lane, relative to the apex of a frustum: those of one leaf, or of two.
pub(crate) struct ProjectedTriangles<S: Simd, A: Arithmetic<S>> {
    /// Corners relative to the apex, each as coordinates on the axes of u, v and depth.
    pub corners: [[A::V; 3]; 3],
    /// Projected corners, each as (u, v).
    pub points: [[A::V; 2]; 3],
    /// A lower bound of each triangle's depth.
    nearest: A::Array,
    /// Intervals of u and v; infinite if a corner is not beyond the apex.
    bounds: [[A::Array; 2]; 2],
    /// The triangles that overlap the frustum, as bits.
    pub overlapping: u32,
}

impl<S: Simd, A: Arithmetic<S>> ProjectedTriangles<S, A> {
    #[inline(always)]
    pub(crate) fn new<C: Corner>(leaves: [&Triangle4<C>; 2], frustum: &Frustum) -> Self {
        let zero = A::splat(0.0);
        let mut corners = [[zero; 3]; 3];
        let (mut least, mut most) = ([zero; 2], [zero; 2]);
        let (mut nearest, mut farthest) = (zero, zero);
        let mut points = [[zero; 2]; 3];
        let spread = if A::IS_BOUNDED { A::splat(frustum.spread) } else { zero };
        for (k, corner) in corners.iter_mut().enumerate() {
            for (place, coordinate) in corner.iter_mut().enumerate() {
                let axis = frustum.axes[place];
                let (at, apex) = (A::corners(leaves, k, axis), A::splat(frustum.apex[axis]));
                let flipped = place == 2 && frustum.flipped;
                *coordinate = if flipped { apex - at } else { at - apex };
            }
            let (at, relative, absolute) = match frustum.shear {
                None => perspective::<S, A>(corner, spread),
                Some(shear) => parallel::<S, A>(corner, shear, frustum.reach),
            };
            for place in 0..2 {
                let [low, high] = around::<S, A>(at[place], relative, absolute);
                least[place] = if k == 0 { low } else { low.min(least[place]) };
                most[place] = if k == 0 { high } else { high.max(most[place]) };
            }
            points[k] = at;
            nearest = if k == 0 { corner[2] } else { corner[2].min(nearest) };
            farthest = if k == 0 { corner[2] } else { corner[2].max(farthest) };
        }
        // A corner that is not clearly beyond the apex has no projection.
        let clear = if frustum.shear.is_some() { A::V::ALL } else { (spread + spread).lt(nearest) };
        let [[first_u, last_u], [first_v, last_v]] = frustum.intervals;
        let mut across = least[0].le(splat::<S, A>(last_u)) & splat::<S, A>(first_u).le(most[0]);
        across &= least[1].le(splat::<S, A>(last_v)) & splat::<S, A>(first_v).le(most[1]);
        let start = splat::<S, A>(frustum.min_depth) - spread;
        let in_depth = start.le(farthest) & nearest.le(splat::<S, A>(frustum.max_depth));
        let unbounded = !clear & A::V::ALL;
        ProjectedTriangles {
            corners,
            points,
            nearest: A::to_f32(below::<S, A>(nearest)),
            bounds: [
                interval::<S, A>([least[0], most[0]], unbounded),
                interval::<S, A>([least[1], most[1]], unbounded),
            ],
            overlapping: in_depth & (across | unbounded),
        }
    }

    /// The blocks of rays that a triangle's bounds overlap, nearer than `depths` of the blocks, as bits.
    #[inline(always)]
    pub(crate) fn blocks(&self, lane: usize, block_bounds: &BlockBounds, depths: &[f32; BLOCKS]) -> u32 {
        let mut blocks = 0;
        for first in (0..PACKET / S::F::LANES).step_by(S::F::LANES) {
            let mut mask = S::F::splat(self.nearest[lane]).le(S::F::load_slice(&depths[first..]));
            for ([least, most], [low, high]) in block_bounds.iter().zip(&self.bounds) {
                let (least, most) = (S::F::load_slice(&least[first..]), S::F::load_slice(&most[first..]));
                mask &= least.le(S::F::splat(high[lane])) & S::F::splat(low[lane]).le(most);
            }
            blocks |= mask << first;
        }
        blocks
    }
}

/// An f32 in all lanes.
#[inline(always)]
fn splat<S: Simd, A: Arithmetic<S>>(x: f32) -> A::V {
    A::splat(f64::from(x))
}

/// An interval in f32, infinite in the lanes of a mask.
#[inline(always)]
fn interval<S: Simd, A: Arithmetic<S>>([low, high]: [A::V; 2], unbounded: u32) -> [A::Array; 2] {
    [
        A::unless(unbounded, f32::NEG_INFINITY, below::<S, A>(low)),
        A::unless(unbounded, f32::INFINITY, above::<S, A>(high)),
    ]
}

/// Bounds of numbers that are off by a share of themselves and by an absolute error.
#[inline(always)]
fn around<S: Simd, A: Arithmetic<S>>(x: A::V, relative: A::V, absolute: A::V) -> [A::V; 2] {
    let error = A::abs(x) * relative + absolute;
    if A::IS_BOUNDED { [x - error, x + error] } else { [x, x] }
}

/// A corner's (u, v) as seen from the apex, and its relative and absolute error.
#[inline(always)]
fn perspective<S: Simd, A: Arithmetic<S>>(corner: &[A::V; 3], spread: A::V) -> ([A::V; 2], A::V, A::V) {
    let share = A::splat(1.0) / corner[2];
    // For a ray that passes the apex at a distance, the corner is moved by that distance: across, and in depth, which
    // changes a slope by that share of itself, at most twice that at the depths that count.
    let lateral = spread * share;
    let relative = A::splat(SLOPE_SLACK) + (lateral + lateral);
    ([corner[0] * share, corner[1] * share], relative, lateral)
}

/// A corner's (u, v), moved along parallel rays to the plane of depth 0, and its relative and absolute error.
#[inline(always)]
fn parallel<S: Simd, A: Arithmetic<S>>(
    corner: &[A::V; 3],
    shear: [f64; 2],
    reach: f64,
) -> ([A::V; 2], A::V, A::V) {
    let back_u = A::splat(shear[0]) * corner[2];
    let back_v = A::splat(shear[1]) * corner[2];
    let largest = A::abs(corner[0]).max(A::abs(corner[1])).max(A::abs(corner[2]));
    let roundings = (largest + A::splat(reach)) * A::splat(PRODUCT_SLACK);
    ([corner[0] - back_u, corner[1] - back_v], A::splat(SLOPE_SLACK), roundings)
}

/// The relative error of a corner's slope in f64 and a ray's in f32: 8 u with u = 2^-24.
const SLOPE_SLACK: f64 = 4.0 * f32::EPSILON as f64;

/// 32 roundings of f64.
pub(crate) const PRODUCT_SLACK: f64 = 16.0 * f64::EPSILON;

/// A bound on underflow to f32: its least normal number.
pub(crate) const UNDERFLOW: f64 = f32::MIN_POSITIVE as f64;

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

/// Numbers that, rounded to f32, are not above `x`, if errors are bounded: rounding is off by u of `x`, or by underflow.
#[inline(always)]
pub(crate) fn below<S: Simd, A: Arithmetic<S>>(x: A::V) -> A::V {
    if A::IS_BOUNDED { x - rounding::<S, A>(x) } else { x }
}

/// Numbers that, rounded to f32, are not below `x`, if errors are bounded.
#[inline(always)]
pub(crate) fn above<S: Simd, A: Arithmetic<S>>(x: A::V) -> A::V {
    if A::IS_BOUNDED { x + rounding::<S, A>(x) } else { x }
}

#[inline(always)]
fn rounding<S: Simd, A: Arithmetic<S>>(x: A::V) -> A::V {
    A::abs(x) * A::splat(f64::from(f32::EPSILON)) + A::splat(UNDERFLOW)
}
