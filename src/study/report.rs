//! The HTML page of a study, self-contained in one file.

use std::fmt::Write;

use super::advice::brief;
use super::data::{NoiseFloor, SettingRow, Study};
use super::html::{against, escaped, geometry, scientific, steps, table, technique_tests, with_code};
use super::pictures::PageImages;
use super::plot::{error_against_time, error_against_twin, error_of_paths};
use super::selection::{Selection, select};
use crate::error::Result;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// The HTML page.
///
/// # Errors
/// [`Error::Failed`](crate::error::Error::Failed) if a plot cannot be drawn.
pub fn page(study: &Study, pictures: &PageImages) -> Result<String> {
    let mut html = head(study);
    html += &selection(study, pictures);
    html += &plots(study)?;
    html += &summary(study);
    html += &geometry(&study.geometry);
    html += &technique_tests(&study.technique_tests);
    html += &steps(study);
    html += &viewer(study, pictures);
    html += &table(study);
    html += &methods(study);
    let names: Vec<serde_json::Value> = study
        .rows
        .iter()
        .map(|row| serde_json::json!({ "name": row.name(), "what": against(row.reference) }))
        .collect();
    let _ = write!(
        html,
        "<script type=\"application/json\" id=\"pictures\">{}</script>\n\
         <script type=\"application/json\" id=\"rows\">{}</script>\n<script>{SCRIPT}</script>\n</body></html>\n",
        embedded(&serde_json::json!(pictures)),
        embedded(&serde_json::json!(names)),
    );
    Ok(html)
}

/// JSON with `<` escaped, so that it cannot close its HTML element.
fn embedded(value: &serde_json::Value) -> String {
    value.to_string().replace('<', "\\u003c")
}

fn head(study: &Study) -> String {
    let title = format!("What accuracy costs: {}", escaped(&study.envelope.subject));
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><meta name=\"color-scheme\" content=\"light dark\">\
         <title>{title}</title>\n<style>{STYLE}</style></head><body>\n<h1>{title}</h1>\n\
         <p class=\"note\">{} × {} pixels; {} thread(s), timed by {} time; {} in which all settings take turns, after one to warm up. \
         kiln {}.</p>\n",
        study.size[0],
        study.size[1],
        study.threads,
        study.clock,
        if study.rounds == 1 { "1 round".into() } else { format!("{} rounds", study.rounds) },
        escaped(&study.envelope.kiln)
    )
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
            format!(", RMSE {}, FLIP {}", scientific(limit.rmse), scientific(limit.flip))
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
        "</div>\n<p class=\"note\">Quick: the fastest setting. Recommended: {recommended}. Limit: the reference of both. Cropped where the quick picture \
         differs most. Times: median (and quartiles).</p>\n"
    )
}

