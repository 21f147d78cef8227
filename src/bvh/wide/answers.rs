//! Which of the ways through the tree serves which rays, and for which instructions.

use super::node::{Content, Node, WIDTH};
use super::packet::PACKET;
use super::{Group, NONE, Step, Wide};
use crate::bvh::{Accelerator, Description, Primitive, Quality, Seen, Traversal, compiled_isa, quality};
use crate::geometry::simd::Portable;
#[cfg(target_arch = "x86_64")]
use crate::geometry::simd::{Avx2, Simd};
use crate::geometry::{Bounds, Corner, Hit, Numerics, PrimId, Ray, SlotId, Sphere, Stored, Tier, Triangle};

impl<T: Tier> Wide<T> {
    fn packet_closest(&self, rays: &[Ray], hits: &mut Vec<Option<Hit>>, traversal: &mut Traversal) -> bool {
        let Traversal { children, tests, packet, .. } = traversal;
        #[cfg(target_arch = "x86_64")]
        if self.simd {
            return self.closest_of_packet::<Avx2>(rays, hits, packet, children, tests);
        }
        self.closest_of_packet::<Portable>(rays, hits, packet, children, tests)
    }

    fn packet_occluded(&self, rays: &[Ray], occluded: &mut Vec<bool>, traversal: &mut Traversal) -> bool {
        let Traversal { children, tests, packet, .. } = traversal;
        #[cfg(target_arch = "x86_64")]
        if self.simd {
            return self.occluded_of_packet::<Avx2>(rays, occluded, packet, children, tests);
        }
        self.occluded_of_packet::<Portable>(rays, occluded, packet, children, tests)
    }
}

impl<T: Tier> Wide<T> {
    /// Whether [`Wide::many`] can be asked about such rays: there are few primitives, or room for turns and no zeros in the
    /// directions.
    #[cfg(target_arch = "x86_64")]
    fn takes_many(&self, rays: &[Ray]) -> bool {
        self.simd && (self.has_few() || self.can_stream() && rays.iter().all(runs_along_all_axes))
    }

    fn many_closest(&self, rays: &[Ray], hits: &mut [Option<Hit>], traversal: &mut Traversal) -> bool {
        self.many(
            rays,
            traversal,
            #[inline(always)]
            |ray, hit| {
                let best = &mut hits[ray];
                if !self.is_better(&rays[ray], &hit, best.as_ref()) {
                    return Step::Go;
                }
                *best = Some(hit);
                Step::Prune(hit.t)
            },
        )
    }

    fn many_occluded(&self, rays: &[Ray], occluded: &mut [bool], traversal: &mut Traversal) -> bool {
        self.many(
            rays,
            traversal,
            #[inline(always)]
            |ray, _| {
                occluded[ray] = true;
                Step::Stop
            },
        )
    }

    /// Rays that have nothing in common, many at once: all against all where there are few primitives, else in turns. `false`
    /// where the machine, the tree or the rays are not for that, and nothing was asked.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn many(&self, rays: &[Ray], traversal: &mut Traversal, found: impl FnMut(usize, Hit) -> Step) -> bool {
        if !self.takes_many(rays) {
            return false;
        }
        Avx2::run(
            #[inline(always)]
            || {
                let Traversal { stacks, tests, packet, .. } = traversal;
                if self.has_few() {
                    self.each_of_few::<Avx2>(rays, packet.any_bundle(), tests, found);
                } else {
                    self.stream::<Avx2>(rays, stacks, tests, found);
                }
            },
        );
        true
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn many(&self, _: &[Ray], _: &mut Traversal, _: impl FnMut(usize, Hit) -> Step) -> bool {
        false
    }
}

/// Fewer rays than this are not worth a packet.
const FEWEST: usize = 16;

/// Whether no component of the direction is 0, and all are numbers.
#[inline(always)]
fn runs_along_all_axes(ray: &Ray) -> bool {
    ray.direction.abs().cmpgt(glam::DVec3::ZERO).all()
}

/// Calls `$self.$method::<S>` with the instructions that serve the ray.
macro_rules! with_instructions {
    ($self:ident.$method:ident($ray:expr $(, $argument:expr)*)) => {{
        #[cfg(target_arch = "x86_64")]
        if $self.simd {
            return if runs_along_all_axes($ray) {
                $self.$method::<Avx2, true>($ray $(, $argument)*)
            } else {
                $self.$method::<Avx2, false>($ray $(, $argument)*)
            };
        }
        $self.$method::<Portable, false>($ray $(, $argument)*)
    }};
}

