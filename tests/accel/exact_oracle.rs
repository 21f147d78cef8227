//! Tests of the exact-arithmetic oracle against cases derived by hand.

use std::cmp::Ordering::{Equal, Greater, Less};

use crate::common::Numbers;
use crate::common::oracle::{
    self, Distance, Passage, f32_ulps, f64_ulps, line_box, line_sphere, line_triangle, passage,
    sign_with_root, sign_with_two_roots,
};
use glam::DVec3;
use kiln::bvh::Ray;
use num_bigint::BigInt;

/// As given: not rounded.
fn ray(origin: DVec3, direction: DVec3) -> Ray {
    Ray::unchecked(origin, direction, 0.0, f64::INFINITY)
}

fn fraction(numerator: i64, denominator: i64) -> Distance {
    Distance::fraction(numerator.into(), denominator.into(), 0)
}

/// The roots of `a x^2 + 2 b x + c`.
fn roots(a: i64, b: i64, c: i64) -> Option<[Distance; 2]> {
    Distance::roots(&a.into(), &b.into(), &c.into(), 0)
}

const UNIT: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

#[test]
fn numbers_are_taken_as_they_are() {
    // 1/3 in f64 is 6004799503160661 * 2^-54, which is short of a third.
    assert_eq!(
        Distance::exactly(1.0 / 3.0),
        Distance::fraction(6_004_799_503_160_661_i64.into(), 1.into(), -54)
    );
    assert_eq!(fraction(1, 3).compare(1.0 / 3.0), Greater);
    assert_eq!(fraction(-1, 3).compare(-1.0 / 3.0), Less);
    for x in [0.0, -0.0, 1.0, -0.1, 1e300, f64::MIN_POSITIVE, f64::from_bits(1), -f64::MAX] {
        assert_eq!(Distance::exactly(x).to_f64(), x);
        assert_eq!(Distance::exactly(x).compare(x), Equal);
        assert_eq!(Distance::exactly(x).compare(x.next_up()), Less);
        assert_eq!(Distance::exactly(x).compare(x.next_down()), Greater);
        assert_eq!(Distance::exactly(x).compare(f64::INFINITY), Less);
        assert_eq!(Distance::exactly(x).compare(f64::NEG_INFINITY), Greater);
    }
    assert_eq!(fraction(6, -4), fraction(-3, 2));
    assert_eq!(Distance::fraction(3.into(), 2.into(), 7), Distance::exactly(192.0));
}

#[test]
fn rounding_is_to_the_nearest_and_ties_go_to_even() {
    // Division of two integers that f64 holds is correctly rounded by IEEE 754.
    for (a, b) in [(1, 3), (2, 3), (-22, 7), (1, 1_000_003), (999_999_999_999_989, 3), (7, 7)] {
        assert_eq!(fraction(a, b).to_f64(), a as f64 / b as f64);
    }
    let large = 1_i64 << 53;
    assert_eq!(fraction(large + 1, 1).to_f64(), large as f64);
    assert_eq!(fraction(large + 3, 1).to_f64(), (large + 4) as f64);
    assert_eq!(fraction(-(3 * large + 4), 3).to_f64(), -((large + 2) as f64));
    assert_eq!(Distance::fraction(BigInt::from(1) << 400, BigInt::from(3) << 500, 100).to_f64(), 1.0 / 3.0);
}

#[test]
fn roots_of_quadratic_equations() {
    // x^2 - 2: the f64 next to the root of 2 is above it.
    let [low, high] = roots(1, 0, -2).unwrap();
    assert_eq!([low.to_f64(), high.to_f64()], [-std::f64::consts::SQRT_2, std::f64::consts::SQRT_2]);
    assert_eq!(high.compare(std::f64::consts::SQRT_2), Less);
    assert_eq!(high.compare(std::f64::consts::SQRT_2.next_down()), Greater);
    assert_eq!(low.compare(-std::f64::consts::SQRT_2), Greater);
    // (x - 3)^2, and (2x - 3)(2x - 5) = 4x^2 - 16x + 15.
    assert_eq!(roots(1, -3, 9).unwrap(), [fraction(3, 1), fraction(3, 1)]);
    assert_eq!(roots(4, -8, 15).unwrap(), [fraction(3, 2), fraction(5, 2)]);
    // x^2 + 1 has none.
    assert!(roots(1, 0, 1).is_none());
    // 1 - √2 and 1 + √2 around -√2 and √2: -1.414 < -0.414 < 1.414 < 2.414.
    let [low_moved, high_moved] = roots(1, -1, -1).unwrap();
    assert!(low < low_moved && low_moved < high && high < high_moved);
    // The same number by another equation: x^2 - 2 and 5x^2 - 10, and 2^20 times x^2 - 2^-39.
    assert_eq!(roots(5, 0, -10).unwrap()[1], high);
    let scaled = Distance::roots(&(BigInt::from(1) << 39), &0.into(), &(-1).into(), 20).unwrap();
    assert_eq!(scaled[1], high);
    // x^2 - 2 * 2^30 x + 1: its small root cancels to 2^-31 (1 + 2^-62 + ...).
    let [small, _] = roots(1, -(1 << 30), 1).unwrap();
    assert_eq!(small.to_f64(), 2f64.powi(-31));
    assert_eq!(small.compare(2f64.powi(-31)), Greater);
    // A root that is 0.
    assert_eq!(roots(1, -3, 0).unwrap()[0].to_f64(), 0.0);
    assert_eq!(roots(1, -3, 0).unwrap()[0].compare(0.0), Equal);
}

