//! The HTML page of a study, self-contained in one file.

use std::fmt::Write;

use serde_json::json;

use super::advice::brief;
use super::data::{NoiseFloor, ReferenceKind, SettingRow, Study};
use super::html::{against, errors, geometry, scientific, settings, steps, technique_tests, with_code};
use super::pictures::PageImages;
use super::plot::{error_against_time, error_against_twin, error_of_paths};
use super::selection::{Selection, select};
use crate::bench::errors::ratio;
use crate::bench::html::{STYLE, escaped, filled};

/// The page with the names of its parts in double braces.
const PAGE: &str = include_str!("page.html");
/// The side of the crops in pixels, as in the script.
const CROP: u32 = 64;
const SCRIPT: &str = include_str!("page.js");

/// The HTML page.
pub fn page(study: &Study, pictures: &PageImages) -> String {
    let names = study.rows.iter().map(|row| json!({ "name": row.name(), "what": against(row.reference) }));
    let rounds = if study.rounds == 1 { "1 round".into() } else { format!("{} rounds", study.rounds) };
    let paths = error_of_paths(&study.rows).map_or(String::new(), |plot| {
        format!(
            "<figure>{plot}<figcaption>Samples and the settings of path tracing: the error of each pixel relative to its own \
             value, so that visible lights and their edges do not dominate.</figcaption></figure>"
        )
    });
    let parts = [
        ("title", escaped(&format!("What accuracy costs: {}", study.envelope.subject))),
        ("style", STYLE.to_owned()),
        ("width", study.size[0].to_string()),
        ("height", study.size[1].to_string()),
        ("threads", study.threads.to_string()),
        ("clock", study.clock.clone()),
        ("rounds", rounds),
        ("kiln", escaped(&study.envelope.kiln)),
        ("headline", with_code(&headline(study))),
        ("errors", errors(&study.errors)),
        ("selection", selection(study, pictures)),
        ("plot of time", error_against_time(&study.rows, study.noise_floor())),
        ("plot of twins", error_against_twin(&study.rows)),
        ("plot of paths", paths),
        ("summary", summary(study)),
        ("geometry", geometry(&study.geometry)),
        ("technique tests", technique_tests(&study.technique_tests)),
        ("steps", steps(study)),
        ("viewer", viewer(study, pictures)),
        ("settings", settings(study)),
        ("facts", machine(study)),
        ("command", escaped(&study.envelope.command)),
        ("limits", study.floors.iter().map(limit).collect()),
        ("definitions", definitions()),
        ("pictures", embedded(&json!(pictures))),
        ("rows", embedded(&names.collect())),
        ("script", SCRIPT.to_owned()),
    ];
    filled(PAGE, &parts)
}

/// JSON with `<` escaped, so that it cannot close its HTML element.
fn embedded(value: &serde_json::Value) -> String {
    value.to_string().replace('<', "\\u003c")
}

/// Crops of the quick setting, the recommended one and the limit, with their times, errors and commands.
fn selection(study: &Study, pictures: &PageImages) -> String {
    let image = |row: usize| Some(pictures.rows.get(row)?.as_ref()?.own);
    let shown = select(study).zip(pictures.limit).zip(pictures.place);
    let Some(((Selection { quick, recommended, is_below_a_step }, limit), [x, y])) = shown else {
        return String::new();
    };
    let mut html = whole(study.size, [x, y], limit) + "<div class=\"three\">\n";
    let mut figure = |title: &str,
                      name: &str,
                      image: Option<usize>,
                      numbers: &str,
                      command: Option<String>| {
        let command = command
            .map_or(String::new(), |command| format!("<code class=\"command\">{}</code>", escaped(&command)));
        if let Some(image) = image {
            let _ = writeln!(
                html,
                "<figure><canvas data-file=\"{image}\" data-x=\"{x}\" data-y=\"{y}\" role=\"img\" aria-label=\"{title}\"></canvas>\
                 <figcaption><b>{title}</b>: {}<br>{numbers}{command}</figcaption></figure>",
                escaped(name)
            );
        }
    };
    let mut row = |title: &str, row: &SettingRow| {
        let errors = row.limit.map_or(String::new(), |limit| {
            let beyond = 100.0 * limit.beyond_step;
            let [rmse, flip] = [limit.rmse, limit.flip].map(scientific);
            format!(
                ", RMSE {rmse}, FLIP {flip}; {beyond:.1} % of the pixels are more than one step of 255 from the limit"
            )
        });
        let numbers = format!("{} ms{errors}", brief(row.trace_ms));
        figure(title, &row.name(), image(row.id), &numbers, Some(study.command_with(&row.options)));
    };
    row("Quick", &study.rows[quick]);
    if recommended != quick {
        row("Recommended", &study.rows[recommended]);
    }
    let samples = study.floors.first().map_or(0, |floor| floor.samples);
    let time = study.limit_ms.map_or(String::new(), |ms| format!("{ms:.0} ms, "));
    let numbers = format!("{time}RMSE of its noise {}", scientific(study.noise_floor()));
    let command = study.limit_options.as_ref().map(|options| study.command_with(options));
    figure("Limit", &format!("exact, {samples} samples"), Some(limit), &numbers, command);
    let recommended = if is_below_a_step {
        "the fastest whose root mean square error is below one of 255 steps of a display"
    } else {
        "the most accurate that was measured"
    };
    html + &format!(
        "</div>\n<p class=\"note\">Quick: the fastest setting. Recommended: {recommended}. Limit: the converged reference. The crops show where \
         the quick picture differs most from the limit. Times: median (and quartiles).</p>\n"
    )
}

