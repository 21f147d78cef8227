//! Pictures of a scene: the one way from a scene and settings to a job.

pub(crate) mod memory;
pub(crate) mod prepared;
pub(crate) mod resolved;

use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, Weak};

use glam::DVec3;

use super::camera::{Mount, Viewpoint, nothing_to_look_at};
use super::metadata::{self, Metadata};
use super::{
    CameraChoice, EnvironmentSettings, PreparedScene, RenderControl, RenderJob, RenderSettings,
    ResolvedPicture, SceneAtTime, check_memory,
};
use crate::effects::{PlanSettings, check_names, check_scene};
use crate::error::{Error, Result, Warnings};
use crate::film::tone::Exposure;
use crate::import::check_drawable;
use crate::job::look::default_look::default_look;
use crate::job::messages::findings::Source;
use crate::job::messages::{notes, outside};
use crate::job::session::resolved::resolve_picture;
use crate::scene::animation::Moment;
use crate::scene::{Animation, Camera, DefaultLook, Environment, PictureSettings, Projection, Scene};
use crate::world::{
    Framing, Recentering, StandardView, View, WorldInputs, fitted_camera, opening, turntable_camera,
};

/// The number of looks, cameras and worlds that are kept: those of cameras above and below an added ground, with and
/// without the look of a scene's own cameras.
const KEPT: usize = 4;

/// A scene for pictures of any settings, cameras and moments.
///
/// [`Session::resolve`] settles what a picture is, [`Session::picture`] builds what it needs at a moment, and
/// [`Session::job`] meters its exposure. What pictures share is kept: the last [`KEPT`] looks, fitted cameras, exposures and
/// worlds, each with its acceleration structure; the worlds of moments at which surfaces move live as long as their
/// pictures. Threads may share a session. Only rendering can be cancelled: metering is, building is not.
pub struct Session {
    scene: Arc<Scene>,
    /// Whether the animation of the scene plays.
    plays: bool,
    /// Whether the scene was moved into the one world that is left.
    is_consumed: bool,
    /// The moment of pictures in which nothing moves.
    still: Moment,
    /// The recentered scene, if it is recentered.
    recentered: OnceLock<Option<(Recentering, Scene)>>,
    /// The bounds of the recentered scene.
    bounds: OnceLock<Option<(DVec3, DVec3)>>,
    environments: Cache<EnvironmentSettings, (Option<Environment>, Warnings)>,
    /// Looks in coordinates of the scene, by the settings that they depend on.
    looks: Cache<RenderSettings, (DefaultLook, Warnings)>,
    /// Cameras in coordinates of the recentered scene.
    fitted: Cache<Fit, Camera>,
    /// Exposures by all settings, and whether the camera orbits: these decide the picture of the first moment.
    exposures: Cache<(RenderSettings, bool), Arc<OnceLock<Exposed>>>,
    worlds: Cache<WorldInputs, Arc<PreparedScene>>,
    moments: Cache<(WorldInputs, Moment), Weak<SceneAtTime>>,
}

/// The last values, by their keys.
struct Cache<K, V>(Mutex<Vec<(K, V)>>);

impl<K, V> Default for Cache<K, V> {
    fn default() -> Self {
        Cache(Mutex::default())
    }
}

impl<K: PartialEq + Clone, V: Clone> Cache<K, V> {
    fn lock(&self) -> MutexGuard<'_, Vec<(K, V)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn get(&self, key: &K) -> Option<V> {
        let mut entries = self.lock();
        let at = entries.iter().position(|(known, _)| known == key)?;
        entries[at..].rotate_left(1);
        entries.last().map(|(_, value)| value.clone())
    }

    /// Adds a value, without the least recently used one if the cache is full.
    fn insert(&self, key: K, value: V) {
        let mut entries = self.lock();
        entries.retain(|(known, _)| *known != key);
        let surplus = (entries.len() + 1).saturating_sub(KEPT);
        entries.drain(..surplus);
        entries.push((key, value));
    }

    /// The value of a key. It is made while the cache is not locked, as a thread of rayon that waits for parts of it may take
    /// up work of another picture. So two threads may make the same value at once.
    fn get_or_insert(&self, key: &K, make: impl FnOnce() -> Result<V>) -> Result<V> {
        if let Some(known) = self.get(key) {
            return Ok(known);
        }
        let made = make()?;
        self.insert(key.clone(), made.clone());
        Ok(made)
    }
}

