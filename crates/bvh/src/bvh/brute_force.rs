//! [`Layout::BruteForce`](super::Layout::BruteForce): every ray against every primitive, the oracle of the tests.

use super::stored_slot::StoredSlot;
use super::{Accelerator, Description, Nearby, Primitive, Traversal};
use crate::geometry::{Hit, Numerics, PreparedRay, PrimId, Ray, SlotId, Stored, Tier, TriangleHit};

/// A list of primitives.
pub(crate) struct BruteForce<T: Tier> {
    slots: Vec<StoredSlot<T::Corner>>,
}

impl<T: Tier> BruteForce<T> {
    /// A list of the given primitives, in any order.
    pub(crate) fn new(slots: Vec<StoredSlot<T::Corner>>) -> Self {
        BruteForce { slots }
    }

    /// The hits of a ray, in the order of the list.
    fn hits(&self, ray: &Ray, traversal: &mut Traversal) -> impl Iterator<Item = Hit> {
        traversal.tests.primitives += self.slots.len() as u64;
        let prepared = T::Prepared::new(ray);
        (0..).zip(&self.slots).filter_map(move |(index, slot)| {
            let TriangleHit { t, barycentrics } = match &slot.primitive {
                Stored::Triangle(corners) => T::hit_triangle(&prepared, ray, corners)?,
                Stored::Analytic(shape) => {
                    TriangleHit { t: shape.hit(ray, T::NUMERICS)?, barycentrics: [0.0; 2] }
                }
            };
            Some(Hit { t, prim: slot.id, slot: SlotId::new(index), barycentrics })
        })
    }

    /// The closest of the hits of a ray.
    fn closest(&self, ray: &Ray, hits: impl Iterator<Item = Hit>) -> Option<Hit> {
        let stored = |hit: &Hit| &self.slots[hit.slot.index() as usize].primitive;
        hits.reduce(|best, hit| {
            let is_better = T::is_before(|| *ray, [(&hit, stored(&hit)), (&best, stored(&best))]);
            if is_better { hit } else { best }
        })
    }
}

impl<T: Tier> Nearby for BruteForce<T> {
    fn every_primitive(&self, visit: &mut dyn FnMut(PrimId, Primitive)) {
        self.slots.iter().for_each(|slot| visit(slot.id, slot.primitive.into()));
    }

    fn closest_hit_by(
        &self,
        ray: &Ray,
        accepts: &mut dyn FnMut(&Hit) -> bool,
        traversal: &mut Traversal,
    ) -> Option<Hit> {
        self.closest(ray, self.hits(ray, traversal).filter(accepts))
    }
}

impl<T: Tier> Accelerator for BruteForce<T> {
    fn closest_hit(&self, ray: &Ray, traversal: &mut Traversal) -> Option<Hit> {
        self.closest(ray, self.hits(ray, traversal))
    }

    fn is_occluded(&self, ray: &Ray, traversal: &mut Traversal) -> bool {
        self.hits(ray, traversal).next().is_some()
    }

    fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>, traversal: &mut Traversal) {
        hits.extend(self.hits(ray, traversal));
    }

    fn primitive(&self, slot: SlotId) -> Primitive {
        self.slots[slot.index() as usize].primitive.into()
    }

    fn numerics(&self) -> Numerics {
        T::NUMERICS
    }

    fn describe(&self) -> Description {
        let slots = self.slots.len();
        Description {
            layout: "brute-force",
            isa: super::compiled_isa(),
            nodes: 0,
            slots,
            bytes: slots * size_of::<StoredSlot<T::Corner>>(),
        }
    }
}
