//! Plots as SVG, by plotters.

use plotters::coord::Shift;
use plotters::coord::ranged1d::{AsRangedCoord, Ranged, SegmentValue, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::Quartiles;
use crate::error::{Error, Result};

/// A bar with quartiles.
pub(crate) struct Bar {
    /// Label beside the bar.
    pub name: String,
    /// Its colour: of the palette, by number.
    pub colour: usize,
    /// Length.
    pub value: Quartiles,
    /// Warning behind the bar, in red; empty if there is none.
    pub warning: String,
}

/// A line plot.
pub(crate) struct Line {
    /// Name in the legend.
    pub name: String,
    /// Its colour: of the palette, by number.
    pub colour: usize,
    /// Whether it is dashed.
    pub broken: bool,
    /// Points.
    pub points: Vec<[f64; 2]>,
}

/// A plot with several lines.
pub(crate) struct Panel {
    /// Title.
    pub title: String,
    /// Label of the y axis.
    pub unit: &'static str,
    /// Whether the y axis is linear from 0; logarithmic otherwise.
    pub linear: bool,
    /// Lines.
    pub lines: Vec<Line>,
}

/// Colours that are distinguishable with red-green colour blindness (Okabe and Ito, Color Universal Design, 2008).
pub(crate) const PALETTE: [RGBColor; 7] = [
    RGBColor(213, 94, 0),
    RGBColor(150, 130, 20),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(0, 114, 178),
    RGBColor(90, 90, 90),
];

pub(crate) const INK: RGBColor = RGBColor(40, 40, 40);
const WARNING: RGBColor = RGBColor(190, 0, 0);
pub(crate) const GRID: RGBColor = RGBColor(225, 225, 225);

fn colour(index: usize) -> RGBColor {
    PALETTE[index % PALETTE.len()]
}

pub(crate) fn text(size: i32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&INK)
}

/// Text to the right of its position.
pub(crate) fn left(size: i32, vertical: VPos) -> TextStyle<'static> {
    text(size).pos(Pos::new(HPos::Left, vertical))
}

pub(crate) fn failed(e: impl std::fmt::Display) -> Error {
    Error::Failed { what: format!("the plot cannot be drawn: {e}"), hint: String::new() }
}

/// Horizontal bars from top to bottom, with a line from the lower to the upper quartile each.
///
/// # Errors
/// [`Error::Failed`] if plotters fails.
pub(crate) fn bars(unit: &str, bars: &[Bar]) -> Result<String> {
    let mut svg = String::new();
    draw_bars(&mut svg, unit, bars).map_err(failed)?;
    Ok(svg)
}

pub(crate) type Drawn<'a> =
    std::result::Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>>;

fn draw_bars<'a>(svg: &'a mut String, unit: &str, bars: &[Bar]) -> Drawn<'a> {
    let size = (900, 64 + 22 * bars.len() as u32);
    let root = SVGBackend::with_string(svg, size).into_drawing_area();
    root.fill(&WHITE)?;
    let longest = bars.iter().map(|bar| bar.value.upper).fold(f64::MIN_POSITIVE, f64::max);
    // Segment ranges of plotters include the end.
    let rows = (0..bars.len().max(1) - 1).into_segmented();
    let mut chart = ChartBuilder::on(&root)
        .margin(8)
        .x_label_area_size(40)
        .y_label_area_size(290)
        .build_cartesian_2d(0.0..longest * 1.3, rows)?;
    // The y axis points upwards.
    let place = |index: usize| bars.len() - 1 - index;
    let label = |value: &SegmentValue<usize>| match value {
        SegmentValue::CenterOf(row) if *row < bars.len() => bars[place(*row)].name.clone(),
        _ => String::new(),
    };
    chart
        .configure_mesh()
        .disable_y_mesh()
        .light_line_style(WHITE)
        .bold_line_style(GRID)
        .axis_style(INK)
        .x_labels(8)
        .y_labels(bars.len())
        .x_label_formatter(&|x| plain(*x))
        .y_label_formatter(&label)
        .x_desc(unit)
        .label_style(text(13))
        .axis_desc_style(text(13))
        .draw()?;
    for (index, bar) in bars.iter().enumerate() {
        let row = place(index);
        let (lower, upper) = (SegmentValue::Exact(row), SegmentValue::Exact(row + 1));
        let fill = colour(bar.colour).filled();
        let mut shape = Rectangle::new([(0.0, lower), (bar.value.median, upper)], fill);
        shape.set_margin(4, 4, 0, 0);
        chart.draw_series([shape])?;
        let middle = || SegmentValue::CenterOf(row);
        let spread = [(bar.value.lower, middle()), (bar.value.upper, middle())];
        chart.draw_series([PathElement::new(spread, INK.stroke_width(2))])?;
        let number = Text::new(short(bar.value.median), (8, 0), left(12, VPos::Center));
        let warning = Text::new(bar.warning.clone(), (52, 0), left(12, VPos::Center).color(&WARNING));
        chart.draw_series([EmptyElement::at((bar.value.upper, middle())) + number + warning])?;
    }
    root.present()
}

