//! Numerically hard rays (A1 to A10). Rays at the borders of boxes are in `tests/hard/hard_boxes.rs`.
//!
//! Every tier runs by brute force and by every tree, and is compared with exact arithmetic.
//! `tests/common/hard/check.rs` states what is asserted of which tier.
//!
//! Not tested here: the count of rejected rays (A8). A debug assertion rejects directions that are zero or not finite
//! where rays are made; tested is that such a ray hits nothing if it is traced.

use crate::common::Numbers;
use crate::common::hard::check::{
    DEFAULT_TREE, STRUCTURES, Summary, WATERTIGHT, all_structures, judge, judge_in, none_gets_out,
};
use crate::common::hard::rays::{At, axes_with_signed_zeros, from_around, targets};
use crate::common::hard::results::{Faults, RayResults, check_both, check_results};
use crate::common::hard::{
    Corners, ball, corners_of, meshes, numbered, placed, ray, single, single_mesh, times_factor, tree_inputs,
    triangles,
};
use glam::DVec3;
use kiln::bvh::detail::{Layout, Slot, build};
use kiln::bvh::{Numerics, PrimId, Ray, Traversal};

/// At least half of the rays hit: the rays are aimed at what the test is about.
fn mostly_hits(summary: Summary) {
    assert!(summary.hit * 2 > summary.rays, "{summary:?}");
}

/// All four combinations of signs of the two zeros of an axis-aligned direction, at an icosphere; single rays and
/// batches. The zeros of a ray's direction are positive, whatever it is made from.
#[test]
fn a1_signed_zeros_make_no_difference() {
    let slots = triangles(single_mesh(&meshes::icosphere(4, DVec3::ZERO, 1.0)));
    for tier in Numerics::ALL {
        for structure in all_structures() {
            let accelerator = build(slots.iter().copied(), structure, tier);
            let mut faults = Faults::new(format!("{}, {structure:?}", tier.name()));
            let side = if structure == Layout::BruteForce { 10 } else { 30 };
            for patterns in axes_with_signed_zeros() {
                let along = patterns[0];
                let (u, v) = (along.any_orthonormal_vector(), along.cross(along.any_orthonormal_vector()));
                let place = |k: usize| (k as f64 + 0.5) / side as f64 * 2.0 - 1.0;
                let origins =
                    (0..side * side).map(|i| u * place(i % side) + v * place(i / side) - along * 3.0);
                let first: Vec<Ray> = origins.map(|origin| ray(origin, along)).collect();
                let expected = RayResults::to_all(&*accelerator, &first);
                for direction in patterns {
                    let made: Vec<Ray> = first.iter().map(|r| ray(r.origin(), direction)).collect();
                    check_results("made", &*accelerator, &made, &expected, &mut faults);
                    assert!(made.iter().all(|ray| ray.direction().to_array().map(f64::to_bits)
                        == along.to_array().map(f64::to_bits)));
                }
                // The disc covers π/4 of the square.
                let hits = expected.iter().filter(|answer| answer.occluded).count();
                assert!(hits * 4 > 3 * expected.len(), "{hits} hits");
            }
            faults.none();
        }
    }
}

/// A wall of two triangles at distances from 10 to a million; rays along its normal at random points, on its edges and
/// on its diagonal. Every ray hits, at any distance, because two components of its direction are 0.
#[test]
fn a2_a_wall_is_not_missed_from_far_away() {
    let wall: [Corners; 2] = [
        [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0)],
        [DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0), DVec3::Y],
    ];
    let slots = triangles(wall);
    let mut numbers = Numbers::new(1);
    let special = [0.0, 0.5, f64::from(1f32.next_down()), 1.0];
    let mut places: Vec<(f64, f64)> = special.iter().flat_map(|&x| special.map(|y| (x, y))).collect();
    places.extend((0..times_factor(400)).map(|_| (numbers.unit(), numbers.unit())));
    for power in 1..=6 {
        for side in [-1.0, 1.0] {
            let z = side * 10f64.powi(power);
            let rays: Vec<Ray> =
                places.iter().map(|&(x, y)| ray(DVec3::new(x, y, z), DVec3::new(0.0, -0.0, -side))).collect();
            let what = format!("wall from {z}");
            let summary = judge(&what, &slots, &rays);
            assert_eq!(summary.hit, rays.len(), "{what}: the oracle itself misses");
            assert_eq!(summary.not_exact, 0, "{what}");
            none_gets_out(&what, &slots, &rays, &WATERTIGHT, &STRUCTURES);
            // Away from edges the tier `fast` hits, too.
            let inside: Vec<Ray> = rays
                .into_iter()
                .filter(|r| {
                    let (x, y) = (r.origin().x, r.origin().y);
                    x.min(y) > 1e-3 && x.max(y) < 0.999 && (x - y).abs() > 1e-3
                })
                .collect();
            none_gets_out(&what, &slots, &inside, &[Numerics::Fast], &STRUCTURES);
        }
    }
}

