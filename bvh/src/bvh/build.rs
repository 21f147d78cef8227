//! Builds binary trees by obvhs's PLOC, reinsertion and leaf collapsing over kiln's own bounds, and wide trees from
//! them.
//!
//! The steps are those of obvhs's `build_bvh2`, without its validation in debug builds, which rejects deep trees.

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;
use obvhs::splits::split_aabbs_preset;
use rayon::prelude::*;

use super::Preset;
use super::bvh2::Bvh2;
use super::splitmix64::{GOLDEN, splitmix64};
use super::stored_slot::StoredSlot;
use super::wide::{Wide, convert};
use crate::geometry::simd::{InstructionSet, prefetch};
use crate::geometry::{Bounds, Corner, Stored, Tier};

/// How much the parts of split triangles are enlarged. obvhs leaves gaps of up to 9.7 ulp (measured) at a cut.
const SPLIT_GAP_ULPS: f32 = 16.0;

/// The largest random growth of a box given to PLOC: in ulps, and relative to its size.
const MAX_JITTER: (u32, f32) = (16, 1.0 / 128.0);

/// Random bits per axis, of 64.
const JITTER_BITS: u32 = 21;

/// Builds a binary tree over `slots`.
pub(crate) fn build<T: Tier>(slots: &[StoredSlot<T::Corner>], preset: Preset) -> Bvh2<T> {
    if slots.is_empty() {
        return Bvh2::new(Vec::new(), Vec::new());
    }
    let Ploc { tree, of_slot, parameters } = ploc_over_slots::<T>(slots, preset);
    let (nodes, order) = with_leaves(tree, parameters);
    Bvh2::new(nodes, order.iter().map(|&i| slots[of_slot[i as usize] as usize]).collect())
}

/// The nodes of a tree over boxes, and the indices of the boxes in the order of the leaves.
pub(super) fn build_nodes(boxes: &[Bounds], parameters: BvhBuildParams) -> (Vec<Bvh2Node>, Vec<u32>) {
    if boxes.is_empty() {
        return (Vec::new(), Vec::new());
    }
    with_leaves(ploc(boxes, parameters), parameters)
}

/// Optimises a tree by reinsertion and collapses leaves where the cost heuristic favours it.
fn with_leaves(mut tree: obvhs::bvh2::Bvh2, parameters: BvhBuildParams) -> (Vec<Bvh2Node>, Vec<u32>) {
    let mut reinsertion = ReinsertionOptimizer::default();
    let ratio = parameters.reinsertion_batch_ratio;
    reinsertion.run(&mut tree, ratio, None);
    collapse(&mut tree, parameters.max_prims_per_leaf.clamp(1, 255), parameters.collapse_traversal_cost);
    reinsertion.run(&mut tree, ratio * parameters.post_collapse_reinsertion_batch_ratio_multiplier, None);
    (tree.nodes, tree.primitive_indices)
}

/// Builds a tree of eight children per node, whose leaves [`convert`] chooses.
pub(crate) fn build_wide<T: Tier>(
    slots: &[StoredSlot<T::Corner>],
    preset: Preset,
    instructions: InstructionSet,
) -> Wide<T> {
    if slots.is_empty() {
        return convert(&obvhs::bvh2::Bvh2::default(), &[], slots, instructions);
    }
    let Ploc { mut tree, of_slot, parameters } = ploc_over_slots::<T>(slots, preset);
    ReinsertionOptimizer::default().run(&mut tree, parameters.reinsertion_batch_ratio, None);
    convert(&tree, &of_slot, slots, instructions)
}

/// PLOC's tree, one box per leaf, not yet optimised.
struct Ploc {
    tree: obvhs::bvh2::Bvh2,
    /// The slot of each box.
    of_slot: Vec<u32>,
    parameters: BvhBuildParams,
}

/// The least number of boxes, slots or leaves per parallel task.
pub(super) const MIN_PARALLEL: usize = 4096;

fn ploc_over_slots<T: Tier>(slots: &[StoredSlot<T::Corner>], preset: Preset) -> Ploc {
    let parameters = preset.parameters();
    let whole: Vec<Bounds> = slots.par_iter().with_min_len(MIN_PARALLEL).map(StoredSlot::bounds).collect();
    let (boxes, of_slot) = if parameters.pre_split {
        split_large_triangles(slots, &whole)
    } else {
        (whole, (0..slots.len() as u32).collect())
    };
    let tree = ploc(&boxes, parameters);
    Ploc { tree, of_slot, parameters }
}

