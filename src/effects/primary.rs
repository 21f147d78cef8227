//! One ray a pixel, from the camera.

use super::Stage;
use super::tile::{Context, Tile};

/// Fills level 0 with the rays of the tile's pixels.
pub struct Primary;

impl Stage for Primary {
    fn name(&self) -> &'static str {
        "primary"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let Some(window) = tile.window else { return };
        let precision = context.world.numerics().ray_precision();
        let level = tile.level();
        context.view.rays(window, precision, &mut level.lanes);
        level.lanes.weave(window.area(), &mut level.rays);
        if level.sources.len() != level.rays.len() {
            level.sources.clear();
            level.sources.extend(0..level.rays.len() as u32);
        }
    }
}
