//! From obvhs's binary tree to nodes of eight.

use obvhs::bvh2::Bvh2;
use rayon::prelude::*;

use super::super::build::LEAST_SHARE;
use super::super::store::StoredSlot;
use super::collapse::Collapse;
use super::node::{Child, Node};
use super::outline::{Below, Entry, Outline};
use super::{Group, NONE, Wide};
use crate::geometry::quad::LANES;
use crate::geometry::simd::prefetch;
use crate::geometry::{Quad, Stored, Tier};

/// The slots of a group, among those that leaves hold.
type Members = std::ops::Range<u32>;

/// Converts a binary tree with a primitive a leaf. A leaf refers to `slots[of_slot[tree.primitive_indices[i]]]`.
///
/// Which node holds what is settled by one thread; the triangles themselves follow in parallel. Neither depends on the number of
/// threads.
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
    let slot_of = |place: u32| of_slot[tree.primitive_indices[place as usize] as usize];
    // Apart from the slots, which are large: leaves refer to them in no order.
    let spheres: Vec<bool> = slots.iter().map(|slot| matches!(slot.primitive, Stored::Sphere(_))).collect();
    let Outline { entries, mut held } = if spheres.contains(&true) {
        Outline::new(tree, |place| spheres[slot_of(place) as usize])
    } else {
        Outline::new(tree, |_| false)
    };
    // In a loop of its own, where none has to wait for the one before.
    for place in &mut held {
        *place = slot_of(*place);
    }
    let held = held;
    let collapse = Collapse::new(&entries);
    // As measured on meshes; there is always room for more.
    wide.nodes.reserve(entries.len() / 6);
    let mut groups: Vec<Members> = Vec::with_capacity(entries.len() / 2 + 1);
    wide.nodes.push(Node::EMPTY);
    // An entry, the place of its wide node, and how deep that is.
    let mut waiting = vec![(0u32, 0usize, 1usize)];
    while let Some((root, place, depth)) = waiting.pop() {
        wide.depth = wide.depth.max(depth);
        let (children, len) = collapse.children(&entries, root);
        for (i, &child) in children[..len].iter().enumerate() {
            let Entry { bounds, below } = entries[child as usize];
            let content = match below {
                Below::Two(_) => {
                    let index = wide.nodes.len();
                    wide.nodes.push(Node::EMPTY);
                    waiting.push((child, index, depth + 1));
                    Child::node(index)
                }
                Below::Triangles(first, count) => {
                    groups.push(first..first + count);
                    Child::leaf(groups.len() - 1, 1, false)
                }
                Below::Spheres(first, count) => {
                    let (lanes, count) = in_order(&held, first..first + count);
                    let first = wide.spheres.len();
                    wide.spheres.extend(lanes[..count].iter().filter_map(|&slot| {
                        match slots[slot as usize].primitive {
                            Stored::Sphere(sphere) => Some((sphere, slots[slot as usize].id)),
                            Stored::Triangle(_) => None,
                        }
                    }));
                    Child::leaf(first, count, true)
                }
            };
            wide.nodes[place].set(i, bounds, content);
        }
    }
    let group = |(index, members): (usize, &Members)| {
        if let Some(soon) = groups.get(index + AHEAD) {
            held[soon.start as usize..soon.end as usize]
                .iter()
                .for_each(|&slot| prefetch(slots, slot as usize));
        }
        Group::new(in_order(&held, members.clone()), slots)
    };
    wide.groups = groups.par_iter().enumerate().with_min_len(LEAST_SHARE).map(group).collect();
    wide
}

/// How far ahead slots are asked for, in groups: they lie in no order.
const AHEAD: usize = 6;

/// Some slots of those that are held, each once, in order; and how many those are.
fn in_order(held: &[u32], members: Members) -> ([u32; LANES], usize) {
    let (mut lanes, mut count) = ([NONE; LANES], 0);
    for &slot in &held[members.start as usize..members.end as usize] {
        // Parts of one triangle.
        if !lanes[..count].contains(&slot) {
            lanes[count] = slot;
            count += 1;
        }
    }
    lanes[..count].sort_unstable();
    (lanes, count)
}

impl<C: crate::geometry::Corner> Group<C> {
    fn new<T: Tier<Corner = C>>((members, count): ([u32; LANES], usize), slots: &[StoredSlot<T>]) -> Self {
        let mut group = Group { quad: Quad::EMPTY, ids: [NONE; LANES] };
        for (lane, &slot) in members[..count].iter().enumerate() {
            let StoredSlot { primitive, id } = &slots[slot as usize];
            if let Stored::Triangle(corners) = primitive {
                group.quad.set(lane, Some(corners));
                group.ids[lane] = id.0;
            }
        }
        group
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_are_in_order_and_parts_are_one() {
        assert_eq!(in_order(&[9, 7, 3, 7, 5, 1], 1..5), ([3, 5, 7, NONE], 3));
    }
}