/// The whole picture, with the square that the crops show.
fn whole(size: [u32; 2], place: [u32; 2], image: usize) -> String {
    let percent = |pixels: u32, of: u32| 100.0 * f64::from(pixels) / f64::from(of);
    let side = |axis: usize| CROP.min(size[axis]);
    let from = |axis: usize| place[axis].saturating_sub(CROP / 2).min(size[axis] - side(axis));
    let [left, top] = [0, 1].map(|axis| percent(from(axis), size[axis]));
    let [width, height] = [0, 1].map(|axis| percent(side(axis), size[axis]));
    format!(
        "<figure class=\"whole\"><div><img data-file=\"{image}\" alt=\"the picture\"><span style=\"left:{left:.2}%;top:{top:.2}%;\
         width:{width:.2}%;height:{height:.2}%\"></span></div><figcaption>The converged picture. The square is enlarged below: there the \
         quick picture differs most.</figcaption></figure>\n"
    )
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
            format!("divides the error (RMSE) by {}", brief(before.rmse / after.rmse))
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

/// List items of advice and facts.
fn summary(study: &Study) -> String {
    let mut lines: Vec<String> = study.advice.iter().map(|advice| advice.text.clone()).collect();
    if lines.is_empty() {
        lines.push("No setting was measured against the limit, so there are no recommendations.".into());
    }
    lines.extend(facts(study));
    lines.iter().map(|line| format!("<li>{}</li>\n", with_code(line))).collect()
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

/// Sliders and enlarged pixels of the pictures; the script fills them.
fn viewer(study: &Study, pictures: &PageImages) -> String {
    let shown: Vec<&SettingRow> =
        study.rows.iter().filter(|row| pictures.rows.get(row.id).is_some_and(Option::is_some)).collect();
    if shown.is_empty() {
        return String::new();
    }
    let first = shown.iter().find(|row| row.base).unwrap_or(&shown[0]).id;
    let option = |row: &&SettingRow| {
        let selected = if row.id == first { " selected" } else { "" };
        format!("<option value=\"{}\"{selected}>{}</option>", row.id, escaped(&row.name()))
    };
    let left_out = match study.rows.len() - shown.len() {
        0 => String::new(),
        count => format!(
            "<p class=\"note\">Pictures of {count} settings are left out, to keep the page small.</p>\n"
        ),
    };
    include_str!("viewer.html")
        .replace("{{options}}", &shown.iter().map(option).collect::<String>())
        .replace("{{left out}}", &left_out)
}

/// Items on the machine, the settings and the time of reading.
fn machine(study: &Study) -> String {
    let load = study.load_ms.map(|load| ["reading the inputs".to_owned(), format!("{} ms", brief(load))]);
    let facts = study.envelope.machine.iter().chain(&study.settings).chain(&load);
    facts.map(|[name, value]| format!("<dt>{}</dt><dd>{}</dd>\n", escaped(name), escaped(value))).collect()
}

/// A list item on the limit of a filter.
fn limit(NoiseFloor { filter, samples, rmse, bounces }: &NoiseFloor) -> String {
    let paths = bounces.map_or(String::new(), |bounces| {
        format!(", at most {bounces} bounces, without a clamp of indirect light")
    });
    format!(
        "<li>Limit for the filter {}: <code>exact</code>, {samples} samples per pixel{paths}. Its noise is {} (RMSE): half the \
         difference of its two halves, which have different seeds.</li>\n",
        escaped(filter),
        scientific(*rmse)
    )
}

/// Definitions of the metrics.
fn definitions() -> String {
    let definition = |(name, meaning): (&str, String)| {
        format!("<b>{}</b>: {}. ", escaped(name), escaped(meaning.trim_end_matches('.')))
    };
    kiln::metrics::definitions().into_iter().map(definition).collect()
}
