//! Reflection by GGX microfacets, or by a mirror.

use glam::DVec3;

use super::fresnel::Fresnel;
use super::ggx::{Ggx, half_vector, reflect};
use super::lobe::{LobeSample, Value};

/// A reflection lobe, D F G2 / (4 |n.v| |n.l|), with weights and compensation in the Fresnel factor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Specular {
    ggx: Ggx,
    fresnel: Fresnel,
    albedo: DVec3,
}

impl Specular {
    /// The lobe of a distribution and a Fresnel factor that together have the directional albedo `albedo`.
    pub(crate) fn new(ggx: Ggx, fresnel: Fresnel, albedo: DVec3) -> Self {
        Specular { ggx, fresnel, albedo }
    }

    /// The directional albedo.
    pub(crate) fn albedo(&self) -> DVec3 {
        self.albedo
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
        let Some((half, v_h)) = half_vector(view, light) else { return Value::ZERO };
        let density = 0.25 * self.ggx.density(half);
        Value {
            scattered: self.fresnel.at(v_h) * (density * self.ggx.shadowing_over_cosine(view.z, light.z)),
            density: density * self.ggx.masking_over_cosine(view.z),
        }
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
