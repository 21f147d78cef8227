//! Shadow terminator: on triangles that approximate a smooth surface, light ends where the smooth surface turns away.
//!
//! With interpolated normals, a triangle near the terminator is lit according to its normals, but lies below the
//! horizon of its own plane or in the shadow of its neighbours. The boundary of the shadow then follows the triangles.
//! Hanika, Hacking the Shadow Terminator (Ray Tracing Gems II, chapter 4, 2021) starts shadow rays on the smooth
//! surface instead: the point is lifted above the tangent planes of the three corners, weighted by its barycentrics. On
//! a concave surface the point lies above these planes and is not moved. It is not moved either where something lies
//! between it and the lifted point, which the shadow ray would miss.
//!
//! Of paths, all rays that leave an opaque surface start there, so that light samples and BSDF samples estimate the
//! same integral. Surfaces that transmit light keep their points, since the rays on their other side start from the
//! triangle.

use glam::DVec3;

use super::plan::transport_for;
use super::tile::{RayGeneration, RenderContext, StartPoints, Tile, vec_bytes};
use super::{Effect, EffectContext, Hook, PlanSettings, RayKind, Stage, id, named};
use crate::bvh::detail::{EDGE_DISTANCE, RayBuffer, origin_offset};
use crate::world::{InteractionSoa, Vec3Soa, World, WorldObject};

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
    called_for: |world: &World, plan_settings: &PlanSettings| {
        let is_path = transport_for(world, plan_settings).transport.traces_paths();
        if world.lights.is_empty() && !is_path {
            return Err("the scene has no lights".into());
        }
        let smooth = world.objects.iter().filter(|object| is_lifted(world, object, is_path));
        named("object", smooth.map(|object| object.name.as_str()))
            .map(|names| format!("the normals of {names}"))
            .ok_or_else(|| "no mesh has vertex normals".into())
    },
    specify: |_, spec| {
        spec.smooth = true;
        if spec.traces_paths() {
            spec.generations_with_origins = u32::MAX;
        }
    },
    stages: |context: &EffectContext, hook| match hook {
        Hook::BeforeLighting(_) if context.spec.shadow_rays || context.spec.traces_paths() => {
            let is_path = context.spec.traces_paths();
            vec![Stage::with_buffers("terminator", move |buffers: &mut Buffers, tile, context| {
                buffers.lift_origins(tile, context, is_path);
            })]
        }
        _ => Vec::new(),
    },
    bytes: |tile| {
        let lifted = tile.generations.iter().filter(|generation| generation.lifted.is_some()).count();
        let lists = tile.buffers::<Buffers>().map_or(0, |Buffers { rays, occluded, lifted }| {
            size_of::<Buffers>() + rays.bytes() + vec_bytes(occluded) + vec_bytes(lifted)
        });
        lifted * size_of::<StartPoints>() + lists
    },
    ..Effect::NONE
};

/// Whether points of an object are lifted.
fn is_lifted(world: &World, object: &WorldObject, is_path: bool) -> bool {
    object.is_smooth() && !(is_path && world.materials[object.material as usize].transmits())
}

/// Temporary buffers.
#[derive(Default)]
struct Buffers {
    /// Rays from the ray origins of surfaces to the origins above their lifted points.
    rays: RayBuffer,
    /// For each ray, whether it is occluded.
    occluded: Vec<bool>,
    /// For each ray its surface, the lifted point and the origin above it.
    lifted: Vec<(u32, [DVec3; 2])>,
}

impl Buffers {
    /// Computes the start points of a generation: those of smooth meshes lie on the smooth surface.
    fn lift_origins(&mut self, tile: &mut Tile, context: &RenderContext, is_path: bool) {
        let world = context.world;
        let Tile { generations, current, depth, traversal, recorder, .. } = tile;
        let RayGeneration { surfaces, origins, lifted: points, .. } = &mut generations[*current];
        let Some(origins) = origins else { return };
        self.list(world, surfaces, origins, is_path);
        let Buffers { rays, occluded, lifted } = self;
        occluded.clear();
        world.accelerator.are_occluded(rays.rays(), occluded, traversal);
        if let Some(recorder) = recorder {
            let surfaces: Vec<u32> = lifted.iter().map(|&(surface, _)| surface).collect();
            recorder.add_tests((RAYS, None), (world, *depth), &surfaces, rays.rays(), occluded);
        }
        let points = points.get_or_insert_default();
        points.position.clone_from(&surfaces.position);
        points.origin.clone_from(origins);
        points.is_lifted.clear();
        let free = lifted.iter().zip(&*occluded).filter(|(_, blocked)| !**blocked);
        let mut free_count = 0;
        for (&(index, [position, origin]), _) in free {
            points.position.set(index as usize, position);
            points.origin.set(index as usize, origin);
            points.is_lifted.set(index as usize, true);
            free_count += 1;
        }
        let cast = rays.len();
        tile.count(RAYS, cast, cast - free_count);
    }

    /// Lists the lifted points of smooth meshes, and the rays that test whether the way to them is free.
    fn list(&mut self, world: &World, surfaces: &InteractionSoa, origins: &Vec3Soa, is_path: bool) {
        let numerics = world.numerics();
        self.rays.clear();
        self.lifted.clear();
        for (index, &object) in surfaces.objects().iter().enumerate() {
            if !is_lifted(world, &world.objects[object as usize], is_path) {
                continue;
            }
            let surface = surfaces.get(index);
            let point = world.smooth_point(&surface);
            // Normals are stored in f32; a lift within their rounding has no meaning.
            let lift = (point.position - surface.point.position).abs().max_element();
            if lift <= EDGE_DISTANCE * point.reach.max_element() {
                continue;
            }
            let origin = point.origin_towards(surface.geometric_normal, numerics);
            let way = origin - origins.get(index);
            if let Some(direction) = way.try_normalize() {
                // Beyond the new origin by the offset of both origins, to hit also the surface that it lies on.
                let length = way.length() + 2.0 * origin_offset(numerics) * point.reach.max_element();
                self.rays.push(&numerics.ray_precision().ray(origins.get(index), direction, 0.0, length));
                self.lifted.push((index as u32, [point.position, origin]));
            }
        }
    }
}
