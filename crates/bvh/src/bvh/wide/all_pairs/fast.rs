//! All pairs in fast tiers: a ray in each lane, one primitive after the other, decided in f32.

use super::index_bits;
use crate::bvh::wide::layout::Wide;
use crate::bvh::wide::results::Results;
use crate::geometry::fast::FastRayN;
use crate::geometry::lanes::{HitN, LANES4, MAX_FLOATS, MAX_LANES};
use crate::geometry::simd::{Doubles, Floats, Simd, TABLE, Vector};
use crate::geometry::{HitBuffer, NO_PRIMITIVE, Rays, Tier};

/// Whether the scene is small enough: at most as many leaves, and as many primitives in them, as for other tiers.
pub(super) fn applies<T: Tier>(wide: &Wide<T>) -> bool {
    wide.triangles.len() + wide.analytic.len() <= TABLE && primitives(wide) <= TABLE
}

/// The number of primitives; parts of a split triangle count as several.
pub(super) fn primitives<T: Tier>(wide: &Wide<T>) -> usize {
    let triangles = wide.triangles.iter().flat_map(|leaf| leaf.ids).filter(|&id| id != NO_PRIMITIVE);
    triangles.count() + wide.analytic.iter().filter(|(shape, _)| shape.is_some()).count()
}

/// A point in all lanes.
#[inline(always)]
fn splat<F: Floats>([x, y, z]: [f64; 3]) -> [F; 3] {
    [F::splat(x as f32), F::splat(y as f32), F::splat(z as f32)]
}

/// Calls `found` with the slot of each primitive and its hits by `rays`, if there are any. It returns whether to go on.
#[inline(always)]
fn each_hit<T: Tier, S: Simd>(
    wide: &Wide<T>,
    rays: &mut FastRayN<S::F>,
    mut found: impl FnMut(&mut FastRayN<S::F>, u32, &HitN<S::F>) -> bool,
) {
    for (index, leaf) in wide.triangles.iter().enumerate() {
        for lane in (0..LANES4).filter(|&lane| leaf.ids[lane] != NO_PRIMITIVE) {
            let [a, b, c] = leaf.corners.corners_f64(lane);
            let corners = [splat(a), splat(b), splat(c)];
            let hits = rays.hit::<true>(&corners);
            if hits.hit != 0 && !found(rays, (index * LANES4 + lane) as u32, &hits) {
                return;
            }
        }
    }
    for (index, (shape, _)) in (0..).zip(&wide.analytic) {
        let Some(shape) = shape else { continue };
        let (hit, t) = shape.hit_in_f32(&rays.origin, &rays.direction, [rays.t_min, rays.t_max]);
        let hits = HitN { hit, t: t.array(), ..HitN::NONE };
        if hit != 0 && !found(rays, wide.slot_of_analytic(index).index(), &hits) {
            return;
        }
    }
}

/// As many numbers as [`Simd::D`] has lanes, from an index on.
#[inline(always)]
fn part<S: Simd>(numbers: &<S::F as Vector>::Array, start: usize) -> <S::D as Vector>::Array {
    S::D::load_f32(&numbers.as_ref()[start..]).array()
}

/// Appends the results of the rays.
#[inline(always)]
pub(super) fn trace<T: Tier, S: Simd>(wide: &Wide<T>, rays: Rays, results: &mut Results) {
    match results {
        Results::Closest(hits) => closest::<T, S>(wide, rays, hits),
        Results::Occluded(occluded) => are_occluded::<T, S>(wide, rays, occluded),
    }
}

#[inline(always)]
fn closest<T: Tier, S: Simd>(wide: &Wide<T>, rays: Rays, hits: &mut HitBuffer) {
    hits.reserve(rays.len());
    for first in (0..rays.len()).step_by(S::F::LANES) {
        let zero = S::F::splat(0.0);
        let (mut any, mut slot, mut barycentrics) = (0, index_bits::<S::F>(0), [zero; 2]);
        let mut group = FastRayN::new::<S::D>(rays, first);
        each_hit::<T, S>(
            wide,
            &mut group,
            #[inline(always)]
            |rays, index, hits| {
                any |= hits.hit;
                rays.t_max = S::F::select(hits.hit, S::F::load(hits.t), rays.t_max);
                slot = S::F::select(hits.hit, index_bits(index), slot);
                for (best, x) in barycentrics.iter_mut().zip(hits.barycentrics) {
                    *best = S::F::select(hits.hit, S::F::load(x), *best);
                }
                true
            },
        );
        let (t, slot, [v, w]) = (group.t_max.array(), slot.array(), barycentrics);
        let (v, w) = (v.array(), w.array());
        let end = S::F::LANES.min(rays.len() - first);
        for start in (0..end).step_by(S::D::LANES) {
            let (mut prims, mut slots) = ([NO_PRIMITIVE; MAX_LANES], [0; MAX_LANES]);
            for lane in (0..S::D::LANES).filter(|lane| any >> (start + lane) & 1 != 0) {
                slots[lane] = slot[start + lane].to_bits();
                prims[lane] = wide.prim_in(slots[lane]);
            }
            let of_half = HitN::<S::D> {
                t: part::<S>(&t, start),
                barycentrics: [part::<S>(&v, start), part::<S>(&w, start)],
                ..HitN::NONE
            };
            hits.append(S::D::LANES.min(end - start), &prims, &slots, &of_half);
        }
    }
}

#[inline(always)]
fn are_occluded<T: Tier, S: Simd>(wide: &Wide<T>, rays: Rays, occluded: &mut Vec<bool>) {
    for first in (0..rays.len()).step_by(S::F::LANES) {
        let count = S::F::LANES.min(rays.len() - first);
        let mut open = S::F::ALL >> (S::F::LANES - count);
        each_hit::<T, S>(
            wide,
            &mut FastRayN::new::<S::D>(rays, first),
            #[inline(always)]
            |_, _, hits| {
                open &= !hits.hit;
                open != 0
            },
        );
        let of_group: [bool; MAX_FLOATS] = std::array::from_fn(|lane| open >> lane & 1 == 0);
        occluded.extend_from_slice(&of_group[..count]);
    }
}
