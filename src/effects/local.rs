//! Local shading: the lights over a surface's horizon, and the colour it has under them.

use super::Stage;
use super::tile::{Context, Level, Tile};
use crate::shading::{ShadingMode, shade_all, takes_light};

/// Finds, for each surface of a level, the lights that shine on its side and that its material returns.
pub struct Illuminate {
    /// How far shading goes.
    pub mode: ShadingMode,
    /// Whether smooth meshes are lit by their normals alone.
    pub smooth: bool,
}

impl Stage for Illuminate {
    fn name(&self) -> &'static str {
        "lights"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let Tile { levels, depth, lights, .. } = tile;
        let surfaces = &levels[*depth].surfaces;
        lights.resize_with(context.world.lights.len(), Box::default);
        for (lanes, light) in lights.iter_mut().zip(&context.world.lights) {
            lanes.look(light, surfaces, self.smooth);
        }
        // What no light changes asks none.
        for (material, range) in surfaces.by_material() {
            if !takes_light(&context.world.materials[*material as usize], self.mode) {
                lights.iter_mut().for_each(|light| light.reaches[range.clone()].fill(false));
            }
        }
    }
}

/// Computes the colour of each surface of a level.
pub struct Shade {
    /// How far shading goes.
    pub mode: ShadingMode,
}

impl Stage for Shade {
    fn name(&self) -> &'static str {
        "shading"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let Tile { levels, depth, lights, shading, .. } = tile;
        let Level { surfaces, colours, .. } = &mut levels[*depth];
        shade_all(context.world, self.mode, surfaces, lights, colours, shading);
    }
}