/// All small cases: those that f64 sees clearly, and those that are 0, which happens for whole roots only (or where the
/// two roots cancel).
#[test]
fn signs_of_sums_with_roots() {
    let whole = |q: i32| (0..=q).find(|r| r * r >= q).filter(|r| r * r == q);
    for a in -9..=9 {
        for q in 0..=20 {
            for s in [-1, 0, 1] {
                let (big_a, big_q) = (BigInt::from(a), BigInt::from(q));
                let value = f64::from(a) + f64::from(s) * f64::from(q).sqrt();
                let expected = if value.abs() < 1e-9 { 0 } else { value.signum() as i32 };
                assert_eq!(sign_with_root(&big_a, s, &big_q), expected);
                for r in 0..=20 {
                    for t in [-1, 0, 1] {
                        let sum = value + f64::from(t) * f64::from(r).sqrt();
                        let found = sign_with_two_roots(&big_a, (s, &big_q), (t, &BigInt::from(r)));
                        if sum.abs() > 1e-9 {
                            assert_eq!(found, sum.signum() as i32, "{a} {s}√{q} {t}√{r}");
                        } else {
                            let cancel = a == 0 && (s * q == -t * r);
                            let all_whole = (s == 0 || whole(q).is_some()) && (t == 0 || whole(r).is_some());
                            assert!(cancel || all_whole, "{a} {s}√{q} {t}√{r} is not 0");
                            assert_eq!(found, 0, "{a} {s}√{q} {t}√{r}");
                        }
                    }
                }
            }
        }
    }
    // Beyond f64: √(10^40 + 1) - √(10^40) is about 5e-21.
    let large = BigInt::from(10).pow(40);
    assert_eq!(sign_with_two_roots(&0.into(), (1, &(&large + 1)), (-1, &large)), 1);
    assert_eq!(sign_with_two_roots(&(-1).into(), (1, &(&large + 1)), (-1, &large)), -1);
}

#[test]
fn triangles_are_closed_and_two_sided() {
    for (x, y) in [(0.25, 0.25), (0.5, 0.5), (0.0, 0.5), (0.5, 0.0), (0.0, 0.0), (1.0, 0.0), (0.0, 1.0)] {
        for z in [2.0, -2.0, 3.0] {
            let down = ray(DVec3::new(x, y, z), DVec3::new(0.0, 0.0, -z));
            assert_eq!(oracle::triangle(&down, &UNIT), Some(Distance::exactly(1.0)), "{x} {y} {z}");
        }
    }
    // One step of f64 beside an edge, even where that is denormal.
    for (x, y) in
        [(0.5_f64.next_up(), 0.5), (-f64::from_bits(1), 0.5), (0.5, -1e-300), (1.0_f64.next_up(), 0.0)]
    {
        let down = ray(DVec3::new(x, y, 2.0), DVec3::NEG_Z);
        assert_eq!(line_triangle(&down, &UNIT), None, "{x} {y}");
    }
}

#[test]
fn a_slanted_triangle_is_met_where_it_should_be() {
    // x/3 + y/2 + z/5 = 1 is met by t (1, 1, 1) where t (1/3 + 1/2 + 1/5) = t 31/30 = 1.
    let corners = [DVec3::X * 3.0, DVec3::Y * 2.0, DVec3::Z * 5.0];
    let diagonal = ray(DVec3::ZERO, DVec3::ONE);
    assert_eq!(oracle::triangle(&diagonal, &corners), Some(fraction(30, 31)));
    assert_eq!(oracle::triangle(&diagonal, &corners).unwrap().to_f64(), 30.0 / 31.0);
    // From (0, 0, 1) along (3, 2, 1) / 1024: t/1024 (1 + 1 + 1/5) = 4/5, t = 1024 * 4 / 11.
    let other = ray(DVec3::Z, DVec3::new(3.0, 2.0, 1.0) / 1024.0);
    assert_eq!(oracle::triangle(&other, &corners), Some(fraction(4096, 11)));
    // Away from it, the line still meets it.
    let away = ray(DVec3::ZERO, DVec3::NEG_ONE);
    assert_eq!(oracle::triangle(&away, &corners), None);
    assert_eq!(line_triangle(&away, &corners), Some(fraction(-30, 31)));
}

