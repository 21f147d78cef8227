//! Floating-point expansions: exact sums, differences and products of f64, for signs that f64 does not decide.
//!
//! Shewchuk, Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates, Discrete &
//! Computational Geometry 18, 1997, section 2. An expansion is a sum of nonoverlapping f64 numbers, smallest first,
//! without zeros; its sign is that of its last term. Exact as long as no intermediate number overflows or underflows,
//! which [`super::Precision::round`] ensures for products of three coordinates.

use std::ops::{Add, Mul, Neg, Sub};

/// An exact number.
#[derive(Debug, Clone, Default)]
pub(crate) struct Expansion(Vec<f64>);

impl Expansion {
    /// `a - b`.
    pub(crate) fn difference(a: f64, b: f64) -> Self {
        Self::of(two_sum(a, -b))
    }

    fn of((sum, error): (f64, f64)) -> Self {
        Expansion([error, sum].into_iter().filter(|&x| x != 0.0).collect())
    }

    /// 1, 0 or -1.
    pub(crate) fn sign(&self) -> i32 {
        self.0.last().map_or(0, |&x| if x > 0.0 { 1 } else { -1 })
    }

    /// The nearest f64, up to 1 ulp.
    pub(crate) fn estimate(&self) -> f64 {
        self.0.iter().sum()
    }

    /// The product with an f64 (Shewchuk's Scale-Expansion).
    pub(crate) fn scaled(&self, by: f64) -> Self {
        let mut terms = Vec::with_capacity(2 * self.0.len());
        let mut keep = |x: f64| {
            if x != 0.0 {
                terms.push(x);
            }
        };
        let mut carried = 0.0;
        for (index, &term) in self.0.iter().enumerate() {
            let (high, low) = two_product(term, by);
            if index == 0 {
                keep(low);
                carried = high;
                continue;
            }
            let (sum, error) = two_sum(carried, low);
            keep(error);
            let (sum, error) = fast_two_sum(high, sum);
            keep(error);
            carried = sum;
        }
        keep(carried);
        Expansion(terms)
    }
}

impl Neg for Expansion {
    type Output = Expansion;

    fn neg(mut self) -> Expansion {
        self.0.iter_mut().for_each(|x| *x = -*x);
        self
    }
}

impl Add for Expansion {
    type Output = Expansion;

    /// Shewchuk's Grow-Expansion, term by term.
    fn add(self, other: Expansion) -> Expansion {
        let (mut terms, added) =
            if self.0.len() >= other.0.len() { (self.0, other.0) } else { (other.0, self.0) };
        for term in added {
            let mut carried = term;
            for x in &mut terms {
                (carried, *x) = two_sum(carried, *x);
            }
            terms.push(carried);
            terms.retain(|&x| x != 0.0);
        }
        Expansion(terms)
    }
}

impl Sub for Expansion {
    type Output = Expansion;

    fn sub(self, other: Expansion) -> Expansion {
        self + -other
    }
}

impl Mul for Expansion {
    type Output = Expansion;

    fn mul(self, other: Expansion) -> Expansion {
        other.0.iter().fold(Expansion::default(), |sum, &term| sum + self.scaled(term))
    }
}

/// The rounded sum and its rounding error (Knuth).
pub(crate) fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let (virtual_b, virtual_a) = (sum - a, sum - (sum - a));
    (sum, (a - virtual_a) + (b - virtual_b))
}

/// [`two_sum`] for |a| >= |b| (Dekker).
fn fast_two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    (sum, b - (sum - a))
}

/// The rounded product and its rounding error (Dekker, Veltkamp), without FMA, which not every machine has.
pub(crate) fn two_product(a: f64, b: f64) -> (f64, f64) {
    const SPLITTER: f64 = 134_217_729.0; // 2^27 + 1
    let split = |x: f64| {
        let c = SPLITTER * x;
        let high = c - (c - x);
        (high, x - high)
    };
    let product = a * b;
    let ((a_high, a_low), (b_high, b_low)) = (split(a), split(b));
    let error = ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low;
    (product, error)
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_bigint::BigInt;
    use proptest::prelude::*;

    /// The number times 2^600, as an integer.
    fn integer(x: f64) -> BigInt {
        if x == 0.0 {
            return BigInt::ZERO;
        }
        let bits = x.to_bits();
        let exponent = (bits >> 52 & 0x7ff) as i64 - 1075;
        let mantissa = BigInt::from(bits & ((1 << 52) - 1) | 1 << 52) * if x < 0.0 { -1 } else { 1 };
        mantissa << (600 + exponent) as u64
    }

    fn sum(e: &Expansion) -> BigInt {
        e.0.iter().map(|&x| integer(x)).sum()
    }

    fn number() -> impl Strategy<Value = f64> {
        (-1.0f64..1.0, -60i32..60, any::<bool>()).prop_map(|(x, e, short)| {
            let x = if short { (x * 16.0).round() } else { x };
            x * f64::from(e).exp2()
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn arithmetic_is_exact(a in number(), b in number(), c in number(), d in number(), f in number()) {
            let (e, g) = (Expansion::difference(a, b), Expansion::difference(c, d));
            let (ei, gi) = (integer(a) - integer(b), integer(c) - integer(d));
            prop_assert_eq!(sum(&e), ei.clone());
            prop_assert_eq!(sum(&(e.clone() + g.clone())), &ei + &gi);
            prop_assert_eq!(sum(&(e.clone() - g.clone())), &ei - &gi);
            let scale = BigInt::from(1) << 600u32;
            prop_assert_eq!(sum(&e.scaled(f)) * &scale, &ei * integer(f));
            let product = e.clone() * g.clone();
            prop_assert_eq!(sum(&product) * &scale, &ei * &gi);
            let cube = product.clone() * e.clone() - g * product;
            prop_assert_eq!(sum(&cube) * &scale * &scale, &ei * &ei * &gi - &gi * &ei * &gi);
            let sign = sum(&cube).sign();
            prop_assert_eq!(cube.sign() > 0, sign == num_bigint::Sign::Plus);
            prop_assert_eq!(cube.sign() < 0, sign == num_bigint::Sign::Minus);
            let no_zero_and_growing = cube.0.windows(2).all(|w| w[0] != 0.0 && w[0].abs() < w[1].abs());
            prop_assert!(no_zero_and_growing);
        }
    }
}
