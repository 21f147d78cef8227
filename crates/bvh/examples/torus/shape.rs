//! [`Torus`]: user geometry whose intersections with rays are decided exactly.
//!
//! With p the point of a ray at t, relative to the centre, the torus around the z axis is where
//!
//! `f(t) = (|p|² + R² - r²)² - 4 R² (x² + y²)`
//!
//! is 0: a polynomial of degree four, negative within. Every f64 is an integer times a power of two, so f has integer
//! coefficients but for a factor. Sturm's theorem counts its roots in an interval exactly: the sequence of f, f' and
//! the negative remainders of their divisions changes sign more often at the start of the interval than at its end, by
//! the number of different roots within. Halving the interval finds each root between two consecutive f64. So every
//! root is found, of whatever multiplicity, no other number is, and t has an error of less than 1 ulp.

use kiln_bvh::glam::DVec3;
use kiln_bvh::{Ray, Side, UserGeometry};
use num_bigint::{BigInt, Sign};

/// A torus around an axis in the direction of z.
#[derive(Debug, Clone, Copy)]
pub struct Torus {
    pub centre: DVec3,
    /// The radius of the circle in the middle of the tube.
    pub major: f64,
    /// The radius of the tube, positive and less than `major`.
    pub minor: f64,
}

impl Torus {
    /// The point of the circle in the middle of the tube that is closest to `point`.
    fn middle(&self, point: DVec3) -> DVec3 {
        let across = (point - self.centre).with_z(0.0).try_normalize().unwrap_or(DVec3::X);
        self.centre + across * self.major
    }

    /// f of a ray.
    fn polynomial(&self, ray: &Ray) -> Polynomial {
        let [o, d, c] = [ray.origin(), ray.direction(), self.centre];
        let numbers = [o.x, o.y, o.z, c.x, c.y, c.z, d.x, d.y, d.z, self.major, self.minor];
        let [ox, oy, oz, cx, cy, cz, dx, dy, dz, major, minor] = integers(numbers);
        let (p, d) = ([ox - cx, oy - cy, oz - cz], [dx, dy, dz]);
        // The coefficients of the sum of the squares of some components of p + t d.
        let squares = |axes: usize| {
            let sum = |a: &[BigInt; 3], b: &[BigInt; 3]| (0..axes).map(|k| &a[k] * &b[k]).sum::<BigInt>();
            [sum(&p, &p), sum(&p, &d) * 2, sum(&d, &d)]
        };
        let major = &major * &major;
        let ([mut a, b, c], across) = (squares(3), squares(2));
        a += &major - &minor * &minor;
        let quartic = [&a * &a, &a * &b * 2, &a * &c * 2 + &b * &b, &b * &c * 2, &c * &c];
        let mut quartic = Polynomial(quartic.to_vec());
        quartic.0.iter_mut().zip(across).for_each(|(sum, part)| *sum -= &major * part * 4);
        quartic
    }
}

impl UserGeometry for Torus {
    fn bounds(&self) -> [DVec3; 2] {
        let reach = DVec3::new(self.major + self.minor, self.major + self.minor, self.minor);
        // More than the rounding of both sums.
        let reach = reach + (self.centre.abs() + reach) * f64::EPSILON;
        [self.centre - reach, self.centre + reach]
    }

    fn intersect(&self, ray: &Ray, found: &mut dyn FnMut(f64, Side)) {
        // Twice as far as the farthest point, so that rounding does not matter.
        let far = ray.origin().distance(self.centre) + self.major + self.minor;
        let end = (2.0 * far / ray.direction().length()).min(f64::MAX);
        let f = self.polynomial(ray);
        let derivatives = f.derivatives();
        // The sign of f after t and up to the next root.
        let is_inside_after = |t: f64| {
            let mut signs = derivatives.iter().map(|derivative| derivative.sign(t));
            signs.find(|sign| *sign != Sign::NoSign) == Some(Sign::Minus)
        };
        for [before, t] in f.roots(end) {
            match [before, t].map(is_inside_after) {
                [false, true] => found(t, Side::Entering),
                [true, false] => found(t, Side::Leaving),
                // A root of even multiplicity: touched from outside, or from within.
                [false, false] => [Side::Entering, Side::Leaving].into_iter().for_each(|side| found(t, side)),
                [true, true] => [Side::Leaving, Side::Entering].into_iter().for_each(|side| found(t, side)),
            }
        }
    }

    fn normal(&self, point: DVec3) -> Option<DVec3> {
        (point - self.middle(point)).try_normalize()
    }

    fn is_closed(&self) -> bool {
        true
    }

    fn closest_point(&self, point: DVec3) -> Option<DVec3> {
        let middle = self.middle(point);
        Some(middle + (point - middle).try_normalize().unwrap_or(DVec3::Z) * self.minor)
    }
}

/// Finite numbers as integers, all times the same power of two.
fn integers<const N: usize>(numbers: [f64; N]) -> [BigInt; N] {
    let parts = numbers.map(parts);
    let least = parts.iter().filter(|part| part.0 != 0).map(|part| part.1).min().unwrap_or(0);
    parts.map(|(mantissa, exponent)| BigInt::from(mantissa) << (exponent - least).max(0))
}

