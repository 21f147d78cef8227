//! Attributes, materials and pictures in the form that shading reads.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DVec2, DVec3, DVec4, Vec2, Vec3, Vec4};

use super::image::Meaning;
use crate::film::{Colour, ColourPipeline};
use crate::scene::{Attribute, Glaze, Material, Mesh, NormalMap, Placed, Sampler, Shape, Texture};

/// What is interpolated across the triangles of an object; nothing for a sphere. Triangles are counted within the object.
pub struct Attributes {
    lowered: Arc<Lowered>,
    /// Where a shared mesh stands. Its normals are carried there as they are asked for.
    placed: Option<Placed>,
}

/// Values in the numbers that they are kept in.
#[derive(Default)]
struct Lowered {
    normals: Option<Corners<Vec3>>,
    uvs: Option<Corners<Vec2>>,
    colours: Option<Corners<Vec3>>,
    /// Only where the material has a normal map.
    tangents: Option<Corners<Vec4>>,
}

/// Values at the corners of triangles.
struct Corners<T> {
    values: Vec<T>,
    triangles: Arc<[[u32; 3]]>,
}

impl<T: Copy> Corners<T> {
    /// The values at the three corners of a triangle.
    #[inline]
    fn of(&self, triangle: u32) -> [T; 3] {
        self.triangles[triangle as usize].map(|i| self.values[i as usize])
    }
}

impl Attributes {
    /// Whether there are normals.
    pub fn is_smooth(&self) -> bool {
        match &self.placed {
            None => self.lowered.normals.is_some(),
            Some(placed) => placed.mesh.normals.is_some(),
        }
    }

    /// Whether there are tangents.
    pub fn has_tangents(&self) -> bool {
        match &self.placed {
            None => self.lowered.tangents.is_some(),
            Some(placed) => placed.mesh.tangents.is_some(),
        }
    }

    /// The normals at a triangle's corners, of length 1 or 0.
    #[inline]
    pub fn normals(&self, triangle: u32) -> Option<[DVec3; 3]> {
        match &self.placed {
            None => Some(self.lowered.normals.as_ref()?.of(triangle).map(|n| n.as_dvec3())),
            Some(placed) => {
                let normals = placed.mesh.normals.as_ref()?;
                let triangles = normals.triangles.as_ref().unwrap_or(&placed.mesh.triangles);
                let corners = triangles[triangle as usize];
                Some(corners.map(|i| {
                    let normal = placed.placement.normal(normals.values[i as usize]);
                    // As where data comes in: what is not a number is none.
                    unit(if normal.is_finite() { normal } else { DVec3::ZERO }).as_dvec3()
                }))
            }
        }
    }

    /// The texture coordinates at a triangle's corners.
    #[inline]
    pub fn uvs(&self, triangle: u32) -> Option<[Vec2; 3]> {
        Some(self.lowered.uvs.as_ref()?.of(triangle))
    }

    /// The tangents at a triangle's corners, of length 1 or 0; see [`Mesh::tangents`].
    #[inline]
    pub fn tangents(&self, triangle: u32) -> Option<[DVec4; 3]> {
        match &self.placed {
            None => Some(self.lowered.tangents.as_ref()?.of(triangle).map(|t| t.as_dvec4())),
            Some(placed) => {
                let tangents = placed.mesh.tangents.as_ref()?;
                let triangles = tangents.triangles.as_ref().unwrap_or(&placed.mesh.triangles);
                let corners = triangles[triangle as usize];
                Some(
                    corners.map(|i| {
                        unit_tangent(placed.placement.tangent(tangents.values[i as usize])).as_dvec4()
                    }),
                )
            }
        }
    }

    /// Whether there is nothing to interpolate.
    pub fn are_none(&self) -> bool {
        let Lowered { normals, uvs, colours, .. } = &*self.lowered;
        let placed = self.placed.as_ref().is_some_and(|placed| placed.mesh.normals.is_some());
        normals.is_none() && uvs.is_none() && colours.is_none() && !placed
    }

    /// The colours at a triangle's corners.
    #[inline]
    pub fn colours(&self, triangle: u32) -> Option<[Vec3; 3]> {
        Some(self.lowered.colours.as_ref()?.of(triangle))
    }
}

/// A normal of any length that f64 holds becomes one that f32 holds; zero stays zero.
fn unit(n: DVec3) -> Vec3 {
    (n / n.abs().max_element()).try_normalize().unwrap_or(DVec3::ZERO).as_vec3()
}

/// A tangent of any length that f64 holds becomes one that f32 holds; what is not a number becomes zero.
fn unit_tangent(t: DVec4) -> Vec4 {
    let along = t.truncate();
    unit(if along.is_finite() { along } else { DVec3::ZERO }).extend(if t.w < 0.0 { -1.0 } else { 1.0 })
}