fn summary(study: &Study) -> String {
    let mut html = "<h2>Recommendations and differences</h2>\n<ul>\n".to_owned();
    for advice in &study.advice {
        let _ = writeln!(html, "<li>{}</li>", with_code(&advice.text));
    }
    if study.advice.is_empty() {
        html += "<li>No setting was measured against the limit: there is no advice for an error.</li>\n";
    }
    for line in facts(study) {
        let _ = writeln!(html, "<li>{}</li>", with_code(&line));
    }
    html + "</ul>\n"
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
        let leaks = geometry.leaks_per_million.map_or(String::new(), |leaks| {
            let leaks = if leaks < 1000.0 { scientific(leaks) } else { format!("{leaks:.0}") };
            format!("; {leaks} leaks per million of rays aimed at edges from inside")
        });
        lines.push(format!(
            "{}: {} of {} rays find something else than in `exact`{leaks}.",
            geometry.numerics, wrong, geometry.rays
        ));
    }
    lines.extend(study.technique_tests.iter().map(|test| {
        let found = if test.test.passed { "no difference found" } else { "different" };
        format!("t-test, {} against both (MIS), {} samples: {found}.", test.name, test.samples)
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

fn plots(study: &Study) -> Result<String> {
    let floor = study.noise_floor();
    let paths = error_of_paths(&study.rows)?.map_or(String::new(), |plot| {
        format!(
            "\n<figure>{plot}<figcaption>Samples and the settings of path tracing: the error of each pixel relative to its own value, so that \
             visible lights and their edges do not outweigh what they light.</figcaption></figure>"
        )
    });
    Ok(format!(
        "<h2>Error against time</h2>\n<div class=\"two\">\n<figure>{}<figcaption>Everything that a picture of so few samples gets wrong, \
         against the limit. Filled: no other setting is better in time or error and as good in the other; the line joins these. Hollow: dominated. Times with \
         overlapping quartiles (horizontal strokes) are ties, and so are errors that differ by less than the limit's own. Settings without an effect of the \
         scene are other pictures and not drawn; acceleration structures give the same picture.</figcaption></figure>\n<figure>{}<figcaption>What a parameter alone gets wrong: the same \
         sample points in <code>exact</code> are the measure. On the line 0 the pictures are the same.</figcaption></figure>{paths}\n</div>\n",
        error_against_time(&study.rows, floor)?,
        error_against_twin(&study.rows)?
    ))
}

fn viewer(study: &Study, pictures: &PageImages) -> String {
    let shown: Vec<&SettingRow> =
        study.rows.iter().filter(|row| pictures.rows.get(row.id).is_some_and(Option::is_some)).collect();
    if shown.is_empty() {
        return String::new();
    }
    let first = shown.iter().find(|row| row.base).unwrap_or(&shown[0]).id;
    let mut html = "<h2 id=\"look\">Pictures</h2>\n<p><label>Setting <select id=\"choice\">".to_owned();
    for row in &shown {
        let selected = if row.id == first { " selected" } else { "" };
        let _ = write!(html, "<option value=\"{}\"{selected}>{}</option>", row.id, escaped(&row.name()));
    }
    html += "</select></label></p>\n";
    if shown.len() < study.rows.len() {
        let _ = writeln!(
            html,
            "<p class=\"note\">Pictures of {} settings are left out, to keep the page small.</p>",
            study.rows.len() - shown.len()
        );
    }
    html + "<div class=\"two\"><figure><div class=\"slider\" id=\"slider\" tabindex=\"0\" role=\"slider\" aria-label=\"reference against setting\" \
        aria-valuemin=\"0\" aria-valuemax=\"100\" aria-valuenow=\"50\"><img class=\"own\" alt=\"the picture of this setting\">\
        <div class=\"top\"><img alt=\"the reference\"></div><span class=\"a\" id=\"what\"></span><span class=\"b\" id=\"name\"></span></div>\
        <figcaption>Drag, or use the arrow keys.</figcaption></figure>\n\
        <figure class=\"heat\"><div id=\"heat\"><img alt=\"where the two differ\"><div class=\"scale\"></div><div class=\"ends\"><span>10⁻⁸</span><span>10⁻⁶</span><span>10⁻⁴</span>\
        <span>10⁻²</span><span>1</span></div></div><p id=\"nothing\" class=\"same\" hidden>No pixel differs.</p>\
        <figcaption>The largest difference of a channel of each pixel, as displayed, on a logarithmic scale; 1 is white.</figcaption></figure></div>\n\
        <div id=\"worst\"><h3>The worst places, enlarged</h3><div class=\"crops\" id=\"crops\"></div></div>\n"
}

fn methods(study: &Study) -> String {
    let mut html = "<h2>How this was measured</h2>\n<dl class=\"facts\">\n".to_owned();
    let mut fact = |name: &str, value: &str| {
        let _ = writeln!(html, "<dt>{}</dt><dd>{}</dd>", escaped(name), escaped(value));
    };
    for [name, value] in study.envelope.machine.iter().chain(&study.settings) {
        fact(name, value);
    }
    if let Some(load) = study.load_ms {
        fact("reading the inputs", &format!("{} ms", brief(load)));
    }
    html += "</dl>\n<p>Made by</p>\n";
    let _ = writeln!(html, "<pre>{}</pre>", escaped(&study.envelope.command));
    html += "<p>Every error is preceded by a check that all pixels are finite numbers. It has no spread: equal settings give equal bits, so a second \
        study gives the same errors. Times have one: the median of all rounds stands before the quartiles in brackets. A time is that of the \
        picture alone, without reading files, building, planning and writing.</p>\n<ul>\n";
    for NoiseFloor { filter, samples, rmse, bounces } in &study.floors {
        let paths = bounces.map_or(String::new(), |bounces| {
            format!(", paths of at most {bounces} bounces without a clamp of indirect light")
        });
        let _ = writeln!(
            html,
            "<li>The limit for the filter {}: <code>exact</code>, {samples} samples a pixel{paths}. Its own error is {} (root mean square), half the \
             difference of its two halves, which have seeds of their own.</li>",
            escaped(filter),
            scientific(*rmse)
        );
    }
    html += "</ul>\n<p>";
    for (name, meaning) in crate::metrics::definitions() {
        let _ = write!(html, "<b>{}</b>: {}. ", escaped(name), escaped(meaning.trim_end_matches('.')));
    }
    html + "</p>\n"
}
