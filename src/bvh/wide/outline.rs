//! A binary tree as nodes of eight need it: in preorder, and without what is within their leaves.
//!
//! The builder's nodes lie in no order that anything else goes by, and most of them are within leaves. So they are read once, and everything
//! after that reads this, from one end to the other.

use obvhs::bvh2::Bvh2;

use crate::geometry::Bounds;
use crate::geometry::quad::LANES;
use crate::geometry::simd::prefetch;

/// The nodes, every one before those below it, those of its first child first; and what their leaves hold.
pub struct Outline {
    /// The nodes.
    pub entries: Vec<Entry>,
    /// The tree's primitives, leaf by leaf, by their places in its list.
    pub held: Vec<u32>,
}

/// A node of the outline. Its first child is the next.
#[derive(Clone, Copy)]
pub struct Entry {
    /// Its box.
    pub bounds: Bounds,
    /// What it holds.
    pub below: Below,
}

/// What is below a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Below {
    /// Two nodes, the second of which is this.
    Two(u32),
    /// As many triangles as fit into a leaf: the first of those that are held, and how many there are.
    Triangles(u32, u32),
    /// As many spheres.
    Spheres(u32, u32),
}

impl Below {
    fn leaf(spheres: bool, first: u32, count: u32) -> Self {
        if spheres { Below::Spheres(first, count) } else { Below::Triangles(first, count) }
    }
}

impl Entry {
    /// Whether it is a leaf.
    #[inline(always)]
    pub fn is_leaf(&self) -> bool {
        !matches!(self.below, Below::Two(_))
    }
}

/// A node above the one that is looked at.
struct Open {
    entry: usize,
    /// How many primitives were held before it.
    first: u32,
    /// Its second child, while that has not been looked at.
    second: Option<u32>,
}

impl Outline {
    /// Of a tree with a primitive a leaf; `is_sphere` is asked about places in its list. Without recursion, for trees of any depth.
    pub fn new(tree: &Bvh2, is_sphere: impl Fn(u32) -> bool) -> Self {
        // As measured on meshes; there is always room for more.
        let entries = Vec::with_capacity(tree.nodes.len() / 3);
        let mut outline = Outline { entries, held: Vec::with_capacity(tree.primitive_indices.len()) };
        let Outline { entries, held } = &mut outline;
        let mut open: Vec<Open> = Vec::new();
        let mut next = (!tree.nodes.is_empty()).then_some(0);
        while let Some(index) = next {
            let node = &tree.nodes[index as usize];
            // What is below the node beside it will be read after what is below this one. Of a leaf that is a place in another
            // list: asked for in vain, and of no harm.
            if let Some(above) = open.last()
                && let Some(second) = above.second
            {
                prefetch(&tree.nodes, tree.nodes[second as usize].first_index as usize);
            }
            let (bounds, first) = (Bounds { min: node.min, max: node.max }, held.len() as u32);
            if !node.is_leaf() {
                open.push(Open { entry: entries.len(), first, second: Some(node.first_index + 1) });
                entries.push(Entry { bounds, below: Below::Two(0) });
                next = Some(node.first_index);
                continue;
            }
            debug_assert_eq!(node.prim_count, 1);
            entries.push(Entry { bounds, below: Below::leaf(is_sphere(node.first_index), first, 1) });
            held.push(node.first_index);
            // Up to where there is a second child to be looked at.
            next = loop {
                let Some(above) = open.last_mut() else { break None };
                if let Some(second) = above.second.take() {
                    entries[above.entry].below = Below::Two(entries.len() as u32);
                    break Some(second);
                }
                close(entries, above, held.len() as u32);
                open.pop();
            };
        }
        outline
    }
}

