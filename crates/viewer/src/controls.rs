//! State of the user's controls, from which render requests are made.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use glam::{DVec2, DVec3};

use super::false_colour::DisplayMode;
use super::keys::CameraMotion;
use super::navigate;
use super::request::{CameraSource, Opened, RenderRequest};
use kiln::job::RenderSettings;
use kiln::scene::animation::{Moment, Timeline};
use kiln::scene::{Camera, Focus, ImportOptions, Lens, Projection};
use kiln::world::StandardView;

/// Flight speed, in distances to the target per second.
const SPEED: f64 = 0.5;

/// Orbit speed of keys, in radians per second.
const TURN: f64 = 1.2;

/// Binary logarithm of the zoom factor of a key press.
const ZOOM: f64 = 0.125;

/// What can be undone: camera, projection, centre of the orbit and settings, and the objects that are isolated and hidden.
#[derive(Clone, PartialEq)]
pub(crate) struct UndoState {
    camera: (CameraSource, Option<Projection>, Option<DVec3>),
    settings: RenderSettings,
    pub visible: [Vec<String>; 2],
}

/// State of the controls.
pub(crate) struct Controls {
    /// Camera.
    pub camera_source: CameraSource,
    /// Projection that overrides the camera's.
    pub projection: Option<Projection>,
    /// Moment of the animation.
    pub time: Moment,
    /// The moment at which the files were opened.
    first: Moment,
    /// Start of playback: clock time and moment of the animation. `None` if paused.
    pub playing: Option<(Instant, Moment)>,
    /// Displayed quantity.
    pub display_mode: DisplayMode,
    /// Render settings.
    pub settings: RenderSettings,
    /// Options with which the files are to be read again.
    pub reading: Option<ImportOptions>,
    /// Vertical field of view of the last perspective camera, in radians.
    angle: f64,
    /// The camera after and before the last change of the projection.
    switched: Option<[Camera; 2]>,
    /// The point about which the camera orbits; `None` for its target.
    pivot: Option<DVec3>,
    /// Minimum and maximum of the bounding box of the scene at the first moment.
    bounds: Option<(DVec3, DVec3)>,
    /// Whether cameras of the files have chosen targets: those of scene files.
    has_targets: bool,
    /// Whether clips of the files can be played.
    plays_clips: bool,
    /// Initial camera, projection and settings of the opened files.
    start: (CameraSource, Option<Projection>, RenderSettings),
    /// Options with which the files were read first.
    start_reading: ImportOptions,
}

impl Controls {
    /// Initial state for opened files.
    pub(crate) fn new(opened: &Opened) -> Self {
        let Opened { camera_source, projection, settings, .. } = opened;
        Controls {
            camera_source: camera_source.clone(),
            projection: *projection,
            time: Moment::first(opened.scene()),
            first: Moment::first(opened.scene()),
            playing: None,
            display_mode: DisplayMode::default(),
            settings: settings.clone(),
            reading: None,
            angle: 40f64.to_radians(),
            switched: None,
            pivot: None,
            bounds: opened.scene().bounds(),
            has_targets: opened.scene().has_settings,
            plays_clips: opened.scene().plays_clips(),
            start: (camera_source.clone(), *projection, settings.clone()),
            start_reading: opened.scene().import_options.clone(),
        }
    }

    /// Updates the state after the files were reloaded: values that the user has not changed take the files' new
    /// values.
    pub(crate) fn reopened(&mut self, opened: &Opened) {
        let (camera_source, projection, _) = &self.start;
        let gone =
            matches!(self.camera_source, CameraSource::Scene(index) if index >= opened.scene().cameras.len());
        if self.camera_source == *camera_source || gone {
            self.camera_source = opened.camera_source.clone();
        }
        if self.projection == *projection {
            self.projection = opened.projection;
        }
        // The others are those of the command line, which stays.
        let (picture, new) = (&mut self.settings.picture, &opened.settings.picture);
        (picture.numerics, picture.colour) = (new.numerics, new.colour);
        self.first = Moment::first(opened.scene());
        if opened.scene().animation.is_none() {
            (self.time, self.playing) = (Moment::first(opened.scene()), None);
        }
        (self.bounds, self.has_targets) = (opened.scene().bounds(), opened.scene().has_settings);
        self.plays_clips = opened.scene().plays_clips();
        self.start = (opened.camera_source.clone(), opened.projection, opened.settings.clone());
    }

