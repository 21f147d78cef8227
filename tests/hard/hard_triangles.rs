//! Single triangles: slivers, no area, duplicates, giants, rays in their plane (B4 to B11). Triangles that share edges
//! are in `tests/hard/hard_meshes.rs`.
//!
//! Every tier runs by brute force and by every tree, and is compared with exact arithmetic.
//! `tests/common/hard/check.rs` states what is asserted of which tier.
//!
//! Not tested here: B10, that triangles are stored as three corners and not as a corner and two edges; the tests of
//! closed meshes (B1, B3) depend on it. B11 concerns two functions of obvhs that kiln does not use; the errors that
//! they have are tested for here.

use crate::common;
use crate::common::Numbers;
use crate::common::hard::check::{
    DEFAULT_TREE, STRUCTURES, Summary, WATERTIGHT, all_structures, judge, judge_in,
};
use crate::common::hard::rays::{At, from_around, targets};
use crate::common::hard::results::{Faults, RayResults};
use crate::common::hard::{
    Corners, meshes, placed, ray, ray_towards, single, single_mesh, times_factor, tree_inputs, triangles,
};
use glam::DVec3;
use kiln::bvh::detail::{Layout, build};
use kiln::bvh::{Numerics, PrimId, Ray, Traversal};

/// Triangles of length 1 and width 0.1 to 1e-7, around the origin and 1e4 away from it, and rays at their rounded
/// centroids. The tier `exact` decides as exact arithmetic does; the hits of the others are finite.
#[test]
fn b4_slivers_are_decided_exactly_and_give_numbers() {
    for centre in [DVec3::ZERO, DVec3::new(1e4, -1e4, 1e4)] {
        for power in [1, 3, 4, 5, 7] {
            let mesh = meshes::slivers(200, 10f64.powi(-power), centre, 3);
            let slots = triangles(mesh.clone());
            let mut numbers = Numbers::new(4);
            let aimed = targets(&mesh, &[At::Centroid, At::Edge], times_factor(1000), &mut numbers);
            let rays = from_around(centre, 3.0, &aimed, &mut numbers);
            judge(&format!("slivers of 1e-{power} at {centre}"), &slots, &rays);
            are_numbers(&slots, &rays, &STRUCTURES);
        }
    }
}

/// Every hit in every tier is at a finite distance above 0, with finite barycentrics.
fn are_numbers(slots: &[kiln::bvh::detail::Slot], rays: &[Ray], structures: &[Layout]) {
    let mut traversal = Traversal::default();
    for tier in Numerics::ALL {
        for &structure in structures {
            let accelerator = build(slots.iter().copied(), structure, tier);
            for ray in rays {
                let mut hits = Vec::new();
                accelerator.all_hits(ray, &mut hits, &mut traversal);
                for hit in hits {
                    let sound =
                        hit.t.is_finite() && hit.t > 0.0 && hit.barycentrics.iter().all(|w| w.is_finite());
                    assert!(sound, "{}, {structure:?}: {ray:?}: {hit:?}", tier.name());
                }
            }
        }
    }
}

/// Triangles without area: two or three equal corners, or corners on a line, with integer coordinates so that the line
/// is exact.
fn flat_triangles(count: usize, seed: u64) -> Vec<Corners> {
    let mut numbers = Numbers::new(seed);
    (0..count)
        .map(|i| {
            let mut whole = || (numbers.vector() * 5.0).round();
            let (p, d) = (whole(), whole());
            let mut corners = match i % 4 {
                0 => [p, p, p],
                1 => [p, p, p + d],
                2 => [p, p + d, p + d],
                _ => [p, p + d, p + 3.0 * d],
            };
            corners.rotate_left(numbers.below(3));
            corners
        })
        .collect()
}

