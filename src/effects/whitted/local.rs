//! The stages of local shading: light samples, and the colours they give.

use crate::effects::tile::{RayGeneration, RenderContext, Tile};
use crate::shading::{ShadingMode, shade_all, takes_light};

/// Samples every light at the surfaces of a generation. Lights below the horizon, and those that the material does not return,
/// are marked as not reaching the surface.
pub(crate) fn sample_lights(tile: &mut Tile, context: &RenderContext, mode: ShadingMode, smooth: bool) {
    let Tile { generations, current, lights, .. } = tile;
    let surfaces = &generations[*current].surfaces;
    lights.resize_with(context.world.lights.len(), Box::default);
    for (samples, light) in lights.iter_mut().zip(&context.world.lights) {
        samples.sample(light, surfaces, smooth);
    }
    for (material, range) in surfaces.by_material() {
        if !takes_light(&context.world.materials[*material as usize], mode) {
            lights.iter_mut().for_each(|light| light.reaches[range.clone()].fill(false));
        }
    }
}

/// Computes the colour of each surface of a generation.
pub(crate) fn shade(tile: &mut Tile, context: &RenderContext, mode: ShadingMode) {
    let Tile { generations, current, lights, shading, .. } = tile;
    let RayGeneration { surfaces, colours, .. } = &mut generations[*current];
    let colours = colours.get_or_insert_default();
    shade_all(context.world, mode, surfaces, lights, colours, shading);
}
