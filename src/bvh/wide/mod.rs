//! Nodes of eight, converted from obvhs's binary tree, and leaves of four triangles side by side.
//!
//! One ray is tested against the eight boxes of a node at once ([`node`]), and against four triangles at once by the
//! arithmetic of the tier ([`Tier::candidates`]); what is left goes through the tier's own test, so an answer has the bits
//! that it has anywhere else. With AVX2 and FMA where the machine has them ([`Simd`]), and without them the same answers.

mod convert;
mod frustum;
mod node;
mod packet;
mod refit;
mod seen;
mod stream;

pub use convert::convert;

pub use node::Child;
use node::{BoxRay, Content, Node, WIDTH, prune_distance};

use super::{Accelerator, Description, Primitive, Quality, Seen, Tests, Traversal, quality};
use crate::geometry::quad::LANES;
#[cfg(target_arch = "x86_64")]
use crate::geometry::simd::Avx2;
use crate::geometry::simd::{Portable, Simd};
use crate::geometry::{
    Bounds, Corner, Hit, Numerics, PrimId, Quad, Ray, SlotId, Sphere, Stored, Tier, Triangle,
};
use packet::PACKET;
pub use packet::Scratch;
pub use stream::Stacks;

/// A tree of eight children a node.
pub struct Wide<T: Tier> {
    nodes: Vec<Node>,
    groups: Vec<Group<T::Corner>>,
    spheres: Vec<(Sphere, PrimId)>,
    /// The longest way from the root, in nodes.
    depth: usize,
    /// Whether the machine's own instructions are used.
    simd: bool,
    /// What it cost by the surface area heuristic before it was first given other positions.
    cost_at_build: Option<f64>,
}

/// Up to four triangles and their numbers.
#[derive(Clone, Copy)]
pub struct Group<C: Corner> {
    quad: Quad<C>,
    ids: [u32; LANES],
}

/// Whether the instructions of [`Avx2`] are there.
pub fn is_accelerated() -> bool {
    #[cfg(target_arch = "x86_64")]
    return Avx2::is_there();
    #[cfg(not(target_arch = "x86_64"))]
    return false;
}

/// What to do after a leaf.
enum Step {
    /// Go on.
    Go,
    /// Go on, but not beyond this distance.
    Prune(f64),
    /// Nothing more is wanted.
    Stop,
}

impl<T: Tier> Wide<T> {
    /// Spheres have the slots after those of triangles.
    #[inline(always)]
    fn slot_of_sphere(&self, index: u32) -> SlotId {
        SlotId((self.groups.len() * LANES) as u32 + index)
    }

    /// The primitive in a slot, in the numbers of the tier.
    #[inline(always)]
    fn stored(&self, slot: SlotId) -> Stored<T::Corner> {
        let slot = slot.0 as usize;
        match self.groups.get(slot / LANES) {
            Some(group) => Stored::Triangle(group.quad.triangle(slot % LANES)),
            None => Stored::Sphere(self.spheres[slot - self.groups.len() * LANES].0),
        }
    }

    /// Whether `hit` comes before the best so far.
    #[inline(always)]
    fn is_better(&self, ray: &Ray, hit: &Hit, best: Option<&Hit>) -> bool {
        best.is_none_or(|best| {
            // A large triangle may be kept in several places.
            hit.prim != best.prim
                && T::is_before(ray, [(hit, &self.stored(hit.slot)), (best, &self.stored(best.slot))])
        })
    }

    /// Calls `found` with every hit in a leaf that may come before `t_max`, until it says that this is enough.
    #[inline(always)]
    fn hits_in_leaf<S: Simd>(
        &self,
        ray: &Ray,
        prepared: &T::Prepared,
        leaf: Child,
        tests: &mut Tests,
        mut t_max: f64,
        mut found: impl FnMut(Hit) -> Step,
    ) -> Step {
        let mut after = Step::Go;
        match leaf.content() {
            Content::Node(_) => {}
            Content::Groups(groups) => {
                tests.primitives += groups.len() as u64;
                for index in groups {
                    let group = &self.groups[index as usize];
                    let mut lanes = T::candidates::<S>(prepared, &group.quad, t_max);
                    while lanes != 0 {
                        let lane = lanes.trailing_zeros() as usize % LANES;
                        lanes &= lanes - 1;
                        let slot = SlotId(index * LANES as u32 + lane as u32);
                        let Some(hit) = hit_triangle::<T>(prepared, ray, group, slot) else { continue };
                        match found(hit) {
                            Step::Stop => return Step::Stop,
                            Step::Prune(t) => {
                                t_max = t;
                                after = Step::Prune(t);
                            }
                            Step::Go => {}
                        }
                    }
                }
            }
            Content::Spheres(spheres) => {
                tests.primitives += spheres.len() as u64;
                for index in spheres {
                    let (sphere, prim) = &self.spheres[index as usize];
                    let Some(t) = hit_sphere::<T>(ray, sphere) else { continue };
                    match found(Hit { t, prim: *prim, slot: self.slot_of_sphere(index), weights: [0.0; 2] }) {
                        Step::Stop => return Step::Stop,
                        Step::Prune(t) => after = Step::Prune(t),
                        Step::Go => {}
                    }
                }
            }
        }
        after
    }

