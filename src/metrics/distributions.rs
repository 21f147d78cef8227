//! Tails of statistical distributions: Student's t, chi-squared and normal. No crate of the project's has them, and `statrs`
//! brings linear algebra.
//!
//! The functions are those of the NIST Digital Library of Mathematical Functions (DLMF), <https://dlmf.nist.gov>. Relative errors
//! are below 1e-9, except where a p-value underflows to 0.

use std::f64::consts::{PI, SQRT_2};

/// Terms after which a series or fraction ends in any case. The number needed grows with the square root of the parameters.
const MAX_TERMS: u32 = 100_000;

/// The probability that |T| is at least `t` for Student's distribution of `degrees` of freedom, which need not be whole:
/// I(x; degrees / 2, 1 / 2) at x = degrees / (degrees + t^2) (DLMF 8.17.1; Abramowitz and Stegun 26.7.1).
pub fn student_two_sided(t: f64, degrees: f64) -> f64 {
    let square = t * t;
    if square.is_infinite() {
        return 0.0;
    }
    // The complement in its own form, since 1 - x loses digits for x near 1.
    let (x, complement) = (degrees / (degrees + square), square / (degrees + square));
    beta_regularised(0.5 * degrees, 0.5, x, complement)
}

/// The probability that a chi-squared variable of `degrees` of freedom is at least `x` >= 0.
pub fn chi_squared_upper(x: f64, degrees: f64) -> f64 {
    gamma_q(0.5 * degrees, 0.5 * x)
}

/// The probability that a standard normal variable is at least `z` in magnitude: Q(1/2, z^2 / 2) (DLMF 7.11.2).
pub fn normal_two_sided(z: f64) -> f64 {
    let z = z.abs() / SQRT_2;
    gamma_q(0.5, z * z)
}

/// The regularised incomplete beta function I(x; a, b), a and b > 0, with `complement` = 1 - x: the continued fraction of DLMF
/// 8.17.22 by Lentz's method (Thompson and Barnett, Coulomb and Bessel Functions of Complex Arguments and Order, 1986), with the
/// reflection 8.17.4 where it converges slowly.
fn beta_regularised(a: f64, b: f64, x: f64, complement: f64) -> f64 {
    if x <= 0.0 || complement <= 0.0 {
        return f64::from(u8::from(complement <= 0.0));
    }
    if x > (a + 1.0) / (a + b + 2.0) {
        return (1.0 - beta_regularised(b, a, complement, x)).clamp(0.0, 1.0);
    }
    // x^a (1 - x)^b / (a B(a, b)). The logarithm of a base near 1 is taken from its complement.
    let ln = |base: f64, other: f64| if base > 0.5 { (-other).ln_1p() } else { base.ln() };
    let ln_beta = ln_gamma(a.min(b)) - ln_gamma_ratio(a.max(b), a.min(b));
    let front = (a * ln(x, complement) + b * ln(complement, x) - ln_beta).exp() / a;
    let coefficient = |n: u32| {
        let m = f64::from(n / 2);
        if n.is_multiple_of(2) {
            m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m))
        } else {
            -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0))
        }
    };
    (front * reciprocal_fraction(coefficient)).clamp(0.0, 1.0)
}

/// 1 / (1 + d1 / (1 + d2 / (1 + ...))) by Lentz's method.
fn reciprocal_fraction(coefficient: impl Fn(u32) -> f64) -> f64 {
    let guarded = |x: f64| if x.abs() < f64::MIN_POSITIVE { f64::MIN_POSITIVE } else { x };
    let (mut c, mut d, mut fraction) = (1.0, 0.0, 1.0);
    for n in 1..MAX_TERMS {
        let numerator = coefficient(n);
        d = 1.0 / guarded(1.0 + numerator * d);
        c = guarded(1.0 + numerator / c);
        fraction *= c * d;
        if (c * d - 1.0).abs() < f64::EPSILON {
            break;
        }
    }
    1.0 / fraction
}

