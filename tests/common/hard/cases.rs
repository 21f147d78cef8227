//! Single rays and primitives in f64, chosen so that rounded arithmetic cannot decide them.

use glam::DVec3;
use kiln::bvh::Ray;
use kiln::bvh::detail::Precision;

use super::Corners;
use crate::common::Numbers;

/// Kinds of numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// Whole numbers from -4 to 4, times a power of two: exact zeros everywhere.
    Lattice(f64),
    /// f64 numbers from -1 to 1.
    Unit,
    /// f64 numbers around a point far away.
    Far,
    /// f32 numbers from -1 to 1.
    Single,
    /// Numbers of one digit, powers of two apart.
    Powers,
    /// f64 numbers of sizes from 1e-60 to 1e18.
    Wild,
}

impl Kind {
    /// How many there are.
    pub const COUNT: usize = 7;

    /// Each in turn.
    pub fn nth(i: usize, numbers: &mut Numbers) -> Self {
        match i % Kind::COUNT {
            0 => Kind::Lattice(1.0),
            1 => Kind::Lattice(f64::from(numbers.below(241) as i32 - 190).exp2()),
            2 => Kind::Unit,
            3 => Kind::Far,
            4 => Kind::Single,
            5 => Kind::Powers,
            _ => Kind::Wild,
        }
    }
}

/// Whether every coordinate is 0 or from 1e-60 to 1e18 in size, which is what is let in.
pub fn is_in_domain(p: DVec3) -> bool {
    p.to_array().into_iter().all(|x| x == 0.0 || (1e-60..=1e18).contains(&x.abs()))
}

/// A power of two, from 2^-199 (above 1e-60) to 2^58 (below 1e18).
fn power(numbers: &mut Numbers) -> f64 {
    f64::from(numbers.below(258) as i32 - 199).exp2()
}

/// A point.
pub fn point(kind: Kind, numbers: &mut Numbers) -> DVec3 {
    let mut coordinate = |k: usize| match kind {
        Kind::Lattice(scale) => (numbers.below(9) as f64 - 4.0) * scale,
        Kind::Unit => numbers.fine_unit() * 2.0 - 1.0,
        Kind::Far => [1e6, -1e5 / 3.0, 1e4 / 7.0][k] + numbers.fine_unit() * 2.0 - 1.0,
        Kind::Single => f64::from(numbers.signed() as f32),
        Kind::Powers => numbers.one_of(&[-1.0, 0.0, 1.0]) * f64::from(numbers.below(80) as i32 - 40).exp2(),
        Kind::Wild => {
            let sign = numbers.one_of(&[-1.0, 1.0]);
            if numbers.below(8) == 0 {
                0.0
            } else {
                sign * (1.0 + numbers.fine_unit()) * power(numbers) * 0.5
            }
        }
    };
    DVec3::new(coordinate(0), coordinate(1), coordinate(2))
}

/// A triangle; now and then one without area.
pub fn triangle(kind: Kind, numbers: &mut Numbers) -> Corners {
    loop {
        let [a, b, c] = [(); 3].map(|()| point(kind, numbers));
        let corners = match numbers.below(12) {
            // A sliver, or without area.
            0 => [a, b, a + (b - a) * 0.5],
            1 => [a, b, nudge(b, numbers)],
            2 => [a, b, b],
            // Across an axis.
            3 => [a, DVec3::new(b.x, b.y, a.z), DVec3::new(c.x, c.y, a.z)],
            _ => [a, b, c],
        };
        if corners.into_iter().all(is_in_domain) {
            return corners;
        }
    }
}

/// A point one step of f64 away on one axis.
fn nudge(mut p: DVec3, numbers: &mut Numbers) -> DVec3 {
    let axis = numbers.below(3);
    if p[axis] != 0.0 {
        p[axis] = if numbers.below(2) == 0 { p[axis].next_up() } else { p[axis].next_down() };
    }
    p
}

