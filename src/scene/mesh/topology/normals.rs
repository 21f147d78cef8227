//! Triangles that are wound against their vertex normals.

use rayon::prelude::*;

use crate::bvh::Triangle;
use crate::scene::Mesh;
use crate::scene::mesh::topology::{Findings, Location};

/// Triangles whose geometric normal opposes the normals of at least two of their corners.
pub(super) fn opposed(mesh: &Mesh) -> Findings {
    let Some(normals) = &mesh.normals else { return Findings::default() };
    let indices = normals.triangles.as_ref().unwrap_or(&mesh.triangles);
    let is_opposed = |triangle: &usize| {
        let corners = mesh.front(mesh.triangles[*triangle]).map(|i| mesh.positions[i as usize]);
        let geometric = Triangle(corners).normal();
        let of_corners = indices[*triangle].map(|i| normals.values[i as usize]);
        of_corners.into_iter().filter(|normal| normal.dot(geometric) < 0.0).count() >= 2
    };
    let opposed = || (0..mesh.triangles.len()).into_par_iter().filter(is_opposed);
    let first = opposed().find_first(|_| true).map(|triangle| Location {
        object: 0,
        triangle: triangle as u32,
        position: mesh.triangles[triangle].map(|i| mesh.positions[i as usize] / 3.0).into_iter().sum(),
    });
    Findings { count: opposed().count(), first }
}
