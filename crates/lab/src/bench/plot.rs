//! Plots as SVG: panels of lines, and scatter plots. Why without a crate: docs/decisions.md.

use std::fmt::Write;

use super::Quartiles;

/// Colours that are distinguishable with red-green colour blindness (Okabe and Ito, Color Universal Design, 2008).
const PALETTE: [&str; 7] = ["#D55E00", "#968214", "#009E73", "#CC79A7", "#56B4E9", "#0072B2", "#5A5A5A"];
/// Number of colours of groups: the palette without its last colour, grey.
const COLOURS: usize = PALETTE.len() - 1;

const INK: &str = "#282828";
const GRID: &str = "#E1E1E1";

/// `text-anchor` of text that begins, ends and has its middle at its position.
const START: &str = "start";
const END: &str = "end";
const MIDDLE: &str = "middle";

fn colour(index: usize) -> &'static str {
    PALETTE[index % PALETTE.len()]
}

/// An SVG under construction. Positions are in pixels from the top left.
struct Svg(String);

impl Svg {
    fn new([width, height]: [f64; 2]) -> Self {
        Svg(format!(
            "<svg role=\"img\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
             xmlns=\"http://www.w3.org/2000/svg\" font-family=\"sans-serif\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#FFFFFF\"/>\n"
        ))
    }

    /// A line through points; of a dashed one, `dashes` are the lengths of dashes and gaps.
    fn line(&mut self, points: &[[f64; 2]], colour: &str, width: f64, dashes: &str) {
        let points: Vec<String> = points.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        let _ = writeln!(
            self.0,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" stroke-dasharray=\"{dashes}\"/>",
            points.join(" ")
        );
    }

    /// Text whose middle has the height of its position.
    fn text(&mut self, [x, y]: [f64; 2], anchor: &str, size: f64, colour: &str, text: &str) {
        let (baseline, text) = (y + 0.35 * size, escaped(text));
        let _ = writeln!(
            self.0,
            "<text x=\"{x:.1}\" y=\"{baseline:.1}\" text-anchor=\"{anchor}\" font-size=\"{size}\" fill=\"{colour}\">{text}</text>"
        );
    }

    /// A circle; a triangle for groups beyond the number of colours.
    fn mark(&mut self, [x, y]: [f64; 2], group: usize, is_filled: bool) {
        let colour = PALETTE[group % COLOURS];
        let paint = format!("fill=\"{}\" stroke=\"{colour}\"", if is_filled { colour } else { "none" });
        let _ = match group / COLOURS {
            0 => writeln!(self.0, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.5\" {paint}/>"),
            _ => writeln!(self.0, "<path d=\"M{x:.1} {y:.1}m0 -5l4 8h-8z\" {paint}/>"),
        };
    }

    fn finish(self) -> String {
        self.0 + "</svg>\n"
    }
}

/// Text with HTML special characters escaped.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// An axis.
struct Axis {
    /// The values at its ends.
    ends: [f64; 2],
    is_logarithmic: bool,
    /// Where the value 0 is on a logarithmic axis.
    zero: f64,
}

impl Axis {
    fn linear(end: f64) -> Self {
        Axis { ends: [0.0, end], is_logarithmic: false, zero: 0.0 }
    }

    fn logarithmic(ends: [f64; 2]) -> Self {
        Axis { ends, is_logarithmic: true, zero: 0.0 }
    }

    /// The fraction of the axis below a value.
    fn share(&self, value: f64) -> f64 {
        let scaled = |value: f64| match self.is_logarithmic {
            true => if value > 0.0 { value } else { self.zero }.log10(),
            false => value,
        };
        let [low, high] = self.ends.map(scaled);
        (scaled(value) - low) / (high - low)
    }

    /// Round values on the axis, `most` or less.
    fn ticks(&self, most: usize) -> Vec<f64> {
        let [low, high] = self.ends;
        if !self.is_logarithmic {
            let step = round_numbers().find(|step| high / step <= most as f64).unwrap_or(high);
            return (0..=(high / step) as usize).map(|index| index as f64 * step).collect();
        }
        let range = low.max(1.2 * self.zero) * 0.999..high * 1.001;
        let mut ticks: Vec<f64> = round_numbers().filter(|number| range.contains(number)).collect();
        if ticks.len() > most {
            ticks.retain(|number| (number.log10() - number.log10().round()).abs() < 1e-6);
        }
        let step = ticks.len().div_ceil(most.max(1)).max(1);
        ticks.into_iter().step_by(step).collect()
    }
}

