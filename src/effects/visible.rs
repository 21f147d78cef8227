//! What rays see: closest hits, and the full account of each.

use super::tile::{Context, Tile};
use super::{RayKind, Stage};

/// Finds the surfaces that the rays of a level hit.
pub struct Visible {
    /// What its rays count as.
    pub kind: RayKind,
    /// The name in statistics.
    pub name: &'static str,
}

impl Stage for Visible {
    fn name(&self) -> &'static str {
        self.name
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let world = context.world;
        let Tile { levels, depth, traversal, seen, onlooker, .. } = tile;
        let level = &mut levels[*depth];
        level.hits.clear();
        world.accelerator.closest_hits(&level.rays, &mut level.hits, traversal);
        world.surfaces(&level.lanes, &level.hits, &mut level.surfaces);
        if *depth == 0 {
            seen.resize(world.objects.len(), false);
            level.surfaces.objects().iter().for_each(|&object| seen[object as usize] = true);
        }
        if let Some(onlooker) = onlooker {
            onlooker.see_level(self.kind, *depth, level);
        }
        let (cast, hit) = (level.rays.len(), level.surfaces.len());
        tile.count(self.kind, cast, hit);
    }
}
