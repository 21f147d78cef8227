//! A study as one page that needs no network and no other file.

use std::fmt::Write;

use super::advice::{brief, comparable, points};
use super::data::{Floor, Geometry, Judge, Row, Study, Told};
use super::errors::PictureErrors;
use super::pareto::front;
use super::pictures::Pictures;
use super::plot::{error_against_time, error_against_twin};
use crate::error::Result;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// The page.
///
/// # Errors
/// [`Error::Failed`](crate::error::Error::Failed) where a plot cannot be drawn.
pub fn page(study: &Study, pictures: &Pictures) -> Result<String> {
    let mut html = head(study);
    html += &summary(study);
    html += &plots(study)?;
    html += &geometry(&study.geometry);
    html += &steps(study);
    html += &look(study, pictures);
    html += &table(study);
    html += &methods(study);
    let names: Vec<serde_json::Value> = study
        .rows
        .iter()
        .map(|row| serde_json::json!({ "name": row.name(), "what": against(row.judge) }))
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

/// JSON that cannot end the element that it stands in.
fn embedded(value: &serde_json::Value) -> String {
    value.to_string().replace('<', "\\u003c")
}

fn head(study: &Study) -> String {
    let title = format!("What accuracy costs: {}", escaped(&study.subject));
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><meta name=\"color-scheme\" content=\"light dark\">\
         <title>{title}</title>\n<style>{STYLE}</style></head><body>\n<h1>{title}</h1>\n\
         <p class=\"note\">{} × {} pixels; {} thread(s), timed by {} time; {} rounds in which all settings take turns, after one to warm up. \
         kiln {}.</p>\n",
        study.size[0],
        study.size[1],
        study.threads,
        study.clock,
        study.rounds,
        escaped(&study.kiln)
    )
}

fn summary(study: &Study) -> String {
    let mut html = "<h2>In short</h2>\n<ul>\n".to_owned();
    for advice in &study.advice {
        let _ = writeln!(html, "<li>{}</li>", with_code(&advice.text));
    }
    if study.advice.is_empty() {
        html += "<li>No setting measured has an error against the limit.</li>\n";
    }
    for line in facts(study) {
        let _ = writeln!(html, "<li>{}</li>", with_code(&line));
    }
    html + "</ul>\n"
}

/// What there is to say beside the advice: which knobs change nothing, and what could not be measured.
pub fn facts(study: &Study) -> Vec<String> {
    let mut lines = Vec::new();
    let bvh: Vec<&Row> = study.rows.iter().filter(|row| row.knob == "bvh").collect();
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
        let leaks =
            geometry.leaks_per_million.map_or(String::new(), |leaks| format!("; {leaks} leaks per million"));
        lines.push(format!(
            "{}: {} of {} rays find something else than in `exact`{leaks}.",
            geometry.numerics, wrong, geometry.rays
        ));
    }
    for row in study.rows.iter().filter(|row| row.non_finite > 0) {
        lines.push(format!(
            "{}: {} pixel(s) are no finite numbers; no error was computed.",
            row.name(),
            row.non_finite
        ));
    }
    lines
}

fn plots(study: &Study) -> Result<String> {
    let floor = study.floors.first().map(|floor| floor.rmse);
    Ok(format!(
        "<h2>Error against time</h2>\n<div class=\"two\">\n<figure>{}<figcaption>Everything that a picture of so few samples gets wrong, \
         against the limit. Filled: no other setting is both quicker and closer; the line joins these. Hollow: dominated. Horizontal strokes \
         reach from the lower to the upper quartile.</figcaption></figure>\n<figure>{}<figcaption>What a knob alone gets wrong: the same \
         sample points in <code>exact</code> are the measure. On the line 0 the pictures are the same.</figcaption></figure>\n</div>\n",
        error_against_time(&study.rows, floor)?,
        error_against_twin(&study.rows)?
    ))
}

