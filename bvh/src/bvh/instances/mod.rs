//! Instances: a tree over the instances (top level) and one tree over each mesh (bottom level).
//!
//! Primitives that are not instanced are in a structure of their own, which is traversed first. A ray passes
//! [`traverse()`] for the top level, [`transform`] into the space of the mesh, and [`traverse()`] for the tree of
//! [`mesh_bvh`]. Boxes are tested in the space of the mesh, triangles in world space on corners that are transformed
//! one by one with the arithmetic that transforms a copy, so hits have the bits of a copied mesh. Boxes are enlarged
//! by all that this arithmetic rounds.

mod mesh_bvh;
mod transform;

use std::cell::Cell;
use std::collections::HashMap;
use std::sync::Arc;

use glam::Vec3A;
use obvhs::bvh2::node::Bvh2Node;

use super::Preset;
use super::build::build_nodes;
use super::traverse::traverse;
use super::{Accelerator, Description, Next, Primitive, Slot, Traversal};
use crate::geometry::{
    Bounds, BoxTest, Corner, Hit, HitBuffer, Mesh, Numerics, Placed, PreparedRay, PrimId, Ray, Rays, SlotId,
    Stored, Tier, Triangle, prune_distance,
};
use mesh_bvh::MeshBvh;
pub use transform::MeshSpace;
use transform::Transform;

/// A mesh with a placement.
pub struct Instance {
    /// The mesh and its placement.
    pub placed: Placed,
    /// The id of its first triangle.
    pub first: PrimId,
}

impl Instance {
    /// The primitive id of a triangle of the mesh.
    fn prim(&self, triangle: u32) -> PrimId {
        PrimId(self.first.0 + triangle)
    }

    /// The triangles in world space, not rounded.
    pub(super) fn slots(&self) -> impl Iterator<Item = Slot> {
        (0..self.placed.triangle_count() as u32).map(|triangle| Slot {
            primitive: Primitive::Triangle(Triangle(self.placed.corners_of(triangle))),
            id: self.prim(triangle),
        })
    }
}

/// Whether a mesh with a placement can be an [`Instance`]: not if the placement is singular or nearly so.
pub fn can_be_instance(placed: &Placed, space: &MeshSpace, numerics: Numerics) -> bool {
    Transform::new(placed, space, numerics).is_some()
}

/// An instance prepared for rays.
struct PreparedInstance {
    instance: Instance,
    transform: Transform,
    /// The index of its mesh in [`Instances::meshes`].
    mesh: u32,
    /// The slot of the first triangle of its mesh.
    slot: u32,
}

/// A structure over single primitives, and a two-level tree over instances.
pub(crate) struct Instances<T: Tier> {
    /// The structure over primitives that are not instanced.
    flat: Box<dyn Accelerator>,
    instances: Vec<PreparedInstance>,
    meshes: Vec<MeshBvh>,
    /// The nodes of the top level.
    top: Vec<Bvh2Node>,
    /// Indices of instances in the order of the leaves.
    order: Vec<u32>,
    tier: std::marker::PhantomData<T>,
}

