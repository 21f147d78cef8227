//! [`Tier`], the interface of the numeric tiers, and the precisions that they store rays and corners in.

use glam::{DVec3, Vec3, Vec3A};

use super::fast::FastRay;
use super::lanes::{HitN, LANES4, Triangle4};
use super::simd::{Doubles, Simd};
use super::woop::WoopTest;
use super::woop_n::PreparedRayN;
use super::{AnalyticShape, Bounds, Hit, Ray, Rays, TriangleHit};
use crate::geometry::Numerics;

/// The floating-point format of rays or corners.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// f32, 24 bits.
    Single,
    /// f64, 53 bits.
    Double,
}

/// Direction components below this share of the largest become 0, which keeps the reciprocals of the box test finite.
/// It is far below the rounding of the direction (2^-25 or 2^-54 of the largest).
const SMALLEST_COMPONENT: f64 = 1.0 / (1u128 << 100) as f64;

/// f64 coordinates below this become 0, as f32 does below 2^-150. Products of three coordinates then do not
/// underflow, which exact arithmetic requires.
const SMALLEST_COORDINATE: f64 = f64::from_bits((1023 - 250) << 52);

impl Precision {
    /// The nearest coordinate of this precision.
    #[inline]
    pub fn round(self, x: f64) -> f64 {
        match self {
            Precision::Single => f64::from(x as f32),
            Precision::Double if x.abs() < SMALLEST_COORDINATE => 0.0,
            Precision::Double => x,
        }
    }

    /// A ray with origin and direction rounded to this precision. Zero components become +0.
    ///
    /// `origin` and `direction` must be finite, `t_max` not NaN, and `direction` of a length that [`Ray::unchecked`]
    /// takes:
    /// [`Bvh::ray`](crate::bvh::Bvh::ray) checks this and normalises. Here debug builds alone check origin and
    /// direction; queries of a ray with NaN return any hits or none.
    ///
    /// # Panics
    /// If `t_min` is NaN or negative.
    #[inline(always)]
    pub fn ray(self, origin: DVec3, direction: DVec3, t_min: f64, t_max: f64) -> Ray {
        // Constants, as those of all renderers, are compared by the compiler.
        assert!(t_min >= 0.0, "a ray from {t_min}");
        let (origin, direction) = match self {
            Precision::Single => (origin.as_vec3().as_dvec3(), direction.as_vec3().as_dvec3()),
            Precision::Double => (origin.map(|c| self.round(c)), direction),
        };
        let floor = direction.abs().max_element() * SMALLEST_COMPONENT;
        let flush = |c: f64| if c.abs() < floor { 0.0 } else { c + 0.0 };
        let direction = DVec3::new(flush(direction.x), flush(direction.y), flush(direction.z));
        let ray = Ray { origin, direction, t_min, t_max };
        debug_assert!(
            ray.origin.is_finite() && ray.direction.is_finite(),
            "a ray that is not finite: {ray:?}"
        );
        debug_assert!(floor > 0.0, "a ray without direction: {ray:?}");
        ray
    }

    /// The distance from 1 to the next larger number.
    #[inline]
    pub fn epsilon(self) -> f64 {
        match self {
            Precision::Single => f64::from(f32::EPSILON),
            Precision::Double => f64::EPSILON,
        }
    }
}

impl Numerics {
    /// The precision of triangle corners.
    #[inline]
    pub fn precision(self) -> Precision {
        match self {
            Numerics::Fast | Numerics::Watertight => Precision::Single,
            Numerics::Double | Numerics::Exact => Precision::Double,
        }
    }

    /// The precision of ray origins and directions: f64 wherever hits are decided in f64.
    #[inline]
    pub fn ray_precision(self) -> Precision {
        match self {
            Numerics::Fast => Precision::Single,
            Numerics::Watertight | Numerics::Double | Numerics::Exact => Precision::Double,
        }
    }
}

/// A triangle corner in the precision of a tier: [`Vec3`] or [`DVec3`].
pub(crate) trait Corner:
    Copy + Send + Sync + 'static + From<[<Self as Corner>::Scalar; 3]> + Into<[<Self as Corner>::Scalar; 3]>
{
    /// The type of a coordinate.
    type Scalar: bytemuck::Pod + Send + Sync;
    /// NaN.
    const NAN: Self::Scalar;
    /// The first coordinates of a slice, converted to f64.
    fn load<D: Doubles>(coordinates: &[Self::Scalar]) -> D;
    /// Coordinates converted to f64, one for each lane.
    fn gather<D: Doubles>(lane: impl Fn(usize) -> Self::Scalar) -> D;
    /// Coordinates of two leaves, converted to f32.
    fn pair<S: Simd>(low: &[Self::Scalar; LANES4], high: &[Self::Scalar; LANES4]) -> S::F8;
    /// Coordinates of two leaves, where [`Simd::D`] has eight lanes.
    fn eight<S: Simd>(low: &[Self::Scalar; LANES4], high: &[Self::Scalar; LANES4]) -> S::D;
    /// The nearest corner of this precision.
    fn from_dvec3(point: DVec3) -> Self;
    /// The corner in f64, exactly.
    fn to_dvec3(self) -> DVec3;
    /// Least and greatest coordinates of three corners.
    fn span(corners: &[Self; 3]) -> [DVec3; 2];
    /// The f32 box of a triangle ([`Bounds::of_triangles`]).
    fn bounds(corners: &[Self; 3]) -> Bounds {
        let [min, max] = Self::span(corners);
        Bounds::of_triangles([min, max], min.abs().max(max.abs()).max_element())
    }
}

