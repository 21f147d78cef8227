//! Plots of error against time.

use super::ReferenceKind;
use super::advice::{comparable, points};
use super::data::SettingRow;
use super::pareto::front;
use super::path_sweep;
use super::work::distinct;
use crate::bench::plot::{Mark, Scatter};

/// Width, and height without the legend, in pixels. Narrow screens show it at three quarters of this size, at which text
/// must be legible.
const SIZE: [f64; 2] = [560.0, 400.0];

/// Plot of the error against the limit over the render time, for all comparable settings, with the Pareto front. `floor`
/// is the noise of the limit.
pub fn error_against_time(rows: &[SettingRow], floor: f64) -> String {
    let error = |row: &SettingRow| row.limit.map(|limit| limit.rmse);
    plot(rows, &comparable(rows), error, Some(floor), "error (RMSE against the limit)")
}

/// Plot of the error against the twin over the render time, for the settings with this reference. There is no Pareto
/// front, as these parameters are independent of each other.
pub(crate) fn error_against_twin(rows: &[SettingRow]) -> String {
    let is_shown = |row: &&SettingRow| {
        row.reference == ReferenceKind::SameSamples && row.twin.is_some() && !row.has_effect_off
    };
    let shown: Vec<&SettingRow> = rows.iter().filter(is_shown).collect();
    let error = |row: &SettingRow| row.twin.map(|twin| twin.rmse);
    plot(rows, &shown, error, None, "error (RMSE, same sample points in exact)")
}

/// Plot of relMSE against the limit over the render time, for samples and the parameters of path tracing, with the Pareto
/// front; `None` where no path is traced. RMSE is dominated by what is bright, such as the edges of visible lights.
pub(crate) fn error_of_paths(rows: &[SettingRow]) -> Option<String> {
    let is_of_paths = |row: &SettingRow| path_sweep::PARAMETERS.contains(&row.parameter.as_str());
    if !rows.iter().any(is_of_paths) {
        return None;
    }
    let mut shown = comparable(rows);
    shown.retain(|row| is_of_paths(row) || ["samples", "together"].contains(&row.parameter.as_str()));
    let error = |row: &SettingRow| row.limit.map(|limit| limit.rel_mse);
    Some(plot(rows, &shown, error, Some(0.0), "error (relMSE against the limit)"))
}

/// A plot of `rows`, a part of `all`, with the Pareto front if there is a `tolerance`, the noise of the reference. Rows of
/// the front are filled and labelled; without it, those with an error.
fn plot(
    all: &[SettingRow],
    rows: &[&SettingRow],
    error: impl Fn(&SettingRow) -> Option<f64>,
    tolerance: Option<f64>,
    axis: &str,
) -> String {
    let points = points(rows, error);
    let front = tolerance.map_or(Vec::new(), |tolerance| front(&points, tolerance));
    // All parameters of the study, so that each has the same colour in every plot.
    let groups = distinct(all.iter().map(|row| row.parameter.as_str()));
    let marks = rows.iter().zip(&points).enumerate().map(|(index, (row, point))| {
        let is_labelled = if tolerance.is_some() { front.contains(&index) } else { point.error > 0.0 };
        Mark {
            x: point.time,
            y: point.error,
            group: groups.iter().position(|group| *group == row.parameter).unwrap_or(0),
            is_filled: is_labelled,
            label: if is_labelled { label(row) } else { String::new() },
        }
    });
    let is_present = |(name, _): &(&str, usize)| rows.iter().any(|row| row.parameter == *name);
    let plot = Scatter {
        size: SIZE,
        text: 13.0,
        axes: ["milliseconds", axis],
        marks: marks.collect(),
        floor: tolerance.filter(|floor| *floor > 0.0).map(|floor| (floor, "the reference's own error")),
        groups: groups.iter().copied().zip(0..).filter(is_present).collect(),
        joined: front,
    };
    plot.svg()
}

/// Short name of a setting: without what is in brackets, and with its parameter if it begins with a number that is not a count.
fn label(row: &SettingRow) -> String {
    let name = row.setting.split(" (").next().unwrap_or_default();
    if name.parse::<f64>().is_ok() { format!("{} {name}", row.parameter) } else { name.to_owned() }
}
