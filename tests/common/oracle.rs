//! What rays hit, decided without rounding.
//!
//! The numbers of a question are floating-point numbers, so they are integers times a common power of two; what is
//! asked of them are signs of polynomials, and those are found in integer arithmetic (num-bigint). Nothing here is
//! shared with kiln, and the formulas are others than its own: a triangle's plane is met first, and the point of
//! meeting is then compared with each edge within the plane.
//!
//! What counts, as in kiln: a ray is open at both ends; triangles have two sides, and their edges belong to them; a ray
//! in a triangle's plane misses; a triangle without area is never hit; a sphere's surface is hit from outside and from
//! inside, and where a ray touches it; a disk has two sides, its rim belongs to it, and a ray in its plane misses.

mod distance;
mod filter;
mod integers;
pub mod moved;
mod rounding;

use std::cmp::Ordering;

use glam::DVec3;
use kiln::bvh::Ray;

// Only some test binaries use the signs.
#[allow(unused_imports)]
pub use distance::{Distance, sign_with_root, sign_with_two_roots};
pub use filter::{Passage, passage};
use integers::{Vector, integers, sign};
pub use rounding::{
    disk_distance_error, distance_error, is_clear, is_clear_of_disk, is_clear_of_sphere,
    sphere_distance_error,
};

/// Where the line of `ray` meets the triangle, if it does.
pub fn line_triangle(ray: &Ray, corners: &[DVec3; 3]) -> Option<Distance> {
    let [o, [a, b, c]] = [[ray.origin(); 3], *corners];
    let ([ox, oy, oz, ax, ay, az, bx, by, bz, cx, cy, cz], places) =
        integers([o[0].x, o[0].y, o[0].z, a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z]);
    let [o, a, b, c] =
        [Vector([ox, oy, oz]), Vector([ax, ay, az]), Vector([bx, by, bz]), Vector([cx, cy, cz])];
    let (d, directions) = integers(ray.direction().to_array());
    let d = Vector(d);
    // The plane is n . (x - a) = 0.
    let n = b.minus(&a).cross(&c.minus(&a));
    let denominator = n.dot(&d);
    let side = sign(&denominator);
    if side == 0 {
        return None;
    }
    let numerator = n.dot(&a.minus(&o));
    // The point of meeting, times the denominator.
    let point = o.times(&denominator).plus(&d.times(&numerator));
    // It lies to the left of every edge, seen from the normal's tip, or on it.
    let inside = [(&a, &b), (&b, &c), (&c, &a)].into_iter().all(|(from, to)| {
        let across = to.minus(from).cross(&point.minus(&from.times(&denominator)));
        sign(&n.dot(&across)) * side >= 0
    });
    inside.then(|| Distance::fraction(numerator, denominator, places - directions))
}

/// Where the line of `ray` meets the sphere, the lesser first.
pub fn line_sphere(ray: &Ray, centre: DVec3, radius: f64) -> Option<[Distance; 2]> {
    let o = ray.origin();
    let ([ox, oy, oz, cx, cy, cz, r], places) =
        integers([o.x, o.y, o.z, centre.x, centre.y, centre.z, radius]);
    let (d, directions) = integers(ray.direction().to_array());
    let d = Vector(d);
    // |f + t d|^2 = r^2
    let f = Vector([ox, oy, oz]).minus(&Vector([cx, cy, cz]));
    Distance::roots(&d.dot(&d), &f.dot(&d), &(f.dot(&f) - &r * &r), places - directions)
}