impl Corner for Vec3 {
    type Scalar = f32;
    const NAN: f32 = f32::NAN;

    #[inline(always)]
    fn load<D: Doubles>(coordinates: &[f32]) -> D {
        D::load_f32(coordinates)
    }

    #[inline(always)]
    fn gather<D: Doubles>(lane: impl Fn(usize) -> f32) -> D {
        D::from_f32(lane)
    }

    #[inline(always)]
    fn pair<S: Simd>(low: &[f32; LANES4], high: &[f32; LANES4]) -> S::F8 {
        S::pair(low, high)
    }

    #[inline(always)]
    fn eight<S: Simd>(low: &[f32; LANES4], high: &[f32; LANES4]) -> S::D {
        S::eight(low, high)
    }

    fn from_dvec3(point: DVec3) -> Self {
        point.as_vec3()
    }

    #[inline(always)]
    fn to_dvec3(self) -> DVec3 {
        self.as_dvec3()
    }

    #[inline(always)]
    fn span(corners: &[Self; 3]) -> [DVec3; 2] {
        let [a, b, c] = corners.map(Vec3A::from);
        [Vec3::from(a.min(b).min(c)).as_dvec3(), Vec3::from(a.max(b).max(c)).as_dvec3()]
    }

    #[inline(always)]
    fn bounds(&[a, b, c]: &[Self; 3]) -> Bounds {
        let (min, max) = (a.min(b).min(c), a.max(b).max(c));
        Bounds { min, max }.grown_near_zero()
    }
}

impl Corner for DVec3 {
    type Scalar = f64;
    const NAN: f64 = f64::NAN;

    #[inline(always)]
    fn load<D: Doubles>(coordinates: &[f64]) -> D {
        D::load_slice(coordinates)
    }

    #[inline(always)]
    fn gather<D: Doubles>(lane: impl Fn(usize) -> f64) -> D {
        D::from_f64(lane)
    }

    #[inline(always)]
    fn pair<S: Simd>(low: &[f64; LANES4], high: &[f64; LANES4]) -> S::F8 {
        S::pair(&low.map(|x| x as f32), &high.map(|x| x as f32))
    }

    #[inline(always)]
    fn eight<S: Simd>(low: &[f64; LANES4], high: &[f64; LANES4]) -> S::D {
        S::D::from_f64(
            #[inline(always)]
            |lane| if lane < LANES4 { low[lane] } else { high[lane - LANES4] },
        )
    }

    fn from_dvec3(point: DVec3) -> Self {
        point.map(|c| Precision::Double.round(c))
    }

    #[inline(always)]
    fn to_dvec3(self) -> DVec3 {
        self
    }

    #[inline(always)]
    fn span([a, b, c]: &[Self; 3]) -> [DVec3; 2] {
        [a.min(*b).min(*c), a.max(*b).max(*c)]
    }
}

/// A primitive in the precision of a tier.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Stored<C> {
    /// The corners of a triangle.
    Triangle([C; 3]),
    /// Any other shape, in f64 in every tier.
    Analytic(AnalyticShape),
}

/// A ray prepared for the triangle test of a tier.
pub(crate) trait PreparedRay: Copy {
    /// Prepares a ray.
    fn new(ray: &Ray) -> Self;
    /// Prepares the rays of a packet, and perhaps more. Where this takes vectors, no direction may have zeros.
    fn prepare_packet<'a, D: Doubles>(rays: Rays, packet: &'a mut PreparedPacket) -> &'a mut [Self];
    /// Notes that hits from `t` on do not count, in a tier that makes use of it.
    #[inline(always)]
    fn shorten(&mut self, _t: f64) {}
    /// See [`Tier::may_hit4`].
    fn may_hit4<C: Corner, S: Simd>(&self, four: &Triangle4<C>) -> u32;
    /// The same for two rays with a leaf each, four bits for each ray.
    #[inline(always)]
    fn may_hit_two<C: Corner, S: Simd>([a, b]: [&Self; 2], [p, q]: [&Triangle4<C>; 2]) -> u32 {
        a.may_hit4::<C, S>(p) | b.may_hit4::<C, S>(q) << LANES4
    }
    /// See [`Tier::hit_triangle4`].
    fn hit_triangle4<C: Corner, S: Simd, const EARLY: bool>(&self, four: &Triangle4<C>) -> HitN<S::D4>;
}

