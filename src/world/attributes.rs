//! Vertex attributes: normals, texture coordinates, colours and tangents, interpolated across triangles.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DVec2, DVec3, DVec4, Vec2, Vec3, Vec4};

use crate::film::{Colour, ColourPipeline};
use crate::scene::mesh::vertex_attributes::{of_triangle, unit, vertex_normal};
use crate::scene::{Attribute, Mesh, Placed, Shape};

/// The vertex attributes of an object; none for an analytic shape. Triangles are numbered within the object.
pub(crate) struct Attributes {
    arrays: Arc<AttributeArrays>,
    /// For an instance of a shared mesh, its placement. Normals and tangents are transformed when they are read.
    placed: Option<Placed>,
}

/// The attributes in the precision they are stored in.
#[derive(Default)]
struct AttributeArrays {
    normals: Option<Corners<Vec3>>,
    uvs: Vec<Corners<Vec2>>,
    colours: Option<Corners<Vec3>>,
    alphas: Option<Corners<f32>>,
    /// Only for materials with a normal map.
    tangents: Option<Corners<Vec4>>,
}

/// An attribute with its own indices.
struct Corners<T> {
    values: Vec<T>,
    triangles: Arc<[[u32; 3]]>,
}

impl<T: Copy> Corners<T> {
    /// The values at the three corners of a triangle.
    // Without `array::map`, which is not always inlined.
    #[inline]
    fn of(&self, triangle: u32) -> [T; 3] {
        let [a, b, c] = self.triangles[triangle as usize];
        [self.values[a as usize], self.values[b as usize], self.values[c as usize]]
    }
}

impl Attributes {
    /// Whether there are vertex normals.
    pub(crate) fn is_smooth(&self) -> bool {
        match &self.placed {
            None => self.arrays.normals.is_some(),
            Some(placed) => placed.mesh.normals.is_some(),
        }
    }

    /// Whether there are tangents.
    pub(crate) fn has_tangents(&self) -> bool {
        match &self.placed {
            None => self.arrays.tangents.is_some(),
            Some(placed) => placed.mesh.tangents.is_some(),
        }
    }

    /// The normals at a triangle's corners, of length 1 or 0. `None` without vertex normals.
    #[inline]
    pub(crate) fn normals(&self, triangle: u32) -> Option<[DVec3; 3]> {
        match &self.placed {
            None => Some(self.arrays.normals.as_ref()?.of(triangle).map(|n| n.as_dvec3())),
            Some(placed) => {
                let normals = of_triangle(placed.mesh.normals.as_ref()?, &placed.mesh, triangle);
                Some(normals.map(|normal| vertex_normal(normal, Some(&placed.placement)).as_dvec3()))
            }
        }
    }

    /// The texture coordinates at a triangle's corners, of the set with this index.
    #[inline]
    pub(crate) fn uvs(&self, triangle: u32, set: u8) -> Option<[Vec2; 3]> {
        Some(self.arrays.uvs.get(usize::from(set))?.of(triangle))
    }

    /// The opacities at a triangle's corners.
    #[inline]
    pub(crate) fn alphas(&self, triangle: u32) -> Option<[f32; 3]> {
        Some(self.arrays.alphas.as_ref()?.of(triangle))
    }

    /// The tangents at a triangle's corners, of length 1 or 0; see [`Mesh::tangents`].
    #[inline]
    pub(crate) fn tangents(&self, triangle: u32) -> Option<[DVec4; 3]> {
        match &self.placed {
            None => Some(self.arrays.tangents.as_ref()?.of(triangle).map(|t| t.as_dvec4())),
            Some(placed) => {
                let tangents = of_triangle(placed.mesh.tangents.as_ref()?, &placed.mesh, triangle);
                Some(tangents.map(|tangent| unit_tangent(placed.placement.tangent(tangent)).as_dvec4()))
            }
        }
    }

    /// Whether there are vertex opacities.
    pub(crate) fn has_alphas(&self) -> bool {
        self.arrays.alphas.is_some()
    }

