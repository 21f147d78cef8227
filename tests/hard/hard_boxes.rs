//! Hard cases, chapter A, second part: rays in faces of boxes, at their edges and corners, and boxes without depth (A3,
//! A6, A7).
//!
//! Every tier, brute force and trees, judged by exact arithmetic; `tests/common/hard/check.rs` says what is asserted of
//! which tier.

use std::cmp::Ordering;

use crate::common::Numbers;
use crate::common::hard::check::{
    STRUCTURES, Summary, WATERTIGHT, all_structures, judge, judge_in, none_gets_out,
};
use crate::common::hard::rays::{At, exactly_through, from_around, lattice, lattice_directions, targets};
use crate::common::hard::results::Faults;
use crate::common::hard::{meshes, placed, ray, ray_towards, single, times_factor, triangles};
use crate::common::oracle::line_box;
use glam::DVec3;
use kiln::bvh::{Traversal, build};
use kiln::geometry::{Beam, BoxTest, DoubleBoxTest, Numerics, Ray, SingleBoxTest, round_up};

/// At least half of the rays hit: the case is not beside the point.
fn mostly_hits(summary: Summary) {
    assert!(summary.hit * 2 > summary.rays, "{summary:?}");
}

/// Set-up: boxes of f32 numbers, some without depth, of sizes and places over six powers of ten, and rays at their
/// corners, edges and faces, from anywhere and from the box itself. A box that the exact ray meets before its end is
/// entered, and no later than it is met, up to rounding.
#[test]
fn a3_a_box_that_the_exact_ray_meets_is_entered() {
    let mut numbers = Numbers::new(33);
    let mut faults = Faults::new("boxes".to_owned());
    let mut met = 0;
    for _ in 0..times_factor(60_000) {
        let power = |numbers: &mut Numbers| 10f64.powf(3.0 * numbers.signed());
        let size = DVec3::new(numbers.unit(), numbers.unit(), numbers.unit()) * power(&mut numbers);
        let min = single(numbers.vector() * power(&mut numbers));
        let mut max = single(min + size);
        if numbers.below(4) == 0 {
            let axis = numbers.below(3);
            max[axis] = min[axis];
        }
        let mut place = || numbers.one_of(&[0.0, 1.0, 0.0, 1.0, 0.5]);
        let [on, start] = [(); 2].map(|()| min + (max - min) * DVec3::new(place(), place(), place()));
        let origin = if numbers.below(3) == 0 { start } else { numbers.vector() * power(&mut numbers) };
        if single(on) == single(origin) {
            continue;
        }
        let mut direction = (on - origin).normalize();
        if numbers.below(4) == 0 {
            direction[numbers.below(3)] = 0.0;
        }
        if direction == DVec3::ZERO {
            continue;
        }
        let ray = ray(origin, direction);
        let Some([enter, leave]) = line_box(&ray, min, max) else { continue };
        if leave.compare(0.0) == Ordering::Less {
            continue;
        }
        met += 1;
        let enter = enter.to_f64().max(0.0);
        let (min, max) = (min.as_vec3a(), max.as_vec3a());
        for t_max in [f32::INFINITY, round_up(enter).next_up()] {
            let entered = [
                SingleBoxTest::new(&ray).enters(min, max, t_max),
                DoubleBoxTest::new(&ray).enters(min, max, t_max),
                Beam::new(&[ray], t_max).and_then(|beam| beam.enters(min, max)),
            ];
            // Three roundings of f32.
            let latest = enter * (1.0 + 2.0 * f64::from(f32::EPSILON));
            let in_time = |at: &Option<f32>| at.is_some_and(|at| f64::from(at) <= latest);
            faults.check(entered.iter().all(in_time), || {
                format!("{ray:?}, {min} to {max}, {t_max}: {entered:?}")
            });
        }
    }
    eprintln!("boxes: {met} met");
    faults.none();
    assert!(met > times_factor(30_000));
}

/// Set-up: a height field of whole numbers, met along an axis at every corner, edge, middle of an edge and middle of a
/// square; so rays run in faces of boxes, along their edges and through their corners. All numbers are small whole
/// ones, so f64 decides exactly.
#[test]
fn a3_rays_in_faces_and_corners_of_boxes_hit() {
    let size = 16;
    let field = meshes::height_field(size, 3);
    for axis in 0..3 {
        // The heights turned to run along the axis.
        let turned = |p: DVec3| match axis {
            0 => DVec3::new(p.z, p.x, p.y),
            1 => DVec3::new(p.y, p.z, p.x),
            _ => p,
        };
        let slots = triangles(placed(&field, turned));
        for side in [-1.0, 1.0] {
            let mut direction = DVec3::ZERO;
            direction[axis] = -side;
            let rays = lattice(axis, 9.0 * side, (-0.5, size as f64 + 0.5), 0.5, direction);
            let summary =
                judge_in(&format!("lattice {axis}"), &slots, &rays, &Numerics::ALL, &all_structures());
            // 33 x 33 of 35 x 35 places lie over the field.
            assert_eq!(summary.hit, 33 * 33);
            assert_eq!(summary.not_exact, 0);
        }
    }
}