/// A small icosphere, and rays from far away along an axis, with one other component between 1e-9 and 2e-7.
#[test]
fn a4_tiny_components_lose_nothing() {
    let ball = single_mesh(&meshes::icosphere(2, DVec3::ZERO, 0.05));
    let slots = triangles(ball.clone());
    let mut numbers = Numbers::new(4);
    for component in [1e-9, 1e-8, 1e-7, 1.2e-7, 2e-7] {
        for distance in [1e4, 1e5, 1e6] {
            let rays: Vec<Ray> = targets(&ball, &[At::Inside], times_factor(200), &mut numbers)
                .into_iter()
                .map(|target| {
                    let axis = numbers.below(3);
                    let mut direction = DVec3::ZERO;
                    direction[axis] = numbers.one_of(&[-1.0, 1.0]);
                    direction[(axis + 1) % 3] = component;
                    // The origin is computed back from the rounded direction, so that the error at the target is the
                    // rounding of the origin.
                    let direction = single(direction);
                    ray(single(target - direction * distance), direction)
                })
                .collect();
            let summary = judge(&format!("component {component} from {distance}"), &slots, &rays);
            mostly_hits(summary);
        }
    }
}

/// The same rays with directions scaled by powers of two. Distances change by that power exactly.
#[test]
fn a5_the_length_of_a_direction_makes_no_difference() {
    let mut mesh = single_mesh(&meshes::icosphere(2, DVec3::ZERO, 1.0));
    mesh.extend(meshes::soup(100, 0.5, 5));
    let mut primitives: Vec<_> = triangles(mesh.clone()).into_iter().map(|slot| slot.primitive).collect();
    primitives.push(ball(DVec3::new(0.25, 0.5, -0.125), 0.5));
    let slots = numbered(primitives);
    let mut numbers = Numbers::new(5);
    let aimed = targets(&mesh, &At::ALL, times_factor(500), &mut numbers);
    let rays = from_around(DVec3::ZERO, 3.0, &aimed, &mut numbers);
    for tier in Numerics::ALL {
        for structure in [Layout::BruteForce, DEFAULT_TREE] {
            let accelerator = build(slots.iter().copied(), structure, tier);
            let alone = RayResults::to_all(&*accelerator, &rays);
            let in_batches = if tier == Numerics::Fast {
                RayResults::in_batches(&*accelerator, &rays)
            } else {
                alone.clone()
            };
            let answers = [alone, in_batches];
            for exponent in [-100, -60, -20, -1, 1, 20, 60, 100] {
                // The tier `fast` multiplies the squared length and the discriminant of a sphere, which is down to
                // 2^-48 of its squared radius for grazing rays: at 2^-60 the product underflows in f32.
                if tier == Numerics::Fast && i32::abs(exponent) > 20 {
                    continue;
                }
                let mut faults = Faults::new(format!("{}, {structure:?}, 2^{exponent}", tier.name()));
                let factor = f64::from(exponent).exp2();
                let longer: Vec<Ray> = rays.iter().map(|r| ray(r.origin(), r.direction() * factor)).collect();
                let [alone, in_batches] = answers.each_ref().map(|answers| -> Vec<RayResults> {
                    answers.iter().map(|answer| answer.times(1.0 / factor)).collect()
                });
                // Streams take lengths of 2^-10 to 2^10. Other rays are traced alone, which in `fast` may find another of
                // several hits at equal t.
                let in_batches = if i32::abs(exponent) < 10 { &in_batches } else { &alone };
                check_both("longer", &*accelerator, &longer, [&alone, in_batches], &mut faults);
                faults.none();
            }
        }
    }
}

