//! Shadows: a light counts only where nothing lies between it and the surface.
//!
//! ASSIGNMENT section 4: a ray from the point towards the light, blocked by anything *between* the two; what lies
//! behind the light does not count.

use super::tile::{Context, Level, Tile};
use super::{Effect, RayKind, Stage};
use crate::geometry::Ray;
use crate::shading::LightSample;
use crate::world::{Surface, World};

/// In the registry.
pub const EFFECT: Effect = Effect {
    name: "shadows",
    summary: "lights are blocked by what stands in their way",
    called_for: |world: &World| match world.lights.as_slice() {
        [] => Err("the scene has no lights".into()),
        [one] => Ok(format!("light `{}`", one.name)),
        many => Ok(format!("{} lights", many.len())),
    },
};

/// Takes away the lights that do not reach the surfaces of a level.
pub struct Shadows {
    /// Which level.
    pub level: usize,
}

impl Stage for Shadows {
    fn name(&self) -> &'static str {
        "shadows"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let Tile { levels, traversal, .. } = tile;
        let Level { surfaces, lights, lights_end, .. } = &mut levels[self.level];
        let cast = lights.len();
        // What reaches its surface moves up over what does not.
        let (mut next, mut kept) = (0, 0);
        for (surface, end) in surfaces.iter().zip(lights_end) {
            while next < *end as usize {
                let light = lights[next];
                if !context.world.accelerator.is_occluded(&shadow_ray(surface, &light), traversal) {
                    lights[kept] = light;
                    kept += 1;
                }
                next += 1;
            }
            *end = kept as u32;
        }
        lights.truncate(kept);
        tile.count(RayKind::Shadow, cast, cast - kept);
    }
}

/// From the surface's outer side to the light, open at both ends.
pub fn shadow_ray(surface: &Surface, light: &LightSample) -> Ray {
    let origin = surface.point.origin_towards(surface.geometric_normal);
    Ray::new(origin, light.direction, 0.0, light.distance)
}
