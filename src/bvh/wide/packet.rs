//! Packets: rays from one place or to one, walked through the tree together.
//!
//! The tree is asked about the frustum, not about rays. A group of triangles that it meets is seen from the apex as four
//! triangles in the plane of (u, v); for each of them that overlaps the packet, blocks of eight rays that it overlaps are
//! tested by three edge functions in f32, which are linear in u and v. Their error is bounded ([`Edges`]); a ray that is
//! outside by more than that is outside, and the others are tested by the tier, four at once where it can
//! ([`Tier::hit_bundle`]). A sphere is a quadratic function of u and v ([`Ball`]), and the rest is the same.

use super::ball::Ball;
use super::frustum::Frustum;
use super::lanes::{BLOCKS, Lanes};
use super::node::{Child, Content, WIDTH};
use super::seen::{Extents, Seen};
use super::{Wide, hit_sphere, hit_sphere_by_four};
use crate::bvh::Tests;
use crate::geometry::bundle::{Gathered, RAYS, WoopBundle};
use crate::geometry::quad::LANES;
use crate::geometry::simd::Simd;
use crate::geometry::{Hit, PrimId, Ray, SlotId, Tier};

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
    /// For every block a depth beyond which nothing counts for any of its rays.
    depths: [f32; BLOCKS],
    /// The rays that are still asked, a byte a block.
    active: [u8; BLOCKS],
    /// Rays made ready for triangles.
    bundles: Vec<WoopBundle>,
}

impl Default for Scratch {
    fn default() -> Self {
        Scratch {
            lanes: Lanes::default(),
            extents: [[[f32::INFINITY; BLOCKS], [f32::NEG_INFINITY; BLOCKS]]; 2],
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
        for (k, [least, most]) in scratch.extents.iter_mut().enumerate() {
            for block in 0..blocks {
                let slopes = S::f8(scratch.lanes.directions[k][block]);
                // What is not a number does not count.
                least[block] = S::f8_least(S::f8_min(slopes, S::f8_splat(f32::INFINITY)));
                most[block] = S::f8_most(S::f8_max(slopes, S::f8_splat(f32::NEG_INFINITY)));
            }
            least[blocks..].fill(f32::INFINITY);
            most[blocks..].fill(f32::NEG_INFINITY);
        }
        scratch.active = [0; BLOCKS];
        scratch.active[..blocks].fill(u8::MAX);
        scratch.depths = [f32::NEG_INFINITY; BLOCKS];
        // The last block may hold fewer.
        let held = rays.len() - (blocks - 1) * BLOCK;
        scratch.active[blocks - 1] = u8::MAX >> (BLOCK - held);
        scratch.lanes.ends[blocks - 1][held..].fill(f32::NEG_INFINITY);
        let mut packet = Packet { rays, frustum, scratch, made: 0, tier: std::marker::PhantomData };
        packet.shorten::<S>(u32::MAX >> (BLOCKS - blocks));
        Some(packet)
    }

    /// Brings the depths of blocks, given as bits, up to date with the ends of their rays, and the frustum's with theirs.
    #[inline(always)]
    fn shorten<S: Simd>(&mut self, mut changed: u32) {
        if changed == 0 {
            return;
        }
        while changed != 0 {
            let block = changed.trailing_zeros() as usize % BLOCKS;
            changed &= changed - 1;
            // Rays that are not asked any more end nowhere, which is no number here.
            let depths = S::f8_max(self.scratch.lanes.depths::<S>(block), S::f8_splat(f32::NEG_INFINITY));
            self.scratch.depths[block] = S::f8_most(depths);
        }
        let mut deepest = S::f8_splat(f32::NEG_INFINITY);
        for some in self.scratch.depths.as_chunks().0 {
            deepest = S::f8_max(S::f8(*some), deepest);
        }
        self.frustum.depth = S::f8_most(deepest) + self.frustum.spread as f32;
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
                // Farthest first.
                let item = (node.children[place], at[place]);
                let mut after = stack.len();
                stack.push(item);
                while after > first && stack[after - 1].1 < item.1 {
                    stack[after] = stack[after - 1];
                    after -= 1;
                }
                stack[after] = item;
            }
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
                            self.visit_sphere::<S>(index, packet, tests, &mut found);
                        }
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn visit_sphere<S: Simd>(
        &self,
        index: u32,
        packet: &mut Packet<T>,
        tests: &mut Tests,
        found: &mut impl FnMut(&mut Packet<T>, usize, Hit) -> bool,
    ) {
        let (sphere, prim) = &self.spheres[index as usize];
        let ball = Ball::<S>::new(sphere, &packet.frustum);
        let mut changed = 0u32;
        for block in 0..packet.scratch.lanes.blocks % (BLOCKS + 1) {
            let [u, v, _] = &packet.scratch.lanes.directions;
            let maybe = ball.meets(u[block], v[block]) & u32::from(packet.scratch.active[block]);
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
                let hits = hit_sphere_by_four::<T, S>(&Gathered::new(packet.rays, first), sphere);
                let mut lanes = (hits.hit | hits.unsure) & asked;
                while lanes != 0 {
                    let place = lanes.trailing_zeros() as usize % RAYS;
                    lanes &= lanes - 1;
                    let ray = first + place;
                    let mut hit = hits.at(place, *prim, self.slot_of_sphere(index));
                    if hits.unsure >> place & 1 != 0 {
                        match hit_sphere::<T>(&packet.rays[ray], sphere) {
                            Some(t) => hit.t = t,
                            None => continue,
                        }
                    }
                    hit_any |= found(packet, ray, hit);
                }
            }
            changed |= u32::from(hit_any) << block;
        }
        packet.shorten::<S>(changed);
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
        let seen = Seen::<S>::new::<T>(&group.quad, &packet.frustum);
        let mut lanes = seen.overlapping;
        if lanes == 0 {
            return 1;
        }
        let edges = seen.edges(&packet.frustum);
        // Brought up to date at the end: what was just written, number by number, cannot be read at once.
        let mut changed = 0u32;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % LANES;
            lanes &= lanes - 1;
            let corners = group.quad.raised(lane);
            let mut blocks = seen.blocks(lane, &packet.scratch.extents);
            let nearest = seen.nearest[lane];
            while blocks != 0 {
                let block = blocks.trailing_zeros() as usize % BLOCKS;
                blocks &= blocks - 1;
                if nearest > packet.scratch.depths[block] + packet.frustum.spread as f32 {
                    continue;
                }
                let inside = edges.inside::<S>(
                    lane,
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
                changed |= u32::from(hit_any) << block;
            }
        }
        packet.shorten::<S>(changed);
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
                        packet.scratch.lanes.ends[ray / BLOCK][ray % BLOCK] = hit.t as f32;
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
                        packet.scratch.lanes.ends[block][lane] = f32::NEG_INFINITY;
                        true
                    },
                )
            },
        )
    }
}
