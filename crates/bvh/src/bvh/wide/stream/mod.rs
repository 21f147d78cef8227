//! The traversal for incoherent rays: [`STREAM_WIDTH`] rays in turns, one node or leaf each.
//!
//! A single ray waits for memory and for branches that cannot be predicted. Here the memory of a ray's next node or
//! leaf is prefetched while the other rays take their turns, and neither the order of a node's children
//! ([`Simd::sort_entered`]) nor the hits in a leaf of triangles take branches: a mispredicted one would also end the
//! overlap of the other rays. So leaves are tested in loops over all rays that wait for one: the first drops those
//! that certainly have no hit ([`Tier::may_hit4`](crate::geometry::Tier::may_hit4)), the second tests the others
//! without leaving early.
//!
//! [`query`] has what is done with hits, [`leaves`] the visits of leaves, [`box_rays`] the rays prepared for boxes,
//! [`state`] the rays in flight, their stacks, and the queues of rays by what they visit next.

mod box_rays;
mod leaves;
mod query;
mod state;

use super::layout::{Child, TriangleLeaf, WIDTH, Wide};
use super::single::box_ray::BoxRay;
use crate::bvh::Tests;
use crate::geometry::simd::Simd;
use crate::geometry::{PreparedRay, Rays, Tier};
use box_rays::BoxRays;
pub(crate) use box_rays::RayMask;
use leaves::{Leaves, LeavesByRay, TriangleTests};
use query::Query;
pub(crate) use query::{AllHits, ClosestHits, Occlusion};
pub(crate) use state::Scratch;
use state::{InFlight, Queues, ROOM, STREAM_WIDTH, Stack, Stacks, StreamRay};

/// Whether the stacks have room for this tree. Must hold for every query.
pub(crate) fn applies<T: Tier>(wide: &Wide<T>) -> bool {
    !wide.nodes.is_empty() && (wide.depth + 2) * WIDTH <= ROOM
}

/// Traces at most `BATCH` rays for a query, but for those that it returns.
#[inline(always)]
pub(crate) fn trace<T: Tier, S: Simd>(
    simd: S,
    wide: &Wide<T>,
    rays: Rays,
    scratch: &mut Option<Scratch>,
    tests: &mut Tests,
    query: impl Query<T, S>,
) -> RayMask {
    let Scratch { triangles, stacks } = scratch.get_or_insert_default();
    simd.run(
        #[inline(always)]
        move || {
            let prepared = T::Prepared::prepare_packet::<S::D4>(rays, triangles);
            let leaves = TriangleTests { wide, rays, prepared, query };
            traverse::<T, S>(wide, rays, stacks, T::IS_FAST, tests, leaves)
        },
    )
}

/// Calls `visit` with the index of each of at most `BATCH` rays and each leaf whose box has a point on it, between
/// `t_min` and `t_max`, ends included; but leaves of triangles only if `may_hit` returns `true` for them. Returns the
/// rays that it does not trace.
#[inline(always)]
pub(crate) fn each_leaf<T: Tier, S: Simd>(
    wide: &Wide<T>,
    rays: Rays,
    scratch: &mut Option<Scratch>,
    tests: &mut Tests,
    may_hit: impl Fn(usize, &TriangleLeaf<T::Corner>) -> bool,
    visit: impl FnMut(usize, Child),
) -> RayMask {
    let Scratch { stacks, .. } = scratch.get_or_insert_default();
    traverse::<T, S>(wide, rays, stacks, false, tests, LeavesByRay { may_hit, visit })
}

