//! Instances: a tree over the instances (top level) and one tree over each mesh (bottom level).
//!
//! Primitives that are not instanced are in a structure of their own, which is traversed first. A ray passes
//! [`descend`] for the top level, [`transform`] into the space of the mesh, and [`descend`] for the tree of
//! [`mesh_bvh`]. Boxes are tested in the space of the mesh, triangles in world space on corners that are transformed
//! one by one with the arithmetic that transforms a copy, so hits have the bits of a copied mesh. Boxes are enlarged
//! by all that this arithmetic rounds.

mod mesh_bvh;
mod transform;

use std::cell::Cell;
use std::collections::HashMap;
use std::sync::Arc;

use glam::DVec3;

use super::Preset;
use super::build::build_over;
use super::layered::Layer;
use super::wide::{BoxRay, Child, Tree, descend, descend_near};
use super::{Accelerator, Description, Next, Primitive, Slot, Traversal};
use crate::geometry::simd::{InstructionSet, Portable, Simd};
use crate::geometry::{
    Bounds, Corner, Hit, Mesh, Numerics, Placed, PreparedRay, PrimId, Ray, SlotId, Stored, Tier, Triangle,
    TriangleHit,
};
pub(crate) use mesh_bvh::MeshBvh;
pub use transform::MeshSpace;
use transform::Transform;

/// A mesh with a placement.
#[derive(Debug, Clone)]
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

impl PreparedInstance {
    /// The hit of a ray on a triangle of its mesh, and the triangle's corners. The ray is prepared at the first one, as
    /// many rays reach none.
    #[inline(always)]
    fn hit<T: Tier>(
        &self,
        ray: &Ray,
        prepared: &mut Option<T::Prepared>,
        &(triangle, corners): &(u32, [u32; 3]),
    ) -> Option<(Hit, [T::Corner; 3])> {
        let Placed { mesh, placement } = &self.instance.placed;
        let corners = corners.map(|i| T::Corner::from_dvec3(placement.point(mesh.positions[i as usize])));
        let prepared = prepared.get_or_insert_with(|| T::Prepared::new(ray));
        let TriangleHit { t, barycentrics } = T::hit_triangle(prepared, ray, &corners)?;
        let (prim, slot) = (self.instance.prim(triangle), SlotId::new(self.slot + triangle));
        Some((Hit { t, prim, slot, barycentrics }, corners))
    }

    /// A triangle of its mesh in world space, in the precision of the tier.
    fn primitive<T: Tier>(&self, triangle: u32) -> Primitive {
        let corners = self.instance.placed.corners_of(triangle);
        Primitive::Triangle(Triangle(corners.map(|p| T::Corner::from_dvec3(p).to_dvec3())))
    }
}

/// A two-level tree over instances, beside the structure over single primitives.
pub(crate) struct Instances<T: Tier> {
    instances: Vec<PreparedInstance>,
    meshes: Vec<Arc<MeshBvh>>,
    /// The top level. Each leaf is one instance, an index into `order`.
    top: Tree,
    /// Indices of instances in the order of the leaves.
    order: Vec<u32>,
    /// The instruction set of the flat structure.
    instructions: InstructionSet,
    tier: std::marker::PhantomData<T>,
}

impl<T: Tier> Instances<T> {
    /// Builds the two-level tree. Every instance must satisfy [`can_be_instance`]. Meshes of `built` keep their trees;
    /// after it, `built` has those of all instances.
    pub(crate) fn new(
        instances: Vec<Instance>,
        (preset, instructions): (Preset, InstructionSet),
        built: &mut Vec<Arc<MeshBvh>>,
    ) -> Self {
        // The highest slots: those of `flat` begin at 0.
        let triangles: usize = instances.iter().map(|i| i.placed.mesh.triangles.len()).sum();
        let triangles = u32::try_from(triangles).expect("primitives are numbered with 32 bits");
        let mut slot = u32::MAX - triangles;
        let kept: HashMap<*const Mesh, Arc<MeshBvh>> =
            built.drain(..).map(|mesh| (Arc::as_ptr(&mesh.mesh), mesh)).collect();
        let mut known: HashMap<*const Mesh, u32> = HashMap::new();
        let mut prepared = Vec::with_capacity(instances.len());
        for instance in instances {
            let mesh = &instance.placed.mesh;
            let index = *known.entry(Arc::as_ptr(mesh)).or_insert_with(|| {
                let kept = kept.get(&Arc::as_ptr(mesh)).cloned();
                built.push(kept.unwrap_or_else(|| Arc::new(MeshBvh::new(mesh.clone(), preset))));
                built.len() as u32 - 1
            });
            let space = &built[index as usize].space;
            let transform =
                Transform::new(&instance.placed, space, T::NUMERICS).expect("it can be an instance");
            let first = slot;
            slot += mesh.triangles.len() as u32;
            prepared.push(PreparedInstance { instance, transform, mesh: index, slot: first });
        }
        let meshes = built.clone();
        let boxes: Vec<Bounds> =
            prepared.iter().map(|i| meshes[i.mesh as usize].in_world(&i.transform)).collect();
        let (top, order) = build_over(&boxes, preset, 1);
        Instances { instances: prepared, meshes, top, order, instructions, tier: std::marker::PhantomData }
    }

