//! Error metrics between two images of the same size: figures, the worst pixels, and error maps; [`t_test`] for noisy ones.
//!
//! Non-finite pixels are counted; if there are any, there are no figures, as NaN spreads to means and is lost in
//! maxima. [`definitions`] defines the figures.

mod compared_image;
pub mod distributions;
mod flip;
mod heat;
pub mod t_test;

pub use compared_image::{Alpha, ComparedImage, Values, displayed};
pub use heat::{error_map, heat_map};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Added to the squared reference in relMSE, so that the divisor is not 0 for black (Rousselle, Knaus and Zwicker,
/// "Adaptive sampling and reconstruction using greedy error minimization", 2011, section 6).
pub const REL_MSE_EPSILON: f64 = 0.01;

/// Upper bound of the memory for a comparison, in bytes per pixel, in addition to the two images: their display values
/// and planes of f64 for FLIP. Measured by peak memory: 163.
pub const BYTES_PER_PIXEL: u64 = 176;

/// Additional bytes per pixel of pictures with alpha: two composites, two alpha channels, and a second FLIP map.
pub const BYTES_PER_PIXEL_OF_ALPHA: u64 = 2 * (12 + 4) + 4;

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
    /// Largest difference of alpha; `None` if both pictures are opaque.
    pub alpha: Option<f64>,
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
    /// Fraction of pixels with a channel whose display values differ by more than one of 255 steps, 0 to 1.
    #[serde(default)]
    pub beyond_step: f64,
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
    /// Alpha of the reference and of the tested image; `None` if both images are opaque.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha: Option<[f32; 2]>,
}

impl Errors {
    /// Compares `test` with `reference`: in their encoding if both have the same, otherwise in display values. Alpha of
    /// either counts as a fourth channel, 1 in a picture without; PSNR and FLIP are the worse of the composites over
    /// black and over white.
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
        let is_stored_alike = reference.is_stored_like(test);
        let (values, a, b) = if is_stored_alike {
            (reference.values, &reference.pixels[..], &test.pixels[..])
        } else {
            (Values::Display, &displayed.0[..], &displayed.1[..])
        };
        let non_finite = NonFinite::of(reference, test);
        let has_alpha = reference.alpha.is_some() || test.alpha.is_some();
        let alphas = has_alpha.then(|| [reference.alphas(), test.alphas()]);
        let pair = Pair { a, b, alphas: alphas.as_ref().map(|[a, b]| [&a[..], &b[..]]) };
        let shown = (non_finite.first.is_none()).then(|| Shown::of(&displayed, pair.alphas, width));
        let figures = shown.as_ref().map(|Shown { mean_square, map }| Figures {
            max: pair.differences().max_by(f64::total_cmp).unwrap_or(0.0),
            rmse: pair.mean(|a, b| (a - b) * (a - b)).sqrt(),
            rel_mse: pair.mean(|a, b| (a - b) * (a - b) / (a * a + REL_MSE_EPSILON)),
            psnr: (*mean_square > 0.0).then(|| -10.0 * mean_square.log10()),
            flip: sum_of(map.len(), |i| f64::from(map[i])) / map.len() as f64,
            differing: sum_of(a.len(), |i| f64::from(u8::from(pair.differs(i)))) / a.len() as f64,
            beyond_step: share_beyond_step(&displayed.0, &displayed.1),
        });
        let worst = if figures.is_some() { pair.worst(width) } else { Vec::new() };
        let alpha = pair.alphas.map(|[a, b]| {
            a.iter().zip(b).map(|(a, b)| (f64::from(*b) - f64::from(*a)).abs()).fold(0.0, f64::max)
        });
        // NaN is not equal to NaN.
        let same = is_stored_alike && (0..a.len()).all(|i| !pair.differs(i));
        let map = shown.map(|shown| shown.map);
        Ok((Errors { width, height, values, same, alpha, non_finite, figures, worst }, map))
    }
}

/// Two images of the same size: colours, and alphas if either has alpha.
struct Pair<'a> {
    a: &'a [[f32; 3]],
    b: &'a [[f32; 3]],
    alphas: Option<[&'a [f32]; 2]>,
}

