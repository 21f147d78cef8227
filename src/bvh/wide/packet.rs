//! Packets: rays from one place or to one, that walk through the tree together.
//!
//! A ray is a point in the plane of (u, v) of its frustum, and rays come in blocks of eight. What they have found is kept in f32 as
//! far as that can tell ([`Best`]); what it cannot tell the tier is asked (`tested`).

use super::Wide;
use super::best::Best;
use super::frustum::Frustum;
use super::lanes::{BLOCKS, Lanes};
use super::node::{Child, WIDTH};
use super::plane::{FOUR, Plane};
use super::seen::Extents;
use crate::bvh::Tests;
use crate::geometry::bundle::{FourHits, Gathered, RAYS, WoopBundle};
use crate::geometry::simd::Simd;
use crate::geometry::{Hit, Ray, SlotId, Tier, round_up};

/// How many rays a packet has at most: those of a tile.
pub const PACKET: usize = BLOCK * BLOCKS;

/// Rays whose edge functions are computed at once.
pub const BLOCK: usize = WIDTH;

/// The numbers of a packet, kept from one to the next.
pub struct Scratch {
    pub(super) lanes: Lanes,
    pub(super) best: Best,
    /// Least and greatest u and v of every block.
    pub(super) extents: Extents,
    /// For every block a depth beyond which nothing counts for any of its rays.
    pub(super) depths: [f32; BLOCKS],
    /// The rays that are still asked, a byte a block.
    pub(super) active: [u8; BLOCKS],
    /// Rays made ready for triangles.
    bundles: Vec<WoopBundle>,
    /// What those found on the triangles that they surely meet.
    pub(super) tested: Vec<FourHits>,
}

impl Default for Scratch {
    fn default() -> Self {
        Scratch {
            lanes: Lanes::default(),
            best: Best::default(),
            extents: [[[f32::INFINITY; BLOCKS], [f32::NEG_INFINITY; BLOCKS]]; 2],
            depths: [f32::NEG_INFINITY; BLOCKS],
            active: [0; BLOCKS],
            bundles: vec![WoopBundle::default(); PACKET / RAYS],
            tested: vec![FourHits::NONE; PACKET / RAYS],
        }
    }
}

impl Scratch {
    /// A bundle to be filled.
    pub(super) fn any_bundle(&mut self) -> &mut WoopBundle {
        &mut self.bundles[0]
    }
}

/// The rays of a packet, asked for their closest hits, or (`ANY`) whether they hit anything.
pub struct Packet<'a, T: Tier, const ANY: bool> {
    pub(super) rays: &'a [Ray],
    pub(super) frustum: Frustum,
    pub(super) scratch: &'a mut Scratch,
    /// The bundles that were made, as bits: once one of their rays is asked about a triangle.
    made: u64,
    /// Whether a triangle that was surely met was not.
    pub(super) is_void: bool,
    tier: std::marker::PhantomData<T>,
}

impl<'a, T: Tier, const ANY: bool> Packet<'a, T, ANY> {
    /// Of rays that share their start, or (`ANY`) their end; `None` where they do not.
    #[inline(always)]
    fn new<S: Simd>(rays: &'a [Ray], scratch: &'a mut Scratch) -> Option<Self> {
        debug_assert!(rays.len() <= PACKET);
        let frustum = Frustum::new::<S>(rays, ANY, &mut scratch.lanes)?;
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
        scratch.best.begin::<S>(&scratch.lanes, round_up(frustum.spread));
        let mut packet =
            Packet { rays, frustum, scratch, made: 0, is_void: false, tier: std::marker::PhantomData };
        packet.shorten::<S>(u32::MAX >> (BLOCKS - blocks));
        Some(packet)
    }

    /// Brings the depths of blocks, given as bits, up to date with those of their rays, and the frustum's with theirs.
    #[inline(always)]
    pub(super) fn shorten<S: Simd>(&mut self, mut changed: u32) {
        if changed == 0 {
            return;
        }
        while changed != 0 {
            let block = changed.trailing_zeros() as usize % BLOCKS;
            changed &= changed - 1;
            self.scratch.depths[block] = S::f8_most(S::f8(self.scratch.best.far[block]));
        }
        let mut deepest = S::f8_splat(f32::NEG_INFINITY);
        for some in self.scratch.depths.as_chunks().0 {
            deepest = S::f8_max(S::f8(*some), deepest);
        }
        self.frustum.depth = S::f8_most(deepest);
    }

