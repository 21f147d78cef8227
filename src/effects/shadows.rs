//! Shadows: a light counts only where nothing lies between it and the surface.
//!
//! The assignment's report: a ray from the point towards the light, blocked by anything *between* the two; what lies
//! behind the light does not count.

use glam::DVec3;

use super::tile::{Context, Level, Tile, vec_bytes};
use super::{Asked, Effect, Hook, RayKind, Stage, named};
use crate::geometry::{Numerics, Ray};
use crate::shading::{LightLanes, LightSample};
use crate::world::{Lanes, RayLanes, Surfaces, World, widely};

/// Towards lights.
const RAYS: RayKind = RayKind("shadow");

/// In the registry.
pub const EFFECT: Effect = Effect {
    name: "shadows",
    summary: "lights are blocked by what stands in their way",
    needs_lights: true,
    is_shading: true,
    rays: &[RAYS],
    value: None,
    called_for: |world: &World, _| {
        let names: Vec<&str> = world.lights.iter().map(|light| light.name.as_str()).collect();
        named("light", &names).ok_or_else(|| "the scene has no lights".into())
    },
    outline: |_, outline| {
        if outline.lit {
            outline.shadow_rays = true;
            outline.leaving = u32::MAX;
        }
    },
    stages: |_: &Asked, hook| match hook {
        Hook::AfterLighting(_) => vec![Box::new(Shadows)],
        _ => Vec::new(),
    },
    bytes: |tile| {
        tile.kept::<Buffers>().map_or(0, |Buffers { lanes, rays, occluded, asked }| {
            size_of::<Buffers>()
                + size_of_val(&**lanes)
                + vec_bytes(rays)
                + vec_bytes(occluded)
                + vec_bytes(asked)
        })
    },
};

/// What asking about one light takes.
#[derive(Default)]
struct Buffers {
    /// The shadow rays of all surfaces of a level, coordinate by coordinate.
    lanes: Box<RayLanes>,
    /// Those that are cast.
    rays: Vec<Ray>,
    /// For each of them, whether it is blocked.
    occluded: Vec<bool>,
    /// For each of them, its surface.
    asked: Vec<u32>,
}

/// Takes away the lights that do not reach the surfaces of a level.
struct Shadows;

impl Stage for Shadows {
    fn name(&self) -> &'static str {
        "shadows"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        tile.with(|own: &mut Buffers, tile| take_away(own, tile, context));
    }
}

fn take_away(own: &mut Buffers, tile: &mut Tile, context: &Context) {
    let Tile { levels, depth, lights, traversal, onlooker, .. } = tile;
    let Level { surfaces, origins, shadow_origins, .. } = &levels[*depth];
    let Some(origins) = shadow_origins.as_ref().or(origins.as_ref()) else { return };
    let Buffers { lanes, rays, occluded, asked } = own;
    let (mut cast, mut blocked) = (0, 0);
    for (index, light) in lights.iter_mut().enumerate() {
        list_reached(&light.reaches[..surfaces.len()], asked);
        if asked.is_empty() {
            continue;
        }
        // Constants, so that the loop has no branch on the tier.
        match context.world.numerics() {
            Numerics::Fast => widely(
                #[inline(always)]
                || rays_to(light, surfaces, origins, Numerics::Fast, lanes),
            ),
            Numerics::Watertight => widely(
                #[inline(always)]
                || rays_to(light, surfaces, origins, Numerics::Watertight, lanes),
            ),
            Numerics::Double | Numerics::Exact => widely(
                #[inline(always)]
                || rays_to(light, surfaces, origins, Numerics::Double, lanes),
            ),
        }
        if asked.len() == surfaces.len() {
            lanes.weave(surfaces.len(), rays);
        } else {
            lanes.weave_some(asked, rays);
        }
        occluded.clear();
        context.world.accelerator.are_occluded(rays, occluded, traversal);
        if let Some(onlooker) = onlooker {
            onlooker.see_asked(RAYS, *depth, Some(index), asked, rays, occluded);
        }
        cast += occluded.len();
        let met = occluded.iter().filter(|&&blocked| blocked).count();
        if met > 0 {
            for (&surface, &is_blocked) in asked.iter().zip(&*occluded) {
                light.reaches[surface as usize] &= !is_blocked;
            }
        }
        blocked += met;
    }
    tile.count(RAYS, cast, blocked);
}

/// The rays from all surfaces to a light.
#[inline(always)]
fn rays_to(
    light: &LightLanes,
    surfaces: &Surfaces,
    origins: &Lanes,
    numerics: Numerics,
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
        rays.set(i, &shadow_ray(origin, &LightSample { direction, ..seen }, numerics));
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
/// The ray ends before the light by two steps of the numbers that corners are rounded to, relative to its length, and a few of f64: the
/// surface that the light stands on may have been rounded to before it, and does not count. Where the ray rises less than a quarter from
/// that surface it may still meet it.
#[inline(always)]
pub fn shadow_ray(origin: DVec3, light: &LightSample, numerics: Numerics) -> Ray {
    let beside = 2.0 * numerics.precision().epsilon() + 8.0 * f64::EPSILON;
    numerics.ray_precision().ray(origin, light.direction, 0.0, light.distance * (1.0 - beside))
}
