//! [`MeshBvh`]: the tree over an instanced mesh, in the space of the mesh.

use std::sync::Arc;

use glam::DVec3;

use super::transform::{MeshSpace, Transform};
use crate::bvh::Preset;
use crate::bvh::build::build_over;
use crate::bvh::wide::{Content, Tree};
use crate::geometry::lanes::LANES4;
use crate::geometry::{Bounds, Corner, Mesh};

/// A mesh and the tree over it, in [`MeshSpace`].
pub(crate) struct MeshBvh {
    /// The mesh.
    pub mesh: Arc<Mesh>,
    /// The space of the tree.
    pub space: MeshSpace,
    /// The tree; the order of its leaves is that of `triangles`.
    pub tree: Tree,
    /// The triangles in the order of the leaves: index in the mesh, and vertex indices.
    pub triangles: Vec<(u32, [u32; 3])>,
}

impl MeshBvh {
    /// Builds the tree.
    ///
    /// # Panics
    /// If the mesh has no [`MeshSpace`].
    pub(crate) fn new(mesh: Arc<Mesh>, preset: Preset) -> Self {
        let space = MeshSpace::of(&mesh).expect("a mesh that can be an instance");
        let bounds = |triangle: &[u32; 3]| {
            let [min, max] = DVec3::span(&triangle.map(|i| space.point(mesh.positions[i as usize])));
            Bounds::rounded_out(min, max)
        };
        let boxes: Vec<Bounds> = mesh.triangles.iter().map(bounds).collect();
        let (tree, order) = build_over(&boxes, preset, LANES4);
        let triangles = order.into_iter().map(|i| (i, mesh.triangles[i as usize])).collect();
        MeshBvh { mesh, space, tree, triangles }
    }

    /// Bounds of the instance in world space, for corners rounded or not: of the at most 64 children of the root's
    /// children, each transformed by itself.
    pub(crate) fn in_world(&self, transform: &Transform) -> Bounds {
        let nodes = &self.tree.nodes;
        let [min, max] = nodes[0]
            .places()
            .flat_map(|place| match nodes[0].children[place].content() {
                Content::Node(index) => {
                    let node = &nodes[index as usize];
                    node.places().map(|place| node.bounds(place)).collect()
                }
                _ => vec![nodes[0].bounds(place)],
            })
            .map(|b| transform.in_world(b.min.as_dvec3(), b.max.as_dvec3()))
            .reduce(|[min, max], [least, greatest]| [min.min(least), max.max(greatest)])
            .unwrap_or([DVec3::INFINITY, DVec3::NEG_INFINITY]);
        Bounds::of_triangles([min, max], min.abs().max(max.abs()).max_element())
    }

    /// Its size in bytes, with the vertex positions of the mesh.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.tree.nodes.as_slice())
            + size_of_val(self.triangles.as_slice())
            + size_of_val(self.mesh.positions.as_slice())
    }
}