/// A finite number as an integer and the exponent of a power of two.
fn parts(x: f64) -> (i64, i32) {
    let exponent = (x.abs().to_bits() >> 52) as i32;
    let fraction = (x.to_bits() & ((1 << 52) - 1)) as i64;
    // Subnormal numbers have no leading 1.
    let mantissa = if exponent == 0 { fraction } else { fraction | 1 << 52 };
    let zeros = mantissa.trailing_zeros() % 64;
    ((mantissa >> zeros) * if x < 0.0 { -1 } else { 1 }, exponent.max(1) - 1075 + zeros as i32)
}

/// A polynomial with integer coefficients, that of the lowest power first, that of the highest not 0.
#[derive(Debug, Clone)]
struct Polynomial(Vec<BigInt>);

impl Polynomial {
    fn degree(&self) -> usize {
        self.0.len() - 1
    }

    fn lead(&self) -> &BigInt {
        &self.0[self.degree()]
    }

    /// The sign at t, exactly.
    fn sign(&self, t: f64) -> Sign {
        let (mantissa, exponent) = parts(t);
        // The value times a power of two that leaves integers.
        let (factor, step) = (BigInt::from(mantissa) << exponent.max(0), (-exponent).max(0) as usize);
        let powers = self.0.iter().rev().enumerate();
        powers.fold(BigInt::ZERO, |sum, (power, c)| sum * &factor + (c << (step * power))).sign()
    }

    fn derivative(&self) -> Self {
        Polynomial((1..).zip(&self.0[1..]).map(|(power, c): (u32, _)| c * power).collect())
    }

    /// The polynomial and all of its derivatives but 0.
    fn derivatives(&self) -> Vec<Self> {
        let next = |p: &Self| (p.degree() > 0).then(|| p.derivative());
        std::iter::successors(Some(self.clone()), next).collect()
    }

    /// Quotient and remainder of a division, both times the same positive number; no remainder if it is 0.
    fn divide(&self, by: &Self) -> (Self, Option<Self>) {
        let (mut rest, mut quotient) = (self.0.clone(), vec![BigInt::ZERO; self.degree() - by.degree() + 1]);
        for shift in (0..quotient.len()).rev() {
            let lead = rest.pop().unwrap_or_default();
            let lead = if by.lead().sign() == Sign::Minus { -lead } else { lead };
            let factor = BigInt::from(by.lead().magnitude().clone());
            rest.iter_mut().chain(&mut quotient).for_each(|c| *c *= &factor);
            rest[shift..].iter_mut().zip(&by.0).for_each(|(c, of_divisor)| *c -= &lead * of_divisor);
            quotient[shift] = lead;
        }
        while rest.last().is_some_and(|c| c.sign() == Sign::NoSign) {
            rest.pop();
        }
        (Polynomial(quotient), (!rest.is_empty()).then_some(Polynomial(rest)))
    }

    /// Sturm's sequence, up to positive factors. The last is the greatest common divisor of the polynomial and its
    /// derivative.
    fn sturm(&self) -> Vec<Self> {
        let mut sequence = vec![self.clone(), self.derivative()];
        while let [.., a, b] = &sequence[..]
            && let Some(rest) = a.divide(b).1
        {
            sequence.push(Polynomial(rest.0.into_iter().map(|c| -c).collect()));
        }
        sequence
    }

    /// Every root with 0 < t <= `end`, as two f64 between which it is: after the first, up to the second, of which at
    /// least one is its neighbour. No other root is between them unless they are neighbours.
    fn roots(&self, end: f64) -> Vec<[f64; 2]> {
        let mut sequence = self.sturm();
        if let Some(common) = sequence.last().filter(|common| common.degree() > 0) {
            // The same roots, once each.
            sequence = self.divide(common).0.sturm();
        }
        let changes = |t: f64| {
            let mut signs: Vec<Sign> = sequence.iter().map(|p| p.sign(t)).collect();
            signs.retain(|sign| *sign != Sign::NoSign);
            signs.windows(2).filter(|pair| pair[0] != pair[1]).count()
        };
        let mut roots = Vec::new();
        // Intervals by the bits of their ends, which are in the order of the numbers; the first is on top.
        let mut waiting = vec![[0.0, end].map(|t| (t.to_bits(), changes(t)))];
        while let Some([(from, at_from), (to, at_to)]) = waiting.pop() {
            if at_from == at_to {
                continue;
            }
            let middle = from.midpoint(to);
            if middle == from || at_from == at_to + 1 {
                roots.push(sequence[0].narrow(from, to));
                continue;
            }
            let at_middle = (middle, changes(f64::from_bits(middle)));
            waiting.extend([[at_middle, (to, at_to)], [(from, at_from), at_middle]]);
        }
        roots
    }

    /// Halves an interval with a single root, which is not a multiple one, down to consecutive numbers.
    fn narrow(&self, mut from: u64, mut to: u64) -> [f64; 2] {
        let at_end = self.sign(f64::from_bits(to));
        while to - from > 1 && at_end != Sign::NoSign {
            let middle = from.midpoint(to);
            match self.sign(f64::from_bits(middle)) {
                Sign::NoSign => {
                    to = middle;
                    break;
                }
                sign if sign == at_end => to = middle,
                _ => from = middle,
            }
        }
        [from, to].map(f64::from_bits)
    }
}
