//! Local shading: the lights over a surface's horizon, and the colour it has under them.

use super::Stage;
use super::tile::{Context, Level, Tile};
use crate::shading::{LightSample, ShadingMode, shade};

/// Finds, for each surface of a level, the lights that shine on its side.
pub struct Illuminate {
    /// Which level.
    pub level: usize,
    /// Whether smooth meshes are lit by their normals alone.
    pub smooth: bool,
}

impl Stage for Illuminate {
    fn name(&self) -> &'static str {
        "lights"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let Level { surfaces, lights, lights_end, .. } = tile.level(self.level);
        for surface in surfaces.iter() {
            lights.extend(
                context.world.lights.iter().filter_map(|light| LightSample::new(light, surface, self.smooth)),
            );
            lights_end.push(lights.len() as u32);
        }
    }
}

/// Computes the colour of each surface of a level.
pub struct Shade {
    /// Which level.
    pub level: usize,
    /// How far shading goes.
    pub mode: ShadingMode,
}

impl Stage for Shade {
    fn name(&self) -> &'static str {
        "shading"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let level = tile.level(self.level);
        for index in 0..level.surfaces.len() {
            let lights = &level.lights[level.lights_of(index)];
            let colour = shade(context.world, self.mode, &level.surfaces[index], lights);
            level.colours.push(colour);
        }
    }
}
