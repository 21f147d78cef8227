//! How far one picture is from another: what a study keeps of the figures of [`crate::metrics`].

use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::metrics::{ComparedImage, Errors, Figures};

/// How far a picture is from another, [`crate::metrics::Figures`] without places.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PictureErrors {
    /// Largest difference of any channel, in the film's numbers.
    pub max: f64,
    /// Root of the mean square difference over all channels, in the film's numbers.
    pub rmse: f64,
    /// Mean square difference relative to the reference.
    pub rel_mse: f64,
    /// Peak signal-to-noise ratio in decibels of what a display shows; missing where it shows the same.
    pub psnr: Option<f64>,
    /// Mean LDR-FLIP of what a display shows, 0 to 1.
    pub flip: f64,
    /// Share of pixels that differ in any channel, 0 to 1.
    pub differing: f64,
}

impl PictureErrors {
    /// The figures of a comparison.
    pub fn of(figures: &Figures) -> Self {
        let &Figures { max, rmse, rel_mse, psnr, flip, differing, .. } = figures;
        PictureErrors { max, rmse, rel_mse, psnr, flip, differing }
    }

    /// How far `test` is from `reference`; `None` where a pixel of either is no finite number.
    ///
    /// # Errors
    /// Those of [`Errors::between`].
    pub fn between(reference: &ComparedImage, test: &ComparedImage) -> Result<Option<Self>> {
        Ok(Errors::between(reference, test)?.figures.as_ref().map(PictureErrors::of))
    }

    /// Whether there is no difference at all.
    pub fn are_none(&self) -> bool {
        self.max == 0.0 && self.differing == 0.0
    }
}
