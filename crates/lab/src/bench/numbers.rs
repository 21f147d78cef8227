//! Random numbers that depend on a seed and an index only, and so not on threads.

use glam::DVec3;

use kiln::bvh::detail::{GOLDEN, splitmix64};

/// A sequence of random numbers: PCG-XSH-RR 64/32 (O'Neill, PCG: A Family of Simple Fast Space-Efficient Statistically
/// Good Algorithms for Random Number Generation, 2014), started where SplitMix64 (Steele, Lea and Flood, Fast
/// Splittable Pseudorandom Number Generators, 2014) puts it.
pub struct Numbers(u64);

impl Numbers {
    /// The sequence of `seed` and `index`.
    pub fn new(seed: u64, index: u64) -> Self {
        Numbers(splitmix64(splitmix64(seed).wrapping_add(index.wrapping_mul(GOLDEN))))
    }

    fn next(&mut self) -> u32 {
        let old = self.0;
        self.0 = old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let shifted = (((old >> 18) ^ old) >> 27) as u32;
        shifted.rotate_right((old >> 59) as u32)
    }

    /// Uniform in `0..n`.
    pub fn below(&mut self, n: usize) -> usize {
        ((u64::from(self.next()) * n as u64) >> 32) as usize
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        f64::from(self.next()) / 4_294_967_296.0
    }

    /// 1 or -1 with equal probability.
    pub fn sign(&mut self) -> f64 {
        if self.below(2) == 0 { 1.0 } else { -1.0 }
    }

    /// Uniform in the unit ball.
    pub fn in_ball(&mut self) -> DVec3 {
        loop {
            let point = 2.0 * DVec3::new(self.unit(), self.unit(), self.unit()) - 1.0;
            if point.length_squared() <= 1.0 {
                return point;
            }
        }
    }

    /// Uniform direction.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            if let Some(direction) = self.in_ball().try_normalize() {
                return direction;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_neighbouring_indices_are_spread_evenly() {
        // The mean of 100,000 uniform numbers is within 5 standard deviations, 1 / sqrt(12 * 100,000), of 1/2; so is
        // the mean of the first numbers of 100,000 sequences.
        let within = |mean: f64| (mean - 0.5).abs() < 5.0 / (12.0f64 * 1e5).sqrt();
        let mut numbers = Numbers::new(1, 0);
        assert!(within((0..100_000).map(|_| numbers.unit()).sum::<f64>() / 1e5));
        assert!(within((0..100_000).map(|index| Numbers::new(1, index).unit()).sum::<f64>() / 1e5));
    }

    #[test]
    fn directions_have_length_one() {
        let mut numbers = Numbers::new(2, 7);
        assert!((0..1000).all(|_| (numbers.direction().length() - 1.0).abs() < 1e-15));
    }
}
