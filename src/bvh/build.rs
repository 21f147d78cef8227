//! Building: obvhs's PLOC, reinsertion and leaf collapsing, over kiln's own boxes.

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;
use obvhs::splits::split_aabbs_preset;
use rayon::prelude::*;

use super::mix::{GOLDEN, mix};
use super::store::StoredSlot;
use super::tree::Tree;
use super::wide::{Wide, convert};
use super::{Preset, Primitive};
use crate::geometry::simd::prefetch;
use crate::geometry::{Bounds, Tier};

/// Where triangles are split, obvhs's halves are measured to leave gaps of up to 9.7 ulp at the cut.
const SPLIT_GAP_ULPS: f32 = 16.0;

/// The greatest growth of a box for the builder: units of its last place, and a share of its size.
const MOST_JITTER: (u32, f32) = (16, 1.0 / 128.0);

/// Random bits for each side: three sides of 64.
const STEP_BITS: u32 = 21;

/// Builds a tree over `slots`.
///
/// The steps are those of obvhs's own `build_bvh2`, with boxes of ours and without the validation that it runs in
/// debug builds, which takes deep trees for broken ones.
pub fn build<T: Tier>(slots: &[StoredSlot<T>], preset: Preset) -> Tree<T> {
    if slots.is_empty() {
        return Tree::new(Vec::new(), Vec::new());
    }
    let Binary { tree, of_slot, parameters } = binary(slots, preset);
    let (nodes, order) = with_leaves(tree, parameters);
    Tree::new(nodes, order.iter().map(|&i| slots[of_slot[i as usize] as usize]).collect())
}

/// Nodes over boxes, and the boxes in the order of the leaves.
pub(super) fn build_nodes(boxes: &[Bounds], parameters: BvhBuildParams) -> (Vec<Bvh2Node>, Vec<u32>) {
    if boxes.is_empty() {
        return (Vec::new(), Vec::new());
    }
    with_leaves(nearest_first(boxes, parameters), parameters)
}

/// The tree, optimised, with as many boxes a leaf as pay.
fn with_leaves(mut tree: Bvh2, parameters: BvhBuildParams) -> (Vec<Bvh2Node>, Vec<u32>) {
    let mut reinsertion = ReinsertionOptimizer::default();
    let ratio = parameters.reinsertion_batch_ratio;
    reinsertion.run(&mut tree, ratio, None);
    collapse(&mut tree, parameters.max_prims_per_leaf.clamp(1, 255), parameters.collapse_traversal_cost);
    reinsertion.run(&mut tree, ratio * parameters.post_collapse_reinsertion_batch_ratio_multiplier, None);
    (tree.nodes, tree.primitive_indices)
}

/// The same for nodes of eight, which find their leaves themselves.
pub fn build_wide<T: Tier>(slots: &[StoredSlot<T>], preset: Preset, simd: bool) -> Wide<T> {
    if slots.is_empty() {
        return convert(&Bvh2::default(), &[], slots, simd);
    }
    let Binary { mut tree, of_slot, parameters } = binary(slots, preset);
    ReinsertionOptimizer::default().run(&mut tree, parameters.reinsertion_batch_ratio, None);
    convert(&tree, &of_slot, slots, simd)
}

/// A binary tree, one primitive a leaf, before it is optimised.
struct Binary {
    tree: Bvh2,
    /// For each box that the tree was built over, the slot of its primitive.
    of_slot: Vec<u32>,
    parameters: BvhBuildParams,
}

/// Boxes, slots or nodes that one thread works on at least.
pub(super) const LEAST_SHARE: usize = 4096;

fn binary<T: Tier>(slots: &[StoredSlot<T>], preset: Preset) -> Binary {
    let parameters = preset.parameters();
    let whole: Vec<Bounds> = slots.par_iter().with_min_len(LEAST_SHARE).map(StoredSlot::bounds).collect();
    let Boxes { boxes, of_slot } = if parameters.pre_split && T::IS_TIGHT {
        split_large_triangles(slots, &whole)
    } else {
        Boxes { boxes: whole, of_slot: (0..slots.len() as u32).collect() }
    };
    let tree = nearest_first(&boxes, parameters);
    Binary { tree, of_slot, parameters }
}

