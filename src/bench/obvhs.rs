//! obvhs as it is shipped: its own builds, traversals and triangle test.

use std::time::Duration;

use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::Ray;
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;

use super::{Built, Engine, Mesh};
use crate::error::Result;

/// One of its layouts.
enum Layout {
    Bvh2,
    CwBvh,
}

/// Every layout.
pub fn engines() -> Vec<Box<dyn Engine>> {
    vec![Box::new(Layout::Bvh2), Box::new(Layout::CwBvh)]
}

impl Engine for Layout {
    fn name(&self) -> &'static str {
        "obvhs"
    }

    fn layout(&self) -> &'static str {
        match self {
            Layout::Bvh2 => "bvh2",
            Layout::CwBvh => "cwbvh",
        }
    }

    fn build(&self, mesh: &Mesh) -> Result<Box<dyn Built>> {
        let triangles: Vec<Triangle> = (0..mesh.triangles.len() as u32)
            .map(|id| {
                let [v0, v1, v2] = mesh.corners(id).map(Vec3A::from);
                Triangle { v0, v1, v2 }
            })
            .collect();
        let mut time = Duration::ZERO;
        let parameters = BvhBuildParams::medium_build();
        let (tree, order) = match self {
            Layout::Bvh2 => {
                let tree = build_bvh2_from_tris(&triangles, parameters, &mut time);
                let order = tree.primitive_indices.clone();
                (Tree::Bvh2(tree), order)
            }
            Layout::CwBvh => {
                let tree = build_cwbvh_from_tris(&triangles, parameters, &mut time);
                let order = tree.primitive_indices.clone();
                (Tree::CwBvh(tree), order)
            }
        };
        // In the order of the leaves, as obvhs advises.
        let slots = order.into_iter().map(|id| (RtTriangle::from(&triangles[id as usize]), id)).collect();
        Ok(Box::new(BuiltObvhs { tree, slots }))
    }
}

enum Tree {
    Bvh2(Bvh2),
    CwBvh(CwBvh),
}

struct BuiltObvhs {
    tree: Tree,
    slots: Vec<(RtTriangle, u32)>,
}

impl Built for BuiltObvhs {
    fn crossings(&self, origin: DVec3, direction: DVec3, found: &mut Vec<u32>) {
        let ray = Ray::new_inf(origin.as_vec3a(), direction.as_vec3a());
        let test = |ray: &Ray, slot: usize| {
            let (triangle, id) = &self.slots[slot];
            if triangle.intersect(ray) < f32::INFINITY {
                found.push(*id);
            }
        };
        match &self.tree {
            Tree::Bvh2(tree) => tree.ray_traverse_anyhit(ray, test),
            Tree::CwBvh(tree) => tree.ray_traverse_anyhit(ray, test),
        }
    }
}
