//! Ambient occlusion against closed forms: 1 minus the form factor of what is near.

use crate::common::picture::parse;
use kiln::error::Warnings;
use kiln::job::{RenderControl, RenderSettings, prepare};
use kiln::scene::{PictureSettings, Samples, Sampling};

const SIZE: u32 = 33;

/// A white floor at z = 0, which ambient light of intensity 1 shows white, seen from above around (x, 0).
fn floor(x: f64, half: f64) -> String {
    format!(
        "[ambient]\nintensity = 1\n[image]\nheadlight = false\ncolour = 'linear'\n\
         [[camera]]\nprojection = 'orthographic'\nposition = [{x}, 0, 0.01]\nlook_at = [{x}, 0, 0]\nup = [0, 1, 0]\n\
         viewing_height = 0.001\nviewpoint_distance = 1\n\
         [material.white]\ncolour = '#ffffff'\n[[triangles]]\nmaterial = 'white'\nindices = [[0, 1, 2], [0, 2, 3]]\n\
         vertices = [[-{half}, -{half}, 0], [{half}, -{half}, 0], [{half}, {half}, 0], [-{half}, {half}, 0]]\n"
    )
}

/// The mean over the pixels for a radius in diagonals, which must lie within four standard errors of independent rays.
fn check(scene: &str, radius: f64, samples: Option<u32>, expected: f64) {
    let samples = samples.map(Samples::clamped);
    let picture = PictureSettings { samples, ..PictureSettings::of_size([SIZE; 2]) };
    let settings = RenderSettings { with: vec![format!("ambient-occlusion={radius}")], ..picture.into() };
    let job = prepare(parse(scene), &settings, &mut Warnings::default()).expect("a job");
    let (film, _) = job.render(&RenderControl::default()).expect("a picture");
    let values: Vec<f64> = film.rows().map(|[red, ..]: [f32; 3]| red.into()).collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let rays = f64::from(samples.map_or(8, |samples| samples.get().max(8)));
    let error = (expected * (1.0 - expected) / (rays * values.len() as f64)).sqrt();
    assert!((mean - expected).abs() <= 4.0 * error + 1e-6, "{mean}, expected {expected} +- {error}");
}

/// The form factor of an infinitely long wall of height h, seen from the floor at the distance d, is (1 - d / sqrt(d^2 + h^2)) / 2.
/// A wall of 400 units length lacks less than 1e-4 of it.
#[test]
fn a_wall_takes_its_form_factor_of_the_ambient_light() {
    for (distance, height) in [(1.0, 1.0), (0.5, 3.0)] {
        let wall = format!(
            "[[triangles]]\nmaterial = 'white'\nindices = [[0, 1, 2], [0, 2, 3]]\n\
             vertices = [[0, -200, 0], [0, 200, 0], [0, 200, {height}], [0, -200, {height}]]\n"
        );
        let factor = 0.5 * (1.0 - distance / f64::hypot(distance, height));
        for samples in [None, Some(16)] {
            check(&(floor(distance, 200.0) + &wall), 10.0, samples, 1.0 - factor);
        }
    }
}

/// A ball of radius R that lies on the floor, seen from the distance D of its centre at the cosine R / D, has the form factor
/// (R / D)^2 R / D.
#[test]
fn a_ball_takes_its_form_factor_of_the_ambient_light() {
    let ball = "[[sphere]]\nmaterial = 'white'\ncentre = [0, 0, 1]\nradius = 1\n";
    let distance = f64::hypot(1.2, 1.0);
    check(&(floor(1.2, 20.0) + ball), 10.0, None, 1.0 - distance.powi(-3));
}

/// A ceiling at height 1 is beyond the radius r for directions with a cosine below 1 / r, which have (1 / r)^2 of the light.
#[test]
fn what_is_beyond_the_radius_does_not_count() {
    let ceiling = "[[triangles]]\nmaterial = 'white'\nindices = [[0, 1, 2], [0, 2, 3]]\n\
        vertices = [[-20, -20, 1], [20, -20, 1], [20, 20, 1], [-20, 20, 1]]\n";
    let scene = floor(0.0, 20.0) + ceiling;
    let diagonal = f64::sqrt(40.0 * 40.0 + 40.0 * 40.0 + 1.0);
    check(&scene, 0.9 / diagonal, None, 1.0);
    check(&scene, 2.0 / diagonal, None, 0.25);
    check(&scene, 1.25 / diagonal, Some(8), 0.64);
}

/// A surface casts 8 rays, shared by the samples of the whole picture.
#[test]
fn samples_share_their_rays() {
    let with = vec!["ambient-occlusion".into()];
    let settings = RenderSettings { with, ..PictureSettings::of_size([SIZE; 2]).into() };
    let mut job = prepare(parse(&floor(0.0, 1.0)), &settings, &mut Warnings::default()).expect("a job");
    for (samples, total, rays) in
        [(1, None, 8), (4, None, 8), (8, None, 8), (16, None, 16), (1, Some(4), 2), (2, Some(4), 4)]
    {
        job.set_sampling(Sampling { samples: Some(samples), total, ..Sampling::default() }).expect("a plan");
        let (_, statistics) = job.render::<[f32; 3]>(&RenderControl::default()).expect("a picture");
        let cast = statistics.rays(kiln::effects::whitted::ambient_occlusion::RAYS).cast;
        assert_eq!(cast, rays * u64::from(SIZE * SIZE), "{samples} samples");
    }
}

/// It is part of no picture that does not ask for it.
#[test]
fn it_is_on_where_it_is_asked_for() {
    let is_on = |scene: &str, with: &[&str]| {
        let with = with.iter().map(|&with| with.to_owned()).collect();
        let settings = RenderSettings { with, ..RenderSettings::default() };
        let job = prepare(parse(scene), &settings, &mut Warnings::default()).expect("a job");
        job.plan.effects_on().any(|effect| effect == kiln::effects::id::AMBIENT_OCCLUSION)
    };
    let scene = floor(0.0, 1.0);
    assert!(!is_on(&scene, &[]));
    assert!(is_on(&scene, &["ambient-occlusion"]));
    assert!(is_on(&(scene.clone() + "[effects]\nambient-occlusion = 0.2\n"), &[]));
    assert!(!is_on(&scene.replace("intensity = 1", "intensity = 0"), &["ambient-occlusion"]));
}
