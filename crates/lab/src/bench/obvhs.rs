//! obvhs with its own builders, traversals and triangle test.

use std::time::Duration;

use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::{INVALID_ID, Ray, RayHit};
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;

use super::speed::Kind;
use super::{Built, Engine, Facts, Label, Mesh, RayQueue, singly};
use kiln::bvh;
use kiln::bvh::detail::{VisitedNode, quality};

/// Both layouts.
pub(crate) fn engines() -> Vec<Engine> {
    let engine = |layout, is_wide| {
        let isa = kiln::bvh::detail::compiled_isa();
        let label = Label { engine: "obvhs", layout, tier: None, preset: Some("medium-build"), isa };
        Engine::new(label, move |mesh| Ok(Box::new(BuiltObvhs::new(is_wide, mesh))))
    };
    vec![engine("bvh2", false), engine("cwbvh", true)]
}

enum Tree {
    Bvh2(Bvh2),
    CwBvh(CwBvh),
}

struct BuiltObvhs {
    tree: Tree,
    /// In leaf order, as obvhs recommends.
    triangles: Vec<RtTriangle>,
}

impl BuiltObvhs {
    fn new(is_wide: bool, mesh: &Mesh) -> Self {
        let triangles: Vec<Triangle> = (0..mesh.triangles.len() as u32)
            .map(|id| {
                let [v0, v1, v2] = mesh.corners(id).map(Vec3A::from);
                Triangle { v0, v1, v2 }
            })
            .collect();
        let mut time = Duration::ZERO;
        let parameters = BvhBuildParams::medium_build();
        let tree = match is_wide {
            false => Tree::Bvh2(build_bvh2_from_tris(&triangles, parameters, &mut time)),
            true => Tree::CwBvh(build_cwbvh_from_tris(&triangles, parameters, &mut time)),
        };
        let order = tree.order().iter().map(|&id| RtTriangle::from(&triangles[id as usize])).collect();
        BuiltObvhs { tree, triangles: order }
    }

    fn closest(&self, ray: Ray) -> Option<u32> {
        let mut hit = RayHit::none();
        let test = |ray: &Ray, slot: usize| self.triangles[slot].intersect(ray);
        match &self.tree {
            Tree::Bvh2(tree) => tree.ray_traverse(ray, &mut hit, test),
            Tree::CwBvh(tree) => tree.ray_traverse(ray, &mut hit, test),
        };
        (hit.primitive_id != INVALID_ID).then(|| self.tree.order()[hit.primitive_id as usize])
    }

    fn is_occluded(&self, ray: Ray) -> bool {
        let test = |ray: &Ray, slot: usize| self.triangles[slot].intersect(ray);
        !match &self.tree {
            Tree::Bvh2(tree) => tree.ray_traverse_miss(ray, test),
            Tree::CwBvh(tree) => tree.ray_traverse_miss(ray, test),
        }
    }
}

impl Tree {
    /// Triangle indices in leaf order.
    fn order(&self) -> &[u32] {
        match self {
            Tree::Bvh2(tree) => &tree.primitive_indices,
            Tree::CwBvh(tree) => &tree.primitive_indices,
        }
    }
}

impl Built for BuiltObvhs {
    fn facts(&self) -> Facts {
        let (nodes, node_bytes, quality) = match &self.tree {
            Tree::Bvh2(tree) => {
                let quality = quality(0, |index, children| {
                    let node = &tree.nodes[index];
                    if !node.is_leaf() {
                        children.extend([node.first_index as usize, node.first_index as usize + 1]);
                    }
                    VisitedNode {
                        area: f64::from(node.aabb().half_area()),
                        primitives: node.prim_count as usize,
                    }
                });
                (tree.nodes.len(), size_of_val(&tree.nodes[..]), Some(quality))
            }
            Tree::CwBvh(tree) => (tree.nodes.len(), size_of_val(&tree.nodes[..]), None),
        };
        let bytes = node_bytes + size_of_val(self.tree.order()) + size_of_val(&self.triangles[..]);
        Facts {
            nodes: Some(nodes as u64),
            depth: quality.map(|quality| quality.depth),
            sah_cost: quality.map(|quality| quality.sah_cost),
            bytes: Some(bytes as u64),
        }
    }

    fn queue<'a>(&'a self, kind: Kind, rays: &'a [bvh::Ray]) -> Box<dyn RayQueue + 'a> {
        let own = |ray: &bvh::Ray| {
            let [near, far] = [ray.t_min(), ray.t_max()].map(|t| t as f32);
            Ray::new(ray.origin().as_vec3a(), ray.direction().as_vec3a(), near, far)
        };
        let rays = rays.iter().map(own);
        if kind.is_any_hit() {
            return singly(rays, |ray| self.is_occluded(*ray).then_some(0));
        }
        singly(rays, |ray| self.closest(*ray))
    }

    fn crossings(&self, origin: DVec3, direction: DVec3, found: &mut Vec<u32>) {
        let ray = Ray::new_inf(origin.as_vec3a(), direction.as_vec3a());
        let test = |ray: &Ray, slot: usize| {
            if self.triangles[slot].intersect(ray) < f32::INFINITY {
                found.push(self.tree.order()[slot]);
            }
        };
        match &self.tree {
            Tree::Bvh2(tree) => tree.ray_traverse_anyhit(ray, test),
            Tree::CwBvh(tree) => tree.ray_traverse_anyhit(ray, test),
        }
    }

    fn finds_all_crossings(&self) -> bool {
        true
    }
}