    /// Calls `found` with every hit that the ray has, nearest boxes first, where `NEAREST` asks for that.
    #[inline(always)]
    fn walk<S: Simd, const FUSED: bool, const NEAREST: bool>(
        &self,
        ray: &Ray,
        stack: &mut Vec<(Child, f32)>,
        tests: &mut Tests,
        mut found: impl FnMut(Hit) -> Step,
    ) {
        if self.nodes.is_empty() {
            return;
        }
        let boxes = BoxRay::new(ray, FUSED);
        let prepared = T::prepare(ray);
        let (mut t_best, mut t_max) = (ray.t_max, prune_distance(ray.t_max));
        // Every node on the way leaves at most all its children but one.
        let room = self.depth * WIDTH;
        if stack.len() < room {
            stack.resize(room, (Node::EMPTY.children[0], 0.0));
        }
        let stack = &mut stack[..];
        let mut top = 0;
        let mut node = &self.nodes[0];
        loop {
            tests.nodes += 1;
            let (mut mask, at) = boxes.enter::<S, FUSED>(node, t_max);
            let mut next = None;
            if mask != 0 {
                let place = mask.trailing_zeros() as usize % WIDTH;
                mask &= mask - 1;
                let (mut nearest, mut nearest_at) = (node.children[place], at[place]);
                let first = top;
                // The nearest goes next, without a detour over the stack; the others wait there, farthest first.
                while mask != 0 {
                    let place = mask.trailing_zeros() as usize % WIDTH;
                    mask &= mask - 1;
                    let mut item = (node.children[place], at[place]);
                    let mut j = top;
                    if NEAREST {
                        if item.1 < nearest_at {
                            (nearest, nearest_at, item) = (item.0, item.1, (nearest, nearest_at));
                        }
                        while j > first && stack[j - 1].1 < item.1 {
                            stack[j] = stack[j - 1];
                            j -= 1;
                        }
                    }
                    stack[j] = item;
                    top += 1;
                }
                next = Some(nearest);
            }
            // On to the next node that is still worth it, past leaves.
            loop {
                let child = match next.take() {
                    Some(child) => child,
                    None => loop {
                        if top == 0 {
                            return;
                        }
                        top -= 1;
                        let (child, at) = stack[top];
                        if !NEAREST || at <= t_max {
                            break child;
                        }
                    },
                };
                if let Content::Node(index) = child.content() {
                    node = &self.nodes[index as usize];
                    break;
                }
                match self.hits_in_leaf::<S>(ray, &prepared, child, tests, t_best, &mut found) {
                    Step::Stop => return,
                    Step::Prune(t) => (t_best, t_max) = (t, prune_distance(t)),
                    Step::Go => {}
                }
            }
        }
    }

    #[inline(always)]
    fn closest<S: Simd, const FUSED: bool>(
        &self,
        ray: &Ray,
        stack: &mut Vec<(Child, f32)>,
        tests: &mut Tests,
    ) -> Option<Hit> {
        S::run(
            #[inline(always)]
            || {
                let mut best: Option<Hit> = None;
                self.walk::<S, FUSED, true>(
                    ray,
                    stack,
                    tests,
                    #[inline(always)]
                    |hit| {
                        if !self.is_better(ray, &hit, best.as_ref()) {
                            return Step::Go;
                        }
                        best = Some(hit);
                        Step::Prune(hit.t)
                    },
                );
                best
            },
        )
    }

    #[inline(always)]
    fn occluded<S: Simd, const FUSED: bool>(
        &self,
        ray: &Ray,
        stack: &mut Vec<(Child, f32)>,
        tests: &mut Tests,
    ) -> bool {
        S::run(
            #[inline(always)]
            || {
                let mut occluded = false;
                self.walk::<S, FUSED, false>(
                    ray,
                    stack,
                    tests,
                    #[inline(always)]
                    |_| {
                        occluded = true;
                        Step::Stop
                    },
                );
                occluded
            },
        )
    }

    #[inline(always)]
    fn all<S: Simd, const FUSED: bool>(
        &self,
        ray: &Ray,
        hits: &mut Vec<Hit>,
        stack: &mut Vec<(Child, f32)>,
        tests: &mut Tests,
    ) {
        self.walk::<S, FUSED, false>(ray, stack, tests, |hit| {
            hits.push(hit);
            Step::Go
        });
    }
}

