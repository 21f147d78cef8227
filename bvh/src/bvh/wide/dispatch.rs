//! [`Accelerator`] for the BVH8: chooses the traversal for the rays of a call, and the instruction set.
//!
//! They are cut into packets. A packet whose rays have nothing in common, or that is abandoned, is traced by all
//! pairs if the scene is small, else as a stream, else ray by ray.

use super::layout::Wide;
use super::packet;
use super::single;
use super::{all_pairs, stream};
use crate::bvh::{Accelerator, Description, Next, Primitive, Quality, Traversal};
#[cfg(target_arch = "x86_64")]
use crate::geometry::simd::{Avx2, Avx512};
use crate::geometry::simd::{InstructionSet, Portable, Simd};
use crate::geometry::{
    Corner, Hit, HitBuffer, Numerics, PACKET, PrimId, Ray, Rays, SlotId, Stored, Tier, Triangle,
};

/// Fewer rays are not traced as a packet.
const MIN_PACKET: usize = 16;

/// Evaluates an expression with `$simd` as the instruction set of the tree.
macro_rules! with {
    ($set:expr, $simd:ident => $value:expr) => {
        match $set {
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx512 => {
                type $simd = Avx512;
                $value
            }
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2 => {
                type $simd = Avx2;
                $value
            }
            InstructionSet::Portable => {
                type $simd = Portable;
                $value
            }
        }
    };
}

/// Calls `single::$function` with the instruction set and box test that serve the ray. AVX-512 has nothing for single
/// rays.
macro_rules! single {
    ($function:ident($wide:expr, $ray:expr $(, $argument:expr)*)) => {
        match $wide.instructions {
            InstructionSet::Portable => {
                single::$function::<T, Portable, false>($wide, $ray $(, $argument)*)
            }
            #[cfg(target_arch = "x86_64")]
            _ if has_no_zeros($ray) => single::$function::<T, Avx2, true>($wide, $ray $(, $argument)*),
            #[cfg(target_arch = "x86_64")]
            _ => single::$function::<T, Avx2, false>($wide, $ray $(, $argument)*),
        }
    };
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

    fn closest_hits(&self, rays: Rays, hits: &mut HitBuffer, traversal: &mut Traversal) {
        let mut padded = std::mem::take(&mut traversal.padded);
        for [rays, following] in packets(rays) {
            let rays = rays.padded(&mut padded);
            if T::IS_TIGHT
                && rays.len() >= MIN_PACKET
                && packet_closest(self, [rays, following], hits, traversal)
            {
                continue;
            }
            if many_closest(self, rays, hits, traversal) {
                continue;
            }
            rays.iter().for_each(|ray| hits.push(self.closest_hit(&ray, traversal).as_ref()));
        }
        traversal.padded = padded;
    }

    fn are_occluded(&self, rays: Rays, occluded: &mut Vec<bool>, traversal: &mut Traversal) {
        let mut padded = std::mem::take(&mut traversal.padded);
        for [rays, following] in packets(rays) {
            let rays = rays.padded(&mut padded);
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
                *occluded = self.is_occluded(&ray, traversal);
            }
        }
        traversal.padded = padded;
    }

    fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>, traversal: &mut Traversal) {
        let first = hits.len();
        let Traversal { children, tests, .. } = traversal;
        single!(all(self, ray, hits, children, tests));
        crate::bvh::merge_split(hits, first);
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

/// Packets of rays, each with the one after it.
fn packets(rays: Rays) -> impl Iterator<Item = [Rays; 2]> {
    let following = rays.chunks(PACKET).skip(1).chain([Rays::default()]);
    rays.chunks(PACKET).zip(following).map(|(rays, following)| [rays, following])
}

/// [`packet::closest`] with the instruction set of the tree.
fn packet_closest<T: Tier>(
    wide: &Wide<T>,
    rays: [Rays; 2],
    hits: &mut HitBuffer,
    traversal: &mut Traversal,
) -> bool {
    let Traversal { children, tests, packet, .. } = traversal;
    with!(wide.instructions, S => packet::closest::<T, S>(wide, rays, hits, packet.of(), children, tests))
}

/// [`packet::occluded`] with the instruction set of the tree.
fn packet_occluded<T: Tier>(
    wide: &Wide<T>,
    rays: [Rays; 2],
    occluded: &mut Vec<bool>,
    traversal: &mut Traversal,
) -> bool {
    let Traversal { children, tests, packet, .. } = traversal;
    with!(wide.instructions, S => packet::occluded::<T, S>(wide, rays, occluded, packet.of(), children, tests))
}

/// [`many`] for closest hits, which are appended.
fn many_closest<T: Tier>(
    wide: &Wide<T>,
    rays: Rays,
    hits: &mut HitBuffer,
    traversal: &mut Traversal,
) -> bool {
    let first = hits.len();
    hits.resize(first + rays.len());
    let is_done = many(
        wide,
        rays,
        traversal,
        #[inline(always)]
        |ray, hit| {
            if !wide.is_better(|| rays.get(ray), &hit, hits.get(first + ray).as_ref()) {
                return Next::Continue;
            }
            hits.set(first + ray, Some(&hit));
            Next::Shorten(hit.t)
        },
    );
    if !is_done {
        hits.resize(first);
    }
    is_done
}

/// [`many`] for any hit.
fn many_occluded<T: Tier>(
    wide: &Wide<T>,
    rays: Rays,
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

/// Traces incoherent rays by all pairs or as a stream. `false`, with nothing traced, if the instruction set, the tree
/// or the rays do not allow either.
#[cfg_attr(not(target_arch = "x86_64"), allow(unused_variables))]
#[inline(always)]
fn many<T: Tier>(
    wide: &Wide<T>,
    rays: Rays,
    traversal: &mut Traversal,
    found: impl FnMut(usize, Hit) -> Next,
) -> bool {
    match wide.instructions {
        InstructionSet::Portable => false,
        #[cfg(target_arch = "x86_64")]
        InstructionSet::Avx2 => many_by::<T, Avx2>(wide, rays, traversal, found),
        #[cfg(target_arch = "x86_64")]
        InstructionSet::Avx512 => many_by::<T, Avx512>(wide, rays, traversal, found),
    }
}

/// [`many`] by an instruction set.
#[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
#[inline(always)]
fn many_by<T: Tier, S: Simd>(
    wide: &Wide<T>,
    rays: Rays,
    Traversal { stream, tests, .. }: &mut Traversal,
    found: impl FnMut(usize, Hit) -> Next,
) -> bool {
    let are_all_pairs = all_pairs::applies(wide);
    S::run(
        #[inline(always)]
        move || {
            if are_all_pairs {
                all_pairs::test::<T, S>(wide, rays, tests, found);
                return true;
            }
            let is_stream = stream::applies::<T, S>(wide, rays);
            if is_stream {
                stream::traverse::<T, S>(wide, rays, stream, tests, found);
            }
            is_stream
        },
    )
}

/// Whether no component of the direction is 0 or NaN.
#[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
#[inline(always)]
fn has_no_zeros(ray: &Ray) -> bool {
    ray.direction.abs().cmpgt(glam::DVec3::ZERO).all()
}
