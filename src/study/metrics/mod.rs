//! How far two pictures of one size are apart: figures, where it is worst, and a map of it.
//!
//! Pictures are finite or not compared: a NaN would make every mean NaN, or vanish in a maximum, so where there is one it is
//! counted and its place given, and there are no figures. [`definitions`] says what each of them means.

mod flip;
mod heat;
mod picture;

pub use heat::{DECADES, error_map, heat_map};
pub use picture::{Picture, Values, displayed};

use rayon::prelude::*;
use serde::Serialize;

use crate::error::{Error, Result};

/// What is added to the square of the reference in relMSE, so that black does not divide by 0. Rousselle, Knaus and Zwicker,
/// "Adaptive sampling and reconstruction using greedy error minimization", 2011, section 6, have 0.01.
pub const REL_MSE_EPSILON: f64 = 0.01;

/// The most bytes for each pixel that comparing takes beside the two pictures: both as displayed, and planes of f64 for FLIP. By peak
/// memory, 163.
pub const BYTES_A_PIXEL: u64 = 176;

/// How many of the worst places are listed, each from another square of [`SQUARE`] pixels.
const WORST: usize = 5;

/// Squares that the worst places come from.
const SQUARE: u32 = 16;

/// How far a picture is from a reference.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Errors {
    /// Width of both in pixels.
    pub width: u32,
    /// Height of both in pixels.
    pub height: u32,
    /// The numbers that `max`, `rmse` and `rel_mse` are in.
    pub values: Values,
    /// Whether every channel of every pixel is the same number in both.
    pub same: bool,
    /// Pixels that are not finite.
    pub non_finite: NonFinite,
    /// The figures; none where a pixel is not finite.
    pub figures: Option<Figures>,
}

/// Pixels with a channel that is NaN or infinite.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct NonFinite {
    /// How many there are in the reference.
    pub reference: u64,
    /// How many there are in the picture that is held against it.
    pub test: u64,
    /// Column and row of the first of either, from the top left corner.
    pub first: Option<(u32, u32)>,
}

/// How far apart two finite pictures are. [`definitions`] says what is what.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figures {
    /// Largest difference of any channel.
    pub max: f64,
    /// Root of the mean square difference over all channels.
    pub rmse: f64,
    /// Mean square difference relative to the reference.
    pub rel_mse: f64,
    /// Peak signal-to-noise ratio in dB, of what a display shows; none where it shows the same.
    pub psnr: Option<f64>,
    /// Mean LDR-FLIP of what a display shows, 0 to 1.
    pub flip: f64,
    /// Share of the pixels that differ in any channel, 0 to 1.
    pub differing: f64,
    /// Where the largest differences are, largest first.
    pub worst: Vec<Worst>,
}

/// A place where pictures differ much.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Worst {
    /// Column, from the left.
    pub x: u32,
    /// Row, from the top.
    pub y: u32,
    /// Largest difference of its channels.
    pub difference: f64,
    /// The reference there.
    pub reference: [f32; 3],
    /// The other picture there.
    pub test: [f32; 3],
}

impl Errors {
    /// How far `test` is from `reference`. In the pictures' own numbers where both are in the same; otherwise both as a
    /// display shows them.
    ///
    /// # Errors
    /// [`Error::Usage`] where the sizes differ.
    pub fn between(reference: &Picture, test: &Picture) -> Result<Errors> {
        Ok(Errors::with_map(reference, test)?.0)
    }

    /// The same, and LDR-FLIP of each pixel, row by row from the top; none where a pixel is not finite.
    ///
    /// # Errors
    /// [`Error::Usage`] where the sizes differ.
    pub fn with_map(reference: &Picture, test: &Picture) -> Result<(Errors, Option<Vec<f32>>)> {
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
                worst: worst(a, b, width),
            }
        });
        // NaN is no number, and equal to none.
        let same = reference.values == test.values && reference.pixels == test.pixels;
        Ok((Errors { width, height, values, same, non_finite, figures }, map))
    }
}

impl NonFinite {
    fn of(reference: &Picture, test: &Picture) -> Self {
        let bad = |pixel: &[f32; 3]| pixel.iter().any(|c| !c.is_finite());
        let count = |picture: &Picture| picture.pixels.iter().filter(|p| bad(p)).count() as u64;
        let first = reference.pixels.iter().zip(&test.pixels).position(|(a, b)| bad(a) || bad(b));
        let place = |i: usize| (i as u32 % reference.width, i as u32 / reference.width);
        NonFinite { reference: count(reference), test: count(test), first: first.map(place) }
    }
}

/// Mean LDR-FLIP of finite display values from 0 to 1, row by row, in rows of `width` pixels.
pub fn mean_flip(a: &[[f32; 3]], b: &[[f32; 3]], width: u32) -> f64 {
    let map = flip::map(a, b, width as usize, flip::PIXELS_PER_DEGREE);
    sum_of(map.len(), |i| f64::from(map[i])) / map.len() as f64
}

/// What each figure means, as lines of `name: definition`.
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

/// The largest difference of the channels of each pixel.
fn differences<'a>(a: &'a [[f32; 3]], b: &'a [[f32; 3]]) -> impl Iterator<Item = f64> + 'a {
    let apart = |(a, b): (&f32, &f32)| (f64::from(*b) - f64::from(*a)).abs();
    a.iter().zip(b).map(move |(a, b)| a.iter().zip(b).map(apart).fold(0.0, f64::max))
}

/// The mean of `f` over all channels of two pictures of one size.
pub fn mean_over(a: &[[f32; 3]], b: &[[f32; 3]], f: impl Fn(f64, f64) -> f64 + Sync) -> f64 {
    let (a, b) = (a.as_flattened(), b.as_flattened());
    sum_of(a.len(), |i| f(a[i].into(), b[i].into())) / a.len() as f64
}

/// The sum of `f` from 0 to `count`, in parts of one size, so that threads cannot change it.
fn sum_of(count: usize, f: impl Fn(usize) -> f64 + Sync) -> f64 {
    const PART: usize = 1 << 14;
    let part = |part: usize| (part * PART..count.min((part + 1) * PART)).map(&f).sum::<f64>();
    let sums: Vec<f64> = (0..count.div_ceil(PART)).into_par_iter().map(part).collect();
    sums.iter().sum()
}

/// The worst pixels, one a square at most.
fn worst(a: &[[f32; 3]], b: &[[f32; 3]], width: u32) -> Vec<Worst> {
    let mut squares = std::collections::BTreeMap::<(u32, u32), Worst>::new();
    for (i, difference) in differences(a, b).enumerate().filter(|(_, difference)| *difference > 0.0) {
        let (x, y) = (i as u32 % width, i as u32 / width);
        let here = Worst { x, y, difference, reference: a[i], test: b[i] };
        let place = squares.entry((y / SQUARE, x / SQUARE)).or_insert_with(|| here.clone());
        if difference > place.difference {
            *place = here;
        }
    }
    let mut worst: Vec<Worst> = squares.into_values().collect();
    worst.sort_by(|a, b| b.difference.total_cmp(&a.difference));
    worst.truncate(WORST);
    worst
}

#[cfg(test)]
mod tests;
