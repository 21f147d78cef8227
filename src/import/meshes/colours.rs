//! Colours of vertices and faces in the conventions of exporters, for PLY, OFF and OBJ.

use std::fmt::Display;
use std::ops::Range;
use std::path::Path;

use glam::DVec3;

use crate::error::Warnings;
use crate::film::colour::srgb_decode;
use crate::scene::{Attribute, Mesh};

/// Largest floating-point value that is read on a scale of 0 to 1. On a scale of 0 to 255, a mesh without larger values
/// would be nearly black.
pub(crate) const MAX_UNIT: f64 = 2.0;

/// Value of white of floating-point colours up to `largest`: 255 above [`MAX_UNIT`], or above 1 if all are whole
/// numbers, with a note about `what`; else 1. Other values above 1 stem from rounding or high dynamic range.
pub(crate) fn white_of_floats(
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

/// Notes that textures take the place of the colours of vertices and faces, which are often baked into both.
pub(crate) fn note_textured(file: &Path, warnings: &mut Warnings) {
    let what = "colours of textured faces are left out, because they would darken the texture";
    warnings.note_left_out(format!("{}: {what}", file.display()));
}

/// Undecoded colours and opacities of vertices or faces.
pub(crate) struct Colours {
    /// Red, green, blue and alpha.
    pub values: Vec<[f64; 4]>,
    /// Value of white per channel; 1 for floating-point numbers.
    pub white: [f64; 4],
    /// Of faces: the index of the colour of each triangle.
    pub triangles: Option<Vec<[u32; 3]>>,
}

impl Colours {
    /// No colours of faces.
    pub(crate) fn of_faces(white: [f64; 4]) -> Self {
        Colours { values: Vec::new(), white, triangles: Some(Vec::new()) }
    }

    /// Adds the colour of a face of `count` triangles; none if it has no triangles.
    pub(crate) fn push_face(&mut self, colour: [f64; 4], count: usize) {
        if count > 0 {
            let triangles = std::iter::repeat_n([self.values.len() as u32; 3], count);
            self.triangles.get_or_insert_default().extend(triangles);
            self.values.push(colour);
        }
    }

    /// Largest finite value of some channels, and whether all are whole numbers.
    pub(crate) fn range(&self, channels: Range<usize>) -> (f64, bool) {
        let finite = || {
            self.values.iter().flat_map(|colour| &colour[channels.clone()]).filter(|value| value.is_finite())
        };
        (finite().copied().fold(0.0, f64::max), finite().all(|value| value.fract() == 0.0))
    }

    /// Sets the white of floating-point numbers ([`white_of_floats`]).
    pub(crate) fn rescale(&mut self, file: &Path, warnings: &mut Warnings) {
        for (name, channels) in [("colours", 0..3), ("opacities", 3..4)] {
            if self.white[channels.clone()].iter().all(|&white| white == 1.0) {
                let (largest, are_whole) = self.range(channels.clone());
                let what = format!("{}: {name}", file.display());
                self.white[channels].fill(white_of_floats(largest, || are_whole, what, warnings));
            }
        }
    }

    /// Sets the colours and opacities of a mesh, rescaled and in linear light. There are no opacities if all are opaque.
    /// Opacities that are all 0, as written by some exporters, are dropped with a note.
    pub(crate) fn set(mut self, mesh: &mut Mesh, file: &Path, warnings: &mut Warnings) {
        self.rescale(file, warnings);
        let Colours { values, white, triangles } = self;
        let linear = |c: &[f64; 4]| DVec3::from([0, 1, 2].map(|i| srgb_decode(c[i] / white[i])));
        let alphas: Vec<f64> = values.iter().map(|c| c[3] / white[3]).collect();
        let is_clear = !alphas.is_empty() && alphas.iter().all(|&alpha| alpha == 0.0);
        if is_clear {
            let file = file.display();
            warnings.note(format!("{file}: colours have an alpha of 0 throughout; drawn as opaque"));
        }
        if !is_clear && alphas.iter().any(|&alpha| alpha != 1.0) {
            mesh.alphas = Some(Attribute { values: alphas, triangles: triangles.clone() });
        }
        mesh.colours = Some(Attribute { values: values.iter().map(linear).collect(), triangles });
    }
}
