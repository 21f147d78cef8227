//! What moves: tracks as plain data, and what a scene is at a time.
//!
//! A track is a function of time, in closed form: nothing is added up from frame to frame, so any frame can be asked for by
//! itself and nothing drifts.

mod easing;
pub mod file;
mod motion;
mod target;
mod timeline;

pub use easing::Easing;
pub use motion::{Goal, Key, Motion, Value};
pub use target::{Property, Target};
pub use timeline::Timeline;

use super::Scene;
use crate::error::{Error, Place, Result};

/// What moves in a scene, and for how long.
#[derive(Debug, Clone, PartialEq)]
pub struct Animation {
    /// Frames a second.
    pub fps: f64,
    /// Seconds.
    pub duration: f64,
    /// Whether the end is the beginning again, so that the last frame is left to the next round.
    pub repeat: bool,
    /// What moves, in the order of the file: each takes what those before it left.
    pub tracks: Vec<Track>,
}

/// A motion of something.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// What moves.
    pub target: Target,
    /// How.
    pub motion: Motion,
    /// Where the file says so.
    pub place: Place,
}

impl Animation {
    /// Whether anything but cameras and lights moves.
    pub fn moves_objects(&self) -> bool {
        self.tracks.iter().any(|track| matches!(track.target, Target::Object(_)))
    }

    /// The same animation for a scene whose objects stand still and are not asked about: cameras look at points.
    ///
    /// # Errors
    /// [`Error::Input`] where there is no such object.
    pub fn without_objects(&self, scene: &Scene) -> Result<Animation> {
        let mut animation = self.clone();
        for track in &mut animation.tracks {
            track.settle(scene)?;
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
    /// The scene at a time, 0 being the beginning and 1 the end of its animation: a function of the description and the time
    /// alone.
    ///
    /// # Errors
    /// [`Error::Input`] where a track has nothing to move, or comes to what cannot be, such as a sphere of no size.
    pub fn at(&self, time: f64) -> Result<Scene> {
        let mut scene = self.clone();
        if let Some(animation) = &self.animation {
            let seconds = time * animation.duration;
            animation.tracks.iter().try_for_each(|track| track.apply(&mut scene, time, seconds))?;
        }
        Ok(scene)
    }
}

#[cfg(test)]
mod tests;
