//! Nodes of eight, converted from obvhs's binary tree, and leaves of four triangles side by side.
//!
//! One ray is tested against the eight boxes of a node at once ([`node`]), and against four triangles at once by the
//! arithmetic of the tier ([`Tier::hit_quad`]), so that an answer has the bits that it has anywhere else; what that cannot tell
//! goes through the tier's own test. With AVX2 and FMA where the machine has them ([`Simd`]), and without them the same answers.

mod answers;
mod ball;
mod best;
mod collapse;
mod convert;
mod edges;
mod few;
mod frustum;
mod lanes;
mod node;
mod outline;
mod packet;
mod plane;
mod refit;
mod seen;
mod stream;
mod tested;
mod together;

pub use convert::convert;

pub use node::Child;
use node::{BoxRay, Content, Node, WIDTH};

use super::Tests;
use crate::geometry::bundle::{FourHits, Gathered};
use crate::geometry::quad::LANES;
#[cfg(target_arch = "x86_64")]
use crate::geometry::simd::Avx2;
use crate::geometry::simd::Simd;
use crate::geometry::{Corner, Hit, PrimId, Quad, Ray, SlotId, Sphere, Stored, Tier};
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

/// The number of a lane that holds no triangle.
const NONE: u32 = u32::MAX;

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

    /// Calls `found` with every hit in a leaf, until it says that this is enough.
    #[inline(always)]
    fn hits_in_leaf<S: Simd>(
        &self,
        ray: &Ray,
        prepared: &T::Prepared,
        leaf: Child,
        tests: &mut Tests,
        mut found: impl FnMut(Hit) -> Step,
    ) -> Step {
        let mut after = Step::Go;
        match leaf.content() {
            Content::Node(_) => {}
            Content::Groups(groups) => {
                tests.primitives += groups.len() as u64;
                for index in groups {
                    let group = &self.groups[index as usize];
                    let four = T::hit_quad::<S>(prepared, &group.quad);
                    let mut lanes = four.hit | four.unsure;
                    while lanes != 0 {
                        let lane = lanes.trailing_zeros() as usize % LANES;
                        lanes &= lanes - 1;
                        let slot = SlotId(index * LANES as u32 + lane as u32);
                        let hit = if four.unsure >> lane & 1 == 0 {
                            four.at(lane, PrimId(group.ids[lane]), slot)
                        } else {
                            match hit_triangle::<T>(prepared, ray, group, slot) {
                                Some(hit) => hit,
                                None => continue,
                            }
                        };
                        match found(hit) {
                            Step::Stop => return Step::Stop,
                            Step::Prune(t) => after = Step::Prune(t),
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
        let mut t_max = boxes.prune_distance(ray.t_max);
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
                match self.hits_in_leaf::<S>(ray, &prepared, child, tests, &mut found) {
                    Step::Stop => return,
                    Step::Prune(t) => t_max = boxes.prune_distance(t),
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

/// The hit of a triangle of which a group cannot tell; few come here.
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

/// As [`hit_sphere`], for four rays at once as far as the tier can.
#[inline(always)]
fn hit_sphere_by_four<T: Tier, S: Simd>(rays: &Gathered<S>, sphere: &Sphere) -> FourHits {
    if sphere.radius > 0.0 { T::hit_sphere_by_four(rays, sphere) } else { FourHits::NONE }
}

#[inline(never)]
fn hit_sphere<T: Tier>(ray: &Ray, sphere: &Sphere) -> Option<f64> {
    // One that has shrunk to nothing is kept, for the day when it grows again.
    if sphere.radius > 0.0 { T::hit_sphere(ray, sphere) } else { None }
}
