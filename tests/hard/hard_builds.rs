//! Trees of hard geometry: extreme ranges of size, deep trees, cut triangles, few primitives (C4 to C11). Build times
//! are tested in `tests/timing/hard_build_times.rs`.
//!
//! Every tier runs by brute force and by every tree, and is compared with exact arithmetic.
//! `tests/common/hard/check.rs` states what is asserted of which tier.
//!
//! Not tested here:
//! - C7, boxes of 8 bits: kiln's nodes hold boxes in f32. Boxes that 8 bits would cut are traced nevertheless.
//! - C8, the contents of leaves: they are not public. Rays test that every part of a cut triangle is hit.
//! - C10: the profile of the tests has debug assertions.
//! - C11, the order of Morton codes: it affects speed only. That no triangle at the ends of their range is lost is
//!   tested.

use crate::common;
use crate::common::Numbers;
use crate::common::hard::check::{
    DEFAULT_TREE, all_structures, judge, judge_in, scaled_ray, scales_to_the_bit,
};
use crate::common::hard::rays::{At, from_around, targets};
use crate::common::hard::results::{Faults, RayResults, check_results};
use crate::common::hard::{
    Corners, ball, meshes, numbered, placed, ray, ray_towards, single, times_factor, tree_inputs, triangles,
};
use glam::DVec3;
use kiln::bvh::detail::{Layout, Slot, build};
use kiln::bvh::{Numerics, Preset, Ray};

/// Nested triangles whose sizes grow by factors of 1.01 and of 2, over 80 powers of two, and triangles of random sizes
/// over the same range.
///
/// Where a triangle is smaller than a rounding step of its distance, the signs of rounded edge functions are arbitrary:
/// brute force must not report a hit far outside the triangle's box, which trees would not test.
#[test]
fn c4_geometric_progressions_are_built_and_traced() {
    let mut numbers = Numbers::new(4);
    for (what, mesh) in [
        ("1.01^k", tree_inputs::nested(1500, 1.01, 1e-3)),
        ("2^k", tree_inputs::nested(80, 2.0, f64::from(-40).exp2())),
        ("octaves", tree_inputs::octaves(800, -40, 40, 4)),
    ] {
        let slots = triangles(mesh.clone());
        let mut rays = vec![ray(DVec3::ZERO, DVec3::Z), ray(DVec3::ZERO, -DVec3::Z)];
        for target in targets(&mesh, &At::ALL, times_factor(250), &mut numbers) {
            // From about the distance of the target from the middle.
            let size = target.abs().max_element();
            rays.push(ray_towards(target + numbers.vector() * size, target));
            rays.push(ray_towards(target * -0.5, target));
        }
        let summary = judge(what, &slots, &rays);
        assert!(summary.hit * 2 > summary.rays, "{what}: {summary:?}");
    }
}

/// Sizes from 1e-6 to 1e6 in one scene; rays at small triangles from near and from far.
#[test]
fn c4_mixed_scales_are_traced() {
    let mesh = meshes::mixed_scales(1000, 5);
    let slots = triangles(mesh.clone());
    let mut numbers = Numbers::new(5);
    let rays: Vec<Ray> = targets(&mesh, &[At::Inside, At::Edge], times_factor(1500), &mut numbers)
        .into_iter()
        .enumerate()
        .map(|(i, target)| {
            let size = target.abs().max_element() * if i % 2 == 0 { 2.0 } else { 100.0 };
            ray_towards(target + numbers.vector() * size, target)
        })
        .collect();
    judge("mixed scales", &slots, &rays);
}

/// 500 nested clusters of needles, the last 145 times as large as the first, and a small triangle in the middle: each
/// cluster is on the traversal stack while the next one is visited.
#[test]
fn c5_deep_stacks_lose_nothing() {
    for clusters in [100, 500] {
        let mesh = tree_inputs::nested_clusters(clusters);
        let slots = triangles(mesh.clone());
        let mut numbers = Numbers::new(5);
        let aimed = targets(&mesh[..1], &At::ALL, times_factor(50), &mut numbers);
        let far = 1.01f64.powi(clusters as i32) * 2.0;
        let rays: Vec<Ray> = [-1.0, 1.0]
            .into_iter()
            .flat_map(|side| {
                aimed.iter().map(move |p| ray(single(*p + DVec3::Z * (side * far)), DVec3::Z * -side))
            })
            .chain(aimed.iter().map(|p| ray_towards(DVec3::new(far, far / 3.0, far / 7.0), *p)))
            .collect();
        let summary =
            judge_in(&format!("{clusters} clusters"), &slots, &rays, &Numerics::STRICT, &all_structures());
        assert!(summary.hit * 2 > summary.rays, "{summary:?}");
    }
}

