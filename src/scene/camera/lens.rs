//! Thin lenses of cameras: what is in focus, and the size and shape of the aperture.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Height of a full-frame film in millimetres, which is 36 wide.
const FILM_HEIGHT: f64 = 24.0;

/// A thin lens of a perspective camera. A point off the plane of focus is seen through the whole aperture, as a blurred
/// image of it; with a radius of 0, all is in focus.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lens {
    /// Radius of the aperture; of a polygon, the distance of its corners from the centre.
    pub radius: f64,
    /// What is in focus.
    pub focus: Focus,
    /// Corners of the aperture, 3 or more; 0 for a circle.
    pub blades: u32,
    /// Rotation of the corners in degrees, counterclockwise as the camera sees them; at 0, one is to the right. In degrees
    /// also here, so that it is printed as it was read.
    pub blade_rotation: f64,
}

impl Lens {
    /// The lens in a scene scaled by `scale`, whose points are where `place` puts them.
    pub fn moved(self, scale: f64, place: impl Fn(DVec3) -> DVec3) -> Self {
        let focus = match self.focus {
            Focus::Auto => Focus::Auto,
            Focus::Distance(distance) => Focus::Distance(distance * scale),
            Focus::Point(point) => Focus::Point(place(point)),
        };
        Lens { radius: self.radius * scale, focus, ..self }
    }
}

/// What a lens focuses on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Focus {
    /// The first surface in the centre of the picture; the camera's target if there is none.
    #[default]
    Auto,
    /// The plane at this distance along the line of sight.
    Distance(f64),
    /// The plane through a point, across the line of sight.
    Point(DVec3),
}

/// The vertical field of view in radians for a focal length in millimetres, on full-frame film.
pub(crate) fn field_of_view(focal_length: f64) -> f64 {
    2.0 * (FILM_HEIGHT / 2.0 / focal_length).atan()
}

/// The radius of an aperture in units of metres from its f-number: the focal length divided by twice that.
/// `slope` is the height of the viewing rectangle at a distance of 1.
pub(crate) fn radius_of(f_stop: f64, slope: f64) -> f64 {
    FILM_HEIGHT / 1000.0 / slope / (2.0 * f_stop)
}
