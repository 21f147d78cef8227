//! Materials, textures and decoded images.

use super::{FurtherTexture, ImageId, Layers, TexelValues, TextureSampler};
use crate::film::Colour;

/// A material. `C` is [`Colour`] in a scene, and a colour in the numbers of the colour pipeline in a prepared world.
#[derive(Debug, Clone, serde::Serialize)]
pub enum Material<C = Colour> {
    /// Phong model, of the assignment and of OBJ.
    Phong(Phong<C>),
    /// Metallic-roughness model of glTF.
    MetallicRoughness(MetallicRoughness<C>),
}

/// Phong material: ambient, diffuse and specular terms, all multiplied by the object's colour (the assignment's
/// report).
#[derive(Debug, Clone, serde::Serialize)]
pub struct Phong<C = Colour> {
    /// Name.
    pub name: String,
    /// The object's own colour.
    pub colour: C,
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
    /// Emitted radiance; may exceed 1.
    pub emission: C,
    /// Mirror reflection blended over the surface.
    pub glaze: Option<Glaze>,
    /// Glass, which path tracing draws instead of the other terms; local shading leaves it out.
    pub refraction: Option<Refraction<C>>,
    /// Normal map.
    pub normal_map: Option<NormalMap>,
    /// How opaque the surface is; `None` for one that is everywhere opaque.
    pub opacity: Option<Opacity>,
}

/// Smooth glass of a closed surface: `illum` 4, 6, 7 and 9 of MTL.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Refraction<C = Colour> {
    /// Index of refraction, above 1.
    pub ior: f64,
    /// Factor of the light that passes the surface.
    pub filter: C,
}

/// A faint mirror reflection: where a reflected ray hits, `colour = own_weight * colour + weight * reflected`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Glaze {
    /// Weight of the reflected colour, 0 to 1.
    pub weight: f64,
    /// Weight of the object's own colour, 0 to `1 - weight`.
    pub own_weight: f64,
    /// Maximum number of reflections of a ray, including the one at this surface.
    pub bounces: u32,
}

/// Material of glTF 2.0, section 3.9 of its specification. Factors are linear and multiply their textures.
#[derive(Debug, Clone, serde::Serialize)]
pub struct MetallicRoughness<C = Colour> {
    /// Name.
    pub name: String,
    /// Base colour.
    pub base_colour: C,
    /// Texture of the base colour (display values).
    pub base_colour_texture: Option<Texture>,
    /// 0 for a dielectric, 1 for a metal.
    pub metallic: f64,
    /// 0 for a mirror, 1 for a fully rough surface.
    pub roughness: f64,
    /// Texture with roughness in green and metallic in blue (linear values).
    pub metallic_roughness_texture: Option<Texture>,
    /// Emitted radiance; may exceed 1.
    pub emission: C,
    /// Texture that multiplies the emission (display values).
    pub emission_texture: Option<Texture>,
    /// If true, the base colour is output without shading (KHR_materials_unlit).
    pub unlit: bool,
    /// Normal map.
    pub normal_map: Option<NormalMap>,
    /// How opaque the surface is; `None` for one that is everywhere opaque.
    pub opacity: Option<Opacity>,
    /// Values of material extensions, which path tracing uses.
    pub layers: Layers<C>,
    /// Whether camera rays hit back faces with `--cull` as well.
    pub double_sided: bool,
    /// Weight of the occlusion texture, 0 to 1: the ambient light is multiplied by `1 + occlusion_strength * (texel -
    /// 1)`.
    pub occlusion_strength: f64,
    /// The further textures, at most one for each slot.
    pub further_textures: Vec<FurtherTexture>,
}

/// The opacity of a surface: the part of it that covers what is behind (alpha; Porter and Duff, Compositing Digital
/// Images, SIGGRAPH 1984). It is the product of factor, texture and vertex alpha.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Opacity {
    /// Factor, 0 to 1.
    pub factor: f64,
    /// Texture whose red channel multiplies the factor.
    pub texture: Option<Texture>,
    /// Where given, the surface is opaque where the product is at least this, and absent elsewhere (`MASK` of glTF).
    pub cutoff: Option<f64>,
}

