//! Materials, textures and decoded images.

pub(crate) mod change;
pub(crate) mod layers;
pub(crate) mod sampler;
pub(crate) mod texels;
pub(crate) mod texture_slot;

use super::{ImageId, Layers, TexelValues, TextureSampler, Textures};
use crate::film::Colour;

/// A material. `C` is [`Colour`] in a scene, and a colour in the numbers of the colour pipeline in a prepared world.
#[derive(Debug, Clone)]
pub enum Material<C = Colour> {
    /// Phong model, of the assignment and of OBJ.
    Phong(Phong<C>),
    /// Metallic-roughness model of glTF.
    MetallicRoughness(MetallicRoughness<C>),
}

/// Phong material: ambient, diffuse and specular terms, all multiplied by the object's colour (the assignment's
/// report).
#[derive(Debug, Clone)]
pub struct Phong<C = Colour> {
    /// Name.
    pub name: String,
    /// The object's own colour.
    pub colour: C,
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
    /// How opaque the surface is; `None` for one that is everywhere opaque.
    pub opacity: Option<Opacity>,
    /// Whether camera rays hit back faces with `--cull` as well.
    pub double_sided: bool,
    /// The textures of colour, normal map and opacity.
    pub textures: Textures,
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
#[derive(Debug, Clone)]
pub struct MetallicRoughness<C = Colour> {
    /// Name.
    pub name: String,
    /// Base colour.
    pub base_colour: C,
    /// 0 for a dielectric, 1 for a metal.
    pub metallic: f64,
    /// 0 for a mirror, 1 for a fully rough surface.
    pub roughness: f64,
    /// Emitted radiance; may exceed 1.
    pub emission: C,
    /// If true, the base colour is output without shading (KHR_materials_unlit).
    pub unlit: bool,
    /// How opaque the surface is; `None` for one that is everywhere opaque.
    pub opacity: Option<Opacity>,
    /// Values of material extensions, which path tracing uses.
    pub layers: Layers<C>,
    /// Whether camera rays hit back faces with `--cull` as well.
    pub double_sided: bool,
    /// The textures.
    pub textures: Textures,
}

/// The opacity of a surface: the part of it that covers what is behind (alpha; Porter and Duff, Compositing Digital
/// Images, SIGGRAPH 1984). It is the product of factor, texture and vertex alpha.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Opacity {
    /// Factor, 0 to 1.
    pub factor: f64,
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
            ambient: 1.0,
            diffuse: 1.0,
            specular: 0.0,
            shininess: 1.0,
            emission: Colour::Linear(glam::DVec3::ZERO),
            glaze: None,
            refraction: None,
            opacity: None,
            double_sided: true,
            textures: Textures::default(),
        }
    }
}

impl Default for MetallicRoughness {
    /// The defaults of glTF 2.0.
    fn default() -> Self {
        MetallicRoughness {
            name: "default".into(),
            base_colour: Colour::Linear(glam::DVec3::ONE),
            metallic: 1.0,
            roughness: 1.0,
            emission: Colour::Linear(glam::DVec3::ZERO),
            unlit: false,
            opacity: None,
            layers: Layers::default(),
            double_sided: true,
            textures: Textures::default(),
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
        let (Colour::Display(emission) | Colour::Linear(emission)) = self.emission();
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
                ambient: m.ambient,
                diffuse: m.diffuse,
                specular: m.specular,
                shininess: m.shininess,
                emission: convert(m.emission),
                glaze: m.glaze,
                refraction: m
                    .refraction
                    .map(|glass| Refraction { ior: glass.ior, filter: convert(glass.filter) }),
                opacity: m.opacity,
                double_sided: m.double_sided,
                textures: m.textures,
            }),
            Material::MetallicRoughness(m) => Material::MetallicRoughness(MetallicRoughness {
                name: m.name,
                base_colour: convert(m.base_colour),
                metallic: m.metallic,
                roughness: m.roughness,
                emission: convert(m.emission),
                unlit: m.unlit,
                opacity: m.opacity,
                layers: m.layers.map_colours(convert),
                double_sided: m.double_sided,
                textures: m.textures,
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

    /// The object's own colour, or the base colour.
    pub fn colour(&self) -> &C {
        match self {
            Material::Phong(m) => &m.colour,
            Material::MetallicRoughness(m) => &m.base_colour,
        }
    }

    /// The emitted radiance without texture.
    pub fn emission(&self) -> &C {
        match self {
            Material::Phong(m) => &m.emission,
            Material::MetallicRoughness(m) => &m.emission,
        }
    }

    /// Mirror reflection blended over the surface.
    pub fn glaze(&self) -> Option<&Glaze> {
        match self {
            Material::Phong(m) => m.glaze.as_ref(),
            Material::MetallicRoughness(_) => None,
        }
    }

    /// Whether back faces may be culled. Those of glass bound a volume and may not.
    pub fn is_single_sided(&self) -> bool {
        match self {
            Material::Phong(m) => !m.double_sided && m.refraction.is_none(),
            Material::MetallicRoughness(m) => !m.double_sided && m.layers.transmission == 0.0,
        }
    }

    /// Opacity; `None` where the surface is opaque.
    pub fn opacity(&self) -> Option<&Opacity> {
        match self {
            Material::Phong(m) => m.opacity.as_ref(),
            Material::MetallicRoughness(m) => m.opacity.as_ref(),
        }
    }

    /// The textures.
    #[inline]
    pub fn textures(&self) -> &Textures {
        match self {
            Material::Phong(m) => &m.textures,
            Material::MetallicRoughness(m) => &m.textures,
        }
    }

    /// The textures, to be changed.
    pub fn textures_mut(&mut self) -> &mut Textures {
        match self {
            Material::Phong(m) => &mut m.textures,
            Material::MetallicRoughness(m) => &mut m.textures,
        }
    }

    /// Whether the material uses any texture.
    pub fn is_textured(&self) -> bool {
        self.textures().iter().next().is_some()
    }
}
