//! Tables of the HTML page, and formatting of text and numbers.

use std::fmt::Write;

use super::advice::{brief, comparable, points};
use super::data::{GeometryErrors, ReferenceKind, SettingRow, Significance, Study, TechniqueTest};
use super::pareto::front;
use crate::effects::EFFECTS;
use crate::metrics::Figures;
use crate::metrics::t_test::ChannelTest;

/// Table of differences in ray hits between the tiers and `exact`.
pub(crate) fn geometry(tiers: &[GeometryErrors]) -> String {
    let mut html = "<h2>Geometry</h2>\n<p class=\"note\">Rays through the centres of a larger picture's pixels, each tier in its own numbers, \
        against <code>exact</code>, before any shading. t in units of the last place of f32; angles between normals in degrees: median, 99.9 %, \
        worst. Leaks: of rays from inside closed meshes, aimed at their edges and vertices, those that hit nothing. Rays of a picture seldom meet an edge \
        exactly, so a tier can leak without a false miss.</p>\n<div class=\"scroll\"><table><tr><th class=\"left\">tier</th><th>rays</th><th>false hits</th><th>false misses</th>\
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

/// Table of the tests of techniques, with histograms; empty if there are none.
pub(crate) fn technique_tests(tests: &[TechniqueTest]) -> String {
    let Some(first) = tests.first() else { return String::new() };
    let mut html = format!(
        "<h2>Do the techniques agree?</h2>\n<p class=\"note\">BSDF samples and samples of lights against both by multiple importance sampling: \
         Welch's t-test of blocks of {0} × {0} pixels, {1} samples a pixel. If both converge to the same picture, the p-values are even; the dashed line \
         is what is expected of a bin. The control, two seeds of one technique, comes first: what bends its histogram is no bias. Where a technique rarely \
         finds a light, means and variances are too small together, and the histogram bends until there are enough samples.</p>\n\
         <div class=\"scroll\"><table><tr><th class=\"left\">against both</th><th class=\"left\">channel</th><th>blocks</th><th>difference of means</th>\
         <th>its standard error</th><th>p of equal means</th><th>p of an even histogram</th><th class=\"left\">p-values from 0 to 1</th><th class=\"left\">result</th></tr>\n",
        first.test.block, first.samples
    );
    for test in tests {
        for channel in &test.test.channels {
            let even = channel.uniform.map_or("–".into(), scientific);
            let (class, result) =
                if test.test.passed { ("left", "no difference") } else { ("left bad", "different") };
            let _ = writeln!(
                html,
                "<tr><td class=\"left\">{}</td><td class=\"left\">{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{even}</td>\
                 <td class=\"left\">{}</td><td class=\"{class}\">{result}</td></tr>",
                escaped(&test.name),
                escaped(&channel.channel),
                channel.tested,
                scientific(channel.difference),
                scientific(channel.standard_error),
                scientific(channel.equal_means),
                histogram(channel)
            );
        }
    }
    html + "</table></div>\n"
}

/// Bars of the p-values; half the height is the expected count, twice that and more is the full height.
fn histogram(channel: &ChannelTest) -> String {
    const WIDTH: usize = 6;
    const HEIGHT: f64 = 28.0;
    let bins = channel.histogram.len();
    let expected = channel.tested as f64 / bins.max(1) as f64;
    let mut svg = format!(
        "<svg role=\"img\" aria-label=\"histogram of p-values\" width=\"{0}\" height=\"{HEIGHT}\" viewBox=\"0 0 {0} {HEIGHT}\">",
        WIDTH * bins
    );
    for (bin, &count) in channel.histogram.iter().enumerate() {
        let share = if expected > 0.0 { (count as f64 / (2.0 * expected)).min(1.0) } else { 0.0 };
        let _ = write!(
            svg,
            "<rect x=\"{}\" y=\"{:.1}\" width=\"{}\" height=\"{:.1}\" fill=\"#0072b2\"/>",
            WIDTH * bin,
            HEIGHT * (1.0 - share),
            WIDTH - 1,
            HEIGHT * share
        );
    }
    let _ = write!(
        svg,
        "<path d=\"M0 {0}H{1}\" stroke=\"currentColor\" stroke-dasharray=\"3 3\"/></svg>",
        HEIGHT / 2.0,
        WIDTH * bins
    );
    svg
}

/// Table of comparisons of adjacent settings, and list of omitted parameters.
pub(crate) fn steps(study: &Study) -> String {
    let mut html = "<h2>What the next step costs and gains</h2>\n<p class=\"note\">Along each parameter, from one setting to the next. Times that \
        differ by no more than their quartiles are equal.</p>\n<div class=\"scroll\"><table><tr><th class=\"left\">parameter</th>\
        <th class=\"left\">from</th><th class=\"left\">to</th><th>time</th><th>error before</th><th>error after</th><th class=\"left\">gain</th></tr>\n"
        .to_owned();
    for step in &study.steps {
        let (Some(from), Some(to)) = (study.rows.get(step.from), study.rows.get(step.to)) else { continue };
        let time = if step.time_is_apart { format!("× {:.2}", step.time_ratio) } else { "equal".into() };
        let error = |error: Option<f64>| {
            let unit = if step.is_relative { " relMSE" } else { "" };
            let number =
                |error| if error == 0.0 { "0".into() } else { format!("{}{unit}", scientific(error)) };
            error.map_or("–".into(), number)
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
            escaped(&step.parameter),
            escaped(&from.setting),
            escaped(&to.setting),
            error(step.error_before),
            error(step.error_after)
        );
    }
    html += "</table></div>\n";
    if !study.left_out.is_empty() {
        html += "<h3>Parameters without effect on this scene</h3>\n<ul>\n";
        for [parameter, why] in &study.left_out {
            let effect = EFFECTS.iter().find(|effect| effect.name() == parameter.as_str());
            let meaning = effect.map_or(String::new(), |effect| format!(" ({})", effect.summary));
            let _ =
                writeln!(html, "<li>{}{}: {}</li>", escaped(parameter), with_code(&meaning), with_code(why));
        }
        html += "</ul>\n";
    }
    html
}

/// Display name of a reference.
pub(crate) fn against(reference: ReferenceKind) -> &'static str {
    match reference {
        ReferenceKind::Limit => "limit",
        ReferenceKind::Twin => "exact, same samples",
    }
}

