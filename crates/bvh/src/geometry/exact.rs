//! The tier `exact`: every decision is that of exact arithmetic on f64 rays and corners.
//!
//! f64 with an error bound decides nearly always. Otherwise expansions give the signs of the edge functions
//! ([`super::expansion`]) and big integers the order of distances ([`super::distance`]). Exact are: whether a ray
//! hits, edges, corners and tangents included; whether the hit lies between `t_min` and `t_max`; and the order of two
//! hits, equality included. A hit's distance is good to [`TOLERANCE`], its barycentrics to 2^-24.
//!
//! Not exact: coordinates below 2^-250 and direction components below 2^-100 of the largest become 0 beforehand, and
//! rays and the origins of secondary rays are rounded.
//!
//! In the bounds, u = 2^-53 is half of `f64::EPSILON`.

use glam::{DVec3, Vec3Swizzles};

use super::distance::{Distance, PlaneHit};
use super::expansion::Expansion;
use super::lanes::{HitN, Triangle4};
use super::simd::Simd;
use super::woop::{Sheared, WoopTest};
use super::{Hit, Ray, Stored, Tier, TriangleHit};
use crate::geometry::Numerics;

/// f64 geometry, decided exactly.
pub(crate) struct Exact;

/// The relative error of a distance. Two distances further apart than four times this differ; the margin of the box
/// tests ([`super::PRUNE_MARGIN`]) is far wider.
pub(crate) const TOLERANCE: f64 = f64::from_bits((1023 - 40) << 52);

/// The relative error of weights, as a share of their sum, above which they are computed exactly.
const WEIGHT_TOLERANCE: f64 = f64::from_bits((1023 - 26) << 52);

impl Tier for Exact {
    const NUMERICS: Numerics = Numerics::Exact;
    type Corner = DVec3;
    type Prepared = WoopTest;

    #[inline(always)]
    fn hit_triangle(test: &WoopTest, ray: &Ray, corners: &[DVec3; 3]) -> Option<TriangleHit> {
        let sheared = test.sheared(corners);
        let weights = sheared.weights();
        let error = weight_error(&sheared);
        let [mut least, mut most] = [weights[0]; 2];
        for weight in [weights[1], weights[2]] {
            least = least.min(weight);
            most = most.max(weight);
        }
        // Two weights of certain, opposite signs: the common case of a miss.
        if least < -error && most > error {
            return None;
        }
        let certain = least > error || most < -error;
        let weights = if certain { weights } else { decide(test, ray, corners, weights, error)? };
        settle(test, ray, corners, &sheared, weights, error)
    }

    #[inline(always)]
    fn may_hit4<S: Simd>(test: &WoopTest, four: &Triangle4<DVec3>) -> u32 {
        test.may_cross4::<_, S::D4>(four)
    }

    #[inline(always)]
    fn hit_triangle4<S: Simd, const EARLY: bool>(test: &WoopTest, four: &Triangle4<DVec3>) -> HitN<S::D4> {
        HitN { undecided: test.may_cross4::<_, S::D4>(four), ..HitN::NONE }
    }

    #[inline(always)]
    fn is_before(ray: impl FnOnce() -> Ray, [a, b]: [(&Hit, &Stored<DVec3>); 2]) -> bool {
        let gap = a.0.t - b.0.t;
        if gap.abs() > 4.0 * TOLERANCE * a.0.t.abs().max(b.0.t.abs()) {
            return gap < 0.0;
        }
        is_exactly_before(&ray(), [a, b])
    }
}

/// Bound on the error of the edge functions of a triangle.
///
/// With M the largest coordinate relative to the ray's origin and P the largest sheared x or y: a sheared coordinate
/// is off by at most 8u M (the difference by u, the shear by 2u, their product and the last difference by u each); an
/// edge function, of two products of those, by 32u M P + 300 u^2 M^2; and rounding it by 4u P^2, where P is at most 2
/// M.
#[inline(always)]
pub(super) fn weight_error(sheared: &Sheared) -> f64 {
    let [a, b, c] = sheared.corners;
    let reach = a.abs().max(b.abs()).max(c.abs()).max_element();
    let lateral = sheared.sheared_xy.as_flattened().iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    24.0 * f64::EPSILON * reach * (lateral + 4.0 * f64::EPSILON * reach)
}

