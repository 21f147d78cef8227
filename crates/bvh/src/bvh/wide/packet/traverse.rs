//! The traversal of the tree by a packet: nodes are tested against the frustum, leaves against blocks of rays.

use super::edge_functions::EdgeFunctions;
use super::frustum::Frustum;
use super::projected_sphere::ProjectedSphere;
use super::projected_triangles::{Arithmetic, InF32, InF64, ProjectedTriangles};
use super::rays::BLOCKS;
use super::resolve::hit_in_slot;
use super::{Occluder, Packet};
use crate::bvh::Tests;
use crate::bvh::wide::layout::{Child, Content, Node, TriangleLeaf, WIDTH, Wide};
use crate::bvh::wide::single::leaf::{hit_analytic, hit_analytic_n};
use crate::geometry::lanes::{LANES4, MASK4, MAX_LANES};
use crate::geometry::simd::{Simd, Vector};
use crate::geometry::{Corner, PrimId, SlotId, Tier, Triangle4};

/// The work per ray above which a packet is abandoned: 1 for each triangle leaf visited, 2 for each of its triangles
/// that overlaps a block of rays. For closest hits and for any hit. Measurements: docs/decisions.md.
const MAX_WORK_PER_RAY: [usize; 2] = [8, 4];

/// The frustum is tightened when at most this share of the rays is left that it was last made for. Measurements:
/// docs/decisions.md.
const TIGHTENED: [usize; 2] = [3, 4];

/// Leaves that occlude more than this share of a packet's rays are tested first by the next packet. Measurements:
/// docs/decisions.md.
const OCCLUDER_SHARE: [usize; 2] = [1, 4];

/// Leaves queued before the first of them is tested, so that its prefetch completes. Measurements: docs/decisions.md.
const MAX_QUEUED: usize = 3;

/// The most leaves in the queue: those of one more child.
const QUEUE_ROOM: usize = (MAX_QUEUED + Child::MAX_COUNT).next_power_of_two();

/// A queue of leaves of triangles and their entry depths.
#[derive(Default)]
struct LeafQueue {
    items: [(u32, f32); QUEUE_ROOM],
    /// The numbers of leaves removed and added so far.
    removed: usize,
    added: usize,
}

impl LeafQueue {
    #[inline(always)]
    fn len(&self) -> usize {
        self.added - self.removed
    }

    #[inline(always)]
    fn add(&mut self, leaf: u32, at: f32) {
        self.items[self.added % QUEUE_ROOM] = (leaf, at);
        self.added += 1;
    }

    /// Removes the first leaf; there must be one.
    #[inline(always)]
    fn remove(&mut self) -> (u32, f32) {
        let first = self.items[self.removed % QUEUE_ROOM];
        self.removed += 1;
        first
    }
}

/// The test of triangles by the rays of a packet: by [`EdgeFunctions`] and the tier, or in fast tiers in f32 alone.
pub(super) trait TriangleTest<S: Simd>: Arithmetic<S> {
    /// The triangles of one or two leaves, prepared.
    type Functions;

    /// Prepares projected triangles of leaves.
    fn functions<C: Corner>(
        projected: &ProjectedTriangles<S, Self>,
        leaves: [&Triangle4<C>; 2],
        frustum: &Frustum,
    ) -> Self::Functions;

    /// Tests the rays of blocks against the triangle in a lane, which is in a slot of a leaf. Returns the blocks in
    /// which best hits changed.
    fn visit_blocks<T: Tier, const ANY: bool>(
        packet: &mut Packet<T, S, ANY>,
        wide: &Wide<T>,
        functions: &Self::Functions,
        triangle: (usize, &TriangleLeaf<T::Corner>, u32),
        blocks: u32,
        tests: &mut Tests,
    ) -> u32;
}

impl<S: Simd> TriangleTest<S> for InF64 {
    type Functions = EdgeFunctions<S>;

    #[inline(always)]
    fn functions<C: Corner>(
        projected: &ProjectedTriangles<S, Self>,
        _: [&Triangle4<C>; 2],
        frustum: &Frustum,
    ) -> EdgeFunctions<S> {
        EdgeFunctions::new(projected, frustum)
    }

