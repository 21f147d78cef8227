//! Materials, textures and decoded images.

use super::{ImageId, Sampler};
use crate::film::Colour;
use std::sync::Arc;

/// A material.
#[derive(Debug, Clone)]
pub enum Material {
    /// Phong model, of the assignment and of OBJ.
    Phong(Phong),
    /// Metallic-roughness model of glTF.
    MetallicRoughness(MetallicRoughness),
}

/// Phong material: ambient, diffuse and specular terms, all multiplied by the object's colour (the assignment's
/// report).
#[derive(Debug, Clone)]
pub struct Phong {
    /// Name.
    pub name: String,
    /// The object's own colour.
    pub colour: Colour,
    /// Texture that multiplies the colour.
    pub texture: Option<Texture>,
    /// Coefficient of ambient light, k_a.
    pub ambient: f64,
    /// Coefficient of diffuse light, k_d.
    pub diffuse: f64,
    /// Coefficient of the highlight, k_s.
    pub specular: f64,
    /// Exponent of the highlight, n.
    pub shininess: f64,
    /// Mirror reflection blended over the surface.
    pub glaze: Option<Glaze>,
    /// Normal map.
    pub normal_map: Option<NormalMap>,
}

/// A faint mirror reflection: where a reflected ray hits, `colour = own_weight * colour + weight * reflected`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glaze {
    /// Weight of the reflected colour, 0 to 1.
    pub weight: f64,
    /// Weight of the object's own colour, 0 to `1 - weight`.
    pub own_weight: f64,
    /// Maximum number of reflections of a ray, including the one at this surface.
    pub bounces: u32,
}

/// Material of glTF 2.0, section 3.9 of its specification. Factors are linear and multiply their textures.
#[derive(Debug, Clone)]
pub struct MetallicRoughness {
    /// Name.
    pub name: String,
    /// Base colour.
    pub base_colour: Colour,
    /// Texture of the base colour (display values).
    pub base_colour_texture: Option<Texture>,
    /// 0 for a dielectric, 1 for a metal.
    pub metallic: f64,
    /// 0 for a mirror, 1 for a fully rough surface.
    pub roughness: f64,
    /// Texture with roughness in green and metallic in blue (linear values).
    pub metallic_roughness_texture: Option<Texture>,
    /// Emitted radiance; may exceed 1.
    pub emission: Colour,
    /// Texture that multiplies the emission (display values).
    pub emission_texture: Option<Texture>,
    /// If true, the base colour is output without shading (KHR_materials_unlit).
    pub unlit: bool,
    /// Normal map.
    pub normal_map: Option<NormalMap>,
}

/// An image and its sampler.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Texture {
    /// The image.
    pub image: ImageId,
    /// Wrap modes and filters.
    pub sampler: Sampler,
}

/// Tangent-space normal map: red, green and blue encode x (along u), y (against v) and z (along the normal), each from
/// -1 at 0 to 1 at 255 (glTF 2.0, section 3.9.3).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalMap {
    /// The texture.
    pub texture: Texture,
    /// Factor of x and y.
    pub scale: f64,
}

/// A decoded image: 8-bit display values.
#[derive(Debug, Clone, PartialEq)]
pub struct DecodedImage {
    /// File or item that it was read from.
    pub name: String,
    /// Width in pixels, at least 1.
    pub width: u32,
    /// Height in pixels, at least 1.
    pub height: u32,
    /// `width * height` pixels of red, green and blue, row by row from the top.
    pub pixels: Arc<[[u8; 3]]>,
}

impl Default for Phong {
    /// A light grey surface without highlight, for meshes without materials.
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
    /// Values of the assignment: 0.75 of the object's colour, 0.25 of the reflected colour, one bounce.
    fn default() -> Self {
        Glaze { weight: 0.25, own_weight: 0.75, bounces: 1 }
    }
}

impl Material {
    /// Name.
    pub fn name(&self) -> &str {
        match self {
            Material::Phong(m) => &m.name,
            Material::MetallicRoughness(m) => &m.name,
        }
    }

    /// Normal map.
    pub fn normal_map(&self) -> Option<&NormalMap> {
        match self {
            Material::Phong(m) => m.normal_map.as_ref(),
            Material::MetallicRoughness(m) => m.normal_map.as_ref(),
        }
    }

    /// The textures that the material uses.
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

    /// Whether the material uses any texture.
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
