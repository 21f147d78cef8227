//! Every ray against every primitive, a vector of rays at once: for incoherent rays in scenes so small that traversal
//! costs more than it saves.
//!
//! 1. Estimates in f32 ([`crate::geometry::estimate`]) find, for each ray, the primitive that it certainly hits first, and
//!    up to [`OPEN`] undecided ones. Most often the ray starts on one, and a shadow ray ends at another.
//! 2. f64 decides which undecided primitives lie behind the origin ([`crate::geometry::plane`]).
//! 3. The tier's test decides the others, and computes the hit: eight rays at once, with a primitive each
//!    ([`SmallLeafBatch`]). Rays with more undecided primitives are traced one by one.
//!
//! In fast tiers f32 decides ([`fast`]).

mod fast;
mod primitives;

use super::layout::Wide;
use super::results::Results;
use crate::bvh::{Accelerator, Traversal};
use crate::geometry::estimate::{Errors, RaysInF32};
use crate::geometry::lanes::MAX_LANES;
use crate::geometry::simd::{Floats, Simd, TABLE, Vector};
use crate::geometry::{HitBuffer, NO_PRIMITIVE, Rays, Tier};
use primitives::NONE;
pub(crate) use primitives::SmallLeafBatch;

/// The undecided primitives of a ray that are kept.
const OPEN: usize = 2;

/// The undecided primitives of each ray of a group.
struct Open<F> {
    /// Indices as the bits of f32 numbers: selected as numbers are.
    indices: [F; OPEN],
    /// The rays that have at least one, two and so on.
    has: [u32; OPEN],
    /// The rays that have too many.
    overflown: u32,
}

impl<F: Floats> Open<F> {
    #[inline(always)]
    fn new() -> Self {
        Open { indices: [index_bits(0); OPEN], has: [0; OPEN], overflown: 0 }
    }

    #[inline(always)]
    fn add(&mut self, mut rays: u32, index: u32) {
        for (indices, has) in self.indices.iter_mut().zip(&mut self.has) {
            let first = rays & !*has;
            *indices = F::select(first, index_bits(index), *indices);
            rays &= *has;
            *has |= first;
        }
        self.overflown |= rays;
    }
}

/// An index as the bits of f32 numbers.
#[inline(always)]
fn index_bits<F: Floats>(index: u32) -> F {
    F::splat(f32::from_bits(index))
}

/// A part of a group of rays: as many as [`Simd::D`] has lanes.
struct Part {
    /// The index of its first ray in the group.
    start: usize,
    /// The number of its rays.
    count: usize,
}

impl Part {
    /// The parts of a group of `count` rays.
    #[inline(always)]
    fn each<S: Simd>(count: usize, mut visit: impl FnMut(Part)) {
        for start in (0..count.min(S::F::LANES)).step_by(S::D::LANES) {
            visit(Part { start, count: (count - start).min(S::D::LANES) });
        }
    }

    /// Its bits of a group's mask.
    #[inline(always)]
    fn of(&self, group: u32) -> u32 {
        group >> self.start & u32::MAX >> (u32::BITS as usize - self.count)
    }

    /// The indices of its rays.
    #[inline(always)]
    fn indices<S: Simd>(&self, of_group: &<S::F as Vector>::Array) -> [u32; MAX_LANES] {
        let mut indices = [0; MAX_LANES];
        for (to, x) in indices.iter_mut().zip(&of_group.as_ref()[self.start..self.start + S::D::LANES]) {
            *to = x.to_bits();
        }
        indices
    }
}

/// Whether the scene is small enough.
#[inline(always)]
pub(crate) fn applies<T: Tier>(wide: &Wide<T>) -> bool {
    wide.batch.is_some() || T::IS_FAST && fast::applies(wide)
}

/// The number of tests of some rays.
#[inline(always)]
fn tests<T: Tier>(wide: &Wide<T>, rays: Rays) -> u64 {
    let primitives = wide.batch.as_ref().map_or_else(|| fast::primitives(wide), |batch| batch.len());
    (rays.len() * primitives) as u64
}

