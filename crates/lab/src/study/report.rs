//! The HTML page of a study, self-contained in one file.

use std::fmt::Write;

use serde_json::json;

use super::advice::brief;
use super::data::{NoiseFloor, ReferenceKind, SettingRow, Study};
use super::html::{against, errors, geometry, scientific, settings, steps, technique_tests, with_code};
use super::pictures::PageImages;
use super::plot::{error_against_time, error_against_twin, error_of_paths};
use super::selection::{Selection, select};
use crate::bench::html::{STYLE, escaped, filled};

/// The page with the names of its parts in double braces.
const PAGE: &str = include_str!("page.html");
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
    let mut html = "<div class=\"three\">\n".to_owned();
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

/// The result in one sentence: what antialiasing and exact arithmetic cost and change; of a study of another parameter,
/// what its last setting costs.
pub fn headline(study: &Study) -> String {
    let of = |parameter: &str| study.rows.iter().filter(|row| row.parameter == parameter).collect::<Vec<_>>();
    let tier = |numerics: &str| of("numerics").into_iter().find(|row| row.setting == numerics);
    let recommended = select(study).map(|selection| &study.rows[selection.recommended]);
    let samples = of("samples").first().copied().zip(recommended);
    let base = study.rows.iter().find(|row| row.base);
    let tiers = base.and_then(|base| tier(&base.numerics)).zip(tier("exact"));
    let samples = samples.filter(|(one, more)| more.samples_per_pixel > one.samples_per_pixel);
    let tiers = tiers.filter(|(from, to)| from.id != to.id);
    let samples = samples.map(|(one, more)| format!("Antialiasing by {}", cost_of(one, more)));
    let mut sentences: Vec<String> = cost_of_tiers(&of("numerics")).into_iter().chain(samples).collect();
    sentences.extend(tiers.map(|(base, exact)| cost_of(base, exact)));
    if let (true, Some(first)) = (sentences.is_empty(), study.rows.iter().find(|row| !row.base)) {
        sentences.extend(of(&first.parameter).last().map(|last| cost_of(first, last)));
    }
    if sentences.is_empty() { "Nothing was varied.".into() } else { format!("{}.", sentences.join("; ")) }
}

/// What each tier costs on this scene, relative to `watertight`, and those that cost more than the next one.
fn cost_of_tiers(rows: &[&SettingRow]) -> Option<String> {
    let one = rows.iter().find(|row| row.setting == "watertight")?.trace_ms.median;
    (rows.len() > 1 && one > 0.0).then_some(())?;
    let times = rows
        .iter()
        .map(|row| format!("{:.2} (`{}`)", row.trace_ms.median / one, row.setting))
        .collect::<Vec<_>>();
    let unexpected = |pair: &[&SettingRow]| pair[0].trace_ms.lower > pair[1].trace_ms.upper;
    let unexpected: Vec<String> = rows
        .windows(2)
        .filter(|pair| unexpected(pair))
        .map(|pair| format!("`{}` is slower than `{}`", pair[0].setting, pair[1].setting))
        .collect();
    let note = match unexpected.is_empty() {
        true => String::new(),
        false => format!(": {}, which their arithmetic does not explain", unexpected.join(", ")),
    };
    Some(format!("On this scene a picture takes {} times as long as in `watertight`{note}", times.join(", ")))
}

/// What a setting costs and changes compared to another.
fn cost_of(from: &SettingRow, to: &SettingRow) -> String {
    let brief = |ratio: f64| format!("{ratio:.0$}", usize::from(ratio < 10.0));
    let ratio = brief(to.trace_ms.median / from.trace_ms.median);
    let change = match (from.errors(), to.errors()) {
        _ if from.fingerprint == to.fingerprint => "changes no pixel".to_owned(),
        (Some(before), Some(after)) if to.reference == ReferenceKind::Limit && after.rmse > 0.0 => {
            format!("divides the error (RMSE) by {}", brief(before.rmse / after.rmse))
        }
        (Some(before), _) => format!("changes {:.2} % of the pixels", 100.0 * before.differing),
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
            format!("; {} of those aimed at edges from inside closed meshes leak", rate(leaks))
        });
        lines.push(format!(
            "`{}`: of a million rays, {} differ from `exact` in the primitive that they hit{leaks}.",
            geometry.numerics,
            rate(geometry.per_million(wrong))
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
