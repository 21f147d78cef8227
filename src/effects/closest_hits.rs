//! The stage that finds closest hits and their surface interactions.

use super::RayKind;
use super::tile::{RenderContext, Tile};
use super::transparency::{self, Transparency};
use crate::world::{HitOrder, World};

/// Finds the closest hits of a generation's rays and computes their surface interactions.
pub(crate) struct ClosestHits {
    /// The kind that the rays are counted as.
    pub kind: RayKind,
    /// The order of their surface interactions.
    pub order: HitOrder,
    /// How rays pass through surfaces; `None` where all are opaque.
    pub transparency: Option<Transparency>,
}

impl ClosestHits {
    /// Finds the hits. Returns whether they are the first of these rays.
    fn find_hits(&self, tile: &mut Tile, world: &World) -> bool {
        if let Some(transparency) = self.transparency {
            return transparency::find_hits(tile, world, transparency);
        }
        let Tile { generations, current, traversal, .. } = tile;
        let generation = &mut generations[*current];
        generation.hits.clear();
        world.accelerator.closest_hits(generation.rays.rays(), &mut generation.hits, traversal);
        true
    }

    /// Runs the stage.
    pub(crate) fn run(&self, tile: &mut Tile, context: &RenderContext) {
        let world = context.world;
        let is_first = self.find_hits(tile, world);
        let Tile {
            generations, current, depth, camera_hits, visible_objects, coverage, shown, caught, ..
        } = tile;
        let generation = &mut generations[*current];
        world.interactions(&generation.rays, &generation.hits, self.order, &mut generation.surfaces);
        if *depth == 0 {
            camera_hits.clear();
            camera_hits.extend(generation.surfaces.ray_of());
            visible_objects.resize(world.objects.len(), false);
            let objects = generation.surfaces.objects().iter();
            objects.for_each(|&object| visible_objects[object as usize] = true);
            if let Some(shown) = shown {
                shown.clear();
                shown.resize(generation.rays.len(), [0.0; 4]);
            }
            if let Some(coverage) = coverage {
                coverage.clear();
                coverage.resize(generation.rays.len(), 0.0);
                camera_hits.iter().for_each(|&ray| coverage[ray as usize] = 1.0);
                let surfaces = &generation.surfaces;
                let is_caught = |i: &usize| world.shadow_catcher() == Some(surfaces.objects()[*i]);
                let found = (0..surfaces.len()).filter(is_caught);
                caught.clear();
                caught.extend(found.map(|i| (surfaces.ray_of()[i], surfaces.position.get(i))));
            }
        }
        let (cast, hit) = (generation.rays.len(), generation.surfaces.len());
        tile.record(|recorder, tile| recorder.add_generation(self.kind, tile, world));
        // A further layer has the rays of the first.
        if is_first {
            tile.count(self.kind, cast, hit);
        }
    }
}
