//! Materials and textures in the numbers of a colour pipeline.

use glam::DVec3;

use super::image::TexelEncoding;
use crate::film::ColourPipeline;
use crate::scene::{Glaze, Material, NormalMap, Sampler, Texture};

/// A material in the numbers of a colour pipeline.
#[derive(Debug, Clone)]
pub enum PreparedMaterial {
    /// The assignment's Phong model.
    Phong(PreparedPhong),
    /// glTF's metallic-roughness model.
    MetallicRoughness(PreparedMetallicRoughness),
}

/// A prepared [`crate::scene::Phong`].
#[derive(Debug, Clone)]
pub struct PreparedPhong {
    /// The base colour.
    pub colour: DVec3,
    /// The texture that multiplies it.
    pub texture: Option<PreparedTexture>,
    /// The ambient coefficient k_a.
    pub ambient: f64,
    /// The diffuse coefficient k_d.
    pub diffuse: f64,
    /// The specular coefficient k_s.
    pub specular: f64,
    /// The specular exponent n.
    pub shininess: f64,
    /// The mirror reflection over the surface.
    pub glaze: Option<Glaze>,
    /// The normal map.
    pub normal_map: Option<PreparedNormalMap>,
}

/// A prepared [`crate::scene::MetallicRoughness`].
#[derive(Debug, Clone)]
pub struct PreparedMetallicRoughness {
    /// The base colour.
    pub base_colour: DVec3,
    /// The texture that multiplies it.
    pub base_colour_texture: Option<PreparedTexture>,
    /// 0 for a dielectric, 1 for a metal.
    pub metallic: f64,
    /// 0 for a mirror, 1 for fully rough.
    pub roughness: f64,
    /// The texture whose green channel multiplies `roughness` and whose blue channel multiplies `metallic`.
    pub metallic_roughness_texture: Option<PreparedTexture>,
    /// The emitted radiance.
    pub emission: DVec3,
    /// The texture that multiplies it.
    pub emission_texture: Option<PreparedTexture>,
    /// Whether the surface shows its base colour, without light (KHR_materials_unlit).
    pub unlit: bool,
    /// The normal map.
    pub normal_map: Option<PreparedNormalMap>,
}

/// A texture: an image and its sampler.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PreparedTexture {
    /// The index of the image.
    pub image: u32,
    /// Filters and wrapping.
    pub sampler: Sampler,
}

/// A prepared [`crate::scene::NormalMap`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PreparedNormalMap {
    /// The texture.
    pub texture: PreparedTexture,
    /// The factor of x and y.
    pub scale: f64,
}

fn normal_map(map: Option<NormalMap>) -> Option<PreparedNormalMap> {
    map.and_then(|map| Some(PreparedNormalMap { texture: texture(Some(map.texture))?, scale: map.scale }))
}

fn texture(texture: Option<Texture>) -> Option<PreparedTexture> {
    texture.map(|t| PreparedTexture { image: t.image.0, sampler: t.sampler })
}

/// Prepares a material for `pipeline`.
pub fn material(material: &Material, pipeline: ColourPipeline) -> PreparedMaterial {
    match material {
        Material::Phong(m) => PreparedMaterial::Phong(PreparedPhong {
            colour: m.colour.to_pipeline(pipeline),
            texture: texture(m.texture),
            ambient: m.ambient,
            diffuse: m.diffuse,
            specular: m.specular,
            shininess: m.shininess,
            glaze: m.glaze,
            normal_map: normal_map(m.normal_map),
        }),
        Material::MetallicRoughness(m) => PreparedMaterial::MetallicRoughness(PreparedMetallicRoughness {
            base_colour: m.base_colour.to_pipeline(pipeline),
            base_colour_texture: texture(m.base_colour_texture),
            metallic: m.metallic,
            roughness: m.roughness,
            metallic_roughness_texture: texture(m.metallic_roughness_texture),
            emission: m.emission.to_pipeline(pipeline),
            emission_texture: texture(m.emission_texture),
            unlit: m.unlit,
            normal_map: normal_map(m.normal_map),
        }),
    }
}

impl PreparedMaterial {
    /// The mirror reflection over the surface.
    pub fn glaze(&self) -> Option<&Glaze> {
        match self {
            PreparedMaterial::Phong(m) => m.glaze.as_ref(),
            PreparedMaterial::MetallicRoughness(_) => None,
        }
    }

    /// The textures of colour, of roughness and metallic, and of emission, with the encoding of their texels.
    pub fn slots(&self) -> [(Option<PreparedTexture>, TexelEncoding); 3] {
        use TexelEncoding::{Colour, Data};
        match self {
            PreparedMaterial::Phong(m) => [(m.texture, Colour), (None, Data), (None, Colour)],
            PreparedMaterial::MetallicRoughness(m) => [
                (m.base_colour_texture, Colour),
                (m.metallic_roughness_texture, Data),
                (m.emission_texture, Colour),
            ],
        }
    }

    /// The textures among [`PreparedMaterial::slots`].
    pub fn textures(&self) -> impl Iterator<Item = (PreparedTexture, TexelEncoding)> + use<> {
        self.slots().into_iter().filter_map(|(texture, encoding)| Some((texture?, encoding)))
    }

    /// The normal map.
    pub fn normal_map(&self) -> Option<&PreparedNormalMap> {
        match self {
            PreparedMaterial::Phong(m) => m.normal_map.as_ref(),
            PreparedMaterial::MetallicRoughness(m) => m.normal_map.as_ref(),
        }
    }
}
