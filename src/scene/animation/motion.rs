//! Motions: evaluation at a time and application to the scene.

use glam::{DMat4, DVec3};

use super::target::{Names, Property, Subject, Target, centre_of};
use super::{Easing, Track};
use crate::error::Result;
use crate::scene::Scene;

/// The kinds of motion.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub enum Motion {
    /// Interpolation over the whole animation: `a + (b - a) t`.
    Lerp {
        /// Animated property of the target.
        property: Property,
        /// First value; if not given, the scene's after earlier tracks.
        from: Option<Value>,
        /// Last value.
        to: Value,
        /// Easing.
        easing: Easing,
    },
    /// Keyframes; the first key's value before it, the last key's value after it.
    Keys {
        /// Animated property of the target.
        property: Property,
        /// Keyframes in ascending order of time, at least one.
        keys: Vec<Key>,
    },
    /// Rotation by `2 pi turns t` about an axis. A mesh is rotated as a whole; a camera's up vector rotates with its
    /// position.
    Orbit {
        /// Animated point of the target.
        property: Property,
        /// A point on the axis.
        around: DVec3,
        /// Direction of the axis, of length 1; positive turns are counter-clockwise seen from its tip.
        axis: DVec3,
        /// Turns over the whole animation; negative values turn clockwise.
        turns: f64,
    },
    /// A camera's look-at target.
    LookAt {
        /// Target.
        goal: Goal,
        /// Offset added to the target.
        offset: DVec3,
    },
}

/// A keyframe.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Key {
    /// Seconds from the beginning.
    pub time: f64,
    /// The value.
    pub value: Value,
    /// Easing from the previous key to this one.
    pub easing: Easing,
}

/// Look-at target of a camera.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub enum Goal {
    /// A point in world space.
    Point(DVec3),
    /// Centre of an object's bounds at the time evaluated.
    Object(String),
}

/// Value of a property; a scalar is repeated three times.
pub type Value = DVec3;

/// `a + (b - a) t`, exactly `b` at 1.
fn lerp(a: Value, b: Value, t: f64) -> Value {
    if t == 1.0 { b } else { a + (b - a) * t }
}

/// Angle in radians of a number of turns, 0 after every whole turn, so that a loop closes bit by bit.
fn angle(turns: f64) -> f64 {
    std::f64::consts::TAU * (turns - turns.floor())
}

/// Rotates a point about an axis (Rodrigues 1840). The rotation is computed as a displacement, so that points on the
/// axis and rotations by 0 are exact.
fn rotated(point: DVec3, around: DVec3, axis: DVec3, angle: f64) -> DVec3 {
    let arm = point - around;
    let radial = arm - arm.dot(axis) * axis;
    point + (angle.cos() - 1.0) * radial + angle.sin() * axis.cross(radial)
}

impl Track {
    /// Applies the track to its targets at `time`, 0 to 1, which is `seconds` after the beginning.
    pub(super) fn apply(&self, scene: &mut Scene, names: &Names, time: f64, seconds: f64) -> Result<()> {
        let centre = match &self.motion {
            Motion::LookAt { goal, .. } => Some(self.goal(goal, scene, names)?),
            _ => None,
        };
        self.for_subjects(scene, names, |mut subject| {
            match &self.motion {
                Motion::Lerp { property, from, to, easing } => {
                    let from = match from {
                        Some(from) => *from,
                        None => subject.value(*property, self)?,
                    };
                    subject.set(*property, lerp(from, *to, easing.of(time)), self)?;
                }
                Motion::Keys { property, keys } => subject.set(*property, value_at(keys, seconds), self)?,
                Motion::Orbit { property, around, axis, turns } => {
                    let angle = angle(turns * time);
                    match &mut subject {
                        Subject::Mesh { object, .. } => {
                            let about =
                                DMat4::from_translation(*around) * DMat4::from_axis_angle(*axis, angle);
                            object.shape.transform(&(about * DMat4::from_translation(-*around)));
                        }
                        other => {
                            let from = other.value(*property, self)?;
                            other.set(*property, rotated(from, *around, *axis, angle), self)?;
                            if let (Subject::Camera(camera), Property::Position) = (other, *property) {
                                camera.up = rotated(camera.up, DVec3::ZERO, *axis, angle);
                            }
                        }
                    }
                }
                Motion::LookAt { offset, .. } => {
                    let goal = centre.unwrap_or_default() + *offset;
                    subject.set(Property::LookAt, goal, self)?;
                }
            }
            Ok(())
        })
    }

    fn goal(&self, goal: &Goal, scene: &Scene, names: &Names) -> Result<DVec3> {
        match goal {
            Goal::Point(point) => Ok(*point),
            Goal::Object(name) => {
                let target = Target::Object(name.clone());
                centre_of(scene, names.indices(&target)).ok_or_else(|| self.unknown(&target, scene))
            }
        }
    }

    /// Replaces a look-at object by its current centre.
    pub(super) fn resolve_goal(&mut self, scene: &Scene, names: &Names) -> Result<()> {
        if let Motion::LookAt { goal, offset } = &self.motion {
            let point = Goal::Point(self.goal(goal, scene, names)?);
            self.motion = Motion::LookAt { goal: point, offset: *offset };
        }
        Ok(())
    }
}

/// Interpolated value of keyframes at a time.
fn value_at(keys: &[Key], seconds: f64) -> Value {
    let next = keys.partition_point(|key| key.time <= seconds);
    match (next.checked_sub(1).and_then(|last| keys.get(last)), keys.get(next)) {
        (Some(a), Some(b)) => lerp(a.value, b.value, b.easing.of((seconds - a.time) / (b.time - a.time))),
        (Some(only), None) | (None, Some(only)) => only.value,
        (None, None) => Value::ZERO,
    }
}
