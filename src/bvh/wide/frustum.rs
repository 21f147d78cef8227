//! What a packet of rays that come from one place, or go to one, or run the same way, has in common: a frustum around all of
//! them.
//!
//! Seen from the apex along the axis that the rays run along most, a ray is a point (u, v): how far it goes aside on the
//! two other axes for each step along this one. The frustum holds the apex and the intervals of u and v. A box is outside
//! when, over all depths that it spans, it lies aside of what the intervals reach; only differences and products of
//! f32 numbers are compared, after the ends of the intervals were moved outwards by more than what these round
//! ([`SLACK`]). Rays that run the same way are points where they cross the plane of depth 0; a box is outside when, carried along
//! them to that plane, it lies aside. There the sum is moved by what its terms may be off by. That the hits of a primitive are
//! within its own box (as [`Tier`](crate::geometry::Tier) says) makes the boxes of a tree conservative for rays, and so for
//! frusta.

use crate::geometry::simd::Simd;
use crate::geometry::{Ray, round_down, round_up};

use super::lanes::Lanes;
use super::node::{LENGTHS, Node, WIDTH};

/// The share by which the ends of intervals are moved outwards. A slope is off by 5 u (two components, a reciprocal, a
/// product and its rounding to f32), a difference by u, its product with the slope by u more, and the other difference by
/// u: 8 u, and the margin within which hits are held to their boxes is 2^-26. This is 16 u.
pub const SLACK: f64 = 8.0 * f32::EPSILON as f64;

/// How far the ends of rays that go to one place may lie from their middle, as a share of the shortest way there. Beyond
/// that a frustum is too wide to be of use.
pub const MOST_SPREAD: f64 = 1.0 / 65536.0;

/// A frustum around rays.
pub struct Frustum {
    /// The axes of u and v, and the one of depth.
    pub axes: [usize; 3],
    /// Whether depth grows downwards along its axis.
    pub downwards: bool,
    /// The middle of the apex.
    pub apex: [f64; 3],
    /// How far any ray may pass beside that, on each axis.
    pub spread: f64,
    /// Least and greatest coordinates of the apex, for boxes.
    bounds: [[f32; 2]; 3],
    /// Intervals of u and of v, moved outwards.
    pub slopes: [[f32; 2]; 2],
    /// For rays that run the same way: how far they go aside for each step in depth.
    pub shear: Option<[f64; 2]>,
    /// How far from the apex any ray starts, on each axis, and as far as that moves it aside.
    pub size: f64,
    /// Nothing before this depth counts.
    pub start: f32,
    /// Nothing beyond this depth counts.
    pub depth: f32,
    /// What a ray meets from this depth on, it meets within its ends, as far as the near one is concerned; infinite where that is not
    /// known.
    pub floor: f32,
}

