//! Vertex attributes at points of triangles, from the description alone. The prepared scene (`world`) interpolates by
//! the same functions.

use std::collections::HashMap;
use std::ops::{Add, Mul};

use glam::{DVec2, DVec3, Vec3};

use crate::scene::{Attribute, Mesh, Placement, Scene, Shape};

/// Barycentric interpolation.
#[inline]
pub(crate) fn blend<T: Mul<f64, Output = T> + Add<Output = T>>(
    [a, b, c]: [T; 3],
    barycentrics: [f64; 3],
) -> T {
    a * barycentrics[0] + b * barycentrics[1] + c * barycentrics[2]
}

/// The normalised vector in f32, for any finite length; zero stays zero.
pub(crate) fn unit(n: DVec3) -> Vec3 {
    (n / n.abs().max_element()).try_normalize().unwrap_or(DVec3::ZERO).as_vec3()
}

/// A vertex normal in the world, of length 1 or 0.
pub(crate) fn vertex_normal(normal: DVec3, placement: Option<&Placement>) -> Vec3 {
    let Some(placement) = placement else { return unit(normal) };
    let normal = placement.normal(normal);
    // As in import, a normal that is not finite becomes zero.
    unit(if normal.is_finite() { normal } else { DVec3::ZERO })
}

/// The normal interpolated between those of a triangle's corners, on the side of the triangle's `normal`. `None` where
/// they are zero, or cancel.
#[inline]
pub(crate) fn smooth_normal(corners: [DVec3; 3], barycentrics: [f64; 3], normal: DVec3) -> Option<DVec3> {
    let smooth = blend(corners, barycentrics).try_normalize()?;
    Some(if smooth.dot(normal) < 0.0 { -smooth } else { smooth })
}

/// The values of an attribute of a mesh at the corners of a triangle.
#[inline]
pub(crate) fn of_triangle<T: Copy>(attribute: &Attribute<T>, mesh: &Mesh, triangle: u32) -> [T; 3] {
    let triangles = attribute.triangles.as_ref().unwrap_or(&mesh.triangles);
    triangles[triangle as usize].map(|i| attribute.values[i as usize])
}

impl Shape {
    /// The shading normal at a point of a primitive, whose geometric normal is `normal`: the vertex normals
    /// interpolated, of length 1, on the side of `normal`. It is `normal` itself on an analytic shape, without vertex
    /// normals, and where they cancel. Normal maps are left out.
    pub fn shading_normal(&self, primitive: u32, barycentrics: [f64; 3], normal: DVec3) -> DVec3 {
        let placement = match self {
            Shape::Placed(placed) => Some(&placed.placement),
            Shape::Mesh(_) | Shape::Analytic(_) => None,
        };
        let smooth = || {
            let mesh = self.mesh()?;
            let corners = of_triangle(mesh.normals.as_ref()?, mesh, primitive);
            let corners = corners.map(|corner| vertex_normal(corner, placement).as_dvec3());
            smooth_normal(corners, barycentrics, normal)
        };
        smooth().unwrap_or(normal)
    }

    /// The texture coordinates of a set at a point of a primitive; `None` without them.
    pub fn uv(&self, primitive: u32, barycentrics: [f64; 3], set: u8) -> Option<DVec2> {
        let mesh = self.mesh()?;
        let corners = of_triangle(mesh.uvs.get(usize::from(set))?, mesh, primitive);
        Some(blend(corners.map(|uv| uv.as_vec2().as_dvec2()), barycentrics))
    }

    /// The interpolated vertex opacity at a point of a primitive; 1 without any.
    pub fn alpha(&self, primitive: u32, barycentrics: [f64; 3]) -> f64 {
        let alphas = self.mesh().and_then(|mesh| Some(of_triangle(mesh.alphas.as_ref()?, mesh, primitive)));
        alphas.map_or(1.0, |alphas| blend(alphas.map(|alpha| f64::from(alpha as f32)), barycentrics))
    }
}

impl Scene {
    /// For each object, the number of objects before it that are placements of the same mesh.
    pub fn placement_indices(&self) -> impl Iterator<Item = u32> {
        let mut counts: HashMap<*const Mesh, u32> = HashMap::new();
        self.objects.iter().map(move |object| match &object.shape {
            Shape::Placed(placed) => {
                let count = counts.entry(std::sync::Arc::as_ptr(&placed.mesh)).or_default();
                *count += 1;
                *count - 1
            }
            Shape::Mesh(_) | Shape::Analytic(_) => 0,
        })
    }
}