impl<T: Tier> Wide<T> {
    fn packet_closest(&self, rays: &[Ray], hits: &mut [Option<Hit>], traversal: &mut Traversal) -> bool {
        let Traversal { children, tests, packet, .. } = traversal;
        #[cfg(target_arch = "x86_64")]
        if self.simd {
            return self.closest_of_packet::<Avx2>(rays, hits, packet, children, tests);
        }
        self.closest_of_packet::<Portable>(rays, hits, packet, children, tests)
    }

    fn packet_occluded(&self, rays: &[Ray], occluded: &mut [bool], traversal: &mut Traversal) -> bool {
        let Traversal { children, tests, packet, .. } = traversal;
        #[cfg(target_arch = "x86_64")]
        if self.simd {
            return self.occluded_of_packet::<Avx2>(rays, occluded, packet, children, tests);
        }
        self.occluded_of_packet::<Portable>(rays, occluded, packet, children, tests)
    }
}

impl<T: Tier> Wide<T> {
    /// Rays in turns, where the machine can and their directions have no zeros.
    fn stream_closest(&self, rays: &[Ray], hits: &mut [Option<Hit>], traversal: &mut Traversal) -> bool {
        #[cfg(target_arch = "x86_64")]
        if self.simd && rays.iter().all(runs_along_all_axes) {
            let Traversal { stacks, tests, .. } = traversal;
            Avx2::run(
                #[inline(always)]
                || {
                    self.stream::<Avx2, false>(
                        rays,
                        stacks,
                        tests,
                        #[inline(always)]
                        |ray, hit| hits[ray] = hit,
                    );
                },
            );
            return true;
        }
        false
    }

    /// The same for rays that any hit blocks.
    fn stream_occluded(&self, rays: &[Ray], occluded: &mut [bool], traversal: &mut Traversal) -> bool {
        #[cfg(target_arch = "x86_64")]
        if self.simd && rays.iter().all(runs_along_all_axes) {
            let Traversal { stacks, tests, .. } = traversal;
            Avx2::run(
                #[inline(always)]
                || {
                    self.stream::<Avx2, true>(
                        rays,
                        stacks,
                        tests,
                        #[inline(always)]
                        |ray, hit| occluded[ray] = hit.is_some(),
                    );
                },
            );
            return true;
        }
        false
    }
}

/// Fewer rays than this are not worth a packet.
const FEWEST: usize = 16;

/// The hit of a triangle that has passed for all that a group can tell; few come here.
#[inline(never)]
fn hit_triangle<T: Tier>(
    prepared: &T::Prepared,
    ray: &Ray,
    group: &Group<T::Corner>,
    slot: SlotId,
) -> Option<Hit> {
    let lane = slot.0 as usize % LANES;
    let hit = T::hit_triangle(prepared, ray, &group.quad.triangle(lane))?;
    Some(Hit { t: hit.t, prim: PrimId(group.ids[lane]), slot, weights: hit.weights })
}

#[inline(never)]
fn hit_sphere<T: Tier>(ray: &Ray, sphere: &Sphere) -> Option<f64> {
    // One that has shrunk to nothing is kept, for the day when it grows again.
    if sphere.radius > 0.0 { T::hit_sphere(ray, sphere) } else { None }
}

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
            let first = hits.len();
            hits.resize(first + rays.len(), None);
            let of_packet = &mut hits[first..];
            if T::IS_TIGHT && rays.len() >= FEWEST && self.packet_closest(rays, of_packet, traversal) {
                continue;
            }
            of_packet.fill(None);
            if self.stream_closest(rays, of_packet, traversal) {
                continue;
            }
            for (ray, hit) in rays.iter().zip(of_packet) {
                *hit = self.closest_hit(ray, traversal);
            }
        }
    }

    fn are_occluded(&self, rays: &[Ray], occluded: &mut Vec<bool>, traversal: &mut Traversal) {
        for rays in rays.chunks(PACKET) {
            let first = occluded.len();
            occluded.resize(first + rays.len(), false);
            let of_packet = &mut occluded[first..];
            if T::IS_TIGHT && rays.len() >= FEWEST && self.packet_occluded(rays, of_packet, traversal) {
                continue;
            }
            of_packet.fill(false);
            if self.stream_occluded(rays, of_packet, traversal) {
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
        let slots = ids.filter(|&id| id != u32::MAX).count() + self.spheres.len();
        let bytes = self.nodes.len() * size_of::<Node>()
            + self.groups.len() * size_of::<Group<T::Corner>>()
            + self.spheres.len() * size_of::<(Sphere, PrimId)>();
        let isa = if self.simd { "avx2" } else { super::compiled_isa() };
        Description { layout: "bvh8", isa, nodes: self.nodes.len(), slots, bytes }
    }
}
