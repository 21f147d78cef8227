//! From obvhs's binary tree to nodes of eight.

use obvhs::bvh2::Bvh2;

use super::super::store::StoredSlot;
use super::node::{Child, Node, WIDTH};
use super::{Group, Wide};
use crate::geometry::quad::LANES;
use crate::geometry::{Bounds, Quad, Stored, Tier};

/// What is below a node of the binary tree.
#[derive(Clone, Copy)]
struct Below {
    /// How many leaves' primitives.
    count: u32,
    /// Whether all are triangles, or all are spheres.
    pure: bool,
}

/// The most primitives that are kept together: one group of triangles.
const MOST_IN_LEAF: u32 = LANES as u32;

/// Converts a binary tree whose leaves refer to `slots` by `of_slot[tree.primitive_indices[i]]`.
pub fn convert<T: Tier>(
    tree: &Bvh2,
    of_slot: &[u32],
    slots: &[StoredSlot<T>],
    order: &[u32],
    simd: bool,
) -> Wide<T> {
    let mut wide = Wide { nodes: Vec::new(), groups: Vec::new(), spheres: Vec::new(), depth: 0, simd };
    if tree.nodes.is_empty() {
        return wide;
    }
    let slot_of = |place: u32| of_slot[tree.primitive_indices[place as usize] as usize];
    let below =
        count(tree, order, |place| matches!(slots[slot_of(place) as usize].primitive, Stored::Sphere(_)));
    let is_leaf = |node: u32| {
        let Below { count, pure } = below[node as usize];
        tree.nodes[node as usize].is_leaf() || (pure && count <= MOST_IN_LEAF)
    };
    wide.nodes.reserve(tree.nodes.len() / 8);
    wide.groups.reserve(tree.nodes.len() / 5);
    wide.nodes.push(Node::EMPTY);
    // A node of the binary tree, the place of its wide node, and how deep that is.
    let mut waiting = vec![(0u32, 0usize, 1usize)];
    let mut members = Vec::new();
    while let Some((root, place, depth)) = waiting.pop() {
        wide.depth = wide.depth.max(depth);
        let mut children = [0u32; WIDTH];
        children[0] = root;
        let mut len = 1;
        // The largest is opened until there is no more room.
        while len < WIDTH {
            let area = |node: u32| tree.nodes[node as usize].aabb().half_area();
            let inner = (0..len).filter(|&i| !is_leaf(children[i]));
            let Some(largest) = inner.max_by(|&i, &j| area(children[i]).total_cmp(&area(children[j]))) else {
                break;
            };
            let first = tree.nodes[children[largest] as usize].first_index;
            children[largest] = first;
            children[len] = first + 1;
            len += 1;
        }
        for (i, &child) in children[..len].iter().enumerate() {
            let b = tree.nodes[child as usize].aabb();
            let b = Bounds { min: b.min.into(), max: b.max.into() };
            if is_leaf(child) {
                collect(tree, child, &mut members);
                members.iter_mut().for_each(|place| *place = slot_of(*place));
                // Parts of one triangle.
                members.sort_unstable();
                members.dedup();
                let leaf = wide.add_leaf(slots, &members);
                wide.nodes[place].set(i, b, leaf);
            } else {
                let index = wide.nodes.len();
                wide.nodes.push(Node::EMPTY);
                wide.nodes[place].set(i, b, Child::node(index));
                waiting.push((child, index, depth + 1));
            }
        }
    }
    wide
}

impl<T: Tier> Wide<T> {
    /// Stores the primitives of a leaf, all of one kind.
    fn add_leaf(&mut self, slots: &[StoredSlot<T>], members: &[u32]) -> Child {
        let slots = || members.iter().map(|&slot| &slots[slot as usize]);
        let triangles: Vec<([T::Corner; 3], u32)> = slots()
            .filter_map(|slot| match slot.primitive {
                Stored::Triangle(corners) => Some((corners, slot.id.0)),
                Stored::Sphere(_) => None,
            })
            .collect();
        if triangles.is_empty() {
            let first = self.spheres.len();
            self.spheres.extend(slots().filter_map(|slot| match slot.primitive {
                Stored::Sphere(sphere) => Some((sphere, slot.id)),
                Stored::Triangle(_) => None,
            }));
            return Child::leaf(first, self.spheres.len() - first, true);
        }
        let first = self.groups.len();
        for group in triangles.chunks(LANES) {
            let mut ids = [u32::MAX; LANES];
            let mut corners = [group[0].0; LANES];
            for (lane, (triangle, id)) in group.iter().enumerate() {
                (corners[lane], ids[lane]) = (*triangle, *id);
            }
            self.groups.push(Group { quad: Quad::new(&corners[..group.len()]), ids });
        }
        Child::leaf(first, self.groups.len() - first, false)
    }
}

/// For each node what is below it. `order` has every node before its children.
fn count(tree: &Bvh2, order: &[u32], is_sphere: impl Fn(u32) -> bool) -> Vec<Below> {
    #[derive(Clone, Copy, Default)]
    struct Kinds {
        triangles: u32,
        spheres: u32,
    }
    let mut kinds = vec![Kinds::default(); tree.nodes.len()];
    for &index in order.iter().rev() {
        let node = &tree.nodes[index as usize];
        let first = node.first_index as usize;
        kinds[index as usize] = if node.is_leaf() {
            let range = node.first_index..node.first_index + node.prim_count;
            let spheres = range.filter(|&place| is_sphere(place)).count() as u32;
            Kinds { triangles: node.prim_count - spheres, spheres }
        } else {
            let (a, b) = (kinds[first], kinds[first + 1]);
            Kinds { triangles: a.triangles + b.triangles, spheres: a.spheres + b.spheres }
        };
    }
    let below =
        |k: &Kinds| Below { count: k.triangles + k.spheres, pure: k.triangles == 0 || k.spheres == 0 };
    kinds.iter().map(below).collect()
}

/// The places in the tree's list of what is below a node.
fn collect(tree: &Bvh2, node: u32, places: &mut Vec<u32>) {
    places.clear();
    // Few are below a leaf, so the recursion is short.
    fn visit(tree: &Bvh2, node: u32, places: &mut Vec<u32>) {
        let node = &tree.nodes[node as usize];
        if node.is_leaf() {
            places.extend(node.first_index..node.first_index + node.prim_count);
        } else {
            visit(tree, node.first_index, places);
            visit(tree, node.first_index + 1, places);
        }
    }
    visit(tree, node, places);
}
