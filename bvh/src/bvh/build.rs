//! Builds binary trees by obvhs's PLOC and reinsertion over kiln's own bounds, and wide trees from them.
//!
//! The steps are those of obvhs's `build_bvh2`, without its validation in debug builds, which rejects deep trees.

use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, SortPrecision};
use rayon::prelude::*;

use super::preset::{Ploc, TopDown};
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
    Tree::new(&ploc(boxes, preset), most)
}

/// Builds a tree of eight children per node, whose leaves [`convert`] chooses.
pub(crate) fn build_wide<T: Tier>(
    slots: &dyn Slots<T::Corner>,
    preset: Preset,
    instructions: InstructionSet,
) -> Wide<T> {
    convert(&binary_tree::<T>(slots, preset), slots, instructions)
}

/// The least number of boxes, slots or leaves per parallel task.
pub(super) const MIN_PARALLEL: usize = 4096;

/// The binary tree of a preset over slots, one reference to a slot per leaf.
fn binary_tree<T: Tier>(slots: &dyn Slots<T::Corner>, preset: Preset) -> obvhs::bvh2::Bvh2 {
    let all = (0..slots.len() as u32).into_par_iter().with_min_len(MIN_PARALLEL);
    let boxes: Vec<Bounds> = all.map(|slot| slots.get(slot).bounds()).collect();
    match preset.top_down() {
        Some(TopDown { budget, reinsertion_ratio }) => {
            let mut tree = sah::build(&boxes, &|slot| slots.get(slot).corners(), budget);
            ReinsertionOptimizer::default().run(&mut tree, reinsertion_ratio, None);
            tree
        }
        None => ploc(&boxes, preset),
    }
}

/// PLOC's tree over boxes, one per leaf, optimised by reinsertion.
///
/// PLOC merges pairs of mutual nearest neighbours. Where all distances are equal (copies of a triangle, rows) or
/// decrease along a sequence (fans, cones), that is one pair per round: quadratic time, and the tree becomes a chain.
/// So each box is enlarged by a small pseudorandom amount derived from its index, which breaks ties and sequences and
/// is deterministic. The nodes get their true bounds afterwards.
fn ploc(boxes: &[Bounds], preset: Preset) -> obvhs::bvh2::Bvh2 {
    if boxes.is_empty() {
        return obvhs::bvh2::Bvh2::default();
    }
    let Ploc { search_distance, search_depth, reinsertion_ratio } = preset.ploc();
    let indexed = boxes.par_iter().with_min_len(MIN_PARALLEL).enumerate();
    let jittered: Vec<Aabb> = indexed.map(|(index, b)| to_obvhs(jitter(*b, index as u64))).collect();
    let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
        search_distance,
        &jittered,
        (0..boxes.len() as u32).collect(),
        SortPrecision::U64,
        search_depth,
    );
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
fn set_bounds(tree: &mut obvhs::bvh2::Bvh2, boxes: &[Bounds]) {
    assert!(tree.children_are_ordered_after_parents, "as PLOC leaves them");
    for index in (0..tree.nodes.len()).rev() {
        if let Some(soon) =
            index.checked_sub(PREFETCH_AHEAD).map(|soon| &tree.nodes[soon]).filter(|soon| soon.is_leaf())
        {
            prefetch(boxes, tree.primitive_indices[soon.first_index as usize] as usize);
        }
        let node = &tree.nodes[index];
        let first = node.first_index as usize;
        let b = if node.is_leaf() {
            to_obvhs(boxes[tree.primitive_indices[first] as usize])
        } else {
            tree.nodes[first].aabb().union(tree.nodes[first + 1].aabb())
        };
        tree.nodes[index].set_aabb(b);
    }
}
