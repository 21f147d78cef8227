//! The crate `bvh`, by its iterators, with the Möller-Trumbore test, as its own test culls back faces.

use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::{BHShape, BoundingHierarchy};
use bvh::bvh::{Bvh, BvhNode};
use bvh::ray::Ray as BvhRay;
use nalgebra::{Point3, Vector3};

use super::speed::Kind;
use super::{Built, Engine, Facts, Label, RayQueue, singly};
use kiln::bvh::Ray;
use kiln::bvh::detail::{Quality, VisitedNode, quality};

/// The only engine.
pub(crate) fn engines() -> Vec<Engine> {
    let isa = kiln::bvh::detail::compiled_isa();
    let label = Label { engine: "bvh", layout: "bvh2", tier: None, preset: None, isa };
    vec![Engine::new(label, |mesh| {
        let triangle = |id: u32| {
            let corners = mesh.corners(id).map(|corner| Point3::from(corner.to_array()));
            Triangle { corners, id, node: 0 }
        };
        let mut triangles: Vec<Triangle> = (0..mesh.triangles.len() as u32).map(triangle).collect();
        let tree = Bvh::build_par(&mut triangles);
        Ok(Box::new(BuiltBinary { tree, triangles }))
    })]
}

struct Triangle {
    corners: [Point3<f32>; 3],
    id: u32,
    node: usize,
}

impl Bounded<f32, 3> for Triangle {
    fn aabb(&self) -> Aabb<f32, 3> {
        let [a, b, c] = &self.corners;
        Aabb::empty().grow(a).grow(b).grow(c)
    }
}

impl BHShape<f32, 3> for Triangle {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

impl Triangle {
    /// Möller and Trumbore, Fast, Minimum Storage Ray-Triangle Intersection, 1997, from both sides.
    fn hit(&self, ray: &BvhRay<f32, 3>) -> Option<f32> {
        let [a, b, c] = &self.corners;
        let (ab, ac) = (b - a, c - a);
        let p = ray.direction.cross(&ac);
        let determinant = ab.dot(&p);
        let s = ray.origin - a;
        let u = s.dot(&p) / determinant;
        let q = s.cross(&ab);
        let v = ray.direction.dot(&q) / determinant;
        let t = ac.dot(&q) / determinant;
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
    }
}

struct BuiltBinary {
    tree: Bvh<f32, 3>,
    triangles: Vec<Triangle>,
}

impl BuiltBinary {
    /// The iterator returns triangles in ascending order of box distance; the first box behind the closest hit ends the
    /// search.
    fn closest(&self, ray: &BvhRay<f32, 3>) -> Option<u32> {
        let mut best: Option<(f32, u32)> = None;
        for triangle in self.tree.nearest_traverse_iterator(ray, &self.triangles) {
            if let Some((t, _)) = best
                && ray.intersection_slice_for_aabb(&triangle.aabb()).is_none_or(|(entry, _)| entry > t)
            {
                break;
            }
            if let Some(t) = triangle.hit(ray)
                && best.is_none_or(|(before, _)| t < before)
            {
                best = Some((t, triangle.id));
            }
        }
        best.map(|(_, id)| id)
    }

    fn is_occluded(&self, ray: &BvhRay<f32, 3>, t_max: f32) -> bool {
        let mut triangles = self.tree.traverse_iterator(ray, &self.triangles);
        triangles.any(|triangle| triangle.hit(ray).is_some_and(|t| t < t_max))
    }

    fn quality(&self) -> Quality {
        let nodes = &self.tree.nodes;
        // The box of a node is stored in its parent.
        let mut areas = vec![0.0; nodes.len()];
        let area = |aabb: &Aabb<f32, 3>| f64::from(aabb.surface_area());
        for node in nodes {
            if let BvhNode::Node { child_l_index, child_l_aabb, child_r_index, child_r_aabb, .. } = node {
                areas[*child_l_index] = area(child_l_aabb);
                areas[*child_r_index] = area(child_r_aabb);
            }
        }
        if let Some(BvhNode::Node { child_l_aabb, child_r_aabb, .. }) = nodes.first() {
            areas[0] = area(&child_l_aabb.join(child_r_aabb));
        }
        quality(0, |index, children| {
            if let BvhNode::Node { child_l_index, child_r_index, .. } = &nodes[index] {
                children.extend([child_l_index, child_r_index]);
            }
            VisitedNode { area: areas[index], primitives: 1 }
        })
    }
}

impl Built for BuiltBinary {
    fn facts(&self) -> Facts {
        let Quality { depth, sah_cost } = self.quality();
        Facts {
            nodes: Some(self.tree.nodes.len() as u64),
            depth: Some(depth),
            sah_cost: Some(sah_cost),
            bytes: Some((size_of_val(&self.tree.nodes[..]) + size_of_val(&self.triangles[..])) as u64),
        }
    }

    fn queue<'a>(&'a self, kind: Kind, rays: &'a [Ray]) -> Box<dyn RayQueue + 'a> {
        let own = |ray: &Ray| {
            let [origin, direction] = [ray.origin(), ray.direction()].map(|v| v.as_vec3().to_array());
            (BvhRay::new(Point3::from(origin), Vector3::from(direction)), ray.t_max() as f32)
        };
        let rays = rays.iter().map(own);
        if kind.is_any_hit() {
            return singly(rays, |(ray, t_max)| self.is_occluded(ray, *t_max).then_some(0));
        }
        singly(rays, |(ray, _)| self.closest(ray))
    }
}
