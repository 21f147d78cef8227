//! [`Layered`]: a structure, and primitives of another kind beside it.

use std::cell::Cell;
use std::sync::Arc;

use glam::DVec3;

use super::shapes::Shapes;
use super::{Accelerator, Description, Nearby, Next, Primitive, Quality, Traversal};
use crate::geometry::{Hit, HitBuffer, LineTest, Numerics, PrimId, Ray, Rays, SlotId};

/// Primitives beside those of a structure, which is traversed first: instances, or user geometry.
pub(super) trait Layer: Send + Sync {
    /// Whether the structure is one tree, which traces streams, can be refitted and has a quality.
    const IS_BESIDE_TREE: bool;

    /// The closest hit, given the structure's, of those that `accepts` returns `true` for.
    fn closest(
        &self,
        flat: &dyn Accelerator,
        ray: &Ray,
        best: Option<Hit>,
        accepts: &mut dyn FnMut(&Hit) -> bool,
        traversal: &mut Traversal,
    ) -> Option<Hit>;

    /// Calls `found` with every hit, until it returns [`Next::Stop`].
    fn each_hit(&self, ray: &Ray, found: &mut dyn FnMut(Hit) -> Next, traversal: &mut Traversal);

    /// Calls `visit` with every primitive of a kind that a structure stores.
    fn each_primitive(&self, _visit: &mut dyn FnMut(PrimId, Primitive)) {}

    /// See [`Nearby::each_near_ray`].
    fn each_near_ray(
        &self,
        _ray: &Ray,
        _visit: &mut dyn FnMut(PrimId, Primitive),
        _traversal: &mut Traversal,
    ) {
    }

    /// See [`Nearby::each_near_box`]; `visit` sets `limit`.
    fn each_near_box(
        &self,
        _corners: [DVec3; 2],
        _limit: &Cell<f64>,
        _visit: &mut dyn FnMut(PrimId, Primitive) -> f64,
        _traversal: &mut Traversal,
    ) {
    }

    /// The primitive of a slot; `None` for those of the structure.
    fn primitive(&self, slot: SlotId) -> Option<Primitive>;

    /// The description of both.
    fn describe(&self, flat: Description) -> Description;

    /// The user geometry, if it is that.
    fn as_shapes(&self) -> Option<&Shapes> {
        None
    }

    /// See [`Nearby::slots_end`].
    fn slots_end(&self) -> u32 {
        u32::MAX
    }
}

/// A structure and a layer.
pub(super) struct Layered<L> {
    pub flat: Arc<dyn Accelerator>,
    pub layer: L,
}

impl<L: Layer> Layered<L> {
    /// Whether the layer has a hit that `accepts` returns `true` for.
    fn is_hit(&self, ray: &Ray, accepts: &mut dyn FnMut(PrimId) -> bool, traversal: &mut Traversal) -> bool {
        let mut any = false;
        let mut found = |hit: Hit| {
            any = accepts(hit.prim);
            if any { Next::Stop } else { Next::Continue }
        };
        self.layer.each_hit(ray, &mut found, traversal);
        any
    }
}

impl<L: Layer> Nearby for Layered<L> {
    fn every_primitive(&self, visit: &mut dyn FnMut(PrimId, Primitive)) {
        self.flat.each_primitive(visit);
        self.layer.each_primitive(visit);
    }

    fn each_near_ray(
        &self,
        ray: &LineTest,
        visit: &mut dyn FnMut(PrimId, Primitive),
        traversal: &mut Traversal,
    ) {
        self.flat.each_near_ray(ray, visit, traversal);
        self.layer.each_near_ray(&ray.ray, visit, traversal);
    }

    fn each_near_rays(
        &self,
        rays: Rays,
        visit: &mut dyn FnMut(usize, &LineTest, PrimId, Primitive),
        traversal: &mut Traversal,
    ) {
        self.flat.each_near_rays(rays, visit, traversal);
        if L::IS_BESIDE_TREE {
            return;
        }
        for (index, ray) in rays.iter().enumerate() {
            let test = LineTest::new(&ray);
            let mut visit = |prim, primitive| visit(index, &test, prim, primitive);
            self.layer.each_near_ray(&ray, &mut visit, traversal);
        }
    }