/// Appends the results of the rays. [`applies`] must hold.
#[inline(always)]
pub(crate) fn trace<T: Tier, S: Simd>(
    simd: S,
    wide: &Wide<T>,
    rays: Rays,
    results: &mut Results,
    traversal: &mut Traversal,
) {
    traversal.tests.primitives += tests(wide, rays);
    simd.run(
        #[inline(always)]
        || {
            let Some(batch) = &wide.batch else { return fast::trace::<T, S>(wide, rays, results) };
            let mut of_rays = [Errors::NONE; TABLE];
            let scene = (wide, &**batch, batch.errors::<S::D>(rays, &mut of_rays));
            let groups = (0..rays.len()).step_by(S::F::LANES);
            match results {
                Results::Closest(hits) => {
                    hits.reserve(rays.len());
                    for first in groups {
                        closest_of_group::<T, S>(scene, rays, first, hits, traversal);
                    }
                }
                Results::Occluded(occluded) => {
                    for first in groups {
                        let hit = occluded_of_group::<T, S>(scene, rays, first, traversal);
                        let count = S::F::LANES.min(rays.len() - first);
                        occluded.extend((0..count).map(|lane| hit >> lane & 1 != 0));
                    }
                }
            }
        },
    );
}

#[inline(always)]
fn closest_of_group<T: Tier, S: Simd>(
    (wide, batch, errors): (&Wide<T>, &SmallLeafBatch, &[Errors; TABLE]),
    rays: Rays,
    first: usize,
    hits: &mut HitBuffer,
    traversal: &mut Traversal,
) {
    let group = RaysInF32::<S::F>::new::<S::D>(rays, first);
    let mut open = Open::<S::F>::new();
    let (mut near, mut far, mut best) = (group.t_max, group.t_max, index_bits::<S::F>(NONE));
    batch.each(
        errors,
        &group,
        #[inline(always)]
        |index, estimate| {
            let farther = estimate.certain & far.le(estimate.near);
            let nearer = estimate.certain & estimate.far.lt(near);
            near = S::F::select(nearer, estimate.near, near);
            far = S::F::select(nearer, estimate.far, far);
            best = S::F::select(nearer, index_bits(index), best);
            open.add(estimate.possible & !(farther | nearer), index);
        },
    );
    let best = best.array();
    let indices = [open.indices[0].array(), open.indices[1].array()];
    Part::each::<S>(
        rays.len() - first,
        #[inline(always)]
        |part| {
            let lanes = rays.lanes::<S::D>(first + part.start);
            let mut found = part.indices::<S>(&best);
            let mut has_best = 0;
            for (lane, &index) in found.iter().enumerate().take(part.count) {
                has_best |= u32::from(index != NONE) << lane;
            }
            let mut unsure = part.of(open.overflown | !group.supported);
            let mut nearest = batch.hit(&lanes, &found, has_best);
            // Lanes that the test of several rays leaves undecided.
            unsure |= has_best & !nearest.hit;
            for (indices, has) in indices.iter().zip(open.has) {
                let indices = part.indices::<S>(indices);
                let is_open = batch.ahead(&lanes, &indices, part.of(has) & !unsure);
                if is_open == 0 {
                    continue;
                }
                let other = batch.hit(&lanes, &indices, is_open);
                let (t, of_other) = (S::D::load(nearest.t), S::D::load(other.t));
                // The order of equal distances is left to the tier.
                unsure |= other.undecided | nearest.hit & other.hit & t.le(of_other) & of_other.le(t);
                let is_nearer = other.hit & (!nearest.hit | of_other.lt(t));
                nearest.hit |= is_nearer;
                nearest.select(is_nearer, &other);
                for (lane, (to, index)) in found.iter_mut().zip(indices).enumerate() {
                    *to = if is_nearer >> lane & 1 != 0 { index } else { *to };
                }
            }
            let (mut prims, mut slots) = ([NO_PRIMITIVE; MAX_LANES], [0; MAX_LANES]);
            for (lane, &index) in found.iter().enumerate().take(S::D::LANES) {
                let index = if nearest.hit >> lane & 1 != 0 { index } else { NONE } as usize % (TABLE + 1);
                (prims[lane], slots[lane]) = (batch.prims[index], batch.slots[index]);
            }
            let before = hits.len();
            hits.append(part.count, &prims, &slots, &nearest);
            while unsure != 0 {
                let lane = unsure.trailing_zeros() as usize;
                unsure &= unsure - 1;
                let hit = wide.closest_hit(&rays.get(first + part.start + lane), traversal);
                hits.set(before + lane, hit.as_ref());
            }
        },
    );
}

