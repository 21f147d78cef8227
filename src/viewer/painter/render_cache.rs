//! Cache of the painter between requests: prepared worlds, fitted cameras, and render times per pixel.

use std::sync::Arc;

use crate::animation::{FrameWorld, PreparedAnimation};
use crate::bvh::Layout;
use crate::effects::{Choices, Decision, EFFECTS, Plan};
use crate::error::{Error, Result};
use crate::film::ColourPipeline;
use crate::job::{self, AddedLight, RenderJob};
use crate::scene::{Camera, Numerics, Sampling, Scene};
use crate::viewer::false_colour::DisplayMode;
use crate::viewer::refine::SamplingKind;
use crate::viewer::request::{CameraSource, Opened, RenderRequest, Settings};
use crate::world::{Recentering, StandardView, fitted_camera};

/// Number of cached worlds: two sides of a comparison and the exact reference.
const MAX_WORLDS: usize = 3;

/// Settings that a world depends on besides the scene.
type Key = (Numerics, ColourPipeline);

/// A scene that is prepared for a request.
pub(crate) struct Prepared {
    /// Render job with one sample per pixel, at its centre.
    pub job: RenderJob,
    /// The camera, in scene coordinates.
    pub camera: Camera,
    /// Decision about each effect with the request's sampling, and whether the scene or the sampling uses the effect.
    pub decisions: Vec<(Decision, bool)>,
    /// Sampling of the final image.
    pub kind: SamplingKind,
}

/// Cached data of the opened files.
#[derive(Default)]
pub(crate) struct RenderCache {
    opened: Option<Arc<Opened>>,
    animations: Vec<(Key, Arc<PreparedAnimation>)>,
    frames: Vec<(Key, f64, Arc<FrameWorld>)>,
    /// The recentered scene, if the worlds are recentered.
    recentered_scene: Option<Arc<Scene>>,
    /// Fitted cameras, each with its view and aspect ratio.
    fitted_cameras: Vec<(StandardView, f64, Camera)>,
    /// Render time in seconds per pixel at one sample, by display mode.
    seconds: Vec<(DisplayMode, f64)>,
}

