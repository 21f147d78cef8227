//! The traversal of the tree by a packet: nodes are tested against the frustum, leaves against blocks of rays.

use super::Packet;
use super::edge_functions::EdgeFunctions;
use super::projected_sphere::ProjectedSphere;
use super::projected_triangles::ProjectedTriangles;
use super::rays::BLOCKS;
use super::resolve::{CertainHit, hit_in_slot};
use crate::bvh::Tests;
use crate::bvh::wide::layout::{Child, Content, Node, TriangleLeaf, WIDTH, Wide};
use crate::bvh::wide::single::leaf::{hit_analytic, hit_analytic_n};
use crate::geometry::lanes::LANES4;
use crate::geometry::simd::{Simd, Vector};
use crate::geometry::{PrimId, SlotId, Tier};

/// The work per ray above which a packet is abandoned: 1 for each triangle leaf visited, 2 for each of its triangles
/// that overlaps the frustum. For closest hits and for any hit. Measurements: docs/decisions.md.
const MAX_WORK_PER_RAY: [usize; 2] = [8, 4];

impl<T: Tier, S: Simd, const ANY: bool> Packet<'_, T, S, ANY> {
    /// Finds the best hits of all rays. `false` if the packet is abandoned.
    #[inline(always)]
    pub(super) fn traverse(
        &mut self,
        wide: &Wide<T>,
        stack: &mut Vec<(Child, f32)>,
        tests: &mut Tests,
        prefetch: impl Fn(usize),
    ) -> bool {
        stack.clear();
        let Some(mut node) = wide.nodes.first() else { return true };
        let mut work = 0;
        loop {
            tests.nodes += 1;
            let (mask, at) = self.frustum.enter::<S>(node);
            push_children::<T, S>(wide, node, mask, &at, stack);
            loop {
                self.prefetch_following(&prefetch);
                let Some((child, at)) = stack.pop() else { return true };
                if at > self.frustum.max_depth {
                    continue;
                }
                match child.content() {
                    Content::Node(index) => {
                        node = &wide.nodes[index as usize];
                        break;
                    }
                    Content::Triangles(triangles) => {
                        for index in triangles {
                            work += self.visit_triangles(wide, index, tests);
                        }
                        if work > MAX_WORK_PER_RAY[usize::from(ANY)] * self.rays.len() {
                            return false;
                        }
                    }
                    Content::Analytic(shapes) => {
                        for index in shapes {
                            self.visit_analytic(wide, index, tests);
                        }
                    }
                }
            }
        }
    }

    /// Tests the four triangles of a leaf. Returns the work done.
    #[inline(always)]
    fn visit_triangles(&mut self, wide: &Wide<T>, index: u32, tests: &mut Tests) -> usize {
        let leaf = &wide.triangles[index as usize];
        let projected = ProjectedTriangles::<S>::new::<T>(&leaf.corners, &self.frustum);
        let (mut blocks, mut lanes) = ([0; LANES4], 0);
        for (lane, blocks) in blocks.iter_mut().enumerate() {
            if projected.overlapping >> lane & 1 != 0 {
                *blocks = projected.blocks(lane, &self.scratch.block_bounds, &self.scratch.depths);
                lanes |= u32::from(*blocks != 0) << lane;
            }
        }
        if lanes == 0 {
            return 1;
        }
        let work = 1 + 2 * lanes.count_ones() as usize;
        let edges = EdgeFunctions::new::<S>(&projected, &self.frustum);
        // Updated at the end: reading the depths right after their lanes were stored would stall.
        let mut changed = 0u32;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % LANES4;
            lanes &= lanes - 1;
            let slot = SlotId::new(index * LANES4 as u32 + lane as u32);
            let (mut blocks, corners) = (blocks[lane], leaf.corners.corners_f64(lane));
            while blocks != 0 {
                let block = blocks.trailing_zeros() as usize % BLOCKS;
                blocks &= blocks - 1;
                let found = self.visit_block(wide, block, lane, (leaf, slot, &corners), &edges, tests);
                changed |= u32::from(found) << block;
            }
        }
        self.update_depths(changed);
        work
    }

    /// Tests the rays of a block against one triangle. Returns whether a best hit changed.
    #[inline(always)]
    fn visit_block(
        &mut self,
        wide: &Wide<T>,
        block: usize,
        lane: usize,
        (leaf, slot, corners): (&TriangleLeaf<T::Corner>, SlotId, &[[f64; 3]; 3]),
        edges: &EdgeFunctions,
        tests: &mut Tests,
    ) -> bool {
        let [u, v, _] = &self.scratch.rays.projected;
        let overlap = edges.overlap::<S>(lane, S::F::load(u[block]), S::F::load(v[block]));
        let active = self.scratch.active[block];
        let mut undecided = overlap.possible & active;
        if undecided == 0 {
            return false;
        }
        tests.primitives += u64::from(undecided.count_ones());
        let (certain, mut found) = (overlap.certain & active, false);
        if certain != 0 {
            let depths = edges.depths(lane, &overlap);
            let hit = CertainHit { slot, corners, sign: edges.signs[lane] };
            let (unknown, changed) = self.record_certain(block, certain, &hit, depths);
            (undecided, found) = (undecided & !certain | unknown, changed);
        }
        if undecided == 0 {
            return found;
        }
        let undecided = self.without_known(wide, block, undecided, leaf.ids[lane]);
        found
            | self.test_block(
                wide,
                block,
                undecided,
                #[inline(always)]
                |packet, first| T::hit_triangle_n(packet.prepared(first / S::D::LANES), corners, false),
                #[inline(always)]
                |packet, ray, group, place| {
                    if group.undecided >> place & 1 == 0 {
                        return Some(group.at(place, PrimId(leaf.ids[lane]), slot));
                    }
                    hit_in_slot(wide, &packet.rays.get(ray), slot)
                },
            )
    }

    /// Tests all rays against an analytic shape.
    #[inline(always)]
    fn visit_analytic(&mut self, wide: &Wide<T>, index: u32, tests: &mut Tests) {
        let (shape, prim) = &wide.analytic[index as usize];
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
            let found = self.test_block(
                wide,
                block,
                possible,
                #[inline(always)]
                |packet, first| hit_analytic_n::<T, S::D>(&packet.rays.lanes(first), shape),
                #[inline(always)]
                |packet, ray, group, lane| {
                    let mut hit = group.at(lane, *prim, wide.slot_of_analytic(index));
                    if group.undecided >> lane & 1 != 0 {
                        hit.t = hit_analytic::<T>(&packet.rays.get(ray), shape)?;
                    }
                    Some(hit)
                },
            );
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
