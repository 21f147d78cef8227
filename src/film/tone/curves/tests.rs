//! Tests of `curves`.

use super::*;

fn close(a: DVec3, b: [f64; 3], error: f64) {
    assert!((a - DVec3::from(b)).abs().max_element() <= error, "{a} {b:?}");
}

#[test]
fn neutral_subtracts_an_offset_below_the_compression() {
    // x = 0.1 > 0.08: offset 0.04. Peak 0.5 - 0.04 < 0.76: no compression.
    close(pbr_neutral(dvec3(0.5, 0.2, 0.1)), [0.46, 0.16, 0.06], 1e-15);
    // x = 0.04 <= 0.08: offset 0.04 - 0.0016 / 0.16 = 0.03.
    close(pbr_neutral(dvec3(0.04, 0.3, 0.2)), [0.01, 0.27, 0.17], 1e-15);
    // x = 0: no offset; a saturated base colour is unchanged up to 0.76.
    assert_eq!(pbr_neutral(dvec3(0.76, 0.3, 0.0)), dvec3(0.76, 0.3, 0.0));
    assert_eq!(pbr_neutral(DVec3::ZERO), DVec3::ZERO);
}

#[test]
fn neutral_compresses_highlights() {
    // Grey 1: offset 0.04, p = 0.96; pn = 1 - 0.24^2 / (0.96 + 1 - 1.52) = 1 - 0.0576 / 0.44 = 0.8690909. All
    // channels are p, so both terms are pn.
    close(pbr_neutral(DVec3::ONE), [1.0 - 0.0576 / 0.44; 3], 1e-15);
    // (2, 0, 0): offset 0, p = 2; pn = 1 - 0.0576 / 1.48 = 0.9610811;
    // g = 1 / (0.15 * 1.0389189 + 1) = 0.8651733; red pn g + pn (1 - g) = pn, others pn (1 - g) = 0.1295794.
    close(pbr_neutral(dvec3(2.0, 0.0, 0.0)), [0.9610811, 0.1295794, 0.1295794], 1e-7);
}

/// The inverse of the tone map returns the light, for every brightness and saturation, up to display white.
#[test]
fn neutral_is_inverted() {
    for colour in [dvec3(0.5, 0.2, 0.1), dvec3(0.04, 0.3, 0.2), dvec3(0.7, 0.0, 0.02), dvec3(1.0, 0.9, 0.8)] {
        for brightness in [0.01, 1.0, 4.0, 20.0] {
            let light = colour * brightness;
            let found = pbr_neutral_inverse(pbr_neutral(light));
            // The smallest channel x, up to 0.08, is displayed as x^2 / 0.16: roundings e of the display, a few
            // units in the last place of the peak, move an x of 0 by the root of 0.16 e, and all channels with it.
            let bound = (0.16 * 16.0 * f64::EPSILON * brightness.max(1.0)).sqrt();
            assert!((found - light).abs().max_element() < bound, "{light} {found}");
        }
    }
    assert_eq!(pbr_neutral_inverse(DVec3::ZERO), DVec3::ZERO);
    close(pbr_neutral(pbr_neutral_inverse(DVec3::ONE)), [WHITE; 3], 1e-12);
    // 254.5 of 255 is displayed as 255: ((254.5 / 255 + 0.055) / 1.055)^2.4 = 0.9956.
    assert_eq!(super::super::quantise::<u8>(super::super::srgb_encode(WHITE)), 255);
}

#[test]
fn filmic_is_the_published_fit() {
    // x = 1: 2.54 / 3.16. x = 0.18: 0.18 * 0.4818 / (0.18 * 1.0274 + 0.14) = 0.086724 / 0.324932.
    close(filmic(DVec3::ONE), [2.54 / 3.16; 3], 1e-15);
    close(filmic(DVec3::splat(0.18)), [0.086_724 / 0.324_932; 3], 1e-12);
    // 2.51 / 2.43 > 1 at the end.
    assert_eq!(filmic(DVec3::splat(1e6)), DVec3::ONE);
}

