//! What a picture in the window follows from: plain data. Two that are equal have equal pictures.

use std::sync::Arc;

use crate::bvh::Preset;
use crate::effects::{Choices, EffectId};
use crate::film::ColourPipeline;
use crate::job::{CameraChoice, RenderSettings};
use crate::scene::{Camera, INLINE_NAME, Numerics, Projection, Scene};
use crate::world::StandardView;

/// Where the scene is seen from.
#[derive(Debug, Clone, PartialEq)]
pub enum CameraSource {
    /// A camera of the scene, by its index: moves as the animation says.
    Scene(usize),
    /// A camera that fits the scene.
    Fitted(StandardView),
    /// Wherever the user went, in the scene's own coordinates.
    Free(Camera),
}

/// How a picture is computed: what the two sides of a comparison may differ in.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// How far shading goes, how pixels are sampled, and which effects are on.
    pub choices: Choices,
    /// How exactly it is decided what a ray hits.
    pub numerics: Numerics,
    /// The numbers that light is added up in.
    pub pipeline: ColourPipeline,
}

impl Settings {
    /// Has an effect, or does without it, over what the scene says.
    pub fn switch(&mut self, effect: EffectId, on: bool) {
        self.set_switch(effect, if on { Some(None) } else { None });
    }

    /// Has an effect with a value, or with its own where that is `None`.
    pub fn set(&mut self, effect: EffectId, value: Option<&str>) {
        self.set_switch(effect, Some(value));
    }

    fn set_switch(&mut self, effect: EffectId, on: Option<Option<&str>>) {
        let Choices { with, without, .. } = &mut self.choices;
        with.retain(|typed| typed.split('=').next() != Some(effect.name()));
        without.retain(|name| *name != effect.name());
        match on {
            Some(Some(value)) => with.push(effect.with_value(value)),
            Some(None) => with.push(effect.name().to_owned()),
            None => without.push(effect.name().to_owned()),
        }
    }

    /// The value that an effect was given by the user.
    pub fn value(&self, effect: EffectId) -> Option<&str> {
        self.choices.with.iter().rev().find_map(|typed| typed.strip_prefix(effect.name())?.strip_prefix('='))
    }
}

/// Files that were opened.
#[derive(Debug)]
pub struct Opened {
    /// What they hold.
    pub scene: Scene,
    /// Where they are first seen from.
    pub camera_source: CameraSource,
    /// The projection that the user wants instead of the camera's own.
    pub projection: Option<Projection>,
    /// Width and height of the picture that the scene calls for, in pixels.
    pub size: [u32; 2],
    /// How the picture is computed at first.
    pub settings: Settings,
    /// How much work is spent on building.
    pub preset: Preset,
}

/// A picture that is wanted.
#[derive(Debug, Clone)]
pub struct RenderRequest {
    /// Which scene.
    pub opened: Arc<Opened>,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Where it is seen from.
    pub camera_source: CameraSource,
    /// The projection, instead of the camera's own.
    pub projection: Option<Projection>,
    /// The moment of its animation, 0 being the beginning and 1 the end.
    pub time: f64,
    /// What is shown of it.
    pub display_mode: super::false_colour::DisplayMode,
    /// Whether the next moment will follow at once: what is not there soon is not seen.
    pub is_playing: bool,
    /// How it is computed; a second time where two ways are compared.
    pub sides: Vec<Settings>,
}

impl RenderRequest {
    /// The settings of `kiln render` for the picture of a side.
    pub fn render_settings(&self, side: usize) -> RenderSettings {
        let Settings { choices, numerics, pipeline } = &self.sides[side];
        RenderSettings {
            camera: match &self.camera_source {
                CameraSource::Scene(index) => CameraChoice::Named(index.to_string()),
                CameraSource::Fitted(view) => CameraChoice::Fitted(*view),
                CameraSource::Free(camera) => {
                    CameraChoice::Given(Camera { name: INLINE_NAME.to_owned(), ..camera.clone() })
                }
            },
            projection: self.projection,
            size: Some(self.size),
            sampling: choices.sampling,
            numerics: Some(*numerics),
            preset: self.opened.preset,
            shading: choices.shading,
            with: choices.with.clone(),
            without: choices.without.clone(),
            colour: Some(*pipeline),
            ..RenderSettings::default()
        }
    }
}

impl PartialEq for RenderRequest {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.opened, &other.opened)
            && self.size == other.size
            && self.camera_source == other.camera_source
            && self.projection == other.projection
            && self.time == other.time
            && self.display_mode == other.display_mode
            && self.is_playing == other.is_playing
            && self.sides == other.sides
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::id;

    #[test]
    fn the_last_word_on_an_effect_counts() {
        let mut settings = Settings {
            choices: Choices { with: vec!["glaze=every-bounce".into()], ..Choices::default() },
            numerics: Numerics::default(),
            pipeline: ColourPipeline::default(),
        };
        assert_eq!(settings.value(id::GLAZE), Some("every-bounce"));
        settings.switch(id::GLAZE, false);
        assert_eq!(
            (settings.choices.with.len(), settings.choices.without.as_slice()),
            (0, &["glaze".to_owned()][..])
        );
        settings.set(id::GLAZE, Some("2"));
        assert_eq!((settings.value(id::GLAZE), settings.choices.without.len()), (Some("2"), 0));
        settings.switch(id::GLAZE, true);
        assert_eq!(
            (settings.value(id::GLAZE), settings.choices.with.as_slice()),
            (None, &["glaze".to_owned()][..])
        );
    }
}
