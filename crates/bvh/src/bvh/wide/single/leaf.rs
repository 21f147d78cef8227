//! The primitive tests of one leaf. Used by the single-ray traversal and by streams.

use crate::bvh::Next;
use crate::bvh::wide::layout::{Child, Content, TriangleLeaf, Wide};
use crate::geometry::lanes::{HitN, LANES4, RayN};
use crate::geometry::simd::{Doubles, Simd};
use crate::geometry::{AnalyticShape, Hit, PrimId, Ray, SlotId, Tier};

/// Calls `found` with every hit in a leaf until it returns [`Next::Stop`]. Returns what the traversal does next.
#[inline(always)]
pub(crate) fn hits_in_leaf<T: Tier, S: Simd>(
    wide: &Wide<T>,
    ray: &Ray,
    prepared: &T::Prepared,
    leaf: Child,
    found: impl FnMut(Hit) -> Next,
) -> Next {
    match leaf.content() {
        Content::Node(_) => Next::Continue,
        Content::Triangles(_) => {
            let triangles = &wide.triangles[leaf.index()];
            let four = T::hit_triangle4::<S, true>(prepared, &triangles.corners);
            hits_on_triangles::<T, S::D4>(&four, prepared, || *ray, (triangles, leaf.index()), found)
        }
        Content::Analytic(_) => hits_on_shapes(wide, ray, leaf, found),
    }
}

/// [`hits_in_leaf`] for the triangles of the leaf at an index, given what four tests at once found.
#[inline(always)]
pub(crate) fn hits_on_triangles<T: Tier, D: Doubles>(
    four: &HitN<D>,
    prepared: &T::Prepared,
    ray: impl Fn() -> Ray,
    (leaf, index): (&TriangleLeaf<T::Corner>, usize),
    mut found: impl FnMut(Hit) -> Next,
) -> Next {
    let (mut next, mut lanes) = (Next::Continue, four.hit | four.undecided);
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize % LANES4;
        lanes &= lanes - 1;
        let slot = SlotId::new((index * LANES4 + lane) as u32);
        let hit = if four.undecided >> lane & 1 == 0 {
            four.at(lane, PrimId(leaf.ids[lane]), slot)
        } else {
            match hit_triangle::<T>(prepared, &ray(), leaf, slot) {
                Some(hit) => hit,
                None => continue,
            }
        };
        match found(hit) {
            Next::Stop => return Next::Stop,
            Next::Shorten(t) => next = Next::Shorten(t),
            Next::Continue => {}
        }
    }
    next
}

/// [`hits_in_leaf`] for a leaf of analytic shapes.
#[inline(always)]
pub(crate) fn hits_on_shapes<T: Tier>(
    wide: &Wide<T>,
    ray: &Ray,
    leaf: Child,
    mut found: impl FnMut(Hit) -> Next,
) -> Next {
    let mut next = Next::Continue;
    for index in leaf.range() {
        let (Some(shape), prim) = &wide.analytic[index] else { continue };
        let Some(t) = hit_analytic::<T>(ray, shape) else { continue };
        let slot = wide.slot_of_analytic(index as u32);
        match found(Hit { t, prim: *prim, slot, barycentrics: [0.0; 2] }) {
            Next::Stop => return Next::Stop,
            Next::Shorten(t) => next = Next::Shorten(t),
            Next::Continue => {}
        }
    }
    next
}

/// The hit on the triangle in a slot of `leaf`, by the test for one ray. Rarely called: for undecided lanes.
#[inline(never)]
pub(crate) fn hit_triangle<T: Tier>(
    prepared: &T::Prepared,
    ray: &Ray,
    leaf: &TriangleLeaf<T::Corner>,
    slot: SlotId,
) -> Option<Hit> {
    let lane = slot.index() as usize % LANES4;
    let hit = T::hit_triangle(prepared, ray, &leaf.corners.triangle(lane))?;
    Some(Hit { t: hit.t, prim: PrimId(leaf.ids[lane]), slot, barycentrics: hit.barycentrics })
}

/// The distance of an analytic shape.
#[inline(never)]
pub(crate) fn hit_analytic<T: Tier>(ray: &Ray, shape: &AnalyticShape) -> Option<f64> {
    shape.hit(ray, T::NUMERICS)
}

/// [`hit_analytic`] for a ray in each lane.
#[inline(always)]
pub(crate) fn hit_analytic_n<T: Tier, D: Doubles>(rays: &RayN<D>, shape: &AnalyticShape) -> HitN<D> {
    if T::HAS_RAY_N { shape.hit_n(rays) } else { HitN::UNDECIDED }
}
