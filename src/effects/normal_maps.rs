//! Normal maps: textures that perturb the shading normals (glTF 2.0, section 3.9.3).
//!
//! A surface is lit only from above the horizon of its unperturbed shading normal: a bump beyond the terminator of the mesh lies in
//! the mesh's shadow.

use glam::DVec3;

use super::texture_points::{self, Buffers};
use super::tile::{RayGeneration, RenderContext, Tile, vec_bytes};
use super::{Effect, EffectContext, Hook, Stage, TextureUse, id, named};
use crate::scene::{TexelEncoding, TextureSlot};
use crate::shading::normal_map::{decode, limit_tilt};
use crate::shading::texture::look_up;
use crate::world::World;

/// The registry's entry.
pub const EFFECT: Effect = Effect {
    id: id::NORMAL_MAPS,
    summary: "normal and bump maps of materials",
    source: "glTF 2.0, section 3.9.3; Cook, Shade Trees, 1984",
    needs_lights: true,
    is_study_switch: true,
    called_for: |world: &World, _| {
        let mapped = world.objects.iter().filter(|object| {
            object.has_tangents()
                && world.materials[object.material as usize].textures()[TextureSlot::Normal].is_some()
        });
        named("object", mapped.map(|object| object.name.as_str()))
            .map(|names| format!("the normal maps of {names}"))
            .ok_or_else(|| "no mesh has a normal map".into())
    },
    specify: |_, spec| spec.texture_use.normal_maps = true,
    stages: |context: &EffectContext, hook: Hook| {
        let texture_use = context.spec.texture_use;
        match hook {
            Hook::AfterLighting(_) => vec![Stage::with_buffers("normal maps", limit_lights)],
            _ => {
                let perturb = move |Unperturbed(normals): &mut Unperturbed,
                                    tile: &mut Tile,
                                    context: &RenderContext| {
                    normals.clear();
                    tile.with_buffers(|points: &mut Buffers, tile| {
                        perturb(points, texture_use, tile, context.world, normals);
                    });
                };
                let stage = Stage::with_buffers("normal maps", perturb);
                texture_points::stages(context, hook, !texture_use.material_textures, stage)
            }
        }
    },
    bytes: |tile| {
        // The texture points are counted here only where the effect of textures has not run: it counts them itself.
        let has_texels =
            tile.generations.iter().any(|RayGeneration { surfaces, .. }| surfaces.texels.bytes() > 0);
        let shared = tile.buffers::<Buffers>().filter(|_| !has_texels).map_or(0, Buffers::bytes);
        let bytes =
            |Unperturbed(normals): &Unperturbed| shared + size_of::<Unperturbed>() + vec_bytes(normals);
        tile.buffers::<Unperturbed>().map_or(0, bytes)
    },
    ..Effect::NONE
};

/// The surfaces of the current generation whose normals were perturbed, with the normals they had before.
#[derive(Default)]
struct Unperturbed(Vec<(u32, DVec3)>);

/// Perturbs the shading normals of the surfaces of a generation.
fn perturb(
    buffers: &Buffers,
    texture_use: TextureUse,
    tile: &mut Tile,
    world: &World,
    unperturbed: &mut Vec<(u32, DVec3)>,
) {
    let RayGeneration { surfaces, .. } = &mut tile.generations[tile.current];
    for part in 0..surfaces.by_material().len() {
        let (material, range) = surfaces.by_material()[part].clone();
        let textures = world.materials[material as usize].textures();
        let Some(texture) = &textures[TextureSlot::Normal] else { continue };
        let image = &world.images[texture.image.0 as usize];
        let filter = texture_use.filter(texture);
        let points = buffers.points(tile.current, texture.coordinates);
        if points.is_empty() {
            continue;
        }
        for i in range {
            let Some(point) = &points[i] else { continue };
            let shading = surfaces.shading_normal.get(i);
            let frame = world.tangent_frame(surfaces.objects()[i], &surfaces.hit(i), shading);
            let Some([tangent, bitangent, normal]) = frame else { continue };
            let encoded = look_up(image, TexelEncoding::Normal, &texture.sampler, &filter, point);
            let n = decode(encoded, textures.normal_scale);
            // A flat texel keeps the bits of the normal.
            if n.x == 0.0 && n.y == 0.0 && n.z > 0.0 {
                continue;
            }
            // On the back side bumps are dents.
            let side = normal.dot(shading).signum();
            let tilted = side * (n.x * tangent + n.y * bitangent + n.z * normal);
            if let Some(tilted) = tilted.try_normalize() {
                let (outer, view) = (surfaces.geometric_normal.get(i), surfaces.view.get(i));
                surfaces.shading_normal.set(i, limit_tilt(shading, tilted, outer, view));
                unperturbed.push((i as u32, shading));
            }
        }
    }
}

/// Removes the lights below the horizon of the unperturbed shading normal.
fn limit_lights(Unperturbed(normals): &mut Unperturbed, tile: &mut Tile, _: &RenderContext) {
    for light in &mut tile.lights {
        for &(i, normal) in &*normals {
            let i = i as usize;
            if light.reaches[i] {
                light.reaches[i] = light.get(i).direction.dot(normal) > 0.0;
            }
        }
    }
}