/// What a fitted camera depends on.
#[derive(Clone, PartialEq)]
struct Fit {
    look_at: Option<String>,
    framing: Framing,
    aspect: f64,
    projection: Projection,
}

/// An exposure that was metered, and the settings with it.
pub(crate) struct Exposed {
    ev: f64,
    picture: PictureSettings,
    clamp: Option<f64>,
}

impl Exposed {
    fn new(job: &RenderJob, meters: bool, control: &RenderControl) -> Result<Self> {
        let mut job = job.with_plan_settings(job.plan_settings.clone())?;
        let ev = match meters {
            true => job.meter(control)?,
            false => job.display_transform(control)?.ev(),
        };
        job.settings.picture.exposure = Some(Exposure::Ev(ev));
        Ok(Exposed { ev, picture: job.settings.picture, clamp: job.plan_settings.clamp })
    }
}

/// A picture at a moment, ready but for its exposure.
pub struct Picture {
    /// The job before its exposure is metered.
    pub job: RenderJob,
    /// What it is a picture of.
    pub resolved: Arc<ResolvedPicture>,
    /// What it shares with other pictures.
    scene: Arc<SceneAtTime>,
    /// Whether it is of a later moment than the first, whose exposure it has.
    is_later: bool,
}

impl Picture {
    /// Whether [`Session::job`] meters an exposure.
    pub fn is_metered(&self) -> bool {
        self.resolved.meters || self.job.display().is_auto()
    }

    /// Whether an exposure is metered already.
    pub fn is_exposed(&self) -> bool {
        self.resolved.exposure.get().is_some()
    }

    /// The camera in coordinates of the scene.
    pub fn camera(&self) -> Camera {
        let Camera { projection, .. } = self.job.camera;
        match (&self.resolved.mount, self.scene.recentering) {
            (Mount::Given(camera), _) => Camera { projection, ..camera.clone() },
            (_, Some(recentering)) => recentering.moved_back(&self.job.camera),
            (_, None) => self.job.camera.clone(),
        }
    }
}

impl Session {
    /// A session of a scene as it is posed: no animation plays.
    ///
    /// # Errors
    /// [`Error::Input`] for a scene that cannot be rendered.
    pub fn still(scene: impl Into<Arc<Scene>>) -> Result<Self> {
        Session::new(scene.into(), false)
    }

    /// A session of a scene whose animation plays, if it has one.
    ///
    /// # Errors
    /// As [`Session::still`].
    pub fn playing(scene: impl Into<Arc<Scene>>) -> Result<Self> {
        let scene = scene.into();
        let plays = scene.animation.is_some();
        Session::new(scene, plays)
    }

    fn new(scene: Arc<Scene>, plays: bool) -> Result<Self> {
        check_scene(&scene.effects)?;
        check_drawable(&scene)?;
        Ok(Session {
            still: Moment::of_still(&scene),
            scene,
            plays,
            is_consumed: false,
            recentered: OnceLock::new(),
            bounds: OnceLock::new(),
            environments: Cache::default(),
            looks: Cache::default(),
            fitted: Cache::default(),
            exposures: Cache::default(),
            worlds: Cache::default(),
            moments: Cache::default(),
        })
    }

    /// The scene in its own coordinates.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// What a picture with these settings is: its camera, look, plan settings and metadata, with warnings and notes about
    /// them. Nothing is built.
    ///
    /// # Errors
    /// [`Error::Usage`] for invalid settings, [`Error::Input`] for a scene that cannot be rendered with them.
    pub fn resolve(
        &self,
        settings: &RenderSettings,
        warnings: &mut Warnings,
    ) -> Result<Arc<ResolvedPicture>> {
        let mut resolved = self.resolve_only(settings, false)?;
        self.warn_of_resolved(&resolved, settings, warnings)?;
        resolved.metadata = self.metadata(&resolved, settings);
        Ok(resolved.into())
    }

