//! Building: obvhs's PLOC, reinsertion and leaf collapsing, over kiln's own boxes.

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;
use obvhs::splits::split_aabbs_preset;

use super::Primitive;
use super::mix::{GOLDEN, mix};
use super::store::StoredSlot;
use super::tree::Tree;
use crate::geometry::{Bounds, Tier};

/// obvhs's build presets, from the least work spent on building to the least spent on tracing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Preset {
    /// One pass, no optimisation, one primitive a leaf.
    FastestBuild,
    /// A little reinsertion.
    VeryFastBuild,
    /// A wider search and more reinsertion.
    FastBuild,
    /// About the build time of Embree, and the default.
    #[default]
    MediumBuild,
    /// Large triangles are split beforehand.
    SlowBuild,
    /// Split beforehand, and every node considered for reinsertion.
    VerySlowBuild,
}

impl Preset {
    /// Every preset.
    pub const ALL: [Preset; 6] = [
        Preset::FastestBuild,
        Preset::VeryFastBuild,
        Preset::FastBuild,
        Preset::MediumBuild,
        Preset::SlowBuild,
        Preset::VerySlowBuild,
    ];

    fn parameters(self) -> BvhBuildParams {
        match self {
            Preset::FastestBuild => BvhBuildParams::fastest_build(),
            Preset::VeryFastBuild => BvhBuildParams::very_fast_build(),
            Preset::FastBuild => BvhBuildParams::fast_build(),
            Preset::MediumBuild => BvhBuildParams::medium_build(),
            Preset::SlowBuild => BvhBuildParams::slow_build(),
            Preset::VerySlowBuild => BvhBuildParams::very_slow_build(),
        }
    }
}

/// Where triangles are split, obvhs's halves are measured to leave gaps of up to 9.7 ulp at the cut.
const SPLIT_GAP_ULPS: f32 = 16.0;

/// The greatest growth of a box for the builder, in units of its last place.
const MOST_JITTER: u64 = 16;

/// Builds a tree over `slots`.
///
/// The steps are those of obvhs's own `build_bvh2`, with boxes of ours and without the validation that it runs in
/// debug builds, which takes deep trees for broken ones.
///
/// PLOC merges pairs of nearest neighbours, and where all are equally near (copies of a triangle, rows, fans) it merges
/// one pair a round: time grows with the square of the number, and the tree becomes a chain. So it is given boxes that
/// are grown by 1 to [`MOST_JITTER`] units in the last place on each side, by a number made from the primitive's place:
/// no two are equally near, and equal input still gives equal trees. The nodes get their true boxes back afterwards.
pub fn build<T: Tier>(slots: &[StoredSlot<T>], preset: Preset) -> Tree<T> {
    if slots.is_empty() {
        return Tree::new(Vec::new(), Vec::new());
    }
    let parameters = preset.parameters();
    let whole: Vec<Bounds> = slots.iter().map(StoredSlot::bounds).collect();
    let Boxes { order, boxes, indices } = if parameters.pre_split {
        split_large_triangles(slots, &whole)
    } else {
        let order: Vec<u32> = (0..slots.len() as u32).collect();
        Boxes { boxes: whole.clone(), indices: order.clone(), order }
    };
    let jittered: Vec<Aabb> = (0..).zip(&boxes).map(|(place, b)| to_obvhs(jitter(*b, place))).collect();
    let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
        parameters.ploc_search_distance,
        &jittered,
        indices,
        parameters.sort_precision,
        parameters.search_depth_threshold,
    );
    tree.uses_spatial_splits = parameters.pre_split;
    let mut reinsertion = ReinsertionOptimizer::default();
    let ratio = parameters.reinsertion_batch_ratio;
    reinsertion.run(&mut tree, ratio, None);
    collapse(&mut tree, parameters.max_prims_per_leaf.clamp(1, 255), parameters.collapse_traversal_cost);
    reinsertion.run(&mut tree, ratio * parameters.post_collapse_reinsertion_batch_ratio_multiplier, None);

    let place = |i: &u32| order[*i as usize] as usize;
    if !parameters.pre_split {
        tighten(&mut tree.nodes, |prims| {
            let boxes = tree.primitive_indices[prims].iter().map(|i| whole[place(i)]);
            boxes.reduce(Bounds::union).unwrap_or(whole[0])
        });
    }
    let ordered = tree.primitive_indices.iter().map(|i| slots[place(i)]).collect();
    Tree::new(tree.nodes, ordered)
}

