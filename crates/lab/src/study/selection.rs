//! The settings that the page shows first: a quick one and a recommended one.

use super::advice::{best, comparable};
use super::data::{SettingRow, Study};

/// Peak signal-to-noise ratio in dB of an RMS error of one step of 8 bits: 20 log10(255).
const PSNR_OF_A_STEP: f64 = 48.13;

/// Settings to begin with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Selection {
    /// Index of the fastest row.
    pub quick: usize,
    /// Index of the fastest row whose RMS error of display values is below one step of 8 bits, or of the closest row.
    pub recommended: usize,
    /// Whether the error of the recommended row is below one step of 8 bits.
    pub is_below_a_step: bool,
}

/// Selects rows of the Pareto front that `kiln render` has options for; `None` if there are none.
pub(crate) fn select(study: &Study) -> Option<Selection> {
    let rows: Vec<&SettingRow> = comparable(&study.rows).into_iter().filter(|row| row.has_options).collect();
    let best = best(&rows, study);
    let is_close = |row: &&&SettingRow| {
        row.limit.is_some_and(|limit| limit.psnr.is_none_or(|psnr| psnr >= PSNR_OF_A_STEP))
    };
    let close = best.iter().find(is_close);
    let recommended = close.or(best.last())?;
    Some(Selection { quick: best.first()?.id, recommended: recommended.id, is_below_a_step: close.is_some() })
}
