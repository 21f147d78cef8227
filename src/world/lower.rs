//! Attributes, materials and pictures in the form that shading reads.

use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};

use crate::film::colour::srgb_decode;
use crate::film::{Colour, ColourPipeline};
use crate::scene::{Attribute, Glaze, Material, Mesh, Sampler, Shape, Texture, TextureImage};

/// What is interpolated across the triangles of an object; nothing for a sphere.
#[derive(Default)]
pub struct Attributes {
    pub normals: Option<Corners<Vec3>>,
    pub uvs: Option<Corners<Vec2>>,
    pub colours: Option<Corners<Vec3>>,
}

/// Values at the corners of triangles.
pub struct Corners<T> {
    values: Vec<T>,
    triangles: Arc<[[u32; 3]]>,
}

impl<T: Copy> Corners<T> {
    /// The values at the three corners of a triangle, counted within the object.
    #[inline]
    pub fn of(&self, triangle: u32) -> [T; 3] {
        self.triangles[triangle as usize].map(|i| self.values[i as usize])
    }
}

/// Takes the attributes out of a shape.
pub fn attributes(shape: Shape) -> Attributes {
    let Shape::Mesh(Mesh { triangles, normals, uvs, colours, .. }) = shape else {
        return Attributes::default();
    };
    let own: Arc<[[u32; 3]]> = triangles.into();
    fn corners<A, B>(a: Attribute<A>, own: &Arc<[[u32; 3]]>, lower: impl Fn(A) -> B) -> Corners<B> {
        let triangles = a.triangles.map_or_else(|| own.clone(), Arc::from);
        Corners { values: a.values.into_iter().map(lower).collect(), triangles }
    }
    // A normal of any length that f64 holds becomes one that f32 holds; zero stays zero.
    let unit = |n: DVec3| (n / n.abs().max_element()).try_normalize().unwrap_or(DVec3::ZERO).as_vec3();
    Attributes {
        normals: normals.map(|a| corners(a, &own, unit)),
        uvs: uvs.map(|a| corners(a, &own, |uv| uv.as_vec2())),
        colours: colours.map(|a| corners(a, &own, |c| c.as_vec3())),
    }
}

/// A material in the numbers of a colour pipeline.
#[derive(Debug, Clone)]
pub enum LoweredMaterial {
    /// Phong's model.
    Phong(PhongValues),
    /// glTF's model.
    MetallicRoughness(MetallicRoughnessValues),
}

/// Numbers of a Phong material; see [`crate::scene::Phong`].
#[derive(Debug, Clone)]
pub struct PhongValues {
    /// Own colour.
    pub colour: DVec3,
    /// Picture that multiplies it.
    pub texture: Option<LoweredTexture>,
    /// k_a.
    pub ambient: f64,
    /// k_d.
    pub diffuse: f64,
    /// k_s.
    pub specular: f64,
    /// n.
    pub shininess: f64,
    /// The mirror over the surface.
    pub glaze: Option<Glaze>,
}

/// Numbers of a metallic-roughness material; see [`crate::scene::MetallicRoughness`].
#[derive(Debug, Clone)]
pub struct MetallicRoughnessValues {
    /// Base colour.
    pub base_colour: DVec3,
    /// Picture that multiplies it.
    pub base_colour_texture: Option<LoweredTexture>,
    /// 0 for a dielectric, 1 for a metal.
    pub metallic: f64,
    /// 0 for a mirror, 1 for fully rough.
    pub roughness: f64,
    /// Picture whose green multiplies the roughness and whose blue multiplies the metallic.
    pub metallic_roughness_texture: Option<LoweredTexture>,
    /// Light given off.
    pub emission: DVec3,
    /// Picture that multiplies it.
    pub emission_texture: Option<LoweredTexture>,
    /// The base colour is all there is to see.
    pub unlit: bool,
}

/// A picture and how to look it up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoweredTexture {
    /// Index of the picture.
    pub image: u32,
    /// What happens outside 0..1.
    pub sampler: Sampler,
}

fn texture(texture: Option<Texture>) -> Option<LoweredTexture> {
    texture.map(|t| LoweredTexture { image: t.image.0, sampler: t.sampler })
}

/// A material's colours in the numbers of `pipeline`.
pub fn material(material: &Material, pipeline: ColourPipeline) -> LoweredMaterial {
    match material {
        Material::Phong(m) => LoweredMaterial::Phong(PhongValues {
            colour: m.colour.lower(pipeline),
            texture: texture(m.texture),
            ambient: m.ambient,
            diffuse: m.diffuse,
            specular: m.specular,
            shininess: m.shininess,
            glaze: m.glaze,
        }),
        Material::MetallicRoughness(m) => LoweredMaterial::MetallicRoughness(MetallicRoughnessValues {
            base_colour: m.base_colour.lower(pipeline),
            base_colour_texture: texture(m.base_colour_texture),
            metallic: m.metallic,
            roughness: m.roughness,
            metallic_roughness_texture: texture(m.metallic_roughness_texture),
            emission: m.emission.lower(pipeline),
            emission_texture: texture(m.emission_texture),
            unlit: m.unlit,
        }),
    }
}

impl LoweredMaterial {
    /// The mirror over the surface, if it has one.
    pub fn glaze(&self) -> Option<&Glaze> {
        match self {
            LoweredMaterial::Phong(m) => m.glaze.as_ref(),
            LoweredMaterial::MetallicRoughness(_) => None,
        }
    }

    /// Whether shading it looks anything up by texture coordinates.
    pub fn is_textured(&self) -> bool {
        match self {
            LoweredMaterial::Phong(m) => m.texture.is_some(),
            LoweredMaterial::MetallicRoughness(m) => {
                m.base_colour_texture.or(m.metallic_roughness_texture).or(m.emission_texture).is_some()
            }
        }
    }
}

/// A picture with what its 8-bit values mean as colours.
pub struct Image {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Pixels, row by row from the top.
    pub pixels: Arc<[[u8; 3]]>,
    /// The pipeline's number for each 8-bit display value.
    pub colours: [f32; 256],
}

impl Image {
    pub(super) fn new(image: TextureImage, pipeline: ColourPipeline) -> Self {
        let colour = |value: usize| {
            let display = value as f64 / 255.0;
            if pipeline == ColourPipeline::Linear { srgb_decode(display) as f32 } else { display as f32 }
        };
        Image {
            width: image.width,
            height: image.height,
            pixels: image.pixels,
            colours: std::array::from_fn(colour),
        }
    }
}

/// The vertex colours of glTF and OBJ are linear light; in display pipelines they are encoded like any colour.
pub fn vertex_colour(linear: DVec3, pipeline: ColourPipeline) -> DVec3 {
    Colour::Linear(linear).lower(pipeline)
}
