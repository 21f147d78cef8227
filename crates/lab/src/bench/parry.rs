//! Triangle meshes of parry3d, by its public ray queries.

use parry3d::math::Vector;
use parry3d::partitioning::{BvhNode, TraversalAction};
use parry3d::query::{Ray as ParryRay, RayCast};
use parry3d::shape::{CompositeShapeRef, TriMesh};

use super::speed::Kind;
use super::{Built, Engine, Facts, Label, RayQueue, singly};
use kiln::bvh::Ray;
use kiln::error::Error;

/// The only engine.
pub(crate) fn engines() -> Vec<Engine> {
    let isa = kiln::bvh::detail::compiled_isa();
    let label = Label { engine: "parry3d", layout: "trimesh", tier: None, preset: None, isa };
    vec![Engine::new(label, |mesh| {
        let vertices = mesh.positions.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
        let failed = |e| Error::Failed { what: format!("parry3d: {e}"), hint: String::new() };
        Ok(Box::new(BuiltParry(TriMesh::new(vertices, mesh.triangles.clone()).map_err(failed)?)))
    })]
}

struct BuiltParry(TriMesh);

impl Built for BuiltParry {
    fn facts(&self) -> Facts {
        let tree = self.0.bvh();
        let area = |node: &BvhNode| f64::from(node.aabb().half_area_or_perimeter());
        // The box of the root is not stored.
        let whole = f64::from(tree.root_aabb().half_area_or_perimeter());
        let mut cost = 1.0;
        tree.traverse(|node| {
            cost += area(node) / whole;
            TraversalAction::Continue
        });
        let mesh = size_of_val(self.0.vertices()) + size_of_val(self.0.indices());
        Facts {
            nodes: Some(u64::from(tree.leaf_count().saturating_sub(1))),
            depth: Some(tree.subtree_depth(0)),
            sah_cost: Some(cost),
            bytes: Some((mesh + tree.heap_memory_size()) as u64),
        }
    }

    fn queue<'a>(&'a self, kind: Kind, rays: &'a [Ray]) -> Box<dyn RayQueue + 'a> {
        let vector = |v: glam::DVec3| Vector::new(v.x as f32, v.y as f32, v.z as f32);
        let own = |ray: &Ray| {
            let t_max = if ray.t_max() < f64::from(f32::MAX) { ray.t_max() as f32 } else { f32::MAX };
            (ParryRay::new(vector(ray.origin()), vector(ray.direction())), t_max)
        };
        let rays = rays.iter().map(own);
        if kind.is_any_hit() {
            return singly(rays, |(ray, t_max)| self.0.intersects_local_ray(ray, *t_max).then_some(0));
        }
        singly(rays, |(ray, t_max)| Some(CompositeShapeRef(&self.0).cast_local_ray(ray, *t_max, false)?.0))
    }
}
