//! The stage that makes one camera ray per pixel.

use super::Stage;
use super::tile::{RenderContext, Tile};

/// Fills generation 0 with the rays through the centres of the tile's pixels.
pub(crate) struct PrimaryRays;

impl Stage for PrimaryRays {
    fn name(&self) -> &'static str {
        "primary"
    }

    fn run(&self, tile: &mut Tile, context: &RenderContext) {
        let Some(window) = tile.window else { return };
        let precision = context.world.numerics().ray_precision();
        let generation = tile.generation();
        context.view.rays(window, precision, &mut generation.rays);
        if generation.sources.len() != generation.rays.len() {
            generation.sources.clear();
            generation.sources.extend(0..generation.rays.len() as u32);
        }
    }
}
