//! Fresnel reflectance: the exact value of a dielectric interface and Schlick's approximation.

use glam::DVec3;

use crate::world::select;

/// Relative indices of refraction outside of this factor of 1 are infinite: the reflectance at normal incidence, of at
/// least 1 - 4e-6, is taken as 1. It keeps the squares of the index finite.
const MAX_INDEX: f64 = 1e6;

/// Relative indices that differ from 1 by less are no interface. Within it the cosine-weighted reflectance is below
/// 1e-4, and the half vector of refraction is the difference of nearly equal vectors.
const MIN_CONTRAST: f64 = 1e-4;

/// The ratio of the index of refraction on the far side of an interface to that on the side of the view. 0 and
/// infinity reflect all light, 1 is no interface.
///
/// `ior` is glTF's value (KHR_materials_ior): 0 is an infinite index, 1 no interface.
pub(crate) fn relative_index(ior: f64, from_inside: bool) -> f64 {
    let ior = if ior > 1.0 / MAX_INDEX { ior } else { f64::INFINITY };
    let eta = if from_inside { 1.0 / ior } else { ior };
    if (eta - 1.0).abs() < MIN_CONTRAST {
        1.0
    } else if eta > MAX_INDEX {
        f64::INFINITY
    } else if eta < 1.0 / MAX_INDEX {
        0.0
    } else {
        eta
    }
}

/// The reflectance at normal incidence, ((eta - 1) / (eta + 1))^2.
#[inline(always)]
pub(crate) fn normal_reflectance(eta: f64) -> f64 {
    let amplitude = (eta - 1.0) / (eta + 1.0);
    if eta == f64::INFINITY { 1.0 } else { amplitude * amplitude }
}

/// The cosine of the refracted direction, by Snell's law. `None`: total internal reflection.
///
/// `eta` is the relative index (see [`relative_index`]), `cos` the cosine of the angle of incidence, 0 to 1.
pub(crate) fn refracted_cosine(eta: f64, cos: f64) -> Option<f64> {
    let (refracted, is_total) = refraction(eta, cos);
    (!is_total).then_some(refracted)
}

/// [`refracted_cosine`] without branches: the cosine, and whether reflection is total, where it means nothing.
#[inline(always)]
pub(crate) fn refraction(eta: f64, cos: f64) -> (f64, bool) {
    // 1 - sin^2 / eta^2 = (eta^2 - 1 + cos^2) / eta^2, without the loss of digits of 1 - cos^2 at grazing angles.
    let numerator = (eta - 1.0) * (eta + 1.0) + cos * cos;
    let is_infinite = eta == f64::INFINITY;
    let refracted = (numerator.max(0.0).sqrt() / eta).min(1.0);
    let refracts = is_infinite | ((numerator > 0.0) & (eta > 0.0));
    (if is_infinite { 1.0 } else { refracted }, !refracts)
}

/// The reflectance of a dielectric interface for unpolarised light, 0 to 1; 1 in total internal reflection.
///
/// Fresnel's equations as in Walter et al., Microfacet Models for Refraction through Rough Surfaces, EGSR 2007,
/// equation 22, written with the refracted cosine. Arguments as for [`refracted_cosine`].
#[inline(always)]
pub(crate) fn dielectric(eta: f64, cos: f64) -> f64 {
    let (refracted, is_total) = refraction(eta, cos);
    let perpendicular = (cos - eta * refracted) / (cos + eta * refracted);
    let parallel = (eta * cos - refracted) / (eta * cos + refracted);
    let partial = (0.5 * (perpendicular * perpendicular + parallel * parallel)).min(1.0);
    let reflectance = if is_total | (eta == f64::INFINITY) { 1.0 } else { partial };
    if eta == 1.0 { 0.0 } else { reflectance }
}

/// Schlick's weight (1 - cos)^5 of the reflectance at grazing incidence (An Inexpensive BRDF Model for
/// Physically-based Rendering, Computer Graphics Forum 13(3), 1994).
#[inline(always)]
pub(crate) fn schlick_weight(cos: f64) -> f64 {
    let x = (1.0 - cos).clamp(0.0, 1.0);
    let square = x * x;
    square * square * x
}

