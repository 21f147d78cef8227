//! Normal maps: pictures that tilt the normals which surfaces are shaded and mirror by.
//!
//! However it is tilted, a surface is lit only from above the horizon of the mesh's own normal: a bump beyond the line where the
//! mesh turns away from a light is in its shadow.

use glam::DVec3;

use super::pictures::{self, Buffers};
use super::tile::{Context, Level, Tile, vec_bytes};
use super::{Asked, Effect, Hook, Pictures, Stage, named};
use crate::shading::normal_map::{decode, held_above};
use crate::shading::texture::look_up;
use crate::world::{Meaning, World};

/// In the registry.
pub const EFFECT: Effect = Effect {
    name: "normal-maps",
    summary: "pictures tilt the normals that surfaces are shaded by",
    needs_lights: true,
    is_shading: false,
    rays: &[],
    value: None,
    called_for: |world: &World, _| {
        let mapped = world.objects.iter().filter(|object| {
            object.has_tangents() && world.materials[object.material as usize].normal_map().is_some()
        });
        let names: Vec<&str> = mapped.map(|object| object.name.as_str()).collect();
        named("object", &names)
            .map(|names| format!("the normal maps of {names}"))
            .ok_or_else(|| "no mesh has a normal map".into())
    },
    outline: |_, outline| outline.pictures.normal_maps = true,
    stages: |asked: &Asked, hook: Hook| {
        let pictures = asked.outline.pictures;
        match hook {
            Hook::AfterLighting(_) => vec![Box::new(Horizon)],
            _ => pictures::stages(asked, hook, !pictures.textures, NormalMaps { pictures }),
        }
    },
    bytes: |tile| {
        // Where there are textures they are billed for what both share. A worker whose rays all missed has no texels either: what
        // it keeps is not this effect's unless normals were tilted.
        let texels = tile.levels.iter().any(|level| level.surfaces.texels.capacity() > 0);
        let shared = tile.kept::<Buffers>().filter(|_| !texels).map_or(0, Buffers::bytes);
        let own = |Tilted(tilted): &Tilted| shared + size_of::<Tilted>() + vec_bytes(tilted);
        tile.kept::<Tilted>().map_or(0, own)
    },
};

/// The surfaces of the level in work whose normals were tilted, and the normals that they had.
#[derive(Default)]
struct Tilted(Vec<(u32, DVec3)>);

/// Tilts the shading normals of the surfaces of a level.
struct NormalMaps {
    pictures: Pictures,
}

impl Stage for NormalMaps {
    fn name(&self) -> &'static str {
        "normal maps"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        tile.with(|Tilted(tilted), tile| {
            tilted.clear();
            tile.with(|own: &mut Buffers, tile| self.tilt(own, tile, context.world, tilted));
        });
    }
}

impl NormalMaps {
    fn tilt(&self, own: &Buffers, tile: &mut Tile, world: &World, kept: &mut Vec<(u32, DVec3)>) {
        let points = own.points(tile.depth);
        if points.is_empty() {
            return;
        }
        let Level { surfaces, hits, .. } = &mut tile.levels[tile.depth];
        for part in 0..surfaces.by_material().len() {
            let (material, range) = surfaces.by_material()[part].clone();
            let Some(map) = world.materials[material as usize].normal_map() else { continue };
            let texture = &map.texture;
            let image = &world.images[texture.image as usize];
            let filter = self.pictures.filter(texture);
            for i in range {
                let (Some(point), Some(hit)) = (&points[i], &hits[surfaces.ray_of()[i] as usize]) else {
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
                    kept.push((i as u32, surface.shading_normal));
                }
            }
        }
    }
}

/// Takes away the lights below the horizon of tilted surfaces.
struct Horizon;

impl Stage for Horizon {
    fn name(&self) -> &'static str {
        "normal maps"
    }

    fn run(&self, tile: &mut Tile, _: &Context) {
        tile.with(|Tilted(tilted), tile| {
            for light in &mut tile.lights {
                for &(i, normal) in &*tilted {
                    let i = i as usize;
                    if light.reaches[i] {
                        light.reaches[i] = light.get(i).direction.dot(normal) > 0.0;
                    }
                }
            }
        });
    }
}
