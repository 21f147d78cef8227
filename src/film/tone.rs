//! Display transform: exposure and tone map, which take linear light to the displayed range before the sRGB transfer
//! function, and the rounding to integers. Films of floating-point pixels, and so OpenEXR, are unaffected.

mod curves;
mod meter;
mod settings;

pub use meter::{auto_exposure, clipped_share, mean_exposure, white_exposure, white_mean_exposure};
pub use settings::{DisplaySettings, Exposure, MAX_EXPOSURE};

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::ColourPipeline;
use super::colour::srgb_encode;
use super::rounding::{Level, Rounding, quantise};

/// Tone map: a curve from scene-linear light (Rec. 709 primaries) to displayed linear light, 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ToneMap {
    /// None: values above 1 are clipped.
    #[default]
    None,
    /// Khronos PBR Neutral: colours below 0.8 keep their hue and saturation.
    PbrNeutral,
    /// AgX, base look: low contrast, highlights fade to white.
    Agx,
    /// Filmic S-curve per channel, fitted to ACES.
    Filmic,
}

names!(ToneMap { None = "none", PbrNeutral = "pbr-neutral", Agx = "agx", Filmic = "filmic" });

/// Exposure and tone map with all values known, and how display values are rounded. The default changes no value. Other
/// exposures and tone maps are for the linear pipeline only.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DisplayTransform {
    ev: f64,
    /// 2^EV.
    scale: f64,
    tone_map: ToneMap,
    rounding: Rounding,
}

impl Default for DisplayTransform {
    #[inline(always)]
    fn default() -> Self {
        DisplayTransform { ev: 0.0, scale: 1.0, tone_map: ToneMap::None, rounding: Rounding::default() }
    }
}

/// Scale of [`DisplayTransform::keep`].
const KEPT: f64 = (1_u128 << 100) as f64;

/// Bound of exposed values: its square is finite, and every curve is at its end.
const MAX_LIGHT: f64 = 1e100;

impl DisplayTransform {
    /// The transform for an exposure in EV, at most [`MAX_EXPOSURE`] of either sign.
    pub fn new(ev: f64, tone_map: ToneMap) -> Self {
        DisplayTransform { ev, scale: ev.exp2(), tone_map, rounding: Rounding::default() }
    }

    /// The same transform with another rounding.
    pub fn rounded(self, rounding: Rounding) -> Self {
        DisplayTransform { rounding, ..self }
    }

    /// How display values are rounded.
    #[inline(always)]
    pub fn rounding(self) -> Rounding {
        self.rounding
    }

    /// The tone map.
    pub fn tone_map(self) -> ToneMap {
        self.tone_map
    }

    /// The exposure in EV.
    pub fn ev(self) -> f64 {
        self.ev
    }

    /// The light that is displayed as white without a tone map.
    pub fn white(self) -> f64 {
        self.scale.recip()
    }

    /// Whether it changes no value before rounding.
    #[inline(always)]
    pub fn is_identity(self) -> bool {
        self.scale == 1.0 && self.tone_map == ToneMap::None
    }

    /// Displayed linear light: 0 to 1 with a tone map, else the exposed colour, not clamped. With a tone map, negative
    /// channels and NaN count as 0.
    pub fn apply(self, colour: DVec3) -> DVec3 {
        if let Some(displayed) = kept(colour) {
            return displayed;
        }
        let exposed = colour * self.scale;
        // NaN is not above 0.
        let held = || DVec3::from(exposed.to_array().map(|c| if c > 0.0 { c.min(MAX_LIGHT) } else { 0.0 }));
        match self.tone_map {
            ToneMap::None => exposed,
            ToneMap::PbrNeutral => curves::pbr_neutral(held()),
            ToneMap::Agx => curves::agx(held()),
            ToneMap::Filmic => curves::filmic(held()),
        }
    }

    /// The light that is displayed as `displayed`, a displayed linear colour: the inverse of [`DisplayTransform::apply`].
    /// Of colours that the tone map cannot display, light near them. `None` for tone maps without a closed inverse.
    pub fn light_of(self, displayed: DVec3) -> Option<DVec3> {
        match self.tone_map {
            ToneMap::None => Some(displayed / self.scale),
            ToneMap::PbrNeutral => Some(curves::pbr_neutral_inverse(displayed) / self.scale),
            ToneMap::Agx | ToneMap::Filmic => None,
        }
    }

    /// Light that is displayed as a surface before a backdrop: `light` of the surface times the part that it covers, and
    /// the displayed linear colour of the backdrop. With tone maps without a closed inverse the backdrop is light, too.
    pub fn over(self, light: DVec3, coverage: f64, backdrop: DVec3) -> DVec3 {
        let behind = backdrop * (1.0 - coverage);
        self.light_of(self.composite(light, coverage, behind)).unwrap_or(light + behind)
    }

    /// Displayed linear colour of a pixel with lit surfaces of this light and coverage, and `displayed`, which is
    /// multiplied by its own coverage.
    pub fn composite(self, light: DVec3, coverage: f64, displayed: DVec3) -> DVec3 {
        let own = if coverage > 0.0 { self.apply(light / coverage) * coverage } else { DVec3::ZERO };
        own + displayed
    }

    /// Film value that [`DisplayTransform::apply`] maps to the displayed linear colour `displayed`, 0 to 1, even
    /// outside the gamut of the tone map: -2^100 (1 + `displayed`), which is no radiance and keeps 23 bits.
    pub fn keep(displayed: DVec3) -> [f32; 3] {
        (-KEPT * (1.0 + displayed.clamp(DVec3::ZERO, DVec3::ONE))).as_vec3().to_array()
    }

