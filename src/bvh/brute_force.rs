//! Every primitive, every time: the oracle that the acceleration structures are held to.

use super::{Accelerator, Description, PrimitiveTest, Slot, Traversal};
use crate::geometry::{Hit, Ray};

/// No structure at all.
pub struct BruteForce {
    slots: Vec<Slot>,
}

impl BruteForce {
    /// Over the given primitives, in any order.
    pub fn new(slots: Vec<Slot>) -> Self {
        BruteForce { slots }
    }
}

impl Accelerator for BruteForce {
    fn closest_hit(&self, ray: &Ray, traversal: &mut Traversal) -> Option<Hit> {
        let mut test = PrimitiveTest::new(ray);
        traversal.tests.primitives += self.slots.len() as u64;
        let hits = (0..).zip(&self.slots).filter_map(|(index, slot)| test.hit(slot, index));
        hits.reduce(|best, hit| if hit.is_before(&best) { hit } else { best })
    }

    fn is_occluded(&self, ray: &Ray, traversal: &mut Traversal) -> bool {
        let mut test = PrimitiveTest::new(ray);
        traversal.tests.primitives += self.slots.len() as u64;
        self.slots.iter().any(|slot| test.hit(slot, 0).is_some())
    }

    fn slots(&self) -> &[Slot] {
        &self.slots
    }

    fn describe(&self) -> Description {
        let slots = self.slots.len();
        Description { layout: "brute-force", nodes: 0, slots, bytes: slots * size_of::<Slot>() }
    }
}
