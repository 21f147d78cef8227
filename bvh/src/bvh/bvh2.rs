//! [`Layout::Bvh2`](super::Layout::Bvh2): obvhs's binary tree, traversed with conservative box tests.
//!
//! Nodes have obvhs's layout: 32 bytes, siblings adjacent, so visiting two children reads one cache line. Bounds are
//! f32 and rounded outwards, a tier's [`BoxTest`] is conservative, and a hit's t lies within its primitive's bounds.
//! So a node is skipped only if it contains no hit before the best hit.

use glam::{Vec3A, Vec4};
use obvhs::bvh2::node::Bvh2Node;

use super::stored_slot::{PrimitiveTest, StoredSlot};
use super::{Accelerator, Description, Next, Primitive, Quality, Tests, Traversal, VisitedNode, quality};
use crate::geometry::{
    Beam, BoxTest, Hit, HitBuffer, Numerics, PACKET, PRUNE_MARGIN, Ray, Rays, SlotId, Tier, round_up,
};

/// A binary bounding volume hierarchy.
pub(crate) struct Bvh2<T: Tier> {
    nodes: Vec<Bvh2Node>,
    slots: Vec<StoredSlot<T>>,
}

impl<T: Tier> Bvh2<T> {
    /// A tree with leaves that are ranges of `slots`.
    pub(super) fn new(nodes: Vec<Bvh2Node>, slots: Vec<StoredSlot<T>>) -> Self {
        Bvh2 { nodes, slots }
    }

    /// Finds up to [`MAX_ENTRIES`] nodes, nearest first, that together contain everything that a batch of rays can
    /// hit. Coherent rays start there instead of at the root.
    fn find_entries(&self, rays: Rays, traversal: &mut Traversal) {
        let Traversal { entries, tests, .. } = traversal;
        entries.clear();
        let t_max = rays.iter().map(|ray| prune_distance(ray.t_max)).fold(0.0, f32::max);
        let (Some(beam), Some(root)) = (Beam::new(rays, t_max), self.nodes.first()) else { return };
        let enters = |node: &Bvh2Node| {
            let [min, max] = planes(node);
            beam.enters(min, max)
        };
        tests.nodes += 1;
        entries.extend(enters(root).map(|at| (0, at)));
        // Opens nodes in order until there are enough, or all are leaves.
        let mut next = 0;
        while next < entries.len() && entries.len() < MAX_ENTRIES {
            let node = &self.nodes[entries[next].0 as usize];
            if node.is_leaf() {
                next += 1;
                continue;
            }
            entries.swap_remove(next);
            tests.nodes += 2;
            for child in [node.first_index, node.first_index + 1] {
                entries.extend(enters(&self.nodes[child as usize]).map(|at| (child, at)));
            }
        }
        entries.sort_unstable_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    }

    /// Calls `visit` with the slots of each leaf below `entries` that the ray enters: one entry after the other,
    /// nearest boxes first within each.
    #[inline]
    fn traverse(
        &self,
        ray: &Ray,
        entries: &[(u32, f32)],
        stack: &mut Vec<(u32, f32)>,
        tests: &mut Tests,
        mut visit: impl FnMut(std::ops::Range<u32>) -> Next,
    ) {
        if entries.is_empty() {
            return;
        }
        let test = T::Boxes::new(ray);
        let mut t_max = prune_distance(ray.t_max);
        for &(entry, _) in entries {
            tests.nodes += 1;
            if enters(&test, &self.nodes[entry as usize], t_max).is_none() {
                continue;
            }
            stack.clear();
            let mut index = entry;
            loop {
                if let Some(leaf) = self.descend(index, &test, t_max, stack, tests) {
                    tests.primitives += leaf.len() as u64;
                    match visit(leaf) {
                        Next::Stop => return,
                        Next::Shorten(t) => t_max = prune_distance(t),
                        Next::Continue => {}
                    }
                }
                index = loop {
                    match stack.pop() {
                        Some((waiting, at)) if at <= t_max => break waiting,
                        Some(_) => {}
                        None => break NO_NODE,
                    }
                };
                if index == NO_NODE {
                    break;
                }
            }
        }
    }

    /// Descends from a node to a leaf, to the nearer child first, and pushes farther ones. `None` if neither child of
    /// a node is entered.
    #[inline(always)]
    fn descend(
        &self,
        mut index: u32,
        test: &T::Boxes,
        t_max: f32,
        stack: &mut Vec<(u32, f32)>,
        tests: &mut Tests,
    ) -> Option<std::ops::Range<u32>> {
        loop {
            let node = &self.nodes[index as usize];
            if node.is_leaf() {
                return Some(node.first_index..node.first_index + node.prim_count);
            }
            tests.nodes += 2;
            let (left, right) = (node.first_index, node.first_index + 1);
            let at_left = enters(test, &self.nodes[left as usize], t_max);
            let at_right = enters(test, &self.nodes[right as usize], t_max);
            index = match (at_left, at_right) {
                (Some(l), Some(r)) => {
                    let (near, far, at_far) = if l <= r { (left, right, r) } else { (right, left, l) };
                    stack.push((far, at_far));
                    near
                }
                (Some(_), None) => left,
                (None, Some(_)) => right,
                (None, None) => return None,
            };
        }
    }