fn geometry(tiers: &[Geometry]) -> String {
    let mut html = "<h2>Geometry</h2>\n<p class=\"note\">Rays through the centres of a larger picture's pixels, each tier in its own numbers, \
        against <code>exact</code>, before any shading. t in units of the last place of f32; angles between normals in degrees: median, 99.9 %, \
        worst.</p>\n<div class=\"scroll\"><table><tr><th class=\"left\">tier</th><th>rays</th><th>false hits</th><th>false misses</th>\
        <th>wrong primitive</th><th>not finite</th><th>t error, ulp</th><th>normals, °</th><th>leaks per million</th></tr>\n"
        .to_owned();
    for tier in tiers {
        let three = |values: Option<[f64; 3]>| {
            values.map_or("–".into(), |values| values.map(scientific).join(" / "))
        };
        let leaks = tier.leaks_per_million.map_or("no closed mesh".to_owned(), scientific);
        let class = |bad: bool| if bad { " class=\"bad\"" } else { "" };
        let _ = writeln!(
            html,
            "<tr><td class=\"left\">{}</td><td>{}</td><td{}>{}</td><td{}>{}</td><td{}>{}</td><td{}>{}</td><td>{}</td><td>{}</td><td{}>{leaks}</td></tr>",
            tier.numerics,
            tier.rays,
            class(tier.false_hits > 0),
            tier.false_hits,
            class(tier.false_misses > 0),
            tier.false_misses,
            class(tier.wrong_primitives > 0),
            tier.wrong_primitives,
            class(tier.non_finite > 0),
            tier.non_finite,
            three(tier.t_ulps),
            three(tier.normal_degrees),
            class(tier.leaks_per_million.is_some_and(|leaks| leaks > 0.0)),
        );
    }
    html + "</table></div>\n"
}

fn steps(study: &Study) -> String {
    let mut html = "<h2>What the next step costs and buys</h2>\n<p class=\"note\">Along each knob, from one setting to the next. Times that \
        differ by no more than their quartiles are called alike.</p>\n<div class=\"scroll\"><table><tr><th class=\"left\">knob</th>\
        <th class=\"left\">from</th><th class=\"left\">to</th><th>time</th><th>error before</th><th>error after</th><th class=\"left\">buys</th></tr>\n"
        .to_owned();
    for step in &study.steps {
        let (Some(from), Some(to)) = (study.rows.get(step.from), study.rows.get(step.to)) else { continue };
        let time = if step.time_is_apart { format!("× {:.2}", step.time_ratio) } else { "alike".into() };
        let error = |error: Option<f64>| {
            error.map_or("–".into(), |error| if error == 0.0 { "0".into() } else { scientific(error) })
        };
        let buys = match (step.error_before, step.error_after) {
            _ if from.fingerprint == to.fingerprint => "same picture".to_owned(),
            (Some(before), Some(after)) if before > 0.0 && after > 0.0 && before >= after => {
                format!("error ÷ {}", scientific(before / after))
            }
            (Some(before), Some(after)) if before > 0.0 && after > 0.0 => {
                format!("error × {}", scientific(after / before))
            }
            (Some(before), Some(0.0)) if before > 0.0 => "no error".into(),
            _ => String::new(),
        };
        let _ = writeln!(
            html,
            "<tr><td class=\"left\">{}</td><td class=\"left\">{}</td><td class=\"left\">{}</td><td>{time}</td><td>{}</td><td>{}</td>\
             <td class=\"left\">{buys}</td></tr>",
            escaped(&step.knob),
            escaped(&from.setting),
            escaped(&to.setting),
            error(step.error_before),
            error(step.error_after)
        );
    }
    html += "</table></div>\n";
    if !study.left_out.is_empty() {
        html += "<h3>Left out, having nothing to do here</h3>\n<ul>\n";
        for [knob, why] in &study.left_out {
            let _ = writeln!(html, "<li>{}: {}</li>", escaped(knob), with_code(why));
        }
        html += "</ul>\n";
    }
    html
}

fn look(study: &Study, pictures: &Pictures) -> String {
    let shown: Vec<&Row> =
        study.rows.iter().filter(|row| pictures.rows.get(row.id).is_some_and(Option::is_some)).collect();
    if shown.is_empty() {
        return String::new();
    }
    let first = shown.iter().find(|row| row.base).unwrap_or(&shown[0]).id;
    let mut html = "<h2 id=\"look\">Look at it</h2>\n<p><label>Setting <select id=\"choice\">".to_owned();
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

fn against(judge: Judge) -> &'static str {
    match judge {
        Judge::Limit => "limit",
        Judge::Twin => "exact, same samples",
    }
}

