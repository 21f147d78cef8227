//! A scene prepared for pictures by many cameras.

use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use glam::DVec3;

use super::resolved::{camera_of, metered, resolve_picture};
use super::{PreparedScene, RenderJob, RenderSettings, ResolvedPicture, SceneAtTime, check_memory};
use crate::bvh::Layout;
use crate::effects::{check_names, check_scene};
use crate::error::{Result, Warnings};
use crate::import::check_drawable;
use crate::render::aov::AovSelection;
use crate::scene::animation::Moment;
use crate::scene::{DefaultLook, PictureSettings, Scene};
use crate::world::Recentering;

/// The number of looks, and of worlds, that are kept: those of cameras above and below an added ground, with and
/// without the look of a scene's own cameras.
const KEPT: usize = 4;

/// A scene for pictures by many cameras and with different settings, at the beginning of its animation. Acceleration
/// structures are built at the first picture, and again for settings that change tier, preset, colours, environment,
/// background or look; up to [`KEPT`] are kept.
///
/// Every picture is that of [`super::prepare`] with the same settings.
pub struct PreparedPictures {
    scene: Arc<Scene>,
    /// The recentered scene, if it is recentered.
    recentered: Option<(Recentering, Scene)>,
    /// The bounds of the recentered scene.
    bounds: OnceLock<Option<(DVec3, DVec3)>>,
    /// Looks in coordinates of the scene, by the settings that they depend on.
    looks: Mutex<Vec<(RenderSettings, DefaultLook, Warnings)>>,
    worlds: Mutex<Vec<(WorldKey, SceneAtTime)>>,
}

/// Key of a cached world.
#[derive(PartialEq)]
struct WorldKey {
    /// The settings that the look depends on, without those of the picture, but for tier and colours.
    settings: RenderSettings,
    /// The look without picture settings and notes, which do not change the world, and without the environment, which
    /// follows from the settings.
    look: DefaultLook,
    structure: Layout,
}

impl PreparedPictures {
    /// Prepares a scene in its own coordinates.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] for a scene that cannot be rendered.
    pub fn new(scene: Arc<Scene>) -> Result<Self> {
        check_scene(&scene.effects)?;
        check_drawable(&scene)?;
        let recentered = Recentering::of(&scene).map(|recentering| {
            let mut moved = Scene::clone(&scene);
            recentering.apply(&mut moved);
            (recentering, moved)
        });
        Ok(PreparedPictures {
            scene,
            recentered,
            bounds: OnceLock::new(),
            looks: Mutex::default(),
            worlds: Mutex::default(),
        })
    }

    /// The scene in its own coordinates.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The job of a picture.
    ///
    /// # Errors
    /// As [`super::prepare`].
    pub fn job(&self, settings: &RenderSettings, warnings: &mut Warnings) -> Result<RenderJob> {
        let (job, meters) = self.unmetered_job(settings, true, warnings)?;
        metered(job, meters, warnings)
    }

    /// The job of AOVs: without metadata, which takes time in proportion to the scene, and with a metered exposure only
    /// where they depend on it.
    ///
    /// # Errors
    /// As [`super::prepare`].
    pub fn aov_job(
        &self,
        settings: &RenderSettings,
        selection: &AovSelection,
        warnings: &mut Warnings,
    ) -> Result<RenderJob> {
        let (job, meters) = self.unmetered_job(settings, false, warnings)?;
        let meters = meters && selection.depends_on_exposure(&job.plan);
        metered(job, meters, warnings)
    }

