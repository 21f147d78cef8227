//! Tone curves. Input is linear light of Rec. 709 primaries, finite and at least 0; output is displayed linear light, 0
//! to 1.

use glam::{DMat3, DVec3, dvec3};

const F90: f64 = 0.04;
const KS: f64 = 0.8 - F90;
const KD: f64 = 0.15;

/// Khronos PBR Neutral (Khronos Group, ToneMapping repository, PBR_Neutral/README.md, 2024).
///
/// With F90 = 0.04, Ks = 0.8 - F90, Kd = 0.15, x the smallest channel:
/// f = x - x^2 / (4 F90) for x <= 2 F90, else F90; p = largest channel of c - f.
/// p <= Ks: c - f. Else (c - f) g pn / p + pn (1 - g), where pn = 1 - (1 - Ks)^2 / (p + 1 - 2 Ks) and
/// g = 1 / (Kd (p - pn) + 1).
pub(crate) fn pbr_neutral(colour: DVec3) -> DVec3 {
    let x = colour.min_element();
    let offset = if x <= 2.0 * F90 { x - x * x / (4.0 * F90) } else { F90 };
    let shifted = colour - offset;
    let peak = shifted.max_element();
    if peak <= KS {
        return shifted;
    }
    let new_peak = 1.0 - (1.0 - KS) * (1.0 - KS) / (peak + 1.0 - 2.0 * KS);
    let g = 1.0 / (KD * (peak - new_peak) + 1.0);
    (shifted * (new_peak / peak * g) + new_peak * (1.0 - g)).clamp(DVec3::ZERO, DVec3::ONE)
}

/// Displayed light up to which [`pbr_neutral_inverse`] inverts: infinite light is displayed as 1, this as 255 of 255.
const WHITE: f64 = 0.9975;

/// The light that [`pbr_neutral`] displays as a colour, or as one near it where it displays none so: it takes away
/// saturation from bright colours.
///
/// With the names above, p = (1 - Ks)^2 / (1 - pn) - 1 + 2 Ks where the largest channel pn exceeds Ks, and
/// c - f = (shown - pn (1 - g)) p / (g pn). The smallest channel y of c - f is x^2 / (4 F90) for x <= 2 F90, so
/// x = sqrt(4 F90 y), else x = y + F90.
pub(crate) fn pbr_neutral_inverse(shown: DVec3) -> DVec3 {
    let shown = shown.clamp(DVec3::ZERO, DVec3::splat(WHITE));
    let new_peak = shown.max_element();
    let mut shifted = shown;
    if new_peak > KS {
        let peak = (1.0 - KS) * (1.0 - KS) / (1.0 - new_peak) - 1.0 + 2.0 * KS;
        let g = 1.0 / (KD * (peak - new_peak) + 1.0);
        shifted = ((shown - new_peak * (1.0 - g)) * (peak / (g * new_peak))).max(DVec3::ZERO);
    }
    let y = shifted.min_element();
    shifted + if y <= F90 { (4.0 * F90 * y).sqrt() - y } else { F90 }
}

/// AgX, base look (Troy Sobotka, AgX for OpenColorIO, 2022), in the minimal form of Benjamin Wrensch, "Minimal AgX
/// Implementation", 2023: inset matrix, log2 from -12.47393 to 4.026069 (10 stops below and 6.5 above 0.18), sigmoid by
/// a polynomial of degree 6, inverse matrix, and the display's exponent 2.2, which gives linear light.
///
/// The mean squared error of the polynomial is 3.67e-6 by its author, against the tabulated sigmoid: 0.0019 RMS, half
/// an 8-bit step. The largest against the sigmoid's formula is 0.0058 (tests). Its ends are -0.00232 and 0.99858, which
/// show as 0 and 255. The rows of the matrices sum to 1 within 1.4e-4, so greys are grey to within one 8-bit step.
pub(crate) fn agx(colour: DVec3) -> DVec3 {
    const INSET: DMat3 = DMat3::from_cols(
        dvec3(0.842479062253094, 0.0423282422610123, 0.0423756549057051),
        dvec3(0.0784335999999992, 0.878468636469772, 0.0784336),
        dvec3(0.0792237451477643, 0.0791661274605434, 0.879142973793104),
    );
    const OUTSET: DMat3 = DMat3::from_cols(
        dvec3(1.19687900512017, -0.0528968517574562, -0.0529716355144438),
        dvec3(-0.0980208811401368, 1.15190312990417, -0.0980434501171241),
        dvec3(-0.0990297440797205, -0.0989611768448433, 1.15107367264116),
    );
    const EV: [f64; 2] = [-12.47393, 4.026069];
    // log2(0) is -infinity, which is clamped.
    let encoded = |c: f64| (c.log2().clamp(EV[0], EV[1]) - EV[0]) / (EV[1] - EV[0]);
    let contrast = (INSET * colour).to_array().map(|c| agx_sigmoid(encoded(c)));
    let display = OUTSET * DVec3::from(contrast);
    DVec3::from(display.to_array().map(|c| c.clamp(0.0, 1.0).powf(2.2)))
}

/// Wrensch's polynomial of degree 6 for the sigmoid of AgX.
fn agx_sigmoid(x: f64) -> f64 {
    (((((15.5 * x - 40.14) * x + 31.96) * x - 6.868) * x + 0.4298) * x + 0.1191) * x - 0.00232
}

/// Krzysztof Narkowicz, "ACES Filmic Tone Mapping Curve", 6 January 2016: a rational fit per channel to RRT and ODT of
/// ACES for sRGB displays, with a largest error of 0.0138 by its author. Pre-exposed as published: 0.6 times the light
/// is the level of ACES.
pub(crate) fn filmic(colour: DVec3) -> DVec3 {
    let curve = |x: f64| (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14);
    DVec3::from(colour.to_array().map(|c| curve(c).clamp(0.0, 1.0)))
}

#[cfg(test)]
mod tests {
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
        for colour in
            [dvec3(0.5, 0.2, 0.1), dvec3(0.04, 0.3, 0.2), dvec3(0.7, 0.0, 0.02), dvec3(1.0, 0.9, 0.8)]
        {
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
        assert_eq!(super::super::quantise(super::super::srgb_encode(WHITE)), 255);
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
                let shown = grey.to_array().map(|c| super::super::quantise(super::super::srgb_encode(c)));
                assert!(shown.iter().max().unwrap() - shown.iter().min().unwrap() <= 1, "{shown:?}");
                before = grey;
                let orange = curve(dvec3(1.0, 0.5, 0.1) * 2f64.powf(f64::from(i) / 10.0));
                // The matrix rows of AgX tint its white by less than an 8-bit step.
                assert!(orange.x + 5e-4 > orange.y && orange.y + 5e-4 > orange.z, "{orange}");
            }
        }
    }
}
