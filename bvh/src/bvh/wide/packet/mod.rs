//! The traversal for packets: up to 256 rays with a common origin (primary rays), a common end (shadow rays to a
//! light) or a common direction (shadow rays to a directional light).
//!
//! A packet passes these files:
//! 1. [`rays`] loads the rays as structures of arrays and finds what they have in common.
//! 2. [`frustum`] bounds them. A ray becomes a point (u, v) of the frustum's projection; eight rays make a block.
//! 3. [`traverse`] descends the tree by the frustum. In a leaf,
//!    [`projected_triangles`] are culled against the (u, v) bounds of blocks, and
//!    [`edge_functions`], f32 with error bounds, decide which rays certainly miss, certainly hit, or neither;
//!    [`projected_sphere`]s are tested by a quadratic function of (u, v).
//! 4. [`hits`] keeps the closest hit of every ray, as an unresolved triangle with f32 bounds of its depth where
//!    possible.
//! 5. [`resolve`] tests by the [`Tier`], four rays at once, what f32 does not decide: during the traversal, rays
//!    whose depth bounds overlap; at the end, the closest hits, whose bits must be those of the tier.
//!
//! A packet that diverges too far is abandoned, and its rays are traced otherwise: both entry functions return
//! `false` then.

mod edge_functions;
mod frustum;
mod hits;
mod projected_sphere;
mod projected_triangles;
mod rays;
mod resolve;
mod traverse;

pub(crate) use rays::PACKET;

use std::marker::PhantomData;

use super::layout::{Child, Wide};
use crate::bvh::Tests;
use crate::geometry::four::{Hit4, LANES4};
use crate::geometry::simd::Simd;
use crate::geometry::woop4::PreparedRay4;
use crate::geometry::{Hit, Ray, Tier, round_up};
use frustum::Frustum;
use hits::BestHits;
use projected_triangles::BlockBounds;
use rays::{BLOCK, BLOCKS, PacketRays};

/// Appends the closest hits of the rays. `false`, with nothing appended, if they must be traced otherwise. The
/// `following` rays are prefetched.
#[inline(always)]
pub(crate) fn closest<T: Tier, S: Simd>(
    wide: &Wide<T>,
    [rays, following]: [&[Ray]; 2],
    hits: &mut Vec<Option<Hit>>,
    scratch: &mut Scratch,
    stack: &mut Vec<(Child, f32)>,
    tests: &mut Tests,
) -> bool {
    S::run(
        #[inline(always)]
        || {
            let Some(mut packet) = Packet::<T, false>::new::<S>(rays, following, scratch) else {
                return false;
            };
            packet.traverse::<S>(wide, stack, tests) && packet.resolve_all::<S>(wide, hits)
        },
    )
}

/// Appends whether each ray hits anything. `false`, with nothing appended, if they must be traced otherwise. The
/// `following` rays are prefetched.
#[inline(always)]
pub(crate) fn occluded<T: Tier, S: Simd>(
    wide: &Wide<T>,
    [rays, following]: [&[Ray]; 2],
    occluded: &mut Vec<bool>,
    scratch: &mut Scratch,
    stack: &mut Vec<(Child, f32)>,
    tests: &mut Tests,
) -> bool {
    S::run(
        #[inline(always)]
        || {
            let Some(mut packet) = Packet::<T, true>::new::<S>(rays, following, scratch) else {
                return false;
            };
            if !packet.traverse::<S>(wide, stack, tests) {
                return false;
            }
            let active = &packet.scratch.active;
            occluded.extend((0..rays.len()).map(|ray| active[ray / BLOCK] >> (ray % BLOCK) & 1 == 0));
            true
        },
    )
}

/// The arrays of a packet, kept from one packet to the next.
pub(crate) struct Scratch {
    rays: PacketRays,
    best: BestHits,
    /// Least and greatest u and v of every block.
    block_bounds: BlockBounds,
    /// For every block, a depth beyond which none of its rays needs a hit.
    depths: [f32; BLOCKS],
    /// The rays that are still traced, one byte per block.
    active: [u8; BLOCKS],
    /// Rays prepared for the tier's triangle test.
    prepared: Vec<PreparedRay4>,
    /// The tier's hits on unresolved triangles.
    resolved: Vec<Hit4>,
}

impl Default for Scratch {
    fn default() -> Self {
        Scratch {
            rays: PacketRays::default(),
            best: BestHits::default(),
            block_bounds: [[[f32::INFINITY; BLOCKS], [f32::NEG_INFINITY; BLOCKS]]; 2],
            depths: [f32::NEG_INFINITY; BLOCKS],
            active: [0; BLOCKS],
            prepared: vec![PreparedRay4::default(); PACKET / LANES4],
            resolved: vec![Hit4::NONE; PACKET / LANES4],
        }
    }
}

