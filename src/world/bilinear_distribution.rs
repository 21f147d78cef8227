//! The importance sampling of an environment image.
//!
//! Directions are sampled with a density that is interpolated, as the radiance is, between the centres of texels. Its value
//! there is the luminance above the mean of the whole sphere, because what is not brighter is found by BSDF samples (Karlík
//! and others, MIS Compensation, 2019, section 4), but not below a part of the luminance. So the density is above 0
//! wherever the radiance is. Images larger than the grid are averaged first.

use std::f64::consts::PI;

use glam::DVec3;

use crate::film::colour::luminance;

/// The most columns of the sampling grid; it has half as many rows.
const MOST_COLUMNS: usize = 2048;

/// The least part of the luminance that is the density, before it is normalised.
const LEAST_SHARE: f64 = 0.1;

/// A distribution over the image whose density, per solid angle, is bilinear between the centres of the texels of a grid,
/// as the radiance is.
pub(super) struct BilinearDistribution {
    columns: usize,
    rows: usize,
    /// Densities at the centres of texels, not normalised.
    weights: Vec<f32>,
    /// Cumulative probabilities, not normalised, of the cells between the centres of four texels, row by row: the first row
    /// lies above the centres of the first texels, the last row below those of the last.
    cells: Vec<f32>,
    /// Cumulative sums of the rows of cells.
    sums: Vec<f64>,
    /// Where searches in `sums` and in each row of `cells` begin and end.
    row_guide: Guide,
    column_guides: Vec<Guide>,
    /// The cosines of the polar angles of their upper edges, and of the last lower edge.
    cosines: Vec<f64>,
    /// The densities in them over the interpolated weight. Within a cell the density is bilinear in the unit square; the
    /// cell's probability is that of its solid angle.
    factors: Vec<f64>,
}

/// A cell of a distribution that two numbers choose, and two numbers that are uniform in [0, 1] within it.
pub(crate) struct Cell {
    column: usize,
    row: usize,
    numbers: [f64; 2],
}

impl BilinearDistribution {
    /// The distribution for an image of RGB texels in longitude and latitude, row by row from the top.
    pub(super) fn new(width: usize, height: usize, texels: &[[f32; 3]]) -> Self {
        let (columns, rows) = (width.min(MOST_COLUMNS), height.min(MOST_COLUMNS / 2));
        let weights = mean_luminance(width, height, texels, columns, rows);
        let mut distribution = BilinearDistribution {
            columns,
            rows,
            weights,
            cells: Vec::new(),
            sums: Vec::new(),
            row_guide: Guide::new::<f64>(&[]),
            column_guides: Vec::new(),
            cosines: Vec::new(),
            factors: Vec::new(),
        };
        let edges = (0..=rows).map(|row| distribution.edges(row)[0]).chain([1.0]);
        distribution.cosines = edges.map(|edge| libm::cos(PI * edge)).collect();
        distribution.accumulate();
        // The sum is the integral over longitude and the cosine of the polar angle, in units of a column.
        let mean = distribution.total() / (2.0 * columns as f64);
        for weight in &mut distribution.weights {
            *weight = (f64::from(*weight) - mean).max(LEAST_SHARE * f64::from(*weight)) as f32;
        }
        distribution.accumulate();
        let factor = |row: usize| {
            let [top, bottom] = distribution.edges(row);
            let solid_angle = distribution.cosines[row] - distribution.cosines[row + 1];
            let total = distribution.total();
            if total > 0.0 { solid_angle / total * columns as f64 / (bottom - top) } else { 0.0 }
        };
        distribution.factors = (0..=rows).map(factor).collect();
        distribution.row_guide = Guide::new(&distribution.sums);
        distribution.column_guides = distribution.cells.chunks_exact(columns).map(Guide::new).collect();
        distribution
    }

    /// Fills `cells` and `sums` from `weights`.
    fn accumulate(&mut self) {
        self.cells.clear();
        self.sums.clear();
        let mut total = 0.0;
        for row in 0..=self.rows {
            let [top, bottom] = [self.cosines[row], self.cosines[row + 1]];
            let mut sum = 0.0f32;
            for column in 0..self.columns {
                let corners = self.corners(column, row, |index| self.weights[index]);
                sum += (corners.iter().sum::<f64>() / 4.0 * (top - bottom)) as f32;
                self.cells.push(sum);
            }
            total += f64::from(sum);
            self.sums.push(total);
        }
    }

