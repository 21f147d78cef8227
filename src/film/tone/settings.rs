//! Exposure, tone map and rounding as set by scenes and users, before an automatic exposure is known.

use serde::{Deserialize, Deserializer, Serialize};

use super::{DisplayTransform, ToneMap};
use crate::film::ColourPipeline;
use crate::film::rounding::Rounding;

/// Largest exposure in EV, of either sign. 2^64 spans the range of radiance in any unit.
pub const MAX_EXPOSURE: f64 = 64.0;

/// Exposure as typed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase", expecting = "expected EV from -64 to 64, or \"auto\"")]
pub enum Exposure {
    /// Computed from a small render of the picture ([`super::auto_exposure`]).
    Auto,
    /// Light is multiplied by 2^EV.
    #[serde(untagged, deserialize_with = "ev")]
    Ev(f64),
}

const EXPOSURE_HINT: &str = "give a number of EV from -64 to 64, or \"auto\"";

fn in_range(ev: f64) -> Result<f64, &'static str> {
    if ev.abs() <= MAX_EXPOSURE { Ok(ev) } else { Err(EXPOSURE_HINT) }
}

fn ev<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    in_range(f64::deserialize(deserializer)?).map_err(serde::de::Error::custom)
}

impl std::str::FromStr for Exposure {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.trim() {
            "auto" => Ok(Exposure::Auto),
            number => Ok(Exposure::Ev(in_range(number.parse().map_err(|_| EXPOSURE_HINT)?)?)),
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

/// Exposure, tone map and rounding as set by a scene or a user. `None` is unset; unset values have no effect.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DisplaySettings {
    /// Exposure.
    pub exposure: Option<Exposure>,
    /// Tone map.
    pub tone_map: Option<ToneMap>,
    /// How display values are rounded.
    pub rounding: Rounding,
}

impl DisplaySettings {
    /// Settings that override any others with no effect.
    pub const OFF: Self = DisplaySettings {
        exposure: Some(Exposure::Ev(0.0)),
        tone_map: Some(ToneMap::None),
        rounding: Rounding { is_16_bit: false, is_dithered: false },
    };

    /// The exposure, if it changes values.
    pub fn exposure(self) -> Option<Exposure> {
        self.exposure.filter(|&exposure| exposure != Exposure::Ev(0.0))
    }

    /// The tone map, if it changes values.
    pub fn tone_map(self) -> Option<ToneMap> {
        self.tone_map.filter(|&map| map != ToneMap::None)
    }

    /// Whether nothing changes values before rounding.
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
        DisplayTransform::new(ev, self.tone_map.unwrap_or_default()).rounded(self.rounding)
    }

    /// The transform as far as it is known before the exposure is metered: `auto` counts as 0 EV.
    pub fn known(self) -> DisplayTransform {
        self.transform(0.0)
    }

    /// The settings as they apply in `pipeline`: of exposure and tone map none unless it is linear.
    pub fn in_pipeline(self, pipeline: ColourPipeline) -> Self {
        match pipeline {
            ColourPipeline::Linear => self,
            _ => DisplaySettings { rounding: self.rounding, ..DisplaySettings::OFF },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
