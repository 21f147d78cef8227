//! The traversal for packets: up to 256 rays with a common origin (primary rays), a common end (shadow rays to a
//! light) or a common direction (shadow rays to a directional light).
//!
//! A packet passes these files:
//! 1. [`rays`] loads the rays as structures of arrays and finds what they have in common.
//! 2. [`frustum`] bounds them. A ray becomes a point (u, v) of the frustum's projection; a block has a ray for each
//!    lane of [`Simd::F`].
//! 3. [`traverse`] descends the tree by the frustum. In a leaf,
//!    [`projected_triangles`] are culled against the (u, v) bounds of blocks, and
//!    [`edge_functions`], f32 with error bounds, decide which rays certainly miss, certainly hit, or neither;
//!    [`projected_sphere`]s are tested by a quadratic function of (u, v).
//! 4. [`hits`] keeps the closest hit of every ray, as an unresolved triangle with f32 bounds of its depth where
//!    possible.
//! 5. [`resolve`] tests by the [`Tier`], half a block at once, what f32 does not decide: during the traversal, rays
//!    whose depth bounds overlap; at the end, the closest hits, whose bits must be those of the tier.
//!
//! In fast tiers, [`fast`] takes the place of edge functions and of 5: f32 decides, without error bounds.
//!
//! A packet that diverges too far is abandoned, and its rays are traced otherwise ([`Outcome`]).

mod edge_functions;
mod fast;
mod frustum;
mod hits;
mod projected_sphere;
mod projected_triangles;
mod rays;
mod resolve;
mod traverse;

use std::any::Any;
use std::marker::PhantomData;

use super::layout::{Child, Wide};
use super::results::Results;
use crate::bvh::Tests;
use crate::geometry::lanes::MAX_FLOATS;
use crate::geometry::simd::{Floats, Simd, Vector};
use crate::geometry::woop_n::PreparedRayN;
use crate::geometry::{PACKET, PER_LINE, Rays, Tier, round_up};
use frustum::Frustum;
use hits::BestHits;
use projected_triangles::BlockBounds;
use rays::{BLOCKS, OfBlock, PacketRays};

/// The largest coordinate of boxes and apexes: their differences, and sums of two of these, are finite in f32.
const MAX_COORDINATE: f32 = f32::MAX / 4.0;

/// Whether the boxes of the tree are small enough for frusta.
#[inline(always)]
pub(crate) fn is_tree_in_range<T: Tier>(wide: &Wide<T>) -> bool {
    // Those of empty places are infinite.
    let fits = |x: &f32| x.abs() <= MAX_COORDINATE || x.is_infinite();
    wide.nodes.first().is_none_or(|root| root.planes.as_flattened().as_flattened().iter().all(fits))
}

/// The one or two leaves of triangles that a packet tests first, because they occluded many rays of the one before.
pub(crate) type Occluder = Option<(u32, Option<u32>)>;

/// What became of the rays of a packet. Those that are not traced must be traced otherwise: nothing is appended for them,
/// but by an abandoned packet for any hit, which appends one flag a ray, `true` for those that are occluded already.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    Traced,
    /// They diverge too far, which was found on the way.
    Abandoned,
    /// They have nothing in common, or the tier does not support them.
    Unsuitable,
}

impl Outcome {
    fn traced_if(is_traced: bool) -> Self {
        if is_traced { Outcome::Traced } else { Outcome::Abandoned }
    }
}

/// Appends the results of the rays. The `following` rays are prefetched.
#[inline(always)]
pub(crate) fn trace<T: Tier, S: Simd>(
    simd: S,
    wide: &Wide<T>,
    [rays, following]: [Rays; 2],
    (results, occluder): (&mut Results, &mut Occluder),
    scratch: &mut Scratch<S>,
    stack: &mut Vec<(Child, f32)>,
    tests: &mut Tests,
) -> Outcome {
    match results {
        Results::Closest(hits) => simd.run(
            #[inline(always)]
            || {
                let Some(mut packet) = Packet::<T, S, false>::new(rays, following, scratch) else {
                    return Outcome::Unsuitable;
                };
                let first = hits.len();
                let is_traversed = packet.traverse(
                    wide,
                    stack,
                    tests,
                    #[inline(always)]
                    |index| hits.prefetch(first + index),
                    occluder,
                );
                Outcome::traced_if(is_traversed && packet.resolve_all(wide, hits))
            },
        ),
        Results::Occluded(occluded) => simd.run(
            #[inline(always)]
            || {
                let Some(mut packet) = Packet::<T, S, true>::new(rays, following, scratch) else {
                    return Outcome::Unsuitable;
                };
                let is_traversed = packet.traverse(wide, stack, tests, |_| {}, occluder);
                packet.append_occluded(occluded);
                Outcome::traced_if(is_traversed)
            },
        ),
    }
}

