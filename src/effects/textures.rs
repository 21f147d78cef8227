//! Textures: lookups of the materials' textures at the surfaces that have them. Those of layers are looked up only by
//! the transport that uses them.

use super::texture_points::{self, Buffers};
use super::tile::{RayGeneration, RenderContext, Tile};
use super::{Effect, EffectContext, EffectValue, Hook, Stage, TextureUse, id, named, plan};
use crate::scene::{Material, TextureFilter, TextureSlot, ValueKind};
use crate::shading::texture::look_up;
use crate::world::{PreparedMaterial, World};

/// The registry's entry.
pub const EFFECT: Effect = Effect {
    id: id::TEXTURES,
    summary: "image textures; filter: nearest, bilinear, mipmap or anisotropic [default: each texture's sampler]",
    source: "Williams, Pyramidal Parametrics, 1983; Igehy, Tracing Ray Differentials, 1999",
    value: Some(EffectValue {
        meaning: "filter",
        placeholder: "FILTER",
        kind: || ValueKind::Names(TextureFilter::ALL.map(|filter| filter.name().to_owned()).to_vec()),
        check: |value| match filter(value) {
            Some(_) => Ok(()),
            None => Err(format!("filters are {}", TextureFilter::ALL.map(TextureFilter::name).join(", "))),
        },
    }),
    called_for: |world: &World, plan_settings| {
        let transport = Some(plan::transport_for(world, plan_settings).transport);
        let texture_use = TextureUse { material_textures: true, transport, ..TextureUse::default() };
        // The filter is that of opacities, too.
        let is_textured = |material: &&PreparedMaterial| {
            texture_use.of(material).next().is_some() || material.textures()[TextureSlot::Opacity].is_some()
        };
        let textured = world.materials_in_use().filter(is_textured);
        named("material", textured.map(Material::name))
            .ok_or_else(|| "no material of an object has a texture".into())
    },
    specify: |context, spec| {
        spec.texture_use.material_textures = true;
        spec.texture_use.filter = context.value.as_deref().and_then(filter);
    },
    stages: |context: &EffectContext, hook: Hook| {
        let texture_use = TextureUse { normal_maps: false, ..context.spec.texture_use };
        let look_up = move |buffers: &mut Buffers, tile: &mut Tile, context: &RenderContext| {
            look_up_all(texture_use, buffers, tile, context.world);
        };
        texture_points::stages(context, hook, true, Stage::with_buffers("textures", look_up))
    },
    bytes: |tile| {
        let texels = tile.generations.iter().map(|generation| generation.surfaces.texels.bytes());
        let texels = texels.sum::<usize>();
        texels + tile.buffers::<Buffers>().filter(|_| texels > 0).map_or(0, Buffers::bytes)
    },
    ..Effect::NONE
};

/// The filter of this name.
pub(super) fn filter(name: &str) -> Option<TextureFilter> {
    TextureFilter::ALL.into_iter().find(|filter| filter.name() == name)
}

/// Looks up the textures of the surfaces of a generation.
fn look_up_all(texture_use: TextureUse, buffers: &Buffers, tile: &mut Tile, world: &World) {
    let RayGeneration { surfaces, .. } = &mut tile.generations[tile.current];
    let mut texels = std::mem::take(&mut surfaces.texels);
    for (material, range) in surfaces.by_material() {
        for (slot, texture) in texture_use.of(&world.materials[*material as usize]) {
            let points = buffers.points(tile.current, texture.coordinates);
            if points.is_empty() {
                continue;
            }
            let image = &world.images[texture.image.0 as usize];
            let (filter, encoding) = (texture_use.filter(&texture), slot.entry().encoding);
            let values = &mut texels.of_mut(slot, surfaces.len())[range.clone()];
            for (value, point) in values.iter_mut().zip(&points[range.clone()]) {
                if let Some(point) = point {
                    *value = look_up(image, encoding, &texture.sampler, &filter, point);
                }
            }
        }
    }
    surfaces.texels = texels;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filters_by_name() {
        let check = EFFECT.value.as_ref().map(|value| value.check).expect("it takes a value");
        for name in ["nearest", "bilinear", "mipmap", "anisotropic"] {
            assert_eq!(filter(name).map(TextureFilter::name), Some(name));
            assert!(check(name).is_ok());
        }
        assert_eq!(check("cubic").unwrap_err(), "filters are nearest, bilinear, mipmap, anisotropic");
    }
}
