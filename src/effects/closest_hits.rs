//! The stage that finds closest hits and their surface interactions.

use super::tile::{RenderContext, Tile};
use super::{RayKind, Stage};

/// Finds the closest hits of a generation's rays and computes their surface interactions.
pub(crate) struct ClosestHits {
    /// The kind that the rays are counted as.
    pub kind: RayKind,
    /// The name in statistics.
    pub name: &'static str,
}

impl Stage for ClosestHits {
    fn name(&self) -> &'static str {
        self.name
    }

    fn run(&self, tile: &mut Tile, context: &RenderContext) {
        let world = context.world;
        let Tile { generations, depth, traversal, visible_objects, recorder, .. } = tile;
        let generation = &mut generations[*depth];
        generation.hits.clear();
        world.accelerator.closest_hits(&generation.rays, &mut generation.hits, traversal);
        world.interactions(&generation.soa, &generation.hits, &mut generation.surfaces);
        if *depth == 0 {
            visible_objects.resize(world.objects.len(), false);
            let objects = generation.surfaces.objects().iter();
            objects.for_each(|&object| visible_objects[object as usize] = true);
        }
        if let Some(recorder) = recorder {
            recorder.record_generation(self.kind, *depth, generation);
        }
        let (cast, hit) = (generation.rays.len(), generation.surfaces.len());
        tile.count(self.kind, cast, hit);
    }
}
