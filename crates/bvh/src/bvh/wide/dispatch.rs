//! [`Accelerator`] for the BVH8: chooses the traversal for the rays of a call, and the instruction set.
//!
//! They are cut into packets. A packet whose rays have nothing in common, or that is abandoned, is traced by all
//! pairs if the scene is small, else as a stream, with such packets beside it, else ray by ray.

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;

use super::layout::Wide;
use super::packet::{self, Outcome};
use super::results::Results;
use super::single;
use super::stream::{self, AllHits, ClosestHits, Occlusion, RayMask};
use super::{all_pairs, near_box, near_ray};
use crate::bvh::{Accelerator, Bvh, Description, Nearby, Next, Primitive, Quality, Traversal, saved};
use crate::geometry::simd::{InstructionSet, Portable};
use crate::geometry::{BATCH, Hit, HitBuffer, LineTest, Numerics, PACKET, PrimId, Ray, Rays, SlotId, Tier};

/// Fewer rays are not traced as a packet.
const MIN_PACKET: usize = 16;

/// The largest exponent in [`Backoff`]. Measurements: docs/decisions.md.
const MAX_DOUBLINGS: u32 = 4;

/// Leaves out packets of a call after several that were abandoned in turn: the next ones are likely to diverge, too,
/// and what a packet did until it was abandoned is lost. After n in turn, 2^(n-1) - 1 are left out: 0, 1, 3, up to
/// 2^[`MAX_DOUBLINGS`] - 1. It serves calls of many packets; nothing is remembered from one call to the next, so that
/// results and counters of a call depend on its rays alone.
#[derive(Default)]
struct Backoff {
    abandoned: u32,
    left_out: u32,
}

impl Backoff {
    /// Traces a packet by `trace`, unless it is left out; returns whether it is traced.
    #[inline(always)]
    fn tries(&mut self, trace: impl FnOnce() -> Outcome) -> bool {
        if self.left_out > 0 {
            self.left_out -= 1;
            return false;
        }
        let outcome = trace();
        match outcome {
            Outcome::Traced => self.abandoned = 0,
            Outcome::Abandoned => {
                self.left_out = (1 << self.abandoned) - 1;
                self.abandoned = (self.abandoned + 1).min(MAX_DOUBLINGS);
            }
            Outcome::Unsuitable => {}
        }
        outcome == Outcome::Traced
    }
}

/// Consecutive rays that no packet traces, at most [`BATCH`]: one stream traces them.
#[derive(Default)]
struct Waiting(Range<usize>);

impl Waiting {
    /// Adds rays. Returns those that must be traced before, which may be none.
    fn add(&mut self, rays: Range<usize>) -> Range<usize> {
        if self.0.end == rays.start && rays.end - self.0.start <= BATCH {
            self.0.end = rays.end;
            return 0..0;
        }
        std::mem::replace(&mut self.0, rays)
    }
}

/// Whether an instruction set traces several rays at once. On x86-64, portable code does so in unit tests alone: it serves
/// processors without AVX2 (before 2013), and took half of the time to compile (docs/decisions.md).
const fn has_batches(instructions: InstructionSet) -> bool {
    cfg!(any(test, not(target_arch = "x86_64"))) || !matches!(instructions, InstructionSet::Portable)
}

/// Evaluates `$value` with `$simd` as the token of an instruction set that traces several rays at once ([`has_batches`]),
/// and `$other` for one that does not.
macro_rules! as_batch {
    ($set:expr, $simd:ident => $value:expr, else $other:expr) => {
        match $set {
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx512($simd) => $value,
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2($simd) => $value,
            #[cfg(any(test, not(target_arch = "x86_64")))]
            InstructionSet::Portable => {
                let $simd = Portable;
                $value
            }
            #[cfg(not(any(test, not(target_arch = "x86_64"))))]
            InstructionSet::Portable => $other,
        }
    };
}

