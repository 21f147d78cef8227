//! Tails of statistical distributions: Student's t, chi-squared and normal.

use std::f64::consts::SQRT_2;

use libm::erfc;
use statrs::function::{beta::checked_beta_reg, gamma::checked_gamma_ur};

/// The probability that |T| is at least `t` for Student's distribution of `degrees` of freedom, which need not be whole:
/// I(x; degrees / 2, 1 / 2) at x = degrees / (degrees + t^2) (DLMF 8.17.1; Abramowitz and Stegun 26.7.1). NaN for NaN.
pub fn student_two_sided(t: f64, degrees: f64) -> f64 {
    checked_beta_reg(0.5 * degrees, 0.5, degrees / (degrees + t * t)).unwrap_or(f64::NAN)
}

/// The probability that a chi-squared variable of `degrees` of freedom is at least `x` >= 0.
pub fn chi_squared_upper(x: f64, degrees: f64) -> f64 {
    if x <= 0.0 { 1.0 } else { checked_gamma_ur(0.5 * degrees, 0.5 * x).unwrap_or(0.0) }
}

/// The probability that a standard normal variable is at least `z` in magnitude.
pub fn normal_two_sided(z: f64) -> f64 {
    erfc(z.abs() / SQRT_2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64, relative: f64) {
        assert!((a - b).abs() <= relative * b.abs(), "{a} is not {b}");
    }

    /// Closed form for 2 degrees of freedom: 1 - t / s = 2 / (s (s + t)), s = sqrt(2 + t^2).
    #[test]
    fn student_of_two_degrees_in_closed_form() {
        for t in [1e-3, 0.1, 0.5, 1.0, 2.0, 7.0, 40.0, 1e4, 1e9] {
            let s = (2.0f64 + t * t).sqrt();
            close(student_two_sided(-t, 2.0), 2.0 / (s * (s + t)), 1e-12);
        }
        assert_eq!((student_two_sided(0.0, 5.5), student_two_sided(f64::INFINITY, 5.5)), (1.0, 0.0));
    }

    /// With many degrees of freedom Student's distribution is the normal one, up to (t^4 + t^2) / (4 degrees): 7e-6 for 4.
    /// Such degrees are those of whole pictures.
    #[test]
    fn student_of_many_degrees_is_normal() {
        for t in [0.5, 1.0, 1.959_963_984_540_054, 4.0] {
            close(student_two_sided(t, 1e7), normal_two_sided(t), 1e-5);
        }
        // The 2.5 % point of the normal distribution, and 2 (1 - Phi(6)).
        close(normal_two_sided(1.959_963_984_540_054), 0.05, 1e-12);
        close(normal_two_sided(-6.0), 1.973_175_290_075_4e-9, 1e-11);
    }

    /// The 5 % points of chi-squared with 10 and 100 degrees of freedom; exp(-x / 2) with 2.
    #[test]
    fn chi_squared_points() {
        close(chi_squared_upper(18.307_038_053_275_146, 10.0), 0.05, 1e-10);
        close(chi_squared_upper(124.342_113_404_004, 100.0), 0.05, 1e-10);
        close(chi_squared_upper(3.0, 2.0), (-1.5f64).exp(), 1e-12);
        assert_eq!((chi_squared_upper(0.0, 3.0), chi_squared_upper(f64::INFINITY, 3.0)), (1.0, 0.0));
    }
}
