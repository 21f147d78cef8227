use glam::DVec3;
use proptest::prelude::*;

use super::*;
use crate::geometry::simd::{Portable, Simd, Vector};
use crate::geometry::{AnalyticShape, Numerics};

type D = <Portable as Simd>::D;

/// What each tier says of a ray.
fn hits(disk: Disk, origin: DVec3, direction: DVec3) -> [Option<f64>; 4] {
    Numerics::ALL.map(|numerics| {
        let ray = numerics.ray_precision().ray(origin, direction, 0.0, f64::INFINITY);
        AnalyticShape::from(disk).hit(&ray, numerics)
    })
}

const UNIT: Disk = Disk { centre: DVec3::ZERO, normal: DVec3::Z, radius: 1.0 };

#[test]
fn both_sides_and_the_rim_are_hit() {
    for (x, y) in [(0.0, 0.0), (0.5, 0.25), (1.0, 0.0), (0.0, -1.0), (-0.6, 0.8f32.next_down().into())] {
        let p = DVec3::new(x, y, 0.0);
        assert_eq!(hits(UNIT, p + DVec3::Z * 2.0, DVec3::NEG_Z), [Some(2.0); 4], "{p}");
        assert_eq!(hits(UNIT, p - DVec3::Z * 2.0, DVec3::Z), [Some(2.0); 4], "{p}");
        // Behind the origin, and from the disk itself.
        assert_eq!(hits(UNIT, p + DVec3::Z * 2.0, DVec3::Z), [None; 4], "{p}");
        assert_eq!(hits(UNIT, p, DVec3::Z), [None; 4], "{p}");
    }
    for (x, y) in [(1.0f32.next_up(), 0.0), (0.8, 0.7), (-0.6, 0.8f32.next_up())] {
        let p = DVec3::new(x.into(), y.into(), 2.0);
        assert_eq!(hits(UNIT, p, DVec3::NEG_Z), [None; 4], "{p}");
    }
}

#[test]
fn a_ray_in_the_plane_or_parallel_to_it_misses() {
    for y in [0.0, 0.5, 1.0] {
        for z in [0.0, 1e-30, -1e-9] {
            assert_eq!(hits(UNIT, DVec3::new(-2.0, y, z), DVec3::X), [None; 4], "{y} {z}");
            assert_eq!(hits(UNIT, DVec3::new(0.0, y, z), DVec3::NEG_X), [None; 4], "{y} {z}");
        }
    }
}

/// A ray that descends by 2^-40 of its way from the height 2^-40 meets the plane at 1.
#[test]
fn grazing_rays_have_the_distance_of_the_plane() {
    let small = 1.0 / (1u64 << 40) as f64;
    let [_, others @ ..] = hits(UNIT, DVec3::new(-0.5, 0.25, small), DVec3::new(1.0, 0.0, -small));
    assert_eq!(others, [Some(1.0); 3]);
}

/// A disk reaches as far along an axis as its radius times the sine of the angle between axis and normal.
#[test]
fn bounds_by_hand() {
    let disk = Disk { centre: DVec3::new(1.0, 2.0, 3.0), normal: DVec3::new(0.6, 0.0, 0.8), radius: 10.0 };
    let Bounds { min, max } = AnalyticShape::from(disk).bounds();
    let expected = [DVec3::new(-7.0, -8.0, -3.0), DVec3::new(9.0, 12.0, 9.0)];
    for (found, expected) in [min, max].map(glam::Vec3::as_dvec3).into_iter().zip(expected) {
        assert!((found - expected).abs().max_element() < 1e-5, "{found} {expected}");
    }
    let Bounds { min, max } = AnalyticShape::from(UNIT).bounds();
    assert!((min.z, max.z) == (0.0, 0.0) && min.x <= -1.0 && max.y >= 1.0, "{min} {max}");
    // The farthest point along (1, 0, 1) is that of the rim; along the normal all are equally far.
    let (farthest, radius) = AnalyticShape::from(UNIT).support(DVec3::new(3.0, 0.0, 5.0));
    assert_eq!((farthest, radius), (DVec3::X, 0.0));
    assert_eq!(AnalyticShape::from(UNIT).support(DVec3::Z), (DVec3::ZERO, 0.0));
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), Just(-0.0), Just(1.0), Just(1e-9), -1.0f64..1.0, -4.0f64..4.0]
}

fn vector() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(number()).prop_map(DVec3::from)
}

proptest! {
    /// One ray and a ray in each lane have the same bits, and what is certainly behind is missed.
    #[test]
    fn lanes_are_as_one_ray(
        centre in vector(),
        normal in vector(),
        origin in vector(),
        target in prop::array::uniform2(number()),
        direction in vector(),
        aimed: bool,
        scale in -30i32..30,
    ) {
        let normal = normal.try_normalize().unwrap_or(DVec3::Y);
        let scale = f64::from(scale).exp2();
        let disk = Disk { centre: centre * scale, normal, radius: 0.7 * scale };
        let (x, y) = normal.any_orthonormal_pair();
        let on_plane = disk.centre + (x * target[0] + y * target[1]) * disk.radius;
        let direction = if aimed { on_plane - origin * scale } else { direction };
        prop_assume!(direction.length() > 0.0);
        let ray = Precision::Double.ray(origin * scale, direction.normalize(), 0.0, 1e12);
        let lanes = RayN {
            origin: ray.origin.to_array().map(D::splat),
            direction: ray.direction.to_array().map(D::splat),
            t_min: D::splat(ray.t_min),
            t_max: D::splat(ray.t_max),
        };
        let one = disk.hit_in_f64(&ray);
        let shape = AnalyticShape::from(disk);
        let each = shape.hit_n(&lanes);
        match (one, each.hit & 1 != 0) {
            _ if each.undecided & 1 != 0 => {}
            (Some(t), true) => prop_assert_eq!(t.to_bits(), each.t[0].to_bits()),
            (one, hit) => prop_assert!(one.is_none() && !hit, "{:?} {}", one, hit),
        }
        let numbers = shape.numbers();
        let behind = shape.in_lanes(|index| D::splat(numbers[index])).behind(&lanes);
        prop_assert!(behind & 1 == 0 || one.is_none());
        // Hits are within the bounds in f32, up to the rounding of the point.
        if let Some(t) = one {
            let Bounds { min, max } = shape.bounds();
            let slack = 1e-12 * (origin.length() + 4.0) * scale;
            let p = ray.at(t);
            prop_assert!((p + slack).cmpge(min.as_dvec3()).all() && (p - slack).cmple(max.as_dvec3()).all());
        }
    }
}