    /// A job, and whether its exposure is to be metered.
    fn unmetered_job(
        &self,
        settings: &RenderSettings,
        has_metadata: bool,
        warnings: &mut Warnings,
    ) -> Result<(RenderJob, bool)> {
        check_names(&settings.with, &settings.without)?;
        let (scene, recentering) = match &self.recentered {
            Some((recentering, scene)) => (scene, Some(recentering)),
            None => (&*self.scene, None),
        };
        let mut look = self.look(settings, warnings)?.recentered(recentering);
        let PictureSettings { width, height, azimuth, elevation, zoom, fov, .. } = settings.picture;
        let of_cameras =
            PictureSettings { width, height, azimuth, elevation, zoom, fov, ..PictureSettings::default() };
        look.picture = of_cameras.or(look.picture);
        super::warn_of_recentering(recentering, warnings);
        let (camera, size) = camera_of(scene, recentering, settings, warnings)?;
        let light = look.light.inspect(|light| light.note(warnings));
        let bounds = || *self.bounds.get_or_init(|| scene.bounds());
        let mut picture = resolve_picture((scene, &bounds), &mut look, camera, size, settings)?;
        if has_metadata {
            let added = light.and_then(|light| light.at(&picture.camera));
            picture = picture.with_metadata((scene, added.as_ref(), &look), recentering, settings);
        }
        let meters = picture.meters;
        let job = self.world(scene, recentering, &look, &picture)?.job_for(picture)?;
        Ok((job, meters))
    }

    /// The look for these settings, in coordinates of the scene.
    fn look(&self, settings: &RenderSettings, warnings: &mut Warnings) -> Result<DefaultLook> {
        let key = settings.of_look(&self.scene);
        let known = locked(&self.looks).iter().find(|(known, ..)| *known == key).cloned();
        let (look, of_look) = match known {
            Some((_, look, of_look)) => (look, of_look),
            None => {
                let mut of_look = Warnings::default();
                let look = key.default_look(&self.scene, &mut of_look)?;
                keep(&self.looks, (key, look.clone(), of_look.clone()));
                (look, of_look)
            }
        };
        of_look.messages().iter().for_each(|text| warnings.push(text.as_str()));
        of_look.notes().iter().for_each(|text| warnings.note(text.as_str()));
        Ok(look)
    }

    /// The scene prepared with a look.
    fn world(
        &self,
        scene: &Scene,
        recentering: Option<&Recentering>,
        look: &DefaultLook,
        picture: &ResolvedPicture,
    ) -> Result<SceneAtTime> {
        let (pipeline, numerics) = (picture.settings.picture.pipeline(), picture.numerics());
        let of_world = PictureSettings {
            colour: Some(pipeline),
            numerics: Some(numerics),
            background: look.picture.background,
            ..PictureSettings::default()
        };
        let key = WorldKey {
            settings: RenderSettings {
                picture: of_world,
                environment: picture.settings.environment.clone(),
                ..RenderSettings::default()
            },
            look: DefaultLook {
                picture: PictureSettings::default(),
                notes: Vec::new(),
                environment: None,
                ..look.clone()
            },
            structure: picture.structure(),
        };
        if let Some((_, world)) = locked(&self.worlds).iter().find(|(known, _)| *known == key) {
            return Ok(world.clone());
        }
        // Not while the cache is locked: a thread that waits for parts of this work may take up another picture.
        let check = || check_memory(scene, &picture.plan_settings, numerics);
        if check().is_err() {
            // The worlds that are kept are in the memory that is used.
            locked(&self.worlds).clear();
            check()?;
        }
        let prepared = PreparedScene::at_rest(
            scene.clone(),
            look,
            recentering.copied(),
            pipeline,
            picture.structure(),
            numerics,
        );
        let world = prepared.at(Moment::of_still(scene))?;
        keep(&self.worlds, (key, world.clone()));
        Ok(world)
    }
}

fn locked<T>(cache: &Mutex<T>) -> MutexGuard<'_, T> {
    cache.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Adds an entry to a cache, without its oldest one if it is full.
fn keep<T>(cache: &Mutex<Vec<T>>, entry: T) {
    let mut cache = locked(cache);
    let surplus = (cache.len() + 1).saturating_sub(KEPT);
    cache.drain(..surplus);
    cache.push(entry);
}
