//! Meshes that stand in many places: a tree over the places, and one tree over each mesh.
//!
//! What is not shared is in a structure of its own, which is asked first. Boxes are tested in the space of the mesh,
//! triangles in the world, with the arithmetic that moves a copy: so each hit is the hit of a mesh that was copied and
//! moved, to the bit. Boxes are met as if larger by all that this arithmetic rounds ([`space`]), so none is passed over
//! that holds the first hit.

mod bottom;
mod space;
mod walk;

use std::cell::Cell;
use std::collections::HashMap;
use std::sync::Arc;

use glam::{DMat3, Vec3A};
use obvhs::bvh2::node::Bvh2Node;

use super::Preset;
use super::build::build_nodes;
use super::{Accelerator, Description, Primitive, Quality, Slot, Traversal};
use crate::geometry::{
    Bounds, BoxTest, Corner, Hit, Numerics, PrimId, Ray, SlotId, Stored, Tier, Triangle, prune_distance,
};
use crate::scene::{Mesh, Placed};
use bottom::Bottom;
use space::Frame;
pub use space::MeshSpace;
use walk::{Step, walk};

/// A mesh in one of its places.
pub struct Instance {
    /// Which, and where.
    pub placed: Placed,
    /// The number of its first triangle.
    pub first: PrimId,
}

impl Instance {
    /// The number of a triangle of the mesh.
    fn prim(&self, triangle: u32) -> PrimId {
        PrimId(self.first.0 + triangle)
    }

    /// Every triangle, as if it were not shared.
    pub(super) fn slots<C: Corner>(&self) -> impl Iterator<Item = Slot> {
        (0..self.placed.triangle_count() as u32).map(|triangle| {
            let corners = self.placed.corners_of(triangle).map(|corner| C::lower(corner).raise());
            Slot { primitive: Primitive::Triangle(Triangle(corners)), id: self.prim(triangle) }
        })
    }
}

/// Whether a mesh in one of its places can be an [`Instance`]. To one that is squeezed flat no ray can be brought back.
pub fn can_be_instance(placed: &Placed, space: &MeshSpace, numerics: Numerics) -> bool {
    Frame::new(placed, space, numerics).is_some()
}

/// Where the trees of two levels keep what waits.
#[derive(Debug, Default)]
pub struct Stacks {
    top: Vec<(u32, f32)>,
    bottom: Vec<(u32, f32)>,
}

/// An instance with what rays need of it.
struct Ready {
    instance: Instance,
    frame: Frame,
    /// Which mesh.
    bottom: u32,
    /// The slot of the first triangle of its mesh.
    slot: u32,
}

/// A structure for what is not shared, and two levels of trees for what is.
pub struct Instances<T: Tier> {
    flat: Box<dyn Accelerator>,
    ready: Vec<Ready>,
    bottoms: Vec<Bottom>,
    top: Vec<Bvh2Node>,
    /// Instances in the order of the leaves.
    order: Vec<u32>,
    tier: std::marker::PhantomData<T>,
}

impl<T: Tier> Instances<T> {
    /// `flat` and these, of which each [`can_be_instance`].
    pub fn new(flat: Box<dyn Accelerator>, instances: Vec<Instance>, preset: Preset) -> Self {
        // The last numbers, whatever slots the other structure has.
        let triangles: usize = instances.iter().map(|i| i.placed.mesh.triangles.len()).sum();
        let triangles = u32::try_from(triangles).expect("primitives are numbered with 32 bits");
        let mut slot = u32::MAX - triangles;
        let mut places: HashMap<*const Mesh, (u32, MeshSpace)> = HashMap::new();
        let mut meshes: Vec<(Arc<Mesh>, MeshSpace, DMat3)> = Vec::new();
        let mut ready = Vec::with_capacity(instances.len());
        for instance in instances {
            let mesh = &instance.placed.mesh;
            let (bottom, space) = *places.entry(Arc::as_ptr(mesh)).or_insert_with(|| {
                let space = MeshSpace::of(mesh).expect("a mesh that can be an instance");
                meshes.push((mesh.clone(), space, DMat3::ZERO));
                (meshes.len() as u32 - 1, space)
            });
            let frame = Frame::new(&instance.placed, &space, T::NUMERICS).expect("it can be an instance");
            let spread = &mut meshes[bottom as usize].2;
            let [x, y, z] = [0, 1, 2].map(|k| spread.col(k).max(frame.spread().col(k)));
            *spread = DMat3::from_cols(x, y, z);
            let first = slot;
            slot += mesh.triangles.len() as u32;
            ready.push(Ready { instance, frame, bottom, slot: first });
        }
        let bottoms: Vec<Bottom> = meshes
            .into_iter()
            .map(|(mesh, space, spread)| {
                // Hits lie on their triangle, but where they are only known to lie in the box around it.
                let spread = if T::IS_TIGHT { DMat3::ZERO } else { spread };
                Bottom::new(mesh, &space, &spread, preset)
            })
            .collect();
        let boxes: Vec<Bounds> =
            ready.iter().map(|ready| bottoms[ready.bottom as usize].in_world(&ready.frame)).collect();
        let mut parameters = preset.parameters();
        // A box is cheaper than a mesh.
        parameters.max_prims_per_leaf = 1;
        let (top, order) = build_nodes(&boxes, parameters);
        Instances { flat, ready, bottoms, top, order, tier: std::marker::PhantomData }
    }

