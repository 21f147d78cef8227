//! The primitive tests of one leaf. Used by the single-ray traversal and by streams.

use crate::bvh::wide::layout::{Child, Content, TriangleLeaf, Wide};
use crate::bvh::{Next, Tests};
use crate::geometry::lanes::{HitN, LANES4, RayN};
use crate::geometry::simd::{Doubles, Simd};
use crate::geometry::{AnalyticShape, Hit, PrimId, Ray, SlotId, Tier};

/// Calls `found` with every hit in a leaf until it returns [`Next::Stop`]. Returns what the traversal does next.
#[inline(always)]
pub(crate) fn hits_in_leaf<T: Tier, S: Simd>(
    wide: &Wide<T>,
    ray: impl Fn() -> Ray,
    prepared: &T::Prepared,
    leaf: Child,
    tests: &mut Tests,
    mut found: impl FnMut(Hit) -> Next,
) -> Next {
    let mut next = Next::Continue;
    match leaf.content() {
        Content::Node(_) => {}
        Content::Triangles(triangles) => {
            tests.primitives += triangles.len() as u64;
            for index in triangles {
                let leaf = &wide.triangles[index as usize];
                let four = T::hit_triangle4::<S::D4>(prepared, &leaf.corners);
                let mut lanes = four.hit | four.undecided;
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize % LANES4;
                    lanes &= lanes - 1;
                    let slot = SlotId::new(index * LANES4 as u32 + lane as u32);
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
            }
        }
        Content::Analytic(shapes) => {
            tests.primitives += shapes.len() as u64;
            for index in shapes {
                let (shape, prim) = &wide.analytic[index as usize];
                let Some(t) = hit_analytic::<T>(&ray(), shape) else { continue };
                match found(Hit {
                    t,
                    prim: *prim,
                    slot: wide.slot_of_analytic(index),
                    barycentrics: [0.0; 2],
                }) {
                    Next::Stop => return Next::Stop,
                    Next::Shorten(t) => next = Next::Shorten(t),
                    Next::Continue => {}
                }
            }
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

/// The distance of an analytic shape. The empty one, which a refit leaves, is missed.
#[inline(never)]
pub(crate) fn hit_analytic<T: Tier>(ray: &Ray, shape: &AnalyticShape) -> Option<f64> {
    if *shape == AnalyticShape::EMPTY { None } else { shape.hit(ray, T::NUMERICS) }
}

/// [`hit_analytic`] for a ray in each lane.
#[inline(always)]
pub(crate) fn hit_analytic_n<T: Tier, D: Doubles>(rays: &RayN<D>, shape: &AnalyticShape) -> HitN<D> {
    match *shape {
        AnalyticShape::EMPTY => HitN::NONE,
        _ if T::HAS_RAY_N => shape.hit_n(rays),
        _ => HitN::UNDECIDED,
    }
}
