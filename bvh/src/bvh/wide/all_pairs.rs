//! Every ray against every primitive, four rays at once: for incoherent rays in scenes so small that traversal costs
//! more than it saves.

use super::layout::{NO_PRIMITIVE, Wide};
use super::single::leaf::{hit_analytic, hit_analytic_ray4, hit_triangle};
use crate::bvh::{Next, Tests};
use crate::geometry::four::{Hit4, LANES4, Ray4};
use crate::geometry::simd::Simd;
use crate::geometry::woop4::PreparedRay4;
use crate::geometry::{Hit, PrimId, Ray, SlotId, Tier};

/// The most triangle leaves, and the most analytic shapes, that all rays are tested against.
const MAX_LEAVES: usize = 4;

/// Whether the scene is small enough.
pub(crate) fn applies<T: Tier>(wide: &Wide<T>) -> bool {
    T::HAS_RAY4 && wide.triangles.len() <= MAX_LEAVES && wide.analytic.len() <= MAX_LEAVES
}

/// Calls `found` with the index of a ray and each of its hits, until it returns [`Next::Stop`] for that ray.
#[inline(always)]
pub(crate) fn test<T: Tier, S: Simd>(
    wide: &Wide<T>,
    rays: &[Ray],
    prepared: &mut PreparedRay4,
    tests: &mut Tests,
    mut found: impl FnMut(usize, Hit) -> Next,
) {
    for (index, four) in rays.chunks(LANES4).enumerate() {
        let first = index * LANES4;
        let mut active = (1 << four.len()) - 1;
        prepared.fill::<S>(four);
        let triangles = wide.triangles.iter().enumerate().flat_map(|(index, leaf)| {
            let occupied = (0..LANES4).filter(|&lane| leaf.ids[lane] != NO_PRIMITIVE);
            occupied.map(move |lane| (leaf, lane, SlotId::new((index * LANES4 + lane) as u32)))
        });
        for (leaf, lane, slot) in triangles {
            tests.primitives += u64::from(u32::count_ones(active));
            let hits = T::hit_triangle_ray4::<S>(prepared, &leaf.corners.corners_f64(lane), false);
            active = each_hit(
                active,
                &hits,
                #[inline(always)]
                |place| {
                    if hits.undecided >> place & 1 == 0 {
                        return Some(hits.at(place, PrimId(leaf.ids[lane]), slot));
                    }
                    let ray = &four[place % four.len()];
                    hit_triangle::<T>(&T::prepare(ray), ray, leaf, slot)
                },
                #[inline(always)]
                |place, hit| found(first + place, hit),
            );
        }
        let ray4 = Ray4::<S>::new(four, 0);
        for (index, (shape, prim)) in (0..).zip(&wide.analytic) {
            tests.primitives += u64::from(u32::count_ones(active));
            let hits = hit_analytic_ray4::<T, S>(&ray4, shape);
            active = each_hit(
                active,
                &hits,
                #[inline(always)]
                |place| {
                    let mut hit = hits.at(place, *prim, wide.slot_of_analytic(index));
                    if hits.undecided >> place & 1 != 0 {
                        hit.t = hit_analytic::<T>(&four[place % four.len()], shape)?;
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
fn each_hit(
    mut active: u32,
    hits: &Hit4,
    hit: impl Fn(usize) -> Option<Hit>,
    mut found: impl FnMut(usize, Hit) -> Next,
) -> u32 {
    let mut lanes = (hits.hit | hits.undecided) & active;
    while lanes != 0 {
        let place = lanes.trailing_zeros() as usize % LANES4;
        lanes &= lanes - 1;
        let Some(hit) = hit(place) else { continue };
        if let Next::Stop = found(place, hit) {
            active &= !(1 << place);
        }
    }
    active
}
