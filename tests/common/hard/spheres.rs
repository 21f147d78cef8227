//! Numerically hard spheres and rays: grazing, tiny, huge, starting on the surface or inside.

use glam::DVec3;
use kiln::bvh::Ray;

use super::{ray, ray_towards, single};
use crate::common::Numbers;

/// A sphere, and rays at it, all of f32 numbers.
pub struct Ball {
    pub name: &'static str,
    pub centre: DVec3,
    pub radius: f64,
    pub rays: Vec<Ray>,
}

impl Ball {
    fn new(name: &'static str, centre: DVec3, radius: f64, rays: Vec<Ray>) -> Self {
        let ball = Ball { name, centre: single(centre), radius: f64::from(radius as f32), rays };
        assert_eq!((ball.centre, ball.radius), (centre, radius), "{name}: not f32 numbers");
        ball
    }
}

/// A ray from `origin` that passes `centre` at about the given distance, on a side of chance.
fn passing(origin: DVec3, centre: DVec3, distance: f64, numbers: &mut Numbers) -> Ray {
    let origin = single(origin);
    let to_centre = centre - origin;
    let ahead = to_centre.normalize();
    let aside = ahead.cross(numbers.direction()).normalize();
    let sine = distance / to_centre.length();
    ray(origin, ahead * (1.0 - sine * sine).sqrt() + aside * sine)
}

/// Rays that pass within `relative` of the radius, nearer and farther; from close by and along the z axis.
pub fn grazing(count: usize, relative: f64, seed: u64) -> Ball {
    let mut numbers = Numbers::new(seed);
    let (centre, radius) = (DVec3::new(0.0, 0.0, 1200.0), 100.0);
    let rays = (0..count).map(|_| {
        let distance = radius * (1.0 + relative * numbers.signed());
        passing(numbers.vector() * 100.0, centre, distance, &mut numbers)
    });
    Ball::new("grazing", centre, radius, rays.collect())
}

/// Rays that touch: with whole numbers, along an axis, and one step of f32 to either side of the tangent.
pub fn touching(count: usize, seed: u64) -> Ball {
    let mut numbers = Numbers::new(seed);
    // Whole points at distance 65 from the centre, across an axis: 16-63, 25-60, 33-56, 39-52, 0-65.
    let sides = [(16.0, 63.0), (25.0, 60.0), (33.0, 56.0), (39.0, 52.0), (0.0, 65.0)];
    let centre = DVec3::new(1.0, -2.0, 300.0);
    let rays = (0..count).map(|i| {
        let (u, v) = numbers.one_of(&sides);
        let sign = |numbers: &mut Numbers| numbers.one_of(&[-1.0, 1.0]);
        let (u, v) = (u * sign(&mut numbers), v * sign(&mut numbers));
        let axis = numbers.below(3);
        let ahead = sign(&mut numbers);
        let mut origin = centre;
        origin[axis] -= ahead * (100.0 + numbers.below(1000) as f64);
        origin[(axis + 1) % 3] += u;
        origin[(axis + 2) % 3] += v;
        if i % 3 > 0 {
            let moved = &mut origin[(axis + 1) % 3];
            let near = *moved as f32;
            *moved = f64::from(if i % 3 == 1 { near.next_up() } else { near.next_down() });
        }
        let mut direction = DVec3::ZERO;
        direction[axis] = ahead;
        ray(origin, direction)
    });
    Ball::new("touching", centre, 65.0, rays.collect())
}

/// A speck of 1e-3 at a distance of 1e4, passed at up to twice its radius.
pub fn tiny(count: usize, seed: u64) -> Ball {
    let mut numbers = Numbers::new(seed);
    let (centre, radius) = (DVec3::new(0.0, 0.0, 1e4), f64::from(1e-3f32));
    // f32 directions are 6e-8 apart, 6e-4 at that distance: the origin moves instead.
    let rays = (0..count).map(|i| {
        let aside = numbers.vector() * (2.0 * radius);
        let direction =
            if i % 2 == 0 { DVec3::Z } else { DVec3::new(f64::from(1e-7f32) * numbers.signed(), 0.0, 1.0) };
        let direction = single(direction);
        ray(single(aside - direction * DVec3::new(1e4, 1e4, 0.0)), direction)
    });
    Ball::new("tiny", centre, radius, rays.collect())
}

