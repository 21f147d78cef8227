//! Cache of the painter between requests: prepared worlds, fitted cameras, and render times per pixel.

use std::sync::{Arc, OnceLock};

use rayon::prelude::*;

use crate::bvh::Layout;
use crate::effects::{Decision, EFFECTS, PlanSettings};
use crate::error::Result;
use crate::error::Warnings;
use crate::film::tone::Exposure;
use crate::job::camera::nothing_to_look_at;
use crate::job::{
    self, EnvironmentSettings, PreparedScene, RenderJob, RenderSettings, ResolvedPicture, SceneAtTime,
};
use crate::render::RenderControl;
use crate::scene::animation::Moment;
use crate::scene::{Camera, DefaultLook, Environment, PictureSettings, Projection, Scene, ShadingMode};
use crate::viewer::false_colour::DisplayMode;
use crate::viewer::request::{CameraSource, Opened, RenderRequest};
use crate::world::{Framing, Recentering, fitted_camera, fitted_to_poses};

/// Number of cached worlds: two sides of a comparison and the exact reference.
const MAX_WORLDS: usize = 3;

/// What a world depends on besides the scene.
#[derive(Clone, PartialEq)]
struct Key {
    /// The settings, with defaults for what no world depends on.
    settings: RenderSettings,
    /// The look without picture settings and notes, which do not change the world, and without the environment, which
    /// follows from the settings.
    look: DefaultLook,
}

impl Key {
    fn new(settings: &RenderSettings, look: &DefaultLook, scene: &Scene) -> Self {
        let (picture, notes) = (PictureSettings::default(), Vec::new());
        let look = DefaultLook { picture, notes, environment: None, ..look.clone() };
        Key { settings: key_settings(settings, scene), look }
    }
}

/// A scene that is prepared for a request.
pub(crate) struct Prepared {
    /// The render job of the final image, before its exposure is metered.
    pub job: RenderJob,
    /// The camera, in scene coordinates.
    pub camera: Camera,
    /// Decision about each effect with the request's sampling, and whether the scene or the sampling uses the effect;
    /// those that are used come first.
    pub decisions: Vec<(Decision, bool)>,
    /// Samples per pixel of the final image, at most: 1 for one at the pixel's centre.
    pub samples: u32,
    /// Whether the exposure is metered before the final image, as in `kiln render`.
    pub meters: bool,
    /// The first frame of an animation, if this is a later one and the exposure is metered or automatic: all frames have
    /// that of the first, as those of `kiln animate`.
    pub first_frame: Option<Arc<Prepared>>,
    /// Settings and clamp with the exposure, once that of a first frame is metered.
    exposed: OnceLock<(PictureSettings, Option<f64>)>,
}

impl Prepared {
    /// Whether [`Prepared::exposed`] is another job.
    pub(crate) fn is_metered(&self) -> bool {
        self.meters || self.first_frame.is_some()
    }

    /// The job with its exposure and clamp, if these are metered or those of the first frame.
    ///
    /// # Errors
    /// Those of rendering.
    pub(crate) fn exposed(&self, control: &RenderControl) -> Result<RenderJob> {
        let plan_settings = self.job.plan_settings.clone();
        let Some(first) = &self.first_frame else {
            let mut job = self.job.with_plan_settings(plan_settings)?;
            if self.meters {
                job.meter(control)?;
            }
            return Ok(job);
        };
        let (picture, clamp) = match first.exposed.get() {
            Some(known) => *known,
            None => {
                let mut job = first.exposed(control)?;
                if job.display().is_auto() {
                    job.settings.picture.exposure = Some(Exposure::Ev(job.display_transform(control)?.ev()));
                }
                *first.exposed.get_or_init(|| (job.settings.picture, job.plan_settings.clamp))
            }
        };
        let mut job = self.job.with_plan_settings(PlanSettings { clamp, ..plan_settings })?;
        job.settings.picture = picture;
        if let Some(Exposure::Ev(ev)) = picture.exposure {
            job.expose_fill(Some(ev));
        }
        Ok(job)
    }

    /// [`Prepared::exposed`] where that renders nothing, since the exposure of the first frame is known.
    pub(crate) fn known_exposed(&self) -> Option<RenderJob> {
        self.first_frame.as_ref().filter(|first| first.exposed.get().is_some())?;
        self.exposed(&RenderControl::default()).ok()
    }

    /// The settings as the panel shows them: an exposure that is metered is `auto`.
    pub(crate) fn shown_settings(&self) -> PictureSettings {
        let picture = self.job.settings.picture;
        let exposure = if self.meters { Some(Exposure::Auto) } else { picture.exposure };
        PictureSettings { exposure, ..picture }
    }
}

/// What a camera that is fitted to a moment depends on: framing, moment or all of the clips, aspect ratio and projection.
type FitKey = (Framing, Option<Moment>, f64, Projection);