impl<T: Tier> Accelerator for Wide<T> {
    fn closest_hit(&self, ray: &Ray, traversal: &mut Traversal) -> Option<Hit> {
        let Traversal { children, tests, .. } = traversal;
        with_instructions!(self.closest(ray, children, tests))
    }

    fn is_occluded(&self, ray: &Ray, traversal: &mut Traversal) -> bool {
        let Traversal { children, tests, .. } = traversal;
        with_instructions!(self.occluded(ray, children, tests))
    }

    fn closest_hits(&self, rays: &[Ray], hits: &mut Vec<Option<Hit>>, traversal: &mut Traversal) {
        for rays in rays.chunks(PACKET) {
            if T::IS_TIGHT && rays.len() >= FEWEST && self.packet_closest(rays, hits, traversal) {
                continue;
            }
            let first = hits.len();
            hits.resize(first + rays.len(), None);
            let of_packet = &mut hits[first..];
            if self.many_closest(rays, of_packet, traversal) {
                continue;
            }
            for (ray, hit) in rays.iter().zip(of_packet) {
                *hit = self.closest_hit(ray, traversal);
            }
        }
    }

    fn are_occluded(&self, rays: &[Ray], occluded: &mut Vec<bool>, traversal: &mut Traversal) {
        for rays in rays.chunks(PACKET) {
            if T::IS_TIGHT && rays.len() >= FEWEST && self.packet_occluded(rays, occluded, traversal) {
                continue;
            }
            let first = occluded.len();
            occluded.resize(first + rays.len(), false);
            let of_packet = &mut occluded[first..];
            if self.many_occluded(rays, of_packet, traversal) {
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
            let mut all = |hits: &mut Vec<Hit>| with_instructions!(self.all(ray, hits, children, tests));
            all(hits);
        }
        // Large triangles may be kept in several places.
        let mut found = hits.split_off(first);
        found.sort_unstable_by_key(|hit| hit.prim);
        found.dedup_by_key(|hit| hit.prim);
        hits.append(&mut found);
    }

    fn primitive(&self, slot: SlotId) -> Primitive {
        match self.stored(slot) {
            Stored::Triangle(corners) => Primitive::Triangle(Triangle(corners.map(Corner::raise))),
            Stored::Sphere(sphere) => Primitive::Sphere(sphere),
        }
    }

    fn numerics(&self) -> Numerics {
        T::NUMERICS
    }

    fn refit(&mut self, primitive: &(dyn Fn(PrimId) -> Primitive + Sync)) -> Option<f64> {
        self.refit_to(primitive)
    }

    fn quality(&self) -> Option<Quality> {
        // Numbered: nodes by their place, and after them the places in nodes that hold leaves.
        let nodes = self.nodes.len();
        let area = |index: usize| -> f64 {
            let node = &self.nodes[index];
            let held = (0..WIDTH).filter(|place| node.present >> place & 1 != 0);
            let whole = held.map(|place| node.bounds(place)).reduce(Bounds::union);
            whole.map_or(0.0, |b| f64::from(b.half_area()))
        };
        let look = |index: usize, children: &mut Vec<usize>| {
            if index < nodes {
                let node = &self.nodes[index];
                let held = (0..WIDTH).filter(|place| node.present >> place & 1 != 0);
                children.extend(held.map(|place| match node.children[place].content() {
                    Content::Node(child) => child as usize,
                    _ => nodes + index * WIDTH + place,
                }));
                return Seen { area: area(index), primitives: 0 };
            }
            let (node, place) = (&self.nodes[(index - nodes) / WIDTH], (index - nodes) % WIDTH);
            let primitives = match node.children[place].content() {
                Content::Groups(range) | Content::Spheres(range) => range.len(),
                Content::Node(_) => 0,
            };
            Seen { area: f64::from(node.bounds(place).half_area()), primitives }
        };
        (nodes > 0).then(|| quality(0, look))
    }

    fn describe(&self) -> Description {
        let ids = self.groups.iter().flat_map(|group| group.ids);
        let slots = ids.filter(|&id| id != NONE).count() + self.spheres.len();
        let bytes = self.nodes.len() * size_of::<Node>()
            + self.groups.len() * size_of::<Group<T::Corner>>()
            + self.spheres.len() * size_of::<(Sphere, PrimId)>();
        let isa = if self.simd { "avx2" } else { compiled_isa() };
        Description { layout: "bvh8", isa, nodes: self.nodes.len(), slots, bytes }
    }
}
