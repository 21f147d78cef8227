//! The transport `whitted`: surfaces are shaded by the lights that they see and by ambient light, and glaze mirrors
//! (Whitted, An Improved Illumination Model for Shaded Display, 1980).

#[cfg(not(kiln_without = "ambient-occlusion"))]
pub mod ambient_occlusion;
#[cfg(not(kiln_without = "glaze"))]
pub mod glaze;
mod local;
mod pixels;
#[cfg(not(kiln_without = "shadows"))]
pub mod shadows;
#[cfg(not(kiln_without = "soft-shadows"))]
pub mod soft_shadows;

use super::{EffectContext, Hook, PlanSpec, Stage, TransportEntry, id};
use crate::scene::Transport;

/// The registry's entry.
pub(super) const TRANSPORT: TransportEntry = TransportEntry {
    transport: Transport::Whitted,
    switch: None,
    effects: &[id::SHADOWS, id::SOFT_SHADOWS, id::AMBIENT_OCCLUSION, id::GLAZE],
    reason: "surfaces are shaded by the lights that they see",
    specify: |context, spec| {
        spec.lit = spec.shading.uses_lights() && !context.world.lights.is_empty();
        spec.layers = true;
    },
    stages: |context: &EffectContext, hook| {
        let PlanSpec { shading: mode, smooth, .. } = context.spec;
        match hook {
            Hook::Lighting(_) => {
                vec![Stage::new("lights", move |tile, context| {
                    local::sample_lights(tile, context, mode, smooth);
                })]
            }
            Hook::Shading(_) => {
                vec![Stage::new("shading", move |tile, context| local::shade(tile, context, mode))]
            }
            Hook::Film => vec![Stage::new("film", pixels::write_pixels)],
            _ => Vec::new(),
        }
    },
};
