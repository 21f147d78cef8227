//! Floating-point numbers as integers, without rounding.

use num_bigint::{BigInt, Sign};

/// An integer vector.
#[derive(Debug, Clone)]
pub struct Vector(pub [BigInt; 3]);

/// A finite number that is not 0 as an odd integer times a power of two; `None` for 0.
fn odd_times_power(x: f64) -> Option<(i64, i32)> {
    assert!(x.is_finite(), "the oracle speaks of finite numbers only, not of {x}");
    let fraction = (x.to_bits() & ((1 << 52) - 1)) as i64;
    let exponent = (x.to_bits() >> 52 & 0x7ff) as i32;
    let (integer, power) =
        if exponent == 0 { (fraction, -1074) } else { (fraction | 1 << 52, exponent - 1075) };
    if integer == 0 {
        return None;
    }
    let zeros = integer.trailing_zeros();
    let odd = integer >> zeros;
    Some((if x < 0.0 { -odd } else { odd }, power + zeros as i32))
}

/// Finite numbers as integers, all times the same power of two: the largest one that leaves none of them a fraction.
pub fn integers<const N: usize>(numbers: [f64; N]) -> ([BigInt; N], i64) {
    let parts = numbers.map(odd_times_power);
    let least = parts.iter().flatten().map(|&(_, power)| power).min().unwrap_or(0);
    let integer = |part: Option<(i64, i32)>| match part {
        Some((odd, power)) => BigInt::from(odd) << (power - least),
        None => BigInt::ZERO,
    };
    (parts.map(integer), i64::from(least))
}

impl Vector {
    pub fn minus(&self, other: &Self) -> Self {
        Vector([0, 1, 2].map(|k| &self.0[k] - &other.0[k]))
    }

    pub fn plus(&self, other: &Self) -> Self {
        Vector([0, 1, 2].map(|k| &self.0[k] + &other.0[k]))
    }

    pub fn times(&self, factor: &BigInt) -> Self {
        Vector([0, 1, 2].map(|k| &self.0[k] * factor))
    }

    pub fn dot(&self, other: &Self) -> BigInt {
        let [a, b, c] = [0, 1, 2].map(|k| &self.0[k] * &other.0[k]);
        a + b + c
    }

    pub fn cross(&self, other: &Self) -> Self {
        let (a, b) = (&self.0, &other.0);
        Vector([(1, 2), (2, 0), (0, 1)].map(|(i, j)| &a[i] * &b[j] - &a[j] * &b[i]))
    }
}

/// -1, 0 or 1.
pub fn sign(x: &BigInt) -> i32 {
    match x.sign() {
        Sign::Minus => -1,
        Sign::NoSign => 0,
        Sign::Plus => 1,
    }
}
