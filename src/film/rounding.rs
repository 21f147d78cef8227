//! Rounding of display values to integers of 8 or 16 bits: to the nearest one, or dithered.

use serde::{Deserialize, Serialize};

/// How display values are rounded. The default is to the nearest integer of 8 bits.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rounding {
    /// Whether image files that can hold them get 16 bits per channel, instead of 8.
    pub is_16_bit: bool,
    /// Whether values are dithered.
    pub is_dithered: bool,
}

/// An integer type of display values; 1 is stored as its maximum.
pub trait Level: bytemuck::Pod + Send + Sync {
    /// The maximum.
    const MAX: f64;

    /// From an integer in its range.
    fn of(integer: i32) -> Self;
}

impl Level for u8 {
    const MAX: f64 = u8::MAX as f64;

    #[inline(always)]
    fn of(integer: i32) -> Self {
        integer as u8
    }
}

impl Level for u16 {
    const MAX: f64 = u16::MAX as f64;

    #[inline(always)]
    fn of(integer: i32) -> Self {
        integer as u16
    }
}

/// Clamps to 0..1 and rounds to the nearest level, halves upwards. NaN becomes 0.
#[inline(always)]
pub fn quantise<L: Level>(x: f64) -> L {
    let y = x * L::MAX + 0.5;
    // With these comparisons the truncating cast vectorises to one instruction.
    let above = if y > 0.0 { y } else { 0.0 };
    let held = if above < L::MAX { above } else { L::MAX };
    L::of(held as i32)
}

/// Clamps to 0..1 and rounds to one of the nearest levels, by random bits. The expected value is `x`; 0 and 1 are exact.
/// NaN becomes 0.
///
/// The noise has a triangular distribution two levels wide, so that neither mean nor variance of the error depends on
/// the value (Lipshitz, Wannamaker and Vanderkooy, Quantization and Dither: A Theoretical Survey, JAES 40(5), 1992).
/// Within half a level of 0 and 1, where it would leave the range, it has a uniform distribution one level wide, whose
/// mean is right as well. At half a level both give the same.
#[inline(always)]
pub fn dither<L: Level>(x: f64, bits: u32) -> L {
    // Centres of 65,536 equal parts of 0..1.
    let [a, b] = [bits >> 16, bits & 0xffff].map(|part| (f64::from(part) + 0.5) / 65536.0);
    let level = if x > 0.0 { x.min(1.0) * L::MAX } else { 0.0 };
    let noise = if level >= 0.5 && level <= L::MAX - 0.5 { a + b - 0.5 } else { a };
    L::of((level + noise) as i32)
}

/// Random bits of a pixel of the whole picture for [`dither`]: of red, green and blue. They depend on its position
/// alone, so that threads, tiles and crops do not change a picture.
#[inline(always)]
pub fn bits_of_pixel([x, y]: [u32; 2]) -> [u32; 3] {
    pcg3d([x, y, 0x0d17_4e50])
}

/// The same for its alpha.
#[inline(always)]
pub fn bits_of_alpha([x, y]: [u32; 2]) -> u32 {
    pcg3d([x, y, 0x0d17_4e51])[0]
}

