//! Reciprocity, extreme parameters and directions, and special cases with known answers.

use super::super::chi_squared::Random;
use super::*;

/// BSDF without cosine of two directions, `b` seen from `a`.
fn bsdf(p: &BsdfParameters, a: DVec3, b: DVec3) -> DVec3 {
    Bsdf::new(p, a).eval(b) / b.z.abs()
}

/// f(a, b) = f(b, a) for metal, diffuse reflection and sheen. The compensation of multiple scattering depends on the
/// view and is divided out, as is the scale of sheen.
#[test]
fn lobes_are_reciprocal() {
    let mut random = Random(5);
    for _ in 0..500 {
        let a = direction(1.0 - random.number(), 6.0 * random.number());
        let b = direction(1.0 - random.number(), 6.0 * random.number());
        let roughness = 0.1 + 0.9 * random.number();
        let ggx = Ggx::new(roughness);
        let factor = |v: DVec3| GgxAlbedo::new(ggx, v.z).compensation(DVec3::splat(0.5)).x;
        let metal = BsdfParameters { roughness, base_colour: DVec3::splat(0.5), ..Default::default() };
        let (x, y) = (bsdf(&metal, a, b).x / factor(a), bsdf(&metal, b, a).x / factor(b));
        assert!((x - y).abs() <= 1e-9 * x, "{x}, {y}");
        let diffuse = BsdfParameters { specular: 0.0, ..dielectric() };
        assert!((bsdf(&diffuse, a, b) - bsdf(&diffuse, b, a)).abs().max_element() < 1e-15);
        let sheen = Sheen::new(DVec3::ONE, 0.25 + 0.75 * random.number(), 1.0);
        let (x, y) = (unmasked(&sheen, a, b), unmasked(&sheen, b, a));
        assert!((x - y).abs() <= 1e-9 * x, "{x}, {y}");
    }

    /// The sheen BRDF of a view, with the scale of normal incidence: 1.
    fn unmasked(sheen: &Sheen, a: DVec3, b: DVec3) -> f64 {
        sheen.seen_from(a.z).value(a, b).scattered.x / b.z
    }
}

/// A BSDF that is set again is that of the new parameters alone.
#[test]
fn a_bsdf_set_again_is_as_new() {
    let many = BsdfParameters {
        metallic: 0.3,
        transmission: 0.5,
        roughness: 0.4,
        thin_walled: true,
        clearcoat: 1.0,
        sheen_colour: DVec3::ONE,
        sheen_roughness: 0.5,
        ..Default::default()
    };
    let lambert = BsdfParameters { specular: 0.0, ..dielectric() };
    let black = BsdfParameters { base_colour: DVec3::ZERO, ..lambert };
    let mut bsdf = Bsdf::EMPTY;
    for parameters in [many, lambert, black, many] {
        bsdf.set(&parameters, view(0.6));
        let new = Bsdf::new(&parameters, view(0.6));
        for light in [direction(0.3, 2.0), -direction(0.8, 1.0)] {
            assert_eq!(bsdf.eval_pdf(light), new.eval_pdf(light));
        }
        for choice in [0.0, 0.3, 0.6, 0.99] {
            assert_eq!(bsdf.sample([choice, 0.2, 0.7]), new.sample([choice, 0.2, 0.7]));
        }
        assert_eq!((bsdf.albedo(), bsdf.is_delta()), (new.albedo(), new.is_delta()));
    }
    bsdf.set(&black, view(0.6));
    assert!(bsdf.sample([0.5; 3]).is_none() && bsdf.is_delta());
}

/// Refraction: f(a, b) / n_b^2 = f(b, a) / n_a^2 (Walter et al. 2007, equation 20 ff.), where b is on the side of
/// n_b. The compensation is left out, and the frame turned over for views from inside, since z is on the side of the
/// view.
#[test]
fn refraction_is_reciprocal() {
    let mut random = Random(6);
    let mut compared = 0;
    for _ in 0..2000 {
        let outside = direction(1.0 - random.number(), 6.0 * random.number());
        let inside = direction(random.number() - 1.0, 6.0 * random.number());
        let roughness = 0.2 + 0.8 * random.number();
        let lobe = |from_inside, cos| {
            let interface = Interface::new(relative_index(1.5, from_inside), 1.0, DVec3::ONE);
            Glass::new(Ggx::new(roughness), interface, DVec3::ONE, 1.0, cos).uncompensated()
        };
        let turned = |d: DVec3| DVec3::new(d.x, d.y, -d.z);
        let x = lobe(false, outside.z).value(outside, inside).scattered.x / -inside.z;
        let y = lobe(true, -inside.z).value(turned(inside), turned(outside)).scattered.x / outside.z;
        let x = x / 2.25;
        assert!((x - y).abs() <= 1e-9 * x.max(1e-12), "{x}, {y}");
        compared += usize::from(x > 0.0);
    }
    assert!(compared > 100, "{compared}");
}

