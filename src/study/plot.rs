//! Plots of error against time as SVG, by plotters. Colours are fixed; the page's CSS overrides them in dark mode.

use std::cell::RefCell;

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::advice::{comparable, points};
use super::data::SettingRow;
use super::pareto::{TimedError, front};
use super::path_sweep;
use crate::bench::Spread;
use crate::bench::plot::{Drawn, GRID, INK, PALETTE, decades, failed, text};
use crate::error::Result;

/// A setting in a plot.
struct Mark {
    /// Index of its group, which determines the colour.
    group: usize,
    /// Time in ms.
    time: Spread,
    /// Error; 0 is drawn on a separate line below all others.
    error: f64,
    /// Label, if not dominated.
    label: Option<String>,
}

/// A plot of marks.
struct Plot {
    groups: Vec<String>,
    marks: Vec<Mark>,
    /// Points of the Pareto front.
    front: Vec<TimedError>,
    /// Noise of the reference.
    floor: Option<f64>,
    /// Label of the error axis.
    error: &'static str,
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
    let groups = parameters(rows);
    let rows = comparable(rows);
    let all = points(&rows);
    let best = front(&all, floor);
    let plot = Plot {
        marks: marks(&groups, &rows, &all, &best),
        groups,
        front: best.iter().map(|&i| all[i]).collect(),
        floor: Some(floor).filter(|floor| *floor > 0.0),
        error: "error (RMSE against the limit)",
    };
    render_svg(&plot)
}

/// Plot of the error against the twin over the render time, for the settings with this reference. There is no Pareto
/// front, as these parameters are independent of each other.
///
/// # Errors
/// [`Error::Failed`](crate::error::Error::Failed) if plotters fails.
pub(crate) fn error_against_twin(rows: &[SettingRow]) -> Result<String> {
    let groups = parameters(rows);
    let is_shown = |row: &&SettingRow| {
        row.reference == super::ReferenceKind::Twin && row.twin.is_some() && !row.has_effect_off
    };
    let rows: Vec<&SettingRow> = rows.iter().filter(is_shown).collect();
    let all = points_of(&rows, |row| row.twin.map(|twin| twin.rmse));
    let wrong: Vec<usize> = (0..rows.len()).filter(|&i| all[i].error > 0.0).collect();
    let plot = Plot {
        marks: marks(&groups, &rows, &all, &wrong),
        groups,
        front: Vec::new(),
        floor: None,
        error: "error (RMSE, same sample points in exact)",
    };
    render_svg(&plot)
}

/// Plot of relMSE against the limit over the render time, for samples and the parameters of path tracing, with the Pareto
/// front; `None` where no path is traced. RMSE is dominated by what is bright, such as the edges of visible lights.
///
/// # Errors
/// [`Error::Failed`](crate::error::Error::Failed) if plotters fails.
pub(crate) fn error_of_paths(rows: &[SettingRow]) -> Result<Option<String>> {
    if !rows.iter().any(|row| path_sweep::PARAMETERS.contains(&row.parameter.as_str())) {
        return Ok(None);
    }
    let groups = parameters(rows);
    let others = ["samples", "together"];
    let is_shown = |row: &&SettingRow| {
        let parameter = row.parameter.as_str();
        path_sweep::PARAMETERS.contains(&parameter) || others.contains(&parameter)
    };
    let rows: Vec<&SettingRow> = comparable(rows).into_iter().filter(is_shown).collect();
    let all = points_of(&rows, |row| row.limit.map(|limit| limit.rel_mse));
    let best = front(&all, 0.0);
    let plot = Plot {
        marks: marks(&groups, &rows, &all, &best),
        groups,
        front: best.iter().map(|&i| all[i]).collect(),
        floor: None,
        error: "error (relMSE against the limit)",
    };
    render_svg(&plot).map(Some)
}

/// Time and error of each row; NaN for a missing error.
fn points_of(rows: &[&SettingRow], error: impl Fn(&SettingRow) -> Option<f64>) -> Vec<TimedError> {
    rows.iter().map(|row| TimedError { time: row.trace_ms, error: error(row).unwrap_or(f64::NAN) }).collect()
}

/// All parameters in order, so that each has the same colour in every plot.
fn parameters(rows: &[SettingRow]) -> Vec<String> {
    let mut parameters: Vec<String> = Vec::new();
    for row in rows {
        if !parameters.contains(&row.parameter) {
            parameters.push(row.parameter.clone());
        }
    }
    parameters
}

fn marks(
    parameters: &[String],
    rows: &[&SettingRow],
    points: &[TimedError],
    labelled: &[usize],
) -> Vec<Mark> {
    let mark = |(i, (row, &TimedError { time, error })): (usize, (&&SettingRow, &TimedError))| Mark {
        group: parameters.iter().position(|parameter| *parameter == row.parameter).unwrap_or(0),
        time,
        error,
        label: labelled.contains(&i).then(|| label(row)),
    };
    rows.iter().zip(points).enumerate().map(mark).collect()
}

