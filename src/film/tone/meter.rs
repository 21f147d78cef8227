//! Measures of a picture in linear light: exposures computed from luminance, and the share of clipped pixels.

use glam::DVec3;

use super::{DisplayTransform, MAX_EXPOSURE, ToneMap};
use crate::film::rounding::Level;
use crate::film::{ColourPipeline, Film};

fn luminance(colour: [f32; 3]) -> f64 {
    crate::film::colour::luminance(DVec3::from(colour.map(f64::from)))
}

/// The exposure in EV for a picture, from its luminance: Erik Reinhard, "Parameter Estimation for Photographic Tone
/// Reproduction", Journal of Graphics Tools 7(1), 2002. The log-average luminance is taken to the key
/// 0.18 * 4^((2 log2 avg - log2 min - log2 max) / (log2 max - log2 min)), where min and max leave out the darkest and
/// the brightest 1 % of pixels: 0.18 where the average is midway, down to 0.045 for a few bright things before a dark
/// background, up to 0.72 for the opposite. The average takes luminances beyond min and max as these, since they are of
/// noise.
///
/// Pixels without light, or with light that is not finite, do not count. Rounded to 1/100 EV, so that the same exposure
/// can be typed. 0 for a picture without light.
pub fn auto_exposure(colours: impl Iterator<Item = [f32; 3]>) -> f64 {
    let lit = colours.map(luminance).filter(|&l| l > 0.0 && l.is_finite());
    let mut logs: Vec<f64> = lit.map(f64::log2).collect();
    if logs.is_empty() {
        return 0.0;
    }
    let (count, end) = (logs.len(), logs.len() / 100);
    let mut ranked = |rank: usize| *logs.select_nth_unstable_by(rank, f64::total_cmp).1;
    let min = ranked(end);
    let max = ranked(count - 1 - end);
    let average = logs.iter().map(|log| log.clamp(min, max)).sum::<f64>() / count as f64;
    let bias = if max > min { (2.0 * average - min - max) / (max - min) } else { 0.0 };
    rounded(0.18f64.log2() + 2.0 * bias - average, 100.0)
}

/// The exposure in EV at which the 99th percentile of luminance (nearest rank, all pixels) becomes 1, rounded down to
/// 1/10 EV. `None` if that percentile has no light or is not finite.
pub fn white_exposure(colours: impl Iterator<Item = [f32; 3]>) -> Option<f64> {
    let mut all: Vec<f64> = colours.map(luminance).collect();
    let rank = (all.len() * 99).div_ceil(100).checked_sub(1)?;
    let (_, &mut percentile, _) = all.select_nth_unstable_by(rank, f64::total_cmp);
    (percentile > 0.0 && percentile.is_finite()).then(|| (-percentile.log2() * 10.0).floor() / 10.0)
}

/// The mean display value of [`mean_exposure`]: about what `pbr-neutral` shows of light of 0.18; and the least, which keeps bright
/// pixels below white.
const MEAN: f64 = 0.42;
const LEAST_MEAN: f64 = 0.25;

/// The exposure in EV at which a tone map shows the lit pixels of a picture with a mean display value of 0.42, or darker, down
/// to 0.25, where the luminance of more than 5 % of them would exceed 1. Rounded to 1/100 EV. The mean rises with the exposure,
/// so it is found by bisection. 0 where less than 5 % of the pixels are lit.
pub fn mean_exposure(colours: &[[f32; 3]], tone_map: ToneMap) -> f64 {
    let lit = |&&colour: &&[f32; 3]| luminance(colour) > 0.0 && luminance(colour).is_finite();
    let lit: Vec<[f32; 3]> = colours.iter().filter(lit).copied().collect();
    if lit.is_empty() || 20 * lit.len() < colours.len() {
        return 0.0;
    }
    let mean = |ev: f64| {
        let shown = DisplayTransform::new(ev, tone_map);
        let of = |colour: &[f32; 3]| {
            let colour = DVec3::from(colour.map(f64::from));
            shown.displayed(ColourPipeline::Linear, colour).clamp(DVec3::ZERO, DVec3::ONE).element_sum() / 3.0
        };
        lit.iter().map(of).sum::<f64>() / lit.len() as f64
    };
    let exposure_of = |wanted: f64| {
        let (mut low, mut high) = (-MAX_EXPOSURE, MAX_EXPOSURE);
        while high - low > 1e-3 {
            let middle = 0.5 * (low + high);
            if mean(middle) < wanted { low = middle } else { high = middle }
        }
        low
    };
    let unclipped = unclipped_exposure(&lit);
    rounded(exposure_of(MEAN).min(exposure_of(LEAST_MEAN).max(unclipped)), 100.0)
}

