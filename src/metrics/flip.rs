//! LDR-FLIP: perceived difference of two alternating images, per pixel. Pure functions of two slices of finite values.
//!
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild, "FLIP: A Difference Evaluator for Alternating
//! Images", 2020. Section numbers below are those of this paper.

use rayon::prelude::*;

use crate::film::colour::srgb_decode;
use crate::film::simd::simd;

/// Pixels per degree of the field of view, for a display 0.7 m and 3840 pixels wide at a distance of 0.7 m:
/// `distance * pixels / width * pi / 180` (section 5.1).
pub(crate) const PIXELS_PER_DEGREE: f64 = 0.7 * (3840.0 / 0.7) * std::f64::consts::PI / 180.0;

/// White point D65 in CIE XYZ: the row sums of [`XYZ_FROM_RGB`].
const WHITE: [f64; 3] = [0.950_428_545_377_181, 1.0, 1.088_900_370_798_128];

/// CIE XYZ from linear sRGB (IEC 61966-2-1), as fractions derived from its primaries and white point.
const XYZ_FROM_RGB: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

/// Contrast sensitivity (table 1): for the luminance channel and the chroma channels red-green and blue-yellow, the
/// amplitudes and widths of the sum of two Gaussians, `a sqrt(pi / b) exp(-pi^2 x^2 / b)`.
const SENSITIVITY: [[(f64, f64); 2]; 3] =
    [[(1.0, 0.0047), (0.0, 1e-5)], [(1.0, 0.0053), (0.0, 1e-5)], [(34.1, 0.04), (13.5, 0.025)]];

/// Exponent of colour differences (section 4.1.3).
const QC: f64 = 0.7;
/// Fraction of the largest colour difference that maps to [`PT`] (section 4.1.3).
const PC: f64 = 0.4;
/// Error that `PC` times the largest colour difference maps to (section 4.1.3).
const PT: f64 = 0.95;
/// Feature width in degrees (section 4.2).
const FEATURE_WIDTH: f64 = 0.082;
/// Exponent of feature differences (section 4.3).
const QF: f64 = 0.5;

/// One channel of an image in row-major order.
type Plane = Vec<f64>;

/// Per-pixel LDR-FLIP, 0 to 1. `a` and `b` are display values from 0 to 1 in rows of `width` pixels.
pub(crate) fn map(a: &[[f32; 3]], b: &[[f32; 3]], width: usize, pixels_per_degree: f64) -> Vec<f32> {
    let perceived = [a, b].map(|picture| PerceivedImage::new(picture, width, pixels_per_degree));
    let largest = largest_colour_difference();
    let error = |i: usize| {
        let colour = colour_error(perceived[0].lab[i], perceived[1].lab[i], largest);
        let edge = (perceived[0].edges[i] - perceived[1].edges[i]).abs();
        let point = (perceived[0].points[i] - perceived[1].points[i]).abs();
        let feature = (edge.max(point) / std::f64::consts::SQRT_2).powf(QF);
        // Section 4.3: features amplify colour differences; the result stays within 0 to 1.
        colour.powf(1.0 - feature) as f32
    };
    (0..a.len()).into_par_iter().map(error).collect()
}

/// Perceived colours and features of an image.
struct PerceivedImage {
    /// Hunt-adjusted L*a*b* after contrast sensitivity filtering (section 4.1).
    lab: Vec<[f64; 3]>,
    /// Edge strength, 0 to 1 (section 4.2).
    edges: Plane,
    /// Point strength, 0 to 1 (section 4.2).
    points: Plane,
}

impl PerceivedImage {
    fn new(picture: &[[f32; 3]], width: usize, pixels_per_degree: f64) -> Self {
        let opponent = picture.par_iter().map(|pixel| ycxcz(xyz(pixel.map(|c| srgb_decode(c.into())))));
        let opponent: Vec<[f64; 3]> = opponent.collect();
        let channel = |c: usize| -> Plane { opponent.iter().map(|pixel| pixel[c]).collect() };
        let rgb_from_xyz = glam::DMat3::from_cols_array_2d(&XYZ_FROM_RGB).transpose().inverse();
        let blurred = [0, 1, 2].map(|c| blur(&channel(c), width, SENSITIVITY[c], pixels_per_degree));
        let lab = |i: usize| {
            let xyz_blurred = xyz_of_ycxcz([blurred[0][i], blurred[1][i], blurred[2][i]]);
            let rgb: [f64; 3] = (rgb_from_xyz * glam::DVec3::from(xyz_blurred)).into();
            hunt(lab(xyz(rgb.map(|c| c.clamp(0.0, 1.0)))))
        };
        let luminance: Plane = opponent.iter().map(|pixel| (pixel[0] + 16.0) / 116.0).collect();
        let (edges, points) = features(&luminance, width, pixels_per_degree);
        PerceivedImage { lab: (0..picture.len()).into_par_iter().map(lab).collect(), edges, points }
    }
}

