//! Tests of rays against primitives in f32 with error bounds, a ray in each lane: which rays certainly miss, which
//! certainly hit, and between which distances. What they leave open is decided by the [`Tier`](super::Tier).
//!
//! In the bounds u = 2^-24 is the rounding of f32, and S bounds the coordinates of ray origins relative to a point of the
//! primitive: S = R + A, where R and A are the largest coordinates of the origins and of that point. Directions have
//! length 1 up to a twentieth, else a lane is not [`RaysInF32::supported`]; the bounds use 1.05 for the largest
//! component. Coordinates are at most 2^30, so nothing overflows; a bound on underflow is added ([`UNDERFLOW`]).

mod shape;
mod triangle;

use super::Rays;
use super::fast::dot;
use super::simd::{Doubles, Floats, Vector};
pub(crate) use shape::ShapeInF32;
pub(crate) use triangle::TriangleInF32;

/// A ray in each lane, in f32.
pub(crate) struct RaysInF32<F> {
    origin: [F; 3],
    direction: [F; 3],
    /// 1 over the square of the direction's length.
    inverse_square: F,
    t_min: F,
    /// See [`super::Ray::t_max`].
    pub t_max: F,
    /// The lanes that estimates are valid for.
    pub supported: u32,
}

/// Bounds in f32 on the hits of a primitive, for the ray in each lane.
pub(crate) struct Estimate<F> {
    /// The rays that may hit.
    pub possible: u32,
    /// Of these, the rays that certainly hit, if `t_max` allows.
    pub certain: u32,
    /// A lower bound of the tier's distance of certain hits, less by a relative margin of 4 u.
    pub near: F,
    /// An upper bound of it, with the same margin.
    pub far: F,
}

/// Bounds of the errors of a primitive's estimates, as its `errors` returns them.
#[derive(Clone, Copy)]
pub(crate) struct Errors([f32; 4]);

impl Errors {
    /// Zeros, for unused entries.
    pub(crate) const NONE: Self = Errors([0.0; 4]);

    // Without `array::map`, which is not always inlined.
    #[inline(always)]
    fn splat<F: Floats>(&self) -> [F; 4] {
        let [a, b, c, d] = self.0;
        [F::splat(a), F::splat(b), F::splat(c), F::splat(d)]
    }
}

/// The largest coordinate of supported rays and primitives.
const MAX_COORDINATE: f32 = (1u32 << 30) as f32;

/// The unit roundoff of f32, 2^-24.
const U: f64 = f32::EPSILON as f64 / 2.0;

/// The largest component of a direction.
const DIRECTION: f64 = 1.05;

/// A bound on the error from underflow: 2^-149 for each of less than a hundred operations, times factors below 2^62.
const UNDERFLOW: f64 = 1.0 / (1u128 << 80) as f64;

impl<F: Floats> RaysInF32<F> {
    /// Twice as many rays as [`Rays::lanes`], from index `first` on.
    #[inline(always)]
    pub(crate) fn new<D: Doubles<Floats = F>>(rays: Rays, first: usize) -> Self {
        let (origin, direction) = (rays.origins_in_f32::<D>(first), rays.directions_in_f32::<D>(first));
        let square = dot(&direction, &direction);
        let is_unit = F::splat(0.9).le(square) & square.le(F::splat(1.1));
        RaysInF32 {
            origin,
            direction,
            inverse_square: F::splat(1.0) / square,
            t_min: rays.t_min_floats::<D>(first),
            t_max: rays.t_max_floats::<D>(first),
            supported: is_unit & reach(&origin).le(F::splat(MAX_COORDINATE)),
        }
    }
}

/// The largest coordinate of the origins of supported rays: R.
#[inline(always)]
pub(crate) fn reach_of_origins<D: Doubles>(rays: Rays) -> f64 {
    let mut largest = D::Floats::splat(0.0);
    for first in (0..rays.len()).step_by(D::Floats::LANES) {
        let origin = rays.origins_in_f32::<D>(first);
        // Lanes that are not supported may have any coordinate.
        largest = reach(&origin).min(D::Floats::splat(MAX_COORDINATE)).max(largest);
    }
    // Coordinates are rounded to f32.
    f64::from(largest.reduce_max()) * (1.0 + 2.0 * U)
}

#[inline(always)]
fn reach<F: Floats>([x, y, z]: &[F; 3]) -> F {
    x.abs().max(y.abs()).max(z.abs())
}

