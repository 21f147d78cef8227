//! Packets: rays from one place or to one, walked through the tree together.
//!
//! The tree is asked about the frustum, not about rays. A group of triangles that it meets is seen from the apex as four
//! triangles in the plane of (u, v); for each of them that overlaps the packet, blocks of eight rays that it overlaps are
//! tested by three edge functions in f32, which are linear in u and v. Their error is bounded ([`Edges`]); a ray that is
//! outside by more than that is outside, and the others are tested by the tier, four at once where it can
//! ([`Tier::hit_bundle`]).

use super::frustum::{BLOCKS, Frustum, Lanes};
use super::node::{Child, Content, WIDTH};
use super::seen::{Extents, Seen};
use super::{Wide, hit_sphere};
use crate::bvh::Tests;
use crate::geometry::bundle::{RAYS, WoopBundle};
use crate::geometry::quad::LANES;
use crate::geometry::simd::Simd;
use crate::geometry::{Hit, PrimId, Ray, SlotId, Tier, round_down};

/// How many rays a packet has at most: those of a tile.
pub const PACKET: usize = BLOCK * BLOCKS;

/// How much work a packet may take for each of its rays: 1 for a group of triangles, 2 more for each of them that the packet
/// overlaps. By medians of 5 alternating runs over a million rays at 80,000 triangles: primary rays take the same time with 1,
/// 2, 4, 8 and 16 (38 ns), shadow rays 82, 79, 82, 89 and 97 ns; with 0, which is without packets, 148 and 197 ns.
const MOST_WORK: usize = 2;

/// Rays whose edge functions are computed at once.
const BLOCK: usize = WIDTH;

/// The numbers of a packet, kept from one to the next.
pub struct Scratch {
    lanes: Lanes,
    /// Least and greatest u and v of every block.
    extents: Extents,
    /// For every ray a depth beyond which nothing counts for it.
    reach: [[f32; BLOCK]; BLOCKS],
    /// The same for every block.
    depths: [f32; BLOCKS],
    /// The rays that are still asked, a byte a block.
    active: [u8; BLOCKS],
    /// Rays made ready for triangles.
    bundles: Vec<WoopBundle>,
}

impl Default for Scratch {
    fn default() -> Self {
        Scratch {
            lanes: Lanes {
                directions: [[[0.0; BLOCK]; BLOCKS]; 3],
                starts: [[0.0; BLOCK]; BLOCKS],
                blocks: 0,
            },
            extents: [[[f32::INFINITY; BLOCKS], [f32::NEG_INFINITY; BLOCKS]]; 2],
            reach: [[f32::NEG_INFINITY; BLOCK]; BLOCKS],
            depths: [f32::NEG_INFINITY; BLOCKS],
            active: [0; BLOCKS],
            bundles: vec![WoopBundle::default(); PACKET / RAYS],
        }
    }
}

impl Scratch {
    /// A bundle to be filled.
    pub(super) fn any_bundle(&mut self) -> &mut WoopBundle {
        &mut self.bundles[0]
    }
}

/// The rays of a packet.
pub struct Packet<'a, T: Tier> {
    rays: &'a [Ray],
    frustum: Frustum,
    scratch: &'a mut Scratch,
    /// The bundles that were made, as bits: once one of their rays is asked about a triangle.
    made: u64,
    tier: std::marker::PhantomData<T>,
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
                scratch.reach[block][lane] = scratch.lanes.depth_at(block, lane, ray.t_max);
            }
        }
        let mut packet = Packet { rays, frustum, scratch, made: 0, tier: std::marker::PhantomData };
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
    fn bundle<S: Simd>(&mut self, index: usize) -> &WoopBundle {
        let index = index % (PACKET / RAYS);
        if T::HAS_BUNDLES && self.made >> index & 1 == 0 {
            self.made |= 1 << index;
            let (first, end) = (index * RAYS, self.rays.len().min((index + 1) * RAYS));
            self.scratch.bundles[index].fill::<S>(&self.rays[first..end]);
        }
        &self.scratch.bundles[index]
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

impl<T: Tier> Wide<T> {
    /// Calls `found` for every ray and hit of the packet that could count. `false` where it gave up: rays that are far apart have
    /// more triangles between them than one by one they would be tested against.
    #[inline(always)]
    fn walk_packet<S: Simd>(
        &self,
        packet: &mut Packet<T>,
        stack: &mut Vec<(Child, f32)>,
        tests: &mut Tests,
        mut found: impl FnMut(&mut Packet<T>, usize, Hit) -> bool,
    ) -> bool {
        stack.clear();
        let Some(mut node) = self.nodes.first() else { return true };
        let mut work = 0;
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
                let Some((child, at)) = stack.pop() else { return true };
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
                            work += self.visit_group::<S>(group, packet, tests, &mut found);
                        }
                        if work > MOST_WORK * packet.rays.len() {
                            return false;
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
    ) -> usize {
        let group = &self.groups[index as usize];
        let seen = Seen::new::<S, T>(&group.quad, &packet.frustum);
        let mut lanes = seen.overlapping;
        let mut changed = false;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % LANES;
            lanes &= lanes - 1;
            let edges = seen.edges(lane, &packet.frustum);
            let corners = group.quad.triangle(lane);
            let mut blocks = seen.blocks::<S>(lane, &packet.scratch.extents);
            let nearest = round_down(seen.nearest[lane]);
            while blocks != 0 {
                let block = blocks.trailing_zeros() as usize % BLOCKS;
                blocks &= blocks - 1;
                if nearest > packet.scratch.depths[block] + packet.frustum.spread as f32 {
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
                    let hits = T::hit_bundle::<S>(packet.bundle::<S>(first / RAYS), &corners);
                    let mut lanes = (hits.hit | hits.unsure) & asked;
                    while lanes != 0 {
                        let place = lanes.trailing_zeros() as usize % RAYS;
                        lanes &= lanes - 1;
                        let ray = first + place;
                        let slot = SlotId(index * LANES as u32 + lane as u32);
                        let hit = if hits.unsure >> place & 1 == 0 {
                            hits.at(place, PrimId(group.ids[lane]), slot)
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
        1 + 2 * seen.overlapping.count_ones() as usize
    }

    /// The closest hits of rays that have something in common; `false` where that is not enough, and what was written is void.
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
                        packet.scratch.reach[block][lane] = packet.scratch.lanes.depth_at(block, lane, hit.t);
                        true
                    },
                )
            },
        )
    }

    /// Whether rays that have something in common hit anything; `false` where that is not enough, and what was written is void.
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
                )
            },
        )
    }
}