/// The weights with their exact signs; `None` where the ray misses.
#[cold]
fn decide(
    test: &WoopTest,
    ray: &Ray,
    corners: &[DVec3; 3],
    mut weights: [f64; 3],
    error: f64,
) -> Option<[f64; 3]> {
    is_ray(ray).then_some(())?;
    let mut positive = weights.iter().any(|&w| w > error);
    let mut negative = weights.iter().any(|&w| w < -error);
    for (k, weight) in weights.iter_mut().enumerate() {
        if weight.abs() <= error {
            // The edge function of `a` is the triple product of the direction, `c` and `b`, over the direction's
            // component along the major axis; `b` and `c` by cyclic permutation.
            let (p, q) = (corners[(k + 2) % 3], corners[(k + 1) % 3]);
            let triple = triple_product(ray, p, q);
            let sign = f64::from(triple.sign()) * test.sign;
            *weight = (triple.estimate() * test.inverse[2]).abs() * sign;
            positive |= sign > 0.0;
            negative |= sign < 0.0;
            if positive && negative {
                return None;
            }
        }
    }
    (positive || negative).then_some(weights)
}

/// `direction . ((p - origin) x (q - origin))`, exactly.
pub(super) fn triple_product(ray: &Ray, p: DVec3, q: DVec3) -> Expansion {
    let side = |v: DVec3, k: usize| Expansion::difference(v[k], ray.origin[k]);
    let minor = |i: usize, j: usize| side(p, i) * side(q, j) - side(p, j) * side(q, i);
    let terms = [(0, 1, 2), (1, 2, 0), (2, 0, 1)].into_iter().filter(|&(k, ..)| ray.direction[k] != 0.0);
    terms
        .map(|(k, i, j)| minor(i, j).scaled(ray.direction[k]))
        .fold(Expansion::default(), |sum, term| sum + term)
}

/// The hit on a triangle that the ray's line certainly passes through.
#[inline(always)]
fn settle(
    test: &WoopTest,
    ray: &Ray,
    corners: &[DVec3; 3],
    sheared: &Sheared,
    weights: [f64; 3],
    error: f64,
) -> Option<TriangleHit> {
    let [weight_a, weight_b, weight_c] = weights;
    let sum = weight_a + weight_b + weight_c;
    let share = 1.0 / sum;
    if error > sum.abs() * WEIGHT_TOLERANCE {
        return settle_exactly(ray, corners);
    }
    let [a, b, c] = sheared.corners.map(|corner| corner.z);
    let depth = (weight_a * a + weight_b * b + weight_c * c) * share;
    // Each weight over the sum is off by twice 3 errors, each of which moves the depth within the triangle's range of
    // depths; the rest is rounding.
    let deep = a.max(b).max(c) - a.min(b).min(c);
    let depth_error =
        7.0 * error * share.abs() * deep + 8.0 * f64::EPSILON * a.abs().max(b.abs()).max(c.abs());
    let t = if depth_error <= depth.abs() * (TOLERANCE / 2.0) {
        depth * test.inverse[2]
    } else {
        match plane_distance(ray, corners) {
            PlaneDistance::At(t) => t,
            PlaneDistance::Behind => return None,
            PlaneDistance::Undecided => return settle_exactly(ray, corners),
        }
    };
    match is_within(ray, t) {
        Some(true) => Some(TriangleHit { t, barycentrics: [weight_b * share, weight_c * share] }),
        Some(false) => None,
        None => settle_exactly(ray, corners),
    }
}

/// The distance to a triangle's plane as far as f64 decides it.
pub(super) enum PlaneDistance {
    /// The distance, to the tolerance.
    At(f64),
    /// At or below 0: a miss.
    Behind,
    /// Not decided by f64.
    Undecided,
}

