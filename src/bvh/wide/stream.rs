//! Rays that have nothing in common, a few at a time.
//!
//! A single ray spends most of its time waiting: for a node to come from memory, and for a test to say which one is next.
//! So some rays take turns, a node or a leaf each, and what a ray needs at its next turn is asked for at the end of this
//! one.

use super::node::{BoxRay, Child, WIDTH};
use super::{Step, Wide};
use crate::bvh::Tests;
use crate::geometry::simd::Simd;
use crate::geometry::{Hit, Ray, Tier};

/// How many rays are on their way at once.
const WALKERS: usize = 32;

/// How much can wait to be visited by one ray. Every node on the way leaves at most all its children but one; trees that are deeper
/// than that allows are walked by one ray at a time.
const ROOM: usize = 256;

/// What waits to be visited, the next last, for every ray: a [`Child`], and in the upper half the bits of the distance at which
/// the ray enters it. Positive numbers are in the order of their bits. At the bottom lies [`Child::NOTHING`].
pub struct Stacks(Box<[Stack; WALKERS]>);

/// Room for a whole vector wherever the top is.
type Items = [u64; ROOM + WIDTH];

#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Stack {
    /// The room at the end also puts the beginnings of stacks, which are nearly all that is ever used, into different sets of the cache.
    items: Items,
}

impl Default for Stacks {
    fn default() -> Self {
        let stacks = vec![Stack { items: [0; ROOM + WIDTH] }; WALKERS];
        Stacks(stacks.try_into().unwrap_or_else(|_| unreachable!("as many as there are walkers")))
    }
}

/// A ray on its way.
#[derive(Clone, Copy)]
struct Walker<P: Copy> {
    boxes: BoxRay,
    prepared: P,
    ray: usize,
    /// How much of its stack is in use.
    top: usize,
    /// Boxes beyond this are not entered.
    t_max: f32,
    /// What it visits next.
    child: Child,
}

impl<P: Copy> Walker<P> {
    /// At the root.
    #[inline(always)]
    fn new<T: Tier<Prepared = P>>(rays: &[Ray], index: usize, stack: &mut Items) -> Self {
        let ray = &rays[index];
        let boxes = BoxRay::new(ray, true);
        stack[0] = u64::from(Child::NOTHING.as_bits());
        Walker {
            t_max: boxes.prune_distance(ray.t_max),
            boxes,
            prepared: T::prepare(ray),
            ray: index,
            top: 1,
            child: Child::node(0),
        }
    }

    /// Takes what is still worth a visit from the stack.
    #[inline(always)]
    fn pop(&mut self, stack: &Items) {
        let mut top = self.top - 1;
        let mut item = stack[top % ROOM];
        // What was entered beyond a hit that was found since is passed over.
        while (item >> 32) as u32 > self.t_max.to_bits() {
            top -= 1;
            item = stack[top % ROOM];
        }
        (self.top, self.child) = (top, Child::of_bits(item as u32));
    }
}

/// For each kind of [`Child`] the walkers that are about to visit one.
struct Queues {
    walkers: [[u8; WALKERS]; Child::KINDS],
    /// How many there are, 16 bits for each kind: in one register. Lengths in memory would make every walker wait for the one
    /// before, because it cannot be foreseen which of them is written.
    lengths: u64,
}

impl Queues {
    const BITS: usize = u64::BITS as usize / Child::KINDS;

    /// Puts a walker into the queue of what it visits next: without a branch, since what that is, is as good as random.
    #[inline(always)]
    fn push(&mut self, walker: usize, child: Child) {
        let kind = child.kind();
        self.walkers[kind][self.len(kind) % WALKERS] = walker as u8;
        self.lengths += 1 << (kind * Self::BITS);
    }

    #[inline(always)]
    fn len(&self, kind: usize) -> usize {
        (self.lengths >> (kind * Self::BITS)) as u16 as usize
    }

