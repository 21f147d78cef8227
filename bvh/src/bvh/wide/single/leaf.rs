//! The primitive tests of one leaf. Used by the single-ray traversal and by streams.

use std::ops::Range;

use crate::bvh::wide::layout::{Child, Content, TriangleLeaf, WIDTH, Wide};
use crate::bvh::{Next, Tests};
use crate::geometry::lanes::{HitN, LANES4, MASK4, RayN};
use crate::geometry::simd::{Doubles, Simd};
use crate::geometry::{AnalyticShape, Hit, PreparedRay, PrimId, Ray, SlotId, Tier, Triangle4};

/// Calls `found` with every hit in a leaf until it returns [`Next::Stop`]. Returns what the traversal does next.
#[inline(always)]
pub(crate) fn hits_in_leaf<T: Tier, S: Simd>(
    wide: &Wide<T>,
    ray: impl Fn() -> Ray,
    prepared: &mut T::Prepared,
    leaf: Child,
    tests: &mut Tests,
    mut found: impl FnMut(Hit) -> Next,
) -> Next {
    let mut next = Next::Continue;
    match leaf.content() {
        Content::Node(_) => {}
        Content::Triangles(triangles) if T::IS_FAST => {
            tests.primitives += triangles.len() as u64;
            next = hits_in_pairs::<T, S>(wide, triangles, prepared, found);
        }
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
                let (Some(shape), prim) = &wide.analytic[index as usize] else { continue };
                let Some(t) = hit_analytic::<T>(&ray(), shape) else { continue };
                match found(Hit {
                    t,
                    prim: *prim,
                    slot: wide.slot_of_analytic(index),
                    barycentrics: [0.0; 2],
                }) {
                    Next::Stop => return Next::Stop,
                    Next::Shorten(t) => {
                        prepared.shorten(t);
                        next = Next::Shorten(t);
                    }
                    Next::Continue => {}
                }
            }
        }
    }
    next
}

/// [`hits_in_leaf`] for the leaves of triangles of a fast tier, two at once.
#[inline(always)]
fn hits_in_pairs<T: Tier, S: Simd>(
    wide: &Wide<T>,
    Range { start, end }: Range<u32>,
    prepared: &mut T::Prepared,
    mut found: impl FnMut(Hit) -> Next,
) -> Next {
    let (mut next, mut first) = (Next::Continue, start);
    while first < end {
        let second = (first + 1).min(end - 1);
        let leaves = [&wide.triangles[first as usize], &wide.triangles[second as usize]];
        let corners = Triangle4::pair::<S>([&leaves[0].corners, &leaves[1].corners], [0, 1, 2]);
        let eight = prepared.hit_in_f32(&corners);
        let mut lanes = if first == second { eight.hit & MASK4 } else { eight.hit };
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % WIDTH;
            lanes &= lanes - 1;
            let prim = PrimId(leaves[lane / LANES4].ids[lane % LANES4]);
            match found(eight.at(lane, prim, SlotId::new(first * LANES4 as u32 + lane as u32))) {
                Next::Stop => return Next::Stop,
                Next::Shorten(t) => {
                    prepared.shorten(t);
                    next = Next::Shorten(t);
                }
                Next::Continue => {}
            }
        }
        first += 2;
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
