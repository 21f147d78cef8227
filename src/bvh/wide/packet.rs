//! Packets: rays from one place or to one, walked through the tree together.
//!
//! The tree is asked about the frustum, not about rays. A group of triangles that it meets is seen from the apex as four
//! triangles in the plane of (u, v); for each of them that overlaps the packet, blocks of eight rays that it overlaps are
//! tested by three edge functions in f32, which are linear in u and v. Their error is bounded ([`Edges`]); a ray that is
//! outside by more than that is outside, and the others are tested by the tier, four at once where it can
//! ([`Tier::hit_bundle`]).

use super::frustum::{BLOCKS, Frustum, Lanes};
use super::node::{Child, Content, WIDTH};
use super::{Wide, hit_sphere};
use crate::bvh::Tests;
use crate::geometry::bundle::RAYS;
use crate::geometry::quad::LANES;
use crate::geometry::simd::Simd;
use crate::geometry::{Corner, Hit, PrimId, Ray, SlotId, Tier};

/// How many rays a packet has at most: those of a tile.
pub const PACKET: usize = BLOCK * BLOCKS;

/// Rays whose edge functions are computed at once.
const BLOCK: usize = WIDTH;

/// The numbers of a packet, kept from one to the next.
pub struct Scratch {
    lanes: Lanes,
    /// Least and greatest u and v of every block.
    extents: [[[f32; BLOCKS]; 2]; 2],
    /// For every ray a depth beyond which nothing counts for it.
    reach: [[f32; BLOCK]; BLOCKS],
    /// The same for every block.
    depths: [f32; BLOCKS],
    /// The rays that are still asked, a byte a block.
    active: [u8; BLOCKS],
}

impl Default for Scratch {
    fn default() -> Self {
        Scratch {
            lanes: Lanes { directions: [[[0.0; BLOCK]; BLOCKS]; 3], blocks: 0 },
            extents: [[[f32::INFINITY; BLOCKS], [f32::NEG_INFINITY; BLOCKS]]; 2],
            reach: [[f32::NEG_INFINITY; BLOCK]; BLOCKS],
            depths: [f32::NEG_INFINITY; BLOCKS],
            active: [0; BLOCKS],
        }
    }
}

/// The rays of a packet.
pub struct Packet<'a, T: Tier> {
    rays: &'a [Ray],
    frustum: Frustum,
    scratch: &'a mut Scratch,
    /// Rays made ready for triangles, once one of them is asked about one.
    bundles: Vec<Option<T::Bundle>>,
}

impl<'a, T: Tier> Packet<'a, T> {
    /// Of rays that share their start, or (`to_end`) their end; `None` where they do not.
    #[inline(always)]
    pub fn new<S: Simd>(rays: &'a [Ray], to_end: bool, scratch: &'a mut Scratch) -> Option<Self> {
        debug_assert!(rays.len() <= PACKET);
        let frustum = Frustum::new::<S>(rays, to_end, &mut scratch.lanes)?;
        let blocks = scratch.lanes.blocks;
        for k in 0..2 {
            for block in 0..blocks {
                let slopes = &scratch.lanes.directions[k][block];
                scratch.extents[k][0][block] = slopes.iter().copied().fold(f32::INFINITY, least);
                scratch.extents[k][1][block] = slopes.iter().copied().fold(f32::NEG_INFINITY, most);
            }
            scratch.extents[k][0][blocks..].fill(f32::INFINITY);
            scratch.extents[k][1][blocks..].fill(f32::NEG_INFINITY);
        }
        scratch.active[blocks..].fill(0);
        for (block, rays) in rays.chunks(BLOCK).enumerate() {
            scratch.active[block] = (u32::MAX >> (32 - rays.len())) as u8;
            scratch.reach[block] = [f32::NEG_INFINITY; BLOCK];
            for (lane, ray) in rays.iter().enumerate() {
                let along = scratch.lanes.directions[2][block][lane];
                scratch.reach[block][lane] = Frustum::depth_at(along, ray.t_max);
            }
        }
        let bundles = vec![None; rays.len().div_ceil(RAYS)];
        let mut packet = Packet { rays, frustum, scratch, bundles };
        for block in 0..blocks {
            packet.shorten_block(block);
        }
        packet.shorten();
        Some(packet)
    }

