//! [`BestHits`]: the closest hits of a packet's rays so far, with f32 bounds of their depths.
//!
//! A triangle that a ray certainly hits ([`EdgeFunctions`](super::edge_functions::EdgeFunctions)) is not tested by
//! the tier while its depth is certainly nearer than the best so far, in which case it is stored unresolved, or
//! certainly farther, in which case it is dropped. Most rays are tested against one triangle only, after the
//! traversal ([`super::resolve`]).

use super::rays::{BLOCK, BLOCKS, PacketRays};
use crate::geometry::four::LANES4;
use crate::geometry::simd::Simd;
use crate::geometry::{Hit, PrimId, SlotId};

/// The closest hits so far.
pub(crate) struct BestHits {
    /// Lower bounds of the depths of the best hits; not bounds for parallel rays.
    near: [[f32; BLOCK]; BLOCKS],
    /// Upper bounds of the depths of the best hits.
    pub far: [[f32; BLOCK]; BLOCKS],
    /// The slot of an unresolved triangle, [`RESOLVED`] or [`NONE`].
    slots: [[u32; BLOCK]; BLOCKS],
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

impl Default for BestHits {
    fn default() -> Self {
        let nothing = Hit { t: 0.0, prim: PrimId(0), slot: SlotId::new(0), barycentrics: [0.0; 2] };
        BestHits {
            near: [[f32::NEG_INFINITY; BLOCK]; BLOCKS],
            far: [[f32::NEG_INFINITY; BLOCK]; BLOCKS],
            slots: [[NONE; BLOCK]; BLOCKS],
            hits: vec![nothing; BLOCK * BLOCKS],
        }
    }
}

impl BestHits {
    /// Removes all hits. Depths are bounded by the rays' `t_max`, off by up to `spread`.
    #[inline(always)]
    pub(crate) fn reset<S: Simd>(&mut self, rays: &PacketRays, spread: f32) {
        let spread = S::f8_splat(spread);
        for block in 0..rays.blocks {
            let [near, far] = rays.depths::<S>(block);
            self.near[block] = S::f8_array(S::f8_sub(near, spread));
            self.far[block] = S::f8_array(S::f8_add(far, spread));
        }
        self.slots[..rays.blocks].fill([NONE; BLOCK]);
    }

    /// The rays of a block for which a triangle between two depths is certainly nearer than the best hit, and those
    /// for which it is certainly farther.
    #[inline(always)]
    pub(crate) fn compare<S: Simd>(&self, block: usize, [near, far]: [S::F8; 2]) -> [u32; 2] {
        [S::f8_le(far, S::f8(self.near[block])), S::f8_le(S::f8(self.far[block]), near)]
    }

    /// Makes the triangle in `slot` the unresolved best hit of some rays of a block.
    #[inline(always)]
    pub(crate) fn set_unresolved<S: Simd>(
        &mut self,
        block: usize,
        rays: u32,
        slot: u32,
        [near, far]: [S::F8; 2],
    ) {
        self.near[block] = S::f8_array(S::f8_select(rays, near, S::f8(self.near[block])));
        self.far[block] = S::f8_array(S::f8_select(rays, far, S::f8(self.far[block])));
        S::masked_store(rays, slot, &mut self.slots[block]);
    }

    /// Makes every further hit of some rays of a block too far.
    #[inline(always)]
    pub(crate) fn retire<S: Simd>(&mut self, block: usize, rays: u32) {
        let nowhere = S::f8_splat(f32::NEG_INFINITY);
        self.far[block] = S::f8_array(S::f8_select(rays, nowhere, S::f8(self.far[block])));
    }

    /// Makes a hit found by the tier the best of its ray, with bounds of its depth.
    #[inline(always)]
    pub(crate) fn set_resolved(&mut self, ray: usize, hit: &Hit, [near, far]: [f32; 2]) {
        let (block, lane) = (ray / BLOCK % BLOCKS, ray % BLOCK);
        (self.near[block][lane], self.far[block][lane]) = (near, far);
        self.resolve(ray, hit);
    }

    /// Replaces the unresolved best hit of a ray by the tier's hit on the same triangle.
    #[inline(always)]
    pub(crate) fn resolve(&mut self, ray: usize, hit: &Hit) {
        self.slots[ray / BLOCK % BLOCKS][ray % BLOCK] = RESOLVED;
        self.hits[ray] = *hit;
    }

    /// The slots of four rays from `first` on, a multiple of 4; see [`BestHits::is_unresolved`].
    #[inline(always)]
    pub(crate) fn slots4(&self, first: usize) -> [u32; LANES4] {
        let [low, high] = self.slots[first / BLOCK % BLOCKS].as_chunks().0 else {
            unreachable!("two halves")
        };
        if first.is_multiple_of(BLOCK) { *low } else { *high }
    }

    /// Whether it is the slot of an unresolved triangle.
    #[inline(always)]
    pub(crate) fn is_unresolved(slot: u32) -> bool {
        slot < RESOLVED
    }

    /// The best hit of a ray.
    #[inline(always)]
    pub(crate) fn get(&self, ray: usize) -> BestHit {
        match self.slots[ray / BLOCK % BLOCKS][ray % BLOCK] {
            NONE => BestHit::None,
            RESOLVED => BestHit::Resolved(self.hits[ray]),
            slot => BestHit::Unresolved(SlotId::new(slot)),
        }
    }
}