    /// Empties a queue, and tells what was in it.
    #[inline(always)]
    fn take(&mut self, kind: usize) -> ([u8; WALKERS], usize) {
        let len = self.len(kind);
        self.lengths -= (len as u64) << (kind * Self::BITS);
        (self.walkers[kind], len)
    }
}

impl<T: Tier> Wide<T> {
    /// Whether [`Wide::stream`] has room for this tree.
    pub fn can_stream(&self) -> bool {
        !self.nodes.is_empty() && (self.depth + 2) * WIDTH <= ROOM
    }

    /// Walks all rays, none of which may have a direction with a 0. Calls `found` with every hit of a ray that it may want,
    /// nearest boxes first, until it says that this is enough.
    #[inline(always)]
    pub(super) fn stream<S: Simd>(
        &self,
        rays: &[Ray],
        Stacks(stacks): &mut Stacks,
        tests: &mut Tests,
        mut found: impl FnMut(usize, Hit) -> Step,
    ) {
        let live = rays.len().min(WALKERS);
        if live == 0 {
            return;
        }
        let mut queues = Queues { walkers: [[0; WALKERS]; Child::KINDS], lengths: 0 };
        let mut walkers = [Walker::new::<T>(rays, 0, &mut stacks[0].items); WALKERS];
        for (index, walker) in walkers.iter_mut().enumerate().take(live) {
            *walker = Walker::new::<T>(rays, index, &mut stacks[index].items);
            queues.push(index, walker.child);
        }
        let mut next = live;
        loop {
            let (ready, len) = queues.take(Child::KIND_NODE);
            tests.nodes += len as u64;
            for &index in &ready[..len] {
                let index = usize::from(index) % WALKERS;
                let (walker, stack) = (&mut walkers[index], &mut stacks[index].items);
                let node = &self.nodes[walker.child.index()];
                let (enter, leave) = walker.boxes.span::<S, true>(node, walker.t_max);
                debug_assert!(walker.top < ROOM);
                let top = walker.top % ROOM;
                let Some(to) = stack[top..top + WIDTH].first_chunk_mut() else {
                    unreachable!("there is room")
                };
                walker.top += S::sort(enter, leave, Child::bits(&node.children), to);
            }
            // In a loop of its own: what was just written takes its time to be read.
            for &index in &ready[..len] {
                let index = usize::from(index) % WALKERS;
                let (walker, stack) = (&mut walkers[index], &mut stacks[index].items);
                walker.pop(stack);
                self.prefetch::<S>(walker.child);
                queues.push(index, walker.child);
            }
            for kind in [Child::KIND_GROUPS, Child::KIND_SPHERES] {
                let (ready, len) = queues.take(kind);
                for &index in &ready[..len] {
                    let index = usize::from(index) % WALKERS;
                    let (walker, stack) = (&mut walkers[index], &mut stacks[index].items);
                    let ray = walker.ray;
                    let after = self.hits_in_leaf::<S>(
                        &rays[ray],
                        &walker.prepared,
                        walker.child,
                        tests,
                        #[inline(always)]
                        |hit| found(ray, hit),
                    );
                    match after {
                        Step::Stop => walker.top = 1,
                        Step::Prune(t) => walker.t_max = walker.boxes.prune_distance(t),
                        Step::Go => {}
                    }
                    walker.pop(stack);
                    self.prefetch::<S>(walker.child);
                    queues.push(index, walker.child);
                }
            }
            let (ready, len) = queues.take(Child::KIND_NOTHING);
            for &index in ready[..len].iter().take(rays.len() - next) {
                let index = usize::from(index) % WALKERS;
                walkers[index] = Walker::new::<T>(rays, next, &mut stacks[index].items);
                queues.push(index, walkers[index].child);
                next += 1;
            }
            if queues.lengths == 0 {
                return;
            }
        }
    }

    #[inline(always)]
    fn prefetch<S: Simd>(&self, child: Child) {
        S::prefetch(&self.nodes, &self.groups, child.is_leaf(), child.index());
    }
}
