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

/// What waits to be visited, the next one last.
#[derive(Default)]
pub struct Stacks {
    children: Vec<Child>,
    distances: Vec<f32>,
}

/// A ray on its way.
struct Walker<T: Tier> {
    ray: usize,
    boxes: BoxRay,
    prepared: T::Prepared,
    /// Beyond these nothing counts: in primitives, and in boxes.
    t_best: f64,
    t_max: f32,
    best: Option<Hit>,
    /// Its part of the stacks, and how much of that is in use.
    base: usize,
    top: usize,
}

impl<T: Tier> Walker<T> {
    #[inline(always)]
    fn new(rays: &[Ray], index: usize, base: usize) -> Self {
        let ray = &rays[index];
        let boxes = BoxRay::new(ray, true);
        Walker {
            ray: index,
            t_max: boxes.prune_distance(ray.t_max),
            boxes,
            prepared: T::prepare(ray),
            t_best: ray.t_max,
            best: None,
            base,
            top: base + 1,
        }
    }
}

impl<T: Tier> Wide<T> {
    /// Walks all rays, none of which may have a direction with a 0. `ANY` hit is enough, or the closest is found; `done` is
    /// told of each ray when its way ends.
    #[inline(always)]
    pub fn stream<S: Simd, const ANY: bool>(
        &self,
        rays: &[Ray],
        stacks: &mut Stacks,
        tests: &mut Tests,
        mut done: impl FnMut(usize, Option<Hit>),
    ) {
        if self.nodes.is_empty() {
            (0..rays.len()).for_each(|ray| done(ray, None));
            return;
        }
        // Every node on the way leaves at most all its children, and a whole vector is written at the end.
        let room = (self.depth + 1) * WIDTH;
        if stacks.children.len() < TURNS * room {
            stacks.children.resize(TURNS * room, Child::node(0));
            stacks.distances.resize(TURNS * room, 0.0);
        }
        let Stacks { children, distances } = stacks;
        let mut next = 0;
        let mut walkers: [Option<Walker<T>>; TURNS] = [const { None }; TURNS];
        let mut live = 0;
        for (turn, walker) in walkers.iter_mut().enumerate() {
            if next < rays.len() {
                let new = Walker::new(rays, next, turn * room);
                (children[new.base], distances[new.base]) = (Child::node(0), 0.0);
                *walker = Some(new);
                next += 1;
                live += 1;
            }
        }
        while live > 0 {
            for slot in &mut walkers {
                let Some(walker) = slot else { continue };
                // What is still worth a visit.
                let child = loop {
                    if walker.top == walker.base {
                        break None;
                    }
                    walker.top -= 1;
                    if ANY || distances[walker.top] <= walker.t_max {
                        break Some(children[walker.top]);
                    }
                };
                match child.map(Child::content) {
                    Some(Content::Node(index)) => {
                        tests.nodes += 1;
                        let node = &self.nodes[index as usize];
                        let (enter, leave) = walker.boxes.span::<S, true>(node, walker.t_max);
                        let (count, sorted, at) = S::sorted(enter, leave, Child::bits(node.children));
                        children[walker.top..walker.top + WIDTH].copy_from_slice(&Child::of_bits(sorted));
                        distances[walker.top..walker.top + WIDTH].copy_from_slice(&at);
                        walker.top += count as usize;
                    }
                    Some(_) => {
                        let (ray, mut best) = (&rays[walker.ray], walker.best);
                        let leaf = children[walker.top];
                        let after = self.hits_in_leaf::<S>(
                            ray,
                            &walker.prepared,
                            leaf,
                            tests,
                            walker.t_best,
                            #[inline(always)]
                            |hit| {
                                if !ANY && !self.is_better(ray, &hit, best.as_ref()) {
                                    return Step::Go;
                                }
                                best = Some(hit);
                                if ANY { Step::Stop } else { Step::Prune(hit.t) }
                            },
                        );
                        walker.best = best;
                        match after {
                            Step::Stop => walker.top = walker.base,
                            Step::Prune(t) => {
                                (walker.t_best, walker.t_max) = (t, walker.boxes.prune_distance(t));
                            }
                            Step::Go => {}
                        }
                    }
                    None => {
                        done(walker.ray, walker.best);
                        if next == rays.len() {
                            *slot = None;
                            live -= 1;
                            continue;
                        }
                        let new = Walker::new(rays, next, walker.base);
                        (children[new.base], distances[new.base]) = (Child::node(0), 0.0);
                        *walker = new;
                        next += 1;
                    }
                }
                if walker.top > walker.base {
                    match children[walker.top - 1].content() {
                        Content::Node(index) => S::prefetch(&self.nodes[index as usize]),
                        Content::Groups(groups) => S::prefetch(&self.groups[groups.start as usize]),
                        Content::Spheres(_) => {}
                    }
                }
            }
        }
    }
}
