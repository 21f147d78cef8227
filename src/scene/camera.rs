//! Camera descriptions: position, orientation and viewing rectangle.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::Lens;

/// Projection of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Projection {
    /// Rays start at the camera's position and pass through the viewing rectangle.
    #[default]
    Perspective,
    /// Rays are parallel and start on the viewing rectangle, moved to the camera's position.
    Orthographic,
}

names!(Projection { Perspective = "perspective", Orthographic = "orthographic" });

/// A camera. It looks from `position` towards `target` through a rectangle at distance `viewpoint_distance`, centred on
/// the line of sight; at that distance both projections cover the same area.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Name.
    pub name: String,
    /// Position.
    pub position: DVec3,
    /// A point that the camera looks at, other than `position`.
    pub target: DVec3,
    /// Up vector; need not be perpendicular to the line of sight.
    pub up: DVec3,
    /// Projection, unless overridden by the user.
    pub projection: Projection,
    /// Height of the viewing rectangle.
    pub view_height: f64,
    /// Width of the viewing rectangle, or `None` to follow the aspect ratio of the picture.
    pub view_width: Option<f64>,
    /// Distance from `position` to the viewing rectangle (the focal length).
    pub viewpoint_distance: f64,
    /// Its thin lens; `None` for a pinhole.
    #[serde(default)]
    pub lens: Option<Lens>,
}

impl Camera {
    /// A perspective camera from its vertical field of view in radians. The viewing rectangle lies at the target, so
    /// that the orthographic projection shows the target at the same size.
    pub fn from_field_of_view(
        name: String,
        position: DVec3,
        target: DVec3,
        up: DVec3,
        vertical_field_of_view: f64,
    ) -> Self {
        let distance = position.distance(target);
        Camera {
            name,
            position,
            target,
            up,
            projection: Projection::Perspective,
            view_height: 2.0 * distance * (vertical_field_of_view / 2.0).tan(),
            view_width: None,
            viewpoint_distance: distance,
            lens: None,
        }
    }
}

/// Default width and height of a picture.
const DEFAULT_SIZE: [u32; 2] = [1024, 1024];

/// Default size of a picture in pixels: the scene's, else one with the aspect ratio of the camera's viewing rectangle,
/// if it has a width.
pub fn default_size(of_scene: Option<[u32; 2]>, camera: Option<&Camera>) -> [u32; 2] {
    let shape = |camera: &Camera| {
        let aspect = camera.view_width? / camera.view_height;
        let [width, height] = DEFAULT_SIZE.map(f64::from);
        let shape = if aspect >= 1.0 { [width, width / aspect] } else { [height * aspect, height] };
        Some(shape.map(|pixels| pixels.round().max(1.0) as u32))
    };
    of_scene.or_else(|| camera.and_then(shape)).unwrap_or(DEFAULT_SIZE)
}
