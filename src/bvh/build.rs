//! Building: obvhs's PLOC, reinsertion and leaf collapsing, over kiln's own boxes.

use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;
use obvhs::splits::split_aabbs_preset;

use super::{Primitive, Slot, Tree};
use crate::geometry::Bounds;

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

/// Builds a tree over `slots`, which end up in the order of its leaves.
///
/// The steps are those of obvhs's own `build_bvh2`, with boxes of ours and without the validation that it runs in
/// debug builds, which takes deep trees for broken ones.
pub fn build(slots: &[Slot], preset: Preset) -> Tree {
    if slots.is_empty() {
        return Tree::default();
    }
    let parameters = preset.parameters();
    let mut order: Vec<u32> = (0..slots.len() as u32).collect();
    let mut boxes: Vec<Aabb> = slots.iter().map(|slot| to_obvhs(slot.primitive.bounds())).collect();
    let mut indices = order.clone();
    if parameters.pre_split {
        (order, boxes, indices) = split_large_triangles(slots, &boxes);
    }
    let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
        parameters.ploc_search_distance,
        &boxes,
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

    let ordered = tree.primitive_indices.iter().map(|&i| slots[order[i as usize] as usize]).collect();
    Tree::new(tree.nodes, ordered)
}

fn to_obvhs(b: Bounds) -> Aabb {
    Aabb::new(Vec3A::from(b.min), Vec3A::from(b.max))
}

/// Boxes of parts of large triangles, and of everything else whole. Returns the slots in an order of its own, the
/// boxes, and for each box its place in that order.
///
/// obvhs looks triangles up by their place in its list, and its leaf collapsing takes for granted that the first box of
/// every primitive stands at the primitive's own place. So triangles come first, spheres next, further parts last.
fn split_large_triangles(slots: &[Slot], whole: &[Aabb]) -> (Vec<u32>, Vec<Aabb>, Vec<u32>) {
    let mut order = Vec::with_capacity(slots.len());
    let mut spheres = Vec::new();
    let mut triangles = Vec::with_capacity(slots.len());
    for (index, slot) in (0..).zip(slots) {
        match slot.primitive {
            Primitive::Triangle(triangle) => {
                let [v0, v1, v2] = triangle.0.map(Vec3A::from);
                triangles.push(obvhs::triangle::Triangle { v0, v1, v2 });
                order.push(index);
            }
            Primitive::Sphere(_) => spheres.push(index),
        }
    }
    let count = triangles.len();
    let mut boxes: Vec<Aabb> = order.iter().map(|&i| whole[i as usize]).collect();
    let mut places: Vec<u32> = (0..count as u32).collect();
    if count > 0 {
        let half_areas = boxes.iter().map(Aabb::half_area);
        let (total, largest) =
            half_areas.fold((0.0, 0.0f32), |(sum, most), area| (sum + area, most.max(area)));
        split_aabbs_preset(&mut boxes, &mut places, &triangles, total / count as f32, largest);
    }
    for b in &mut boxes {
        *b = to_obvhs(Bounds { min: b.min.into(), max: b.max.into() }.grown(SPLIT_GAP_ULPS));
    }
    boxes.splice(count..count, spheres.iter().map(|&i| whole[i as usize]));
    places.splice(count..count, count as u32..(count + spheres.len()) as u32);
    order.extend(spheres);
    (order, boxes, places)
}
