//! Images to be compared.

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
}

impl ComparedImage {
    /// Reads an image file: PNG and JPEG as display values, OpenEXR in the encoding that it states.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] if the file cannot be read.
    pub fn open(file: &Path) -> Result<Self> {
        let read = read_picture(file)?;
        Ok(ComparedImage {
            width: read.width,
            height: read.height,
            values: values(read.pipeline),
            pixels: read.values,
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
        }
    }

    /// Display values, 0 to 1, not rounded to 8 bits. Linear values are encoded by sRGB (IEC 61966-2-1) and clamped,
    /// without exposure or tone mapping. NaN stays NaN.
    pub fn displayed(&self) -> Vec<[f32; 3]> {
        displayed(&self.pixels, self.values)
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
