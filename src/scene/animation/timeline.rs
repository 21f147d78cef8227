//! Mapping of frame numbers to times.

use crate::scene::{Scene, Seconds};

/// Maximum number of frames of an animation: nine hours at 30 per second.
const MAX_FRAMES: f64 = 1e6;

/// A moment of an animation.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Moment {
    /// The part of the animation that is over: 0 at the beginning, 1 at the end.
    pub part: f64,
    /// Seconds since the beginning. Pictures of different seconds have different random numbers.
    pub seconds: f64,
}

impl Moment {
    /// The moment of a picture of a scene in which nothing moves: that of the pose of its clips.
    pub fn of_still(scene: &Scene) -> Self {
        Moment { part: 0.0, seconds: scene.import_options.time.map_or(0.0, Seconds::get) }
    }

    /// The moment at which the window opens a scene.
    pub fn first(scene: &Scene) -> Self {
        if scene.animation.is_some() { Moment::default() } else { Moment::of_still(scene) }
    }
}

/// Frame times: with F = fps * duration, frame i is at time i / F.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timeline {
    fps: f64,
    /// F, the number of frame intervals.
    steps: f64,
    repeat: bool,
}

impl Timeline {
    /// A timeline of `duration` seconds at `fps` frames per second.
    ///
    /// # Errors
    /// A message if there is no frame or more than a million.
    pub fn new(fps: f64, duration: f64, repeat: bool) -> Result<Self, String> {
        let usable = |x: f64| x.is_finite() && x > 0.0;
        if !usable(fps) || !usable(duration) {
            return Err("give `fps` and `duration` above 0".into());
        }
        let steps = fps * duration;
        // 0.7 * 30 is not 21 in binary; values this close to an integer are rounded.
        let whole = steps.round();
        let steps = if (steps - whole).abs() <= 1e-9 * whole { whole } else { steps };
        if steps > MAX_FRAMES {
            return Err("give less; a million frames are the most".into());
        }
        if repeat && steps < 1.0 {
            return Err("give more; there is not one frame".into());
        }
        Ok(Timeline { fps, steps, repeat })
    }

    /// Frames per second.
    pub fn fps(&self) -> f64 {
        self.fps
    }

    /// Number of the last frame, counted from 0. The frame at the very end is included unless the animation repeats.
    pub fn last(&self) -> i32 {
        if self.repeat { self.steps.ceil() as i32 - 1 } else { self.steps.floor() as i32 }
    }

    /// Time of a frame: 0 at the beginning, 1 at the end.
    pub fn time(&self, frame: i32) -> f64 {
        f64::from(frame) / self.steps
    }

    /// The moment of a frame. Its seconds are the f64 nearest to frame / fps, so those of `--time` with that quotient.
    pub fn moment(&self, frame: i32) -> Moment {
        Moment { part: self.time(frame), seconds: f64::from(frame) / self.fps }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ten_seconds_at_thirty_frames_have_301() {
        let line = Timeline::new(30.0, 10.0, false).unwrap();
        assert_eq!((line.last(), line.time(0), line.time(150), line.time(300)), (300, 0.0, 0.5, 1.0));
        assert_eq!(line.time(1), 1.0 / 300.0);
    }

    /// Not 9 / 45 * 1.5, which is another f64 than 9 / 30.
    #[test]
    fn seconds_are_the_quotient_of_frame_and_rate() {
        let line = Timeline::new(30.0, 1.5, false).unwrap();
        assert_ne!(line.time(9) * 1.5, 9.0 / 30.0);
        assert_eq!(line.moment(9), Moment { part: 9.0 / 45.0, seconds: 0.3 });
        assert_eq!(Timeline::new(2.0, 1.0, false).unwrap().moment(1).seconds, 0.5);
    }

    #[test]
    fn what_repeats_has_no_frame_twice() {
        let line = Timeline::new(24.0, 2.0, true).unwrap();
        // 48 steps; the 49th frame would be the first again.
        assert_eq!((line.last(), line.time(48)), (47, 1.0));
    }

    #[test]
    fn lengths_that_are_not_whole_end_before_the_end() {
        // 29.97 * 10 = 299.7 steps: frame 299 is the last within.
        assert_eq!(Timeline::new(29.97, 10.0, false).unwrap().last(), 299);
        assert_eq!(Timeline::new(29.97, 10.0, true).unwrap().last(), 299);
        // 0.7 * 30 is 20.999999999999996 in binary.
        assert_eq!(Timeline::new(30.0, 0.7, false).unwrap().last(), 21);
        assert_eq!(Timeline::new(30.0, 0.01, false).unwrap().last(), 0);
    }

    #[test]
    fn what_has_no_frames_is_refused() {
        for (fps, duration, repeat) in [
            (0.0, 1.0, false),
            (30.0, -1.0, false),
            (f64::NAN, 1.0, false),
            (30.0, 1e9, false),
            (1.0, 0.5, true),
        ] {
            assert!(Timeline::new(fps, duration, repeat).is_err());
        }
    }
}
