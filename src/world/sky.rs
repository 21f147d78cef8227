//! The built-in sky: Preetham, Shirley and Smits, A Practical Analytic Model for Daylight, SIGGRAPH 1999, for a turbidity of
//! 3 and a sun 40 degrees high in the direction of +x, turned by 30 degrees towards +z. Without sun disc, and scaled, each
//! channel by itself, so that a white diffuse surface that faces up is shown white. Below the horizon lies ground of albedo 0.3.

use std::f64::consts::PI;

use glam::DVec3;

const TURBIDITY: f64 = 3.0;
const SUN_HEIGHT: f64 = 40.0;
const SUN_AZIMUTH: f64 = 30.0;
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
    let mut pixels = vec![DVec3::ZERO; WIDTH * HEIGHT];
    let mut irradiance = DVec3::ZERO;
    for row in 0..HEIGHT / 2 {
        let angle = PI * (row as f64 + 0.5) / HEIGHT as f64;
        for column in 0..WIDTH {
            let longitude = ((column as f64 + 0.5) / WIDTH as f64 - 0.5) * 2.0 * PI;
            let direction =
                DVec3::new(angle.sin() * longitude.cos(), angle.cos(), angle.sin() * longitude.sin());
            let radiance = radiance(direction, sun, zenith_angle);
            pixels[row * WIDTH + column] = radiance;
            let solid_angle = angle.sin() * (PI / HEIGHT as f64) * (2.0 * PI / WIDTH as f64);
            irradiance += radiance * (angle.cos() * solid_angle);
        }
    }
    // The irradiance becomes pi in every channel: without the sun the sky alone would tint everything blue.
    let scale = PI / irradiance;
    pixels[HEIGHT / 2 * WIDTH..].fill(DVec3::splat(GROUND_ALBEDO));
    pixels[..HEIGHT / 2 * WIDTH].iter_mut().for_each(|pixel| *pixel *= scale);
    (WIDTH, HEIGHT, pixels.into_iter().map(|pixel| pixel.as_vec3().to_array()).collect())
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
