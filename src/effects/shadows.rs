//! Shadows: a light counts only where nothing lies between it and the surface.
//!
//! The assignment's report: a ray from the point towards the light, blocked by anything *between* the two; what lies
//! behind the light does not count.

use glam::DVec3;

use super::tile::{Context, Level, Tile};
use super::{Effect, RayKind, Stage};
use crate::geometry::{Precision, Ray};
use crate::shading::LightSample;
use crate::world::World;

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
        let Tile { levels, traversal, shadow_rays, occluded, .. } = tile;
        let Level { origins, lights, lights_end, .. } = &mut levels[self.level];
        let precision = context.world.numerics().precision();
        let cast = lights.len();
        shadow_rays.clear();
        occluded.clear();
        let mut start = 0;
        for (origin, &end) in origins.iter().zip(lights_end.iter()) {
            let end = end as usize;
            shadow_rays.extend(lights[start..end].iter().map(|light| shadow_ray(*origin, light, precision)));
            start = end;
        }
        context.world.accelerator.are_occluded(shadow_rays, occluded, traversal);
        // What reaches its surface moves up over what does not.
        let (mut next, mut kept) = (0, 0);
        for end in lights_end {
            while next < *end as usize {
                if !occluded[next] {
                    lights[kept] = lights[next];
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

/// The ray from `origin`, on a surface's outer side, to a light, open at both ends.
pub fn shadow_ray(origin: DVec3, light: &LightSample, precision: Precision) -> Ray {
    precision.ray(origin, light.direction, 0.0, light.distance)
}
