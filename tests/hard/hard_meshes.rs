//! Triangles that share edges and corners: closed meshes do not leak (B1 to B3).
//!
//! Every tier runs by brute force and by every tree, and is compared with exact arithmetic.
//! `tests/common/hard/check.rs` states what is asserted of which tier.

use crate::common::Numbers;
use crate::common::hard::check::{
    DEFAULT_TREE, STRUCTURES, WATERTIGHT, all_structures, judge, judge_in, none_gets_out, scales_to_the_bit,
};
use crate::common::hard::rays::{At, from_around, lattice_directions, targets};
use crate::common::hard::{
    Corners, fine_ray_towards, meshes, ray, ray_towards, single, single_mesh, times_factor, triangles,
};
use glam::{DQuat, DVec3};
use kiln::bvh::detail::build;
use kiln::bvh::{Numerics, Ray, Traversal};

/// Rays from near the middle of a closed mesh at points of shared edges and corners.
fn from_inside(mesh: &[Corners], centre: DVec3, half_side: f64, count: usize, seed: u64) -> Vec<Ray> {
    let mut numbers = Numbers::new(seed);
    let aimed = targets(mesh, &At::SHARED, times_factor(count), &mut numbers);
    from_around(centre, half_side, &aimed, &mut numbers)
}

/// Closed icospheres of 5120 triangles, of several sizes and at several positions, rounded to f32; rays from inside at
/// corners, middles of edges and points of edges.
#[test]
fn b1_closed_meshes_do_not_leak() {
    for (radius, x) in [(1.0, 0.0), (1e-6, 0.0), (1e5, 0.0), (1.0, 1e3), (1.0, 1e5)] {
        let centre = DVec3::new(x, 0.0, 0.0);
        let mesh = single_mesh(&meshes::icosphere(4, centre, radius));
        let rays = from_inside(&mesh, centre, radius * 0.3, 30_000, 77);
        let what = format!("sphere of {radius} at {x}");
        none_gets_out(&what, &triangles(mesh.clone()), &rays, &WATERTIGHT, &[DEFAULT_TREE]);
        // With fewer rays, every structure.
        let few = &rays[..rays.len() / 50];
        none_gets_out(&what, &triangles(mesh), few, &WATERTIGHT, &all_structures());
    }
}

/// The same with corners and rays in f64. Rounded to f32 by a tier, the mesh is closed as well.
#[test]
fn b1_closed_meshes_of_f64_numbers_do_not_leak() {
    for (radius, x) in [(1.0, 0.0), (1e-9, 0.0), (1.0 / 3.0, 1e3), (1.0, 1e6)] {
        let centre = DVec3::new(x, x / 3.0, -x / 7.0);
        let mesh = meshes::icosphere(3, centre, radius);
        let mut numbers = Numbers::new(78);
        let aimed = targets(&mesh, &At::SHARED, times_factor(10_000), &mut numbers);
        let origins =
            aimed.iter().map(|_| centre + numbers.fine_vector() * (radius * 0.3)).collect::<Vec<_>>();
        let what = format!("f64 sphere of {radius} at {x}");
        let slots = triangles(mesh);
        let rays: Vec<Ray> =
            origins.iter().zip(&aimed).map(|(o, target)| fine_ray_towards(*o, *target)).collect();
        none_gets_out(&what, &slots, &rays, &[Numerics::Double, Numerics::Exact], &[DEFAULT_TREE]);
        judge_in(&what, &slots, &rays[..rays.len() / 50], &[Numerics::Double, Numerics::Exact], &STRUCTURES);
        // Rounded to f32, a sphere of radius 1 at a million still has its middle inside.
        let rays: Vec<Ray> = aimed.iter().map(|target| ray_towards(centre, *target)).collect();
        none_gets_out(&what, &slots, &rays, &[Numerics::Watertight], &[DEFAULT_TREE]);
    }
}