    /// As [`Session::resolve`], of a camera that orbits once about what it looks at, or about the scene if it is fitted to that,
    /// with so many frames per second and seconds.
    ///
    /// # Errors
    /// As [`Session::resolve`].
    pub fn resolve_turntable(
        &self,
        settings: &RenderSettings,
        timing: [f64; 2],
        warnings: &mut Warnings,
    ) -> Result<Arc<ResolvedPicture>> {
        let mut resolved = self.resolve_only(settings, true)?;
        self.warn_of_resolved(&resolved, settings, warnings)?;
        resolved.metadata = self.metadata(&resolved, settings);
        metadata::add_to_fingerprint(&mut resolved.metadata, "turntable", &timing);
        Ok(resolved.into())
    }

    /// As [`Session::resolve`], without the warnings ([`Session::warn_of_resolved`]) and without metadata
    /// ([`Session::metadata`]), which take time in proportion to the scene.
    ///
    /// # Errors
    /// As [`Session::resolve`].
    pub fn resolve_only(&self, settings: &RenderSettings, orbits: bool) -> Result<ResolvedPicture> {
        check_names(&settings.with, &settings.without)?;
        let (own_look, _) = self.look(settings)?;
        let viewpoint = Viewpoint::of(&settings.camera, &self.scene)?;
        let size = viewpoint.size(settings, &self.scene);
        let mount = match orbits {
            true => self.orbit(&viewpoint, settings, size)?,
            false => match &viewpoint {
                Viewpoint::OfScene(index) => Mount::OfScene(*index),
                Viewpoint::Given(camera) => Mount::Given(camera.clone()),
                Viewpoint::Fitted(view) => Mount::Fitted(self.fit(*view, settings, size)?),
            },
        };
        let (scene, recentering) = self.recentered();
        let mut look = own_look.recentered(recentering);
        let camera = mount.at_rest(scene, recentering);
        let bounds = || *self.bounds.get_or_init(|| scene.bounds());
        let mut resolved = resolve_picture((scene, &bounds), &mut look, camera, size, settings)?;
        let ground = own_look.ground.filter(|_| look.ground.is_some());
        resolved.look = DefaultLook { ground, picture: look.picture, ..own_look };
        (resolved.mount, resolved.recentering) = (mount, recentering.copied());
        let key = (resolved.settings.clone(), orbits);
        resolved.exposure = self.exposures.get_or_insert(&key, || Ok(Arc::default()))?;
        let is_fitted = matches!(viewpoint, Viewpoint::Fitted(_));
        resolved.source = Arc::new(Source {
            inputs: self.scene.inputs.clone(),
            has_physical_lights: self.scene.has_physical_lights,
            look_at: settings.look_at.clone().filter(|_| is_fitted),
        });
        Ok(resolved)
    }

    /// Warnings and notes about the settings, the look and the camera of a picture.
    ///
    /// # Errors
    /// As [`Session::resolve`].
    pub fn warn_of_resolved(
        &self,
        resolved: &ResolvedPicture,
        settings: &RenderSettings,
        warnings: &mut Warnings,
    ) -> Result<()> {
        warnings.extend(&self.look(settings)?.1);
        self.warn_of_camera(resolved, settings, warnings)
    }