/// 1, 2 and 5 times the powers of ten, ascending.
fn round_numbers() -> impl DoubleEndedIterator<Item = f64> {
    (-20..20).flat_map(|power| [1.0, 2.0, 5.0].map(|digit| digit * 10f64.powi(power)))
}

/// The ends of the smallest range that contains the positive `numbers`, with ends of 1, 2 or 5 times a power of ten.
fn decades(numbers: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let (low, high) = (numbers.clone().fold(f64::INFINITY, f64::min), numbers.fold(0.0, f64::max));
    if low > high {
        return [1.0, 10.0];
    }
    let below = round_numbers().rev().find(|number| *number <= low * 1.001).unwrap_or(low);
    let above = round_numbers().find(|number| *number >= high * 0.999).unwrap_or(high);
    [below, above.max(below * 2.0)]
}

/// A round number without trailing zeros, by a power of ten if it is large or small.
fn tick_label(x: f64) -> String {
    if x == 0.0 || (0.999e-3..0.999e4).contains(&x) {
        return format!("{}", (x * 1e4).round() / 1e4);
    }
    let exponent = (x.log10() + 1e-6).floor();
    let superscript = |c: char| c.to_digit(10).and_then(|digit| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(digit as usize));
    let power: String = exponent.to_string().chars().map(|c| superscript(c).unwrap_or('⁻')).collect();
    match (x / 10f64.powf(exponent)).round() {
        1.0 => format!("10{power}"),
        digit => format!("{digit}·10{power}"),
    }
}

/// A plotting area: its left, top, right and bottom edges in pixels, and its axes.
struct Chart {
    edges: [f64; 4],
    x: Axis,
    y: Axis,
}

impl Chart {
    fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [left, top, right, bottom] = self.edges;
        [left + (right - left) * self.x.share(x), bottom + (top - bottom) * self.y.share(y)]
    }

    fn draw_x_axis(&self, svg: &mut Svg, size: f64, title: &str) {
        let [left, top, right, bottom] = self.edges;
        for x in self.x.ticks(((right - left) / (3.5 * size)) as usize) {
            let [column, _] = self.place([x, 0.0]);
            svg.line(&[[column, top], [column, bottom]], GRID, 1.0, "");
            svg.text([column, bottom + size], MIDDLE, size, INK, &tick_label(x));
        }
        svg.line(&[[left, bottom], [right, bottom]], INK, 1.0, "");
        svg.text([(left + right) / 2.0, bottom + 2.4 * size], MIDDLE, size, INK, title);
    }

    fn draw_y_axis(&self, svg: &mut Svg, size: f64, title: &str) {
        let [left, top, right, bottom] = self.edges;
        let zero = (self.y.zero > 0.0).then_some(0.0);
        for y in self.y.ticks(((bottom - top) / (3.0 * size)) as usize).into_iter().chain(zero) {
            let [_, row] = self.place([self.x.ends[0], y]);
            svg.line(&[[left, row], [right, row]], GRID, 1.0, "");
            svg.text([left - 5.0, row], END, size, INK, &tick_label(y));
        }
        svg.line(&[[left, top], [left, bottom]], INK, 1.0, "");
        let _ = write!(
            svg.0,
            "<g transform=\"translate({} {}) rotate(-90)\">",
            left - 4.3 * size,
            (top + bottom) / 2.0
        );
        svg.text([0.0; 2], MIDDLE, size, INK, title);
        svg.0 += "</g>\n";
    }
}

/// The number with three significant digits, and with groups of three if it is large.
pub fn three_digits(x: f64) -> String {
    match x {
        _ if x >= 99.95 => kiln::render::grouped(x.round() as u64, ','),
        _ if x >= 9.995 => format!("{x:.1}"),
        _ => format!("{x:.2}"),
    }
}

/// A line plot.
pub(crate) struct Line {
    /// Name in the legend.
    pub name: String,
    /// Its colour: of the palette, by number.
    pub colour: usize,
    /// Whether it is dashed.
    pub is_dashed: bool,
    /// Points.
    pub points: Vec<[f64; 2]>,
}

impl Line {
    fn dashes(&self) -> &'static str {
        if self.is_dashed { "5 4" } else { "" }
    }
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

