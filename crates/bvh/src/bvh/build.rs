//! Builds binary trees by obvhs's PLOC and reinsertion over kiln's own bounds, and wide trees from them.
//!
//! The steps are those of obvhs's `build_bvh2`, without its validation in debug builds, which rejects deep trees.

use crate::threads::*;
use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, SortPrecision};

use super::preset::{Ploc, SearchDistance, TopDown};
use super::splitmix64::{GOLDEN, splitmix64};
use super::stored_slot::Slots;
use super::wide::{Tree, Wide, convert};
use super::{Preset, sah};
use crate::geometry::simd::{InstructionSet, prefetch};
use crate::geometry::{Bounds, Tier};

/// The largest random growth of a box given to PLOC: in ulps, and relative to its size.
const MAX_JITTER: (u32, f32) = (16, 1.0 / 128.0);

/// Random bits per axis, of 64.
const JITTER_BITS: u32 = 21;

/// Builds a tree of eight children per node over boxes, with up to `most` of them per leaf; see [`Tree::new`].
pub(super) fn build_over(boxes: &[Bounds], preset: Preset, most: usize) -> (Tree, Vec<u32>) {
    let bounds = |index: u32| boxes[index as usize];
    let boxes =
        Boxes { len: boxes.len(), bounds: &bounds, prefetch: &|index| prefetch(boxes, index as usize) };
    Tree::new(&ploc(&boxes, preset), most)
}

/// Builds a tree of eight children per node, whose leaves [`convert`] chooses.
pub(crate) fn build_wide<T: Tier>(
    slots: &dyn Slots<T::Corner>,
    preset: Preset,
    instructions: InstructionSet,
) -> Wide<T> {
    convert(binary_tree::<T>(slots, preset), slots, instructions)
}

/// The least number of boxes, slots or leaves per parallel task.
pub(super) const MIN_PARALLEL: usize = 4096;

/// Boxes that are computed when they are read.
struct Boxes<'a> {
    len: usize,
    bounds: &'a (dyn Fn(u32) -> Bounds + Sync),
    /// Prefetches what a box is computed from.
    prefetch: &'a dyn Fn(u32),
}

/// The binary tree of a preset over slots, one reference to a slot per leaf.
fn binary_tree<T: Tier>(slots: &dyn Slots<T::Corner>, preset: Preset) -> Bvh2 {
    let (len, bounds) = (slots.len(), |slot| slots.get(slot).bounds());
    match preset.top_down() {
        Some(TopDown { budget, reinsertion_ratio }) => {
            let all = (0..len as u32).into_par_iter().with_min_len(MIN_PARALLEL);
            let boxes: Vec<Bounds> = all.map(bounds).collect();
            let mut tree = sah::build(&boxes, &|slot| slots.get(slot).corners(), budget);
            ReinsertionOptimizer::default().run(&mut tree, reinsertion_ratio, None);
            tree
        }
        None => ploc(&Boxes { len, bounds: &bounds, prefetch: &|slot| slots.prefetch(slot) }, preset),
    }
}

/// PLOC's tree over boxes, one per leaf, optimised by reinsertion.
///
/// PLOC merges pairs of mutual nearest neighbours. Where all distances are equal (copies of a triangle, rows) or
/// decrease along a sequence (fans, cones), that is one pair per round: quadratic time, and the tree becomes a chain.
/// So each box is enlarged by a small pseudorandom amount derived from its index, which breaks ties and sequences and
/// is deterministic. The nodes get their true bounds afterwards.
///
/// The leaves are given as nodes: obvhs keeps a list of boxes, of as many bytes, until the tree is built.
fn ploc(boxes: &Boxes, preset: Preset) -> Bvh2 {
    let Boxes { len, bounds, .. } = *boxes;
    if len == 0 {
        return Bvh2::default();
    }
    let Ploc { search_distance, search_depth, reinsertion_ratio } = preset.ploc();
    let leaf = |index: u32| Bvh2Node::new(to_obvhs(jitter(bounds(index), u64::from(index))), 1, index);
    let all = (0..len as u32).into_par_iter().with_min_len(MIN_PARALLEL);
    let mut builder = PlocBuilder { current_nodes: all.map(leaf).collect(), ..PlocBuilder::new() };
    let whole = builder.current_nodes.iter().fold(Aabb::empty(), |whole, node| whole.union(node.aabb()));
    let mut tree = Bvh2::zeroed(len);
    tree.primitive_indices = (0..len as u32).collect();
    let (precision, depth) = (SortPrecision::U64, search_depth);
    match search_distance {
        SearchDistance::Two => builder.build_ploc_from_leaves::<2, false>(&mut tree, whole, precision, depth),
        SearchDistance::Six => builder.build_ploc_from_leaves::<6, false>(&mut tree, whole, precision, depth),
        SearchDistance::Fourteen => {
            builder.build_ploc_from_leaves::<14, false>(&mut tree, whole, precision, depth);
        }
    }
    drop(builder);
    set_bounds(&mut tree, boxes);
    ReinsertionOptimizer::default().run(&mut tree, reinsertion_ratio, None);
    tree
}

