//! Animation tracks as plain data, and their evaluation at a time.
//!
//! A track is a closed-form function of time. Frames do not accumulate error and can be evaluated in any order.

pub(crate) mod clip;

mod easing;
mod motion;
mod target;
mod timeline;

pub use easing::Easing;
pub use motion::{Goal, Key, Motion, Value};
use target::Names;
pub use target::{Property, Target};
pub use timeline::{Moment, Timeline};

use glam::DVec3;

use super::{Camera, Clip, Scene};
use crate::error::{Error, Place, Result};

/// Animation of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Animation {
    /// Frames per second.
    pub fps: f64,
    /// Duration in seconds.
    pub duration: f64,
    /// Whether the animation loops, so that the last frame, equal to the first, is omitted.
    pub repeat: bool,
    /// Tracks in the order of the file; each acts on the result of those before it.
    pub tracks: Vec<Track>,
    /// Clips of the input files, played together from their beginnings. The last pose of each holds.
    pub clips: Vec<Clip>,
}

/// A motion and its target.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// The animated camera, object or light.
    pub target: Target,
    /// The motion.
    pub motion: Motion,
    /// Place in the input file.
    pub place: Place,
}

impl Animation {
    /// The default frames per second.
    pub const FPS: f64 = 30.0;

    /// The duration of a turntable in seconds.
    pub const TURN: f64 = 10.0;

    /// The animation of a turntable.
    pub fn turntable(tracks: Vec<Track>) -> Self {
        Animation { fps: Self::FPS, duration: Self::TURN, repeat: true, tracks, clips: Vec::new() }
    }

    /// A camera orbits once around a point, about the vertical axis.
    pub fn orbit(camera: &Camera, around: DVec3) -> Self {
        let orbit = |property| Track {
            target: Target::Camera(camera.name.clone()),
            motion: Motion::Orbit { property, around, axis: DVec3::Y, turns: 1.0 },
            place: std::path::Path::new("turntable").into(),
        };
        Animation::turntable(vec![orbit(Property::Position), orbit(Property::LookAt)])
    }

    /// Whether any surface of the scene changes: an object, or a light with an area. Cameras and other lights may move
    /// without this.
    pub fn moves_surfaces(&self, scene: &Scene) -> bool {
        let is_area =
            |name: &str| scene.lights.iter().any(|light| light.name == name && light.kind.is_area());
        !self.clips.is_empty()
            || self.tracks.iter().any(|track| match &track.target {
                Target::Object(_) => true,
                Target::Light(name) => is_area(name),
                Target::Camera(_) => false,
            })
    }

    /// Whether a light has a track.
    pub fn moves_lights(&self) -> bool {
        self.tracks.iter().any(|track| matches!(track.target, Target::Light(_)))
    }

    /// The same animation with look-at objects, which must not move, replaced by the points where they are.
    ///
    /// # Errors
    /// [`Error::Input`] if a look-at object does not exist.
    pub fn without_objects(&self, scene: &Scene) -> Result<Animation> {
        let mut animation = self.clone();
        let scene = scene.with_hidden();
        let names = Names::of(&scene);
        for track in &mut animation.tracks {
            track.resolve_goal(&scene, &names)?;
        }
        Ok(animation)
    }
}

impl Track {
    fn error(&self, what: impl Into<String>, hint: impl Into<String>) -> Error {
        Error::input(self.place.clone(), what, hint)
    }
}

impl Scene {
    /// The scene at a time, 0 at the beginning and 1 at the end of its animation; depends only on the description and
    /// the time.
    ///
    /// # Errors
    /// [`Error::Input`] if a track has no target, or results in an invalid value such as a radius of 0.
    pub fn at(&self, time: f64) -> Result<Scene> {
        let mut scene = self.clone();
        if let Some(animation) = &self.animation {
            let seconds = time * animation.duration;
            let hidden = scene.show_all();
            let names = Names::of(&scene);
            animation.tracks.iter().try_for_each(|track| track.apply(&mut scene, &names, time, seconds))?;
            scene.hide_objects(&hidden);
        }
        Ok(scene)
    }
}

#[cfg(test)]
mod tests;
