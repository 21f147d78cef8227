//! The hits of a packet that f32 does not decide: tested by the tier, a group of rays at once where it can
//! ([`Tier::hit_triangle_n`]), or by the side of a triangle's plane in f64 ([`TrianglePlane`]).

use super::Packet;
use super::hits::{BestHit, is_resolved, is_unresolved};
use crate::bvh::wide::layout::Wide;
use crate::bvh::wide::single::leaf::hit_triangle;
use crate::geometry::lanes::{HitN, LANES4, MAX_LANES};
use crate::geometry::plane::TrianglePlane;
use crate::geometry::simd::{Simd, Vector};
use crate::geometry::{Hit, HitBuffer, NO_PRIMITIVE, PreparedRay, Ray, SlotId, Tier};

impl<T: Tier, S: Simd, const ANY: bool> Packet<'_, T, S, ANY> {
    /// Records certain hits of rays of a block between two depths, on a triangle given by slot, corners and the sign
    /// for [`TrianglePlane::new`]. Returns the rays that must still be tested, and whether a best hit changed.
    #[inline(always)]
    pub(super) fn record_certain(
        &mut self,
        block: usize,
        certain: u32,
        (slot, corners, sign): (SlotId, &[[f64; 3]; 3], f64),
        depths: [S::F; 2],
    ) -> (u32, bool) {
        let [nearer, farther] = self.scratch.best.compare(block, depths);
        // Nearer to the apex the hit may be outside of the ray.
        let within = certain & S::F::splat(self.frustum.inner_depth).le(depths[0]);
        let nearer = nearer & within;
        let mut unknown = certain & !(nearer | farther);
        if !ANY {
            if nearer != 0 {
                self.scratch.best.set_unresolved(block, nearer, slot.index(), depths);
            }
            return (unknown, nearer != 0);
        }
        let mut hit = nearer;
        if unknown & within != 0 {
            // Shadow rays start close to the surface that they leave: f64 decides on which side of the triangle.
            let plane = TrianglePlane::new(corners, sign);
            for half in 0..2 {
                let tested = unknown & within & (S::D::ALL << (half * S::D::LANES));
                if tested == 0 {
                    continue;
                }
                let origins = self.rays.origin_lanes::<S::D>(block * S::F::LANES + half * S::D::LANES);
                let [before, beyond] = plane.sides(origins);
                unknown &= !((before | beyond) << (half * S::D::LANES) & tested);
                hit |= beyond << (half * S::D::LANES) & tested;
            }
        }
        if hit != 0 {
            self.retire(block, hit);
        }
        (unknown, hit != 0)
    }

    /// Tests some rays of a block, half of it at once, and records their hits. `test` tests a group of rays from an
    /// index on; `hit` makes the hit of a ray from a lane of the result. Returns whether a best hit changed.
    #[inline(always)]
    pub(super) fn test_block(
        &mut self,
        wide: &Wide<T>,
        block: usize,
        rays: u32,
        test: impl Fn(&mut Self, usize) -> HitN<S::D>,
        hit: impl Fn(&Self, usize, &HitN<S::D>, usize) -> Option<Hit>,
    ) -> bool {
        let mut changed = false;
        for half in 0..2 {
            let tested = rays >> (half * S::D::LANES) & S::D::ALL;
            if tested == 0 {
                continue;
            }
            let first = block * S::F::LANES + half * S::D::LANES;
            let group = test(self, first);
            let mut lanes = (group.hit | group.undecided) & tested;
            while lanes != 0 {
                let place = lanes.trailing_zeros() as usize % S::D::LANES;
                lanes &= lanes - 1;
                let Some(hit) = hit(self, first + place, &group, place) else { continue };
                changed |= self.record(wide, first + place, &hit);
            }
        }
        changed
    }

    /// The given rays of a block without those whose best hit is already on triangle `prim`, which may be in several
    /// slots.
    #[inline(always)]
    pub(super) fn without_known(&self, wide: &Wide<T>, block: usize, mut rays: u32, prim: u32) -> u32 {
        if ANY {
            return rays;
        }
        let mut left = rays;
        while rays != 0 {
            let lane = rays.trailing_zeros() as usize % S::F::LANES;
            rays &= rays - 1;
            let is_known = match self.scratch.best.get(block * S::F::LANES + lane) {
                BestHit::None => false,
                BestHit::Unresolved(slot) => wide.prim_in(slot.index()) == prim,
                BestHit::Resolved(hit) => hit.prim.0 == prim,
            };
            left &= !(u32::from(is_known) << lane);
        }
        left
    }

    /// Records a hit found by the tier. Returns whether it is the new best hit.
    #[inline(always)]
    fn record(&mut self, wide: &Wide<T>, ray: usize, hit: &Hit) -> bool {
        if ANY {
            self.retire(ray / S::F::LANES, 1 << (ray % S::F::LANES));
            return true;
        }
        let best = match self.scratch.best.get(ray) {
            BestHit::None => None,
            BestHit::Resolved(hit) => Some(hit),
            BestHit::Unresolved(slot) => {
                let best = hit_in_slot(wide, &self.rays.get(ray), slot);
                match &best {
                    Some(best) => self.scratch.best.resolve(ray, best),
                    None => self.is_inconsistent = true,
                }
                best
            }
        };
        if !wide.is_better(|| self.rays.get(ray), hit, best.as_ref()) {
            return false;
        }
        let depths = self.scratch.rays.depths_at(ray, hit.t);
        self.scratch.best.set_resolved(ray, hit, depths);
        true
    }
}