/// Panels side by side with a common legend and a logarithmic x axis.
pub(crate) fn panels(across: &str, panels: &[Panel]) -> String {
    let width = 330.0 * panels.len().max(1) as f64;
    let mut svg = Svg::new([width, 360.0]);
    for (panel, left) in panels.iter().zip((0..).map(|index| 330.0 * f64::from(index))) {
        let values = |axis: usize| {
            panel.lines.iter().flat_map(move |line| line.points.iter().map(move |point| point[axis]))
        };
        let y = match panel.linear {
            true => Axis::linear(1.1 * values(1).fold(f64::MIN_POSITIVE, f64::max)),
            false => Axis::logarithmic(decades(values(1))),
        };
        let edges = [left + 54.0, 30.0, left + 314.0, 264.0];
        let chart = Chart { edges, x: Axis::logarithmic(decades(values(0))), y };
        svg.text([left + 184.0, 16.0], MIDDLE, 13.0, INK, &panel.title);
        chart.draw_x_axis(&mut svg, 10.0, across);
        chart.draw_y_axis(&mut svg, 10.0, panel.unit);
        for line in &panel.lines {
            let points: Vec<[f64; 2]> = line.points.iter().map(|&point| chart.place(point)).collect();
            svg.line(&points, colour(line.colour), 2.0, line.dashes());
            points.into_iter().for_each(|point| svg.mark(point, line.colour, true));
        }
    }
    let lines = panels.first().map_or(&[][..], |panel| &panel.lines);
    for (index, line) in lines.iter().enumerate() {
        let x = 20.0 + index as f64 * width / lines.len() as f64;
        svg.line(&[[x, 332.0], [x + 28.0, 332.0]], colour(line.colour), 2.0, line.dashes());
        svg.text([x + 36.0, 332.0], START, 11.0, INK, &line.name);
    }
    svg.finish()
}

/// A mark of a scatter plot.
pub(crate) struct Mark {
    /// Position along x, above 0, with its quartiles.
    pub x: Quartiles,
    /// Position along y. The value 0 is on a line below all others.
    pub y: f64,
    /// Number of its group, which determines its colour and shape.
    pub group: usize,
    /// Whether it is filled; hollow otherwise.
    pub is_filled: bool,
    /// Label beside it, which is left out where there is no room for it; may be empty.
    pub label: String,
}