/// Rays at triangles without area. No ray hits one in the tier `exact`, nor one with two equal corners in any
/// watertight tier, where equal corners give edge functions that cancel exactly. Every hit of the other tiers is
/// finite.
#[test]
fn b5_triangles_without_area_are_not_hit() {
    let all = flat_triangles(300, 5);
    let mut numbers = Numbers::new(55);
    let aimed = targets(&all, &[At::Corner, At::Edge, At::EdgeMiddle], times_factor(1500), &mut numbers);
    let mut rays = from_around(DVec3::ZERO, 15.0, &aimed, &mut numbers);
    let origins = rays.iter().map(|r| r.origin().round()).collect::<Vec<_>>();
    rays.extend(
        origins.into_iter().zip(&aimed).filter(|(o, p)| *o != **p).map(|(o, p)| ray(o, single(*p) - o)),
    );
    let slots = triangles(all.clone());
    let summary = judge_in("without area", &slots, &rays, &[Numerics::Exact], &STRUCTURES);
    assert_eq!(summary.hit, 0);
    are_numbers(&slots, &rays, &STRUCTURES);
    let equal = all.into_iter().filter(|[a, b, c]| a == b || b == c || c == a);
    let summary = judge("two equal corners", &triangles(equal), &rays);
    assert_eq!((summary.hit, summary.not_exact), (0, 0));
}

/// A height field, and the same with as many triangles without area among the others. Hits stay the same.
#[test]
fn b5_triangles_without_area_change_nothing_for_others() {
    let field = meshes::height_field(10, 5);
    let flat = placed(&flat_triangles(field.len(), 6), |p| p + DVec3::splat(5.0));
    let mixed: Vec<Corners> = field.iter().zip(&flat).flat_map(|(a, b)| [*a, *b]).collect();
    let mut numbers = Numbers::new(56);
    let aimed = targets(&mixed, &At::ALL, times_factor(3000), &mut numbers);
    let rays = from_around(DVec3::splat(5.0), 12.0, &aimed, &mut numbers);
    let mut traversal = Traversal::default();
    for structure in all_structures() {
        let clean = build(triangles(field.clone()), structure, Numerics::Exact);
        let dirty = build(triangles(mixed.clone()), structure, Numerics::Exact);
        let mut faults = Faults::new(format!("{structure:?}"));
        for ray in &rays {
            let expected = RayResults::of(&*clean, ray, &mut traversal);
            let mut found = RayResults::of(&*dirty, ray, &mut traversal);
            for hit in found.all.iter_mut().chain(&mut found.closest) {
                // The triangles of the field have even indices.
                hit.0 = if hit.0.0 % 2 == 0 { PrimId(hit.0.0 / 2) } else { PrimId(u32::MAX) };
            }
            faults.check(found == expected, || format!("{ray:?}: {}", found.unlike(&expected)));
        }
        faults.none();
    }
}

/// Tiles that are each present twice, with indices in reverse order. In every tier and structure the lowest index wins,
/// whatever the order of the slots.
#[test]
fn b6_of_equal_triangles_the_lowest_number_wins() {
    let mesh = meshes::doubled_tiles(16);
    let once = mesh.len() / 2;
    let mut numbers = Numbers::new(6);
    let aimed = targets(&mesh, &[At::Inside], times_factor(2000), &mut numbers);
    let rays = from_around(DVec3::new(8.0, 8.0, 10.0), 8.0, &aimed, &mut numbers);
    let forwards = triangles(mesh.clone());
    let mut shuffled = forwards.clone();
    meshes::shuffle(&mut shuffled, &mut numbers);
    let mut traversal = Traversal::default();
    for tier in Numerics::STRICT {
        for structure in all_structures() {
            let in_order = build(forwards.iter().copied(), structure, tier);
            let out_of_order = build(shuffled.iter().copied(), structure, tier);
            let mut faults = Faults::new(format!("{}, {structure:?}", tier.name()));
            for ray in &rays {
                let answer = RayResults::of(&*in_order, ray, &mut traversal);
                faults.check(answer == RayResults::of(&*out_of_order, ray, &mut traversal), || {
                    format!("{ray:?}: order")
                });
                let lowest = answer.closest.is_some_and(|(id, _)| (id.0 as usize) < once);
                faults.check(lowest, || format!("{ray:?}: {answer:?}"));
                faults.check(answer.all.len() == 2, || format!("{ray:?}: {answer:?}"));
            }
            faults.none();
        }
    }
    let summary = judge("doubled tiles", &shuffled, &rays[..rays.len() / 4]);
    assert_eq!(summary.tied, summary.rays);
}

