//! Mean and variance of a pixel's samples, for adaptive sampling and the AOVs `samples` and `variance`.

use glam::DVec3;

/// The count, mean and sum of squared deviations of samples, updated one by one (Welford, Note on a Method for Calculating Corrected
/// Sums of Squares and Products, Technometrics 4(3), 1962): no difference of large sums, so equal samples have variance 0.
#[derive(Debug, Clone, Copy, Default)]
pub struct SampleVariance {
    count: u32,
    mean: DVec3,
    squares: DVec3,
}

impl SampleVariance {
    /// Adds a sample.
    pub fn add(&mut self, colour: [f32; 3]) {
        let colour = DVec3::from(colour.map(f64::from));
        self.count += 1;
        let before = colour - self.mean;
        self.mean += before / f64::from(self.count);
        self.squares += before * (colour - self.mean);
    }

    /// The number of samples.
    pub fn count(&self) -> u32 {
        self.count
    }

    /// Their mean.
    pub fn mean(&self) -> DVec3 {
        self.mean
    }

    /// Their unbiased variance: the sum of squared deviations over the count less 1. `None` for one sample, which says
    /// nothing of it.
    pub fn unbiased(&self) -> Option<DVec3> {
        (self.count > 1).then(|| self.squares / f64::from(self.count - 1))
    }
}

/// What the AOVs hold of a pixel's samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelStatistics {
    /// The number of samples.
    pub count: u32,
    /// The unbiased variance of the samples in red, green and blue; infinite for one sample.
    pub variance: [f32; 3],
}

impl PixelStatistics {
    /// The statistics of one sample.
    pub fn of_one() -> Self {
        PixelStatistics { count: 1, variance: [f32::INFINITY; 3] }
    }
}

impl From<&SampleVariance> for PixelStatistics {
    fn from(samples: &SampleVariance) -> Self {
        let count = samples.count;
        let Some(variance) = samples.unbiased() else {
            return PixelStatistics { count, ..PixelStatistics::of_one() };
        };
        PixelStatistics { count, variance: variance.min(DVec3::splat(f32::MAX.into())).as_vec3().to_array() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(samples: &[[f32; 3]]) -> PixelStatistics {
        let mut variance = SampleVariance::default();
        samples.iter().for_each(|&sample| variance.add(sample));
        PixelStatistics::from(&variance)
    }

    /// 1, 2, 6 have the mean 3 and squared deviations 4 + 1 + 9 = 14, over 2. Deviations of 0.1f32 from itself are 0.
    #[test]
    fn variances_by_hand() {
        let known = of(&[[1.0, 0.1, 4097.0], [2.0, 0.1, 4098.0], [6.0, 0.1, 4102.0]]);
        assert_eq!(known, PixelStatistics { count: 3, variance: [7.0, 0.0, 7.0] });
        assert_eq!(of(&[[1.0; 3]]), PixelStatistics::of_one());
        let extreme = of(&[[f32::MAX; 3], [f32::MIN; 3]]);
        assert_eq!(extreme.variance, [f32::MAX; 3]);
    }
}
