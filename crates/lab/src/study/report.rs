//! What follows from the data of a study: its result in a sentence, facts, what the page begins with; its JSON and page.

use std::collections::BTreeMap;

use serde::Serialize;

use super::advice::{best, best_of_paths, comparable, scientific};
use super::data::{ReferenceKind, SettingRow, Study};
use super::pictures::PageImages;
use super::selection::{Selection, select};
use crate::bench::errors::ratio;
use kiln::effects::EFFECTS;

/// The JSON of a study: its data, and what follows from them.
#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    study: &'a Study,
    /// The result in one sentence.
    headline: String,
    /// Sentences on structures, tiers and techniques.
    facts: Vec<String>,
    /// Indices of the rows whose accuracy can be compared.
    compared: Vec<usize>,
    /// Those on the Pareto front of time and RMS error.
    front: Vec<usize>,
    /// Those on the Pareto front of time and relMSE of samples and the parameters of paths.
    front_of_paths: Vec<usize>,
    /// The rows to begin with.
    selection: Option<Selection>,
    /// The command that renders the picture of each row, and of the limit.
    commands: Vec<Option<String>>,
    limit_command: Option<String>,
    /// What the effects without effect on the scene do, by name.
    meanings: BTreeMap<&'static str, &'static str>,
    /// Definitions of the errors, by name.
    definitions: [(&'static str, String); 7],
}

/// The text of `study.json`.
pub fn to_json(study: &Study) -> String {
    let compared = comparable(&study.rows);
    let ids = |rows: &[&SettingRow]| rows.iter().map(|row| row.id).collect();
    let command = |row: &SettingRow| row.has_options.then(|| study.command_with(&row.options));
    let is_left_out = |name: &str| study.left_out.iter().any(|[left_out, _]| left_out == name);
    let report = Report {
        study,
        headline: headline(study),
        facts: facts(study),
        front: ids(&best(&compared, study)),
        front_of_paths: ids(&best_of_paths(&compared)),
        compared: ids(&compared),
        selection: select(study),
        commands: study.rows.iter().map(command).collect(),
        limit_command: study.limit_options.as_ref().map(|options| study.command_with(options)),
        meanings: EFFECTS
            .iter()
            .map(|effect| (effect.name(), effect.summary))
            .filter(|(name, _)| is_left_out(name))
            .collect(),
        definitions: kiln::metrics::definitions(),
    };
    format!("{:#}\n", serde_json::json!(report))
}

/// The HTML page of a study, of its JSON and its pictures.
pub fn page(json: &str, pictures: &PageImages) -> String {
    let pictures = serde_json::json!(pictures).to_string();
    crate::page::page(include_str!("page.js"), &[("study", json), ("pictures", &pictures)])
}

/// The result in one sentence: the largest error, and what less of it costs; of a study of one parameter, what its last
/// setting costs.
pub fn headline(study: &Study) -> String {
    let largest = study.errors.iter().max_by(|a, b| a.now.beyond_step.total_cmp(&b.now.beyond_step));
    match largest {
        Some(error) if error.now.beyond_step > 0.0 => {
            format!(
                "{} of the pixels are off by more than one step of 255 ({}); `{}` leaves {} in {} times the time.",
                error.now.share(),
                error.cause,
                error.options,
                error.then.share(),
                ratio(&error.time)
            )
        }
        Some(_) => "No cause moves a pixel by more than one step of 255.".into(),
        None => match study.rows.iter().find(|row| !row.base) {
            Some(first) => {
                let last = study.rows.iter().rfind(|row| row.parameter == first.parameter);
                format!("{}.", cost_of(first, last.unwrap_or(first)))
            }
            None => "Nothing was varied.".into(),
        },
    }
}

/// What a setting costs and changes compared to another.
fn cost_of(from: &SettingRow, to: &SettingRow) -> String {
    let brief = |ratio: f64| format!("{ratio:.0$}", usize::from(ratio < 10.0));
    let ratio = ratio(&to.trace_ms.over(&from.trace_ms));
    let change = match (from.errors(), to.errors()) {
        _ if from.fingerprint == to.fingerprint => "changes no pixel".to_owned(),
        (Some(before), Some(after)) if to.reference == ReferenceKind::Limit && after.rmse > 0.0 => {
            format!("divides the RMS error by {}", brief(before.rmse / after.rmse))
        }
        (Some(before), _) => {
            format!("changes {:.2} % of the pixels by more than one step of 255", 100.0 * before.beyond_step)
        }
        _ => "changes the picture".to_owned(),
    };
    let is_same = from.parameter == to.parameter;
    let [from, to] = [from, to].map(|row| if is_same { row.setting.clone() } else { row.name() });
    format!("`{to}` costs {ratio} times `{from}` and {change}")
}

/// Sentences on acceleration structures, ray hits of the tiers and non-finite pixels.
pub fn facts(study: &Study) -> Vec<String> {
    let mut lines = Vec::new();
    let bvh: Vec<&SettingRow> = study.rows.iter().filter(|row| row.parameter == "bvh").collect();
    if !bvh.is_empty() {
        let differing: Vec<&str> = bvh
            .iter()
            .filter(|row| bvh.iter().any(|other| other.fingerprint != row.fingerprint))
            .map(|row| row.setting.as_str())
            .collect();
        lines.push(if differing.is_empty() {
            format!("All {} acceleration structures gave the same picture, to the bit.", bvh.len())
        } else {
            format!(
                "Acceleration structures gave different pictures, which is a fault in kiln: {}.",
                differing.join(", ")
            )
        });
    }
    for geometry in &study.geometry {
        let wrong = geometry.false_hits + geometry.false_misses + geometry.wrong_primitives;
        let rate = |rate: f64| if rate < 1000.0 { scientific(rate) } else { format!("{rate:.0}") };
        let leaks = geometry.leaks_per_million.map_or(String::new(), |leaks| {
            format!(
                "; of a million rays from inside the scene's closed meshes towards edges, {} leak",
                rate(leaks)
            )
        });
        lines.push(format!(
            "`{}`: of a million rays, {} differ from `exact` in the primitive that they hit{leaks}.",
            geometry.numerics,
            rate(geometry.per_million(wrong))
        ));
    }
    let samples: Vec<&SettingRow> = study.rows.iter().filter(|row| row.parameter == "samples").collect();
    let error = |row: &SettingRow| row.limit.map_or(0.0, |limit| limit.rmse);
    if let [one, two, ..] = samples[..]
        && one.samples_per_pixel == 1.0
        && error(two) > error(one)
    {
        lines.push(format!(
            "{} are farther from the limit than {}: several samples are weighted by the pixel filter, whose neighbours share \
             few of them; one lies at the pixel's centre.",
            two.setting, one.setting
        ));
    }
    lines.extend(study.technique_tests.iter().map(|test| {
        let found = if test.test.passed { "no difference found" } else { "different" };
        format!(
            "t-test, {} against multiple importance sampling, {} samples: {found}.",
            test.name, test.samples
        )
    }));
    for row in study.rows.iter().filter(|row| row.non_finite > 0) {
        lines.push(format!(
            "{}: {} pixel(s) are not finite; no error was computed.",
            row.name(),
            row.non_finite
        ));
    }
    lines
}