/// Reflectance by colour channel as a function of the cosine between view and microfacet normal. Weights of the lobe
/// are multiplied in, so values may exceed 1.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Fresnel {
    /// Schlick's approximation between the values at normal and at grazing incidence.
    Schlick {
        /// Value at normal incidence.
        f0: DVec3,
        /// Value at grazing incidence.
        f90: DVec3,
    },
    /// The exact value of an interface, times the factor.
    Exact(Interface, DVec3),
}

impl Fresnel {
    /// The value at a cosine, 0 to 1.
    pub(crate) fn at(&self, cos: f64) -> DVec3 {
        match self {
            Fresnel::Schlick { f0, f90 } => *f0 + (*f90 - *f0) * schlick_weight(cos),
            Fresnel::Exact(interface, factor) => interface.reflectance(cos) * *factor,
        }
    }
}

/// A dielectric interface whose reflectance is modified by KHR_materials_specular.
///
/// The extension states its factors for Schlick's approximation: F0 is multiplied by `specular_colour` (up to 1) and
/// by `specular`, F90 by `specular`. Here the exact reflectance F is mapped affinely, so that F0 becomes the modified
/// F0 and 1 the modified F90. Default factors leave F as it is. Total internal reflection stays complete.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Interface {
    /// Relative index of refraction (see [`relative_index`]).
    pub(crate) eta: f64,
    /// Reflectance where F is 0, by extrapolation: 0 with default factors.
    pub(crate) offset: DVec3,
    /// Derivative of the reflectance by F: 1 with default factors.
    pub(crate) slope: DVec3,
}

impl Interface {
    /// The interface of a relative index and the factors of KHR_materials_specular.
    #[inline(always)]
    pub(crate) fn new(eta: f64, specular: f64, specular_colour: DVec3) -> Self {
        let f0 = normal_reflectance(eta);
        let modified = (specular_colour * f0).min(DVec3::ONE) * specular;
        let slope = (DVec3::splat(specular) - modified) / (1.0 - f0);
        // F90 - slope instead of F0 - slope * f0: exactly 0 with default factors.
        let offset = DVec3::splat(specular) - slope;
        let is_default = (modified.x == f0) & (modified.y == f0) & (modified.z == f0);
        let (offset, slope) =
            (select(is_default, DVec3::ZERO, offset), select(is_default, DVec3::ONE, slope));
        let reflects_all = f0 >= 1.0;
        let (offset, slope) =
            (select(reflects_all, modified, offset), select(reflects_all, DVec3::ZERO, slope));
        let is_none = eta == 1.0;
        let (offset, slope) = (select(is_none, DVec3::ZERO, offset), select(is_none, DVec3::ZERO, slope));
        Interface { eta, offset, slope }
    }

    /// The reflectance by channel, 0 to 1, at the cosine between view and (microfacet) normal.
    #[inline(always)]
    pub(crate) fn reflectance(&self, cos: f64) -> DVec3 {
        let is_total = (self.eta < 1.0) & refraction(self.eta, cos).1;
        let modified = (self.offset + self.slope * dielectric(self.eta, cos)).clamp(DVec3::ZERO, DVec3::ONE);
        if is_total { DVec3::ONE } else { modified }
    }

