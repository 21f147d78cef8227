//! The metallic-roughness materials of scene files.

use schemars::JsonSchema;
use serde::Deserialize;

use crate::film::Colour;
use crate::import::formats::scene_file::fault::{Fault, unit};
use crate::import::formats::scene_file::material::{emission, opacity};
use crate::import::formats::scene_file::sections::MaterialSection;
use crate::scene::{ColourValue, Layers, MetallicRoughness, Volume};

/// Layers and medium of a metallic-roughness material, as in the extensions of glTF.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LayersSection {
    /// Index of refraction, 1 or more, or 0 for one that reflects everything; 1.5 if not given.
    pub ior: Option<f64>,
    /// Weight of the reflection of a dielectric, 0 to 1; 1 if not given.
    pub specular: Option<f64>,
    /// Factor of the reflectance of a dielectric at normal incidence; white if not given.
    pub specular_colour: Option<ColourValue>,
    /// Part of the light that is transmitted instead of scattered diffusely, 0 to 1; 0 if not given.
    pub transmission: Option<f64>,
    /// Whether the surface encloses a volume, which refracts; if not, it is a thin wall.
    #[serde(default)]
    pub volume: bool,
    /// Transmittance of the volume over `attenuation_distance`; white if not given.
    pub attenuation_colour: Option<ColourValue>,
    /// The distance of `attenuation_colour`; infinite if not given.
    pub attenuation_distance: Option<f64>,
    /// Weight of a clear coat, 0 to 1; 0 if not given.
    pub clearcoat: Option<f64>,
    /// Roughness of the clear coat, 0 to 1; 0 if not given.
    pub clearcoat_roughness: Option<f64>,
    /// Colour of the sheen of cloth; none if not given.
    pub sheen_colour: Option<ColourValue>,
    /// Roughness of the sheen, 0 to 1; 0 if not given.
    pub sheen_roughness: Option<f64>,
    /// Strength of the anisotropy, 0 to 1: how much rougher the surface is along its tangents; 0 if not given.
    pub anisotropy: Option<f64>,
    /// Angle of the rougher direction from the tangent in degrees, counterclockwise; 0 if not given.
    pub anisotropy_rotation: Option<f64>,
}

/// Converts a material with `roughness`, `metallic` or `layers`.
pub(super) fn metallic_roughness(name: &str, s: &MaterialSection) -> Result<MetallicRoughness, Fault> {
    let of_phong = [
        ("ambient", s.ambient.is_some()),
        ("diffuse", s.diffuse.is_some()),
        ("specular", s.specular.is_some()),
        ("shininess", s.shininess.is_some()),
        ("glaze", s.glaze.is_some()),
    ];
    if let Some((key, _)) = of_phong.into_iter().find(|(_, given)| *given) {
        let what = format!("material `{name}` has `{key}` beside `roughness`, `metallic` or `layers`");
        return Err(Fault::new(what, "give the keys of one model: Phong or metallic-roughness"));
    }
    let unit = |key, value: Option<f64>, default| unit(key, value.unwrap_or(default));
    let layers = s.layers.clone().unwrap_or_default();
    let ior = layers.ior.unwrap_or(1.5);
    if !(ior == 0.0 || ior >= 1.0 && ior.is_finite()) {
        return Err(Fault::new(format!("`ior` is {ior}"), "give a number from 1, or 0"));
    }
    let attenuation_distance = layers.attenuation_distance.unwrap_or(f64::INFINITY);
    if attenuation_distance.is_nan() || attenuation_distance <= 0.0 {
        let what = format!("`attenuation_distance` is {attenuation_distance}");
        return Err(Fault::new(what, "give a distance above 0"));
    }
    let rotation = layers.anisotropy_rotation.unwrap_or(0.0);
    if !rotation.is_finite() {
        let what = format!("`anisotropy_rotation` is {rotation}");
        return Err(Fault::new(what, "give an angle in degrees"));
    }
    let attenuation_colour = Colour::from_u8(layers.attenuation_colour.map_or([255; 3], |colour| colour.0));
    let none = Layers::default();
    Ok(MetallicRoughness {
        name: name.to_owned(),
        base_colour: Colour::from_u8(s.colour.0),
        metallic: unit("metallic", s.metallic, 0.0)?,
        roughness: unit("roughness", s.roughness, 1.0)?,
        emission: emission(s)?,
        opacity: opacity(s)?,
        layers: Layers {
            ior,
            specular: unit("specular", layers.specular, 1.0)?,
            specular_colour: layers
                .specular_colour
                .map_or(none.specular_colour, |colour| Colour::from_u8(colour.0)),
            transmission: unit("transmission", layers.transmission, 0.0)?,
            volume: layers.volume.then_some(Volume { attenuation_colour, attenuation_distance }),
            clearcoat: unit("clearcoat", layers.clearcoat, 0.0)?,
            clearcoat_roughness: unit("clearcoat_roughness", layers.clearcoat_roughness, 0.0)?,
            sheen_colour: layers.sheen_colour.map_or(none.sheen_colour, |colour| Colour::from_u8(colour.0)),
            sheen_roughness: unit("sheen_roughness", layers.sheen_roughness, 0.0)?,
            anisotropy: unit("anisotropy", layers.anisotropy, 0.0)?,
            anisotropy_rotation: rotation.to_radians(),
        },
        double_sided: s.double_sided.unwrap_or(true),
        ..MetallicRoughness::default()
    })
}