/// The regularised upper incomplete gamma function Q(a, x), a > 0, x >= 0: the series of DLMF 8.11.4 below a + 1, the continued
/// fraction of 8.9.2 by Lentz's method above.
pub(crate) fn gamma_q(a: f64, x: f64) -> f64 {
    let front = (a * x.max(f64::MIN_POSITIVE).ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > sum * 1e-16 {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return (1.0 - front * sum).clamp(0.0, 1.0);
    }
    let mut b = x + 1.0 - a;
    let mut c = f64::MAX;
    let mut d = 1.0 / b;
    let mut fraction = d;
    for i in 1..MAX_TERMS {
        let i = f64::from(i);
        let numerator = -i * (i - a);
        b += 2.0;
        d = 1.0 / (numerator * d + b);
        c = b + numerator / c;
        fraction *= c * d;
        if (c * d - 1.0).abs() < 1e-15 {
            break;
        }
    }
    (front * fraction).clamp(0.0, 1.0)
}

/// The logarithm of the gamma function, x > 0: Stirling's series (DLMF 5.11.1) from 10 on, recurrence below. Error below 1e-12,
/// relative above 1.
fn ln_gamma(mut x: f64) -> f64 {
    let mut shift = 0.0;
    while x < 10.0 {
        shift -= x.ln();
        x += 1.0;
    }
    shift + (x - 0.5) * x.ln() - x + 0.5 * (2.0 * PI).ln() + stirling(x)
}

/// The logarithm of the quotient of the gamma functions of `a + b` and `a`, both positive, without cancellation for large `a`.
fn ln_gamma_ratio(a: f64, b: f64) -> f64 {
    if a < 10.0 {
        return ln_gamma(a + b) - ln_gamma(a);
    }
    (a - 0.5) * (b / a).ln_1p() + b * ((a + b).ln() - 1.0) + stirling(a + b) - stirling(a)
}

/// Stirling's series without its elementary part, x >= 10.
fn stirling(x: f64) -> f64 {
    let inverse = 1.0 / (x * x);
    (1.0 / 12.0
        - inverse * (1.0 / 360.0 - inverse * (1.0 / 1260.0 - inverse * (1.0 / 1680.0 - inverse / 1188.0))))
        / x
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64, relative: f64) {
        assert!((a - b).abs() <= relative * b.abs(), "{a} is not {b}");
    }

    /// Closed forms: 1 - 2/pi atan t with 1 degree of freedom (Cauchy), 1 - t / sqrt(2 + t^2) with 2, and
    /// 1 - 2/pi (atan u + u / (1 + u^2)), u = t / sqrt 3, with 3; the tails of large t by atan(1 / t), without cancellation.
    #[test]
    fn student_of_one_two_and_three_degrees_in_closed_form() {
        for t in [1e-3, 0.1, 0.5, 1.0, 2.0, 7.0, 40.0, 1e4, 1e9] {
            close(student_two_sided(t, 1.0), (1.0 / t).atan() * 2.0 / PI, 1e-12);
            // 1 - t / s = 2 / (s (s + t)), s = sqrt(2 + t^2).
            let s = (2.0 + t * t).sqrt();
            close(student_two_sided(-t, 2.0), 2.0 / (s * (s + t)), 1e-12);
        }
        for t in [0.1, 1.0, 2.0, 7.0] {
            let u: f64 = t / 3f64.sqrt();
            close(student_two_sided(t, 3.0), 1.0 - 2.0 / PI * (u.atan() + u / (1.0 + u * u)), 1e-11);
        }
        assert_eq!((student_two_sided(0.0, 5.5), student_two_sided(f64::INFINITY, 5.5)), (1.0, 0.0));
    }

    /// Two-sided quantiles as tabulated (Abramowitz and Stegun, table 26.10, three digits).
    #[test]
    fn student_quantiles_of_the_table() {
        for (degrees, probability, quantile) in [
            (5.0, 0.05, 2.571),
            (10.0, 0.05, 2.228),
            (10.0, 0.01, 3.169),
            (30.0, 0.05, 2.042),
            (30.0, 0.01, 2.750),
            (60.0, 0.001, 3.460),
            (120.0, 0.01, 2.617),
        ] {
            let (below, above): (f64, f64) = (quantile - 6e-4, quantile + 6e-4);
            let interval = [student_two_sided(above, degrees), student_two_sided(below, degrees)];
            assert!(interval[0] < probability && probability < interval[1], "{degrees}: {interval:?}");
        }
    }

    /// The integral of the density from t to infinity, by Simpson's rule in u = 1 / s; the density's constant cancels against
    /// the integral from 0, where the probability is 1.
    #[test]
    fn student_of_fractional_degrees_by_quadrature() {
        for degrees in [4.5f64, 17.3, 94.2, 2000.7] {
            let density = |s: f64| (-0.5 * (degrees + 1.0) * (s * s / degrees).ln_1p()).exp();
            let simpson = |from: f64, to: f64| {
                let (count, h) = (20_000, (to - from) / 20_000.0);
                let weight = |i: u32| if i == 0 || i == count { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
                (0..=count).map(|i| weight(i) * density(from + f64::from(i) * h)).sum::<f64>() * h / 3.0
            };
            // Beyond 1, s = 1 / u: the integrand density(1 / u) / u^2 vanishes at 0 for 2 or more degrees.
            let tail = |t: f64| {
                let (count, h) = (20_000, 1.0 / t / 20_000.0);
                let weight = |i: u32| if i == count { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
                let at = |u: f64| density(1.0 / u) / (u * u);
                (1..=count).map(|i| weight(i) * at(f64::from(i) * h)).sum::<f64>() * h / 3.0
            };
            let whole = simpson(0.0, 1.0) + tail(1.0);
            for t in [1.0, 1.7, 3.0, 5.0] {
                close(student_two_sided(t, degrees), tail(t) / whole, 1e-9);
            }
        }
    }

    /// With many degrees of freedom Student's distribution is the normal one, up to (t^4 + t^2) / (4 degrees): 7e-8 for 4.
    #[test]
    fn student_of_many_degrees_is_normal() {
        for t in [0.5, 1.0, 1.959_963_984_540_054, 4.0] {
            close(student_two_sided(t, 1e9), normal_two_sided(t), 1e-7);
        }
        // The 2.5 % point of the normal distribution.
        close(normal_two_sided(1.959_963_984_540_054), 0.05, 1e-12);
        // 2 (1 - Phi(6)) = 1.9731752900754e-9.
        close(normal_two_sided(-6.0), 1.973_175_290_075_4e-9, 1e-11);
    }

    /// Q(1, x) = e^-x; Q(1/2, x) = erfc(sqrt x), erfc(1) = 0.157299207050285; Q(2, x) = (1 + x) e^-x. The 5 % point
    /// of chi-squared with 10 degrees of freedom is 18.307038053275146, with 100 it is 124.342113404004.
    #[test]
    fn incomplete_gamma_function() {
        for x in [0.1, 1.0, 3.0, 30.0] {
            assert!((gamma_q(1.0, x) - (-x).exp()).abs() < 1e-13);
            assert!((gamma_q(2.0, x) - (1.0 + x) * (-x).exp()).abs() < 1e-12);
        }
        assert!((gamma_q(0.5, 1.0) - 0.157_299_207_050_285).abs() < 1e-12);
        assert!((chi_squared_upper(18.307_038_053_275_146, 10.0) - 0.05).abs() < 1e-11);
        assert!((chi_squared_upper(124.342_113_404_004, 100.0) - 0.05).abs() < 1e-10);
        assert_eq!(gamma_q(3.0, 0.0), 1.0);
    }
}
