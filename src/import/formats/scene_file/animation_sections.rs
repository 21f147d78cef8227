//! TOML form of animations.

use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

use crate::import::formats::scene_file::sections::ScaleValue;
use crate::scene::animation::{Easing, Property};

/// Animation: duration and tracks. With F = fps * duration, frame i shows the scene at time i / F; frames are 0 to F.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AnimationSection {
    /// Frames per second; 30 if not given.
    pub fps: Option<f64>,
    /// Duration in seconds; 10 if not given.
    pub duration: Option<f64>,
    /// Whether the animation loops. The last frame, equal to the first, is then omitted, so that looped playback does
    /// not repeat a frame.
    #[serde(default)]
    pub repeat: bool,
    /// Tracks, applied in this order.
    #[serde(default)]
    #[schemars(with = "Vec<TrackSection>")]
    pub track: Vec<Spanned<TrackSection>>,
}

/// A track: the name of its target (`camera`, `object` or `light`), and one of `lerp`, `keyframes`, `orbit` and
/// `look_at`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrackSection {
    /// The name of a camera.
    pub camera: Option<String>,
    /// The name of a sphere, a triangle list or a mesh.
    pub object: Option<String>,
    /// The name of a light.
    pub light: Option<String>,
    /// Animated property of the target; position if not given.
    pub property: Option<Property>,
    /// Linear interpolation over the whole animation.
    pub lerp: Option<LerpSection>,
    /// Keyframes.
    pub keyframes: Option<Vec<KeySection>>,
    /// Rotation about an axis. A mesh is rotated as a whole.
    pub orbit: Option<OrbitSection>,
    /// Point or object that a camera looks at.
    pub look_at: Option<LookAtSection>,
}

/// Interpolation from one value to another.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LerpSection {
    /// First value; the scene's if not given.
    pub from: Option<ScaleValue>,
    /// Last value.
    pub to: ScaleValue,
    /// Easing; linear if not given.
    #[serde(default)]
    pub easing: Easing,
}

/// A keyframe.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KeySection {
    /// Seconds from the beginning.
    pub time: f64,
    /// The value.
    pub value: ScaleValue,
    /// Easing from the previous key to this one; linear if not given.
    #[serde(default)]
    pub easing: Easing,
}

/// Rotation about an axis.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OrbitSection {
    /// A point on the axis.
    pub around: [f64; 3],
    /// Direction of the axis; (0, 1, 0) if not given.
    pub axis: Option<[f64; 3]>,
    /// Turns over the whole animation, counter-clockwise seen from the tip of the axis; negative values turn clockwise;
    /// 1 if not given.
    pub turns: Option<f64>,
}

/// Look-at target of a camera: an object or a point.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LookAtSection {
    /// Name of an object; the camera looks at the centre of its bounds.
    pub object: Option<String>,
    /// A point in world space.
    pub point: Option<[f64; 3]>,
    /// Offset added to the target; zero if not given.
    pub offset: Option<[f64; 3]>,
}