impl Pair<'_> {
    fn differs(&self, pixel: usize) -> bool {
        self.a[pixel] != self.b[pixel] || self.alphas.is_some_and(|[a, b]| a[pixel] != b[pixel])
    }

    /// Largest difference of a channel, for each pixel.
    fn differences(&self) -> impl Iterator<Item = f64> + '_ {
        let alpha = |i: usize| self.alphas.map_or(0.0, |[a, b]| (f64::from(b[i]) - f64::from(a[i])).abs());
        differences(self.a, self.b).enumerate().map(move |(i, difference)| difference.max(alpha(i)))
    }

    /// Mean of `f` over all channels.
    fn mean(&self, f: impl Fn(f64, f64) -> f64 + Sync) -> f64 {
        let colours = mean_over(self.a, self.b, &f);
        let Some([a, b]) = self.alphas else { return colours };
        let alpha = sum_of(a.len(), |i| f(a[i].into(), b[i].into())) / a.len() as f64;
        (3.0 * colours + alpha) / 4.0
    }

    /// The worst pixels, at most one per square.
    fn worst(&self, width: u32) -> Vec<Worst> {
        let mut squares = std::collections::BTreeMap::<(u32, u32), Worst>::new();
        for (i, difference) in self.differences().enumerate().filter(|(_, difference)| *difference > 0.0) {
            let (x, y) = (i as u32 % width, i as u32 / width);
            let alpha = self.alphas.map(|[a, b]| [a[i], b[i]]);
            let here = Worst { x, y, difference, reference: self.a[i], test: self.b[i], alpha };
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
}

/// Errors of displayed values; with alpha, the worse of the composites over black and over white.
struct Shown {
    mean_square: f64,
    /// LDR-FLIP of each pixel.
    map: Vec<f32>,
}

impl Shown {
    fn of((a, b): &(Vec<[f32; 3]>, Vec<[f32; 3]>), alphas: Option<[&[f32]; 2]>, width: u32) -> Self {
        let of = |a: &[[f32; 3]], b: &[[f32; 3]]| Shown {
            mean_square: mean_over(a, b, |a, b| (a - b) * (a - b)),
            map: flip::map(a, b, width as usize, flip::PIXELS_PER_DEGREE),
        };
        let Some([alphas_a, alphas_b]) = alphas else { return of(a, b) };
        let over = |pixels: &[[f32; 3]], alphas: &[f32], background: f32| -> Vec<[f32; 3]> {
            let one =
                |(pixel, &alpha): (&[f32; 3], &f32)| pixel.map(|c| c * alpha + background * (1.0 - alpha));
            pixels.iter().zip(alphas).map(one).collect()
        };
        let [black, white] =
            [0.0, 1.0].map(|background| of(&over(a, alphas_a, background), &over(b, alphas_b, background)));
        Shown {
            mean_square: black.mean_square.max(white.mean_square),
            map: black.map.iter().zip(&white.map).map(|(a, b)| a.max(*b)).collect(),
        }
    }
}

impl NonFinite {
    fn of(reference: &ComparedImage, test: &ComparedImage) -> Self {
        let bad = |picture: &ComparedImage, i: usize| {
            picture.pixels[i].iter().any(|c| !c.is_finite())
                || picture.alpha.as_ref().is_some_and(|alpha| !alpha.values[i].is_finite())
        };
        let all = 0..reference.pixels.len();
        let count = |picture: &ComparedImage| all.clone().filter(|&i| bad(picture, i)).count() as u64;
        let first = all.clone().find(|&i| bad(reference, i) || bad(test, i));
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
pub fn definitions() -> [(&'static str, String); 7] {
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
        (
            "beyond_step",
            "share of those that a display shows more than one of 255 steps apart, 0 to 1".into(),
        ),
    ]
}

/// Largest channel difference of each pixel.
fn differences<'a>(a: &'a [[f32; 3]], b: &'a [[f32; 3]]) -> impl Iterator<Item = f64> + 'a {
    let difference = |(a, b): (&f32, &f32)| (f64::from(*b) - f64::from(*a)).abs();
    a.iter().zip(b).map(move |(a, b)| a.iter().zip(b).map(difference).fold(0.0, f64::max))
}

/// Display values further apart than this differ by more than one of 255 steps and the rounding of both to f32.
pub const BEYOND_STEP: f64 = 1.0 / 255.0 + f32::EPSILON as f64;

/// The share of pixels with a channel whose display values differ by more than [`BEYOND_STEP`].
fn share_beyond_step(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    differences(a, b).filter(|difference| *difference > BEYOND_STEP).count() as f64 / a.len() as f64
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

#[cfg(test)]
mod tests;