impl Frustum {
    /// Around rays that start at one place (`to_end` false) or end at one, or run the same way. `None` where the rays have
    /// nothing of that in common or run in too different directions.
    #[inline(always)]
    pub fn new<S: Simd>(rays: &[Ray], to_end: bool, lanes: &mut Lanes) -> Option<Self> {
        let first = rays.first()?;
        if rays[rays.len() / 2].direction == first.direction
            && rays[rays.len() - 1].direction == first.direction
        {
            return Self::parallel(rays, lanes);
        }
        // Packets that are none are found out early, as most are where rays scatter.
        if !to_end && rays[rays.len() / 2].origin != first.origin {
            return None;
        }
        let common = lanes.fill::<S>(rays, to_end);
        let (apex, spread) = if to_end { common.end? } else { (common.start?, 0.0) };
        let intervals = common.directions;
        // The axis along which the ray that runs least along it runs most; all the same way.
        let along = |axis: usize| {
            let [least, most] = intervals[axis];
            if least > 0.0 || most < 0.0 { least.abs().min(most.abs()) } else { 0.0 }
        };
        let depth = if along(0) >= along(1) && along(0) >= along(2) {
            0
        } else if along(1) >= along(2) {
            1
        } else {
            2
        };
        // Rays of other lengths than about 1 go one by one, where those are seen to.
        let longest = intervals.as_flattened().iter().fold(0.0, |most: f32, x| most.max(x.abs()));
        if !(LENGTHS.contains(&f64::from(along(depth))) && LENGTHS.contains(&f64::from(longest))) {
            return None;
        }
        let axes = [(depth + 1) % 3, (depth + 2) % 3, depth];
        let downwards = (first.direction[depth] < 0.0) != to_end;
        lanes.directions.rotate_left(axes[0]);
        let sign = S::f8_splat(if to_end { -1.0 } else { 1.0 });
        let one = S::f8_splat(1.0);
        let mut slopes = [[S::f8_splat(f32::INFINITY), S::f8_splat(f32::NEG_INFINITY)]; 2];
        for block in 0..lanes.blocks {
            let along = S::f8(lanes.directions[2][block]);
            let along = S::f8_max(along, S::f8_sub(S::f8_splat(0.0), along));
            let share = S::f8_mul(sign, S::f8_div(one, along));
            lanes.directions[2][block] = S::f8_array(along);
            for (k, [least, most]) in slopes.iter_mut().enumerate() {
                let slope = S::f8_mul(S::f8(lanes.directions[k][block]), share);
                lanes.directions[k][block] = S::f8_array(slope);
                (*least, *most) = (S::f8_min(slope, *least), S::f8_max(slope, *most));
            }
        }
        let mut intervals = [[0.0; 2]; 2];
        for (interval, [least, most]) in intervals.iter_mut().zip(slopes) {
            let (a, b) = (f64::from(S::f8_least(least)), f64::from(S::f8_most(most)));
            *interval = [round_down(a - a.abs() * SLACK), round_up(b + b.abs() * SLACK)];
        }
        let around = |x: f64| [round_down(x - spread), round_up(x + spread)];
        let frustum = Frustum {
            axes,
            downwards,
            apex,
            spread,
            bounds: apex.map(around),
            slopes: intervals,
            shear: None,
            size: 0.0,
            start: 0.0,
            depth: f32::INFINITY,
            floor: if common.counts_from_0 {
                round_up(2.0 * spread).max(f32::MIN_POSITIVE)
            } else {
                f32::INFINITY
            },
        };
        lanes.starts[..lanes.blocks].fill([0.0; WIDTH]);
        // Slopes that f32 cannot hold are of no use.
        frustum.slopes.as_flattened().iter().all(|slope| slope.is_finite()).then_some(frustum)
    }

    /// Around rays that run the same way.
    fn parallel(rays: &[Ray], lanes: &mut Lanes) -> Option<Self> {
        let (direction, apex) = (rays[0].direction, rays[0].origin);
        let length = direction.abs();
        let depth = (0..3).fold(0, |best, axis| if length[axis] > length[best] { axis } else { best });
        let axes = [(depth + 1) % 3, (depth + 2) % 3, depth];
        let downwards = direction[depth] < 0.0;
        if !LENGTHS.contains(&length[depth]) || rays.iter().any(|ray| ray.direction != direction) {
            return None;
        }
        let shear = [0, 1].map(|k| direction[axes[k]] / length[depth]);
        lanes.blocks = rays.len().div_ceil(WIDTH);
        let mut frustum = Frustum {
            axes,
            downwards,
            apex: apex.to_array(),
            spread: 0.0,
            bounds: apex.to_array().map(|x| [round_down(x), round_up(x)]),
            slopes: [[f32::INFINITY, f32::NEG_INFINITY]; 2],
            shear: Some(shear),
            size: 0.0,
            start: f32::INFINITY,
            depth: f32::INFINITY,
            floor: f32::INFINITY,
        };
        for i in 0..lanes.blocks * WIDTH {
            let (block, lane) = (i / WIDTH, i % WIDTH);
            let from_apex = rays[i.min(rays.len() - 1)].origin - apex;
            let start = if downwards { -from_apex[depth] } else { from_apex[depth] };
            for (k, interval) in frustum.slopes.iter_mut().enumerate() {
                let (aside, back) = (from_apex[axes[k]], shear[k] * start);
                let at = aside - back;
                let off = (aside.abs() + back.abs()) * SLACK;
                lanes.directions[k][block][lane] = at as f32;
                *interval = [interval[0].min(round_down(at - off)), interval[1].max(round_up(at + off))];
                frustum.size = frustum.size.max(aside.abs() + back.abs());
            }
            lanes.directions[2][block][lane] = length[depth] as f32;
            lanes.ends[block][lane] = rays[i.min(rays.len() - 1)].t_max as f32;
            lanes.starts[block][lane] = round_up(start + start.abs() * SLACK);
            frustum.start = frustum.start.min(round_down(start - start.abs() * SLACK));
            frustum.size = frustum.size.max(start.abs());
        }
        frustum.slopes.as_flattened().iter().all(|at| at.is_finite()).then_some(frustum)
    }

