//! Pearson's chi-squared test of samples on the sphere against their density, for tests of samplers.
//!
//! The method is that of nori's `warptest` (W. Jakob): cells over the sphere, expected counts by quadrature of the
//! density, cells of low expectation pooled. Samples that return no direction count in a cell of their own, so that
//! the integral of the density is tested, too.

use std::f64::consts::PI;

use glam::DVec3;

use super::quadrature::{Peak, integrate};
use crate::metrics::distributions::chi_squared_upper;

/// Cells in polar angle and azimuth.
const CELLS: [usize; 2] = [12, 20];

/// Error of the density's integral over a cell: 0.4 samples of 4 million.
const TOLERANCE: f64 = 1e-7;

/// Cells with a lower expected count are pooled: the distribution of the statistic is then close to its limit.
const MIN_EXPECTED: f64 = 5.0;

/// Samples of a test and the counts that its density predicts.
pub(crate) struct Histogram {
    observed: Vec<f64>,
    expected: Vec<f64>,
    count: f64,
}

impl Histogram {
    /// Counts the directions of `count` samples, and integrates their density over each cell, refined at `peaks`.
    pub(crate) fn new(
        count: usize,
        mut sample: impl FnMut() -> Option<DVec3>,
        density: impl Fn(DVec3) -> f64,
        peaks: &[Peak],
    ) -> Self {
        let cells = CELLS[0] * CELLS[1];
        let mut observed = vec![0.0; cells + 1];
        for _ in 0..count {
            observed[sample().map_or(cells, cell_of)] += 1.0;
        }
        let (height, width) = (PI / CELLS[0] as f64, 2.0 * PI / CELLS[1] as f64);
        let mut expected: Vec<f64> = (0..cells)
            .map(|i| {
                let (row, column) = ((i / CELLS[1]) as f64, (i % CELLS[1]) as f64);
                let cell = [row * height, (row + 1.0) * height, column * width, (column + 1.0) * width];
                integrate(&|d| DVec3::splat(density(d)), cell, peaks, TOLERANCE).x * count as f64
            })
            .collect();
        expected.push(count as f64 - expected.iter().sum::<f64>());
        Histogram { observed, expected, count: count as f64 }
    }

    /// The histogram whose density is `factor` of this one in the cells that `chosen` selects by index.
    pub(crate) fn perturbed(&self, factor: f64, chosen: impl Fn(usize) -> bool) -> Self {
        let cells = self.expected.len() - 1;
        let mut expected: Vec<f64> =
            (0..cells).map(|i| self.expected[i] * if chosen(i) { factor } else { 1.0 }).collect();
        expected.push(self.count - expected.iter().sum::<f64>());
        Histogram { observed: self.observed.clone(), expected, count: self.count }
    }

    /// The probability of a statistic at least as great if the samples have the density.
    pub(crate) fn p_value(&self) -> f64 {
        // Less than nothing is expected: a density whose integral exceeds 1, beyond the error of the quadrature.
        if self.expected.iter().any(|e| *e < -1e-4 * self.count.max(1e3).sqrt()) {
            return 0.0;
        }
        p_value(&self.observed, &self.expected)
    }
}

/// The cell that contains a direction.
fn cell_of(direction: DVec3) -> usize {
    let theta = direction.z.clamp(-1.0, 1.0).acos() / PI;
    let phi = direction.y.atan2(direction.x).rem_euclid(2.0 * PI) / (2.0 * PI);
    let index = |x: f64, n: usize| ((x * n as f64) as usize).min(n - 1);
    index(theta, CELLS[0]) * CELLS[1] + index(phi, CELLS[1])
}

/// The p-value of observed counts under expected ones of the same sum. 1 if all are in one pool.
pub(crate) fn p_value(observed: &[f64], expected: &[f64]) -> f64 {
    let mut order: Vec<usize> = (0..expected.len()).collect();
    order.sort_by(|a, b| expected[*a].total_cmp(&expected[*b]));
    let (mut statistic, mut cells) = (0.0, 0);
    let mut add = |observed: f64, expected: f64| {
        statistic += (observed - expected) * (observed - expected) / expected.max(MIN_EXPECTED);
        cells += 1;
    };
    let mut pool = (0.0, 0.0);
    for i in order {
        if expected[i] >= MIN_EXPECTED {
            add(observed[i], expected[i]);
            continue;
        }
        pool = (pool.0 + observed[i], pool.1 + expected[i]);
        if pool.1 >= MIN_EXPECTED {
            add(pool.0, pool.1);
            pool = (0.0, 0.0);
        }
    }
    // Less than a cell should have. The statistic divides by more than the expectation, so that chance is not
    // rejected.
    if pool != (0.0, 0.0) {
        add(pool.0, pool.1);
    }
    if cells < 2 { 1.0 } else { chi_squared_upper(statistic, f64::from(cells - 1)) }
}

/// Random numbers for tests: splitmix64 (Steele, Lea and Flood, Fast Splittable Pseudorandom Number Generators, 2014).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// A uniform number, 0 to below 1.
    pub(crate) fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 * 2.0f64.powi(-53)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform samples have p-values that are uniform: of 200 tests, 10 are expected below 0.05, with the standard
    /// deviation sqrt(200 x 0.05 x 0.95) = 3.1. 25 would be five deviations too many, and none below 0.3 impossible
    /// as well.
    #[test]
    fn p_values_are_uniform() {
        let mut random = Random(1);
        let below = |bound: f64, values: &[f64]| values.iter().filter(|p| **p < bound).count();
        let values: Vec<f64> = (0..200)
            .map(|_| {
                let mut observed = vec![0.0; 50];
                (0..5000).for_each(|_| observed[(random.number() * 50.0) as usize] += 1.0);
                p_value(&observed, &[100.0; 50])
            })
            .collect();
        assert!(below(0.05, &values) < 25, "{}", below(0.05, &values));
        // 100 expected below 0.5, deviation 7.1.
        assert!((65..135).contains(&below(0.5, &values)), "{}", below(0.5, &values));
    }

    /// Samples where none are expected are found.
    #[test]
    fn impossible_samples_are_rejected() {
        assert!(p_value(&[500.0, 480.0, 20.0], &[500.0, 500.0, 0.0]) < 1e-6);
    }
}