fn table(study: &Study) -> String {
    let alternatives = comparable(&study.rows);
    let best: Vec<usize> = front(&points(&alternatives)).into_iter().map(|i| alternatives[i].id).collect();
    let mut html = "<h2>All settings</h2>\n<p class=\"note\">● on the Pareto front of time and error against the limit, ○ dominated; settings of another \
        filter have another limit and no mark. Errors: against what the column says. Quartiles of building are in the CSV. A row shows its picture when it is clicked.</p>\n\
        <div class=\"scroll\"><table><tr><th class=\"left\">setting</th><th>build ms</th><th>picture ms</th><th>rays</th><th>samples a pixel</th>\
        <th>structure KB</th><th class=\"left\">against</th><th>RMSE</th><th>max</th><th>PSNR dB</th><th>relMSE</th><th>FLIP</th><th>pixels that differ</th>\
        <th>RMSE to limit</th></tr>\n"
        .to_owned();
    for row in &study.rows {
        let class = match alternatives.iter().any(|other| other.id == row.id) {
            true if best.contains(&row.id) => "front",
            true => "dominated",
            false => "",
        };
        let limit = row.limit.map_or("–".into(), |limit| scientific(limit.rmse));
        let limit = if row.told == Told::Within {
            format!(
                "<span class=\"within\" title=\"cannot be told from the reference's own error\">≈ {limit}</span>"
            )
        } else {
            limit
        };
        let _ = writeln!(
            html,
            "<tr class=\"{class}\" data-row=\"{}\"><td class=\"left\">{}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.1}</td><td>{:.1}</td>\
             <td class=\"left\">{}</td>{}<td>{limit}</td></tr>",
            row.id,
            escaped(&row.name()),
            scientific(row.build_ms.median),
            brief(row.trace_ms),
            row.rays,
            row.samples_per_pixel,
            row.structure_bytes as f64 / 1024.0,
            against(row.judge),
            cells(row)
        );
    }
    html + "</table></div>\n<p class=\"note\">≈: less than ten times the reference's own error; the true one may be anything up to about that. \
        The same numbers, and those that are not shown, are in study.csv and study.json beside this page.</p>\n"
}

fn cells(row: &Row) -> String {
    if row.non_finite > 0 {
        return format!(
            "<td colspan=\"6\" class=\"bad\">{} pixels are no finite numbers</td>",
            row.non_finite
        );
    }
    match row.errors() {
        None => "<td colspan=\"6\">–</td>".into(),
        Some(errors) if errors.are_none() => {
            "<td colspan=\"6\" class=\"same\">same picture: error 0</td>".into()
        }
        Some(&PictureErrors { max, rmse, rel_mse, psnr, flip, differing }) => format!(
            "<td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.3} %</td>",
            scientific(rmse),
            scientific(max),
            psnr.map_or("–".into(), |psnr| format!("{psnr:.1}")),
            scientific(rel_mse),
            scientific(flip),
            100.0 * differing
        ),
    }
}

fn methods(study: &Study) -> String {
    let mut html = "<h2>How this was measured</h2>\n<dl class=\"facts\">\n".to_owned();
    let mut fact = |name: &str, value: &str| {
        let _ = writeln!(html, "<dt>{}</dt><dd>{}</dd>", escaped(name), escaped(value));
    };
    for [name, value] in study.machine.iter().chain(&study.settings) {
        fact(name, value);
    }
    if let Some(load) = study.load_ms {
        fact("reading the inputs", &format!("{} ms", brief(load)));
    }
    html += "</dl>\n<p>Made by</p>\n";
    let _ = writeln!(html, "<pre>{}</pre>", escaped(&study.command));
    html += "<p>Every error is preceded by a check that all pixels are finite numbers. It has no spread: equal settings give equal bits, so a second \
        study gives the same errors. Times have one: the median of all rounds stands before the quartiles in brackets. A time is that of the \
        picture alone, without reading files, building, planning and writing.</p>\n<ul>\n";
    for Floor { filter, samples, rmse } in &study.floors {
        let _ = writeln!(
            html,
            "<li>The limit for the filter {}: <code>exact</code>, {samples} samples a pixel. Its own error is {} (root mean square), half the \
             difference of its two halves, which have seeds of their own.</li>",
            escaped(filter),
            scientific(*rmse)
        );
    }
    html += "</ul>\n<p>";
    for (name, meaning) in super::metrics::definitions() {
        let _ = write!(html, "<b>{}</b>: {}. ", escaped(name), escaped(meaning.trim_end_matches('.')));
    }
    html + "</p>\n"
}

/// With two digits.
fn scientific(x: f64) -> String {
    if x == 0.0 {
        "0".into()
    } else if (0.01..1e4).contains(&x.abs()) {
        format!(
            "{:.*}",
            if x < 1.0 {
                3
            } else if x < 100.0 {
                2
            } else {
                0
            },
            x
        )
    } else {
        format!("{x:.1e}")
    }
}

/// Text with what stands between backquotes as code.
fn with_code(text: &str) -> String {
    let parts = text.split('`').enumerate();
    parts
        .map(|(i, part)| if i % 2 == 1 { format!("<code>{}</code>", escaped(part)) } else { escaped(part) })
        .collect()
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