/// The ray with one number of it a step of f64 off.
pub fn nudged(ray: &Ray, numbers: &mut Numbers) -> Ray {
    if numbers.below(2) == 0 {
        Ray::unchecked(nudge(ray.origin(), numbers), ray.direction(), ray.t_min(), ray.t_max())
    } else {
        Ray::unchecked(ray.origin(), nudge(ray.direction(), numbers), ray.t_min(), ray.t_max())
    }
}

/// A ray that has to do with the triangle.
pub fn aimed_ray(kind: Kind, corners: &Corners, numbers: &mut Numbers) -> Ray {
    loop {
        let turn = numbers.below(3);
        let [a, b, c] = [corners[turn], corners[(turn + 1) % 3], corners[(turn + 2) % 3]];
        let share = numbers.one_of(&[0.5, 0.25, 0.75, 1.0, 1.5, -0.5]);
        let target = match numbers.below(5) {
            0 => a,
            1 => a + (b - a) * 0.5,
            2 => a + (b - a) * share,
            3 => a + (b - a) * numbers.fine_unit(),
            _ => a + (b - a) * 0.25 + (c - a) * 0.25,
        };
        let free = point(kind, numbers);
        let in_plane = a + (b - a) * share + (c - a) * numbers.one_of(&[0.25, -0.5, 0.0]);
        let origin = match numbers.below(6) {
            0 => in_plane,
            1 => nudge(in_plane, numbers),
            // From the other side, so that the target lies in the middle.
            2 => target * 2.0 - free,
            _ => free,
        };
        let mut direction = match numbers.below(6) {
            0 => (target - origin).normalize_or_zero(),
            1 => target - nudge(origin, numbers),
            // Along the plane, or almost.
            2 => (b - a) * share + (c - a) * 0.5,
            _ => target - origin,
        };
        if numbers.below(4) == 0 {
            direction *= f64::from(numbers.below(60) as i32 - 30).exp2();
        }
        let ray = Ray::unchecked(origin, direction, 0.0, f64::INFINITY);
        let ray = if numbers.below(3) == 0 { nudged(&ray, numbers) } else { ray };
        let size = ray.direction().abs().max_element();
        if (1e-60..=1e18).contains(&size) && is_in_domain(ray.origin()) {
            return Precision::Double.ray(ray.origin(), ray.direction(), 0.0, f64::INFINITY);
        }
    }
}

/// A sphere, and a ray that touches it: exactly for the kinds of few digits, as well as rounding lets it for others.
pub fn touching_ball(kind: Kind, numbers: &mut Numbers) -> (DVec3, f64, Ray) {
    loop {
        let centre = point(kind, numbers);
        // 1, 2, 2 and 3 make a whole distance; the ray runs across it.
        let size = match kind {
            Kind::Lattice(scale) => scale,
            Kind::Wild => power(numbers),
            _ => f64::from(numbers.below(20) as i32 - 10).exp2(),
        };
        let (arm, along) = numbers.one_of(&[
            (DVec3::new(1.0, 2.0, 2.0), DVec3::new(2.0, -1.0, 0.0)),
            (DVec3::new(-2.0, 1.0, 2.0), DVec3::new(1.0, 0.0, 1.0)),
            (DVec3::new(3.0, 0.0, 0.0), DVec3::new(0.0, 1.0, -3.0)),
            (DVec3::new(0.0, 0.0, -3.0), DVec3::new(-1.0, 0.0, 0.0)),
        ]);
        let touch = centre + arm * size;
        let steps = f64::from(numbers.below(64) as u32) - 8.0;
        let direction = along * if numbers.below(2) == 0 { 1.0 } else { size };
        let origin = touch - along * (size * steps);
        let fits = is_in_domain(centre) && is_in_domain(origin) && (1e-60..1e17).contains(&size);
        if fits && (1e-60..1e18).contains(&direction.abs().max_element()) {
            return (centre, 3.0 * size, Precision::Double.ray(origin, direction, 0.0, f64::INFINITY));
        }
    }
}
