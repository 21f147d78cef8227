//! Rays in the faces of bounding boxes and at their edges and corners, and boxes without depth (A3, A6, A7).
//!
//! Every tier runs by brute force and by every tree, and is compared with exact arithmetic.
//! `tests/common/hard/check.rs` states what is asserted of which tier.

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
use kiln::bvh::detail::{Layout, build};
use kiln::bvh::{Numerics, Preset, Ray, Traversal};

/// At least half of the rays hit: the rays are aimed at what the test is about.
fn mostly_hits(summary: Summary) {
    assert!(summary.hit * 2 > summary.rays, "{summary:?}");
}

/// The least f32 number that is not below a number.
fn round_up(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) < x { nearest.next_up() } else { nearest }
}

/// Boxes with f32 corners, some without depth, with sizes and positions over six powers of ten; rays through their
/// corners, edges and faces, from random points and from points of the box. The box test accepts every box that the
/// exact ray meets before its end: it is that of the only leaf of a tree, whose triangle spans the box, and a tree
/// counts the primitives that it tests.
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
        let spanning = [min, max, DVec3::new(min.x, max.y, min.z)];
        for structure in
            [Layout::Wide, Layout::Avx2, Layout::Portable].map(|layout| layout(Preset::FastBuild))
        {
            let tree = build(triangles([spanning]), structure, Numerics::Watertight);
            for t_max in [f64::INFINITY, round_up(enter).next_up().into()] {
                let mut traversal = Traversal::default();
                tree.closest_hit(
                    &Ray::unchecked(ray.origin(), ray.direction(), ray.t_min(), t_max),
                    &mut traversal,
                );
                let is_entered = traversal.tests.primitives == 1;
                faults.check(is_entered, || format!("{ray:?}, {min} to {max}, {t_max}: {structure:?}"));
            }
        }
    }
    eprintln!("boxes: {met} met");
    faults.none();
    assert!(met > times_factor(30_000));
}

/// A height field with integer coordinates, and rays along an axis through every corner, edge, middle of an edge and
/// middle of a square: these rays run in faces of boxes, along their edges and through their corners. All numbers are
/// small integers, so f64 arithmetic is exact.
#[test]
fn a3_rays_in_faces_and_corners_of_boxes_hit() {
    let size = 16;
    let field = meshes::height_field(size, 3);
    for axis in 0..3 {
        // The height field, permuted so that heights are along the axis.
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
                judge_in(&format!("lattice {axis}"), &slots, &rays, &Numerics::STRICT, &all_structures());
            // 33 x 33 of the 35 x 35 rays are over the field.
            assert_eq!(summary.hit, 33 * 33);
            assert_eq!(summary.not_exact, 0);
        }
    }
}

/// The same field, and rays with integer origins and directions through its corners and points of its edges.
///
/// A ray in the plane of a triangle that passes beside its box must miss in brute force, too. The smallest case is the
/// ray from (21, 1, -3) along (-2, 1, 3) and the triangle (20, 6, 3), (21, 6, 2), (21, 7, 3): all three edge functions
/// are 0 exactly, but not when they are rounded.
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

/// Rays that start at corners, on edges, on faces and in the middle of boxes: those of single triangles, of pairs and
/// of the whole mesh. Directions are all lattice directions and random ones.
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

/// Triangles in planes perpendicular to an axis, whose boxes have no depth. In every tier, a ray in such a plane
/// misses, as does a parallel ray one f32 step beside it; a ray tilted by one f32 step hits the triangles that the
/// exact ray hits.
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
            let last = in_plane[in_plane.len() - 1];
            in_plane.push(Ray::unchecked(aside, last.direction(), last.t_min(), last.t_max()));
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

/// Closed boxes of 100 x 100 x 1e-4, and rays at their corners, edges and faces from outside and inside.
#[test]
fn a7_thin_boxes_are_not_missed() {
    let mesh = meshes::thin_boxes(12, 7);
    let slots = triangles(mesh.clone());
    let mut numbers = Numbers::new(77);
    let aimed = targets(&mesh, &At::ALL, times_factor(3000), &mut numbers);
    mostly_hits(judge("thin boxes", &slots, &from_around(DVec3::ZERO, 300.0, &aimed, &mut numbers)));
    // Every ray from the middle of a closed box hits.
    let from_within: Vec<Ray> = mesh
        .chunks(12)
        .flat_map(|thin| {
            let min = thin.iter().flatten().copied().reduce(DVec3::min).expect("corners");
            let max = thin.iter().flatten().copied().reduce(DVec3::max).expect("corners");
            let middle = single((min + max) / 2.0);
            // Only where rounding has not moved the middle onto a face.
            assert!(min.cmplt(middle).all() && middle.cmplt(max).all());
            let aimed = targets(thin, &At::SHARED, times_factor(600), &mut numbers);
            aimed.into_iter().map(move |target| ray_towards(middle, target)).collect::<Vec<_>>()
        })
        .collect();
    none_gets_out("within thin boxes", &slots, &from_within, &WATERTIGHT, &STRUCTURES);
}
