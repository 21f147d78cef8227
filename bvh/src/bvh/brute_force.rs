//! [`Layout::BruteForce`](super::Layout::BruteForce): every ray against every primitive, the oracle of the tests.

use super::stored_slot::{PrimitiveTest, StoredSlot};
use super::{Accelerator, Description, Primitive, Traversal};
use crate::geometry::{Hit, Numerics, PrimId, Ray, SlotId, Tier};

/// A list of primitives.
pub(crate) struct BruteForce<T: Tier> {
    slots: Vec<StoredSlot<T::Corner>>,
}

impl<T: Tier> BruteForce<T> {
    /// A list of the given primitives, in any order.
    pub(crate) fn new(slots: Vec<StoredSlot<T::Corner>>) -> Self {
        BruteForce { slots }
    }
}

impl<T: Tier> Accelerator for BruteForce<T> {
    fn closest_hit(&self, ray: &Ray, traversal: &mut Traversal) -> Option<Hit> {
        let mut test = PrimitiveTest::<T>::new(ray);
        traversal.tests.primitives += self.slots.len() as u64;
        test.closest(&self.slots, 0..self.slots.len() as u32, None)
    }

    fn is_occluded(&self, ray: &Ray, traversal: &mut Traversal) -> bool {
        let mut test = PrimitiveTest::<T>::new(ray);
        traversal.tests.primitives += self.slots.len() as u64;
        self.slots.iter().any(|slot| test.hit(slot, 0).is_some())
    }

    fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>, traversal: &mut Traversal) {
        let mut test = PrimitiveTest::<T>::new(ray);
        traversal.tests.primitives += self.slots.len() as u64;
        hits.extend((0..).zip(&self.slots).filter_map(|(index, slot)| test.hit(slot, index)));
    }

    fn primitive(&self, slot: SlotId) -> Primitive {
        self.slots[slot.index() as usize].primitive.into()
    }

    fn each_primitive(&self, visit: &mut dyn FnMut(PrimId, Primitive)) {
        self.slots.iter().for_each(|slot| visit(slot.id, slot.primitive.into()));
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
