//! The material extensions of glTF that are layers and media: index of refraction, specular, transmission, volume, clear
//! coat, sheen and anisotropy, with their textures.

use glam::DVec3;
use gltf::json::Value;

use crate::error::Result;
use crate::film::Colour;
use crate::import::formats::gltf::{Loader, specular_glossiness};
use crate::scene::{Layers, SlotEntry, TEXTURE_SLOTS, Texture, TextureSlot, Textures, Volume};

pub(super) const IOR: &str = "KHR_materials_ior";
pub(super) const SPECULAR: &str = "KHR_materials_specular";
pub(super) const TRANSMISSION: &str = "KHR_materials_transmission";
pub(super) const VOLUME: &str = "KHR_materials_volume";
pub(super) const CLEARCOAT: &str = "KHR_materials_clearcoat";
pub(super) const SHEEN: &str = "KHR_materials_sheen";
const ANISOTROPY: &str = "KHR_materials_anisotropy";

/// All of them, and that which is converted to them.
pub(super) const ALL: [&str; 8] =
    [IOR, SPECULAR, TRANSMISSION, VOLUME, CLEARCOAT, SHEEN, ANISOTROPY, specular_glossiness::NAME];

/// A finite number, else the default.
pub(super) fn number(value: Option<&Value>, default: f64) -> f64 {
    value.and_then(Value::as_f64).filter(|x| x.is_finite()).unwrap_or(default)
}

/// Three finite numbers, else those of the default.
fn channels(value: Option<&Value>, default: DVec3) -> DVec3 {
    let channels = value.and_then(Value::as_array);
    DVec3::from([0, 1, 2].map(|i| number(channels.and_then(|c| c.get(i)), default[i])))
}

/// A colour with channels from 0 to 1.
pub(super) fn unit_colour(value: Option<&Value>, default: DVec3) -> DVec3 {
    channels(value, default).clamp(DVec3::ZERO, DVec3::ONE)
}

/// The values of a material's extensions, clamped to the ranges of the format.
pub(super) fn layers(material: &gltf::Material) -> Layers {
    let value = |extension: &str, key: &str| material.extension_value(extension).and_then(|v| v.get(key));
    let number = |extension, key, default: f64| number(value(extension, key), default);
    let unit = |extension, key, default| number(extension, key, default).clamp(0.0, 1.0);
    let colour = |extension, key, default: DVec3, most: f64| {
        Colour::Linear(channels(value(extension, key), default).clamp(DVec3::ZERO, DVec3::splat(most)))
    };
    // A thickness of 0 is a thin wall.
    let volume = (number(VOLUME, "thicknessFactor", 0.0) > 0.0).then(|| Volume {
        attenuation_colour: colour(VOLUME, "attenuationColor", DVec3::ONE, 1.0),
        attenuation_distance: Some(number(VOLUME, "attenuationDistance", f64::INFINITY))
            .filter(|distance| *distance > 0.0)
            .unwrap_or(f64::INFINITY),
    });
    Layers {
        ior: Some(number(IOR, "ior", 1.5)).filter(|ior| *ior == 0.0 || *ior >= 1.0).unwrap_or(1.5),
        specular: unit(SPECULAR, "specularFactor", 1.0),
        specular_colour: colour(SPECULAR, "specularColorFactor", DVec3::ONE, f64::MAX),
        transmission: unit(TRANSMISSION, "transmissionFactor", 0.0),
        volume,
        clearcoat: unit(CLEARCOAT, "clearcoatFactor", 0.0),
        clearcoat_roughness: unit(CLEARCOAT, "clearcoatRoughnessFactor", 0.0),
        sheen_colour: colour(SHEEN, "sheenColorFactor", DVec3::ZERO, 1.0),
        sheen_roughness: unit(SHEEN, "sheenRoughnessFactor", 0.0),
        anisotropy: unit(ANISOTROPY, "anisotropyStrength", 0.0),
        anisotropy_rotation: number(ANISOTROPY, "anisotropyRotation", 0.0),
    }
}

/// Whether a texture has an effect: whether its factor is not 0. That of opacities is read by [`Loader::opacity`].
/// `thicknessTexture` is for renderers that do not trace rays (KHR_materials_volume, section Thickness Texture).
fn is_used(slot: TextureSlot, material: &gltf::Material, layers: &Layers) -> bool {
    let colours = |colour: Colour| colour != Colour::Linear(DVec3::ZERO);
    match slot {
        TextureSlot::BaseColour
        | TextureSlot::MetallicRoughness
        | TextureSlot::Normal
        | TextureSlot::Emission => true,
        TextureSlot::Opacity => false,
        _ if material.unlit() => false,
        TextureSlot::Occlusion => material.occlusion_texture().is_some_and(|t| t.strength() > 0.0),
        TextureSlot::Specular => layers.specular != 0.0,
        TextureSlot::SpecularColour => layers.specular != 0.0 && colours(layers.specular_colour),
        TextureSlot::Transmission => layers.transmission != 0.0,
        TextureSlot::Clearcoat => layers.clearcoat != 0.0,
        TextureSlot::ClearcoatRoughness => layers.clearcoat != 0.0 && layers.clearcoat_roughness != 0.0,
        TextureSlot::SheenColour => colours(layers.sheen_colour),
        TextureSlot::Anisotropy => layers.anisotropy != 0.0,
        TextureSlot::SheenRoughness => colours(layers.sheen_colour) && layers.sheen_roughness != 0.0,
    }
}

/// Whether the clear coat of a material has a normal map.
pub(super) fn has_coat_normals(material: &gltf::Material) -> bool {
    material.extension_value(CLEARCOAT).is_some_and(|value| value.get("clearcoatNormalTexture").is_some())
}

impl Loader<'_> {
    /// The textures of a material but its opacity. One that does not exist is left out with a warning.
    pub(super) fn textures(&mut self, material: &gltf::Material, layers: &Layers) -> Result<Textures> {
        let scale = material.normal_texture().map_or(1.0, |t| f64::from(t.scale()));
        let strength = material.occlusion_texture().map_or(1.0, |t| f64::from(t.strength()));
        let mut textures = Textures::default();
        textures.normal_scale = if scale.is_finite() { scale } else { 1.0 };
        textures.occlusion_strength = strength.clamp(0.0, 1.0);
        for SlotEntry { slot, gltf, is_gltf_alpha, .. } in &TEXTURE_SLOTS {
            if is_used(*slot, material, layers) {
                textures[*slot] = match is_gltf_alpha {
                    true => self.alpha_texture_at(material, gltf, None)?,
                    false => self.texture_at(material, gltf),
                };
            }
        }
        Ok(textures)
    }

    /// The alpha channel of the texture that a JSON pointer names, as a grey texture; `None` without one.
    pub(super) fn alpha_texture_at(
        &mut self,
        material: &gltf::Material,
        pointer: &str,
        alpha_use: AlphaUse,
    ) -> Result<Option<Texture>> {
        let Some((texture, coordinates)) = self.named(material, pointer) else { return Ok(None) };
        let Some(colour) = self.texture(&texture) else { return Ok(None) };
        let key = (colour.image, alpha_use);
        let image = match self.alphas.get(&key) {
            Some(known) => *known,
            None => self.alpha_of(&texture.source(), alpha_use)?,
        };
        self.alphas.insert(key, image);
        Ok(image.map(|image| Texture { image, coordinates, ..colour }))
    }
}

/// What an alpha channel stands for: its values, or the roughness 1 - factor x alpha, by the bits of the factor.
pub(super) type AlphaUse = Option<u64>;