/// Evaluates an expression that traces at most [`BATCH`] rays as a stream, with `$simd` as the token of the tree's
/// instruction set. Its value is the mask of the rays that are left: all if the instruction set or the tree do not
/// allow streams.
macro_rules! as_stream {
    ($wide:expr, $rays:expr, $simd:ident => $value:expr) => {
        match $wide.has_streams() && stream::applies($wide) {
            true => as_batch!($wide.instructions, $simd => $value, else RayMask::first($rays.len())),
            false => RayMask::first($rays.len()),
        }
    };
}

impl<T: Tier> Wide<T> {
    /// The closest hit that `accepts` returns `true` for.
    #[inline(always)]
    fn closest(
        &self,
        ray: &Ray,
        mut accepts: impl FnMut(&Hit) -> bool,
        traversal: &mut Traversal,
    ) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        one::<T, true>(
            self,
            ray,
            traversal,
            #[inline(always)]
            |hit| {
                if !self.is_better(|| *ray, &hit, best.as_ref()) || !accepts(&hit) {
                    return Next::Continue;
                }
                best = Some(hit);
                Next::Shorten(hit.t)
            },
        );
        best
    }

    /// Calls `found` with every hit, until it returns [`Next::Stop`]. A traversal for each caller would gain nothing.
    fn each_hit_of(&self, ray: &Ray, found: &mut dyn FnMut(Hit) -> Next, traversal: &mut Traversal) {
        one::<T, false>(self, ray, traversal, found);
    }

    /// Appends the results of rays.
    fn trace(&self, all: Rays, mut results: Results, traversal: &mut Traversal) {
        let first = results.len();
        let (mut backoff, mut waiting) = (Backoff::default(), Waiting::default());
        let (mut occluder, is_in_range) = (None, packet::is_tree_in_range(self));
        for [rays, following] in packets(all) {
            let start = results.len() - first;
            let Traversal { children, tests, packet, .. } = traversal;
            if is_in_range
                && rays.len() >= MIN_PACKET
                && backoff.tries(|| {
                    as_batch!(
                        self.instructions,
                        simd => packet::trace(
                            simd, self, [rays, following], (&mut results, &mut occluder), packet.of(), children, tests
                        ),
                        else Outcome::Unsuitable
                    )
                })
            {
                continue;
            }
            if has_batches(self.instructions) && all_pairs::applies(self) {
                results.resize(first + start);
                as_batch!(
                    self.instructions,
                    simd => all_pairs::trace(simd, self, rays, &mut results, traversal),
                    else ()
                );
                continue;
            }
            let end = start + rays.len();
            results.resize(first + end);
            self.stream(all, waiting.add(start..end), &mut results, first, traversal);
        }
        self.stream(all, waiting.0, &mut results, first, traversal);
    }

    /// Sets the results of a range of rays, traced as a stream or one by one; that of the first ray of all is at
    /// `first`.
    fn stream(
        &self,
        rays: Rays,
        range: Range<usize>,
        results: &mut Results,
        first: usize,
        traversal: &mut Traversal,
    ) {
        if range.is_empty() {
            return;
        }
        let (first, rays) = (first + range.start, rays.slice(range.start, range.len()));
        let Traversal { stream, tests, .. } = traversal;
        let left = match results {
            Results::Closest(hits) => as_stream!(self, rays, simd => stream::trace(
                simd, self, rays, stream, tests, ClosestHits::new(self, rays, hits, first)
            )),
            Results::Occluded(occluded) => as_stream!(self, rays, simd => stream::trace(
                simd, self, rays, stream, tests, Occlusion(&mut occluded[first..])
            )),
        };
        for (place, ray) in left.iter().map(|index| (first + index, rays.get(index))) {
            match results {
                Results::Closest(hits) => hits.set(place, self.closest_hit(&ray, traversal).as_ref()),
                Results::Occluded(occluded) => {
                    occluded[place] = occluded[place] || self.is_occluded(&ray, traversal);
                }
            }
        }
    }
}