    /// Calls `found` with every hit on an instance that no box is passed over for: all that lie before `t_max`, and before
    /// what `found` says from then on; it says `None` where nothing more is wanted.
    #[inline(always)]
    fn each_hit(
        &self,
        ray: &Ray,
        t_max: f64,
        traversal: &mut Traversal,
        mut found: impl FnMut(Hit, [T::Corner; 3]) -> Option<f64>,
    ) {
        let Traversal { instances: Stacks { top, bottom }, tests, .. } = traversal;
        let boxes = T::Boxes::new(ray);
        let mut prepared: Option<T::Prepared> = None;
        let mut count = 0;
        let t_max = Cell::new(t_max);
        let enters = |min: Vec3A, max: Vec3A, t_max: f32| boxes.enters(min, max, t_max);
        walk(&self.top, prune_distance(t_max.get()), top, &mut count, enters, |leaf, enter| {
            for &index in &self.order[leaf.start as usize..leaf.end as usize] {
                let Ready { instance, frame, bottom: mesh, slot } = &self.ready[index as usize];
                let Bottom { mesh, nodes, triangles } = &self.bottoms[*mesh as usize];
                let (boxes, start) = frame.local(ray, enter);
                // With room for the rounding of the difference.
                let local = || prune_distance(t_max.get() - start + t_max.get() * f64::EPSILON);
                let enters = |min: Vec3A, max: Vec3A, t_max: f32| boxes.enters(min, max, t_max);
                let visit = |leaf: std::ops::Range<u32>, _| {
                    let leaf = &triangles[leaf.start as usize..leaf.end as usize];
                    tests.primitives += leaf.len() as u64;
                    let before = t_max.get();
                    for (triangle, corners) in leaf {
                        let corner = |i: u32| {
                            T::Corner::lower(instance.placed.placement.point(mesh.positions[i as usize]))
                        };
                        let corners = corners.map(corner);
                        let prepared = prepared.get_or_insert_with(|| T::prepare(ray));
                        if let Some(hit) = T::hit_triangle(prepared, ray, &corners) {
                            let (prim, slot) = (instance.prim(*triangle), SlotId(slot + triangle));
                            match found(Hit { t: hit.t, prim, slot, weights: hit.weights }, corners) {
                                Some(t) => t_max.set(t),
                                None => return Step::Stop,
                            }
                        }
                    }
                    if t_max.get() < before { Step::Prune(local()) } else { Step::Go }
                };
                let step = walk(nodes, local(), bottom, &mut tests.nodes, enters, visit);
                if let Step::Stop = step {
                    return Step::Stop;
                }
            }
            Step::Prune(prune_distance(t_max.get()))
        });
        tests.nodes += count;
    }

    /// The closest hit of all, given that of `flat`.
    fn closest(&self, ray: &Ray, flat: Option<Hit>, traversal: &mut Traversal) -> Option<Hit> {
        let stored = |hit: Hit| match self.flat.primitive(hit.slot) {
            Primitive::Triangle(Triangle(corners)) => Stored::Triangle(corners.map(T::Corner::lower)),
            Primitive::Sphere(sphere) => Stored::Sphere(sphere),
        };
        let mut best: Option<(Hit, Stored<T::Corner>)> = flat.map(|hit| (hit, stored(hit)));
        let t_max = best.map_or(ray.t_max, |(hit, _)| hit.t);
        self.each_hit(ray, t_max, traversal, |hit, corners| {
            let stored = Stored::Triangle(corners);
            let is_better =
                best.as_ref().is_none_or(|(other, with)| T::is_before(ray, [(&hit, &stored), (other, with)]));
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

    fn closest_hits(&self, rays: &[Ray], hits: &mut Vec<Option<Hit>>, traversal: &mut Traversal) {
        let first = hits.len();
        self.flat.closest_hits(rays, hits, traversal);
        for (ray, hit) in rays.iter().zip(&mut hits[first..]) {
            *hit = self.closest(ray, *hit, traversal);
        }
    }

    fn are_occluded(&self, rays: &[Ray], occluded: &mut Vec<bool>, traversal: &mut Traversal) {
        let first = occluded.len();
        self.flat.are_occluded(rays, occluded, traversal);
        for (ray, occluded) in rays.iter().zip(&mut occluded[first..]) {
            *occluded = *occluded || self.is_any_hit(ray, traversal);
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
        let after = self.ready.partition_point(|ready| ready.slot <= slot.0);
        match after.checked_sub(1).map(|index| &self.ready[index]) {
            None => self.flat.primitive(slot),
            Some(ready) => {
                let corners = ready.instance.placed.corners_of(slot.0 - ready.slot);
                Primitive::Triangle(Triangle(corners.map(|p| T::Corner::lower(p).raise())))
            }
        }
    }

    fn numerics(&self) -> Numerics {
        T::NUMERICS
    }

    fn quality(&self) -> Option<Quality> {
        // Two levels and a structure beside them have no area in common to measure by.
        None
    }

    fn describe(&self) -> Description {
        let flat = self.flat.describe();
        let lists = |ready: &Ready| ready.instance.placed.placement.bytes();
        let own = size_of_val(self.ready.as_slice())
            + self.ready.iter().map(lists).sum::<usize>()
            + size_of_val(self.top.as_slice())
            + size_of_val(self.order.as_slice());
        let bytes = self.bottoms.iter().map(Bottom::bytes).sum::<usize>() + own;
        let nodes = self.bottoms.iter().map(|bottom| bottom.nodes.len()).sum::<usize>() + self.top.len();
        let slots = self.bottoms.iter().map(|bottom| bottom.triangles.len()).sum::<usize>();
        Description {
            layout: "instances",
            isa: flat.isa,
            nodes: flat.nodes + nodes,
            slots: flat.slots + slots,
            bytes: flat.bytes + bytes,
        }
    }
}