/// Formats a number with three digits, or in thousands or millions.
pub(crate) fn short(x: f64) -> String {
    match x.abs() {
        size if size >= 999_500.0 => format!("{:.3} M", x / 1e6),
        size if size >= 99.95 => format!("{x:.0}"),
        size if size >= 9.995 => format!("{x:.1}"),
        _ => format!("{x:.2}"),
    }
}

/// Panels side by side with a common legend and a logarithmic x axis.
///
/// # Errors
/// [`Error::Failed`] if plotters fails.
pub(crate) fn panels(across: &str, panels: &[Panel]) -> Result<String> {
    let mut svg = String::new();
    draw_panels(&mut svg, across, panels).map_err(failed)?;
    Ok(svg)
}

/// A point of a scatter plot.
pub(crate) struct Point {
    /// Label beside it.
    pub name: String,
    /// Its colour: of the palette, by number.
    pub colour: usize,
    /// x above 0, and y of 0 or more.
    pub place: [f64; 2],
}

/// Labelled points on logarithmic axes. Those with y = 0 are on a line below all others.
///
/// # Errors
/// [`Error::Failed`] if plotters fails.
pub(crate) fn scatter(across: &str, upright: &str, points: &[Point]) -> Result<String> {
    let mut svg = String::new();
    draw_scatter(&mut svg, across, upright, points).map_err(failed)?;
    Ok(svg.replacen("<svg ", "<svg role=\"img\" ", 1))
}

fn draw_scatter<'a>(svg: &'a mut String, across: &str, upright: &str, points: &[Point]) -> Drawn<'a> {
    let root = SVGBackend::with_string(svg, (760, 460)).into_drawing_area();
    root.fill(&WHITE)?;
    let along = decades(points.iter().map(|point| point.place[0]));
    let errors = || points.iter().map(|point| point.place[1]).filter(|&y| y > 0.0);
    let power = |round: fn(f64) -> f64, y: f64| 10f64.powf(round(y.log10()));
    let least = power(f64::floor, errors().fold(1e3, f64::min));
    let most = power(f64::ceil, errors().fold(1e4, f64::max));
    // 0 is drawn half a decade below the axis.
    let zero = least / 10f64.sqrt();
    let mut chart = ChartBuilder::on(&root)
        .margin(10)
        .x_label_area_size(42)
        .y_label_area_size(64)
        .build_cartesian_2d((along.start..along.end * 1.4).log_scale(), (zero / 1.5..most).log_scale())?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .bold_line_style(GRID)
        .axis_style(INK)
        .x_label_formatter(&|x| plain(*x))
        .y_label_formatter(&|y| power_of_ten(*y))
        .x_desc(across)
        .y_desc(upright)
        .label_style(text(13))
        .axis_desc_style(text(13))
        .draw()?;
    chart.draw_series([PathElement::new([(along.start, zero), (along.end * 1.4, zero)], GRID)])?;
    let origin = chart.backend_coord(&(along.start, zero));
    root.draw(&Text::new("0", (origin.0 - 8, origin.1), text(13).pos(Pos::new(HPos::Right, VPos::Center))))?;
    let place = |[x, y]: [f64; 2]| chart.backend_coord(&(x, if y > 0.0 { y } else { zero }));
    // Left and right ends and rows of what a label must not cover.
    let mut taken: Vec<(i32, i32, i32)> = points
        .iter()
        .map(|point| place(point.place))
        .map(|(column, row)| (column - 5, column + 5, row))
        .collect();
    for Point { name, colour: index, place: at } in points {
        let (column, row) = place(*at);
        root.draw(&Circle::new((column, row), 5, colour(*index).filled()))?;
        // Above or below the point where something is in the way.
        let (left_end, right_end) = (column + 9, column + 9 + 7 * name.len() as i32);
        let is_free = |row: i32| {
            let is_apart = |&(from, to, other): &(i32, i32, i32)| {
                (row - other).abs() >= 14 || right_end < from || to < left_end
            };
            taken.iter().all(is_apart)
        };
        let rows = [0, -15, 15, -30, 30].map(|offset| row + offset);
        let row = rows.into_iter().find(|&row| is_free(row)).unwrap_or(row);
        taken.push((left_end, right_end, row));
        root.draw(&Text::new(name.clone(), (left_end, row), left(13, VPos::Center)))?;
    }
    root.present()
}

/// The smallest range that contains the positive `numbers`, with ends of 1, 2 or 5 times a power of ten.
pub(crate) fn decades(numbers: impl Iterator<Item = f64> + Clone) -> std::ops::Range<f64> {
    let (low, high) = (numbers.clone().fold(f64::INFINITY, f64::min), numbers.fold(0.0, f64::max));
    if low > high {
        return 1.0..10.0;
    }
    let power = |x: f64| 10f64.powf(x.log10().floor());
    let nice = |x: f64| [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power(x));
    let below = nice(low).into_iter().rev().find(|nice| *nice <= low * 1.001).unwrap_or(low);
    let above = nice(high).into_iter().find(|nice| *nice >= high * 0.999).unwrap_or(high);
    below..above.max(below * 2.0)
}

