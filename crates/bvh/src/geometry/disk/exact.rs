//! The test of the tier `exact`: that of [`super`] with error bounds, then exact arithmetic. Crossings in every tier.

use std::cmp::Ordering;

use glam::DVec3;
use num_bigint::BigInt;
use num_traits::Signed;

use super::Disk;
use crate::geometry::distance::{Distance, Vector, dot, integers, minus};
use crate::geometry::exact::{TOLERANCE, is_ray, is_within};
use crate::geometry::{Ray, Side};

/// The distance within `t_min < t < t_max` at which the ray meets the disk.
#[inline(always)]
pub(super) fn hit(ray: &Ray, disk: &Disk) -> Option<f64> {
    let exactly = || distance(ray, disk).map(|distance| distance.to_f64());
    // As `Disk::hit_in_f64`, with error bounds.
    let (d, f, n) = (ray.direction, ray.origin - disk.centre, disk.normal);
    let product = |with: DVec3| (n.dot(with), 4.0 * f64::EPSILON * n.abs().dot(with.abs()));
    let ((height, height_error), (along, along_error)) = (product(f), product(d));
    let within = |share: f64| height_error <= height.abs() * share && along_error <= along.abs() * share;
    if along == 0.0 || !within(TOLERANCE / 4.0) {
        // A ray that leaves the disk it starts on: rounding destroys the distance, not its sign.
        let is_behind = height * along > 0.0 && within(0.5);
        return if is_behind { None } else { exactly() };
    }
    let t = -(height / along);
    let from_centre = f + d * t;
    let (mm, rr) = (from_centre.dot(from_centre), disk.radius * disk.radius);
    // The relative error of t, and those of the vector and of its square.
    let relative = height_error / height.abs() + along_error / along.abs() + 4.0 * f64::EPSILON;
    let error = 4.0 * f64::EPSILON * f.length() + relative * t.abs() * d.length();
    let error = 2.0 * mm.sqrt() * error + error * error + 4.0 * f64::EPSILON * (mm + rr);
    let inside = rr - mm;
    if inside < -error {
        return None;
    }
    match is_within(ray, t) {
        Some(is_within) if inside > error => is_within.then_some(t),
        Some(false) => None,
        _ => exactly(),
    }
}

/// The exact distance, if it lies between `t_min` and `t_max` and the disk is met.
#[cold]
pub(super) fn distance(ray: &Ray, disk: &Disk) -> Option<Distance> {
    let plane = PlanePoint::new(ray, disk)?;
    let distance = plane.distance();
    (plane.order().is_le() && distance.is_within(ray)).then_some(distance)
}

/// The exact distance of the plane.
pub(super) fn to_plane(ray: &Ray, disk: &Disk) -> Option<Distance> {
    PlanePoint::new(ray, disk).map(|plane| plane.distance())
}

/// The crossing of the moved ray ([`crate::geometry::crossing`]).
///
/// With m from the centre to the point in the plane, the move δ of the origin moves that point by `δ - d (n . δ) / (n .
/// d)`, which changes `m . m` by twice `δ . v / (n . d)` with `v = m (n . d) - n (m . d)`. On the rim, the first
/// component of v that is not 0 decides.
pub(super) fn crossing(ray: &Ray, disk: &Disk) -> Option<(f64, Side)> {
    let plane = PlanePoint::new(ray, disk)?;
    let PlanePoint { along, point, direction, normal, .. } = &plane;
    let is_inside = plane.order().then_with(|| {
        let turned = dot(point, direction);
        // v and n . d, times the same: the sign is that of their quotient.
        first_sign(&[0, 1, 2].map(|k| &point[k] * along - &normal[k] * &turned)).cmp(&0)
    });
    is_inside.is_lt().then_some(())?;
    let distance = plane.distance();
    let is_beyond = |t: f64| {
        t < f64::INFINITY
            && distance
                .cmp(&Distance::of(t))
                .then_with(|| (0).cmp(&first_sign(&normal.clone().map(|n| n * along))))
                == Ordering::Greater
    };
    let side = if along.is_negative() { Side::Entering } else { Side::Leaving };
    (is_beyond(ray.t_min) && !is_beyond(ray.t_max)).then(|| (distance.to_f64(), side))
}

/// The sign of the first number that is not 0.
fn first_sign(numbers: &Vector) -> i32 {
    numbers.iter().map(|x| x.cmp(&BigInt::ZERO) as i32).find(|&sign| sign != 0).unwrap_or(0)
}

/// Where a ray's line meets a disk's plane, in integers: every number times a power of two.
struct PlanePoint {
    /// `n . d`.
    along: BigInt,
    /// `-n . f`: the distance times `along`.
    height: BigInt,
    /// The vector from the centre times `along`.
    point: Vector,
    /// The radius times `along`.
    radius: BigInt,
    direction: Vector,
    normal: Vector,
}

impl PlanePoint {
    /// `None` for a line parallel to the plane.
    fn new(ray: &Ray, disk: &Disk) -> Option<Self> {
        is_ray(ray).then_some(())?;
        let [o, d, c, n] = [ray.origin, ray.direction, disk.centre, disk.normal];
        let numbers = integers([o.x, o.y, o.z, d.x, d.y, d.z, c.x, c.y, c.z, n.x, n.y, n.z, disk.radius]);
        let vector = |i: usize| -> Vector { [0, 1, 2].map(|k| numbers[3 * i + k].clone()) };
        let (direction, normal, f) = (vector(1), vector(3), minus(&vector(0), &vector(2)));
        let (along, height) = (dot(&normal, &direction), -dot(&normal, &f));
        (along != BigInt::ZERO).then_some(())?;
        let point = [0, 1, 2].map(|k| &f[k] * &along + &direction[k] * &height);
        let radius = &numbers[12] * &along;
        Some(PlanePoint { along, height, point, radius, direction, normal })
    }

    fn distance(&self) -> Distance {
        Distance::ratio(&self.height, &self.along)
    }

    /// The order of the point's distance from the centre and the radius.
    fn order(&self) -> Ordering {
        dot(&self.point, &self.point).cmp(&(&self.radius * &self.radius))
    }
}
