//! Visits of the leaves that the rays of a stream reach: [`TriangleTests`], and [`LeavesByRay`] for a caller's own
//! tests.

use super::query::{After, Query};
use super::state::InFlight;
use crate::bvh::Next;
use crate::bvh::wide::layout::{Child, TriangleLeaf, Wide};
use crate::bvh::wide::single::leaf::{hits_on_shapes, hits_on_triangles};
use crate::geometry::lanes::{LANES4, MASK4};
use crate::geometry::simd::{Simd, Vector};
use crate::geometry::{PreparedRay, Rays, Tier};

/// Visits of leaves.
pub(super) trait Leaves<T: Tier, S: Simd> {
    /// Whether a leaf of triangles must be visited: `false` only if the ray has certainly no hit there.
    fn may_hit(&self, ray: usize, leaf: &TriangleLeaf<T::Corner>) -> bool;

    /// The same for two rays with a leaf each.
    #[inline(always)]
    fn may_hit_two(&self, [a, b]: [usize; 2], [p, q]: [&TriangleLeaf<T::Corner>; 2]) -> [bool; 2] {
        [self.may_hit(a, p), self.may_hit(b, q)]
    }

    /// Whether a ray need not be traced.
    #[inline(always)]
    fn is_known(&self, _ray: usize) -> bool {
        false
    }

    /// Visits a leaf of triangles.
    fn visit_triangles(&mut self, at: InFlight, leaf: Child) -> After;

    /// Visits a leaf of analytic shapes.
    fn visit_analytic(&mut self, at: InFlight, leaf: Child) -> After;

    /// The ray has no further leaves.
    fn finish(&mut self, at: InFlight);
}

/// The tests of a tier, for a query.
pub(super) struct TriangleTests<'a, T: Tier, Q> {
    pub wide: &'a Wide<T>,
    pub rays: Rays<'a>,
    /// For each ray.
    pub prepared: &'a [T::Prepared],
    pub query: Q,
}

impl<T: Tier, S: Simd, Q: Query<T, S>> Leaves<T, S> for TriangleTests<'_, T, Q> {
    #[inline(always)]
    fn may_hit(&self, ray: usize, leaf: &TriangleLeaf<T::Corner>) -> bool {
        T::may_hit4::<S>(&self.prepared[ray], &leaf.corners) != 0
    }

    #[inline(always)]
    fn may_hit_two(&self, [a, b]: [usize; 2], [p, q]: [&TriangleLeaf<T::Corner>; 2]) -> [bool; 2] {
        if T::HAS_RAY_N && S::D::LANES == 2 * LANES4 {
            let (rays, fours) = ([&self.prepared[a], &self.prepared[b]], [&p.corners, &q.corners]);
            let bits = T::Prepared::may_hit_two::<_, S>(rays, fours);
            return [bits & MASK4 != 0, bits >> LANES4 != 0];
        }
        [self.may_hit(a, p), self.may_hit(b, q)]
    }

    #[inline(always)]
    fn is_known(&self, ray: usize) -> bool {
        self.query.is_known(ray)
    }

    #[inline(always)]
    fn visit_triangles(&mut self, at: InFlight, leaf: Child) -> After {
        let (index, prepared) = (leaf.index(), &self.prepared[at.ray]);
        let leaf = &self.wide.triangles[index];
        let four = T::hit_triangle4::<S, false>(prepared, &leaf.corners);
        if !self.query.found_in_leaf(at, &four, leaf, index) {
            let (ray, query) = (|| self.rays.get(at.ray), &mut self.query);
            hits_on_triangles::<T, S::D4>(&four, prepared, ray, (leaf, index), |hit| {
                query.found(at, &hit);
                Next::Continue
            });
        }
        self.query.next(at)
    }

    #[inline(always)]
    fn visit_analytic(&mut self, at: InFlight, leaf: Child) -> After {
        let query = &mut self.query;
        hits_on_shapes(self.wide, &self.rays.get(at.ray), leaf, |hit| {
            query.found(at, &hit);
            Next::Continue
        });
        self.query.next(at)
    }

    #[inline(always)]
    fn finish(&mut self, at: InFlight) {
        self.query.finish(at);
    }
}

/// Functions of the index of a ray and a leaf, which may have a hit anywhere.
pub(super) struct LeavesByRay<M, V> {
    pub may_hit: M,
    pub visit: V,
}

impl<T: Tier, S: Simd, M, V> Leaves<T, S> for LeavesByRay<M, V>
where
    M: Fn(usize, &TriangleLeaf<T::Corner>) -> bool,
    V: FnMut(usize, Child),
{
    #[inline(always)]
    fn may_hit(&self, ray: usize, leaf: &TriangleLeaf<T::Corner>) -> bool {
        (self.may_hit)(ray, leaf)
    }

    #[inline(always)]
    fn visit_triangles(&mut self, at: InFlight, leaf: Child) -> After {
        (self.visit)(at.ray, leaf);
        After::EVERYTHING
    }

    #[inline(always)]
    fn visit_analytic(&mut self, at: InFlight, leaf: Child) -> After {
        (self.visit)(at.ray, leaf);
        After::EVERYTHING
    }

    #[inline(always)]
    fn finish(&mut self, _: InFlight) {}
}
