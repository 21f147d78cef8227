//! The smooth terminator: where triangles stand in for a smooth surface, light ends where that surface turns away.
//!
//! With interpolated normals, a triangle near the terminator is lit by its normals but lies below the horizon of its own
//! plane, or in the shadow of its neighbours: the line between light and dark follows the triangles, in steps. Hanika,
//! Hacking the Shadow Terminator (Ray Tracing Gems II, chapter 4, 2021) lets shadow rays start from the smooth surface
//! instead: the point is lifted above the tangent planes of the three corners, each weighted by its barycentric
//! coordinate. Where the surface is concave it lies above them already and stays where it is; and so it does where something
//! lies between the point and its place on the smooth surface, which the shadow ray would else pass over.

use super::tile::{Context, Level, Tile, vec_bytes};
use super::{Asked, Effect, Hook, RayKind, Stage, named};
use crate::geometry::Ray;
use crate::geometry::spawn::{EDGE_DISTANCE, ORIGIN_OFFSET};
use crate::world::{Lanes, World};

/// From points to their places on the smooth surface.
const RAYS: RayKind = RayKind("terminator");

/// In the registry.
pub const EFFECT: Effect = Effect {
    name: "terminator",
    summary: "the shadow line of smooth meshes follows their normals, not their triangles",
    needs_lights: true,
    is_shading: true,
    rays: &[RAYS],
    value: None,
    called_for: |world: &World, _| {
        if world.lights.is_empty() {
            return Err("the scene has no lights".into());
        }
        let smooth = world.objects.iter().filter(|object| object.is_smooth());
        let names: Vec<&str> = smooth.map(|object| object.name.as_str()).collect();
        named("object", &names)
            .map(|names| format!("the normals of {names}"))
            .ok_or_else(|| "no mesh has normals of its own".into())
    },
    outline: |_, outline| outline.smooth = true,
    stages: |asked: &Asked, hook| match hook {
        Hook::BeforeLighting(_) if asked.outline.shadow_rays => vec![Box::new(Lift)],
        _ => Vec::new(),
    },
    bytes: |tile| {
        let lifted = tile.levels.iter().filter(|level| level.shadow_origins.is_some()).count();
        let own = tile.kept::<Buffers>().map_or(0, |Buffers { rays, occluded, lifted }| {
            size_of::<Buffers>() + vec_bytes(rays) + vec_bytes(occluded) + vec_bytes(lifted)
        });
        lifted * size_of::<Lanes>() + own
    },
};

/// What asking for a level takes.
#[derive(Default)]
struct Buffers {
    /// From where rays leave the surfaces to where their shadow rays are to start.
    rays: Vec<Ray>,
    /// For each of them, whether something is in the way.
    occluded: Vec<bool>,
    /// For each of them, its surface.
    lifted: Vec<u32>,
}

/// Lifts the points that shadow rays start from onto the smooth surface.
struct Lift;

impl Stage for Lift {
    fn name(&self) -> &'static str {
        "terminator"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        tile.with(|own: &mut Buffers, tile| lift(own, tile, context));
    }
}

fn lift(own: &mut Buffers, tile: &mut Tile, context: &Context) {
    let world = context.world;
    let numerics = world.numerics();
    let Tile { levels, depth, traversal, onlooker, .. } = tile;
    let Level { surfaces, hits, origins, shadow_origins, .. } = &mut levels[*depth];
    let Some(origins) = origins else { return };
    let shadow_origins = shadow_origins.get_or_insert_default();
    shadow_origins.clone_from(origins);
    let Buffers { rays, occluded, lifted } = own;
    rays.clear();
    occluded.clear();
    lifted.clear();
    for (index, (&ray, &object)) in surfaces.ray_of().iter().zip(surfaces.objects()).enumerate() {
        let Some(hit) = &hits[ray as usize] else { continue };
        if !world.objects[object as usize].is_smooth() {
            continue;
        }
        let surface = surfaces.get(index);
        let point = world.smooth_point(&surface, hit);
        // Normals are kept in f32: a lift within their rounding says nothing.
        let lift = (point.position - surface.point.position).abs().max_element();
        if lift <= EDGE_DISTANCE * point.reach.max_element() {
            continue;
        }
        let start = point.origin_towards(surface.geometric_normal, numerics);
        shadow_origins.set(index, start);
        let way = start - origins.get(index);
        if let Some(direction) = way.try_normalize() {
            // Beyond the new origin by the offset of both, so that what it lies on is met, too.
            let length = way.length() + 2.0 * ORIGIN_OFFSET * point.reach.max_element();
            rays.push(numerics.ray_precision().ray(origins.get(index), direction, 0.0, length));
            lifted.push(index as u32);
        }
    }
    world.accelerator.are_occluded(rays, occluded, traversal);
    if let Some(onlooker) = onlooker {
        onlooker.see_asked(RAYS, *depth, None, lifted, rays, occluded);
    }
    let blocked = lifted.iter().zip(&*occluded).filter(|(_, blocked)| **blocked);
    let mut met = 0;
    for (&index, _) in blocked {
        shadow_origins.set(index as usize, origins.get(index as usize));
        met += 1;
    }
    let cast = rays.len();
    tile.count(RAYS, cast, met);
}
