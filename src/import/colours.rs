//! Colours of vertices and faces in the conventions of exporters, for PLY and OFF.

use glam::DVec3;

use crate::error::Warnings;
use crate::film::colour::srgb_decode;

/// Undecoded colours and opacities of vertices or faces.
#[derive(Default)]
pub(super) struct Colours {
    /// Red, green, blue and alpha.
    pub values: Vec<[f64; 4]>,
    /// Value of white per channel.
    pub white: [f64; 4],
    /// Whether the values are floating-point numbers, with white at 1.
    pub is_float: bool,
}

/// Largest floating-point value that is read on a scale of 0 to 1. On a scale of 0 to 255, a mesh without larger values
/// would be nearly black.
const MOST: f64 = 2.0;

impl Colours {
    /// Returns linear colours and opacities; `None` if all are opaque. Floating-point values above [`MOST`] are divided
    /// by 255, and opacities that are all 0, as written by some exporters, are dropped; both add a note that begins
    /// with `about`.
    pub(super) fn decoded(mut self, about: &str, warnings: &mut Warnings) -> (Vec<DVec3>, Option<Vec<f64>>) {
        let largest = |of: fn(&[f64; 4]) -> f64| self.values.iter().map(of).fold(0.0, f64::max);
        if self.is_float {
            let (colour, alpha) = (largest(|c| c[0].max(c[1]).max(c[2])), largest(|c| c[3]));
            for (channels, most) in [(0..3, colour), (3..4, alpha)] {
                if most > MOST && most <= 255.0 {
                    warnings
                        .note(format!("{about} values up to {most}, which are taken as those of 0 to 255"));
                    self.white[channels].fill(255.0);
                }
            }
        }
        let Colours { values, white, .. } = self;
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
            warnings.note(format!("{about} an alpha of 0 throughout; drawn as opaque"));
        }
        let alphas = Some(alphas).filter(|alphas| !is_clear && alphas.iter().any(|&alpha| alpha != 1.0));
        (values.iter().map(linear).collect(), alphas)
    }
}
