//! The triangle test.
//!
//! Woop, Benthin and Wald, Watertight Ray/Triangle Intersection, JCGT 2(1) 2013, section 3, carried out in f64: the
//! vertices are sheared so that the ray is the third axis, and the hit is decided by three edge functions
//! `p.x * q.y - p.y * q.x` in the plane.
//!
//! Why f64 throughout rather than f32 with a fallback: rounding is monotone, so the rounded difference of two rounded
//! products has the sign of the exact difference or is zero. With zero on the inside, a hit between two triangles that
//! share an edge cannot be lost, in any precision; in f64 the sheared vertices are moreover within 2^-51 of exact, relative to their
//! distance along the ray, so hits are decided as for the true triangles except within that of an edge. No FMA: it would break the symmetry
//! between the two sides of an edge.

use glam::{DVec3, Vec3, Vec3A};

use super::{Bounds, Ray};

/// Three corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangle(pub [Vec3; 3]);

impl Triangle {
    /// The smallest box that holds the triangle.
    #[inline]
    pub fn bounds(&self) -> Bounds {
        let [a, b, c] = self.0.map(Vec3A::from);
        Bounds { min: a.min(b).min(c).into(), max: a.max(b).max(c).into() }
    }

    /// A vector perpendicular to the triangle; the order of the corners gives its side, twice the area its length.
    #[inline]
    pub fn normal(&self) -> DVec3 {
        let [a, b, c] = self.0.map(|p| p.as_dvec3());
        (b - a).cross(c - a)
    }
}

/// A ray made ready for triangles.
pub struct TriangleTest {
    origin: DVec3,
    /// The axis that the ray runs along most.
    along: Along,
    shear: [f64; 3],
}

/// Where a ray meets a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriangleHit {
    /// Distance along the ray.
    pub t: f64,
    /// Barycentric coordinates of the second and the third corner; the first has the rest of 1.
    pub weights: [f64; 2],
}

#[derive(Clone, Copy)]
enum Along {
    X,
    Y,
    Z,
}

impl TriangleTest {
    /// Prepares `ray`.
    #[inline]
    pub fn new(ray: &Ray) -> Self {
        let (d, length) = (ray.direction, ray.direction.abs());
        let (along, turned) = if length.x >= length.y && length.x >= length.z {
            (Along::X, DVec3::new(d.y, d.z, d.x))
        } else if length.y >= length.z {
            (Along::Y, DVec3::new(d.z, d.x, d.y))
        } else {
            (Along::Z, d)
        };
        let reciprocal = 1.0 / turned.z;
        let shear = [turned.x * reciprocal, turned.y * reciprocal, reciprocal];
        TriangleTest { origin: ray.origin, along, shear }
    }

