//! Progressive refinement: the sequence of passes of a picture.
//!
//! The resolution of the first pass is chosen so that it meets a time limit; the last pass is the picture of `kiln
//! render`, to the bit. Each pass is a whole picture. Coarse passes render pixels of `factor` by `factor` pixels of the
//! picture. Factors are halved, so that the first image is soon replaced: the second pass takes at most four times as long.
//! Passes of samples begin anew, each with at most an eighth of the samples of the next: all but the last have at most a
//! seventh of its samples. With adaptive sampling the last may take fewer than its maximum, and the share be larger. A mean
//! of parts would cost nothing more, but it is the picture only up to rounding, and adaptive sampling has no parts.

use std::time::Duration;

/// Time limit of the first pass in seconds: the second pass, of four times its pixels, replaces it within 0.1 s.
const FIRST_PASS_SECONDS: f64 = 0.018;

/// Time limit of the first pass in seconds during playback, where frames are not refined: 30 frames per second.
const PLAYBACK_PASS_SECONDS: f64 = 0.03;

/// Least width or height of the first pass in pixels, whichever is larger.
const LEAST_SIDE: u32 = 96;

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

/// Render time of a pass with one sample a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PassTime {
    /// Seconds that do not depend on the number of pixels.
    fixed: f64,
    /// Seconds per pixel.
    per_pixel: f64,
}

impl PassTime {
    /// The time of a pass of `pixels` pixels that took `time`. `of_threads` is the processor time of a thread in its stages,
    /// if that is measured: unlike `time` it does not contain that of other processes.
    pub(crate) fn new(pixels: usize, time: Duration, of_threads: Option<Duration>) -> Self {
        let [time, of_pixels] = [time, of_threads.unwrap_or(time)].map(|time| time.as_secs_f64());
        PassTime { fixed: (time - of_pixels).max(0.0), per_pixel: of_pixels / pixels.max(1) as f64 }
    }

    /// Geometric means with the previous times, which damp outliers.
    pub(crate) fn damped(self, before: Option<PassTime>) -> Self {
        let mean = |own: f64, before: f64| (own * before).sqrt();
        before.map_or(self, |before| PassTime {
            fixed: mean(self.fixed, before.fixed),
            per_pixel: mean(self.per_pixel, before.per_pixel),
        })
    }

    /// Factor of the first pass of a picture. The fixed part counts for at most half of the limit, because fewer pixels do not
    /// reduce it.
    pub(crate) fn first_factor(time: Option<PassTime>, [width, height]: [u32; 2], is_playing: bool) -> u32 {
        let limit = if is_playing { PLAYBACK_PASS_SECONDS } else { FIRST_PASS_SECONDS };
        let most = (width.max(height) / LEAST_SIDE).max(1);
        let Some(PassTime { fixed, per_pixel }) = time else { return DEFAULT_FACTOR.min(most) };
        let seconds = per_pixel * f64::from(width) * f64::from(height);
        let factor = (seconds / (limit - fixed.min(limit / 2.0))).sqrt().ceil();
        (factor as u32).clamp(1, most)
    }
}

/// The passes of a picture of at most `samples` samples per pixel, the first of them with factor `first`.
pub(crate) fn passes(first: u32, samples: u32) -> Vec<Pass> {
    let factors = std::iter::successors(Some(first), |factor| Some(factor.div_ceil(2)));
    let mut passes: Vec<Pass> = factors.take_while(|factor| *factor > 1).map(Pass::Coarse).collect();
    let counts = std::iter::successors(Some(1u32), |count| count.checked_mul(MORE_SAMPLES));
    passes.extend(counts.take_while(|count| *count <= samples / MORE_SAMPLES).map(Pass::Samples));
    passes.push(Pass::Samples(samples));
    passes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of a million pixels.
    const SIZE: [u32; 2] = [1024, 1024];

    #[test]
    fn a_picture_begins_as_coarsely_as_it_has_to() {
        let factor = |fixed: f64, per_pixel: f64, is_playing: bool| {
            PassTime::first_factor(Some(PassTime { fixed, per_pixel }), SIZE, is_playing)
        };
        // At 15 ns a pixel 0.016 s; at 100 ns 0.105 s: a ninth takes 0.012 s, a quarter 0.026 s.
        assert_eq!((factor(0.0, 15e-9, false), factor(0.0, 100e-9, false)), (1, 3));
        assert_eq!(factor(0.0, 100e-9, true), 2);
        // Half of 18 ms is left after a fixed part of 10 ms or a second: an eleventh takes longer.
        assert_eq!((factor(0.010, 100e-9, false), factor(1.0, 100e-9, false)), (4, 4));
        // Not below 96 pixels a side: 1024 / 10 is 102, of a picture of 90 all.
        assert_eq!(factor(0.0, 1.0, false), 10);
        assert_eq!(PassTime::first_factor(Some(PassTime { fixed: 0.0, per_pixel: 1.0 }), [90, 60], false), 1);
        assert_eq!(PassTime::first_factor(None, SIZE, false), DEFAULT_FACTOR);
    }

    /// Another process that takes half of the time changes the fixed part alone, and passes of any size give the same time
    /// of a pixel.
    #[test]
    fn times_are_those_of_threads() {
        let ms = Duration::from_millis;
        let (alone, beside) =
            (PassTime::new(1000, ms(4), Some(ms(3))), PassTime::new(1000, ms(8), Some(ms(3))));
        assert_eq!((alone.per_pixel, beside.per_pixel), (3e-6, 3e-6));
        assert!((alone.fixed - 0.001).abs() < 1e-12 && (beside.fixed - 0.005).abs() < 1e-12);
        assert_eq!(PassTime::new(1000, ms(4), None), PassTime { fixed: 0.0, per_pixel: 4e-6 });
        let damped =
            PassTime { fixed: 1.0, per_pixel: 4.0 }.damped(Some(PassTime { fixed: 9.0, per_pixel: 1.0 }));
        assert_eq!(damped, PassTime { fixed: 3.0, per_pixel: 2.0 });
    }

    #[test]
    fn passes_end_with_what_was_asked_for() {
        use Pass::{Coarse, Samples};
        assert_eq!(passes(8, 1), [Coarse(8), Coarse(4), Coarse(2), Samples(1)]);
        assert_eq!(passes(5, 1), [Coarse(5), Coarse(3), Coarse(2), Samples(1)]);
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
