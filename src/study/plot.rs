//! Plots of error against time as SVG, by plotters. Colours are fixed; the page's CSS overrides them in dark mode.

use std::cell::RefCell;
use std::ops::Range;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::VPos;

use super::ReferenceKind;
use super::advice::{comparable, points};
use super::data::SettingRow;
use super::pareto::{TimedError, front};
use super::path_sweep;
use super::work::distinct;
use crate::bench::plot::{Drawn, GRID, INK, PALETTE, decades, failed, left, text};
use crate::error::Result;

/// Settings in a plot.
struct Plot<'a> {
    rows: Vec<&'a SettingRow>,
    /// Time and error of each row. The error 0 is drawn on a separate line below all others.
    points: Vec<TimedError>,
    /// All parameters of the study, so that each has the same colour in every plot.
    groups: Vec<&'a str>,
    /// Indices of the rows of the Pareto front.
    front: Vec<usize>,
    /// Indices of the rows that are filled and labelled.
    labelled: Vec<usize>,
    /// Noise of the reference.
    floor: Option<f64>,
    /// Label of the error axis.
    axis: &'static str,
}

/// Width in pixels. Narrow screens show it at three quarters of this size, at which text must be legible.
const WIDTH: u32 = 560;
/// Height without the legend.
const HEIGHT: u32 = 400;
/// Number of group colours: the palette without its last colour, grey.
const COLOURS: usize = PALETTE.len() - 1;
/// Height of a legend line in pixels.
const LEGEND: i32 = 18;

/// Plot of the error against the limit over the render time, for all comparable settings, with the Pareto front. `floor`
/// is the noise of the limit.
///
/// # Errors
/// [`Error::Failed`](crate::error::Error::Failed) if plotters fails.
pub fn error_against_time(rows: &[SettingRow], floor: f64) -> Result<String> {
    let error = |row: &SettingRow| row.limit.map(|limit| limit.rmse);
    Plot::new(rows, comparable(rows), error, Some(floor), "error (RMSE against the limit)").svg()
}

/// Plot of the error against the twin over the render time, for the settings with this reference. There is no Pareto
/// front, as these parameters are independent of each other.
///
/// # Errors
/// [`Error::Failed`](crate::error::Error::Failed) if plotters fails.
pub(crate) fn error_against_twin(rows: &[SettingRow]) -> Result<String> {
    let is_shown = |row: &&SettingRow| {
        row.reference == ReferenceKind::SameSamples && row.twin.is_some() && !row.has_effect_off
    };
    let shown = rows.iter().filter(is_shown).collect();
    let error = |row: &SettingRow| row.twin.map(|twin| twin.rmse);
    Plot::new(rows, shown, error, None, "error (RMSE, same sample points in exact)").svg()
}

/// Plot of relMSE against the limit over the render time, for samples and the parameters of path tracing, with the Pareto
/// front; `None` where no path is traced. RMSE is dominated by what is bright, such as the edges of visible lights.
///
/// # Errors
/// [`Error::Failed`](crate::error::Error::Failed) if plotters fails.
pub(crate) fn error_of_paths(rows: &[SettingRow]) -> Result<Option<String>> {
    let is_of_paths = |row: &SettingRow| path_sweep::PARAMETERS.contains(&row.parameter.as_str());
    if !rows.iter().any(is_of_paths) {
        return Ok(None);
    }
    let mut shown = comparable(rows);
    shown.retain(|row| is_of_paths(row) || ["samples", "together"].contains(&row.parameter.as_str()));
    let error = |row: &SettingRow| row.limit.map(|limit| limit.rel_mse);
    Plot::new(rows, shown, error, Some(0.0), "error (relMSE against the limit)").svg().map(Some)
}

impl<'a> Plot<'a> {
    /// A plot of `rows`, a part of `all`, with the Pareto front if there is a `tolerance`, the noise of the reference.
    fn new(
        all: &'a [SettingRow],
        rows: Vec<&'a SettingRow>,
        error: impl Fn(&SettingRow) -> Option<f64>,
        tolerance: Option<f64>,
        axis: &'static str,
    ) -> Self {
        let groups = distinct(all.iter().map(|row| row.parameter.as_str()));
        let points = points(&rows, error);
        let front = tolerance.map_or(Vec::new(), |tolerance| front(&points, tolerance));
        let labelled = match tolerance {
            Some(_) => front.clone(),
            None => (0..rows.len()).filter(|&i| points[i].error > 0.0).collect(),
        };
        Plot { rows, points, groups, front, labelled, floor: tolerance.filter(|floor| *floor > 0.0), axis }
    }

