//! Colours of vertices and faces in the conventions of exporters, for PLY, OFF and OBJ.

use std::fmt::Display;
use std::ops::Range;
use std::path::Path;

use glam::DVec3;

use crate::error::Warnings;
use crate::film::colour::srgb_decode;

/// Largest floating-point value that is read on a scale of 0 to 1. On a scale of 0 to 255, a mesh without larger values
/// would be nearly black.
const MAX_UNIT: f64 = 2.0;

/// Value of white of floating-point colours up to `largest`: 255 above [`MAX_UNIT`], or above 1 if all are whole
/// numbers, with a note about `what`; else 1. Other values above 1 stem from rounding or high dynamic range.
pub(super) fn white_of_floats(
    largest: f64,
    are_whole: impl FnOnce() -> bool,
    what: impl Display,
    warnings: &mut Warnings,
) -> f64 {
    if largest > MAX_UNIT || largest > 1.0 && are_whole() {
        warnings.note(format!("{what} up to {largest} are read on a scale of 0 to 255"));
        return 255.0;
    }
    1.0
}

/// Undecoded colours and opacities of vertices or faces.
pub(super) struct Colours {
    /// Red, green, blue and alpha.
    pub values: Vec<[f64; 4]>,
    /// Value of white per channel; 1 for floating-point numbers.
    pub white: [f64; 4],
}

impl Colours {
    /// Largest finite value of some channels, and whether all are whole numbers.
    pub(super) fn range(&self, channels: Range<usize>) -> (f64, bool) {
        let finite = || {
            self.values.iter().flat_map(|colour| &colour[channels.clone()]).filter(|value| value.is_finite())
        };
        (finite().copied().fold(0.0, f64::max), finite().all(|value| value.fract() == 0.0))
    }

    /// Sets the white of floating-point numbers ([`white_of_floats`]).
    pub(super) fn rescale(&mut self, file: &Path, warnings: &mut Warnings) {
        for (name, channels) in [("colours", 0..3), ("opacities", 3..4)] {
            if self.white[channels.clone()].iter().all(|&white| white == 1.0) {
                let (largest, are_whole) = self.range(channels.clone());
                let what = format!("{}: {name}", file.display());
                self.white[channels].fill(white_of_floats(largest, || are_whole, what, warnings));
            }
        }
    }

    /// Returns linear colours and opacities, rescaled; `None` if all are opaque. Opacities that are all 0, as written
    /// by some exporters, are dropped with a note.
    pub(super) fn decoded(mut self, file: &Path, warnings: &mut Warnings) -> (Vec<DVec3>, Option<Vec<f64>>) {
        self.rescale(file, warnings);
        let Colours { values, white } = self;
        let linear = |c: &[f64; 4]| {
            DVec3::new(
                srgb_decode(c[0] / white[0]),
                srgb_decode(c[1] / white[1]),
                srgb_decode(c[2] / white[2]),
            )
        };
        let alphas: Vec<f64> = values.iter().map(|c| c[3] / white[3]).collect();
        let is_clear = !alphas.is_empty() && alphas.iter().all(|&alpha| alpha == 0.0);
        if is_clear {
            let file = file.display();
            warnings.note(format!("{file}: colours have an alpha of 0 throughout; drawn as opaque"));
        }
        let alphas = Some(alphas).filter(|alphas| !is_clear && alphas.iter().any(|&alpha| alpha != 1.0));
        (values.iter().map(linear).collect(), alphas)
    }
}