/// Set-up: the same field, met through its corners and points of its edges by rays of whole numbers in all directions.
///
/// What this has found: in `watertight` and `double`, brute force took a ray that runs in the plane of a triangle, and
/// past its box, for a hit, to which trees did not come. The smallest case: the ray from (21, 1, -3) along (-2, 1, 3)
/// and the triangle (20, 6, 3), (21, 6, 2), (21, 7, 3). All three edge functions are 0; as computed they were not.
#[test]
fn a3_slanted_rays_through_lattice_points_hit() {
    let field = meshes::height_field(24, 5);
    let slots = triangles(field.clone());
    let mut numbers = Numbers::new(2024);
    let aimed = targets(&field, &[At::Corner, At::EdgeMiddle], times_factor(2500), &mut numbers);
    let rays = exactly_through(&aimed, 6, 1.0, &mut numbers);
    let summary = judge("slanted lattice", &slots, &rays);
    mostly_hits(summary);
    // Many rays meet two triangles at once.
    assert!(summary.tied * 4 > summary.rays, "{summary:?}");
}

/// Set-up: rays that start at corners, on edges, on faces and in the middle of the boxes of triangles, of pairs of them
/// and of all of them; along all lattice directions and others.
#[test]
fn a6_rays_that_start_on_boxes_miss_nothing() {
    let mut mesh = meshes::height_field(6, 6);
    mesh.extend(
        placed(&meshes::soup(60, 0.8, 6), |p| p * 3.0 + 3.0).iter().map(|corners| corners.map(single)),
    );
    let slots = triangles(mesh.clone());
    let mut numbers = Numbers::new(6);
    let all: Vec<DVec3> = mesh.iter().flatten().copied().collect();
    let directions = lattice_directions();
    let rays: Vec<Ray> = (0..times_factor(4000))
        .map(|i| {
            let mut of = mesh[numbers.below(mesh.len())].to_vec();
            match i % 8 {
                0 => of.clone_from(&all),
                1..4 => of.extend(mesh[numbers.below(mesh.len())]),
                _ => {}
            }
            let min = of.iter().copied().reduce(DVec3::min).expect("corners");
            let max = of.iter().copied().reduce(DVec3::max).expect("corners");
            let mut place = || numbers.one_of(&[0.0, 0.0, 1.0, 1.0, 0.5]);
            let origin = min + (max - min) * DVec3::new(place(), place(), place());
            let direction = if i % 2 == 0 { numbers.one_of(&directions) } else { numbers.direction() };
            ray(origin, direction)
        })
        .collect();
    let summary = judge("from boxes", &slots, &rays);
    assert!(summary.hit * 3 > summary.rays, "{summary:?}");
}

/// Set-up: triangles in planes across an axis, whose boxes are flat. A ray in such a plane misses, in every tier; a ray
/// one step of f32 beside it misses too, and a ray tilted by one step meets what it should.
#[test]
fn a7_flat_boxes_are_met_and_rays_in_them_miss() {
    let mut numbers = Numbers::new(7);
    for axis in 0..3 {
        let flat = |p: DVec3| {
            let mut q = p * 4.0;
            q[axis] = 0.75;
            q
        };
        let mesh = placed(&meshes::soup(60, 0.4, 70 + axis as u64), |p| single(flat(p)));
        let slots = triangles(mesh.clone());
        let mut in_plane = Vec::new();
        let mut tilted = Vec::new();
        for target in targets(&mesh, &At::ALL, times_factor(600), &mut numbers) {
            let origin = single(flat(numbers.vector() * 2.0));
            in_plane.push(ray_towards(origin, single(target)));
            let mut aside = origin;
            let step = if numbers.below(2) == 0 { 0.75f32.next_up() } else { 0.75f32.next_down() };
            aside[axis] = f64::from(step);
            in_plane.push(Ray { origin: aside, ..in_plane[in_plane.len() - 1] });
            tilted.push(ray(aside, single(target) - aside));
        }
        let summary = judge(&format!("flat {axis}"), &slots, &in_plane);
        assert_eq!((summary.hit, summary.not_exact), (0, 0));
        judge(&format!("flat {axis}, tilted"), &slots, &tilted);
        let mut traversal = Traversal::default();
        for structure in STRUCTURES {
            let fast = build(slots.iter().copied(), structure, Numerics::Fast);
            let hits = in_plane.iter().filter(|ray| fast.is_occluded(ray, &mut traversal)).count();
            assert_eq!(hits, 0, "fast, {structure:?}");
        }
    }
}

/// Set-up: closed boxes of 100 x 100 x 1e-4, met at corners, edges and faces from outside and from within.
#[test]
fn a7_thin_boxes_are_not_missed() {
    let mesh = meshes::thin_boxes(12, 7);
    let slots = triangles(mesh.clone());
    let mut numbers = Numbers::new(77);
    let aimed = targets(&mesh, &At::ALL, times_factor(3000), &mut numbers);
    mostly_hits(judge("thin boxes", &slots, &from_around(DVec3::ZERO, 300.0, &aimed, &mut numbers)));
    // From the middle of each box, anywhere: closed.
    let from_within: Vec<Ray> = mesh
        .chunks(12)
        .flat_map(|thin| {
            let min = thin.iter().flatten().copied().reduce(DVec3::min).expect("corners");
            let max = thin.iter().flatten().copied().reduce(DVec3::max).expect("corners");
            let middle = single((min + max) / 2.0);
            // Rounding must not have put it on a face.
            assert!(min.cmplt(middle).all() && middle.cmplt(max).all());
            let aimed = targets(thin, &At::SHARED, times_factor(600), &mut numbers);
            aimed.into_iter().map(move |target| ray_towards(middle, target)).collect::<Vec<_>>()
        })
        .collect();
    none_gets_out("within thin boxes", &slots, &from_within, &WATERTIGHT, &STRUCTURES);
}
