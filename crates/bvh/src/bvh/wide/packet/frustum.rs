//! [`Frustum`]: a conservative frustum around the rays of a packet, tested against the boxes of nodes.
//!
//! Depth is measured from the apex along the axis of the largest direction components; a ray is the point (u, v) of
//! its slopes, the change of the other two coordinates per unit of depth. The frustum is the apex with intervals of u
//! and v. A box is outside if over its range of depths it does not overlap these intervals. Only differences and
//! products of f32 numbers are compared, after the bounds of the intervals were moved outwards by more than these
//! round ([`SLACK`]).
//!
//! For parallel rays, (u, v) is the point where a ray crosses the plane of depth 0. A box is outside if, carried
//! along the rays to that plane, it does not overlap the intervals; there a bound on the rounding is added to the
//! sum.
//!
//! Hits of a primitive lie within its bounds (see [`Tier`](crate::geometry::Tier)), so the boxes of a tree are
//! conservative for rays, and for frusta around rays.

use super::MAX_COORDINATE;
use super::rays::{Common, PacketRays};
use crate::bvh::wide::layout::{Node, WIDTH};
use crate::bvh::wide::single::box_ray::LENGTHS;
use crate::geometry::simd::{Doubles, Floats, Simd, Vector};
use crate::geometry::{Rays, round_down, round_up};

/// The relative amount by which bounds of intervals are moved outwards. A slope is off by 5 u (two components, a
/// reciprocal, a product and its rounding to f32), a difference by u, its product with the slope by u more, and the
/// other difference by u: 8 u; and hits are clamped to their bounds up to 2^-26. This is 16 u, with u = 2^-24.
pub(crate) const SLACK: f64 = 8.0 * f32::EPSILON as f64;

/// The largest distance of a ray from the common end, relative to the shortest ray. Wider frusta cull too little.
pub(crate) const MAX_SPREAD: f64 = 1.0 / 65536.0;

/// Whether two rays end so close to each other that a packet with both may have a common end.
#[inline(always)]
fn may_end_together(rays: Rays, [i, j]: [usize; 2]) -> bool {
    let end = |i: usize| rays.origin(i) + rays.t_max(i) * rays.direction(i);
    (end(i) - end(j)).abs().max_element() <= rays.t_max(i).min(rays.t_max(j)) * MAX_SPREAD
}

/// A frustum around rays with a common origin, end (`to_end`) or direction. The apex is the common origin or end.
pub(crate) struct Frustum {
    /// The axes of u, v and depth.
    pub axes: [usize; 3],
    /// Whether depth grows towards negative coordinates.
    pub flipped: bool,
    /// The apex; for parallel rays, the origin of the first.
    pub apex: [f64; 3],
    /// The largest distance on any axis at which a ray passes the apex.
    pub spread: f64,
    /// Least and greatest coordinates of the apex in f32.
    apex_bounds: [[f32; 2]; 3],
    /// The intervals of u and v, moved outwards.
    pub intervals: [[f32; 2]; 2],
    /// For parallel rays, the change of the u and v coordinates per unit of depth.
    pub shear: Option<[f64; 2]>,
    /// For parallel rays, a bound on coordinates of origins relative to the apex, and on how far the shear moves them.
    pub reach: f64,
    /// No ray has hits before this depth.
    pub min_depth: f32,
    /// No ray needs hits beyond this depth.
    pub max_depth: f32,
    /// Hits from this depth on are certainly on the ray's side of the apex: beyond `t_min`, or before `t_max` for a
    /// common end. Infinite if that is unknown.
    pub inner_depth: f32,
}

