//! Error maps as colour images.

use super::ComparedImage;

/// Decimal logarithms of the first and the last error of a logarithmic error map: below the resolution of f32 at 1, and
/// black against white.
const DECADES: [f64; 2] = [-8.0, 0.0];

/// Ten equidistant colours of matplotlib's "magma" (van der Walt and Smith 2015), the usual colour map of FLIP.
const MAGMA: [[u8; 3]; 10] = [
    [0, 0, 4],
    [24, 15, 61],
    [68, 15, 118],
    [114, 31, 129],
    [158, 47, 127],
    [205, 64, 113],
    [241, 96, 93],
    [253, 150, 104],
    [254, 202, 141],
    [252, 253, 191],
];

/// Colours of `errors` (0 to 1): black at 0, through purple and orange, to light yellow at 1.
pub fn heat_map(errors: &[f32]) -> Vec<[u8; 3]> {
    errors.iter().map(|&error| colour(error)).collect()
}

/// Colour map of the largest channel difference of each pixel, in display values, on the logarithmic scale of
/// [`DECADES`]. Both images must have the same size.
pub fn error_map(a: &ComparedImage, b: &ComparedImage) -> Vec<[u8; 3]> {
    let largest = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max);
    let position = |error: f32| {
        ((f64::from(error).log10() - DECADES[0]) / (DECADES[1] - DECADES[0])).clamp(0.0, 1.0) as f32
    };
    let errors: Vec<f32> = a.displayed().iter().zip(&b.displayed()).map(largest).map(position).collect();
    heat_map(&errors)
}

fn colour(error: f32) -> [u8; 3] {
    let at = error.clamp(0.0, 1.0) * (MAGMA.len() - 1) as f32;
    let below = (at as usize).min(MAGMA.len() - 2);
    let part = at - below as f32;
    std::array::from_fn(|c| {
        let (low, high) = (f32::from(MAGMA[below][c]), f32::from(MAGMA[below + 1][c]));
        (low + (high - low) * part).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_and_a_middle() {
        // 1/18 is half-way between the first colour and the second: (12, 7.5, 32.5).
        assert_eq!(
            heat_map(&[0.0, 1.0, 1.0 / 18.0, 2.0]),
            [[0, 0, 4], [252, 253, 191], [12, 8, 33], [252, 253, 191]]
        );
    }
}