/// Traces the rays, but for those that it returns. `fast`: boxes are tested without margins.
///
/// One function, because `queues` must stay in registers between the steps.
#[inline(always)]
fn traverse<T: Tier, S: Simd>(
    wide: &Wide<T>,
    rays: Rays,
    Stacks(stacks): &mut Stacks,
    fast: bool,
    tests: &mut Tests,
    mut leaves: impl Leaves<T, S>,
) -> RayMask {
    let mut prepared = BoxRays::default();
    let mut boxes = [BoxRay::default(); STREAM_WIDTH];
    let unsupported = BoxRays::unsupported::<S::D4>(rays);
    let (order, len) = unsupported.others(
        rays.len(),
        #[inline(always)]
        |ray| leaves.is_known(ray),
    );
    let mut waiting = order[..len].iter().map(|&ray| usize::from(ray));
    let mut queues = Queues::EMPTY;
    let mut in_flight = [StreamRay::default(); STREAM_WIDTH];
    for (place, state) in in_flight.iter_mut().enumerate() {
        let Some(ray) = waiting.next() else { break };
        *state = StreamRay::new(rays, ray, &mut stacks[place].items);
        boxes[place] = *prepared.at::<S>(rays, ray, fast);
        queues.push(place, state.child);
    }
    while !queues.is_empty() {
        // 1. Nodes: the entered children go to the stacks.
        let (ready, len) = queues.take(Child::KIND_NODE);
        tests.nodes += len as u64;
        for &place in &ready[..len] {
            let place = usize::from(place) % STREAM_WIDTH;
            let (state, stack) = (&mut in_flight[place], &mut stacks[place].items);
            let node = &wide.nodes[state.child.index()];
            let (enter, leave) = boxes[place].span::<S, true>(node, state.t_max, fast);
            debug_assert!(state.top < ROOM);
            let top = state.top % ROOM;
            let Some(to) = stack[top..top + WIDTH].first_chunk_mut() else { unreachable!("there is room") };
            state.top += S::sort_entered(enter, leave, Child::bits(&node.children), to);
        }
        // In a second loop, because reading what was just stored in parts stalls.
        for &place in &ready[..len] {
            advance::<T, S>(wide, place, &mut in_flight, stacks, &mut queues);
        }
        // 2. Leaves of triangles: those that may have a hit, found without a branch; then the hits.
        let (ready, len) = queues.take(Child::KIND_TRIANGLES);
        tests.primitives += len as u64;
        let (mut candidates, mut count) = ([0; STREAM_WIDTH], 0);
        let leaf = |child: Child| &wide.triangles[child.index()];
        let (pairs, rest) = ready[..len].as_chunks();
        for places in pairs {
            let [a, b] = places.map(|place| in_flight[usize::from(place) % STREAM_WIDTH]);
            let may_hit = leaves.may_hit_two([a.ray, b.ray], [leaf(a.child), leaf(b.child)]);
            for (place, may_hit) in places.iter().zip(may_hit) {
                candidates[count % STREAM_WIDTH] = *place;
                count += usize::from(may_hit);
            }
        }
        for &place in rest {
            let StreamRay { ray, child, .. } = in_flight[usize::from(place) % STREAM_WIDTH];
            candidates[count % STREAM_WIDTH] = place;
            count += usize::from(leaves.may_hit(ray, leaf(child)));
        }
        for &place in &candidates[..count] {
            let place = usize::from(place) % STREAM_WIDTH;
            let state = &mut in_flight[place];
            state.apply(leaves.visit_triangles(InFlight { place, ray: state.ray }, state.child));
        }
        for &place in &ready[..len] {
            advance::<T, S>(wide, place, &mut in_flight, stacks, &mut queues);
        }
        // 3. Leaves of analytic shapes.
        let (ready, len) = queues.take(Child::KIND_ANALYTIC);
        for &place in &ready[..len] {
            let state = &mut in_flight[usize::from(place) % STREAM_WIDTH];
            let at = InFlight { place: place.into(), ray: state.ray };
            tests.primitives += state.child.range().len() as u64;
            state.apply(leaves.visit_analytic(at, state.child));
            advance::<T, S>(wide, place, &mut in_flight, stacks, &mut queues);
        }
        // 4. Finished rays are replaced by the next ones.
        let (ready, len) = queues.take(Child::KIND_NOTHING);
        for &place in &ready[..len] {
            let place = usize::from(place) % STREAM_WIDTH;
            leaves.finish(InFlight { place, ray: in_flight[place].ray });
            if let Some(ray) = waiting.next() {
                in_flight[place] = StreamRay::new(rays, ray, &mut stacks[place].items);
                boxes[place] = *prepared.at::<S>(rays, ray, fast);
                queues.push(place, in_flight[place].child);
            }
        }
    }
    unsupported
}

/// Pops what the ray at a place visits next, prefetches it, and queues the ray for it.
#[inline(always)]
fn advance<T: Tier, S: Simd>(
    wide: &Wide<T>,
    place: u8,
    in_flight: &mut [StreamRay; STREAM_WIDTH],
    stacks: &[Stack; STREAM_WIDTH],
    queues: &mut Queues,
) {
    let place = usize::from(place) % STREAM_WIDTH;
    let state = &mut in_flight[place];
    state.pop(&stacks[place].items);
    S::prefetch(&wide.nodes, &wide.triangles, state.child.is_leaf(), state.child.index());
    queues.push(place, state.child);
}