impl Frustum {
    /// The frustum of rays with a common end (`to_end`) or origin, or of parallel rays, and their projection in
    /// `packet`. `None` if the rays have nothing in common or diverge too far.
    #[inline(always)]
    pub(crate) fn new<S: Simd>(rays: Rays, to_end: bool, packet: &mut PacketRays<S>) -> Option<Self> {
        let last = rays.len().checked_sub(1)?;
        let direction = rays.direction(0);
        if rays.direction(rays.len() / 2) == direction && rays.direction(last) == direction {
            return Self::parallel(rays, packet);
        }
        // Rejects most incoherent packets early.
        if to_end && !may_end_together(rays, [0, rays.len() / 2])
            || !to_end && rays.origin(rays.len() / 2) != rays.origin(0)
        {
            return None;
        }
        let common = packet.fill(rays, to_end);
        let (apex, spread) = if to_end { common.end? } else { (common.origin?, 0.0) };
        let depth = depth_axis(&common)?;
        let axes = [(depth + 1) % 3, (depth + 2) % 3, depth];
        let mut intervals = [[0.0; 2]; 2];
        for (interval, [least, most]) in intervals.iter_mut().zip(packet.project(rays, axes, to_end)) {
            *interval = widened(least.reduce_min(), most.reduce_max());
        }
        if !is_apex_in_range(apex) {
            return None;
        }
        let around = |x: f64| apex_bounds(x, spread);
        let frustum = Frustum {
            axes,
            flipped: (direction[depth] < 0.0) != to_end,
            apex,
            spread,
            apex_bounds: apex.map(around),
            intervals,
            shear: None,
            reach: 0.0,
            min_depth: 0.0,
            max_depth: f32::INFINITY,
            inner_depth: if common.starts_at_0 {
                round_up(2.0 * spread).max(f32::MIN_POSITIVE)
            } else {
                f32::INFINITY
            },
        };
        packet.starts[..packet.blocks].fill(S::F::ZEROS);
        frustum.intervals.as_flattened().iter().all(|slope| slope.is_finite()).then_some(frustum)
    }

    /// The frustum of parallel rays.
    #[inline(always)]
    fn parallel<S: Simd>(rays: Rays, packet: &mut PacketRays<S>) -> Option<Self> {
        let (direction, apex) = (rays.direction(0), rays.origin(0));
        let length = direction.abs();
        let depth = (0..3).fold(0, |best, axis| if length[axis] > length[best] { axis } else { best });
        let axes = [(depth + 1) % 3, (depth + 2) % 3, depth];
        let flipped = direction[depth] < 0.0;
        if !LENGTHS.contains(&length[depth])
            || !is_apex_in_range(apex.to_array())
            || !are_parallel::<S::D>(rays)
        {
            return None;
        }
        let shear = [0, 1].map(|k| direction[axes[k]] / length[depth]);
        packet.blocks = rays.len().div_ceil(S::F::LANES);
        let (intervals, min_depth, reach) =
            packet.project_parallel(rays, apex.to_array(), axes, flipped, shear);
        let frustum = Frustum {
            axes,
            flipped,
            apex: apex.to_array(),
            spread: 0.0,
            apex_bounds: apex.to_array().map(|x| apex_bounds(x, 0.0)),
            intervals: intervals.map(|[least, most]| [round_down(least), round_up(most)]),
            shear: Some(shear),
            reach,
            min_depth: round_down(min_depth),
            max_depth: f32::INFINITY,
            inner_depth: f32::INFINITY,
        };
        packet.projected[2][..packet.blocks].fill(S::F::splat(length[depth] as f32).array());
        frustum.intervals.as_flattened().iter().all(|at| at.is_finite()).then_some(frustum)
    }

