//! What rays see: closest hits, and the full account of each.

use super::tile::{Context, Tile};
use super::{RayKind, Stage};
use crate::world::Surface;

/// Finds the surfaces that the rays of a level hit.
pub struct Visible {
    /// Which level.
    pub level: usize,
    /// What its rays count as.
    pub kind: RayKind,
}

impl Stage for Visible {
    fn name(&self) -> &'static str {
        match self.kind {
            RayKind::Glaze => "glaze hits",
            _ => "primary hits",
        }
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let world = context.world;
        tile.level(self.level);
        let Tile { levels, traversal, seen, .. } = tile;
        let level = &mut levels[self.level];
        world.accelerator.closest_hits(&level.rays, &mut level.hits, traversal);
        for ((index, ray), hit) in (0..).zip(&level.rays).zip(&level.hits) {
            if let Some(hit) = hit {
                level.ray_of.push(index);
                level.surfaces.push(world.surface(ray, hit));
            }
        }
        if self.level == 0 {
            seen.resize(world.objects.len(), false);
            level.surfaces.iter().for_each(|surface| seen[surface.object as usize] = true);
        }
        let (cast, hit) = (level.rays.len(), level.surfaces.len());
        tile.count(self.kind, cast, hit);
    }
}

/// Finds, for each surface of a level, where rays that leave it start. Only where some do.
pub struct Origins {
    /// Which level.
    pub level: usize,
}

impl Stage for Origins {
    fn name(&self) -> &'static str {
        "ray origins"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let numerics = context.world.numerics();
        let level = tile.level(self.level);
        let origin = |s: &Surface| s.point.origin_towards(s.geometric_normal, numerics);
        level.origins.extend(level.surfaces.iter().map(origin));
    }
}
