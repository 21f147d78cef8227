//! Cache of the painter between requests: prepared worlds, fitted cameras, and render times per pixel.

use std::sync::Arc;

use crate::animation::{FrameWorld, PreparedAnimation};
use crate::bvh::Layout;
use crate::effects::{Choices, Decision, EFFECTS, Plan};
use crate::error::Warnings;
use crate::error::{Error, Result};
use crate::film::tone::Exposure;
use crate::job::{self, CameraChoice, EnvironmentSettings, RenderJob, RenderSettings};
use crate::scene::{Camera, DefaultLook, Environment, PictureSettings, Sampling, Scene, ShadingMode};
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
    environments: Vec<(EnvironmentSettings, Option<Environment>)>,
    /// The looks of the last settings.
    looks: Vec<(RenderSettings, DefaultLook)>,
    scenes: Vec<(Key, Arc<PreparedAnimation>)>,
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
    pub(crate) fn has_worlds(&mut self, request: &RenderRequest) -> bool {
        if !self.opened.as_ref().is_some_and(|opened| Arc::ptr_eq(opened, &request.opened)) {
            return false;
        }
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
        let scene = &request.opened.scene;
        let mut look = self.look(scene, &settings)?;
        let mut key = Key::new(&settings, &look, scene);
        let mut animation = self.scene(scene, &look, &key)?;
        let mut frame = self.frame(&animation, &key, request.time)?;
        let recentering = frame.recentering;
        let mut lens = match &request.camera_source {
            CameraSource::Scene(index) => frame.cameras.get(*index).unwrap_or(&frame.camera).clone(),
            CameraSource::Fitted(view) => {
                let framing = settings.framing(*view, &request.opened.scene);
                self.fit(request, framing, animation.recentering())?
            }
            CameraSource::Free(camera) => {
                recentering.map_or_else(|| camera.clone(), |recentering| recentering.moved(camera))
            }
        };
        lens.projection = request.projection.unwrap_or(lens.projection);
        if look.recentered(animation.recentering().as_ref()).hide_ground(&lens) {
            (look.ground, look.picture.ground) = (None, Some(false));
            key = Key::new(&settings, &look, scene);
            animation = self.scene(scene, &look, &key)?;
            frame = self.frame(&animation, &key, request.time)?;
        }
        let mut world = Arc::clone(&frame.world);
        if let Some(light) = look.light {
            world = Arc::new(world.under(light.at(&lens).into_iter().collect(), &[]));
        }
        let camera = match &request.camera_source {
            CameraSource::Free(camera) => Camera { projection: lens.projection, ..camera.clone() },
            _ => recentering.map_or_else(|| lens.clone(), |recentering| recentering.moved_back(&lens)),
        };
        let meters = job::leave_to_metering(&mut look, scene, &settings, &camera);
        let mut picture = look.picture;
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

    /// The look of a scene: that of `kiln render`.
    fn look(&mut self, scene: &Scene, settings: &RenderSettings) -> Result<DefaultLook> {
        let settings = settings_of_look(settings, scene);
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

    /// The scene of a key as an animation, with its look but for the light that follows the camera.
    fn scene(&mut self, scene: &Scene, look: &DefaultLook, key: &Key) -> Result<Arc<PreparedAnimation>> {
        if let Some(at) = self.scenes.iter().position(|(known, _)| known == key) {
            let found = self.scenes.remove(at);
            self.scenes.push(found);
        } else {
            self.scenes.drain(..self.scenes.len().saturating_sub(MAX_WORLDS - 1));
            let camera = scene.cameras.first().cloned().unwrap_or_else(|| placeholder_camera(scene));
            let (pipeline, numerics) = (look.picture.pipeline(), look.picture.numerics.unwrap_or_default());
            let (look, structure) =
                (DefaultLook { light: None, ..look.clone() }, Layout::Wide(key.settings.preset));
            let animation =
                PreparedAnimation::new(scene.clone(), look, &camera, pipeline, structure, numerics)?;
            self.scenes.push((key.clone(), Arc::new(animation)));
        }
        Ok(Arc::clone(&self.scenes[self.scenes.len() - 1].1))
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

/// The settings without those that no look depends on. Of the camera, it depends on whether it is the files'.
fn settings_of_look(settings: &RenderSettings, scene: &Scene) -> RenderSettings {
    let camera = match settings.camera.is_of_file(scene) {
        true => CameraChoice::Named(String::new()),
        false => CameraChoice::Fitted(StandardView::Auto),
    };
    let picture = PictureSettings {
        width: None,
        height: None,
        azimuth: None,
        elevation: None,
        zoom: None,
        fov: None,
        ..settings.picture
    };
    RenderSettings { camera, projection: None, longest_side: None, picture, ..settings.clone() }
}

/// The settings without those that no world depends on. Of the shading, it depends on whether it has lights.
fn key_settings(settings: &RenderSettings, scene: &Scene) -> RenderSettings {
    let settings = settings_of_look(settings, scene);
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

/// A valid camera for [`PreparedAnimation::new`] if the scene has none. It is never rendered.
fn placeholder_camera(scene: &Scene) -> Camera {
    let (target, up) = (scene.bounds().map_or(glam::DVec3::ZERO, |(min, _)| min), glam::DVec3::Y);
    let back = target + glam::DVec3::Z * target.abs().max_element().max(1.0);
    Camera::from_field_of_view("none".into(), back, target, up, 1.0)
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use super::*;
    use crate::import;
    use crate::render::RenderControl;
    use crate::scene::{ImportOptions, Look, OptionValue, Rotation};
    use crate::viewer::controls::Controls;

    const SIZE: [u32; 2] = [20, 16];

    /// Scene files, and meshes of each format.
    fn files() -> Vec<PathBuf> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let folders = ["scenes", "scenes/effects", "scenes/hard"].map(|folder| root.join(folder));
        let files = folders.iter().flat_map(|folder| std::fs::read_dir(folder).expect("a folder"));
        let files = files.map(|entry| entry.expect("a file").path());
        let mut files: Vec<PathBuf> =
            files.filter(|file| file.extension().is_some_and(|ending| ending == "toml")).collect();
        assert!(files.len() > 30, "{}", files.len());
        let meshes = ["l.obj", "materials.obj", "square.gltf", "square.ply", "tetrahedron.stl"];
        files.extend(meshes.map(|file| root.join("assets/import").join(file)));
        files
    }

    /// The window has the picture of `kiln render`, bit by bit: the same look, camera, exposure, clamp and sampling.
    #[test]
    fn the_window_has_the_picture_of_the_command() {
        let variants: [fn(&mut RenderSettings); 6] = [
            |_| (),
            |settings| settings.picture.look = Some(Look::Draft),
            |settings| settings.picture.exposure = Some(Exposure::Ev(1.0)),
            |settings| settings.picture.ground = Some(true),
            |settings| settings.picture.elevation = Rotation::parse("-30").ok(),
            |settings| settings.without = vec!["path".into()],
        ];
        for file in files() {
            let options = ImportOptions { smooths_meshes: true, ..ImportOptions::default() };
            let scene = import::load_with(std::slice::from_ref(&file), &options, &mut Warnings::default())
                .expect("a scene");
            let camera_source = match scene.default_camera() {
                Some(_) => CameraSource::Scene(0),
                None => CameraSource::Fitted(StandardView::Auto),
            };
            let of_scene = RenderSettings { mesh_look: Look::Studio, ..RenderSettings::default() };
            let opened = Arc::new(Opened {
                scene: scene.clone(),
                camera_source,
                projection: None,
                size: SIZE,
                settings: of_scene.clone(),
            });
            let mut cache = RenderCache::default();
            for (index, change) in variants.iter().enumerate() {
                let mut settings = of_scene.clone();
                change(&mut settings);
                let whole = PictureSettings::of_size(SIZE).or(settings.picture);
                let command = RenderSettings { picture: whole, ..settings.clone() };
                let Ok(expected) = job::prepare(scene.clone(), &command, &mut Warnings::default()) else {
                    continue;
                };
                let mut controls = Controls::new(&opened);
                controls.sides = vec![settings];
                let request = controls.request(&opened, SIZE);
                let prepared = cache.prepare(&request, &request.sides[0]).expect("a job");
                let mut shown = prepared.job.with_choices(prepared.choices.clone()).expect("a job");
                if prepared.meters {
                    shown.meter(&RenderControl::default()).expect("an exposure");
                }
                let picture = |job: &RenderJob| {
                    let (film, _) = job.render::<[u8; 3]>(&RenderControl::default()).expect("a picture");
                    film.rows().collect::<Vec<_>>()
                };
                assert!(picture(&shown) == picture(&expected), "{}, variant {index}", file.display());
            }
        }
    }
}
