//! The tier `fast`: f32 throughout, without guarantees. [`Numerics::Fast`] lists what it gives up.
//!
//! Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, Journal of Graphics Tools 2(1) 1997, without
//! the threshold on small determinants that it suggests, which depends on scale. Edge functions and the distance are
//! compared before the division. Two triangles compute the edge function of a shared edge from different differences, so
//! both may reject a ray.

use glam::Vec3;

use super::lanes::{HitN, MASK4, Triangle4};
use super::numerics::{PreparedPacket, PreparedRay};
use super::simd::{Doubles, Floats, Lanes, Simd, Vector};
use super::{BATCH, Corner, Hit, Ray, Rays, Stored, Tier, TriangleHit};
use crate::geometry::Numerics;

/// f32 geometry, decided in f32.
pub(crate) struct Fast;

/// A ray in f32.
#[derive(Clone, Copy, Default)]
#[repr(C, align(32))]
pub(crate) struct FastRay {
    pub(super) origin: [f32; 3],
    pub(super) t_min: f32,
    pub(super) direction: [f32; 3],
    pub(super) t_max: f32,
}

/// A ray in f32 in each lane.
pub(crate) struct FastRayN<F> {
    pub origin: [F; 3],
    pub direction: [F; 3],
    pub t_min: F,
    pub t_max: F,
}

/// One number: a vector for tests of one primitive.
pub(super) type One = Lanes<f32, 1>;

impl PreparedRay for FastRay {
    #[inline(always)]
    fn new(ray: &Ray) -> Self {
        FastRay {
            origin: ray.origin.as_vec3().to_array(),
            t_min: ray.t_min as f32,
            direction: ray.direction.as_vec3().to_array(),
            // Distances that overflow are no hits.
            t_max: (ray.t_max as f32).min(f32::MAX),
        }
    }

    #[inline(always)]
    fn prepare_packet<'a, D: Doubles>(rays: Rays, packet: &'a mut PreparedPacket) -> &'a mut [Self] {
        packet.fast.resize(BATCH, FastRay::default());
        for first in (0..rays.len()).step_by(D::Floats::LANES) {
            let FastRayN { origin, direction, t_min, t_max } = FastRayN::new::<D>(rays, first);
            let ([x, y, z], [dx, dy, dz]) = (origin, direction);
            let (origin, direction) =
                ([x.array(), y.array(), z.array()], [dx.array(), dy.array(), dz.array()]);
            let (t_min, t_max) = (t_min.array(), t_max.array());
            for (i, ray) in packet.fast[first..first + D::Floats::LANES].iter_mut().enumerate() {
                *ray = FastRay {
                    origin: [origin[0][i], origin[1][i], origin[2][i]],
                    t_min: t_min[i],
                    direction: [direction[0][i], direction[1][i], direction[2][i]],
                    t_max: t_max[i],
                };
            }
        }
        &mut packet.fast
    }

    #[inline(always)]
    fn shorten(&mut self, t: f64) {
        self.t_max = t as f32;
    }

    // All of them: the whole test is hardly more.
    #[inline(always)]
    fn may_hit4<C: Corner, S: Simd>(&self, _: &Triangle4<C>) -> u32 {
        MASK4
    }

    #[inline(always)]
    fn hit_triangle4<C: Corner, S: Simd, const EARLY: bool>(&self, four: &Triangle4<C>) -> HitN<S::D4> {
        let HitN { hit, t, barycentrics: [v, w], .. } =
            FastRayN::<S::F8>::splat(self).hit::<EARLY>(&Triangle4::pair::<S>([four; 2], [0, 1, 2]));
        // Without `array::map`, which is not always inlined.
        let barycentrics = [S::D4::load_f32(&v).array(), S::D4::load_f32(&w).array()];
        HitN { hit: hit & MASK4, undecided: 0, t: S::D4::load_f32(&t).array(), barycentrics }
    }
}

impl<F: Floats> FastRayN<F> {
    /// A ray in all lanes.
    #[inline(always)]
    pub(super) fn splat(ray: &FastRay) -> Self {
        let ([x, y, z], [dx, dy, dz]) = (ray.origin, ray.direction);
        FastRayN {
            origin: [F::splat(x), F::splat(y), F::splat(z)],
            direction: [F::splat(dx), F::splat(dy), F::splat(dz)],
            t_min: F::splat(ray.t_min),
            t_max: F::splat(ray.t_max),
        }
    }

    /// The rays from index `first` on.
    #[inline(always)]
    pub(crate) fn new<D: Doubles<Floats = F>>(rays: Rays, first: usize) -> Self {
        FastRayN {
            origin: rays.origins_in_f32::<D>(first),
            direction: rays.directions_in_f32::<D>(first),
            t_min: rays.t_min_floats::<D>(first),
            // Distances that overflow are no hits.
            t_max: rays.t_max_floats::<D>(first).min(F::splat(f32::MAX)),
        }
    }

