//! The leaves of a packet in fast tiers: triangles are projected and decided in f32, without error bounds, by the edge
//! functions of Möller and Trumbore's test for rays with a common point or direction. t and barycentrics are theirs.

use super::frustum::Frustum;
use super::hits::is_unresolved;
use super::projected_sphere::ProjectedSphere;
use super::projected_triangles::overlapped;
use super::rays::{BLOCKS, OfBlock, PacketRays};
use super::{Packet, Scratch};
use crate::bvh::Tests;
use crate::bvh::wide::layout::{WIDTH, Wide};
use crate::geometry::fast::{FastRayN, cross, dot, minus};
use crate::geometry::lanes::{HitN, LANES4, MASK4, MAX_LANES};
use crate::geometry::simd::{Doubles, Floats, Simd, Vector};
use crate::geometry::{HitBuffer, NO_PRIMITIVE, Rays, Tier, Triangle4};

/// Below this gap between a ray's origin and a triangle, relative to their depths, the side of the triangle on which the
/// ray starts is decided by the triangle's plane.
const NEAR: f32 = 1.0 / 1024.0;

/// The triangles of two leaves, projected to the (u, v) plane of a frustum.
struct Projected<S: Simd> {
    /// The corners in world space, and relative to the apex: coordinates on the axes of u, v and depth.
    world: [[S::F8; 3]; 3],
    corners: [[S::F8; 3]; 3],
    /// Least depths, and intervals of u and v; infinite if a corner is not beyond the apex.
    nearest: [f32; WIDTH],
    bounds: [[[f32; WIDTH]; 2]; 2],
    /// The triangles that overlap the frustum, as bits.
    overlapping: u32,
}

/// The edge functions of the triangles.
///
/// A ray has the direction (u, v, 1), or starts at (u, v, 0). `weights` are the second and third edge function; the
/// determinant is `linear` and the volume `constant`, or for parallel rays the other way round. The depth is the
/// volume over the determinant. Oriented so that `constant` is positive.
#[repr(C, align(64))]
struct Functions {
    /// Coefficients of u, v and 1.
    weights: [[[f32; WIDTH]; 3]; 2],
    linear: [[f32; WIDTH]; 3],
    constant: [f32; WIDTH],
    /// The normals, and the first corners in world space.
    normal: [[f32; WIDTH]; 3],
    corner: [[f32; WIDTH]; 3],
}

impl<S: Simd> Projected<S> {
    #[inline(always)]
    fn new<T: Tier>(leaves: [&Triangle4<T::Corner>; 2], frustum: &Frustum) -> Self {
        let world = Triangle4::pair::<S>(leaves, frustum.axes);
        let mut corners = world;
        for place in 0..3 {
            let apex = S::F8::splat(frustum.apex[frustum.axes[place]] as f32);
            for (corner, world) in corners.iter_mut().zip(&world) {
                let flipped = place == 2 && frustum.flipped;
                corner[place] = if flipped { apex - world[place] } else { world[place] - apex };
            }
        }
        let (zero, one) = (S::F8::splat(0.0), S::F8::splat(1.0));
        let (mut nearest, mut farthest) = (corners[0][2], corners[0][2]);
        let (mut least, mut most) = ([zero; 2], [zero; 2]);
        for (k, corner) in corners.iter().enumerate() {
            let at = match frustum.shear {
                None => {
                    let share = one / corner[2];
                    [corner[0] * share, corner[1] * share]
                }
                Some([u, v]) => {
                    let (u, v) = (S::F8::splat(u as f32), S::F8::splat(v as f32));
                    [corner[0] - u * corner[2], corner[1] - v * corner[2]]
                }
            };
            for place in 0..2 {
                least[place] = if k == 0 { at[place] } else { at[place].min(least[place]) };
                most[place] = if k == 0 { at[place] } else { at[place].max(most[place]) };
            }
            (nearest, farthest) = (corner[2].min(nearest), corner[2].max(farthest));
        }
        let unbounded = if frustum.shear.is_some() { 0 } else { nearest.le(zero) };
        let mut across = u32::MAX;
        for (place, [low, high]) in frustum.intervals.into_iter().enumerate() {
            across &= least[place].le(S::F8::splat(high)) & S::F8::splat(low).le(most[place]);
        }
        let in_depth =
            S::F8::splat(frustum.min_depth).le(farthest) & nearest.le(S::F8::splat(frustum.max_depth));
        let mut bounds = [[[0.0; WIDTH]; 2]; 2];
        let infinite = S::F8::splat(f32::INFINITY);
        for (place, [low, high]) in bounds.iter_mut().enumerate() {
            *low = S::F8::select(unbounded, zero - infinite, least[place]).array();
            *high = S::F8::select(unbounded, infinite, most[place]).array();
        }
        let overlapping = in_depth & (across | unbounded);
        Projected { world, corners, nearest: nearest.array(), bounds, overlapping }
    }
}

