//! Pictures are invariant to scaling and translation of the scene (H1-H3).

use crate::common;
use crate::common::picture::{Prepared, bits, equip, load, picture, placed, prepare};
use glam::DVec3;
use kiln::bvh::{Ray, Traversal};
use kiln::scene::{Numerics, Projection, Scene};

/// The assignment scene from its second viewpoint.
fn assignment(projection: Projection) -> Scene {
    let mut scene = load(&common::repository("scenes/assignment.toml"));
    scene.cameras.retain(|c| c.name == "view2");
    scene.cameras[0].projection = projection;
    scene
}

const PROJECTIONS: [Projection; 2] = [Projection::Perspective, Projection::Orthographic];

/// The bunny with a camera that fits it and a headlight.
fn bunny() -> Scene {
    let mut scene = load(&common::models().join("stanford-bunny.obj"));
    equip(&mut scene);
    scene
}

fn assert_same_when_doubled(
    scene: &Scene,
    size: [u32; 2],
    powers: impl Iterator<Item = i32>,
    numerics: Numerics,
) {
    let expected = bits(&picture(scene.clone(), size, numerics), size);
    assert!(expected.iter().any(|pixel| *pixel != expected[0]), "an empty picture");
    for power in powers {
        let scaled = placed(scene.clone(), f64::from(power).exp2(), DVec3::ZERO);
        let found = bits(&picture(scaled, size, numerics), size);
        let differ = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
        assert_eq!(differ, 0, "pixels differ at 2^{power} in {}", numerics.name());
    }
}

/// The assignment scene with its camera and lights, scaled by 2^k, k = -40 to 40: the pixels are the same bit for bit.
/// In `fast`, f32 products overflow or underflow beyond 2^±12.
#[test]
fn h1_the_assignment_scene_times_powers_of_two() {
    for projection in PROJECTIONS {
        let scene = assignment(projection);
        for numerics in Numerics::ALL {
            let most = if numerics == Numerics::Fast { 12 } else { 40 };
            assert_same_when_doubled(&scene, [128, 128], -most..=most, numerics);
        }
    }
}

/// The same for the bunny.
#[test]
#[ignore = "needs KILN_MODELS"]
fn with_models_h1_the_bunny_times_powers_of_two() {
    let scene = bunny();
    assert_same_when_doubled(&scene, [128, 128], -40..=40, Numerics::Watertight);
    for numerics in [Numerics::Fast, Numerics::Double, Numerics::Exact] {
        let far: &[i32] = if numerics == Numerics::Fast { &[-12, 12] } else { &[-40, -21, 21, 40] };
        assert_same_when_doubled(&scene, [128, 128], far.iter().copied(), numerics);
    }
}

/// Parallel rays around a ray, at the distance `aside` from it.
fn beside(ray: &Ray, aside: f64) -> impl Iterator<Item = Ray> + '_ {
    let (u, v) = ray.direction().normalize().any_orthonormal_pair();
    (0..16).map(move |i| {
        let (sine, cosine) = (f64::from(i) * std::f64::consts::TAU / 16.0).sin_cos();
        let origin = ray.origin() + aside * (cosine * u + sine * v);
        Ray::unchecked(origin, ray.direction(), ray.t_min(), ray.t_max())
    })
}

/// Whether a ray, moved by up to `aside`, both hits and misses.
fn grazes(prepared: &Prepared, ray: &Ray, aside: f64) -> bool {
    let mut traversal = Traversal::default();
    let mut hits = |ray: &Ray| prepared.world.accelerator.closest_hit(ray, &mut traversal).is_some();
    let first = hits(ray);
    [1.0, 0.5, 0.25].iter().any(|share| beside(ray, share * aside).any(|ray| hits(&ray) != first))
}

/// Bound of the displacement between a scene of this size and its rays by rounding to f32: half a step per axis for
/// corners and for ray origins, and half a step of the direction over at most twice the size of the scene.
fn single_bound(reach: f64) -> f64 {
    (1.0 + 1.0 + 2.0) * 3f64.sqrt() * reach * f64::from(f32::EPSILON) / 2.0
}

fn assert_same_mask(scene: &Scene, size: [u32; 2], scale: f64, offset: DVec3, what: &str) {
    let mask = |scene: &Scene, numerics| -> (Prepared, Vec<bool>) {
        let prepared = prepare(scene.clone(), size, numerics);
        let mask = prepared.hits().iter().map(Option::is_some).collect();
        (prepared, mask)
    };
    let (_, expected) = mask(scene, Numerics::Double);
    assert!(expected.contains(&true) && expected.contains(&false), "{what}: the mask says nothing");
    let placed = placed(scene.clone(), scale, offset);
    let (fine, double) = mask(&placed, Numerics::Double);
    let differ = double.iter().zip(&expected).filter(|(a, b)| a != b).count();
    assert_eq!(differ, 0, "{what}: pixels of the mask differ in double");
    assert_eq!(mask(&placed, Numerics::Exact).1, expected, "{what}: exact");

    let (_, single) = mask(&placed, Numerics::Watertight);
    let mut moved = placed.clone();
    kiln::world::recenter(&mut moved);
    let (min, max) = moved.bounds().expect("a scene with bounds");
    let reach = min.abs().max(max.abs()).max(moved.cameras[0].position.abs()).length();
    let rays = fine.rays();
    let mut differ = 0;
    for ((ray, single), double) in rays.iter().zip(&single).zip(&double) {
        if single != double {
            differ += 1;
            assert!(
                grazes(&fine, ray, single_bound(reach)),
                "{what}: watertight differs off the silhouette, {ray:?}"
            );
        }
    }
    eprintln!("{what}: {differ} of {} pixels of the mask differ in watertight", rays.len());
}

/// The assignment scene and the bunny, scaled by 10^k and moved by up to 10^6 of their size. All coordinates are
/// rounded anew; the mask of hits is the same in `double`, and in `watertight` except for pixels within
/// [`single_bound`] of a silhouette.
fn assert_masks_stay(scene: &Scene, size: [u32; 2], name: &str) {
    for power in -6..=6 {
        assert_same_mask(scene, size, 10f64.powi(power), DVec3::ZERO, &format!("{name} times 10^{power}"));
    }
    for distance in [1.0, 1e3, 1e6] {
        for direction in [DVec3::X, DVec3::new(-0.3, 0.7, 1.0)] {
            let offset = distance * direction;
            assert_same_mask(scene, size, 1.0, offset, &format!("{name} moved by {offset}"));
        }
    }
}

#[test]
fn h2_h3_the_assignment_scene_in_decimal_scales_and_places() {
    for projection in PROJECTIONS {
        assert_masks_stay(&assignment(projection), [256, 256], projection.name());
    }
}

#[test]
#[ignore = "needs KILN_MODELS"]
fn with_models_h2_h3_the_bunny_in_decimal_scales_and_places() {
    let scene = bunny();
    assert_masks_stay(&scene, [256, 256], "bunny");
}