    /// The hits on a triangle in each lane. `EARLY`: with branches that spare work where all are missed.
    #[inline(always)]
    pub(crate) fn hit<const EARLY: bool>(&self, [a, b, c]: &[[F; 3]; 3]) -> HitN<F> {
        let (to_b, to_c) = (minus(b, a), minus(c, a));
        let from_a = minus(&self.origin, a);
        let (p, q) = (cross(&self.direction, &to_c), cross(&from_a, &to_b));
        let determinant = dot(&to_b, &p);
        let size = determinant.abs();
        let v = dot(&from_a, &p).flip(determinant);
        let w = dot(&self.direction, &q).flip(determinant);
        // NaN, of empty lanes, is not inside.
        let inside = F::splat(0.0).le(v.min(w).min(size - v - w));
        // Most triangles are missed.
        if EARLY && inside == 0 {
            return HitN::NONE;
        }
        let depth = dot(&to_c, &q).flip(determinant);
        let within = (self.t_min * size).lt(depth) & depth.lt(self.t_max * size);
        let hit = inside & within;
        if EARLY && hit == 0 {
            return HitN::NONE;
        }
        // Divided one by one: the reciprocal may overflow.
        let barycentrics = [(v / size).array(), (w / size).array()];
        HitN { hit, undecided: 0, t: (depth / size).array(), barycentrics }
    }
}

impl Tier for Fast {
    const NUMERICS: Numerics = Numerics::Fast;
    const IS_FAST: bool = true;
    type Corner = Vec3;
    type Prepared = FastRay;

    #[inline(always)]
    fn hit_triangle(test: &FastRay, _: &Ray, corners: &[Vec3; 3]) -> Option<TriangleHit> {
        let corners = corners.map(|corner| corner.to_array().map(One::splat));
        let hit = FastRayN::splat(test).hit::<true>(&corners);
        let [[v], [w]] = hit.barycentrics;
        let hits = TriangleHit { t: hit.t[0].into(), barycentrics: [v.into(), w.into()] };
        (hit.hit != 0).then_some(hits)
    }

    #[inline(always)]
    fn is_before(_: impl FnOnce() -> Ray, [a, b]: [(&Hit, &Stored<Vec3>); 2]) -> bool {
        a.0.t < b.0.t
    }
}

#[inline(always)]
pub(crate) fn minus<F: Floats>(a: &[F; 3], b: &[F; 3]) -> [F; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn cross<F: Floats>(a: &[F; 3], b: &[F; 3]) -> [F; 3] {
    [a[1].mul_sub(b[2], a[2] * b[1]), a[2].mul_sub(b[0], a[0] * b[2]), a[0].mul_sub(b[1], a[1] * b[0])]
}

#[inline(always)]
pub(crate) fn dot<F: Floats>(a: &[F; 3], b: &[F; 3]) -> F {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Precision;
    use crate::geometry::lanes::Triangle4;
    use crate::geometry::simd::{InstructionSet, Simd, with_simd};
    use glam::DVec3;

    /// Triangle k is in the plane z = k + 1, with corners at (0, 0), (8, 0) and (0, 8); every product is exact.
    fn check<S: Simd>(simd: S) {
        simd.run(|| {
            let mut leaves = [Triangle4::EMPTY; 2];
            for k in 0..7 {
                let z = (k + 1) as f32;
                let corners = [Vec3::new(0.0, 0.0, z), Vec3::new(8.0, 0.0, z), Vec3::new(0.0, 8.0, z)];
                leaves[k / 4].set(k % 4, &corners);
            }
            let corners = Triangle4::pair::<S>([&leaves[0], &leaves[1]], [0, 1, 2]);
            for (x, y) in (-1..10).flat_map(|x| (-1..10).map(move |y| (f64::from(x), f64::from(y)))) {
                let is_inside = x >= 0.0 && y >= 0.0 && x + y <= 8.0;
                for (from, side) in [(0.0, 1.0), (16.0, -1.0)] {
                    // Strictly between planes 2 and 5, which the ends are on.
                    let at = |z: f64| (z - from) * side;
                    let (near, far) = (at(2.0).min(at(5.0)), at(2.0).max(at(5.0)));
                    let ray = Precision::Single.ray(DVec3::new(x, y, from), DVec3::Z * side, near, far);
                    let hits = FastRayN::splat(&FastRay::new(&ray)).hit::<false>(&corners);
                    assert_eq!(hits.hit, if is_inside { 0b1100 } else { 0 }, "{ray:?}");
                    for lane in (0..8).filter(|lane| hits.hit >> lane & 1 != 0) {
                        assert_eq!(f64::from(hits.t[lane]), at((lane + 1) as f64));
                        let [v, w] = [hits.barycentrics[0][lane], hits.barycentrics[1][lane]];
                        assert_eq!([f64::from(v), f64::from(w)], [x / 8.0, y / 8.0]);
                    }
                }
            }
        });
    }

    #[test]
    fn eight_triangles_are_hit_exactly_where_f32_is_exact() {
        InstructionSet::supported().into_iter().for_each(|set| with_simd!(set, simd => check(simd)));
    }
}