/// The memory of [`PreparedRay::prepare_packet`].
#[derive(Default)]
pub(crate) struct PreparedPacket {
    pub woop: Vec<WoopTest>,
    pub fast: Vec<FastRay>,
}

/// A numeric tier: the tests of rays against triangles and analytic shapes, and the order of hits.
///
/// Every tier that is not fast must keep a hit's distance within the interval in which the ray is inside the
/// primitive's own bounds, up to a margin below that of the box tests, and the hit on its triangle up to a few units in
/// the last place. Then no acceleration structure changes the image.
pub(crate) trait Tier: Send + Sync + 'static {
    /// Its name.
    const NUMERICS: Numerics;
    /// Whether traversals decide in f32 without error bounds: see [`Numerics::Fast`].
    const IS_FAST: bool = false;
    /// The type of triangle corners.
    type Corner: Corner;
    /// A ray prepared for triangles.
    type Prepared: PreparedRay;

    /// Whether the tier decides hits by the test of Woop, Benthin and Wald and the f64 tests of analytic shapes, of
    /// which there are versions for several rays. Else those return [`HitN::UNDECIDED`].
    const HAS_RAY_N: bool = false;

    /// [`Tier::hit_triangle`] for a ray in each lane and one triangle. `ahead`: the caller knows that no hit lies
    /// behind a ray's origin.
    #[inline(always)]
    fn hit_triangle_n<D: Doubles>(rays: &PreparedRayN<D>, corners: &[[f64; 3]; 3], ahead: bool) -> HitN<D> {
        if Self::HAS_RAY_N { rays.hit(corners, ahead) } else { HitN::UNDECIDED }
    }

    /// [`Tier::hit_triangle`] for a ray in each lane with a triangle of its own, given as a lane of a [`Triangle4`]
    /// and known to lie ahead.
    #[inline(always)]
    fn hit_triangles_n<'a, D: Doubles>(
        rays: &PreparedRayN<D>,
        triangle: impl Fn(usize) -> (&'a Triangle4<Self::Corner>, usize),
    ) -> HitN<D> {
        if Self::HAS_RAY_N { rays.hit_each(triangle) } else { HitN::UNDECIDED }
    }

    /// The hit of `ray`, for which `prepared` was made, on a triangle, with `t_min < t < t_max`. Two-sided; a ray in
    /// the triangle's plane misses.
    fn hit_triangle(prepared: &Self::Prepared, ray: &Ray, corners: &[Self::Corner; 3])
    -> Option<TriangleHit>;

    /// The triangles of four that the ray may hit; [`Tier::hit_triangle`] misses the others. Without branches.
    #[inline(always)]
    fn may_hit4<S: Simd>(prepared: &Self::Prepared, four: &Triangle4<Self::Corner>) -> u32 {
        prepared.may_hit4::<_, S>(four)
    }

    /// [`Tier::hit_triangle`] for one ray and four triangles; if `EARLY`, with branches that spare work where all are
    /// missed.
    #[inline(always)]
    fn hit_triangle4<S: Simd, const EARLY: bool>(
        prepared: &Self::Prepared,
        four: &Triangle4<Self::Corner>,
    ) -> HitN<S::D4> {
        prepared.hit_triangle4::<_, S, EARLY>(four)
    }

    /// Whether the first of two hits of a ray is nearer, or equally near with the lower primitive id.
    #[inline(always)]
    fn is_before(_: impl FnOnce() -> Ray, [a, b]: [(&Hit, &Stored<Self::Corner>); 2]) -> bool {
        a.0.is_before(b.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_rays_hold_f32_numbers_and_no_negative_zero() {
        let ray = Precision::Single.ray(DVec3::splat(0.1), DVec3::new(-0.0, -1.0, 1e-40), 0.0, 1.0);
        assert_eq!(ray.origin, DVec3::splat(f64::from(0.1f32)));
        assert_eq!(ray.direction.to_array().map(f64::to_bits), [0.0, -1.0, 0.0].map(f64::to_bits));
    }

    #[test]
    fn double_rays_hold_f64_numbers_and_no_negative_zero() {
        let ray =
            Precision::Double.ray(DVec3::new(0.1, -1e-80, -0.0), DVec3::new(-0.0, -1.0, 1e-20), 0.0, 1.0);
        assert_eq!(ray.origin, DVec3::new(0.1, 0.0, 0.0));
        assert_eq!(ray.direction.to_array().map(f64::to_bits), [0.0, -1.0, 1e-20].map(f64::to_bits));
    }

    use crate::geometry::{Double, Exact, Fast, Watertight};

    /// What a tier says of a ray from `origin` and a triangle.
    fn hit_of<T: Tier>(corners: [DVec3; 3], ray: impl Fn(Precision) -> Ray) -> Option<TriangleHit> {
        let ray = ray(T::NUMERICS.ray_precision());
        T::hit_triangle(&T::Prepared::new(&ray), &ray, &corners.map(T::Corner::from_dvec3))
    }

    fn hits(corners: [DVec3; 3], ray: impl Fn(Precision) -> Ray) -> [Option<TriangleHit>; 4] {
        [
            hit_of::<Fast>(corners, &ray),
            hit_of::<Watertight>(corners, &ray),
            hit_of::<Double>(corners, &ray),
            hit_of::<Exact>(corners, &ray),
        ]
    }

    fn distances(corners: [DVec3; 3], origin: DVec3, direction: DVec3) -> [Option<f64>; 4] {
        hits(corners, |precision| precision.ray(origin, direction, 0.0, f64::INFINITY))
            .map(|h| h.map(|h| h.t))
    }

    const UNIT: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

    #[test]
    fn both_sides_edges_and_corners_hit() {
        for (x, y) in [(0.25, 0.25), (0.5, 0.5), (0.0, 0.5), (0.5, 0.0), (0.0, 0.0), (1.0, 0.0), (0.0, 1.0)] {
            let p = DVec3::new(x, y, 0.0);
            assert_eq!(distances(UNIT, p + DVec3::Z * 2.0, -DVec3::Z), [Some(2.0); 4], "{p}");
            assert_eq!(distances(UNIT, p - DVec3::Z * 2.0, DVec3::Z), [Some(2.0); 4], "{p}");
        }
        for (x, y) in [(0.5000001, 0.5), (-0.0000001, 0.5), (0.5, -0.0000001)] {
            assert_eq!(distances(UNIT, DVec3::new(x, y, 2.0), -DVec3::Z), [None; 4]);
        }
    }

    #[test]
    fn a_ray_in_the_plane_misses() {
        assert_eq!(distances(UNIT, DVec3::new(-1.0, 0.25, 0.0), DVec3::X), [None; 4]);
        assert_eq!(distances(UNIT, DVec3::new(-1.0, 0.0, 0.0), DVec3::X), [None; 4]);
    }

    #[test]
    fn the_interval_is_open_at_both_ends() {
        let test = |t_min, t_max| {
            let found = hits(UNIT, |p| p.ray(DVec3::new(0.25, 0.25, 5.0), -DVec3::Z, t_min, t_max));
            found.map(|hit| hit.is_some())
        };
        // In f32, which all tiers can tell from 5.
        let [below, above] = [5.0f32.next_down(), 5.0f32.next_up()].map(f64::from);
        for (t_min, t_max) in [(0.0, 5.0), (5.0, 10.0), (5.0, 5.0)] {
            assert_eq!(test(t_min, t_max), [false; 4]);
        }
        assert_eq!((test(0.0, above), test(below, 10.0)), ([true; 4], [true; 4]));
    }

    #[test]
    fn the_distance_to_an_axis_aligned_plane_is_good_at_any_angle() {
        // The assignment's plane seen from 2^-14 above it: t = (y_plane - y_origin) / d_y.
        let plane =
            [DVec3::new(-1e4, -500.0, -1e4), DVec3::new(-1e4, -500.0, 1e5), DVec3::new(1e4, -500.0, -1e4)];
        let origin = DVec3::new(-300.0, -500.0 + 6.103_515_625e-5, 200.0);
        for z in [1.0, 100.0, 1e4] {
            let direction = (DVec3::new(-300.0, -500.0, 200.0 + z) - origin).normalize();
            let ray = |precision: Precision| precision.ray(origin, direction, 0.0, 1e9);
            // All but `fast`.
            for (hit, numerics) in hits(plane, ray).into_iter().zip(Numerics::ALL).skip(1) {
                let ray = ray(numerics.ray_precision());
                let exact = (-500.0 - ray.origin.y) / ray.direction.y;
                let t = hit.unwrap().t;
                assert!((t - exact).abs() <= 2.0 * f64::EPSILON * exact, "{}: {t} {exact}", numerics.name());
            }
        }
    }

    #[test]
    fn barycentrics_find_the_corners() {
        for (k, corner) in UNIT.iter().enumerate() {
            for hit in hits(UNIT, |p| p.ray(*corner + DVec3::Z, -DVec3::Z, 0.0, 2.0)) {
                let [v, w] = hit.unwrap().barycentrics;
                assert_eq!([1.0 - v - w, v, w][k], 1.0);
            }
        }
    }
}