/// The [`Scratch`] of the instruction set that used it last.
#[derive(Default)]
pub(crate) struct Scratches(Option<Box<dyn Any + Send + Sync>>);

impl Scratches {
    /// The scratch of an instruction set, with what its last packet left.
    #[inline(always)]
    pub(crate) fn of<S: Simd>(&mut self) -> &mut Scratch<S> {
        if !self.0.as_ref().is_some_and(|scratch| scratch.is::<Scratch<S>>()) {
            self.0 = Some(Box::new(Scratch::<S>::default()));
        }
        let scratch = self.0.as_mut().and_then(|scratch| scratch.downcast_mut());
        scratch.unwrap_or_else(|| unreachable!("of this type"))
    }
}

/// The arrays of a packet, kept from one packet to the next.
pub(crate) struct Scratch<S: Simd> {
    rays: PacketRays<S>,
    best: BestHits<S>,
    /// Least and greatest u and v of every block.
    block_bounds: BlockBounds,
    /// For every block, a depth beyond which none of its rays needs a hit.
    depths: [f32; BLOCKS],
    /// The barycentrics v and w of the best hits, in fast tiers.
    barycentrics: [[OfBlock<S>; BLOCKS]; 2],
    /// The rays that are still traced, one mask per block.
    active: [u32; BLOCKS],
    /// Rays prepared for the tier's triangle test.
    prepared: Vec<PreparedRayN<S::D>>,
}

impl<S: Simd> Default for Scratch<S> {
    fn default() -> Self {
        Scratch {
            rays: PacketRays::default(),
            best: BestHits::default(),
            block_bounds: [[[f32::INFINITY; BLOCKS], [f32::NEG_INFINITY; BLOCKS]]; 2],
            depths: [f32::NEG_INFINITY; BLOCKS],
            barycentrics: [[S::F::ZEROS; BLOCKS]; 2],
            active: [0; BLOCKS],
            prepared: vec![PreparedRayN::default(); PACKET / S::D::LANES],
        }
    }
}

/// A packet of rays, traced for their closest hits, or (`ANY`) for any hit.
///
/// Methods take the tree as a parameter: as a field, it would be reloaded after every store to `scratch`.
struct Packet<'a, T: Tier, S: Simd, const ANY: bool> {
    rays: Rays<'a>,
    /// The rays of the next packet, and the number of those that are prefetched.
    following: Rays<'a>,
    prefetched: usize,
    frustum: Frustum,
    scratch: &'a mut Scratch<S>,
    /// The entries of `scratch.prepared` that are filled, as bits.
    is_prepared: u64,
    /// Whether the tier missed a triangle that f32 certainly hit: the packet is abandoned.
    is_inconsistent: bool,
    /// The number of rays that are still traced.
    remaining: usize,
    tier: PhantomData<T>,
}

impl<'a, T: Tier, S: Simd, const ANY: bool> Packet<'a, T, S, ANY> {
    /// A packet of rays with a common origin, or (`ANY`) a common end, or direction; `None` for other rays.
    #[inline(always)]
    fn new(rays: Rays<'a>, following: Rays<'a>, scratch: &'a mut Scratch<S>) -> Option<Self> {
        debug_assert!(rays.len() <= PACKET);
        if T::IS_FAST && !fast::supports::<S>(rays) {
            return None;
        }
        let frustum = Frustum::new(rays, ANY, &mut scratch.rays)?;
        let blocks = scratch.rays.blocks;
        for (k, [least, most]) in scratch.block_bounds.iter_mut().enumerate() {
            for block in 0..blocks {
                let slopes = S::F::load(scratch.rays.projected[k][block]);
                // NaN is left out.
                least[block] = slopes.min(S::F::splat(f32::INFINITY)).reduce_min();
                most[block] = slopes.max(S::F::splat(f32::NEG_INFINITY)).reduce_max();
            }
            least[blocks..].fill(f32::INFINITY);
            most[blocks..].fill(f32::NEG_INFINITY);
        }
        scratch.active = [0; BLOCKS];
        scratch.active[..blocks].fill(S::F::ALL);
        scratch.depths = [f32::NEG_INFINITY; BLOCKS];
        let in_last_block = rays.len() - (blocks - 1) * S::F::LANES;
        scratch.active[blocks - 1] = S::F::ALL >> (S::F::LANES - in_last_block);
        scratch.rays.ends[blocks - 1].as_mut()[in_last_block..].fill(f32::NEG_INFINITY);
        scratch.best.reset(&scratch.rays, round_up(frustum.spread), T::IS_FAST);
        let mut packet = Packet {
            rays,
            following,
            prefetched: 0,
            frustum,
            scratch,
            is_prepared: 0,
            is_inconsistent: false,
            remaining: rays.len(),
            tier: PhantomData,
        };
        packet.update_depths(u32::MAX >> (BLOCKS - blocks));
        Some(packet)
    }

