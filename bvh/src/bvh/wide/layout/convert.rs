//! [`convert()`]: from obvhs's binary tree to nodes of eight children.

use std::ops::Range;

use obvhs::bvh2::Bvh2;
use rayon::prelude::*;

use super::collapse::Collapse;
use super::node::{Child, Node};
use super::preorder::{Entry, EntryContent, Preorder};
use super::{TriangleLeaf, Wide};
use crate::bvh::build::MIN_PARALLEL;
use crate::bvh::stored_slot::StoredSlot;
use crate::bvh::wide::all_pairs::SmallLeafBatch;
use crate::geometry::lanes::LANES4;
use crate::geometry::simd::{InstructionSet, prefetch};
use crate::geometry::{Corner, NO_PRIMITIVE, Stored, Tier, Triangle4};

/// The primitives of a leaf: a range of [`Preorder::primitives`].
type LeafSlots = Range<u32>;

/// Converts a binary tree with one primitive per leaf. [`Bvh2::primitive_indices`] are indices into
/// `slots`; parts of a triangle have the same.
///
/// Nodes are written by one thread, triangles in parallel. The result does not depend on the number of threads.
pub(crate) fn convert<T: Tier>(
    tree: &Bvh2,
    slots: &[StoredSlot<T::Corner>],
    instructions: InstructionSet,
) -> Wide<T> {
    let mut wide = Wide {
        nodes: Vec::new(),
        triangles: Vec::new(),
        analytic: Vec::new(),
        depth: 0,
        batch: None,
        instructions,
        cost_at_build: None,
    };
    if tree.nodes.is_empty() {
        return wide;
    }
    let slot_of = |place: u32| tree.primitive_indices[place as usize];
    // A list of its own, because slots are large and are accessed in random order.
    let shapes: Vec<bool> = slots.iter().map(|slot| matches!(slot.primitive, Stored::Analytic(_))).collect();
    let Preorder { entries, primitives: mut members } = if shapes.contains(&true) {
        Preorder::new(tree, |place| shapes[slot_of(place) as usize])
    } else {
        Preorder::new(tree, |_| false)
    };
    // In a loop of its own, so that the memory accesses overlap.
    for place in &mut members {
        *place = slot_of(*place);
    }
    let members = members;
    let leaves = write_nodes(&mut wide, &entries, &members, slots);
    let leaf = |(index, leaf): (usize, &LeafSlots)| {
        if let Some(soon) = leaves.get(index + PREFETCH_AHEAD) {
            members[soon.start as usize..soon.end as usize]
                .iter()
                .for_each(|&slot| prefetch(slots, slot as usize));
        }
        TriangleLeaf::new(in_order(&members, leaf.clone()), slots)
    };
    wide.triangles = leaves.par_iter().enumerate().with_min_len(MIN_PARALLEL).map(leaf).collect();
    wide.batch = SmallLeafBatch::new(&wide);
    wide
}

/// Writes the nodes and analytic shapes, and returns the slots of the triangle leaves. `members` are the slots of
/// [`Preorder::primitives`].
fn write_nodes<T: Tier>(
    wide: &mut Wide<T>,
    entries: &[Entry],
    members: &[u32],
    slots: &[StoredSlot<T::Corner>],
) -> Vec<LeafSlots> {
    let collapse = Collapse::new(entries);
    // The usual size of meshes; the lists grow if necessary.
    wide.nodes.reserve(entries.len() / 6);
    let mut leaves: Vec<LeafSlots> = Vec::with_capacity(entries.len() / 2 + 1);
    wide.nodes.push(Node::EMPTY);
    // An entry, the index of its wide node, and the depth of that.
    let mut stack = vec![(0u32, 0usize, 1usize)];
    while let Some((root, index, depth)) = stack.pop() {
        wide.depth = wide.depth.max(depth);
        let (children, len) = collapse.children(entries, root);
        for (place, &child) in children[..len].iter().enumerate() {
            let Entry { bounds, content } = entries[child as usize];
            let reference = match content {
                EntryContent::Inner(_) => {
                    let index = wide.nodes.len();
                    wide.nodes.push(Node::EMPTY);
                    stack.push((child, index, depth + 1));
                    Child::node(index)
                }
                EntryContent::Triangles(first, count) => {
                    leaves.push(first..first + count);
                    Child::leaf(leaves.len() - 1, 1, false)
                }
                EntryContent::Analytic(first, count) => {
                    let (lanes, count) = in_order(members, first..first + count);
                    let first = wide.analytic.len();
                    wide.analytic.extend(lanes[..count].iter().filter_map(|&slot| {
                        match slots[slot as usize].primitive {
                            Stored::Analytic(shape) => Some((Some(shape), slots[slot as usize].id)),
                            Stored::Triangle(_) => None,
                        }
                    }));
                    Child::leaf(first, count, true)
                }
            };
            wide.nodes[index].set(place, bounds, reference);
        }
    }
    leaves
}

/// The distance, in leaves, at which slots are prefetched: they are accessed in random order.
const PREFETCH_AHEAD: usize = 6;

/// The slots of a leaf, ascending and without duplicates, and their number.
fn in_order(slots: &[u32], members: LeafSlots) -> ([u32; LANES4], usize) {
    let (mut lanes, mut count) = ([NO_PRIMITIVE; LANES4], 0);
    for &slot in &slots[members.start as usize..members.end as usize] {
        // Parts of one triangle have the same slot.
        if !lanes[..count].contains(&slot) {
            lanes[count] = slot;
            count += 1;
        }
    }
    lanes[..count].sort_unstable();
    (lanes, count)
}

impl<C: Corner> TriangleLeaf<C> {
    fn new((members, count): ([u32; LANES4], usize), slots: &[StoredSlot<C>]) -> Self {
        let mut leaf = TriangleLeaf { corners: Triangle4::EMPTY, ids: [NO_PRIMITIVE; LANES4] };
        for (lane, &slot) in members[..count].iter().enumerate() {
            let StoredSlot { primitive, id } = &slots[slot as usize];
            if let Stored::Triangle(corners) = primitive {
                leaf.corners.set(lane, corners);
                leaf.ids[lane] = id.0;
            }
        }
        leaf
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_are_in_order_and_parts_are_one() {
        assert_eq!(in_order(&[9, 7, 3, 7, 5, 1], 1..5), ([3, 5, 7, NO_PRIMITIVE], 3));
    }
}