/// All values are finite and not negative, and the weights bounded, for every combination of extreme parameters,
/// views and lights.
#[test]
fn no_parameters_give_nan() {
    let extremes = [0.0, 1e-3, 0.5, 1.0];
    let iors = [0.0, 1e-3, 0.5, 0.999_99, 1.0, 1.000_2, 1.01, 1.5, 2.4, 1e3, f64::INFINITY];
    let cosines = [1e-300, 1e-12, 1e-3, 0.3, 1.0];
    let mut random = Random(9);
    let pick = |values: &[f64], random: &mut Random| values[(random.number() * values.len() as f64) as usize];
    for _ in 0..20_000 {
        let mut any = || pick(&extremes, &mut random);
        let colour = |x: f64, y: f64| DVec3::new(x, y, 1.0);
        let mut p = BsdfParameters {
            base_colour: DVec3::splat(any()) * colour(any(), any()),
            metallic: any(),
            roughness: any(),
            ior: 1.5,
            specular: any(),
            specular_colour: colour(any(), any() * 100.0),
            transmission: any(),
            thin_walled: any() > 0.5,
            from_inside: any() > 0.1,
            clearcoat: any(),
            clearcoat_roughness: any(),
            sheen_colour: DVec3::splat(any()) * colour(any(), any()),
            sheen_roughness: any(),
            anisotropy: any(),
        };
        p.ior = pick(&iors, &mut random);
        let cos = pick(&cosines, &mut random);
        let view = view(cos).with_z(cos);
        let bsdf = Bsdf::new(&p, view);
        assert!(bsdf.albedo().is_finite(), "{p:?}");
        for _ in 0..6 {
            let sign = if random.number() < 0.5 { -1.0 } else { 1.0 };
            let z = sign * pick(&cosines, &mut random);
            let light = direction(z, 0.7 + 3.0 * f64::from(random.number() < 0.5)).with_z(z);
            for light in [light, -view, view, DVec3::new(-view.x, -view.y, view.z)] {
                let (scattered, pdf) = bsdf.eval_pdf(light);
                assert!(
                    scattered.is_finite() && scattered.min_element() >= 0.0,
                    "{scattered} {light} {view} {p:?}"
                );
                assert!(pdf.is_finite() && pdf >= 0.0, "{pdf} {light} {view} {p:?}");
            }
            let edge = [0.0, 0.5, 1.0 - f64::EPSILON, random.number()];
            let numbers = [pick(&edge, &mut random), pick(&edge, &mut random), pick(&edge, &mut random)];
            let Some(sample) = bsdf.sample(numbers) else { continue };
            assert!(sample.weight.is_finite() && sample.weight.min_element() >= 0.0, "{sample:?} {p:?}");
            assert!((sample.direction.length() - 1.0).abs() < 1e-9, "{sample:?} {view} {p:?}");
        }
    }
}

/// Without an interface light passes straight through, whatever the roughness.
#[test]
fn no_interface_is_invisible() {
    for thin_walled in [false, true] {
        let p = BsdfParameters { ior: 1.0, thin_walled, roughness: 0.8, ..glass(false) };
        let bsdf = Bsdf::new(&p, view(0.3));
        assert!(bsdf.is_delta());
        let sample = bsdf.sample([0.4, 0.2, 0.9]).expect("transmitted");
        assert!((sample.direction + bsdf.view).length() < 1e-15);
        assert!((sample.weight - DVec3::ONE).abs().max_element() < 1e-15);
        assert!(sample.is_transmission && sample.is_delta);
    }
}

/// Below the critical angle (cosine sqrt(5) / 3 = 0.745 for index 1.5) smooth glass reflects all from inside.
#[test]
fn total_internal_reflection_is_complete() {
    let bsdf = Bsdf::new(&BsdfParameters { roughness: 0.0, ..glass(true) }, view(0.74));
    for choice in [0.0, 0.5, 0.999_999] {
        let sample = bsdf.sample([choice, 0.5, 0.5]).expect("reflected");
        assert!(!sample.is_transmission && sample.weight == DVec3::ONE, "{sample:?}");
    }
}

/// Smooth glass refracts by Snell's law: from the sine 0.6 to 0.6 / 1.5 = 0.4, on the other side of the normal.
#[test]
fn snells_law() {
    let view = DVec3::new(0.6, 0.0, 0.8);
    let bsdf = Bsdf::new(&BsdfParameters { roughness: 0.0, ..glass(false) }, view);
    let sample = bsdf.sample([0.999, 0.5, 0.5]).expect("refracted");
    assert!((sample.direction - DVec3::new(-0.4, 0.0, -(1.0f64 - 0.16).sqrt())).length() < 1e-15);
}

/// Metal is opaque, whatever its transmission; black metal absorbs at normal incidence.
#[test]
fn metal_is_opaque() {
    let metal = BsdfParameters { roughness: 0.5, transmission: 1.0, ..Default::default() };
    let bsdf = Bsdf::new(&metal, view(0.5));
    assert_eq!(bsdf.eval(direction(-0.5, 0.7)), DVec3::ZERO);
    let black = BsdfParameters { roughness: 0.0, base_colour: DVec3::ZERO, ..metal };
    assert_eq!(Bsdf::new(&black, DVec3::Z).sample([0.5; 3]), None);
}
