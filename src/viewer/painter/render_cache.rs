//! Cache of the painter between requests: prepared worlds, fitted cameras, and render times per pixel.

use std::sync::Arc;

use crate::animation::{FrameWorld, PreparedAnimation};
use crate::bvh::Layout;
use crate::effects::{Choices, Decision, EFFECTS, Plan};
use crate::error::Warnings;
use crate::error::{Error, Result};
use crate::film::tone::Exposure;
use crate::job::{self, AddedLight, CameraChoice, RenderJob, RenderSettings};
use crate::scene::{Camera, Ground, PictureSettings, Sampling, Scene, ShadingMode};
use crate::viewer::false_colour::DisplayMode;
use crate::viewer::refine::SamplingKind;
use crate::viewer::request::{CameraSource, Opened, RenderRequest};
use crate::world::{Framing, Recentering, StandardView, fitted_camera};

/// Number of cached worlds: two sides of a comparison and the exact reference.
const MAX_WORLDS: usize = 3;

/// What a world depends on besides the scene.
#[derive(Clone, PartialEq)]
struct Key {
    /// The settings, with defaults for what no world depends on.
    settings: RenderSettings,
    /// Whether the camera is below the ground of the default look, which is then left out.
    is_below_ground: bool,
}

/// A completed scene as an animation.
#[derive(Clone)]
struct CachedScene {
    animation: Arc<PreparedAnimation>,
    /// The light that follows the camera.
    light: Option<AddedLight>,
    /// Settings of the scene and of the default look.
    picture: PictureSettings,
    /// The ground, in world coordinates.
    ground: Option<Ground>,
}

/// A scene that is prepared for a request.
pub(crate) struct Prepared {
    /// Render job with one sample per pixel, at its centre.
    pub job: RenderJob,
    /// The camera, in scene coordinates.
    pub camera: Camera,
    /// Decision about each effect with the request's sampling, and whether the scene or the sampling uses the effect;
    /// those that are used come first.
    pub decisions: Vec<(Decision, bool)>,
    /// How the final image is sampled.
    pub kind: SamplingKind,
    /// Effects and sampling of the final image.
    pub choices: Choices,
    /// Whether `kiln render` meters the exposure; the window shows an automatic one.
    pub meters: bool,
}

/// Cached data of the opened files.
#[derive(Default)]
pub(crate) struct RenderCache {
    opened: Option<Arc<Opened>>,
    scenes: Vec<(Key, CachedScene)>,
    frames: Vec<(Key, f64, Arc<FrameWorld>)>,
    /// The recentered scene, if the worlds are recentered.
    recentered_scene: Option<Arc<Scene>>,
    /// Fitted cameras, each with its framing and aspect ratio.
    fitted_cameras: Vec<(Framing, f64, Camera)>,
    /// Render time in seconds per pixel at one sample, by display mode.
    seconds: Vec<(DisplayMode, f64)>,
}