/// A smaller icosphere and a cube with integer coordinates, from inside and outside; every hit is compared.
#[test]
fn b1_hits_at_shared_points_are_the_exact_ones() {
    let sphere = single_mesh(&meshes::icosphere(2, DVec3::ZERO, 1.0));
    let cube = meshes::cube(5);
    for (what, mesh, size) in [("sphere", sphere, 1.0), ("cube", cube, 5.0)] {
        let slots = triangles(mesh.clone());
        let inside = from_inside(&mesh, DVec3::ZERO, 0.3 * size, 2500, 79);
        let summary = judge(&format!("{what} from inside"), &slots, &inside);
        assert_eq!(summary.hit, summary.rays);
        none_gets_out(what, &slots, &inside, &WATERTIGHT, &STRUCTURES);
        let mut numbers = Numbers::new(80);
        let aimed = targets(&mesh, &At::ALL, times_factor(2500), &mut numbers);
        let outside = from_around(DVec3::ZERO, 4.0 * size, &aimed, &mut numbers);
        judge(&format!("{what} from anywhere"), &slots, &outside);
    }
}

/// Rays from lattice points inside a cube with integer coordinates along all lattice directions, through corners and
/// edges.
#[test]
fn b1_lattice_rays_in_a_cube_do_not_leak() {
    let slots = triangles(meshes::cube(4));
    let mut rays = Vec::new();
    for i in 0..7 * 7 * 7 {
        let origin = DVec3::new((i % 7) as f64, (i / 7 % 7) as f64, (i / 49) as f64) - 3.0;
        rays.extend(lattice_directions().into_iter().map(|direction| ray(origin, direction)));
    }
    let summary = judge("lattice rays in a cube", &slots, &rays);
    // Integer coordinates, and directions without rounding: f64 arithmetic is exact.
    assert_eq!((summary.hit, summary.not_exact), (rays.len(), 0));
    assert!(summary.tied > rays.len() / 2);
}

/// A closed mesh and rays at its edges, scaled by powers of two.
#[test]
fn b1_scaled_by_powers_of_two_nothing_changes() {
    let mut mesh = single_mesh(&meshes::icosphere(2, DVec3::new(0.5, -0.25, 0.125), 1.0));
    mesh.extend(meshes::soup(100, 0.3, 81));
    let rays = from_inside(&mesh, DVec3::ZERO, 0.5, 600, 82);
    let slots = triangles(mesh);
    scales_to_the_bit("sphere and soup", &slots, &rays, &[-40, -20, -1, 7, 20, 40], &WATERTIGHT);
    // The tier `fast` multiplies three lengths in f32, here of at most 2^-10: at scales below about 2^-20 digits are
    // lost.
    scales_to_the_bit("sphere and soup", &slots, &rays, &[-20, -1, 7, 20, 40], &[Numerics::Fast]);
}

/// A square of two triangles, and rays through its diagonal from both sides, perpendicular and oblique, with zero
/// components of both signs.
#[test]
fn b2_the_diagonal_of_a_square_does_not_leak() {
    let p = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    let square = [[p(-1.0, -1.0), p(1.0, -1.0), p(1.0, 1.0)], [p(-1.0, -1.0), p(1.0, 1.0), p(-1.0, 1.0)]];
    let slots = triangles(square);
    let mut numbers = Numbers::new(2);
    let mut rays = Vec::new();
    for _ in 0..times_factor(5000) {
        let q = f64::from(numbers.signed() as f32);
        for side in [-5.0, 5.0] {
            for (u, v) in [(0.0, 0.0), (-0.0, 0.0), (0.0, -0.0), (-0.0, -0.0)] {
                rays.push(ray(DVec3::new(q, q, side), DVec3::new(u, v, -side.signum())));
            }
            rays.push(ray(DVec3::new(0.0, 0.0, side), DVec3::new(q, q, -side)));
        }
    }
    none_gets_out("diagonal", &slots, &rays, &WATERTIGHT, &STRUCTURES);
    let summary = judge("diagonal", &slots, &rays[..rays.len() / 10]);
    assert_eq!((summary.hit, summary.tied, summary.not_exact), (summary.rays, summary.rays, 0));
}

