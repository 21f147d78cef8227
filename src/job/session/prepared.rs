//! A scene prepared for rendering, and its state at any time.
//!
//! All times share the images, and the acceleration structure where only cameras and lights move. Where objects move,
//! each time builds its own: refitting would need a structure per frame in flight as well, and gives a tree that is
//! slower to traverse.

use std::sync::Arc;

use crate::effects::random::seed_at;
use crate::error::Result;
use crate::film::tone::Exposure;
use crate::import;
use crate::job::{RenderJob, ResolvedPicture};
use crate::scene::animation::Moment;
use crate::scene::{AddedLight, Camera, Scene};
use crate::world::{Recentering, World, WorldInputs, recenter};

/// A scene prepared for rendering, with the parts that all times share.
pub struct PreparedScene {
    /// The scene before anything moves.
    world: Arc<World>,
    /// The cameras before anything moves, in coordinates of the world.
    cameras: Vec<Camera>,
    /// How the scene was recentered.
    recentering: Option<Recentering>,
    /// The light that follows the camera.
    light: Option<AddedLight>,
    /// What moves; `None` for a scene that is the same at all times.
    moving: Option<MovingScene>,
}

/// The description of a scene in which something moves.
struct MovingScene {
    /// The scene in its own coordinates; without objects where no time needs them.
    scene: Scene,
    /// What the worlds of all times depend on besides; `None` where no surface moves.
    inputs: Option<WorldInputs>,
}

/// A prepared scene at a time.
#[derive(Clone)]
pub struct SceneAtTime {
    /// The prepared scene, without the light that follows the camera.
    world: Arc<World>,
    /// The cameras of the scene, in coordinates of the world.
    pub cameras: Vec<Camera>,
    /// How the scene was recentered.
    pub recentering: Option<Recentering>,
    light: Option<AddedLight>,
    /// The time in seconds, which the random numbers of pictures depend on.
    seconds: f64,
}

impl PreparedScene {
    /// Prepares a scene in its own coordinates, for the moments of its animation if that `plays`.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] for a track whose target does not exist.
    pub fn new(mut scene: Scene, inputs: &WorldInputs, plays: bool) -> Result<Self> {
        let moving = if plays { MovingScene::of(&mut scene, inputs)? } else { None };
        let recentering = recenter(&mut scene);
        let light = inputs.light.filter(|_| scene.lights.is_empty());
        let cameras = std::mem::take(&mut scene.cameras);
        let world = World::prepare_with(scene, &inputs.recentered(recentering.as_ref())).into();
        Ok(PreparedScene { world, cameras, recentering, light, moving })
    }

    /// The scene at a moment of its animation.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] where a track takes a property out of its range.
    pub fn at(&self, moment: Moment) -> Result<SceneAtTime> {
        let PreparedScene { world, recentering, light, .. } = self;
        let (light, recentering, seconds) = (*light, *recentering, moment.seconds);
        let Some(MovingScene { scene, inputs }) = &self.moving else {
            let (world, cameras) = (Arc::clone(world), self.cameras.clone());
            return Ok(SceneAtTime { world, cameras, recentering, light, seconds });
        };
        let mut scene = scene_at(scene, moment)?;
        let recentering = match inputs {
            Some(_) => recenter(&mut scene),
            None => recentering.inspect(|recentering| recentering.apply(&mut scene)),
        };
        let cameras = std::mem::take(&mut scene.cameras);
        let world = match inputs {
            Some(inputs) => world.prepare_another(scene, &inputs.recentered(recentering.as_ref())),
            None => world.under(scene.lights, &scene.objects),
        };
        Ok(SceneAtTime { world: world.into(), cameras, recentering, light, seconds })
    }
}

/// A scene in its own coordinates at a moment of its animation: its tracks, or the clips that it plays.
pub fn scene_at(scene: &Scene, moment: Moment) -> Result<Scene> {
    let mut scene = scene.at(moment.part)?;
    if scene.plays_clips() {
        import::pose(&mut scene, moment.seconds)?;
    }
    Ok(scene)
}

impl MovingScene {
    /// What moves in a scene; `None` without an animation.
    fn of(scene: &mut Scene, inputs: &WorldInputs) -> Result<Option<Self>> {
        let Some(animation) = &scene.animation else { return Ok(None) };
        let (moves, moves_lights) = (animation.moves_surfaces(scene), animation.moves_lights());
        let has_clips = !animation.clips.is_empty();
        let animation = if moves { animation.clone() } else { animation.without_objects(scene)? };
        // A clip imports the objects again at each time. Lights that move may come to lie on surfaces.
        let (objects, hidden) = match !has_clips && (moves || moves_lights) {
            true => (scene.objects.clone(), scene.hidden.clone()),
            false => Default::default(),
        };
        let all = std::mem::take(&mut scene.objects);
        let moving = Scene { objects, hidden, animation: Some(animation), ..scene.clone() };
        scene.objects = all;
        Ok(Some(MovingScene { scene: moving, inputs: moves.then(|| inputs.clone()) }))
    }
}

impl SceneAtTime {
    /// The prepared scene with the light that follows a camera, which is in coordinates of the world.
    pub fn world_for(&self, camera: &Camera) -> Arc<World> {
        match self.light {
            Some(light) => Arc::new(self.world.under(light.at(camera).into_iter().collect(), &[])),
            None => Arc::clone(&self.world),
        }
    }

    /// The job of a picture, whose camera is in coordinates of the world. At other times than 0 its random numbers have
    /// another seed, unless the picture is to have the same grain.
    ///
    /// # Errors
    /// As [`RenderJob::new`].
    pub fn job_for(&self, picture: ResolvedPicture) -> Result<RenderJob> {
        let size = picture.size();
        let ResolvedPicture { camera, window, settings, mut plan_settings, metadata, source, .. } = picture;
        if settings.picture.same_grain != Some(true) {
            let seed = &mut plan_settings.sampling.seed;
            *seed = seed_at(*seed, self.seconds);
        }
        let job = RenderJob::new(self.world_for(&camera), self.recentering, camera, size, plan_settings)?;
        let mut job = RenderJob { window, settings, metadata, source, ..job };
        // Before the exposure is metered, there is none.
        if let Some(Exposure::Ev(ev)) = job.settings.picture.exposure {
            job.expose_fill(Some(ev));
        }
        Ok(job)
    }
}
