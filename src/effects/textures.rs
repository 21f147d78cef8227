//! Textures: lookups of the materials' textures at the surfaces that have them.

use super::texture_points::{self, Buffers};
use super::tile::{RayGeneration, RenderContext, Tile, vec_bytes};
use super::{Effect, EffectContext, EffectValue, Hook, Stage, TextureUse, id, named};
use crate::scene::{Material, TexelEncoding, Texture, TextureFilter};
use crate::shading::texture::look_up;
use crate::world::{PreparedMaterial, Texels, World};

/// The registry's entry.
pub const EFFECT: Effect = Effect {
    id: id::TEXTURES,
    summary: "pictures on surfaces: nearest, bilinear, mipmap or anisotropic; as each says itself, if not told",
    builds_on: None,
    needs_lights: false,
    is_shading: false,
    decides_samples: false,
    is_study_switch: false,
    whitted_only: false,
    rays: &[],
    value: Some(EffectValue {
        meaning: "filter",
        check: |value| match filter(value) {
            Some(_) => Ok(()),
            None => Err(format!("filters are {}", TextureFilter::ALL.map(TextureFilter::name).join(", "))),
        },
    }),
    called_for: |world: &World, _| {
        let textured = world.materials_in_use().filter(|material| material.textures().next().is_some());
        let names: Vec<&str> = textured.map(Material::name).collect();
        named("material", &names).ok_or_else(|| "no object is of a material with a picture".into())
    },
    specify: |context, spec| {
        spec.texture_use.material_textures = true;
        spec.texture_use.filter = context.value.as_deref().and_then(filter);
    },
    stages: |context: &EffectContext, hook: Hook| {
        texture_points::stages(context, hook, true, Textures { texture_use: context.spec.texture_use })
    },
    bytes: |tile| {
        let texels = tile.generations.iter().map(|generation| vec_bytes(&generation.surfaces.texels));
        let texels = texels.sum::<usize>();
        texels + tile.buffers::<Buffers>().filter(|_| texels > 0).map_or(0, Buffers::bytes)
    },
};

/// The filter of this name.
fn filter(name: &str) -> Option<TextureFilter> {
    TextureFilter::ALL.into_iter().find(|filter| filter.name() == name)
}

/// Looks up the textures of the surfaces of a generation.
struct Textures {
    texture_use: TextureUse,
}

/// Stores a looked-up value in the texels of a surface.
type Store = fn(&mut Texels, glam::DVec3);

impl Stage for Textures {
    fn name(&self) -> &'static str {
        "textures"
    }

    fn run(&self, tile: &mut Tile, context: &RenderContext) {
        tile.with_buffers(|own: &mut Buffers, tile| {
            let points = own.points(tile.depth);
            if points.is_empty() {
                return;
            }
            let RayGeneration { surfaces, .. } = &mut tile.generations[tile.depth];
            let mut texels = std::mem::take(&mut surfaces.texels);
            texels.resize(surfaces.len(), Texels::default());
            for (material, range) in surfaces.by_material() {
                let material = &context.world.materials[*material as usize];
                for (texture, encoding, store) in slots(material) {
                    let image = &context.world.images[texture.image.0 as usize];
                    let filter = self.texture_use.filter(&texture);
                    for (texels, point) in texels[range.clone()].iter_mut().zip(&points[range.clone()]) {
                        if let Some(point) = point {
                            store(texels, look_up(image, encoding, &texture.sampler, &filter, point));
                        }
                    }
                }
            }
            surfaces.texels = texels;
        });
    }
}

/// The textures of a material, the encoding of their texels, and where their values are stored.
fn slots(material: &PreparedMaterial) -> impl Iterator<Item = (Texture, TexelEncoding, Store)> {
    let stores: [Store; 3] = [
        |texels, c| texels.colour = c,
        |texels, c| (texels.roughness, texels.metallic) = (c.y, c.z),
        |texels, c| texels.emission = c,
    ];
    let slots = material.slots().into_iter().zip(stores);
    slots.filter_map(|((texture, encoding), store)| Some((texture?, encoding, store)))
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