    /// The places of `node` whose boxes may be entered by a ray, as bits, and lower bounds of the entry depths.
    #[inline(always)]
    pub(crate) fn enter<S: Simd>(&self, node: &Node) -> (u32, [f32; WIDTH]) {
        let [u, v, depth] = self.axes;
        let apex = self.apex_bounds[depth];
        let [least, greatest] = [S::F8::load(node.planes[depth][0]), S::F8::load(node.planes[depth][1])];
        // Least and greatest depth of each box, for any position of the apex in its bounds.
        let (near, far) = if self.flipped {
            (S::F8::splat(apex[0]) - greatest, S::F8::splat(apex[1]) - least)
        } else {
            (least - S::F8::splat(apex[1]), greatest - S::F8::splat(apex[0]))
        };
        let start = S::F8::splat(self.min_depth);
        let near = near.max(start);
        let mut mask = start.le(far) & near.le(S::F8::splat(self.max_depth));
        if let Some(shear) = self.shear {
            for (k, axis) in [u, v].into_iter().enumerate() {
                let shear = S::F8::splat(shear[k] as f32);
                let (a, b) = (shear * near, shear * far);
                let (low, high) = (a.min(b), a.max(b));
                let least = S::F8::load(node.planes[axis][0]) - S::F8::splat(self.apex_bounds[axis][1]);
                let most = S::F8::load(node.planes[axis][1]) - S::F8::splat(self.apex_bounds[axis][0]);
                // Each term is off by at most 3 u of itself (the shear, depth, product), and their difference by u.
                let size = least.abs().max(most.abs()) + low.abs().max(high.abs());
                let error = (size + S::F8::splat(self.reach as f32)) * S::F8::splat(SLACK as f32);
                let error = error + S::F8::splat(f32::MIN_POSITIVE);
                let [first, last] = self.intervals[k];
                mask &= (least - high - error).le(S::F8::splat(last));
                mask &= S::F8::splat(first).le(most - low + error);
            }
            return (mask, near.array());
        }
        for (k, axis) in [u, v].into_iter().enumerate() {
            let [apex_least, apex_most] = self.apex_bounds[axis];
            let [slope_least, slope_most] = self.intervals[k];
            let (low, high) = (S::F8::splat(slope_least), S::F8::splat(slope_most));
            let above = S::F8::load(node.planes[axis][0]) - S::F8::splat(apex_most);
            let below = S::F8::load(node.planes[axis][1]) - S::F8::splat(apex_least);
            mask &= above.le((high * near).max(high * far));
            mask &= (low * near).min(low * far).le(below);
        }
        (mask, near.array())
    }
}

/// An interval of slopes, moved outwards.
#[inline(always)]
pub(crate) fn widened(least: f32, most: f32) -> [f32; 2] {
    let (a, b) = (f64::from(least), f64::from(most));
    [round_down(a - a.abs() * SLACK), round_up(b + b.abs() * SLACK)]
}

/// Bounds of a coordinate of the apex, moved by 2^-23 of itself for hits outside the bounds of their triangles
/// ([`Bounds::of_triangles`](crate::geometry::Bounds::of_triangles)).
#[inline(always)]
fn apex_bounds(x: f64, spread: f64) -> [f32; 2] {
    let by = spread + x.abs() * f64::from(f32::EPSILON);
    [round_down(x - by), round_up(x + by)]
}

/// Whether depths from the apex are finite: an infinite one times a slope of 0 is NaN, and culls a box.
#[inline(always)]
fn is_apex_in_range(apex: [f64; 3]) -> bool {
    apex.iter().all(|x| x.abs() <= f64::from(MAX_COORDINATE))
}

/// Whether all rays have the same direction.
#[inline(always)]
fn are_parallel<D: Doubles>(rays: Rays) -> bool {
    let direction = rays.direction(0);
    let mut same = D::ALL;
    for first in (0..rays.len()).step_by(D::LANES) {
        for (lanes, of_first) in rays.direction_lanes::<D>(first).into_iter().zip(direction.to_array()) {
            let of_first = D::splat(of_first);
            same &= lanes.le(of_first) & of_first.le(lanes);
        }
    }
    same == D::ALL
}

/// The axis on which the least direction component is largest and all have the same sign; `None` if components are
/// too small or too large for f32 slopes. Such rays are traced one by one, which scales them.
#[inline(always)]
fn depth_axis(common: &Common) -> Option<usize> {
    let shortest = |axis: usize| {
        let [least, most] = common.directions[axis];
        if least > 0.0 || most < 0.0 { least.abs().min(most.abs()) } else { 0.0 }
    };
    let depth = if shortest(0) >= shortest(1) && shortest(0) >= shortest(2) {
        0
    } else if shortest(1) >= shortest(2) {
        1
    } else {
        2
    };
    let longest = common.directions.as_flattened().iter().fold(0.0, |most: f32, x| most.max(x.abs()));
    let fits = LENGTHS.contains(&f64::from(shortest(depth))) && LENGTHS.contains(&f64::from(longest));
    fits.then_some(depth)
}
