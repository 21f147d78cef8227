//! [`Bvh::set_user_geometry`]: surfaces with intersection functions of their own ([`UserGeometry`]; here shapes) beside
//! the primitives of a structure.
//!
//! They have a tree of their own, and so do not change how triangles and analytic shapes are stored and traced. That
//! structure is traversed first, then the tree of the shapes, up to the closest hit found before.

#[cfg(test)]
mod tests;

use std::sync::Arc;

use glam::DVec3;

use super::build::build_over;
use super::layered::{Layer, Layered};
use super::wide::{BoxRay, Tree, descend, descend_near};
use super::{
    Accelerator, Bvh, ClosestPoint, Description, Next, NotFinite, Preset, Primitive, SignedHit, Traversal,
};
use crate::geometry::simd::{InstructionSet, Portable, Simd};
use crate::geometry::{
    Bounds, Hit, NO_PRIMITIVE, Numerics, PrimId, Ray, Side, SlotId, Triangle, UserGeometry, clamp_to_bounds,
    is_before_exactly,
};

/// A shape and its bounds.
struct Bounded {
    shape: Arc<dyn UserGeometry>,
    bounds: [DVec3; 2],
}

impl Bounded {
    /// # Errors
    /// [`NotFinite::Bounds`] with the index of the shape.
    fn new((index, shape): (usize, Arc<dyn UserGeometry>)) -> Result<Self, NotFinite> {
        let bounds = shape.bounds();
        let [min, max] = bounds;
        let is_finite = min.as_vec3().is_finite() && max.as_vec3().is_finite();
        let is_box = is_finite && min.cmple(max).all();
        if is_box { Ok(Bounded { shape, bounds }) } else { Err(NotFinite::Bounds(index)) }
    }

    /// Calls `found` with the points between the ray's ends: within the interval in which the ray is inside the bounds.
    fn each_point(&self, ray: &Ray, mut found: impl FnMut(f64, Side)) {
        let line = Ray { t_min: 0.0, t_max: f64::INFINITY, ..*ray };
        let [min, max] = self.bounds;
        self.shape.intersect(&line, &mut |t, side| {
            let within = |t: &f64| ray.t_min < *t && *t < ray.t_max;
            if let Some(t) = clamp_to_bounds(min, max, &line, t).filter(within) {
                found(t, side);
            }
        });
    }
}

/// The shapes of a structure, and a tree over their boxes.
pub(crate) struct Shapes {
    shapes: Vec<Bounded>,
    /// Each leaf is one shape, an index into `order`.
    tree: Tree,
    /// Indices of shapes in the order of the leaves.
    order: Vec<u32>,
    /// The id and the slot of the first.
    first: u32,
    slot: u32,
    instructions: InstructionSet,
}

impl Shapes {
    /// `first` is the first id, and `slots_end` the end of the slots, below which the highest are used.
    ///
    /// # Errors
    /// [`NotFinite::Bounds`] for the first shape whose bounds are no box that is finite in f32; [`NotFinite::Id`] for
    /// the first without an id or a slot.
    fn new(
        shapes: impl IntoIterator<Item = Arc<dyn UserGeometry>>,
        preset: Preset,
        [first, slots_end]: [u32; 2],
    ) -> Result<Self, NotFinite> {
        let shapes: Vec<Bounded> =
            shapes.into_iter().enumerate().map(Bounded::new).collect::<Result<_, _>>()?;
        let boxes: Vec<Bounds> =
            shapes.iter().map(|Bounded { bounds: [min, max], .. }| Bounds::rounded_out(*min, *max)).collect();
        let most = slots_end.min(NO_PRIMITIVE - first);
        let slot =
            u32::try_from(shapes.len()).ok().filter(|count| *count <= most).map(|count| slots_end - count);
        let slot = slot.ok_or(NotFinite::Id(most as usize))?;
        let (tree, order) = build_over(&boxes, preset, 1);
        let instructions = InstructionSet::widest();
        Ok(Shapes { shapes, tree, order, first, slot, instructions })
    }

    /// Calls `visit` with the index of each shape whose box the ray enters before `t_max`, until it returns
    /// [`Next::Stop`]; nearest boxes first if `NEAREST`.
    fn each_near<const NEAREST: bool>(
        &self,
        ray: &Ray,
        t_max: f64,
        traversal: &mut Traversal,
        visit: impl FnMut(usize) -> Next,
    ) {
        match self.instructions.as_avx2() {
            Some(simd) => self.each_near_by::<_, NEAREST>(simd, ray, t_max, traversal, visit),
            None => self.each_near_by::<_, NEAREST>(Portable, ray, t_max, traversal, visit),
        }
    }

