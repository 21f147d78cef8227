//! The importance sampling of an environment image.
//!
//! Directions are sampled with a density that is interpolated, as the radiance is, between the centres of texels. Its value
//! there is the luminance above the mean of the whole sphere, because what is not brighter is found by BSDF samples (Karlík
//! and others, MIS Compensation, 2019, section 4), but not below a part of the luminance. So the density is above 0
//! wherever the radiance is. Images larger than the grid are averaged first.

use std::f64::consts::PI;

use glam::DVec3;

use super::guide::{find, guide};
use crate::film::colour::luminance;

/// The most columns of the sampling grid; it has half as many rows.
const MOST_COLUMNS: usize = 2048;

/// The least part of the luminance that is the density, before it is normalised.
const LEAST_SHARE: f64 = 0.1;

/// The parts of guides.
const GUIDE_PARTS: usize = 64;

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
    /// The guides of `sums` and of each row of `cells`, of [`GUIDE_PARTS`] parts.
    row_guide: [u16; GUIDE_PARTS + 1],
    column_guides: Vec<[u16; GUIDE_PARTS + 1]>,
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
            row_guide: [0; GUIDE_PARTS + 1],
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
        distribution.row_guide = guide_array(&distribution.sums);
        distribution.column_guides = distribution.cells.chunks_exact(columns).map(guide_array).collect();
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
        let (row, y) = find(&self.row_guide, &self.sums, y);
        let cells = &self.cells[row * self.columns..][..self.columns];
        let (column, x) = find(&self.column_guides[row], cells, x);
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

fn guide_array<T: Copy + Into<f64>>(sums: &[T]) -> [u16; GUIDE_PARTS + 1] {
    let mut entries = guide(sums, GUIDE_PARTS);
    std::array::from_fn(|_| entries.next().unwrap_or_default() as u16)
}

fn lerp(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// A number in 0 to 1 whose density is linear from `a` at 0 to `b` at 1, both at least 0 (pbrt, 4th edition, section 2.3.2).
fn sample_linear(number: f64, a: f64, b: f64) -> f64 {
    let root = lerp(a * a, b * b, number).sqrt();
    if a + root > 0.0 { (number * (a + b) / (a + root)).min(1.0) } else { number }
}
