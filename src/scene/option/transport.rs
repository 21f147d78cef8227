//! [`Transport`]: how light is transported from lights to the camera.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How light is transported from lights to the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Transport {
    /// Surfaces are shaded by the lights that they see and by a constant ambient light; glaze mirrors (Whitted, An Improved
    /// Illumination Model for Shaded Display, 1980).
    Whitted,
    /// Paths are traced: light that surfaces scatter onto each other, environments and emissive surfaces as lights.
    Path,
}

names!(Transport { Whitted = "whitted", Path = "path" });

/// What calls for a transport.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TransportReason {
    /// It was chosen.
    Choice,
    /// An environment.
    Environment,
    /// A light with an area.
    AreaLight,
    /// Materials that transmit light or light others ([`crate::scene::DefaultLook::path_tracing_reason`]).
    Material,
    /// Nothing calls for another.
    Nothing,
}

impl Transport {
    /// Whether light is estimated from random paths: environments and surfaces that emit are lights, and colours are
    /// noisy.
    pub fn traces_paths(self) -> bool {
        match self {
            Transport::Whitted => false,
            Transport::Path => true,
        }
    }

    /// The transport of a picture, and what calls for it: the choice, otherwise what the scene has.
    pub fn called_for(
        choice: Option<Transport>,
        has_environment: bool,
        has_area_light: bool,
        has_path_tracing_material: bool,
    ) -> (Transport, TransportReason) {
        match choice {
            Some(transport) => (transport, TransportReason::Choice),
            None if has_path_tracing_material => (Transport::Path, TransportReason::Material),
            None if has_environment => (Transport::Path, TransportReason::Environment),
            None if has_area_light => (Transport::Path, TransportReason::AreaLight),
            None => (Transport::Whitted, TransportReason::Nothing),
        }
    }
}
