//! Where the textures of a material lie: sets of texture coordinates and KHR_texture_transform.
//!
//! Transforms are applied to the texture coordinates of the meshes when they are read: each pair of set and transform
//! that a material uses becomes one of [`crate::scene::Mesh::uvs`].

use glam::{DAffine2, DMat2, DVec2};
use serde_json::Value;

use crate::import::formats::gltf::document::TEXTURE_TRANSFORM;
use crate::import::formats::gltf::{Loader, layers, specular_glossiness};
use crate::scene::{Attribute, TEXTURE_SLOTS, Texture};

/// The set of texture coordinates of a texture, and their transform.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Coordinates {
    set: u32,
    transform: DAffine2,
}

impl Coordinates {
    /// Those of a textureInfo object.
    fn of(info: &Value) -> Self {
        let transform = &info["extensions"][TEXTURE_TRANSFORM];
        let set = |value: &Value| value["texCoord"].as_u64().and_then(|set| u32::try_from(set).ok());
        let pair = |key: &str, default: f64| {
            DVec2::from([0, 1].map(|i| layers::number(transform[key].get(i), default)))
        };
        let (sin, cos) = layers::number(transform.get("rotation"), 0.0).sin_cos();
        // Counterclockwise as a picture is seen, whose v grows downwards. The code in the text of the extension turns
        // the other way; viewers, and the model TextureTransformTest, agree on this (glTF issue 1563).
        let rotation = DMat2::from_cols(DVec2::new(cos, -sin), DVec2::new(sin, cos));
        let matrix = rotation * DMat2::from_diagonal(pair("scale", 1.0));
        Coordinates {
            set: set(transform).or_else(|| set(info)).unwrap_or(0),
            transform: DAffine2::from_mat2_translation(matrix, pair("offset", 0.0)),
        }
    }
}

/// The coordinates of all textures of a material, each once, those of its base colour first.
pub(super) fn coordinates(material: &Value) -> Vec<Coordinates> {
    let pointers =
        specular_glossiness::POINTERS.into_iter().chain(TEXTURE_SLOTS.iter().map(|slot| slot.gltf));
    let mut all = Vec::new();
    for info in pointers.filter_map(|pointer| material.pointer(pointer)) {
        let one = Coordinates::of(info);
        if !all.contains(&one) {
            all.push(one);
        }
    }
    all
}

impl<'a> Loader<'a> {
    /// The JSON of a material.
    pub(super) fn json_of(&self, material: &gltf::Material) -> &'a Value {
        material.index().map_or(&Value::Null, |index| &self.root["materials"][index])
    }

    /// The texture of a material that a JSON pointer names, and its index in [`crate::scene::Mesh::uvs`]; `None` without
    /// it, or if it does not exist, with a warning.
    pub(super) fn named(
        &mut self,
        material: &gltf::Material,
        pointer: &str,
    ) -> Option<(gltf::Texture<'a>, u8)> {
        let place = self.coordinates_at(material, pointer);
        let index = self.json_of(material).pointer(pointer)?["index"]
            .as_u64()
            .and_then(|index| usize::try_from(index).ok());
        let texture = index.and_then(|index| self.document.textures().nth(index));
        if texture.is_none() {
            let name = material.name().unwrap_or("without a name");
            let key = pointer.rsplit('/').next().unwrap_or(pointer);
            self.left_out(format!("material {name}: its {key} does not exist; left out"));
        }
        Some((texture?, place?))
    }

    /// The texture of a material that a JSON pointer names.
    pub(super) fn texture_at(&mut self, material: &gltf::Material, pointer: &str) -> Option<Texture> {
        let (texture, coordinates) = self.named(material, pointer)?;
        Some(Texture { coordinates, ..self.texture(&texture)? })
    }

    /// The index in [`crate::scene::Mesh::uvs`] of the texture of a material that a JSON pointer names; `None` without it.
    pub(super) fn coordinates_at(&self, material: &gltf::Material, pointer: &str) -> Option<u8> {
        let json = self.json_of(material);
        let own = Coordinates::of(json.pointer(pointer)?);
        let place = coordinates(json).iter().position(|coordinates| *coordinates == own)?;
        u8::try_from(place).ok()
    }

    /// The texture coordinates of a primitive with `count` vertices, for each of its material's [`coordinates`]; those of
    /// sets that it does not have are 0, with a warning. Empty if it has none of the sets.
    pub(super) fn uvs(
        &mut self,
        primitive: &gltf::Primitive,
        name: &str,
        count: usize,
    ) -> Vec<Attribute<DVec2>> {
        let mut coordinates = coordinates(self.json_of(&primitive.material()));
        if coordinates.is_empty() {
            coordinates.push(Coordinates { set: 0, transform: DAffine2::IDENTITY });
        }
        let values = |coordinates: &Coordinates| {
            let accessor = self.attribute(primitive, &gltf::Semantic::TexCoords(coordinates.set))?;
            let values = self.vectors::<2>(&accessor).filter(|values| values.len() == count)?;
            Some(values.into_iter().map(|uv| coordinates.transform.transform_point2(uv.into())).collect())
        };
        let all: Vec<Option<Vec<DVec2>>> = coordinates.iter().map(values).collect();
        if all.iter().all(Option::is_none) {
            return Vec::new();
        }
        if let Some(missing) = all.iter().position(Option::is_none) {
            let set = coordinates[missing].set;
            self.left_out(format!("{name}: a texture of its material is on set {set} of texture coordinates, which it does not have"));
        }
        let or_zero = |values: Option<_>| values.unwrap_or_else(|| vec![DVec2::ZERO; count]);
        all.into_iter().map(|values| Attribute::per_position(or_zero(values))).collect()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn coordinates_of_a_material_are_listed_once() {
        let moved = json!({ "index": 0, "extensions": { TEXTURE_TRANSFORM: { "offset": [1, 0] } } });
        let material = json!({
            "occlusionTexture": { "index": 0, "texCoord": 1 },
            "pbrMetallicRoughness": { "baseColorTexture": { "index": 3 }, "metallicRoughnessTexture": moved },
            "extensions": { "KHR_materials_sheen": { "sheenColorTexture": { "index": 0, "texCoord": 2 } } },
        });
        let found: Vec<(u32, f64)> =
            coordinates(&material).iter().map(|c| (c.set, c.transform.translation.x)).collect();
        assert_eq!(found, [(0, 0.0), (0, 1.0), (1, 0.0), (2, 0.0)]);
    }
}