fn draw_panels<'a>(svg: &'a mut String, across: &str, panels: &[Panel]) -> Drawn<'a> {
    let columns = panels.len().max(1);
    let root = SVGBackend::with_string(svg, (330 * columns as u32, 360)).into_drawing_area();
    root.fill(&WHITE)?;
    let (plots, legend) = root.split_vertically(310);
    for (panel, area) in panels.iter().zip(plots.split_evenly((1, columns))) {
        let values = || panel.lines.iter().flat_map(|line| line.points.iter().map(|point| point[1]));
        if panel.linear {
            let top = values().fold(f64::MIN_POSITIVE, f64::max);
            draw_panel(&area, across, panel, 0.0..1.1 * top)?;
        } else {
            draw_panel(&area, across, panel, decades(values()).log_scale())?;
        }
    }
    draw_legend(&legend, panels)?;
    root.present()
}

fn draw_panel<'a, Y>(
    area: &DrawingArea<SVGBackend<'a>, Shift>,
    across: &str,
    panel: &Panel,
    upright: Y,
) -> Drawn<'a>
where
    Y: AsRangedCoord<Value = f64>,
    Y::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    let along = decades(panel.lines.iter().flat_map(|line| line.points.iter().map(|point| point[0])));
    let mut chart = ChartBuilder::on(area)
        .caption(&panel.title, text(15))
        .margin(8)
        .x_label_area_size(38)
        .y_label_area_size(56)
        .build_cartesian_2d(along.log_scale(), upright)?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .bold_line_style(GRID)
        .axis_style(INK)
        .x_labels(6)
        .y_labels(8)
        .x_label_formatter(&|x| power_of_ten(*x))
        .y_label_formatter(&|y| plain(*y))
        .x_desc(across)
        .y_desc(panel.unit)
        .label_style(text(12))
        .axis_desc_style(text(12))
        .draw()?;
    for line in &panel.lines {
        let (points, colour) = (line.points.iter().map(|&[x, y]| (x, y)), colour(line.colour));
        let style = colour.stroke_width(2);
        if line.broken {
            chart.draw_series(DashedLineSeries::new(points.clone(), 5, 4, style))?;
        } else {
            chart.draw_series(LineSeries::new(points.clone(), style))?;
        }
        chart.draw_series(points.map(|point| Circle::new(point, 3, colour.filled())))?;
    }
    Ok(())
}

fn draw_legend<'a>(area: &DrawingArea<SVGBackend<'a>, Shift>, panels: &[Panel]) -> Drawn<'a> {
    let lines = panels.first().map_or(&[][..], |panel| &panel.lines);
    let (width, _) = area.dim_in_pixel();
    let step = width as i32 / lines.len().max(1) as i32;
    for (place, line) in (0..).zip(lines) {
        let (x, y, style) = (20 + place * step, 22, colour(line.colour).stroke_width(2));
        let dashes: &[(i32, i32)] = if line.broken { &[(0, 8), (12, 20), (24, 28)] } else { &[(0, 28)] };
        for (from, to) in dashes {
            area.draw(&PathElement::new([(x + from, y), (x + to, y)], style))?;
        }
        area.draw(&Text::new(line.name.clone(), (x + 36, y), left(13, VPos::Center)))?;
    }
    Ok(())
}

/// A power of ten with a superscript exponent.
fn power_of_ten(x: f64) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let exponent = x.log10().round();
    if (x.log10() - exponent).abs() > 1e-6 || !(0.0..10.0).contains(&exponent) {
        return String::new();
    }
    format!("10{}", DIGITS[exponent as usize])
}

/// Formats a number without trailing zeros.
fn plain(x: f64) -> String {
    if x >= 10_000.0 { power_of_ten(x) } else { format!("{}", (x * 1e4).round() / 1e4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_have_labels_and_warnings() {
        let value = Quartiles { lower: 9.0, median: 10.0, upper: 11.0 };
        let bar =
            |name: &str, warning: &str| Bar { name: name.into(), colour: 0, value, warning: warning.into() };
        let svg = bars("furlongs", &[bar("quick", ""), bar("brown <fox>", "3 wrong")]).expect("a plot");
        assert!(svg.starts_with("<svg ") && svg.trim_end().ends_with("</svg>"));
        for text in ["furlongs", "quick", "brown &lt;fox&gt;", "3 wrong", "10.0"] {
            assert!(svg.contains(text), "{text}: {svg}");
        }
        bars("nothing", &[]).expect("a plot of nothing");
    }

    #[test]
    fn axes_end_at_round_numbers() {
        assert_eq!(decades([3.0, 60.0].into_iter()), 2.0..100.0);
        assert_eq!(decades([1000.0, 1e7].into_iter()), 1000.0..1e7);
        assert_eq!(decades([5.0].into_iter()), 5.0..10.0);
        assert_eq!([1e3, 2e3, 1e7].map(power_of_ten), ["10³", "", "10⁷"]);
    }
}
