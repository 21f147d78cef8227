//! KHR_materials_variants: named alternatives of the materials of primitives.

use serde_json::Value;

use crate::import::formats::gltf::document::items;

pub(super) const NAME: &str = "KHR_materials_variants";

/// The names of the variants of a document.
pub(super) fn names(root: &Value) -> Vec<String> {
    let list = root["extensions"][NAME]["variants"].as_array();
    let name = |variant: &Value| variant["name"].as_str().unwrap_or_default().to_owned();
    list.into_iter().flatten().map(name).collect()
}

/// Gives the primitives their materials of a variant; those without a mapping keep theirs.
pub(super) fn choose(root: &mut Value, variant: usize) {
    for mesh in items(root, "meshes") {
        for primitive in items(mesh, "primitives") {
            let mappings = primitive["extensions"][NAME]["mappings"].as_array();
            let has_variant = |mapping: &&Value| {
                let variants = mapping["variants"].as_array();
                variants.into_iter().flatten().any(|index| index.as_u64() == Some(variant as u64))
            };
            let mapping = mappings.and_then(|mappings| mappings.iter().find(has_variant));
            let material = mapping.map(|mapping| mapping["material"].clone());
            if let (Some(material), Some(primitive)) = (material, primitive.as_object_mut()) {
                primitive.insert("material".to_owned(), material);
            }
        }
    }
}
