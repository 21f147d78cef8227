//! [`MeshBvh`]: the tree over an instanced mesh, in the space of the mesh.

use std::sync::Arc;

use glam::DVec3;
use obvhs::bvh2::node::Bvh2Node;

use super::transform::{MeshSpace, Transform};
use crate::bvh::Preset;
use crate::bvh::build::build_nodes;
use crate::geometry::Mesh;
use crate::geometry::{Bounds, Corner};

/// A mesh and the binary tree over it, in [`MeshSpace`].
pub(crate) struct MeshBvh {
    /// The mesh.
    pub mesh: Arc<Mesh>,
    /// The nodes of the tree.
    pub nodes: Vec<Bvh2Node>,
    /// The triangles in the order of the leaves: index in the mesh, and vertex indices.
    pub triangles: Vec<(u32, [u32; 3])>,
}

/// The number of nodes whose transformed boxes bound an instance.
const BOUNDING_NODES: usize = 64;

impl MeshBvh {
    /// Builds the tree.
    pub(crate) fn new(mesh: Arc<Mesh>, space: &MeshSpace, preset: Preset) -> Self {
        let bounds = |triangle: &[u32; 3]| {
            let [min, max] = DVec3::span(&triangle.map(|i| space.point(mesh.positions[i as usize])));
            Bounds::rounded_out(min, max)
        };
        let boxes: Vec<Bounds> = mesh.triangles.iter().map(bounds).collect();
        let (nodes, order) = build_nodes(&boxes, preset.parameters());
        let triangles = order.into_iter().map(|i| (i, mesh.triangles[i as usize])).collect();
        MeshBvh { mesh, nodes, triangles }
    }

    /// Bounds of the instance in world space, for corners rounded or not.
    pub(crate) fn in_world(&self, transform: &Transform) -> Bounds {
        let mut open = vec![0];
        let mut next = 0;
        while next < open.len() && open.len() < BOUNDING_NODES {
            let node = &self.nodes[open[next]];
            if node.is_leaf() {
                next += 1;
            } else {
                open[next] = node.first_index as usize;
                open.push(open[next] + 1);
            }
        }
        let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let [min, max] = open.into_iter().fold(none, |[min, max], index| {
            let b = self.nodes[index].aabb();
            let corner = |v: glam::Vec3A| glam::Vec3::from(v).as_dvec3();
            let [least, greatest] = transform.in_world(corner(b.min), corner(b.max));
            [min.min(least), max.max(greatest)]
        });
        Bounds::rounded_out(min, max)
    }

    /// Its size in bytes, with the vertex positions of the mesh.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
            + size_of_val(self.triangles.as_slice())
            + size_of_val(self.mesh.positions.as_slice())
    }
}
