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
#[derive(Debug, Clone, PartialEq)]
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
