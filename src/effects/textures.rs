//! Textures: what the pictures of materials say of the surfaces that have them, and of no others.

use super::pictures::{self, Buffers};
use super::tile::{Context, Level, Tile, vec_bytes};
use super::{Asked, Effect, Hook, Pictures, Stage, Value, named};
use crate::scene::TextureFilter;
use crate::shading::texture::look_up;
use crate::world::{LoweredMaterial, LoweredTexture, Meaning, Texels, World};

/// In the registry.
pub const EFFECT: Effect = Effect {
    name: "textures",
    summary: "pictures on surfaces: nearest, bilinear, mipmap or anisotropic; as each says itself, if not told",
    needs_lights: false,
    is_shading: false,
    rays: &[],
    value: Some(Value {
        meaning: "filter",
        check: |value| match filter(value) {
            Some(_) => Ok(()),
            None => Err(format!("filters are {}", TextureFilter::ALL.map(TextureFilter::name).join(", "))),
        },
    }),
    called_for: |world: &World, _| {
        let pictured = world.materials_in_use().filter(|(_, material)| material.textures().next().is_some());
        let names: Vec<&str> = pictured.map(|(name, _)| name).collect();
        named("material", &names).ok_or_else(|| "no object is of a material with a picture".into())
    },
    outline: |asked, outline| {
        outline.pictures.textures = true;
        outline.pictures.filter = asked.value.as_deref().and_then(filter);
    },
    stages: |asked: &Asked, hook: Hook| {
        pictures::stages(asked, hook, true, Textures { pictures: asked.outline.pictures })
    },
    bytes: |tile| {
        let texels = tile.levels.iter().map(|level| vec_bytes(&level.surfaces.texels)).sum::<usize>();
        texels + tile.kept::<Buffers>().filter(|_| texels > 0).map_or(0, Buffers::bytes)
    },
};

/// The filter of this name.
fn filter(name: &str) -> Option<TextureFilter> {
    TextureFilter::ALL.into_iter().find(|filter| filter.name() == name)
}

/// Looks up the pictures of the surfaces of a level.
struct Textures {
    pictures: Pictures,
}

/// Where what a picture shows goes.
type Put = fn(&mut Texels, glam::DVec3);

impl Stage for Textures {
    fn name(&self) -> &'static str {
        "textures"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        tile.with(|own: &mut Buffers, tile| {
            let points = own.points(tile.depth);
            if points.is_empty() {
                return;
            }
            let Level { surfaces, .. } = &mut tile.levels[tile.depth];
            let mut texels = std::mem::take(&mut surfaces.texels);
            texels.resize(surfaces.len(), Texels::default());
            for (material, range) in surfaces.by_material() {
                let material = &context.world.materials[*material as usize];
                for (texture, meaning, put) in slots(material) {
                    let image = &context.world.images[texture.image as usize];
                    let filter = self.pictures.filter(&texture);
                    for (texels, point) in texels[range.clone()].iter_mut().zip(&points[range.clone()]) {
                        if let Some(point) = point {
                            put(texels, look_up(image, meaning, &texture.sampler, &filter, point));
                        }
                    }
                }
            }
            surfaces.texels = texels;
        });
    }
}

/// The pictures of a material, what their values mean, and where they go.
fn slots(material: &LoweredMaterial) -> impl Iterator<Item = (LoweredTexture, Meaning, Put)> {
    let puts: [Put; 3] = [
        |texels, c| texels.colour = c,
        |texels, c| (texels.roughness, texels.metallic) = (c.y, c.z),
        |texels, c| texels.emission = c,
    ];
    material
        .slots()
        .into_iter()
        .zip(puts)
        .filter_map(|((texture, meaning), put)| Some((texture?, meaning, put)))
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
