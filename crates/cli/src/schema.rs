//! `kiln schema`: the JSON schema of scene files.

use kiln::effects::EFFECTS;
use kiln::import::SceneFile;

/// The JSON schema of scene files, with the names of the effects.
pub(super) fn schema() -> serde_json::Value {
    let mut schema = SceneFile::schema();
    let mut names = serde_json::Map::new();
    for effect in EFFECTS {
        let types =
            if effect.value.is_some() { ["boolean", "number", "string"].as_slice() } else { &["boolean"] };
        let entry = serde_json::json!({ "description": effect.summary, "type": types });
        names.insert(effect.name().into(), entry);
    }
    if let Some(section) = schema.pointer_mut("/properties/effects").and_then(|s| s.as_object_mut()) {
        section.insert("properties".into(), names.into());
        section.insert("additionalProperties".into(), false.into());
    }
    schema
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_can_be_said_in_a_scene_file() {
        let schema = schema();
        for effect in EFFECTS {
            let text = format!("[effects]\n{} = true\n", effect.id);
            let file = SceneFile::parse(&text, std::path::Path::new("a.toml")).unwrap();
            assert!(file.effects[effect.name()].get_ref().is_on());
            assert!(schema["properties"]["effects"]["properties"][effect.name()].is_object());
            assert!(!effect.summary.is_empty() && !effect.source.is_empty());
        }
    }
}
