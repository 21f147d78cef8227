//! What f32 cannot tell of a packet's rays: the tier is asked, four rays at once where it can ([`Tier::hit_bundle`]).

use super::best::{Best, Found};
use super::packet::{BLOCK, Packet};
use super::{Wide, hit_triangle};
use crate::geometry::bundle::{FourHits, RAYS};
use crate::geometry::quad::LANES;
use crate::geometry::simd::Simd;
use crate::geometry::{Hit, PrimId, Ray, SlotId, Tier};

impl<T: Tier> Wide<T> {
    /// The hit of a ray on the triangle in a slot.
    pub(super) fn tested(&self, ray: &Ray, slot: SlotId) -> Option<Hit> {
        hit_triangle::<T>(&T::prepare(ray), ray, &self.groups[slot.0 as usize / LANES], slot)
    }

    /// The triangle in a slot.
    #[inline(always)]
    fn prim_of(&self, slot: SlotId) -> u32 {
        self.groups[slot.0 as usize / LANES].ids[slot.0 as usize % LANES]
    }

    /// Of rays of a block those that have not found this triangle already: a large one may be kept in several places.
    #[inline(always)]
    pub(super) fn unknown_to<const ANY: bool>(
        &self,
        packet: &Packet<T, ANY>,
        block: usize,
        mut rays: u32,
        prim: u32,
    ) -> u32 {
        if ANY {
            return rays;
        }
        let mut left = rays;
        while rays != 0 {
            let lane = rays.trailing_zeros() as usize % BLOCK;
            rays &= rays - 1;
            let is_known = match packet.scratch.best.of(block * BLOCK + lane) {
                Found::Nothing => false,
                Found::Surely(slot) => self.prim_of(slot) == prim,
                Found::Hit(hit) => hit.prim.0 == prim,
            };
            left &= !(u32::from(is_known) << lane);
        }
        left
    }

    /// Takes note of a hit that was tested; whether it matters.
    #[inline(always)]
    pub(super) fn found<S: Simd, const ANY: bool>(
        &self,
        packet: &mut Packet<T, ANY>,
        ray: usize,
        hit: &Hit,
    ) -> bool {
        if ANY {
            packet.end::<S>(ray / BLOCK, 1 << (ray % BLOCK));
            return true;
        }
        let best = match packet.scratch.best.of(ray) {
            Found::Nothing => None,
            Found::Hit(hit) => Some(hit),
            Found::Surely(slot) => {
                let best = self.tested(&packet.rays[ray], slot);
                match &best {
                    Some(best) => packet.scratch.best.keep(ray, best),
                    None => packet.is_void = true,
                }
                best
            }
        };
        if !self.is_better(&packet.rays[ray], hit, best.as_ref()) {
            return false;
        }
        let depths = packet.scratch.lanes.depths_at(ray, hit.t);
        packet.scratch.best.set(ray, hit, depths);
        true
    }

    /// Tests what was surely met, and appends the best hits of all rays; `false` where something was not met after all, and
    /// nothing is appended.
    ///
    /// In one loop for each step: a step waits for its own result only once there are results of many.
    #[inline(always)]
    pub(super) fn answers<S: Simd>(
        &self,
        packet: &mut Packet<T, false>,
        hits: &mut Vec<Option<Hit>>,
    ) -> bool {
        let (rays, before) = (packet.rays, hits.len());
        let fours = rays.len().div_ceil(RAYS);
        let mut asked = 0u64;
        for index in 0..fours {
            if packet.scratch.best.slots_of(index * RAYS).into_iter().any(Best::is_slot) {
                asked |= 1 << index;
                packet.bundle::<S>(index);
            }
        }
        for index in 0..fours {
            if asked >> index & 1 != 0 {
                packet.scratch.tested[index] = self.test_four::<S>(packet, index);
            }
        }
        hits.reserve(rays.len());
        for (index, ray) in rays.iter().enumerate() {
            let best = match packet.scratch.best.of(index) {
                Found::Nothing => None,
                Found::Hit(hit) => Some(hit),
                Found::Surely(slot) => {
                    let (four, lane) = (&packet.scratch.tested[index / RAYS], index % RAYS);
                    let hit = if four.hit >> lane & 1 != 0 {
                        Some(four.at(lane, PrimId(self.prim_of(slot)), slot))
                    } else if four.unsure >> lane & 1 != 0 {
                        self.tested(ray, slot)
                    } else {
                        None
                    };
                    packet.is_void |= hit.is_none();
                    hit
                }
            };
            hits.push(best);
        }
        if packet.is_void {
            hits.truncate(before);
        }
        !packet.is_void
    }

    /// Four rays, some of which surely meet triangles, against those.
    #[inline(always)]
    fn test_four<S: Simd>(&self, packet: &mut Packet<T, false>, index: usize) -> FourHits {
        let slots = packet.scratch.best.slots_of(index * RAYS);
        let Some(some) = slots.into_iter().find(|&slot| Best::is_slot(slot)) else { return FourHits::NONE };
        // Rays that have found nothing or a hit keep the others company.
        let or_some = |slot: u32| if Best::is_slot(slot) { slot } else { some };
        let asked = [or_some(slots[0]), or_some(slots[1]), or_some(slots[2]), or_some(slots[3])];
        let place = |slot: u32| (&self.groups[slot as usize / LANES].quad, slot as usize % LANES);
        let bundle = packet.bundle::<S>(index);
        if asked == [some; RAYS] {
            let (quad, lane) = place(some);
            return T::hit_bundle::<S>(bundle, &quad.raised(lane), true);
        }
        T::hit_each::<S>(bundle, &[place(asked[0]), place(asked[1]), place(asked[2]), place(asked[3])])
    }
}