/// [`mean_exposure`] under light that shows white surfaces white: below 0 only as far as 5 % of the lit pixels would be
/// brighter than white, so that white objects do not become grey.
pub fn white_mean_exposure(colours: &[[f32; 3]], tone_map: ToneMap) -> f64 {
    let lit = |&&colour: &&[f32; 3]| luminance(colour) > 0.0 && luminance(colour).is_finite();
    let lit: Vec<[f32; 3]> = colours.iter().filter(lit).copied().collect();
    let mean = mean_exposure(colours, tone_map);
    if lit.is_empty() { mean } else { mean.max(rounded(unclipped_exposure(&lit).min(0.0), 100.0)) }
}

/// The exposure in EV at which 5 % of these colours, at least one, are brighter than white.
fn unclipped_exposure(lit: &[[f32; 3]]) -> f64 {
    let mut luminances: Vec<f64> = lit.iter().copied().map(luminance).collect();
    let rank = (luminances.len() * 95).div_ceil(100) - 1;
    let bright = *luminances.select_nth_unstable_by(rank, f64::total_cmp).1;
    -bright.log2()
}

/// The share of pixels, 0 to 1, with a channel at the maximum.
pub fn clipped_share<L: Level + Into<f64>>(film: &Film<[L; 3]>) -> f64 {
    let is_clipped = |pixel: &&[L; 3]| pixel.iter().any(|&channel| channel.into() == L::MAX);
    let clipped = film.stored().iter().filter(is_clipped).count();
    clipped as f64 / film.stored().len().max(1) as f64
}