    /// Prefetches some rays of the next packet. Called from time to time: all at once, they would wait for memory.
    #[inline(always)]
    fn prefetch_following(&mut self, also: impl Fn(usize)) {
        if self.prefetched < self.following.len() {
            self.following.prefetch(self.prefetched);
            also(self.prefetched);
            self.prefetched += PER_LINE;
        }
    }

    /// Updates the depths of the changed blocks, given as bits, and of the frustum, from those of the best hits.
    #[inline(always)]
    fn update_depths(&mut self, mut changed: u32) {
        if changed == 0 {
            return;
        }
        while changed != 0 {
            let block = changed.trailing_zeros() as usize % BLOCKS;
            changed &= changed - 1;
            // NaN, of rays with NaN, is left out: it would leave out the block.
            let far = S::F::load(self.scratch.best.far[block]).max(S::F::splat(f32::NEG_INFINITY));
            self.scratch.depths[block] = far.reduce_max();
        }
        let mut deepest = S::F::splat(f32::NEG_INFINITY);
        for first in (0..PACKET / S::F::LANES).step_by(S::F::LANES) {
            deepest = S::F::load_slice(&self.scratch.depths[first..]).max(deepest);
        }
        self.frustum.max_depth = deepest.reduce_max();
    }

    /// Bounds blocks and the frustum by the rays that are still traced; from then on both hold for active rays alone.
    /// Blocks without any keep their bounds: their depths leave them out. The frustum of parallel rays stays.
    #[inline(always)]
    fn tighten(&mut self) {
        if self.frustum.shear.is_some() {
            return;
        }
        let [infinity, nothing] = [S::F::splat(f32::INFINITY), S::F::splat(f32::NEG_INFINITY)];
        for k in 0..2 {
            let (mut low, mut high) = (infinity, nothing);
            let [least, most] = &mut self.scratch.block_bounds[k];
            for block in 0..self.scratch.rays.blocks % (BLOCKS + 1) {
                let active = self.scratch.active[block];
                if active == 0 {
                    continue;
                }
                let slopes = S::F::load(self.scratch.rays.projected[k][block]);
                // NaN is left out.
                let a = S::F::select(active, slopes, infinity).min(infinity);
                let b = S::F::select(active, slopes, nothing).max(nothing);
                (least[block], most[block]) = (a.reduce_min(), b.reduce_max());
                (low, high) = (a.min(low), b.max(high));
            }
            let (low, high) = (low.reduce_min(), high.reduce_max());
            if low <= high {
                self.frustum.intervals[k] = frustum::widened(low, high);
            }
        }
    }

    /// A group of rays, as many as [`Simd::D`] has lanes, prepared for the tier's triangle test.
    #[inline(always)]
    fn prepared(&mut self, index: usize) -> &PreparedRayN<S::D> {
        let index = index % (PACKET / S::D::LANES);
        if T::HAS_RAY_N && self.is_prepared >> index & 1 == 0 {
            self.is_prepared |= 1 << index;
            self.scratch.prepared[index].fill(self.rays, index * S::D::LANES);
        }
        &self.scratch.prepared[index]
    }

    /// Ends the traversal of some rays of a block.
    #[inline(always)]
    fn retire(&mut self, block: usize, rays: u32) {
        self.remaining -= (self.scratch.active[block] & rays).count_ones() as usize;
        self.scratch.active[block] &= !rays;
        self.scratch.best.retire(block, rays);
    }
}

impl<T: Tier, S: Simd> Packet<'_, T, S, true> {
    /// Appends whether each ray is retired.
    #[inline(always)]
    fn append_occluded(&mut self, occluded: &mut Vec<bool>) {
        for first in (0..self.rays.len()).step_by(S::F::LANES) {
            self.prefetch_following(|_| {});
            let active = self.scratch.active[first / S::F::LANES];
            let of_block: [bool; MAX_FLOATS] = std::array::from_fn(|lane| active >> lane & 1 == 0);
            // A constant number of bytes is copied without a call.
            if first + S::F::LANES <= self.rays.len() {
                occluded.extend_from_slice(&of_block[..S::F::LANES]);
            } else {
                occluded.extend_from_slice(&of_block[..self.rays.len() - first]);
            }
        }
    }
}
