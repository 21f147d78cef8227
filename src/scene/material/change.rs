//! Changes of single values of materials.

use serde::Deserialize;

use crate::film::Colour;
use crate::scene::{ColourValue, Layers, Material, MetallicRoughness, Phong};

/// Values of a material in place of its own; textures stay, and multiply them.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialChange {
    /// The colour; of a metallic-roughness material its base colour.
    pub colour: Option<ColourValue>,
    /// 0 for a dielectric, 1 for a metal. A Phong material becomes a metallic-roughness one.
    pub metallic: Option<f64>,
    /// 0 for a mirror, 1 for a fully rough surface. A Phong material becomes a metallic-roughness one.
    pub roughness: Option<f64>,
}

impl MaterialChange {
    /// A material with these values.
    pub fn of(&self, material: Material) -> Material {
        let is_metallic_roughness = self.metallic.is_some() || self.roughness.is_some();
        let colour = self.colour.map(|colour| Colour::from_u8(colour.0));
        match material {
            Material::Phong(m) if !is_metallic_roughness => {
                Material::Phong(Phong { colour: colour.unwrap_or(m.colour), ..m })
            }
            Material::Phong(m) => self.of(Material::MetallicRoughness(m.into())),
            Material::MetallicRoughness(m) => Material::MetallicRoughness(MetallicRoughness {
                base_colour: colour.unwrap_or(m.base_colour),
                metallic: self.metallic.unwrap_or(m.metallic),
                roughness: self.roughness.unwrap_or(m.roughness),
                ..m
            }),
        }
    }
}

impl From<Phong> for MetallicRoughness {
    /// Its colour and textures on a dielectric, as rough as its highlight is wide: the exponent n of Blinn and Phong is
    /// about 2 / alpha^2 - 2 of a microfacet distribution (Walter et al. 2007, section 5.2), and alpha the roughness
    /// squared. Without a highlight it is fully rough.
    fn from(m: Phong) -> Self {
        let alpha = (2.0 / (m.shininess + 2.0)).sqrt();
        MetallicRoughness {
            name: m.name,
            base_colour: m.colour,
            metallic: 0.0,
            roughness: if m.specular > 0.0 { alpha.sqrt().min(1.0) } else { 1.0 },
            emission: m.emission,
            unlit: false,
            opacity: m.opacity,
            layers: Layers::default(),
            double_sided: m.double_sided,
            textures: m.textures,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_values_change_and_the_others_stay() {
        let own = Material::MetallicRoughness(MetallicRoughness {
            roughness: 0.7,
            opacity: Some(crate::scene::Opacity { factor: 0.5, cutoff: None }),
            ..Phong::default().into()
        });
        let change = MaterialChange { metallic: Some(1.0), ..MaterialChange::default() };
        let Material::MetallicRoughness(m) = change.of(own) else { panic!("another model") };
        assert_eq!((m.metallic, m.roughness, m.opacity.map(|o| o.factor)), (1.0, 0.7, Some(0.5)));
        assert_eq!(m.base_colour, Phong::default().colour);
    }

    /// An exponent of 30 is an alpha of sqrt(2 / 32) = 1/4, a roughness of 1/2. A colour alone leaves the model.
    #[test]
    fn phong_materials_become_metallic_roughness_where_a_value_needs_it() {
        let own = Phong { specular: 0.3, shininess: 30.0, ..Phong::default() };
        let red = MaterialChange { colour: Some(ColourValue([255, 0, 0])), ..MaterialChange::default() };
        let Material::Phong(m) = red.of(Material::Phong(own.clone())) else { panic!("another model") };
        assert_eq!((m.colour, m.shininess), (Colour::from_u8([255, 0, 0]), 30.0));
        let metal = MaterialChange { metallic: Some(1.0), ..red };
        let Material::MetallicRoughness(m) = metal.of(Material::Phong(own)) else { panic!("the same model") };
        assert_eq!((m.base_colour, m.metallic, m.roughness), (Colour::from_u8([255, 0, 0]), 1.0, 0.5));
    }
}
