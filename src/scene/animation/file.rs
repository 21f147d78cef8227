//! What scene files say of animations.

use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

use super::{Easing, Property};
use crate::scene::file::ScaleValue;

/// What moves, and for how long. With F = fps * duration, frame i is the scene at i / F of the way; frames are 0 to F.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AnimationSection {
    /// Frames a second; 30 if not given.
    pub fps: Option<f64>,
    /// Seconds; 10 if not given.
    pub duration: Option<f64>,
    /// Whether the end is the beginning again: the last frame is left out then, so that a player that begins anew does not
    /// stand still for a frame.
    #[serde(default)]
    pub repeat: bool,
    /// What moves. Tracks are applied in their order.
    #[serde(default)]
    #[schemars(with = "Vec<TrackSection>")]
    pub track: Vec<Spanned<TrackSection>>,
}

/// A motion: the name of what moves (`camera`, `object` or `light`), and one of `lerp`, `keyframes`, `orbit` and `look_at`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrackSection {
    /// The name of a camera.
    pub camera: Option<String>,
    /// The name of a sphere, a triangle list or a mesh.
    pub object: Option<String>,
    /// The name of a light.
    pub light: Option<String>,
    /// What of it changes: position if not given.
    pub property: Option<Property>,
    /// From one value to another over the whole animation.
    pub lerp: Option<LerpSection>,
    /// Values at times.
    pub keyframes: Option<Vec<KeySection>>,
    /// On a circle about an axis. A mesh is turned as a whole.
    pub orbit: Option<OrbitSection>,
    /// What a camera keeps looking at.
    pub look_at: Option<LookAtSection>,
}

/// From one value to another.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LerpSection {
    /// The first value; what the scene says if not given.
    pub from: Option<ScaleValue>,
    /// The last value.
    pub to: ScaleValue,
    /// How it gathers speed; linear if not given.
    #[serde(default)]
    pub easing: Easing,
}

/// A value at a time.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KeySection {
    /// Seconds from the beginning.
    pub time: f64,
    /// The value.
    pub value: ScaleValue,
    /// The way that leads to it from the key before; linear if not given.
    #[serde(default)]
    pub easing: Easing,
}

/// A circle.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OrbitSection {
    /// A point of the axis.
    pub around: [f64; 3],
    /// The direction of the axis; (0, 1, 0) if not given.
    pub axis: Option<[f64; 3]>,
    /// Turns over the whole animation, counter-clockwise seen from the axis's tip; 1 if not given, below 0 the other way.
    pub turns: Option<f64>,
}

/// What a camera looks at: an object or a point.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LookAtSection {
    /// The name of an object; the middle of its bounds is looked at.
    pub object: Option<String>,
    /// A point.
    pub point: Option<[f64; 3]>,
    /// How far beside it; nothing if not given.
    pub offset: Option<[f64; 3]>,
}