    /// Whether there is nothing to interpolate.
    pub(crate) fn are_none(&self) -> bool {
        let AttributeArrays { normals, uvs, colours, .. } = &*self.arrays;
        let placed = self.placed.as_ref().is_some_and(|placed| placed.mesh.normals.is_some());
        normals.is_none() && uvs.is_empty() && colours.is_none() && !placed
    }

    /// The colours at a triangle's corners.
    #[inline]
    pub(crate) fn colours(&self, triangle: u32) -> Option<[Vec3; 3]> {
        Some(self.arrays.colours.as_ref()?.of(triangle))
    }
}

/// The tangent with its direction normalised, in f32, and its handedness w as 1 or -1. A direction that is not finite
/// becomes zero.
fn unit_tangent(t: DVec4) -> Vec4 {
    let along = t.truncate();
    unit(if along.is_finite() { along } else { DVec3::ZERO }).extend(if t.w < 0.0 { -1.0 } else { 1.0 })
}

/// The attributes of shared meshes, converted once per mesh.
#[derive(Default)]
pub(crate) struct SharedAttributes(HashMap<*const Mesh, Arc<AttributeArrays>>);

impl SharedAttributes {
    /// Converts the attributes of a shape. Tangents are dropped where the material needs none.
    pub(crate) fn attributes(&mut self, shape: Shape, needs_tangents: bool) -> Attributes {
        match shape {
            Shape::Analytic(_) => Attributes { arrays: Arc::default(), placed: None },
            Shape::Mesh(mut mesh) => {
                let (normals, tangents) = (mesh.normals.take(), mesh.tangents.take());
                let own: Arc<[[u32; 3]]> = std::mem::take(&mut mesh.triangles).into();
                let mut arrays = without_normals(mesh.uvs, mesh.colours, mesh.alphas, &own);
                arrays.normals = normals.map(|a| corners(a, &own, unit));
                arrays.tangents = tangents.filter(|_| needs_tangents).map(|a| corners(a, &own, unit_tangent));
                Attributes { arrays: Arc::new(arrays), placed: None }
            }
            Shape::Placed(placed) => {
                // `placed` keeps the mesh alive, so its address is not reused.
                let arrays = self.0.entry(Arc::as_ptr(&placed.mesh)).or_insert_with(|| {
                    let Mesh { uvs, colours, alphas, triangles, .. } = &*placed.mesh;
                    let is_kept = !uvs.is_empty() || colours.is_some() || alphas.is_some();
                    let own: Arc<[[u32; 3]]> =
                        if is_kept { triangles.clone().into() } else { Arc::default() };
                    Arc::new(without_normals(uvs.clone(), colours.clone(), alphas.clone(), &own))
                });
                Attributes { arrays: arrays.clone(), placed: Some(placed) }
            }
        }
    }
}

/// Converts an attribute; `own` are the mesh's triangles, for an attribute without indices.
fn corners<A, B>(a: Attribute<A>, own: &Arc<[[u32; 3]]>, convert: impl Fn(A) -> B) -> Corners<B> {
    let triangles = a.triangles.map_or_else(|| own.clone(), Arc::from);
    Corners { values: a.values.into_iter().map(convert).collect(), triangles }
}

fn without_normals(
    uvs: Vec<Attribute<DVec2>>,
    colours: Option<Attribute<DVec3>>,
    alphas: Option<Attribute<f64>>,
    own: &Arc<[[u32; 3]]>,
) -> AttributeArrays {
    AttributeArrays {
        uvs: uvs.into_iter().map(|a| corners(a, own, |uv| uv.as_vec2())).collect(),
        colours: colours.map(|a| corners(a, own, |c| c.as_vec3())),
        alphas: alphas.map(|a| corners(a, own, |alpha| alpha as f32)),
        ..AttributeArrays::default()
    }
}

/// A vertex colour in the numbers of `pipeline`. Vertex colours of glTF and OBJ are linear; the display pipelines
/// encode them.
pub(crate) fn vertex_colour(linear: DVec3, pipeline: ColourPipeline) -> DVec3 {
    Colour::Linear(linear).to_pipeline(pipeline)
}
