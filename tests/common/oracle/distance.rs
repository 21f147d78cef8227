//! Distances along a ray, without rounding: fractions, and roots of quadratic equations.

use std::cmp::Ordering;

use num_bigint::{BigInt, BigUint};

use super::integers::{integers, sign};

/// The number `(rational + root * sqrt(radicand)) / divisor * 2^power`.
#[derive(Debug, Clone)]
pub struct Distance {
    rational: BigInt,
    /// -1, 0 or 1.
    root: i32,
    /// Not below 0.
    radicand: BigInt,
    /// Above 0.
    divisor: BigInt,
    power: i64,
}

impl Distance {
    /// `numerator / denominator * 2^power`. The denominator must not be 0.
    pub fn fraction(numerator: BigInt, denominator: BigInt, power: i64) -> Self {
        let (rational, divisor) =
            if sign(&denominator) < 0 { (-numerator, -denominator) } else { (numerator, denominator) };
        assert!(sign(&divisor) > 0, "a fraction over 0");
        Distance { rational, root: 0, radicand: BigInt::ZERO, divisor, power }
    }

    /// Where `a x^2 + 2 b x + c` is 0, times `2^power`, the lesser first; `None` where it is 0 nowhere. `a` must be
    /// above 0.
    pub fn roots(a: &BigInt, b: &BigInt, c: &BigInt, power: i64) -> Option<[Self; 2]> {
        assert!(sign(a) > 0, "not a quadratic equation that opens upwards");
        let radicand = b * b - a * c;
        if sign(&radicand) < 0 {
            return None;
        }
        let root = sign(&radicand);
        Some([-root, root].map(|root| Distance {
            rational: -b,
            root,
            radicand: radicand.clone(),
            divisor: a.clone(),
            power,
        }))
    }

    /// A finite number.
    pub fn exactly(x: f64) -> Self {
        let ([integer], power) = integers([x]);
        Distance::fraction(integer, BigInt::from(1), power)
    }

    /// How this number compares with `x`, which may be infinite.
    pub fn compare(&self, x: f64) -> Ordering {
        if x.is_infinite() {
            return 0.0.partial_cmp(&x).expect("a number");
        }
        self.cmp(&Distance::exactly(x))
    }

    /// The nearest f64, ties to even: always where the number is a fraction; where a root is in it, unless it lies
    /// within 2^-60 of the middle of two. (Denormal results are rounded twice.)
    pub fn to_f64(&self) -> f64 {
        let (numerator, power) = self.numerator();
        if sign(&numerator) == 0 {
            return 0.0;
        }
        // A quotient of 64 bits or more, its last bit set if anything is left over.
        let shift = 66 + self.divisor.bits() as i64 - numerator.bits() as i64;
        let (over, under) = (shift.max(0), (-shift).max(0));
        let magnitude = numerator.magnitude() << over;
        let divisor = self.divisor.magnitude() << under;
        let quotient = &magnitude / &divisor;
        let rest = magnitude - &quotient * divisor;
        let digits = u128::try_from(&quotient).expect("at most 67 bits");
        let digits = digits << 1 | u128::from(rest != BigUint::ZERO);
        // The conversion rounds to the nearest, ties to even.
        let rounded = times_power_of_two(digits as f64, power - shift - 1);
        if sign(&numerator) < 0 { -rounded } else { rounded }
    }

    /// `rational + root * sqrt(radicand)` as an integer of 128 bits or more, times the power of two that is returned.
    fn numerator(&self) -> (BigInt, i64) {
        if self.root == 0 {
            return (self.rational.clone(), self.power);
        }
        if sign_with_root(&self.rational, self.root, &self.radicand) == 0 {
            return (BigInt::ZERO, 0);
        }
        let mut digits = 64_i64;
        loop {
            let squared: BigUint = self.radicand.magnitude() << (2 * digits);
            let root = BigInt::from(squared.sqrt());
            let sum: BigInt = (&self.rational << digits) + root * self.root;
            if sum.bits() > 128 {
                return (sum, self.power - digits);
            }
            digits *= 2;
        }
    }
}

impl Ord for Distance {
    fn cmp(&self, other: &Self) -> Ordering {
        // Over the common divisor and the lesser power of two.
        let shift = self.power - other.power;
        let mine = &other.divisor << shift.max(0);
        let others = &self.divisor << (-shift).max(0);
        let rational = &self.rational * &mine - &other.rational * &others;
        // mine * sqrt(radicand) is sqrt(mine^2 * radicand).
        let under = |factor: &BigInt, radicand: &BigInt| factor * factor * radicand;
        let sign = sign_with_two_roots(
            &rational,
            (self.root, &under(&mine, &self.radicand)),
            (-other.root, &under(&others, &other.radicand)),
        );
        sign.cmp(&0)
    }
}

impl PartialOrd for Distance {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Distance {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Distance {}

/// The sign of `a + s * sqrt(q)`, with `s` one of -1, 0 and 1, and `q` not below 0.
pub fn sign_with_root(a: &BigInt, s: i32, q: &BigInt) -> i32 {
    let (of_a, of_root) = (sign(a), s * sign(q));
    if of_a * of_root >= 0 {
        return if of_a != 0 { of_a } else { of_root };
    }
    // Against each other: the one with the larger square has its way.
    match (a * a).cmp(q) {
        Ordering::Greater => of_a,
        Ordering::Less => of_root,
        Ordering::Equal => 0,
    }
}

/// The sign of `a + s * sqrt(q) + t * sqrt(r)`, with `s` and `t` each one of -1, 0 and 1, and `q` and `r` not below 0.
pub fn sign_with_two_roots(a: &BigInt, (s, q): (i32, &BigInt), (t, r): (i32, &BigInt)) -> i32 {
    let (s, t) = (s * sign(q), t * sign(r));
    if t == 0 {
        return sign_with_root(a, s, q);
    }
    if s == 0 {
        return sign_with_root(a, t, r);
    }
    // Both roots together; where they pull apart, the larger has its way.
    let of_roots = if s == t { s } else { s * q.cmp(r) as i32 };
    let of_a = sign(a);
    if of_a * of_roots >= 0 {
        return if of_a != 0 { of_a } else { of_roots };
    }
    // Against each other: a^2 - (s sqrt(q) + t sqrt(r))^2 = (a^2 - q - r) - 2 s t sqrt(q r).
    let difference = a * a - q - r;
    of_a * sign_with_root(&difference, -s * t, &(BigInt::from(4) * q * r))
}

/// `x * 2^power` for any power.
fn times_power_of_two(mut x: f64, mut power: i64) -> f64 {
    while power != 0 && x != 0.0 && x.is_finite() {
        let step = power.clamp(-1000, 1000);
        // Normal powers of two are exact.
        x *= f64::from_bits(((1023 + step) as u64) << 52);
        power -= step;
    }
    x
}