/// Cached data of the opened files.
#[derive(Default)]
pub(crate) struct RenderCache {
    opened: Option<Arc<Opened>>,
    environments: Vec<(EnvironmentSettings, Option<Environment>)>,
    /// The looks of the last settings.
    looks: Vec<(RenderSettings, DefaultLook)>,
    scenes: Vec<(Key, Arc<PreparedScene>)>,
    /// Scenes at the last times.
    at_times: Vec<(Key, Moment, SceneAtTime)>,
    /// The recentered scene, if the worlds are recentered.
    recentered_scene: Option<Arc<Scene>>,
    /// Fitted cameras, each with its framing and aspect ratio.
    fitted_cameras: Vec<(Framing, f64, Camera)>,
    /// First frames of animations, of the last sides.
    first_frames: Vec<(RenderRequest, RenderSettings, Arc<Prepared>)>,
    /// The camera that was last fitted to a moment, with what it depends on.
    fitted_at: Option<(FitKey, Camera)>,
    /// The last exposure that was metered, for fill light until the next is.
    metered: Option<f64>,
    /// Render time in seconds per pixel at one sample, by display mode.
    seconds: Vec<(DisplayMode, f64)>,
}

impl RenderCache {
    /// Empties the cache for other opened files.
    fn open(&mut self, opened: &Arc<Opened>) {
        if !self.opened.as_ref().is_some_and(|known| Arc::ptr_eq(known, opened)) {
            *self = RenderCache { opened: Some(Arc::clone(opened)), ..RenderCache::default() };
        }
    }

    /// Whether the trees of all sides of a request are cached.
    pub(crate) fn has_worlds(&mut self, request: &RenderRequest) -> bool {
        self.open(&request.opened);
        let scene = &request.opened.scene;
        let mut has = |side: &RenderSettings| {
            let settings = request.render_settings(side);
            let Ok(look) = self.look(scene, &settings) else { return false };
            let Key { settings, look } = Key::new(&settings, &look, scene);
            // Whether the ground is hidden depends on the camera.
            let is_it = |known: &Key| {
                known.settings == settings
                    && known.look == DefaultLook { ground: known.look.ground, ..look.clone() }
            };
            self.scenes.iter().any(|(known, _)| is_it(known))
        };
        request.sides.iter().all(&mut has)
    }

    /// Render time in seconds per pixel at one sample; `None` before the first measurement.
    pub(crate) fn seconds_per_pixel(&self, request: &RenderRequest) -> Option<f64> {
        self.seconds.iter().find(|(mode, _)| *mode == request.display_mode).map(|(_, seconds)| *seconds)
    }

    /// Records a render time per pixel: the geometric mean with the previous value, which damps outliers caused by
    /// other processes.
    pub(crate) fn record_seconds(&mut self, request: &RenderRequest, seconds: f64) {
        let seconds = self.seconds_per_pixel(request).map_or(seconds, |before| (before * seconds).sqrt());
        self.seconds.retain(|(mode, _)| *mode != request.display_mode);
        self.seconds.push((request.display_mode, seconds));
    }

    /// Records a metered exposure.
    pub(crate) fn record_exposure(&mut self, metered: &RenderJob) {
        if let Some(Exposure::Ev(ev)) = metered.settings.picture.exposure {
            self.metered = Some(ev);
        }
    }

