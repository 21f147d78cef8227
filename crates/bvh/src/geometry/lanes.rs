//! Rays, triangles and hits as structures of arrays: the operands of the primitive tests of a pair in each lane of
//! [`Doubles`].
//!
//! The tests themselves are in [`super::woop_n`] and [`super::sphere`]; the traversals of `bvh/wide` call them through
//! [`Tier`](super::Tier).

use super::simd::{Doubles, Simd, Vector};
use super::{Corner, Hit, PrimId, SlotId};

/// Lanes of [`Triangle4`].
pub(crate) const LANES4: usize = 4;

/// The most lanes of [`Doubles`].
pub(crate) const MAX_LANES: usize = 8;

/// The most lanes of [`Floats`](super::simd::Floats), a multiple of those of every vector.
pub(crate) const MAX_FLOATS: usize = 2 * MAX_LANES;

/// All four lanes, as bits.
pub(crate) const MASK4: u32 = (1 << LANES4) - 1;

/// A ray in each lane.
pub(crate) struct RayN<D: Doubles> {
    /// See [`super::Ray::origin`].
    pub origin: [D; 3],
    /// See [`super::Ray::direction`].
    pub direction: [D; 3],
    /// See [`super::Ray::t_min`].
    pub t_min: D,
    /// See [`super::Ray::t_max`].
    pub t_max: D,
}

/// The dot product of the vectors in each lane, in the order of [`glam::DVec3::dot`].
#[inline(always)]
pub(crate) fn dot<D: Doubles>([ax, ay, az]: &[D; 3], [bx, by, bz]: &[D; 3]) -> D {
    *ax * *bx + *ay * *by + *az * *bz
}

/// Up to four triangles: `corners[k][axis][lane]`. Coordinates of empty lanes are NaN, which no ray hits.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
pub(crate) struct Triangle4<C: Corner> {
    /// First, second and third corners.
    pub corners: [[[C::Scalar; LANES4]; 3]; 3],
}

impl<C: Corner> Triangle4<C> {
    /// Four empty lanes.
    pub(crate) const EMPTY: Self = Triangle4 { corners: [[[C::NAN; LANES4]; 3]; 3] };

    /// Writes a triangle to a lane.
    #[inline(always)]
    pub(crate) fn set(&mut self, lane: usize, triangle: &[C; 3]) {
        for (corner, &point) in self.corners.iter_mut().zip(triangle) {
            let [x, y, z]: [C::Scalar; 3] = point.into();
            (corner[0][lane], corner[1][lane], corner[2][lane]) = (x, y, z);
        }
    }

    /// The corners of the triangles of two leaves, in f32, with their coordinates in the order of `axes`.
    #[inline(always)]
    pub(crate) fn pair<S: Simd>([low, high]: [&Self; 2], axes: [usize; 3]) -> [[S::F8; 3]; 3] {
        let mut corners = [[S::F8::splat(0.0); 3]; 3];
        for (k, corner) in corners.iter_mut().enumerate() {
            for (at, axis) in corner.iter_mut().zip(axes) {
                *at = C::pair::<S>(&low.corners[k][axis], &high.corners[k][axis]);
            }
        }
        corners
    }

    /// The triangle in a lane.
    #[inline(always)]
    pub(crate) fn triangle(&self, lane: usize) -> [C; 3] {
        [self.corner(0, lane), self.corner(1, lane), self.corner(2, lane)]
    }

    /// The corners in a lane, converted to f64.
    #[inline(always)]
    pub(crate) fn corners_f64(&self, lane: usize) -> [[f64; 3]; 3] {
        let [a, b, c] = self.triangle(lane);
        [a.to_dvec3().to_array(), b.to_dvec3().to_array(), c.to_dvec3().to_array()]
    }

    // Without `array::map`, which is not always inlined.
    #[inline(always)]
    fn corner(&self, k: usize, lane: usize) -> C {
        let [x, y, z] = &self.corners[k];
        C::from([x[lane], y[lane], z[lane]])
    }
}

/// The hit of a ray-primitive pair in each lane. Masks have one bit per lane.
#[derive(Clone, Copy)]
pub(crate) struct HitN<D: Vector> {
    /// Lanes that hit.
    pub hit: u32,
    /// Lanes that must be tested again by the tier's test for one ray.
    pub undecided: u32,
    /// Distances.
    pub t: D::Array,
    /// The barycentrics v and w.
    pub barycentrics: [D::Array; 2],
}

impl<D: Vector<Scalar: Into<f64>>> HitN<D> {
    /// Misses.
    pub(crate) const NONE: Self = HitN { hit: 0, undecided: 0, t: D::ZEROS, barycentrics: [D::ZEROS; 2] };
    /// Undecided lanes: the result of tiers without a test of several pairs.
    pub(crate) const UNDECIDED: Self = HitN { undecided: D::ALL, ..Self::NONE };

    /// Replaces distances and barycentrics in some lanes by those of other hits; masks are left.
    #[inline(always)]
    pub(crate) fn select(&mut self, lanes: u32, other: &Self)
    where
        D: Doubles,
    {
        self.t = D::select(lanes, D::load(other.t), D::load(self.t)).array();
        for (to, of) in self.barycentrics.iter_mut().zip(other.barycentrics) {
            *to = D::select(lanes, D::load(of), D::load(*to)).array();
        }
    }

    /// The hit in a lane, on primitive `prim` in `slot`.
    #[inline(always)]
    pub(crate) fn at(&self, lane: usize, prim: PrimId, slot: SlotId) -> Hit {
        Hit {
            t: self.t[lane].into(),
            prim,
            slot,
            barycentrics: [self.barycentrics[0][lane].into(), self.barycentrics[1][lane].into()],
        }
    }
}
