//! Error against time, as SVG by plotters. Colours are fixed: a page that has a dark form overrides them by CSS.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::advice::{comparable, points};
use super::data::Row;
use super::pareto::front;
use crate::bench::plot::{decades, failed, text, Drawn, GRID, INK, PALETTE};
use crate::error::Result;

/// A setting in a plot.
struct Mark {
    /// The group that it is coloured by.
    group: usize,
    /// Milliseconds.
    time: f64,
    /// The quartiles of that.
    spread: [f64; 2],
    /// Its error; 0 has a line of its own below all others.
    error: f64,
    /// What stands beside it, where it is not dominated.
    label: Option<String>,
}

/// A plot of marks.
struct Plot {
    groups: Vec<String>,
    marks: Vec<Mark>,
    /// The corners of the Pareto front.
    front: Vec<[f64; 2]>,
    /// The reference's own error.
    floor: Option<f64>,
    /// What the upright axis is of.
    error: &'static str,
}

/// Width in pixels: on a narrow screen it is shown at three quarters of that, and letters must remain legible.
const WIDTH: u32 = 560;
/// Height without the legend.
const HEIGHT: u32 = 400;
/// The colours of the palette but the last, the grey of what has no group.
const COLOURS: usize = PALETTE.len() - 1;
/// Height of a line of the legend.
const LEGEND: i32 = 18;

/// The error against the limit over the time of the picture, of all settings that have the same limit, with the Pareto front.
///
/// # Errors
/// [`Error::Failed`](crate::error::Error::Failed) where plotters does.
pub fn error_against_time(rows: &[Row], floor: Option<f64>) -> Result<String> {
    let groups = knobs(rows);
    let rows = comparable(rows);
    let all = points(&rows);
    let best = front(&all);
    let plot = Plot {
        marks: marks(&groups, &rows, &all, &best),
        groups,
        front: best.iter().map(|&i| all[i]).collect(),
        floor: floor.filter(|floor| *floor > 0.0),
        error: "error (RMSE against the limit)",
    };
    drawn(&plot)
}

/// The error against the twin over the time of the picture, of the settings that are judged by it. Nothing is drawn as the front:
/// these knobs are no alternatives for one another.
///
/// # Errors
/// [`Error::Failed`](crate::error::Error::Failed) where plotters does.
pub fn error_against_twin(rows: &[Row]) -> Result<String> {
    let groups = knobs(rows);
    let rows: Vec<&Row> =
        rows.iter().filter(|row| row.judge == super::Judge::Twin && row.twin.is_some()).collect();
    let all: Vec<[f64; 2]> =
        rows.iter().map(|row| [row.trace_ms.median, row.twin.map_or(f64::NAN, |twin| twin.rmse)]).collect();
    let wrong: Vec<usize> = (0..rows.len()).filter(|&i| all[i][1] > 0.0).collect();
    let plot = Plot {
        marks: marks(&groups, &rows, &all, &wrong),
        groups,
        front: Vec::new(),
        floor: None,
        error: "error (RMSE, same sample points in exact)",
    };
    drawn(&plot)
}

/// All knobs, so that each has the same colour in every plot.
fn knobs(rows: &[Row]) -> Vec<String> {
    let mut knobs: Vec<String> = Vec::new();
    for row in rows {
        if !knobs.contains(&row.knob) {
            knobs.push(row.knob.clone());
        }
    }
    knobs
}

fn marks(knobs: &[String], rows: &[&Row], points: &[[f64; 2]], labelled: &[usize]) -> Vec<Mark> {
    let mark = |(i, (row, &[time, error])): (usize, (&&Row, &[f64; 2]))| Mark {
        group: knobs.iter().position(|knob| *knob == row.knob).unwrap_or(0),
        time,
        spread: [row.trace_ms.lower, row.trace_ms.upper],
        error,
        label: labelled.contains(&i).then(|| row.setting.clone()),
    };
    rows.iter().zip(points).enumerate().map(mark).collect()
}

fn drawn(plot: &Plot) -> Result<String> {
    let mut svg = String::new();
    draw(&mut svg, plot).map_err(failed)?;
    // As large as there is room for.
    Ok(svg.replacen("<svg ", "<svg role=\"img\" ", 1))
}

/// Of a group, its colour.
fn colour(group: usize) -> RGBColor {
    PALETTE[group % COLOURS]
}

/// The times that are written on the axis: those that begin with 1, 2 or 5.
fn round_time(time: f64) -> String {
    let digit = time / 10f64.powf((time.log10() + 1e-9).floor());
    let is_round = [1.0, 2.0, 5.0].iter().any(|round| (digit - round).abs() < 1e-6);
    if is_round {
        format!("{}", (time * 1e4).round() / 1e4)
    } else {
        String::new()
    }
}

