//! Tables of the HTML page, and formatting of text and numbers.

use std::fmt::Write;

use super::advice::{best, brief, comparable};
use super::data::{GeometryErrors, ReferenceKind, SettingRow, Significance, Study, TechniqueTest};
use crate::bench::errors::{PictureError, ratio};
use crate::bench::html::{Cell, escaped, table};
use kiln::effects::EFFECTS;
use kiln::metrics::Figures;
use kiln::metrics::t_test::ChannelTest;

/// Text of a missing number.
const NONE: &str = "–";

/// Attributes of a cell that is marked if it is bad.
fn marked(is_bad: bool) -> &'static str {
    if is_bad { " class=\"bad\"" } else { "" }
}

/// Table of the errors of the base's picture; empty if there are none.
pub(crate) fn errors(errors: &[PictureError]) -> String {
    if errors.is_empty() {
        return String::new();
    }
    let row = |error: &PictureError| {
        let code = |text: &str| format!("<code>{}</code>", escaped(text));
        let time = format!("× {}", ratio(&error.time));
        let cells = [
            escaped(&error.cause),
            error.now.text(),
            code(&error.options),
            error.then.text(),
            time,
            escaped(&error.note),
        ];
        (String::new(), cells.map(|cell| ("", cell)).to_vec())
    };
    "<h2>What each error costs</h2>\n<p class=\"note\">Errors: the pixels that are off by more than one step of 255 in a channel, and in \
     brackets the largest difference in steps, of displayed values before rounding. Time: with the option, relative to the \
     picture. <code>kiln explain --measure</code> prints the same table.</p>\n"
        .to_owned()
        + &table("<cause|error|<type|error then|time|<", errors.iter().map(row))
}

/// Table of differences in ray hits between the tiers and `exact`.
pub(crate) fn geometry(tiers: &[GeometryErrors]) -> String {
    let titles = "<tier|false hits|false misses|wrong primitive|not finite|leaks|t error, ulp|normals, °";
    let row = |tier: &GeometryErrors| {
        let count = |count: u64| (marked(count > 0), scientific(tier.per_million(count)));
        let three = |values: Option<[f64; 3]>| {
            ("", values.map_or(NONE.into(), |values| values.map(scientific).join(" / ")))
        };
        let leaks = tier.leaks_per_million.map_or("no closed mesh".to_owned(), scientific);
        let cells = vec![
            ("", tier.numerics.clone()),
            count(tier.false_hits),
            count(tier.false_misses),
            count(tier.wrong_primitives),
            count(tier.non_finite),
            (marked(tier.leaks_per_million.is_some_and(|leaks| leaks > 0.0)), leaks),
            three(tier.t_ulps),
            three(tier.normal_degrees),
        ];
        (String::new(), cells)
    };
    "<h2>Geometry</h2>\n<p class=\"note\">Camera rays of each tier against <code>exact</code>, before shading. Counts are per million rays. Leaks: rays from \
     inside closed meshes, aimed at edges and vertices, that hit nothing; camera rays seldom meet an edge exactly, so a tier can leak without a \
     false miss. Errors of t in ulps of f32 and of normals in degrees: median, 99.9 % quantile, maximum.</p>\n"
        .to_owned()
        + &table(titles, tiers.iter().map(row))
}

/// Table of the tests of techniques, with histograms; empty if there are none.
pub(crate) fn technique_tests(tests: &[TechniqueTest]) -> String {
    let Some(first) = tests.first() else { return String::new() };
    let titles = "<against both|<channel|blocks|difference of means|its standard error|p of equal means|\
        p of an even histogram|<p-values from 0 to 1|<result";
    let row = |test: &TechniqueTest, channel: &ChannelTest| {
        let (attributes, result) =
            if test.test.passed { ("", "no difference") } else { (" class=\"left bad\"", "different") };
        let cells = vec![
            ("", escaped(&test.name)),
            ("", escaped(&channel.channel)),
            ("", channel.tested.to_string()),
            ("", scientific(channel.difference)),
            ("", scientific(channel.standard_error)),
            ("", scientific(channel.equal_means)),
            ("", channel.uniform.map_or(NONE.into(), scientific)),
            ("", histogram(channel)),
            (attributes, result.to_owned()),
        ];
        (String::new(), cells)
    };
    let rows = tests.iter().flat_map(|test| test.test.channels.iter().map(move |channel| row(test, channel)));
    format!(
        "<h2>Do the techniques agree?</h2>\n<p class=\"note\">BSDF samples and samples of lights against both by multiple importance sampling: \
         Welch's t-test of blocks of {0} × {0} pixels, {1} samples a pixel. If both converge to the same picture, the p-values are even; the dashed line \
         is what is expected of a bin. The control, two seeds of one technique, comes first: what bends its histogram is no bias. Where a technique rarely \
         finds a light, means and variances are too small together, and the histogram bends until there are enough samples.</p>\n{2}",
        first.test.block,
        first.samples,
        table(titles, rows)
    )
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
    let titles = "<parameter|<from|<to|time|error before|error after|<gain";
    let rows = study.steps.iter().filter_map(|step| {
        let (from, to) = (study.rows.get(step.from)?, study.rows.get(step.to)?);
        let time =
            if step.time_is_significant { format!("× {}", ratio(&step.time_ratio)) } else { "equal".into() };
        let error = |error: Option<f64>| match error {
            None => NONE.to_owned(),
            Some(0.0) => "0".into(),
            Some(error) if step.is_relative => format!("{} relMSE", scientific(error)),
            Some(error) => scientific(error),
        };
        let gain = match (step.error_before, step.error_after) {
            _ if from.fingerprint == to.fingerprint => "same picture".to_owned(),
            (Some(before), Some(0.0)) if before > 0.0 => "no error".into(),
            (Some(before), Some(after)) if before > 0.0 && before >= after => {
                format!("error ÷ {}", scientific(before / after))
            }
            (Some(before), Some(after)) if before > 0.0 => format!("error × {}", scientific(after / before)),
            _ => String::new(),
        };
        let [before, after] = [step.error_before, step.error_after].map(error);
        let names = [&step.parameter, &from.setting, &to.setting].map(|name| escaped(name));
        let cells = names.into_iter().chain([time, before, after, gain]).map(|cell| ("", cell));
        Some((String::new(), cells.collect()))
    });
    let mut html = "<h2>What the next step costs and gains</h2>\n<p class=\"note\">Along each parameter, from one setting to the next. Times that \
        differ by no more than their quartiles are equal.</p>\n"
        .to_owned()
        + &table(titles, rows);
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
        ReferenceKind::SameSamples => "exact, same samples",
    }
}