    /// The group of a row, which determines the colour.
    fn group(&self, row: &SettingRow) -> usize {
        self.groups.iter().position(|group| *group == row.parameter).unwrap_or(0)
    }

    fn svg(&self) -> Result<String> {
        let mut svg = String::new();
        draw(&mut svg, self).map_err(failed)?;
        Ok(svg.replacen("<svg ", "<svg role=\"img\" ", 1))
    }
}

/// Short name of a setting: without what is in brackets, and with its parameter if it begins with a number that is not a count.
fn label(row: &SettingRow) -> String {
    let name = row.setting.split(" (").next().unwrap_or_default();
    if name.parse::<f64>().is_ok() { format!("{} {name}", row.parameter) } else { name.to_owned() }
}

/// Label of a time on the axis; empty unless its first digit is 1, 2 or 5 and the others are 0.
fn round_time(time: f64) -> String {
    let digit = time / 10f64.powf((time.log10() + 1e-9).floor());
    let is_round = [1.0, 2.0, 5.0].iter().any(|round| (digit - round).abs() < 1e-6);
    if is_round { format!("{}", (time * 1e4).round() / 1e4) } else { String::new() }
}

/// Advance width of a label's character in pixels, at most, on average.
const LABEL_ADVANCE: i32 = 7;
/// Height of a label in pixels.
const LABEL_HEIGHT: i32 = 15;

/// The columns and rows of a rectangle in pixels.
type PixelBox = (Range<i32>, Range<i32>);

fn overlap(a: &PixelBox, b: &PixelBox) -> bool {
    a.0.start < b.0.end && b.0.start < a.0.end && a.1.start < b.1.end && b.1.start < a.1.end
}

fn contains(outer: &PixelBox, inner: &PixelBox) -> bool {
    let spans = |outer: &Range<i32>, inner: &Range<i32>| outer.start <= inner.start && inner.end <= outer.end;
    spans(&outer.0, &inner.0) && spans(&outer.1, &inner.1)
}

/// A place for a label of this size beside the mark at `(x, y)`, inside the plot and without overlaps; `None` if there is
/// none. To the lower left of a point of the front there are no other points.
fn free_place(
    (x, y): (i32, i32),
    (width, height): (i32, i32),
    inside: &PixelBox,
    taken: &[PixelBox],
) -> Option<PixelBox> {
    let (left, right, above, below) = (x - 6 - width, x + 6, y - 2 - height, y + 2);
    let corners = [(left, below), (right, above), (left, above), (right, below), (x - width / 2, y + 6)];
    let boxes = corners.map(|(x, y)| (x..x + width, y..y + height));
    boxes
        .into_iter()
        .find(|label| contains(inside, label) && !taken.iter().any(|other| overlap(label, other)))
}

/// A circle; a triangle for parameters beyond the number of colours.
fn draw_mark<'a>(
    area: &DrawingArea<SVGBackend<'a>, Shift>,
    (x, y): (i32, i32),
    group: usize,
    is_filled: bool,
) -> Drawn<'a> {
    let colour = PALETTE[group % COLOURS];
    let style = if is_filled { colour.filled() } else { colour.stroke_width(1) };
    match group / COLOURS {
        0 => area.draw(&Circle::new((x, y), 4, style)),
        // `TriangleMarker` is always filled.
        _ if !is_filled => {
            let outline = [(x, y - 5), (x + 4, y + 3), (x - 4, y + 3), (x, y - 5)];
            area.draw(&PathElement::new(outline, style))
        }
        _ => area.draw(&TriangleMarker::new((x, y), 5, style)),
    }
}

