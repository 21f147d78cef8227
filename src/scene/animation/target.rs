//! Targets of tracks, by name, and access to their animated properties.

use std::collections::HashMap;

use glam::{DMat4, DQuat, DVec3, EulerRot};

use super::Track;
use crate::error::{Error, Result, nearest_name};
use crate::scene::mesh::support::PointTrees;
use crate::scene::{AnalyticShape, Camera, Focus, Lens, Light, Object, Scene, Shape, bounds};

/// Target of a track, by name.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub enum Target {
    /// A camera.
    Camera(String),
    /// An analytic shape, a triangle list or a mesh; the name of a mesh file stands for all its objects.
    Object(String),
    /// A light.
    Light(String),
}

/// Animated property of a target.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, serde::Deserialize, serde::Serialize, schemars::JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Property {
    /// Position of a camera, an analytic shape, or a light other than a directional one.
    #[default]
    Position,
    /// Look-at point of a camera.
    LookAt,
    /// Focus distance of a camera's lens.
    FocusDistance,
    /// Radius of an analytic shape.
    Radius,
    /// Intensity of a light.
    Intensity,
    /// Direction in which a light shines, or an analytic shape with a direction faces.
    Direction,
    /// Translation of a mesh from its place in the scene.
    Translate,
    /// Rotation of a mesh about the centre of its bounds: about x, then y, then z, in degrees.
    Rotate,
    /// Scale of a mesh about the centre of its bounds: one factor, or one per axis.
    Scale,
}

names!(Property {
    Position = "position", LookAt = "look_at", FocusDistance = "focus_distance", Radius = "radius",
    Intensity = "intensity", Direction = "direction", Translate = "translate", Rotate = "rotate", Scale = "scale",
});