/// Rounds to 1/`steps`, without a negative zero, and holds within the range of exposures.
fn rounded(ev: f64, steps: f64) -> f64 {
    (ev * steps).round().clamp(-MAX_EXPOSURE * steps, MAX_EXPOSURE * steps) / steps + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Film, Window};

    #[test]
    fn the_automatic_exposure_shows_the_log_average_as_its_key() {
        // Uniform 0.36 is one stop above 0.18.
        assert_eq!(auto_exposure(std::iter::repeat_n([0.36; 3], 50)), -1.0);
        // Half 0.09, half 0.36: the log-average is 0.18, midway.
        assert_eq!(auto_exposure([[0.09; 3], [0.36; 3]].into_iter()), 0.0);
        // Three times 0.09, once 0.36 = 0.09 * 2^2: the log-average is 0.09 * 2^0.5, a quarter of the way up, so the key
        // is 0.18 * 4^((2 * 0.5 - 0 - 2) / 2) = 0.09, and the exposure log2(0.09) - log2(0.09 * 2^0.5).
        assert_eq!(auto_exposure([[0.09; 3], [0.09; 3], [0.36; 3], [0.09; 3]].into_iter()), -0.5);
        // Of 200 pixels the two brightest and the two darkest count as the others, whatever they are.
        for outliers in [[0.18; 2], [1e9, 1e-9], [0.18, 1e-30], [1e4, 0.18]] {
            let sparks = (0..200).map(|i| [if i % 100 < 2 { outliers[i % 2] } else { 0.18 }; 3]);
            assert_eq!(auto_exposure(sparks), 0.0);
        }
        // Green 1 has the luminance 0.7152: log2(0.18 / 0.7152) = -1.99036.
        assert_eq!(auto_exposure([[0.0, 1.0, 0.0]].into_iter()), -1.99);
        // Black and non-finite pixels do not count.
        let mixed = [[0.36; 3], [0.0; 3], [f32::NAN; 3], [f32::INFINITY; 3], [-1.0; 3]];
        assert_eq!(auto_exposure(mixed.into_iter()), -1.0);
        assert_eq!(auto_exposure(std::iter::repeat_n([0.0; 3], 9)), 0.0);
    }

    /// Grey of 0.42 is ((0.42 + 0.055) / 1.055)^2.4 = 0.14731 in linear light: light of half is one stop below. Black does
    /// not count.
    #[test]
    fn the_mean_display_value_is_that_of_a_grey() {
        let light = ((0.42f64 + 0.055) / 1.055).powf(2.4);
        let grey = vec![[(0.5 * light) as f32; 3], [0.0; 3]];
        assert_eq!(mean_exposure(&grey, ToneMap::None), 1.0);
        // pbr-neutral takes 0.04 off.
        assert_eq!(mean_exposure(&[[(light + 0.04) as f32; 3]], ToneMap::PbrNeutral), 0.0);
        assert_eq!(mean_exposure(&[[0.0; 3]], ToneMap::None), 0.0);
        // Of a fifth at 2 and the rest at 0.01, the fifth is shown as white at -1 EV. Then the mean is that of 1 and, of
        // 0.005, 12.92 * 0.005 = 0.0646, or by the power 1.055 * 0.005^(1/2.4) - 0.055 = 0.061: 0.249, so it is 0.25 that
        // decides, little above.
        let bright: Vec<[f32; 3]> = [2.0, 0.01, 0.01, 0.01, 0.01].map(|l| [l; 3]).into();
        let ev = mean_exposure(&bright, ToneMap::None);
        assert!((-1.0..=-0.9).contains(&ev), "{ev}");
        // Of 2 % above white nothing is kept, and where next to nothing is lit.
        let mut few = vec![[(0.5 * light) as f32; 3]; 98];
        few.extend([[50.0; 3]; 2]);
        assert!(mean_exposure(&few, ToneMap::None) > 0.9);
        let dark: Vec<[f32; 3]> = (0..100).map(|i| [f32::from(u8::from(i < 4)); 3]).collect();
        assert_eq!(mean_exposure(&dark, ToneMap::None), 0.0);
    }

    /// White of 1.25 becomes 1, log2(1.25) = 0.32 lower, where the mean alone would take it to grey. Dark objects are as by
    /// the mean.
    #[test]
    fn white_objects_stay_white_under_a_sky() {
        assert_eq!(white_mean_exposure(&[[1.25; 3]], ToneMap::None), -0.32);
        assert!(mean_exposure(&[[1.25; 3]], ToneMap::None) < -2.0);
        let dark = [[0.01; 3]];
        assert_eq!(white_mean_exposure(&dark, ToneMap::None), mean_exposure(&dark, ToneMap::None));
        assert_eq!(white_mean_exposure(&[[0.0; 3]], ToneMap::None), 0.0);
    }

    #[test]
    fn the_exposure_for_white_leaves_one_percent_above() {
        // 200 pixels of luminance 1 to 200: rank 198 has 198. log2(198) = 7.629.
        let ramp = (1..=200u16).map(|i| [f32::from(i); 3]);
        assert_eq!(white_exposure(ramp), Some(-7.7));
        assert_eq!(white_exposure(std::iter::repeat_n([0.0; 3], 5)), None);
        assert_eq!(white_exposure(std::iter::empty()), None);
    }

    #[test]
    fn pixels_with_a_full_channel_are_clipped() {
        let window = Window { x: 0, y: 0, width: 4, height: 1 };
        let film = Film::from_rows(window, &[[255u8, 0, 0], [254; 3], [0; 3], [255; 3]]).unwrap();
        assert_eq!(clipped_share(&film), 0.5);
    }
}