    /// The instance of a leaf of the top level, and the tree over its mesh.
    #[inline(always)]
    fn at(&self, leaf: Child) -> (&PreparedInstance, &MeshBvh) {
        let instance = &self.instances[self.order[leaf.index()] as usize];
        (instance, &self.meshes[instance.mesh as usize])
    }

    /// Calls `found` with the hits on instances before `t_max` until it returns [`Next::Stop`], nearest boxes first if
    /// `NEAREST`.
    #[inline(always)]
    fn each_triangle_hit<const NEAREST: bool>(
        &self,
        ray: &Ray,
        t_max: f64,
        traversal: &mut Traversal,
        mut found: impl FnMut(Hit, [T::Corner; 3]) -> Next,
    ) {
        let mut prepared = None;
        self.each_near::<NEAREST>(
            ray,
            t_max,
            traversal,
            #[inline(always)]
            |instance, triangle| {
                let hit = instance.hit::<T>(ray, &mut prepared, triangle);
                hit.map_or(Next::Continue, |(hit, corners)| found(hit, corners))
            },
        );
    }

    /// Calls `visit` with the triangles, and their instances, that have a point on the ray before `t_max`, ends
    /// included, and perhaps with others, until it returns [`Next::Stop`]; nearest boxes first if `NEAREST`.
    #[inline(always)]
    fn each_near<const NEAREST: bool>(
        &self,
        ray: &Ray,
        t_max: f64,
        traversal: &mut Traversal,
        visit: impl FnMut(&PreparedInstance, &(u32, [u32; 3])) -> Next,
    ) {
        if let Some(simd) = self.instructions.as_avx2() {
            return self.each_near_by::<_, NEAREST>(simd, ray, t_max, traversal, visit);
        }
        self.each_near_by::<_, NEAREST>(Portable, ray, t_max, traversal, visit);
    }

    /// [`Instances::each_near`] by an instruction set.
    #[inline(always)]
    fn each_near_by<S: Simd, const NEAREST: bool>(
        &self,
        simd: S,
        ray: &Ray,
        t_max: f64,
        Traversal { children, mesh_children, tests, .. }: &mut Traversal,
        mut visit: impl FnMut(&PreparedInstance, &(u32, [u32; 3])) -> Next,
    ) {
        let boxes = BoxRay::new(ray, false, false);
        let mut nearest = t_max;
        let top = (&*self.top.nodes, self.top.depth);
        simd.run(
            #[inline(always)]
            || {
                descend::<S, false, NEAREST>(
                    top,
                    &boxes,
                    t_max,
                    false,
                    children,
                    tests,
                    #[inline(always)]
                    |leaf, enter, tests| {
                        let (instance, MeshBvh { tree, triangles, .. }) = self.at(leaf);
                        let (boxes, start) = instance.transform.local(ray, boxes.along_ray(enter));
                        // Plus the rounding of the difference.
                        let local = |t: f64| t - start + t * f64::EPSILON;
                        let stopped = descend::<S, false, NEAREST>(
                            (&tree.nodes, tree.depth),
                            &boxes,
                            local(nearest),
                            false,
                            mesh_children,
                            tests,
                            #[inline(always)]
                            |leaf, _, tests| {
                                let mut next = Next::Continue;
                                for triangle in &triangles[leaf.range()] {
                                    tests.primitives += 1;
                                    match visit(instance, triangle) {
                                        Next::Stop => return Next::Stop,
                                        Next::Shorten(t) => {
                                            nearest = t;
                                            next = Next::Shorten(local(t));
                                        }
                                        Next::Continue => {}
                                    }
                                }
                                next
                            },
                        );
                        if stopped { Next::Stop } else { Next::Shorten(nearest) }
                    },
                )
            },
        );
    }
}

