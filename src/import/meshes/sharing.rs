//! Selects the meshes that are instanced; others are baked.
//!
//! The rendered picture is the same either way: baked copies trace faster, instances take less memory.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::scene::{Mesh, Object, Scene, Shape};

/// Minimum number of triangles saved for a mesh to be instanced. Below it, baking costs less than 80 MB of peak memory,
/// at 305 bytes per triangle, and instances render slower. Measurements: docs/decisions.md.
const MIN_SAVED_TRIANGLES: usize = 1 << 18;

/// Groups the placed objects by shared mesh: index of the first object to indices of all.
pub fn shared(objects: &[Object]) -> BTreeMap<usize, Vec<usize>> {
    let mut first_of = std::collections::HashMap::new();
    let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (index, object) in objects.iter().enumerate() {
        if let Shape::Placed(placed) = &object.shape {
            let first: usize = *first_of.entry(Arc::as_ptr(&placed.mesh)).or_insert(index);
            groups.entry(first).or_default().push(index);
        }
    }
    groups
}

/// Bakes the placed meshes that are too small to be instanced.
pub(crate) fn bake_small(scene: &mut Scene) {
    let mut small: Vec<*const Mesh> = Vec::new();
    for (first, group) in shared(&scene.objects) {
        if let Shape::Placed(placed) = &scene.objects[first].shape
            && (group.len() - 1) * placed.mesh.triangles.len() < MIN_SAVED_TRIANGLES
        {
            small.push(Arc::as_ptr(&placed.mesh));
        }
    }
    // Pointers identify meshes, because each lives until its last placement is baked.
    let small: std::collections::HashSet<*const Mesh> = small.into_iter().collect();
    scene.bake(|placed| small.contains(&Arc::as_ptr(&placed.mesh)));
}