/// The sigmoid from which AgX's table is made (Sobotka's `equation_full_curve`): 0.5 at 10 / 16.5 of the log range,
/// slope 2 there; on both sides a scaled x / (1 + x^p)^(1/p), p being 3 for the toe and 3.25 for the shoulder,
/// which ends at 0 and 1.
fn sigmoid(x: f64) -> f64 {
    const PIVOT: [f64; 2] = [10.0 / 16.5, 0.5];
    const SLOPE: f64 = 2.0;
    let is_toe = x < PIVOT[0];
    let (width, height, power) =
        if is_toe { (PIVOT[0], PIVOT[1], 3.0) } else { (1.0 - PIVOT[0], 1.0 - PIVOT[1], 3.25f64) };
    let scale =
        ((SLOPE * width).powf(-power) * ((SLOPE * width / height).powf(power) - 1.0)).powf(-1.0 / power);
    let term = SLOPE * (x - PIVOT[0]).abs() / scale;
    let rise = scale * term / (1.0 + term.powf(power)).powf(1.0 / power);
    if is_toe { PIVOT[1] - rise } else { PIVOT[1] + rise }
}

#[test]
fn the_polynomial_of_agx_is_close_to_its_sigmoid_and_monotone() {
    const N: usize = 4096;
    let errors = (0..=N).map(|i| i as f64 / N as f64).map(|x| agx_sigmoid(x) - sigmoid(x));
    let (mut sum, mut max) = (0.0, 0f64);
    errors.for_each(|e| (sum, max) = (sum + e * e, max.max(e.abs())));
    assert!(max < 0.006 && sum / (N as f64) < 8e-6, "{max} {}", sum / N as f64);
    let is_rising = |i: usize| agx_sigmoid((i + 1) as f64 / N as f64) > agx_sigmoid(i as f64 / N as f64);
    assert!((0..N).all(is_rising));
}

#[test]
fn agx_shows_mid_grey_at_the_pivot() {
    // log2(0.18) = -2.473931: (12.47393 - 2.473931) / 16.499999 = 0.6060606; the polynomial is 0.496731 there, and
    // 0.496731^2.2 = 0.214495. The matrices leave greys as they are within 1.4e-4.
    close(agx(DVec3::splat(0.18)), [0.496_731f64.powf(2.2); 3], 5e-4);
    // At and below the least exposure the polynomial is negative: black.
    assert_eq!(agx(DVec3::ZERO), DVec3::ZERO);
    // At and above the greatest it is 0.99858; matrix rows of 1 - 2e-5 and more.
    close(agx(DVec3::splat(1e9)), [0.998_58f64.powf(2.2); 3], 5e-4);
}

/// Each curve is monotone for greys, within 0 to 1, keeps the hue of greys within an 8-bit step, and the order of
/// channels.
#[test]
fn greys_stay_grey_and_in_order() {
    for curve in [pbr_neutral, agx, filmic] {
        let mut before = DVec3::ZERO;
        for i in -200..200 {
            let grey = curve(DVec3::splat(2f64.powf(f64::from(i) / 10.0)));
            assert!(grey.cmpge(before).all() && grey.cmple(DVec3::ONE).all(), "{grey}");
            let shown = grey.to_array().map(|c| super::super::quantise::<u8>(super::super::srgb_encode(c)));
            assert!(shown.iter().max().unwrap() - shown.iter().min().unwrap() <= 1, "{shown:?}");
            before = grey;
            let orange = curve(dvec3(1.0, 0.5, 0.1) * 2f64.powf(f64::from(i) / 10.0));
            // The matrix rows of AgX tint its white by less than an 8-bit step.
            assert!(orange.x + 5e-4 > orange.y && orange.y + 5e-4 > orange.z, "{orange}");
        }
    }
}