impl<T: Tier> Accelerator for Wide<T> {
    fn closest_hit(&self, ray: &Ray, traversal: &mut Traversal) -> Option<Hit> {
        self.closest(ray, |_| true, traversal)
    }

    fn is_occluded(&self, ray: &Ray, traversal: &mut Traversal) -> bool {
        let mut occluded = false;
        one::<T, false>(
            self,
            ray,
            traversal,
            #[inline(always)]
            |_| {
                occluded = true;
                Next::Stop
            },
        );
        occluded
    }

    fn closest_hits(&self, rays: Rays, hits: &mut HitBuffer, traversal: &mut Traversal) {
        self.trace(rays, Results::Closest(hits), traversal);
    }

    fn are_occluded(&self, rays: Rays, occluded: &mut Vec<bool>, traversal: &mut Traversal) {
        self.trace(rays, Results::Occluded(occluded), traversal);
    }

    fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>, traversal: &mut Traversal) {
        let first = hits.len();
        let mut found = |hit| {
            hits.push(hit);
            Next::Continue
        };
        self.each_hit_of(ray, &mut found, traversal);
        crate::bvh::merge_split(hits, first);
    }

    fn each_hit(&self, rays: Rays, hits: &mut Vec<(usize, Hit)>, traversal: &mut Traversal) {
        for (first, rays) in batches(rays) {
            let Traversal { stream, tests, .. } = traversal;
            let left = as_stream!(self, rays, simd => stream::trace(
                simd, self, rays, stream, tests, AllHits(hits, first)
            ));
            for index in left.iter() {
                let mut found = |hit| {
                    hits.push((first + index, hit));
                    Next::Continue
                };
                self.each_hit_of(&rays.get(index), &mut found, traversal);
            }
        }
    }

    fn has_streams(&self) -> bool {
        !matches!(self.instructions, InstructionSet::Portable)
    }

    fn primitive(&self, slot: SlotId) -> Primitive {
        self.stored(slot).into()
    }

    fn is_occluded_by(
        &self,
        ray: &Ray,
        accepts: &mut dyn FnMut(PrimId) -> bool,
        traversal: &mut Traversal,
    ) -> bool {
        let mut occluded = false;
        let mut found = |hit: Hit| {
            occluded = accepts(hit.prim);
            if occluded { Next::Stop } else { Next::Continue }
        };
        self.each_hit_of(ray, &mut found, traversal);
        occluded
    }

    fn numerics(&self) -> Numerics {
        T::NUMERICS
    }

    fn refit(&mut self, primitive: &(dyn Fn(PrimId) -> Primitive + Sync)) -> Option<f64> {
        self.refit_to(primitive)
    }

    fn quality(&self) -> Option<Quality> {
        self.measure()
    }

    fn describe(&self) -> Description {
        self.description()
    }
}

impl<T: Tier> Nearby for Wide<T> {
    fn every_primitive(&self, visit: &mut dyn FnMut(PrimId, Primitive)) {
        near_ray::each_primitive(self, visit);
    }

    fn copy_to_refit(&self) -> Option<Arc<dyn Accelerator>> {
        Some(Arc::new(self.without_batch()))
    }

    fn closest_hit_by(
        &self,
        ray: &Ray,
        accepts: &mut dyn FnMut(&Hit) -> bool,
        traversal: &mut Traversal,
    ) -> Option<Hit> {
        self.closest(ray, accepts, traversal)
    }

    fn each_near_ray(
        &self,
        ray: &LineTest,
        visit: &mut dyn FnMut(PrimId, Primitive),
        traversal: &mut Traversal,
    ) {
        match self.instructions.as_avx2() {
            Some(simd) if has_no_zeros(&ray.ray) => {
                near_ray::visit::<T, _, true>(simd, self, ray, traversal, visit);
            }
            Some(simd) => near_ray::visit::<T, _, false>(simd, self, ray, traversal, visit),
            None => near_ray::visit::<T, _, false>(Portable, self, ray, traversal, visit),
        }
    }

