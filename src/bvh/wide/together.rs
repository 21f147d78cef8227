//! The way of a packet through the tree.
//!
//! The tree is asked about the frustum, not about rays. A group of triangles that it meets is seen from the apex as four
//! triangles in the plane of (u, v) ([`Seen`]); for each of them that overlaps the packet, blocks of eight rays that it overlaps are
//! tested by three edge functions in f32, which are linear in u and v ([`Edges`]). A sphere is a quadratic function of u
//! and v ([`Ball`]), and the rest is the same.

use super::ball::Ball;
use super::edges::Edges;
use super::lanes::BLOCKS;
use super::node::{Child, Content, WIDTH};
use super::packet::{BLOCK, Packet};
use super::seen::Seen;
use super::{Wide, hit_sphere, hit_sphere_by_four};
use crate::bvh::Tests;
use crate::geometry::bundle::{FourHits, Gathered, RAYS};
use crate::geometry::quad::LANES;
use crate::geometry::simd::Simd;
use crate::geometry::{Hit, PrimId, SlotId, Tier};

/// How much work a packet may take for each of its rays: 1 for a group of triangles, 2 more for each of them that the packet
/// overlaps. By medians of 5 alternating runs over a million rays at 80,000 triangles: primary rays take the same time with 1,
/// 2, 4, 8 and 16 (38 ns), shadow rays 82, 79, 82, 89 and 97 ns; with 0, which is without packets, 148 and 197 ns. That was when
/// every ray was tested against all that it may meet: now 6 saves a third of primary rays' instructions there, but no time for certain.
const MOST_WORK: usize = 2;

impl<T: Tier> Wide<T> {
    /// Finds what counts for the rays of the packet. `false` where it gave up: rays that are far apart have more triangles between
    /// them than one by one they would be tested against.
    #[inline(always)]
    pub(super) fn walk_packet<S: Simd, const ANY: bool>(
        &self,
        packet: &mut Packet<T, ANY>,
        stack: &mut Vec<(Child, f32)>,
        tests: &mut Tests,
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
                            work += self.visit_group::<S, ANY>(group, packet, tests);
                        }
                        if work > MOST_WORK * packet.rays.len() {
                            return false;
                        }
                    }
                    Content::Spheres(spheres) => {
                        for index in spheres {
                            self.visit_sphere::<S, ANY>(index, packet, tests);
                        }
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn visit_sphere<S: Simd, const ANY: bool>(
        &self,
        index: u32,
        packet: &mut Packet<T, ANY>,
        tests: &mut Tests,
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
            tests.primitives += u64::from(maybe.count_ones());
            let hit_any = self.test_block::<S, ANY>(
                packet,
                block,
                maybe,
                #[inline(always)]
                |packet, first| hit_sphere_by_four::<T, S>(&Gathered::new(packet.rays, first), sphere),
                #[inline(always)]
                |packet, ray, four, lane| {
                    let mut hit = four.at(lane, *prim, self.slot_of_sphere(index));
                    if four.unsure >> lane & 1 != 0 {
                        hit.t = hit_sphere::<T>(&packet.rays[ray], sphere)?;
                    }
                    Some(hit)
                },
            );
            changed |= u32::from(hit_any) << block;
        }
        packet.shorten::<S>(changed);
    }

    #[inline(always)]
    fn visit_group<S: Simd, const ANY: bool>(
        &self,
        index: u32,
        packet: &mut Packet<T, ANY>,
        tests: &mut Tests,
    ) -> usize {
        let group = &self.groups[index as usize];
        let seen = Seen::<S>::new::<T>(&group.quad, &packet.frustum);
        let mut lanes = seen.overlapping;
        if lanes == 0 {
            return 1;
        }
        let edges = Edges::new::<S>(&seen, &packet.frustum);
        // Brought up to date at the end: what was just written, number by number, cannot be read at once.
        let mut changed = 0u32;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % LANES;
            lanes &= lanes - 1;
            let slot = SlotId(index * LANES as u32 + lane as u32);
            let mut blocks = seen.blocks(lane, &packet.scratch.extents);
            let (nearest, corners) = (seen.nearest[lane], group.quad.raised(lane));
            while blocks != 0 {
                let block = blocks.trailing_zeros() as usize % BLOCKS;
                blocks &= blocks - 1;
                if nearest > packet.scratch.depths[block] {
                    continue;
                }
                let [u, v, _] = &packet.scratch.lanes.directions;
                let met = edges.meet::<S>(lane, u[block], v[block]);
                let active = u32::from(packet.scratch.active[block]);
                let mut maybe = met.maybe & active;
                if maybe == 0 {
                    continue;
                }
                tests.primitives += u64::from(maybe.count_ones());
                let (surely, mut hit_any) = (met.surely & active, false);
                if surely != 0 {
                    let depths = edges.depths(lane, &met);
                    let (unknown, matters) =
                        packet.sure::<S>(block, surely, (slot, &corners, edges.signs[lane]), depths);
                    (maybe, hit_any) = (maybe & !surely | unknown, matters);
                }
                if maybe != 0 {
                    maybe = self.unknown_to(packet, block, maybe, group.ids[lane]);
                    hit_any |= self.test_block::<S, ANY>(
                        packet,
                        block,
                        maybe,
                        #[inline(always)]
                        |packet, first| T::hit_bundle::<S>(packet.bundle::<S>(first / RAYS), &corners, false),
                        #[inline(always)]
                        |packet, ray, four, place| {
                            if four.unsure >> place & 1 == 0 {
                                return Some(four.at(place, PrimId(group.ids[lane]), slot));
                            }
                            self.tested(&packet.rays[ray], slot)
                        },
                    );
                }
                changed |= u32::from(hit_any) << block;
            }
        }
        packet.shorten::<S>(changed);
        1 + 2 * seen.overlapping.count_ones() as usize
    }

    /// Tests some rays of a block, four at once; whether any found what matters.
    #[inline(always)]
    fn test_block<S: Simd, const ANY: bool>(
        &self,
        packet: &mut Packet<T, ANY>,
        block: usize,
        rays: u32,
        four_at_once: impl Fn(&mut Packet<T, ANY>, usize) -> FourHits,
        hit: impl Fn(&Packet<T, ANY>, usize, &FourHits, usize) -> Option<Hit>,
    ) -> bool {
        let mut hit_any = false;
        for half in 0..BLOCK / RAYS {
            let asked = rays >> (half * RAYS) & ((1 << RAYS) - 1);
            if asked == 0 {
                continue;
            }
            let first = block * BLOCK + half * RAYS;
            let four = four_at_once(packet, first);
            let mut lanes = (four.hit | four.unsure) & asked;
            while lanes != 0 {
                let place = lanes.trailing_zeros() as usize % RAYS;
                lanes &= lanes - 1;
                let Some(hit) = hit(packet, first + place, &four, place) else { continue };
                hit_any |= self.found::<S, ANY>(packet, first + place, &hit);
            }
        }
        hit_any
    }
}
