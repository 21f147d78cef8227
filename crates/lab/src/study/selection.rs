//! The settings that the page shows first: a quick one and a recommended one.

use serde::Serialize;

use super::advice::{best, comparable, fastest};
use super::data::{SettingRow, Study};

/// Peak signal-to-noise ratio in dB of an RMS error of one step of 8 bits: 20 log10(255).
const PSNR_OF_A_STEP: f64 = 48.13;

/// Settings to begin with.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Selection {
    /// Index of the fastest row.
    pub quick: usize,
    /// Index of the fastest row whose RMS error of display values is below one step of 8 bits, or of the closest row.
    pub recommended: usize,
    /// Whether the error of the recommended row is below one step of 8 bits.
    pub is_below_a_step: bool,
}

/// Selects rows that `kiln render` has options for; `None` if there are none.
pub(crate) fn select(study: &Study) -> Option<Selection> {
    let rows: Vec<&SettingRow> = comparable(&study.rows).into_iter().filter(|row| row.has_options).collect();
    let is_close = |row: &SettingRow| {
        row.limit.is_some_and(|limit| limit.psnr.is_none_or(|psnr| psnr >= PSNR_OF_A_STEP))
    };
    let quick = fastest(&rows, |_| true)?;
    let close = fastest(&rows, is_close);
    let recommended = close.or(best(&rows, study).last().copied())?;
    Some(Selection { quick: quick.id, recommended: recommended.id, is_below_a_step: close.is_some() })
}
