//! Render settings that users give in addition to the scene, as plain data.

pub(crate) mod options;

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use crate::bvh::Preset;
use crate::effects::{EffectId, id};
use crate::error::{Error, Result, Warnings};
use crate::farm::Shard;
use crate::film::{ColourPipeline, DisplaySettings, Window};
use crate::import;
use crate::scene::option::{group, options};
use crate::scene::{
    Camera, Environment, Intensity, Look, Object, PictureSettings, Projection, Rotation, Scene,
};
use crate::world::{Framing, StandardView};

/// Render settings. A field that is `None` or empty is taken from the scene, then from defaults.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RenderSettings {
    /// Choice of the camera.
    pub camera: CameraChoice,
    /// Object that an automatic camera frames, by name; all if `None`.
    pub look_at: Option<String>,
    /// Projection; that of the camera if `None`.
    pub projection: Option<Projection>,
    /// Maximum side length in pixels if neither size nor `crop` is given.
    pub longest_side: Option<u32>,
    /// Rectangle of the picture that is rendered.
    pub crop: Option<Window>,
    /// Shard of the tiles that is rendered.
    pub shard: Shard,
    /// Light from infinitely far away, instead of the scene's.
    pub environment: EnvironmentSettings,
    /// Effects to turn on, as `NAME` or `NAME=VALUE`.
    pub with: Vec<String>,
    /// Effects to turn off, by name.
    pub without: Vec<String>,
    /// Value of `--depth`, which is also in `with`; messages name that option.
    #[serde(skip)]
    pub depth: Option<u32>,
    /// Names of AOVs, as for `kiln render --aov`. They are part of the fingerprint.
    pub aovs: Vec<String>,
    /// Look of scenes without a scene file where [`PictureSettings::look`] chooses none.
    pub mesh_look: Look,
    /// Options of the picture, which scene files have, too.
    pub picture: PictureSettings,
    /// Build preset of the acceleration structure.
    pub preset: Preset,
}

impl From<PictureSettings> for RenderSettings {
    fn from(picture: PictureSettings) -> Self {
        RenderSettings { picture, ..RenderSettings::default() }
    }
}

impl RenderSettings {
    /// Turns an effect on or off, overriding the scene.
    pub fn switch(&mut self, effect: EffectId, on: bool) {
        self.set_switch(effect, if on { Some(None) } else { None });
    }

    /// Turns an effect on with a value; `None` for its default value.
    pub fn set(&mut self, effect: EffectId, value: Option<&str>) {
        self.set_switch(effect, Some(value));
    }

    /// Leaves an effect to the scene.
    pub fn leave(&mut self, effect: EffectId) {
        self.with.retain(|typed| typed.split('=').next() != Some(effect.name()));
        self.without.retain(|name| *name != effect.name());
        if effect == id::PATH {
            self.depth = None;
        }
    }

    fn set_switch(&mut self, effect: EffectId, on: Option<Option<&str>>) {
        self.leave(effect);
        match on {
            Some(Some(value)) => self.with.push(effect.with_value(value)),
            Some(None) => self.with.push(effect.name().to_owned()),
            None => self.without.push(effect.name().to_owned()),
        }
    }

    /// The value that the settings give an effect.
    pub fn value(&self, effect: EffectId) -> Option<&str> {
        self.with.iter().rev().find_map(|typed| typed.strip_prefix(effect.name())?.strip_prefix('='))
    }

    /// The look of a scene.
    pub fn look(&self, scene: &Scene) -> Look {
        let default = if scene.has_settings { Look::Draft } else { self.mesh_look };
        self.picture.or(scene.picture).look.unwrap_or(default)
    }

    /// How a fitted camera looks at a scene from a side, by these settings and those of the scene.
    pub fn framing(&self, view: StandardView, scene: &Scene) -> Framing {
        let mut framing = Framing::from(view);
        if self.look(scene) == Look::Studio {
            framing.field_of_view = crate::job::look::default_look::FIELD_OF_VIEW;
        }
        framing.with(&self.picture.or(scene.picture))
    }

    /// The settings without those that no look depends on. Of the camera, it depends on whether it is the files'.
    pub(crate) fn of_look(&self, scene: &Scene) -> Self {
        let camera = match self.camera.is_of_file(scene) {
            true => CameraChoice::Named(String::new()),
            false => CameraChoice::Fitted(StandardView::Auto),
        };
        let picture = PictureSettings {
            width: None,
            height: None,
            azimuth: None,
            elevation: None,
            zoom: None,
            fov: None,
            ..self.picture
        };
        RenderSettings {
            camera,
            look_at: None,
            projection: None,
            longest_side: None,
            picture,
            ..self.clone()
        }
    }

