//! Images to be compared.

use std::borrow::Cow;
use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;

use crate::error::Result;
use crate::film::read::read_picture;
use crate::film::{ColourPipeline, Film};

/// Encoding of pixel values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Values {
    /// Display values: nominally 0 to 1, sRGB-encoded.
    Display,
    /// Linear values.
    Linear,
}

impl Values {
    /// Name in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Values::Display => "display",
            Values::Linear => "linear",
        }
    }
}

/// An image to be compared.
#[derive(Debug, Clone, PartialEq)]
pub struct ComparedImage {
    /// Width in pixels, 1 or more.
    pub width: u32,
    /// Height in pixels, 1 or more.
    pub height: u32,
    /// Encoding of `pixels`.
    pub values: Values,
    /// `width * height` pixels of red, green and blue; row 0 is the top row.
    pub pixels: Vec<[f32; 3]>,
    /// Alpha; `None` if all pixels are opaque.
    pub alpha: Option<Alpha>,
}

/// The alpha channel of an image.
#[derive(Debug, Clone, PartialEq)]
pub struct Alpha {
    /// Alpha per pixel, 0 to 1.
    pub values: Vec<f32>,
    /// Whether colours are associated (multiplied by alpha), as in OpenEXR.
    pub is_associated: bool,
}

impl ComparedImage {
    /// Reads an image file: PNG and JPEG as display values, OpenEXR in the encoding that it states.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] if the file cannot be read.
    pub fn open(file: &Path) -> Result<Self> {
        let read = read_picture(file)?;
        // Decided by the contents of the file, not its name.
        let is_associated = read.is_exr;
        Ok(ComparedImage {
            width: read.width,
            height: read.height,
            values: values(read.pipeline),
            pixels: read.values,
            alpha: read.alpha.map(|values| Alpha { values, is_associated }),
        })
    }

    /// The pixels of a film in the encoding of its pipeline, not rounded to 8 bits.
    pub fn of_film(film: &Film, pipeline: ColourPipeline) -> Self {
        let window = film.window();
        ComparedImage {
            width: window.width,
            height: window.height,
            values: values(pipeline),
            pixels: film.rows().collect(),
            alpha: None,
        }
    }

    /// Display values, 0 to 1, not rounded to 8 bits. Linear values are encoded by sRGB (IEC 61966-2-1) and clamped,
    /// without exposure or tone mapping. NaN stays NaN. Colours are unassociated, and black where alpha is 0.
    pub fn displayed(&self) -> Vec<[f32; 3]> {
        let Some(Alpha { values, is_associated }) = &self.alpha else {
            return displayed(&self.pixels, self.values);
        };
        let straight = |(pixel, &alpha): (&[f32; 3], &f32)| match alpha {
            0.0 => [0.0; 3],
            _ if *is_associated => pixel.map(|c| c / alpha),
            _ => *pixel,
        };
        let straight: Vec<[f32; 3]> = self.pixels.iter().zip(values).map(straight).collect();
        displayed(&straight, self.values)
    }

    /// The image in display values ([`ComparedImage::displayed`]).
    pub fn into_displayed(self) -> Self {
        let pixels = self.displayed();
        let alpha = self.alpha.map(|alpha| Alpha { is_associated: false, ..alpha });
        ComparedImage { pixels, values: Values::Display, alpha, ..self }
    }

    /// Alpha per pixel; 1 without an alpha channel.
    pub(super) fn alphas(&self) -> Cow<'_, [f32]> {
        self.alpha
            .as_ref()
            .map_or_else(|| vec![1.0; self.pixels.len()].into(), |alpha| (&alpha.values[..]).into())
    }

    /// Whether both images have the same encoding and association of alpha.
    pub(super) fn is_stored_like(&self, other: &ComparedImage) -> bool {
        let is_associated = |image: &ComparedImage| image.alpha.as_ref().map(|alpha| alpha.is_associated);
        let differs = is_associated(self).zip(is_associated(other)).is_some_and(|(a, b)| a != b);
        self.values == other.values && !differs
    }
}

/// Display values of `pixels`: see [`ComparedImage::displayed`].
pub fn displayed(pixels: &[[f32; 3]], values: Values) -> Vec<[f32; 3]> {
    let pipeline = match values {
        Values::Display => ColourPipeline::Display,
        Values::Linear => ColourPipeline::Linear,
    };
    pixels.par_iter().map(|pixel| pixel.map(|c| pipeline.displayed(c.into()) as f32)).collect()
}

fn values(pipeline: ColourPipeline) -> Values {
    match pipeline {
        ColourPipeline::Display | ColourPipeline::U8 => Values::Display,
        ColourPipeline::Linear => Values::Linear,
    }
}