/// A mesh with spheres, scaled by powers of two from 2^-40 to 2^40, the range in which scenes are not rescaled. Hits
/// are the same, bit for bit. (The tier `fast` multiplies three lengths in f32: below 2^-34, the last digits of the
/// product are below the least f32.)
#[test]
fn c6_every_scale_that_is_let_in_is_the_same() {
    let mut primitives: Vec<_> =
        triangles(meshes::soup(300, 0.3, 6)).into_iter().map(|slot| slot.primitive).collect();
    primitives.extend([ball(DVec3::new(0.5, 0.25, 0.0), 0.25), ball(DVec3::new(-0.5, 0.0, 0.375), 0.125)]);
    let slots = numbered(primitives);
    let mut numbers = Numbers::new(6);
    let mesh = common::hard::corners_of(&slots);
    let aimed = targets(&mesh, &At::ALL, times_factor(200), &mut numbers);
    let rays = from_around(DVec3::ZERO, 2.0, &aimed, &mut numbers);
    let tiers = [Numerics::Watertight, Numerics::Double, Numerics::Exact];
    scales_to_the_bit("scales", &slots, &rays, &[-40, -27, -10, 10, 27, 40], &tiers);
    scales_to_the_bit("scales", &slots, &rays, &[-30, -20, -10, 10, 27, 40], &[Numerics::Fast]);
}