impl RenderCache {
    /// Whether the trees of all sides of a request are cached.
    pub(crate) fn has_worlds(&self, request: &RenderRequest) -> bool {
        let same = self.opened.as_ref().is_some_and(|opened| Arc::ptr_eq(opened, &request.opened));
        let has = |settings: &Settings| self.animations.iter().any(|(key, _)| *key == key_of(settings));
        same && request.sides.iter().all(has)
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

    /// Prepares the scene for a request with the settings of one side.
    pub(crate) fn prepare(&mut self, request: &RenderRequest, settings: &Settings) -> Result<Arc<Prepared>> {
        if !self.opened.as_ref().is_some_and(|opened| Arc::ptr_eq(opened, &request.opened)) {
            *self = RenderCache { opened: Some(Arc::clone(&request.opened)), ..RenderCache::default() };
        }
        let animation = self.animation(&request.opened, settings)?;
        let frame = self.frame(&animation, settings, request.time)?;
        let recentering = frame.recentering;
        let mut lens = match &request.camera_source {
            CameraSource::Scene(index) => frame.cameras.get(*index).unwrap_or(&frame.camera).clone(),
            CameraSource::Fitted(view) => self.fit(request, *view, animation.range())?,
            CameraSource::Free(camera) => {
                recentering.map_or_else(|| camera.clone(), |recentering| recentering.moved(camera))
            }
        };
        lens.projection = request.projection.unwrap_or(lens.projection);
        let mut world = Arc::clone(&frame.world);
        let is_lit = job::is_lit(&request.opened.scene, settings.choices.transport);
        let light = match (request.opened.scene.has_key_light, settings.headlight && !is_lit) {
            (true, _) => Some(AddedLight::Key),
            (false, wanted) => wanted.then_some(AddedLight::Headlight),
        };
        if let Some(light) = light.filter(|_| settings.choices.shading.uses_lights()) {
            world = Arc::new(world.under(light.at(&lens).into_iter().collect()));
        }
        let sampling = settings.choices.sampling;
        let whole = Plan::new(&world, &settings.choices)?;
        let kind = match (whole.takes_samples(), whole.is_adaptive()) {
            (false, _) => SamplingKind::Centres,
            (true, false) => SamplingKind::Samples(sampling.max_samples()),
            (true, true) => SamplingKind::Adaptive,
        };
        let decisions = EFFECTS.iter().zip(whole.decisions);
        let decisions = decisions
            .map(|(effect, decision)| (decision, (effect.called_for)(&world, &settings.choices).is_ok()))
            .collect();
        let camera = match &request.camera_source {
            CameraSource::Free(camera) => Camera { projection: lens.projection, ..camera.clone() },
            _ => recentering.map_or_else(|| lens.clone(), |recentering| recentering.moved_back(&lens)),
        };
        let centres = Choices { sampling: Sampling::default(), ..settings.choices.clone() };
        let job = RenderJob::new(world, recentering, lens, request.size, centres)?;
        let job = RenderJob { display: settings.display, ..job };
        Ok(Arc::new(Prepared { job, camera, decisions, kind }))
    }

    fn animation(&mut self, opened: &Arc<Opened>, settings: &Settings) -> Result<Arc<PreparedAnimation>> {
        let key = key_of(settings);
        if let Some(at) = self.animations.iter().position(|(known, _)| *known == key) {
            let found = self.animations.remove(at);
            self.animations.push(found);
        } else {
            self.animations.drain(..self.animations.len().saturating_sub(MAX_WORLDS - 1));
            let scene = opened.scene.clone();
            let camera = scene.cameras.first().cloned().unwrap_or_else(|| placeholder_camera(&scene));
            let (pipeline, structure) = (settings.pipeline, Layout::Wide(opened.preset));
            let animation =
                PreparedAnimation::new(scene, &camera, None, pipeline, structure, settings.numerics)?;
            self.animations.push((key, Arc::new(animation)));
        }
        Ok(Arc::clone(&self.animations[self.animations.len() - 1].1))
    }

    fn frame(
        &mut self,
        animation: &PreparedAnimation,
        settings: &Settings,
        time: f64,
    ) -> Result<Arc<FrameWorld>> {
        let key = key_of(settings);
        let is_it = |(known, at, _): &(Key, f64, Arc<FrameWorld>)| (*known, *at) == (key, time);
        if let Some((_, _, frame)) = self.frames.iter().find(|frame| is_it(frame)) {
            return Ok(Arc::clone(frame));
        }
        self.frames.retain(|(known, ..)| *known != key);
        self.frames.drain(..self.frames.len().saturating_sub(MAX_WORLDS - 1));
        let frame = Arc::new(animation.at(time)?);
        self.frames.push((key, time, Arc::clone(&frame)));
        Ok(frame)
    }

    /// A camera fitted to the unanimated scene, in world coordinates: the same that `kiln render` uses.
    fn fit(
        &mut self,
        request: &RenderRequest,
        view: StandardView,
        recentering: Option<Recentering>,
    ) -> Result<Camera> {
        let aspect = f64::from(request.size[0]) / f64::from(request.size[1]);
        if let Some((.., camera)) =
            self.fitted_cameras.iter().find(|(known, at, _)| (*known, *at) == (view, aspect))
        {
            return Ok(camera.clone());
        }
        if let (None, Some(recentering)) = (&self.recentered_scene, recentering) {
            let mut scene = request.opened.scene.clone();
            recentering.apply(&mut scene);
            self.recentered_scene = Some(Arc::new(scene));
        }
        let scene = self.recentered_scene.as_deref().unwrap_or(&request.opened.scene);
        let projection = request.projection.unwrap_or_default();
        let camera = fitted_camera(scene, view, aspect, projection).ok_or_else(|| Error::Failed {
            what: "there is nothing to look at".into(),
            hint: "`kiln info` says what the file holds".into(),
        })?;
        self.fitted_cameras.retain(|(known, ..)| *known != view);
        self.fitted_cameras.push((view, aspect, camera.clone()));
        Ok(camera)
    }
}

fn key_of(settings: &Settings) -> Key {
    (settings.numerics, settings.pipeline)
}

/// A valid camera for [`PreparedAnimation::new`] if the scene has none. It is never rendered.
fn placeholder_camera(scene: &Scene) -> Camera {
    let (target, up) = (scene.bounds().map_or(glam::DVec3::ZERO, |(min, _)| min), glam::DVec3::Y);
    let back = target + glam::DVec3::Z * target.abs().max_element().max(1.0);
    Camera::from_field_of_view("none".into(), back, target, up, 1.0)
}