    /// The places of `node` whose boxes any of the rays may enter, as bits, and the depths from which.
    #[inline(always)]
    pub fn enter<S: Simd>(&self, node: &Node) -> (u32, [f32; WIDTH]) {
        let [u, v, depth] = self.axes;
        let side = self.bounds[depth];
        let [least, greatest] = [S::f8(node.planes[depth][0]), S::f8(node.planes[depth][1])];
        // The nearest and the farthest depth of each box, from wherever the apex may be.
        let (near, far) = if self.downwards {
            (S::f8_sub(S::f8_splat(side[0]), greatest), S::f8_sub(S::f8_splat(side[1]), least))
        } else {
            (S::f8_sub(least, S::f8_splat(side[1])), S::f8_sub(greatest, S::f8_splat(side[0])))
        };
        let start = S::f8_splat(self.start);
        let near = S::f8_max(near, start);
        let mut mask = S::f8_le(start, far) & S::f8_le(near, S::f8_splat(self.depth));
        if let Some(shear) = self.shear {
            for (k, axis) in [u, v].into_iter().enumerate() {
                let shear = S::f8_splat(shear[k] as f32);
                let (a, b) = (S::f8_mul(shear, near), S::f8_mul(shear, far));
                let (low, high) = (S::f8_min(a, b), S::f8_max(a, b));
                let least = S::f8_sub(S::f8(node.planes[axis][0]), S::f8_splat(self.bounds[axis][1]));
                let most = S::f8_sub(S::f8(node.planes[axis][1]), S::f8_splat(self.bounds[axis][0]));
                // Each term is off by 3 u of itself at most (the shear, depth, product), and their difference by u.
                let size = S::f8_add(size_of::<S>(least, most), size_of::<S>(low, high));
                let off =
                    S::f8_mul(S::f8_add(size, S::f8_splat(self.size as f32)), S::f8_splat(SLACK as f32));
                let off = S::f8_add(off, S::f8_splat(f32::MIN_POSITIVE));
                let [first, last] = self.slopes[k];
                mask &= S::f8_le(S::f8_sub(S::f8_sub(least, high), off), S::f8_splat(last));
                mask &= S::f8_le(S::f8_splat(first), S::f8_add(S::f8_sub(most, low), off));
            }
            return (mask, S::f8_array(near));
        }
        for (k, axis) in [u, v].into_iter().enumerate() {
            let [apex_least, apex_most] = self.bounds[axis];
            let [slope_least, slope_most] = self.slopes[k];
            let (low, high) = (S::f8_splat(slope_least), S::f8_splat(slope_most));
            let above = S::f8_sub(S::f8(node.planes[axis][0]), S::f8_splat(apex_most));
            let below = S::f8_sub(S::f8(node.planes[axis][1]), S::f8_splat(apex_least));
            mask &= S::f8_le(above, S::f8_max(S::f8_mul(high, near), S::f8_mul(high, far)));
            mask &= S::f8_le(S::f8_min(S::f8_mul(low, near), S::f8_mul(low, far)), below);
        }
        (mask, S::f8_array(near))
    }
}

/// The greater of two numbers' sizes.
#[inline(always)]
fn size_of<S: Simd>(a: S::F8, b: S::F8) -> S::F8 {
    let zero = S::f8_splat(0.0);
    S::f8_max(S::f8_max(a, S::f8_sub(zero, a)), S::f8_max(b, S::f8_sub(zero, b)))
}