    fn total(&self) -> f64 {
        self.sums.last().copied().unwrap_or(0.0)
    }

    /// The upper and lower edge of a row of cells, 0 to 1. The first and the last row are half as high as the others.
    fn edges(&self, row: usize) -> [f64; 2] {
        let centre = |row: f64| (row / self.rows as f64).clamp(0.0, 1.0);
        [centre(row as f64 - 0.5), centre(row as f64 + 0.5)]
    }

    /// The weights at the corners of a cell, top left, top right, bottom left, bottom right, from those of the texels of the
    /// grid by their index.
    fn corners(&self, column: usize, row: usize, weight: impl Fn(usize) -> f32) -> [f64; 4] {
        let right = if column + 1 == self.columns { 0 } else { column + 1 };
        let (above, below) = (row.saturating_sub(1) * self.columns, row.min(self.rows - 1) * self.columns);
        let at = |index: usize| f64::from(weight(index));
        [at(above + column), at(above + right), at(below + column), at(below + right)]
    }

    /// The cell that two numbers in [0, 1) choose.
    #[inline]
    pub(super) fn cell(&self, [x, y]: [f64; 2]) -> Cell {
        let (row, y) = self.row_guide.position(&self.sums, y);
        let cells = &self.cells[row * self.columns..][..self.columns];
        let (column, x) = self.column_guides[row].position(cells, x);
        Cell { column, row, numbers: [x, y] }
    }

    /// The place in a cell, 0 to 1 from the left and the top of the image. `weight` is that of a texel of the grid.
    #[inline]
    pub(super) fn sample(&self, cell: &Cell, weight: impl Fn(usize) -> f32) -> [f64; 2] {
        let &Cell { column, row, numbers: [x, y] } = cell;
        let [a, b, c, d] = self.corners(column, row, weight);
        let down = sample_linear(y, a + b, c + d);
        let across = sample_linear(x, lerp(a, c, down), lerp(b, d, down));
        let [top, bottom] = self.edges(row);
        let u = (column as f64 + 0.5 + across) / self.columns as f64;
        [if u < 1.0 { u } else { u - 1.0 }, lerp(top, bottom, down)]
    }

    /// The weight of a texel of the grid.
    #[inline]
    pub(super) fn weight(&self, index: usize) -> f32 {
        self.weights[index]
    }

    /// The weights of all texels, row by row from the top, if the grid is that of an image of this size.
    pub(super) fn weights_of(&self, width: usize, height: usize) -> Option<&[f32]> {
        (self.columns == width && self.rows == height).then_some(&self.weights[..])
    }

    /// The density in a row of cells, relative to the unit square, over the interpolated weight.
    #[inline]
    pub(super) fn factor(&self, row: usize) -> f64 {
        self.factors[row]
    }

    /// The density at a place, relative to the unit square.
    pub(super) fn density(&self, [u, v]: [f64; 2]) -> f64 {
        let x = (u * self.columns as f64 - 0.5).rem_euclid(self.columns as f64);
        let column = (x as usize).min(self.columns - 1);
        let row = ((v * self.rows as f64 + 0.5) as usize).min(self.rows);
        let [top, bottom] = self.edges(row);
        let (across, down) = (x - column as f64, (v - top) / (bottom - top));
        let [a, b, c, d] = self.corners(column, row, |index| self.weights[index]);
        lerp(lerp(a, b, across), lerp(c, d, across), down) * self.factors[row]
    }
}

/// The luminance of an image, averaged for each cell of a grid over the texels that it covers wholly or in part.
fn mean_luminance(width: usize, height: usize, texels: &[[f32; 3]], columns: usize, rows: usize) -> Vec<f32> {
    let covered = |cell: usize, cells: usize, texels: usize| {
        cell * texels / cells..((cell + 1) * texels).div_ceil(cells)
    };
    let mut cells = Vec::with_capacity(columns * rows);
    for row in 0..rows {
        let lines = covered(row, rows, height);
        for column in 0..columns {
            let places = covered(column, columns, width);
            let colours = lines.clone().flat_map(|y| &texels[y * width..][places.clone()]);
            let sum: f64 = colours.map(|&colour| luminance(DVec3::from(colour.map(f64::from)))).sum();
            cells.push((sum / (lines.len() * places.len()) as f64) as f32);
        }
    }
    cells
}

