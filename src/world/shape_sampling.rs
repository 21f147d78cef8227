//! Random points of analytic shapes as seen from a point: of a sphere uniform in the solid angle (Shirley, Wang and
//! Zimmerman, Monte Carlo Techniques for Direct Lighting Calculations, 1996; pbrt, 4th edition, section 6.2.4), of a disk
//! uniform in the area.

use std::f64::consts::PI;

use glam::DVec3;

use super::turns::sin_cos_of_turns;
use crate::bvh::detail::ORIGIN_OFFSET;
use crate::bvh::{AnalyticShape, Disk, Sphere};

/// A random point of the surface as seen from `from`: the unit direction towards it and its distance. `numbers` are in
/// [0, 1). `None` where nothing is seen.
pub(super) fn sample(shape: &AnalyticShape, from: DVec3, numbers: [f64; 2]) -> Option<(DVec3, f64)> {
    match shape {
        AnalyticShape::Sphere(sphere) => sample_sphere(sphere, from, numbers),
        AnalyticShape::Disk(disk) => sample_disk(disk, from, numbers),
        other => unreachable!("no lamp is a {}", other.name()),
    }
}

/// The reciprocal of the density per solid angle, in steradians, with which [`sample`] from `from` chooses the point of
/// the surface at `position`.
pub(super) fn sampled_solid_angle(shape: &AnalyticShape, from: DVec3, position: DVec3) -> f64 {
    match shape {
        AnalyticShape::Sphere(sphere) => solid_angle(sphere, from),
        AnalyticShape::Disk(disk) => disk_solid_angle(disk, from, position),
        other => unreachable!("no lamp is a {}", other.name()),
    }
}

fn sample_disk(disk: &Disk, from: DVec3, [x, y]: [f64; 2]) -> Option<(DVec3, f64)> {
    let (tangent, bitangent) = disk.normal.any_orthonormal_pair();
    let (sin, cos) = sin_cos_of_turns(y);
    let from_centre = (tangent * cos + bitangent * sin) * (disk.radius * x.sqrt());
    let to_point = disk.centre + from_centre - from;
    let distance = to_point.length();
    (distance > 0.0 && distance.is_finite()).then(|| (to_point / distance, distance))
}

/// The area times the cosine over the squared distance.
fn disk_solid_angle(disk: &Disk, from: DVec3, position: DVec3) -> f64 {
    let to_point = position - from;
    let distance = to_point.length();
    let cosine = (to_point / distance).dot(disk.normal).abs();
    (disk.radius / distance).powi(2) * PI * cosine
}

/// The solid angle of a sphere seen from `from`, in steradians: 4 pi from inside.
fn solid_angle(sphere: &Sphere, from: DVec3) -> f64 {
    2.0 * PI * one_minus_cos(sphere, from)
}

/// 1 minus the cosine of the half angle of the cone that holds a sphere; 2 from inside. Without cancellation for small
/// angles: sin^2 / (1 + cos). A point that is nearer to the surface than the offset of ray origins counts as inside: points
/// of the surface itself lie on either side of it by rounding.
fn one_minus_cos(sphere: &Sphere, from: DVec3) -> f64 {
    let surface = sphere.radius + ORIGIN_OFFSET * (sphere.centre.abs().max_element() + sphere.radius);
    let distance_squared = from.distance_squared(sphere.centre);
    if distance_squared <= surface * surface {
        return 2.0;
    }
    let sin2 = sphere.radius * sphere.radius / distance_squared;
    sin2 / (1.0 + (1.0 - sin2).sqrt())
}