/// Rays with directions that are zero or not finite, made without the checks of the constructor. No primitive is hit,
/// the sphere in `exact` included, and nothing panics.
#[test]
fn a8_directions_that_are_none_hit_nothing() {
    let mut primitives: Vec<_> = triangles(single_mesh(&meshes::icosphere(2, DVec3::ZERO, 1.0)))
        .into_iter()
        .map(|slot| slot.primitive)
        .collect();
    primitives.push(ball(DVec3::ZERO, 0.5));
    let slots = numbered(primitives);
    let (nan, infinite) = (f64::NAN, f64::INFINITY);
    let bad = [
        DVec3::ZERO,
        DVec3::new(nan, 0.0, 1.0),
        DVec3::new(0.0, nan, 1.0),
        DVec3::new(0.0, 1.0, nan),
        DVec3::splat(nan),
        DVec3::new(infinite, 0.0, 0.0),
        DVec3::new(0.0, -infinite, 1.0),
    ];
    let mut traversal = Traversal::default();
    for tier in Numerics::ALL {
        let mut faults = Faults::new(tier.name().to_owned());
        for structure in all_structures() {
            let accelerator = build(slots.iter().copied(), structure, tier);
            for direction in bad {
                for origin in [DVec3::ZERO, DVec3::new(0.25, 0.5, 3.0)] {
                    let ray = Ray::unchecked(origin, direction, 0.0, infinite);
                    let answer = RayResults::of(&*accelerator, &ray, &mut traversal);
                    faults
                        .check(!answer.occluded && answer.closest.is_none() && answer.all.is_empty(), || {
                            format!("{structure:?}: {ray:?}: {answer:?}")
                        });
                }
            }
        }
        faults.none();
    }
}

/// A triangle at z = 5, and rays with `t_min` or `t_max` at it, just before or just beyond.
#[test]
fn a9_rays_are_open_at_both_ends() {
    let slots = triangles(tree_inputs::coincident(1));
    let table = |before: f64, beyond: f64| {
        [
            ((0.0, 5.0), false),
            ((5.0, 10.0), false),
            ((5.0, 5.0), false),
            ((0.0, beyond), true),
            ((before, 10.0), true),
            ((before, beyond), true),
            ((beyond, 10.0), false),
            ((0.0, before), false),
            ((0.0, f64::INFINITY), true),
        ]
    };
    let mut traversal = Traversal::default();
    for tier in Numerics::ALL {
        // The ends of rays are f64, except in `fast`.
        let table = match tier {
            Numerics::Fast => table(5f32.next_down().into(), 5f32.next_up().into()),
            _ => table(5f64.next_down(), 5f64.next_up()),
        };
        for structure in all_structures() {
            let accelerator = build(slots.iter().copied(), structure, tier);
            for ((t_min, t_max), hits) in table {
                let ray = tier.precision().ray(DVec3::ZERO, DVec3::Z, t_min, t_max);
                let answer = RayResults::of(&*accelerator, &ray, &mut traversal);
                let expected = hits.then_some((PrimId(0), 5f64.to_bits()));
                let what = format!("{}, {structure:?}, {t_min} to {t_max}", tier.name());
                assert_eq!(answer.closest, expected, "{what}");
                assert_eq!(answer.all, expected.into_iter().collect::<Vec<_>>(), "{what}");
                assert_eq!(answer.occluded, hits, "{what}");
            }
        }
    }
}

/// Directions so short that distances overflow f32, and so long that they underflow.
#[test]
fn a10_distances_beyond_f32_are_right_or_no_hit_but_numbers() {
    let slots: Vec<Slot> = triangles(placed(&meshes::icosphere(1, DVec3::ZERO, 1.0), |p| {
        single(p * 100.0 + DVec3::new(1e6, 0.0, 0.0))
    }));
    let mut traversal = Traversal::default();
    for length in [1e-38, 1e-30, 1e-20, 1e20, 1e30, 1e38] {
        let length = f64::from(length as f32);
        let mut numbers = Numbers::new(10);
        let rays: Vec<Ray> = targets(&corners_of(&slots), &[At::Inside], times_factor(50), &mut numbers)
            .into_iter()
            .map(|p| ray(DVec3::new(0.0, p.y, p.z), DVec3::X * length))
            .collect();
        // The tier `exact` is right; hits of the others are within rounding error.
        let exact = judge_in("far", &slots, &rays, &[Numerics::Exact], &STRUCTURES);
        assert!(exact.hit * 10 > rays.len() * 9, "{exact:?}");
        for tier in Numerics::ALL {
            for structure in STRUCTURES {
                let accelerator = build(slots.iter().copied(), structure, tier);
                for ray in &rays {
                    let hits = RayResults::of(&*accelerator, ray, &mut traversal).all;
                    for (_, t) in hits {
                        let x = f64::from_bits(t) * length;
                        // The sphere extends from 1e6 - 100 to 1e6 + 100.
                        assert!((x - 1e6).abs() < 101.0, "{} {structure:?}: {ray:?}: {x}", tier.name());
                    }
                }
            }
        }
    }
}
