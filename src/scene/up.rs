//! [`UpAxis`]: the axis of a file that points up, and turning scenes so that it is +y.

use glam::{DMat4, DVec3, DVec4};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::option::OptionValue;
use super::{Scene, Shape, Step};
use crate::error::nearest_name;

/// The axis that points up in a file. In a scene it is +y.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum UpAxis {
    /// +x.
    #[serde(rename = "x", alias = "X")]
    X,
    /// +y.
    #[default]
    #[serde(rename = "y", alias = "Y")]
    Y,
    /// +z.
    #[serde(rename = "z", alias = "Z")]
    Z,
    /// -x.
    #[serde(rename = "-x", alias = "-X")]
    MinusX,
    /// -y.
    #[serde(rename = "-y", alias = "-Y")]
    MinusY,
    /// -z.
    #[serde(rename = "-z", alias = "-Z")]
    MinusZ,
}

names!(UpAxis { X = "x", Y = "y", Z = "z", MinusX = "-x", MinusY = "-y", MinusZ = "-z" });

/// What `--up` chooses: an axis of all files, or that of each file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum UpChoice {
    /// The axis that the format or the scene file says; z where a file of another format seems to stand upright in it, else y.
    #[default]
    Auto,
    /// This axis.
    Axis(UpAxis),
}

impl UpChoice {
    /// All values.
    pub fn all() -> impl Iterator<Item = Self> {
        [UpChoice::Auto].into_iter().chain(UpAxis::ALL.map(UpChoice::Axis))
    }

    /// The name for users.
    pub fn name(self) -> &'static str {
        self.axis().map_or("auto", UpAxis::name)
    }

    /// The axis of all files.
    pub fn axis(self) -> Option<UpAxis> {
        match self {
            UpChoice::Auto => None,
            UpChoice::Axis(axis) => Some(axis),
        }
    }
}

impl OptionValue for UpChoice {
    fn names() -> Vec<&'static str> {
        UpChoice::all().map(UpChoice::name).collect()
    }

    fn parse(text: &str) -> Result<Self, String> {
        let name = text.strip_prefix('+').unwrap_or(text);
        let found = UpChoice::all().find(|choice| choice.name().eq_ignore_ascii_case(name));
        found.ok_or_else(|| nearest_name(text, &Self::names()))
    }

    fn text(&self) -> String {
        self.name().to_owned()
    }
}

impl UpAxis {
    /// The unit vector in the file.
    pub fn vector(self) -> DVec3 {
        match self {
            UpAxis::X => DVec3::X,
            UpAxis::Y => DVec3::Y,
            UpAxis::Z => DVec3::Z,
            UpAxis::MinusX => DVec3::NEG_X,
            UpAxis::MinusY => DVec3::NEG_Y,
            UpAxis::MinusZ => DVec3::NEG_Z,
        }
    }

    /// The rotation by quarter turns that makes the axis +y; exact, as it only exchanges coordinates and signs.
    pub fn world_from_file(self) -> DMat4 {
        let [x, y, z] = match self {
            UpAxis::X => [DVec3::Y, DVec3::NEG_X, DVec3::Z],
            UpAxis::Y => DVec3::AXES,
            UpAxis::Z => [DVec3::X, DVec3::NEG_Z, DVec3::Y],
            UpAxis::MinusX => [DVec3::NEG_Y, DVec3::X, DVec3::Z],
            UpAxis::MinusY => [DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z],
            UpAxis::MinusZ => [DVec3::X, DVec3::Z, DVec3::NEG_Y],
        };
        DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), DVec4::W)
    }
}

impl Shape {
    /// Transforms a shape of a mesh file; analytic shapes, which such files do not have, stay.
    pub(crate) fn transform(&mut self, world_from_mesh: &DMat4) {
        match self {
            Shape::Mesh(mesh) => mesh.transform(world_from_mesh),
            Shape::Placed(placed) => placed.placement.then(Step::Affine(*world_from_mesh)),
            Shape::Analytic(_) => {}
        }
    }
}

impl Scene {
    /// Turns the objects, cameras and lights of a mesh file so that `up` is +y.
    pub(crate) fn turn(&mut self, up: UpAxis) {
        let rotation = up.world_from_file();
        let turned = |v: &mut DVec3| *v = rotation.transform_vector3(*v);
        self.objects.iter_mut().for_each(|object| object.shape.transform(&rotation));
        for camera in &mut self.cameras {
            [&mut camera.position, &mut camera.target, &mut camera.up].into_iter().for_each(turned);
        }
        for light in &mut self.lights {
            light.kind.rotate(&rotation);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_may_have_a_sign_and_capitals() {
        for (text, up) in [("+Z", UpAxis::Z), ("z", UpAxis::Z), ("-Y", UpAxis::MinusY)] {
            assert_eq!(UpChoice::parse(text), Ok(UpChoice::Axis(up)), "{text}");
        }
        assert!(UpChoice::parse("++z").is_err());
    }

    #[test]
    fn the_axis_becomes_y_without_mirroring() {
        for up in UpAxis::ALL {
            let rotation = up.world_from_file();
            assert_eq!(rotation.transform_vector3(up.vector()), DVec3::Y, "{}", up.name());
            assert_eq!(rotation.determinant(), 1.0, "{}", up.name());
        }
    }
}
