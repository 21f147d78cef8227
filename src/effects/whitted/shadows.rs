//! Shadows: occlusion tests between surfaces and lights.
//!
//! The assignment's report: a ray from the point towards the light, blocked by anything *between* the two. What lies behind the
//! light does not block it.

use glam::DVec3;

use crate::bvh::detail::RayBuffer;
use crate::bvh::{Numerics, Ray};
use crate::effects::samples::DiscPoints;
use crate::effects::tile::{RayGeneration, RenderContext, Tile, vec_bytes};
use crate::effects::transparency::transmittance;
use crate::effects::{Effect, EffectContext, Hook, PlanSpec, RayKind, Stage, id, named, shadow_ray};
use crate::scene::TextureFilter;
use crate::shading::{LightSample, LightSoa};
use crate::world::{InteractionSoa, Vec3Soa, World, simd};

/// Shadow rays.
pub const RAYS: RayKind = RayKind { name: "shadow", is_shadow: true, colour: [120, 190, 255] };

/// The registry's entry.
pub const EFFECT: Effect = Effect {
    id: id::SHADOWS,
    summary: "shadows: a shadow ray from each surface to each light",
    source: "Whitted, An Improved Illumination Model for Shaded Display, 1980",
    needs_lights: true,
    is_shading: true,
    is_study_switch: true,
    rays: &[RAYS],
    called_for: |world: &World, _| {
        let names = world.lights.iter().map(|light| light.name.as_str());
        named("light", names).ok_or_else(|| "the scene has no lights".into())
    },
    specify: |_, spec| {
        if spec.lit {
            spec.shadow_rays = true;
            spec.generations_with_origins = u32::MAX;
        }
    },
    stages: |context: &EffectContext, hook| match hook {
        Hook::AfterLighting(_) => {
            let PlanSpec { continued, soft_shadows, texture_use, .. } = context.spec;
            let continued = continued.map(|kinds| (kinds.shadow_rays, texture_use.filter));
            vec![Stage::with_buffers("shadows", move |buffers, tile, context| {
                if !soft_shadows {
                    return test_occlusion(buffers, tile, context, continued, None);
                }
                tile.with_buffers(|points: &mut DiscPoints, tile| {
                    test_occlusion(buffers, tile, context, continued, Some(points));
                });
            })]
        }
        _ => Vec::new(),
    },
    bytes: |tile| {
        tile.buffers::<Buffers>().map_or(0, |Buffers { rays, occluded, surfaces }| {
            size_of::<Buffers>() + rays.bytes() + vec_bytes(occluded) + vec_bytes(surfaces)
        })
    },
    ..Effect::NONE
};

/// Temporary buffers, reused for each light.
#[derive(Default)]
struct Buffers {
    /// The shadow rays of all surfaces of a generation, then those that are cast.
    rays: RayBuffer,
    /// For each ray that is cast, whether it is occluded.
    occluded: Vec<bool>,
    /// For each ray that is cast, its surface.
    surfaces: Vec<u32>,
}

