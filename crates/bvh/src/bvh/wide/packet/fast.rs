//! The tests of a packet in fast tiers: triangles are decided in f32, without error bounds, by the edge functions of
//! Möller and Trumbore's test for rays with a common point or direction. t and barycentrics are theirs.

use super::Packet;
use super::frustum::Frustum;
use super::hits::is_unresolved;
use super::projected_triangles::{Arithmetic, InF32, ProjectedTriangles};
use super::rays::{BLOCKS, OfBlock, PacketRays};
use super::traverse::TriangleTest;
use crate::bvh::Tests;
use crate::bvh::wide::layout::{TriangleLeaf, WIDTH, Wide};
use crate::geometry::fast::{FastRayN, cross, dot, minus};
use crate::geometry::lanes::{HitN, MAX_LANES};
use crate::geometry::simd::{Doubles, Floats, Simd, Vector};
use crate::geometry::{AnalyticShape, Corner, HitBuffer, NO_PRIMITIVE, Rays, Tier, Triangle4};

/// Below this gap between a ray's origin and a triangle, relative to their depths, the side of the triangle on which the
/// ray starts is decided by the triangle's plane.
const NEAR: f32 = 1.0 / 1024.0;

/// The edge functions of the triangles.
///
/// A ray has the direction (u, v, 1), or starts at (u, v, 0). `weights` are the second and third edge function; the
/// determinant is `linear` and the volume `constant`, or for parallel rays the other way round. The depth is the
/// volume over the determinant. Oriented so that `constant` is positive.
#[repr(C, align(64))]
pub(super) struct Functions {
    /// Coefficients of u, v and 1.
    weights: [[[f32; WIDTH]; 3]; 2],
    linear: [[f32; WIDTH]; 3],
    constant: [f32; WIDTH],
    /// The normals, and the first corners in world space.
    normal: [[f32; WIDTH]; 3],
    corner: [[f32; WIDTH]; 3],
}

impl<S: Simd> TriangleTest<S> for InF32 {
    type Functions = Functions;

    #[inline(always)]
    fn functions<C: Corner>(
        projected: &ProjectedTriangles<S, Self>,
        leaves: [&Triangle4<C>; 2],
        frustum: &Frustum,
    ) -> Functions {
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
        let mut corner = [[0.0; WIDTH]; 3];
        for (x, axis) in corner.iter_mut().zip(frustum.axes) {
            *x = <Self as Arithmetic<S>>::corners(leaves, 0, axis).array();
        }
        let depth = if frustum.flipped { zero - normal[2] } else { normal[2] };
        Functions {
            weights: [oriented(weights[0], constant), oriented(weights[1], constant)],
            linear: oriented(linear, constant),
            constant: constant.abs().array(),
            normal: oriented([normal[0], normal[1], depth], constant),
            corner,
        }
    }

    #[inline(always)]
    fn visit_blocks<T: Tier, const ANY: bool>(
        packet: &mut Packet<T, S, ANY>,
        _: &Wide<T>,
        functions: &Functions,
        (lane, _, slot): (usize, &TriangleLeaf<T::Corner>, u32),
        mut blocks: u32,
        tests: &mut Tests,
    ) -> u32 {
        let weights: [[S::F; 3]; 2] =
            [splat(&functions.weights[0], lane), splat(&functions.weights[1], lane)];
        let linear: [S::F; 3] = splat(&functions.linear, lane);
        let (constant, zero) = (S::F::splat(functions.constant[lane]), S::F::splat(0.0));
        let is_parallel = packet.frustum.shear.is_some();
        let mut changed = 0;
        while blocks != 0 {
            let block = blocks.trailing_zeros() as usize % BLOCKS;
            blocks &= blocks - 1;
            let [u, v, _] = &packet.scratch.rays.projected;
            let (u, v) = (S::F::load(u[block]), S::F::load(v[block]));
            let second = plane(&weights[0], u, v);
            let third = plane(&weights[1], u, v);
            let linear = plane(&linear, u, v);
            let (determinant, volume) = if is_parallel { (constant, linear) } else { (linear, constant) };
            let first = determinant - second - third;
            let inside = zero.le(second.min(third).min(first)) & packet.scratch.active[block];
            if inside == 0 {
                continue;
            }
            tests.primitives += u64::from(inside.count_ones());
            let share = S::F::splat(1.0) / determinant;
            let depth = volume * share;
            let found = if ANY {
                packet.occluded_fast(functions, lane, block, inside, depth)
            } else {
                let (start, far) = packet.extent(block);
                inside & start.lt(depth) & depth.lt(far)
            };
            let found = packet.record_fast(block, found, slot, depth, [second * share, third * share]);
            changed |= u32::from(found) << block;
        }
        changed
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
        same &= t_min.abs().le(zero);
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
            let reach = S::F::splat(self.frustum.reach as f32) + depth.abs();
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

    /// Makes a primitive the best hit of some rays of a block. Returns whether there are any.
    #[inline(always)]
    fn record_fast(
        &mut self,
        block: usize,
        rays: u32,
        slot: u32,
        depth: S::F,
        barycentrics: [S::F; 2],
    ) -> bool {
        if rays == 0 {
            return false;
        }
        if ANY {
            self.retire(block, rays);
            return true;
        }
        self.scratch.best.set_unresolved(block, rays, slot, [depth; 2]);
        for (of_best, x) in self.scratch.barycentrics.iter_mut().zip(barycentrics) {
            of_best[block] = S::F::select(rays, x, S::F::load(of_best[block])).array();
        }
        true
    }

    /// Tests some rays of a block against an analytic shape. Returns whether a best hit changed.
    #[inline(always)]
    pub(super) fn test_shape_fast(
        &mut self,
        block: usize,
        possible: u32,
        shape: &AnalyticShape,
        slot: u32,
    ) -> bool {
        let FastRayN { origin, direction, t_min, t_max } =
            FastRayN::new::<S::D>(self.rays, block * S::F::LANES);
        let (hit, t) = shape.hit_in_f32(&origin, &direction, [t_min, t_max]);
        let (start, far) = self.extent(block);
        let depth = t.mul_add(S::F::load(self.scratch.rays.projected[2][block]), start);
        let found = possible & hit & if ANY { S::F::ALL } else { depth.lt(far) };
        self.record_fast(block, found, slot, depth, [S::F::splat(0.0); 2])
    }

    /// Appends the best hits of a group of rays.
    #[inline(always)]
    pub(super) fn append_fast(&self, wide: &Wide<T>, first: usize, hits: &mut HitBuffer) {
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
        let depth = at_half::<S>(&self.scratch.best.far[block], half) - at_half::<S>(&starts[block], half);
        let [v, w] = &self.scratch.barycentrics;
        let group = HitN::<S::D> {
            t: (depth / at_half::<S>(&projected[2][block], half)).array(),
            barycentrics: [at_half::<S>(&v[block], half).array(), at_half::<S>(&w[block], half).array()],
            ..HitN::NONE
        };
        hits.append(count, &prims, &slots, &group);
    }
}
