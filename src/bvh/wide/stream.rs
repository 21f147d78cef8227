//! Rays that have nothing in common, a few at a time.
//!
//! A single ray spends most of its time waiting: for a node to come from memory, and for a test to say which one is next.
//! So some rays take turns, a node or a leaf each, and what a ray needs at its next turn is asked for at the end of this
//! one.

use super::node::{BoxRay, Child, Content, WIDTH};
use super::{Step, Wide};
use crate::bvh::Tests;
use crate::geometry::simd::Simd;
use crate::geometry::{Hit, Ray, Tier};

/// How many rays take turns.
const TURNS: usize = 6;

/// How much can wait to be visited by one ray. Every node on the way leaves at most all its children but one, and a whole
/// vector is written at the end; trees that are deeper than that allows are walked by one ray at a time.
const ROOM: usize = 256;

/// What waits to be visited, the next last, for every ray: a [`Child`], and in the upper half the bits of the distance at which
/// the ray enters it. Positive numbers are in the order of their bits.
pub struct Stacks(Vec<[u64; ROOM]>);

impl Default for Stacks {
    fn default() -> Self {
        Stacks(vec![[0; ROOM]; TURNS])
    }
}

/// A ray on its way.
#[derive(Clone, Copy)]
struct Walker<P: Copy> {
    boxes: BoxRay,
    prepared: P,
    ray: usize,
    /// Its stack, and how much of that is in use.
    stack: usize,
    top: usize,
    /// Boxes beyond this are not entered.
    t_max: f32,
}

impl<P: Copy> Walker<P> {
    #[inline(always)]
    fn new<T: Tier<Prepared = P>>(rays: &[Ray], index: usize, stack: usize, stacks: &mut Stacks) -> Self {
        let ray = &rays[index];
        let boxes = BoxRay::new(ray, true);
        // The root is entered wherever it is.
        stacks.0[stack][0] = 0;
        Walker {
            t_max: boxes.prune_distance(ray.t_max),
            boxes,
            prepared: T::prepare(ray),
            ray: index,
            stack,
            top: 1,
        }
    }
}

impl<T: Tier> Wide<T> {
    /// Whether [`Wide::stream`] has room for this tree.
    pub fn can_stream(&self) -> bool {
        !self.nodes.is_empty() && (self.depth + 1) * WIDTH <= ROOM
    }

    /// Walks all rays, none of which may have a direction with a 0. Calls `found` with every hit of a ray that it may want,
    /// nearest boxes first, until it says that this is enough.
    #[inline(always)]
    pub fn stream<S: Simd>(
        &self,
        rays: &[Ray],
        stacks: &mut Stacks,
        tests: &mut Tests,
        mut found: impl FnMut(usize, Hit) -> Step,
    ) {
        let mut live = rays.len().min(TURNS);
        if live == 0 {
            return;
        }
        // Where there are fewer rays than turns the others stay out.
        let mut walkers: [Walker<T::Prepared>; TURNS] = std::array::from_fn(
            #[inline(always)]
            |turn| Walker::new::<T>(rays, turn.min(live - 1), turn, stacks),
        );
        let mut next = live;
        let mut turn = 0;
        while live > 0 {
            if turn >= live {
                turn = 0;
            }
            let walker = &mut walkers[turn];
            let stack = &mut stacks.0[walker.stack];
            // What is still worth a visit.
            let child = loop {
                if walker.top == 0 {
                    break None;
                }
                walker.top -= 1;
                let item = stack[walker.top];
                if (item >> 32) as u32 <= walker.t_max.to_bits() {
                    break Some(Child::of_bits(item as u32));
                }
            };
            match child.map(Child::content) {
                Some(Content::Node(index)) => {
                    tests.nodes += 1;
                    let node = &self.nodes[index as usize];
                    let (enter, leave) = walker.boxes.span::<S, true>(node, walker.t_max);
                    let Some(to) = stack[walker.top..].first_chunk_mut() else { unreachable!("there is room") };
                    walker.top += S::sort(enter, leave, Child::bits(&node.children), to);
                }
                Some(_) => {
                    let leaf = Child::of_bits(stack[walker.top] as u32);
                    let (ray, index) = (&rays[walker.ray], walker.ray);
                    let after = self.hits_in_leaf::<S>(
                        ray,
                        &walker.prepared,
                        leaf,
                        tests,
                        #[inline(always)]
                        |hit| found(index, hit),
                    );
                    match after {
                        Step::Stop => walker.top = 0,
                        Step::Prune(t) => walker.t_max = walker.boxes.prune_distance(t),
                        Step::Go => {}
                    }
                }
                None if next < rays.len() => {
                    *walker = Walker::new::<T>(rays, next, walker.stack, stacks);
                    next += 1;
                    turn += 1;
                    continue;
                }
                None => {
                    live -= 1;
                    walkers[turn] = walkers[live];
                    continue;
                }
            }
            if walker.top > 0 {
                match Child::of_bits(stack[walker.top - 1] as u32).content() {
                    Content::Node(index) => S::prefetch(&self.nodes, index as usize),
                    Content::Groups(groups) => S::prefetch(&self.groups, groups.start as usize),
                    Content::Spheres(_) => {}
                }
            }
            turn += 1;
        }
    }
}
