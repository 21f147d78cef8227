//! From obvhs's binary tree to nodes of eight.

use obvhs::bvh2::Bvh2;
use rayon::prelude::*;

use super::super::build::LEAST_SHARE;
use super::super::store::StoredSlot;
use super::collapse::Collapse;
use super::node::{Child, Node};
use super::{Group, NONE, Wide};
use crate::geometry::quad::LANES;
use crate::geometry::{Bounds, Quad, Stored, Tier};

/// The slots of a group, as many as there are.
type Members = [u32; LANES];

/// Converts a binary tree with a primitive a leaf, whose parents are known. A leaf refers to
/// `slots[of_slot[tree.primitive_indices[i]]]`.
///
/// Which node holds what is settled in one pass over the tree; the triangles themselves follow in parallel. Neither depends
/// on the number of threads.
pub fn convert<T: Tier>(tree: &Bvh2, of_slot: &[u32], slots: &[StoredSlot<T>], simd: bool) -> Wide<T> {
    let mut wide = Wide {
        nodes: Vec::new(),
        groups: Vec::new(),
        spheres: Vec::new(),
        depth: 0,
        simd,
        cost_at_build: None,
    };
    if tree.nodes.is_empty() {
        return wide;
    }
    let slot_of =
        |node: u32| of_slot[tree.primitive_indices[tree.nodes[node as usize].first_index as usize] as usize];
    // Apart from the slots, which are large: nodes refer to them in no order.
    let spheres: Vec<bool> = slots.iter().map(|slot| matches!(slot.primitive, Stored::Sphere(_))).collect();
    let is_sphere = |node: u32| spheres[slot_of(node) as usize];
    let below = if spheres.contains(&true) { below(tree, is_sphere) } else { below(tree, |_| false) };
    let is_leaf = |node: u32| below[node as usize] != MANY;
    let collapse = Collapse::new(tree, is_leaf);
    // As measured on meshes; there is always room for more.
    wide.nodes.reserve(tree.nodes.len() / 20);
    let mut groups: Vec<Members> = Vec::with_capacity(tree.nodes.len() / 5);
    wide.nodes.push(Node::EMPTY);
    // A node of the binary tree, the place of its wide node, and how deep that is.
    let mut waiting = vec![(0u32, 0usize, 1usize)];
    while let Some((root, place, depth)) = waiting.pop() {
        wide.depth = wide.depth.max(depth);
        let (children, len) = collapse.children(tree, root);
        for (i, &child) in children[..len].iter().enumerate() {
            let b = tree.nodes[child as usize].aabb();
            let b = Bounds { min: b.min.into(), max: b.max.into() };
            if !is_leaf(child) {
                let index = wide.nodes.len();
                wide.nodes.push(Node::EMPTY);
                wide.nodes[place].set(i, b, Child::node(index));
                waiting.push((child, index, depth + 1));
                continue;
            }
            let (members, count) = members(tree, child, slot_of);
            let leaf = if below[child as usize] & TRIANGLES != 0 {
                groups.push(members);
                Child::leaf(groups.len() - 1, 1, false)
            } else {
                let first = wide.spheres.len();
                wide.spheres.extend(members[..count].iter().filter_map(|&slot| {
                    match slots[slot as usize].primitive {
                        Stored::Sphere(sphere) => Some((sphere, slots[slot as usize].id)),
                        Stored::Triangle(_) => None,
                    }
                }));
                Child::leaf(first, count, true)
            };
            wide.nodes[place].set(i, b, leaf);
        }
    }
    wide.groups =
        groups.par_iter().with_min_len(LEAST_SHARE).map(|members| Group::new(members, slots)).collect();
    wide
}

/// What is below a node: 1 to 4 triangles in the lower half, 1 to 4 spheres in the upper, or [`MANY`].
type Below = u8;

/// More than fit into one leaf, or of both kinds.
const MANY: Below = u8::MAX;
/// The half that counts triangles.
const TRIANGLES: Below = 0x0f;
const TRIANGLE: Below = 0x01;
const SPHERE: Below = 0x10;

/// For each node what is below it: one group of triangles, as many spheres, or more. Every leaf tells those above it, up to
/// one that has heard enough; so it needs no order of nodes, and little time for trees of any depth.
fn below(tree: &Bvh2, is_sphere: impl Fn(u32) -> bool) -> Vec<Below> {
    const MOST: Below = LANES as Below;
    let mut below = vec![0; tree.nodes.len()];
    for leaf in 0..tree.nodes.len() as u32 {
        let node = &tree.nodes[leaf as usize];
        if !node.is_leaf() {
            continue;
        }
        debug_assert_eq!(node.prim_count, 1);
        let (one, other, most) =
            if is_sphere(leaf) { (SPHERE, TRIANGLES, MOST * SPHERE) } else { (TRIANGLE, !TRIANGLES, MOST) };
        let mut at = leaf;
        loop {
            let count = &mut below[at as usize];
            if *count == MANY {
                break;
            }
            *count = if *count & other != 0 || *count == most { MANY } else { *count + one };
            if at == 0 {
                break;
            }
            at = tree.parents[at as usize];
        }
    }
    below
}

/// The slots below a node that is a leaf, each once, in order.
fn members(tree: &Bvh2, node: u32, slot_of: impl Fn(u32) -> u32) -> (Members, usize) {
    let (mut members, mut count) = ([NONE; LANES], 0);
    // Not more than there are leaves wait.
    let (mut waiting, mut top) = ([node; LANES], 1);
    while top > 0 {
        top -= 1;
        let index = waiting[top];
        let node = &tree.nodes[index as usize];
        if node.is_leaf() {
            let slot = slot_of(index);
            // Parts of one triangle.
            if !members[..count].contains(&slot) {
                members[count] = slot;
                count += 1;
            }
        } else {
            (waiting[top], waiting[top + 1]) = (node.first_index + 1, node.first_index);
            top += 2;
        }
    }
    members[..count].sort_unstable();
    (members, count)
}

impl<C: crate::geometry::Corner> Group<C> {
    fn new<T: Tier<Corner = C>>(members: &Members, slots: &[StoredSlot<T>]) -> Self {
        let mut group = Group { quad: Quad::EMPTY, ids: [NONE; LANES] };
        for (lane, &slot) in members.iter().enumerate().filter(|(_, slot)| **slot != NONE) {
            let StoredSlot { primitive, id } = &slots[slot as usize];
            if let Stored::Triangle(corners) = primitive {
                group.quad.set(lane, Some(corners));
                group.ids[lane] = id.0;
            }
        }
        group
    }
}