    fn each_near_rays(
        &self,
        rays: Rays,
        visit: &mut dyn FnMut(usize, &LineTest, PrimId, Primitive),
        traversal: &mut Traversal,
    ) {
        for (first, rays) in batches(rays) {
            let mut visit =
                |index, test: &LineTest, prim, primitive| visit(first + index, test, prim, primitive);
            let left = as_stream!(self, rays, simd => near_ray::visit_stream(
                simd, self, rays, traversal, &mut visit
            ));
            for index in left.iter() {
                let test = LineTest::new(&rays.get(index));
                let mut visit = |prim, primitive| visit(index, &test, prim, primitive);
                self.each_near_ray(&test, &mut visit, traversal);
            }
        }
    }

    fn each_near_box(
        &self,
        corners: [DVec3; 2],
        limit: f64,
        visit: &mut dyn FnMut(PrimId, Primitive) -> f64,
        traversal: &mut Traversal,
    ) {
        near_box::visit(self, corners, limit, visit, traversal);
    }

    fn save(&self, of: &Bvh, to: &mut saved::Writer) -> Option<std::io::Result<()>> {
        Some(saved::save(self, of, to))
    }
}

/// [`single::traverse`] with the instruction set and box test that serve the ray. AVX-512 has nothing for single rays.
#[inline(always)]
fn one<T: Tier, const NEAREST: bool>(
    wide: &Wide<T>,
    ray: &Ray,
    Traversal { children, tests, .. }: &mut Traversal,
    found: impl FnMut(Hit) -> Next,
) {
    match wide.instructions.as_avx2() {
        Some(simd) if has_no_zeros(ray) => {
            single::traverse::<T, _, true, NEAREST>(simd, wide, ray, children, tests, found);
        }
        Some(simd) => single::traverse::<T, _, false, NEAREST>(simd, wide, ray, children, tests, found),
        None => single::traverse::<T, _, false, NEAREST>(Portable, wide, ray, children, tests, found),
    }
}

/// Packets of rays, each with the one after it.
fn packets(rays: Rays) -> impl Iterator<Item = [Rays; 2]> {
    let following = rays.chunks(PACKET).skip(1).chain([Rays::default()]);
    rays.chunks(PACKET).zip(following).map(|(rays, following)| [rays, following])
}

/// Slices of at most [`BATCH`] rays, each with the index of its first.
fn batches(rays: Rays) -> impl Iterator<Item = (usize, Rays)> {
    rays.chunks(BATCH).enumerate().map(|(index, rays)| (index * BATCH, rays))
}

/// Whether no component of the direction is 0 or NaN.
#[inline(always)]
fn has_no_zeros(ray: &Ray) -> bool {
    ray.direction.abs().cmpgt(DVec3::ZERO).all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_are_left_out_after_several_that_were_abandoned() {
        let mut backoff = Backoff::default();
        // 1 for a packet that is tried. Abandoned ones leave out 0, 1, 3, 7, 15 and again 15 of those after them.
        let mut tried = |outcome: Outcome| {
            let mut count = 0;
            backoff.tries(|| {
                count += 1;
                outcome
            });
            count
        };
        let places: Vec<usize> = (0..60).filter(|_| tried(Outcome::Abandoned) == 1).collect();
        assert_eq!(places, [0, 1, 3, 7, 15, 31, 47]);
        // The 3 that are left out, then one that is traced: all are tried again.
        assert_eq!([Outcome::Traced; 5].map(&mut tried), [0, 0, 0, 1, 1]);
        // Those that are no packets cost little, and change nothing.
        assert_eq!([Outcome::Unsuitable; 3].map(&mut tried), [1, 1, 1]);
        assert_eq!([Outcome::Abandoned; 4].map(tried), [1, 1, 0, 1]);
    }
}