/// Tests every light for occlusion at the surfaces of a generation. Shadow rays behind surfaces are counted as `continued`;
/// `None` where all surfaces are opaque. `points` are the sampled points of lights with an apparent diameter.
fn test_occlusion(
    buffers: &mut Buffers,
    tile: &mut Tile,
    context: &RenderContext,
    continued: Option<(RayKind, Option<TextureFilter>)>,
    points: Option<&DiscPoints>,
) {
    let Tile { generations, current, depth, lights, traversal, recorder, .. } = tile;
    let RayGeneration { surfaces, origins, lifted, .. } = &generations[*current];
    let lifted = lifted.as_ref().map(|lifted| &lifted.origin);
    let Some(origins) = lifted.or(origins.as_deref()) else { return };
    let Buffers { rays, occluded, surfaces: tested } = buffers;
    let (mut cast, mut blocked, mut count) = (0, 0, 0);
    for (index, light) in lights.iter_mut().enumerate() {
        list_reached(&light.reaches[..surfaces.len()], tested);
        if tested.is_empty() {
            continue;
        }
        match points.and_then(|points| points.of_light(index)) {
            Some(directions) => {
                let precision = context.world.numerics().ray_precision();
                let ray = |i: usize| precision.ray(origins.get(i), directions[i], 0.0, f64::INFINITY);
                rays.write(0..directions.len(), ray);
            }
            None => {
                let numerics = context.world.numerics();
                shadow_rays(light, surfaces, origins, numerics, rays);
                let in_world = &context.world.lights[index];
                if !in_world.touched.is_empty() {
                    let share = |i: usize| in_world.tested_share(origins.get(i));
                    rays.write(0..surfaces.len(), |i| {
                        ray_to(light, surfaces, origins, numerics, i, share(i))
                    });
                }
            }
        }
        rays.keep(tested);
        occluded.clear();
        context.world.accelerator.are_occluded(rays.rays(), occluded, traversal);
        if let Some((_, filter)) = continued {
            let blocked =
                tested.iter().zip(rays.rays().iter()).zip(&mut *occluded).filter(|(_, occluded)| **occluded);
            for ((&surface, ray), occluded) in blocked {
                let transmittance = transmittance(context.world, &ray, traversal, filter, &mut count);
                light.scale(surface as usize, transmittance);
                *occluded = transmittance == 0.0;
            }
        }
        if let Some(recorder) = recorder {
            let (kind, at) = ((RAYS, Some(index)), (context.world, *depth));
            recorder.add_tests(kind, at, tested, rays.rays(), occluded);
        }
        cast += occluded.len();
        let blocked_here = occluded.iter().filter(|&&blocked| blocked).count();
        if blocked_here > 0 {
            for (&surface, &is_blocked) in tested.iter().zip(&*occluded) {
                light.reaches[surface as usize] &= !is_blocked;
            }
        }
        blocked += blocked_here;
    }
    tile.count(RAYS, cast, blocked);
    if let Some((kind, _)) = continued.filter(|_| count > 0) {
        tile.count(kind, count, 0);
    }
}

/// Writes the shadow rays of all surfaces, also of those that the light does not reach.
fn shadow_rays(
    light: &LightSoa,
    surfaces: &InteractionSoa,
    origins: &Vec3Soa,
    numerics: Numerics,
    rays: &mut RayBuffer,
) {
    // The tier is passed as a constant, so that the loops have no branch on it.
    match numerics {
        Numerics::Fast => simd!(rays_to(light, surfaces, origins, Numerics::Fast, rays)),
        Numerics::Watertight => simd!(rays_to(light, surfaces, origins, Numerics::Watertight, rays)),
        _ => simd!(rays_to(light, surfaces, origins, Numerics::Double, rays)),
    }
}

#[inline(always)]
fn rays_to(
    light: &LightSoa,
    surfaces: &InteractionSoa,
    origins: &Vec3Soa,
    numerics: Numerics,
    rays: &mut RayBuffer,
) {
    rays.write(
        0..surfaces.len(),
        #[inline(always)]
        |i| ray_to(light, surfaces, origins, numerics, i, 1.0),
    );
}

/// Shadow ray of surface `i`. `share` is the tested fraction of the way to the light.
#[inline(always)]
fn ray_to(
    light: &LightSoa,
    surfaces: &InteractionSoa,
    origins: &Vec3Soa,
    numerics: Numerics,
    i: usize,
    share: f64,
) -> Ray {
    let origin = origins.get(i);
    let seen = light.get(i).seen_from(origin - surfaces.position.get(i));
    // A light that does not reach the surface may have no direction; the ray is not cast.
    let normal = surfaces.geometric_normal.get(i);
    let pick = |a: f64, b: f64| if light.reaches[i] { a } else { b };
    let direction = DVec3::new(
        pick(seen.direction.x, normal.x),
        pick(seen.direction.y, normal.y),
        pick(seen.direction.z, normal.z),
    );
    shadow_ray(origin, &LightSample { direction, distance: seen.distance * share, ..seen }, numerics)
}

/// Lists the surfaces whose entry in `reaches` is set.
fn list_reached(reaches: &[bool], surfaces: &mut Vec<u32>) {
    surfaces.clear();
    if reaches.iter().all(|&reaches| reaches) {
        surfaces.extend(0..reaches.len() as u32);
    } else {
        surfaces.extend((0..).zip(reaches).filter(|(_, reaches)| **reaches).map(|(i, _)| i));
    }
}