/// A direction uniform in the solid angle, and the distance to the sphere along it. `None` where `from` is on the sphere
/// and the direction leaves it.
fn sample_sphere(sphere: &Sphere, from: DVec3, [x, y]: [f64; 2]) -> Option<(DVec3, f64)> {
    let span = one_minus_cos(sphere, from);
    let to_centre = sphere.centre - from;
    let distance = to_centre.length();
    let axis = to_centre.try_normalize().unwrap_or(DVec3::Z);
    let cos = 1.0 - span * x;
    let sin = (span * x * (2.0 - span * x)).max(0.0).sqrt();
    let (tangent, bitangent) = axis.any_orthonormal_pair();
    let (sin_angle, cos_angle) = sin_cos_of_turns(y);
    let direction = (axis * cos + (tangent * cos_angle + bitangent * sin_angle) * sin).normalize();
    // The nearer root from outside, the farther from inside. On the silhouette the half chord is 0 up to rounding.
    let half_chord = (sphere.radius * sphere.radius - distance * distance * sin * sin).max(0.0).sqrt();
    let t = distance * cos + if span < 2.0 { -half_chord } else { half_chord };
    (t > 0.0).then_some((direction, t))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sphere of radius 1 at distance 2: sin = 1/2, cos = sqrt(3)/2.
    #[test]
    fn solid_angles_by_hand() {
        let sphere = Sphere { centre: DVec3::Z * 2.0, radius: 1.0 };
        let expected = 2.0 * PI * (1.0 - 0.75f64.sqrt());
        assert!((solid_angle(&sphere, DVec3::ZERO) - expected).abs() < 1e-14);
        assert_eq!(solid_angle(&sphere, sphere.centre), 4.0 * PI);
        // Far away: pi r^2 / d^2, to the square of r / d.
        let far = Sphere { centre: DVec3::Z * 1e9, radius: 1.0 };
        assert!((solid_angle(&far, DVec3::ZERO) / (PI * 1e-18) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn sampled_points_are_on_the_sphere_and_on_the_near_side() {
        for from in [DVec3::ZERO, DVec3::new(0.3, -0.2, 2.1), DVec3::new(40.0, 3.0, -9.0)] {
            let sphere = Sphere { centre: DVec3::Z * 2.0, radius: 1.0 };
            for i in 0..256 {
                let numbers = [f64::from(i % 16) / 16.0, f64::from(i / 16) / 16.0];
                let Some((direction, t)) = sample_sphere(&sphere, from, numbers) else {
                    panic!("{from} {numbers:?}")
                };
                let point = from + direction * t;
                assert!((point.distance(sphere.centre) - 1.0).abs() < 1e-6, "{from} {numbers:?}");
                let inside = from.distance(sphere.centre) < 1.0;
                let outward = (point - sphere.centre).dot(direction);
                assert!(if inside { outward > 0.0 } else { outward < 1e-6 }, "{from} {numbers:?} {outward}");
            }
        }
    }

    /// On the axis the solid angle is 2 pi (1 - cos) of the half angle. It is the mean of the reciprocal density of
    /// samples: by the midpoint rule, to 1e-4.
    #[test]
    fn densities_integrate_to_the_solid_angle() {
        let disk =
            Disk { centre: DVec3::new(3.0, -1.0, 2.0), normal: DVec3::new(0.0, -0.6, 0.8), radius: 1.5 };
        for distance in [0.3, 2.0, 1e3] {
            for side in [1.0, -1.0] {
                let from = disk.centre + disk.normal * (side * distance);
                let (mut sum, count) = (0.0, 1 << 16);
                for i in 0..count {
                    let numbers = [(f64::from(i) + 0.5) / f64::from(count), f64::from(i) * 0.618_034 % 1.0];
                    let (direction, t) = sample(&disk.into(), from, numbers).expect("a sample");
                    let (point, _) = AnalyticShape::from(disk).surface(from + direction * t);
                    assert!((point.position - disk.centre).length() <= disk.radius * (1.0 + 1e-15));
                    assert!((point.position - from - direction * t).length() < 1e-12 * distance.max(1.0));
                    sum += sampled_solid_angle(&disk.into(), from, point.position);
                }
                let cosine = distance / distance.hypot(disk.radius);
                let expected = 2.0 * PI * (1.0 - cosine);
                let mean = sum / f64::from(count);
                assert!((mean / expected - 1.0).abs() < 1e-4, "{distance}: {mean} {expected}");
            }
        }
    }
}
