//! Rectangles that shine from one side, and points on them uniform in the solid angle (Ureña, Fajardo and King, An
//! Area-Preserving Parametrization for Spherical Rectangles, Computer Graphics Forum 32(4), 2013).

use std::f64::consts::PI;

use glam::DVec3;

use super::view::basis;
use crate::bvh::Mesh;

/// Solid angle in steradians below which points are sampled by area, as pbrt does below 3e-4 (4th edition, section
/// 6.5.4). The parametrisation loses digits as the solid angle falls and for thin rectangles seen from close by: down
/// to here the sampled places are off by at most 1e-6 of the solid angle (`places_divide_the_solid_angle`), at 1e-5 by
/// 2e-5 in grazing views. Where so little is seen, both densities differ little, unless the view grazes the rectangle,
/// which then gives next to no light.
const MIN_SOLID_ANGLE: f64 = 1e-3;

/// A rectangle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rectangle {
    centre: DVec3,
    /// Unit vectors along the edges.
    axes: [DVec3; 2],
    size: [f64; 2],
    /// The unit normal of the front, `axes[0] x axes[1]`.
    normal: DVec3,
}

impl Rectangle {
    /// The rectangle with a front that faces along `direction`, with width and height like those of a picture that a
    /// camera looks at in the opposite direction. `None` for a direction without length.
    pub(super) fn new(centre: DVec3, direction: DVec3, up: DVec3, size: [f64; 2]) -> Option<Self> {
        let [right, up, normal] = basis(direction, DVec3::ZERO, up)?;
        Some(Rectangle { centre, axes: [right, up], size, normal })
    }

    /// Its area.
    pub(super) fn area(&self) -> f64 {
        self.size[0] * self.size[1]
    }

    /// The corners, counterclockwise seen from the front. Their coordinates along the edges, 0 to 1, are (0, 0), (1,
    /// 0), (1, 1) and (0, 1).
    pub(super) fn corners(&self) -> [DVec3; 4] {
        let [x, y] = [0, 1].map(|k| 0.5 * self.size[k] * self.axes[k]);
        [self.centre - x - y, self.centre + x - y, self.centre + x + y, self.centre - x + y]
    }

    /// Its two triangles.
    pub(super) fn mesh(&self) -> Mesh {
        let triangles = vec![[0, 1, 2], [0, 2, 3]];
        Mesh { positions: self.corners().to_vec(), triangles, ..Mesh::default() }
    }

    /// The rectangle as seen from a point; `None` from behind, from its plane, and from where f64 does not resolve it.
    fn seen_from(&self, from: DVec3) -> Option<SeenRectangle> {
        let to_centre = self.centre - from;
        // Relative to the size of it all, so that no product overflows or vanishes.
        let unit = to_centre.abs().max_element().max(self.size[0]).max(self.size[1]);
        let along = |k: usize| {
            let (middle, half) = ((to_centre / unit).dot(self.axes[k]), 0.5 * self.size[k] / unit);
            [middle - half, middle + half]
        };
        let height = -(to_centre / unit).dot(self.normal);
        let seen = SeenRectangle { x: along(0), y: along(1), height };
        let has_area = seen.x[0] < seen.x[1] && seen.y[0] < seen.y[1];
        (height > 0.0 && unit.is_finite() && has_area).then_some(seen)
    }

    /// Samples a point as seen from `from`: its coordinates along the edges, 0 to 1. `numbers` are in [0, 1). `None`
    /// where the front is not seen.
    pub(super) fn sample(&self, from: DVec3, numbers: [f64; 2]) -> Option<[f64; 2]> {
        let seen = self.seen_from(from)?;
        Some(if seen.solid_angle() < MIN_SOLID_ANGLE { numbers } else { seen.sample(numbers) })
    }

    /// The density per solid angle with which [`Rectangle::sample`] from `from` chooses the point at `position`: 1 over
    /// the solid angle or, where that is below [`MIN_SOLID_ANGLE`], squared distance over area times cosine. Infinite
    /// where nothing is sampled.
    pub(super) fn pdf(&self, from: DVec3, position: DVec3) -> f64 {
        let Some(seen) = self.seen_from(from) else { return f64::INFINITY };
        let solid_angle = seen.solid_angle();
        if solid_angle >= MIN_SOLID_ANGLE {
            return 1.0 / solid_angle;
        }
        let to_light = position - from;
        let distance = to_light.length();
        let cosine = -(to_light / distance).dot(self.normal);
        if cosine > 0.0 { distance / cosine * (distance / self.area()) } else { f64::INFINITY }
    }
}

/// A rectangle in the coordinates of a point in front of it: along the edges, and height of the point above the plane.
#[derive(Debug, Clone, Copy)]
struct SeenRectangle {
    x: [f64; 2],
    y: [f64; 2],
    height: f64,
}

