//! What the user has chosen to see: the interface changes this, and an order follows from it.

use std::sync::Arc;
use std::time::Instant;

use glam::{DVec2, DVec3};

use super::false_colour::DisplayMode;
use super::keys::CameraMotion;
use super::request::{CameraSource, Opened, RenderRequest, Settings};
use super::navigate;
use crate::scene::animation::Timeline;
use crate::scene::{Camera, Numerics, Projection};
use crate::shading::ShadingMode;
use crate::world::StandardView;

/// Lengths of the distance to the target that are flown in a second.
const SPEED: f64 = 0.5;

/// Radians that keys orbit in a second.
const TURN: f64 = 1.2;

/// Powers of two that a press of + zooms by.
const ZOOM: f64 = 0.125;

/// Everything that can be chosen.
pub struct Controls {
    /// Where it is seen from.
    pub camera_source: CameraSource,
    /// The projection, instead of the camera's own.
    pub projection: Option<Projection>,
    /// The moment of the animation, 0 being the beginning and 1 the end.
    pub time: f64,
    /// Since when it plays, and from where.
    pub playing: Option<(Instant, f64)>,
    /// What is shown.
    pub display_mode: DisplayMode,
    /// How it is computed, in one or two ways.
    pub sides: Vec<Settings>,
    /// Which of them the panel changes.
    pub side: usize,
    /// Where the line between two sides is: the share of the width left of it.
    pub split: f32,
    /// The angle of view that perspective had last, in radians.
    angle: f64,
    /// What the files said when they were opened.
    start: (CameraSource, Option<Projection>, Settings),
}

impl Controls {
    /// As files are first looked at.
    pub fn new(opened: &Opened) -> Self {
        let Opened { camera_source, projection, settings, .. } = opened;
        Controls {
            camera_source: camera_source.clone(),
            projection: *projection,
            time: 0.0,
            playing: None,
            display_mode: DisplayMode::default(),
            sides: vec![settings.clone()],
            side: 0,
            split: 0.5,
            angle: 40f64.to_radians(),
            start: (camera_source.clone(), *projection, settings.clone()),
        }
    }

    /// The files have changed: what the user chose stays, what was the files' own follows them.
    pub fn reopened(&mut self, opened: &Opened) {
        let (camera_source, projection, settings) = &self.start;
        let gone = matches!(self.camera_source, CameraSource::Scene(index) if index >= opened.scene.cameras.len());
        if self.camera_source == *camera_source || gone {
            self.camera_source = opened.camera_source.clone();
        }
        if self.projection == *projection {
            self.projection = opened.projection;
        }
        for side in &mut self.sides {
            let new = &opened.settings;
            side.choices.scene = new.choices.scene.clone();
            update_unchanged(&mut side.choices.shading, settings.choices.shading, new.choices.shading);
            update_unchanged(&mut side.numerics, settings.numerics, new.numerics);
            update_unchanged(&mut side.pipeline, settings.pipeline, new.pipeline);
            update_unchanged(&mut side.choices.sampling, settings.choices.sampling, new.choices.sampling);
        }
        if opened.scene.animation.is_none() {
            (self.time, self.playing) = (0.0, None);
        }
        self.start = (opened.camera_source.clone(), opened.projection, opened.settings.clone());
    }

    /// The settings that the panel changes.
    pub fn settings(&mut self) -> &mut Settings {
        &mut self.sides[self.side]
    }

    /// The order that follows.
    pub fn request(&self, opened: &Arc<Opened>, size: [u32; 2]) -> RenderRequest {
        RenderRequest {
            opened: Arc::clone(opened),
            size,
            camera_source: self.camera_source.clone(),
            projection: self.projection,
            time: self.time,
            display_mode: self.display_mode,
            is_playing: self.playing.is_some(),
            sides: self.sides.clone(),
        }
    }

    /// Moves the camera, which was last seen as `seen`.
    pub fn navigate(&mut self, displayed: Option<&Camera>, how: impl FnOnce(&mut Camera)) {
        let camera = match &self.camera_source {
            CameraSource::Free(camera) => Some(camera),
            _ => displayed,
        };
        if let Some(camera) = camera {
            let mut moved = camera.clone();
            moved.projection = self.projection.unwrap_or(moved.projection);
            if moved.projection == Projection::Perspective {
                self.angle = navigate::field_of_view(&moved);
            }
            how(&mut moved);
            self.projection = None;
            self.camera_source = CameraSource::Free(moved);
        }
    }