    #[inline]
    fn closest_below(
        &self,
        ray: &Ray,
        entries: &[(u32, f32)],
        stack: &mut Vec<(u32, f32)>,
        tests: &mut Tests,
    ) -> Option<Hit> {
        let mut test = PrimitiveTest::<T>::new(ray);
        let mut best: Option<Hit> = None;
        self.traverse(ray, entries, stack, tests, |leaf| {
            let before = best;
            for index in leaf {
                if let Some(hit) = test.hit(&self.slots[index as usize], index)
                    && test.is_better(&hit, best.as_ref(), &self.slots)
                {
                    best = Some(hit);
                }
            }
            match best {
                Some(hit) if best != before => Next::Shorten(hit.t),
                _ => Next::Continue,
            }
        });
        best
    }

    #[inline]
    fn occluded_below(
        &self,
        ray: &Ray,
        entries: &[(u32, f32)],
        stack: &mut Vec<(u32, f32)>,
        tests: &mut Tests,
    ) -> bool {
        let mut test = PrimitiveTest::<T>::new(ray);
        let mut occluded = false;
        self.traverse(ray, entries, stack, tests, |leaf| {
            let slots = &self.slots[leaf.start as usize..leaf.end as usize];
            occluded = slots.iter().any(|slot| test.hit(slot, 0).is_some());
            if occluded { Next::Stop } else { Next::Continue }
        });
        occluded
    }

    /// The entry of a single ray: the root, if there is one.
    fn root(&self) -> &'static [(u32, f32)] {
        if self.nodes.is_empty() { &[] } else { &[(0, 0.0)] }
    }
}

/// The index of no node.
const NO_NODE: u32 = u32::MAX;

/// The most nodes at which a packet of rays starts. Measurements: docs/decisions.md.
const MAX_ENTRIES: usize = 8;

/// An f32 distance beyond which no box around a hit at `t` is entered: computed entry distances are at most 1 + γ3
/// too far.
#[inline]
fn prune_distance(t: f64) -> f32 {
    round_up(t) * PRUNE_MARGIN
}

#[inline(always)]
fn enters(test: &impl BoxTest, node: &Bvh2Node, t_max: f32) -> Option<f32> {
    let [min, max] = planes(node);
    test.enters(min, max, t_max)
}

/// A node's bounds. The fourth components of the two vectors are its count and index, which are ignored.
#[inline(always)]
fn planes(node: &Bvh2Node) -> [Vec3A; 2] {
    let [min, max]: [Vec4; 2] = bytemuck::cast(*node);
    [Vec3A::from_vec4(min), Vec3A::from_vec4(max)]
}

impl<T: Tier> Accelerator for Bvh2<T> {
    fn closest_hit(&self, ray: &Ray, traversal: &mut Traversal) -> Option<Hit> {
        self.closest_below(ray, self.root(), &mut traversal.stack, &mut traversal.tests)
    }

    fn is_occluded(&self, ray: &Ray, traversal: &mut Traversal) -> bool {
        self.occluded_below(ray, self.root(), &mut traversal.stack, &mut traversal.tests)
    }

    fn closest_hits(&self, rays: Rays, hits: &mut HitBuffer, traversal: &mut Traversal) {
        for rays in rays.chunks(PACKET) {
            self.find_entries(rays, traversal);
            let Traversal { stack, entries, tests, .. } = traversal;
            rays.iter().for_each(|ray| hits.push(self.closest_below(&ray, entries, stack, tests).as_ref()));
        }
    }

    fn are_occluded(&self, rays: Rays, occluded: &mut Vec<bool>, traversal: &mut Traversal) {
        for rays in rays.chunks(PACKET) {
            self.find_entries(rays, traversal);
            let Traversal { stack, entries, tests, .. } = traversal;
            occluded.extend(rays.iter().map(|ray| self.occluded_below(&ray, entries, stack, tests)));
        }
    }

    fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>, traversal: &mut Traversal) {
        let Traversal { stack, tests, .. } = traversal;
        let mut test = PrimitiveTest::<T>::new(ray);
        let first = hits.len();
        self.traverse(ray, self.root(), stack, tests, |leaf| {
            hits.extend(leaf.filter_map(|index| test.hit(&self.slots[index as usize], index)));
            Next::Continue
        });
        // A split triangle is in several slots.
        let mut found = hits.split_off(first);
        found.sort_unstable_by_key(|hit| hit.prim);
        found.dedup_by_key(|hit| hit.prim);
        hits.append(&mut found);
    }

    fn primitive(&self, slot: SlotId) -> Primitive {
        self.slots[slot.index() as usize].primitive()
    }

    fn numerics(&self) -> Numerics {
        T::NUMERICS
    }

    fn describe(&self) -> Description {
        let (nodes, slots) = (self.nodes.len(), self.slots.len());
        let bytes = nodes * size_of::<Bvh2Node>() + slots * size_of::<StoredSlot<T>>();
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_has_its_planes_where_the_box_test_reads_them() {
        let b = obvhs::aabb::Aabb::new(glam::Vec3A::new(1.0, 2.0, 3.0), glam::Vec3A::new(4.0, 5.0, 6.0));
        let node = Bvh2Node::new(b, 7, 8);
        assert_eq!(planes(&node), [Vec3A::new(1.0, 2.0, 3.0), Vec3A::new(4.0, 5.0, 6.0)]);
    }

    #[test]
    fn the_prune_distance_is_beyond() {
        for t in [1e-40, 1e-3, 1.0, 1e5, 1e30] {
            assert!(f64::from(prune_distance(t)) >= t);
        }
        assert_eq!(prune_distance(f64::INFINITY), f32::INFINITY);
        assert_eq!(prune_distance(f64::MAX), f32::INFINITY);
    }
}