    /// The settings with which the files were opened.
    pub(crate) fn start_settings(&self) -> &RenderSettings {
        &self.start.2
    }

    /// The options with which the files were read first.
    pub(crate) fn start_reading(&self) -> &ImportOptions {
        &self.start_reading
    }

    /// What can be undone of this state.
    pub(crate) fn undo_state(&self, options: &ImportOptions) -> UndoState {
        UndoState {
            camera: (self.camera_source.clone(), self.projection, self.pivot),
            settings: self.settings.clone(),
            visible: [options.isolate.clone(), options.hide.clone()],
        }
    }

    /// Restores camera and settings.
    pub(crate) fn restore(&mut self, state: UndoState) {
        (self.camera_source, self.projection, self.pivot) = state.camera;
        self.settings = state.settings;
    }

    /// The render request for this state.
    pub(crate) fn request(&self, opened: &Arc<Opened>, size: [u32; 2]) -> RenderRequest {
        RenderRequest {
            opened: Arc::clone(opened),
            size,
            camera_source: self.camera_source.clone(),
            projection: self.projection,
            time: self.time,
            display_mode: self.display_mode,
            is_playing: self.playing.is_some(),
            settings: self.settings.clone(),
        }
    }

    /// The point about which the camera orbits, if it is not its target: one that was clicked, or the centre of the scene
    /// if neither the files nor the user set a target.
    fn pivot(&self) -> Option<DVec3> {
        let centre = || self.bounds.map(|(min, max)| min / 2.0 + max / 2.0);
        self.pivot.or_else(|| match &self.camera_source {
            CameraSource::Fitted(_) | CameraSource::FittedAt(_, None) => centre(),
            CameraSource::Scene(_) if !self.has_targets => centre(),
            _ => None,
        })
    }

    /// Orbits by angles as of [`navigate::orbit`].
    pub(crate) fn orbit(&mut self, displayed: Option<&Camera>, by: DVec2) {
        let pivot = self.pivot();
        self.navigate(displayed, |camera| {
            let around = pivot.unwrap_or(camera.target);
            navigate::orbit(camera, by, around);
        });
    }

    /// Orbits about a point of the scene from now on, and focuses the lens on it if there is one; `None` for the centre of
    /// the scene.
    pub(crate) fn look_at(&mut self, displayed: &Camera, point: Option<DVec3>, has_lens: bool) {
        if let (Some(point), true) = (point, has_lens) {
            self.navigate(Some(displayed), |camera| {
                camera.lens = Some(Lens { focus: Focus::Point(point), ..camera.lens.unwrap_or_default() });
            });
        }
        self.pivot = point.or(self.bounds.map(|(min, max)| min / 2.0 + max / 2.0));
    }

    /// Moves a point of the scene to the middle of the picture, and orbits about it.
    pub(crate) fn centre(&mut self, displayed: &Camera, point: DVec3) {
        self.navigate(Some(displayed), |camera| navigate::focus(camera, point));
        self.pivot = None;
    }

    /// Changes the camera by `how`. `displayed` is the camera of the displayed picture.
    pub(crate) fn navigate(&mut self, displayed: Option<&Camera>, how: impl FnOnce(&mut Camera)) {
        let camera = match &self.camera_source {
            CameraSource::Free(camera) => Some(camera),
            _ => displayed,
        };
        if let Some(camera) = camera {
            let (before, pivot) = (camera.clone(), self.pivot());
            let mut moved = camera.clone();
            moved.projection = self.projection.unwrap_or(moved.projection);
            if moved.projection == Projection::Perspective {
                self.angle = navigate::field_of_view(&moved);
            }
            how(&mut moved);
            self.projection = None;
            self.pivot = pivot.map(|pivot| navigate::carried(pivot, &before, &moved));
            self.camera_source = CameraSource::Free(moved);
        }
    }

