//! The tree over a mesh that stands in many places.

use std::sync::Arc;

use glam::{DMat3, DVec3};
use obvhs::bvh2::node::Bvh2Node;

use super::space::{Frame, MeshSpace};
use crate::bvh::Preset;
use crate::bvh::build::build_nodes;
use crate::geometry::{Bounds, Corner};
use crate::scene::Mesh;

/// A mesh and the tree over it, in its own space.
pub struct Bottom {
    /// The mesh.
    pub mesh: Arc<Mesh>,
    /// The boxes.
    pub nodes: Vec<Bvh2Node>,
    /// The triangles in the order of the leaves: their place in the mesh, and their corners'.
    pub triangles: Vec<(u32, [u32; 3])>,
}

/// How many boxes a mesh is seen as where it is put into a box of the world.
const PARTS: usize = 64;

impl Bottom {
    /// A tree over `mesh`, whose boxes are larger than their triangles by `spread` times their half sizes.
    pub fn new(mesh: Arc<Mesh>, space: &MeshSpace, spread: &DMat3, preset: Preset) -> Self {
        let bounds = |triangle: &[u32; 3]| {
            let [min, max] = DVec3::span(&triangle.map(|i| space.point(mesh.positions[i as usize])));
            let more = *spread * ((max - min) / 2.0);
            Bounds::rounded_out(min - more, max + more)
        };
        let boxes: Vec<Bounds> = mesh.triangles.iter().map(bounds).collect();
        let (nodes, order) = build_nodes(&boxes, preset.parameters());
        let triangles = order.into_iter().map(|i| (i, mesh.triangles[i as usize])).collect();
        Bottom { mesh, nodes, triangles }
    }

    /// A box that holds all corners in one of the mesh's places, in the world, rounded or not.
    pub fn in_world(&self, frame: &Frame) -> Bounds {
        let mut open = vec![0];
        let mut next = 0;
        while next < open.len() && open.len() < PARTS {
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
            let [least, greatest] = frame.in_world(corner(b.min), corner(b.max));
            [min.min(least), max.max(greatest)]
        });
        Bounds::rounded_out(min, max)
    }

    /// Its size in bytes, with the corners that it reads.
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
            + size_of_val(self.triangles.as_slice())
            + size_of_val(self.mesh.positions.as_slice())
    }
}