    /// Whether a film value is one of [`DisplayTransform::keep`].
    pub fn is_kept(pixel: [f32; 3]) -> bool {
        kept(DVec3::from(pixel.map(f64::from))).is_some()
    }

    /// Weighted mean of two film values; `share` is the weight of the first. Values of [`DisplayTransform::keep`] are
    /// averaged as displayed.
    pub fn mean(self, first: [f32; 3], second: [f32; 3], share: f64) -> [f32; 3] {
        let of = |a: DVec3, b: DVec3| a * share + b * (1.0 - share);
        let [a, b] = [first, second].map(|pixel| DVec3::from(pixel.map(f64::from)));
        if Self::is_kept(first) || Self::is_kept(second) {
            return Self::keep(of(self.apply(a), self.apply(b)));
        }
        of(a, b).as_vec3().to_array()
    }

    /// Display values of a colour in the encoding of `pipeline`, 0 to 1, before quantisation.
    pub fn displayed(self, pipeline: ColourPipeline, colour: DVec3) -> DVec3 {
        let colour = if self.is_identity() { colour } else { self.apply(colour) };
        DVec3::from(colour.to_array().map(|c| pipeline.displayed(c)))
    }

    /// The 8-bit display values of a film value, rounded to the nearest.
    #[inline(always)]
    pub fn encode(self, pipeline: ColourPipeline, colour: [f32; 3]) -> [u8; 3] {
        if self.is_identity() { pipeline.encode(colour) } else { self.encode_mapped(colour) }
    }

    /// [`DisplayTransform::encode`] in the linear pipeline.
    pub(super) fn encode_mapped<L: Level>(self, colour: [f32; 3]) -> [L; 3] {
        self.apply(DVec3::from(colour.map(f64::from))).to_array().map(|c| quantise(srgb_encode(c)))
    }
}

/// The displayed colour of a value of [`DisplayTransform::keep`]; `None` for light.
#[inline]
fn kept(value: DVec3) -> Option<DVec3> {
    (-2.0 * KEPT..=-KEPT).contains(&value.x).then(|| value / -KEPT - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// 8-bit colours, also outside the gamut of the tone map, and their means: 23 bits suffice.
    #[test]
    fn kept_colours_are_displayed_unchanged() {
        for (map, ev) in ToneMap::ALL.into_iter().zip([1.0, -3.0, 5.5, 0.25]) {
            let transform = DisplayTransform::new(ev, map);
            for value in 0..=255u8 {
                let colour = [value, 255 - value, 0];
                let linear =
                    DVec3::from(colour.map(|c| crate::film::colour::srgb_decode(f64::from(c) / 255.0)));
                let pixel = DisplayTransform::keep(linear);
                assert!(DisplayTransform::is_kept(pixel));
                assert_eq!(transform.encode(ColourPipeline::Linear, pixel), colour, "{map:?}");
                let half = transform.mean(pixel, [0.0; 3], 0.5);
                assert!(
                    (transform.apply(Vec3::from(half).as_dvec3()) - linear / 2.0).abs().max_element() < 1e-6
                );
            }
        }
        assert_eq!(DisplayTransform::default().mean([1.0; 3], [0.0; 3], 0.25), [0.25; 3]);
        assert!(!DisplayTransform::is_kept([f32::MIN; 3]) && !DisplayTransform::is_kept([-1e20; 3]));
    }

    #[test]
    fn one_ev_is_a_factor_of_two() {
        let colour = DVec3::new(0.1, 0.7, 13.0);
        assert_eq!(DisplayTransform::new(1.0, ToneMap::None).apply(colour), 2.0 * colour);
        assert_eq!(DisplayTransform::new(-3.0, ToneMap::None).apply(colour), colour / 8.0);
        // The exposure comes before the tone map.
        for map in ToneMap::ALL {
            let (one, none) = (DisplayTransform::new(1.0, map), DisplayTransform::new(0.0, map));
            assert_eq!(one.apply(colour), none.apply(2.0 * colour));
        }
    }

    #[test]
    fn without_exposure_and_tone_map_values_are_those_of_the_pipeline() {
        let identity = DisplaySettings::OFF;
        assert!(identity.is_identity() && identity.transform(9.0).is_identity());
        for value in [-1.0, 0.0, 0.2, 0.7, 4.0, f32::NAN, f32::INFINITY] {
            for pipeline in [ColourPipeline::Display, ColourPipeline::Linear] {
                let encoded = identity.transform(9.0).encode(pipeline, [value; 3]);
                assert_eq!(encoded, pipeline.encode([value; 3]));
            }
        }
    }

    #[test]
    fn every_float_is_mapped_to_0_to_1() {
        let values = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, -1e-3, 0.0, 1e-45];
        for (map, ev) in ToneMap::ALL.into_iter().zip([64.0, -64.0, 0.0, 5.5]) {
            for a in values {
                for b in values {
                    let transform = DisplayTransform::new(ev, map);
                    let colour =
                        transform.displayed(ColourPipeline::Linear, DVec3::new(a.into(), b.into(), 0.5));
                    let is_in = |c: f64| (0.0..=1.0).contains(&c) || (map == ToneMap::None && c.is_nan());
                    assert!(colour.to_array().into_iter().all(is_in), "{map:?} {a} {b}: {colour}");
                }
            }
            // Infinite light is white, not NaN.
            let white = DisplayTransform::new(0.0, map).encode(ColourPipeline::Linear, [f32::INFINITY; 3]);
            assert!(white == [255; 3], "{map:?}: {white:?}");
        }
    }
}
