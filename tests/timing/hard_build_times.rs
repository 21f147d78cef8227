//! Hard cases, chapter C, first part: how long building takes (C1 to C3, C6).
//!
//! Bounds are the catalogue's, for a machine that is not busy: the best of five tries counts, and no two tests of this
//! file run at once. Presets that it gives no bound for are held against as many triangles at random.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::common::Numbers;
use crate::common::hard::check::{DEFAULT_TREE, all_structures, judge_in, scaled};
use crate::common::hard::rays::{At, from_around, targets};
use crate::common::hard::{meshes, ray, ray_towards, single, times_factor, tree_inputs, triangles};
use glam::DVec3;
use kiln::bvh::detail::{Layout, Slot, build};
use kiln::bvh::{Numerics, Preset, PrimId, Traversal};

/// To be held by a test while it times.
fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// How long it takes to build a tree, the best of up to five tries.
fn build_time(slots: &[Slot], preset: Preset, enough: Duration) -> Duration {
    let mut best = Duration::MAX;
    for _ in 0..5 {
        let start = Instant::now();
        build(slots.iter().copied(), Layout::Wide(preset), Numerics::Watertight);
        best = best.min(start.elapsed());
        if best < enough {
            break;
        }
    }
    best
}

/// A builder that merges one pair a round is hundreds of times slower on these than on triangles at random.
const MOST_TIMES_SLOWER: u32 = 30;

/// Builds a tree of every preset, the default one within the limit, none much slower than for as many triangles at
/// random.
fn builds_in_good_time(limit: Duration, what: &str, slots: &[Slot]) {
    let random = triangles(meshes::soup(slots.len(), 0.02, 1));
    for preset in Preset::ALL {
        let usual = build_time(&random, preset, Duration::MAX);
        let slow = usual * MOST_TIMES_SLOWER;
        let most = if preset == Preset::default() { limit.min(slow) } else { slow };
        let time = build_time(slots, preset, most);
        let [time_ms, usual_ms] = [time, usual].map(|t| t.as_millis());
        eprintln!("{what}, {preset:?}: {} triangles in {time_ms} ms, at random {usual_ms} ms", slots.len());
        assert!(time < most, "{what}, {preset:?}: {time:?}; at random {usual:?}");
    }
}

/// Set-up: 10^5 times the same triangle, built within a second in a thread with little stack; a ray at its centroid
/// finds the first.
#[test]
fn c1_coincident_triangles_build_in_good_time() {
    let _alone = alone();
    let slots = triangles(tree_inputs::coincident(100_000));
    let body = move || {
        builds_in_good_time(Duration::from_secs(1), "coincident", &slots);
        let mut traversal = Traversal::default();
        let at_centroid = [
            ray(DVec3::ZERO, DVec3::Z),
            ray(DVec3::new(1.0, 2.0, 9.0), DVec3::new(-1.0, -2.0, -4.0)),
            ray_towards(DVec3::new(-3.0, 1.0, 1.0), DVec3::new(0.0, 0.0, 5.0)),
        ];
        for tier in Numerics::STRICT {
            for structure in [Layout::BruteForce, DEFAULT_TREE] {
                let accelerator = build(slots.iter().copied(), structure, tier);
                for ray in &at_centroid {
                    let hit = accelerator.closest_hit(ray, &mut traversal).map(|hit| hit.prim);
                    assert_eq!(hit, Some(PrimId(0)), "{}, {structure:?}, {ray:?}", tier.name());
                }
            }
        }
    };
    // As little as a worker of rayon has.
    let thread = std::thread::Builder::new().stack_size(2 << 20).spawn(body).expect("a thread");
    thread.join().expect("no panic");
}

/// Set-up: 2000 times the same triangle, all hits counted, in every structure.
#[test]
fn c1_all_of_coincident_triangles_are_hit() {
    let _alone = alone();
    let slots = triangles(tree_inputs::coincident(2000));
    let mut numbers = Numbers::new(1);
    let aimed = targets(&tree_inputs::coincident(1), &[At::Inside, At::Centroid], 20, &mut numbers);
    let summary = judge_in(
        "coincident",
        &slots,
        &from_around(DVec3::ZERO, 3.0, &aimed, &mut numbers),
        &Numerics::STRICT,
        &all_structures(),
    );
    assert_eq!((summary.hit, summary.tied), (summary.rays, summary.rays));
}

/// Set-up: rows of 50 000 equal triangles at whole distances, side by side, behind each other, and as a fence.
#[test]
fn c2_rows_stacks_and_fences_build_in_good_time() {
    let _alone = alone();
    let limit = Duration::from_millis(500);
    let mut numbers = Numbers::new(2);
    for (what, mesh) in [
        ("row", tree_inputs::row(50_000, DVec3::X)),
        ("diagonal row", tree_inputs::row(50_000, DVec3::ONE)),
        ("stack", tree_inputs::row(8000, DVec3::Z)),
        ("fence", tree_inputs::fence(224)),
    ] {
        let mut rays = Vec::new();
        for target in targets(&mesh, &At::ALL, times_factor(12), &mut numbers) {
            rays.push(ray_towards(target + numbers.vector() * 20.0, target));
        }
        // Along the row, through all of it, where that is possible.
        rays.push(ray(DVec3::new(-5.0, 0.25, 0.25), DVec3::X));
        rays.push(ray(DVec3::new(0.25, 0.25, -5.0), DVec3::Z));
        let slots = triangles(mesh);
        builds_in_good_time(limit, what, &slots);
        judge_in(what, &slots, &rays, &Numerics::STRICT, &[Layout::BruteForce, DEFAULT_TREE]);
    }
}

/// Set-up: a fan of 50 000 triangles around a point, all in a plane.
#[test]
fn c3_fans_build_in_good_time() {
    let _alone = alone();
    let mesh = meshes::fan(50_000);
    let mut numbers = Numbers::new(3);
    let aimed = targets(&mesh, &At::ALL, times_factor(10), &mut numbers);
    let mut rays = from_around(DVec3::ZERO, 1.5, &aimed, &mut numbers);
    rays.push(ray_towards(DVec3::new(0.125, 0.25, 3.0), DVec3::ZERO));
    let slots = triangles(mesh);
    builds_in_good_time(Duration::from_millis(500), "fan", &slots);
    judge_in("fan", &slots, &rays, &Numerics::STRICT, &[Layout::BruteForce, DEFAULT_TREE]);
}

/// Set-up: a double cone of 50 000 triangles.
///
/// What this has found: boxes grown by a few units in the last place are still joined one pair a round where they all
/// reach from a tip to a rim and overlap. Every preset took four times as long for twice as many triangles.
#[test]
fn c3_cones_build_in_good_time() {
    let _alone = alone();
    builds_in_good_time(Duration::from_millis(500), "double cone", &triangles(meshes::bicone(25_000)));
}

/// Set-up: a sphere of 20 480 triangles, times powers of two as far as scenes are let in without being scaled.
#[test]
fn c6_every_scale_builds_in_good_time() {
    let _alone = alone();
    let large = triangles(meshes::icosphere(5, DVec3::ZERO, 1.0).iter().map(|corners| corners.map(single)));
    for exponent in (-40..=40).step_by(8) {
        let scale = f64::from(exponent).exp2();
        let scaled: Vec<Slot> = large.iter().map(|slot| scaled(slot, scale)).collect();
        let limit = Duration::from_secs(1);
        let time = build_time(&scaled, Preset::default(), limit);
        assert!(time < limit, "2^{exponent}: {time:?}");
    }
}
