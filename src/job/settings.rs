//! Render settings that users give in addition to the scene, as plain data.

use serde::{Deserialize, Serialize};

use crate::bvh::Preset;
use crate::film::{ColourPipeline, DisplaySettings, Share, Window};
use crate::scene::{Camera, Numerics, Projection, Sampling};
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
    /// Effects to turn on, each as `NAME` or `NAME=VALUE`.
    pub with: Vec<String>,
    /// Effects to turn off.
    pub without: Vec<String>,
    /// The colour pipeline.
    pub colour: Option<ColourPipeline>,
    /// Names of AOV layers, as for `kiln render --aov`. They are part of the fingerprint.
    pub layers: Vec<String>,
    /// Exposure and tone map of 8-bit pictures, for the linear pipeline.
    pub display: DisplaySettings,
    /// Whether a scene without lights gets a headlight; true if neither settings nor scene say.
    pub headlight: Option<bool>,
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
