//! [`Preorder`]: the builder's binary tree in preorder, with subtrees of a few primitives turned into leaves.
//!
//! The builder's nodes are in no useful order, and most of them are within such leaves. They are read once, here;
//! [`super::collapse`] and [`super::convert`](mod@super::convert) read this list sequentially.

use obvhs::bvh2::Bvh2;

use crate::geometry::Bounds;
use crate::geometry::simd::prefetch;

/// The nodes in preorder, and the primitives of the leaves.
pub(crate) struct Preorder {
    /// The nodes. The root is the first.
    pub entries: Vec<Entry>,
    /// The primitives of the leaves, as indices into the tree's list of primitives.
    pub primitives: Vec<u32>,
}

/// A node. Its first child is the next entry.
#[derive(Clone, Copy)]
pub(crate) struct Entry {
    /// Its bounds.
    pub bounds: Bounds,
    /// Its children or primitives.
    pub content: EntryContent,
}

/// The children or primitives of an [`Entry`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum EntryContent {
    /// Two children; this is the index of the second.
    Inner(u32),
    /// A leaf of triangles, or of a tree over boxes: the first of [`Preorder::primitives`] and their number.
    Triangles(u32, u32),
    /// A leaf of analytic shapes, likewise.
    Analytic(u32, u32),
}

impl EntryContent {
    fn leaf(shapes: bool, first: u32, count: u32) -> Self {
        if shapes { EntryContent::Analytic(first, count) } else { EntryContent::Triangles(first, count) }
    }
}

impl Entry {
    /// Whether it is a leaf.
    #[inline(always)]
    pub(crate) fn is_leaf(&self) -> bool {
        !matches!(self.content, EntryContent::Inner(_))
    }
}

/// An ancestor of the node that is read.
struct Ancestor {
    entry: usize,
    /// The number of primitives before it.
    first: u32,
    /// Its second child, until that is read.
    second: Option<u32>,
}

impl Preorder {
    /// The preorder of a tree with one primitive per leaf, with leaves of up to `most` primitives. `is_analytic` gets
    /// indices into the tree's list of primitives. Not recursive: the tree may be of any depth.
    pub(crate) fn new(tree: &Bvh2, most: usize, is_analytic: impl Fn(u32) -> bool) -> Self {
        // The usual size of meshes; the list grows if necessary.
        let entries = Vec::with_capacity(tree.nodes.len() / 3);
        let mut preorder = Preorder { entries, primitives: Vec::with_capacity(tree.primitive_indices.len()) };
        let Preorder { entries, primitives } = &mut preorder;
        let mut ancestors: Vec<Ancestor> = Vec::new();
        let mut next = (!tree.nodes.is_empty()).then_some(0);
        while let Some(index) = next {
            let node = &tree.nodes[index as usize];
            // The children of the sibling are read after this subtree. If the sibling is a leaf, the index is of
            // another list and the prefetch useless.
            if let Some(above) = ancestors.last()
                && let Some(second) = above.second
            {
                prefetch(&tree.nodes, tree.nodes[second as usize].first_index as usize);
            }
            let (bounds, first) = (Bounds { min: node.min, max: node.max }, primitives.len() as u32);
            if !node.is_leaf() {
                ancestors.push(Ancestor { entry: entries.len(), first, second: Some(node.first_index + 1) });
                entries.push(Entry { bounds, content: EntryContent::Inner(0) });
                next = Some(node.first_index);
                continue;
            }
            debug_assert_eq!(node.prim_count, 1);
            entries
                .push(Entry { bounds, content: EntryContent::leaf(is_analytic(node.first_index), first, 1) });
            primitives.push(node.first_index);
            // Up to the nearest ancestor whose second child was not read.
            next = loop {
                let Some(above) = ancestors.last_mut() else { break None };
                if let Some(second) = above.second.take() {
                    entries[above.entry].content = EntryContent::Inner(entries.len() as u32);
                    break Some(second);
                }
                try_leaf(entries, above, primitives.len() as u32, most);
                ancestors.pop();
            };
        }
        preorder
    }
}

