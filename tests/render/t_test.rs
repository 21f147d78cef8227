//! The AOVs `samples` and `variance`, and the t-test of pictures of equal and different radiance.

use crate::common::picture::parse;
use kiln::error::Warnings;
use kiln::film::{Film, FilterShape};
use kiln::job::{RenderControl, RenderJob, RenderSettings, prepare};
use kiln::metrics::t_test::{Estimate, TTest};
use kiln::render::aov::{self, AovSelection};
use kiln::scene::{PictureSettings, PixelSampler, Samples, Transport};

const SIZE: u32 = 48;

/// Settings for path tracing with independent samples.
pub fn settings(samples: u32, depth: u32, seed: u32) -> RenderSettings {
    let picture = PictureSettings {
        transport: Some(Transport::Path),
        filter: Some(FilterShape::Box),
        sampler: Some(PixelSampler::Independent),
        samples: Some(Samples::clamped(samples)),
        seed: Some(seed),
        ..PictureSettings::of_size([SIZE; 2])
    };
    RenderSettings { with: vec![format!("path={depth}")], ..picture.into() }
}

/// The picture of a job with the statistics of its samples.
pub fn estimate(job: &RenderJob) -> Estimate {
    let (film, statistics): (Film, _) = job.render(&RenderControl::default()).expect("a picture");
    assert_eq!(statistics.non_finite, []);
    let selection = AovSelection::new(&["samples".into(), "variance".into()]).expect("names");
    let channels =
        aov::channels(&job.aov_source(Some(&film)), &selection, &RenderControl::default()).expect("channels");
    let values = |name: &str| {
        channels
            .iter()
            .find(|channel| channel.name == name)
            .map(|channel| channel.values.clone())
            .expect(name)
    };
    Estimate {
        width: film.window().width,
        height: film.window().height,
        means: std::array::from_fn(|c| film.rows().map(|pixel: [f32; 3]| pixel[c]).collect()),
        variances: ["Variance.R", "Variance.G", "Variance.B"].map(values),
        counts: values("Samples.X"),
        seed: Some(job.plan_settings.sampling.seed),
    }
}

fn rendered(scene: &str, settings: &RenderSettings) -> Estimate {
    estimate(&prepare(parse(scene), settings, &mut Warnings::default()).expect("a job"))
}

/// The inside of a Lambertian sphere, and a lamp in it.
fn room(emission: f64) -> String {
    format!(
        "[[camera]]\nposition = [0.1, 0.2, 0]\nlook_at = [1, 0.3, 0.2]\nvertical_fov = 90\n\
         [material.wall]\ncolour = '#c0a080'\n\
         [material.lamp]\ncolour = '#000000'\nemission = '#ffffff'\nemission_intensity = {emission}\n\
         [[sphere]]\nmaterial = 'wall'\ncentre = [0, 0, 0]\nradius = 1.5\n\
         [[sphere]]\nmaterial = 'lamp'\ncentre = [0.3, 0.9, 0.1]\nradius = 0.2\n"
    )
}

/// A picture of 16 samples is the mean of the 16 pictures of one sample each, and its variance theirs.
#[test]
fn mean_and_variance_are_those_of_pictures_of_one_sample() {
    let scene = room(4.0);
    let whole = rendered(&scene, &settings(16, 3, 5));
    let singles: Vec<Vec<[f32; 3]>> = (0..16)
        .map(|i| {
            let settings = settings(16, 3, 5);
            let mut job = prepare(parse(&scene), &settings, &mut Warnings::default()).expect("a job");
            job.set_sampling(job.plan_settings.sampling.part(i, i + 1)).expect("a plan");
            let (film, _): (Film, _) = job.render(&RenderControl::default()).expect("a picture");
            film.rows().collect()
        })
        .collect();
    let mut varying = 0;
    for pixel in 0..(SIZE * SIZE) as usize {
        assert_eq!(whole.counts[pixel], 16.0);
        for c in 0..3 {
            let samples: Vec<f64> = singles.iter().map(|single| single[pixel][c].into()).collect();
            let mean = samples.iter().sum::<f64>() / 16.0;
            let variance = samples.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 15.0;
            varying += u32::from(variance > 0.0);
            let close = |a: f32, b: f64| (f64::from(a) - b).abs() <= 1e-6 * b.abs();
            assert!(close(whole.means[c][pixel], mean) && close(whole.variances[c][pixel], variance));
        }
    }
    assert!(varying > 3 * SIZE * SIZE / 2, "{varying}");
}

