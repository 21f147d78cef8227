//! Recommendations: the fastest setting below an error bound; time and error differences between adjacent settings.

use serde::{Deserialize, Serialize};

use super::data::{SettingRow, Significance, Study};
use super::pareto::{TimedError, front};
use super::path_sweep;
use crate::timing::Quartiles;
use kiln::bvh::Numerics;

/// The fastest setting below an error bound.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Advice {
    /// Upper bound of the RMS error; 1 is white.
    pub below: f64,
    /// Index of the fastest row below the bound, if there is one.
    pub row: Option<usize>,
    /// The advice as a sentence.
    pub text: String,
}

/// Comparison of adjacent settings of a parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterStep {
    /// Name of the parameter.
    pub parameter: String,
    /// Index of the first row.
    pub from: usize,
    /// Index of the second row.
    pub to: usize,
    /// Ratio of the second median time to the first, with the spread of both.
    pub time_ratio: Quartiles,
    /// Whether the quartile ranges of the times are disjoint.
    pub time_is_significant: bool,
    /// Error of the first row: RMS, or relMSE if `is_relative`.
    pub error_before: Option<f64>,
    /// Error of the second row.
    pub error_after: Option<f64>,
    /// Whether errors are relMSE, as for path tracing: bright pixels dominate its RMS error.
    #[serde(default, skip_serializing_if = "is_false")]
    pub is_relative: bool,
}

/// For serde.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes fields by reference")]
fn is_false(value: &bool) -> bool {
    !value
}

/// Rows whose accuracy can be compared: those with finite pixels and the filter of the first row, without an effect
/// turned off, which is another picture, and without acceleration structures, which all give the same picture.
pub(crate) fn comparable(rows: &[SettingRow]) -> Vec<&SettingRow> {
    let filter = rows.first().map(|row| row.filter.clone());
    let is_comparable = |row: &&SettingRow| {
        let is_accuracy = !row.has_effect_off && row.parameter != "bvh";
        is_accuracy && row.limit.is_some() && Some(&row.filter) == filter.as_ref()
    };
    rows.iter().filter(is_comparable).collect()
}

/// Time and error of each row; NaN for a missing error.
pub(crate) fn points(rows: &[&SettingRow], error: impl Fn(&SettingRow) -> Option<f64>) -> Vec<TimedError> {
    rows.iter().map(|row| TimedError { time: row.trace_ms, error: error(row).unwrap_or(f64::NAN) }).collect()
}

/// Rows of the Pareto front of time and RMS error against the limit.
pub(crate) fn best<'a>(rows: &[&'a SettingRow], study: &Study) -> Vec<&'a SettingRow> {
    let points = points(rows, |row| row.limit.map(|limit| limit.rmse));
    front(&points, study.noise_floor()).into_iter().map(|index| rows[index]).collect()
}

/// Rows of the Pareto front of time and relMSE against the limit, of samples and the parameters of path tracing: RMSE is
/// dominated by what is bright, such as the edges of visible lights.
pub(crate) fn best_of_paths<'a>(rows: &[&'a SettingRow]) -> Vec<&'a SettingRow> {
    let is_of_paths =
        |name: &str| path_sweep::PARAMETERS.contains(&name) || ["samples", "together"].contains(&name);
    let rows: Vec<&SettingRow> = rows.iter().copied().filter(|row| is_of_paths(&row.parameter)).collect();
    let points = points(&rows, |row| row.limit.map(|limit| limit.rel_mse));
    front(&points, 0.0).into_iter().map(|index| rows[index]).collect()
}

/// Recommendations for round error bounds between the smallest and the largest measured error.
pub fn advice(rows: &[SettingRow]) -> Vec<Advice> {
    let rows = comparable(rows);
    let error = |row: &SettingRow| row.limit.map_or(f64::NAN, |limit| limit.rmse);
    let worst = rows.iter().map(|row| error(row)).fold(0.0, f64::max);
    let best = rows.iter().map(|row| error(row)).fold(f64::INFINITY, f64::min);
    let mut advice = Vec::new();
    for steps in round_errors(255.0 * best, 255.0 * worst) {
        let below = steps / 255.0;
        let row = fastest(&rows, |row| error(row) < below);
        let text = match row {
            Some(row) => format!(
                "fastest setting with an RMS error below {steps} of 255 steps: {}: {} ms, error {}{}{}{}",
                row.name(),
                brief(row.trace_ms),
                scientific(255.0 * error(row)),
                if row.significance == Significance::Insignificant {
                    ", not significant beside the noise of the reference"
                } else {
                    ""
                },
                match (row.has_options, row.options.as_str()) {
                    (true, "") => String::new(),
                    (true, options) => format!("; `{options}`"),
                    (false, _) => "; no options of `kiln render` give it".into(),
                },
                equally_fast(row, &rows, below),
            ),
            None => format!(
                "no measured setting has an RMS error below {steps} of 255 steps; `--full` measures more samples"
            ),
        };
        advice.push(Advice { below, row: row.map(|row| row.id), text });
    }
    advice
}

