//! Normal maps: pictures that tilt the normals which surfaces are shaded and mirror by.

use super::textures::Pictures;
use super::tile::{Context, Level, Tile};
use super::{Effect, Stage};
use crate::shading::normal_map::{decode, held_above};
use crate::shading::texture::look_up;
use crate::world::{Meaning, World};

/// In the registry.
pub const EFFECT: Effect = Effect {
    name: "normal-maps",
    summary: "pictures tilt the normals that surfaces are shaded by",
    needs_lights: true,
    called_for: |world: &World| {
        let mapped = world.objects.iter().filter(|object| {
            object.has_tangents() && world.materials[object.material as usize].normal_map().is_some()
        });
        match mapped.count() {
            0 => Err("no mesh has a normal map".into()),
            n => Ok(format!("{n} mesh(es) with normal maps")),
        }
    },
};

/// Tilts the shading normals of the surfaces of a level.
pub struct NormalMaps {
    /// Which level.
    pub level: usize,
    /// What is asked for.
    pub pictures: Pictures,
}

impl Stage for NormalMaps {
    fn name(&self) -> &'static str {
        "normal maps"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let world = context.world;
        let Level { surfaces, texture_points, hits, .. } = &mut tile.levels[self.level];
        if texture_points.is_empty() {
            return;
        }
        for part in 0..surfaces.by_material().len() {
            let (material, range) = surfaces.by_material()[part].clone();
            let Some(map) = world.materials[material as usize].normal_map() else { continue };
            let texture = &map.texture;
            let image = &world.images[texture.image as usize];
            let filter = texture.sampler.filter(self.pictures.filter);
            for i in range {
                let (Some(point), Some(hit)) = (&texture_points[i], &hits[surfaces.ray_of()[i] as usize])
                else {
                    continue;
                };
                let surface = surfaces.get(i);
                let Some([tangent, bitangent, normal]) = world.tangent_frame(&surface, hit) else { continue };
                let encoded = look_up(image, Meaning::Numbers, &texture.sampler, &filter, point);
                let n = decode(encoded, map.scale);
                // Seen from behind, bumps are dents.
                let side = normal.dot(surface.shading_normal).signum();
                let tilted = side * (n.x * tangent + n.y * bitangent + n.z * normal);
                if let Some(tilted) = tilted.try_normalize() {
                    let held =
                        held_above(surface.shading_normal, tilted, surface.geometric_normal, surface.view);
                    surfaces.shading_normal.set(i, held);
                }
            }
        }
    }
}
