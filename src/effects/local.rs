//! Local shading: the lights over a surface's horizon, and the colour it has under them.

use super::Stage;
use super::tile::{Context, Level, Tile};
use crate::shading::{ShadingMode, shade_all};

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
        let Tile { levels, lights, .. } = tile;
        let surfaces = &levels[self.level].surfaces;
        lights.resize_with(context.world.lights.len(), Box::default);
        for (lanes, light) in lights.iter_mut().zip(&context.world.lights) {
            lanes.look(light, surfaces, self.smooth);
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
        let Tile { levels, lights, shading, .. } = tile;
        let Level { surfaces, colours, .. } = &mut levels[self.level];
        shade_all(context.world, self.mode, surfaces, lights, colours, shading);
    }
}