/// Squares 1, 2, 4 and 16 f32 steps apart, in shuffled order. The tier `exact` guarantees the nearest one; the others
/// find it on these squares, too.
#[test]
fn b7_of_sheets_a_step_apart_the_nearest_is_found() {
    for steps in [1, 2, 4, 16] {
        let mesh = meshes::sheets(40, steps, 7);
        let slots = triangles(mesh.clone());
        let mut numbers = Numbers::new(77);
        let aimed = targets(&mesh, &[At::Inside, At::EdgeMiddle], times_factor(1500), &mut numbers);
        for side in [-1.0, 3.0] {
            let origins = aimed.iter().map(|_| single(DVec3::new(0.0, 0.0, side) + numbers.vector() * 0.9));
            let rays: Vec<Ray> = origins.zip(&aimed).map(|(o, target)| ray_towards(o, *target)).collect();
            judge(&format!("sheets {steps} apart from {side}"), &slots, &rays);
        }
    }
}

/// A floor of size 10^5, and rays from 200 down to 2^-14 above it, far from the origin. Distances are within one f32
/// step of the exact ones in the tier `exact`, and within four in the other tiers that compute in f64.
#[test]
fn b8_a_giant_floor_at_grazing_incidence_is_where_it_is() {
    let slots = triangles([meshes::GIANT]);
    let mut traversal = Traversal::default();
    for height in [200.0, 1.0, 1e-2, 1e-3, f64::from(-14).exp2()] {
        let mut numbers = Numbers::new(8);
        let rays: Vec<Ray> = (0..times_factor(2000))
            .map(|_| {
                let z = 90_000.0 * numbers.unit();
                // The floor's edge is at x = 10^4 (1 - (z + 10^4) / 5.5 10^4) there; targets stay well inside.
                let right = -10_000.0 + 20_000.0 * (1.0 - (z + 10_000.0) / 110_000.0);
                let x = -9_000.0 + (right - 500.0 + 9_000.0) * numbers.unit();
                let origin = DVec3::new(-9_500.0, -500.0 + height, -9_000.0);
                ray_towards(origin, DVec3::new(x.max(-9_400.0), -500.0, z))
            })
            .collect();
        judge(&format!("floor from {height}"), &slots, &rays);
        for tier in WATERTIGHT {
            let accelerator = build(slots.iter().copied(), DEFAULT_TREE, tier);
            let allowed = if tier == Numerics::Exact { 1.0 } else { 4.0 };
            let mut worst = 0.0;
            for ray in &rays {
                let exact = common::oracle::triangle(ray, &meshes::GIANT);
                let found = accelerator.closest_hit(ray, &mut traversal);
                if let (Some(exact), Some(hit)) = (exact, found) {
                    worst = f64::max(worst, common::oracle::f32_ulps(hit.t, &exact));
                }
            }
            eprintln!("floor from {height}, {}: {worst} steps of f32", tier.name());
            assert!(worst <= allowed, "floor from {height}, {}: {worst}", tier.name());
        }
    }
}

/// Rays at points of the long edge of that floor, rounded to f32, and one f32 step to either side.
#[test]
fn b8_the_edge_of_a_giant_floor_is_decided_exactly() {
    let slots = triangles([meshes::GIANT]);
    let [_, far, right] = meshes::GIANT;
    let mut numbers = Numbers::new(88);
    let mut rays = Vec::new();
    for _ in 0..times_factor(5000) {
        let target = far.lerp(right, numbers.unit());
        let direct = ray_towards(DVec3::new(0.0, -300.0, -5000.0) + numbers.vector() * 150.0, target);
        rays.push(direct);
        for axis in 0..3 {
            for up in [true, false] {
                let mut direction = direct.direction();
                let near = direction[axis] as f32;
                direction[axis] = f64::from(if up { near.next_up() } else { near.next_down() });
                rays.push(Ray::unchecked(direct.origin(), direction, direct.t_min(), direct.t_max()));
            }
        }
    }
    let summary = judge("the floor's edge", &slots, &rays);
    // About half of them on either side.
    assert!(summary.hit * 3 > summary.rays && summary.hit * 3 < summary.rays * 2, "{summary:?}");
}