    #[inline(always)]
    fn visit_blocks<T: Tier, const ANY: bool>(
        packet: &mut Packet<T, S, ANY>,
        wide: &Wide<T>,
        edges: &EdgeFunctions<S>,
        (lane, leaf, slot): (usize, &TriangleLeaf<T::Corner>, u32),
        mut blocks: u32,
        tests: &mut Tests,
    ) -> u32 {
        let (slot, corners) = (SlotId::new(slot), leaf.corners.corners_f64(lane % LANES4));
        let mut changed = 0;
        while blocks != 0 {
            let block = blocks.trailing_zeros() as usize % BLOCKS;
            blocks &= blocks - 1;
            let [u, v, _] = &packet.scratch.rays.projected;
            let overlap = edges.overlap(lane, S::F::load(u[block]), S::F::load(v[block]));
            let active = packet.scratch.active[block];
            let mut undecided = overlap.possible & active;
            if undecided == 0 {
                continue;
            }
            tests.primitives += u64::from(undecided.count_ones());
            let certain = overlap.certain & active;
            if certain != 0 {
                let depths = edges.depths(lane, &overlap);
                let triangle = (slot, &corners, edges.signs[lane]);
                let (unknown, found) = packet.record_certain(block, certain, triangle, depths);
                undecided = undecided & !certain | unknown;
                changed |= u32::from(found) << block;
            }
            if undecided == 0 {
                continue;
            }
            let undecided = packet.without_known(wide, block, undecided, leaf.ids[lane % LANES4]);
            let found = packet.test_block(
                wide,
                block,
                undecided,
                #[inline(always)]
                |packet, first| T::hit_triangle_n(packet.prepared(first / S::D::LANES), &corners, false),
                #[inline(always)]
                |packet, ray, group, place| {
                    if group.undecided >> place & 1 == 0 {
                        return Some(group.at(place, PrimId(leaf.ids[lane % LANES4]), slot));
                    }
                    hit_in_slot(wide, &packet.rays.get(ray), slot)
                },
            );
            changed |= u32::from(found) << block;
        }
        changed
    }
}

