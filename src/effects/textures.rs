//! Textures: lookups of the materials' textures at the surfaces that have them. Those of layers are looked up only by
//! the transport that uses them.

use super::texture_points::{self, Buffers};
use super::tile::{RayGeneration, RenderContext, Tile, vec_bytes};
use super::{Effect, EffectContext, EffectValue, Hook, Stage, TextureUse, id, named, plan};
use crate::scene::{Material, TexelEncoding, Texture, TextureFilter, TextureSlot};
use crate::shading::texture::look_up;
use crate::world::{FurtherTexels, InteractionSoa, PreparedMaterial, Texels, TexturePoint, World};

/// The registry's entry.
pub const EFFECT: Effect = Effect {
    id: id::TEXTURES,
    summary: "image textures; filter: nearest, bilinear, mipmap or anisotropic [default: each texture's sampler]",
    source: "Williams, Pyramidal Parametrics, 1983; Igehy, Tracing Ray Differentials, 1999",
    value: Some(EffectValue {
        meaning: "filter",
        placeholder: "FILTER",
        check: |value| match filter(value) {
            Some(_) => Ok(()),
            None => Err(format!("filters are {}", TextureFilter::ALL.map(TextureFilter::name).join(", "))),
        },
    }),
    called_for: |world: &World, choices| {
        let slots = plan::transport_for(world, choices).texture_slots;
        let is_textured = |material: &&PreparedMaterial| {
            material.textures().chain(texture_points::further(material, slots)).next().is_some()
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
        let textures = Textures { texture_use: context.spec.texture_use };
        let look_up = move |buffers: &mut Buffers, tile: &mut Tile, context: &RenderContext| {
            textures.look_up_all(buffers, tile, context.world);
        };
        texture_points::stages(context, hook, true, Stage::with_buffers("textures", look_up))
    },
    bytes: |tile| {
        let bytes =
            |surfaces: &InteractionSoa| vec_bytes(&surfaces.texels) + vec_bytes(&surfaces.further_texels);
        let texels = tile.generations.iter().map(|generation| bytes(&generation.surfaces)).sum::<usize>();
        texels + tile.buffers::<Buffers>().filter(|_| texels > 0).map_or(0, Buffers::bytes)
    },
    ..Effect::NONE
};

/// The filter of this name.
pub(super) fn filter(name: &str) -> Option<TextureFilter> {
    TextureFilter::ALL.into_iter().find(|filter| filter.name() == name)
}

/// Looks up the textures of the surfaces of a generation.
struct Textures {
    texture_use: TextureUse,
}

/// Stores a looked-up value in the texels of a surface.
type Store<T> = fn(&mut T, glam::DVec3);

/// A texture of a material, the encoding of its texels, and where its value is stored.
type Slot<T> = (Texture, TexelEncoding, Store<T>);

impl Textures {
    fn look_up_all(&self, buffers: &Buffers, tile: &mut Tile, world: &World) {
        let points = |set: u8| buffers.points(tile.current, set);
        let RayGeneration { surfaces, .. } = &mut tile.generations[tile.current];
        let mut texels = std::mem::take(&mut surfaces.texels);
        let mut further = std::mem::take(&mut surfaces.further_texels);
        let used = self.texture_use.slots;
        let of_slots = |material| further_slots(material, used);
        self.look_up(world, surfaces, &points, slots, &mut texels);
        self.look_up(world, surfaces, &points, of_slots, &mut further);
        (surfaces.texels, surfaces.further_texels) = (texels, further);
    }

    /// Looks up the textures in `slots` of each surface's material into `texels`, which stay empty without any.
    fn look_up<'a, 'p, T: Clone + Default, S: Iterator<Item = Slot<T>>>(
        &self,
        world: &'a World,
        surfaces: &InteractionSoa,
        points: &dyn Fn(u8) -> &'p [Option<TexturePoint>],
        slots: impl Fn(&'a PreparedMaterial) -> S,
        texels: &mut Vec<T>,
    ) {
        for (material, range) in surfaces.by_material() {
            for (texture, encoding, store) in slots(&world.materials[*material as usize]) {
                let points = points(texture.coordinates);
                if points.is_empty() {
                    continue;
                }
                texels.resize(surfaces.len(), T::default());
                let image = &world.images[texture.image.0 as usize];
                let filter = self.texture_use.filter(&texture);
                for (texels, point) in texels[range.clone()].iter_mut().zip(&points[range.clone()]) {
                    if let Some(point) = point {
                        store(texels, look_up(image, encoding, &texture.sampler, &filter, point));
                    }
                }
            }
        }
    }
}

fn slots(material: &PreparedMaterial) -> impl Iterator<Item = Slot<Texels>> + use<> {
    let stores: [Store<Texels>; 3] = [
        |texels, c| texels.colour = c,
        |texels, c| (texels.roughness, texels.metallic) = (c.y, c.z),
        |texels, c| texels.emission = c,
    ];
    let slots = material.slots().into_iter().zip(stores);
    slots.filter_map(|((texture, encoding), store)| Some((texture?, encoding, store)))
}

/// The further textures that the transport uses.
fn further_slots<'a>(
    material: &'a PreparedMaterial,
    used: &'static [TextureSlot],
) -> impl Iterator<Item = Slot<FurtherTexels>> + 'a {
    let store = |slot| -> Store<FurtherTexels> {
        match slot {
            TextureSlot::Occlusion => |texels, c| texels.occlusion = c.x,
            TextureSlot::Specular => |texels, c| texels.specular = c.x,
            TextureSlot::SpecularColour => |texels, c| texels.specular_colour = c,
            TextureSlot::Transmission => |texels, c| texels.transmission = c.x,
            TextureSlot::Clearcoat => |texels, c| texels.clearcoat = c.x,
            TextureSlot::ClearcoatRoughness => |texels, c| texels.clearcoat_roughness = c.y,
            TextureSlot::SheenColour => |texels, c| texels.sheen_colour = c,
            TextureSlot::SheenRoughness => |texels, c| texels.sheen_roughness = c.x,
        }
    };
    let used = material.further_textures().iter().filter(move |further| used.contains(&further.slot));
    used.map(move |further| (further.texture, further.slot.encoding(), store(further.slot)))
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
