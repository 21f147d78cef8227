//! The stages of local shading: light samples, and the colours they give.

use crate::effects::record::{LightRecord, LocalRecord};
use crate::effects::recorder::Recorder;
use crate::effects::tile::{RayGeneration, RenderContext, Tile};
use crate::shading::{LightSample, ShadingMode, shade_all, takes_light, terms_of};
use crate::world::World;

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
    tile.record(|recorder, tile| record(recorder, tile, context.world, mode));
}

/// Records lights, terms and colours of the current generation.
#[cold]
fn record(recorder: &mut Recorder, tile: &Tile, world: &World, mode: ShadingMode) {
    let RayGeneration { surfaces, colours: Some(colours), .. } = &tile.generations[tile.current] else {
        return;
    };
    for (i, record) in recorder.surfaces(tile.depth) {
        let lights = tile.lights.iter().enumerate().map(|(index, light)| {
            let LightSample { cosine, radiance, .. } = light.get(i);
            LightRecord { light: world.light_name(index), cosine, radiance, reaches: light.reaches[i] }
        });
        record.local = Some(LocalRecord {
            lights: lights.collect(),
            terms: terms_of(world, mode, surfaces, &tile.lights, i),
            colour: colours.get(i),
            glaze: None,
            steps_8_bit: None,
        });
    }
}
