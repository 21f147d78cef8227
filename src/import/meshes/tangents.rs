//! Tangents for normal maps by MikkTSpace (Mikkelsen, Simulation of Wrinkled Surfaces Revisited, 2008), for files
//! without tangents. Normal map bakers use the same algorithm.

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{DVec3, DVec4};

use crate::scene::{Attribute, Mesh};

/// Computes missing tangents of a mesh with a normal map on one of its sets of texture coordinates; does nothing without
/// that set. A mesh without normals gets those of its triangles, which define the side that the map applies to.
pub(crate) fn make_tangents(mesh: &mut Mesh, set: u8) {
    if mesh.uvs.len() <= usize::from(set) || mesh.triangles.is_empty() {
        return;
    }
    if mesh.normals.is_none() {
        mesh.normals = Some(normals_of_triangles(mesh));
    }
    if mesh.tangents.is_some() {
        return;
    }
    let mut corners = Corners {
        mesh,
        set: set.into(),
        origin: mesh.positions[mesh.triangles[0][0] as usize],
        made: Vec::new(),
    };
    corners.made.resize(mesh.triangles.len(), [DVec4::ZERO; 3]);
    // `generate_tangents` has no failure today; if it fails, the mesh gets no tangents.
    if generate_tangents(&mut corners).is_ok() {
        let values = corners.made.into_flattened();
        let triangles = (0..mesh.triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        mesh.tangents = Some(Attribute { values, triangles: Some(triangles) });
    }
}

/// Geometric normals of triangles, towards their front sides.
pub(crate) fn normals_of_triangles(mesh: &Mesh) -> Attribute<DVec3> {
    let normal = |t: &[u32; 3]| {
        let [a, b, c] = mesh.front(*t).map(|i| mesh.positions[i as usize]);
        (b - a).cross(c - a).normalize_or_zero()
    };
    let triangles = (0..mesh.triangles.len() as u32).map(|i| [i; 3]).collect();
    Attribute { values: mesh.triangles.iter().map(normal).collect(), triangles: Some(triangles) }
}

/// Adapter of a mesh to MikkTSpace.
struct Corners<'a> {
    mesh: &'a Mesh,
    /// The index of the texture coordinates.
    set: usize,
    /// Subtracted from all positions, which may be too far from the origin for f32.
    origin: DVec3,
    made: Vec<[DVec4; 3]>,
}

impl Corners<'_> {
    fn of<T: Copy>(&self, attribute: Option<&Attribute<T>>, face: usize, corner: usize) -> Option<T> {
        let attribute = attribute?;
        let triangles = attribute.triangles.as_ref().unwrap_or(&self.mesh.triangles);
        Some(attribute.values[triangles[face][corner] as usize])
    }
}

impl Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.mesh.triangles.len()
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        let position = self.mesh.positions[self.mesh.triangles[face][corner] as usize];
        (position - self.origin).as_vec3().to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        let normal = self.of(self.mesh.normals.as_ref(), face, corner).unwrap_or_default();
        normal.normalize_or_zero().as_vec3().to_array()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        let uv = self.of(self.mesh.uvs.get(self.set), face, corner).unwrap_or_default();
        // v points up in MikkTSpace and down in glTF and in [`Mesh`].
        [uv.x as f32, (1.0 - uv.y) as f32]
    }

    fn set_tangent(&mut self, tangent: Option<TangentSpace>, face: usize, corner: usize) {
        if let Some(tangent) = tangent {
            self.made[face][corner] = DVec4::from(tangent.tangent_encoded().map(f64::from));
        }
    }
}