impl<T: Tier> Instances<T> {
    /// Builds the two-level tree. Every instance must satisfy [`can_be_instance`].
    pub(crate) fn new(flat: Box<dyn Accelerator>, instances: Vec<Instance>, preset: Preset) -> Self {
        // The highest slots: those of `flat` begin at 0.
        let triangles: usize = instances.iter().map(|i| i.placed.mesh.triangles.len()).sum();
        let triangles = u32::try_from(triangles).expect("primitives are numbered with 32 bits");
        let mut slot = u32::MAX - triangles;
        let mut known: HashMap<*const Mesh, (u32, MeshSpace)> = HashMap::new();
        let mut meshes: Vec<(Arc<Mesh>, MeshSpace)> = Vec::new();
        let mut prepared = Vec::with_capacity(instances.len());
        for instance in instances {
            let mesh = &instance.placed.mesh;
            let (index, space) = *known.entry(Arc::as_ptr(mesh)).or_insert_with(|| {
                let space = MeshSpace::of(mesh).expect("a mesh that can be an instance");
                meshes.push((mesh.clone(), space));
                (meshes.len() as u32 - 1, space)
            });
            let transform =
                Transform::new(&instance.placed, &space, T::NUMERICS).expect("it can be an instance");
            let first = slot;
            slot += mesh.triangles.len() as u32;
            prepared.push(PreparedInstance { instance, transform, mesh: index, slot: first });
        }
        let meshes: Vec<MeshBvh> =
            meshes.into_iter().map(|(mesh, space)| MeshBvh::new(mesh, &space, preset)).collect();
        let boxes: Vec<Bounds> =
            prepared.iter().map(|i| meshes[i.mesh as usize].in_world(&i.transform)).collect();
        let mut parameters = preset.parameters();
        // Testing a box is cheaper than traversing a mesh.
        parameters.max_prims_per_leaf = 1;
        let (top, order) = build_nodes(&boxes, parameters);
        Instances { flat, instances: prepared, meshes, top, order, tier: std::marker::PhantomData }
    }

    /// Calls `found` with the hits on instances before `t_max`. It returns the new `t_max`, or `None` to stop.
    #[inline(always)]
    fn each_hit(
        &self,
        ray: &Ray,
        t_max: f64,
        traversal: &mut Traversal,
        mut found: impl FnMut(Hit, [T::Corner; 3]) -> Option<f64>,
    ) {
        let Traversal { stack, mesh_stack, tests, .. } = traversal;
        let boxes = T::Boxes::new(ray);
        let mut prepared: Option<T::Prepared> = None;
        let mut count = 0;
        let t_max = Cell::new(t_max);
        let enters = |min: Vec3A, max: Vec3A, t_max: f32| boxes.enters(min, max, t_max);
        traverse(&self.top, prune_distance(t_max.get()), stack, &mut count, enters, |leaf, enter| {
            for &index in &self.order[leaf.start as usize..leaf.end as usize] {
                let PreparedInstance { instance, transform, mesh, slot } = &self.instances[index as usize];
                let MeshBvh { mesh, nodes, triangles } = &self.meshes[*mesh as usize];
                let (boxes, start) = transform.local(ray, enter);
                // Plus the rounding of the difference.
                let local = || prune_distance(t_max.get() - start + t_max.get() * f64::EPSILON);
                let enters = |min: Vec3A, max: Vec3A, t_max: f32| boxes.enters(min, max, t_max);
                let visit = |leaf: std::ops::Range<u32>, _| {
                    let leaf = &triangles[leaf.start as usize..leaf.end as usize];
                    tests.primitives += leaf.len() as u64;
                    let before = t_max.get();
                    for (triangle, corners) in leaf {
                        let corner = |i: u32| {
                            T::Corner::from_dvec3(instance.placed.placement.point(mesh.positions[i as usize]))
                        };
                        let corners = corners.map(corner);
                        let prepared = prepared.get_or_insert_with(|| T::Prepared::new(ray));
                        if let Some(hit) = T::hit_triangle(prepared, ray, &corners) {
                            let (prim, slot) = (instance.prim(*triangle), SlotId::new(slot + triangle));
                            match found(Hit { t: hit.t, prim, slot, barycentrics: hit.barycentrics }, corners)
                            {
                                Some(t) => t_max.set(t),
                                None => return Next::Stop,
                            }
                        }
                    }
                    if t_max.get() < before { Next::Shorten(local()) } else { Next::Continue }
                };
                let next = traverse(nodes, local(), mesh_stack, &mut tests.nodes, enters, visit);
                if let Next::Stop = next {
                    return Next::Stop;
                }
            }
            Next::Shorten(prune_distance(t_max.get()))
        });
        tests.nodes += count;
    }