impl RenderCache {
    /// Whether the trees of all sides of a request are cached.
    pub(crate) fn has_worlds(&self, request: &RenderRequest) -> bool {
        let same = self.opened.as_ref().is_some_and(|opened| Arc::ptr_eq(opened, &request.opened));
        let has = |side: &RenderSettings| {
            let settings = key_settings(&request.render_settings(side), &request.opened.scene);
            self.scenes.iter().any(|(key, _)| key.settings == settings)
        };
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
    pub(crate) fn prepare(
        &mut self,
        request: &RenderRequest,
        side: &RenderSettings,
    ) -> Result<Arc<Prepared>> {
        if !self.opened.as_ref().is_some_and(|opened| Arc::ptr_eq(opened, &request.opened)) {
            *self = RenderCache { opened: Some(Arc::clone(&request.opened)), ..RenderCache::default() };
        }
        let settings = request.render_settings(side);
        let mut key =
            Key { settings: key_settings(&settings, &request.opened.scene), is_below_ground: false };
        let mut cached = self.scene(&request.opened, &key)?;
        let mut frame = self.frame(&cached.animation, &key, request.time)?;
        let recentering = frame.recentering;
        let mut lens = match &request.camera_source {
            CameraSource::Scene(index) => frame.cameras.get(*index).unwrap_or(&frame.camera).clone(),
            CameraSource::Fitted(view) => {
                let framing = settings.framing(*view, &request.opened.scene);
                self.fit(request, framing, cached.animation.range())?
            }
            CameraSource::Free(camera) => {
                recentering.map_or_else(|| camera.clone(), |recentering| recentering.moved(camera))
            }
        };
        lens.projection = request.projection.unwrap_or(lens.projection);
        if cached.ground.is_some_and(|ground| ground.is_hidden_from(&lens)) {
            key.is_below_ground = true;
            cached = self.scene(&request.opened, &key)?;
            frame = self.frame(&cached.animation, &key, request.time)?;
        }
        let mut world = Arc::clone(&frame.world);
        if let Some(light) = cached.light {
            world = Arc::new(world.under(light.at(&lens).into_iter().collect()));
        }
        let scene = &request.opened.scene;
        let mut picture = settings.picture.or(scene.picture).or_look(cached.picture);
        let camera = match &request.camera_source {
            CameraSource::Free(camera) => Camera { projection: lens.projection, ..camera.clone() },
            _ => recentering.map_or_else(|| lens.clone(), |recentering| recentering.moved_back(&lens)),
        };
        let chosen = settings.picture.exposure.or(scene.picture.exposure);
        let meters = job::leave_to_metering(&mut picture, chosen, scene, &settings, &camera);
        if meters {
            picture.exposure = Some(Exposure::Auto);
        }
        let choices = job::choices(&mut picture, scene.effects.clone(), &lens, &settings)?;
        let sampling = choices.sampling;
        let centres = Choices { sampling: Sampling::default(), ..choices.clone() };
        let job = RenderJob::new(world, recentering, lens, request.size, centres)?;
        let choices = Choices { lens: job.choices.lens.clone(), ..choices };
        let whole = Plan::new(&job.world, &choices)?;
        let kind = match (whole.takes_samples(), whole.is_adaptive()) {
            (false, _) => SamplingKind::Centres,
            (true, false) => SamplingKind::Samples(sampling.max_samples()),
            (true, true) => SamplingKind::Adaptive,
        };
        let decisions = EFFECTS.iter().zip(whole.decisions);
        let mut decisions: Vec<(Decision, bool)> = decisions
            .map(|(effect, decision)| (decision, (effect.called_for)(&job.world, &choices).is_ok()))
            .collect();
        decisions.sort_by_key(|(_, can)| !can);
        let job = RenderJob { settings: RenderSettings { picture, ..settings }, ..job };
        Ok(Arc::new(Prepared { job, camera, decisions, kind, choices, meters }))
    }

    /// The scene of a key, completed as for `kiln render`.
    fn scene(&mut self, opened: &Arc<Opened>, key: &Key) -> Result<CachedScene> {
        if let Some(at) = self.scenes.iter().position(|(known, _)| known == key) {
            let found = self.scenes.remove(at);
            self.scenes.push(found);
        } else {
            self.scenes.drain(..self.scenes.len().saturating_sub(MAX_WORLDS - 1));
            let mut scene = opened.scene.clone();
            key.settings.complete(&mut scene, &mut Warnings::default())?;
            let picture = scene.picture;
            let light = job::added_light(&scene);
            if key.is_below_ground {
                scene.ground = None;
            }
            let mut ground = scene.ground;
            let camera = scene.cameras.first().cloned().unwrap_or_else(|| placeholder_camera(&scene));
            let (pipeline, numerics) = (picture.pipeline(), picture.numerics.unwrap_or_default());
            let structure = Layout::Wide(key.settings.preset);
            let animation = PreparedAnimation::new(scene, &camera, None, pipeline, structure, numerics)?;
            if let (Some(ground), Some(recentering)) = (&mut ground, animation.range()) {
                recentering.move_ground(ground);
            }
            let animation = Arc::new(animation);
            self.scenes.push((key.clone(), CachedScene { animation, light, picture, ground }));
        }
        Ok(self.scenes[self.scenes.len() - 1].1.clone())
    }

    fn frame(&mut self, animation: &PreparedAnimation, key: &Key, time: f64) -> Result<Arc<FrameWorld>> {
        let is_it = |(known, at, _): &(Key, f64, Arc<FrameWorld>)| (known, *at) == (key, time);
        if let Some((_, _, frame)) = self.frames.iter().find(|frame| is_it(frame)) {
            return Ok(Arc::clone(frame));
        }
        self.frames.retain(|(known, ..)| known != key);
        self.frames.drain(..self.frames.len().saturating_sub(MAX_WORLDS - 1));
        let frame = Arc::new(animation.at(time)?);
        self.frames.push((key.clone(), time, Arc::clone(&frame)));
        Ok(frame)
    }

    /// A camera fitted to the unanimated scene, in world coordinates: the same that `kiln render` uses.
    fn fit(
        &mut self,
        request: &RenderRequest,
        framing: Framing,
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
        let camera = fitted_camera(scene, framing, aspect, projection).ok_or_else(|| Error::Failed {
            what: "there is nothing to look at".into(),
            hint: "`kiln info` says what the file holds".into(),
        })?;
        self.fitted_cameras.retain(|(known, ..)| *known != framing);
        self.fitted_cameras.push((framing, aspect, camera.clone()));
        Ok(camera)
    }
}

/// The settings without those that no world depends on: of the camera, it depends on whether it is the files'; of the
/// shading, on whether it has lights.
fn key_settings(settings: &RenderSettings, scene: &Scene) -> RenderSettings {
    let camera = match settings.camera.is_of_file(scene) {
        true => CameraChoice::Named(String::new()),
        false => CameraChoice::Fitted(StandardView::Auto),
    };
    let lit =
        |shading: ShadingMode| if shading.uses_lights() { ShadingMode::Full } else { ShadingMode::Flat };
    RenderSettings {
        camera,
        projection: None,
        longest_side: None,
        with: Vec::new(),
        without: Vec::new(),
        picture: PictureSettings {
            width: None,
            height: None,
            azimuth: None,
            elevation: None,
            zoom: None,
            fov: None,
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
        ..settings.clone()
    }
}

/// A valid camera for [`PreparedAnimation::new`] if the scene has none. It is never rendered.
fn placeholder_camera(scene: &Scene) -> Camera {
    let (target, up) = (scene.bounds().map_or(glam::DVec3::ZERO, |(min, _)| min), glam::DVec3::Y);
    let back = target + glam::DVec3::Z * target.abs().max_element().max(1.0);
    Camera::from_field_of_view("none".into(), back, target, up, 1.0)
}
