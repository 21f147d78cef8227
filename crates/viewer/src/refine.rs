//! Progressive refinement: the sequence of passes of a picture.
//!
//! The resolution of the first pass is chosen so that it meets a time limit; the last pass is the picture of `kiln
//! render`, to the bit. Each pass is a whole picture. Coarse passes render pixels of `factor` by `factor` pixels of the
//! picture. With factors that decrease by 4, all passes but the first cost a fifteenth of a pass of full size. Passes
//! of samples begin anew, each with at most an eighth of the samples of the next: all but the last have at most a seventh
//! of its samples. With adaptive sampling the last may take fewer than its maximum, and the share be larger. A mean of
//! parts would cost nothing more, but it is the picture only up to rounding, and adaptive sampling has no parts.

/// Time limit of the first pass in seconds; the interface waits for it about as long.
const FIRST_PASS_SECONDS: f64 = 0.008;

/// Time limit of the first pass in seconds during playback, where frames are not refined: 30 frames per second.
const PLAYBACK_PASS_SECONDS: f64 = 0.03;

/// Maximum factor of a coarse pass.
const MAX_FACTOR: u32 = 32;

/// Least ratio of the samples of a pass to those of the pass before it.
const MORE_SAMPLES: u32 = 8;

/// Factor of the first pass before any render time was measured.
const DEFAULT_FACTOR: u32 = 8;

/// A pass over a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pass {
    /// One sample at the centre of each pixel, at a resolution reduced by this factor on each axis.
    Coarse(u32),
    /// At most so many samples of each pixel; the last pass is the picture.
    Samples(u32),
}

/// Factor of the first pass of a picture, from the render time per pixel.
pub(crate) fn first_factor(pixels: usize, seconds_per_pixel: Option<f64>, is_playing: bool) -> u32 {
    let limit = if is_playing { PLAYBACK_PASS_SECONDS } else { FIRST_PASS_SECONDS };
    let Some(seconds) = seconds_per_pixel else { return DEFAULT_FACTOR };
    let factor = (seconds * pixels as f64 / limit).sqrt().ceil();
    (factor as u32).clamp(1, MAX_FACTOR)
}

/// The passes of a picture of at most `samples` samples per pixel, the first of them with factor `first`.
pub(crate) fn passes(first: u32, samples: u32) -> Vec<Pass> {
    let mut passes = Vec::new();
    let mut factor = first;
    while factor > 1 {
        passes.push(Pass::Coarse(factor));
        factor = if factor > 4 { factor / 4 } else { 1 };
    }
    let counts = std::iter::successors(Some(1u32), |count| count.checked_mul(MORE_SAMPLES));
    passes.extend(counts.take_while(|count| *count <= samples / MORE_SAMPLES).map(Pass::Samples));
    passes.push(Pass::Samples(samples));
    passes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_begins_as_coarsely_as_it_has_to() {
        // A million pixels at 5 ns: 0.0052 s.
        assert_eq!(first_factor(1 << 20, Some(5e-9), false), 1);
        // At 100 ns a tenth: a quarter of the pixels take 0.026 s, a sixteenth 0.0066.
        assert_eq!(first_factor(1 << 20, Some(100e-9), false), 4);
        assert_eq!(first_factor(1 << 20, Some(100e-9), true), 2);
        assert_eq!(first_factor(1 << 20, Some(1.0), false), MAX_FACTOR);
        assert_eq!(first_factor(1 << 20, None, false), DEFAULT_FACTOR);
    }

    #[test]
    fn passes_end_with_what_was_asked_for() {
        use Pass::{Coarse, Samples};
        assert_eq!(passes(8, 1), [Coarse(8), Coarse(2), Samples(1)]);
        assert_eq!(passes(16, 1), [Coarse(16), Coarse(4), Samples(1)]);
        assert_eq!(passes(1, 1), [Samples(1)]);
        assert_eq!(passes(1, 7), [Samples(7)]);
        assert_eq!(passes(2, 16), [Coarse(2), Samples(1), Samples(16)]);
        assert_eq!(passes(1, 64), [Samples(1), Samples(8), Samples(64)]);
        for samples in [1, 2, 3, 64, 100, 65_536, u32::MAX] {
            let all = passes(1, samples);
            assert_eq!(all.last(), Some(&Samples(samples)));
            // Ratios of 8 are the worst case: 1/8 + 1/64 + ... = 1/7.
            let count = |pass: &Pass| if let Samples(count) = pass { u64::from(*count) } else { 0 };
            let before: u64 = all[..all.len() - 1].iter().map(count).sum();
            assert!(7 * before <= u64::from(samples), "{samples}: {before}");
        }
    }
}