impl<T: Tier, S: Simd> Packet<'_, T, S, false> {
    /// Tests the unresolved best hits and appends the best hits of all rays. `false`, with nothing appended, if the
    /// tier missed a triangle that f32 certainly hit.
    #[inline(always)]
    pub(super) fn resolve_all(&mut self, wide: &Wide<T>, hits: &mut HitBuffer) -> bool {
        let before = hits.len();
        hits.reserve(self.rays.len());
        for first in (0..self.rays.len()).step_by(S::D::LANES) {
            self.prefetch_following(
                #[inline(always)]
                |index| hits.prefetch(before + index),
            );
            if T::IS_FAST {
                self.append_fast(wide, first, hits);
            } else {
                self.resolve_group(wide, first, hits);
            }
        }
        if self.is_inconsistent {
            hits.resize(before);
        }
        !self.is_inconsistent
    }

    /// Tests the unresolved best hits of a group of rays, and appends their best hits.
    #[inline(always)]
    fn resolve_group(&mut self, wide: &Wide<T>, first: usize, hits: &mut HitBuffer) {
        let count = S::D::LANES.min(self.rays.len() - first);
        let (mut slots, mut unresolved, mut resolved) = ([0; MAX_LANES], 0u32, 0u32);
        for (lane, to) in slots.iter_mut().enumerate().take(S::D::LANES) {
            let slot = self.scratch.best.slot(first + lane);
            unresolved |= u32::from(is_unresolved(slot)) << lane;
            resolved |= u32::from(is_resolved(slot)) << lane;
            *to = slot;
        }
        let all = u32::MAX >> (u32::BITS as usize - count);
        unresolved &= all;
        let (mut group, mut prims) = (HitN::NONE, [NO_PRIMITIVE; MAX_LANES]);
        if unresolved != 0 {
            // Other lanes are tested against any of the triangles.
            let some = slots[unresolved.trailing_zeros() as usize % MAX_LANES];
            let mut is_one = true;
            for (lane, slot) in slots.iter_mut().enumerate() {
                *slot = if unresolved >> lane & 1 != 0 { *slot } else { some };
                is_one &= *slot == some;
            }
            let place = |slot: u32| (&wide.triangles[slot as usize / LANES4], slot as usize % LANES4);
            let prepared = self.prepared(first / S::D::LANES);
            if is_one {
                let (leaf, lane) = place(some);
                group = T::hit_triangle_n(prepared, &leaf.corners.corners_f64(lane), true);
                prims = [leaf.ids[lane]; MAX_LANES];
            } else {
                let triangles = slots.map(place);
                group = T::hit_triangles_n(
                    prepared,
                    #[inline(always)]
                    |lane| (&triangles[lane].0.corners, triangles[lane].1),
                );
                prims = triangles.map(|(leaf, lane)| leaf.ids[lane]);
            }
            group.hit &= unresolved;
            for (lane, prim) in prims.iter_mut().enumerate() {
                *prim = if group.hit >> lane & 1 != 0 { *prim } else { NO_PRIMITIVE };
            }
        }
        let before = hits.len();
        hits.append(count, &prims, &slots, &group);
        // One by one: what the tier found before, and what it must decide by the test for one ray.
        let mut others = (resolved | unresolved & !group.hit) & all;
        while others != 0 {
            let lane = others.trailing_zeros() as usize % MAX_LANES;
            others &= others - 1;
            let hit = match self.scratch.best.get(first + lane) {
                BestHit::None => None,
                BestHit::Resolved(hit) => Some(hit),
                BestHit::Unresolved(slot) => {
                    let hit = hit_in_slot(wide, &self.rays.get(first + lane), slot);
                    self.is_inconsistent |= hit.is_none();
                    hit
                }
            };
            hits.set(before + lane, hit.as_ref());
        }
    }
}

/// The tier's hit of a ray on the triangle in a slot.
pub(crate) fn hit_in_slot<T: Tier>(wide: &Wide<T>, ray: &Ray, slot: SlotId) -> Option<Hit> {
    hit_triangle::<T>(&T::Prepared::new(ray), ray, &wide.triangles[slot.index() as usize / LANES4], slot)
}
