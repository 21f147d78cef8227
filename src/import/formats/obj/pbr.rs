//! MTL materials with the keys of physically based rendering, as Blender exports them: `Pr`, `Pm`, `Ps`, `Pc`, `Pcr`,
//! `Ni`, `Tf`, `map_Pr`, `map_Pm`, `map_Ke`. A key without a number stands aside for its map.
//!
//! Colours of such materials are linear, as Blender writes them; those of other MTL materials are display values.

use glam::DVec3;

use crate::error::Result;
use crate::film::Colour;
use crate::import::formats::obj::material::{Converter, has_highlight};
use crate::import::formats::obj::mtl::Definition;
use crate::import::images::Channels;
use crate::scene::{Layers, MetallicRoughness, Refraction, TextureSlot, Textures, Volume};

/// Roughness of the sheen, which MTL cannot say: the default of Blender's Principled BSDF.
const SHEEN_ROUGHNESS: f64 = 0.5;

/// Maps that this module reads.
pub(crate) const MAPS: [&str; 3] = ["map_Pr", "map_Pm", "map_Ke"];

/// The number of a key, if it is finite.
pub(super) fn number(m: &tobj::Material, key: &str) -> Option<f64> {
    m.unknown_param.get(key)?.trim().parse().ok().filter(|number: &f64| number.is_finite())
}

/// The three numbers of `Tf`.
pub(super) fn filter(m: &tobj::Material) -> Option<DVec3> {
    let mut numbers = m.unknown_param.get("Tf")?.split_whitespace().map(str::parse::<f64>);
    let mut next = || numbers.next()?.ok().map(|number| number.clamp(0.0, 1.0));
    Some(DVec3::new(next()?, next()?, next()?))
}

/// Whether a material has one of the keys.
pub(crate) fn is_physically_based(m: &tobj::Material) -> bool {
    ["Pr", "Pm", "Ps", "Pc"].into_iter().any(|key| number(m, key).is_some())
        || ["map_Pr", "map_Pm"].into_iter().any(|key| m.unknown_param.contains_key(key))
}

impl Converter<'_> {
    /// Converts a physically based material, to whose textures those of its own keys are added.
    pub(super) fn physically_based(
        &mut self,
        definition: &Definition,
        mut textures: Textures,
    ) -> Result<MetallicRoughness> {
        let m = &definition.material;
        let unit_of = |key: &str, default: f64| number(m, key).unwrap_or(default).clamp(0.0, 1.0);
        let mut image = |key: &str| self.image(m.unknown_param.get(key), Channels::Colour);
        let [roughness_map, metallic_map, emission_map] =
            [image("map_Pr")?, image("map_Pm")?, image("map_Ke")?];
        let file = &self.source.file;
        let both = self.images.metallic_roughness(self.scene, roughness_map, metallic_map, file)?;
        let first = if roughness_map.is_some() { "map_Pr" } else { "map_Pm" };
        let colour = |value: Option<[f64; 3]>, default: f64| {
            Colour::Linear(value.map_or(DVec3::splat(default), DVec3::from))
        };
        let transmission = filter(m).map_or(0.0, |filter| filter.element_sum() / 3.0);
        // Exporters without an index write 1.
        let ior = m.optical_density.filter(|ior| *ior > 1.0 || *ior == 1.0 && transmission > 0.0);
        let has_colours = textures[TextureSlot::BaseColour].is_some();
        textures[TextureSlot::MetallicRoughness] = both.map(|image| definition.texture(image, first));
        textures[TextureSlot::Emission] = emission_map.map(|image| definition.texture(image, "map_Ke"));
        Ok(MetallicRoughness {
            name: m.name.clone(),
            base_colour: colour(m.diffuse, if has_colours { 1.0 } else { 0.8 }),
            metallic: unit_of("Pm", if metallic_map.is_some() { 1.0 } else { 0.0 }),
            roughness: unit_of("Pr", 1.0),
            emission: colour(m.emissive, if emission_map.is_some() { 1.0 } else { 0.0 }),
            layers: Layers {
                ior: ior.unwrap_or(1.5),
                specular: f64::from(u8::from(has_highlight(m))),
                transmission,
                volume: (transmission > 0.0).then_some(Volume {
                    attenuation_colour: Colour::Linear(DVec3::ONE),
                    attenuation_distance: f64::INFINITY,
                }),
                clearcoat: unit_of("Pc", 0.0),
                clearcoat_roughness: unit_of("Pcr", 0.0),
                sheen_colour: Colour::Linear(DVec3::splat(unit_of("Ps", 0.0))),
                sheen_roughness: SHEEN_ROUGHNESS,
                ..Layers::default()
            },
            textures,
            ..MetallicRoughness::default()
        })
    }
}

/// The glass of a material without those keys: `illum` 4, 6, 7 or 9, and an index `Ni` above 1. Some exporters write
/// such an `illum` for opaque materials, with an index of 1, or with `d` below 1 for alpha, without `Tf`.
pub(crate) fn refraction(m: &tobj::Material) -> Option<Refraction> {
    let ior = m.optical_density.filter(|ior| *ior > 1.0)?;
    let is_glass = matches!(m.illumination_model, Some(4 | 6 | 7 | 9));
    let is_alpha = m.dissolve.is_some_and(|d| d < 1.0);
    let filter = match filter(m) {
        None if is_alpha => return None,
        filter => filter.unwrap_or(DVec3::ONE),
    };
    (is_glass && filter != DVec3::ZERO).then_some(Refraction { ior, filter: Colour::Linear(filter) })
}
