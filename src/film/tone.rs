//! Display transform: exposure and tone map, which take linear light to the displayed range before the sRGB transfer
//! function and the rounding to 8 bits. Films of floating-point pixels, and so OpenEXR, are unaffected.

mod curves;
mod meter;

pub use meter::{METER_BYTES, auto_exposure, clipped_share, luminance, white_exposure};

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::ColourPipeline;
use super::colour::{quantise, srgb_encode};

/// Largest exposure in EV, of either sign. 2^64 spans the range of radiance in any unit.
pub const MAX_EXPOSURE: f64 = 64.0;

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

impl ToneMap {
    /// All tone maps.
    pub const ALL: [Self; 4] = [ToneMap::None, ToneMap::PbrNeutral, ToneMap::Agx, ToneMap::Filmic];

    /// The name as typed by users.
    pub fn name(self) -> &'static str {
        match self {
            ToneMap::None => "none",
            ToneMap::PbrNeutral => "pbr-neutral",
            ToneMap::Agx => "agx",
            ToneMap::Filmic => "filmic",
        }
    }
}

/// Exposure as typed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "ExposureValue", into = "ExposureValue")]
pub enum Exposure {
    /// Light is multiplied by 2^EV.
    Ev(f64),
    /// Computed from the picture ([`auto_exposure`]).
    Auto,
}

/// Exposure in EV, -64 to 64, or "auto".
#[derive(Serialize, Deserialize, schemars::JsonSchema)]
#[serde(untagged, expecting = "expected a number of EV or \"auto\"")]
pub enum ExposureValue {
    /// EV.
    Ev(f64),
    /// From the picture.
    Named(AutoName),
}

/// The name of the exposure that is computed from the picture.
#[derive(Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum AutoName {
    /// From the picture.
    Auto,
}

const EXPOSURE_HINT: &str = "give a number of EV from -64 to 64, or \"auto\"";

impl TryFrom<ExposureValue> for Exposure {
    type Error = String;

    fn try_from(value: ExposureValue) -> Result<Self, String> {
        match value {
            ExposureValue::Named(AutoName::Auto) => Ok(Exposure::Auto),
            ExposureValue::Ev(ev) if ev.abs() <= MAX_EXPOSURE => Ok(Exposure::Ev(ev)),
            ExposureValue::Ev(ev) => Err(format!("the exposure is {ev}; {EXPOSURE_HINT}")),
        }
    }
}

impl From<Exposure> for ExposureValue {
    fn from(exposure: Exposure) -> Self {
        match exposure {
            Exposure::Ev(ev) => ExposureValue::Ev(ev),
            Exposure::Auto => ExposureValue::Named(AutoName::Auto),
        }
    }
}

impl std::str::FromStr for Exposure {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.trim() {
            "auto" => Ok(Exposure::Auto),
            number => number
                .parse()
                .map_err(|_| EXPOSURE_HINT.to_owned())
                .and_then(|ev| Exposure::try_from(ExposureValue::Ev(ev))),
        }
    }
}

impl std::fmt::Display for Exposure {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Exposure::Ev(ev) => ev.fmt(f),
            Exposure::Auto => f.write_str("auto"),
        }
    }
}

/// Exposure and tone map as set by a scene or a user. `None` is unset; unset values have no effect.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DisplaySettings {
    /// Exposure.
    pub exposure: Option<Exposure>,
    /// Tone map.
    pub tone_map: Option<ToneMap>,
}

impl DisplaySettings {
    /// Settings that override any others with no effect.
    pub const OFF: Self = DisplaySettings { exposure: Some(Exposure::Ev(0.0)), tone_map: Some(ToneMap::None) };

    /// These settings, and those of `other` where these are unset.
    pub fn or(self, other: Self) -> Self {
        DisplaySettings {
            exposure: self.exposure.or(other.exposure),
            tone_map: self.tone_map.or(other.tone_map),
        }
    }

    /// The exposure, if it changes values.
    pub fn exposure(self) -> Option<Exposure> {
        self.exposure.filter(|&exposure| exposure != Exposure::Ev(0.0))
    }

    /// The tone map, if it changes values.
    pub fn tone_map(self) -> Option<ToneMap> {
        self.tone_map.filter(|&map| map != ToneMap::None)
    }

    /// Whether nothing changes values.
    pub fn is_identity(self) -> bool {
        self.exposure().is_none() && self.tone_map().is_none()
    }

    /// Whether the exposure is computed from the picture.
    pub fn is_auto(self) -> bool {
        self.exposure == Some(Exposure::Auto)
    }

    /// The transform, with an exposure of `auto` EV if it is computed from the picture.
    pub fn transform(self, auto: f64) -> DisplayTransform {
        let ev = match self.exposure {
            None => 0.0,
            Some(Exposure::Ev(ev)) => ev,
            Some(Exposure::Auto) => auto,
        };
        DisplayTransform::new(ev, self.tone_map.unwrap_or_default())
    }

