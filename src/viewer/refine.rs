//! Progressive refinement: the sequence of passes of a picture.
//!
//! The resolution of the first pass is chosen so that it meets a time limit; the last pass has full size and all
//! samples. Coarse passes render pixels of `factor` by `factor` pixels of the picture. With factors that decrease by 4,
//! all passes but the first cost a fifteenth of a pass of full size.

/// Time limit of the first pass in seconds; the interface waits for it about as long.
const FIRST_PASS_SECONDS: f64 = 0.008;

/// Time limit of the first pass in seconds during playback, where frames are not refined: 30 frames per second.
const PLAYBACK_PASS_SECONDS: f64 = 0.03;

/// Maximum factor of a coarse pass.
const MAX_FACTOR: u32 = 32;

/// Number of passes for adaptive sampling, each of an equal part of the tiles.
pub(crate) const BATCHES: usize = 8;

/// Factor of the first pass before any render time was measured.
const DEFAULT_FACTOR: u32 = 8;

/// A pass over a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pass {
    /// One sample at the centre of each pixel, at a resolution reduced by this factor on each axis.
    Coarse(u32),
    /// A range of sample numbers of every pixel, the end excluded.
    Samples(u32, u32),
    /// One sample at the centre of each pixel.
    Whole,
    /// All samples of the tiles whose index has this remainder by [`BATCHES`].
    Tiles(usize),
}

/// Sampling of a picture, which determines its passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SamplingKind {
    /// One sample at the pixel centre.
    Centres,
    /// A fixed number of samples per pixel.
    Samples(u32),
    /// All samples of each tile at once: adaptive sampling, and pictures with colours that bypass exposure and tone map. A
    /// pixel with both kinds of colour is limited to the display's range, so the mean of parts is not the whole.
    Tiles,
}

/// Factor of the first pass of a picture, from the render time per pixel.
pub(crate) fn first_factor(pixels: usize, seconds_per_pixel: Option<f64>, is_playing: bool) -> u32 {
    let limit = if is_playing { PLAYBACK_PASS_SECONDS } else { FIRST_PASS_SECONDS };
    let Some(seconds) = seconds_per_pixel else { return DEFAULT_FACTOR };
    let factor = (seconds * pixels as f64 / limit).sqrt().ceil();
    (factor as u32).clamp(1, MAX_FACTOR)
}

/// The passes of a picture, the first of them with factor `first`.
pub(crate) fn passes(first: u32, kind: SamplingKind) -> Vec<Pass> {
    let mut passes = Vec::new();
    let mut factor = first;
    while factor > 1 {
        passes.push(Pass::Coarse(factor));
        factor = if factor > 4 { factor / 4 } else { 1 };
    }
    match kind {
        SamplingKind::Centres => passes.push(Pass::Whole),
        SamplingKind::Tiles => {
            passes.push(Pass::Coarse(1));
            passes.extend((0..BATCHES).map(Pass::Tiles));
        }
        SamplingKind::Samples(samples) => {
            let (mut from, mut to) = (0, 1);
            while from < samples {
                passes.push(Pass::Samples(from, to.min(samples)));
                (from, to) = (to, to.saturating_mul(2));
            }
        }
    }
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
        use Pass::{Coarse, Samples, Tiles, Whole};
        assert_eq!(passes(8, SamplingKind::Centres), [Coarse(8), Coarse(2), Whole]);
        assert_eq!(passes(16, SamplingKind::Centres), [Coarse(16), Coarse(4), Whole]);
        assert_eq!(passes(1, SamplingKind::Centres), [Whole]);
        assert_eq!(
            passes(1, SamplingKind::Samples(6)),
            [Samples(0, 1), Samples(1, 2), Samples(2, 4), Samples(4, 6)]
        );
        let adaptive = passes(2, SamplingKind::Tiles);
        assert_eq!(adaptive[..3], [Coarse(2), Coarse(1), Tiles(0)]);
        assert_eq!(adaptive.last(), Some(&Tiles(BATCHES - 1)));
        for samples in [1, 2, 3, 64, 100, 65_536] {
            let mut next = 0;
            for pass in passes(1, SamplingKind::Samples(samples)) {
                let Samples(from, to) = pass else { panic!("{pass:?}") };
                assert!(from == next && to > from);
                next = to;
            }
            assert_eq!(next, samples);
        }
    }
}