/// An image and its sampler.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Texture {
    /// The image.
    pub image: ImageId,
    /// Wrap modes and filters.
    pub sampler: TextureSampler,
    /// The index of its texture coordinates in [`super::Mesh::uvs`].
    pub coordinates: u8,
}

/// Tangent-space normal map: red, green and blue encode x (along u), y (against v) and z (along the normal), each from
/// -1 at 0 to 1 at the largest value (glTF 2.0, section 3.9.3).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct NormalMap {
    /// The texture.
    pub texture: Texture,
    /// Factor of x and y.
    pub scale: f64,
}

/// A decoded image: display values of 8 or 16 bits.
#[derive(Debug, Clone, PartialEq)]
pub struct DecodedImage {
    /// File or item that it was read from.
    pub name: String,
    /// Width in pixels, at least 1.
    pub width: u32,
    /// Height in pixels, at least 1.
    pub height: u32,
    /// `width * height` pixels, row by row from the top.
    pub pixels: TexelValues,
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
            emission: Colour::Linear(glam::DVec3::ZERO),
            glaze: None,
            refraction: None,
            normal_map: None,
            opacity: None,
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
            opacity: None,
            layers: Layers::default(),
            double_sided: true,
            occlusion_strength: 1.0,
            further_textures: Vec::new(),
        }
    }
}

impl Default for Glaze {
    /// Values of the assignment: 0.75 of the object's colour, 0.25 of the reflected colour, one bounce.
    fn default() -> Self {
        Glaze { weight: 0.25, own_weight: 0.75, bounces: 1 }
    }
}

/// How the stored values of a texture are decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum TexelEncoding {
    /// As colours in the numbers of the pipeline: through the sRGB transfer function in `linear`.
    Colour,
    /// As numbers, the value divided by the largest of its bit depth: roughness, metallic, opacity.
    Data,
    /// As [`TexelEncoding::Data`], for components of normals (glTF 2.0, section 3.9.3), but flat texels are exactly
    /// flat: 1/2 lies between two stored values, and if both x and y are one of these, they are decoded as 1/2.
    Normal,
}

impl TexelEncoding {
    /// Decoded values of data or a normal, 0 to 1, of stored ones, 0 to `largest`.
    #[inline]
    pub fn numbers(self, texel: [u16; 3], largest: u16, number: impl Fn(u16) -> f64) -> [f64; 3] {
        let is_level = |value: u16| value == largest / 2 || value == largest / 2 + 1;
        match (self, texel.map(number)) {
            (TexelEncoding::Normal, [.., z]) if is_level(texel[0]) && is_level(texel[1]) => [0.5, 0.5, z],
            (_, numbers) => numbers,
        }
    }
}

impl Material {
    /// Whether it emits light.
    pub fn emits(&self) -> bool {
        let (Material::Phong(Phong { emission, .. })
        | Material::MetallicRoughness(MetallicRoughness { emission, .. })) = self;
        let (Colour::Display(emission) | Colour::Linear(emission)) = emission;
        *emission != glam::DVec3::ZERO
    }
}

impl<C> Material<C> {
    /// Whether it transmits light by refraction or into a volume.
    pub fn transmits(&self) -> bool {
        match self {
            Material::Phong(m) => m.refraction.is_some(),
            Material::MetallicRoughness(m) => !m.unlit && m.layers.transmission > 0.0,
        }
    }

    /// Whether its colour is output without shading.
    pub fn is_unlit(&self) -> bool {
        matches!(self, Material::MetallicRoughness(MetallicRoughness { unlit: true, .. }))
    }

