//! A scene prepared for pictures by many cameras.

use std::sync::{Arc, Mutex, PoisonError};

use super::resolved::{camera_of, metered, resolve_picture};
use super::{PreparedScene, RenderJob, RenderSettings, ResolvedPicture, SceneAtTime, check_memory};
use crate::bvh::Layout;
use crate::effects::{check_names, check_scene};
use crate::error::{Result, Warnings};
use crate::import::check_drawable;
use crate::scene::{DefaultLook, PictureSettings, Scene};
use crate::world::{Recentering, recenter};

/// The number of looks, and of worlds, that are kept: those of cameras above and below an added ground, with and without
/// the look of a scene's own cameras.
const KEPT: usize = 4;

/// A scene for pictures by many cameras and with different settings, at the beginning of its animation. Acceleration
/// structures are built once for all pictures that differ in cameras, sizes, sampling and effects alone.
///
/// Every picture is that of [`super::prepare`] with the same settings.
pub struct PreparedPictures {
    scene: Arc<Scene>,
    /// The recentered scene, if it is recentered.
    recentered: Option<(Recentering, Scene)>,
    /// Looks in coordinates of the scene, by the settings that they depend on.
    looks: Mutex<Vec<(RenderSettings, DefaultLook)>>,
    worlds: Mutex<Vec<(WorldKey, SceneAtTime)>>,
}

/// What a world depends on besides the scene.
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
        let mut moved = Scene::clone(&scene);
        let recentered = recenter(&mut moved).map(|recentering| (recentering, moved));
        Ok(PreparedPictures { scene, recentered, looks: Mutex::default(), worlds: Mutex::default() })
    }

    /// The scene in its own coordinates.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The job of a picture. `has_metadata`: with the metadata of [`super::prepare`], which takes time in proportion to
    /// the scene; otherwise without any.
    ///
    /// # Errors
    /// As [`super::prepare`].
    pub fn job(
        &self,
        settings: &RenderSettings,
        has_metadata: bool,
        warnings: &mut Warnings,
    ) -> Result<RenderJob> {
        check_names(&settings.with, &settings.without)?;
        let (scene, recentering) = match &self.recentered {
            Some((recentering, scene)) => (scene, Some(recentering)),
            None => (&*self.scene, None),
        };
        let mut look = self.look(settings, warnings)?.recentered(recentering);
        look.picture = settings.picture.or(look.picture);
        super::warn_of_recentering(recentering, warnings);
        let (camera, size) = camera_of(scene, recentering, settings, warnings)?;
        let light = look.light.inspect(|light| light.note(warnings));
        let mut picture = resolve_picture(scene, &mut look, camera, size, settings)?;
        if has_metadata {
            let lights = light.and_then(|light| light.at(&picture.camera));
            let lit = lights.map(|light| {
                let mut lit = scene.clone();
                lit.lights.push(light);
                lit
            });
            picture = picture.with_metadata((lit.as_ref().unwrap_or(scene), &look), recentering, settings);
        }
        let meters = picture.meters;
        let job = self.world(scene, recentering, &look, &picture)?.job_for(picture)?;
        metered(job, meters, warnings)
    }

    /// The look for these settings, in coordinates of the scene.
    fn look(&self, settings: &RenderSettings, warnings: &mut Warnings) -> Result<DefaultLook> {
        let key = settings.of_look(&self.scene);
        let mut looks = self.looks.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, look)) = looks.iter().find(|(known, _)| *known == key) {
            look.notes.iter().for_each(|note| warnings.note(note.as_str()));
            return Ok(look.clone());
        }
        let look = settings.default_look(&self.scene, warnings)?;
        keep(&mut looks, (key, look.clone()));
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
        let mut worlds = self.worlds.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, world)) = worlds.iter().find(|(known, _)| *known == key) {
            return Ok(world.clone());
        }
        check_memory(scene, &picture.plan_settings, numerics)?;
        let prepared = PreparedScene::at_rest(
            scene.clone(),
            look,
            recentering.copied(),
            pipeline,
            picture.structure(),
            numerics,
        );
        let world = prepared.at(0.0)?;
        keep(&mut worlds, (key, world.clone()));
        Ok(world)
    }
}

/// Adds an entry to a cache, without its oldest one if it is full.
fn keep<T>(cache: &mut Vec<T>, entry: T) {
    cache.drain(..(cache.len() + 1).saturating_sub(KEPT));
    cache.push(entry);
}