fn xyz(rgb: [f64; 3]) -> [f64; 3] {
    XYZ_FROM_RGB.map(|row| row[0] * rgb[0] + row[1] * rgb[1] + row[2] * rgb[2])
}

/// YCxCz, the linearised CIELAB for contrast sensitivity filtering (section 4.1.1).
fn ycxcz(xyz: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = [0, 1, 2].map(|c| xyz[c] / WHITE[c]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn xyz_of_ycxcz([y, cx, cz]: [f64; 3]) -> [f64; 3] {
    let y = (y + 16.0) / 116.0;
    [(cx / 500.0 + y) * WHITE[0], y * WHITE[1], (y - cz / 200.0) * WHITE[2]]
}

/// CIE 1976 L*a*b*.
fn lab(xyz: [f64; 3]) -> [f64; 3] {
    const DELTA: f64 = 6.0 / 29.0;
    let f = |t: f64| {
        if t > DELTA * DELTA * DELTA { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    };
    let [x, y, z] = [0, 1, 2].map(|c| f(xyz[c] / WHITE[c]));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Hunt effect: chroma scales with luminance (section 4.1.2).
fn hunt([l, a, b]: [f64; 3]) -> [f64; 3] {
    [l, 0.01 * l * a, 0.01 * l * b]
}

/// HyAB distance for large colour differences (Abasi, Tehran and Fairchild, 2019).
fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// Largest colour difference raised to [`QC`]: that between green and blue.
fn largest_colour_difference() -> f64 {
    let of = |rgb: [f64; 3]| hunt(lab(xyz(rgb)));
    hyab(of([0.0, 1.0, 0.0]), of([0.0, 0.0, 1.0])).powf(QC)
}

/// Colour error, 0 to 1 (section 4.1.3).
fn colour_error(a: [f64; 3], b: [f64; 3], largest: f64) -> f64 {
    let difference = hyab(a, b).powf(QC);
    let knee = PC * largest;
    if difference < knee {
        difference * PT / knee
    } else {
        PT + (difference - knee) / (largest - knee) * (1.0 - PT)
    }
}

/// Contrast sensitivity filter: a sum of two separable Gaussians.
fn blur(plane: &[f64], width: usize, gaussians: [(f64, f64); 2], pixels_per_degree: f64) -> Plane {
    use std::f64::consts::PI;
    // Kernel radius for all channels: three standard deviations of the widest Gaussian (section 4.1.1).
    let widest = SENSITIVITY.iter().flatten().fold(0.0, |widest: f64, &(_, b)| widest.max(b));
    let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as i64;
    let kernels = gaussians.map(|(a, b)| {
        // The square root, as the kernel is applied once per direction.
        let scale = (a * (PI / b).sqrt()).sqrt();
        kernel(radius, |x| scale * (-PI * PI * (x / pixels_per_degree).powi(2) / b).exp())
    });
    let total: f64 = kernels.iter().map(|kernel| kernel.iter().sum::<f64>().powi(2)).sum();
    let mut sum = vec![0.0; plane.len()];
    for kernel in kernels.iter().filter(|kernel| kernel.iter().any(|&k| k != 0.0)) {
        let part = convolve_columns(&convolve_rows(plane, width, kernel), width, kernel);
        sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part / total);
    }
    sum
}

/// Edge and point strengths: first and second Gaussian derivatives of the luminance, whose positive and negative
/// weights are normalised to 1 and -1 (section 4.2).
fn features(luminance: &[f64], width: usize, pixels_per_degree: f64) -> (Plane, Plane) {
    let sigma = 0.5 * FEATURE_WIDTH * pixels_per_degree;
    let radius = (3.0 * sigma).ceil() as i64;
    let gauss = |x: f64| (-x * x / (2.0 * sigma * sigma)).exp();
    let smooth = normalised(kernel(radius, gauss));
    let first = normalised(kernel(radius, |x| -x * gauss(x)));
    let second = normalised(kernel(radius, |x| (x * x / (sigma * sigma) - 1.0) * gauss(x)));
    let strength = |derivative: &[f64]| -> Plane {
        let x = convolve_columns(&convolve_rows(luminance, width, derivative), width, &smooth);
        let y = convolve_columns(&convolve_rows(luminance, width, &smooth), width, derivative);
        x.iter().zip(y).map(|(x, y)| x.hypot(y)).collect()
    };
    (strength(&first), strength(&second))
}

/// Values of `f` from `-radius` to `radius`.
fn kernel(radius: i64, f: impl Fn(f64) -> f64) -> Vec<f64> {
    (-radius..=radius).map(|x| f(x as f64)).collect()
}

/// Scales positive weights to the sum 1, negative weights to -1.
fn normalised(mut kernel: Vec<f64>) -> Vec<f64> {
    let positive: f64 = kernel.iter().filter(|k| **k > 0.0).sum();
    let negative: f64 = -kernel.iter().filter(|k| **k < 0.0).sum::<f64>();
    kernel.iter_mut().for_each(|k| *k /= if *k > 0.0 { positive } else { negative });
    kernel
}

/// Convolution of rows; the end pixels are repeated.
fn convolve_rows(plane: &[f64], width: usize, kernel: &[f64]) -> Plane {
    let radius = kernel.len() / 2;
    let mut out = vec![0.0; plane.len()];
    out.par_chunks_mut(width).zip(plane.par_chunks(width)).for_each(|(out, row)| {
        let ends = (row[0], row[width - 1]);
        let padded: Vec<f64> = std::iter::repeat_n(ends.0, radius)
            .chain(row.iter().copied())
            .chain(std::iter::repeat_n(ends.1, radius))
            .collect();
        add_weighted(out, kernel, |i| &padded[i..i + width]);
    });
    out
}

/// Convolution of columns; the end pixels are repeated.
fn convolve_columns(plane: &[f64], width: usize, kernel: &[f64]) -> Plane {
    let (radius, height) = (kernel.len() / 2, plane.len() / width);
    let mut out = vec![0.0; plane.len()];
    out.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        add_weighted(out, kernel, |i| {
            let from = (y + i).saturating_sub(radius).min(height - 1) * width;
            &plane[from..from + width]
        });
    });
    out
}

/// Adds weighted rows to `out`.
fn add_weighted<'a>(out: &mut [f64], kernel: &[f64], row: impl Fn(usize) -> &'a [f64]) {
    simd!({
        for (i, k) in kernel.iter().enumerate() {
            out.iter_mut().zip(row(i)).for_each(|(out, v)| *out += v * k);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean(map: &[f32]) -> f64 {
        map.iter().map(|&e| f64::from(e)).sum::<f64>() / map.len() as f64
    }

    #[test]
    fn colour_conversions_are_inverse() {
        let rgb = [0.25, 0.5, 0.75];
        let rgb_from_xyz = glam::DMat3::from_cols_array_2d(&XYZ_FROM_RGB).transpose().inverse();
        let back: [f64; 3] = (rgb_from_xyz * glam::DVec3::from(xyz_of_ycxcz(ycxcz(xyz(rgb))))).into();
        assert!(rgb.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-12), "{back:?}");
        // White has L* = 100, a* = b* = 0.
        let white = lab(xyz([1.0; 3]));
        assert!(
            (white[0] - 100.0).abs() < 1e-9 && white[1].abs() < 1e-9 && white[2].abs() < 1e-9,
            "{white:?}"
        );
    }

    /// Uniform images have no features, and blurring does not change them: FLIP is the colour error. Black and white
    /// differ by 100 in L*, and not in a* and b*.
    #[test]
    fn black_and_white_have_a_closed_form() {
        let (black, white) = (vec![[0.0; 3]; 12], vec![[1.0; 3]; 12]);
        let difference = 100f64.powf(QC);
        let largest = largest_colour_difference();
        assert!(difference < largest && difference > PC * largest);
        let expected = PT + (difference - PC * largest) / (largest - PC * largest) * (1.0 - PT);
        let map = map(&black, &white, 4, PIXELS_PER_DEGREE);
        assert!(map.iter().all(|&e| (f64::from(e) - expected).abs() < 1e-6), "{map:?} is not {expected}");
    }

    #[test]
    fn green_and_blue_have_the_largest_error() {
        let (green, blue) = (vec![[0.0, 1.0, 0.0]; 9], vec![[0.0, 0.0, 1.0]; 9]);
        assert!((mean(&map(&green, &blue, 3, PIXELS_PER_DEGREE)) - 1.0).abs() < 1e-6);
        assert_eq!(mean(&map(&green, &green, 3, PIXELS_PER_DEGREE)), 0.0);
    }

    /// A step from black to white is an edge of strength 1: all positive weights of the first derivative fall on white,
    /// all negative ones on black, and the middle weight is 0.
    #[test]
    fn a_step_is_an_edge_of_strength_1() {
        let width = 64;
        let luminance: Plane = (0..width * 3).map(|i| if i % width < 32 { 0.0 } else { 1.0 }).collect();
        let (edges, points) = features(&luminance, width, PIXELS_PER_DEGREE);
        assert!((edges[32] - 1.0).abs() < 1e-12, "{}", edges[32]);
        assert!(edges[0].abs() < 1e-12 && points[0].abs() < 1e-12);
    }
}
