//! Reflection by GGX microfacets, or by a mirror.

use glam::DVec3;

use super::albedo::GgxAlbedo;
use super::fresnel::Fresnel;
use super::ggx::{Ggx, reflect};
use super::lobe::{LobeSample, Value};

/// A reflection lobe, D F G2 / (4 |n.v| |n.l|), with weights and compensation in the Fresnel factor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Specular {
    pub(crate) ggx: Ggx,
    pub(crate) fresnel: Fresnel,
    /// The directional albedo.
    pub(crate) albedo: DVec3,
}

impl Specular {
    /// A lobe with Schlick's approximation.
    pub(crate) fn schlick(ggx: Ggx, [f0, f90]: [DVec3; 2], albedo: &GgxAlbedo) -> Self {
        Specular { ggx, fresnel: Fresnel::Schlick { f0, f90 }, albedo: albedo.of(f0, f90) }
    }

    /// The reflection of a clear coat of a weight and roughness, each 0 to 1, for a view with the cosine `cos`: a layer of
    /// fixed index 1.5 over everything else (KHR_materials_clearcoat). Its albedo is one number.
    pub(crate) fn clearcoat(weight: f64, roughness: f64, cos: f64) -> Self {
        const F0: f64 = 0.04;
        let ggx = Ggx::new(roughness);
        let albedo = GgxAlbedo::new(ggx, cos);
        let f90 = albedo.compensation(DVec3::splat(F0)) * weight;
        Specular::schlick(ggx, [f90 * F0, f90], &albedo)
    }

    /// The reflection that, mirrored to the other side, is the transmission through a thin wall, for a view with the
    /// cosine `cos`: light passes straight through and is spread as a reflection would be (KHR_materials_transmission). The
    /// roughness of the spread falls to 0 with the index of refraction, as in the glTF Sample Renderer. `transmitted` is
    /// the albedo: it is divided by that of the lobe, so that nothing is lost.
    pub(crate) fn thin(roughness: f64, ior: f64, transmitted: DVec3, cos: f64) -> Self {
        let contrast = if ior > 0.0 { ior.max(1.0 / ior) - 1.0 } else { 1.0 };
        let ggx = Ggx::new(roughness * (2.0 * contrast).clamp(0.0, 1.0));
        let factor = transmitted / GgxAlbedo::new(ggx, cos).all;
        Specular { ggx, fresnel: Fresnel::Schlick { f0: factor, f90: factor }, albedo: transmitted }
    }

    /// Whether the surface is a mirror.
    pub(crate) fn is_delta(&self) -> bool {
        self.ggx.is_delta()
    }

    /// The BRDF times cosine and the density of [`Specular::sample`], that of visible normals over 4 v.h.
    pub(crate) fn value(&self, view: DVec3, light: DVec3) -> Value {
        if light.z <= 0.0 || self.is_delta() {
            return Value::ZERO;
        }
        let (scattered, density, v_h) = self.ggx.reflection(view, light);
        Value { scattered: self.fresnel.at(v_h) * scattered, density }
    }

    /// A direction from a visible normal. `None`: below the surface.
    pub(crate) fn sample(&self, view: DVec3, numbers: [f64; 2]) -> Option<LobeSample> {
        if self.is_delta() {
            let mirrored = DVec3::new(-view.x, -view.y, view.z);
            return Some(LobeSample::Delta(mirrored, self.fresnel.at(view.z)));
        }
        let light = reflect(view, self.ggx.sample_visible_normal(view, numbers)?);
        (light.z > 0.0).then_some(LobeSample::Scattered(light))
    }
}
