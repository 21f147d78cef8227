//! The built-in sky: Preetham, Shirley and Smits, A Practical Analytic Model for Daylight, SIGGRAPH 1999, for a turbidity of
//! 3 and a sun 40 degrees high in the direction of +x, turned by 30 degrees towards +z.
//!
//! The sun is spread over some 10 degrees, as behind thin cloud: a disc of half a degree would be seen by so few paths that
//! pictures with mirrors or glass would be noisy. It gives a surface that faces up twice the light of the sky. The whole is scaled
//! so that a white diffuse surface that faces up is shown white. Below the horizon lies ground of albedo 0.3.

use std::f64::consts::PI;

use glam::DVec3;

use crate::film::colour::luminance;

const TURBIDITY: f64 = 3.0;
const SUN_HEIGHT: f64 = 40.0;
const SUN_AZIMUTH: f64 = 30.0;
/// The angle at which the radiance of the spread sun has fallen to 1 / e, in degrees.
const SUN_SPREAD: f64 = 6.0;
/// The irradiance of a surface that faces up by the sun, relative to that by the sky.
const SUN_SHARE: f64 = 2.0;
/// The colour of the sun, linear sRGB: a black body of 5500 K, by its chromaticity (0.3325, 0.3411).
const SUN_COLOUR: DVec3 = DVec3::new(1.10, 0.99, 0.83);
const GROUND_ALBEDO: f64 = 0.3;
const WIDTH: usize = 512;
const HEIGHT: usize = 256;

/// Perez coefficients A to E of luminance Y and chromaticities x and y: factor of the turbidity, and constant (appendix A.2).
const PEREZ: [[[f64; 2]; 5]; 3] = [
    [[0.1787, -1.4630], [-0.3554, 0.4275], [-0.0227, 5.3251], [0.1206, -2.5771], [-0.0670, 0.3703]],
    [[-0.0193, -0.2592], [-0.0665, 0.0008], [-0.0004, 0.2125], [-0.0641, -0.8989], [-0.0033, 0.0452]],
    [[-0.0167, -0.2608], [-0.0950, 0.0092], [-0.0079, 0.2102], [-0.0441, -1.6537], [-0.0109, 0.0529]],
];

/// Zenith chromaticities x and y: by powers 2 to 0 of the turbidity (rows) and 3 to 0 of the sun's zenith angle (appendix A.2).
const ZENITH: [[[f64; 4]; 3]; 2] = [
    [
        [0.00166, -0.00375, 0.00209, 0.0],
        [-0.02903, 0.06377, -0.03202, 0.00394],
        [0.11693, -0.21196, 0.06052, 0.25886],
    ],
    [
        [0.00275, -0.00610, 0.00317, 0.0],
        [-0.04214, 0.08970, -0.04153, 0.00516],
        [0.15346, -0.26756, 0.06670, 0.26688],
    ],
];

