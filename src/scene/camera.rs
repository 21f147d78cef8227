//! Cameras as they are described: where they stand and what rectangle they see.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// How a camera's rays run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Projection {
    /// From the camera's position through the viewing rectangle.
    #[default]
    Perspective,
    /// In parallel, from the viewing rectangle moved to the camera's position.
    Orthographic,
}

impl Projection {
    /// The name as typed by users.
    pub fn name(self) -> &'static str {
        match self {
            Projection::Perspective => "perspective",
            Projection::Orthographic => "orthographic",
        }
    }
}

/// A camera. It looks from `position` towards `target` through a rectangle at distance `viewpoint_distance` that is
/// centred on the line of sight; both projections see the same at that distance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Its name.
    pub name: String,
    /// Where it stands.
    pub position: DVec3,
    /// A point it looks at, other than `position`.
    pub target: DVec3,
    /// Roughly where up is; need not be perpendicular to the line of sight.
    pub up: DVec3,
    /// How its rays run, unless the user says otherwise.
    pub projection: Projection,
    /// Height of the viewing rectangle.
    pub view_height: f64,
    /// Width of the viewing rectangle, or `None` to follow the picture's shape.
    pub view_width: Option<f64>,
    /// Distance from `position` to the viewing rectangle (the focal length).
    pub viewpoint_distance: f64,
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
        }
    }
}

/// Width and height of a picture where nothing says otherwise.
const USUAL_SIZE: [u32; 2] = [1024, 1024];

/// The size of a picture for which nobody gives one, in pixels: the scene's, else one in the shape of the camera's viewing
/// rectangle, where it has one.
pub fn usual_size(of_scene: Option<[u32; 2]>, camera: Option<&Camera>) -> [u32; 2] {
    let shape = |camera: &Camera| {
        let aspect = camera.view_width? / camera.view_height;
        let [width, height] = USUAL_SIZE.map(f64::from);
        let shape = if aspect >= 1.0 { [width, width / aspect] } else { [height * aspect, height] };
        Some(shape.map(|pixels| pixels.round().max(1.0) as u32))
    };
    of_scene.or_else(|| camera.and_then(shape)).unwrap_or(USUAL_SIZE)
}