/// Closed double cones with 8 to 10,000 triangles at each apex; rays from inside at the apexes and at other points.
#[test]
fn b3_hubs_of_many_triangles_do_not_leak() {
    for valence in [8, 100, 1000, 10_000] {
        let mesh = meshes::bicone(valence);
        let slots = triangles(mesh.clone());
        let mut numbers = Numbers::new(3);
        let at_tip: Vec<Ray> = (0..times_factor(2000))
            .map(|i| {
                let tip = single(DVec3::new(0.0, 0.0, if i % 2 == 0 { 0.7 } else { -0.7 }));
                let origin = single(numbers.direction() * (0.2 * numbers.unit()));
                // Directions need not have length 1.
                ray(origin, tip - origin)
            })
            .collect();
        let elsewhere = from_inside(&mesh, DVec3::ZERO, 0.1, 2000, 33);
        let what = format!("bicone of {valence}");
        // A ray at the apex hits the boxes of all triangles, so trees are as slow as brute force.
        let some = at_tip.len() * 100 / valence.max(100);
        none_gets_out(&what, &slots, &at_tip[..some.max(20)], &WATERTIGHT, &[DEFAULT_TREE]);
        none_gets_out(&what, &slots, &elsewhere, &WATERTIGHT, &[DEFAULT_TREE]);
        if valence <= 1000 {
            let mut few = at_tip[..some.min(300)].to_vec();
            few.extend(&elsewhere[..some.min(300)]);
            let summary = judge(&what, &slots, &few);
            assert_eq!(summary.hit, summary.rays);
        }
    }
}

/// Closed meshes with T-vertices that triangles without area close. Of rays from inside at the split edges and at the
/// new vertices none escapes, in any tier; without those triangles some do.
#[test]
fn b1_triangles_without_area_close_t_vertices() {
    for (radius, x) in [(1.0, 0.0), (1e-6, 0.0), (1.0, 1e3)] {
        let centre = DVec3::new(x, 0.5 * x, 0.0);
        // Split along diagonals, on which the new vertices lie exactly, or up to rounding if the mesh is rotated.
        let cube = |turn: DQuat| -> Vec<Corners> {
            let place = |p: DVec3| centre + radius * (turn * p);
            meshes::cube(2).into_iter().map(|[a, b, c]| [c, a, b].map(place)).collect()
        };
        let turn = DQuat::from_rotation_x(0.7) * DQuat::from_rotation_y(1.9);
        for mesh in [cube(DQuat::IDENTITY), cube(turn), meshes::icosphere(2, centre, radius)] {
            let mesh = meshes::with_t_vertices(&single_mesh(&mesh), 5);
            let closing: Vec<Corners> = mesh.iter().copied().filter(is_sliver).collect();
            assert!(closing.len() > mesh.len() / 8, "{} of {}", closing.len(), mesh.len());
            let rays = from_inside(&closing, centre, radius * 0.3, 20_000, 79);
            let what = format!("T-vertices, size {radius} at {x}");
            none_gets_out(&what, &triangles(mesh.clone()), &rays, &WATERTIGHT, &[DEFAULT_TREE]);
            none_gets_out(
                &what,
                &triangles(mesh.clone()),
                &rays[..rays.len() / 50],
                &WATERTIGHT,
                &all_structures(),
            );
            let open = triangles(mesh.into_iter().filter(|corners| !is_sliver(corners)).collect::<Vec<_>>());
            let tree = build(open, DEFAULT_TREE, Numerics::Watertight);
            let lost = |ray: &&Ray| tree.closest_hit(ray, &mut Traversal::default()).is_none();
            assert!(rays.iter().filter(lost).count() > 0, "{what}: no gap to close");
        }
    }
}

/// Whether the corners are on a line up to rounding.
fn is_sliver([a, b, c]: &Corners) -> bool {
    let reach = a.abs().max(b.abs()).max(c.abs()).max_element();
    (*b - *a).cross(*c - *a).length() < 1e-6 * reach * (*b - *a).length()
}
