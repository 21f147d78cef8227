//! Error metrics between two images of the same size: figures, the worst pixels, and error maps; [`t_test`] for noisy ones.
//!
//! Non-finite pixels are counted; if there are any, there are no figures, as NaN spreads to means and is lost in
//! maxima. [`definitions`] defines the figures.

mod compared_image;
pub mod distributions;
mod flip;
mod heat;
pub mod t_test;

pub use compared_image::{ComparedImage, Values, displayed};
pub use heat::{DECADES, error_map, heat_map};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Added to the squared reference in relMSE, so that the divisor is not 0 for black (Rousselle, Knaus and Zwicker,
/// "Adaptive sampling and reconstruction using greedy error minimization", 2011, section 6).
pub const REL_MSE_EPSILON: f64 = 0.01;

/// Upper bound of the memory for a comparison, in bytes per pixel, in addition to the two images: their display values
/// and planes of f64 for FLIP. Measured by peak memory: 163.
pub const BYTES_PER_PIXEL: u64 = 176;

/// Maximum number of worst pixels listed, each from a different square of [`SQUARE`] pixels.
const WORST: usize = 5;

/// Side in pixels of the squares with at most one worst pixel each.
const SQUARE: u32 = 16;

/// Result of the comparison of an image with a reference.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Errors {
    /// Width of both in pixels.
    pub width: u32,
    /// Height of both in pixels.
    pub height: u32,
    /// Encoding in which `max`, `rmse` and `rel_mse` are computed.
    pub values: Values,
    /// Whether all channels of all pixels are equal.
    pub same: bool,
    /// Non-finite pixels.
    pub non_finite: NonFinite,
    /// The figures; `None` if a pixel is not finite.
    pub figures: Option<Figures>,
    /// Worst pixels in descending order of difference; none if a pixel is not finite.
    #[serde(skip)]
    pub worst: Vec<Worst>,
}

/// Pixels with a channel that is NaN or infinite.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct NonFinite {
    /// Number in the reference.
    pub reference: u64,
    /// Number in the tested image.
    pub test: u64,
    /// Column and row of the first in either image.
    pub first: Option<(u32, u32)>,
}

/// Error figures of two finite images, see [`definitions`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// Largest channel difference.
    pub max: f64,
    /// Root mean square difference over all channels.
    pub rmse: f64,
    /// Mean square difference relative to the reference.
    pub rel_mse: f64,
    /// Peak signal-to-noise ratio of display values in dB; `None` if they are equal.
    pub psnr: Option<f64>,
    /// Mean LDR-FLIP of display values, 0 to 1.
    pub flip: f64,
    /// Fraction of pixels that differ in any channel, 0 to 1.
    pub differing: f64,
}

impl Figures {
    /// Whether the pictures are equal.
    pub fn are_none(&self) -> bool {
        self.max == 0.0 && self.differing == 0.0
    }
}

/// A pixel with a large difference.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Worst {
    /// Column, from the left.
    pub x: u32,
    /// Row, from the top.
    pub y: u32,
    /// Largest channel difference.
    pub difference: f64,
    /// Pixel of the reference.
    pub reference: [f32; 3],
    /// Pixel of the tested image.
    pub test: [f32; 3],
}

impl Errors {
    /// Compares `test` with `reference`: in their encoding if both have the same, otherwise in display values.
    ///
    /// # Errors
    /// [`Error::Usage`] if the sizes differ.
    pub fn between(reference: &ComparedImage, test: &ComparedImage) -> Result<Errors> {
        Ok(Errors::with_map(reference, test)?.0)
    }

    /// Like [`Errors::between`], with the per-pixel LDR-FLIP; `None` if a pixel is not finite.
    ///
    /// # Errors
    /// [`Error::Usage`] if the sizes differ.
    pub fn with_map(reference: &ComparedImage, test: &ComparedImage) -> Result<(Errors, Option<Vec<f32>>)> {
        let (width, height) = (reference.width, reference.height);
        if (width, height) != (test.width, test.height) {
            let what = format!("{width} x {height} pixels against {} x {}", test.width, test.height);
            return Err(Error::usage(format!("sizes differ: {what}"), "compare pictures of one size"));
        }
        let displayed = (reference.displayed(), test.displayed());
        let (values, a, b) = if reference.values == test.values {
            (reference.values, &reference.pixels[..], &test.pixels[..])
        } else {
            (Values::Display, &displayed.0[..], &displayed.1[..])
        };
        let non_finite = NonFinite::of(reference, test);
        let map = (non_finite.first.is_none())
            .then(|| flip::map(&displayed.0, &displayed.1, width as usize, flip::PIXELS_PER_DEGREE));
        let figures = map.as_ref().map(|map| {
            let shown = mean_over(&displayed.0, &displayed.1, |a, b| (a - b) * (a - b));
            Figures {
                max: differences(a, b).max_by(f64::total_cmp).unwrap_or(0.0),
                rmse: mean_over(a, b, |a, b| (a - b) * (a - b)).sqrt(),
                rel_mse: mean_over(a, b, |a, b| (a - b) * (a - b) / (a * a + REL_MSE_EPSILON)),
                psnr: (shown > 0.0).then(|| -10.0 * shown.log10()),
                flip: sum_of(map.len(), |i| f64::from(map[i])) / map.len() as f64,
                differing: sum_of(a.len(), |i| f64::from(u8::from(a[i] != b[i]))) / a.len() as f64,
            }
        });
        let worst = if figures.is_some() { worst(a, b, width) } else { Vec::new() };
        // NaN is not equal to NaN.
        let same = reference.values == test.values && reference.pixels == test.pixels;
        Ok((Errors { width, height, values, same, non_finite, figures, worst }, map))
    }
}