#[test]
fn rays_in_the_plane_and_triangles_without_area_miss() {
    assert_eq!(line_triangle(&ray(DVec3::new(-1.0, 0.25, 0.0), DVec3::X), &UNIT), None);
    assert_eq!(line_triangle(&ray(DVec3::new(-1.0, 0.25, 1.0), DVec3::X), &UNIT), None);
    let p = DVec3::new(1.0, 2.0, 3.0);
    let d = DVec3::new(0.0, 1.0, 2.0);
    for flat in [[p, p, p], [p, p, p + d], [p, p + d, p + 3.0 * d], [p + d, p, p + d]] {
        for towards in [p, p + d, p + 2.0 * d, p + 0.5 * d] {
            assert_eq!(line_triangle(&ray(DVec3::ZERO, towards), &flat), None);
        }
    }
}

#[test]
fn rays_are_open_at_both_ends() {
    let down = |t_min, t_max| Ray::unchecked(DVec3::new(0.25, 0.25, 5.0), DVec3::NEG_Z, t_min, t_max);
    assert!(oracle::triangle(&down(0.0, 5.0), &UNIT).is_none());
    assert!(oracle::triangle(&down(5.0, 9.0), &UNIT).is_none());
    assert!(oracle::triangle(&down(5.0_f64.next_down(), 5.0_f64.next_up()), &UNIT).is_some());
    // The origin in the plane: t is 0.
    assert!(oracle::triangle(&ray(DVec3::new(0.25, 0.25, 0.0), DVec3::Z), &UNIT).is_none());
    let least = ray(DVec3::new(0.25, 0.25, f64::from_bits(1)), DVec3::NEG_Z);
    assert!(oracle::triangle(&least, &UNIT).is_some());
}

#[test]
fn spheres_are_met_twice_once_or_not_at_all() {
    let centre = DVec3::new(0.0, 0.0, 5.0);
    let along_z = |x: f64| ray(DVec3::new(x, 0.0, 0.0), DVec3::Z);
    // 3-4-5: passing 3 beside the centre of a ball of 5, the half chord is 4.
    assert_eq!(line_sphere(&along_z(3.0), centre, 5.0).unwrap(), [fraction(1, 1), fraction(9, 1)]);
    // Grazing, and one step of f64 to either side: the half chord is √(2^-51 - 2^-104), about 2^-25.5.
    assert_eq!(line_sphere(&along_z(2.0), centre, 2.0).unwrap(), [fraction(5, 1), fraction(5, 1)]);
    assert_eq!(line_sphere(&along_z(2.0_f64.next_up()), centre, 2.0), None);
    let [enter, leave] = line_sphere(&along_z(2.0_f64.next_down()), centre, 2.0).unwrap();
    assert!(enter < leave);
    // (2 - 2^-52)^2 = 4 - 2^-50 + 2^-104.
    let half = (2f64.powi(-50) - 2f64.powi(-104)).sqrt();
    assert!((leave.to_f64() - 5.0 - half).abs() < 1e-15 && (5.0 - half - enter.to_f64()).abs() < 1e-15);
    // From within, from the surface, from behind.
    assert_eq!(oracle::sphere(&ray(centre, DVec3::Z), centre, 2.0), Some(fraction(2, 1)));
    assert_eq!(oracle::sphere(&ray(centre - DVec3::Z * 2.0, DVec3::Z), centre, 2.0), Some(fraction(4, 1)));
    assert_eq!(oracle::sphere(&ray(centre - DVec3::Z * 2.0, DVec3::NEG_Z), centre, 2.0), None);
    assert_eq!(oracle::sphere(&ray(DVec3::Z * 9.0, DVec3::Z), centre, 2.0), None);
    // A direction of length 4.
    assert_eq!(oracle::sphere(&ray(DVec3::ZERO, DVec3::Z * 4.0), centre, 2.0), Some(fraction(3, 4)));
    // An irrational one: passing 1 beside the centre of a ball of 2, it is √3 before it.
    let exact = oracle::sphere(&along_z(1.0), centre, 2.0).unwrap();
    assert_eq!(exact.to_f64(), 5.0 - 3f64.sqrt());
    assert!(f64_ulps(5.0 - 3f64.sqrt(), &exact) == 0.0);
}