#[inline(always)]
fn splat<F: Floats>(x: &[f32; 3]) -> [F; 3] {
    [F::splat(x[0]), F::splat(x[1]), F::splat(x[2])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::simd::{Portable, Simd};
    use crate::geometry::{
        AnalyticShape, Double, Numerics, Precision, PreparedRay, Ray, RayBuffer, Sphere, Tier, Watertight,
    };
    use glam::DVec3;

    type F = <Portable as Simd>::F;
    type D = <Portable as Simd>::D;

    /// Random numbers from -1 to 1.
    struct Numbers(u64);

    impl Numbers {
        fn unit(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
        }

        fn vector(&mut self) -> DVec3 {
            DVec3::new(self.unit(), self.unit(), self.unit())
        }

        /// One of some scales.
        fn scale(&mut self, scales: &[f64]) -> f64 {
            scales[((self.unit() + 1.0) / 2.0 * scales.len() as f64) as usize % scales.len()]
        }
    }

    /// How many rays certainly missed, certainly hit, and were left open.
    #[derive(Debug, Default)]
    struct Counts {
        missed: usize,
        hit: usize,
        open: usize,
    }

    impl Counts {
        /// Checks what an estimate says of a ray against the tier's distance.
        fn check(&mut self, estimate: &Estimate<F>, t: Option<f64>, what: &dyn Fn() -> String) {
            if estimate.possible & 1 == 0 {
                self.missed += 1;
                assert_eq!(t, None, "a hit is certainly missed: {}", what());
            } else if estimate.certain & 1 != 0 {
                self.hit += 1;
                let [near, far] = [estimate.near, estimate.far].map(|x| f64::from(x.array()[0]));
                let t = t.unwrap_or_else(|| panic!("a miss is certainly hit: {}", what()));
                let slack = 4.0 * U * t;
                assert!(near + slack <= t && t + slack <= far, "{t} is not in {near}..{far}: {}", what());
            } else {
                self.open += 1;
            }
        }
    }

    /// Distances from edges and surfaces.
    const BESIDE: [f64; 8] = [0.0, 1e-15, 1e-9, 1e-7, 1e-5, 1e-2, 0.1, 0.3];

    fn buffer(precision: Precision, origin: DVec3, towards: DVec3, t_min: f64) -> (RayBuffer, Ray) {
        let mut rays = RayBuffer::default();
        let ray = precision.ray(origin, towards.normalize(), t_min, f64::INFINITY);
        rays.push(&ray);
        (rays, ray)
    }

    fn check_triangles<T: Tier>(numbers: &mut Numbers) -> Counts {
        let mut counts = Counts::default();
        let precision = T::NUMERICS.precision();
        for _ in 0..40_000 {
            let (size, away) = (numbers.scale(&[1e-4, 1.0, 30.0]), numbers.scale(&[0.0, 1.0, 1.0, 1e3, 1e6]));
            let centre = numbers.vector() * away;
            let thin = numbers.scale(&[1.0, 1.0, 1.0, 1e-3, 1e-9]);
            let [a, b] = [centre + numbers.vector() * size, centre + numbers.vector() * size];
            let c = a + (b - a) * numbers.unit() + numbers.vector() * (size * thin);
            let corners = [a, b, c].map(|corner| corner.map(|x| precision.round(x)));
            // A point near an edge, or anywhere in the triangle; the ray passes it, starts there, or runs along.
            let [v, w] = [0.5 + 0.5 * numbers.unit(), numbers.scale(&BESIDE)];
            let target =
                corners[0] + (corners[1] - corners[0]) * v * (1.0 - w) + (corners[2] - corners[0]) * w;
            let target = target + numbers.vector() * (numbers.scale(&BESIDE) * size);
            let distance = numbers.scale(&[0.0, 1e-12, 1e-6, 1.0, 1.0, 1.0, 1e3]);
            let origin = target + numbers.vector() * (distance * size);
            // Far from the origin of coordinates, both may be rounded to the same point.
            let towards = if target != origin { target - origin } else { numbers.vector() };
            let t_min = numbers.scale(&[0.0, 0.0, 0.5]) * size;
            let (rays, ray) = buffer(T::NUMERICS.ray_precision(), origin, towards, t_min);
            let triangle = TriangleInF32::new(&corners.map(|corner| corner.to_array()));
            let errors = triangle.errors(reach_of_origins::<D>(rays.rays()));
            let estimate = triangle.estimate(&errors, &RaysInF32::<F>::new::<D>(rays.rays(), 0));
            let tier = corners.map(<T::Corner as crate::geometry::Corner>::from_dvec3);
            let hit = T::hit_triangle(&T::Prepared::new(&ray), &ray, &tier);
            counts.check(&estimate, hit.map(|hit| hit.t), &|| format!("{corners:?} {ray:?}"));
        }
        counts
    }

    #[test]
    fn what_is_certain_of_triangles_is_what_the_tier_finds() {
        let mut numbers = Numbers(7);
        for counts in [check_triangles::<Watertight>(&mut numbers), check_triangles::<Double>(&mut numbers)] {
            let Counts { missed, hit, open } = counts;
            assert!(missed > 2000 && hit > 2000 && open > 2000, "{counts:?}");
        }
    }

    #[test]
    fn what_is_certain_of_spheres_is_what_the_tier_finds() {
        let (mut numbers, mut counts) = (Numbers(11), Counts::default());
        for _ in 0..80_000 {
            let (radius, away) = (numbers.scale(&[1e-4, 1.0, 30.0]), numbers.scale(&[0.0, 1.0, 1e3, 1e6]));
            let centre = numbers.vector() * away;
            let sphere = Sphere { centre, radius };
            // A point on or near the surface, or near the silhouette.
            let outward = numbers.vector().normalize();
            let point = centre + outward * (radius * (1.0 + numbers.unit() * numbers.scale(&BESIDE)));
            let across = outward.cross(numbers.vector()).normalize();
            let slope = numbers.scale(&[0.0, 1e-9, 1e-4, 1.0, 1.0, 1.0]) * numbers.unit();
            let direction = (across + outward * slope).normalize();
            let origin = point - direction * (radius * numbers.scale(&[0.0, 1e-9, 1.0, 1e3]));
            let t_min = numbers.scale(&[0.0, 0.0, 0.5]) * radius;
            let (rays, ray) = buffer(Precision::Double, origin, direction, t_min);
            let test = ShapeInF32::new(&sphere.into());
            let errors = test.errors(reach_of_origins::<D>(rays.rays()));
            let estimate = test.estimate(&errors, &RaysInF32::<F>::new::<D>(rays.rays(), 0));
            let hit = AnalyticShape::from(sphere).hit(&ray, Numerics::Watertight);
            counts.check(&estimate, hit, &|| format!("{sphere:?} {ray:?}"));
        }
        assert!(counts.missed > 2000 && counts.hit > 2000 && counts.open > 2000, "{counts:?}");
    }

    /// Squares of lengths of 1e-23 are subnormal in f32.
    #[test]
    fn tiny_spheres_are_not_missed() {
        let (mut numbers, mut counts) = (Numbers(13), Counts::default());
        for _ in 0..40_000 {
            let sphere = Sphere { centre: DVec3::ZERO, radius: 10f64.powf(-22.5 + 0.5 * numbers.unit()) };
            let point = numbers.vector().normalize() * sphere.radius * (1.0 - 1e-7 * numbers.unit().abs());
            let direction = point.cross(numbers.vector() * sphere.radius).normalize();
            let (rays, ray) =
                buffer(Precision::Double, point - direction * sphere.radius * 2.0, direction, 0.0);
            let test = ShapeInF32::new(&sphere.into());
            let errors = test.errors(reach_of_origins::<D>(rays.rays()));
            let estimate = test.estimate(&errors, &RaysInF32::<F>::new::<D>(rays.rays(), 0));
            let hit = AnalyticShape::from(sphere).hit(&ray, Numerics::Watertight);
            counts.check(&estimate, hit, &|| format!("{sphere:?} {ray:?}"));
        }
        assert!(counts.open > 10_000, "{counts:?}");
    }

    /// Rays whose direction has another length, or that start too far away, are left to the tier.
    #[test]
    fn unsupported_rays_are_named() {
        let mut rays = RayBuffer::default();
        for (x, length) in [(1.0, 1.0), (1e10, 1.0), (f64::NAN, 1.0), (1.0, 0.5), (1.0, 2.0), (1.0, f64::NAN)]
        {
            let (origin, direction) = (DVec3::splat(x), DVec3::X * length);
            rays.push(&Ray { origin, direction, t_min: 0.0, t_max: 1.0 });
        }
        let supported = RaysInF32::<F>::new::<D>(rays.rays(), 0).supported;
        assert_eq!(supported & 0b11_1111, 1);
        // The reach is that of the others, up to the limit.
        assert_eq!(reach_of_origins::<D>(rays.rays()), f64::from(MAX_COORDINATE) * (1.0 + 2.0 * U));
    }
}
