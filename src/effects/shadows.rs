//! Shadows: a light counts only where nothing lies between it and the surface.
//!
//! The assignment's report: a ray from the point towards the light, blocked by anything *between* the two; what lies
//! behind the light does not count.

use glam::DVec3;

use super::tile::{Context, Level, Tile};
use super::{Effect, RayKind, Stage};
use crate::geometry::{Precision, Ray};
use crate::shading::{LightLanes, LightSample};
use crate::world::{Lanes, RayLanes, Surfaces, widely};

/// In the registry.
pub const EFFECT: Effect = Effect {
    name: "shadows",
    summary: "lights are blocked by what stands in their way",
    needs_lights: true,
    is_shading: true,
    called_for: |world, _| match world.lights.as_slice() {
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
        let Tile {
            levels,
            lights,
            traversal,
            shadow_rays,
            shadow_lanes,
            shadow_origins,
            occluded,
            shadowed,
            ..
        } = tile;
        let Level { surfaces, origins, shadow_points, .. } = &levels[self.level];
        let numerics = context.world.numerics();
        for (i, lifted) in shadow_points.iter().enumerate() {
            shadow_origins.set(i, lifted.origin_towards(surfaces.geometric_normal.get(i), numerics));
        }
        let origins = if shadow_points.is_empty() { origins } else { shadow_origins };
        let (mut cast, mut blocked) = (0, 0);
        for light in lights {
            match numerics.precision() {
                Precision::Single => widely(
                    #[inline(always)]
                    || rays_to(light, surfaces, origins, Precision::Single, shadow_lanes),
                ),
                Precision::Double => widely(
                    #[inline(always)]
                    || rays_to(light, surfaces, origins, Precision::Double, shadow_lanes),
                ),
            }
            list_reached(&light.reaches[..surfaces.len()], shadowed);
            if shadowed.len() == surfaces.len() {
                shadow_lanes.weave(surfaces.len(), shadow_rays);
            } else {
                shadow_lanes.weave_some(shadowed, shadow_rays);
            }
            occluded.clear();
            context.world.accelerator.are_occluded(shadow_rays, occluded, traversal);
            cast += occluded.len();
            let met = occluded.iter().filter(|&&blocked| blocked).count();
            if met > 0 {
                for (&surface, &is_blocked) in shadowed.iter().zip(&*occluded) {
                    light.reaches[surface as usize] &= !is_blocked;
                }
            }
            blocked += met;
        }
        tile.count(RayKind::Shadow, cast, blocked);
    }
}

/// The rays from all surfaces to a light.
#[inline(always)]
fn rays_to(
    light: &LightLanes,
    surfaces: &Surfaces,
    origins: &Lanes,
    precision: Precision,
    rays: &mut RayLanes,
) {
    for i in 0..surfaces.len() {
        let origin = origins.get(i);
        let seen = light.get(i).seen_from(origin - surfaces.position.get(i));
        // Where the light does not reach it may have no direction, and nobody will ask.
        let normal = surfaces.geometric_normal.get(i);
        let pick = |a: f64, b: f64| if light.reaches[i] { a } else { b };
        let direction = DVec3::new(
            pick(seen.direction.x, normal.x),
            pick(seen.direction.y, normal.y),
            pick(seen.direction.z, normal.z),
        );
        rays.set(i, &shadow_ray(origin, &LightSample { direction, ..seen }, precision));
    }
}

/// Lists the surfaces that a light reaches.
fn list_reached(reaches: &[bool], surfaces: &mut Vec<u32>) {
    surfaces.clear();
    if reaches.iter().all(|&reaches| reaches) {
        surfaces.extend(0..reaches.len() as u32);
    } else {
        surfaces.extend((0..).zip(reaches).filter(|(_, reaches)| **reaches).map(|(i, _)| i));
    }
}

/// The ray from `origin`, on a surface's outer side, to a light as seen from there, open at both ends.
///
/// Rounded, it ends beside the light, by up to half a step of its numbers relative to its length, and by a few of f64's
/// from the way to the light: what it meets there may be what the light stands on, and does not count. Where the ray
/// rises less than a quarter from what the light stands on it may still meet it.
#[inline(always)]
pub fn shadow_ray(origin: DVec3, light: &LightSample, precision: Precision) -> Ray {
    let beside = 2.0 * precision.epsilon() + 8.0 * f64::EPSILON;
    precision.ray(origin, light.direction, 0.0, light.distance * (1.0 - beside))
}
