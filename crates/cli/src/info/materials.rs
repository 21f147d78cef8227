//! What the materials of a scene use.

use serde_json::{Map, Value, json};

use super::Lines;
use kiln::effects::id;
use kiln::film::{Colour, ColourPipeline};
use kiln::scene::{ImageId, Layers, Material, Scene, TextureSlot};

/// Materials that the text describes.
const MOST: usize = 16;

/// A feature that a material uses: its key and value in JSON, and its text.
struct Feature {
    key: &'static str,
    value: Value,
    /// Empty for what the list of textures says.
    text: String,
}

pub(super) fn to_json(scene: &Scene) -> Vec<Value> {
    let used = uses(scene);
    let describe = |(material, used): (&Material, usize)| {
        let mut object = Map::new();
        object.insert("name".into(), json!(material.name()));
        object.insert("model".into(), json!(model(material)));
        object.insert("objects".into(), json!(used));
        let image = |image: ImageId| &scene.images[image.0 as usize].name;
        let textures =
            textures(material).into_iter().map(|(slot, id)| json!({ "slot": slot, "image": image(id) }));
        object.insert("textures".into(), textures.collect());
        object.extend(features(material).into_iter().map(|feature| (feature.key.into(), feature.value)));
        Value::Object(object)
    };
    scene.materials.iter().zip(used).map(describe).collect()
}

/// Adds a line for each material.
pub(super) fn add(lines: &mut Lines, scene: &Scene) {
    let described = scene.materials.iter().zip(uses(scene)).filter_map(|(material, used)| {
        let mut texts: Vec<String> = features(material).into_iter().map(|feature| feature.text).collect();
        let textures: Vec<&str> = textures(material).into_iter().map(|(slot, _)| slot).collect();
        texts.retain(|text| !text.is_empty());
        if !textures.is_empty() {
            texts.push(format!("textures: {}", textures.join(", ")));
        }
        if used == 0 && !texts.is_empty() {
            texts.push("unused".into());
        }
        let texts = texts.join("; ");
        (!texts.is_empty()).then(|| format!("{} ({}): {texts}", material.name(), model(material)))
    });
    let described: Vec<String> = described.collect();
    described.iter().take(MOST).for_each(|text| lines.add("material", text));
    if let more @ 1.. = described.len().saturating_sub(MOST) {
        lines.add("material", format!("{more} more; --json lists all"));
    }
}

/// The number of objects of each material.
fn uses(scene: &Scene) -> Vec<usize> {
    let mut uses = vec![0; scene.materials.len()];
    scene.objects.iter().for_each(|object| uses[object.material.0 as usize] += 1);
    uses
}

fn model(material: &Material) -> &'static str {
    match material {
        Material::Phong(_) => "phong",
        Material::MetallicRoughness(_) => "metallic-roughness",
    }
}

/// The textures of a material: what each is for, and its image.
fn textures(material: &Material) -> Vec<(&'static str, ImageId)> {
    material.textures().iter().map(|(slot, texture)| (slot.entry().name, texture.image)).collect()
}

fn features(material: &Material) -> Vec<Feature> {
    let mut features = Vec::new();
    let mut add = |key, value: Value, text: String| features.push(Feature { key, value, text });
    let [r, g, b] = linear(*material.colour());
    add("colour", json!([r, g, b]), format!("colour ({}, {}, {})", r as f32, g as f32, b as f32));
    if let Material::MetallicRoughness(m) = material {
        add("metallic", json!(m.metallic), format!("metallic {}", m.metallic as f32));
        add("roughness", json!(m.roughness), format!("roughness {}", m.roughness as f32));
    }
    if let Material::MetallicRoughness(m) = material
        && m.unlit
    {
        add("unlit", json!(true), "unlit".into());
    }
    if let Some(opacity) = material.opacity() {
        let mode = if opacity.cutoff.is_some() { "mask" } else { "blend" };
        let value = json!({ "mode": mode, "factor": opacity.factor, "cutoff": opacity.cutoff });
        let cutoff = opacity.cutoff.map_or(String::new(), |cutoff| format!(", cutoff {}", cutoff as f32));
        add("opacity", value, format!("opacity by {mode}, factor {}{cutoff}", opacity.factor as f32));
    }
    if material.emits() {
        let [r, g, b] = linear(*material.emission());
        add("emission", json!([r, g, b]), format!("emission ({}, {}, {})", r as f32, g as f32, b as f32));
    }
    if material.textures()[TextureSlot::Normal].is_some() {
        let scale = material.textures().normal_scale;
        let text = if scale == 1.0 { String::new() } else { format!("normal map, scale {}", scale as f32) };
        add("normal_map", json!({ "scale": scale }), text);
    }
    match material {
        Material::Phong(m) => {
            if let Some(glaze) = &m.glaze {
                let value = json!({ "weight": glaze.weight, "bounces": glaze.bounces });
                let key = id::GLAZE.name();
                add(key, value, format!("{key} of weight {}", glaze.weight as f32));
            }
            if let Some(glass) = &m.refraction {
                add("refraction", json!({ "ior": glass.ior }), format!("glass, ior {}", glass.ior as f32));
            }
        }
        Material::MetallicRoughness(m) => add_layers(&m.layers, &mut add),
    }
    features
}

/// Adds the layers that differ from their defaults.
fn add_layers(layers: &Layers, add: &mut impl FnMut(&'static str, Value, String)) {
    let is_black = |colour: Colour| linear(colour) == [0.0; 3];
    let default = Layers::default();
    for (key, value, none) in layers.numbers() {
        if value != none {
            add(key, json!(value), format!("{key} {}", value as f32));
        }
    }
    if let Some(volume) = &layers.volume {
        let colour = linear(volume.attenuation_colour);
        // JSON has no infinity.
        let distance = Some(volume.attenuation_distance).filter(|distance| distance.is_finite());
        let value = json!({ "attenuation_colour": colour, "attenuation_distance": distance });
        add("volume", value, "volume".into());
    }
    if !is_black(layers.sheen_colour) {
        let colour = linear(layers.sheen_colour);
        add("sheen", json!({ "colour": colour, "roughness": layers.sheen_roughness }), "sheen".into());
    }
    if layers.specular != default.specular || layers.specular_colour != default.specular_colour {
        let value = json!({ "factor": layers.specular, "colour": linear(layers.specular_colour) });
        add("specular", value, format!("specular {}", layers.specular as f32));
    }
}

fn linear(colour: Colour) -> [f64; 3] {
    colour.to_pipeline(ColourPipeline::Linear).to_array()
}