/// Turns a node into a leaf if its at most `most` primitives, counting parts of split ones, are all triangles or all
/// analytic shapes.
fn try_leaf(entries: &mut Vec<Entry>, node: &Ancestor, primitives: u32, most: usize) {
    let (count, EntryContent::Inner(second)) = (primitives - node.first, entries[node.entry].content) else {
        return;
    };
    if count as usize > most {
        return;
    }
    let shapes = match (entries[node.entry + 1].content, entries[second as usize].content) {
        (EntryContent::Triangles(..), EntryContent::Triangles(..)) => false,
        (EntryContent::Analytic(..), EntryContent::Analytic(..)) => true,
        _ => return,
    };
    entries.truncate(node.entry + 1);
    entries[node.entry].content = EntryContent::leaf(shapes, node.first, count);
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use obvhs::bvh2::node::Bvh2Node;

    /// The tree ((8 7) (6 5)) ((4 3) (2 (1 0))) of primitive indices, level by level. The bounds of node i have
    /// length i.
    fn preorder(is_analytic: impl Fn(u32) -> bool) -> Preorder {
        // The first child of a node, or minus 1 minus the primitive of a leaf.
        let nodes = [1i32, 3, 5, 7, 9, 11, 13, -9, -8, -7, -6, -5, -4, -3, 15, -2, -1].map(|first| {
            let (first_index, prim_count) = if first > 0 { (first as u32, 0) } else { (!first as u32, 1) };
            Bvh2Node { first_index, prim_count, ..Bvh2Node::default() }
        });
        let boxed = |(number, node): (u8, Bvh2Node)| Bvh2Node { max: Vec3::splat(number.into()), ..node };
        let nodes = (0..).zip(nodes).map(boxed).collect();
        let tree = Bvh2 { nodes, primitive_indices: (0..9).collect(), ..Bvh2::default() };
        Preorder::new(&tree, 4, is_analytic)
    }

    fn contents(preorder: &Preorder) -> Vec<EntryContent> {
        preorder.entries.iter().map(|entry| entry.content).collect()
    }

    #[test]
    fn leaves_hold_all_that_fits() {
        let preorder = preorder(|_| false);
        assert_eq!(preorder.primitives, [8, 7, 6, 5, 4, 3, 2, 1, 0]);
        // Leaves of four, two and three.
        let EntryContent::Inner(2) = preorder.entries[0].content else { panic!("{:?}", contents(&preorder)) };
        let leaves = [(0, 4), (4, 2), (6, 3)].map(|(first, count)| EntryContent::Triangles(first, count));
        assert_eq!(
            contents(&preorder),
            [EntryContent::Inner(2), leaves[0], EntryContent::Inner(4), leaves[1], leaves[2]]
        );
        let boxes: Vec<f32> = preorder.entries.iter().map(|entry| entry.bounds.max.x).collect();
        assert_eq!(boxes, [0.0, 1.0, 2.0, 5.0, 6.0]);
    }

    #[test]
    fn triangles_and_shapes_do_not_mix() {
        // The first two primitives are analytic shapes, and the last but one.
        let preorder = preorder(|place| [8, 7, 1].contains(&place));
        let (inner, triangles, shapes) =
            (EntryContent::Inner, EntryContent::Triangles, EntryContent::Analytic);
        let expected = [
            inner(4),
            inner(3),
            shapes(0, 2),
            triangles(2, 2),
            inner(6),
            triangles(4, 2),
            inner(8),
            triangles(6, 1),
            inner(10),
            shapes(7, 1),
            triangles(8, 1),
        ];
        assert_eq!(contents(&preorder), expected);
    }

    #[test]
    fn nothing_has_no_entries() {
        assert!(Preorder::new(&Bvh2::default(), 4, |_| false).entries.is_empty());
    }

    /// A chain of 100,000 nodes with one leaf each, which would overflow the stack of a recursive function.
    #[test]
    fn deep_trees_do_not_overflow_the_stack() {
        let most = 100_000;
        let mut nodes = vec![Bvh2Node { first_index: 1, ..Bvh2Node::default() }];
        for index in 1..=most {
            let inner = Bvh2Node { first_index: 2 * index + 1, ..Bvh2Node::default() };
            let leaf = Bvh2Node { prim_count: 1, first_index: index - 1, ..Bvh2Node::default() };
            let last = Bvh2Node { first_index: most, ..leaf };
            nodes.extend([if index == most { last } else { inner }, leaf]);
        }
        let tree = Bvh2 { nodes, primitive_indices: (0..=most).collect(), ..Bvh2::default() };
        let preorder = Preorder::new(&tree, 4, |_| false);
        assert_eq!(preorder.primitives.len(), 1 + most as usize);
        // The last four primitives share a leaf; every other has a leaf and a node.
        assert_eq!(preorder.entries.len(), 2 * (most as usize - 3) + 1);
    }
}
