//! Every ray against every primitive, several rays at once: for incoherent rays in scenes so small that traversal costs
//! more than it saves.

use super::layout::Wide;
use super::single::leaf::{hit_analytic, hit_analytic_n, hit_triangle};
use crate::bvh::{Next, Tests};
use crate::geometry::lanes::{HitN, LANES4};
use crate::geometry::simd::{Doubles, Simd, Vector};
use crate::geometry::woop_n::PreparedRayN;
use crate::geometry::{Hit, NO_PRIMITIVE, PreparedRay, PrimId, Rays, SlotId, Tier};

/// The most triangle leaves, and the most analytic shapes, that all rays are tested against.
const MAX_LEAVES: usize = 4;

/// Whether the scene is small enough.
pub(crate) fn applies<T: Tier>(wide: &Wide<T>) -> bool {
    T::HAS_RAY_N && wide.triangles.len() <= MAX_LEAVES && wide.analytic.len() <= MAX_LEAVES
}

/// Calls `found` with the index of a ray and each of its hits, until it returns [`Next::Stop`] for that ray.
#[inline(always)]
pub(crate) fn test<T: Tier, S: Simd>(
    wide: &Wide<T>,
    rays: Rays,
    tests: &mut Tests,
    mut found: impl FnMut(usize, Hit) -> Next,
) {
    let mut prepared = PreparedRayN::<S::D>::default();
    for first in (0..rays.len()).step_by(S::D::LANES) {
        let mut active = S::D::ALL >> S::D::LANES.saturating_sub(rays.len() - first);
        prepared.fill(rays, first);
        let triangles = wide.triangles.iter().enumerate().flat_map(|(index, leaf)| {
            let occupied = (0..LANES4).filter(|&lane| leaf.ids[lane] != NO_PRIMITIVE);
            occupied.map(move |lane| (leaf, lane, SlotId::new((index * LANES4 + lane) as u32)))
        });
        for (leaf, lane, slot) in triangles {
            tests.primitives += u64::from(u32::count_ones(active));
            let hits = T::hit_triangle_n(&prepared, &leaf.corners.corners_f64(lane), false);
            active = each_hit(
                active,
                &hits,
                #[inline(always)]
                |place| {
                    if hits.undecided >> place & 1 == 0 {
                        return Some(hits.at(place, PrimId(leaf.ids[lane]), slot));
                    }
                    let ray = &rays.get(first + place);
                    hit_triangle::<T>(&T::Prepared::new(ray), ray, leaf, slot)
                },
                #[inline(always)]
                |place, hit| found(first + place, hit),
            );
        }
        let ray_n = rays.lanes::<S::D>(first);
        for (index, (shape, prim)) in (0..).zip(&wide.analytic) {
            tests.primitives += u64::from(u32::count_ones(active));
            let hits = hit_analytic_n::<T, S::D>(&ray_n, shape);
            active = each_hit(
                active,
                &hits,
                #[inline(always)]
                |place| {
                    let mut hit = hits.at(place, *prim, wide.slot_of_analytic(index));
                    if hits.undecided >> place & 1 != 0 {
                        hit.t = hit_analytic::<T>(&rays.get(first + place), shape)?;
                    }
                    Some(hit)
                },
                #[inline(always)]
                |place, hit| found(first + place, hit),
            );
        }
    }
}

/// Calls `found` with the hits of the active lanes, as `hit` decides them; returns the lanes that are still active.
#[inline(always)]
fn each_hit<D: Doubles>(
    mut active: u32,
    hits: &HitN<D>,
    hit: impl Fn(usize) -> Option<Hit>,
    mut found: impl FnMut(usize, Hit) -> Next,
) -> u32 {
    let mut lanes = (hits.hit | hits.undecided) & active;
    while lanes != 0 {
        let place = lanes.trailing_zeros() as usize % D::LANES;
        lanes &= lanes - 1;
        let Some(hit) = hit(place) else { continue };
        if let Next::Stop = found(place, hit) {
            active &= !(1 << place);
        }
    }
    active
}