fn draw<'a>(svg: &'a mut String, plot: &Plot) -> Drawn<'a> {
    let columns = 3;
    let present: Vec<usize> =
        (0..plot.groups.len()).filter(|&group| plot.marks.iter().any(|mark| mark.group == group)).collect();
    let legend_lines = present.len().div_ceil(columns) as i32;
    let height = HEIGHT + (LEGEND * legend_lines) as u32;
    let root = SVGBackend::with_string(svg, (WIDTH, height)).into_drawing_area();
    root.fill(&WHITE)?;
    let (area, legend) = root.split_vertically(HEIGHT);
    let positive = || plot.marks.iter().map(|mark| mark.error).chain(plot.floor).filter(|error| *error > 0.0);
    let errors = if positive().next().is_some() { decades(positive()) } else { 0.1..1.0 };
    // Room for a label above the largest, and beside the slowest.
    let errors = errors.start..errors.end * 1.6;
    let has_zero = plot.marks.iter().any(|mark| mark.error == 0.0);
    // A line of its own for 0, which has no logarithm.
    let zero = 10f64.powf((errors.start.log10() - 0.6).floor());
    let errors = if has_zero { zero * 0.6..errors.end } else { errors };
    let times = plot.marks.iter().flat_map(|mark| mark.spread);
    let times = decades(times);
    let times = times.start..times.end * 1.6;
    let place = |error: f64| if error > 0.0 { error } else { zero };

    let mut chart = ChartBuilder::on(&area)
        .margin(8)
        .x_label_area_size(40)
        .y_label_area_size(66)
        .build_cartesian_2d(times.clone().log_scale(), errors.clone().log_scale())?;
    let error_label = |error: &f64| {
        if has_zero && *error < zero * 2.0 {
            return if (*error / zero).log10().abs() < 0.01 { "0".to_owned() } else { String::new() };
        }
        format!("{error:.0e}")
    };
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .bold_line_style(GRID)
        .axis_style(INK)
        // Enough of them that plotters goes through the digits of each power of ten.
        .x_labels(40)
        .y_labels(8)
        .x_label_formatter(&|time| round_time(*time))
        .y_label_formatter(&error_label)
        .x_desc("milliseconds")
        .y_desc(plot.error)
        .label_style(text(16))
        .axis_desc_style(text(16))
        .draw()?;
    if let Some(floor) = plot.floor {
        let line = [(times.start, floor), (times.end, floor)];
        chart.draw_series(DashedLineSeries::new(line, 4, 4, PALETTE[6].stroke_width(1)))?;
        let style = text(14).color(&PALETTE[6]).pos(Pos::new(HPos::Left, VPos::Bottom));
        chart.draw_series([Text::new(
            "the reference's own error",
            (times.start * 1.05, floor * 1.03),
            style,
        )])?;
    }
    let steps = plot.front.windows(2).flat_map(|pair| {
        let [[a, b], [c, d]] = [pair[0], pair[1]];
        [(a, place(b)), (c, place(b)), (c, place(d))]
    });
    let start = plot.front.first().map(|&[time, error]| (time, place(error)));
    chart.draw_series(LineSeries::new(start.into_iter().chain(steps), INK.stroke_width(1)))?;
    for mark in &plot.marks {
        let (colour, y) = (colour(mark.group), place(mark.error));
        let spread = [(mark.spread[0], y), (mark.spread[1], y)];
        chart.draw_series([PathElement::new(spread, colour.stroke_width(1))])?;
        let style = if mark.label.is_some() { colour.filled() } else { colour.stroke_width(1) };
        // Colours are fewer than knobs: those that come round again have another shape.
        match mark.group / COLOURS {
            0 => chart.draw_series([Circle::new((mark.time, y), 4, style)])?,
            // plotters fills its own triangles whatever the style.
            _ if mark.label.is_none() => {
                let outline = PathElement::new([(0, -5), (4, 3), (-4, 3), (0, -5)], style);
                chart.draw_series([EmptyElement::at((mark.time, y)) + outline])?
            }
            _ => chart.draw_series([TriangleMarker::new((mark.time, y), 5, style)])?,
        };
    }
    let mut taken: Vec<(i32, i32)> = Vec::new();
    for mark in &plot.marks {
        let Some(label) = &mark.label else { continue };
        let point = (mark.time, place(mark.error));
        let at = chart.backend_coord(&point);
        // Labels that would lie on one another are left to the table.
        if taken.iter().any(|other| (other.1 - at.1).abs() < 15 && (other.0 - at.0).abs() < 110) {
            continue;
        }
        taken.push(at);
        let style = text(14).pos(Pos::new(HPos::Left, VPos::Bottom));
        chart.draw_series([EmptyElement::at(point) + Text::new(label.clone(), (6, -3), style)])?;
    }
    for (place, &index) in present.iter().enumerate() {
        let (column, line, group) = (place % columns, place / columns, &plot.groups[index]);
        let (x, y) = (70 + column as i32 * 160, 6 + LEGEND * line as i32);
        match index / COLOURS {
            0 => legend.draw(&Circle::new((x, y), 4, colour(index).filled()))?,
            _ => legend.draw(&TriangleMarker::new((x, y), 5, colour(index).filled()))?,
        }
        legend.draw(&Text::new(
            group.clone(),
            (x + 10, y),
            text(15).pos(Pos::new(HPos::Left, VPos::Center)),
        ))?;
    }
    root.present()
}