fn to_obvhs(b: Bounds) -> Aabb {
    Aabb::new(Vec3A::from(b.min), Vec3A::from(b.max))
}

/// The box, enlarged at each plane by 1 ulp up to [`MAX_JITTER`], pseudorandomly by its index.
fn jitter(b: Bounds, index: u64) -> Bounds {
    let (ulps, share) = MAX_JITTER;
    let (ulp, size) = (b.ulp(), (b.max - b.min).max_element());
    let steps = |bits: u64| {
        let step = |bits: u32| {
            let portion = bits as f32 / (1u32 << JITTER_BITS) as f32;
            ulp * (1 + bits % ulps) as f32 + size * share * portion
        };
        let part = |k: u32| (bits >> (k * JITTER_BITS)) as u32 & ((1 << JITTER_BITS) - 1);
        Vec3::new(step(part(0)), step(part(1)), step(part(2)))
    };
    let below = steps(splitmix64((2 * index + 1).wrapping_mul(GOLDEN)));
    b.grown(below, steps(splitmix64((2 * index + 2).wrapping_mul(GOLDEN))))
}

/// The distance, in nodes, at which boxes are prefetched: they are accessed in random order.
const PREFETCH_AHEAD: usize = 16;

/// Sets the bounds of all nodes from the boxes of the leaves, bottom-up.
fn set_bounds(tree: &mut Bvh2, boxes: &Boxes) {
    assert!(tree.children_are_ordered_after_parents, "as PLOC leaves them");
    for index in (0..tree.nodes.len()).rev() {
        if let Some(soon) =
            index.checked_sub(PREFETCH_AHEAD).map(|soon| &tree.nodes[soon]).filter(|soon| soon.is_leaf())
        {
            (boxes.prefetch)(tree.primitive_indices[soon.first_index as usize]);
        }
        let node = &tree.nodes[index];
        let first = node.first_index as usize;
        let b = if node.is_leaf() {
            to_obvhs((boxes.bounds)(tree.primitive_indices[first]))
        } else {
            tree.nodes[first].aabb().union(tree.nodes[first + 1].aabb())
        };
        tree.nodes[index].set_aabb(b);
    }
}

#[cfg(test)]
mod tests {
    use obvhs::ploc::PlocSearchDistance;

    use super::*;

    /// Leaves that are given as nodes become the tree of obvhs's own build over the same boxes.
    #[test]
    fn trees_are_those_of_lists_of_boxes() {
        let number = |seed: u64| (splitmix64(seed) >> 40) as f32 / (1u32 << 24) as f32;
        let boxes: Vec<Bounds> = (0..5000u64)
            .map(|i| {
                let corner =
                    |k: u64| Vec3::new(number(9 * i + k), number(9 * i + k + 1), number(9 * i + k + 2));
                let min = corner(0) * 100.0;
                Bounds { min, max: min + corner(3) }
            })
            .collect();
        let distances = [PlocSearchDistance::VeryLow, PlocSearchDistance::Low, PlocSearchDistance::Medium];
        for (preset, distance) in Preset::ALL.into_iter().zip(distances) {
            let Ploc { search_depth, reinsertion_ratio, .. } = preset.ploc();
            let bounds = |index: u32| boxes[index as usize];
            let all = Boxes { len: boxes.len(), bounds: &bounds, prefetch: &|_| () };
            let jittered = |(index, b): (u64, &Bounds)| to_obvhs(jitter(*b, index));
            let jittered: Vec<Aabb> = (0..).zip(&boxes).map(jittered).collect();
            let indices = (0..boxes.len() as u32).collect();
            let mut expected =
                PlocBuilder::new().build(distance, &jittered, indices, SortPrecision::U64, search_depth);
            set_bounds(&mut expected, &all);
            ReinsertionOptimizer::default().run(&mut expected, reinsertion_ratio, None);
            let found = ploc(&all, preset);
            let nodes = |tree: &Bvh2| -> Vec<_> {
                let node = |n: &Bvh2Node| (n.min.to_array(), n.max.to_array(), n.prim_count, n.first_index);
                tree.nodes.iter().map(node).collect()
            };
            assert!(nodes(&found) == nodes(&expected), "{}", preset.name());
            assert_eq!(found.primitive_indices, expected.primitive_indices);
        }
    }
}
