//! How far off the tests in f64 may be: for triangles the one of Woop, Benthin and Wald (JCGT 2(1) 2013), for spheres
//! the one of Haines, Günther and Akenine-Möller (Ray Tracing Gems, chapter 7, 2019).
//!
//! A hit in f64 that is not the exact one is right if it can be blamed on rounding. These bounds say when it can. `u`
//! is half the distance from 1 to the next f64; where its squares are left out, the constants have room for them.

use glam::DVec3;
use kiln::bvh::Ray;

use super::filter::{U, edges};

/// Whether a decision in f64 must be the exact one: the line keeps clear of the triangle's edges, and the origin of the
/// triangle's plane.
///
/// Let `m` be the size of a corner seen from the origin (its largest coordinate). A sheared coordinate `x - s z` with
/// |s| <= 1 has a size of at most 2m. Its error is at most `u m` for the difference x, `u m + 2u m + u m` for the difference
/// z, the shear (a reciprocal and a product) and their product, and `2u m` for the subtraction: 7u m. An edge function
/// `x y' - y x'` of two corners then has an error of at most `2 (7 * 2 + 2 * 7 + 4) u m m' + 8u m m' = 72u m m'`.
/// Exactly, it is the triple product of [`edges`] over the largest component of the direction.
///
/// The distance is the sum of the edge functions times the depths of the opposite corners, which exactly is the volume
/// of the three corners, over a sum of numbers of one sign. It has the right sign if the volume is clear of `3 * 72u m
/// m' m''` for the edge functions, `5 * 3 * 8u m m' m''` for products and sums, and `8 * 6u m m' m''` for the volume as
/// computed here: 384u m m' m''.
pub fn is_clear(ray: &Ray, corners: &[DVec3; 3]) -> bool {
    let relative = corners.map(|corner| corner - ray.origin());
    let [a, b, c] = relative.map(|corner| corner.abs().max_element());
    let length = ray.direction().abs().max_element();
    let margins = [b * c, c * a, a * b].map(|product| 80.0 * U * length * product);
    let beside =
        edges(ray, corners).iter().zip(margins).all(|((sum, error), margin)| sum.abs() > error + margin);
    let volume = relative[0].dot(relative[1].cross(relative[2]));
    beside && volume.abs() > 400.0 * U * a * b * c
}

/// A bound on the error of the distance of a hit; infinite where the edge functions are no larger than their errors.
///
/// The distance is a mean of the corners' depths, weighted by the edge functions. With `e` the error of each and `s`
/// their sum, the mean moves by at most `3 e (greatest depth - least depth) / (s - 3 e)`. Products, sums, the
/// reciprocal and the shear add 9u times the greatest depth, and holding the distance within the triangle's box 3u.
pub fn distance_error(ray: &Ray, corners: &[DVec3; 3]) -> f64 {
    let relative = corners.map(|corner| corner - ray.origin());
    let size = relative.iter().map(|corner| corner.abs().max_element()).fold(0.0, f64::max);
    let length = ray.direction().abs();
    let axis = (0..3).fold(0, |most, k| if length[k] > length[most] { k } else { most });
    let depths = relative.map(|corner| corner[axis]);
    let extent = depths.iter().flat_map(|z| depths.map(|y| (z - y).abs())).fold(0.0, f64::max);
    let (sum, unsure) = edges(ray, corners).iter().fold((0.0, 0.0), |(s, e), edge| (s + edge.0, e + edge.1));
    let error = 80.0 * U * size * size;
    let rest = (f64::abs(sum) - unsure) / length[axis] - 3.0 * error;
    if rest > 0.0 { (3.0 * error * extent / rest + 16.0 * U * size) / length[axis] } else { f64::INFINITY }
}

/// What the sphere test computes, and how far off it may be.
struct Chord {
    /// The squared radius less the squared distance of the line from the centre.
    squared: f64,
    squared_error: f64,
    /// The distance from the origin to the middle of the chord, times the direction's length.
    middle: f64,
    /// The squared distance of the origin from the centre less the squared radius.
    power: f64,
    power_error: f64,
    /// The direction's length.
    length: f64,
}

