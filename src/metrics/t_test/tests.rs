//! The test of pixels against values computed by hand, and its error and power on numbers of known distributions.

use super::*;
use crate::bvh::detail::{GOLDEN, splitmix64};

/// Random numbers.
struct Random(u64);

impl Random {
    /// A uniform number, 0 to below 1.
    fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(GOLDEN);
        (splitmix64(self.0) >> 11) as f64 * 2.0f64.powi(-53)
    }
}

/// A picture whose channels are equal.
fn estimate(width: u32, means: &[f32], variances: &[f32], count: f32) -> Estimate {
    let height = means.len() as u32 / width;
    let counts = vec![count; means.len()];
    Estimate {
        width,
        height,
        means: std::array::from_fn(|_| means.to_vec()),
        variances: std::array::from_fn(|_| variances.to_vec()),
        counts,
        seed: None,
    }
}

/// A picture of the mean and variance of `count` draws a pixel.
fn drawn(width: u32, count: u32, mut draw: impl FnMut() -> f64) -> Estimate {
    let pixels = (width * width) as usize;
    let (mut means, mut variances) = (Vec::new(), Vec::new());
    for _ in 0..pixels {
        let samples: Vec<f64> = (0..count).map(|_| draw()).collect();
        let mean = samples.iter().sum::<f64>() / f64::from(count);
        means.push(mean as f32);
        let squares: f64 = samples.iter().map(|x| (x - mean) * (x - mean)).sum();
        variances.push((squares / f64::from(count - 1)) as f32);
    }
    estimate(width, &means, &variances, count as f32)
}

/// Means 1 and 3, variances 6 and 10 of 4 and 5 samples. Squared standard error 6/4 + 10/5 = 3.5, t = 2 / sqrt 3.5 = 1.069045;
/// degrees of freedom 3.5^2 / (1.5^2 / 3 + 2^2 / 4) = 12.25 / 1.75 = 7. The tabulated two-sided 30 % point of 7 degrees is 1.119,
/// the 40 % point 0.896.
#[test]
fn welch_by_hand() {
    let (a, b) = (estimate(1, &[1.0], &[6.0], 4.0), estimate(1, &[3.0], &[10.0], 5.0));
    let mut sums = Sums::default();
    sums.add_pixel(&a, &b, 0, 0);
    assert_eq!((sums.difference, sums.variance), (2.0, 3.5));
    assert!((sums.variance * sums.variance / sums.weighted - 7.0).abs() < 1e-12);
    let p = sums.p_value();
    assert!((p - student_two_sided(2.0 / 3.5f64.sqrt(), 7.0)).abs() < 1e-12 && 0.30 < p && p < 0.40, "{p}");
    let test = TTest::between(&a, &b, 1).unwrap();
    assert_eq!((test.channels[0].tested, test.channels[0].uniform), (1, None));
    assert_eq!(test.channels[0].histogram[(p * 20.0) as usize], 1);
    assert!(test.passed);
}

/// Pixels without variance are equal up to the rounding of f32, or certain to differ.
#[test]
fn pixels_without_variance() {
    let a = estimate(3, &[0.0, 0.1, 0.25], &[0.0; 3], 8.0);
    let b = estimate(3, &[0.0, 0.1f32.next_up(), 0.26], &[0.0; 3], 8.0);
    let test = TTest::between(&a, &b, 1).unwrap();
    let channel = &test.channels[2];
    assert_eq!((channel.left_out, channel.certain, channel.tested, channel.histogram[0]), (2, 1, 1, 1));
    assert!(!test.passed && channel.below_low == 1.0);
    let same = TTest::between(&a, &a, 2).unwrap();
    assert!(same.passed && same.channels[0].left_out == 2 && same.channels[0].tested == 0);
    let [one, two] = [1, 2].map(|seed| Estimate { seed: Some(seed), ..a.clone() });
    assert!(TTest::between(&one, &two, 1).is_ok() && TTest::between(&one, &one, 1).is_err());
    assert!(TTest::between(&a, &estimate(1, &[0.0; 3], &[0.0; 3], 8.0), 1).is_err());
}

