//! The stage that writes the colours of surfaces to pixels.

use crate::effects::recorder::Recorder;
use crate::effects::shadow_catcher::catch_shadows;
use crate::effects::tile::{RayGeneration, RenderContext, Tile};
use crate::effects::unlit::expose_unlit;
use crate::world::{RAYS_PER_BATCH, Vec3Soa, World, simd};

/// Gives every pixel the colour of its surface, of the environment, or of the background.
pub(crate) fn write_pixels(tile: &mut Tile, context: &RenderContext) {
    write(tile, context.world);
    expose_unlit(tile, context);
    catch_shadows(tile, context.world, false);
    tile.record(Recorder::add_colours);
}

fn write(tile: &mut Tile, world: &World) {
    let Tile { generations, pixels, .. } = tile;
    let generation = &generations[0];
    let RayGeneration { surfaces, colours: Some(colours), .. } = generation else { return };
    pixels.resize(generation.rays.len(), world.background.as_vec3().to_array());
    if surfaces.len() == pixels.len() {
        // Every ray hit: surface i belongs to pixel i.
        simd!(write_all(colours, pixels));
        return;
    }
    if world.environment.is_some() {
        for (ray, &source) in generation.rays.rays().iter().zip(&generation.sources) {
            let place = world.environment_position(ray.direction());
            pixels[source as usize] = world.background_towards(ray.direction(), place).as_vec3().to_array();
        }
    }
    for (i, &ray) in surfaces.ray_of().iter().enumerate() {
        pixels[generation.sources[ray as usize] as usize] = colours.get(i).as_vec3().to_array();
    }
}

#[inline(always)]
fn write_all(colours: &Vec3Soa, pixels: &mut [[f32; 3]]) {
    for (i, pixel) in (0..RAYS_PER_BATCH).zip(pixels) {
        *pixel = colours.get(i).as_vec3().to_array();
    }
}