/// A mesh scaled by powers of two over the whole range that import accepts, and recentered as scenes are. Hits are
/// those of the mesh itself, with distances scaled by the same power.
#[test]
fn c6_every_scale_that_the_border_lets_in_is_brought_into_range() {
    use kiln::scene::{Mesh, Scene, Shape};
    let mesh = meshes::soup(200, 0.3, 66);
    let mut numbers = Numbers::new(66);
    let aimed = targets(&mesh, &At::ALL, times_factor(100), &mut numbers);
    let rays = from_around(DVec3::ZERO, 2.0, &aimed, &mut numbers);
    for tier in [Numerics::Watertight, Numerics::Double, Numerics::Exact] {
        let answers = RayResults::to_all(&*build(triangles(mesh.clone()), DEFAULT_TREE, tier), &rays);
        for exponent in (-199..=59).step_by(3) {
            let power = |exponent: i32| f64::from(exponent).exp2();
            let positions = mesh.iter().flatten().map(|p| *p * power(exponent)).collect();
            let indices = (0..mesh.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
            let shape = Shape::Mesh(Mesh { positions, triangles: indices, ..Mesh::default() });
            let mut scene = Scene::from_iter([shape]);
            let range = kiln::world::recenter(&mut scene);
            assert!(range.is_none_or(|range| range.middle == DVec3::ZERO));
            let scale = power(exponent) * range.map_or(1.0, |range| range.scale);
            let Shape::Mesh(moved) = &scene.objects[0].shape else { unreachable!() };
            let corners = moved.triangles.iter().map(|t| t.map(|i| moved.positions[i as usize]));
            let there = build(triangles(corners), DEFAULT_TREE, tier);
            let mut faults = Faults::new(format!("{}, 2^{exponent}", tier.name()));
            let expected: Vec<RayResults> = answers.iter().map(|answer| answer.times(scale)).collect();
            let moved: Vec<Ray> = rays.iter().map(|ray| scaled_ray(ray, scale)).collect();
            check_results("in range", &*there, &moved, &expected, &mut faults);
            faults.none();
        }
    }
}

/// Boxes with sides of 255 times a power of two, up to two f32 steps more or less, which bounds of 8 bits would cut if
/// rounded down; rays along and at their faces, edges and corners.
#[test]
fn c7_boxes_that_eight_bits_would_cut_lose_nothing() {
    let mesh = tree_inputs::extents_of_255(60, 1);
    let slots = triangles(mesh.clone());
    let mut numbers = Numbers::new(7);
    let mut rays = Vec::new();
    for target in targets(&mesh, &At::ALL, times_factor(1500), &mut numbers) {
        let mut direction = numbers.direction();
        if numbers.below(2) == 0 {
            direction = DVec3::ZERO;
            direction[numbers.below(3)] = numbers.one_of(&[-1.0, 1.0]);
        }
        let target = single(target);
        rays.push(ray(single(target - direction * 1000.0), direction));
    }
    let summary = judge("extents of 255", &slots, &rays);
    assert!(summary.hit * 3 > summary.rays, "{summary:?}");
}

/// Large triangles through many small ones, which two presets cut; rays at points all over the large ones, and along
/// lines perpendicular to an axis, where cuts are. Every preset finds every part.
#[test]
fn c8_triangles_cut_to_pieces_are_whole() {
    let mesh = tree_inputs::to_be_split(40, 2000, 8);
    let slots = triangles(mesh.clone());
    let large: Vec<Corners> = mesh.into_iter().filter(|[a, b, _]| a.distance(*b) > 10.0).collect();
    assert!(large.len() > 30);
    let split = [Layout::BruteForce, Layout::Portable(Preset::BestTrace), Layout::Wide(Preset::BestTrace)];
    // Triangles were cut: there are more slots than triangles.
    let most = build(slots.iter().copied(), split[2], Numerics::Watertight).describe().slots;
    assert!(most > slots.len(), "nothing was cut");
    let mut numbers = Numbers::new(88);
    let aimed = targets(&large, &At::ALL, times_factor(1500), &mut numbers);
    judge_in(
        "cut triangles",
        &slots,
        &from_around(DVec3::ZERO, 150.0, &aimed, &mut numbers),
        &Numerics::STRICT,
        &split,
    );
    let across: Vec<Ray> = aimed
        .into_iter()
        .map(|target| {
            let mut direction = DVec3::ZERO;
            direction[numbers.below(3)] = numbers.one_of(&[-1.0, 1.0]);
            ray(single(single(target) - direction * 256.0), direction)
        })
        .collect();
    judge_in("cut triangles, along axes", &slots, &across, &Numerics::STRICT, &split);
}

/// How many slots the preset that cuts most makes of so many primitives.
fn pieces(slots: &[Slot]) -> usize {
    build(slots.iter().copied(), Layout::Wide(Preset::BestTrace), Numerics::Watertight).describe().slots
}

/// Large triangles with integer coordinates among small ones, and rays in their planes, through them and past them.
/// Where f64 does not decide that a ray lies in the plane, every structure still gives the same result: a hit may not
/// depend on the box of the whole triangle, of which trees that cut triangles hold parts only.
#[test]
fn c8_rays_in_the_planes_of_cut_triangles_are_told_the_same() {
    let mut numbers = Numbers::new(89);
    let mut whole = |size: f64| (numbers.vector() * size).round();
    let large: Vec<Corners> = (0..40)
        .map(|_| {
            // Long and narrow: the boxes of the parts are much smaller than that of the whole.
            let end = whole(100.0);
            [end, whole(15.0) - end, whole(15.0)]
        })
        .collect();
    let mut mesh = large.clone();
    mesh.extend(meshes::soup(1500, 0.005, 90).iter().map(|corners| corners.map(|p| single(p * 100.0))));
    let slots = triangles(mesh);
    assert!(pieces(&slots) > slots.len() + 40, "hardly anything was cut");
    let rays: Vec<Ray> = (0..times_factor(8000))
        .map(|i| {
            let [a, b, c] = large[i % large.len()];
            let mut step = || f64::from(numbers.below(9) as u32) - 4.0;
            let direction = (b - a) * step() + (c - a) * (step() + 0.5) * 2.0;
            let origin = a + (b - a) * step() - direction * step();
            ray(origin, direction)
        })
        .collect();
    judge_in("in planes of cut triangles", &slots, &rays, &Numerics::STRICT, &all_structures());
}

/// 0 to 5 primitives, triangles and spheres, in every structure.
#[test]
fn c9_few_primitives_are_built_and_traced() {
    let mut primitives: Vec<_> =
        triangles(meshes::soup(4, 0.8, 9)).into_iter().map(|slot| slot.primitive).collect();
    primitives.insert(1, ball(DVec3::new(0.25, 0.0, 0.0), 0.5));
    let mut numbers = Numbers::new(9);
    let aimed = targets(&meshes::soup(4, 0.8, 9), &At::ALL, times_factor(300), &mut numbers);
    let rays = from_around(DVec3::ZERO, 2.0, &aimed, &mut numbers);
    for count in 0..=5 {
        let slots = numbered(primitives[..count].iter().copied());
        let summary =
            judge_in(&format!("{count} primitives"), &slots, &rays, &Numerics::STRICT, &all_structures());
        assert_eq!(summary.hit > 0, count > 0);
    }
}

/// A grid of triangles with centroids at both ends of their range on every axis, at the origin and at a million.
#[test]
fn c11_the_ends_of_the_range_of_middles_are_not_lost() {
    for offset in [DVec3::ZERO, DVec3::splat(1e6)] {
        let corner = |i: usize| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64) * 64.0;
        let mut mesh: Vec<Corners> = (0..8)
            .map(|i| [DVec3::ZERO, DVec3::X, DVec3::Y].map(|p| single(p + corner(i) + offset)))
            .collect();
        let within = placed(&meshes::soup(500, 0.5, 11), |p| single(p.abs() * 32.0 + 16.0 + offset));
        mesh.extend(within);
        let slots = triangles(mesh.clone());
        let mut numbers = Numbers::new(11);
        let mut aimed = targets(&mesh[..8], &At::ALL, times_factor(400), &mut numbers);
        aimed.extend(targets(&mesh, &At::ALL, times_factor(400), &mut numbers));
        let rays = from_around(offset + 32.0, 100.0, &aimed, &mut numbers);
        let summary = judge_in(
            &format!("ends of the range at {offset}"),
            &slots,
            &rays,
            &Numerics::STRICT,
            &all_structures(),
        );
        assert!(summary.hit * 2 > summary.rays, "{summary:?}");
    }
}