/// A normal number by Box and Muller.
fn normal(random: &mut Random) -> f64 {
    (-2.0 * (1.0 - random.number()).ln()).sqrt() * (std::f64::consts::TAU * random.number()).cos()
}

/// Normal samples meet every assumption: 100 tests, for which the p-values of uniformity and of equal means must be uniform
/// themselves, within four standard deviations of the counts below 0.1 and 0.5 (10 +- 3, 50 +- 5). Variances differ by 9, counts
/// too, so Student's test of equal variances would fail.
#[test]
fn equal_expectations_have_uniform_p_values() {
    let mut random = Random(7);
    for block in [1, 4] {
        let tests: Vec<TTest> = (0..100)
            .map(|_| {
                let a = drawn(48, 4, || 1.0 + 0.3 * normal(&mut random));
                let b = drawn(48, 7, || 1.0 + 0.9 * normal(&mut random));
                TTest::between(&a, &b, block).unwrap()
            })
            .collect();
        let of = |value: fn(&ChannelTest) -> f64| -> Vec<f64> {
            tests.iter().map(|test| value(&test.channels[0])).collect()
        };
        for values in [of(|c| c.uniform.unwrap_or(-1.0)), of(|c| c.equal_means)] {
            let below = |bound: f64| values.iter().filter(|p| **p < bound).count();
            assert!(below(0.1) < 22 && (30..70).contains(&below(0.5)), "{} {}", below(0.1), below(0.5));
            assert!(values.iter().all(|p| *p >= 0.0));
        }
    }
}

/// The power: 64 x 64 pixels of 16 samples, mean 1, standard deviation s = 0.2, with a bias of 1 %. The standard error of a pixel's
/// difference is s sqrt(2 / 16) = 0.0707, so t is shifted by d = 0.141. A block of 8 x 8 pixels has one an eighth as large, d =
/// 1.13. A normal p-value is below 0.05 with probability Phi(d - 1.96) + Phi(-d - 1.96): 0.0523 for pixels, hardly more than 0.05:
/// invisible. For blocks 0.203. The mean of the picture is 0.01 / (0.0707 / 64) = 9.05 standard errors off: certain to be found.
#[test]
fn the_power_is_as_computed() {
    let mut random = Random(11);
    let (mut pixels, mut blocks, mut found) = (0, 0, 0);
    for _ in 0..20 {
        let a = drawn(64, 16, || 1.0 + 0.2 * normal(&mut random));
        let b = drawn(64, 16, || 1.01 + 0.2 * normal(&mut random));
        let test = TTest::between(&a, &b, 1).unwrap();
        pixels += test.channels[0].histogram[0];
        found += u32::from(!test.passed);
        // 4.5 standard errors or fewer occur with probability Phi(4.5 - 9.05) = 3e-6.
        assert!(test.channels[0].equal_means < 1e-5);
        blocks += TTest::between(&a, &b, 8).unwrap().channels[0].histogram[0];
    }
    assert_eq!(found, 20);
    // 20 x 4096 pixels: 4284 expected, standard deviation 64. 20 x 64 blocks: 260 expected, standard deviation 14.4.
    assert!((4028..4540).contains(&pixels), "{pixels}");
    assert!((202..318).contains(&blocks), "{blocks}");
}

/// A bias of 1 % where the noise is 1 % of the mean a sample, 64 samples: t is shifted by 0.01 / (0.01 sqrt(2 / 64)) = 5.7, so nearly
/// every p-value is below 0.01.
#[test]
fn a_bias_above_the_noise_is_seen_in_every_pixel() {
    let mut random = Random(3);
    let a = drawn(24, 64, || 1.0 + 0.01 * normal(&mut random));
    let b = drawn(24, 64, || 1.01 + 0.01 * normal(&mut random));
    let test = TTest::between(&a, &b, 1).unwrap();
    assert!(!test.passed && test.channels[1].below_low > 0.98, "{}", test.channels[1].below_low);
    assert!(test.channels[1].uniform.is_some_and(|p| p < 1e-100));
}
