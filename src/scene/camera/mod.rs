//! Camera descriptions: position, orientation and viewing rectangle.

pub(crate) mod lens;
pub(crate) mod text;

use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

use super::{Lens, Scene};

/// Projection of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Projection {
    /// Rays start at the camera's position and pass through the viewing rectangle.
    #[default]
    Perspective,
    /// Rays are parallel and start on the viewing rectangle, moved to the camera's position.
    Orthographic,
    /// Rays start at the camera's position in all directions. The picture is equirectangular: from left to right a full turn
    /// about the camera's vertical axis, with the line of sight in the middle; from top to bottom straight up to straight
    /// down.
    Panoramic,
}

names!(Projection {
    Perspective = "perspective", Orthographic = "orthographic", Panoramic = "panoramic",
});

impl Projection {
    /// Whether rays start at the camera's position, so that distant things are smaller.
    pub fn is_central(self) -> bool {
        self != Projection::Orthographic
    }

    /// Whether a camera may have a thin lens.
    pub fn has_lens(self) -> bool {
        self == Projection::Perspective
    }

    /// Whether a picture shows all directions, so that a camera that fits a scene stands in its middle.
    pub fn shows_all_directions(self) -> bool {
        self == Projection::Panoramic
    }

    /// Width divided by height of pictures with square pixels; `None` where the viewing rectangle decides.
    pub fn aspect(self) -> Option<f64> {
        self.shows_all_directions().then_some(2.0)
    }

    /// Options of the automatic camera that change nothing, and what to use instead.
    pub fn unused_framing(self) -> (&'static [&'static str], &'static str) {
        match self {
            Projection::Perspective => (&[], ""),
            Projection::Orthographic => (&["fov"], "; use zoom"),
            Projection::Panoramic => (&["fov", "zoom"], ""),
        }
    }

    /// Description for users.
    pub fn meaning(self) -> &'static str {
        match self {
            Projection::Perspective => "distant things are smaller, as for the eye",
            Projection::Orthographic => "parallel lines stay parallel, as in drawings to scale",
            Projection::Panoramic => "all directions at once, as in environment maps",
        }
    }
}

/// A camera. It looks from `position` towards `target` through a rectangle at distance `viewpoint_distance`, centred on
/// the line of sight unless it has a shift; at that distance both projections cover the same area.
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
    /// Where the viewing rectangle and the pixels differ from those of a symmetric camera with square pixels.
    #[serde(default, skip_serializing_if = "Sensor::is_default")]
    pub sensor: Sensor,
    /// Whether it was fitted to frame the scene, rather than placed by a file or a user.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub fitted: bool,
}

/// How the viewing rectangle of a camera lies, and its pixels.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// The middle of the viewing rectangle, right of and above the line of sight, in shares of its width and height.
    pub shift: DVec2,
    /// Whether a picture with another aspect ratio than the viewing rectangle shows exactly the rectangle, with oblong
    /// pixels. Otherwise pixels are square, and it shows more.
    pub oblong_pixels: bool,
}

impl Sensor {
    /// Whether the rectangle is centred and pixels are square.
    pub fn is_default(&self) -> bool {
        *self == Sensor::default()
    }
}

/// The intrinsic matrix of a pinhole camera, in pixels of a picture of `size`, as OpenCV and COLMAP define it: a point
/// (x, y, z) of the camera, x to the right, y down and z ahead, is seen at (`focal` x / z + `principal`), and the centre
/// of the picture's first pixel, top left, is (0, 0).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrinsics {
    /// Focal lengths f_x and f_y, above 0.
    pub focal: DVec2,
    /// The principal point (c_x, c_y).
    pub principal: DVec2,
    /// Width and height of the picture.
    pub size: [u32; 2],
}

impl Intrinsics {
    /// Width and height of the viewing rectangle at distance 1, and its sensor.
    pub fn rectangle(&self) -> (DVec2, Sensor) {
        let size = DVec2::from(self.size.map(f64::from));
        // The middle of the picture is (size - 1) / 2 from the centre of the first pixel.
        let shift = ((size - 1.0) / 2.0 - self.principal) / size;
        let sensor = Sensor { shift: DVec2::new(shift.x, -shift.y), oblong_pixels: true };
        (size / self.focal, sensor)
    }
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
            sensor: Sensor::default(),
            fitted: false,
        }
    }
}

impl Scene {
    /// The camera of a picture for which none is chosen: the first. `None`, for one that is fitted, if there is none, or if
    /// objects come from each of several mesh files, as a file's camera frames the objects of that file alone.
    pub fn default_camera(&self) -> Option<&Camera> {
        let has_objects = |input| self.objects.iter().any(|object| object.input == input);
        let inputs = self.inputs.len();
        let is_combined = inputs > 1 && !self.has_settings && (0..inputs).all(has_objects);
        self.cameras.first().filter(|_| !is_combined)
    }
}

/// Default width and height of a picture.
const DEFAULT_SIZE: [u32; 2] = [1024, 1024];

/// Default size of a picture in pixels: the scene's, else one with the aspect ratio of the projection or of the camera's
/// viewing rectangle, if it has a width.
pub fn default_size(of_scene: Option<[u32; 2]>, camera: Option<&Camera>, projection: Projection) -> [u32; 2] {
    let of_rectangle = || camera.and_then(|camera| Some(camera.view_width? / camera.view_height));
    let shape = |aspect: f64| {
        let [width, height] = DEFAULT_SIZE.map(f64::from);
        let shape = if aspect >= 1.0 { [width, width / aspect] } else { [height * aspect, height] };
        shape.map(|pixels| pixels.round().max(1.0) as u32)
    };
    of_scene.or_else(|| projection.aspect().or_else(of_rectangle).map(shape)).unwrap_or(DEFAULT_SIZE)
}

#[cfg(test)]
mod tests {
    use super::super::{MaterialId, Mesh, Object, Shape};
    use super::*;

    /// A file of cameras alone, and a scene file, say what all objects are seen by; one of several meshes does not.
    #[test]
    fn a_camera_of_one_of_several_meshes_is_not_the_default() {
        let object = |input| Object {
            name: "mesh".into(),
            input,
            material: MaterialId(0),
            shape: Shape::Mesh(Mesh::default()),
        };
        let camera = Camera::from_field_of_view("c".into(), DVec3::Z, DVec3::ZERO, DVec3::Y, 1.0);
        let of = |objects: &[usize], has_settings| {
            let objects = objects.iter().map(|&input| object(input)).collect();
            let inputs = vec!["a.obj".into(), "b.glb".into()];
            let scene =
                Scene { objects, inputs, has_settings, cameras: vec![camera.clone()], ..Scene::default() };
            scene.default_camera().is_some()
        };
        assert_eq!([of(&[0, 1], false), of(&[0, 1], true), of(&[0, 0], false)], [false, true, true]);
    }
}