/// Makes a leaf of a node if all below it fits into one, every part of a primitive counting.
fn close(entries: &mut Vec<Entry>, node: &Open, held: u32) {
    let (count, Below::Two(second)) = (held - node.first, entries[node.entry].below) else { return };
    if count > LANES as u32 {
        return;
    }
    let spheres = match (entries[node.entry + 1].below, entries[second as usize].below) {
        (Below::Triangles(..), Below::Triangles(..)) => false,
        (Below::Spheres(..), Below::Spheres(..)) => true,
        _ => return,
    };
    entries.truncate(node.entry + 1);
    entries[node.entry].below = Below::leaf(spheres, node.first, count);
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use obvhs::bvh2::node::Bvh2Node;

    /// Nodes level by level: ((8 7) (6 5)) ((4 3) (2 (1 0))), a place in the list of primitives each. Boxes are as long as the node's number.
    fn outline(is_sphere: impl Fn(u32) -> bool) -> Outline {
        let inner = |first: u32| Bvh2Node { first_index: first, ..Bvh2Node::default() };
        let leaf = |index: u32| Bvh2Node { prim_count: 1, first_index: index, ..Bvh2Node::default() };
        let nodes = vec![
            inner(1),
            inner(3),
            inner(5),
            inner(7),
            inner(9),
            inner(11),
            inner(13),
            leaf(8),
            leaf(7),
            leaf(6),
            leaf(5),
            leaf(4),
            leaf(3),
            leaf(2),
            inner(15),
            leaf(1),
            leaf(0),
        ];
        let boxed = |(number, node): (u8, Bvh2Node)| Bvh2Node { max: Vec3::splat(number.into()), ..node };
        let nodes = (0..).zip(nodes).map(boxed).collect();
        let tree = Bvh2 { nodes, primitive_indices: (0..9).collect(), ..Bvh2::default() };
        Outline::new(&tree, is_sphere)
    }

    fn below(outline: &Outline) -> Vec<Below> {
        outline.entries.iter().map(|entry| entry.below).collect()
    }

    #[test]
    fn leaves_hold_all_that_fits() {
        let outline = outline(|_| false);
        assert_eq!(outline.held, [8, 7, 6, 5, 4, 3, 2, 1, 0]);
        // Four, and five: of two and three.
        let Below::Two(2) = outline.entries[0].below else { panic!("{:?}", below(&outline)) };
        let leaves = [(0, 4), (4, 2), (6, 3)].map(|(first, count)| Below::Triangles(first, count));
        assert_eq!(below(&outline), [Below::Two(2), leaves[0], Below::Two(4), leaves[1], leaves[2]]);
        let boxes: Vec<f32> = outline.entries.iter().map(|entry| entry.bounds.max.x).collect();
        assert_eq!(boxes, [0.0, 1.0, 2.0, 5.0, 6.0]);
    }

    #[test]
    fn triangles_and_spheres_do_not_mix() {
        // The first two are spheres, and the last but one.
        let outline = outline(|place| [8, 7, 1].contains(&place));
        let (two, triangles, spheres) = (Below::Two, Below::Triangles, Below::Spheres);
        let expected = [
            two(4),
            two(3),
            spheres(0, 2),
            triangles(2, 2),
            two(6),
            triangles(4, 2),
            two(8),
            triangles(6, 1),
            two(10),
            spheres(7, 1),
            triangles(8, 1),
        ];
        assert_eq!(below(&outline), expected);
    }

    #[test]
    fn nothing_has_no_entries() {
        assert!(Outline::new(&Bvh2::default(), |_| false).entries.is_empty());
    }

    /// A chain of a hundred thousand, which recursion would not survive: every second child is a leaf.
    #[test]
    fn depth_is_no_matter() {
        let most = 100_000;
        let mut nodes = vec![Bvh2Node { first_index: 1, ..Bvh2Node::default() }];
        for index in 1..=most {
            let inner = Bvh2Node { first_index: 2 * index + 1, ..Bvh2Node::default() };
            let leaf = Bvh2Node { prim_count: 1, first_index: index - 1, ..Bvh2Node::default() };
            let last = Bvh2Node { first_index: most, ..leaf };
            nodes.extend([if index == most { last } else { inner }, leaf]);
        }
        let tree = Bvh2 { nodes, primitive_indices: (0..=most).collect(), ..Bvh2::default() };
        let outline = Outline::new(&tree, |_| false);
        assert_eq!(outline.held.len(), 1 + most as usize);
        // The last four share a leaf; a leaf and a node for every other.
        assert_eq!(outline.entries.len(), 2 * (most as usize - 3) + 1);
    }
}
