//! Spheres with numerically hard rays (D1 to D5).
//!
//! Every tier runs by brute force and by every tree, and is compared with exact arithmetic.
//! `tests/common/hard/check.rs` states what is asserted of which tier.
//!
//! Not tested here: radii that are 0, negative or not numbers. They are left out by import, which is tested in
//! `tests/import/import.rs`.

use crate::common::hard::check::{Summary, judge, scales_to_the_bit};
use crate::common::hard::spheres::{self, Ball};
use crate::common::hard::{ball, numbered, times_factor};
use kiln::bvh::Numerics;

fn judged(ball_and_rays: &Ball) -> Summary {
    let Ball { name, centre, radius, rays } = ball_and_rays;
    let summary = judge(name, &numbered([ball(*centre, *radius)]), rays);
    assert!(summary.ulps.iter().all(|ulps| *ulps <= 1.0), "{name}: {summary:?}");
    summary
}

/// Rays that pass within 1e-4 and 1e-7 of the radius, on both sides.
#[test]
fn d1_grazing_rays_are_decided_exactly() {
    for relative in [1e-4, 1e-7] {
        let summary = judged(&spheres::grazing(times_factor(8000), relative, 12));
        assert!(summary.hit * 3 > summary.rays && summary.hit * 3 < summary.rays * 2, "{summary:?}");
    }
}

/// Rays that touch a sphere exactly, and one f32 step to either side. A tangent ray hits.
#[test]
fn d1_touching_is_a_hit() {
    let summary = judged(&spheres::touching(times_factor(6000), 12));
    // Those that touch, and those moved inwards.
    assert!(summary.hit * 3 > summary.rays && summary.hit < summary.rays, "{summary:?}");
}

/// A sphere of radius 1e-3 at a distance of 1e4.
#[test]
fn d2_a_tiny_sphere_is_decided_exactly() {
    let summary = judged(&spheres::tiny(times_factor(6000), 12));
    assert!(summary.hit > summary.rays / 10 && summary.hit < summary.rays / 2, "{summary:?}");
}

/// A sphere of radius 1e5, and rays from about 1 above it.
#[test]
fn d3_a_huge_sphere_is_decided_exactly() {
    let summary = judged(&spheres::huge(times_factor(6000), 12));
    assert!(summary.hit * 2 > summary.rays, "{summary:?}");
}

/// Rays that start on the surface, exactly or rounded to f32, in all directions, tangents included.
#[test]
fn d4_rays_from_the_surface_are_decided_exactly() {
    let summary = judged(&spheres::on_surface(times_factor(6000), 12));
    assert!(summary.hit > summary.rays / 4 && summary.hit < summary.rays * 3 / 4, "{summary:?}");
}

/// Rays that start inside: each of them hits, once.
#[test]
fn d5_every_ray_from_inside_hits() {
    let summary = judged(&spheres::inside(times_factor(6000), 12));
    assert_eq!((summary.hit, summary.not_exact), (summary.rays, 0));
}

/// Random rays, rays from a distance of a million, and rays with directions of length 1e-3.
#[test]
fn d_ordinary_far_and_short_rays_are_decided_exactly() {
    for case in [
        spheres::ordinary(times_factor(4000), 12),
        spheres::far(times_factor(4000), 12),
        spheres::short_directions(times_factor(4000), 12),
    ] {
        let summary = judged(&case);
        assert!(summary.hit * 2 > summary.rays, "{}: {summary:?}", case.name);
    }
}

/// The hardest of these, scaled by powers of two.
#[test]
fn d_scaled_by_powers_of_two_nothing_changes() {
    for case in [spheres::grazing(300, 1e-7, 13), spheres::on_surface(300, 13), spheres::touching(300, 13)] {
        let slots = numbered([ball(case.centre, case.radius)]);
        scales_to_the_bit(case.name, &slots, &case.rays, &[-20, -1, 7, 20], &Numerics::ALL);
    }
}
