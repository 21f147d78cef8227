//! obvhs's binary tree, walked with conservative boxes.
//!
//! Nodes are used as obvhs lays them out: 32 bytes each, siblings side by side, so a step reads one cache line. Boxes
//! are f32 and hold what is in them; [`BoxTest`] misses none of them; a hit's t lies within its primitive's box. So a
//! node is only ever passed over when nothing in it can come before the best hit.

use glam::{Vec3A, Vec4};
use obvhs::bvh2::node::Bvh2Node;

use super::{Accelerator, Description, PrimitiveTest, Slot, Traversal};
use crate::geometry::{BoxTest, Hit, Ray};

/// A binary tree of boxes.
#[derive(Default)]
pub struct Tree {
    nodes: Vec<Bvh2Node>,
    slots: Vec<Slot>,
}

impl Tree {
    /// A tree whose leaves refer to ranges of `slots`.
    pub(super) fn new(nodes: Vec<Bvh2Node>, slots: Vec<Slot>) -> Self {
        Tree { nodes, slots }
    }

    /// Calls `visit` with the index range of each leaf that the ray meets, nearest boxes first. `visit` returns the
    /// distance beyond which nothing counts any more.
    #[inline]
    fn walk(
        &self,
        ray: &Ray,
        traversal: &mut Traversal,
        mut visit: impl FnMut(std::ops::Range<u32>) -> Step,
    ) {
        let test = BoxTest::new(ray);
        let mut t_max = prune_distance(ray.t_max);
        let Traversal { stack, tests } = traversal;
        stack.clear();
        let Some(root) = self.nodes.first() else { return };
        tests.nodes += 1;
        if enters(&test, root, t_max).is_none() {
            return;
        }
        let mut index = 0;
        loop {
            let node = &self.nodes[index as usize];
            if node.is_leaf() {
                let leaf = node.first_index..node.first_index + node.prim_count;
                tests.primitives += leaf.len() as u64;
                match visit(leaf) {
                    Step::Stop => return,
                    Step::Prune(t) => t_max = prune_distance(t),
                    Step::Go => {}
                }
            } else {
                tests.nodes += 2;
                let (left, right) = (node.first_index, node.first_index + 1);
                let at_left = enters(&test, &self.nodes[left as usize], t_max);
                let at_right = enters(&test, &self.nodes[right as usize], t_max);
                match (at_left, at_right) {
                    (Some(l), Some(r)) => {
                        let (near, far, at_far) = if l <= r { (left, right, r) } else { (right, left, l) };
                        stack.push((far, at_far));
                        index = near;
                        continue;
                    }
                    (Some(_), None) => {
                        index = left;
                        continue;
                    }
                    (None, Some(_)) => {
                        index = right;
                        continue;
                    }
                    (None, None) => {}
                }
            }
            loop {
                match stack.pop() {
                    None => return,
                    Some((waiting, at)) if at <= t_max => {
                        index = waiting;
                        break;
                    }
                    Some(_) => {}
                }
            }
        }
    }
}

/// What to do after a leaf.
enum Step {
    /// Go on.
    Go,
    /// Go on, but not beyond this distance.
    Prune(f64),
    /// Nothing more is wanted.
    Stop,
}

/// An f32 distance that no box around a hit at `t` is entered beyond: computed entries are at most 1 + γ3 too far.
#[inline]
fn prune_distance(t: f64) -> f32 {
    (t as f32).next_up() * crate::geometry::PRUNE_MARGIN
}

#[inline(always)]
fn enters(test: &BoxTest, node: &Bvh2Node, t_max: f32) -> Option<f32> {
    let [min, max] = planes(node);
    test.enters(min, max, t_max)
}

/// A node's box. The fourth numbers of the two vectors are its count and its index, and take no part.
#[inline(always)]
fn planes(node: &Bvh2Node) -> [Vec3A; 2] {
    let [min, max]: [Vec4; 2] = bytemuck::cast(*node);
    [Vec3A::from_vec4(min), Vec3A::from_vec4(max)]
}

impl Accelerator for Tree {
    fn closest_hit(&self, ray: &Ray, traversal: &mut Traversal) -> Option<Hit> {
        let mut test = PrimitiveTest::new(ray);
        let mut best: Option<Hit> = None;
        self.walk(ray, traversal, |leaf| {
            let before = best;
            for index in leaf {
                if let Some(hit) = test.hit(&self.slots[index as usize], index)
                    && best.is_none_or(|best| hit.is_before(&best))
                {
                    best = Some(hit);
                }
            }
            match best {
                Some(hit) if best != before => Step::Prune(hit.t),
                _ => Step::Go,
            }
        });
        best
    }

    fn is_occluded(&self, ray: &Ray, traversal: &mut Traversal) -> bool {
        let mut test = PrimitiveTest::new(ray);
        let mut occluded = false;
        self.walk(ray, traversal, |leaf| {
            let slots = &self.slots[leaf.start as usize..leaf.end as usize];
            occluded = slots.iter().any(|slot| test.distance(&slot.primitive).is_some());
            if occluded { Step::Stop } else { Step::Go }
        });
        occluded
    }

    fn slots(&self) -> &[Slot] {
        &self.slots
    }

    fn describe(&self) -> Description {
        let (nodes, slots) = (self.nodes.len(), self.slots.len());
        let bytes = nodes * size_of::<Bvh2Node>() + slots * size_of::<Slot>();
        Description { layout: "bvh2", nodes, slots, bytes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_holds_its_planes_where_the_box_test_reads_them() {
        let b = obvhs::aabb::Aabb::new(glam::Vec3A::new(1.0, 2.0, 3.0), glam::Vec3A::new(4.0, 5.0, 6.0));
        let node = Bvh2Node::new(b, 7, 8);
        assert_eq!(planes(&node), [Vec3A::new(1.0, 2.0, 3.0), Vec3A::new(4.0, 5.0, 6.0)]);
    }

    #[test]
    fn the_prune_distance_is_beyond() {
        for t in [1e-40, 1e-3, 1.0, 1e5, 1e30] {
            assert!(f64::from(prune_distance(t)) > t);
        }
        assert_eq!(prune_distance(f64::INFINITY), f32::INFINITY);
        assert_eq!(prune_distance(f64::MAX), f32::INFINITY);
    }
}