/// Table of all settings.
pub(crate) fn settings(study: &Study) -> String {
    let titles = "<setting|build ms|picture ms|samples a pixel|<against|RMSE|max|PSNR dB|relMSE|FLIP|\
        beyond a step|RMSE to limit";
    let alternatives = comparable(&study.rows);
    let best = best(&alternatives, study);
    let is_in = |rows: &[&SettingRow], id: usize| rows.iter().any(|row| row.id == id);
    let row = |row: &SettingRow| {
        let class = match is_in(&alternatives, row.id) {
            true if is_in(&best, row.id) => "front",
            true => "dominated",
            false => "",
        };
        let mut limit = row.limit.map_or(NONE.into(), |limit| scientific(limit.rmse));
        if row.significance == Significance::Insignificant {
            limit = format!(
                "<span class=\"insignificant\" title=\"not significant beside the noise of the reference\">≈ {limit}</span>"
            );
        }
        let reference = if row.reference == ReferenceKind::Limit { "limit" } else { "exact" };
        let mut cells = vec![
            ("", escaped(&row.name())),
            ("", scientific(row.build_ms.median)),
            ("", brief(row.trace_ms)),
            ("", format!("{:.1}", row.samples_per_pixel)),
            ("", reference.to_owned()),
        ];
        cells.extend(error_cells(row));
        cells.push(("", limit));
        (format!(" class=\"{class}\" data-row=\"{}\"", row.id), cells)
    };
    format!(
        "<h2>All settings</h2>\n<p class=\"note\">● on the Pareto front of time and error against the limit, ○ dominated or tied. No mark: another filter, \
         which has another limit, acceleration structures, and settings with an effect turned off. Errors: against the limit, or against <code>exact</code> at the same sample points.  A row shows its picture when it is clicked.</p>\n\
         {}<p class=\"note\">≈: less than ten times the reference's own error; the true one may be anything up to about that. \
         The same numbers, and those that are not shown, are in study.csv and study.json beside this page.</p>\n",
        table(titles, study.rows.iter().map(row))
    )
}

/// Cells of the errors: one that spans all of them if there are none.
fn error_cells(row: &SettingRow) -> Vec<Cell> {
    let all = |attributes: &'static str, text: &str| vec![(attributes, text.to_owned())];
    match row.errors() {
        _ if row.non_finite > 0 => {
            all(" colspan=\"6\" class=\"bad\"", &format!("{} pixels are not finite", row.non_finite))
        }
        None => all(" colspan=\"6\"", NONE),
        Some(errors) if errors.are_none() => all(" colspan=\"6\" class=\"same\"", "same picture: error 0"),
        Some(&Figures { max, rmse, rel_mse, psnr, flip, beyond_step, .. }) => {
            let psnr = psnr.map_or(NONE.into(), |psnr| format!("{psnr:.1}"));
            let beyond_step = format!("{:.2} %", 100.0 * beyond_step);
            let [rmse, max, rel_mse, flip] = [rmse, max, rel_mse, flip].map(scientific);
            [rmse, max, psnr, rel_mse, flip, beyond_step].map(|cell| ("", cell)).into()
        }
    }
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

/// Text as HTML, with parts between backquotes as code.
pub(crate) fn with_code(text: &str) -> String {
    let parts = text.split('`').enumerate();
    parts
        .map(|(i, part)| if i % 2 == 1 { format!("<code>{}</code>", escaped(part)) } else { escaped(part) })
        .collect()
}
