//! The state of a stream: rays in flight, their stacks, and the queues of rays by the kind of their next visit.

use super::query::After;
use crate::bvh::wide::layout::{Child, WIDTH};
use crate::bvh::wide::single::box_ray::prune_distance;
use crate::geometry::{PreparedPacket, Rays};

/// Rays in flight.
pub(crate) const STREAM_WIDTH: usize = 64;

/// Elements per stack. Every node on a path leaves at most seven children; deeper trees are traversed by single rays.
pub(crate) const ROOM: usize = 256;

/// The memory of streams: its prepared rays, and a stack for each ray in flight.
#[derive(Default)]
pub(crate) struct Scratch {
    pub triangles: PreparedPacket,
    pub stacks: Stacks,
}

/// One traversal stack per ray in flight. An element has a [`Child`] in its lower half and the bits of its entry
/// distance in its upper half; positive f32 are ordered as their bits. The bottom element is [`Child::NOTHING`].
pub(crate) struct Stacks(pub Box<[Stack; STREAM_WIDTH]>);

/// With room for a whole vector above any top.
type Items = [u64; ROOM + WIDTH];

/// The stack of one ray.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct Stack {
    /// The padding also puts the bottoms of the stacks, nearly all that is used, into different cache sets.
    pub items: Items,
}

impl Default for Stacks {
    fn default() -> Self {
        let stacks = vec![Stack { items: [0; ROOM + WIDTH] }; STREAM_WIDTH];
        Stacks(stacks.try_into().unwrap_or_else(|_| unreachable!("as many as rays in flight")))
    }
}

/// The place of a ray in flight, below [`STREAM_WIDTH`], and the index of the ray.
#[derive(Clone, Copy)]
pub(crate) struct InFlight {
    pub place: usize,
    pub ray: usize,
}

/// A ray in flight.
#[derive(Clone, Copy, Default)]
pub(crate) struct StreamRay {
    /// The index of the ray.
    pub ray: usize,
    /// The height of its stack.
    pub top: usize,
    /// Boxes beyond this distance are not entered.
    pub t_max: f32,
    /// The node or leaf that it visits next.
    pub child: Child,
}

impl StreamRay {
    /// A ray at the root.
    #[inline(always)]
    pub(crate) fn new(rays: Rays, ray: usize, stack: &mut Items) -> Self {
        stack[0] = u64::from(Child::NOTHING.as_bits());
        StreamRay { ray, top: 1, t_max: prune_distance(rays.t_max(ray)), child: Child::node(0) }
    }

    /// Leaves out what does not matter after a leaf. Without branches, which would be mispredicted.
    #[inline(always)]
    pub(crate) fn apply(&mut self, After { t_max, is_done }: After) {
        self.t_max = self.t_max.min(prune_distance(t_max));
        self.top = if is_done { 1 } else { self.top };
    }

    /// Pops the next child that is entered before `t_max`.
    #[inline(always)]
    pub(crate) fn pop(&mut self, stack: &Items) {
        let mut top = self.top - 1;
        let mut item = stack[top % ROOM];
        while (item >> 32) as u32 > self.t_max.to_bits() {
            top -= 1;
            item = stack[top % ROOM];
        }
        (self.top, self.child) = (top, Child::of_bits(item as u32));
    }
}

/// One queue of rays for each kind of [`Child`].
pub(crate) struct Queues {
    rays: [[u8; STREAM_WIDTH]; Child::KINDS],
    /// The lengths, 16 bits for each kind, in one register: in memory, every push would wait for the one before,
    /// because the processor cannot predict which length is written.
    lengths: u64,
}

impl Queues {
    /// Empty queues.
    pub(crate) const EMPTY: Queues = Queues { rays: [[0; STREAM_WIDTH]; Child::KINDS], lengths: 0 };

    const BITS: usize = u64::BITS as usize / Child::KINDS;

    /// Whether no ray waits.
    #[inline(always)]
    pub(crate) fn is_empty(&self) -> bool {
        self.lengths == 0
    }

    /// Appends a ray to the queue of its next child. Without a branch, which would be mispredicted.
    #[inline(always)]
    pub(crate) fn push(&mut self, ray: usize, child: Child) {
        let kind = child.kind();
        self.rays[kind][self.len(kind) % STREAM_WIDTH] = ray as u8;
        self.lengths += 1 << (kind * Self::BITS);
    }

    #[inline(always)]
    fn len(&self, kind: usize) -> usize {
        (self.lengths >> (kind * Self::BITS)) as u16 as usize
    }

    /// Empties a queue and returns its rays and their number.
    #[inline(always)]
    pub(crate) fn take(&mut self, kind: usize) -> ([u8; STREAM_WIDTH], usize) {
        let len = self.len(kind);
        self.lengths -= (len as u64) << (kind * Self::BITS);
        (self.rays[kind], len)
    }
}