/// Short name of a setting: without what is in brackets, and with its parameter if it begins with a number that is not a count.
fn label(row: &SettingRow) -> String {
    let name = row.setting.split(" (").next().unwrap_or_default();
    if name.parse::<f64>().is_ok() { format!("{} {name}", row.parameter) } else { name.to_owned() }
}

fn render_svg(plot: &Plot) -> Result<String> {
    let mut svg = String::new();
    draw(&mut svg, plot).map_err(failed)?;
    Ok(svg.replacen("<svg ", "<svg role=\"img\" ", 1))
}

fn colour(group: usize) -> RGBColor {
    PALETTE[group % COLOURS]
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

/// A rectangle in pixels.
#[derive(Clone, Copy)]
struct PixelBox {
    x: i32,
    y: i32,
    width: i32,
    height: i32,
}

impl PixelBox {
    /// The box of a mark.
    fn around((x, y): (i32, i32)) -> Self {
        PixelBox { x: x - 4, y: y - 4, width: 9, height: 9 }
    }

    fn overlaps(&self, other: &PixelBox) -> bool {
        let is_beside = self.x + self.width <= other.x || other.x + other.width <= self.x;
        let is_above = self.y + self.height <= other.y || other.y + other.height <= self.y;
        !is_beside && !is_above
    }

    fn contains(&self, other: &PixelBox) -> bool {
        (self.x..=self.x + self.width - other.width).contains(&other.x)
            && (self.y..=self.y + self.height - other.height).contains(&other.y)
    }
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
    let boxes = corners.map(|(x, y)| PixelBox { x, y, width, height });
    boxes.into_iter().find(|label| inside.contains(label) && !taken.iter().any(|other| label.overlaps(other)))
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
    // Margin for labels.
    let errors = errors.start..errors.end * 1.6;
    let has_zero = plot.marks.iter().any(|mark| mark.error == 0.0);
    // Position of the error 0, which has no logarithm.
    let zero = 10f64.powf((errors.start.log10() - 0.6).floor());
    let errors = if has_zero { zero * 0.6..errors.end } else { errors };
    let times = plot.marks.iter().flat_map(|mark| [mark.time.lower, mark.time.upper]);
    let times = decades(times);
    let times = times.start..times.end * 1.6;
    let position = |error: f64| if error > 0.0 { error } else { zero };

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
        let [(a, b), (c, d)] = [pair[0], pair[1]].map(|point| (point.time.median, position(point.error)));
        [(a, b), (c, b), (c, d)]
    });
    let start = plot.front.first().map(|point| (point.time.median, position(point.error)));
    chart.draw_series(LineSeries::new(start.into_iter().chain(steps), INK.stroke_width(1)))?;
    for mark in &plot.marks {
        let (colour, x, y) = (colour(mark.group), mark.time.median, position(mark.error));
        let spread = [(mark.time.lower, y), (mark.time.upper, y)];
        chart.draw_series([PathElement::new(spread, colour.stroke_width(1))])?;
        let style = if mark.label.is_some() { colour.filled() } else { colour.stroke_width(1) };
        // Parameters beyond the number of colours have triangles.
        match mark.group / COLOURS {
            0 => chart.draw_series([Circle::new((x, y), 4, style)])?,
            // `TriangleMarker` is always filled.
            _ if mark.label.is_none() => {
                let outline = PathElement::new([(0, -5), (4, 3), (-4, 3), (0, -5)], style);
                chart.draw_series([EmptyElement::at((x, y)) + outline])?
            }
            _ => chart.draw_series([TriangleMarker::new((x, y), 5, style)])?,
        };
    }
    let place = |mark: &Mark| chart.backend_coord(&(mark.time.median, position(mark.error)));
    let (x_range, y_range) = chart.plotting_area().get_pixel_range();
    let inside = PixelBox {
        x: x_range.start,
        y: y_range.start,
        width: x_range.len() as i32,
        height: y_range.len() as i32,
    };
    let mut taken: Vec<PixelBox> = plot.marks.iter().map(|mark| PixelBox::around(place(mark))).collect();
    for mark in &plot.marks {
        let Some(label) = &mark.label else { continue };
        let size = (LABEL_ADVANCE * label.chars().count() as i32, LABEL_HEIGHT);
        if let Some(free) = free_place(place(mark), size, &inside, &taken) {
            let style = text(14).pos(Pos::new(HPos::Left, VPos::Top));
            root.draw(&Text::new(label.clone(), (free.x, free.y), style))?;
            taken.push(free);
        }
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
