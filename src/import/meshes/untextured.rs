//! Faces without texture coordinates in meshes of textured materials.

use glam::DVec2;

use crate::scene::Mesh;

/// Placeholder for missing texture coordinates of a corner.
pub(crate) const NO_UV: DVec2 = DVec2::NAN;

/// Splits off the triangles that lack texture coordinates at a corner, as a mesh without texture coordinates, which is
/// drawn in the colour of its material. `None` if there are none.
pub(crate) fn split_off(mesh: &mut Mesh) -> Option<Mesh> {
    let uvs = mesh.uvs.first()?;
    let indices = uvs.triangles.as_ref().unwrap_or(&mesh.triangles);
    let has_uvs = |triangle: &[u32; 3]| triangle.iter().all(|&i| !uvs.values[i as usize].is_nan());
    let has_uvs: Vec<bool> = indices.iter().map(has_uvs).collect();
    if has_uvs.iter().all(|&has| has) {
        return None;
    }
    let mut without = mesh.clone();
    without.retain(|i| !has_uvs[i]);
    without.uvs.clear();
    mesh.retain(|i| has_uvs[i]);
    fill(mesh);
    Some(without)
}

/// Replaces missing texture coordinates by the lower left corner of the image. No textured triangle uses them.
pub(crate) fn fill(mesh: &mut Mesh) {
    let values = mesh.uvs.iter_mut().flat_map(|uvs| &mut uvs.values);
    values.filter(|uv| uv.is_nan()).for_each(|uv| *uv = DVec2::Y);
}
