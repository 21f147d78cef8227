//! [`BestHits`]: the closest hits of a packet's rays so far, with f32 bounds of their depths.
//!
//! A triangle that a ray certainly hits ([`EdgeFunctions`](super::edge_functions::EdgeFunctions)) is not tested by
//! the tier while its depth is certainly nearer than the best so far, in which case it is stored unresolved, or
//! certainly farther, in which case it is dropped. Most rays are tested against one triangle only, after the
//! traversal ([`super::resolve`]).

use super::rays::{BLOCKS, OfBlock, PacketRays};
use crate::geometry::simd::{Floats, Simd, Vector};
use crate::geometry::{Hit, PACKET, PrimId, SlotId};

/// The closest hits so far.
#[repr(C, align(64))]
pub(crate) struct BestHits<S: Simd> {
    /// Lower bounds of the depths of the best hits; not bounds for parallel rays.
    near: [OfBlock<S>; BLOCKS],
    /// Upper bounds of the depths of the best hits.
    pub far: [OfBlock<S>; BLOCKS],
    /// The slot of an unresolved triangle, [`RESOLVED`] or [`NONE`], as the bits of an f32: selected as depths are.
    slots: [OfBlock<S>; BLOCKS],
    /// The resolved hits.
    hits: Vec<Hit>,
}

/// The slot of a resolved hit, which is in `hits`.
const RESOLVED: u32 = NONE - 1;
/// The slot of a ray without a hit.
const NONE: u32 = u32::MAX;

/// The best hit of a ray.
#[derive(Clone, Copy)]
pub(crate) enum BestHit {
    /// No hit so far.
    None,
    /// A triangle that the ray certainly hits; not yet tested by the tier.
    Unresolved(SlotId),
    /// A hit found by the tier.
    Resolved(Hit),
}

impl<S: Simd> Default for BestHits<S> {
    fn default() -> Self {
        let nothing = Hit { t: 0.0, prim: PrimId(0), slot: SlotId::new(0), barycentrics: [0.0; 2] };
        BestHits {
            near: [S::F::ZEROS; BLOCKS],
            far: [S::F::ZEROS; BLOCKS],
            slots: [S::F::splat(f32::from_bits(NONE)).array(); BLOCKS],
            hits: vec![nothing; PACKET],
        }
    }
}

impl<S: Simd> BestHits<S> {
    /// Removes all hits. Depths are bounded by the rays' `t_max`, off by up to `spread`; `fast`: as they are computed.
    #[inline(always)]
    pub(crate) fn reset(&mut self, rays: &PacketRays<S>, spread: f32, fast: bool) {
        let spread = S::F::splat(spread);
        for block in 0..rays.blocks {
            let [near, far] = rays.depths(block);
            self.near[block] = (near - spread).array();
            let far = if fast { rays.depth_of_end(block) } else { far + spread };
            self.far[block] = far.array();
        }
        self.slots[..rays.blocks].fill(S::F::splat(f32::from_bits(NONE)).array());
    }

    /// The rays of a block for which a triangle between two depths is certainly nearer than the best hit, and those
    /// for which it is certainly farther.
    #[inline(always)]
    pub(crate) fn compare(&self, block: usize, [near, far]: [S::F; 2]) -> [u32; 2] {
        [far.le(S::F::load(self.near[block])), S::F::load(self.far[block]).le(near)]
    }

    /// Makes the triangle in `slot` the unresolved best hit of some rays of a block.
    #[inline(always)]
    pub(crate) fn set_unresolved(&mut self, block: usize, rays: u32, slot: u32, [near, far]: [S::F; 2]) {
        self.near[block] = S::F::select(rays, near, S::F::load(self.near[block])).array();
        self.far[block] = S::F::select(rays, far, S::F::load(self.far[block])).array();
        let slot = S::F::splat(f32::from_bits(slot));
        self.slots[block] = S::F::select(rays, slot, S::F::load(self.slots[block])).array();
    }

    /// Makes every further hit of some rays of a block too far.
    #[inline(always)]
    pub(crate) fn retire(&mut self, block: usize, rays: u32) {
        let nowhere = S::F::splat(f32::NEG_INFINITY);
        self.far[block] = S::F::select(rays, nowhere, S::F::load(self.far[block])).array();
    }

    /// Makes a hit found by the tier the best of its ray, with bounds of its depth.
    #[inline(always)]
    pub(crate) fn set_resolved(&mut self, ray: usize, hit: &Hit, [near, far]: [f32; 2]) {
        let (block, lane) = (ray / S::F::LANES % BLOCKS, ray % S::F::LANES);
        (self.near[block][lane], self.far[block][lane]) = (near, far);
        self.resolve(ray, hit);
    }

    /// Replaces the unresolved best hit of a ray by the tier's hit on the same triangle.
    #[inline(always)]
    pub(crate) fn resolve(&mut self, ray: usize, hit: &Hit) {
        self.slots[ray / S::F::LANES % BLOCKS][ray % S::F::LANES] = f32::from_bits(RESOLVED);
        self.hits[ray] = *hit;
    }

    /// The slot of a ray; see [`is_unresolved`].
    #[inline(always)]
    pub(crate) fn slot(&self, ray: usize) -> u32 {
        self.slots[ray / S::F::LANES % BLOCKS][ray % S::F::LANES].to_bits()
    }

    /// The best hit of a ray.
    #[inline(always)]
    pub(crate) fn get(&self, ray: usize) -> BestHit {
        match self.slot(ray) {
            NONE => BestHit::None,
            RESOLVED => BestHit::Resolved(self.hits[ray]),
            slot => BestHit::Unresolved(SlotId::new(slot)),
        }
    }
}

/// Whether it is the slot of a resolved hit.
#[inline(always)]
pub(crate) fn is_resolved(slot: u32) -> bool {
    slot == RESOLVED
}

/// Whether it is the slot of an unresolved triangle.
#[inline(always)]
pub(crate) fn is_unresolved(slot: u32) -> bool {
    slot < RESOLVED
}
