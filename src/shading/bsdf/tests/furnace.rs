//! White furnace: the directional albedo by quadrature of `eval` and by sampling.

use super::super::chi_squared::Random;
use super::super::quadrature::integrate_sphere;
use super::*;

const COSINES: [f64; 5] = [0.05, 0.1, 0.2, 0.5, 1.0];
const SAMPLES: usize = 20_000;
const ROUGHNESSES: [f64; 5] = [0.0, 0.1, 0.3, 0.6, 1.0];

/// The directional albedo by quadrature and by sampling, with the standard error of the latter.
struct Albedo {
    exact: DVec3,
    sampled: DVec3,
    error: DVec3,
}

/// The part of delta lobes. Their samples depend on the first number only: the midpoint rule over it.
fn delta_albedo(bsdf: &Bsdf) -> DVec3 {
    if !bsdf.lobes().any(|(lobe, _)| lobe.is_delta()) {
        return DVec3::ZERO;
    }
    let n = 20_000;
    let samples = (0..n).filter_map(|i| bsdf.sample([(f64::from(i) + 0.5) / f64::from(n), 0.5, 0.5]));
    samples.filter(|sample| sample.is_delta).map(|sample| sample.weight / f64::from(n)).sum()
}

/// Samples `count` directions, and integrates `eval` to `tolerance`.
fn albedo(parameters: &BsdfParameters, cos: f64, count: usize, tolerance: f64) -> Albedo {
    let bsdf = Bsdf::new(parameters, view(cos));
    let integral = integrate_sphere(&|light| bsdf.eval(light), &peaks(parameters, bsdf.view), tolerance);
    let mut random = Random(7);
    let (mut sum, mut squares) = (DVec3::ZERO, DVec3::ZERO);
    for _ in 0..count {
        let numbers = [random.number(), random.number(), random.number()];
        let weight = bsdf.sample(numbers).map_or(DVec3::ZERO, |sample| sample.weight);
        sum += weight;
        squares += weight * weight;
    }
    let n = count as f64;
    let mean = sum / n;
    let variance = (squares / n - mean * mean).max(DVec3::ZERO) / n;
    let error = DVec3::new(variance.x.sqrt(), variance.y.sqrt(), variance.z.sqrt());
    Albedo { exact: integral + delta_albedo(&bsdf), sampled: mean, error }
}

/// The samples agree with the quadrature to 5 standard errors (in 600 comparisons, 3e-4 false alarms are expected).
/// `rare`: events of a probability of 8 / count may have been missed altogether, which the standard error does not
/// show.
fn check_samples(albedo: &Albedo, rare: f64, what: &str) {
    let difference = (albedo.sampled - albedo.exact).abs();
    let allowed = albedo.error * 5.0 + rare;
    assert!(difference.cmple(allowed).all(), "{what}: {} sampled, {} exact", albedo.sampled, albedo.exact);
}

/// The albedo of parameters that lose nothing is 1 for every cosine and roughness.
fn loses_nothing(parameters: &BsdfParameters, tolerance: f64) {
    for cos in COSINES {
        for roughness in ROUGHNESSES {
            let p = BsdfParameters { roughness, ..*parameters };
            let result = albedo(&p, cos, SAMPLES, 0.003 * tolerance);
            let what = format!("cosine {cos}, {p:?}");
            let loss = (result.exact - DVec3::ONE).abs().max_element();
            assert!(loss < tolerance, "{what}: {}", result.exact);
            check_samples(&result, 8.0 / SAMPLES as f64 + 0.1 * tolerance, &what);
        }
    }
}

#[test]
fn white_metal_reflects_all() {
    loses_nothing(&BsdfParameters::default(), 1e-3);
}

/// Multiple scattering is returned by a table of the albedo, which is less accurate than that of isotropic surfaces. By
/// sampling, since quadrature misses the lobes of smooth surfaces, which are narrow strips; elsewhere it agrees.
#[test]
fn white_anisotropic_surfaces_reflect_all() {
    for (cos, roughness) in COSINES.into_iter().flat_map(|cos| ROUGHNESSES.map(|roughness| (cos, roughness)))
    {
        for (anisotropy, metallic) in [0.3, 0.6, 1.0].into_iter().flat_map(|a| [0.0, 1.0].map(|m| (a, m))) {
            let p = BsdfParameters { anisotropy, metallic, roughness, ..Default::default() };
            let what = format!("cosine {cos}, {p:?}");
            let tolerance = if roughness < 0.3 { f64::INFINITY } else { 1e-4 };
            let result = albedo(&p, cos, SAMPLES, tolerance);
            let loss = (result.sampled - DVec3::ONE).abs();
            assert!(loss.cmple(result.error * 5.0 + 0.02).all(), "{what}: {}", result.sampled);
            if roughness >= 0.3 {
                check_samples(&result, 8.0 / SAMPLES as f64 + 2e-3, &what);
            }
        }
    }
}

