//! The material extensions of glTF that are layers and media: index of refraction, specular, transmission, volume, clear
//! coat and sheen, with their textures.

use glam::DVec3;
use gltf::json::Value;

use super::texture::OCCLUSION;
use super::{Loader, specular_glossiness};
use crate::error::Result;
use crate::film::Colour;
use crate::scene::{FurtherTexture, Layers, Texture, TextureSlot, Volume};

pub(super) const IOR: &str = "KHR_materials_ior";
pub(super) const SPECULAR: &str = "KHR_materials_specular";
pub(super) const TRANSMISSION: &str = "KHR_materials_transmission";
pub(super) const VOLUME: &str = "KHR_materials_volume";
pub(super) const CLEARCOAT: &str = "KHR_materials_clearcoat";
pub(super) const SHEEN: &str = "KHR_materials_sheen";

/// All of them, and that which is converted to them.
pub(super) const ALL: [&str; 7] =
    [IOR, SPECULAR, TRANSMISSION, VOLUME, CLEARCOAT, SHEEN, specular_glossiness::NAME];

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
    }
}

/// The textures of the extensions: extension, key, slot, and whether the alpha channel is read. `thicknessTexture` is
/// for renderers that do not trace rays (KHR_materials_volume, section Thickness Texture).
const TEXTURES: [(&str, &str, TextureSlot, bool); 7] = [
    (SPECULAR, "specularTexture", TextureSlot::Specular, true),
    (SPECULAR, "specularColorTexture", TextureSlot::SpecularColour, false),
    (TRANSMISSION, "transmissionTexture", TextureSlot::Transmission, false),
    (CLEARCOAT, "clearcoatTexture", TextureSlot::Clearcoat, false),
    (CLEARCOAT, "clearcoatRoughnessTexture", TextureSlot::ClearcoatRoughness, false),
    (SHEEN, "sheenColorTexture", TextureSlot::SheenColour, false),
    (SHEEN, "sheenRoughnessTexture", TextureSlot::SheenRoughness, true),
];

/// Whether the factor of a slot is 0, so that its texture has no effect.
fn is_zero(slot: TextureSlot, layers: &Layers) -> bool {
    let black = |colour: Colour| matches!(colour, Colour::Linear(DVec3::ZERO));
    match slot {
        TextureSlot::Occlusion => false,
        TextureSlot::Specular => layers.specular == 0.0,
        TextureSlot::SpecularColour => layers.specular == 0.0 || black(layers.specular_colour),
        TextureSlot::Transmission => layers.transmission == 0.0,
        TextureSlot::Clearcoat => layers.clearcoat == 0.0,
        TextureSlot::ClearcoatRoughness => layers.clearcoat == 0.0 || layers.clearcoat_roughness == 0.0,
        TextureSlot::SheenColour => black(layers.sheen_colour),
        TextureSlot::SheenRoughness => black(layers.sheen_colour) || layers.sheen_roughness == 0.0,
    }
}

/// Whether the clear coat of a material has a normal map.
pub(super) fn has_coat_normals(material: &gltf::Material) -> bool {
    material.extension_value(CLEARCOAT).is_some_and(|value| value.get("clearcoatNormalTexture").is_some())
}

/// The textures of the extensions, by JSON pointers from a material.
pub(super) fn pointers() -> impl Iterator<Item = String> {
    TEXTURES.into_iter().map(|(extension, key, ..)| pointer(extension, key))
}

fn pointer(extension: &str, key: &str) -> String {
    format!("/extensions/{extension}/{key}")
}

impl Loader<'_> {
    /// The textures of occlusion and of a material's extensions. One that does not exist is left out with a warning.
    pub(super) fn further_textures(
        &mut self,
        material: &gltf::Material,
        layers: &Layers,
        document: &gltf::Document,
    ) -> Result<Vec<FurtherTexture>> {
        let mut further = Vec::new();
        if material.unlit() {
            return Ok(further);
        }
        if material.occlusion_texture().is_some_and(|occlusion| occlusion.strength() > 0.0) {
            let texture = self.texture_at(material, OCCLUSION, document);
            further.extend(texture.map(|texture| FurtherTexture { slot: TextureSlot::Occlusion, texture }));
        }
        for (extension, key, slot, is_alpha) in TEXTURES {
            if is_zero(slot, layers) {
                continue;
            }
            let pointer = pointer(extension, key);
            let texture = if is_alpha {
                self.alpha_texture_at(material, &pointer, document, None)?
            } else {
                self.texture_at(material, &pointer, document)
            };
            further.extend(texture.map(|texture| FurtherTexture { slot, texture }));
        }
        Ok(further)
    }

    /// The alpha channel of the texture that a JSON pointer names, as a grey texture; `None` without one.
    pub(super) fn alpha_texture_at(
        &mut self,
        material: &gltf::Material,
        pointer: &str,
        document: &gltf::Document,
        alpha_use: AlphaUse,
    ) -> Result<Option<Texture>> {
        let Some((texture, coordinates)) = self.named(material, pointer, document) else { return Ok(None) };
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