    /// Prepares the scene for a request with the settings of one side.
    pub(crate) fn prepare(
        &mut self,
        request: &RenderRequest,
        side: &RenderSettings,
    ) -> Result<Arc<Prepared>> {
        self.open(&request.opened);
        let settings = request.render_settings(side);
        let scene = &request.opened.scene;
        let mut look = self.look(scene, &settings)?;
        let mut prepared = self.at_time(&settings, &look, request)?;
        let recentering = prepared.recentering;
        let moved_back =
            |camera: &Camera| recentering.map_or_else(|| camera.clone(), |by| by.moved_back(camera));
        let mut camera = match &request.camera_source {
            CameraSource::Scene(index) => {
                let camera = prepared.cameras.get(*index).or(prepared.cameras.first());
                camera.ok_or_else(|| nothing_to_look_at(scene))?.clone()
            }
            CameraSource::Fitted(view) => {
                let framing = settings.framing(*view, scene);
                let recentering = self.prepared(&settings, &look, scene)?.recentering();
                self.fit(request, (&settings, framing), recentering)?
            }
            CameraSource::FittedAt(view, moment) => {
                // As if it was given: the command that renders the picture gives it.
                let camera = self.fit_at(request, (&settings, settings.framing(*view, scene)), *moment)?;
                let camera_source = CameraSource::Free(camera);
                return self.prepare(&RenderRequest { camera_source, ..request.clone() }, side);
            }
            CameraSource::Free(camera) => recentering.map_or_else(|| camera.clone(), |by| by.moved(camera)),
        };
        camera.projection = request.projection.unwrap_or(camera.projection);
        let in_scene = match &request.camera_source {
            CameraSource::Free(free) => Camera { projection: camera.projection, ..free.clone() },
            _ => moved_back(&camera),
        };
        let had_ground = look.ground.is_some();
        let bounds = || scene.bounds();
        let of_scene = (scene, &bounds as &dyn Fn() -> _);
        let picture = job::resolve_picture(of_scene, &mut look, in_scene.clone(), request.size, &settings)?;
        if had_ground && look.ground.is_none() {
            prepared = self.at_time(&settings, &look, request)?;
        }
        let meters = picture.meters;
        let mut job = prepared.job_for(ResolvedPicture { camera, ..picture })?;
        if meters {
            job.expose_fill(self.metered);
        }
        let (sampling, plan_settings, whole) = (job.plan_settings.sampling, &job.plan_settings, &job.plan);
        let samples = if whole.takes_samples() { sampling.max_samples() } else { 1 };
        let decisions = EFFECTS.iter().zip(&whole.decisions);
        let mut decisions: Vec<(Decision, bool)> = decisions
            .map(|(effect, decision)| {
                (decision.clone(), (effect.called_for)(&job.world, plan_settings).is_ok())
            })
            .collect();
        decisions.sort_by_key(|(_, can)| !can);
        let is_later = scene.animation.is_some() && request.time != Moment::default();
        let first_frame = match is_later && (meters || job.display().is_auto()) {
            true => Some(self.first_frame(request, side)?),
            false => None,
        };
        let (camera, exposed) = (in_scene, OnceLock::new());
        Ok(Arc::new(Prepared { job, camera, decisions, samples, meters, first_frame, exposed }))
    }

    /// The first frame of the animation of a request.
    fn first_frame(&mut self, request: &RenderRequest, side: &RenderSettings) -> Result<Arc<Prepared>> {
        let first = RenderRequest {
            time: Moment::default(),
            display_mode: DisplayMode::Picture,
            is_playing: false,
            ..request.clone()
        };
        if let Some((.., known)) = self.first_frames.iter().find(|(r, s, _)| (r, s) == (&first, side)) {
            return Ok(Arc::clone(known));
        }
        let found = self.prepare(&first, side)?;
        self.first_frames.drain(..self.first_frames.len().saturating_sub(MAX_WORLDS - 1));
        self.first_frames.push((first, side.clone(), Arc::clone(&found)));
        Ok(found)
    }

    /// The look of a scene: that of `kiln render`.
    fn look(&mut self, scene: &Scene, settings: &RenderSettings) -> Result<DefaultLook> {
        let settings = settings.of_look(scene);
        if let Some((_, look)) = self.looks.iter().find(|(known, _)| *known == settings) {
            return Ok(look.clone());
        }
        let known = self.environments.iter().find(|(known, _)| *known == settings.environment);
        let environment = match known {
            Some((_, environment)) => environment.clone(),
            None => {
                let read = settings.environment.of(scene, &mut Warnings::default())?;
                self.environments.drain(..self.environments.len().saturating_sub(MAX_WORLDS - 1));
                self.environments.push((settings.environment.clone(), read.clone()));
                read
            }
        };
        let look = job::default_look(scene, &settings, environment)?;
        self.looks.drain(..self.looks.len().saturating_sub(MAX_WORLDS - 1));
        self.looks.push((settings, look.clone()));
        Ok(look)
    }

    /// The scene with its look.
    fn prepared(
        &mut self,
        settings: &RenderSettings,
        look: &DefaultLook,
        scene: &Scene,
    ) -> Result<Arc<PreparedScene>> {
        let key = Key::new(settings, look, scene);
        if let Some(at) = self.scenes.iter().position(|(known, _)| *known == key) {
            let found = self.scenes.remove(at);
            self.scenes.push(found);
        } else {
            self.scenes.drain(..self.scenes.len().saturating_sub(MAX_WORLDS - 1));
            let (pipeline, numerics) = (look.picture.pipeline(), look.picture.numerics());
            let structure = Layout::Wide(settings.preset);
            let prepared = PreparedScene::new(scene.clone(), look, pipeline, structure, numerics)?;
            self.scenes.push((key, Arc::new(prepared)));
        }
        Ok(Arc::clone(&self.scenes[self.scenes.len() - 1].1))
    }