    /// Brings the depth of a block up to date with those of its rays.
    #[inline(always)]
    fn shorten_block(&mut self, block: usize) {
        self.scratch.depths[block] = self.scratch.reach[block].into_iter().fold(f32::NEG_INFINITY, most);
    }

    /// Brings the frustum's depth up to date with those of the blocks.
    #[inline(always)]
    fn shorten(&mut self) {
        let deepest =
            self.scratch.depths[..self.scratch.lanes.blocks].iter().copied().fold(f32::NEG_INFINITY, most);
        self.frustum.depth = deepest + self.frustum.spread as f32;
    }

    /// Four rays made ready for triangles.
    #[inline(always)]
    fn bundle(&mut self, index: usize) -> &T::Bundle {
        let rays = self.rays;
        self.bundles[index].get_or_insert_with(
            #[cold]
            || T::bundle(&rays[index * RAYS..rays.len().min((index + 1) * RAYS)]),
        )
    }
}

#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The edges of a triangle as functions of u and v, each `[a, b, c]` for a u + b v + c; a ray is inside where all are
/// positive or all negative.
///
/// Each is off by less than its bound. With P = |a u| + |b v| + |c|: a, b, c, u and v are rounded to f32 (u of themselves
/// each), the products and sums round three times more: 6 u P at most, and 8 u P stands here. In f64, a, b and c are
/// products of corners A and B: off by 4 of its roundings of |A| |B|, as is what the tier decides by. And a ray
/// that passes the apex on a side by `spread` sees an edge function that differs by the edge's length times that.
struct Edges {
    lines: [[f32; 3]; 3],
    bounds: [f32; 3],
}