/// The hash `pcg3d` (Jarzynski and Olano, Hash Functions for GPU Rendering, JCGT 9(3), 2020): each input bit flips each
/// output bit with a probability of about 1/2.
#[inline(always)]
pub fn pcg3d(v: [u32; 3]) -> [u32; 3] {
    let mixed = |[x, y, z]: [u32; 3]| {
        let x = x.wrapping_add(y.wrapping_mul(z));
        let y = y.wrapping_add(z.wrapping_mul(x));
        [x, y, z.wrapping_add(x.wrapping_mul(y))]
    };
    let spread = v.map(|c| c.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    mixed(mixed(spread).map(|c| c ^ (c >> 16)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantising_rounds_halves_up_and_clamps() {
        // 127.5 is exactly between 127 and 128.
        assert_eq!(quantise::<u8>(127.5 / 255.0), 128);
        assert_eq!(quantise::<u8>(127.4 / 255.0), 127);
        assert_eq!(quantise::<u16>(32767.5 / 65535.0), 32768);
        assert_eq!(quantise::<u16>(32767.4 / 65535.0), 32767);
        for (x, expected) in [(-3.0, 0), (7.0, 255), (f64::NAN, 0), (f64::INFINITY, 255)] {
            assert_eq!((quantise::<u8>(x), u32::from(quantise::<u16>(x))), (expected as u8, expected * 257));
        }
    }

    /// Every value of 8 bits, also as an f32, is a multiple of 257 in 16 bits, since 65535 = 257 * 255.
    #[test]
    fn sixteen_bits_hold_eight_exactly() {
        for value in 0..=255u8 {
            let x = f64::from(f32::from(value) / 255.0);
            assert_eq!(quantise::<u16>(x), u16::from(value) * 257);
        }
    }

    /// The mean of a million pixels of a constant is it within 4 standard errors, those of the error's variance:
    /// f (1 - f) within half a level of the ends (f being the fraction of the level), elsewhere 1/4 (Lipshitz et al.,
    /// section 3: 3/12 of a squared level). The variance is that within 2 %.
    #[test]
    fn dithering_is_unbiased() {
        const SIDE: u32 = 1000;
        fn check<L: Level + Into<f64>>(level: f64) {
            let (mut sum, mut squares) = (0.0, 0.0);
            for pixel in (0..SIDE * SIDE).map(|i| [i % SIDE, i / SIDE]) {
                let error = dither::<L>(level / L::MAX, bits_of_pixel(pixel)[1]).into() - level;
                (sum, squares) = (sum + error, squares + error * error);
            }
            let count = f64::from(SIDE * SIDE);
            let is_at_end = level < 0.5 || level > L::MAX - 0.5;
            let variance = if is_at_end { level.fract() * (1.0 - level.fract()) } else { 0.25 };
            assert!((sum / count).abs() < 4.0 * (variance / count).sqrt(), "{level}: {}", sum / count);
            assert!((squares / count - variance).abs() < 0.02 * variance, "{level}: {}", squares / count);
        }
        for level in [0.01, 0.3, 0.49, 0.51, 0.9, 1.0, 77.0, 77.25, 128.5, 253.7, 254.6, 254.99] {
            check::<u8>(level);
            check::<u16>(level);
        }
        check::<u16>(65534.75);
    }

    #[test]
    fn black_and_white_stay_flat() {
        for pixel in (0..1 << 16).map(|i| [i % 256, i / 256]) {
            for bits in bits_of_pixel(pixel).into_iter().chain([0, u32::MAX]) {
                for (x, expected) in [(0.0, 0), (1.0, 255), (-1.0, 0), (1.5, 255), (f64::NAN, 0)] {
                    assert_eq!(dither::<u8>(x, bits), expected);
                    assert_eq!(dither::<u16>(x, bits), u16::from(expected) * 257);
                }
            }
        }
    }

    /// Channels, and neighbouring pixels, are rounded independently: a correlation of 65,536 pairs has a standard
    /// deviation of 1 / 256.
    #[test]
    fn pixels_and_channels_are_independent() {
        let error = |bits: u32| f64::from(dither::<u8>(0.5, bits)) - 127.5;
        let numbers = |x: u32, y: u32| {
            let [r, g, b] = bits_of_pixel([x, y]);
            [r, g, b, bits_of_alpha([x, y]), bits_of_pixel([x + 1, y])[0], bits_of_pixel([x, y + 1])[0]]
                .map(error)
        };
        let all: Vec<[f64; 6]> = (0..1 << 16).map(|i| numbers(i % 256, i / 256)).collect();
        for (i, j) in (0..6).flat_map(|i| (0..i).map(move |j| (i, j))) {
            let products: f64 = all.iter().map(|errors| errors[i] * errors[j]).sum();
            // The errors' variance is 1/4.
            let correlation = products / all.len() as f64 / 0.25;
            assert!(correlation.abs() < 4.5 / 256.0, "{i} and {j}: {correlation}");
        }
    }
}