impl SeenRectangle {
    /// The solid angle in steradians: that of its two triangles (van Oosterom and Strackee, The Solid Angle of a Plane
    /// Triangle, IEEE Transactions on Biomedical Engineering 30(2), 1983). The sum of the inner angles minus 2 pi,
    /// which is the same, has no digits for small rectangles.
    fn solid_angle(&self) -> f64 {
        let SeenRectangle { x: [x0, x1], y: [y0, y1], height } = *self;
        let corner = |x: f64, y: f64| DVec3::new(x, y, height);
        let [a, b, c, d] = [corner(x0, y0), corner(x1, y0), corner(x1, y1), corner(x0, y1)];
        let volume = height * (x1 - x0) * (y1 - y0);
        let triangle = |a: DVec3, b: DVec3, c: DVec3| {
            let [la, lb, lc] = [a, b, c].map(DVec3::length);
            2.0 * libm::atan2(volume, la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
        };
        triangle(a, b, c) + triangle(a, c, d)
    }

    /// The coordinates along the edges, 0 to 1, of a point uniform in the solid angle.
    fn sample(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let SeenRectangle { x: [x0, x1], y: [y0, y1], height: z } = *self;
        // The inner angle between the edges at (x, y); its cosine is `product` over the lengths (x, z) and (y, z), its
        // sine z times the length (x, y, z) over them.
        let angle =
            |x: f64, y: f64, product: f64| libm::atan2(z * libm::hypot(libm::hypot(x, y), z), product);
        // The part of the solid angle left of the sampled x is u of the whole.
        let left = (PI - angle(x0, y1, x0 * y1)) + (PI - angle(x0, y0, -x0 * y0));
        let a = u * self.solid_angle() + left;
        // Ureña's f = (cos a b0 - b1) / sin a with b0 = -y0 / near and b1 = y1 / far, which are close to 1 in grazing
        // views: written with 1 - b0, 1 - b1 and 1 - cos a, which have no cancellation there.
        let (near, far) = (libm::hypot(y0, z), libm::hypot(y1, z));
        let below_one =
            |y: f64, length: f64| if y > 0.0 { z / length * (z / (length + y)) } else { 1.0 - y / length };
        let f = (below_one(y1, far) - below_one(-y0, near)) / libm::sin(a) + y0 / near * libm::tan(0.5 * a);
        // His x = cu z / sqrt(1 - cu^2) with cu = 1 / sqrt(f^2 + b0^2), and 1 - b0^2 = z^2 / near^2.
        let below = (f - z / near) * (f + z / near);
        let x = z.copysign(f) / below.sqrt();
        // `max` and `min` take the other number instead of a NaN.
        let x = x.max(x0).min(x1);
        let d2 = x * x + z * z;
        let (h0, h1) = (y0 / (d2 + y0 * y0).sqrt(), y1 / (d2 + y1 * y1).sqrt());
        let h = h0 + v * (h1 - h0);
        let y = h * (d2 / ((1.0 - h) * (1.0 + h))).sqrt();
        let y = y.max(y0).min(y1);
        [((x - x0) / (x1 - x0)).clamp(0.0, 1.0), ((y - y0) / (y1 - y0)).clamp(0.0, 1.0)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn unit_square(size: [f64; 2]) -> Rectangle {
        Rectangle::new(DVec3::ZERO, DVec3::Z, DVec3::Y, size).unwrap()
    }

    /// On the axis of a rectangle of 2a by 2b at the distance d, 4 asin(ab / sqrt((a^2 + d^2)(b^2 + d^2))); far away
    /// the area over the squared distance; close to its middle 2 pi.
    #[test]
    fn solid_angles_by_hand() {
        for (a, b, d) in [(1.0f64, 1.0f64, 1.0f64), (0.5, 3.0, 0.2), (1e-3, 2.0, 5.0), (7.0, 0.1, 0.3)] {
            let seen = unit_square([2.0 * a, 2.0 * b]).seen_from(DVec3::Z * d).unwrap();
            let expected = 4.0 * (a * b / ((a * a + d * d) * (b * b + d * d)).sqrt()).asin();
            assert!((seen.solid_angle() / expected - 1.0).abs() < 1e-13, "{a} {b} {d}");
        }
        let rectangle = unit_square([2.0, 3.0]);
        for far in [1e8, 1e90] {
            let solid_angle = rectangle.seen_from(DVec3::Z * far).unwrap().solid_angle();
            assert!((solid_angle / 6.0 * far * far - 1.0).abs() < 1e-14, "{far}");
        }
        let close = rectangle.seen_from(DVec3::Z * 1e-200).unwrap().solid_angle();
        assert!((close - 2.0 * PI).abs() < 1e-14);
        assert!(rectangle.seen_from(DVec3::NEG_Z).is_none() && rectangle.seen_from(DVec3::X * 9.0).is_none());
    }

    /// A side that is rounded away beside the distance to its middle: without an area there is nothing to sample.
    #[test]
    fn rectangles_without_a_seen_area_are_not_sampled() {
        let from = DVec3::new(0.5, 0.5, 1e-30);
        for size in [[1.0, 1e-30], [1e-30, 1.0]] {
            let thin = unit_square(size);
            assert!(thin.sample(from, [0.5; 2]).is_none() && thin.pdf(from, DVec3::ZERO).is_infinite());
        }
    }

    /// The solid angle of the part of a seen rectangle up to x: atan(xy / (z r)) at each corner, with alternating signs. For
    /// large solid angles it is more exact than [`SeenRectangle::solid_angle`].
    fn part(seen: &SeenRectangle, x: f64) -> f64 {
        let SeenRectangle { x: [x0, _], y: [y0, y1], height: z } = *seen;
        let corner = |x: f64, y: f64| (x * y).atan2(z * DVec3::new(x, y, z).length());
        corner(x, y1) - corner(x, y0) - corner(x0, y1) + corner(x0, y0)
    }

    /// Numbers in [0, 1), evenly spread: multiples of the powers of 1 / 1.1673, the root of x^6 = x + 1 (Roberts, The
    /// Unreasonable Effectiveness of Quasirandom Sequences, 2018), of the square root of 2 for the sixth.
    fn spread(i: u32) -> [f64; 6] {
        [0.856_675, 0.733_892, 0.628_707, 0.538_597, 0.461_403, 0.414_214]
            .map(|step| ((f64::from(i) + 0.5) * step).fract())
    }

    fn between(number: f64, from: f64, to: f64) -> f64 {
        from + (to - from) * number
    }

    /// The solid angle left of a sampled place is the first random number's share of the whole, and in the column of
    /// the place, an interval of the sphere's height over the x axis, the second is its share: from everywhere that the
    /// parametrisation is used for.
    #[test]
    fn places_divide_the_solid_angle() {
        let mut count = 0;
        for i in 0..1_000_000 {
            let [a, b, c, d, u, v] = spread(i);
            let size = [1.0, 10f64.powf(between(a, -4.0, 0.0))];
            let height = 10f64.powf(between(d, -8.0, 3.0));
            let from = DVec3::new(between(b, -2.0, 2.0), between(c, -2.0, 2.0) * size[1], height);
            let seen = unit_square(size).seen_from(from).unwrap();
            let whole = seen.solid_angle();
            if whole < MIN_SOLID_ANGLE {
                continue;
            }
            count += 1;
            let [x, y] = seen.sample([u, v]);
            // Places are rounded to 2^-53 of the rectangle, which is much as seen from right above it.
            let tolerance = 1e-6 + 1e-15 / height;
            let x = between(x, seen.x[0], seen.x[1]);
            let left = part(&seen, x) / part(&seen, seen.x[1]);
            assert!((left - u).abs() < tolerance, "{from} {size:?} {u}: {left} of {whole}");
            // The unit vector's y is uniform between those at the ends of the column.
            let unit_y = |y: f64| y / DVec3::new(x, y, seen.height).length();
            let [first, last] = seen.y.map(unit_y);
            let at = unit_y(between(y, seen.y[0], seen.y[1]));
            assert!((at - between(v, first, last)).abs() < tolerance * (last - first), "{from} {size:?} {v}");
        }
        assert!(count > 200_000, "{count}");
    }

    proptest! {
        /// Samples and densities are numbers from everywhere: at corners, edges, in the plane, a hair above it, beyond
        /// all scales; sampled places lie on the rectangle.
        #[test]
        fn samples_are_numbers(
            place in prop::array::uniform3(prop_oneof![
                Just(0.0), Just(0.5), Just(-0.5), Just(1.0), Just(5e-324), Just(1e-170), Just(-1e-17), Just(1e120),
                -2.0f64..2.0, (-300i32..300).prop_map(|e| 10f64.powi(e)),
            ]),
            size in prop::array::uniform2(prop_oneof![Just(1.0), Just(1e-100), Just(1e100), 1e-6f64..1.0]),
            scale in prop_oneof![Just(1.0), Just(1e-100), Just(1e30)],
            numbers in prop::array::uniform2(prop_oneof![Just(0.0), Just(1.0 - f64::EPSILON / 2.0), 0.0f64..1.0]),
            direction in prop::array::uniform3(-1.0f64..1.0),
        ) {
            let direction = DVec3::from(direction);
            prop_assume!(direction.length() > 0.1);
            let size = size.map(|side| side * scale);
            let rectangle = Rectangle::new(DVec3::from(place) * 0.3, direction, DVec3::Y, size).unwrap();
            let [x, y] = rectangle.axes;
            let from = rectangle.centre + (x * place[0] + y * place[1] + rectangle.normal * place[2]) * scale;
            if let Some([u, v]) = rectangle.sample(from, numbers) {
                prop_assert!((0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&v), "{} {}", u, v);
                let [corner, right, _, up] = rectangle.corners();
                let position = corner + (right - corner) * u + (up - corner) * v;
                let pdf = rectangle.pdf(from, position);
                prop_assert!(pdf > 0.0, "{}", pdf);
            }
            prop_assert!(rectangle.pdf(from, from) > 0.0);
        }
    }
}