    /// Where `ray`, for which this was made, hits the triangle within the ray's ends. Both sides count; edges and
    /// corners count; a ray in the triangle's plane does not hit.
    #[inline(always)]
    pub fn hit(&self, ray: &Ray, triangle: &Triangle) -> Option<TriangleHit> {
        let [a, b, c] = &triangle.0;
        let from_origin = |corner: &Vec3| corner.as_dvec3() - self.origin;
        let (a, b, c) = (from_origin(a), from_origin(b), from_origin(c));
        // The axes are turned so that the ray runs along the last; written out, they stay in registers.
        let turned = |v: DVec3| match self.along {
            Along::X => DVec3::new(v.y, v.z, v.x),
            Along::Y => DVec3::new(v.z, v.x, v.y),
            Along::Z => v,
        };
        let (a, b, c) = (turned(a), turned(b), turned(c));
        let sheared = |v: DVec3| (v.x - self.shear[0] * v.z, v.y - self.shear[1] * v.z);
        let ((ax, ay), (bx, by), (cx, cy)) = (sheared(a), sheared(b), sheared(c));
        // The edge functions, each proportional to the weight of the corner opposite.
        let weight_a = cx * by - cy * bx;
        let weight_b = ax * cy - ay * cx;
        let weight_c = bx * ay - by * ax;
        let inside = (weight_a >= 0.0 && weight_b >= 0.0 && weight_c >= 0.0)
            || (weight_a <= 0.0 && weight_b <= 0.0 && weight_c <= 0.0);
        let sum = weight_a + weight_b + weight_c;
        if !inside || sum == 0.0 {
            return None;
        }
        let share = 1.0 / sum;
        // A convex combination of the corners' depths: its error is relative to the triangle, not to the scene.
        let t = (weight_a * a.z + weight_b * b.z + weight_c * c.z) * share * self.shear[2];
        let t = triangle.bounds().hold(ray, t);
        (ray.t_min < t && t < ray.t_max)
            .then_some(TriangleHit { t, weights: [weight_b * share, weight_c * share] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit(triangle: &Triangle, origin: DVec3, direction: DVec3) -> Option<f64> {
        let ray = Ray::new(origin, direction, 0.0, f64::INFINITY);
        TriangleTest::new(&ray).hit(&ray, triangle).map(|hit| hit.t)
    }

    const UNIT: Triangle = Triangle([Vec3::ZERO, Vec3::X, Vec3::Y]);

    #[test]
    fn both_sides_edges_and_corners_hit() {
        for (x, y) in [(0.25, 0.25), (0.5, 0.5), (0.0, 0.5), (0.5, 0.0), (0.0, 0.0), (1.0, 0.0), (0.0, 1.0)] {
            let p = DVec3::new(x, y, 0.0);
            assert_eq!(hit(&UNIT, p + DVec3::Z * 2.0, -DVec3::Z), Some(2.0), "{p}");
            assert_eq!(hit(&UNIT, p - DVec3::Z * 2.0, DVec3::Z), Some(2.0), "{p}");
        }
        for (x, y) in [(0.5000001, 0.5), (-0.0000001, 0.5), (0.5, -0.0000001)] {
            assert_eq!(hit(&UNIT, DVec3::new(x, y, 2.0), -DVec3::Z), None);
        }
    }

    #[test]
    fn a_ray_in_the_plane_misses() {
        assert_eq!(hit(&UNIT, DVec3::new(-1.0, 0.25, 0.0), DVec3::X), None);
        assert_eq!(hit(&UNIT, DVec3::new(-1.0, 0.0, 0.0), DVec3::X), None);
    }

    #[test]
    fn the_interval_is_open_at_both_ends() {
        let test = |t_min, t_max| {
            let ray = Ray { origin: DVec3::new(0.2, 0.2, 5.0), direction: -DVec3::Z, t_min, t_max };
            TriangleTest::new(&ray).hit(&ray, &UNIT).is_some()
        };
        let [below, above] = [5.0f64.next_down(), 5.0f64.next_up()];
        assert!(!test(0.0, 5.0) && !test(5.0, 10.0) && !test(5.0, 5.0));
        assert!(test(0.0, above) && test(below, 10.0));
    }

    #[test]
    fn the_distance_to_an_axis_aligned_plane_is_exact_at_any_angle() {
        // The assignment's plane seen from 2^-14 above it: t = (y_plane - y_origin) / d_y, to 2 ulp of f64.
        let plane = Triangle([
            Vec3::new(-1e4, -500.0, -1e4),
            Vec3::new(-1e4, -500.0, 1e5),
            Vec3::new(1e4, -500.0, -1e4),
        ]);
        let origin = DVec3::new(-300.0, -500.0 + 6.103_515_625e-5, 200.0);
        for z in [1.0, 100.0, 1e4] {
            let ray =
                Ray::new(origin, (DVec3::new(-300.0, -500.0, 200.0 + z) - origin).normalize(), 0.0, 1e9);
            let t = TriangleTest::new(&ray).hit(&ray, &plane).unwrap().t;
            let exact = (-500.0 - ray.origin.y) / ray.direction.y;
            assert!((t - exact).abs() <= 2.0 * f64::EPSILON * exact, "{t} {exact}");
        }
    }

    #[test]
    fn barycentrics_find_the_corners() {
        for (k, corner) in UNIT.0.iter().enumerate() {
            let ray = Ray::new(corner.as_dvec3() + DVec3::Z, -DVec3::Z, 0.0, 2.0);
            let [v, w] = TriangleTest::new(&ray).hit(&ray, &UNIT).unwrap().weights;
            assert_eq!([1.0 - v - w, v, w][k], 1.0);
        }
    }
}
