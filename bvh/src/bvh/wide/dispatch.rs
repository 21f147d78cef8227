//! [`Accelerator`] for the BVH8: chooses the traversal for a batch of rays, and the instruction set.
//!
//! A batch is cut into packets. A packet whose rays have nothing in common, or that is abandoned, is traced by all
//! pairs if the scene is small, else as a stream, else ray by ray.

use super::layout::Wide;
use super::packet::{self, PACKET};
use super::single;
#[cfg(target_arch = "x86_64")]
use super::{all_pairs, stream};
use crate::bvh::{Accelerator, Description, Next, Primitive, Quality, Traversal};
use crate::geometry::simd::Portable;
#[cfg(target_arch = "x86_64")]
use crate::geometry::simd::{Avx2, Simd};
use crate::geometry::{Corner, Hit, Numerics, PrimId, Ray, SlotId, Stored, Tier, Triangle};

/// Batches of fewer rays are not traced as packets.
const MIN_PACKET: usize = 16;

/// Calls `single::$function` with the instruction set and box test that serve the ray.
macro_rules! single {
    ($function:ident($wide:expr, $ray:expr $(, $argument:expr)*)) => {{
        #[cfg(target_arch = "x86_64")]
        if $wide.simd {
            return if has_no_zeros($ray) {
                single::$function::<T, Avx2, true>($wide, $ray $(, $argument)*)
            } else {
                single::$function::<T, Avx2, false>($wide, $ray $(, $argument)*)
            };
        }
        single::$function::<T, Portable, false>($wide, $ray $(, $argument)*)
    }};
}

impl<T: Tier> Accelerator for Wide<T> {
    fn closest_hit(&self, ray: &Ray, traversal: &mut Traversal) -> Option<Hit> {
        let Traversal { children, tests, .. } = traversal;
        single!(closest(self, ray, children, tests))
    }

    fn is_occluded(&self, ray: &Ray, traversal: &mut Traversal) -> bool {
        let Traversal { children, tests, .. } = traversal;
        single!(occluded(self, ray, children, tests))
    }

    fn closest_hits(&self, rays: &[Ray], hits: &mut Vec<Option<Hit>>, traversal: &mut Traversal) {
        for [rays, following] in packets(rays) {
            if T::IS_TIGHT
                && rays.len() >= MIN_PACKET
                && packet_closest(self, [rays, following], hits, traversal)
            {
                continue;
            }
            let first = hits.len();
            hits.resize(first + rays.len(), None);
            let of_packet = &mut hits[first..];
            if many_closest(self, rays, of_packet, traversal) {
                continue;
            }
            for (ray, hit) in rays.iter().zip(of_packet) {
                *hit = self.closest_hit(ray, traversal);
            }
        }
    }

    fn are_occluded(&self, rays: &[Ray], occluded: &mut Vec<bool>, traversal: &mut Traversal) {
        for [rays, following] in packets(rays) {
            if T::IS_TIGHT
                && rays.len() >= MIN_PACKET
                && packet_occluded(self, [rays, following], occluded, traversal)
            {
                continue;
            }
            let first = occluded.len();
            occluded.resize(first + rays.len(), false);
            let of_packet = &mut occluded[first..];
            if many_occluded(self, rays, of_packet, traversal) {
                continue;
            }
            for (ray, occluded) in rays.iter().zip(of_packet) {
                *occluded = self.is_occluded(ray, traversal);
            }
        }
    }

    fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>, traversal: &mut Traversal) {
        let first = hits.len();
        {
            let Traversal { children, tests, .. } = traversal;
            let mut all = |hits: &mut Vec<Hit>| single!(all(self, ray, hits, children, tests));
            all(hits);
        }
        // A split triangle is in several slots.
        let mut found = hits.split_off(first);
        found.sort_unstable_by_key(|hit| hit.prim);
        found.dedup_by_key(|hit| hit.prim);
        hits.append(&mut found);
    }

    fn primitive(&self, slot: SlotId) -> Primitive {
        match self.stored(slot) {
            Stored::Triangle(corners) => Primitive::Triangle(Triangle(corners.map(Corner::to_dvec3))),
            Stored::Analytic(shape) => Primitive::Analytic(shape),
        }
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

/// The packets of a batch, each with the one after it.
fn packets(rays: &[Ray]) -> impl Iterator<Item = [&[Ray]; 2]> {
    let following = rays.chunks(PACKET).skip(1).chain([&[][..]]);
    rays.chunks(PACKET).zip(following).map(|(rays, following)| [rays, following])
}

/// [`packet::closest`] with the instruction set of the machine.
fn packet_closest<T: Tier>(
    wide: &Wide<T>,
    rays: [&[Ray]; 2],
    hits: &mut Vec<Option<Hit>>,
    traversal: &mut Traversal,
) -> bool {
    let Traversal { children, tests, packet, .. } = traversal;
    #[cfg(target_arch = "x86_64")]
    if wide.simd {
        return packet::closest::<T, Avx2>(wide, rays, hits, packet, children, tests);
    }
    packet::closest::<T, Portable>(wide, rays, hits, packet, children, tests)
}

/// [`packet::occluded`] with the instruction set of the machine.
fn packet_occluded<T: Tier>(
    wide: &Wide<T>,
    rays: [&[Ray]; 2],
    occluded: &mut Vec<bool>,
    traversal: &mut Traversal,
) -> bool {
    let Traversal { children, tests, packet, .. } = traversal;
    #[cfg(target_arch = "x86_64")]
    if wide.simd {
        return packet::occluded::<T, Avx2>(wide, rays, occluded, packet, children, tests);
    }
    packet::occluded::<T, Portable>(wide, rays, occluded, packet, children, tests)
}

/// [`many`] for closest hits.
fn many_closest<T: Tier>(
    wide: &Wide<T>,
    rays: &[Ray],
    hits: &mut [Option<Hit>],
    traversal: &mut Traversal,
) -> bool {
    many(
        wide,
        rays,
        traversal,
        #[inline(always)]
        |ray, hit| {
            let best = &mut hits[ray];
            if !wide.is_better(&rays[ray], &hit, best.as_ref()) {
                return Next::Continue;
            }
            *best = Some(hit);
            Next::Shorten(hit.t)
        },
    )
}

/// [`many`] for any hit.
fn many_occluded<T: Tier>(
    wide: &Wide<T>,
    rays: &[Ray],
    occluded: &mut [bool],
    traversal: &mut Traversal,
) -> bool {
    many(
        wide,
        rays,
        traversal,
        #[inline(always)]
        |ray, _| {
            occluded[ray] = true;
            Next::Stop
        },
    )
}

/// Traces incoherent rays by all pairs or as a stream. `false`, with nothing traced, if the machine, the tree or the
/// rays do not allow either.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn many<T: Tier>(
    wide: &Wide<T>,
    rays: &[Ray],
    traversal: &mut Traversal,
    found: impl FnMut(usize, Hit) -> Next,
) -> bool {
    let is_small = all_pairs::applies(wide);
    if !(wide.simd && (is_small || stream::applies(wide) && rays.iter().all(has_no_zeros))) {
        return false;
    }
    Avx2::run(
        #[inline(always)]
        || {
            let Traversal { stacks, tests, packet, .. } = traversal;
            if is_small {
                all_pairs::test::<T, Avx2>(wide, rays, packet.any_prepared(), tests, found);
            } else {
                stream::traverse::<T, Avx2>(wide, rays, stacks, tests, found);
            }
        },
    );
    true
}

#[cfg(not(target_arch = "x86_64"))]
fn many<T: Tier>(_: &Wide<T>, _: &[Ray], _: &mut Traversal, _: impl FnMut(usize, Hit) -> Next) -> bool {
    false
}

/// Whether no component of the direction is 0 or NaN.
#[inline(always)]
fn has_no_zeros(ray: &Ray) -> bool {
    ray.direction.abs().cmpgt(glam::DVec3::ZERO).all()
}
