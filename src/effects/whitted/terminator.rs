//! Shadow terminator: on triangles that approximate a smooth surface, light ends where the smooth surface turns away.
//!
//! With interpolated normals, a triangle near the terminator is lit according to its normals, but lies below the horizon of its
//! own plane or in the shadow of its neighbours. The boundary of the shadow then follows the triangles. Hanika, Hacking the Shadow
//! Terminator (Ray Tracing Gems II, chapter 4, 2021) starts shadow rays on the smooth surface instead: the point is lifted above
//! the tangent planes of the three corners, weighted by its barycentrics. On a concave surface the point lies above these
//! planes and is not moved. It is not moved either where something lies between it and the lifted point, which the shadow ray would
//! miss.

use crate::effects::tile::{RayGeneration, RenderContext, Tile, vec_bytes};
use crate::effects::{Effect, EffectContext, Hook, RayKind, Stage, id, named};
use crate::geometry::RayBuffer;
use crate::geometry::spawn::{EDGE_DISTANCE, ORIGIN_OFFSET};
use crate::world::{InteractionSoa, Vec3Soa, World};

/// Occlusion tests between points and their lifted positions.
pub const RAYS: RayKind = RayKind { name: "terminator", is_shadow: false, colour: [230, 150, 230] };

/// The registry's entry.
pub const EFFECT: Effect = Effect {
    id: id::TERMINATOR,
    summary: "shadow terminator of smooth meshes by shading normals instead of triangles",
    source: "Hanika, Hacking the Shadow Terminator, Ray Tracing Gems II, chapter 4, 2021",
    needs_lights: true,
    is_shading: true,
    is_study_switch: true,
    rays: &[RAYS],
    called_for: |world: &World, _| {
        if world.lights.is_empty() {
            return Err("the scene has no lights".into());
        }
        let smooth = world.objects.iter().filter(|object| object.is_smooth());
        named("object", smooth.map(|object| object.name.as_str()))
            .map(|names| format!("the normals of {names}"))
            .ok_or_else(|| "no mesh has vertex normals".into())
    },
    specify: |_, spec| spec.smooth = true,
    stages: |context: &EffectContext, hook| match hook {
        Hook::BeforeLighting(_) if context.spec.shadow_rays => {
            vec![Stage::with_buffers("terminator", lift_origins)]
        }
        _ => Vec::new(),
    },
    bytes: |tile| {
        let lifted = tile.generations.iter().filter(|generation| generation.shadow_origins.is_some()).count();
        let lists = tile.buffers::<Buffers>().map_or(0, |Buffers { rays, occluded, lifted }| {
            size_of::<Buffers>() + rays.bytes() + vec_bytes(occluded) + vec_bytes(lifted)
        });
        lifted * size_of::<Vec3Soa>() + lists
    },
    ..Effect::NONE
};

/// Temporary buffers.
#[derive(Default)]
struct Buffers {
    /// Rays from the ray origins of surfaces to their lifted shadow ray origins.
    rays: RayBuffer,
    /// For each ray, whether it is occluded.
    occluded: Vec<bool>,
    /// For each ray, its surface.
    lifted: Vec<u32>,
}

/// Computes the shadow ray origins of a generation: those of smooth meshes lie on the smooth surface.
fn lift_origins(buffers: &mut Buffers, tile: &mut Tile, context: &RenderContext) {
    let world = context.world;
    let Tile { generations, current, depth, traversal, recorder, .. } = tile;
    let RayGeneration { surfaces, origins, shadow_origins, .. } = &mut generations[*current];
    let Some(origins) = origins else { return };
    let shadow_origins = shadow_origins.get_or_insert_default();
    shadow_origins.clone_from(origins);
    buffers.lift(world, surfaces, origins, shadow_origins);
    let Buffers { rays, occluded, lifted } = buffers;
    occluded.clear();
    world.accelerator.are_occluded(rays.rays(), occluded, traversal);
    if let Some(recorder) = recorder {
        let surfaces = lifted.iter().map(|&surface| surface as usize);
        recorder.add_tests((RAYS, None), *depth, surfaces, rays.rays(), occluded);
    }
    let blocked = lifted.iter().zip(&*occluded).filter(|(_, blocked)| **blocked);
    let mut blocked_count = 0;
    for (&index, _) in blocked {
        shadow_origins.set(index as usize, origins.get(index as usize));
        blocked_count += 1;
    }
    let cast = rays.len();
    tile.count(RAYS, cast, blocked_count);
}

impl Buffers {
    /// Lifts the shadow ray origins of smooth meshes, and lists the rays that test whether the way to them is free.
    fn lift(
        &mut self,
        world: &World,
        surfaces: &InteractionSoa,
        origins: &Vec3Soa,
        shadow_origins: &mut Vec3Soa,
    ) {
        let numerics = world.numerics();
        self.rays.clear();
        self.lifted.clear();
        for (index, &object) in surfaces.objects().iter().enumerate() {
            if !world.objects[object as usize].is_smooth() {
                continue;
            }
            let surface = surfaces.get(index);
            let point = world.smooth_point(&surface);
            // Normals are stored in f32; a lift within their rounding has no meaning.
            let lift = (point.position - surface.point.position).abs().max_element();
            if lift <= EDGE_DISTANCE * point.reach.max_element() {
                continue;
            }
            let start = point.origin_towards(surface.geometric_normal, numerics);
            shadow_origins.set(index, start);
            let way = start - origins.get(index);
            if let Some(direction) = way.try_normalize() {
                // Beyond the new origin by the offset of both origins, to hit also the surface that it lies on.
                let length = way.length() + 2.0 * ORIGIN_OFFSET * point.reach.max_element();
                self.rays.push(&numerics.ray_precision().ray(origins.get(index), direction, 0.0, length));
                self.lifted.push(index as u32);
            }
        }
    }
}
