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
mod tests;