    /// Four rays made ready for triangles.
    #[inline(always)]
    pub(super) fn bundle<S: Simd>(&mut self, index: usize) -> &WoopBundle {
        let index = index % (PACKET / RAYS);
        if T::HAS_BUNDLES && self.made >> index & 1 == 0 {
            self.made |= 1 << index;
            let (first, end) = (index * RAYS, self.rays.len().min((index + 1) * RAYS));
            self.scratch.bundles[index].fill::<S>(&self.rays[first..end]);
        }
        &self.scratch.bundles[index]
    }

    /// Nothing more is asked about some rays of a block.
    #[inline(always)]
    pub(super) fn end<S: Simd>(&mut self, block: usize, rays: u32) {
        self.scratch.active[block] &= !(rays as u8);
        self.scratch.best.end::<S>(block, rays);
    }

    /// Takes note of rays of a block that surely meet the triangle in `slot`, between two depths. Those of which more has to be known, and
    /// whether any matters.
    #[inline(always)]
    pub(super) fn sure<S: Simd>(
        &mut self,
        block: usize,
        surely: u32,
        (slot, corners, sign): (SlotId, &[[f64; 3]; 3], f64),
        depths: [S::F8; 2],
    ) -> (u32, bool) {
        let [nearer, farther] = self.scratch.best.compare::<S>(block, depths);
        // Before that a hit may lie before the ray.
        let within = surely & S::f8_le(S::f8_splat(self.frustum.floor), depths[0]);
        let nearer = nearer & within;
        let mut unknown = surely & !(nearer | farther);
        if !ANY {
            if nearer != 0 {
                self.scratch.best.take::<S>(block, nearer, slot.0, depths);
            }
            return (unknown, nearer != 0);
        }
        let mut hit = nearer;
        if unknown & within != 0 {
            let plane = Plane::new(corners, sign);
            for half in 0..BLOCK / RAYS {
                let asked = unknown & within & (FOUR << (half * RAYS));
                if asked == 0 {
                    continue;
                }
                let four = Gathered::<S>::new(self.rays, block * BLOCK + half * RAYS);
                let [before, beyond] = plane.sides::<S>(&four);
                unknown &= !((before | beyond) << (half * RAYS) & asked);
                hit |= beyond << (half * RAYS) & asked;
            }
        }
        if hit != 0 {
            self.end::<S>(block, hit);
        }
        (unknown, hit != 0)
    }
}

impl<T: Tier> Wide<T> {
    /// Appends the closest hits of rays that have something in common; `false` where that is not enough, and nothing is appended.
    #[inline(always)]
    pub fn closest_of_packet<S: Simd>(
        &self,
        rays: &[Ray],
        hits: &mut Vec<Option<Hit>>,
        scratch: &mut Scratch,
        stack: &mut Vec<(Child, f32)>,
        tests: &mut Tests,
    ) -> bool {
        S::run(
            #[inline(always)]
            || {
                let Some(mut packet) = Packet::<T, false>::new::<S>(rays, scratch) else { return false };
                self.walk_packet::<S, false>(&mut packet, stack, tests)
                    && self.answers::<S>(&mut packet, hits)
            },
        )
    }

    /// Appends whether rays that have something in common hit anything; `false` where that is not enough, and nothing is appended.
    #[inline(always)]
    pub fn occluded_of_packet<S: Simd>(
        &self,
        rays: &[Ray],
        occluded: &mut Vec<bool>,
        scratch: &mut Scratch,
        stack: &mut Vec<(Child, f32)>,
        tests: &mut Tests,
    ) -> bool {
        S::run(
            #[inline(always)]
            || {
                let Some(mut packet) = Packet::<T, true>::new::<S>(rays, scratch) else { return false };
                if !self.walk_packet::<S, true>(&mut packet, stack, tests) {
                    return false;
                }
                let active = &packet.scratch.active;
                occluded.extend((0..rays.len()).map(|ray| active[ray / BLOCK] >> (ray % BLOCK) & 1 == 0));
                true
            },
        )
    }
}