    /// The scene that a fitted camera frames: the objects of the name to look at alone, if there is one.
    ///
    /// # Errors
    /// [`Error::Usage`] if no object has that name.
    pub fn looked_at<'a>(&self, scene: &'a Scene) -> Result<Cow<'a, Scene>> {
        let Some(name) = &self.look_at else { return Ok(Cow::Borrowed(scene)) };
        let is_point = name.split(',').all(|number| number.trim().parse::<f64>().is_ok());
        let named = scene.objects_named(name, "--look-at").map_err(|e| match e {
            Error::Usage { what, .. } if is_point => {
                let camera = "--camera '{ position = [0, 1, 6], look_at = [0, 1, 0] }'";
                Error::usage(what, format!("a point is `look_at` of a camera: {camera}"))
            }
            e => e,
        })?;
        let objects: Vec<Object> = named.into_iter().map(|index| scene.objects[index].clone()).collect();
        Ok(Cow::Owned(Scene { objects, ..Scene::default() }))
    }
}

options! {
    /// Settings of the environment.
    #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct EnvironmentSettings {
        /// Environment light and background: an equirectangular .hdr or .exr image, `sky`, or a colour. Turns path tracing on
        /// [default: the scene's]
        [of(group::LIGHT).value_name("FILE|sky|COLOUR")] environment: Option<String>,
        /// Rotation of the environment about +y in degrees, counterclockwise seen from above
        [of(group::LIGHT).hyphens().value_name("DEG")] environment_rotation: Option<Rotation>,
        /// Factor of the radiance of the environment [default: the scene's, or 1]
        [of(group::LIGHT).value_name("FACTOR")] environment_intensity: Option<Intensity>,
        /// Light the scene by the environment, but show the background colour behind it [default: false]
        [of(group::LIGHT)] hide_environment: Option<bool>,
    }
}

impl EnvironmentSettings {
    /// The environment of a scene: that of these settings, or its own.
    ///
    /// # Errors
    /// [`Error::Input`] for a file that cannot be used, [`Error::Usage`] for settings of an environment that is not there.
    pub fn of(&self, scene: &Scene, warnings: &mut Warnings) -> Result<Option<Environment>> {
        let chosen = match &self.environment {
            Some(source) => {
                let source = import::environment(source, warnings)?;
                Some(Environment { source, rotation: 0.0, intensity: 1.0, is_hidden: false })
            }
            None => scene.environment.clone(),
        };
        let is_changed = self.environment_rotation.is_some()
            || self.environment_intensity.is_some()
            || self.hide_environment.is_some();
        if chosen.is_none() && is_changed {
            return Err(Error::usage(
                "there is no environment to rotate, scale or hide",
                "give one by --environment",
            ));
        }
        Ok(chosen.map(|own| Environment {
            rotation: self.environment_rotation.map_or(own.rotation, |degrees| degrees.get().to_radians()),
            intensity: self.environment_intensity.map_or(own.intensity, Intensity::get),
            is_hidden: self.hide_environment.unwrap_or(own.is_hidden),
            ..own
        }))
    }
}

/// What a scene is seen by.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CameraChoice {
    /// The first camera of the scene; one that fits the scene if it has none.
    #[default]
    Default,
    /// The camera of the scene with this name, or with this index, counted from 0.
    Named(String),
    /// A camera that fits the scene, from a standard side.
    Fitted(StandardView),
    /// A camera in the scene's coordinates.
    Given(Camera),
    /// The camera of the scene with this index, counted from 0, whatever its name is.
    Index(usize),
}

impl CameraChoice {
    /// Whether the camera was made for the files, rather than to frame the scene: one of theirs, or one that is given in
    /// its place.
    pub(crate) fn is_of_file(&self, scene: &Scene) -> bool {
        match self {
            CameraChoice::Named(_) | CameraChoice::Index(_) => true,
            CameraChoice::Fitted(_) => false,
            CameraChoice::Given(camera) if camera.fitted => false,
            CameraChoice::Default | CameraChoice::Given(_) => scene.default_camera().is_some(),
        }
    }
}

/// Checks exposure, tone map and dithering against the pipeline.
///
/// # Errors
/// [`Error::Usage`] that says what to give instead.
pub fn check_display(display: DisplaySettings, pipeline: ColourPipeline) -> Result<()> {
    if !display.is_identity() && pipeline != ColourPipeline::Linear {
        let what =
            format!("exposure and tone map need the colour arithmetic `linear`, not `{}`", pipeline.name());
        let hint = "give --colour linear, or --exposure 0 --tone-map none";
        return Err(Error::usage(what, hint));
    }
    if display.rounding.is_dithered && pipeline == ColourPipeline::U8 {
        let what = "the colour arithmetic `u8` rounds to 8 bits in each step, so there is nothing to dither";
        return Err(Error::usage(what, "give --colour display or linear, or leave --dither out"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_word_on_an_effect_counts() {
        let mut settings = RenderSettings { with: vec!["glaze=every-bounce".into()], ..Default::default() };
        assert_eq!(settings.value(id::GLAZE), Some("every-bounce"));
        settings.switch(id::GLAZE, false);
        assert_eq!((settings.with.len(), settings.without.as_slice()), (0, &["glaze".to_owned()][..]));
        settings.set(id::GLAZE, Some("2"));
        assert_eq!((settings.value(id::GLAZE), settings.without.len()), (Some("2"), 0));
        settings.switch(id::GLAZE, true);
        assert_eq!((settings.value(id::GLAZE), settings.with.as_slice()), (None, &["glaze".to_owned()][..]));
    }
}
