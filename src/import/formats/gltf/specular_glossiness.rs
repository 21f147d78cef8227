//! KHR_materials_pbrSpecularGlossiness, converted to metallic-roughness with layers.
//!
//! The reflectance at normal incidence is `specular`: an infinite index of refraction (`ior` 0), whose reflectance is
//! 1, with the specular colour as its factor (KHR_materials_specular, section Conversions). The roughness is 1 -
//! glossiness. Both are exact, and so are their textures, the roughness within half a step of 8 bits. The diffuse part
//! of the extension, diffuse (1 - max(specular)) (1 - F), becomes the base below a dielectric layer: diffuse scaled by
//! what the layer leaves.

use crate::error::Result;
use crate::film::Colour;
use crate::import::formats::gltf::Loader;
use crate::import::formats::gltf::layers::{number, unit_colour};
use crate::scene::{MetallicRoughness, Opacity, TextureSlot};
use glam::DVec3;

pub(super) const NAME: &str = "KHR_materials_pbrSpecularGlossiness";

const DIFFUSE: &str = "/extensions/KHR_materials_pbrSpecularGlossiness/diffuseTexture";
const SPECULAR: &str = "/extensions/KHR_materials_pbrSpecularGlossiness/specularGlossinessTexture";

/// The textures of the extension, by JSON pointers from a material.
pub(super) const POINTERS: [&str; 2] = [DIFFUSE, SPECULAR];

impl Loader<'_> {
    /// Replaces base colour, opacity, metallic, roughness, index of refraction and specular of a material by those of
    /// the extension, if the material has it.
    pub(super) fn replace_by_specular_glossiness(
        &mut self,
        of: &gltf::Material,
        material: &mut MetallicRoughness,
    ) -> Result<()> {
        let Some(value) = of.extension_value(NAME) else { return Ok(()) };
        let colour = |key| Colour::Linear(unit_colour(value.get(key), DVec3::ONE));
        let glossiness = number(value.get("glossinessFactor"), 1.0).clamp(0.0, 1.0);
        material.base_colour = colour("diffuseFactor");
        material.textures[TextureSlot::BaseColour] = self.texture_at(of, DIFFUSE);
        if let Some(cutoff) = material.opacity.map(|opacity| opacity.cutoff) {
            let alpha = value.get("diffuseFactor").and_then(|factor| factor.get(3));
            material.textures[TextureSlot::Opacity] = self.alpha_texture_at(of, DIFFUSE, None)?;
            material.opacity = Some(Opacity { factor: number(alpha, 1.0).clamp(0.0, 1.0), cutoff });
        }
        material.metallic = 0.0;
        material.roughness = 1.0 - glossiness;
        (material.layers.ior, material.layers.specular) = (0.0, 1.0);
        material.layers.specular_colour = colour("specularFactor");
        material.textures[TextureSlot::Specular] = None;
        material.textures[TextureSlot::SpecularColour] = self.texture_at(of, SPECULAR);
        // Without an alpha channel the glossiness is its factor.
        let alpha_use = Some(glossiness.to_bits());
        let roughness = self.alpha_texture_at(of, SPECULAR, alpha_use)?;
        if roughness.is_some() {
            material.roughness = 1.0;
        }
        material.textures[TextureSlot::MetallicRoughness] = roughness;
        Ok(())
    }
}
