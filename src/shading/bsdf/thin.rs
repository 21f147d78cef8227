//! Transmission through a thin wall: no refraction, no volume.
//!
//! KHR_materials_transmission: light passes straight through and is spread as a reflection would be, mirrored at the
//! surface. The roughness of the spread falls to 0 with the index of refraction, as in the glTF Sample Renderer.

use glam::DVec3;

use super::albedo::GgxAlbedo;
use super::fresnel::Fresnel;
use super::ggx::Ggx;
use super::lobe::{LobeSample, Value};
use super::specular::Specular;

/// A reflection lobe of Fresnel factor 1, mirrored to the other side.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ThinTransmission(Specular);

/// A direction mirrored at the surface.
fn mirrored(direction: DVec3) -> DVec3 {
    DVec3::new(direction.x, direction.y, -direction.z)
}

impl ThinTransmission {
    /// The lobe of an albedo, which includes tint and what is not reflected, for a view with the cosine `cos`. It is
    /// divided by the albedo of the lobe, so that nothing is lost.
    pub(crate) fn new(roughness: f64, ior: f64, transmitted: DVec3, cos: f64) -> Self {
        let contrast = if ior > 0.0 { ior.max(1.0 / ior) - 1.0 } else { 1.0 };
        let ggx = Ggx::new(roughness * (2.0 * contrast).clamp(0.0, 1.0));
        let factor = transmitted / GgxAlbedo::new(ggx, cos).all;
        ThinTransmission(Specular::new(ggx, Fresnel::Schlick { f0: factor, f90: factor }, transmitted))
    }

    /// The directional albedo.
    pub(crate) fn albedo(&self) -> DVec3 {
        self.0.albedo()
    }

    /// Whether light passes in one direction only.
    pub(crate) fn is_delta(&self) -> bool {
        self.0.is_delta()
    }

    /// The BTDF times cosine and the density of [`ThinTransmission::sample`].
    pub(crate) fn value(&self, view: DVec3, light: DVec3) -> Value {
        self.0.value(view, mirrored(light))
    }

    /// A direction on the other side. `None`: masked.
    pub(crate) fn sample(&self, view: DVec3, numbers: [f64; 2]) -> Option<LobeSample> {
        self.0.sample(view, numbers).map(|sample| match sample {
            LobeSample::Scattered(light) => LobeSample::Scattered(mirrored(light)),
            LobeSample::Delta(light, throughput) => LobeSample::Delta(mirrored(light), throughput),
        })
    }
}