/// PLOC's tree over boxes, one per leaf.
///
/// PLOC merges pairs of mutual nearest neighbours. Where all distances are equal (copies of a triangle, rows) or
/// decrease along a sequence (fans, cones), that is one pair per round: quadratic time, and the tree becomes a chain.
/// So each box is enlarged by a small pseudorandom amount derived from its index, which breaks ties and sequences and
/// is deterministic. The nodes get their true bounds afterwards.
fn ploc(boxes: &[Bounds], parameters: BvhBuildParams) -> obvhs::bvh2::Bvh2 {
    let indexed = boxes.par_iter().with_min_len(MIN_PARALLEL).enumerate();
    let jittered: Vec<Aabb> = indexed.map(|(index, b)| to_obvhs(jitter(*b, index as u64))).collect();
    let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
        parameters.ploc_search_distance,
        &jittered,
        (0..boxes.len() as u32).collect(),
        parameters.sort_precision,
        parameters.search_depth_threshold,
    );
    set_bounds(&mut tree, boxes);
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

/// Bounds of parts of large triangles and of all other primitives, and the slot of each.
fn split_large_triangles<C: Corner>(slots: &[StoredSlot<C>], whole: &[Bounds]) -> (Vec<Bounds>, Vec<u32>) {
    let mut triangles = Vec::with_capacity(slots.len());
    // The slot of each triangle in obvhs's list.
    let mut of_triangle = Vec::with_capacity(slots.len());
    let mut others = Vec::new();
    for (index, slot) in (0..).zip(slots) {
        match slot.primitive {
            Stored::Triangle(corners) => {
                let [v0, v1, v2] = corners.map(|corner| corner.to_dvec3().as_vec3a());
                triangles.push(obvhs::triangle::Triangle { v0, v1, v2 });
                of_triangle.push(index);
            }
            Stored::Analytic(_) => others.push(index),
        }
    }
    let mut parts: Vec<Aabb> = of_triangle.iter().map(|&i: &u32| to_obvhs(whole[i as usize])).collect();
    let mut of_part: Vec<u32> = (0..triangles.len() as u32).collect();
    if !triangles.is_empty() {
        let half_areas = parts.iter().map(Aabb::half_area);
        let (total, largest) =
            half_areas.fold((0.0, 0.0f32), |(sum, most), area| (sum + area, most.max(area)));
        split_aabbs_preset(&mut parts, &mut of_part, &triangles, total / triangles.len() as f32, largest);
    }
    let mut of_slot: Vec<u32> = of_part.iter().map(|&part| of_triangle[part as usize]).collect();
    // The error of a cut is relative to the coordinates of the whole triangle. What lies beyond the bounds of that is
    // cut off, so that a ray that starts on a flat triangle starts in none of its parts.
    let closed = |(part, &slot): (&Aabb, &u32)| {
        let whole = whole[slot as usize];
        let gap = Vec3::splat(SPLIT_GAP_ULPS * whole.ulp());
        Bounds { min: part.min.into(), max: part.max.into() }.grown(gap, gap).intersection(whole)
    };
    let mut boxes: Vec<Bounds> = parts.iter().zip(&of_slot).map(closed).collect();
    boxes.extend(others.iter().map(|&i| whole[i as usize]));
    of_slot.extend(others);
    (boxes, of_slot)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::{Primitive, Slot};
    use crate::geometry::{PrimId, Triangle};
    use glam::DVec3;

    /// A long flat triangle among small ones: its parts are flat, too.
    #[test]
    fn parts_lie_within_the_bounds_of_their_triangle() {
        let triangle = |id: u32, at: DVec3, [to, and]: [DVec3; 2]| {
            let primitive = Primitive::Triangle(Triangle([at, at + to, at + and]));
            StoredSlot::<Vec3>::new(Slot { primitive, id: PrimId(id) })
        };
        let long = [DVec3::new(300.0, 0.0, 300.0), DVec3::new(290.0, 0.0, 300.0)];
        let mut slots = vec![triangle(0, DVec3::new(-100.0, 1.7, -100.0), long)];
        let small = |id: u32| triangle(id, DVec3::new(f64::from(id) * 0.1, 3.0, 0.0), [DVec3::X, DVec3::Z]);
        slots.extend((1..1000).map(small));
        let whole: Vec<Bounds> = slots.iter().map(StoredSlot::bounds).collect();
        let (boxes, of_slot) = split_large_triangles(&slots, &whole);
        assert!(boxes.len() > slots.len(), "nothing was split");
        for (part, &slot) in boxes.iter().zip(&of_slot) {
            assert_eq!(part.union(whole[slot as usize]), whole[slot as usize]);
        }
    }
}