impl NonFinite {
    fn of(reference: &ComparedImage, test: &ComparedImage) -> Self {
        let bad = |pixel: &[f32; 3]| pixel.iter().any(|c| !c.is_finite());
        let count = |picture: &ComparedImage| picture.pixels.iter().filter(|p| bad(p)).count() as u64;
        let first = reference.pixels.iter().zip(&test.pixels).position(|(a, b)| bad(a) || bad(b));
        let position = |i: usize| (i as u32 % reference.width, i as u32 / reference.width);
        NonFinite { reference: count(reference), test: count(test), first: first.map(position) }
    }
}

/// Mean LDR-FLIP of finite display values from 0 to 1, in rows of `width` pixels.
pub fn mean_flip(a: &[[f32; 3]], b: &[[f32; 3]], width: u32) -> f64 {
    let map = flip::map(a, b, width as usize, flip::PIXELS_PER_DEGREE);
    sum_of(map.len(), |i| f64::from(map[i])) / map.len() as f64
}

/// Names and definitions of the figures.
pub fn definitions() -> [(&'static str, String); 6] {
    let flip = format!(
        "mean LDR-FLIP of what a display shows, 0 to 1, at {:.2} pixels a degree (Andersson et al. 2020)",
        flip::PIXELS_PER_DEGREE
    );
    [
        ("max", "largest |b - a| of any channel".into()),
        ("rmse", "square root of the mean of (b - a)^2 over all pixels and channels".into()),
        ("relmse", format!("mean of (b - a)^2 / (a^2 + {REL_MSE_EPSILON})")),
        ("psnr", "-10 log10 of the mean of (b - a)^2 of what a display shows, in dB".into()),
        ("flip", flip),
        ("differing", "share of the pixels with a channel that differs, 0 to 1".into()),
    ]
}

/// Largest channel difference of each pixel.
fn differences<'a>(a: &'a [[f32; 3]], b: &'a [[f32; 3]]) -> impl Iterator<Item = f64> + 'a {
    let difference = |(a, b): (&f32, &f32)| (f64::from(*b) - f64::from(*a)).abs();
    a.iter().zip(b).map(move |(a, b)| a.iter().zip(b).map(difference).fold(0.0, f64::max))
}

/// Mean of `f` over all channels of two images of the same size.
pub fn mean_over(a: &[[f32; 3]], b: &[[f32; 3]], f: impl Fn(f64, f64) -> f64 + Sync) -> f64 {
    let (a, b) = (a.as_flattened(), b.as_flattened());
    sum_of(a.len(), |i| f(a[i].into(), b[i].into())) / a.len() as f64
}

/// Sum of `f` over `0..count`, in parts of fixed size, so that the number of threads does not change the result.
fn sum_of(count: usize, f: impl Fn(usize) -> f64 + Sync) -> f64 {
    const PART: usize = 1 << 14;
    let part = |part: usize| (part * PART..count.min((part + 1) * PART)).map(&f).sum::<f64>();
    let sums: Vec<f64> = (0..count.div_ceil(PART)).into_par_iter().map(part).collect();
    sums.iter().sum()
}

/// The worst pixels, at most one per square.
fn worst(a: &[[f32; 3]], b: &[[f32; 3]], width: u32) -> Vec<Worst> {
    let mut squares = std::collections::BTreeMap::<(u32, u32), Worst>::new();
    for (i, difference) in differences(a, b).enumerate().filter(|(_, difference)| *difference > 0.0) {
        let (x, y) = (i as u32 % width, i as u32 / width);
        let here = Worst { x, y, difference, reference: a[i], test: b[i] };
        let worst = squares.entry((y / SQUARE, x / SQUARE)).or_insert_with(|| here.clone());
        if difference > worst.difference {
            *worst = here;
        }
    }
    let mut worst: Vec<Worst> = squares.into_values().collect();
    worst.sort_by(|a, b| b.difference.total_cmp(&a.difference));
    worst.truncate(WORST);
    worst
}

#[cfg(test)]
mod tests;