/// Width, height and radiance of the sky as an equirectangular image.
pub(super) fn image() -> (usize, usize, Vec<[f32; 3]>) {
    let zenith_angle = (90.0 - SUN_HEIGHT).to_radians();
    let (sin, cos) = SUN_AZIMUTH.to_radians().sin_cos();
    let sun = DVec3::new(zenith_angle.sin() * cos, zenith_angle.cos(), zenith_angle.sin() * sin);
    let mut sky = vec![DVec3::ZERO; WIDTH * HEIGHT / 2];
    let mut glow = vec![0.0; WIDTH * HEIGHT / 2];
    let (mut of_sky, mut of_sun) = (DVec3::ZERO, 0.0);
    for row in 0..HEIGHT / 2 {
        let angle = PI * (row as f64 + 0.5) / HEIGHT as f64;
        // The horizontal irradiance by a texel of radiance 1.
        let weight = angle.sin() * angle.cos() * (PI / HEIGHT as f64) * (2.0 * PI / WIDTH as f64);
        for column in 0..WIDTH {
            let longitude = ((column as f64 + 0.5) / WIDTH as f64 - 0.5) * 2.0 * PI;
            let direction =
                DVec3::new(angle.sin() * longitude.cos(), angle.cos(), angle.sin() * longitude.sin());
            let index = row * WIDTH + column;
            sky[index] = radiance(direction, sun, zenith_angle);
            glow[index] = (-(direction.angle_between(sun).to_degrees() / SUN_SPREAD).powi(2)).exp();
            of_sky += sky[index] * weight;
            of_sun += glow[index] * weight;
        }
    }
    let sun_colour = SUN_COLOUR / luminance(SUN_COLOUR) * (SUN_SHARE * luminance(of_sky) / of_sun);
    let scale = PI / (luminance(of_sky) * (1.0 + SUN_SHARE));
    let above = sky.iter().zip(&glow).map(|(sky, glow)| (*sky + sun_colour * *glow) * scale);
    let ground = std::iter::repeat_n(DVec3::splat(GROUND_ALBEDO), WIDTH * HEIGHT / 2);
    (WIDTH, HEIGHT, above.chain(ground).map(|pixel| pixel.as_vec3().to_array()).collect())
}

/// Relative radiance, linear sRGB, from a direction above the horizon.
fn radiance(direction: DVec3, sun: DVec3, sun_zenith: f64) -> DVec3 {
    let cos_view = direction.y.max(1e-3);
    let gamma = direction.dot(sun).clamp(-1.0, 1.0).acos();
    // Perez and others, All-Weather Model for Sky Luminance Distribution, 1993: relative to the zenith.
    let relative = |coefficients: &[[f64; 2]; 5]| {
        let [a, b, c, d, e] = coefficients.map(|[slope, constant]| slope * TURBIDITY + constant);
        let value = |cos: f64, gamma: f64| {
            (1.0 + a * (b / cos).exp()) * (1.0 + c * (d * gamma).exp() + e * gamma.cos().powi(2))
        };
        value(cos_view, gamma) / value(1.0, sun_zenith)
    };
    let zenith = ZENITH.map(|rows| {
        let of_angle = |row: [f64; 4]| row.into_iter().fold(0.0, |sum, factor| sum * sun_zenith + factor);
        rows.into_iter().fold(0.0, |sum, row| sum * TURBIDITY + of_angle(row))
    });
    // The luminance of the zenith is a factor that the caller divides by.
    let luminance = relative(&PEREZ[0]);
    let (x, y) = (zenith[0] * relative(&PEREZ[1]), zenith[1] * relative(&PEREZ[2]));
    let xyz = DVec3::new(x / y, 1.0, (1.0 - x - y) / y) * luminance;
    // From XYZ to linear sRGB (IEC 61966-2-1). Colours outside the gamut are cut off at 0.
    let rows = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];
    DVec3::from(rows.map(|row| DVec3::from(row).dot(xyz).max(0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The irradiance of a surface that faces up is pi times white, up to the tint that sky and sun leave, and everything is finite.
    #[test]
    fn a_surface_that_faces_up_is_shown_white() {
        let (width, height, pixels) = image();
        let mut irradiance = DVec3::ZERO;
        for (index, pixel) in pixels.iter().enumerate().take(width * height / 2) {
            let angle = PI * ((index / width) as f64 + 0.5) / height as f64;
            let weight = angle.sin() * angle.cos() * (PI / height as f64) * (2.0 * PI / width as f64);
            irradiance += DVec3::from(pixel.map(f64::from)) * weight;
        }
        assert!((luminance(irradiance) / PI - 1.0).abs() < 1e-6, "{irradiance}");
        assert!((irradiance / PI - 1.0).abs().max_element() < 0.25, "{irradiance}");
        assert!(pixels.as_flattened().iter().all(|value| value.is_finite() && *value >= 0.0));
    }
}