    /// The transform as far as it is known before the picture is: `auto` counts as 0 EV. Adaptive sampling uses it.
    pub fn known(self) -> DisplayTransform {
        self.transform(0.0)
    }

    /// The transform of a picture with these colours. Only `auto` reads them.
    pub fn transform_of(self, colours: impl Iterator<Item = [f32; 3]>) -> DisplayTransform {
        self.transform(if self.is_auto() { auto_exposure(colours) } else { 0.0 })
    }

    /// The settings as they apply in `pipeline`: none unless it is linear.
    pub fn in_pipeline(self, pipeline: ColourPipeline) -> Self {
        if pipeline == ColourPipeline::Linear { self } else { DisplaySettings::OFF }
    }
}

/// Exposure and tone map with all values known. The default changes nothing. Others are for the linear pipeline only.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DisplayTransform {
    ev: f64,
    /// 2^EV.
    scale: f64,
    tone_map: ToneMap,
}

impl Default for DisplayTransform {
    #[inline(always)]
    fn default() -> Self {
        DisplayTransform { ev: 0.0, scale: 1.0, tone_map: ToneMap::None }
    }
}

/// Bound of exposed values: its square is finite, and every curve is at its end.
const MAX_LIGHT: f64 = 1e100;

impl DisplayTransform {
    /// The transform for an exposure in EV, at most [`MAX_EXPOSURE`] of either sign.
    pub fn new(ev: f64, tone_map: ToneMap) -> Self {
        DisplayTransform { ev, scale: ev.exp2(), tone_map }
    }

    /// The tone map.
    pub fn tone_map(self) -> ToneMap {
        self.tone_map
    }

    /// The exposure in EV.
    pub fn ev(self) -> f64 {
        self.ev
    }

    /// Whether it changes nothing.
    #[inline(always)]
    pub fn is_identity(self) -> bool {
        self.scale == 1.0 && self.tone_map == ToneMap::None
    }

    /// Displayed linear light: 0 to 1 with a tone map, else the exposed colour, not clamped. With a tone map, negative
    /// channels and NaN count as 0.
    pub fn apply(self, colour: DVec3) -> DVec3 {
        let exposed = colour * self.scale;
        let held = || DVec3::from(exposed.to_array().map(|c| c.max(0.0).min(MAX_LIGHT)));
        match self.tone_map {
            ToneMap::None => exposed,
            ToneMap::PbrNeutral => curves::pbr_neutral(held()),
            ToneMap::Agx => curves::agx(held()),
            ToneMap::Filmic => curves::filmic(held()),
        }
    }

    /// Display values of a colour in the encoding of `pipeline`, 0 to 1, before quantisation.
    pub fn displayed(self, pipeline: ColourPipeline, colour: DVec3) -> DVec3 {
        let colour = if self.is_identity() { colour } else { self.apply(colour) };
        DVec3::from(colour.to_array().map(|c| pipeline.displayed(c)))
    }

    /// The 8-bit display values of a film value.
    #[inline(always)]
    pub fn encode(self, pipeline: ColourPipeline, colour: [f32; 3]) -> [u8; 3] {
        if self.is_identity() { pipeline.encode(colour) } else { self.encode_mapped(colour) }
    }

    /// [`DisplayTransform::encode`] in the linear pipeline.
    pub(super) fn encode_mapped(self, colour: [f32; 3]) -> [u8; 3] {
        self.apply(DVec3::from(colour.map(f64::from))).to_array().map(|c| quantise(srgb_encode(c)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let identity = DisplaySettings { exposure: Some(Exposure::Ev(0.0)), tone_map: Some(ToneMap::None) };
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
                    let colour = transform.displayed(ColourPipeline::Linear, DVec3::new(a.into(), b.into(), 0.5));
                    let is_in = |c: f64| (0.0..=1.0).contains(&c) || (map == ToneMap::None && c.is_nan());
                    assert!(colour.to_array().into_iter().all(is_in), "{map:?} {a} {b}: {colour}");
                }
            }
            // Infinite light is white, not NaN.
            let white = DisplayTransform::new(0.0, map).encode(ColourPipeline::Linear, [f32::INFINITY; 3]);
            assert!(white == [255; 3], "{map:?}: {white:?}");
        }
    }

    #[test]
    fn exposures_are_read_as_typed() {
        assert_eq!("auto".parse(), Ok(Exposure::Auto));
        assert_eq!("-9.3".parse(), Ok(Exposure::Ev(-9.3)));
        for bad in ["", "bright", "nan", "inf", "64.1", "-65"] {
            assert!(bad.parse::<Exposure>().is_err(), "{bad}");
        }
        for exposure in [Exposure::Auto, Exposure::Ev(0.1 + 0.2), Exposure::Ev(-64.0)] {
            assert_eq!(exposure.to_string().parse(), Ok(exposure));
        }
    }
}
