//! Render settings that users give in addition to the scene, as plain data.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::bvh::Preset;
use crate::effects::EffectId;
use crate::error::{Error, Result, Warnings};
use crate::film::{Colour, ColourPipeline, DisplaySettings, Share, Window};
use crate::import;
use crate::scene::{Camera, Environment, Ground, Numerics, Projection, Sampling, Scene, Transport};
use crate::shading::ShadingMode;
use crate::world::StandardView;

/// Render settings. A field that is `None` or empty is taken from the scene, then from defaults.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RenderSettings {
    /// Choice of the camera.
    pub camera: CameraChoice,
    /// Projection, overriding the camera's.
    pub projection: Option<Projection>,
    /// Width and height of the picture in pixels.
    pub size: Option<[u32; 2]>,
    /// Maximum side length in pixels if neither `size` nor `crop` is given.
    pub longest_side: Option<u32>,
    /// Region of the picture that is rendered.
    pub crop: Option<Window>,
    /// Share of the tiles that is rendered.
    pub share: Share,
    /// Sample count, reconstruction filter and seed.
    pub sampling: Sampling,
    /// Arithmetic tier.
    pub numerics: Option<Numerics>,
    /// Build preset of the acceleration structure; does not affect the picture.
    pub preset: Preset,
    /// Shading mode.
    pub shading: ShadingMode,
    /// Transport of light.
    pub transport: Option<Transport>,
    /// Largest radiance that a path adds by indirect light, above 0.
    pub clamp: Option<f64>,
    /// Light from infinitely far away, instead of the scene's.
    pub environment: EnvironmentSettings,
    /// Effects to turn on, each as `NAME` or `NAME=VALUE`.
    pub with: Vec<String>,
    /// Effects to turn off.
    pub without: Vec<String>,
    /// The colour pipeline.
    pub colour: Option<ColourPipeline>,
    /// Names of AOVs, as for `kiln render --aov`. They are part of the fingerprint.
    pub aovs: Vec<String>,
    /// Exposure and tone map of 8-bit pictures, for the linear pipeline.
    pub display: DisplaySettings,
    /// Whether a scene without lights gets a headlight; true if neither settings nor scene say.
    pub headlight: Option<bool>,
    /// Whether a ground is put under the scene; false if neither settings nor scene say.
    pub ground: Option<bool>,
    /// The background, instead of the scene's.
    pub background: Option<Background>,
    /// What scenes without a scene file get that their files do not have.
    pub look: Look,
}

/// What rays that hit nothing see.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Background {
    /// A colour of 8-bit sRGB values.
    Colour([u8; 3]),
    /// Black, with an alpha channel in the picture.
    Transparent,
}

impl Background {
    /// The colour.
    pub fn colour(self) -> Colour {
        match self {
            Background::Colour(colour) => Colour::from_u8(colour),
            Background::Transparent => Colour::from_u8([0; 3]),
        }
    }
}

/// What scenes without a scene file get that their files do not have. Scene files say themselves how they look.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Look {
    /// A headlight and ambient light, on a dark background, with one sample a pixel.
    #[default]
    Draft,
    /// Antialiasing; where files have no light, a key light and fill light; where they have no camera, too, a ground and
    /// a light background. No light, ground or background where the settings choose one of environment, headlight, ground and
    /// background.
    Studio,
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

    fn set_switch(&mut self, effect: EffectId, on: Option<Option<&str>>) {
        let RenderSettings { with, without, .. } = self;
        with.retain(|typed| typed.split('=').next() != Some(effect.name()));
        without.retain(|name| *name != effect.name());
        match on {
            Some(Some(value)) => with.push(effect.with_value(value)),
            Some(None) => with.push(effect.name().to_owned()),
            None => without.push(effect.name().to_owned()),
        }
    }

    /// The value that the settings give an effect.
    pub fn value(&self, effect: EffectId) -> Option<&str> {
        self.with.iter().rev().find_map(|typed| typed.strip_prefix(effect.name())?.strip_prefix('='))
    }

    /// Gives a scene, in its own coordinates and before anything moves, the environment, background and ground that are
    /// asked for, and the look.
    ///
    /// # Errors
    /// Those of [`EnvironmentSettings::apply`], and [`Error::Input`] for a ground under a scene without objects.
    pub fn complete(&self, scene: &mut Scene, warnings: &mut Warnings) -> Result<()> {
        super::warn_of_dark_lights(scene, warnings);
        self.environment.apply(scene, warnings)?;
        scene.background = self.background.map(Background::colour).or(scene.background);
        if self.look == Look::Studio {
            super::studio::complete(scene, self, warnings);
        }
        if !self.ground.or(scene.has_ground).unwrap_or(false) {
            return Ok(());
        }
        scene.ground = scene.bounds().and_then(Ground::under);
        if scene.ground.is_some() {
            return Ok(());
        }
        let file = scene.inputs.first().map_or(Path::new("-"), PathBuf::as_path);
        let hint = "leave --ground (`ground` of [image]) out, or add something that has a size";
        Err(Error::input(file, "there is nothing in it to put a ground under", hint))
    }
}

/// Settings of the environment.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EnvironmentSettings {
    /// `sky`, a colour (`#808080` or `808080`), or an equirectangular image in .hdr or .exr; `None` for the scene's.
    pub source: Option<String>,
    /// Rotation about +y in degrees, counterclockwise seen from above.
    pub rotation: Option<f64>,
    /// Whether rays that hit nothing see the background instead.
    pub hide: bool,
}

impl EnvironmentSettings {
    /// Gives a scene the environment that is asked for.
    ///
    /// # Errors
    /// [`Error::Input`] for a file that cannot be used, [`Error::Usage`] for settings of an environment that is not there.
    pub fn apply(&self, scene: &mut Scene, warnings: &mut Warnings) -> Result<()> {
        if let Some(source) = &self.source {
            let source = import::environment(source, warnings)?;
            scene.environment = Some(Environment { source, rotation: 0.0, intensity: 1.0, is_hidden: false });
        }
        if self.rotation.is_none() && !self.hide {
            return Ok(());
        }
        let Some(environment) = &mut scene.environment else {
            return Err(Error::usage(
                "there is no environment to rotate or hide",
                "give one by --environment",
            ));
        };
        environment.rotation = self.rotation.map_or(environment.rotation, f64::to_radians);
        environment.is_hidden |= self.hide;
        Ok(())
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
}

/// Checks exposure and tone map against the pipeline, and that an automatic exposure has a whole picture.
///
/// # Errors
/// [`Error::Usage`] that says what to give instead.
pub fn check_display(display: DisplaySettings, pipeline: ColourPipeline, is_whole: bool) -> Result<()> {
    if !display.is_identity() && pipeline != ColourPipeline::Linear {
        let what =
            format!("exposure and tone map take linear light, and the colours are `{}`", pipeline.name());
        let hint = "give --colour linear, or --exposure 0 --tone-map none";
        return Err(Error::usage(what, hint));
    }
    if display.is_auto() && !is_whole {
        let what = "`auto` exposure is computed from a whole picture, and this is a part of one";
        let hint =
            "give --exposure a number, such as the one that a whole picture, maybe a small one, reports";
        return Err(Error::usage(what, hint));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::id;

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
