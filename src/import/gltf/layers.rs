//! The material extensions of glTF that are layers and media: index of refraction, specular, transmission, volume, clear
//! coat and sheen. Their textures are left out, with a warning by the caller.

use glam::DVec3;
use gltf::json::Value;

use crate::film::Colour;
use crate::scene::{Layers, Volume};

pub(super) const IOR: &str = "KHR_materials_ior";
pub(super) const SPECULAR: &str = "KHR_materials_specular";
pub(super) const TRANSMISSION: &str = "KHR_materials_transmission";
pub(super) const VOLUME: &str = "KHR_materials_volume";
pub(super) const CLEARCOAT: &str = "KHR_materials_clearcoat";
pub(super) const SHEEN: &str = "KHR_materials_sheen";

/// All of them.
pub(super) const ALL: [&str; 6] = [IOR, SPECULAR, TRANSMISSION, VOLUME, CLEARCOAT, SHEEN];

/// The values of a material's extensions, clamped to the ranges of the format.
pub(super) fn layers(material: &gltf::Material) -> Layers {
    let value = |extension: &str, key: &str| material.extension_value(extension).and_then(|v| v.get(key));
    let number = |extension, key, default: f64| {
        value(extension, key).and_then(Value::as_f64).filter(|x| x.is_finite()).unwrap_or(default)
    };
    let unit = |extension, key, default| number(extension, key, default).clamp(0.0, 1.0);
    let colour = |extension, key, default: DVec3, most: f64| {
        let channels = value(extension, key).and_then(Value::as_array);
        let channel = |i: usize| channels.and_then(|c| c.get(i)?.as_f64()).filter(|x| x.is_finite());
        let [r, g, b] = [0, 1, 2].map(|i| channel(i).unwrap_or(default[i]).clamp(0.0, most));
        Colour::Linear(DVec3::new(r, g, b))
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

/// Whether an extension of the material has a texture, none of which is read.
pub(super) fn has_textures(material: &gltf::Material) -> bool {
    let has_texture = |value: &Value| {
        value.as_object().is_some_and(|object| object.keys().any(|key| key.ends_with("Texture")))
    };
    ALL.into_iter().filter_map(|name| material.extension_value(name)).any(has_texture)
}