    /// The material with every colour converted by `convert`.
    pub fn map_colours<D>(self, convert: impl Fn(C) -> D) -> Material<D> {
        match self {
            Material::Phong(m) => Material::Phong(Phong {
                name: m.name,
                colour: convert(m.colour),
                texture: m.texture,
                ambient: m.ambient,
                diffuse: m.diffuse,
                specular: m.specular,
                shininess: m.shininess,
                emission: convert(m.emission),
                glaze: m.glaze,
                refraction: m
                    .refraction
                    .map(|glass| Refraction { ior: glass.ior, filter: convert(glass.filter) }),
                normal_map: m.normal_map,
                opacity: m.opacity,
            }),
            Material::MetallicRoughness(m) => Material::MetallicRoughness(MetallicRoughness {
                name: m.name,
                base_colour: convert(m.base_colour),
                base_colour_texture: m.base_colour_texture,
                metallic: m.metallic,
                roughness: m.roughness,
                metallic_roughness_texture: m.metallic_roughness_texture,
                emission: convert(m.emission),
                emission_texture: m.emission_texture,
                unlit: m.unlit,
                normal_map: m.normal_map,
                opacity: m.opacity,
                layers: m.layers.map_colours(convert),
                double_sided: m.double_sided,
                occlusion_strength: m.occlusion_strength,
                further_textures: m.further_textures,
            }),
        }
    }

    /// Name.
    pub fn name(&self) -> &str {
        match self {
            Material::Phong(m) => &m.name,
            Material::MetallicRoughness(m) => &m.name,
        }
    }

    /// Mirror reflection blended over the surface.
    pub fn glaze(&self) -> Option<&Glaze> {
        match self {
            Material::Phong(m) => m.glaze.as_ref(),
            Material::MetallicRoughness(_) => None,
        }
    }

    /// Normal map.
    pub fn normal_map(&self) -> Option<&NormalMap> {
        match self {
            Material::Phong(m) => m.normal_map.as_ref(),
            Material::MetallicRoughness(m) => m.normal_map.as_ref(),
        }
    }

    /// Whether back faces may be culled. Those of glass bound a volume and may not.
    pub fn is_single_sided(&self) -> bool {
        matches!(self, Material::MetallicRoughness(m) if !m.double_sided && m.layers.transmission == 0.0)
    }

    /// Opacity; `None` where the surface is opaque.
    pub fn opacity(&self) -> Option<&Opacity> {
        match self {
            Material::Phong(m) => m.opacity.as_ref(),
            Material::MetallicRoughness(m) => m.opacity.as_ref(),
        }
    }

    /// The textures of colour, of roughness and metallic, and of emission, with the encoding of their texels.
    pub fn slots(&self) -> [(Option<Texture>, TexelEncoding); 3] {
        use TexelEncoding::{Colour, Data};
        match self {
            Material::Phong(m) => [(m.texture, Colour), (None, Data), (None, Colour)],
            Material::MetallicRoughness(m) => [
                (m.base_colour_texture, Colour),
                (m.metallic_roughness_texture, Data),
                (m.emission_texture, Colour),
            ],
        }
    }

    /// The textures among [`Material::slots`].
    pub fn textures(&self) -> impl Iterator<Item = (Texture, TexelEncoding)> + use<C> {
        self.slots().into_iter().filter_map(|(texture, encoding)| Some((texture?, encoding)))
    }

    /// The further textures.
    pub fn further_textures(&self) -> &[FurtherTexture] {
        match self {
            Material::Phong(_) => &[],
            Material::MetallicRoughness(m) => &m.further_textures,
        }
    }

    /// All textures of the material, with those of the normal map and the opacity.
    pub fn textures_mut(&mut self) -> impl Iterator<Item = &mut Texture> {
        let (own, normal_map, opacity, further) = match self {
            Material::Phong(m) => {
                ([m.texture.as_mut(), None, None], &mut m.normal_map, &mut m.opacity, Default::default())
            }
            Material::MetallicRoughness(m) => {
                let own =
                    [&mut m.base_colour_texture, &mut m.metallic_roughness_texture, &mut m.emission_texture];
                (own.map(Option::as_mut), &mut m.normal_map, &mut m.opacity, m.further_textures.iter_mut())
            }
        };
        let normal_map = normal_map.iter_mut().map(|map| &mut map.texture);
        let opacity = opacity.iter_mut().filter_map(|opacity| opacity.texture.as_mut());
        let further = further.map(|further| &mut further.texture);
        own.into_iter().flatten().chain(normal_map).chain(opacity).chain(further)
    }

    /// Whether the material uses any texture.
    pub fn is_textured(&self) -> bool {
        self.textures().next().is_some()
            || self.normal_map().is_some()
            || self.opacity().is_some_and(|opacity| opacity.texture.is_some())
            || !self.further_textures().is_empty()
    }
}