/// Rays in the plane of the floor, and one f32 step above and below it. Rays in the plane miss in every tier.
#[test]
fn b9_rays_in_a_triangles_plane_miss() {
    let mut mesh = vec![meshes::GIANT];
    mesh.extend(placed(&meshes::soup(40, 0.5, 9), |p| single(DVec3::new(p.x * 400.0, -500.0, p.z * 400.0))));
    let slots = triangles(mesh.clone());
    let mut numbers = Numbers::new(9);
    let (mut within, mut beside) = (Vec::new(), Vec::new());
    for target in targets(&mesh, &At::ALL, times_factor(1000), &mut numbers) {
        let origin = single(DVec3::new(numbers.signed() * 600.0, -500.0, numbers.signed() * 600.0));
        let level = ray_towards(origin, single(target));
        within.push(level);
        let y = if numbers.below(2) == 0 { 500f32.next_up() } else { 500f32.next_down() };
        let next = DVec3::new(origin.x, -f64::from(y), origin.z);
        beside.push(Ray::unchecked(next, level.direction(), level.t_min(), level.t_max()));
        beside.push(ray(next, single(target) - next));
    }
    // Orthographic rays along z, in the plane.
    within.extend((0..512).map(|i| ray(DVec3::new(f64::from(i) - 256.0, -500.0, 0.0), DVec3::NEG_Z)));
    let summary = judge("in the plane", &slots, &within);
    assert_eq!((summary.hit, summary.not_exact), (0, 0));
    let mut traversal = Traversal::default();
    for structure in all_structures() {
        let fast = build(slots.iter().copied(), structure, Numerics::Fast);
        assert_eq!(
            within.iter().filter(|ray| fast.is_occluded(ray, &mut traversal)).count(),
            0,
            "{structure:?}"
        );
    }
    let summary = judge("beside the plane", &slots, &beside);
    assert!(summary.hit > 0);
}

/// Triangles of half sizes 0.1 to 1000 at z = 5, with a larger one behind. Distances do not depend on the size of a
/// triangle, in any tier.
#[test]
fn b11_distances_do_not_depend_on_the_size_of_a_triangle() {
    let square = |half: f64, z: f64| {
        [DVec3::new(-half, -half, z), DVec3::new(2.0 * half, -half, z), DVec3::new(-half, 2.0 * half, z)]
            .map(single)
    };
    let mut traversal = Traversal::default();
    for half in [0.1, 1.0, 10.0, 1000.0] {
        for behind in [0.1, 1.0, 10.0, 1000.0] {
            let mesh = [square(behind, 50.0), square(half, 5.0)];
            let slots = triangles(mesh);
            let mut numbers = Numbers::new(11);
            let aimed = targets(&mesh[1..], &[At::Inside], times_factor(50), &mut numbers);
            for tier in Numerics::ALL {
                for structure in STRUCTURES {
                    let accelerator = build(slots.iter().copied(), structure, tier);
                    for target in &aimed {
                        // At most 45 degrees off the normal, where f32 loses little.
                        let ray = ray_towards(
                            DVec3::new(target.x, target.y, 0.0) + numbers.vector() * 2.0,
                            *target,
                        );
                        let exact = common::oracle::triangle(&ray, &mesh[1]).expect("a hit");
                        let hit = accelerator.closest_hit(&ray, &mut traversal).expect("a hit");
                        let ulps = common::oracle::f32_ulps(hit.t, &exact);
                        assert_eq!(hit.prim, PrimId(1), "{}, {structure:?}: {ray:?}", tier.name());
                        assert!(ulps <= 4.0, "{}, {structure:?}: {ray:?}: {ulps}", tier.name());
                    }
                }
            }
        }
    }
}

/// All hard triangles of this file in one scene.
#[test]
fn b_everything_at_once_is_exact() {
    let mut mesh = single_mesh(&meshes::icosphere(1, DVec3::ZERO, 2.0));
    mesh.extend(meshes::soup(100, 0.7, 12));
    mesh.extend(meshes::slivers(50, 1e-4, DVec3::ZERO, 13));
    mesh.extend(meshes::sheets(10, 1, 14));
    mesh.extend(meshes::mixed_scales(100, 15));
    mesh.extend(tree_inputs::coincident(5));
    mesh.extend(meshes::doubled_tiles(3));
    let slots = triangles(mesh.clone());
    let mut numbers = Numbers::new(16);
    let aimed = targets(&mesh, &At::ALL, times_factor(4000), &mut numbers);
    let summary: Summary = judge("everything", &slots, &from_around(DVec3::ZERO, 4.0, &aimed, &mut numbers));
    assert!(summary.hit * 2 > summary.rays && summary.tied * 50 > summary.rays, "{summary:?}");
}