/// The fastest of the rows that are good enough. Of those that are as fast, one that changes the least: no tier without
/// guarantees, and not two parameters together.
pub(crate) fn fastest<'a>(
    rows: &[&'a SettingRow],
    is_good: impl Fn(&SettingRow) -> bool,
) -> Option<&'a SettingRow> {
    let good = || rows.iter().copied().filter(|row| is_good(row));
    let least = good().min_by(|a, b| a.trace_ms.median.total_cmp(&b.trace_ms.median))?;
    let change = |row: &SettingRow| (row.numerics == Numerics::Fast.name(), row.parameter == "together");
    let tied = good().filter(|row| !row.trace_ms.is_apart_from(&least.trace_ms));
    tied.min_by(|a, b| change(a).cmp(&change(b)).then(a.trace_ms.median.total_cmp(&b.trace_ms.median)))
}

/// Names of rows with other pictures below the bound whose times do not differ significantly from that of `row`.
fn equally_fast(row: &SettingRow, rows: &[&SettingRow], below: f64) -> String {
    let mut seen = vec![&row.fingerprint];
    let mut names = Vec::new();
    for other in rows {
        let is_below = other.limit.is_some_and(|limit| limit.rmse < below);
        if is_below && !seen.contains(&&other.fingerprint) && !other.trace_ms.is_apart_from(&row.trace_ms) {
            seen.push(&other.fingerprint);
            names.push(other.name());
        }
    }
    match names.len() {
        0 => String::new(),
        1 | 2 => format!("; equally fast within the quartiles: {}", names.join(", ")),
        more => format!("; {more} others are equally fast within the quartiles"),
    }
}

/// Formats a median with its quartiles.
pub(crate) fn brief(ms: Quartiles) -> String {
    let digits = if ms.median < 10.0 { 2 } else { usize::from(ms.median < 100.0) };
    format!("{:.digits$} ({:.digits$} to {:.digits$})", ms.median, ms.lower, ms.upper)
}

/// Formats a number with two or more significant digits.
pub(crate) fn scientific(x: f64) -> String {
    if x == 0.0 {
        "0".into()
    } else if (0.01..1e4).contains(&x.abs()) {
        let digits = if x < 1.0 { 3 } else { 2 * usize::from(x < 100.0) };
        format!("{x:.digits$}")
    } else {
        format!("{x:.1e}")
    }
}

/// Error bounds 100, 50, 20, 10, 5, …: those below `worst`, down to the first below `best`, at most six.
fn round_errors(best: f64, worst: f64) -> Vec<f64> {
    if !(worst > 0.0 && best.is_finite()) {
        return Vec::new();
    }
    let all = (-9..3i32)
        .rev()
        .flat_map(|power| [5.0, 2.0, 1.0].map(|digit| format!("{digit}e{power}").parse().unwrap_or(1.0)));
    let inside: Vec<f64> = all.filter(|&below: &f64| below < worst).collect();
    let count = inside.iter().take_while(|&&below| below > best).count() + 1;
    inside.into_iter().take(count.min(6)).collect()
}

/// Comparisons of adjacent settings of each parameter; not of acceleration structures, which give the same picture.
pub fn steps(rows: &[SettingRow]) -> Vec<ParameterStep> {
    let pairs = rows.windows(2).filter(|pair| {
        pair[0].parameter == pair[1].parameter && !["together", "bvh"].contains(&pair[0].parameter.as_str())
    });
    pairs
        .map(|pair| {
            let [from, to] = [&pair[0], &pair[1]];
            let is_relative = path_sweep::PARAMETERS.contains(&from.parameter.as_str());
            let error = |row: &SettingRow| {
                row.errors().map(|errors| if is_relative { errors.rel_mse } else { errors.rmse })
            };
            ParameterStep {
                parameter: from.parameter.clone(),
                from: from.id,
                to: to.id,
                time_ratio: to.trace_ms.over(&from.trace_ms),
                time_is_significant: to.trace_ms.is_apart_from(&from.trace_ms),
                error_before: error(from),
                error_after: error(to),
                is_relative,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_bounds_are_round_and_in_range() {
        // 0.001 is the first bound below the best error.
        assert_eq!(round_errors(0.0015, 0.03), [0.02, 0.01, 0.005, 0.002, 0.001]);
        assert!(round_errors(0.0, 0.0).is_empty());
    }
}
