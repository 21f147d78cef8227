//! Where rays that leave surfaces start: shared by all effects that send some out.

use super::Stage;
use super::tile::{Context, Level, Tile};
use crate::geometry::Numerics;
use crate::world::{Lanes, Surfaces, widely};

/// Finds, for each surface of a level, where rays that leave it start. Only where some do.
pub struct Origins {
    /// On how many levels, from the first, some do.
    pub levels: u32,
}

impl Stage for Origins {
    fn name(&self) -> &'static str {
        "ray origins"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        if tile.depth >= self.levels as usize {
            return;
        }
        let Level { surfaces, origins, .. } = tile.level();
        let origins = origins.get_or_insert_default();
        // Constants, so that the loops have no branch on the tier.
        match context.world.numerics() {
            Numerics::Fast => widely(
                #[inline(always)]
                || find_origins(surfaces, origins, Numerics::Fast),
            ),
            _ => widely(
                #[inline(always)]
                || find_origins(surfaces, origins, Numerics::Watertight),
            ),
        }
    }
}

#[inline(always)]
fn find_origins(surfaces: &Surfaces, origins: &mut Lanes, numerics: Numerics) {
    for i in 0..surfaces.len() {
        origins.set(i, surfaces.point(i).origin_towards(surfaces.geometric_normal.get(i), numerics));
    }
}
