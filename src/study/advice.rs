//! What to choose: the cheapest setting below an error, and what one step along a knob costs and buys.

use serde::{Deserialize, Serialize};

use super::data::{Quartiles, Row, Told};
use super::pareto::front;

/// For an error below so much, what is cheapest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Advice {
    /// The root mean square error that is not to be exceeded.
    pub below: f64,
    /// The row that is cheapest; missing where no setting measured is good enough.
    pub row: Option<usize>,
    /// The advice as a sentence.
    pub text: String,
}

/// From one setting of a knob to the next.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// The knob.
    pub knob: String,
    /// The row that it starts from.
    pub from: usize,
    /// The row that it leads to.
    pub to: usize,
    /// Its time, in parts of the time before.
    pub time_ratio: f64,
    /// Whether the times differ by more than their quartiles.
    pub time_is_apart: bool,
    /// The error before, root mean square.
    pub error_before: Option<f64>,
    /// The error after.
    pub error_after: Option<f64>,
}

/// The rows that are alternatives for one another: finite, and with the limit of the first row's filter.
pub fn comparable(rows: &[Row]) -> Vec<&Row> {
    let filter = rows.first().map(|row| row.filter.clone());
    rows.iter().filter(|row| row.limit.is_some() && Some(&row.filter) == filter.as_ref()).collect()
}

/// Of each of `rows`, its time and its error against the limit.
pub fn points(rows: &[&Row]) -> Vec<[f64; 2]> {
    rows.iter().map(|row| [row.trace_ms.median, row.limit.map_or(f64::NAN, |limit| limit.rmse)]).collect()
}

/// Advice at round errors between the best and the worst that were measured.
pub fn advice(rows: &[Row]) -> Vec<Advice> {
    let rows = comparable(rows);
    let points = points(&rows);
    let front = front(&points);
    let worst = points.iter().map(|point| point[1]).fold(0.0, f64::max);
    let best = points.iter().map(|point| point[1]).fold(f64::INFINITY, f64::min);
    let mut advice = Vec::new();
    for below in round_errors(best, worst) {
        let row = front.iter().find(|&&i| points[i][1] < below).map(|&i| rows[i]);
        let text = match row {
            Some(row) => format!(
                "for an error below {below} (root mean square; 1 is white), the cheapest setting measured was {}: {} ms, error {:.1e}{}{}{}",
                row.name(),
                brief(row.trace_ms),
                row.limit.map_or(f64::NAN, |limit| limit.rmse),
                if row.told == Told::Within { ", which the reference's own error blurs" } else { "" },
                match (row.has_options, row.options.as_str()) {
                    (true, "") => String::new(),
                    (true, options) => format!("; `{options}`"),
                    (false, _) => "; no options of `kiln render` make it".into(),
                },
                as_quick(row, &rows, below),
            ),
            None => format!("no setting measured has an error below {below}; `--full` tries more samples"),
        };
        advice.push(Advice { below, row: row.map(|row| row.id), text });
    }
    advice
}

/// Other pictures below an error whose times cannot be told from that of `row`.
fn as_quick(row: &Row, rows: &[&Row], below: f64) -> String {
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
        1 | 2 => format!("; as quick within the quartiles: {}", names.join(", ")),
        more => format!("; {more} others are as quick within the quartiles"),
    }
}

/// A median with its quartiles.
pub fn brief(ms: Quartiles) -> String {
    let digits = if ms.median < 10.0 { 2 } else { usize::from(ms.median < 100.0) };
    format!("{:.digits$} ({:.digits$} to {:.digits$})", ms.median, ms.lower, ms.upper)
}

/// 0.1, 0.05, 0.02, …: from the last above `worst` to the first below `best`, at most six of them.
fn round_errors(best: f64, worst: f64) -> Vec<f64> {
    if !(worst > 0.0 && best.is_finite()) {
        return Vec::new();
    }
    let all = (-9..1i32)
        .rev()
        .flat_map(|power| [5.0, 2.0, 1.0].map(|digit| format!("{digit}e{power}").parse().unwrap_or(1.0)));
    let inside: Vec<f64> = all.filter(|&below: &f64| below < worst).collect();
    let count = inside.iter().take_while(|&&below| below > best).count() + 1;
    inside.into_iter().take(count.min(6)).collect()
}

/// The steps along each knob, in the order of its settings.
pub fn steps(rows: &[Row]) -> Vec<Step> {
    let pairs = rows.windows(2).filter(|pair| pair[0].knob == pair[1].knob && pair[0].knob != "together");
    pairs
        .map(|pair| {
            let [from, to] = [&pair[0], &pair[1]];
            Step {
                knob: from.knob.clone(),
                from: from.id,
                to: to.id,
                time_ratio: to.trace_ms.median / from.trace_ms.median,
                time_is_apart: to.trace_ms.is_apart_from(&from.trace_ms),
                error_before: from.errors().map(|errors| errors.rmse),
                error_after: to.errors().map(|errors| errors.rmse),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_to_ask_for_are_round_and_within_reach() {
        // Below 0.03 come 0.02, 0.01, 0.005 and 0.002; 0.001 is the first that nothing reaches.
        assert_eq!(round_errors(0.0015, 0.03), [0.02, 0.01, 0.005, 0.002, 0.001]);
        assert!(round_errors(0.0, 0.0).is_empty());
    }
}