    /// [`Session::warn_of_resolved`] without what is about the look ([`Session::look`]).
    ///
    /// # Errors
    /// As [`Session::resolve`].
    pub fn warn_of_camera(
        &self,
        resolved: &ResolvedPicture,
        settings: &RenderSettings,
        warnings: &mut Warnings,
    ) -> Result<()> {
        let (scene, recentering) = self.recentered();
        notes::warn_of_recentering(recentering, warnings);
        let viewpoint = Viewpoint::of(&settings.camera, &self.scene)?;
        viewpoint.report(settings, scene, warnings);
        let ResolvedPicture { camera, mount, look, .. } = resolved;
        let shows_all = camera.projection.shows_all_directions();
        if matches!(viewpoint, Viewpoint::Fitted(StandardView::Auto))
            && matches!(mount, Mount::Fitted(_))
            && !shows_all
        {
            let has_default_view =
                settings.camera == CameraChoice::Default && settings.picture.azimuth.is_none();
            match opening(&*settings.looked_at(scene)?) {
                Some(opening) if !opening.is_flat => {
                    warnings.note("the surface is open to one side; the camera looks in from there");
                }
                None if has_default_view && !scene.has_settings => {
                    warnings.note_usual("the camera looks from +z; --azimuth 180 shows the back");
                }
                _ => {}
            }
        }
        let is_of_mesh_file = !scene.has_settings && matches!(viewpoint, Viewpoint::OfScene(_));
        let is_from_side = matches!(viewpoint, Viewpoint::Fitted(view) if view != StandardView::Auto);
        // Files place their objects for their cameras; a scene file is written by hand. A view from a side may see an edge.
        if settings.look_at.is_none() && (scene.has_settings || is_of_mesh_file || is_from_side) {
            let view = View::new(camera, camera.projection, resolved.size())?;
            if scene.has_settings {
                outside::warn(scene, &view, recentering, warnings);
            }
            if !shows_all {
                outside::note_framing(scene, camera, &view, is_of_mesh_file, warnings);
            }
        }
        if let Some(light) = look.light {
            light.note(warnings);
        }
        Ok(())
    }

    /// The metadata of a picture with these settings: of the scene, the light that is added to it, its look, and the settings.
    pub(crate) fn metadata(&self, resolved: &ResolvedPicture, settings: &RenderSettings) -> Metadata {
        let (scene, recentering) = self.recentered();
        let look = resolved.look.recentered(recentering);
        let added = look.light.filter(|_| scene.lights.is_empty());
        let added = added.and_then(|light| light.at(&resolved.camera));
        let ResolvedPicture { camera, window, meters, .. } = resolved;
        let of_scene = (scene, added.as_ref(), &look);
        let mut metadata = metadata::metadata(of_scene, recentering, camera, *window, settings);
        if *meters {
            metadata::add_to_fingerprint(&mut metadata, "metered", &true);
        }
        metadata
    }

    /// Whether the acceleration structure of a picture is built, but for moments at which surfaces move.
    pub fn has_world(&self, resolved: &ResolvedPicture) -> bool {
        self.worlds.get(&resolved.world_inputs()).is_some()
    }

    /// The picture at a moment. Its world is built, unless it is kept.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is not enough memory, [`Error::Input`] where a track takes a property out of its range, and
    /// those of [`RenderJob::new`].
    pub fn picture(&self, resolved: &Arc<ResolvedPicture>, moment: Moment) -> Result<Picture> {
        let key = (resolved.world_inputs(), moment);
        let scene = match self.moments.get(&key).and_then(|scene| scene.upgrade()) {
            Some(scene) => scene,
            None => {
                let scene = Arc::new(self.prepared(resolved, &key.0)?.at(moment)?);
                self.moments.insert(key, Arc::downgrade(&scene));
                scene
            }
        };
        let camera = resolved.camera_at(&scene, moment)?;
        let job = scene.job_for(ResolvedPicture { camera, ..ResolvedPicture::clone(resolved) })?;
        let is_later = moment != self.first_moment(resolved);
        Ok(Picture { job, resolved: Arc::clone(resolved), scene, is_later })
    }

    /// The picture at the first moment.
    ///
    /// # Errors
    /// As [`Session::picture`].
    pub fn first_picture(&self, resolved: &Arc<ResolvedPicture>) -> Result<Picture> {
        self.picture(resolved, self.first_moment(resolved))
    }

    fn first_moment(&self, resolved: &ResolvedPicture) -> Moment {
        if self.moves(resolved) { Moment::default() } else { self.still }
    }

    /// Whether pictures of other moments may differ.
    fn moves(&self, resolved: &ResolvedPicture) -> bool {
        self.plays || matches!(resolved.mount, Mount::Orbit(_))
    }

