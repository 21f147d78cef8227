//! Weights of multiple importance sampling of light by BSDF samples and light samples.

use crate::effects::LightTechnique;

/// The power heuristic with exponent 2 (Veach, Robust Monte Carlo Methods for Light Transport Simulation, 1997, section
/// 9.2.4): the weight of a sample of density `own` beside a technique of density `other`.
#[inline(always)]
fn power_heuristic(own: f64, other: f64) -> f64 {
    // Scaled, so that no square overflows or underflows.
    let ratio = other / own;
    if own.is_infinite() { 1.0 } else { 1.0 / (1.0 + ratio * ratio) }
}

/// The weight of light found by a BSDF sample of density `own`, where light samples have the density `light`.
#[inline]
pub(super) fn bsdf_weight(technique: LightTechnique, own: f64, light: f64) -> f64 {
    match technique {
        LightTechnique::Both => power_heuristic(own, light),
        LightTechnique::BsdfSamples => 1.0,
        // 1 for what light samples cannot reach.
        LightTechnique::LightSamples => f64::from(u8::from(own.is_infinite() || light <= 0.0)),
    }
}

/// The weight of a light sample of density `own`, where BSDF samples have the density `bsdf`.
#[inline(always)]
pub(super) fn light_weight(technique: LightTechnique, own: f64, bsdf: f64) -> f64 {
    match technique {
        LightTechnique::Both => power_heuristic(own, bsdf),
        LightTechnique::BsdfSamples => f64::from(u8::from(bsdf <= 0.0)),
        LightTechnique::LightSamples => 1.0,
    }
}
