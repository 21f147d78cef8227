//! KHR_materials_clearcoat: a clear layer of fixed index 1.5 over everything else.

use glam::DVec3;

use super::albedo::GgxAlbedo;
use super::fresnel::Fresnel;
use super::ggx::Ggx;
use super::specular::Specular;

/// The reflectance at normal incidence for the index 1.5.
const F0: f64 = 0.04;

/// The reflection of a clear coat.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Clearcoat(pub(crate) Specular);

impl Clearcoat {
    /// The coat of a weight and roughness, each 0 to 1, for a view with the cosine `cos`. Its albedo is one number.
    pub(crate) fn new(weight: f64, roughness: f64, cos: f64) -> Self {
        let ggx = Ggx::new(roughness);
        let albedo = GgxAlbedo::new(ggx, cos);
        let compensation = albedo.compensation(DVec3::splat(F0)) * weight;
        let (f0, f90) = (compensation * F0, compensation);
        Clearcoat(Specular::new(ggx, Fresnel::Schlick { f0, f90 }, albedo.of(f0, f90)))
    }
}