fn to_obvhs(b: Bounds) -> Aabb {
    Aabb::new(Vec3A::from(b.min), Vec3A::from(b.max))
}

/// The box, larger by a number of units in the last place that depends on its place, 1 to [`MOST_JITTER`] on each side.
fn jitter(b: Bounds, place: u64) -> Bounds {
    let ulp = b.ulp();
    let mut side = 6 * place;
    let mut step = || {
        side += 1;
        ulp * (1 + mix(side.wrapping_mul(GOLDEN)) % MOST_JITTER) as f32
    };
    let mut steps = || Vec3::new(step(), step(), step());
    b.grown(steps(), steps())
}

/// Gives every node the box around what is below it, from the boxes of leaves.
fn tighten(nodes: &mut [Bvh2Node], leaf: impl Fn(std::ops::Range<usize>) -> Bounds) {
    // Every node before its children: backwards, children come first. As deep as the tree is, without recursion.
    let mut order = Vec::with_capacity(nodes.len());
    let mut waiting = vec![0usize];
    while let Some(index) = waiting.pop() {
        order.push(index);
        if !nodes[index].is_leaf() {
            let first = nodes[index].first_index as usize;
            waiting.extend([first, first + 1]);
        }
    }
    for index in order.into_iter().rev() {
        let first = nodes[index].first_index as usize;
        let b = if nodes[index].is_leaf() {
            to_obvhs(leaf(first..first + nodes[index].prim_count as usize))
        } else {
            nodes[first].aabb().union(nodes[first + 1].aabb())
        };
        nodes[index].set_aabb(b);
    }
}

/// What the builder is given.
struct Boxes {
    /// The slots in an order of its own.
    order: Vec<u32>,
    /// Boxes of slots, or of parts of them.
    boxes: Vec<Bounds>,
    /// For each box, the place of its slot in that order.
    indices: Vec<u32>,
}

/// Boxes of parts of large triangles, and of everything else whole.
///
/// obvhs looks triangles up by their place in its list, and its leaf collapsing takes for granted that the first box of
/// every primitive stands at the primitive's own place. So triangles come first, spheres next, further parts last.
fn split_large_triangles<T: Tier>(slots: &[StoredSlot<T>], whole: &[Bounds]) -> Boxes {
    let mut order = Vec::with_capacity(slots.len());
    let mut spheres = Vec::new();
    let mut triangles = Vec::with_capacity(slots.len());
    for (index, slot) in (0..).zip(slots) {
        match slot.primitive() {
            Primitive::Triangle(triangle) => {
                let [v0, v1, v2] = triangle.0.map(|corner| corner.as_vec3a());
                triangles.push(obvhs::triangle::Triangle { v0, v1, v2 });
                order.push(index);
            }
            Primitive::Sphere(_) => spheres.push(index),
        }
    }
    let count = triangles.len();
    let mut split: Vec<Aabb> = order.iter().map(|&i| to_obvhs(whole[i as usize])).collect();
    let mut indices: Vec<u32> = (0..count as u32).collect();
    if count > 0 {
        let half_areas = split.iter().map(Aabb::half_area);
        let (total, largest) =
            half_areas.fold((0.0, 0.0f32), |(sum, most), area| (sum + area, most.max(area)));
        split_aabbs_preset(&mut split, &mut indices, &triangles, total / count as f32, largest);
    }
    // The cuts are as exact as the whole triangle's coordinates are.
    let closed = |(b, i): (&Aabb, &u32)| {
        let gap = Vec3::splat(SPLIT_GAP_ULPS * whole[order[*i as usize] as usize].ulp());
        Bounds { min: b.min.into(), max: b.max.into() }.grown(gap, gap)
    };
    let mut boxes: Vec<Bounds> = split.iter().zip(&indices).map(closed).collect();
    boxes.splice(count..count, spheres.iter().map(|&i| whole[i as usize]));
    indices.splice(count..count, count as u32..(count + spheres.len()) as u32);
    order.extend(spheres);
    Boxes { order, boxes, indices }
}