/// A scatter plot on logarithmic axes.
pub(crate) struct Scatter<'a> {
    /// Width, and height without the legend.
    pub size: [f64; 2],
    /// Size of text.
    pub text: f64,
    /// Titles of the axes.
    pub axes: [&'a str; 2],
    /// Marks, drawn in their order.
    pub marks: Vec<Mark>,
    /// Indices of marks that are joined by steps.
    pub joined: Vec<usize>,
    /// A height with a dashed line and its label.
    pub floor: Option<(f64, &'a str)>,
    /// Names and numbers of the groups in the legend.
    pub groups: Vec<(&'a str, usize)>,
}

impl Scatter<'_> {
    /// Axes that contain all marks, with a margin for labels at the upper ends.
    fn axes(&self) -> [Axis; 2] {
        let positive = || {
            let heights = self.marks.iter().map(|mark| mark.y);
            heights.chain(self.floor.map(|(floor, _)| floor)).filter(|y| *y > 0.0)
        };
        let [low, high] = if positive().next().is_some() { decades(positive()) } else { [0.1, 1.0] };
        let has_zero = self.marks.iter().any(|mark| mark.y == 0.0);
        let zero = if has_zero { low / 10f64.sqrt() } else { 0.0 };
        let [left, right] = decades(self.marks.iter().flat_map(|mark| [mark.x.lower, mark.x.upper]));
        let ends = [if has_zero { zero / 1.5 } else { low }, high * 1.6];
        [Axis::logarithmic([left, right * 1.6]), Axis { zero, ..Axis::logarithmic(ends) }]
    }

    /// The plot as SVG.
    pub(crate) fn svg(&self) -> String {
        const COLUMNS: usize = 3;
        const LEGEND: f64 = 18.0;
        let ([width, height], text) = (self.size, self.text);
        let mut svg = Svg::new([width, height + LEGEND * self.groups.len().div_ceil(COLUMNS) as f64]);
        let [x, y] = self.axes();
        let edges = [5.2 * text, 8.0, width - 10.0, height - 3.2 * text];
        let chart = Chart { edges, x, y };
        chart.draw_x_axis(&mut svg, text, self.axes[0]);
        chart.draw_y_axis(&mut svg, text, self.axes[1]);
        if let Some((floor, name)) = self.floor {
            let [_, row] = chart.place([chart.x.ends[0], floor]);
            svg.line(&[[edges[0], row], [edges[2], row]], PALETTE[6], 1.0, "4 4");
            svg.text([edges[0] + 5.0, row - 8.0], START, text - 1.0, PALETTE[6], name);
        }
        let places: Vec<[f64; 2]> =
            self.marks.iter().map(|mark| chart.place([mark.x.median, mark.y])).collect();
        let steps = self.joined.windows(2).flat_map(|pair| {
            let [from, to] = [places[pair[0]], places[pair[1]]];
            [from, [to[0], from[1]], to]
        });
        svg.line(&steps.collect::<Vec<_>>(), INK, 1.0, "");
        for (mark, &place) in self.marks.iter().zip(&places) {
            let ends = [mark.x.lower, mark.x.upper].map(|x| chart.place([x, mark.y]));
            svg.line(&ends, PALETTE[mark.group % COLOURS], 1.0, "");
            svg.mark(place, mark.group, mark.is_filled);
        }
        let mut taken: Vec<Rectangle> =
            places.iter().map(|[x, y]| [x - 4.0, y - 4.0, x + 5.0, y + 5.0]).collect();
        for (mark, &place) in self.marks.iter().zip(&places).filter(|(mark, _)| !mark.label.is_empty()) {
            // The mean advance width of a character is at most 0.6 of the height of the text.
            let size = [(text - 1.0) * 0.6 * mark.label.chars().count() as f64, text];
            if let Some(free) = free_place(place, size, &edges, &taken) {
                let at = [free[0], (free[1] + free[3]) / 2.0];
                svg.text(at, START, text - 1.0, INK, &mark.label);
                taken.push(free);
            }
        }
        for (index, &(name, group)) in self.groups.iter().enumerate() {
            let (column, row) = ((index % COLUMNS) as f64, (index / COLUMNS) as f64);
            let [x, y] = [70.0 + 160.0 * column, height + 6.0 + LEGEND * row];
            svg.mark([x, y], group, true);
            svg.text([x + 10.0, y], START, text - 1.0, INK, name);
        }
        svg.finish()
    }
}

/// Left, top, right and bottom in pixels.
type Rectangle = [f64; 4];

/// A place for a label beside the mark at `(x, y)`, inside the plot and without overlaps; `None` if there is none. To the
/// lower left of a mark of a Pareto front there are no others.
fn free_place(
    [x, y]: [f64; 2],
    [width, height]: [f64; 2],
    inside: &Rectangle,
    taken: &[Rectangle],
) -> Option<Rectangle> {
    let (left, right) = (x - 6.0 - width, x + 7.0);
    let places = [0.0, height].into_iter().flat_map(|further| {
        let (above, below) = (y - 2.0 - height - further, y + 2.0 + further);
        [[left, below], [right, above], [left, above], [right, below], [right, y - height / 2.0]]
    });
    let mut labels = places.map(|[x, y]| [x, y, x + width, y + height]);
    labels.find(|[left, top, right, bottom]| {
        let overlaps = |other: &Rectangle| {
            *left < other[2] && other[0] < *right && *top < other[3] && other[1] < *bottom
        };
        let is_inside =
            inside[0] <= *left && inside[1] <= *top && *right <= inside[2] && *bottom <= inside[3];
        is_inside && !taken.iter().any(overlaps)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_end_at_round_numbers() {
        assert_eq!(decades([3.0, 60.0].into_iter()), [2.0, 100.0]);
        assert_eq!(decades([1000.0, 1e7].into_iter()), [1000.0, 1e7]);
        assert_eq!(decades([5.0].into_iter()), [5.0, 10.0]);
        let labels = [0.0, 0.005, 1e3, 2e5, 1e7, 5e-4].map(tick_label);
        assert_eq!(labels, ["0", "0.005", "1000", "2·10⁵", "10⁷", "5·10⁻⁴"]);
    }

    #[test]
    fn ticks_are_round_and_few() {
        // Steps of 20: six of them, and 0, are up to 130; steps of 10 would be thirteen.
        assert_eq!(Axis::linear(130.0).ticks(8), [0.0, 20.0, 40.0, 60.0, 80.0, 100.0, 120.0]);
        assert_eq!(Axis::logarithmic([2.0, 60.0]).ticks(8), [2.0, 5.0, 10.0, 20.0, 50.0]);
        // Powers of ten alone, as there are 13 round numbers; then every second.
        assert_eq!(Axis::logarithmic([1.0, 1e4]).ticks(8), [1.0, 10.0, 100.0, 1e3, 1e4]);
        assert_eq!(Axis::logarithmic([1.0, 1e4]).ticks(3), [1.0, 100.0, 1e4]);
        // On a logarithmic axis 0 is where the axis has it: halfway from 1 to 100.
        assert_eq!(Axis { zero: 10.0, ..Axis::logarithmic([1.0, 100.0]) }.share(0.0), 0.5);
    }
}
