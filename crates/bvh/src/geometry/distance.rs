//! Exact distances along rays, for the cases of the tier `exact` that f64 does not decide.
//!
//! Every f64 is an integer times a power of two. Scaling all coordinates by one power of two makes them integers and
//! leaves t, a ratio of lengths, unchanged. So t is a fraction of integers for a triangle, and a root of a quadratic
//! with integer coefficients for a quadric such as a sphere.

use std::cmp::Ordering;

use glam::DVec3;
use num_bigint::{BigInt, Sign};
use num_traits::{Signed, ToPrimitive};

use super::Ray;

/// The number `(b - √d) / a`, or `(b + √d) / a` if `far`, with `a > 0` and `d >= 0`.
#[derive(Debug, Clone)]
pub(crate) struct Distance {
    b: BigInt,
    a: BigInt,
    d: BigInt,
    far: bool,
}

/// A ray's exact intersection with the plane of a triangle.
pub(crate) struct PlaneHit {
    /// The distance along the ray.
    pub distance: Distance,
    /// The barycentrics of the corners, rounded to f64.
    pub barycentrics: [f64; 3],
}

/// Three integers.
pub(crate) type Vector = [BigInt; 3];

impl Distance {
    /// A finite number as a distance.
    pub(crate) fn of(t: f64) -> Self {
        let [b, a] = integers([t, 1.0]);
        Distance { b, a, d: BigInt::ZERO, far: false }
    }

    /// The intersection with the plane of a triangle of normal n, at `n.(corner - origin) / n.direction`. `None` if
    /// the ray is parallel to the plane or the triangle has no area.
    pub(crate) fn to_triangle(ray: &Ray, corners: &[DVec3; 3]) -> Option<PlaneHit> {
        let [o, d] = [ray.origin, ray.direction];
        let [a, b, c] = *corners;
        let numbers = integers([o.x, o.y, o.z, d.x, d.y, d.z, a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z]);
        let vector = |i: usize| -> Vector { [0, 1, 2].map(|k| numbers[3 * i + k].clone()) };
        let (origin, direction) = (vector(0), vector(1));
        let [a, b, c] = [2, 3, 4].map(|i| minus(&vector(i), &origin));
        let normal = cross(&minus(&b, &a), &minus(&c, &a));
        let across = dot(&normal, &direction);
        if across.sign() == Sign::NoSign {
            return None;
        }
        let barycentrics =
            [(&b, &c), (&c, &a), (&a, &b)].map(|(p, q)| ratio(&dot(&direction, &cross(p, q)), &across));
        Some(PlaneHit { distance: Distance::ratio(&dot(&normal, &a), &across), barycentrics })
    }

    /// A fraction whose denominator is not 0.
    pub(crate) fn ratio(numerator: &BigInt, denominator: &BigInt) -> Self {
        let sign = denominator.signum();
        Distance { b: numerator * &sign, a: denominator * &sign, d: BigInt::ZERO, far: false }
    }

    /// The near and far root of `a t^2 - 2 b t + c = 0` with `a > 0`. `None` if they are not real.
    pub(crate) fn roots(a: &BigInt, b: &BigInt, c: &BigInt) -> Option<[Self; 2]> {
        let d = b * b - a * c;
        if d.is_negative() {
            return None;
        }
        Some([false, true].map(|far| Distance { b: b.clone(), a: a.clone(), d: d.clone(), far }))
    }

    /// Whether it lies strictly between `t_min` and `t_max` of the ray.
    pub(crate) fn is_within(&self, ray: &Ray) -> bool {
        let order = |t: f64| if t.is_finite() { self.cmp(&Distance::of(t)) } else { 0.0f64.total_cmp(&t) };
        order(ray.t_min).is_gt() && order(ray.t_max).is_lt()
    }

    /// The order of two distances.
    pub(crate) fn cmp(&self, other: &Self) -> Ordering {
        // The difference times both denominators: an integer and two square roots, the second subtracted.
        let whole = &self.b * &other.a - &other.b * &self.a;
        let root = |x: &Self, by: &BigInt, plus: bool| {
            let square = &x.d * by * by;
            let sign = sign(&square);
            (if plus { sign } else { -sign }, square)
        };
        let sign = sign_of_sum(&whole, root(self, &other.a, self.far), root(other, &self.a, !other.far));
        sign.cmp(&0)
    }

    /// The nearest f64, up to 1 ulp.
    pub(crate) fn to_f64(&self) -> f64 {
        // Fractional bits of the root.
        const PLACES: u32 = 64;
        let root = (&self.d << (2 * PLACES)).sqrt();
        let root = if self.far { root } else { -root };
        let b = &self.b << PLACES;
        if self.b.is_negative() == root.is_negative() || root.sign() == Sign::NoSign {
            return ratio(&(b + root), &(&self.a << PLACES));
        }
        // Where b and the root cancel: (b^2 - d) / (a (b - root)).
        ratio(&((&self.b * &self.b - &self.d) << PLACES), &(&self.a * (b - root)))
    }
}

/// 1, 0 or -1.
fn sign(x: &BigInt) -> i32 {
    x.cmp(&BigInt::ZERO) as i32
}

