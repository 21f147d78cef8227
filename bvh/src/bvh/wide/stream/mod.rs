//! The traversal for incoherent rays: [`STREAM_WIDTH`] rays in turns, one node or leaf each.
//!
//! A single ray waits for memory and for branches that cannot be predicted. Here the memory of a ray's next node or
//! leaf is prefetched while the other rays take their turns, and the children of a node are sorted without branches
//! ([`Simd::sort_entered`]). [`box_rays`] has the rays prepared for boxes, [`state`] the rays in flight, their stacks,
//! and the queues of rays by what they visit next.

mod box_rays;
mod state;

use super::layout::{Child, WIDTH, Wide};
use super::single::box_ray::prune_distance;
use super::single::leaf::hits_in_leaf;
use crate::bvh::{Next, Tests};
use crate::geometry::simd::{Simd, Vector};
use crate::geometry::{Hit, PreparedRay, Rays, Tier};
use box_rays::BoxRays;
pub(crate) use state::Scratch;
use state::{Queues, ROOM, STREAM_WIDTH, Stacks, StreamRay};

/// Whether the stacks have room for this tree, and the rays are supported.
#[inline(always)]
pub(crate) fn applies<T: Tier, S: Simd>(wide: &Wide<T>, rays: Rays) -> bool {
    !wide.nodes.is_empty() && (wide.depth + 2) * WIDTH <= ROOM && BoxRays::supports::<S::D4>(rays)
}

/// Calls `found` with the index of a ray and each of its hits, nearest boxes first, until it returns [`Next::Stop`]
/// for that ray. [`applies`] must hold; `rays` must be `BATCH` at most.
#[inline(always)]
pub(crate) fn each_hit<T: Tier, S: Simd>(
    wide: &Wide<T>,
    rays: Rays,
    Scratch { boxes, triangles, stacks }: &mut Scratch,
    tests: &mut Tests,
    mut found: impl FnMut(usize, Hit) -> Next,
) {
    let prepared = T::Prepared::prepare_packet::<S::D4>(rays, triangles);
    traverse::<T, S>(
        wide,
        rays,
        (boxes, stacks),
        T::IS_FAST,
        tests,
        #[inline(always)]
        |ray, leaf, tests| {
            hits_in_leaf::<T, S>(
                wide,
                #[inline(always)]
                || rays.get(ray),
                &mut prepared[ray],
                leaf,
                tests,
                #[inline(always)]
                |hit| found(ray, hit),
            )
        },
    );
}

/// Calls `visit` with the index of a ray and each leaf whose box has a point on it, between `t_min` and `t_max`, ends
/// included. As for [`each_hit`], [`applies`] must hold, and `rays` be `BATCH` at most.
#[inline(always)]
pub(crate) fn each_leaf<T: Tier, S: Simd>(
    wide: &Wide<T>,
    rays: Rays,
    Scratch { boxes, stacks, .. }: &mut Scratch,
    tests: &mut Tests,
    mut visit: impl FnMut(usize, Child, &mut Tests),
) {
    traverse::<T, S>(
        wide,
        rays,
        (boxes, stacks),
        false,
        tests,
        #[inline(always)]
        |ray, leaf, tests| {
            visit(ray, leaf, tests);
            Next::Continue
        },
    );
}

/// Calls `visit` with the index of a ray and each leaf that it enters, until it returns [`Next::Stop`] for that ray.
/// `fast`: boxes are tested without margins.
///
/// One function, because `queues` and `next` must stay in registers between the steps.
#[inline(always)]
fn traverse<T: Tier, S: Simd>(
    wide: &Wide<T>,
    rays: Rays,
    (boxes, Stacks(stacks)): (&mut BoxRays, &mut Stacks),
    fast: bool,
    tests: &mut Tests,
    mut visit: impl FnMut(usize, Child, &mut Tests) -> Next,
) {
    for first in (0..rays.len()).step_by(S::F8::LANES) {
        boxes.fill::<S>(rays, first, fast);
    }
    let live = rays.len().min(STREAM_WIDTH);
    let mut queues = Queues::default();
    let mut in_flight = [StreamRay::default(); STREAM_WIDTH];
    for (index, state) in in_flight.iter_mut().enumerate().take(live) {
        *state = StreamRay::new(rays, index, &mut stacks[index].items);
        queues.push(index, state.child);
    }
    let mut next = live;
    loop {
        // 1. Nodes: the entered children go to the stacks.
        let (ready, len) = queues.take(Child::KIND_NODE);
        tests.nodes += len as u64;
        for &index in &ready[..len] {
            let index = usize::from(index) % STREAM_WIDTH;
            let (state, stack) = (&mut in_flight[index], &mut stacks[index].items);
            let node = &wide.nodes[state.child.index()];
            let (enter, leave) = boxes.at(state.ray).span::<S, true>(node, state.t_max, fast);
            debug_assert!(state.top < ROOM);
            let top = state.top % ROOM;
            let Some(to) = stack[top..top + WIDTH].first_chunk_mut() else { unreachable!("there is room") };
            state.top += S::sort_entered(enter, leave, Child::bits(&node.children), to);
        }
        // In a second loop, because reading what was just stored in parts stalls.
        for &index in &ready[..len] {
            let index = usize::from(index) % STREAM_WIDTH;
            let (state, stack) = (&mut in_flight[index], &mut stacks[index].items);
            state.pop(stack);
            prefetch::<T, S>(wide, state.child);
            queues.push(index, state.child);
        }
        // 2. Leaves.
        for kind in [Child::KIND_TRIANGLES, Child::KIND_ANALYTIC] {
            let (ready, len) = queues.take(kind);
            for &index in &ready[..len] {
                let index = usize::from(index) % STREAM_WIDTH;
                let (state, stack) = (&mut in_flight[index], &mut stacks[index].items);
                let after = visit(state.ray, state.child, tests);
                match after {
                    Next::Stop => state.top = 1,
                    Next::Shorten(t) => state.t_max = prune_distance(t),
                    Next::Continue => {}
                }
                state.pop(stack);
                prefetch::<T, S>(wide, state.child);
                queues.push(index, state.child);
            }
        }
        // 3. Finished rays are replaced by the next ones.
        let (ready, len) = queues.take(Child::KIND_NOTHING);
        for &index in ready[..len].iter().take(rays.len() - next) {
            let index = usize::from(index) % STREAM_WIDTH;
            in_flight[index] = StreamRay::new(rays, next, &mut stacks[index].items);
            queues.push(index, in_flight[index].child);
            next += 1;
        }
        if queues.is_empty() {
            return;
        }
    }
}

#[inline(always)]
fn prefetch<T: Tier, S: Simd>(wide: &Wide<T>, child: Child) {
    S::prefetch(&wide.nodes, &wide.triangles, child.is_leaf(), child.index());
}
