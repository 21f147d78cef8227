//! Crossings of a ray whose origin is moved by `(e, e^2, e^3)`, with e a power of two: a real ray, in integers.
//!
//! If e is small enough for the numbers in question, the answers are those of every smaller e.

use std::cmp::Ordering;

use glam::DVec3;
use kiln::bvh::Ray;
use num_bigint::BigInt;

use super::integers::{Vector, integers, sign};

/// A crossing: the index of the triangle, and whether the ray leaves through its back.
pub type SignedCrossing = (u32, bool);

/// The crossings of the moved ray with triangles, in order of distance, then index. e is `2^-bits`, and all numbers
/// are multiples of `2^-(3 bits)`.
pub fn crossings(ray: &Ray, triangles: &[[DVec3; 3]], bits: u32) -> Vec<SignedCrossing> {
    let scaled = |v: DVec3| {
        Vector(v.to_array().map(|x| {
            let ([integer], power) = integers([x]);
            integer << usize::try_from(power + 3 * i64::from(bits)).expect("a multiple of the unit")
        }))
    };
    let one = BigInt::from(1);
    let origin = scaled(ray.origin()).plus(&Vector([2, 1, 0].map(|k| one.clone() << (k * bits))));
    let direction = scaled(ray.direction());
    let scale = one << (3 * bits);
    let mut found: Vec<(BigInt, BigInt, SignedCrossing)> = Vec::new();
    for (index, corners) in (0..).zip(triangles) {
        let [a, b, c] = corners.map(scaled);
        let normal = b.minus(&a).cross(&c.minus(&a));
        let across = normal.dot(&direction);
        if sign(&across) == 0 {
            continue;
        }
        let height = normal.dot(&a.minus(&origin));
        // t is height / across, made a fraction with a positive denominator.
        let (height, across) = (height * sign(&across), &across * sign(&across));
        // The point in the plane, times the denominator, against every edge.
        let point = origin.times(&across).plus(&direction.times(&height));
        let is_inside = [(&a, &b), (&b, &c), (&c, &a)].into_iter().all(|(from, to)| {
            let inwards = to.minus(from).cross(&point.minus(&from.times(&across))).dot(&normal);
            assert_ne!(sign(&inwards), 0, "the moved ray meets an edge: e is too large");
            sign(&inwards) > 0
        });
        // t_max is a multiple of the unit, too, or infinite.
        let is_before_end = || {
            let Vector([t_max, ..]) = scaled(DVec3::splat(ray.t_max()));
            &height * &scale < &across * t_max
        };
        if is_inside && sign(&height) > 0 && (ray.t_max() == f64::INFINITY || is_before_end()) {
            let leaves = sign(&normal.dot(&direction)) > 0;
            found.push((height, across, (index, leaves)));
        }
    }
    let order = |a: &(BigInt, BigInt, SignedCrossing), b: &(BigInt, BigInt, SignedCrossing)| -> Ordering {
        (&a.0 * &b.1).cmp(&(&b.0 * &a.1)).then(a.2.cmp(&b.2))
    };
    found.sort_by(order);
    found.into_iter().map(|(.., crossing)| crossing).collect()
}