impl<T: Tier, S: Simd, const ANY: bool> Packet<'_, T, S, ANY> {
    /// Finds the best hits of all rays. `false` if the packet is abandoned.
    #[inline(always)]
    pub(super) fn traverse(
        &mut self,
        wide: &Wide<T>,
        stack: &mut Vec<(Child, f32)>,
        tests: &mut Tests,
        prefetch: impl Fn(usize),
        occluder: &mut Occluder,
    ) -> bool {
        stack.clear();
        let Some(mut node) = wide.nodes.first() else { return true };
        let (mut queue, mut work) = (LeafQueue::default(), 0);
        // Rays when the frustum was made, and the most that leaves retired.
        let (mut rays_in_frustum, mut most) =
            (self.rays.len(), self.rays.len() * OCCLUDER_SHARE[0] / OCCLUDER_SHARE[1]);
        let tested = if ANY { occluder.take() } else { None };
        if let Some((first, second)) = tested {
            work += self.visit_leaves(wide, first, second, tests);
            self.retired(rays_in_frustum, (first, second), &mut rays_in_frustum, &mut most, occluder);
            if self.remaining == 0 {
                return true;
            }
        }
        let tested = tested.map(|(first, second)| [first, second.unwrap_or(first)]);
        loop {
            tests.nodes += 1;
            let (mask, at) = self.frustum.enter::<S>(node);
            push_children::<T, S>(wide, node, mask, &at, stack);
            loop {
                self.prefetch_following(&prefetch);
                let next = stack.pop();
                if next.is_some_and(|(_, at)| at > self.frustum.max_depth) {
                    continue;
                }
                let may_stay = match next.map(|(child, at)| (child.content(), at)) {
                    Some((Content::Node(index), _)) => {
                        node = &wide.nodes[index as usize];
                        break;
                    }
                    Some((Content::Triangles(leaves), at)) => {
                        for leaf in leaves {
                            if !(ANY && tested.is_some_and(|tested| tested.contains(&leaf))) {
                                queue.add(leaf, at);
                            }
                        }
                        MAX_QUEUED
                    }
                    Some((Content::Analytic(shapes), _)) => {
                        for index in shapes {
                            self.visit_analytic(wide, index, tests);
                        }
                        MAX_QUEUED
                    }
                    None if queue.len() == 0 => return true,
                    None => 0,
                };
                while queue.len() > may_stay {
                    let (first, at) = queue.remove();
                    if at > self.frustum.max_depth {
                        continue;
                    }
                    let are_two = (S::D::LANES > LANES4 || T::IS_FAST) && queue.len() > 0;
                    let second = if are_two { Some(queue.remove().0) } else { None };
                    let before = self.remaining;
                    work += self.visit_leaves(wide, first, second, tests);
                    if ANY && self.remaining != before {
                        self.retired(before, (first, second), &mut rays_in_frustum, &mut most, occluder);
                        if self.remaining == 0 {
                            return true;
                        }
                    }
                }
                if work > MAX_WORK_PER_RAY[usize::from(ANY)] * self.rays.len() {
                    return false;
                }
            }
        }
    }

    /// After leaves retired rays, of which there were `before`: tightens the frustum if many are gone since it was made
    /// for `rays_in_frustum` rays, and notes the leaves if they are the ones that retired the most.
    #[inline(always)]
    fn retired(
        &mut self,
        before: usize,
        leaves: (u32, Option<u32>),
        rays_in_frustum: &mut usize,
        most: &mut usize,
        occluder: &mut Occluder,
    ) {
        let count = before - self.remaining;
        if count > *most {
            (*most, *occluder) = (count, Some(leaves));
        }
        if self.remaining != 0 && self.remaining * TIGHTENED[1] <= *rays_in_frustum * TIGHTENED[0] {
            *rays_in_frustum = self.remaining;
            self.tighten();
        }
    }

    /// [`Packet::visit_triangles`] in the arithmetic of the tier.
    #[inline(always)]
    fn visit_leaves(&mut self, wide: &Wide<T>, first: u32, second: Option<u32>, tests: &mut Tests) -> usize {
        if T::IS_FAST {
            self.visit_triangles::<InF32>(wide, first, second, tests)
        } else {
            self.visit_triangles::<InF64>(wide, first, second, tests)
        }
    }

    /// Tests the triangles of a leaf and, where there are the lanes, of a second. Returns the work done.
    #[inline(always)]
    fn visit_triangles<A: TriangleTest<S>>(
        &mut self,
        wide: &Wide<T>,
        first: u32,
        second: Option<u32>,
        tests: &mut Tests,
    ) -> usize {
        let indices = [first, second.unwrap_or(first)];
        let leaves = [&wide.triangles[indices[0] as usize], &wide.triangles[indices[1] as usize]];
        let corners = [&leaves[0].corners, &leaves[1].corners];
        let projected = ProjectedTriangles::<S, A>::new(corners, &self.frustum);
        let (mut blocks, mut lanes) = ([0; MAX_LANES], 0u32);
        let mut overlapping = projected.overlapping & if second.is_some() { A::V::ALL } else { MASK4 };
        while overlapping != 0 {
            let lane = overlapping.trailing_zeros() as usize % A::V::LANES;
            overlapping &= overlapping - 1;
            blocks[lane] = projected.blocks(lane, &self.scratch.block_bounds, &self.scratch.depths);
            lanes |= u32::from(blocks[lane] != 0) << lane;
        }
        let visits = 1 + usize::from(second.is_some());
        if lanes == 0 {
            return visits;
        }
        let work = visits + 2 * lanes.count_ones() as usize;
        let functions = A::functions(&projected, corners, &self.frustum);
        // Updated at the end: reading the depths right after their lanes were stored would stall.
        let mut changed = 0u32;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % A::V::LANES;
            lanes &= lanes - 1;
            let (leaf, index) = (leaves[lane / LANES4], indices[lane / LANES4]);
            let triangle = (lane, leaf, index * LANES4 as u32 + (lane % LANES4) as u32);
            changed |= A::visit_blocks(self, wide, &functions, triangle, blocks[lane], tests);
        }
        self.update_depths(changed);
        work
    }

    /// Tests all rays against an analytic shape.
    #[inline(always)]
    fn visit_analytic(&mut self, wide: &Wide<T>, index: u32, tests: &mut Tests) {
        let (Some(shape), prim) = &wide.analytic[index as usize] else { return };
        let slot = wide.slot_of_analytic(index);
        let projected = ProjectedSphere::<S>::new(shape.bounding_sphere(), &self.frustum);
        let mut changed = 0u32;
        for block in 0..self.scratch.rays.blocks % (BLOCKS + 1) {
            let [u, v, _] = &self.scratch.rays.projected;
            let possible =
                projected.possible(S::F::load(u[block]), S::F::load(v[block])) & self.scratch.active[block];
            if possible == 0 {
                continue;
            }
            tests.primitives += u64::from(possible.count_ones());
            let found = if T::IS_FAST {
                self.test_shape_fast(block, possible, shape, slot.index())
            } else {
                self.test_block(
                    wide,
                    block,
                    possible,
                    #[inline(always)]
                    |packet, first| hit_analytic_n::<T, S::D>(&packet.rays.lanes(first), shape),
                    #[inline(always)]
                    |packet, ray, group, lane| {
                        let mut hit = group.at(lane, *prim, slot);
                        if group.undecided >> lane & 1 != 0 {
                            hit.t = hit_analytic::<T>(&packet.rays.get(ray), shape)?;
                        }
                        Some(hit)
                    },
                )
            };
            changed |= u32::from(found) << block;
        }
        self.update_depths(changed);
    }
}

/// Pushes the children in `mask`, the farthest first, and prefetches them. `at` are the entry depths.
#[inline(always)]
fn push_children<T: Tier, S: Simd>(
    wide: &Wide<T>,
    node: &Node,
    mut mask: u32,
    at: &[f32; WIDTH],
    stack: &mut Vec<(Child, f32)>,
) {
    let first = stack.len();
    while mask != 0 {
        let place = mask.trailing_zeros() as usize % WIDTH;
        mask &= mask - 1;
        let item = (node.children[place], at[place]);
        S::prefetch(&wide.nodes, &wide.triangles, item.0.is_leaf(), item.0.index());
        let mut after = stack.len();
        stack.push(item);
        while after > first && stack[after - 1].1 < item.1 {
            stack[after] = stack[after - 1];
            after -= 1;
        }
        stack[after] = item;
    }
}