/// Mutable access to a target of a track.
pub(super) enum Subject<'a> {
    Camera(&'a mut Camera),
    Light(&'a mut Light),
    Analytic(&'a mut AnalyticShape),
    Mesh { object: &'a mut Object, centre: DVec3 },
}

/// Indices of cameras, lights and objects by name, so that the time for many tracks is linear.
pub(super) struct Names {
    cameras: HashMap<String, Vec<usize>>,
    lights: HashMap<String, Vec<usize>>,
    /// By names of objects and of their mesh files.
    objects: HashMap<String, Vec<usize>>,
}

impl Names {
    pub(super) fn of(scene: &Scene) -> Self {
        fn index<'a>(names: impl Iterator<Item = &'a str>) -> HashMap<String, Vec<usize>> {
            let mut indices = HashMap::<String, Vec<usize>>::new();
            names.enumerate().for_each(|(i, name)| indices.entry(name.to_owned()).or_default().push(i));
            indices
        }
        let mut objects = index(scene.objects.iter().map(|object| object.name.as_str()));
        for (i, object) in scene.objects.iter().enumerate() {
            for (end, _) in object.name.match_indices('/') {
                objects.entry(object.name[..end].to_owned()).or_default().push(i);
            }
        }
        objects.values_mut().for_each(|indices| indices.sort_unstable());
        let cameras = index(scene.cameras.iter().map(|camera| camera.name.as_str()));
        Names { cameras, lights: index(scene.lights.iter().map(|light| light.name.as_str())), objects }
    }

    /// The indices of a target; empty if it does not exist.
    pub(super) fn indices(&self, target: &Target) -> &[usize] {
        let found = match target {
            Target::Camera(name) => self.cameras.get(name),
            Target::Light(name) => self.lights.get(name),
            Target::Object(name) => self.objects.get(name),
        };
        found.map_or(&[], Vec::as_slice)
    }
}

impl Track {
    /// Calls `act` with each target of the track: several if the objects of a mesh file share the name.
    pub(super) fn for_subjects(
        &self,
        scene: &mut Scene,
        names: &Names,
        mut act: impl FnMut(Subject) -> Result<()>,
    ) -> Result<()> {
        let indices = names.indices(&self.target);
        if indices.is_empty() {
            return Err(self.unknown(&self.target, scene));
        }
        match &self.target {
            Target::Camera(_) => {
                indices.iter().try_for_each(|&i| act(Subject::Camera(&mut scene.cameras[i])))
            }
            Target::Light(_) => indices.iter().try_for_each(|&i| act(Subject::Light(&mut scene.lights[i]))),
            Target::Object(_) => {
                let is_mesh = |&i: &usize| !matches!(scene.objects[i].shape, Shape::Analytic(_));
                let centre = indices.iter().any(is_mesh).then(|| centre_of(scene, indices)).flatten();
                let centre = centre.unwrap_or_default();
                indices.iter().try_for_each(|&i| {
                    let object = &mut scene.objects[i];
                    act(match object.shape {
                        Shape::Analytic(ref mut shape) => Subject::Analytic(shape),
                        _ => Subject::Mesh { object, centre },
                    })
                })
            }
        }
    }

    /// The error for a target that does not exist.
    pub(super) fn unknown(&self, target: &Target, scene: &Scene) -> Error {
        let (kind, name, known): (_, _, Vec<&str>) = match target {
            Target::Camera(name) => ("camera", name, scene.cameras.iter().map(|c| c.name.as_str()).collect()),
            Target::Light(name) => ("light", name, scene.lights.iter().map(|l| l.name.as_str()).collect()),
            Target::Object(name) => ("object", name, scene.objects.iter().map(|o| o.name.as_str()).collect()),
        };
        let hint = match known.as_slice() {
            [] => format!("the scene has no {kind}; give it one of that name"),
            known => nearest_name(name, known),
        };
        self.error(format!("there is no {kind} `{name}` to animate"), hint)
    }
}

/// Centre of the bounds of the objects of these indices. Triangles without area count, so that it does not jump where a
/// track scales an object to 0.
pub(super) fn centre_of(scene: &Scene, indices: &[usize]) -> Option<DVec3> {
    let objects: Vec<Object> = indices.iter().map(|&i| scene.objects[i].clone()).collect();
    let (min, max) = bounds(&PointTrees::counting(&objects, |_| true), &objects)?;
    Some(min / 2.0 + max / 2.0)
}

impl Subject<'_> {
    /// The vector that is a property.
    fn vector(&mut self, property: Property) -> Option<&mut DVec3> {
        match (self, property) {
            (Subject::Camera(camera), Property::Position) => Some(&mut camera.position),
            (Subject::Camera(camera), Property::LookAt) => Some(&mut camera.target),
            (Subject::Analytic(shape), Property::Position) => Some(shape.centre_mut()),
            (Subject::Analytic(shape), Property::Direction) => shape.direction_mut(),
            (Subject::Light(light), Property::Position) => light.kind.position_mut(),
            (Subject::Light(light), Property::Direction) => light.kind.direction_mut(),
            _ => None,
        }
    }

    /// The number that is a property.
    fn number(&mut self, property: Property) -> Option<&mut f64> {
        match (self, property) {
            (Subject::Analytic(shape), Property::Radius) => Some(shape.radius_mut()),
            (Subject::Light(light), Property::Intensity) => Some(&mut light.intensity),
            _ => None,
        }
    }

    /// Current value of a property.
    pub(super) fn value(&mut self, property: Property, track: &Track) -> Result<DVec3> {
        if let Some(vector) = self.vector(property) {
            return Ok(*vector);
        }
        if let Some(number) = self.number(property) {
            return Ok(DVec3::splat(*number));
        }
        match (&*self, property) {
            (
                Subject::Camera(Camera { lens: Some(Lens { focus: Focus::Distance(distance), .. }), .. }),
                Property::FocusDistance,
            ) => Ok(DVec3::splat(*distance)),
            (Subject::Mesh { .. }, Property::Translate | Property::Rotate) => Ok(DVec3::ZERO),
            (Subject::Mesh { .. }, Property::Scale) => Ok(DVec3::ONE),
            _ => Err(self.has_no(property, track)),
        }
    }

    /// Sets a property.
    ///
    /// # Errors
    /// [`Error::Input`] if the target lacks the property or the value is invalid.
    pub(super) fn set(&mut self, property: Property, mut value: DVec3, track: &Track) -> Result<()> {
        // Fails if the target lacks the property.
        self.value(property, track)?;
        let bad = |what: &str, hint: &str| Err(track.error(what, hint));
        if property == Property::Direction {
            let Some(unit) = value.try_normalize() else {
                let hint = "choose values that do not pass through 0";
                return bad("comes to a direction of no length", hint);
            };
            value = unit;
        }
        if let Some(vector) = self.vector(property) {
            *vector = value;
            return Ok(());
        }
        if property == Property::Radius && value.x <= 0.0 {
            return bad(&format!("comes to a radius of {}", value.x), "keep radii above 0");
        }
        if property == Property::Intensity && value.x < 0.0 {
            return bad(&format!("comes to an intensity of {}", value.x), "keep intensities at 0 or more");
        }
        if let Some(number) = self.number(property) {
            *number = value.x;
            return Ok(());
        }
        match self {
            Subject::Mesh { object, centre } => {
                let linear = match property {
                    Property::Rotate => {
                        let [x, y, z] = value.to_array().map(f64::to_radians);
                        DMat4::from_quat(DQuat::from_euler(EulerRot::ZYX, z, y, x))
                    }
                    Property::Scale if value.to_array().contains(&0.0) => {
                        let hint = "a mesh without size cannot be seen; keep factors other than 0";
                        return bad("comes to a scale of 0", hint);
                    }
                    Property::Scale => DMat4::from_scale(value),
                    _ => {
                        object.shape.transform(&DMat4::from_translation(value));
                        return Ok(());
                    }
                };
                let about = DMat4::from_translation(*centre) * linear * DMat4::from_translation(-*centre);
                object.shape.transform(&about);
            }
            Subject::Camera(_) if value.x <= 0.0 => {
                return bad(&format!("comes to a focus distance of {}", value.x), "keep distances above 0");
            }
            Subject::Camera(camera) => {
                camera.lens = camera.lens.map(|lens| Lens { focus: Focus::Distance(value.x), ..lens });
            }
            Subject::Analytic(_) | Subject::Light(_) => {}
        }
        Ok(())
    }

    fn has_no(&mut self, property: Property, track: &Track) -> Error {
        let properties = [Property::Position, Property::Direction, Property::Radius, Property::Intensity];
        let has = |p: &Property| self.vector(*p).is_some() || self.number(*p).is_some();
        let names: Vec<&str> = properties.into_iter().filter(has).map(Property::name).collect();
        let (last, others) = names.split_last().unwrap_or((&"name", &[]));
        let of_kind = [others.join(", "), (*last).to_owned()].join(" or ");
        let (what, has) = match self {
            Subject::Camera(_) => {
                ("a camera".into(), "position or look_at, or its focus_distance if [[camera]] gives one")
            }
            Subject::Light(light) => (light.kind.noun(), &*of_kind),
            Subject::Analytic(shape) => (format!("a {}", shape.name()), &*of_kind),
            Subject::Mesh { .. } => ("a mesh".into(), "translate, rotate or scale, or `orbit`"),
        };
        track.error(format!("{what} has no `{}`", property.name()), format!("animate its {has}"))
    }
}
