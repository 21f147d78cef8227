//! The smooth terminator: where triangles stand in for a smooth surface, light ends where that surface turns away.
//!
//! With interpolated normals, a triangle near the terminator is lit by its normals but lies below the horizon of its own
//! plane, or in the shadow of its neighbours: the line between light and dark follows the triangles, in steps. Hanika,
//! Hacking the Shadow Terminator (Ray Tracing Gems II, chapter 4, 2021) lets shadow rays start from the smooth surface
//! instead: the point is lifted above the tangent planes of the three corners, each weighted by its barycentric
//! coordinate. Where the surface is concave it lies above them already and stays where it is; and so it does where something
//! lies between the point and its place on the smooth surface, which the shadow ray would else pass over.

use super::tile::{Context, Level, Tile};
use super::{Effect, Stage};

/// In the registry.
pub const EFFECT: Effect = Effect {
    name: "terminator",
    summary: "the shadow line of smooth meshes follows their normals, not their triangles",
    needs_lights: true,
    is_shading: true,
    called_for: |world, _| {
        if world.lights.is_empty() {
            return Err("the scene has no lights".into());
        }
        match world.objects.iter().filter(|object| object.is_smooth()).count() {
            0 => Err("no mesh has normals of its own".into()),
            n => Ok(format!("{n} mesh(es) with normals")),
        }
    },
};

/// Lifts the points that shadow rays start from onto the smooth surface.
pub struct Lift {
    /// Which level.
    pub level: usize,
}

impl Stage for Lift {
    fn name(&self) -> &'static str {
        "terminator"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let world = context.world;
        let numerics = world.numerics();
        let Tile { levels, traversal, shadow_rays, occluded, shadowed, .. } = tile;
        let Level { surfaces, hits, origins, shadow_points, .. } = &mut levels[self.level];
        shadow_rays.clear();
        shadowed.clear();
        occluded.clear();
        for (index, &ray) in surfaces.ray_of().iter().enumerate() {
            let surface = surfaces.get(index);
            let lifted = hits[ray as usize].map_or(surface.point, |hit| world.smooth_point(&surface, &hit));
            shadow_points.push(lifted);
            if lifted.position == surface.point.position {
                continue;
            }
            let origin = origins.get(index);
            let way = lifted.origin_towards(surface.geometric_normal, numerics) - origin;
            if let Some(direction) = way.try_normalize() {
                shadow_rays.push(numerics.precision().ray(origin, direction, 0.0, way.length()));
                shadowed.push(index as u32);
            }
        }
        world.accelerator.are_occluded(shadow_rays, occluded, traversal);
        for (&index, _) in shadowed.iter().zip(occluded.iter()).filter(|(_, blocked)| **blocked) {
            shadow_points[index as usize] = surfaces.get(index as usize).point;
        }
    }
}
