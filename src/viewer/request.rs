//! Render requests of the viewer, as plain data: equal requests have equal pictures.

use std::sync::Arc;

use crate::bvh::Preset;
use crate::effects::{Choices, EffectId};
use crate::film::{ColourPipeline, DisplaySettings};
use crate::job::{CameraChoice, EnvironmentSettings, RenderSettings};
use crate::scene::{Camera, INLINE_NAME, Numerics, Projection, Scene};
use crate::world::StandardView;

/// Camera of the viewer.
#[derive(Debug, Clone, PartialEq)]
pub enum CameraSource {
    /// A camera of the scene by its index, animated if the scene animates it.
    Scene(usize),
    /// A standard view that is fitted to the scene.
    Fitted(StandardView),
    /// A camera moved by the user, in scene coordinates.
    Free(Camera),
}

/// Render settings that the two sides of a comparison may differ in.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Shading mode, sampling and effects.
    pub choices: Choices,
    /// Numerics tier of intersection.
    pub numerics: Numerics,
    /// Colour pipeline: number format of radiance.
    pub pipeline: ColourPipeline,
    /// Exposure and tone map, used if the pipeline is linear.
    pub display: DisplaySettings,
    /// Whether a scene without lights gets a headlight.
    pub headlight: bool,
}

impl Settings {
    /// Enables or disables an effect, overriding the scene.
    pub fn switch(&mut self, effect: EffectId, on: bool) {
        self.set_switch(effect, if on { Some(None) } else { None });
    }

    /// Enables an effect with a value; `None` for its default value.
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

    /// The value that the user set for an effect.
    pub fn value(&self, effect: EffectId) -> Option<&str> {
        self.choices.with.iter().rev().find_map(|typed| typed.strip_prefix(effect.name())?.strip_prefix('='))
    }
}

/// Opened input files.
#[derive(Debug)]
pub struct Opened {
    /// Scene of all files.
    pub scene: Scene,
    /// Initial camera.
    pub camera_source: CameraSource,
    /// Projection that overrides the camera's.
    pub projection: Option<Projection>,
    /// Width and height in pixels that the scene specifies.
    pub size: [u32; 2],
    /// Initial render settings.
    pub settings: Settings,
    /// Settings of the environment, which the scene has already.
    pub environment: EnvironmentSettings,
    /// Preset of the tree build.
    pub preset: Preset,
}

/// Request for a picture.
#[derive(Debug, Clone)]
pub(crate) struct RenderRequest {
    /// Scene and files.
    pub opened: Arc<Opened>,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Camera.
    pub camera_source: CameraSource,
    /// Projection that overrides the camera's.
    pub projection: Option<Projection>,
    /// Animation time: 0 is the start and 1 the end.
    pub time: f64,
    /// Displayed quantity: the picture or false colours.
    pub display_mode: super::false_colour::DisplayMode,
    /// Whether the animation plays, so that this picture has the time of one frame.
    pub is_playing: bool,
    /// Render settings: one entry, or two for a comparison.
    pub sides: Vec<Settings>,
}

impl RenderRequest {
    /// The settings of `kiln render` for the picture of `sides[side]`.
    pub(crate) fn render_settings(&self, side: usize) -> RenderSettings {
        let Settings { choices, numerics, pipeline, display, headlight } = &self.sides[side];
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
            transport: choices.transport,
            clamp: choices.clamp,
            with: choices.with.clone(),
            without: choices.without.clone(),
            colour: Some(*pipeline),
            display: display.in_pipeline(*pipeline),
            headlight: (!headlight).then_some(false),
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
            display: DisplaySettings::default(),
            headlight: true,
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