impl Functions {
    #[inline(always)]
    fn new<S: Simd>(projected: &Projected<S>, frustum: &Frustum) -> Self {
        let ([a, b, c], zero) = (&projected.corners, S::F8::splat(0.0));
        let (to_b, to_c) = (minus(b, a), minus(c, a));
        let normal = cross(&to_c, &to_b);
        let volume = dot(a, &normal);
        let (weights, linear, constant) = match frustum.shear {
            None => ([cross(a, &to_c), cross(&to_b, a)], normal, volume),
            Some([u, v]) => {
                let direction = [S::F8::splat(u as f32), S::F8::splat(v as f32), S::F8::splat(1.0)];
                let (p, q) = (cross(&direction, &to_c), cross(&to_b, &direction));
                let weights = [[p[0], p[1], zero - dot(&p, a)], [q[0], q[1], zero - dot(&q, a)]];
                let linear = [zero - normal[0], zero - normal[1], volume];
                (weights, linear, dot(&direction, &normal))
            }
        };
        let [x, y, z] = &projected.world[0];
        let depth = if frustum.flipped { zero - normal[2] } else { normal[2] };
        Functions {
            weights: [oriented(weights[0], constant), oriented(weights[1], constant)],
            linear: oriented(linear, constant),
            constant: constant.flip(constant).array(),
            normal: oriented([normal[0], normal[1], depth], constant),
            corner: [x.array(), y.array(), z.array()],
        }
    }
}

/// Three numbers, negated where `sign` is negative.
#[inline(always)]
fn oriented<F: Floats<Array = [f32; WIDTH]>>([x, y, z]: [F; 3], sign: F) -> [[f32; WIDTH]; 3] {
    [x.flip(sign).array(), y.flip(sign).array(), z.flip(sign).array()]
}

/// Whether all rays start at 0: otherwise they are no packet here.
#[inline(always)]
pub(super) fn supports<S: Simd>(rays: Rays) -> bool {
    let zero = S::F::splat(0.0);
    let mut same = S::F::ALL;
    for first in (0..rays.len()).step_by(S::F::LANES) {
        let t_min = rays.t_min_floats::<S::D>(first);
        same &= t_min.flip(t_min).le(zero);
    }
    same == S::F::ALL
}

/// One number of three in all lanes.
#[inline(always)]
fn splat<F: Floats>(numbers: &[[f32; WIDTH]; 3], lane: usize) -> [F; 3] {
    [F::splat(numbers[0][lane]), F::splat(numbers[1][lane]), F::splat(numbers[2][lane])]
}

/// The numbers of half a block, from a lane on.
#[inline(always)]
fn at_half<S: Simd>(x: &OfBlock<S>, first: usize) -> S::D {
    S::D::load_f32(&x.as_ref()[first..])
}

/// The value of a linear function of u and v.
#[inline(always)]
fn plane<F: Floats>([a, b, c]: &[F; 3], u: F, v: F) -> F {
    a.mul_add(u, b.mul_add(v, *c))
}