    #[inline(always)]
    fn each_near_by<S: Simd, const NEAREST: bool>(
        &self,
        simd: S,
        ray: &Ray,
        t_max: f64,
        Traversal { children, tests, .. }: &mut Traversal,
        mut visit: impl FnMut(usize) -> Next,
    ) {
        let boxes = BoxRay::new(ray, false, false);
        let tree = (&*self.tree.nodes, self.tree.depth);
        simd.run(
            #[inline(always)]
            || {
                descend::<S, false, NEAREST>(tree, &boxes, t_max, false, children, tests, |leaf, _, tests| {
                    tests.primitives += 1;
                    visit(self.order[leaf.index()] as usize)
                })
            },
        );
    }

    fn prim(&self, index: usize) -> PrimId {
        PrimId(self.first + index as u32)
    }

    /// Calls `found` with the first hit of the ray on each shape that it meets before `t_max`, until it returns
    /// [`Next::Stop`]; nearest boxes first if `NEAREST`.
    fn each_first_hit<const NEAREST: bool>(
        &self,
        ray: &Ray,
        t_max: f64,
        traversal: &mut Traversal,
        mut found: impl FnMut(Hit) -> Next,
    ) {
        self.each_near::<NEAREST>(ray, t_max, traversal, |index| {
            let mut least = f64::INFINITY;
            self.shapes[index].each_point(ray, |t, _| least = t.min(least));
            if least == f64::INFINITY {
                return Next::Continue;
            }
            let slot = SlotId::new(self.slot + index as u32);
            found(Hit { t: least, prim: self.prim(index), slot, barycentrics: [0.0; 2] })
        });
    }

    /// Appends the crossings of the ray to those of the other primitives, which are in order from index `first` on, and
    /// orders them by t; at equal t by id, those of one shape as it reported them.
    pub(super) fn add_crossings(
        &self,
        ray: &Ray,
        crossings: &mut Vec<SignedHit>,
        first: usize,
        traversal: &mut Traversal,
    ) {
        let others = crossings.len();
        self.each_near::<false>(ray, ray.t_max, traversal, |index| {
            let prim = self.prim(index);
            self.shapes[index].each_point(ray, |t, side| crossings.push(SignedHit { t, prim, side }));
            Next::Continue
        });
        crossings[others..].sort_by_key(|crossing| crossing.prim);
        crossings[first..].sort_by(|a, b| a.t.total_cmp(&b.t));
    }

    /// The crossings of the ray that leave a shape, less those that enter one.
    pub(super) fn winding_number(&self, ray: &Ray, traversal: &mut Traversal) -> i32 {
        self.sum_of_sides(ray, |_| true, traversal)
    }

    /// The same of the closed shapes alone.
    pub(super) fn winding_number_of_closed(&self, ray: &Ray, traversal: &mut Traversal) -> i32 {
        self.sum_of_sides(ray, |shape| shape.is_closed(), traversal)
    }

    fn sum_of_sides(
        &self,
        ray: &Ray,
        counts: impl Fn(&dyn UserGeometry) -> bool,
        traversal: &mut Traversal,
    ) -> i32 {
        let mut sum = 0;
        self.each_near::<false>(ray, ray.t_max, traversal, |index| {
            let bounded = &self.shapes[index];
            if counts(&*bounded.shape) {
                bounded.each_point(ray, |_, side| sum += if side == Side::Leaving { 1 } else { -1 });
            }
            Next::Continue
        });
        sum
    }

    /// Calls `visit` with the closest points of shapes that are no farther from a point than `limit`, or than the
    /// distance that `visit` returned last, and perhaps of others.
    pub(super) fn each_closest_point(
        &self,
        point: DVec3,
        mut limit: f64,
        visit: &mut dyn FnMut(ClosestPoint) -> f64,
        Traversal { children, tests, .. }: &mut Traversal,
    ) {
        descend_near(&self.tree.nodes, [point; 2], limit, children, tests, |leaf, tests| {
            tests.primitives += 1;
            let index = self.order[leaf.index()] as usize;
            if let Some(on) = self.shapes[index].shape.closest_point(point) {
                limit =
                    visit(ClosestPoint { point: on, distance: on.distance(point), prim: self.prim(index) });
            }
            limit
        });
    }

    /// Appends the shapes whose bounds have a point in common with the box, which is not inverted, in order of id.
    pub(super) fn add_in_box(
        &self,
        ends: [DVec3; 2],
        found: &mut Vec<PrimId>,
        Traversal { children, tests, .. }: &mut Traversal,
    ) {
        let first = found.len();
        descend_near(&self.tree.nodes, ends, 0.0, children, tests, |leaf, _| {
            let index = self.order[leaf.index()] as usize;
            let [min, max] = self.shapes[index].bounds;
            if min.cmple(ends[1]).all() && max.cmpge(ends[0]).all() {
                found.push(self.prim(index));
            }
            0.0
        });
        found[first..].sort_unstable();
    }

    /// The number of shapes that are not closed.
    pub(super) fn open(&self) -> usize {
        self.shapes.iter().filter(|bounded| !bounded.shape.is_closed()).count()
    }