/// What shared meshes have become, once each.
#[derive(Default)]
pub struct Shared(HashMap<*const Mesh, Arc<Lowered>>);

impl Shared {
    /// Takes the attributes out of a shape. Tangents are left where no normal map needs them.
    pub fn attributes(&mut self, shape: Shape, has_normal_map: bool) -> Attributes {
        match shape {
            Shape::Sphere { .. } => Attributes { lowered: Arc::default(), placed: None },
            Shape::Mesh(mut mesh) => {
                let (normals, tangents) = (mesh.normals.take(), mesh.tangents.take());
                let own: Arc<[[u32; 3]]> = std::mem::take(&mut mesh.triangles).into();
                let mut lowered = lower(mesh.uvs, mesh.colours, &own);
                lowered.normals = normals.map(|a| corners(a, &own, unit));
                lowered.tangents =
                    tangents.filter(|_| has_normal_map).map(|a| corners(a, &own, unit_tangent));
                Attributes { lowered: Arc::new(lowered), placed: None }
            }
            Shape::Placed(placed) => {
                // The mesh is kept, so no other can be taken for it.
                let lowered = self.0.entry(Arc::as_ptr(&placed.mesh)).or_insert_with(|| {
                    let Mesh { uvs, colours, triangles, .. } = &*placed.mesh;
                    let is_kept = uvs.is_some() || colours.is_some();
                    let own: Arc<[[u32; 3]]> =
                        if is_kept { triangles.clone().into() } else { Arc::default() };
                    Arc::new(lower(uvs.clone(), colours.clone(), &own))
                });
                Attributes { lowered: lowered.clone(), placed: Some(placed) }
            }
        }
    }
}

fn corners<A, B>(a: Attribute<A>, own: &Arc<[[u32; 3]]>, lower: impl Fn(A) -> B) -> Corners<B> {
    let triangles = a.triangles.map_or_else(|| own.clone(), Arc::from);
    Corners { values: a.values.into_iter().map(lower).collect(), triangles }
}

fn lower(uvs: Option<Attribute<DVec2>>, colours: Option<Attribute<DVec3>>, own: &Arc<[[u32; 3]]>) -> Lowered {
    Lowered {
        normals: None,
        tangents: None,
        uvs: uvs.map(|a| corners(a, own, |uv| uv.as_vec2())),
        colours: colours.map(|a| corners(a, own, |c| c.as_vec3())),
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
    /// What tilts its normals.
    pub normal_map: Option<LoweredNormalMap>,
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
    /// What tilts its normals.
    pub normal_map: Option<LoweredNormalMap>,
}

/// A picture and how to look it up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoweredTexture {
    /// Index of the picture.
    pub image: u32,
    /// What happens outside 0..1.
    pub sampler: Sampler,
}

/// A picture that tilts normals; see [`crate::scene::NormalMap`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoweredNormalMap {
    /// The picture.
    pub texture: LoweredTexture,
    /// What x and y are multiplied by.
    pub scale: f64,
}

fn normal_map(map: Option<NormalMap>) -> Option<LoweredNormalMap> {
    map.and_then(|map| Some(LoweredNormalMap { texture: texture(Some(map.texture))?, scale: map.scale }))
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
            normal_map: normal_map(m.normal_map),
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
            normal_map: normal_map(m.normal_map),
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

    /// The pictures of its colour, its roughness and metallic, and its emission, and what their values mean.
    pub fn slots(&self) -> [(Option<LoweredTexture>, Meaning); 3] {
        use Meaning::{Colours, Numbers};
        match self {
            LoweredMaterial::Phong(m) => [(m.texture, Colours), (None, Numbers), (None, Colours)],
            LoweredMaterial::MetallicRoughness(m) => [
                (m.base_colour_texture, Colours),
                (m.metallic_roughness_texture, Numbers),
                (m.emission_texture, Colours),
            ],
        }
    }

    /// Those of them that there are.
    pub fn textures(&self) -> impl Iterator<Item = (LoweredTexture, Meaning)> + use<> {
        self.slots().into_iter().filter_map(|(texture, meaning)| Some((texture?, meaning)))
    }

    /// What tilts its normals.
    pub fn normal_map(&self) -> Option<&LoweredNormalMap> {
        match self {
            LoweredMaterial::Phong(m) => m.normal_map.as_ref(),
            LoweredMaterial::MetallicRoughness(m) => m.normal_map.as_ref(),
        }
    }
}

/// The vertex colours of glTF and OBJ are linear light; in display pipelines they are encoded like any colour.
pub fn vertex_colour(linear: DVec3, pipeline: ColourPipeline) -> DVec3 {
    Colour::Linear(linear).lower(pipeline)
}
