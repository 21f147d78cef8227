//! The reflection of metals: Schlick's approximation with the base colour at normal incidence.

use glam::DVec3;

use super::albedo::GgxAlbedo;

/// The Fresnel factors at normal and grazing incidence of a metal (glTF 2.0, appendix B.2.1), with the compensation of
/// multiple scattering. A base colour of 1 reflects all light.
pub(crate) fn conductor(base_colour: DVec3, albedo: &GgxAlbedo) -> [DVec3; 2] {
    let compensation = albedo.compensation(base_colour);
    [base_colour * compensation, compensation]
}