/// The distance to a triangle's plane in f64.
#[cold]
pub(super) fn plane_distance(ray: &Ray, &[a, b, c]: &[DVec3; 3]) -> PlaneDistance {
    let (u, v, to_a) = (b - a, c - a, a - ray.origin);
    let normal = u.cross(v);
    let permanent = u.abs().yzx() * v.abs().zxy() + u.abs().zxy() * v.abs().yzx();
    // The normal is off by 4u of its permanent, the vector to the corner by u, their product by u more, the sum by 2u
    // more; and 2u for second-order terms.
    let product = |with: DVec3| (normal.dot(with), 5.0 * f64::EPSILON * permanent.dot(with.abs()));
    let (numerator, numerator_error) = product(to_a);
    let (denominator, denominator_error) = product(ray.direction);
    let within = |share: f64| {
        numerator_error <= numerator.abs() * share && denominator_error <= denominator.abs() * share
    };
    if within(TOLERANCE / 4.0) {
        return PlaneDistance::At(numerator / denominator);
    }
    // A ray that leaves the surface it starts on: rounding destroys the distance, not its sign. 0 is not behind.
    let behind = numerator != 0.0 && numerator.is_sign_negative() != denominator.is_sign_negative();
    if behind && within(0.5) { PlaneDistance::Behind } else { PlaneDistance::Undecided }
}

/// [`settle`] in exact integer arithmetic.
#[cold]
fn settle_exactly(ray: &Ray, corners: &[DVec3; 3]) -> Option<TriangleHit> {
    is_ray(ray).then_some(())?;
    let PlaneHit { distance, barycentrics } = Distance::to_triangle(ray, corners)?;
    distance
        .is_within(ray)
        .then(|| TriangleHit { t: distance.to_f64(), barycentrics: [barycentrics[1], barycentrics[2]] })
}

/// Whether origin and direction are finite and the direction is not zero. Other rays hit nothing.
pub(super) fn is_ray(ray: &Ray) -> bool {
    ray.origin.is_finite() && ray.direction.is_finite() && ray.direction != DVec3::ZERO
}

/// Whether a distance, good to the tolerance, lies between `t_min` and `t_max`; `None` if it is too near one of them
/// to decide.
#[inline(always)]
pub(super) fn is_within(ray: &Ray, t: f64) -> Option<bool> {
    let slack = 2.0 * TOLERANCE * t.abs();
    if t - slack > ray.t_min && t + slack < ray.t_max {
        return Some(true);
    }
    (t + slack < ray.t_min || t - slack > ray.t_max).then_some(false)
}

/// The exact distance of a primitive that the ray hits.
fn exact_distance(ray: &Ray, primitive: &Stored<DVec3>) -> Option<Distance> {
    match primitive {
        Stored::Triangle(corners) => Distance::to_triangle(ray, corners).map(|crossing| crossing.distance),
        Stored::Analytic(shape) => shape.exact_distance(ray),
    }
}

/// Whether a distance is before the exact distance of a primitive that the ray hits, up to rounding at `of_primitive`.
pub(crate) fn is_before_exactly(ray: &Ray, t: f64, of_primitive: f64, primitive: Stored<DVec3>) -> bool {
    if (t - of_primitive).abs() > 4.0 * TOLERANCE * t.max(of_primitive) {
        return t < of_primitive;
    }
    exact_distance(ray, &primitive).is_some_and(|distance| Distance::of(t).cmp(&distance).is_lt())
}

#[cold]
fn is_exactly_before(ray: &Ray, hits: [(&Hit, &Stored<DVec3>); 2]) -> bool {
    let [a, b] = hits.map(|(_, primitive)| exact_distance(ray, primitive));
    let order = match (a, b) {
        (Some(a), Some(b)) => a.cmp(&b),
        // Unreachable: both have been hit.
        _ => std::cmp::Ordering::Equal,
    };
    order.then(hits[0].0.prim.cmp(&hits[1].0.prim)).is_lt()
}