    /// Builds the world of a picture from the scene, which is not kept beside it: the session has pictures of this world alone
    /// from now on.
    ///
    /// # Errors
    /// As [`Session::picture`].
    pub fn consume(&mut self, resolved: &ResolvedPicture) -> Result<()> {
        let inputs = resolved.world_inputs();
        check_memory(&self.scene, &resolved.plan_settings, inputs.numerics)?;
        (self.is_consumed, self.recentered) = (true, OnceLock::new());
        let scene = Arc::unwrap_or_clone(std::mem::take(&mut self.scene));
        let prepared = PreparedScene::new(scene, &inputs, self.plays)?;
        self.worlds.insert(inputs, prepared.into());
        Ok(())
    }

    /// The job of a picture with its exposure, which is metered if that is asked for or the look says so; those of later
    /// moments have that of the first. An exposure `auto` matters to display values alone: without `is_displayed`, it is left
    /// to [`RenderJob::display_transform`].
    ///
    /// # Errors
    /// As [`RenderJob::render`].
    pub fn job(&self, picture: &Picture, is_displayed: bool, control: &RenderControl) -> Result<RenderJob> {
        let Picture { job, resolved, is_later, .. } = picture;
        let plan_settings = job.plan_settings.clone();
        if !(resolved.meters || is_displayed && job.display().is_auto()) {
            return job.with_plan_settings(plan_settings);
        }
        let Exposed { ev, picture, clamp } = match resolved.exposure.get() {
            Some(known) => known,
            None => {
                let first = is_later.then(|| self.first_picture(resolved)).transpose()?;
                let first = first.as_ref().map_or(job, |first| &first.job);
                let exposed = Exposed::new(first, resolved.meters, control)?;
                resolved.exposure.get_or_init(|| exposed)
            }
        };
        let mut job = job.with_plan_settings(PlanSettings { clamp: *clamp, ..plan_settings })?;
        job.settings.picture = *picture;
        job.expose_fill(Some(*ev));
        if resolved.meters {
            metadata::replace(&mut job.metadata, picture);
        } else {
            metadata::set_auto_exposure(&mut job.metadata, *job.auto_exposure.get_or_init(|| *ev));
        }
        Ok(job)
    }

    /// As [`Session::first_job`]. Nothing else is kept of the scene.
    ///
    /// # Errors
    /// As [`Session::picture`] and [`Session::job`].
    pub fn into_job(
        mut self,
        resolved: &Arc<ResolvedPicture>,
        is_displayed: bool,
        control: &RenderControl,
        warnings: &mut Warnings,
    ) -> Result<RenderJob> {
        self.consume(resolved)?;
        self.first_job(resolved, is_displayed, control, warnings)
    }

    /// The job of a picture at the first moment, with its warnings.
    ///
    /// # Errors
    /// As [`Session::picture`] and [`Session::job`].
    pub fn first_job(
        &self,
        resolved: &Arc<ResolvedPicture>,
        is_displayed: bool,
        control: &RenderControl,
        warnings: &mut Warnings,
    ) -> Result<RenderJob> {
        let picture = self.first_picture(resolved)?;
        let job = self.job(&picture, is_displayed, control)?;
        self.warn(&picture, &job, warnings);
        Ok(job)
    }

    /// Warnings and notes about a picture before it is rendered, once its job has its exposure.
    pub fn warn(&self, picture: &Picture, job: &RenderJob, warnings: &mut Warnings) {
        let resolved = &picture.resolved;
        let exposed = resolved.exposure.get();
        if let Some(Exposed { ev, .. }) = exposed.filter(|known| known.picture == job.settings.picture) {
            let from = if self.moves(resolved) { ", from frame 0" } else { "" };
            let how = if resolved.meters { ", metered; --exposure 0 turns this off" } else { "" };
            warnings.note(format!("the exposure is {ev} EV{from}{how}"));
            notes::note_dark_environment(job, *ev, warnings);
        }
        notes::warn_of_job(job, warnings);
    }

