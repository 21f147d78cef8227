//! What rays see: closest hits, and the full account of each.

use super::tile::{Context, Level, Tile};
use super::{RayKind, Stage};
use crate::geometry::Numerics;
use crate::geometry::spawn::SurfacePoint;
use crate::world::{Lanes, Surfaces, widely};

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
        level.hits.clear();
        world.accelerator.closest_hits(&level.rays, &mut level.hits, traversal);
        world.surfaces(&level.lanes, &level.hits, &mut level.surfaces);
        level.shadow_points.clear();
        if self.level == 0 {
            seen.resize(world.objects.len(), false);
            level.surfaces.objects().iter().for_each(|&object| seen[object as usize] = true);
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
        let level = tile.level(self.level);
        let Level { surfaces, origins, .. } = level;
        match context.world.numerics() {
            Numerics::Fast => widely(
                #[inline(always)]
                || find_origins(surfaces, origins, Numerics::Fast),
            ),
            Numerics::Watertight => widely(
                #[inline(always)]
                || find_origins(surfaces, origins, Numerics::Watertight),
            ),
            Numerics::Double | Numerics::Exact => {
                widely(
                    #[inline(always)]
                    || find_origins(surfaces, origins, context.world.numerics()),
                );
            }
        }
    }
}

#[inline(always)]
fn find_origins(surfaces: &Surfaces, origins: &mut Lanes, numerics: Numerics) {
    for i in 0..surfaces.len() {
        let point = SurfacePoint { position: surfaces.position.get(i), reach: surfaces.reach.get(i) };
        origins.set(i, point.origin_towards(surfaces.geometric_normal.get(i), numerics));
    }
}
