//! What the lobes of a BSDF have in common.

use glam::DVec3;

use super::clearcoat::Clearcoat;
use super::diffuse::Diffuse;
use super::glass::Glass;
use super::sheen::Sheen;
use super::specular::Specular;
use super::thin::ThinTransmission;

/// A lobe for a pair of directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Value {
    /// BSDF times the absolute cosine of the light.
    pub(crate) scattered: DVec3,
    /// Density of the lobe's sampling per solid angle.
    pub(crate) density: f64,
}

impl Value {
    /// Nothing is scattered, and no direction sampled.
    pub(crate) const ZERO: Value = Value { scattered: DVec3::ZERO, density: 0.0 };
}

/// A sampled direction of a lobe.
#[derive(Debug, Clone, Copy)]
pub(crate) enum LobeSample {
    /// One of a density, from [`Lobe::value`].
    Scattered(DVec3),
    /// A direction of a delta lobe with its throughput, the lobe's part divided by the probability within the lobe.
    Delta(DVec3, DVec3),
}

/// A lobe, prepared for a point and view. Its weight in the BSDF is contained.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Lobe {
    Clearcoat(Clearcoat),
    Sheen(Sheen),
    Specular(Specular),
    Diffuse(Diffuse),
    Glass(Glass),
    ThinTransmission(ThinTransmission),
}

impl Lobe {
    /// The directional albedo, exact to what the tables state. The choice of lobes depends on it.
    pub(crate) fn albedo(&self) -> DVec3 {
        match self {
            Lobe::Clearcoat(lobe) => lobe.0.albedo(),
            Lobe::Sheen(lobe) => lobe.albedo(),
            Lobe::Specular(lobe) => lobe.albedo(),
            Lobe::Diffuse(lobe) => lobe.albedo(),
            Lobe::Glass(lobe) => lobe.albedo(),
            Lobe::ThinTransmission(lobe) => lobe.albedo(),
        }
    }

    /// Whether only single directions are scattered to.
    pub(crate) fn is_delta(&self) -> bool {
        match self {
            Lobe::Clearcoat(lobe) => lobe.0.is_delta(),
            Lobe::Sheen(_) | Lobe::Diffuse(_) => false,
            Lobe::Specular(lobe) => lobe.is_delta(),
            Lobe::Glass(lobe) => lobe.is_delta(),
            Lobe::ThinTransmission(lobe) => lobe.is_delta(),
        }
    }

    /// The lobe for a light direction; zero for delta lobes.
    pub(crate) fn value(&self, view: DVec3, light: DVec3) -> Value {
        match self {
            Lobe::Clearcoat(lobe) => lobe.0.value(view, light),
            Lobe::Sheen(lobe) => lobe.value(view, light),
            Lobe::Specular(lobe) => lobe.value(view, light),
            Lobe::Diffuse(lobe) => lobe.value(light),
            Lobe::Glass(lobe) => lobe.value(view, light),
            Lobe::ThinTransmission(lobe) => lobe.value(view, light),
        }
    }

    /// A direction from three numbers, 0 to below 1. `None`: absorbed.
    pub(crate) fn sample(&self, view: DVec3, numbers: [f64; 3]) -> Option<LobeSample> {
        let [choice, u, v] = numbers;
        match self {
            Lobe::Clearcoat(lobe) => lobe.0.sample(view, [u, v]),
            Lobe::Sheen(_) => Some(LobeSample::Scattered(Sheen::sample([u, v]))),
            Lobe::Specular(lobe) => lobe.sample(view, [u, v]),
            Lobe::Diffuse(_) => Some(LobeSample::Scattered(Diffuse::sample([u, v]))),
            Lobe::Glass(lobe) => lobe.sample(view, choice, [u, v]),
            Lobe::ThinTransmission(lobe) => lobe.sample(view, [u, v]),
        }
    }
}