/// One sample a pixel has no variance, and says so.
#[test]
fn the_variance_of_one_sample_is_infinite() {
    let centred = |picture: &mut PictureSettings| {
        *picture = PictureSettings { transport: picture.transport, ..PictureSettings::of_size([SIZE; 2]) };
    };
    let one = rendered(&room(4.0), &crate::common::picture::changed(settings(1, 1, 0), centred));
    assert!(one.variances.iter().flatten().all(|&variance| variance == f32::INFINITY));
    assert!(one.counts.iter().all(|&count| count == 1.0));
}

/// Independent samples converge as 1 / N, Sobol points faster; the reported variance predicts the error of the first only.
#[test]
fn the_variance_predicts_the_error_of_independent_samples() {
    let scene = room(4.0);
    let ratio = |sampler| {
        let of = |samples, seed| {
            let mut settings = settings(samples, 1, seed);
            settings.picture.sampler = Some(sampler);
            rendered(&scene, &settings)
        };
        let (a, b) = (of(64, 1), of(64, 2));
        let (mut square, mut predicted) = (0.0, 0.0);
        for pixel in 0..(SIZE * SIZE) as usize {
            square += f64::from(a.means[0][pixel] - b.means[0][pixel]).powi(2);
            predicted += f64::from(a.variances[0][pixel] + b.variances[0][pixel]) / 64.0;
        }
        square / predicted
    };
    // The mean of 2304 squares of standard normal numbers is 1 with standard deviation sqrt(2 / 2304) = 0.03; weights that differ
    // between pixels make it a few times that.
    let independent = ratio(PixelSampler::Independent);
    assert!((0.8..1.2).contains(&independent), "{independent}");
    let sobol = ratio(PixelSampler::Sobol);
    assert!(sobol < 0.7 * independent, "{sobol}");
}

/// The control: two seeds. Then a lamp that is 1 % brighter: from the standard error of the mean, which the test reports, follows
/// how certain it is to be found.
#[test]
fn seeds_agree_and_one_per_cent_of_radiance_is_found() {
    let (a, b) = (rendered(&room(4.0), &settings(64, 3, 1)), rendered(&room(4.0), &settings(64, 3, 2)));
    let control = TTest::between(&a, &b, 1).expect("a test");
    assert!(control.passed, "{control:?}");
    assert!(control.channels.iter().all(|channel| (0.003..0.02).contains(&channel.below_low)), "{control:?}");
    assert!(TTest::between(&a, &b, 4).expect("a test").passed);

    let brighter = rendered(&room(4.04), &settings(64, 3, 3));
    let test = TTest::between(&a, &brighter, 4).expect("a test");
    let channel = &test.channels[0];
    let mean: f64 = a.means[0].iter().map(|&x| f64::from(x)).sum::<f64>() / f64::from(SIZE * SIZE);
    // All light comes from the lamp, so the difference is 1 % of the mean.
    let errors = 0.01 * mean / channel.standard_error;
    println!(
        "difference {:+.3e} +- {:.3e}, {errors:.1} standard errors",
        channel.difference, channel.standard_error
    );
    assert!((channel.difference - 0.01 * mean).abs() < 4.0 * channel.standard_error);
    // The threshold 1.7e-4 is at 3.76 standard errors: with 8 or more the power is 1 - Phi(-4.2) = 0.99999.
    assert!(errors > 8.0 && !test.passed && channel.equal_means < test.threshold, "{errors}: {test:?}");
}
