//! KHR_materials_variants: named alternatives of the materials of primitives.

use serde_json::Value;

use super::document::items;

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

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn primitives_take_the_material_of_their_mapping() {
        let primitive = |material: u32| {
            json!({ "material": material, "extensions": { NAME: { "mappings": [
                { "material": 4, "variants": [0, 2] }, { "material": 5, "variants": [1] } ] } } })
        };
        let variants = json!({ NAME: { "variants": [{ "name": "a" }, { "name": "b" }, { "name": "c" }] } });
        let mut root = json!({ "extensions": variants, "meshes": [{ "primitives": [primitive(3), {}] }] });
        assert_eq!(names(&root), ["a", "b", "c"]);
        let before = root.clone();
        for (variant, material) in [(2, 4), (1, 5)] {
            choose(&mut root, variant);
            assert_eq!(root["meshes"][0]["primitives"], json!([primitive(material), {}]));
        }
        root = before.clone();
        choose(&mut root, 3);
        assert_eq!(root, before);
    }
}