impl<T: Tier> Wide<T> {
    /// Calls `found` for every ray and hit of the packet that could count, until nothing is active.
    #[inline(always)]
    fn walk_packet<S: Simd>(
        &self,
        packet: &mut Packet<T>,
        stack: &mut Vec<(Child, f32)>,
        tests: &mut Tests,
        mut found: impl FnMut(&mut Packet<T>, usize, Hit) -> bool,
    ) {
        stack.clear();
        let Some(mut node) = self.nodes.first() else { return };
        loop {
            tests.nodes += 1;
            let (mut mask, at) = packet.frustum.enter::<S>(node);
            let first = stack.len();
            while mask != 0 {
                let place = mask.trailing_zeros() as usize % WIDTH;
                mask &= mask - 1;
                stack.push((node.children[place], at[place]));
            }
            stack[first..].sort_unstable_by(|a, b| b.1.total_cmp(&a.1));
            loop {
                let Some((child, at)) = stack.pop() else { return };
                if at > packet.frustum.depth {
                    continue;
                }
                match child.content() {
                    Content::Node(index) => {
                        node = &self.nodes[index as usize];
                        break;
                    }
                    Content::Groups(groups) => {
                        for group in groups {
                            self.visit_group::<S>(group, packet, tests, &mut found);
                        }
                    }
                    Content::Spheres(spheres) => {
                        for index in spheres {
                            self.visit_sphere(index, packet, tests, &mut found);
                        }
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn visit_sphere(
        &self,
        index: u32,
        packet: &mut Packet<T>,
        tests: &mut Tests,
        found: &mut impl FnMut(&mut Packet<T>, usize, Hit) -> bool,
    ) {
        let (sphere, prim) = &self.spheres[index as usize];
        let rays = packet.rays;
        for (i, ray) in rays.iter().enumerate() {
            if packet.scratch.active[i / BLOCK] >> (i % BLOCK) & 1 == 0 {
                continue;
            }
            tests.primitives += 1;
            if let Some(t) = hit_sphere::<T>(ray, sphere) {
                let hit = Hit { t, prim: *prim, slot: self.slot_of_sphere(index), weights: [0.0; 2] };
                if found(packet, i, hit) {
                    packet.shorten_block(i / BLOCK);
                }
            }
        }
        packet.shorten();
    }

    #[inline(always)]
    fn visit_group<S: Simd>(
        &self,
        index: u32,
        packet: &mut Packet<T>,
        tests: &mut Tests,
        found: &mut impl FnMut(&mut Packet<T>, usize, Hit) -> bool,
    ) {
        let group = &self.groups[index as usize];
        let seen = Seen::new::<S, T>(&group.quad, &packet.frustum);
        let mut lanes = seen.overlapping;
        let mut changed = false;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % LANES;
            lanes &= lanes - 1;
            let edges = seen.edges(lane, &packet.frustum);
            let corners = group.quad.triangle(lane);
            let mut blocks = seen.blocks::<S>(lane, packet);
            let nearest = seen.nearest[lane] as f32;
            while blocks != 0 {
                let block = blocks.trailing_zeros() as usize % BLOCKS;
                blocks &= blocks - 1;
                if nearest > packet.scratch.depths[block] * super::node::MARGIN + packet.frustum.spread as f32
                {
                    continue;
                }
                let inside = edges.inside::<S>(
                    packet.scratch.lanes.directions[0][block],
                    packet.scratch.lanes.directions[1][block],
                );
                let maybe = inside & u32::from(packet.scratch.active[block]);
                if maybe == 0 {
                    continue;
                }
                let mut hit_any = false;
                for half in 0..BLOCK / RAYS {
                    let asked = maybe >> (half * RAYS) & ((1 << RAYS) - 1);
                    if asked == 0 {
                        continue;
                    }
                    tests.primitives += u64::from(asked.count_ones());
                    let first = block * BLOCK + half * RAYS;
                    let hits = T::hit_bundle::<S>(packet.bundle(first / RAYS), &corners);
                    let mut lanes = (hits.hit | hits.unsure) & asked;
                    while lanes != 0 {
                        let place = lanes.trailing_zeros() as usize % RAYS;
                        lanes &= lanes - 1;
                        let ray = first + place;
                        let slot = SlotId(index * LANES as u32 + lane as u32);
                        let hit = if hits.unsure >> place & 1 == 0 {
                            Hit {
                                t: hits.t[place],
                                prim: PrimId(group.ids[lane]),
                                slot,
                                weights: [hits.weights[0][place], hits.weights[1][place]],
                            }
                        } else {
                            let prepared = T::prepare(&packet.rays[ray]);
                            match super::hit_triangle::<T>(&prepared, &packet.rays[ray], group, slot) {
                                Some(hit) => hit,
                                None => continue,
                            }
                        };
                        hit_any |= found(packet, ray, hit);
                    }
                }
                if hit_any {
                    packet.shorten_block(block);
                    changed = true;
                }
            }
        }
        if changed {
            packet.shorten();
        }
    }

    /// The closest hits of rays that start at one place; `false` where they do not, and nothing is done.
    #[inline(always)]
    pub fn closest_of_packet<S: Simd>(
        &self,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
        scratch: &mut Scratch,
        stack: &mut Vec<(Child, f32)>,
        tests: &mut Tests,
    ) -> bool {
        S::run(
            #[inline(always)]
            || {
                let Some(mut packet) = Packet::<T>::new::<S>(rays, false, scratch) else { return false };
                self.walk_packet::<S>(
                    &mut packet,
                    stack,
                    tests,
                    #[inline(always)]
                    |packet, ray, hit| {
                        if !self.is_better(&packet.rays[ray], &hit, hits[ray].as_ref()) {
                            return false;
                        }
                        hits[ray] = Some(hit);
                        let (block, lane) = (ray / BLOCK, ray % BLOCK);
                        packet.scratch.reach[block][lane] =
                            Frustum::depth_at(packet.scratch.lanes.directions[2][block][lane], hit.t);
                        true
                    },
                );
                true
            },
        )
    }

    /// Whether rays that end at one place hit anything; `false` where they do not end so, and nothing is done.
    #[inline(always)]
    pub fn occluded_of_packet<S: Simd>(
        &self,
        rays: &[Ray],
        occluded: &mut [bool],
        scratch: &mut Scratch,
        stack: &mut Vec<(Child, f32)>,
        tests: &mut Tests,
    ) -> bool {
        S::run(
            #[inline(always)]
            || {
                let Some(mut packet) = Packet::<T>::new::<S>(rays, true, scratch) else { return false };
                self.walk_packet::<S>(
                    &mut packet,
                    stack,
                    tests,
                    #[inline(always)]
                    |packet, ray, _| {
                        occluded[ray] = true;
                        let (block, lane) = (ray / BLOCK, ray % BLOCK);
                        packet.scratch.active[block] &= !(1 << lane);
                        packet.scratch.reach[block][lane] = f32::NEG_INFINITY;
                        true
                    },
                );
                true
            },
        )
    }
}

/// A group of triangles seen from an apex: across its u and v, and in depth.
struct Seen {
    /// Corners from the apex, each `[u axis, v axis, depth][lane]`.
    corners: [[[f64; LANES]; 3]; 3],
    /// The least depth of each triangle.
    nearest: [f64; LANES],
    /// Least and greatest u, least and greatest v; infinite where a corner is not before the apex.
    extents: [[[f64; LANES]; 2]; 2],
    /// The triangles that overlap the packet.
    overlapping: u32,
}

impl Seen {
    #[inline(always)]
    fn new<S: Simd, T: Tier>(quad: &crate::geometry::Quad<T::Corner>, frustum: &Frustum) -> Self {
        let zero = S::d4_splat(0.0);
        let mut corners = [[zero; 3]; 3];
        let (mut least, mut most) = ([zero; 2], [zero; 2]);
        let (mut nearest, mut farthest) = (zero, zero);
        let (spread, depth) = (S::d4_splat(frustum.spread), S::d4_splat(f64::from(frustum.depth)));
        for (k, corner) in corners.iter_mut().enumerate() {
            for (place, side) in corner.iter_mut().enumerate() {
                let axis = frustum.axes[place];
                let (at, apex) =
                    (T::Corner::to_d4::<S>(quad.corners[k][axis]), S::d4_splat(frustum.apex[axis]));
                let down = place == 2 && frustum.downwards;
                *side = if down { S::d4_sub(apex, at) } else { S::d4_sub(at, apex) };
            }
            let share = S::d4_div(S::d4_splat(1.0), corner[2]);
            // A ray that passes the apex on a side sees a corner moved by as much.
            let aside = S::d4_mul(spread, share);
            for place in 0..2 {
                let slope = S::d4_mul(corner[place], share);
                let around = S::d4_add(S::d4_mul(S::d4_abs(slope), S::d4_splat(SLOPE_SLACK)), aside);
                let around = S::d4_add(around, S::d4_mul(S::d4_abs(slope), aside_share::<S>(aside)));
                let (low, high) = (S::d4_sub(slope, around), S::d4_add(slope, around));
                least[place] = if k == 0 { low } else { S::d4_min(low, least[place]) };
                most[place] = if k == 0 { high } else { S::d4_max(high, most[place]) };
            }
            nearest = if k == 0 { corner[2] } else { S::d4_min(corner[2], nearest) };
            farthest = if k == 0 { corner[2] } else { S::d4_max(corner[2], farthest) };
        }
        // Where a corner is not clearly before the apex there is no saying where it is seen.
        let clear = S::d4_lt(S::d4_add(spread, spread), nearest);
        let slope = |k: usize, side: usize| S::d4_splat(f64::from(frustum.slopes[k][side]));
        let mut across = S::d4_le(least[0], slope(0, 1)) & S::d4_le(slope(0, 0), most[0]);
        across &= S::d4_le(least[1], slope(1, 1)) & S::d4_le(slope(1, 0), most[1]);
        let ahead = S::d4_le(S::d4_sub(zero, spread), farthest) & S::d4_le(nearest, depth);
        let mut seen = Seen {
            corners: [[[0.0; LANES]; 3]; 3],
            nearest: S::d4_array(nearest),
            extents: [
                [S::d4_array(least[0]), S::d4_array(most[0])],
                [S::d4_array(least[1]), S::d4_array(most[1])],
            ],
            overlapping: ahead & (across | !clear & ((1 << LANES) - 1)),
        };
        for k in 0..3 {
            for place in 0..3 {
                seen.corners[k][place] = S::d4_array(corners[k][place]);
            }
        }
        let mut unclear = !clear & ((1 << LANES) - 1);
        while unclear != 0 {
            let lane = unclear.trailing_zeros() as usize % LANES;
            unclear &= unclear - 1;
            for extent in &mut seen.extents {
                (extent[0][lane], extent[1][lane]) = (f64::NEG_INFINITY, f64::INFINITY);
            }
        }
        seen
    }

    /// The blocks of the packet that a triangle overlaps, as bits.
    #[inline(always)]
    fn blocks<S: Simd>(&self, lane: usize, packet: &Packet<impl Tier>) -> u32 {
        let mut blocks = 0;
        for some in (0..BLOCKS).step_by(BLOCK) {
            let mut mask = u32::MAX;
            for k in 0..2 {
                let low = S::f8_splat(crate::geometry::round_down(self.extents[k][0][lane]));
                let high = S::f8_splat(crate::geometry::round_up(self.extents[k][1][lane]));
                let [least, most] = &packet.scratch.extents[k];
                mask &= S::f8_le(eight::<S>(least, some), high) & S::f8_le(low, eight::<S>(most, some));
            }
            blocks |= mask << some;
        }
        blocks
    }

    #[inline(always)]
    fn edges(&self, lane: usize, frustum: &Frustum) -> Edges {
        let corner = |k: usize| [0, 1, 2].map(|place| self.corners[k][place][lane]);
        let corners = [corner(0), corner(1), corner(2)];
        let reach = frustum.slopes.map(|[low, high]| f64::from(low.abs().max(high.abs())));
        let mut edges = Edges { lines: [[0.0; 3]; 3], bounds: [0.0; 3] };
        for k in 0..3 {
            let (p, q) = (corners[k], corners[(k + 1) % 3]);
            let line = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
            let size = |x: [f64; 3]| x[0].abs() * reach[0] + x[1].abs() * reach[1] + x[2].abs();
            let length = (q[0] - p[0]).abs() + (q[1] - p[1]).abs() + (q[2] - p[2]).abs();
            let sum = |x: [f64; 3]| x[0].abs() + x[1].abs() + x[2].abs();
            let aside = 1.0 + reach[0] + reach[1];
            let bound = size(line) * EDGE_SLACK
                + sum(p) * sum(q) * aside * PRODUCT_SLACK
                + 2.0 * frustum.spread * (length + frustum.spread) * aside;
            edges.lines[k] = line.map(|x| x as f32);
            edges.bounds[k] = crate::geometry::round_up(bound);
        }
        edges
    }
}

/// What a corner's slope, computed in f64, may be off by, and a ray's in f32, as a share.
const SLOPE_SLACK: f64 = 4.0 * f32::EPSILON as f64;

/// 8 u: see [`Edges`].
const EDGE_SLACK: f64 = 4.0 * f32::EPSILON as f64;

/// 32 roundings of f64: see [`Edges`].
const PRODUCT_SLACK: f64 = 16.0 * f64::EPSILON;

/// The share by which depth, moved by `aside` of itself, changes a slope: twice that, at the depths where it counts.
#[inline(always)]
fn aside_share<S: Simd>(aside: S::D4) -> S::D4 {
    S::d4_add(aside, aside)
}

#[inline(always)]
fn eight<S: Simd>(list: &[f32; BLOCKS], first: usize) -> S::F8 {
    let mut some = [0.0; BLOCK];
    some.copy_from_slice(&list[first..first + BLOCK]);
    S::f8(some)
}

impl Edges {
    /// The rays of a block that may be inside, as bits.
    #[inline(always)]
    fn inside<S: Simd>(&self, u: [f32; BLOCK], v: [f32; BLOCK]) -> u32 {
        let (u, v) = (S::f8(u), S::f8(v));
        let zero = S::f8_splat(0.0);
        let (mut least, mut most) = (S::f8_splat(f32::INFINITY), S::f8_splat(f32::NEG_INFINITY));
        for ([a, b, c], bound) in self.lines.into_iter().zip(self.bounds) {
            let value = S::mul_add(S::f8_splat(a), u, S::mul_add(S::f8_splat(b), v, S::f8_splat(c)));
            least = S::f8_min(S::f8_add(value, S::f8_splat(bound)), least);
            most = S::f8_max(S::f8_sub(value, S::f8_splat(bound)), most);
        }
        S::f8_le(zero, least) | S::f8_le(most, zero)
    }
}