    /// The scene in the coordinates of its world, and how it was recentered.
    pub fn recentered(&self) -> (&Scene, Option<&Recentering>) {
        let recentered = self.recentered.get_or_init(|| {
            Recentering::of(&self.scene).map(|recentering| {
                let mut moved = Scene::clone(&self.scene);
                recentering.apply(&mut moved);
                (recentering, moved)
            })
        });
        match recentered {
            Some((recentering, scene)) => (scene, Some(recentering)),
            None => (&self.scene, None),
        }
    }

    /// The look for these settings, in coordinates of the scene, with its warnings and notes.
    ///
    /// # Errors
    /// [`Error::Usage`] for invalid settings, [`Error::Input`] for an environment that cannot be read.
    pub fn look(&self, settings: &RenderSettings) -> Result<(DefaultLook, Warnings)> {
        let key = settings.of_look(&self.scene);
        let (mut look, warnings) = self.looks.get_or_insert(&key, || {
            let environment = self.environments.get_or_insert(&key.environment, || {
                let mut warnings = Warnings::default();
                Ok((key.environment.of(&self.scene, &mut warnings)?, warnings))
            });
            let (environment, mut warnings) = environment?;
            notes::warn_of_dark_lights(&self.scene, &mut warnings);
            let look = default_look(&self.scene, &key, environment)?;
            look.notes.iter().for_each(|note| warnings.note(note.as_str()));
            look.usual_note.iter().for_each(|note| warnings.note_usual(note.as_str()));
            Ok((look, warnings))
        })?;
        let PictureSettings { width, height, azimuth, elevation, zoom, fov, .. } = settings.picture;
        let of_camera =
            PictureSettings { width, height, azimuth, elevation, zoom, fov, ..PictureSettings::default() };
        look.picture = of_camera.or(look.picture);
        Ok((look, warnings))
    }

    /// A camera that fits the recentered scene, in its coordinates.
    fn fit(&self, view: StandardView, settings: &RenderSettings, size: [u32; 2]) -> Result<Camera> {
        let (scene, _) = self.recentered();
        let fit = Fit {
            look_at: settings.look_at.clone(),
            framing: settings.framing(view, scene),
            aspect: aspect(size),
            projection: settings.projection.unwrap_or_default(),
        };
        self.fitted.get_or_insert(&fit, || {
            let seen = settings.looked_at(scene)?;
            fitted_camera(&seen, fit.framing, fit.aspect, fit.projection)
                .ok_or_else(|| nothing_to_look_at(scene, settings))
        })
    }

    /// A camera that orbits once.
    fn orbit(&self, viewpoint: &Viewpoint, settings: &RenderSettings, size: [u32; 2]) -> Result<Mount> {
        let scene = &self.scene;
        let (camera, around) = match viewpoint {
            Viewpoint::OfScene(index) => (scene.cameras[*index].clone(), scene.cameras[*index].target),
            Viewpoint::Given(camera) => (camera.clone(), camera.target),
            Viewpoint::Fitted(view) => {
                let (framing, projection) =
                    (settings.framing(*view, scene), settings.projection.unwrap_or_default());
                turntable_camera(&*settings.looked_at(scene)?, framing, aspect(size), projection)
                    .ok_or_else(|| nothing_to_look_at(scene, settings))?
            }
        };
        let animation = Some(Animation::orbit(&camera, around));
        Ok(Mount::Orbit(Arc::new(Scene { cameras: vec![camera], animation, ..Scene::default() })))
    }

    /// The scene prepared for a picture.
    fn prepared(&self, resolved: &ResolvedPicture, inputs: &WorldInputs) -> Result<Arc<PreparedScene>> {
        self.worlds.get_or_insert(inputs, || {
            if self.is_consumed {
                let hint = "make another session of the scene".to_owned();
                return Err(Error::Failed {
                    what: "the session has no scene for another world".into(),
                    hint,
                });
            }
            let check = || check_memory(&self.scene, &resolved.plan_settings, inputs.numerics);
            if check().is_err() {
                // The worlds that are kept are in the memory that is used.
                self.worlds.lock().clear();
                check()?;
            }
            PreparedScene::new(Scene::clone(&self.scene), inputs, self.plays).map(Arc::new)
        })
    }
}

fn aspect([width, height]: [u32; 2]) -> f64 {
    f64::from(width) / f64::from(height)
}