    /// The shape of a slot; `None` for the slots of other primitives.
    pub(super) fn in_slot(&self, slot: SlotId) -> Option<&Arc<dyn UserGeometry>> {
        let index = slot.index().checked_sub(self.slot)?;
        self.shapes.get(index as usize).map(|bounded| &bounded.shape)
    }

    fn get(&self, prim: PrimId) -> Option<&Arc<dyn UserGeometry>> {
        let index = prim.0.checked_sub(self.first)?;
        self.shapes.get(index as usize).map(|bounded| &bounded.shape)
    }
}

impl Layer for Shapes {
    const IS_BESIDE_TREE: bool = true;

    fn closest(
        &self,
        flat: &dyn Accelerator,
        ray: &Ray,
        best: Option<Hit>,
        accepts: &mut dyn FnMut(&Hit) -> bool,
        traversal: &mut Traversal,
    ) -> Option<Hit> {
        let is_exact = flat.numerics() == Numerics::Exact;
        let is_better = |hit: &Hit, best: &Hit| match self.in_slot(best.slot) {
            None if is_exact => is_before_exactly(ray, hit.t, best.t, flat.primitive(best.slot).into()),
            _ => hit.is_before(best),
        };
        let t_max = best.map_or(ray.t_max, |hit| hit.t);
        let mut best = best;
        self.each_first_hit::<true>(ray, t_max, traversal, |hit| {
            if !best.as_ref().is_none_or(|best| is_better(&hit, best)) || !accepts(&hit) {
                return Next::Continue;
            }
            best = Some(hit);
            Next::Shorten(hit.t)
        });
        best
    }

    fn each_hit(&self, ray: &Ray, found: &mut dyn FnMut(Hit) -> Next, traversal: &mut Traversal) {
        self.each_first_hit::<false>(ray, ray.t_max, traversal, found);
    }

    /// A triangle of NaN for a shape: it is none of [`Primitive`].
    fn primitive(&self, slot: SlotId) -> Option<Primitive> {
        self.in_slot(slot).map(|_| Primitive::Triangle(Triangle([DVec3::NAN; 3])))
    }

    fn describe(&self, flat: Description) -> Description {
        let Shapes { shapes, tree, order, .. } = self;
        let bytes =
            size_of_val(shapes.as_slice()) + size_of_val(&*tree.nodes) + size_of_val(order.as_slice());
        Description {
            nodes: flat.nodes + tree.nodes.len(),
            slots: flat.slots + shapes.len(),
            bytes: flat.bytes + bytes,
            ..flat
        }
    }

    fn as_shapes(&self) -> Option<&Shapes> {
        Some(self)
    }
}

impl Bvh {
    /// Replaces the user geometry ([`UserGeometry`]) beside the primitives; none by default. The tree over the
    /// primitives stays. The id of each is the number of primitives plus its index in `shapes`; [`Bvh::update`] and
    /// [`Bvh::set_instances`] keep the user geometry, and number it anew. To move or deform some, call this again.
    ///
    /// Every query of rays finds it, and [`Bvh::user_geometry`] returns it by id; [`Accelerator::primitive`] of its
    /// slots is a triangle of NaN. Crossings at equal t are in order of id. [`Bvh::in_box`] tests its bounds, and
    /// [`Bvh::par_intersecting_triangles`] ignores it. Queries for hits use the first point between the ends of the
    /// ray, and so do filters ([`Bvh::closest_hit_by`]).
    ///
    /// # Errors
    /// [`NotFinite::Bounds`] for the first whose bounds are not finite in f32, or inverted; [`NotFinite::Id`] if there
    /// are too many. Nothing changes.
    pub fn set_user_geometry(
        &mut self,
        shapes: impl IntoIterator<Item = Arc<dyn UserGeometry>>,
    ) -> Result<(), NotFinite> {
        let ends = [self.ids(), self.accelerator.slots_end()];
        let shapes = Shapes::new(shapes, self.layout.preset().unwrap_or_default(), ends)?;
        let flat = self.accelerator.parts().map_or(&self.accelerator, |parts| parts.0).clone();
        self.accelerator =
            if shapes.shapes.is_empty() { flat } else { Arc::new(Layered { flat, layer: shapes }) };
        self.forget_surface();
        Ok(())
    }

    /// The user geometry with an id ([`Bvh::set_user_geometry`]); `None` for other primitives.
    pub fn user_geometry(&self, prim: PrimId) -> Option<&Arc<dyn UserGeometry>> {
        self.own_shapes()?.get(prim)
    }

    /// The user geometry and its tree; `None` without any.
    pub(super) fn own_shapes(&self) -> Option<&Shapes> {
        self.accelerator.parts().map(|parts| parts.1)
    }

    /// All user geometry, in order.
    pub fn user_geometries(&self) -> impl Iterator<Item = &Arc<dyn UserGeometry>> {
        self.own_shapes().into_iter().flat_map(|all| all.shapes.iter().map(|bounded| &bounded.shape))
    }
}
