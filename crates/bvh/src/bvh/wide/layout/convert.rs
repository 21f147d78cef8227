//! [`convert()`] and [`Tree::new`]: from obvhs's binary tree to nodes of eight children.

use std::ops::Range;

use crate::threads::*;
use obvhs::bvh2::Bvh2;

use super::collapse::Collapse;
use super::node::{Child, Node};
use super::preorder::{Entry, EntryContent, Preorder};
use super::{TriangleLeaf, Wide};
use crate::bvh::build::MIN_PARALLEL;
use crate::bvh::stored_slot::{Slots, StoredSlot};
use crate::bvh::wide::all_pairs::SmallLeafBatch;
use crate::geometry::lanes::LANES4;
use crate::geometry::simd::InstructionSet;
use crate::geometry::{Corner, NO_PRIMITIVE, Stored, Tier, Triangle4};

/// The primitives of a leaf: a range of [`Preorder::primitives`].
type LeafSlots = Range<u32>;

/// Converts a binary tree with one primitive per leaf. [`Bvh2::primitive_indices`] are indices into
/// `slots`; parts of a triangle have the same.
///
/// Nodes are written by one thread, triangles in parallel. The result does not depend on the number of threads.
pub(crate) fn convert<T: Tier>(
    tree: Bvh2,
    slots: &dyn Slots<T::Corner>,
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
    let is_analytic = |slot: u32| matches!(slots.get(slot).primitive, Stored::Analytic(_));
    let shapes: Vec<bool> = (0..slots.len() as u32).map(is_analytic).collect();
    let Preorder { entries, primitives: mut members } = if shapes.contains(&true) {
        Preorder::new(&tree, LANES4, |place| shapes[slot_of(place) as usize])
    } else {
        Preorder::new(&tree, LANES4, |_| false)
    };
    // In a loop of its own, so that the memory accesses overlap.
    for place in &mut members {
        *place = slot_of(*place);
    }
    // Half of the memory of what is built next.
    drop(tree);
    let members = members;
    let mut leaves: Vec<LeafSlots> = Vec::with_capacity(entries.len() / 2 + 1);
    (wide.nodes, wide.depth) = write_nodes(&entries, |first, count, is_analytic| {
        if !is_analytic {
            leaves.push(first..first + count);
            return Child::leaf(leaves.len() - 1, 1, false);
        }
        let (lanes, count) = in_order(&members, first..first + count);
        let first = wide.analytic.len();
        wide.analytic.extend(lanes[..count].iter().filter_map(|&slot| {
            let StoredSlot { primitive, id } = slots.get(slot);
            match primitive {
                Stored::Analytic(shape) => Some((Some(shape), id)),
                Stored::Triangle(_) => None,
            }
        }));
        Child::leaf(first, count, true)
    });
    let leaf = |(index, leaf): (usize, &LeafSlots)| {
        if let Some(soon) = leaves.get(index + PREFETCH_AHEAD) {
            members[soon.start as usize..soon.end as usize].iter().for_each(|&slot| slots.prefetch(slot));
        }
        TriangleLeaf::new(in_order(&members, leaf.clone()), slots)
    };
    wide.triangles = leaves.par_iter().enumerate().with_min_len(MIN_PARALLEL).map(leaf).collect();
    wide.batch = SmallLeafBatch::new(&wide);
    wide
}

/// A tree of eight children per node over boxes alone.
pub(crate) struct Tree {
    /// As [`Wide::nodes`].
    pub nodes: Vec<Node>,
    /// As [`Wide::depth`].
    pub depth: usize,
}

impl Tree {
    /// Converts a binary tree with one box per leaf to one of up to `most` boxes per leaf. Also returns the indices of
    /// the boxes in the order of the leaves, which are ranges of that list.
    pub(crate) fn new(tree: &Bvh2, most: usize) -> (Self, Vec<u32>) {
        let Preorder { entries, primitives } = Preorder::new(tree, most, |_| false);
        let leaf = |first: u32, count: u32, _| Child::leaf(first as usize, count as usize, false);
        let (nodes, depth) = if entries.is_empty() { (Vec::new(), 0) } else { write_nodes(&entries, leaf) };
        let order = primitives.into_iter().map(|place| tree.primitive_indices[place as usize]).collect();
        (Tree { nodes, depth }, order)
    }
}

/// The nodes, and the number of them on the longest path from the root. `leaf` returns the reference to a leaf of the
/// primitives from the first of [`Preorder::primitives`] on, of their number, and whether they are analytic shapes.
fn write_nodes(entries: &[Entry], mut leaf: impl FnMut(u32, u32, bool) -> Child) -> (Vec<Node>, usize) {
    let collapse = Collapse::new(entries);
    // The usual size of meshes; the list grows if necessary.
    let mut nodes = Vec::with_capacity(entries.len() / 6 + 1);
    nodes.push(Node::EMPTY);
    let mut deepest = 0;
    // An entry, the index of its wide node, and the depth of that.
    let mut stack = vec![(0u32, 0usize, 1usize)];
    while let Some((root, index, depth)) = stack.pop() {
        deepest = deepest.max(depth);
        let (children, len) = collapse.children(entries, root);
        for (place, &child) in children[..len].iter().enumerate() {
            let Entry { bounds, content } = entries[child as usize];
            let reference = match content {
                EntryContent::Inner(_) => {
                    stack.push((child, nodes.len(), depth + 1));
                    nodes.push(Node::EMPTY);
                    Child::node(nodes.len() - 1)
                }
                EntryContent::Triangles(first, count) => leaf(first, count, false),
                EntryContent::Analytic(first, count) => leaf(first, count, true),
            };
            nodes[index].set(place, bounds, reference);
        }
    }
    (nodes, deepest)
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
    fn new((members, count): ([u32; LANES4], usize), slots: &dyn Slots<C>) -> Self {
        let mut leaf = TriangleLeaf { corners: Triangle4::EMPTY, ids: [NO_PRIMITIVE; LANES4] };
        for (lane, &slot) in members[..count].iter().enumerate() {
            let StoredSlot { primitive, id } = slots.get(slot);
            if let Stored::Triangle(corners) = &primitive {
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
