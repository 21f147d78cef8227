//! [`Layout::Bvh2`](super::Layout::Bvh2): obvhs's binary tree, traversed with conservative box tests; for
//! comparisons only.
//!
//! Bounds are f32 and rounded outwards, a tier's [`BoxTest`] is conservative, and a hit's t lies within its
//! primitive's bounds. So a node is skipped only if it contains no hit before the best hit.

use std::ops::Range;

use obvhs::bvh2::node::Bvh2Node;

use super::stored_slot::{PrimitiveTest, StoredSlot};
use super::traverse::traverse;
use super::{Accelerator, Description, Next, Primitive, Quality, Traversal, VisitedNode, quality};
use crate::geometry::{BoxTest, Hit, Numerics, PrimId, Ray, SlotId, Tier, prune_distance};

/// A binary bounding volume hierarchy.
pub(crate) struct Bvh2<T: Tier> {
    nodes: Vec<Bvh2Node>,
    slots: Vec<StoredSlot<T::Corner>>,
}

impl<T: Tier> Bvh2<T> {
    /// A tree with leaves that are ranges of `slots`.
    pub(super) fn new(nodes: Vec<Bvh2Node>, slots: Vec<StoredSlot<T::Corner>>) -> Self {
        Bvh2 { nodes, slots }
    }

    /// Calls `visit` with the slots of each leaf that the ray enters, nearest boxes first.
    #[inline]
    fn each_leaf(&self, ray: &Ray, traversal: &mut Traversal, mut visit: impl FnMut(Range<u32>) -> Next) {
        let Traversal { stack, tests, .. } = traversal;
        let boxes = T::Boxes::new(ray);
        traverse(
            &self.nodes,
            prune_distance(ray.t_max),
            stack,
            &mut tests.nodes,
            |min, max, t_max| boxes.enters(min, max, t_max),
            |leaf, _| {
                tests.primitives += leaf.len() as u64;
                match visit(leaf) {
                    Next::Continue => Next::Continue,
                    Next::Shorten(t) => Next::Shorten(prune_distance(t)),
                    Next::Stop => Next::Stop,
                }
            },
        );
    }
}

impl<T: Tier> Accelerator for Bvh2<T> {
    fn closest_hit(&self, ray: &Ray, traversal: &mut Traversal) -> Option<Hit> {
        let mut test = PrimitiveTest::<T>::new(ray);
        let mut best: Option<Hit> = None;
        self.each_leaf(ray, traversal, |leaf| {
            best = test.closest(&self.slots, leaf, best);
            best.map_or(Next::Continue, |hit| Next::Shorten(hit.t))
        });
        best
    }

    fn is_occluded(&self, ray: &Ray, traversal: &mut Traversal) -> bool {
        let mut test = PrimitiveTest::<T>::new(ray);
        let mut occluded = false;
        self.each_leaf(ray, traversal, |leaf| {
            let slots = &self.slots[leaf.start as usize..leaf.end as usize];
            occluded = slots.iter().any(|slot| test.hit(slot, 0).is_some());
            if occluded { Next::Stop } else { Next::Continue }
        });
        occluded
    }

    fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>, traversal: &mut Traversal) {
        let mut test = PrimitiveTest::<T>::new(ray);
        let first = hits.len();
        self.each_leaf(ray, traversal, |leaf| {
            hits.extend(leaf.filter_map(|index| test.hit(&self.slots[index as usize], index)));
            Next::Continue
        });
        super::merge_split(hits, first);
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
        let (nodes, slots) = (self.nodes.len(), self.slots.len());
        let bytes = nodes * size_of::<Bvh2Node>() + slots * size_of::<StoredSlot<T::Corner>>();
        Description { layout: "bvh2", isa: super::compiled_isa(), nodes, slots, bytes }
    }

    fn quality(&self) -> Option<Quality> {
        let visit = |index: usize, children: &mut Vec<usize>| {
            let node = &self.nodes[index];
            if !node.is_leaf() {
                children.extend([node.first_index as usize, node.first_index as usize + 1]);
            }
            VisitedNode { area: f64::from(node.aabb().half_area()), primitives: node.prim_count as usize }
        };
        (!self.nodes.is_empty()).then(|| quality(0, visit))
    }
}
