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
    needs_lights: true,
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
        let Level { surfaces, origins, shadow_points, lights, lights_end, .. } = &mut levels[self.level];
        let numerics = context.world.numerics();
        let precision = numerics.precision();
        let cast = lights.len();
        shadow_rays.clear();
        occluded.clear();
        let mut start = 0;
        for (index, &end) in lights_end.iter().enumerate() {
            let end = end as usize;
            let lights = &lights[start..end];
            let surface = &surfaces[index];
            let origin = match shadow_points.get(index) {
                Some(lifted) => lifted.origin_towards(surface.geometric_normal, numerics),
                None => origins[index],
            };
            let moved = origin - surface.point.position;
            shadow_rays
                .extend(lights.iter().map(|light| shadow_ray(origin, &light.seen_from(moved), precision)));
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

/// The ray from `origin`, on a surface's outer side, to a light as seen from there, open at both ends.
///
/// Rounded, it ends beside the light, by up to half a step of its numbers relative to its length, and by a few of f64's
/// from the way to the light: what it meets there may be what the light stands on, and does not count. Where the ray
/// rises less than a quarter from what the light stands on it may still meet it.
pub fn shadow_ray(origin: DVec3, light: &LightSample, precision: Precision) -> Ray {
    let beside = 2.0 * precision.epsilon() + 8.0 * f64::EPSILON;
    precision.ray(origin, light.direction, 0.0, light.distance * (1.0 - beside))
}
