//! Chi-squared tests of `sample` against `pdf`, and the weight of samples.

use super::super::chi_squared::{Histogram, Random};
use super::super::quadrature::integrate_sphere;
use super::*;

/// Samples of each test. The rejection of a density off by 1 % takes more, see below.
const COUNT: usize = 200_000;

/// The chance of a false alarm in any of the tests below (Bonferroni's correction: divided by their number).
const SIGNIFICANCE: f64 = 0.01;

fn histogram(parameters: &BsdfParameters, cos: f64, count: usize, seed: u64) -> Histogram {
    let bsdf = Bsdf::new(parameters, view(cos));
    let mut random = Random(seed);
    let sample = || {
        let sample = bsdf.sample([random.number(), random.number(), random.number()])?;
        (!sample.is_delta).then_some(sample.direction)
    };
    Histogram::new(count, sample, |light| bsdf.pdf(light), &peaks(parameters, bsdf.view))
}

/// A material for each lobe alone and for mixtures.
fn materials() -> Vec<BsdfParameters> {
    let colour = DVec3::new(0.9, 0.5, 0.2);
    let metal = |roughness| BsdfParameters { roughness, base_colour: colour, ..Default::default() };
    let glass = |roughness, from_inside| BsdfParameters { roughness, ..glass(from_inside) };
    let thin = BsdfParameters { roughness: 0.4, thin_walled: true, base_colour: colour, ..glass(0.4, false) };
    let coat = BsdfParameters { clearcoat: 0.8, clearcoat_roughness: 0.3, ..dielectric() };
    let sheen = BsdfParameters { sheen_colour: colour, sheen_roughness: 0.4, ..metal(0.5) };
    vec![
        metal(0.15),
        metal(0.5),
        metal(1.0),
        BsdfParameters { anisotropy: 0.4, ..metal(0.3) },
        BsdfParameters { anisotropy: 0.9, ..metal(0.4) },
        BsdfParameters { anisotropy: 0.7, ..coat },
        BsdfParameters { anisotropy: 0.5, transmission: 0.5, thin_walled: true, ..dielectric() },
        BsdfParameters { specular: 0.0, ..dielectric() }, // diffuse
        BsdfParameters { base_colour: DVec3::ZERO, ..sheen }, // sheen
        BsdfParameters { roughness: 0.3, base_colour: colour, ..dielectric() },
        glass(0.2, false),
        glass(0.2, true),
        glass(0.7, false),
        glass(0.7, true),
        BsdfParameters { ior: 1.05, ..glass(0.5, false) },
        BsdfParameters { base_colour: colour, specular: 0.5, specular_colour: colour, ..glass(0.5, true) },
        thin,
        BsdfParameters { ior: 1.1, transmission: 0.6, ..thin },
        coat,
        sheen,
        BsdfParameters { clearcoat_roughness: 0.0, ..coat }, // with a delta lobe
        BsdfParameters {
            metallic: 0.3,
            transmission: 0.5,
            sheen_colour: colour,
            sheen_roughness: 0.7,
            ..coat
        },
    ]
}

#[test]
fn samples_have_the_density() {
    let cosines = [0.08, 0.4, 0.97];
    let tests = (materials().len() * cosines.len()) as f64;
    for (i, material) in materials().iter().enumerate() {
        for cos in cosines {
            let p = histogram(material, cos, COUNT, i as u64).p_value();
            assert!(p > SIGNIFICANCE / tests, "cosine {cos}, p {p}: {material:?}");
        }
    }
}

/// The test rejects densities that are off by 1 %: all too high or low, and half of the cells too high, half too low.
/// With 4 million samples the statistic grows by 1e-4 x 4e6 = 400; its standard deviation is sqrt(2 x 240) = 22 at
/// most.
#[test]
fn a_density_off_by_one_percent_is_rejected() {
    let tests = (materials().len() * 3) as f64;
    for material in [&materials()[1], &materials()[7], &materials()[12]] {
        let histogram = histogram(material, 0.4, 4_000_000, 1);
        assert!(histogram.p_value() > SIGNIFICANCE / tests);
        assert!(histogram.perturbed(1.01, |_| true).p_value() < SIGNIFICANCE / tests, "{material:?}");
        assert!(histogram.perturbed(0.99, |_| true).p_value() < SIGNIFICANCE / tests, "{material:?}");
        let mixed = histogram.perturbed(1.01, |i| i % 2 == 0).perturbed(0.99, |i| i % 2 == 1);
        assert!(mixed.p_value() < SIGNIFICANCE / tests, "{material:?}");
    }
}

/// The weight of a sample is `eval / pdf`, its density `pdf`, and its side as it says.
#[test]
fn weights_are_ratios() {
    let mut random = Random(3);
    for material in materials() {
        let bsdf = Bsdf::new(&material, view(0.3));
        for _ in 0..2000 {
            let numbers = [random.number(), random.number(), random.number()];
            let Some(sample) = bsdf.sample(numbers) else { continue };
            assert!((sample.direction.length() - 1.0).abs() < 1e-12);
            assert_eq!(sample.is_transmission, sample.direction.z < 0.0);
            if sample.is_delta {
                assert_eq!(sample.pdf, 0.0);
            } else {
                assert_eq!(sample.pdf, bsdf.pdf(sample.direction));
                assert_eq!(sample.weight, bsdf.eval(sample.direction) / sample.pdf);
            }
        }
    }
}

/// The density integrates to the part of samples that are neither absorbed nor of a delta lobe, at most 1.
#[test]
fn densities_integrate_to_at_most_one() {
    for material in materials() {
        for cos in [0.02, 0.3, 1.0] {
            let bsdf = Bsdf::new(&material, view(cos));
            let density = |light| DVec3::splat(bsdf.pdf(light));
            let integral = integrate_sphere(&density, &peaks(&material, bsdf.view), 1e-5).x;
            assert!(integral < 1.0 + 1e-3 && integral > 0.2, "{integral}: {material:?}");
        }
    }
}

/// Lambert's reflection without a [`Bsdf`] is that of its parameters.
#[test]
fn diffuse_alone_is_that_of_its_parameters() {
    for albedo in [DVec3::new(0.9, 0.5, 0.2), DVec3::new(0.0, 0.0, 1e-9)] {
        let parameters =
            BsdfParameters { specular: 0.0, base_colour: albedo, metallic: 0.0, ..Default::default() };
        let bsdf = Bsdf::new(&parameters, view(0.6));
        let light = view(0.2);
        assert_eq!(diffuse::eval_pdf(albedo, light), bsdf.eval_pdf(light));
        assert_eq!(diffuse::eval_pdf(albedo, -light), bsdf.eval_pdf(-light));
        let (sample, direction) = (bsdf.sample([0.3, 0.7, 0.1]).unwrap(), diffuse::sample([0.7, 0.1]));
        let (value, pdf) = diffuse::eval_pdf(albedo, direction);
        assert_eq!((sample.direction, sample.weight, sample.pdf), (direction, value / pdf, pdf));
    }
}
