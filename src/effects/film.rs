//! From surfaces to pixels.

use super::Stage;
use super::tile::{Context, Tile};
use crate::world::{LANES, Lanes, widely};

/// Gives every pixel the colour of its surface, or the background's.
pub struct Expose;

impl Stage for Expose {
    fn name(&self) -> &'static str {
        "film"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let Tile { levels, pixels, .. } = tile;
        let level = &levels[0];
        let surfaces = &level.surfaces;
        pixels.resize(level.rays.len(), context.world.background.as_vec3().to_array());
        if surfaces.len() == pixels.len() {
            // A ray a pixel, a surface a ray.
            widely(
                #[inline(always)]
                || expose(&level.colours, pixels),
            );
            return;
        }
        for (i, &ray) in surfaces.ray_of().iter().enumerate() {
            pixels[level.sources[ray as usize] as usize] = level.colours.get(i).as_vec3().to_array();
        }
    }
}

#[inline(always)]
fn expose(colours: &Lanes, pixels: &mut [[f32; 3]]) {
    for (i, pixel) in (0..LANES).zip(pixels) {
        *pixel = colours.get(i).as_vec3().to_array();
    }
}