    /// The closest hit, given that of `flat`.
    fn closest(&self, ray: &Ray, flat: Option<Hit>, traversal: &mut Traversal) -> Option<Hit> {
        let mut best: Option<(Hit, Stored<T::Corner>)> =
            flat.map(|hit| (hit, self.flat.primitive(hit.slot).into()));
        let t_max = best.map_or(ray.t_max, |(hit, _)| hit.t);
        self.each_hit(ray, t_max, traversal, |hit, corners| {
            let stored = Stored::Triangle(corners);
            let is_better = best
                .as_ref()
                .is_none_or(|(other, with)| T::is_before(|| *ray, [(&hit, &stored), (other, with)]));
            if is_better {
                best = Some((hit, stored));
            }
            best.map(|(hit, _)| hit.t)
        });
        best.map(|(hit, _)| hit)
    }

    fn is_any_hit(&self, ray: &Ray, traversal: &mut Traversal) -> bool {
        let mut any = false;
        self.each_hit(ray, ray.t_max, traversal, |_, _| {
            any = true;
            None
        });
        any
    }
}

impl<T: Tier> Accelerator for Instances<T> {
    fn closest_hit(&self, ray: &Ray, traversal: &mut Traversal) -> Option<Hit> {
        let flat = self.flat.closest_hit(ray, traversal);
        self.closest(ray, flat, traversal)
    }

    fn is_occluded(&self, ray: &Ray, traversal: &mut Traversal) -> bool {
        self.flat.is_occluded(ray, traversal) || self.is_any_hit(ray, traversal)
    }

    fn closest_hits(&self, rays: Rays, hits: &mut HitBuffer, traversal: &mut Traversal) {
        let first = hits.len();
        self.flat.closest_hits(rays, hits, traversal);
        for (index, ray) in (first..).zip(rays.iter()) {
            let hit = self.closest(&ray, hits.get(index), traversal);
            hits.set(index, hit.as_ref());
        }
    }

    fn are_occluded(&self, rays: Rays, occluded: &mut Vec<bool>, traversal: &mut Traversal) {
        let first = occluded.len();
        self.flat.are_occluded(rays, occluded, traversal);
        for (ray, occluded) in rays.iter().zip(&mut occluded[first..]) {
            *occluded = *occluded || self.is_any_hit(&ray, traversal);
        }
    }

    fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>, traversal: &mut Traversal) {
        self.flat.all_hits(ray, hits, traversal);
        self.each_hit(ray, ray.t_max, traversal, |hit, _| {
            hits.push(hit);
            Some(ray.t_max)
        });
    }

    fn primitive(&self, slot: SlotId) -> Primitive {
        let after = self.instances.partition_point(|instance| instance.slot <= slot.index());
        match after.checked_sub(1).map(|index| &self.instances[index]) {
            None => self.flat.primitive(slot),
            Some(prepared) => {
                let corners = prepared.instance.placed.corners_of(slot.index() - prepared.slot);
                Primitive::Triangle(Triangle(corners.map(|p| T::Corner::from_dvec3(p).to_dvec3())))
            }
        }
    }

    fn each_primitive(&self, visit: &mut dyn FnMut(PrimId, Primitive)) {
        self.flat.each_primitive(visit);
        let slots = self.instances.iter().flat_map(|prepared| prepared.instance.slots());
        slots.for_each(|slot| visit(slot.id, Stored::<T::Corner>::from(slot.primitive).into()));
    }

    fn numerics(&self) -> Numerics {
        T::NUMERICS
    }

    fn describe(&self) -> Description {
        let flat = self.flat.describe();
        let lists = |prepared: &PreparedInstance| prepared.instance.placed.placement.bytes();
        let own = size_of_val(self.instances.as_slice())
            + self.instances.iter().map(lists).sum::<usize>()
            + size_of_val(self.top.as_slice())
            + size_of_val(self.order.as_slice());
        let bytes = self.meshes.iter().map(MeshBvh::bytes).sum::<usize>() + own;
        let nodes = self.meshes.iter().map(|mesh| mesh.nodes.len()).sum::<usize>() + self.top.len();
        let slots = self.meshes.iter().map(|mesh| mesh.triangles.len()).sum::<usize>();
        Description {
            layout: "instances",
            isa: flat.isa,
            nodes: flat.nodes + nodes,
            slots: flat.slots + slots,
            bytes: flat.bytes + bytes,
        }
    }
}