impl Scratch {
    /// Memory for four prepared rays, outside of packets.
    pub(crate) fn any_prepared(&mut self) -> &mut PreparedRay4 {
        &mut self.prepared[0]
    }
}

/// A packet of rays, traced for their closest hits, or (`ANY`) for any hit.
///
/// Methods take the tree as a parameter: as a field, it would be reloaded after every store to `scratch`.
struct Packet<'a, T: Tier, const ANY: bool> {
    rays: &'a [Ray],
    frustum: Frustum,
    scratch: &'a mut Scratch,
    /// The entries of `scratch.prepared` that are filled, as bits.
    is_prepared: u64,
    /// Whether the tier missed a triangle that f32 certainly hit: the packet is abandoned.
    is_inconsistent: bool,
    tier: PhantomData<T>,
}

impl<'a, T: Tier, const ANY: bool> Packet<'a, T, ANY> {
    /// A packet of rays with a common origin, or (`ANY`) a common end, or direction; `None` for other rays.
    #[inline(always)]
    fn new<S: Simd>(rays: &'a [Ray], following: &[Ray], scratch: &'a mut Scratch) -> Option<Self> {
        debug_assert!(rays.len() <= PACKET);
        let frustum = Frustum::new::<S>(rays, following, ANY, &mut scratch.rays)?;
        let blocks = scratch.rays.blocks;
        for (k, [least, most]) in scratch.block_bounds.iter_mut().enumerate() {
            for block in 0..blocks {
                let slopes = S::f8(scratch.rays.projected[k][block]);
                // NaN is left out.
                least[block] = S::f8_reduce_min(S::f8_min(slopes, S::f8_splat(f32::INFINITY)));
                most[block] = S::f8_reduce_max(S::f8_max(slopes, S::f8_splat(f32::NEG_INFINITY)));
            }
            least[blocks..].fill(f32::INFINITY);
            most[blocks..].fill(f32::NEG_INFINITY);
        }
        scratch.active = [0; BLOCKS];
        scratch.active[..blocks].fill(u8::MAX);
        scratch.depths = [f32::NEG_INFINITY; BLOCKS];
        let in_last_block = rays.len() - (blocks - 1) * BLOCK;
        scratch.active[blocks - 1] = u8::MAX >> (BLOCK - in_last_block);
        scratch.rays.ends[blocks - 1][in_last_block..].fill(f32::NEG_INFINITY);
        scratch.best.reset::<S>(&scratch.rays, round_up(frustum.spread));
        let mut packet =
            Packet { rays, frustum, scratch, is_prepared: 0, is_inconsistent: false, tier: PhantomData };
        packet.update_depths::<S>(u32::MAX >> (BLOCKS - blocks));
        Some(packet)
    }

    /// Updates the depths of the changed blocks, given as bits, and of the frustum, from those of the best hits.
    #[inline(always)]
    fn update_depths<S: Simd>(&mut self, mut changed: u32) {
        if changed == 0 {
            return;
        }
        while changed != 0 {
            let block = changed.trailing_zeros() as usize % BLOCKS;
            changed &= changed - 1;
            self.scratch.depths[block] = S::f8_reduce_max(S::f8(self.scratch.best.far[block]));
        }
        let mut deepest = S::f8_splat(f32::NEG_INFINITY);
        for some in self.scratch.depths.as_chunks().0 {
            deepest = S::f8_max(S::f8(*some), deepest);
        }
        self.frustum.max_depth = S::f8_reduce_max(deepest);
    }

    /// Four rays prepared for the tier's triangle test.
    #[inline(always)]
    fn prepared<S: Simd>(&mut self, index: usize) -> &PreparedRay4 {
        let index = index % (PACKET / LANES4);
        if T::HAS_RAY4 && self.is_prepared >> index & 1 == 0 {
            self.is_prepared |= 1 << index;
            let (first, end) = (index * LANES4, self.rays.len().min((index + 1) * LANES4));
            self.scratch.prepared[index].fill::<S>(&self.rays[first..end]);
        }
        &self.scratch.prepared[index]
    }

    /// Ends the traversal of some rays of a block.
    #[inline(always)]
    fn retire<S: Simd>(&mut self, block: usize, rays: u32) {
        self.scratch.active[block] &= !(rays as u8);
        self.scratch.best.retire::<S>(block, rays);
    }
}