/// Where the line of `ray` meets the disk, if it does. The normal has any length.
pub fn line_disk(ray: &Ray, centre: DVec3, normal: DVec3, radius: f64) -> Option<Distance> {
    let o = ray.origin();
    let ([ox, oy, oz, cx, cy, cz, r], places) =
        integers([o.x, o.y, o.z, centre.x, centre.y, centre.z, radius]);
    let (d, directions) = integers(ray.direction().to_array());
    let (n, _) = integers(normal.to_array());
    let (d, n, to_centre) = (Vector(d), Vector(n), Vector([cx, cy, cz]).minus(&Vector([ox, oy, oz])));
    // The plane is n . (o + t d - c) = 0; no power of two of the normal matters.
    let (numerator, denominator) = (n.dot(&to_centre), n.dot(&d));
    if sign(&denominator) == 0 {
        return None;
    }
    // The vector from the centre, times the denominator.
    let from_centre = d.times(&numerator).minus(&to_centre.times(&denominator));
    let reach = &r * &denominator;
    let is_met = from_centre.dot(&from_centre) <= &reach * &reach;
    is_met.then(|| Distance::fraction(numerator, denominator, places - directions))
}

/// The part of the line of `ray` that lies within the box from `min` to `max`, faces included.
pub fn line_box(ray: &Ray, min: DVec3, max: DVec3) -> Option<[Distance; 2]> {
    let (mut enter, mut leave): (Option<Distance>, Option<Distance>) = (None, None);
    for axis in 0..3 {
        let ([o, least, greatest], places) = integers([ray.origin()[axis], min[axis], max[axis]]);
        let ([d], directions) = integers([ray.direction()[axis]]);
        if sign(&d) == 0 {
            if o < least || o > greatest {
                return None;
            }
            continue;
        }
        let at = |plane| Distance::fraction(plane - &o, d.clone(), places - directions);
        let (near, far) = if sign(&d) > 0 { (least, greatest) } else { (greatest, least) };
        let (near, far) = (at(near), at(far));
        enter = Some(enter.map_or(near.clone(), |so_far| so_far.max(near)));
        leave = Some(leave.map_or(far.clone(), |so_far| so_far.min(far)));
    }
    let (enter, leave) = (enter.expect("a direction"), leave.expect("a direction"));
    (enter <= leave).then_some([enter, leave])
}

/// Whether the distance lies strictly between the ends of `ray`.
pub fn is_within(ray: &Ray, distance: &Distance) -> bool {
    distance.compare(ray.t_min()) == Ordering::Greater && distance.compare(ray.t_max()) == Ordering::Less
}

/// Where `ray` hits the triangle.
pub fn triangle(ray: &Ray, corners: &[DVec3; 3]) -> Option<Distance> {
    if passage(ray, corners) == Passage::Beside {
        return None;
    }
    line_triangle(ray, corners).filter(|distance| is_within(ray, distance))
}

/// Where `ray` first hits the sphere.
pub fn sphere(ray: &Ray, centre: DVec3, radius: f64) -> Option<Distance> {
    line_sphere(ray, centre, radius)?.into_iter().find(|distance| is_within(ray, distance))
}

/// Where `ray` hits the disk.
pub fn disk(ray: &Ray, centre: DVec3, normal: DVec3, radius: f64) -> Option<Distance> {
    line_disk(ray, centre, normal, radius).filter(|distance| is_within(ray, distance))
}

/// The power of two at or below `x`, which is a normal number.
fn leading_digit(x: f64) -> f64 {
    f64::from_bits(x.abs().to_bits() & !((1 << 52) - 1))
}

/// A step of f32 at `x`: what the last of 24 binary digits is worth there, also where f32 does not reach.
pub fn f32_step(x: f64) -> f64 {
    leading_digit(x) * f64::from(f32::EPSILON)
}

/// The distance of `found` from the exact one, in steps of f32 at that place.
pub fn f32_ulps(found: f64, exact: &Distance) -> f64 {
    let exact = exact.to_f64();
    (found - exact).abs() / f32_step(exact)
}

/// The same in steps of f64.
pub fn f64_ulps(found: f64, exact: &Distance) -> f64 {
    let exact = exact.to_f64();
    (found - exact).abs() / (leading_digit(exact) * f64::EPSILON)
}