    /// Magnifies by `factor` what is under the mouse: the scene point `surface`, which is approached and not passed; where
    /// there is none, the point at the target's distance. Position and aspect ratio are those of [`navigate::zoom_at`].
    pub(crate) fn zoom(
        &mut self,
        displayed: Option<&Camera>,
        factor: f64,
        surface: Option<DVec3>,
        (at, aspect): (DVec2, f64),
    ) {
        let size = self.bounds.map_or(f64::NAN, |(min, max)| (max - min).length());
        self.navigate(displayed, |camera| {
            let factor = navigate::limited_zoom(camera, factor, size);
            match surface {
                Some(point) => navigate::zoom_about(camera, factor, point),
                None => navigate::zoom_at(camera, factor, at, aspect),
            }
        });
    }

    /// Flies and orbits for `seconds` of held keys, and zooms by pressed keys towards the scene point `middle`.
    pub(crate) fn drive(
        &mut self,
        displayed: Option<&Camera>,
        middle: Option<DVec3>,
        drive: CameraMotion,
        seconds: f64,
        fast: bool,
    ) {
        let speed = if fast { 4.0 * SPEED } else { SPEED };
        let CameraMotion { fly, orbit, zoom } = drive;
        if fly != DVec3::ZERO {
            self.navigate(displayed, |camera| navigate::fly(camera, fly * speed * seconds));
        }
        if orbit != DVec2::ZERO {
            self.orbit(displayed, orbit * TURN * seconds);
        }
        if zoom != 0.0 {
            self.zoom(displayed, (zoom * ZOOM).exp2(), middle, (DVec2::ZERO, 1.0));
        }
    }

    /// Sets the projection. `displayed` is the camera of the displayed picture.
    pub(crate) fn project(&mut self, projection: Projection, displayed: Option<&Camera>) {
        if let Some(camera) = displayed.filter(|camera| camera.projection == Projection::Perspective) {
            self.angle = navigate::field_of_view(camera);
        }
        let angle = self.angle;
        match self.camera_source.clone() {
            CameraSource::Free(before) => match self.switched.take() {
                Some([after, first]) if after == before && first.projection == projection => {
                    self.camera_source = CameraSource::Free(first);
                }
                _ => {
                    self.navigate(displayed, |camera| {
                        navigate::switch_projection(camera, projection, angle);
                    });
                    if let CameraSource::Free(after) = &self.camera_source {
                        self.switched = Some([after.clone(), before]);
                    }
                }
            },
            // A scene camera's viewing rectangle is valid for both projections.
            _ => self.projection = Some(projection),
        }
    }

    /// Switches between perspective and orthographic.
    pub(crate) fn switch_projection(&mut self, displayed: Option<&Camera>) {
        let own = match (&self.camera_source, displayed) {
            (CameraSource::Free(camera), _) | (_, Some(camera)) => camera.projection,
            _ => Projection::Perspective,
        };
        let other = match self.projection.unwrap_or(own) {
            Projection::Perspective => Projection::Orthographic,
            _ => Projection::Perspective,
        };
        self.project(other, displayed);
    }

    /// Restores the initial camera and projection.
    pub(crate) fn reset_camera(&mut self) {
        (self.camera_source, self.projection, self.pivot) = (self.start.0.clone(), self.start.1, None);
    }

    /// Selects a standard view that is fitted to the scene at the displayed moment; to all of the clips while they play.
    pub(crate) fn fit_standard_view(&mut self, view: StandardView) {
        let is_first = self.time == self.first;
        self.set_camera(match self.playing {
            Some(_) if self.plays_clips => CameraSource::FittedAt(view, None),
            _ if is_first => CameraSource::Fitted(view),
            _ => CameraSource::FittedAt(view, Some(self.time)),
        });
    }

    /// Keeps the displayed camera where another scene would be framed by another.
    pub(crate) fn keep_camera(&mut self, displayed: Option<&Camera>) {
        if let (CameraSource::Fitted(_) | CameraSource::FittedAt(..), Some(camera)) =
            (&self.camera_source, displayed)
        {
            self.camera_source = CameraSource::Free(camera.clone());
        }
    }

