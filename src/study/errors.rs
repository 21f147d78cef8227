//! Error figures of a comparison, as stored by a study.

use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::metrics::{ComparedImage, Errors, Figures};

/// [`crate::metrics::Figures`] without the worst pixels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PictureErrors {
    /// Largest channel difference, in film values.
    pub max: f64,
    /// Root mean square difference over all channels, in film values.
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

impl PictureErrors {
    /// The figures of a comparison.
    pub fn of(figures: &Figures) -> Self {
        let &Figures { max, rmse, rel_mse, psnr, flip, differing, .. } = figures;
        PictureErrors { max, rmse, rel_mse, psnr, flip, differing }
    }

    /// Errors of `test` against `reference`; `None` if a pixel is not finite.
    ///
    /// # Errors
    /// Those of [`Errors::between`].
    pub fn between(reference: &ComparedImage, test: &ComparedImage) -> Result<Option<Self>> {
        Ok(Errors::between(reference, test)?.figures.as_ref().map(PictureErrors::of))
    }

    /// Whether the pictures are equal.
    pub fn are_none(&self) -> bool {
        self.max == 0.0 && self.differing == 0.0
    }
}