    /// Flies and turns by keys that were held for so many seconds, and zooms by those that were pressed.
    pub fn drive(&mut self, displayed: Option<&Camera>, drive: CameraMotion, seconds: f64, fast: bool) {
        let speed = if fast { 4.0 * SPEED } else { SPEED };
        let CameraMotion { fly, orbit, zoom } = drive;
        self.navigate(displayed, |camera| {
            if fly != DVec3::ZERO {
                navigate::fly(camera, fly * speed * seconds);
            }
            if orbit != DVec2::ZERO {
                navigate::orbit(camera, orbit * TURN * seconds);
            }
            if zoom != 0.0 {
                navigate::zoom(camera, (zoom * ZOOM).exp2());
            }
        });
    }

    /// Has the projection that it is told; `seen` is the camera of the picture that is shown.
    pub fn project(&mut self, projection: Projection, displayed: Option<&Camera>) {
        let angle = self.angle;
        match &self.camera_source {
            CameraSource::Free(_) => {
                self.navigate(displayed, |camera| navigate::switch_projection(camera, projection, angle));
            }
            // Of the scene's own cameras the rectangle says all.
            _ => self.projection = Some(projection),
        }
    }

    /// The other projection than that which is seen.
    pub fn switch_projection(&mut self, displayed: Option<&Camera>) {
        let own = match (&self.camera_source, displayed) {
            (CameraSource::Free(camera), _) | (_, Some(camera)) => camera.projection,
            _ => Projection::Perspective,
        };
        let other = match self.projection.unwrap_or(own) {
            Projection::Perspective => Projection::Orthographic,
            Projection::Orthographic => Projection::Perspective,
        };
        self.project(other, displayed);
    }

    /// Back to where it was first seen from.
    pub fn reset_camera(&mut self) {
        (self.camera_source, self.projection) = (self.start.0.clone(), self.start.1);
    }

    /// Seen from a standard side, all of it.
    pub fn fit_standard_view(&mut self, view: StandardView) {
        self.camera_source = CameraSource::Fitted(view);
    }

    /// The next camera of the scene.
    pub fn next_camera(&mut self, count: usize) {
        if count > 0 {
            let next = match self.camera_source {
                CameraSource::Scene(index) => (index + 1) % count,
                _ => 0,
            };
            (self.camera_source, self.projection) = (CameraSource::Scene(next), None);
        }
    }

    /// The next shading mode.
    pub fn next_shading(&mut self) {
        let shading = &mut self.settings().choices.shading;
        *shading = next(&ShadingMode::ALL, *shading);
    }

    /// The next tier.
    pub fn next_tier(&mut self) {
        let numerics = &mut self.settings().numerics;
        *numerics = next(&Numerics::ALL, *numerics);
    }

    /// Beside a second setting, or alone.
    pub fn switch_comparison(&mut self) {
        match self.sides.len() {
            1 => {
                self.sides.push(self.sides[0].clone());
                self.side = 1;
            }
            _ => {
                self.sides.truncate(1);
                self.side = 0;
            }
        }
    }

    /// Goes on or stops.
    pub fn play(&mut self) {
        self.playing = match self.playing {
            Some(_) => None,
            None => Some((Instant::now(), self.time)),
        };
    }

    /// Goes to a frame, which is brought into the animation.
    pub fn go_to(&mut self, timeline: &Timeline, frame: i32) {
        self.time = timeline.time(frame.rem_euclid(timeline.last() + 1));
        if self.playing.is_some() {
            self.playing = Some((Instant::now(), self.time));
        }
    }

    /// Brings the time of what plays up to now, to a whole frame; from the end on it begins again.
    pub fn advance(&mut self, timeline: &Timeline, duration: f64) {
        let Some((since, from)) = self.playing else { return };
        let passed = since.elapsed().as_secs_f64() / duration;
        let frames = f64::from(timeline.last() + 1);
        let at = (frame_of(timeline, from) + passed * timeline.fps() * duration).rem_euclid(frames);
        self.time = timeline.time(at as i32);
    }

    /// The frame that is shown.
    pub fn frame(&self, timeline: &Timeline) -> i32 {
        frame_of(timeline, self.time).round() as i32
    }
}

fn frame_of(timeline: &Timeline, time: f64) -> f64 {
    time / timeline.time(1)
}

/// What was as the files said goes on as they say now.
fn update_unchanged<T: PartialEq + Copy>(value: &mut T, old: T, new: T) {
    if *value == old {
        *value = new;
    }
}

/// The one after `value`, in turns.
pub fn next<T: PartialEq + Copy>(all: &[T], value: T) -> T {
    let at = all.iter().position(|other| *other == value).map_or(0, |at| at + 1);
    all[at % all.len()]
}