/// With `f` the distance from the centre to the origin and `n` that to the line: the differences have an error of `u
/// f`, `b / a` one of `4u + 3u + u` and so `d b / a` one of 9u f, the sum another `2u f`: 12u f per coordinate, at most
/// 21u f in all. So `n^2` has an error of `2 (21u f) n + (21u f)^2 + 4u n^2`; the second is not small where the sphere
/// is much smaller than its distance. The squared radius, less it, has `2u r^2` more, and `f^2 - r^2` an error of `6u
/// (f^2 + r^2)`.
fn chord(ray: &Ray, centre: DVec3, radius: f64) -> Chord {
    let (f, d) = (ray.origin() - centre, ray.direction());
    let (length, distance) = (d.length(), f.length());
    let nearest = (f - d * (f.dot(d) / d.length_squared())).length();
    let of_nearest = 21.0 * U * distance;
    Chord {
        squared: (radius - nearest) * (radius + nearest),
        // Twice the error: this is computed with as many roundings.
        squared_error: 2.0 * (2.0 * of_nearest * nearest + of_nearest * of_nearest)
            + 2.0 * U * (4.0 * nearest * nearest + 2.0 * radius * radius),
        middle: -f.dot(d) / length,
        power: (distance - radius) * (distance + radius),
        power_error: 2.0 * U * 6.0 * (distance * distance + radius * radius),
        length,
    }
}

/// Whether a decision in f64 must be the exact one: the line keeps clear of touching the sphere, and the origin of its
/// surface.
pub fn is_clear_of_sphere(ray: &Ray, centre: DVec3, radius: f64) -> bool {
    let chord = chord(ray, centre, radius);
    chord.squared.abs() > chord.squared_error && chord.power.abs() > chord.power_error
}

/// A bound on the error of the distance of a hit.
///
/// Half the chord, the root of a number that may be off by `e`, is off by at most `e / root`, and by at most the root
/// of `e`. The far end is as far off as the middle and this together. The near end is the power over the far end.
pub fn sphere_distance_error(ray: &Ray, centre: DVec3, radius: f64) -> f64 {
    let chord = chord(ray, centre, radius);
    let half = chord.squared.max(0.0).sqrt();
    let of_half = chord.squared_error.sqrt().min(chord.squared_error / half);
    let far = chord.middle.abs() + half;
    let of_far = of_half + 16.0 * U * ((ray.origin() - centre).length() + far);
    let near = chord.power.abs() / far;
    let of_near = chord.power_error / far + near * of_far / far;
    of_far.max(of_near) / chord.length
}

/// What the disk test computes, and how far off it may be.
struct Plane {
    /// The heights of the origin and of the direction over the plane.
    height: f64,
    height_error: f64,
    along: f64,
    along_error: f64,
    /// The distance from the origin to the centre, at most.
    reach: f64,
}

/// With `f` from the centre to the origin, the terms of `n . f` have an error of 2u, and their sum 2u more; the terms
/// of `n . d` one of u, and their sum 2u more. Twice this: it is computed here with as many roundings.
fn plane(ray: &Ray, centre: DVec3, normal: DVec3) -> Plane {
    let (f, d) = (ray.origin() - centre, ray.direction());
    Plane {
        height: normal.dot(f),
        height_error: 8.0 * U * normal.abs().dot(f.abs()),
        along: normal.dot(d),
        along_error: 6.0 * U * normal.abs().dot(d.abs()),
        reach: f.length(),
    }
}

/// Whether a decision in f64 must be the exact one: the ray is not parallel to the plane, does not start on it, and
/// keeps clear of the rim.
///
/// The computed t has a relative error of those of height and slope, and 2u; the point `f + t d` one of that times its
/// way, `u f`, `u t d` and `u` of itself on each axis. Twice this, for the roundings here.
pub fn is_clear_of_disk(ray: &Ray, centre: DVec3, normal: DVec3, radius: f64) -> bool {
    let Plane { height, height_error, along, along_error, reach } = plane(ray, centre, normal);
    if height.abs() <= height_error || along.abs() <= along_error {
        return false;
    }
    let t = -height / along;
    let way = t.abs() * ray.direction().length();
    let relative = height_error / height.abs() + along_error / (along.abs() - along_error) + 4.0 * U;
    let error = 2.0 * (relative * way + 4.0 * U * (reach + way));
    let from_centre = (ray.origin() - centre + ray.direction() * t).length();
    (from_centre - radius).abs() > error + 8.0 * U * radius
}

/// A bound on the error of the distance of a hit: that of the quotient, and of clamping it to bounds that have been
/// rounded by 4u of their coordinates and of the way.
pub fn disk_distance_error(ray: &Ray, centre: DVec3, normal: DVec3, radius: f64) -> f64 {
    let Plane { height, height_error, along, along_error, reach } = plane(ray, centre, normal);
    if along.abs() <= along_error {
        return f64::INFINITY;
    }
    let t = (height / along).abs();
    let rest = along.abs() - along_error;
    let of_bounds =
        8.0 * U * (reach + radius + centre.abs().max_element()) / ray.direction().abs().max_element();
    (height_error + t * along_error) / rest + 8.0 * U * t + of_bounds
}