/// A globe of 1e5, seen from about 1 above its surface, in all directions along and towards it.
pub fn huge(count: usize, seed: u64) -> Ball {
    let mut numbers = Numbers::new(seed);
    let (centre, radius) = (DVec3::new(0.0, -1e5, 0.0), 1e5);
    let rays = (0..count).map(|i| {
        let up = if i % 2 == 0 { DVec3::Y } else { numbers.direction() };
        let origin = centre + up * (radius + 1.0);
        let target =
            centre + (up + numbers.vector() * 10f64.powf(-4.0 * numbers.unit())).normalize() * radius;
        ray_towards(origin, target)
    });
    Ball::new("huge", centre, radius, rays.collect())
}

/// Rays that start on the surface, rounded to f32, and leave or enter; some start exactly on it.
pub fn on_surface(count: usize, seed: u64) -> Ball {
    let mut numbers = Numbers::new(seed);
    let (centre, radius) = (DVec3::new(3.0, -5.0, 8.0), 3.0);
    // Whole points at distance 3: (±1, ±2, ±2) and (±3, 0, 0), their coordinates in any order.
    let whole = [DVec3::new(1.0, 2.0, 2.0), DVec3::new(3.0, 0.0, 0.0)];
    let rays = (0..count).map(|i| {
        let arm = if i % 2 == 0 {
            let p: DVec3 = numbers.one_of(&whole);
            let turn = numbers.below(3);
            let p = DVec3::new(p[turn], p[(turn + 1) % 3], p[(turn + 2) % 3]);
            p * DVec3::new(
                numbers.one_of(&[-1.0, 1.0]),
                numbers.one_of(&[-1.0, 1.0]),
                numbers.one_of(&[-1.0, 1.0]),
            )
        } else {
            numbers.direction() * radius
        };
        let origin = single(centre + arm);
        // Every sixth in the tangent plane, as well as rounding lets it.
        let direction =
            if i % 6 < 2 { arm.cross(numbers.direction()).normalize() } else { numbers.direction() };
        ray(origin, direction)
    });
    Ball::new("on the surface", centre, radius, rays.collect())
}

/// Rays that start inside.
pub fn inside(count: usize, seed: u64) -> Ball {
    let mut numbers = Numbers::new(seed);
    let (centre, radius) = (DVec3::new(0.0, 0.0, 50.0), 100.0);
    let rays = (0..count).map(|_| {
        let origin = centre + numbers.direction() * (radius * numbers.unit());
        ray(origin, numbers.direction())
    });
    Ball::new("from inside", centre, radius, rays.collect())
}

/// A ball of 75 at a distance of a million.
pub fn far(count: usize, seed: u64) -> Ball {
    let mut numbers = Numbers::new(seed);
    let (centre, radius) = (DVec3::new(0.0, 0.0, 1e6), 75.0);
    let rays =
        (0..count).map(|_| passing(numbers.vector(), centre, radius * 1.5 * numbers.unit(), &mut numbers));
    Ball::new("far", centre, radius, rays.collect())
}

/// Rays at a ball in front of them, no closer to grazing than chance has it.
pub fn ordinary(count: usize, seed: u64) -> Ball {
    let mut numbers = Numbers::new(seed);
    let (centre, radius) = (DVec3::new(0.0, 0.0, 1200.0), 100.0);
    let rays = (0..count)
        .map(|_| passing(numbers.vector() * 500.0, centre, radius * 1.5 * numbers.unit(), &mut numbers));
    Ball::new("ordinary", centre, radius, rays.collect())
}

/// The same rays with directions a thousandth as long.
pub fn short_directions(count: usize, seed: u64) -> Ball {
    let ball = ordinary(count, seed);
    let rays = ball.rays.iter().map(|r| ray(r.origin(), r.direction() * 1e-3)).collect();
    Ball { name: "short directions", rays, ..ball }
}