impl<T: Tier, S: Simd, const ANY: bool> Packet<'_, T, S, ANY> {
    /// Tests the triangles of one or two leaves. Returns the work done.
    #[inline(always)]
    pub(super) fn visit_triangles_fast(
        &mut self,
        wide: &Wide<T>,
        first: u32,
        second: Option<u32>,
        tests: &mut Tests,
    ) -> usize {
        let indices = [first, second.unwrap_or(first)];
        let leaves = [&wide.triangles[indices[0] as usize], &wide.triangles[indices[1] as usize]];
        let projected = Projected::<S>::new::<T>([&leaves[0].corners, &leaves[1].corners], &self.frustum);
        let (mut blocks, mut lanes) = ([0; WIDTH], 0u32);
        let mut overlapping = projected.overlapping & if second.is_some() { u32::MAX } else { MASK4 };
        while overlapping != 0 {
            let lane = overlapping.trailing_zeros() as usize % WIDTH;
            overlapping &= overlapping - 1;
            let [u, v] = &projected.bounds;
            let bounds = [[u[0][lane], u[1][lane]], [v[0][lane], v[1][lane]]];
            let Scratch { block_bounds, depths, .. } = &*self.scratch;
            blocks[lane] = overlapped::<S>(projected.nearest[lane], bounds, block_bounds, depths);
            lanes |= u32::from(blocks[lane] != 0) << lane;
        }
        let visits = 1 + usize::from(second.is_some());
        if lanes == 0 {
            return visits;
        }
        let work = visits + 2 * lanes.count_ones() as usize;
        let functions = Functions::new(&projected, &self.frustum);
        let mut changed = 0;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % WIDTH;
            lanes &= lanes - 1;
            let slot = indices[lane / LANES4] * LANES4 as u32 + (lane % LANES4) as u32;
            changed |= self.visit_blocks(&functions, lane, slot, blocks[lane], tests);
        }
        self.update_depths(changed);
        work
    }

    /// Tests the rays of blocks against a triangle. Returns the blocks in which best hits changed.
    #[inline(always)]
    fn visit_blocks(
        &mut self,
        functions: &Functions,
        lane: usize,
        slot: u32,
        mut blocks: u32,
        tests: &mut Tests,
    ) -> u32 {
        let weights: [[S::F; 3]; 2] =
            [splat(&functions.weights[0], lane), splat(&functions.weights[1], lane)];
        let linear: [S::F; 3] = splat(&functions.linear, lane);
        let (constant, zero) = (S::F::splat(functions.constant[lane]), S::F::splat(0.0));
        let is_parallel = self.frustum.shear.is_some();
        let mut changed = 0;
        while blocks != 0 {
            let block = blocks.trailing_zeros() as usize % BLOCKS;
            blocks &= blocks - 1;
            let [u, v, _] = &self.scratch.rays.projected;
            let (u, v) = (S::F::load(u[block]), S::F::load(v[block]));
            let second = plane(&weights[0], u, v);
            let third = plane(&weights[1], u, v);
            let linear = plane(&linear, u, v);
            let (determinant, volume) = if is_parallel { (constant, linear) } else { (linear, constant) };
            let first = determinant - second - third;
            let inside = zero.le(second.min(third).min(first)) & self.scratch.active[block];
            if inside == 0 {
                continue;
            }
            tests.primitives += u64::from(inside.count_ones());
            let share = S::F::splat(1.0) / determinant;
            let depth = volume * share;
            let found = if ANY {
                self.occluded_fast(functions, lane, block, inside, depth)
            } else {
                let (start, far) = self.extent(block);
                inside & start.lt(depth) & depth.lt(far)
            };
            if found == 0 {
                continue;
            }
            changed |= 1 << block;
            if ANY {
                self.retire(block, found);
            } else {
                self.set_fast(block, found, slot, depth, [second * share, third * share]);
            }
        }
        changed
    }

    /// The rays of `inside`, whose lines meet a triangle at a depth, that meet it themselves.
    #[inline(always)]
    fn occluded_fast(
        &self,
        functions: &Functions,
        lane: usize,
        block: usize,
        inside: u32,
        depth: S::F,
    ) -> u32 {
        let is_parallel = self.frustum.shear.is_some();
        let (start, far) = self.extent(block);
        // How far the triangle is from the ray's origin. The apex is at the other end, or behind all origins.
        let (gap, reach, within) = if is_parallel {
            let reach = S::F::splat(self.frustum.reach as f32) + depth.flip(depth);
            (depth - start, reach, inside & depth.lt(far))
        } else {
            (far - depth, far, inside & S::F::splat(self.frustum.inner_depth).le(depth))
        };
        let tolerance = reach * S::F::splat(NEAR);
        let certain = within & tolerance.lt(gap);
        let near = within & !certain & (S::F::splat(0.0) - tolerance).lt(gap);
        if near == 0 {
            return certain;
        }
        let (normal, corner): ([S::F; 3], [S::F; 3]) =
            (splat(&functions.normal, lane), splat(&functions.corner, lane));
        let axes = self.frustum.axes;
        let first = block * S::F::LANES;
        let origin = [
            self.rays.origin_floats::<S::D>(axes[0], first),
            self.rays.origin_floats::<S::D>(axes[1], first),
            self.rays.origin_floats::<S::D>(axes[2], first),
        ];
        let height = dot(&normal, &minus(&corner, &origin));
        let zero = S::F::splat(0.0);
        certain | near & if is_parallel { zero.lt(height) } else { height.lt(zero) }
    }

    /// The depths of the origins of the rays of a block, 0 at an apex, and of their best hits or ends.
    #[inline(always)]
    fn extent(&self, block: usize) -> (S::F, S::F) {
        (S::F::load(self.scratch.rays.starts[block]), S::F::load(self.scratch.best.far[block]))
    }

    /// Makes a triangle the best hit of some rays of a block.
    #[inline(always)]
    fn set_fast(&mut self, block: usize, rays: u32, slot: u32, depth: S::F, barycentrics: [S::F; 2]) {
        self.scratch.best.set_unresolved(block, rays, slot, [depth; 2]);
        for (of_best, x) in self.scratch.barycentrics.iter_mut().zip(barycentrics) {
            of_best[block] = S::F::select(rays, x, S::F::load(of_best[block])).array();
        }
    }

    /// Tests all rays against an analytic shape.
    #[inline(always)]
    pub(super) fn visit_analytic_fast(&mut self, wide: &Wide<T>, index: u32, tests: &mut Tests) {
        let (Some(shape), _) = &wide.analytic[index as usize] else { return };
        let slot = wide.slot_of_analytic(index).index();
        let projected = ProjectedSphere::<S>::new(shape.bounding_sphere(), &self.frustum);
        let mut changed = 0;
        for block in 0..self.scratch.rays.blocks % (BLOCKS + 1) {
            let [u, v, length] = &self.scratch.rays.projected;
            let length = S::F::load(length[block]);
            let possible =
                projected.possible(S::F::load(u[block]), S::F::load(v[block])) & self.scratch.active[block];
            if possible == 0 {
                continue;
            }
            tests.primitives += u64::from(possible.count_ones());
            let first = block * S::F::LANES;
            let rays = &self.rays;
            let FastRayN { origin, direction, t_min, t_max } = FastRayN::new::<S::D>(*rays, first);
            let (hit, t) = shape.hit_in_f32(&origin, &direction, [t_min, t_max]);
            let (start, far) = self.extent(block);
            let depth = t.mul_add(length, start);
            let found = possible & hit & if ANY { S::F::ALL } else { depth.lt(far) };
            if found != 0 {
                changed |= 1 << block;
                if ANY {
                    self.retire(block, found);
                } else {
                    self.set_fast(block, found, slot, depth, [S::F::splat(0.0); 2]);
                }
            }
        }
        self.update_depths(changed);
    }

    /// Appends the best hits of all rays.
    #[inline(always)]
    pub(super) fn append_fast(&mut self, wide: &Wide<T>, hits: &mut HitBuffer) {
        let before = hits.len();
        hits.reserve(self.rays.len());
        for first in (0..self.rays.len()).step_by(S::D::LANES) {
            self.prefetch_following(
                #[inline(always)]
                |index| hits.prefetch(before + index),
            );
            let count = S::D::LANES.min(self.rays.len() - first);
            let (mut slots, mut prims) = ([0; MAX_LANES], [NO_PRIMITIVE; MAX_LANES]);
            for lane in 0..S::D::LANES {
                let slot = self.scratch.best.slot(first + lane);
                if is_unresolved(slot) {
                    slots[lane] = slot;
                    prims[lane] = wide.prim_in(slot);
                }
            }
            let (block, half) = (first / S::F::LANES % BLOCKS, first % S::F::LANES);
            let PacketRays { projected, starts, .. } = &self.scratch.rays;
            let depth =
                at_half::<S>(&self.scratch.best.far[block], half) - at_half::<S>(&starts[block], half);
            let [v, w] = &self.scratch.barycentrics;
            let group = HitN::<S::D> {
                t: (depth / at_half::<S>(&projected[2][block], half)).array(),
                barycentrics: [at_half::<S>(&v[block], half).array(), at_half::<S>(&w[block], half).array()],
                ..HitN::NONE
            };
            hits.append(count, &prims, &slots, &group);
        }
    }
}
