//! A picture to be compared: its pixels, and what their numbers are.

use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;

use crate::error::Result;
use crate::film::read::read_picture;
use crate::film::{ColourPipeline, Film};

/// What the numbers of a picture are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Values {
    /// What a display shows: nominally 0 to 1, encoded by sRGB.
    Display,
    /// Linear light.
    Linear,
}

impl Values {
    /// The name, as JSON has it.
    pub fn name(self) -> &'static str {
        match self {
            Values::Display => "display",
            Values::Linear => "linear",
        }
    }
}

/// A picture to be compared.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Width in pixels, 1 or more.
    pub width: u32,
    /// Height in pixels, 1 or more.
    pub height: u32,
    /// What the numbers are.
    pub values: Values,
    /// `width * height` pixels of red, green and blue, row by row from the top.
    pub pixels: Vec<[f32; 3]>,
}

impl Picture {
    /// A picture in a file: PNG and JPEG in display values, OpenEXR in its own numbers.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] where the file cannot be used.
    pub fn open(file: &Path) -> Result<Self> {
        let read = read_picture(file)?;
        Ok(Picture {
            width: read.width,
            height: read.height,
            values: values(read.pipeline),
            pixels: read.values,
        })
    }

    /// A rendered picture, in the film's own numbers: those of its pipeline, not rounded to 8 bits.
    pub fn of_film(film: &Film, pipeline: ColourPipeline) -> Self {
        let window = film.window();
        Picture {
            width: window.width,
            height: window.height,
            values: values(pipeline),
            pixels: film.rows().collect(),
        }
    }

    /// What a display shows of each pixel, 0 to 1: linear light encoded by sRGB (IEC 61966-2-1), then clamped, without any
    /// exposure or tone mapping; not rounded to 8 bits. NaN stays NaN.
    pub fn displayed(&self) -> Vec<[f32; 3]> {
        displayed(&self.pixels, self.values)
    }
}

/// What a display shows of `pixels`: see [`Picture::displayed`].
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