fn lerp(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// A number in 0 to 1 whose density is linear from `a` at 0 to `b` at 1, both at least 0 (pbrt, 4th edition, section 2.3.2).
fn sample_linear(number: f64, a: f64, b: f64) -> f64 {
    let root = lerp(a * a, b * b, number).sqrt();
    if a + root > 0.0 { (number * (a + b) / (a + root)).min(1.0) } else { number }
}

/// The parts of the unit interval for which a [`Guide`] has an entry.
const GUIDE_PARTS: usize = 64;

/// For equal parts of the unit interval, the first entry of cumulative sums that a number in it or behind it may choose: a
/// search takes few steps (Chen and Asau, On Generating Random Variates from an Empirical Distribution, 1974).
#[derive(Clone)]
struct Guide([u16; GUIDE_PARTS + 1]);

impl Guide {
    fn new<T: Copy + Into<f64>>(sums: &[T]) -> Self {
        let total = sums.last().map_or(0.0, |&sum| sum.into());
        Guide(std::array::from_fn(|part| {
            let at = part as f64 / GUIDE_PARTS as f64 * total;
            sums.partition_point(|&sum| sum.into() <= at) as u16
        }))
    }

    /// The entry of the sums that a number in [0, 1) chooses, and how far into it that is, 0 to 1. Entries of weight 0 are not
    /// chosen.
    #[inline]
    fn position<T: Copy + Into<f64>>(&self, sums: &[T], number: f64) -> (usize, f64) {
        let at = number * sums[sums.len() - 1].into();
        let part = (number * GUIDE_PARTS as f64) as usize;
        // Products are rounded monotonically, so the entry lies between those of the ends of its part.
        let (first, end) = (usize::from(self.0[part]), usize::from(self.0[part + 1]));
        let index = first + sums[first..end].partition_point(|&sum| sum.into() <= at);
        let index = index.min(sums.len() - 1);
        let before = if index == 0 { 0.0 } else { sums[index - 1].into() };
        let weight = sums[index].into() - before;
        (index, if weight > 0.0 { ((at - before) / weight).clamp(0.0, 1.0) } else { 0.5 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The entry and the place in it are those of a search through all sums: of even weights, of few that are not 0, and at
    /// numbers just below the ends of a guide's parts.
    #[test]
    fn searches_by_guide_find_what_full_searches_do() {
        let weights: [fn(usize) -> f32; 5] = [
            |_| 1.0,
            |_| 0.0,
            |i| if i % 100 == 7 { 3.0 } else { 0.0 },
            |i| (i as f32).powi(3),
            |i| f32::from(i == 999),
        ];
        for (weight, len) in
            weights.into_iter().flat_map(|weight| [1000, 1024, 2048].map(|len| (weight, len)))
        {
            let sums: Vec<f32> = (0..len)
                .scan(0.0, |sum, i| {
                    *sum += weight(i);
                    Some(*sum)
                })
                .collect();
            let guide = Guide::new(&sums);
            for k in 0..100_000u32 {
                let part = f64::from(k % 64) / 64.0;
                let number = match k % 3 {
                    0 => f64::from(k) / 100_000.0,
                    1 => part,
                    _ => (if part > 0.0 { part } else { 1.0 }) - f64::from(f32::EPSILON) / 2.0,
                };
                let at = number * f64::from(sums[len - 1]);
                let expected = sums.partition_point(|&sum| f64::from(sum) <= at).min(len - 1);
                let (index, within) = guide.position(&sums, number);
                assert_eq!(index, expected, "{number} of {len}");
                let before = if index == 0 { 0.0 } else { f64::from(sums[index - 1]) };
                assert!((before + within * f64::from(sums[index]) - within * before - at).abs() <= 1e-9 * at);
            }
        }
    }
}
