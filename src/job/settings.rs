//! What a user can ask of a picture beyond the scene: plain data.

use serde::{Deserialize, Serialize};

use crate::bvh::Preset;
use crate::film::{ColourPipeline, Share, Window};
use crate::scene::{Camera, Numerics, Projection, Sampling};
use crate::shading::ShadingMode;
use crate::world::StandardView;

/// Everything that a user can ask of a picture. What is `None` or empty is left to the scene, then to kiln's defaults.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RenderSettings {
    /// What the scene is seen by.
    pub camera: CameraChoice,
    /// The projection, instead of the camera's own.
    pub projection: Option<Projection>,
    /// Width and height of the picture in pixels.
    pub size: Option<[u32; 2]>,
    /// The longest side in pixels of a picture for which neither `size` nor `crop` is given.
    pub longest_side: Option<u32>,
    /// The part of the picture that is rendered.
    pub crop: Option<Window>,
    /// The share of the picture's tiles that is rendered.
    pub share: Share,
    /// How often and where pixels are sampled.
    pub sampling: Sampling,
    /// The tier of numerics.
    pub numerics: Option<Numerics>,
    /// How much work is spent on building the acceleration structure; the picture does not depend on it.
    pub preset: Preset,
    /// How far shading goes.
    pub shading: ShadingMode,
    /// Effects to have, each as `NAME` or `NAME=VALUE`.
    pub with: Vec<String>,
    /// Effects to do without.
    pub without: Vec<String>,
    /// The colour pipeline.
    pub colour: Option<ColourPipeline>,
    /// Names of layers beside the picture, as `kiln render --aov` takes them. They are part of its fingerprint.
    pub layers: Vec<String>,
}

/// What a scene is seen by.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CameraChoice {
    /// The scene's first camera; one that fits the scene where it has none.
    #[default]
    Default,
    /// The scene's camera of this name, or of this index counted from 0.
    Named(String),
    /// A camera that fits the scene, from a standard side.
    Fitted(StandardView),
    /// A camera in the scene's coordinates.
    Given(Camera),
}
