//! The plot of error against time, `study.svg`.

use super::advice::{best, comparable};
use super::data::{SettingRow, Study};
use super::work::distinct;
use crate::bench::plot::{Mark, Scatter};

/// Width, and height without the legend, in pixels.
const SIZE: [f64; 2] = [560.0, 400.0];

/// Plot of the RMS error against the limit over the render time, for all comparable settings, with the Pareto front, whose
/// rows are filled and labelled.
pub fn error_against_time(study: &Study) -> String {
    let rows = comparable(&study.rows);
    let best = best(&rows, study);
    // All parameters of the study, so that each has the same colour as on the page.
    let groups = distinct(study.rows.iter().map(|row| row.parameter.as_str()));
    let mark = |row: &&SettingRow| {
        let is_best = best.iter().any(|best| best.id == row.id);
        Mark {
            x: row.trace_ms,
            y: 255.0 * row.limit.map_or(f64::NAN, |limit| limit.rmse),
            group: groups.iter().position(|group| *group == row.parameter).unwrap_or(0),
            is_filled: is_best,
            label: if is_best { label(row) } else { String::new() },
        }
    };
    let is_present = |(name, _): &(&str, usize)| rows.iter().any(|row| row.parameter == *name);
    let floor = Some(255.0 * study.noise_floor()).filter(|floor| *floor > 0.0);
    let plot = Scatter {
        size: SIZE,
        text: 13.0,
        axes: ["time of the picture, milliseconds", "RMS error, steps of 255"],
        marks: rows.iter().map(mark).collect(),
        floor: floor.map(|floor| (floor, "noise of the limit")),
        groups: groups.iter().copied().zip(0..).filter(is_present).collect(),
        joined: best.iter().filter_map(|best| rows.iter().position(|row| row.id == best.id)).collect(),
    };
    plot.svg()
}

/// Short name of a setting: without what is in brackets, and with its parameter if it begins with a number that is not a count.
fn label(row: &SettingRow) -> String {
    let name = row.setting.split(" (").next().unwrap_or_default();
    if name.parse::<f64>().is_ok() { format!("{} {name}", row.parameter) } else { name.to_owned() }
}
