//! The specular layer of opaque dielectrics over a diffuse base.
//!
//! glTF states the layering as `fresnel_mix`, which scales the base by 1 - F(v.h) with the half vector of each pair
//! of directions. At grazing angles layer and base together then reflect more than arrives. Here the base is scaled
//! by 1 minus the directional albedo of the layer (Kulla and Conty, Revisiting Physically Based Shading at
//! Imageworks, SIGGRAPH 2017; OpenPBR 1.1, section 3.2), so that a white base reflects exactly the rest. The sum is
//! not reciprocal, its parts are.

use glam::DVec3;

use super::fresnel::{normal_reflectance, relative_index};

/// The reflectance at normal incidence below which that at grazing incidence is lowered in proportion (index 1.33).
/// Schlick's approximation is 1 at grazing incidence even where there is no interface, at an index of 1; glTF keeps
/// that. The bound is that of Lagarde and de Rousiers, Moving Frostbite to Physically Based Rendering, 2014, section
/// 3.1.1.
const MIN_REFLECTANCE: f64 = 0.02;

/// The reflectances at normal and grazing incidence of KHR_materials_ior and KHR_materials_specular. Interfaces from
/// inside have the values of the outside.
pub(crate) fn reflectances(ior: f64, specular: f64, colour: DVec3) -> [DVec3; 2] {
    let reflectance = normal_reflectance(relative_index(ior, false));
    let f0 = (colour * reflectance).min(DVec3::ONE) * specular;
    [f0, DVec3::splat(specular * (reflectance / MIN_REFLECTANCE).min(1.0))]
}

#[cfg(test)]
mod tests {
    use super::super::albedo::GgxAlbedo;
    use super::super::ggx::Ggx;
    use super::*;

    /// KHR_materials_specular: F0 = min(0.04 colour, 1) specular, F90 = specular; a mirror needs no compensation.
    #[test]
    fn factors_of_gltf() {
        let mirror = GgxAlbedo::new(Ggx::new(0.0), 0.5);
        let factors = |ior, specular, colour| mirror.compensated(reflectances(ior, specular, colour));
        let [f0, f90] = factors(1.5, 0.5, DVec3::new(1.0, 50.0, 0.0));
        assert!((f0 - DVec3::new(0.02, 0.5, 0.0)).abs().max_element() < 1e-15);
        assert_eq!(f90, DVec3::splat(0.5));
        assert_eq!(factors(1.0, 1.0, DVec3::ONE), [DVec3::ZERO; 2]);
        assert_eq!(factors(0.0, 1.0, DVec3::ONE), [DVec3::ONE; 2]);
    }
}