fn draw<'a>(svg: &'a mut String, plot: &Plot) -> Drawn<'a> {
    let columns = 3;
    let is_present = |group: &usize| plot.rows.iter().any(|row| plot.group(row) == *group);
    let present: Vec<usize> = (0..plot.groups.len()).filter(is_present).collect();
    let legend_lines = present.len().div_ceil(columns) as i32;
    let height = HEIGHT + (LEGEND * legend_lines) as u32;
    let root = SVGBackend::with_string(svg, (WIDTH, height)).into_drawing_area();
    root.fill(&WHITE)?;
    let (area, legend) = root.split_vertically(HEIGHT);
    let positive =
        || plot.points.iter().map(|point| point.error).chain(plot.floor).filter(|error| *error > 0.0);
    let errors = if positive().next().is_some() { decades(positive()) } else { 0.1..1.0 };
    // Margin for labels.
    let errors = errors.start..errors.end * 1.6;
    let has_zero = plot.points.iter().any(|point| point.error == 0.0);
    // Position of the error 0, which has no logarithm.
    let zero = 10f64.powf((errors.start.log10() - 0.6).floor());
    let errors = if has_zero { zero * 0.6..errors.end } else { errors };
    let times = decades(plot.points.iter().flat_map(|point| [point.time.lower, point.time.upper]));
    let times = times.start..times.end * 1.6;
    let position =
        |point: &TimedError| (point.time.median, if point.error > 0.0 { point.error } else { zero });

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
    let last_time = RefCell::new(String::new());
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .bold_line_style(GRID)
        .axis_style(INK)
        // Enough labels that plotters includes all digits of each power of ten.
        .x_labels(40)
        .y_labels(8)
        .x_label_formatter(&|time| {
            // plotters returns some times twice.
            let label = round_time(*time);
            if last_time.replace(label.clone()) == label { String::new() } else { label }
        })
        .y_label_formatter(&error_label)
        .x_desc("milliseconds")
        .y_desc(plot.axis)
        .label_style(text(16))
        .axis_desc_style(text(16))
        .draw()?;
    if let Some(floor) = plot.floor {
        let line = [(times.start, floor), (times.end, floor)];
        chart.draw_series(DashedLineSeries::new(line, 4, 4, PALETTE[6].stroke_width(1)))?;
        let (place, style) = ((times.start * 1.05, floor * 1.03), left(14, VPos::Bottom).color(&PALETTE[6]));
        chart.draw_series([Text::new("the reference's own error", place, style)])?;
    }
    let best: Vec<(f64, f64)> = plot.front.iter().map(|&i| position(&plot.points[i])).collect();
    let steps = best.windows(2).flat_map(|pair| [pair[0], (pair[1].0, pair[0].1), pair[1]]);
    chart
        .draw_series(LineSeries::new(best.first().copied().into_iter().chain(steps), INK.stroke_width(1)))?;
    let mut taken: Vec<PixelBox> = Vec::new();
    for (i, (row, point)) in plot.rows.iter().zip(&plot.points).enumerate() {
        let (group, (_, y)) = (plot.group(row), position(point));
        let spread = [(point.time.lower, y), (point.time.upper, y)];
        chart.draw_series([PathElement::new(spread, PALETTE[group % COLOURS].stroke_width(1))])?;
        let (x, y) = chart.backend_coord(&position(point));
        draw_mark(&root, (x, y), group, plot.labelled.contains(&i))?;
        taken.push((x - 4..x + 5, y - 4..y + 5));
    }
    let inside = chart.plotting_area().get_pixel_range();
    for (i, (row, point)) in plot.rows.iter().zip(&plot.points).enumerate() {
        if !plot.labelled.contains(&i) {
            continue;
        }
        let label = label(row);
        let size = (LABEL_ADVANCE * label.chars().count() as i32, LABEL_HEIGHT);
        if let Some(free) = free_place(chart.backend_coord(&position(point)), size, &inside, &taken) {
            root.draw(&Text::new(label, (free.0.start, free.1.start), left(14, VPos::Top)))?;
            taken.push(free);
        }
    }
    for (place, &group) in present.iter().enumerate() {
        let (column, line) = (place % columns, place / columns);
        let (x, y) = (70 + column as i32 * 160, 6 + LEGEND * line as i32);
        draw_mark(&legend, (x, y), group, true)?;
        legend.draw(&Text::new(plot.groups[group], (x + 10, y), left(15, VPos::Center)))?;
    }
    root.present()
}
