//! Layers and media of metallic-roughness materials.

use crate::film::Colour;

/// Values of the extensions KHR_materials_ior, specular, transmission, volume, clearcoat, sheen and anisotropy:
/// factors of the textures in [`crate::scene::MetallicRoughness::textures`].
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Layers<C = Colour> {
    /// Index of refraction; 0 reflects everything.
    pub ior: f64,
    /// Weight of the dielectric reflection, 0 to 1.
    pub specular: f64,
    /// Factor of the dielectric reflectance at normal incidence.
    pub specular_colour: C,
    /// Part of the light below the dielectric reflection that is transmitted, 0 to 1.
    pub transmission: f64,
    /// The medium that the surface encloses; `None` for a thin wall.
    pub volume: Option<Volume<C>>,
    /// Weight of the clear coat, 0 to 1.
    pub clearcoat: f64,
    /// Roughness of the clear coat, 0 to 1.
    pub clearcoat_roughness: f64,
    /// Colour of the sheen; black is none.
    pub sheen_colour: C,
    /// Roughness of the sheen, 0 to 1.
    pub sheen_roughness: f64,
    /// Strength of the anisotropy, 0 to 1: how much rougher the surface is along its tangents.
    #[serde(skip_serializing_if = "is_zero")]
    pub anisotropy: f64,
    /// Angle of the rougher direction from the tangent, towards the bitangent, in radians.
    #[serde(skip_serializing_if = "is_zero")]
    pub anisotropy_rotation: f64,
}

/// Left out of fingerprints.
fn is_zero(number: &f64) -> bool {
    *number == 0.0
}

/// A homogeneous medium that absorbs.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Volume<C = Colour> {
    /// Transmittance of the medium, by channel, over `attenuation_distance`.
    pub attenuation_colour: C,
    /// A distance above 0, which may be infinite.
    pub attenuation_distance: f64,
}

impl Default for Layers {
    /// The defaults of the extensions.
    fn default() -> Self {
        Layers {
            ior: 1.5,
            specular: 1.0,
            specular_colour: Colour::Linear(glam::DVec3::ONE),
            transmission: 0.0,
            volume: None,
            clearcoat: 0.0,
            clearcoat_roughness: 0.0,
            sheen_colour: Colour::Linear(glam::DVec3::ZERO),
            sheen_roughness: 0.0,
            anisotropy: 0.0,
            anisotropy_rotation: 0.0,
        }
    }
}

impl Layers<glam::DVec3> {
    /// Whether it has lobes that only the general BSDF of path tracing has.
    pub fn has_extra_lobes(&self) -> bool {
        self.clearcoat > 0.0 || self.sheen_colour != glam::DVec3::ZERO
    }
}

impl<C> Layers<C> {
    /// The names and values of numbers that are described by themselves, and the values that stand for none.
    pub fn numbers(&self) -> [(&'static str, f64, f64); 6] {
        [
            ("transmission", self.transmission, 0.0),
            ("ior", self.ior, 1.5),
            ("clearcoat", self.clearcoat, 0.0),
            ("clearcoat_roughness", self.clearcoat_roughness, 0.0),
            ("anisotropy", self.anisotropy, 0.0),
            ("anisotropy_rotation", self.anisotropy_rotation, 0.0),
        ]
    }

    /// The layers with every colour converted by `convert`.
    pub fn map_colours<D>(self, convert: impl Fn(C) -> D) -> Layers<D> {
        Layers {
            ior: self.ior,
            specular: self.specular,
            specular_colour: convert(self.specular_colour),
            transmission: self.transmission,
            volume: self.volume.map(|volume| Volume {
                attenuation_colour: convert(volume.attenuation_colour),
                attenuation_distance: volume.attenuation_distance,
            }),
            clearcoat: self.clearcoat,
            clearcoat_roughness: self.clearcoat_roughness,
            sheen_colour: convert(self.sheen_colour),
            sheen_roughness: self.sheen_roughness,
            anisotropy: self.anisotropy,
            anisotropy_rotation: self.anisotropy_rotation,
        }
    }
}
