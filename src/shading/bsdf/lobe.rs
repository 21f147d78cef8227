//! The lobes of a BSDF: what they have in common, and those that need no file of their own.

use glam::DVec3;

use super::anisotropic::AnisotropicSpecular;
use super::diffuse;
use super::glass::Glass;
use super::sheen::Sheen;
use super::specular::Specular;

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
    Sheen(Sheen),
    Specular(Specular),
    Anisotropic(AnisotropicSpecular),
    /// Lambert's diffuse reflection with an albedo.
    Diffuse(DVec3),
    Glass(Glass),
    /// Transmission through a thin wall: a reflection, mirrored to the other side.
    ThinTransmission(Specular),
}

impl Lobe {
    /// The directional albedo, exact to what the tables state. The choice of lobes depends on it.
    pub(crate) fn albedo(&self) -> DVec3 {
        match self {
            Lobe::Sheen(lobe) => lobe.albedo,
            Lobe::Specular(lobe) | Lobe::ThinTransmission(lobe) => lobe.albedo,
            Lobe::Anisotropic(lobe) => lobe.albedo,
            Lobe::Diffuse(albedo) => *albedo,
            Lobe::Glass(lobe) => lobe.albedo,
        }
    }

    /// Whether only single directions are scattered to.
    pub(crate) fn is_delta(&self) -> bool {
        match self {
            Lobe::Sheen(_) | Lobe::Anisotropic(_) | Lobe::Diffuse(_) => false,
            Lobe::Specular(lobe) | Lobe::ThinTransmission(lobe) => lobe.is_delta(),
            Lobe::Glass(lobe) => lobe.is_delta(),
        }
    }

    /// The lobe for a light direction; zero for delta lobes.
    pub(crate) fn value(&self, view: DVec3, light: DVec3) -> Value {
        match self {
            Lobe::Sheen(lobe) => lobe.value(view, light),
            Lobe::Specular(lobe) => lobe.value(view, light),
            Lobe::Anisotropic(lobe) => lobe.value(view, light),
            Lobe::Diffuse(albedo) => {
                let (scattered, density) = diffuse::eval_pdf(*albedo, light);
                Value { scattered, density }
            }
            Lobe::Glass(lobe) => lobe.value(view, light),
            Lobe::ThinTransmission(lobe) => lobe.value(view, mirrored(light)),
        }
    }

    /// A direction from three numbers, 0 to below 1. `None`: absorbed.
    pub(crate) fn sample(&self, view: DVec3, numbers: [f64; 3]) -> Option<LobeSample> {
        let [choice, u, v] = numbers;
        match self {
            Lobe::Sheen(_) => Some(LobeSample::Scattered(Sheen::sample([u, v]))),
            Lobe::Specular(lobe) => lobe.sample(view, [u, v]),
            Lobe::Anisotropic(lobe) => lobe.sample(view, [u, v]),
            Lobe::Diffuse(_) => Some(LobeSample::Scattered(diffuse::sample([u, v]))),
            Lobe::Glass(lobe) => lobe.sample(view, choice, [u, v]),
            Lobe::ThinTransmission(lobe) => Some(match lobe.sample(view, [u, v])? {
                LobeSample::Scattered(light) => LobeSample::Scattered(mirrored(light)),
                LobeSample::Delta(light, throughput) => LobeSample::Delta(mirrored(light), throughput),
            }),
        }
    }
}

/// A direction mirrored at the surface.
fn mirrored(direction: DVec3) -> DVec3 {
    DVec3::new(direction.x, direction.y, -direction.z)
}
