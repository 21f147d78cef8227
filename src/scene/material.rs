//! What things are made of.

use super::{ImageId, Sampler};
use crate::film::Colour;
use std::sync::Arc;

/// A material.
#[derive(Debug, Clone)]
pub enum Material {
    /// The assignment's model, and OBJ's.
    Phong(Phong),
    /// glTF's model.
    MetallicRoughness(MetallicRoughness),
}

/// Ambient, diffuse and specular light on an object's own colour (the assignment's report): the highlight too has the
/// object's colour.
#[derive(Debug, Clone)]
pub struct Phong {
    /// Its name.
    pub name: String,
    /// The object's own colour.
    pub colour: Colour,
    /// A picture that multiplies the colour.
    pub texture: Option<Texture>,
    /// Coefficient of ambient light, k_a.
    pub ambient: f64,
    /// Coefficient of diffuse light, k_d.
    pub diffuse: f64,
    /// Coefficient of the highlight, k_s.
    pub specular: f64,
    /// Exponent of the highlight, n.
    pub shininess: f64,
    /// A faint mirror over the surface.
    pub glaze: Option<Glaze>,
    /// What tilts its normals.
    pub normal_map: Option<NormalMap>,
}

/// A faint mirror: where a reflected ray hits something, `colour = own_weight * colour + weight * reflected`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glaze {
    /// Weight of what is seen in the mirror, 0 to 1.
    pub weight: f64,
    /// Weight of the object's own colour, 0 to `1 - weight`.
    pub own_weight: f64,
    /// How often a ray may be reflected, starting with this surface.
    pub bounces: u32,
}

/// glTF 2.0's material, section 3.9 of its specification. Factors are in linear light and multiply their textures.
#[derive(Debug, Clone)]
pub struct MetallicRoughness {
    /// Its name.
    pub name: String,
    /// Base colour.
    pub base_colour: Colour,
    /// Picture of the base colour (display values).
    pub base_colour_texture: Option<Texture>,
    /// 0 for a dielectric, 1 for a metal.
    pub metallic: f64,
    /// 0 for a mirror, 1 for a fully rough surface.
    pub roughness: f64,
    /// Picture with roughness in green and metallic in blue (plain numbers).
    pub metallic_roughness_texture: Option<Texture>,
    /// Light the surface gives off; may exceed 1.
    pub emission: Colour,
    /// Picture that multiplies the emission (display values).
    pub emission_texture: Option<Texture>,
    /// No shading at all: the base colour is what is seen.
    pub unlit: bool,
    /// What tilts its normals.
    pub normal_map: Option<NormalMap>,
}

/// A picture and how to look it up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Texture {
    /// The picture.
    pub image: ImageId,
    /// What happens outside 0..1.
    pub sampler: Sampler,
}

/// A picture that tilts normals: red, green and blue stand for x (along u), y (against v) and z (along the normal), each
/// from -1 at 0 to 1 at 255 (glTF 2.0, section 3.9.3).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalMap {
    /// The picture.
    pub texture: Texture,
    /// What x and y are multiplied by.
    pub scale: f64,
}

/// A decoded picture: 8-bit display values.
#[derive(Debug, Clone, PartialEq)]
pub struct TextureImage {
    /// Where it came from.
    pub name: String,
    /// Width in pixels, at least 1.
    pub width: u32,
    /// Height in pixels, at least 1.
    pub height: u32,
    /// `width * height` pixels of red, green and blue, row by row from the top.
    pub pixels: Arc<[[u8; 3]]>,
}

impl Default for Phong {
    /// A light grey, dull surface: what a mesh without materials is made of.
    fn default() -> Self {
        Phong {
            name: "default".into(),
            colour: Colour::from_u8([204; 3]),
            texture: None,
            ambient: 1.0,
            diffuse: 1.0,
            specular: 0.0,
            shininess: 1.0,
            glaze: None,
            normal_map: None,
        }
    }
}

impl Default for MetallicRoughness {
    /// The defaults of glTF 2.0.
    fn default() -> Self {
        MetallicRoughness {
            name: "default".into(),
            base_colour: Colour::Linear(glam::DVec3::ONE),
            base_colour_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            emission: Colour::Linear(glam::DVec3::ZERO),
            emission_texture: None,
            unlit: false,
            normal_map: None,
        }
    }
}

impl Default for Glaze {
    /// The assignment's: 0.75 of the object's own colour, 0.25 of what it mirrors, one bounce.
    fn default() -> Self {
        Glaze { weight: 0.25, own_weight: 0.75, bounces: 1 }
    }
}

impl Material {
    /// Its name.
    pub fn name(&self) -> &str {
        match self {
            Material::Phong(m) => &m.name,
            Material::MetallicRoughness(m) => &m.name,
        }
    }

    /// What tilts its normals.
    pub fn normal_map(&self) -> Option<&NormalMap> {
        match self {
            Material::Phong(m) => m.normal_map.as_ref(),
            Material::MetallicRoughness(m) => m.normal_map.as_ref(),
        }
    }

    /// The textures it reads.
    pub fn textures_mut(&mut self) -> impl Iterator<Item = &mut Texture> {
        let (textures, normal_map) = match self {
            Material::Phong(m) => ([m.texture.as_mut(), None, None], m.normal_map.as_mut()),
            Material::MetallicRoughness(m) => (
                [
                    m.base_colour_texture.as_mut(),
                    m.metallic_roughness_texture.as_mut(),
                    m.emission_texture.as_mut(),
                ],
                m.normal_map.as_mut(),
            ),
        };
        textures.into_iter().flatten().chain(normal_map.map(|map| &mut map.texture))
    }

    /// Whether it reads any texture.
    pub fn is_textured(&self) -> bool {
        match self {
            Material::Phong(m) => m.texture.is_some() || m.normal_map.is_some(),
            Material::MetallicRoughness(m) => {
                let textures = [m.base_colour_texture, m.metallic_roughness_texture, m.emission_texture];
                textures.iter().any(Option::is_some) || m.normal_map.is_some()
            }
        }
    }
}