#[test]
fn a_sphere_that_touches_a_plane_is_met_at_the_same_distance() {
    // The ball of 5 around the origin touches the plane 3x + 4y = 25 at (3, 4, 0).
    let plane = [DVec3::new(3.0, 4.0, -9.0), DVec3::new(7.0, 1.0, 9.0), DVec3::new(-1.0, 7.0, 9.0)];
    let origin = DVec3::new(13.0, 5.0, 2.0);
    let touching = ray(origin, DVec3::new(3.0, 4.0, 0.0) - origin);
    let on_plane = oracle::triangle(&touching, &plane).unwrap();
    let on_ball = oracle::sphere(&touching, DVec3::ZERO, 5.0).unwrap();
    assert_eq!(on_plane, fraction(1, 1));
    assert_eq!(on_plane, on_ball);
    // A nudge of the target along the plane, and the plane comes first.
    let beside = ray(origin, DVec3::new(3.0, 4.0, 1e-12) - origin);
    assert!(oracle::triangle(&beside, &plane).unwrap() < oracle::sphere(&beside, DVec3::ZERO, 5.0).unwrap());
}

#[test]
fn boxes_are_closed() {
    let (min, max) = (DVec3::ZERO, DVec3::ONE);
    let through = line_box(&ray(DVec3::new(-1.0, 0.5, -2.0), DVec3::new(2.0, 0.0, 3.0)), min, max).unwrap();
    // x in t 1/2..1, z in t 2/3..1.
    assert_eq!(through, [fraction(2, 3), fraction(1, 1)]);
    // In a face, along an edge, through a corner only, and just beside.
    assert!(line_box(&ray(DVec3::new(0.0, 0.5, -1.0), DVec3::Z), min, max).is_some());
    assert!(line_box(&ray(DVec3::new(1.0, 1.0, -1.0), DVec3::Z), min, max).is_some());
    let corner = line_box(&ray(DVec3::new(0.0, 2.0, 0.0), DVec3::new(1.0, -1.0, 1.0)), min, max).unwrap();
    assert_eq!(corner, [fraction(1, 1), fraction(1, 1)]);
    let beside = DVec3::new(0.0, 2.0_f64.next_up(), 0.0);
    assert_eq!(line_box(&ray(beside, DVec3::new(1.0, -1.0, 1.0)), min, max), None);
    assert_eq!(line_box(&ray(DVec3::new(1.0_f64.next_up(), 0.5, -1.0), DVec3::Z), min, max), None);
    // Downwards.
    let down = line_box(&ray(DVec3::new(0.5, 0.5, 3.0), DVec3::NEG_Z), min, max).unwrap();
    assert_eq!(down, [fraction(2, 1), fraction(3, 1)]);
}

#[test]
fn ulps_are_counted() {
    assert_eq!(f32_ulps(1.5 + 3.0 * f64::from(f32::EPSILON), &Distance::exactly(1.5)), 3.0);
    assert_eq!(f64_ulps(1.5 + 2.0 * f64::EPSILON, &Distance::exactly(1.5)), 2.0);
    assert_eq!(f32_ulps(1.5, &Distance::exactly(1.5)), 0.0);
}

/// The filter's formula (signs of triple products) is not the oracle's (a point within a plane), so each checks the
/// other.
#[test]
fn what_the_filter_is_certain_of_is_so() {
    let mut numbers = Numbers::new(1);
    let mut count = [0; 3];
    for i in 0..30_000 {
        // Lattices, so that edges are met; and numbers of many sizes, moved away from the origin.
        let lattice = i % 3 == 0;
        let scale = f64::from(numbers.below(40) as i32 - 20).exp2();
        let mut vector = || {
            let v = numbers.vector();
            if lattice { (v * 4.0).round() } else { v * scale + DVec3::splat(f64::from(i % 5)) }
        };
        let (origin, a, b, c) = (vector(), vector(), vector(), vector());
        let target = match i % 4 {
            0 => a,
            1 => (a + b) / 2.0,
            2 => (a + b + c) / 3.0,
            _ => vector(),
        };
        let ray = ray(origin, target - origin);
        let (said, exact) = (passage(&ray, &[a, b, c]), line_triangle(&ray, &[a, b, c]));
        match said {
            Passage::Beside => assert_eq!(exact, None, "{ray:?} {a} {b} {c}"),
            Passage::Through => assert!(exact.is_some(), "{ray:?} {a} {b} {c}"),
            Passage::Doubtful => {}
        }
        count[said as usize] += 1;
    }
    assert!(count.iter().all(|&n| n > 1000), "{count:?}");
}