    fn each_near_box(
        &self,
        corners: [DVec3; 2],
        limit: f64,
        visit: &mut dyn FnMut(PrimId, Primitive) -> f64,
        traversal: &mut Traversal,
    ) {
        let limit = Cell::new(limit);
        let mut visit = |prim, primitive| {
            limit.set(visit(prim, primitive));
            limit.get()
        };
        self.flat.each_near_box(corners, limit.get(), &mut visit, traversal);
        self.layer.each_near_box(corners, &limit, &mut visit, traversal);
    }

    fn closest_hit_by(
        &self,
        ray: &Ray,
        accepts: &mut dyn FnMut(&Hit) -> bool,
        traversal: &mut Traversal,
    ) -> Option<Hit> {
        let flat = self.flat.closest_hit_by(ray, accepts, traversal);
        self.layer.closest(&*self.flat, ray, flat, accepts, traversal)
    }

    fn parts(&self) -> Option<(&Arc<dyn Accelerator>, &Shapes)> {
        self.layer.as_shapes().map(|shapes| (&self.flat, shapes))
    }

    fn slots_end(&self) -> u32 {
        self.layer.slots_end().min(self.flat.slots_end())
    }
}

impl<L: Layer> Accelerator for Layered<L> {
    fn closest_hit(&self, ray: &Ray, traversal: &mut Traversal) -> Option<Hit> {
        let flat = self.flat.closest_hit(ray, traversal);
        self.layer.closest(&*self.flat, ray, flat, &mut |_| true, traversal)
    }

    fn is_occluded(&self, ray: &Ray, traversal: &mut Traversal) -> bool {
        self.flat.is_occluded(ray, traversal) || self.is_hit(ray, &mut |_| true, traversal)
    }

    fn is_occluded_by(
        &self,
        ray: &Ray,
        accepts: &mut dyn FnMut(PrimId) -> bool,
        traversal: &mut Traversal,
    ) -> bool {
        self.flat.is_occluded_by(ray, accepts, traversal) || self.is_hit(ray, accepts, traversal)
    }

    fn closest_hits(&self, rays: Rays, hits: &mut HitBuffer, traversal: &mut Traversal) {
        let first = hits.len();
        self.flat.closest_hits(rays, hits, traversal);
        for (index, ray) in (first..).zip(rays.iter()) {
            let hit = self.layer.closest(&*self.flat, &ray, hits.get(index), &mut |_| true, traversal);
            hits.set(index, hit.as_ref());
        }
    }

    fn are_occluded(&self, rays: Rays, occluded: &mut Vec<bool>, traversal: &mut Traversal) {
        let first = occluded.len();
        self.flat.are_occluded(rays, occluded, traversal);
        for (ray, occluded) in rays.iter().zip(&mut occluded[first..]) {
            *occluded = *occluded || self.is_hit(&ray, &mut |_| true, traversal);
        }
    }

    fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>, traversal: &mut Traversal) {
        self.flat.all_hits(ray, hits, traversal);
        let mut found = |hit| {
            hits.push(hit);
            Next::Continue
        };
        self.layer.each_hit(ray, &mut found, traversal);
    }

    fn each_hit(&self, rays: Rays, hits: &mut Vec<(usize, Hit)>, traversal: &mut Traversal) {
        self.flat.each_hit(rays, hits, traversal);
        for (index, ray) in rays.iter().enumerate() {
            let mut found = |hit| {
                hits.push((index, hit));
                Next::Continue
            };
            self.layer.each_hit(&ray, &mut found, traversal);
        }
    }

    fn has_streams(&self) -> bool {
        L::IS_BESIDE_TREE && self.flat.has_streams()
    }

    fn primitive(&self, slot: SlotId) -> Primitive {
        self.layer.primitive(slot).unwrap_or_else(|| self.flat.primitive(slot))
    }

    fn numerics(&self) -> Numerics {
        self.flat.numerics()
    }

    fn refit(&mut self, primitive: &(dyn Fn(PrimId) -> Primitive + Sync)) -> Option<f64> {
        if L::IS_BESIDE_TREE { Arc::get_mut(&mut self.flat)?.refit(primitive) } else { None }
    }

    fn quality(&self) -> Option<Quality> {
        if L::IS_BESIDE_TREE { self.flat.quality() } else { None }
    }

    fn describe(&self) -> Description {
        self.layer.describe(self.flat.describe())
    }
}
