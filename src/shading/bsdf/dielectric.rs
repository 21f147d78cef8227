//! The specular layer of opaque dielectrics over a diffuse base.
//!
//! glTF states the layering as `fresnel_mix`, which scales the base by 1 - F(v.h) with the half vector of each pair
//! of directions. At grazing angles layer and base together then reflect more than arrives. Here the base is scaled
//! by 1 minus the directional albedo of the layer (Kulla and Conty, Revisiting Physically Based Shading at
//! Imageworks, SIGGRAPH 2017; OpenPBR 1.1, section 3.2), so that a white base reflects exactly the rest. The sum is
//! not reciprocal, its parts are.

use glam::DVec3;

use super::albedo::GgxAlbedo;
use super::fresnel::{normal_reflectance, relative_index};

/// The reflectance at normal incidence below which that at grazing incidence is lowered in proportion (index 1.33).
/// Schlick's approximation is 1 at grazing incidence even where there is no interface, at an index of 1; glTF keeps
/// that. The bound is that of Lagarde and de Rousiers, Moving Frostbite to Physically Based Rendering, 2014, section
/// 3.1.1.
const MIN_REFLECTANCE: f64 = 0.02;

/// The reflectances at normal and grazing incidence of KHR_materials_ior and KHR_materials_specular.
pub(crate) fn reflectances(ior: f64, specular: f64, colour: DVec3) -> [DVec3; 2] {
    let reflectance = normal_reflectance(relative_index(ior, false));
    let f0 = (colour * reflectance).min(DVec3::ONE) * specular;
    [f0, DVec3::splat(specular * (reflectance / MIN_REFLECTANCE).min(1.0))]
}

/// The Fresnel factors at normal and grazing incidence of KHR_materials_ior and KHR_materials_specular, with the
/// compensation of multiple scattering. Interfaces from inside have the values of the outside.
pub(crate) fn dielectric_layer(ior: f64, specular: f64, colour: DVec3, albedo: &GgxAlbedo) -> [DVec3; 2] {
    let [f0, f90] = reflectances(ior, specular, colour);
    let compensation = albedo.compensation(f0);
    [f0 * compensation, f90 * compensation]
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::super::albedo::view_at;
    use super::super::fresnel::schlick_weight;
    use super::super::ggx::{Ggx, half_vector};
    use super::super::quadrature::integrate_sphere;
    use super::*;

    /// glTF's `fresnel_mix` gains energy: a smooth layer over a white base, seen at the cosine 0.1, reflects
    /// F(0.1) = 0.04 + 0.96 x 0.9^5 = 0.607, and the base scaled by 1 - F(v.h) more than 0.8 of the light.
    #[test]
    fn fresnel_mix_gains_energy() {
        let view = view_at(0.1);
        let fresnel = |cos: f64| 0.04 + 0.96 * schlick_weight(cos);
        let base = |light: DVec3| {
            let cos = half_vector(view, light).map_or(0.0, |(_, cos)| cos);
            DVec3::splat((1.0 - fresnel(cos)) * light.z.max(0.0) / PI)
        };
        let base = integrate_sphere(&base, &[], 1e-6).x;
        assert!((fresnel(0.1) - 0.607).abs() < 1e-3);
        assert!(fresnel(0.1) + base > 1.4, "{base}");
    }

    /// KHR_materials_specular: F0 = min(0.04 colour, 1) specular, F90 = specular; a mirror needs no compensation.
    #[test]
    fn factors_of_gltf() {
        let mirror = GgxAlbedo::new(Ggx::new(0.0), 0.5);
        let [f0, f90] = dielectric_layer(1.5, 0.5, DVec3::new(1.0, 50.0, 0.0), &mirror);
        assert!((f0 - DVec3::new(0.02, 0.5, 0.0)).abs().max_element() < 1e-15);
        assert_eq!(f90, DVec3::splat(0.5));
        assert_eq!(dielectric_layer(1.0, 1.0, DVec3::ONE, &mirror), [DVec3::ZERO; 2]);
        assert_eq!(dielectric_layer(0.0, 1.0, DVec3::ONE, &mirror), [DVec3::ONE; 2]);
    }
}
