//! From surfaces to pixels.

use super::Stage;
use super::tile::{Context, Tile};

/// Gives every pixel the colour of its surface, or the background's.
pub struct Expose;

impl Stage for Expose {
    fn name(&self) -> &'static str {
        "film"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let Tile { levels, pixels, .. } = tile;
        let level = &levels[0];
        pixels.resize(level.rays.len(), context.world.background.as_vec3().to_array());
        for (i, &ray) in level.surfaces.ray_of().iter().enumerate() {
            pixels[level.sources[ray as usize] as usize] = level.colours.get(i).as_vec3().to_array();
        }
    }
}
