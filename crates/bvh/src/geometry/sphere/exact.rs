//! The test of the tier `exact`: that of [`super`] with error bounds, then exact arithmetic. Crossings in every tier.

use std::cmp::Ordering;

use super::Sphere;
use crate::geometry::crossing::first_sign;
use crate::geometry::distance::{Distance, Vector, dot, integers, minus};
use crate::geometry::exact::{TOLERANCE, is_ray, is_within};
use crate::geometry::expansion::Expansion;
use crate::geometry::{Ray, Side};

/// The least distance within `t_min < t < t_max` at which the ray meets the sphere.
#[inline(always)]
pub(crate) fn hit(ray: &Ray, sphere: &Sphere) -> Option<f64> {
    // As `Sphere::hit_in_f64`, with error bounds.
    let (d, f) = (ray.direction, ray.origin - sphere.centre);
    let (a, ff, rr) = (d.dot(d), f.dot(f), sphere.radius * sphere.radius);
    let b = -f.dot(d);
    let nearest = f + d * (b / a);
    let nn = nearest.dot(nearest);
    let discriminant = rr - nn;
    // b is off by 5u √(ff a), so the nearest point by 13u √ff on each axis, its square by 2 √3 times that of its
    // length, and more where it is short; each of the squares by 4u of itself.
    let error = f64::EPSILON * (32.0 * (nn * ff).sqrt() + 4.0 * (nn + rr) + 1024.0 * f64::EPSILON * ff);
    if discriminant < -error {
        return None;
    }
    let c = ff - rr;
    let (b_error, c_error) = (4.0 * f64::EPSILON * (ff * a).sqrt(), 4.0 * f64::EPSILON * (ff + rr));
    if c > c_error && b < -b_error {
        // The ray starts outside and points away.
        return None;
    }
    if discriminant <= error {
        return distance(ray, sphere).map(|distance| distance.to_f64());
    }
    let root = (a * discriminant).sqrt();
    let q = b + root.copysign(b);
    let q_error = b_error + (a * error) / root + 4.0 * f64::EPSILON * root;
    let sure = q_error <= q.abs() * (TOLERANCE / 4.0) && c_error <= c.abs() * (TOLERANCE / 4.0);
    if !sure {
        return distance(ray, sphere).map(|distance| distance.to_f64());
    }
    let (t0, t1) = (c / q, q / a);
    for t in [t0.min(t1), t0.max(t1)] {
        match is_within(ray, t) {
            Some(true) => return Some(t),
            Some(false) => {}
            None => return distance(ray, sphere).map(|distance| distance.to_f64()),
        }
    }
    None
}

/// The first of a sphere's two distances that lies between `t_min` and `t_max`.
#[cold]
pub(crate) fn distance(ray: &Ray, sphere: &Sphere) -> Option<Distance> {
    is_ray(ray).then_some(())?;
    roots(ray, sphere)?.into_iter().find(|distance| distance.is_within(ray))
}

/// The crossings of the moved ray ([`crate::geometry::crossing`]). Where the line only touches the sphere there are
/// none, unless one end of the ray is there.
pub(crate) fn crossings(ray: &Ray, sphere: &Sphere) -> [Option<(f64, Side)>; 2] {
    let roots = if is_ray(ray) { roots(ray, sphere) } else { None };
    let Some([near, far]) = roots else { return [None; 2] };
    // Whether the sphere holds the moved point at t, which lies on it otherwise: whether the move shortens the vector
    // from the centre.
    let holds = |t: f64| {
        let from_centre = |k: usize| {
            Expansion::difference(ray.origin[k], sphere.centre[k])
                + Expansion::difference(ray.direction[k], 0.0).scaled(t)
        };
        first_sign(&[0, 1, 2].map(from_centre)) < 0
    };
    let order = |root: &Distance, t: f64| match t {
        f64::INFINITY => Ordering::Less,
        _ => root.cmp(&Distance::of(t)),
    };
    let is_inside = |t: f64| match [order(&near, t), order(&far, t)] {
        [Ordering::Less, Ordering::Greater] => true,
        [near, far] => (near.is_eq() || far.is_eq()) && holds(t),
    };
    let [starts_inside, ends_inside] = [ray.t_min, ray.t_max].map(is_inside);
    let is_between = |root: &Distance| order(root, ray.t_min).is_ge() && order(root, ray.t_max).is_le();
    let is_passed = near.cmp(&far).is_lt() && is_between(&near) && is_between(&far);
    let enters = !starts_inside && (ends_inside || is_passed);
    let leaves = !ends_inside && (starts_inside || is_passed);
    [enters.then(|| (near.to_f64(), Side::Entering)), leaves.then(|| (far.to_f64(), Side::Leaving))]
}

/// The near and far intersection, the roots of `a t^2 - 2 b t + c = 0`. `None` if the line misses the sphere.
pub(crate) fn roots(ray: &Ray, sphere: &Sphere) -> Option<[Distance; 2]> {
    let [o, d, m] = [ray.origin, ray.direction, sphere.centre];
    let numbers = integers([o.x, o.y, o.z, d.x, d.y, d.z, m.x, m.y, m.z, sphere.radius]);
    let vector = |i: usize| -> Vector { [0, 1, 2].map(|k| numbers[3 * i + k].clone()) };
    let (direction, to_centre) = (vector(1), minus(&vector(2), &vector(0)));
    let c = dot(&to_centre, &to_centre) - &numbers[9] * &numbers[9];
    Distance::roots(&dot(&direction, &direction), &dot(&to_centre, &direction), &c)
}
