//! Path tracing by BSDF samples alone, by light samples alone, and by both with multiple importance sampling, depth by depth:
//! t-tests of blocks of 4 x 4 pixels show whether they converge to the same picture.
//!
//! The controls, two seeds of each technique, show that the blocks' p-values are uniform. Those of single pixels are not: where
//! BSDF samples rarely find the lamp, a pixel's mean and its variance are too small together. With 128 samples a pixel and one
//! bounce, 11 % of p-values are below 0.01 where BSDF samples are tested against the others, with 2048 samples 3 %, and with 16,384
//! the histogram is even: a bias would grow.

use crate::common::picture::parse;
use crate::path::room_file;
use crate::t_test::{estimate, settings};
use kiln::effects::{LightTechnique, PathSettings, PlanSettings};
use kiln::error::Warnings;
use kiln::job::prepare;
use kiln::metrics::t_test::{Estimate, TTest};

/// Samples per pixel: with 51 and more the control of 2 % is seen at 8 standard errors.
const SAMPLES: u32 = 64;

/// A box of diffuse walls with a lamp of two triangles, a ball of rough metal and a glossy dielectric one.
fn room(emission: f64) -> String {
    format!(
        "[[camera]]\nposition = [-1.8, 0.3, 1.7]\nlook_at = [0.5, -0.4, -0.5]\nvertical_fov = 70\n\
         [material.wall]\ncolour = '#d0b8a0'\n\
         [material.metal]\ncolour = '#e0c070'\nmetallic = 1\nroughness = 0.4\n\
         [material.gloss]\ncolour = '#4060a0'\nmetallic = 0\nroughness = 0.3\n\
         [material.lamp]\ncolour = '#000000'\nemission = '#fff0d0'\nemission_intensity = {emission}\n\
         [[mesh]]\nmaterial = 'wall'\nfile = '{}'\n\
         [[sphere]]\nmaterial = 'metal'\ncentre = [0.7, -1.1, -0.6]\nradius = 0.8\n\
         [[sphere]]\nmaterial = 'gloss'\ncentre = [-0.7, -1.4, -0.4]\nradius = 0.5\n\
         [[triangles]]\nmaterial = 'lamp'\nvertices = [[-0.8, 1.1, -0.8], [0.8, 1.1, -0.8], [0.8, 1.1, 0.8]]\n\
         [[triangles]]\nmaterial = 'lamp'\nvertices = [[-0.8, 1.1, -0.8], [0.8, 1.1, 0.8], [-0.8, 1.1, 0.8]]\n",
        room_file()
    )
}

fn render(emission: f64, technique: LightTechnique, depth: u32, seed: u32) -> Estimate {
    render_by(PathSettings::default(), emission, technique, (depth, seed))
}

fn render_by(
    path: PathSettings,
    emission: f64,
    technique: LightTechnique,
    (depth, seed): (u32, u32),
) -> Estimate {
    render_scene(&room(emission), path, technique, (depth, seed))
}

fn render_scene(
    scene: &str,
    path: PathSettings,
    technique: LightTechnique,
    (depth, seed): (u32, u32),
) -> Estimate {
    let job = prepare(parse(scene), &settings(SAMPLES, depth, seed), &mut Warnings::default());
    let job = job.expect("a job");
    let plan_settings = PlanSettings { light_technique: technique, path, ..job.plan_settings.clone() };
    estimate(&job.with_plan_settings(plan_settings).expect("the job with another technique"))
}

fn test(a: &Estimate, b: &Estimate) -> TTest {
    TTest::between(a, b, 4).expect("pictures of one size")
}

/// The most that a difference may be seen to be: four standard errors of the mean difference, relative to the mean.
fn sensitivity(a: &Estimate, test: &TTest) -> f64 {
    let mean = a.means[0].iter().map(|&x| f64::from(x)).sum::<f64>() / a.means[0].len() as f64;
    4.0 * test.channels[0].standard_error / mean
}

const TECHNIQUES: [LightTechnique; 3] =
    [LightTechnique::Both, LightTechnique::BsdfSamples, LightTechnique::LightSamples];

#[test]
fn techniques_converge_to_the_same_picture() {
    for depth in 1..=4 {
        let render = |i: usize, seed: usize| render(6.0, TECHNIQUES[i], depth, (seed + i) as u32);
        let (first, again) = ([0, 1, 2].map(|i| render(i, 1)), [0, 1, 2].map(|i| render(i, 4)));
        for (i, technique) in TECHNIQUES.iter().enumerate() {
            let control = test(&first[i], &again[i]);
            assert!(control.passed, "depth {depth}, control of {technique:?}: {control:?}");
        }
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            let test = test(&first[i], &again[j]);
            let pair = [TECHNIQUES[i], TECHNIQUES[j]];
            assert!(test.passed, "depth {depth}, {pair:?}: {test:?}");
            // A smaller difference of the whole picture could be missed.
            let seen = sensitivity(&first[i], &test);
            assert!(seen < 0.02, "depth {depth}, {pair:?}: {seen}");
        }
    }
}