    /// The scene with its look at the time of a request.
    fn at_time(
        &mut self,
        settings: &RenderSettings,
        look: &DefaultLook,
        request: &RenderRequest,
    ) -> Result<SceneAtTime> {
        let (scene, time) = (&request.opened.scene, request.time);
        let key = Key::new(settings, look, scene);
        if let Some((.., found)) = self.at_times.iter().find(|(known, at, _)| (known, *at) == (&key, time)) {
            return Ok(found.clone());
        }
        self.at_times.retain(|(known, ..)| *known != key);
        self.at_times.drain(..self.at_times.len().saturating_sub(MAX_WORLDS - 1));
        let found = self.prepared(settings, look, scene)?.at(time)?;
        self.at_times.push((key, time, found.clone()));
        Ok(found)
    }

    /// A camera fitted to the scene at a moment of its animation, in scene coordinates; to poses of all of its clips without
    /// a moment.
    fn fit_at(
        &mut self,
        request: &RenderRequest,
        (settings, framing): (&RenderSettings, Framing),
        moment: Option<Moment>,
    ) -> Result<Camera> {
        let aspect = f64::from(request.size[0]) / f64::from(request.size[1]);
        let projection = request.projection.unwrap_or_default();
        let key = (framing, moment, aspect, projection);
        if let Some((_, camera)) = self.fitted_at.as_ref().filter(|(known, _)| *known == key) {
            return Ok(camera.clone());
        }
        let scene = &request.opened.scene;
        let seen_at = |moment| {
            let pose = job::scene_at(scene, moment)?;
            Ok(settings.looked_at(&pose)?.into_owned())
        };
        let animation = scene.animation.as_ref().filter(|_| moment.is_none());
        let others = animation.map_or(Vec::new(), |animation| fitted_moments(scene, animation.duration));
        // A pose that cannot be read is the error of its frame.
        let others = others.into_par_iter().filter_map(|moment| seen_at(moment).ok());
        let first = seen_at(moment.unwrap_or_default())?;
        let camera = fitted_to_poses(&first, others, framing, aspect, projection);
        let camera = camera.ok_or_else(|| nothing_to_look_at(scene))?;
        self.fitted_at = Some((key, camera.clone()));
        Ok(camera)
    }

    /// A camera fitted to the unanimated scene, in world coordinates: the same that `kiln render` uses.
    fn fit(
        &mut self,
        request: &RenderRequest,
        (settings, framing): (&RenderSettings, Framing),
        recentering: Option<Recentering>,
    ) -> Result<Camera> {
        let aspect = f64::from(request.size[0]) / f64::from(request.size[1]);
        let projection = request.projection.unwrap_or_default();
        let is_it = |(known, at, camera): &&(Framing, f64, Camera)| {
            (*known, *at, camera.projection) == (framing, aspect, projection)
        };
        if let Some((.., camera)) = self.fitted_cameras.iter().find(is_it) {
            return Ok(camera.clone());
        }
        if let (None, Some(recentering)) = (&self.recentered_scene, recentering) {
            let mut scene = request.opened.scene.clone();
            recentering.apply(&mut scene);
            self.recentered_scene = Some(Arc::new(scene));
        }
        let scene = self.recentered_scene.as_deref().unwrap_or(&request.opened.scene);
        let seen = settings.looked_at(scene)?;
        let camera =
            fitted_camera(&seen, framing, aspect, projection).ok_or_else(|| nothing_to_look_at(scene))?;
        self.fitted_cameras.retain(|(known, ..)| *known != framing);
        self.fitted_cameras.push((framing, aspect, camera.clone()));
        Ok(camera)
    }
}

/// The most moments of clips that a camera is fitted to besides the first, and the most triangles of all of them together,
/// since each pose is read from the files.
const FITTED_MOMENTS: usize = 16;
const FITTED_TRIANGLES: usize = 4_000_000;

/// Moments after the first that a camera is fitted to, at equal distances up to the end of clips of `duration` seconds.
fn fitted_moments(scene: &Scene, duration: f64) -> Vec<Moment> {
    let count = (FITTED_TRIANGLES / scene.primitive_count().max(1)).clamp(2, FITTED_MOMENTS);
    let parts = (1..=count).map(|index| index as f64 / count as f64);
    parts.map(|part| Moment { part, seconds: part * duration }).collect()
}

/// The settings without those that no world depends on. Of the shading, it depends on whether it has lights.
fn key_settings(settings: &RenderSettings, scene: &Scene) -> RenderSettings {
    let settings = settings.of_look(scene);
    let lit =
        |shading: ShadingMode| if shading.uses_lights() { ShadingMode::Full } else { ShadingMode::Flat };
    RenderSettings {
        with: Vec::new(),
        without: Vec::new(),
        picture: PictureSettings {
            shading: settings.picture.shading.map(lit),
            clamp: None,
            samples: None,
            filter: None,
            filter_radius: None,
            noise: None,
            min_samples: None,
            seed: None,
            sampler: None,
            exposure: None,
            tone_map: None,
            ..settings.picture
        },
        ..settings
    }
}