    /// The part of light that is transmitted, 0 to 1, where `reflectance` is reflected. It is one number, so that a
    /// coloured reflection does not tint the transmission in the complementary colour, as KHR_materials_specular
    /// states.
    #[inline(always)]
    pub(crate) fn transmittance(&self, reflectance: DVec3) -> f64 {
        if self.eta.is_infinite() { 0.0 } else { 1.0 - reflectance.max_element() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ((1.5 - 1) / (1.5 + 1))^2 = 0.04, from both sides; ((2.42 - 1) / (2.42 + 1))^2 = (71 / 171)^2 for diamond.
    #[test]
    fn normal_incidence() {
        assert!((dielectric(1.5, 1.0) - 0.04).abs() < 1e-15);
        assert!((dielectric(1.0 / 1.5, 1.0) - 0.04).abs() < 1e-15);
        assert!((dielectric(2.42, 1.0) - (71.0f64 / 171.0).powi(2)).abs() < 1e-15);
        assert!((normal_reflectance(1.5) - 0.04).abs() < 1e-15);
        assert_eq!(dielectric(1.0, 0.3), 0.0);
        assert_eq!(dielectric(f64::INFINITY, 0.3), 1.0);
    }

    /// At Brewster's angle, tan = n, parallel light is transmitted entirely and the refracted ray is at a right angle
    /// to the reflected one, so that F = (n^2 - 1)^2 / (2 (n^2 + 1)^2); for n = 1.5 it is (1.25 / 3.25)^2 / 2 = 25 /
    /// 338.
    #[test]
    fn brewster_angle() {
        let cos = 1.0 / 3.25f64.sqrt(); // cos = 1 / sqrt(1 + tan^2)
        assert!((dielectric(1.5, cos) - 25.0 / 338.0).abs() < 1e-15);
    }

    /// From glass with n = 1.5 the critical angle has the sine 2 / 3, the cosine sqrt(5) / 3.
    #[test]
    fn total_internal_reflection() {
        let critical = 5.0f64.sqrt() / 3.0;
        assert_eq!(dielectric(1.0 / 1.5, critical * (1.0 - 1e-14)), 1.0);
        assert_eq!(refracted_cosine(1.0 / 1.5, critical * (1.0 - 1e-14)), None);
        let above = dielectric(1.0 / 1.5, critical * (1.0 + 1e-14));
        assert!(above < 1.0 && above > 0.999_99, "{above}");
        assert_eq!(dielectric(0.0, 1.0), 1.0);
    }

    /// Grazing incidence reflects all: with refracted cosine C = sqrt(1 - 1 / n^2), F = 1 - 2 (1 / (n C) + n / C) cos
    /// to first order; both polarisations, (1 - x)^2 = 1 - 2 x with x = 2 cos / (n C) and 2 n cos / C, halved.
    #[test]
    fn grazing_incidence() {
        assert_eq!(dielectric(1.5, 0.0), 1.0);
        let (cos, c) = (1e-9, (1.0f64 - 1.0 / 2.25).sqrt());
        let expected = 2.0 * (1.0 / (1.5 * c) + 1.5 / c) * cos;
        assert!(((1.0 - dielectric(1.5, cos)) / expected - 1.0).abs() < 1e-6);
    }

    /// The reflectance is the same along a refracted path in both directions.
    #[test]
    fn symmetric_along_the_path() {
        for cos in [0.01, 0.2, 0.7, 1.0] {
            let refracted = refracted_cosine(1.7, cos).expect("into the denser medium");
            assert!((dielectric(1.7, cos) - dielectric(1.0 / 1.7, refracted)).abs() < 1e-12);
        }
    }

    /// KHR_materials_specular: F0 0.04 x (1, 0.5, 0) x 0.5 = (0.02, 0.01, 0), F90 0.5; by default nothing changes.
    #[test]
    fn specular_factors() {
        let same = Interface::new(1.5, 1.0, DVec3::ONE);
        assert_eq!(same.reflectance(0.3), DVec3::splat(dielectric(1.5, 0.3)));
        let half = Interface::new(1.5, 0.5, DVec3::new(1.0, 0.5, 0.0));
        assert!((half.reflectance(1.0) - DVec3::new(0.02, 0.01, 0.0)).abs().max_element() < 1e-15);
        assert!((half.reflectance(0.0) - DVec3::splat(0.5)).abs().max_element() < 1e-15);
        let inside = Interface::new(1.0 / 1.5, 0.5, DVec3::ZERO);
        assert_eq!(inside.reflectance(0.5), DVec3::ONE);
    }

    #[test]
    fn indices_of_gltf() {
        assert_eq!(relative_index(1.5, false), 1.5);
        assert_eq!(relative_index(1.5, true), 1.0 / 1.5);
        assert_eq!(relative_index(0.0, false), f64::INFINITY);
        assert_eq!(relative_index(0.0, true), 0.0);
        assert_eq!(relative_index(1.000_01, true), 1.0);
        assert_eq!(relative_index(f64::INFINITY, false), f64::INFINITY);
    }
}