    /// Selects a camera.
    pub(crate) fn set_camera(&mut self, camera_source: CameraSource) {
        (self.camera_source, self.pivot) = (camera_source, None);
    }

    /// Selects the next camera of the scene.
    pub(crate) fn next_camera(&mut self, count: usize) {
        if count > 0 {
            let next = match self.camera_source {
                CameraSource::Scene(index) => (index + 1) % count,
                _ => 0,
            };
            self.set_camera(CameraSource::Scene(next));
            self.projection = None;
        }
    }

    /// Selects the next display mode, after the last the first.
    pub(crate) fn next_display_mode(&mut self) {
        let after = DisplayMode::ALL.iter().skip_while(|mode| **mode != self.display_mode).nth(1);
        self.display_mode = after.copied().unwrap_or_default();
    }

    /// Lights the scene by an image of the surroundings.
    pub(crate) fn light_by(&mut self, file: &Path) {
        self.settings.picture.light = None;
        self.settings.environment.environment = Some(file.to_string_lossy().into_owned());
    }

    /// Starts or pauses playback.
    pub(crate) fn play(&mut self) {
        self.playing = match self.playing {
            Some(_) => None,
            None => Some((Instant::now(), self.time)),
        };
    }

    /// Shows a frame, modulo the number of frames.
    pub(crate) fn go_to(&mut self, timeline: &Timeline, frame: i32) {
        self.time = timeline.moment(frame.rem_euclid(timeline.last() + 1));
        if self.playing.is_some() {
            self.playing = Some((Instant::now(), self.time));
        }
    }

    /// Goes to the start of the animation.
    pub(crate) fn restart(&mut self) {
        let start = Moment::default();
        (self.time, self.playing) = (start, self.playing.map(|_| (Instant::now(), start)));
    }

    /// Advances playback to the current whole frame, in a loop. `duration` is in seconds.
    pub(crate) fn advance(&mut self, timeline: &Timeline, duration: f64) {
        let Some((since, from)) = self.playing else { return };
        let passed = since.elapsed().as_secs_f64() / duration;
        let frames = f64::from(timeline.last() + 1);
        let at = (frame_of(timeline, from) + passed * timeline.fps() * duration).rem_euclid(frames);
        self.time = timeline.moment(at as i32);
    }

    /// The current frame.
    pub(crate) fn frame(&self, timeline: &Timeline) -> i32 {
        frame_of(timeline, self.time).round() as i32
    }
}

fn frame_of(timeline: &Timeline, moment: Moment) -> f64 {
    moment.part / timeline.time(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use kiln::bvh::Sphere;
    use kiln::job::Session;
    use kiln::scene::{Scene, Shape};

    fn controls(camera: Camera) -> Controls {
        let camera_source = CameraSource::Free(camera);
        let settings = RenderSettings::default();
        let ball = Sphere { centre: DVec3::ZERO, radius: 1.0 };
        let scene = Scene::from_iter([Shape::Analytic(ball.into())]);
        Controls::new(&Opened {
            session: Session::playing(scene).expect("a scene").into(),
            camera_source,
            projection: None,
            settings,
        })
    }

    /// The projection's key, pressed twice, gives the same camera to the bit, and so does the key that resets it.
    #[test]
    fn the_projection_switches_back_to_the_same_camera() {
        let camera =
            Camera::from_field_of_view("c".into(), DVec3::new(5.0, 7.0, 9.0), DVec3::ONE, DVec3::Y, 0.7);
        let mut camera = Camera { viewpoint_distance: 0.3, ..camera };
        camera.view_height *= 0.1;
        let mut controls = controls(camera.clone());
        controls.switch_projection(None);
        let CameraSource::Free(parallel) = controls.camera_source.clone() else { panic!("moved") };
        assert_eq!(parallel.projection, Projection::Orthographic);
        controls.switch_projection(Some(&parallel));
        assert_eq!(controls.camera_source, CameraSource::Free(camera.clone()));
        controls.navigate(None, |camera| navigate::zoom(camera, 2.0));
        controls.switch_projection(None);
        controls.reset_camera();
        assert_eq!(controls.camera_source, CameraSource::Free(camera));
    }
}
