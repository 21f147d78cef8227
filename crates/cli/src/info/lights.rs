//! Lights and the environment of a scene.

use serde_json::{Value, json};

use kiln::film::ColourPipeline;
use kiln::scene::{Environment, EnvironmentSource, Light};

pub(super) fn text(light: &Light) -> String {
    format!("{} ({}, intensity {})", light.name, light.kind.name(), light.intensity as f32)
}

pub(super) fn environment_to_json(environment: &Environment) -> Value {
    let source = match &environment.source {
        EnvironmentSource::Image(image) => {
            json!({ "type": "image", "name": image.name, "width": image.width, "height": image.height })
        }
        EnvironmentSource::Sky => json!({ "type": "sky" }),
        EnvironmentSource::Colour(colour) => {
            json!({ "type": "colour", "colour": colour.to_pipeline(ColourPipeline::Linear).to_array() })
        }
    };
    json!({ "source": source, "intensity": environment.intensity, "hidden": environment.is_hidden })
}

pub(super) fn environment_text(environment: &Environment) -> String {
    let source = match &environment.source {
        EnvironmentSource::Image(image) => format!("{} ({} x {})", image.name, image.width, image.height),
        EnvironmentSource::Sky => "sky".into(),
        EnvironmentSource::Colour(_) => "one colour".into(),
    };
    format!("{source}, intensity {}", environment.intensity as f32)
}
