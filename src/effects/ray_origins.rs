//! The rays that leave surfaces, shared by all effects that cast such rays: the stage that computes their origins, and the
//! extent of shadow rays.

use glam::DVec3;

use super::Stage;
use super::tile::RayGeneration;
use crate::bvh::{Numerics, Ray};
use crate::shading::LightSample;
use crate::world::{InteractionSoa, Vec3Soa, simd};

/// Computes the ray origin of each surface, in the first generations: those that need origins.
pub(crate) fn stage(generations: u32) -> Stage {
    Stage::new("ray origins", move |tile, context| {
        if tile.depth < generations as usize {
            let RayGeneration { surfaces, origins, .. } = tile.generation();
            find_origins(surfaces, origins.get_or_insert_default(), context.world.numerics());
        }
    })
}

/// Computes the origin of rays that leave each surface on the side of its geometric normal.
pub(crate) fn find_origins(surfaces: &InteractionSoa, origins: &mut Vec3Soa, numerics: Numerics) {
    // The tier is passed as a constant, so that the loops have no branch on it.
    match numerics {
        Numerics::Fast => simd!(compute_origins(surfaces, origins, Numerics::Fast)),
        Numerics::Watertight => simd!(compute_origins(surfaces, origins, Numerics::Watertight)),
        _ => simd!(compute_origins(surfaces, origins, Numerics::Double)),
    }
}

#[inline(always)]
fn compute_origins(surfaces: &InteractionSoa, origins: &mut Vec3Soa, numerics: Numerics) {
    for i in 0..surfaces.len() {
        origins.set(i, surfaces.point(i).origin_towards(surfaces.geometric_normal.get(i), numerics));
    }
}

/// The shadow ray from `origin`, on a surface's outer side, to a light as sampled from there; open at both ends.
///
/// The ray ends before the light by a relative distance of 2 epsilon of the precision of corners and 8 epsilon of f64,
/// so that rounding of the ray does not make it hit the surface of the light. The caller shortens the distance of
/// `light` for the rounding of corners ([`crate::world::WorldLight::tested_share`]).
#[inline(always)]
pub fn shadow_ray(origin: DVec3, light: &LightSample, numerics: Numerics) -> Ray {
    let margin = 2.0 * numerics.precision().epsilon() + 8.0 * f64::EPSILON;
    numerics.ray_precision().ray(origin, light.direction, 0.0, light.distance * (1.0 - margin))
}