/// The rays of a group that hit anything.
#[inline(always)]
fn occluded_of_group<T: Tier, S: Simd>(
    (wide, batch, errors): (&Wide<T>, &SmallLeafBatch, &[Errors; TABLE]),
    rays: Rays,
    first: usize,
    traversal: &mut Traversal,
) -> u32 {
    let group = RaysInF32::<S::F>::new::<S::D>(rays, first);
    let mut open = Open::<S::F>::new();
    let mut certain = 0;
    batch.each(
        errors,
        &group,
        #[inline(always)]
        |index, estimate| {
            let beyond = estimate.certain & group.t_max.le(estimate.near);
            let hit = estimate.certain & estimate.far.lt(group.t_max);
            certain |= hit;
            open.add(estimate.possible & !(beyond | hit), index);
        },
    );
    certain &= group.supported;
    let indices = [open.indices[0].array(), open.indices[1].array()];
    let mut all = 0;
    Part::each::<S>(
        rays.len() - first,
        #[inline(always)]
        |part| {
            let lanes = rays.lanes::<S::D>(first + part.start);
            let mut hit = part.of(certain);
            let mut unsure = part.of(open.overflown | !group.supported) & !hit;
            let indices = [part.indices::<S>(&indices[0]), part.indices::<S>(&indices[1])];
            let decided = hit | unsure;
            let is_open = [
                batch.ahead(&lanes, &indices[0], part.of(open.has[0]) & !decided),
                batch.ahead(&lanes, &indices[1], part.of(open.has[1]) & !decided),
            ];
            // Most rays have one left: all of these are tested together.
            let [mut first_open, second_open] = indices;
            for (lane, to) in first_open.iter_mut().enumerate() {
                *to = if is_open[0] >> lane & 1 != 0 { *to } else { second_open[lane] };
            }
            let found = batch.hit(&lanes, &first_open, is_open[0] | is_open[1]);
            hit |= found.hit;
            unsure |= found.undecided;
            let found = batch.hit(&lanes, &second_open, is_open[0] & is_open[1] & !hit);
            hit |= found.hit;
            unsure = (unsure | found.undecided) & !hit;
            while unsure != 0 {
                let lane = unsure.trailing_zeros() as usize;
                unsure &= unsure - 1;
                let ray = rays.get(first + part.start + lane);
                hit |= u32::from(wide.is_occluded(&ray, traversal)) << lane;
            }
            all |= hit << part.start;
        },
    );
    all
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::bvh::build::build_wide;
    use crate::bvh::splitmix64::splitmix64;
    use crate::bvh::stored_slot::StoredSlot;
    use crate::bvh::{Preset, Primitive, Slot};
    use crate::geometry::simd::InstructionSet;
    use crate::geometry::{Fast, PrimId, Triangle, Watertight};

    fn applies_to<T: Tier>(count: u32) -> bool {
        let number = |i: u32| splitmix64(u64::from(i)) as f64 / 2f64.powi(64);
        let point = |i: u32| DVec3::new(number(3 * i), number(3 * i + 1), number(3 * i + 2));
        let triangle = |id: u32| Triangle([0, 1, 2].map(|corner| point(3 * id + corner)));
        let slot = |id: u32| Slot { primitive: Primitive::Triangle(triangle(id)), id: PrimId(id) };
        let slots: Vec<_> = (0..count).map(|id| StoredSlot::<T::Corner>::new(slot(id))).collect();
        applies(&build_wide::<T>(&slots, Preset::default(), InstructionSet::widest()))
    }

    /// Leaves of triangles have room for four and are seldom full.
    #[test]
    fn all_pairs_are_tested_in_as_small_scenes_in_fast_tiers() {
        for count in 1..=40 {
            let is_small = count as usize <= TABLE;
            assert_eq!(
                [applies_to::<Watertight>(count), applies_to::<Fast>(count)],
                [is_small; 2],
                "{count}"
            );
        }
    }
}
