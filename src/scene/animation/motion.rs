//! Motions: from a time to a value, and to what moves.

use glam::{DMat4, DVec3};

use super::target::{Property, Subject, Target, middle_of};
use super::{Easing, Track};
use crate::error::Result;
use crate::scene::Scene;

/// How something moves.
#[derive(Debug, Clone, PartialEq)]
pub enum Motion {
    /// From one value to another over the whole animation: `a + (b - a) t`.
    Lerp {
        /// What of the target.
        property: Property,
        /// The first value; what the scene says, or what earlier tracks made of it, if not given.
        from: Option<Value>,
        /// The last value.
        to: Value,
        /// How it gathers speed.
        easing: Easing,
    },
    /// From key to key; the first key's value before it, the last one's after it.
    Keys {
        /// What of the target.
        property: Property,
        /// At least one, in the order of their times.
        keys: Vec<Key>,
    },
    /// On a circle: turned by `2 pi turns t` about an axis. A mesh is turned as a whole; with a camera's position its up.
    Orbit {
        /// Which point of the target.
        property: Property,
        /// A point of the axis.
        around: DVec3,
        /// Its direction, of length 1; counter-clockwise seen from its tip.
        axis: DVec3,
        /// How many turns over the whole animation; below 0 the other way round.
        turns: f64,
    },
    /// A camera keeps looking at something.
    LookAt {
        /// What it looks at.
        goal: Goal,
        /// How far beside it.
        offset: DVec3,
    },
}

/// A value at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Key {
    /// Seconds from the beginning.
    pub time: f64,
    /// The value.
    pub value: Value,
    /// The way that leads to it.
    pub easing: Easing,
}

/// What a camera looks at.
#[derive(Debug, Clone, PartialEq)]
pub enum Goal {
    /// A point.
    Point(DVec3),
    /// The middle of an object, wherever it is by then.
    Object(String),
}

/// Three numbers; where one is enough, three times the same.
pub type Value = DVec3;

/// `a + (b - a) t`, which is `b` exactly for 1.
fn lerp(a: Value, b: Value, t: f64) -> Value {
    if t == 1.0 { b } else { a + (b - a) * t }
}

/// The angle of so many turns: 0 after every whole one, so that things come back to where they were, to the bit.
fn angle(turns: f64) -> f64 {
    std::f64::consts::TAU * (turns - turns.floor())
}

/// The point turned about an axis (Rodrigues 1840), as what is added to it: what lies along the axis stays as it is, and
/// without an angle everything does, to the bit.
fn turned(point: DVec3, around: DVec3, axis: DVec3, angle: f64) -> DVec3 {
    let from = point - around;
    let out = from - from.dot(axis) * axis;
    point + (angle.cos() - 1.0) * out + angle.sin() * axis.cross(out)
}

impl Track {
    /// Moves what there is to move to where it is at `time`, 0 to 1, `seconds` after the beginning.
    pub(super) fn apply(&self, scene: &mut Scene, time: f64, seconds: f64) -> Result<()> {
        let middle = match &self.motion {
            Motion::LookAt { goal, .. } => Some(self.goal(goal, scene)?),
            _ => None,
        };
        for mut subject in self.subjects(scene)? {
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
                            Subject::place(object, &(about * DMat4::from_translation(-*around)));
                        }
                        other => {
                            let from = other.value(*property, self)?;
                            other.set(*property, turned(from, *around, *axis, angle), self)?;
                            if let (Subject::Camera(camera), Property::Position) = (other, *property) {
                                camera.up = turned(camera.up, DVec3::ZERO, *axis, angle);
                            }
                        }
                    }
                }
                Motion::LookAt { offset, .. } => {
                    let goal = middle.unwrap_or_default() + *offset;
                    subject.set(Property::LookAt, goal, self)?;
                }
            }
        }
        Ok(())
    }

    fn goal(&self, goal: &Goal, scene: &Scene) -> Result<DVec3> {
        match goal {
            Goal::Point(point) => Ok(*point),
            Goal::Object(name) => {
                middle_of(scene, name).ok_or_else(|| self.unknown(&Target::Object(name.clone()), scene))
            }
        }
    }

    /// Looks at a point where it looked at an object that stands still.
    pub(super) fn settle(&mut self, scene: &Scene) -> Result<()> {
        if let Motion::LookAt { goal, offset } = &self.motion {
            let point = Goal::Point(self.goal(goal, scene)?);
            self.motion = Motion::LookAt { goal: point, offset: *offset };
        }
        Ok(())
    }
}

/// The value between the keys around a time.
fn value_at(keys: &[Key], seconds: f64) -> Value {
    let next = keys.partition_point(|key| key.time <= seconds);
    match (next.checked_sub(1).and_then(|last| keys.get(last)), keys.get(next)) {
        (Some(a), Some(b)) => lerp(a.value, b.value, b.easing.of((seconds - a.time) / (b.time - a.time))),
        (Some(only), None) | (None, Some(only)) => only.value,
        (None, None) => Value::ZERO,
    }
}