/// Under a disk light, whose front alone shines, and an emissive disk, which is turned to the side.
#[test]
fn techniques_converge_to_the_same_picture_under_disks() {
    let lamp = "[[triangles]]\nmaterial = 'lamp'";
    let scene = room(6.0);
    let room = scene.split(lamp).next().expect("what comes before the lamp");
    let scene = format!(
        "{room}[[light]]\ntype = 'disk'\nposition = [0.2, 1.1, 0]\ndirection = [0, -1, 0.1]\nradius = 0.9\nintensity = 3\n\
         [[disk]]\nmaterial = 'lamp'\ncentre = [-1.2, 0, -1]\nnormal = [1, 0.2, 0.3]\nradius = 0.7\n"
    );
    let render = |i: usize, seed| render_scene(&scene, PathSettings::default(), TECHNIQUES[i], (2, seed));
    let (first, again) = ([0, 1, 2].map(|i| render(i, 1)), [0, 1, 2].map(|i| render(i, 4)));
    for (i, j) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)] {
        let test = test(&first[i], &again[j]);
        let pair = [TECHNIQUES[i], TECHNIQUES[j]];
        assert!(test.passed, "{pair:?}: {test:?}");
        let seen = sensitivity(&first[i], &test);
        // BSDF samples alone find the smaller lamps less often than those of `room`.
        assert!(seen < 0.03, "{pair:?}: {seen}");
    }
}

/// Neither where roulette starts nor the number of light samples changes what pictures converge to, in any technique.
#[test]
fn roulette_and_light_samples_converge_to_the_same_picture() {
    let usual = render(6.0, LightTechnique::Both, 6, 21);
    let of = |roulette_from, light_samples| PathSettings {
        roulette_from,
        light_samples,
        ..PathSettings::default()
    };
    let cases = [
        (of(3, 1), LightTechnique::Both),
        (of(0, 1), LightTechnique::Both),
        (of(u32::MAX, 1), LightTechnique::Both),
        (of(3, 2), LightTechnique::Both),
        (of(3, 5), LightTechnique::Both),
        (of(3, 5), LightTechnique::LightSamples),
        (of(3, 5), LightTechnique::BsdfSamples),
    ];
    for (seed, (path, technique)) in (22..).zip(cases) {
        let test = test(&usual, &render_by(path, 6.0, technique, (6, seed)));
        assert!(test.passed, "{path:?}, {technique:?}: {test:?}");
        let seen = sensitivity(&usual, &test);
        assert!(seen < 0.02, "{path:?}, {technique:?}: {seen}");
    }
}

/// Further light samples of a light without noise are all the same: a point light, seen by one bounce.
#[test]
fn light_samples_share_the_light() {
    let scene = "[[camera]]\nposition = [0, 2, 3]\nlook_at = [0, 0, 0]\nvertical_fov = 40\n\
         [material.floor]\ncolour = '#d0b8a0'\n\
         [[light]]\ntype = 'point'\nposition = [1, 2, 1]\nintensity = 2\n\
         [[sphere]]\nmaterial = 'floor'\ncentre = [0, 0, 0]\nradius = 0.8\n";
    let job = prepare(parse(scene), &settings(4, 1, 1), &mut Warnings::default()).expect("a job");
    let picture = |light_samples| {
        let path = PathSettings { light_samples, ..PathSettings::default() };
        let plan_settings = PlanSettings { path, ..job.plan_settings.clone() };
        estimate(&job.with_plan_settings(plan_settings).expect("the job with other samples"))
    };
    // A quarter of the light four times is the light, without rounding: both are powers of two.
    let [one, four] = [1, 4].map(picture);
    assert_eq!(one.means, four.means);
    assert!(one.means[0].iter().any(|&mean| mean > 0.1));
}

/// The lamp is 2 % brighter in one of the pictures. All light comes from it.
#[test]
fn a_wrong_weight_would_be_found() {
    let right = render(6.0, LightTechnique::Both, 2, 1);
    for (technique, seed) in [(LightTechnique::Both, 2), (LightTechnique::LightSamples, 3)] {
        let wrong = test(&right, &render(6.12, technique, 2, seed));
        let channel = &wrong.channels[0];
        let errors = 0.02 * 4.0 / sensitivity(&right, &wrong);
        println!("{:+.2e} +- {:.2e}, {errors:.1} errors", channel.difference, channel.standard_error);
        // The threshold of 1.7e-4 is at 3.8 standard errors.
        assert!(errors > 8.0 && !wrong.passed && channel.difference > 0.0, "{errors} {wrong:?}");
    }
}