/// The sign of `whole + s √p + t √q` with signs s and t.
fn sign_of_sum(whole: &BigInt, (s, p): (i32, BigInt), (t, q): (i32, BigInt)) -> i32 {
    // The sign of a sum of two terms with signs s and t; `squares` is the sign of the difference of their squares.
    let stronger = |s: i32, t: i32, squares: i32| {
        if s == t || t == 0 || squares > 0 {
            s
        } else if squares < 0 || s == 0 {
            t
        } else {
            0
        }
    };
    let roots = stronger(s, t, sign(&(&p - &q)));
    let whole_sign = sign(whole);
    if whole_sign == roots || roots == 0 || whole_sign == 0 {
        return if roots == 0 { whole_sign } else { roots };
    }
    // Opposite signs: compare squares, (s √p + t √q)^2 - whole^2 = rest + 2 s t √(p q).
    let product = &p * &q;
    let rest = &p + &q - whole * whole;
    let four = &product << 2u32;
    let squares = sign(&(&rest * &rest - four));
    match stronger(sign(&rest), s * t * sign(&product), squares) {
        0 => 0,
        1 => roots,
        _ => whole_sign,
    }
}

/// Finite numbers as integers, all scaled by the same power of two.
pub(crate) fn integers<const N: usize>(numbers: [f64; N]) -> [BigInt; N] {
    let parts = numbers.map(|x| {
        let bits = x.to_bits();
        let exponent = (bits >> 52 & 0x7ff) as i32;
        let fraction = bits & ((1 << 52) - 1);
        let (mantissa, exponent) = if exponent == 0 { (fraction, 1) } else { (fraction | 1 << 52, exponent) };
        let zeros = mantissa.trailing_zeros();
        if mantissa == 0 { (0, None) } else { (mantissa >> zeros, Some(exponent + zeros as i32)) }
    });
    let least = parts.iter().filter_map(|p| p.1).min().unwrap_or(0);
    let mut index = 0;
    parts.map(|(mantissa, exponent)| {
        let integer = BigInt::from(mantissa) << (exponent.unwrap_or(least) - least) as u32;
        let negative = numbers[index].is_sign_negative();
        index += 1;
        if negative { -integer } else { integer }
    })
}

/// The quotient of two integers, to 1 ulp.
fn ratio(numerator: &BigInt, denominator: &BigInt) -> f64 {
    let shift = denominator.bits() as i64 - numerator.bits() as i64 + 66;
    let quotient = match u64::try_from(shift) {
        Ok(shift) => (numerator << shift) / denominator,
        Err(_) => numerator / (denominator << shift.unsigned_abs()),
    };
    // In two steps: each power is within the range of f64.
    let half = (shift / 2) as i32;
    quotient.to_f64().unwrap_or(f64::NAN) * 2f64.powi(-half) * 2f64.powi(half - shift as i32)
}

pub(crate) fn minus(a: &Vector, b: &Vector) -> Vector {
    [0, 1, 2].map(|k| &a[k] - &b[k])
}

pub(crate) fn dot(a: &Vector, b: &Vector) -> BigInt {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

pub(crate) fn cross(a: &Vector, b: &Vector) -> Vector {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| &a[i] * &b[j] - &a[j] * &b[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn root(b: i32, a: i32, d: i32, far: bool) -> Distance {
        Distance { b: b.into(), a: a.into(), d: d.into(), far }
    }

    /// All small roots against f64, whose precision is far below the least gap between two different roots.
    #[test]
    fn order_is_that_of_the_numbers() {
        let mut all = Vec::new();
        for b in -4..=4 {
            for a in 1..=3 {
                for d in 0..=9 {
                    all.extend([false, true].map(|far| (b, a, d, far)));
                }
            }
        }
        let number = |&(b, a, d, far): &(i32, i32, i32, bool)| {
            let root = f64::from(d).sqrt();
            (f64::from(b) + if far { root } else { -root }) / f64::from(a)
        };
        for x in &all {
            let exact = root(x.0, x.1, x.2, x.3);
            assert!((exact.to_f64() - number(x)).abs() <= 4.0 * f64::EPSILON, "{x:?}");
            for y in &all {
                let gap = number(x) - number(y);
                let expected = if gap.abs() < 1e-9 { Ordering::Equal } else { gap.total_cmp(&0.0) };
                assert_eq!(exact.cmp(&root(y.0, y.1, y.2, y.3)), expected, "{x:?} {y:?}");
            }
        }
    }

    #[test]
    fn numbers_survive() {
        for t in [0.0, 1.0, -0.1, 1e-70, 1e30, 4.0 / 3.0, f64::MIN_POSITIVE / 8.0] {
            assert_eq!(Distance::of(t).to_f64(), t);
        }
    }

    #[test]
    fn cancelling_roots_keep_their_digits() {
        // t^2 - 2e9 t + 1 = 0: the near root is 5e-10 (1 + at most 2.5e-19).
        let big = root(1_000_000_000, 1, 0, false);
        let d = &big.b * &big.b - BigInt::from(1);
        assert_eq!(Distance { d, ..big }.to_f64(), 5e-10);
    }
}
