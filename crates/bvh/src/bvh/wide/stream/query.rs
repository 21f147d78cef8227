//! What is done with the hits of a stream: [`ClosestHits`], [`Occlusion`] and [`AllHits`].

use super::state::{InFlight, STREAM_WIDTH};
use crate::bvh::wide::layout::{TriangleLeaf, Wide};
use crate::geometry::lanes::{HitN, LANES4};
use crate::geometry::simd::{Doubles, Simd, Vector};
use crate::geometry::{Hit, HitBuffer, NO_PRIMITIVE, PrimId, Rays, SlotId, Tier};

/// A query about each ray of a stream.
pub(crate) trait Query<T: Tier, S: Simd> {
    /// Takes a hit.
    fn found(&mut self, at: InFlight, hit: &Hit);

    /// Takes the hits on the triangles of the leaf at `index`, without a branch that depends on them; `false` where
    /// that is not possible, and [`Query::found`] must take them one by one.
    #[inline(always)]
    fn found_in_leaf(
        &mut self,
        _at: InFlight,
        _four: &HitN<S::D4>,
        _leaf: &TriangleLeaf<T::Corner>,
        _index: usize,
    ) -> bool {
        false
    }

    /// What the ray does after a leaf.
    #[inline(always)]
    fn next(&self, _at: InFlight) -> After {
        After::EVERYTHING
    }

    /// Whether a ray need not be traced.
    #[inline(always)]
    fn is_known(&self, _ray: usize) -> bool {
        false
    }

    /// The ray has no further leaves.
    #[inline(always)]
    fn finish(&mut self, _at: InFlight) {}
}

/// What a ray does after a leaf.
pub(crate) struct After {
    /// Hits from here on do not matter.
    pub t_max: f64,
    /// Whether no other leaf matters.
    pub is_done: bool,
}

impl After {
    /// All leaves matter.
    pub(super) const EVERYTHING: After = After { t_max: f64::INFINITY, is_done: false };
}

/// A closest hit so far: t, the barycentrics, and the bits of primitive and slot. A vector, so that it is replaced
/// without a branch.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
struct Best([f64; 4]);

impl Best {
    /// No hit, farther than any.
    const NONE: Best = Best([f64::INFINITY, 0.0, 0.0, f64::from_bits(NO_PRIMITIVE as u64)]);

    #[inline(always)]
    fn new([t, v, w]: [f64; 3], prim: u32, slot: u32) -> Self {
        Best([t, v, w, f64::from_bits(u64::from(slot) << 32 | u64::from(prim))])
    }

    #[inline(always)]
    fn t(&self) -> f64 {
        self.0[0]
    }

    #[inline(always)]
    fn prim(&self) -> u32 {
        self.0[3].to_bits() as u32
    }

    /// The hit, if there is one.
    #[inline(always)]
    fn hit(&self) -> Option<Hit> {
        let [t, v, w, bits] = self.0;
        let (prim, slot) = (PrimId(self.prim()), (bits.to_bits() >> 32) as u32);
        (prim.0 != NO_PRIMITIVE).then(|| Hit { t, prim, slot: SlotId::new(slot), barycentrics: [v, w] })
    }
}

/// The closest hit of each ray, beside the ray while it is in flight.
pub(crate) struct ClosestHits<'a, T: Tier> {
    wide: &'a Wide<T>,
    rays: Rays<'a>,
    hits: &'a mut HitBuffer,
    /// The index of the hit of the first ray.
    first: usize,
    best: [Best; STREAM_WIDTH],
}

impl<'a, T: Tier> ClosestHits<'a, T> {
    #[inline(always)]
    pub(crate) fn new(wide: &'a Wide<T>, rays: Rays<'a>, hits: &'a mut HitBuffer, first: usize) -> Self {
        ClosestHits { wide, rays, hits, first, best: [Best::NONE; STREAM_WIDTH] }
    }
}

impl<T: Tier, S: Simd> Query<T, S> for ClosestHits<'_, T> {
    #[inline(always)]
    fn found(&mut self, at: InFlight, hit: &Hit) {
        let best = &mut self.best[at.place % STREAM_WIDTH];
        if self.wide.is_better(|| self.rays.get(at.ray), hit, best.hit().as_ref()) {
            let [v, w] = hit.barycentrics;
            *best = Best::new([hit.t, v, w], hit.prim.0, hit.slot.index());
        }
    }

    #[inline(always)]
    fn found_in_leaf(
        &mut self,
        at: InFlight,
        four: &HitN<S::D4>,
        leaf: &TriangleLeaf<T::Corner>,
        index: usize,
    ) -> bool {
        let best = &mut self.best[at.place % STREAM_WIDTH];
        let t = S::D4::select(four.hit, S::D4::load(four.t), S::D4::splat(f64::INFINITY));
        let nearest = t.reduce_min();
        let lanes = t.le(S::D4::splat(nearest)) & four.hit;
        // Undecided, or several at the same distance: seldom.
        if four.undecided | lanes & lanes.wrapping_sub(1) != 0 {
            return false;
        }
        let lane = (lanes | 1 << (LANES4 - 1)).trailing_zeros() as usize % LANES4;
        let prim = leaf.ids[lane];
        // `&&` and `||` would be branches. As `Tier::is_before`.
        let is_lower = (nearest == best.t()) & (prim < best.prim()) & !T::IS_FAST;
        let is_better = (lanes != 0) & ((nearest < best.t()) | is_lower);
        let [v, w] = &four.barycentrics;
        let other = Best::new([nearest, v[lane], w[lane]], prim, (index * LANES4 + lane) as u32);
        let all = 0u32.wrapping_sub(is_better.into()) & S::D4::ALL;
        *best = Best(S::D4::select(all, S::D4::load(other.0), S::D4::load(best.0)).array());
        true
    }

    #[inline(always)]
    fn next(&self, at: InFlight) -> After {
        After { t_max: self.best[at.place % STREAM_WIDTH].t(), ..After::EVERYTHING }
    }

    #[inline(always)]
    fn finish(&mut self, at: InFlight) {
        let best = std::mem::replace(&mut self.best[at.place % STREAM_WIDTH], Best::NONE);
        if let Some(hit) = best.hit() {
            self.hits.set(self.first + at.ray, Some(&hit));
        }
    }
}

/// Whether each ray has a hit.
pub(crate) struct Occlusion<'a>(pub &'a mut [bool]);

impl<T: Tier, S: Simd> Query<T, S> for Occlusion<'_> {
    #[inline(always)]
    fn found(&mut self, at: InFlight, _: &Hit) {
        self.0[at.ray] = true;
    }

    #[inline(always)]
    fn found_in_leaf(
        &mut self,
        at: InFlight,
        four: &HitN<S::D4>,
        _: &TriangleLeaf<T::Corner>,
        _: usize,
    ) -> bool {
        self.0[at.ray] = four.hit != 0;
        four.hit != 0 || four.undecided == 0
    }

    #[inline(always)]
    fn next(&self, at: InFlight) -> After {
        After { is_done: self.0[at.ray], ..After::EVERYTHING }
    }

    /// An abandoned packet found a hit.
    #[inline(always)]
    fn is_known(&self, ray: usize) -> bool {
        self.0[ray]
    }
}

/// Every hit of each ray, with the index of the ray, added to that of the first.
pub(crate) struct AllHits<'a>(pub &'a mut Vec<(usize, Hit)>, pub usize);

impl<T: Tier, S: Simd> Query<T, S> for AllHits<'_> {
    #[inline(always)]
    fn found(&mut self, at: InFlight, hit: &Hit) {
        self.0.push((self.1 + at.ray, *hit));
    }
}
