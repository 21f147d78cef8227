//! The stages of local shading: light samples, and the colours they give.

use crate::effects::Stage;
use crate::effects::tile::{RayGeneration, RenderContext, Tile};
use crate::shading::{ShadingMode, shade_all, takes_light};

/// Samples every light at the surfaces of a generation. Lights below the horizon, and those that the material does not return,
/// are marked as not reaching the surface.
pub(crate) struct SampleLights {
    /// Which terms are shaded.
    pub mode: ShadingMode,
    /// Whether smooth meshes are lit by their shading normals alone.
    pub smooth: bool,
}

impl Stage for SampleLights {
    fn name(&self) -> &'static str {
        "lights"
    }

    fn run(&self, tile: &mut Tile, context: &RenderContext) {
        let Tile { generations, current, lights, .. } = tile;
        let surfaces = &generations[*current].surfaces;
        lights.resize_with(context.world.lights.len(), Box::default);
        for (samples, light) in lights.iter_mut().zip(&context.world.lights) {
            samples.sample(light, surfaces, self.smooth);
        }
        for (material, range) in surfaces.by_material() {
            if !takes_light(&context.world.materials[*material as usize], self.mode) {
                lights.iter_mut().for_each(|light| light.reaches[range.clone()].fill(false));
            }
        }
    }
}

/// Computes the colour of each surface of a generation.
pub(crate) struct Shade {
    /// Which terms are shaded.
    pub mode: ShadingMode,
}

impl Stage for Shade {
    fn name(&self) -> &'static str {
        "shading"
    }

    fn run(&self, tile: &mut Tile, context: &RenderContext) {
        let Tile { generations, current, lights, shading, .. } = tile;
        let RayGeneration { surfaces, colours, .. } = &mut generations[*current];
        let colours = colours.get_or_insert_default();
        shade_all(context.world, self.mode, surfaces, lights, colours, shading);
    }
}
