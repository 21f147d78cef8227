//! The stage that makes one camera ray per pixel.

use super::tile::{RenderContext, Tile};

/// Fills generation 0 with the rays through the centres of the tile's pixels.
pub(crate) fn fill(tile: &mut Tile, context: &RenderContext) {
    let Some(window) = tile.window else { return };
    let precision = context.world.numerics().ray_precision();
    let generation = tile.generation();
    context.view.rays(window, precision, &mut generation.rays);
    if generation.sources.len() != generation.rays.len() {
        generation.sources.clear();
        generation.sources.extend(0..generation.rays.len() as u32);
    }
}
