//! A scene prepared for rendering, and its state at any time.
//!
//! All times share the images, and the acceleration structure where only cameras and lights move. Where objects move,
//! each time builds its own: refitting would need a structure per frame in flight as well, and gives a tree that is
//! slower to traverse.

use std::sync::Arc;

use super::{RenderJob, ResolvedPicture};
use crate::bvh::Layout;
use crate::effects::random::seed_at;
use crate::error::Result;
use crate::film::ColourPipeline;
use crate::film::tone::Exposure;
use crate::import;
use crate::scene::animation::Moment;
use crate::scene::{AddedLight, Camera, DefaultLook, Numerics, Scene};
use crate::world::{Recentering, World, recenter};

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
    /// Its look.
    look: DefaultLook,
    /// The structure to build for each time; `None` where no surface moves.
    structure: Option<Layout>,
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
    /// Prepares a scene in its own coordinates.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] for a track whose target does not exist.
    pub fn new(
        mut scene: Scene,
        look: &DefaultLook,
        pipeline: ColourPipeline,
        structure: Layout,
        numerics: Numerics,
    ) -> Result<Self> {
        let moving = MovingScene::of(&mut scene, look, structure)?;
        let recentering = recenter(&mut scene);
        let look = look.recentered(recentering.as_ref());
        let prepared = PreparedScene::at_rest(scene, &look, recentering, pipeline, structure, numerics);
        Ok(PreparedScene { moving, ..prepared })
    }

    /// Prepares a scene without animation that was recentered with its look.
    pub(crate) fn at_rest(
        mut scene: Scene,
        look: &DefaultLook,
        recentering: Option<Recentering>,
        pipeline: ColourPipeline,
        structure: Layout,
        numerics: Numerics,
    ) -> Self {
        let light = look.light.filter(|_| scene.lights.is_empty());
        let cameras = std::mem::take(&mut scene.cameras);
        let world = World::prepare_look(scene, look, pipeline, structure, numerics).into();
        PreparedScene { world, cameras, recentering, light, moving: None }
    }

    /// How the scene before anything moves was recentered.
    pub fn recentering(&self) -> Option<Recentering> {
        self.recentering
    }

    /// The scene at a moment of its animation.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] where a track takes a property out of its range.
    pub fn at(&self, moment: Moment) -> Result<SceneAtTime> {
        let PreparedScene { world, recentering, light, .. } = self;
        let (light, recentering, seconds) = (*light, *recentering, moment.seconds);
        let Some(MovingScene { scene, look, structure }) = &self.moving else {
            let (world, cameras) = (Arc::clone(world), self.cameras.clone());
            return Ok(SceneAtTime { world, cameras, recentering, light, seconds });
        };
        let mut scene = scene_at(scene, moment)?;
        let recentering = match structure {
            Some(_) => recenter(&mut scene),
            None => recentering.inspect(|recentering| recentering.apply(&mut scene)),
        };
        let cameras = std::mem::take(&mut scene.cameras);
        let world = match structure {
            Some(structure) => {
                world.prepare_another(scene, &look.recentered(recentering.as_ref()), *structure)
            }
            None => world.under(scene.lights, &scene.objects),
        };
        Ok(SceneAtTime { world: world.into(), cameras, recentering, light, seconds })
    }
}

/// A scene in its own coordinates at a moment of its animation: its tracks, or the clips that it plays.
pub(crate) fn scene_at(scene: &Scene, moment: Moment) -> Result<Scene> {
    let mut scene = scene.at(moment.part)?;
    if scene.plays_clips() {
        import::pose(&mut scene, moment.seconds)?;
    }
    Ok(scene)
}

impl MovingScene {
    /// What moves in a scene; `None` without an animation.
    fn of(scene: &mut Scene, look: &DefaultLook, structure: Layout) -> Result<Option<Self>> {
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
        Ok(Some(MovingScene { scene: moving, look: look.clone(), structure: moves.then_some(structure) }))
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
        let ResolvedPicture { camera, window, settings, mut plan_settings, metadata, .. } = picture;
        if settings.picture.same_grain != Some(true) {
            let seed = &mut plan_settings.sampling.seed;
            *seed = seed_at(*seed, self.seconds);
        }
        let job = RenderJob::new(self.world_for(&camera), self.recentering, camera, size, plan_settings)?;
        let mut job = RenderJob { window, settings, metadata, ..job };
        // Before the exposure is metered, there is none.
        if let Some(Exposure::Ev(ev)) = job.settings.picture.exposure {
            job.expose_fill(Some(ev));
        }
        Ok(job)
    }
}
