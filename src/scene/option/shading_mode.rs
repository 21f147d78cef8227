//! [`ShadingMode`]: which terms of the shading model are computed.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which terms of the shading model are computed, in ascending order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ShadingMode {
    /// The base colour, without light.
    Flat,
    /// Ambient light.
    Ambient,
    /// Ambient and diffuse light.
    Diffuse,
    /// All terms, with highlights and the effects of shading. Typed `phong`.
    #[default]
    #[serde(rename = "phong")]
    Full,
}

names!(ShadingMode { Flat = "flat", Ambient = "ambient", Diffuse = "diffuse", Full = "phong" });

impl ShadingMode {
    /// Whether lights are evaluated.
    pub fn uses_lights(self) -> bool {
        self >= ShadingMode::Diffuse
    }
}
