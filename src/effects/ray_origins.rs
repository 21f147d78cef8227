//! The stage that computes the origins of the rays that leave surfaces, shared by all effects that cast such rays.

use super::Stage;
use super::tile::{RayGeneration, RenderContext, Tile};
use crate::geometry::Numerics;
use crate::world::{InteractionSoa, Vec3Soa, simd_dispatch};

/// Computes the ray origin of each surface of a generation.
pub(crate) struct RayOrigins {
    /// The number of generations, from the first, that need origins.
    pub generations: u32,
}

impl Stage for RayOrigins {
    fn name(&self) -> &'static str {
        "ray origins"
    }

    fn run(&self, tile: &mut Tile, context: &RenderContext) {
        if tile.depth >= self.generations as usize {
            return;
        }
        let RayGeneration { surfaces, origins, .. } = tile.generation();
        let origins = origins.get_or_insert_default();
        // The tier is passed as a constant, so that the loops have no branch on it.
        match context.world.numerics() {
            Numerics::Naive => simd_dispatch(
                #[inline(always)]
                || find_origins(surfaces, origins, Numerics::Naive),
            ),
            _ => simd_dispatch(
                #[inline(always)]
                || find_origins(surfaces, origins, Numerics::Watertight),
            ),
        }
    }
}

#[inline(always)]
fn find_origins(surfaces: &InteractionSoa, origins: &mut Vec3Soa, numerics: Numerics) {
    for i in 0..surfaces.len() {
        origins.set(i, surfaces.point(i).origin_towards(surfaces.geometric_normal.get(i), numerics));
    }
}