impl<T: Tier> Layer for Instances<T> {
    const IS_BESIDE_TREE: bool = false;

    fn closest(
        &self,
        flat: &dyn Accelerator,
        ray: &Ray,
        best: Option<Hit>,
        accepts: &mut dyn FnMut(&Hit) -> bool,
        traversal: &mut Traversal,
    ) -> Option<Hit> {
        let t_max = best.map_or(ray.t_max, |hit| hit.t);
        let mut best: Option<(Hit, Stored<T::Corner>)> =
            best.map(|hit| (hit, flat.primitive(hit.slot).into()));
        self.each_triangle_hit::<true>(ray, t_max, traversal, |hit, corners| {
            let stored = Stored::Triangle(corners);
            let is_better = best
                .as_ref()
                .is_none_or(|(other, with)| T::is_before(|| *ray, [(&hit, &stored), (other, with)]));
            if !is_better || !accepts(&hit) {
                return Next::Continue;
            }
            best = Some((hit, stored));
            Next::Shorten(hit.t)
        });
        best.map(|(hit, _)| hit)
    }

    fn each_hit(&self, ray: &Ray, found: &mut dyn FnMut(Hit) -> Next, traversal: &mut Traversal) {
        self.each_triangle_hit::<false>(ray, ray.t_max, traversal, |hit, _| found(hit));
    }

    fn each_primitive(&self, visit: &mut dyn FnMut(PrimId, Primitive)) {
        for instance in &self.instances {
            for triangle in 0..instance.instance.placed.triangle_count() as u32 {
                visit(instance.instance.prim(triangle), instance.primitive::<T>(triangle));
            }
        }
    }

    fn each_near_ray(&self, ray: &Ray, visit: &mut dyn FnMut(PrimId, Primitive), traversal: &mut Traversal) {
        self.each_near::<false>(ray, ray.t_max, traversal, |instance, &(triangle, _)| {
            visit(instance.instance.prim(triangle), instance.primitive::<T>(triangle));
            Next::Continue
        });
    }

    fn each_near_box(
        &self,
        corners: [DVec3; 2],
        limit: &Cell<f64>,
        visit: &mut dyn FnMut(PrimId, Primitive) -> f64,
        Traversal { children, mesh_children, tests, .. }: &mut Traversal,
    ) {
        descend_near(&self.top.nodes, corners, limit.get(), children, tests, |leaf, tests| {
            let (instance, MeshBvh { tree, triangles, .. }) = self.at(leaf);
            let (local, scale) = instance.transform.local_box(corners);
            let nearest = limit.get() * scale;
            descend_near(&tree.nodes, local, nearest, mesh_children, tests, |leaf, tests| {
                for &(triangle, _) in &triangles[leaf.range()] {
                    tests.primitives += 1;
                    visit(instance.instance.prim(triangle), instance.primitive::<T>(triangle));
                }
                limit.get() * scale
            });
            limit.get()
        });
    }

    fn primitive(&self, slot: SlotId) -> Option<Primitive> {
        let after = self.instances.partition_point(|instance| instance.slot <= slot.index());
        let instance = &self.instances[after.checked_sub(1)?];
        Some(instance.primitive::<T>(slot.index() - instance.slot))
    }

    fn describe(&self, flat: Description) -> Description {
        let lists = |prepared: &PreparedInstance| prepared.instance.placed.placement.bytes();
        let own = size_of_val(self.instances.as_slice())
            + self.instances.iter().map(lists).sum::<usize>()
            + size_of_val(self.top.nodes.as_slice())
            + size_of_val(self.order.as_slice());
        let bytes = self.meshes.iter().map(|mesh| mesh.bytes()).sum::<usize>() + own;
        let nodes =
            self.meshes.iter().map(|mesh| mesh.tree.nodes.len()).sum::<usize>() + self.top.nodes.len();
        let slots = self.meshes.iter().map(|mesh| mesh.triangles.len()).sum::<usize>();
        Description {
            layout: "instances",
            isa: flat.isa,
            nodes: flat.nodes + nodes,
            slots: flat.slots + slots,
            bytes: flat.bytes + bytes,
        }
    }

    fn slots_end(&self) -> u32 {
        self.instances.first().map_or(u32::MAX, |instance| instance.slot)
    }
}