/// PLOC's tree over boxes, one a leaf.
///
/// PLOC merges pairs that are each other's nearest. Where all are equally near (copies of a triangle, rows), or each is
/// nearer to the next than to the last (fans, cones), that is one pair a round: time grows with the square of the number,
/// and the tree becomes a chain. So it is given boxes that are grown a little on each side, by a number made from the
/// primitive's place: no two are equally near, no long run is ordered, and equal input still gives equal trees. The nodes
/// get their true boxes back before anything else looks at them.
fn nearest_first(boxes: &[Bounds], parameters: BvhBuildParams) -> Bvh2 {
    let places = boxes.par_iter().with_min_len(LEAST_SHARE).enumerate();
    let jittered: Vec<Aabb> = places.map(|(place, b)| to_obvhs(jitter(*b, place as u64))).collect();
    let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
        parameters.ploc_search_distance,
        &jittered,
        (0..boxes.len() as u32).collect(),
        parameters.sort_precision,
        parameters.search_depth_threshold,
    );
    tighten(&mut tree, boxes);
    tree
}

fn to_obvhs(b: Bounds) -> Aabb {
    Aabb::new(Vec3A::from(b.min), Vec3A::from(b.max))
}

/// The box, larger on each side by up to [`MOST_JITTER`], and by a unit in the last place at least, as its place tells.
fn jitter(b: Bounds, place: u64) -> Bounds {
    let (units, share) = MOST_JITTER;
    let (ulp, size) = (b.ulp(), (b.max - b.min).max_element());
    let steps = |bits: u64| {
        let step = |bits: u32| {
            let portion = bits as f32 / (1u32 << STEP_BITS) as f32;
            ulp * (1 + bits % units) as f32 + size * share * portion
        };
        let part = |k: u32| (bits >> (k * STEP_BITS)) as u32 & ((1 << STEP_BITS) - 1);
        Vec3::new(step(part(0)), step(part(1)), step(part(2)))
    };
    let below = steps(mix((2 * place + 1).wrapping_mul(GOLDEN)));
    b.grown(below, steps(mix((2 * place + 2).wrapping_mul(GOLDEN))))
}

/// How far ahead boxes are asked for, in nodes: they lie in no order.
const AHEAD: usize = 16;

/// Gives every node the box around what is below it, from the boxes of leaves.
fn tighten(tree: &mut Bvh2, boxes: &[Bounds]) {
    assert!(tree.children_are_ordered_after_parents, "as PLOC leaves them");
    for index in (0..tree.nodes.len()).rev() {
        if let Some(soon) =
            index.checked_sub(AHEAD).map(|soon| &tree.nodes[soon]).filter(|soon| soon.is_leaf())
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

/// What the builder is given.
struct Boxes {
    /// Boxes of primitives, or of parts of them.
    boxes: Vec<Bounds>,
    /// For each box, the slot of its primitive.
    of_slot: Vec<u32>,
}

/// Boxes of parts of large triangles, and of everything else whole.
fn split_large_triangles<T: Tier>(slots: &[StoredSlot<T>], whole: &[Bounds]) -> Boxes {
    let mut triangles = Vec::with_capacity(slots.len());
    // obvhs looks triangles up by their place in its list.
    let mut of_triangle = Vec::with_capacity(slots.len());
    let mut spheres = Vec::new();
    for (index, slot) in (0..).zip(slots) {
        match slot.primitive() {
            Primitive::Triangle(triangle) => {
                let [v0, v1, v2] = triangle.0.map(|corner| corner.as_vec3a());
                triangles.push(obvhs::triangle::Triangle { v0, v1, v2 });
                of_triangle.push(index);
            }
            Primitive::Sphere(_) => spheres.push(index),
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
    // The cuts are as exact as the whole triangle's coordinates are.
    let closed = |(part, &slot): (&Aabb, &u32)| {
        let gap = Vec3::splat(SPLIT_GAP_ULPS * whole[slot as usize].ulp());
        Bounds { min: part.min.into(), max: part.max.into() }.grown(gap, gap)
    };
    let mut boxes: Vec<Bounds> = parts.iter().zip(&of_slot).map(closed).collect();
    boxes.extend(spheres.iter().map(|&i| whole[i as usize]));
    of_slot.extend(spheres);
    Boxes { boxes, of_slot }
}