/// Table of all settings.
pub(crate) fn table(study: &Study) -> String {
    let alternatives = comparable(&study.rows);
    let best: Vec<usize> =
        front(&points(&alternatives), study.noise_floor()).into_iter().map(|i| alternatives[i].id).collect();
    let mut html = "<h2>All settings</h2>\n<p class=\"note\">● on the Pareto front of time and error against the limit, ○ dominated or tied. No mark: another filter, \
        which has another limit, acceleration structures, and settings with an effect turned off. Errors: against the limit, or against <code>exact</code> at the same sample points.  A row shows its picture when it is clicked.</p>\n\
        <div class=\"scroll\"><table><tr><th class=\"left\">setting</th><th>build ms</th><th>picture ms</th><th>samples a pixel</th><th class=\"left\">against</th><th>RMSE</th><th>max</th><th>PSNR dB</th><th>relMSE</th><th>FLIP</th><th>pixels that differ</th>\
        <th>RMSE to limit</th></tr>\n"
        .to_owned();
    for row in &study.rows {
        let class = match alternatives.iter().any(|other| other.id == row.id) {
            true if best.contains(&row.id) => "front",
            true => "dominated",
            false => "",
        };
        let limit = row.limit.map_or("–".into(), |limit| scientific(limit.rmse));
        let limit = if row.significance == Significance::Insignificant {
            format!(
                "<span class=\"within\" title=\"cannot be told from the reference's own error\">≈ {limit}</span>"
            )
        } else {
            limit
        };
        let _ = writeln!(
            html,
            "<tr class=\"{class}\" data-row=\"{}\"><td class=\"left\">{}</td><td>{}</td><td>{}</td><td>{:.1}</td>\
             <td class=\"left\">{}</td>{}<td>{limit}</td></tr>",
            row.id,
            escaped(&row.name()),
            scientific(row.build_ms.median),
            brief(row.trace_ms),
            row.samples_per_pixel,
            match row.reference {
                ReferenceKind::Limit => "limit",
                ReferenceKind::Twin => "exact",
            },
            cells(row)
        );
    }
    html + "</table></div>\n<p class=\"note\">≈: less than ten times the reference's own error; the true one may be anything up to about that. \
        The same numbers, and those that are not shown, are in study.csv and study.json beside this page.</p>\n"
}

fn cells(row: &SettingRow) -> String {
    if row.non_finite > 0 {
        return format!("<td colspan=\"6\" class=\"bad\">{} pixels are not finite</td>", row.non_finite);
    }
    match row.errors() {
        None => "<td colspan=\"6\">–</td>".into(),
        Some(errors) if errors.are_none() => {
            "<td colspan=\"6\" class=\"same\">same picture: error 0</td>".into()
        }
        Some(&Figures { max, rmse, rel_mse, psnr, flip, differing }) => format!(
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

/// Formats a number with two or more significant digits.
pub(crate) fn scientific(x: f64) -> String {
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

/// Text as HTML, with parts between backquotes as code.
pub(crate) fn with_code(text: &str) -> String {
    let parts = text.split('`').enumerate();
    parts
        .map(|(i, part)| if i % 2 == 1 { format!("<code>{}</code>", escaped(part)) } else { escaped(part) })
        .collect()
}

/// Text with HTML special characters escaped.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