/// Without strength the lobes are those of isotropic surfaces, bit for bit; a strength that vanishes has their limit.
#[test]
fn anisotropy_ends_in_isotropy() {
    let p = BsdfParameters { roughness: 0.4, metallic: 0.5, ..Default::default() };
    for cos in COSINES {
        let (bsdf, light) = (Bsdf::new(&p, view(cos)), direction(0.6, 2.0));
        let of = |anisotropy| Bsdf::new(&BsdfParameters { anisotropy, ..p }, view(cos)).eval_pdf(light);
        assert_eq!(of(0.0), bsdf.eval_pdf(light));
        let ((value, pdf), (limit, limit_pdf)) = (of(1e-6), bsdf.eval_pdf(light));
        // As accurate as the tables of albedos.
        assert!((value - limit).abs().max_element() < 0.02 * limit.max_element(), "{cos}: {value} {limit}");
        assert!((pdf - limit_pdf).abs() < 0.02 * limit_pdf, "{cos}: {pdf} {limit_pdf}");
    }
}

#[test]
fn white_diffuse_below_a_dielectric_reflects_all() {
    loses_nothing(&dielectric(), 1e-3);
}

#[test]
fn smooth_and_rough_glass_loses_nothing() {
    for from_inside in [false, true] {
        for ior in [1.0, 1.1, 1.5, 2.4, 0.0] {
            loses_nothing(&BsdfParameters { ior, ..glass(from_inside) }, 0.01);
        }
    }
}

#[test]
fn smooth_glass_loses_nothing_at_all() {
    for from_inside in [false, true] {
        for cos in COSINES {
            let bsdf = Bsdf::new(&BsdfParameters { roughness: 0.0, ..glass(from_inside) }, view(cos));
            assert!((delta_albedo(&bsdf) - DVec3::ONE).abs().max_element() < 1e-12);
        }
    }
}

#[test]
fn thin_walls_lose_nothing() {
    for ior in [1.0, 1.2, 1.5, 2.4] {
        loses_nothing(&BsdfParameters { ior, thin_walled: true, ..glass(false) }, 5e-3);
    }
}

/// No combination of layers reflects and transmits more than arrives, and samples agree with the quadrature.
#[test]
fn nothing_gains_energy() {
    let colour = DVec3::new(0.9, 1.0, 0.3);
    let mut cases = 0;
    for i in 0..2 * 2 * 3 * 3 * 3 * 2 {
        let mut rest = i;
        let mut pick = |n: usize| (rest % n, rest /= n).0;
        let (coated, white, sheen, transmission) = (pick(2) == 1, pick(2) == 1, pick(3), pick(3));
        let (metallic, smooth) = (pick(3) as f64 * 0.5, pick(2) == 1);
        let p = BsdfParameters {
            base_colour: if white { DVec3::ONE } else { colour },
            metallic,
            roughness: if smooth { 0.15 } else { 0.5 },
            specular_colour: if white { DVec3::ONE } else { colour },
            transmission: [0.0, 0.5, 0.9][transmission],
            thin_walled: transmission == 2,
            clearcoat: if coated { 0.7 } else { 0.0 },
            clearcoat_roughness: if white { 0.0 } else { 0.3 },
            sheen_colour: if sheen > 0 { colour } else { DVec3::ZERO },
            sheen_roughness: [0.0, 0.3, 0.8][sheen],
            ..Default::default()
        };
        for cos in [0.05, 0.6] {
            let result = albedo(&p, cos, SAMPLES / 2, 1e-4);
            let what = format!("cosine {cos}, {p:?}");
            assert!(result.exact.max_element() < 1.001, "{what}: {}", result.exact);
            check_samples(&result, 1e-3, &what);
            let by_tables = Bsdf::new(&p, view(cos)).albedo();
            assert!(
                (by_tables - result.exact).abs().max_element() < 0.02,
                "{what}: {by_tables}, {}",
                result.exact
            );
            cases += 1;
        }
    }
    assert_eq!(cases, 432);
}
