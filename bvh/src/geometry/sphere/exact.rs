//! The test of the tier `exact`: that of [`super`] with error bounds, then exact arithmetic.

use super::Sphere;
use crate::geometry::Ray;
use crate::geometry::distance::{Distance, Vector, dot, integers, minus};
use crate::geometry::exact::{TOLERANCE, is_ray, is_within};

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

/// The near and far intersection, the roots of `a t^2 - 2 b t + c = 0`. `None` if the line misses the sphere.
fn roots(ray: &Ray, sphere: &Sphere) -> Option<[Distance; 2]> {
    let [o, d, m] = [ray.origin, ray.direction, sphere.centre];
    let numbers = integers([o.x, o.y, o.z, d.x, d.y, d.z, m.x, m.y, m.z, sphere.radius]);
    let vector = |i: usize| -> Vector { [0, 1, 2].map(|k| numbers[3 * i + k].clone()) };
    let (direction, to_centre) = (vector(1), minus(&vector(2), &vector(0)));
    let c = dot(&to_centre, &to_centre) - &numbers[9] * &numbers[9];
    Distance::roots(&dot(&direction, &direction), &dot(&to_centre, &direction), &c)
}
