//! An animation prepared once, and the scene at any of its times.
//!
//! What does not move is shared by all frames: images always, the acceleration structure where only cameras and lights move. Where
//! objects move, each frame's structure is built anew: refitting wants a structure of its own for each frame in flight and traces worse.

use std::sync::Arc;

use crate::bvh::Layout;
use crate::error::Result;
use crate::film::ColourPipeline;
use crate::scene::animation::{Motion, Property, Target, Track};
use crate::scene::{Animation, Camera, Numerics, Projection, Scene};
use crate::world::{Range, StandardView, World, bring_into_range, headlight, turntable_camera};

/// Seconds of a turntable, and frames a second, where nothing says otherwise.
const TURNTABLE: (f64, f64) = (10.0, 30.0);

/// An animation with all that its frames share.
pub struct PreparedAnimation {
    /// The description; without its objects where they stand still, for they are in the world.
    scene: Scene,
    /// Index of the camera.
    camera: usize,
    /// Whether the camera brings a light, because the scene has none.
    headlight: bool,
    world: World,
    /// How the scene was moved where its objects stand still.
    range: Option<Range>,
    /// What is built for objects that move; `None` where none does.
    structure: Option<Layout>,
}

/// What there is at a time.
pub struct FrameWorld {
    /// The scene, prepared.
    pub world: Arc<World>,
    /// What it is seen by.
    pub camera: Camera,
    /// All the scene's cameras, and that one where it is another.
    pub cameras: Vec<Camera>,
    /// How the scene was moved before it was prepared.
    pub range: Option<Range>,
}

impl PreparedAnimation {
    /// Prepares what all frames share. `camera` is what the frames are seen by, as it is described: one of the scene's or
    /// another. `headlight` says whether a scene without lights is given one that goes with the camera.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] where a track has nothing to move.
    pub fn new(
        mut scene: Scene,
        camera: &Camera,
        headlight: bool,
        pipeline: ColourPipeline,
        structure: Layout,
        numerics: Numerics,
    ) -> Result<Self> {
        let known = scene.cameras.iter().position(|known| known == camera);
        let camera = known.unwrap_or_else(|| {
            scene.cameras.push(camera.clone());
            scene.cameras.len() - 1
        });
        let moves = scene.animation.as_ref().is_some_and(Animation::moves_objects);
        let mut base = scene.clone();
        if !moves {
            scene.animation = match &scene.animation {
                Some(animation) => Some(animation.without_objects(&scene)?),
                None => None,
            };
            scene.objects = Vec::new();
        }
        let range = bring_into_range(&mut base);
        let world = World::prepare(base, pipeline, structure, numerics);
        Ok(PreparedAnimation {
            headlight: headlight && scene.lights.is_empty(),
            scene,
            camera,
            world,
            range,
            structure: moves.then_some(structure),
        })
    }

    /// The world at rest, for what is to be said of it.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// How the scene at rest was moved before it was prepared.
    pub fn range(&self) -> Option<Range> {
        self.range
    }

    /// What there is at a time, 0 being the beginning and 1 the end.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] where a track comes to what cannot be.
    pub fn at(&self, time: f64) -> Result<FrameWorld> {
        let mut scene = self.scene.at(time)?;
        let range = match (self.structure, &self.range) {
            (Some(_), _) => bring_into_range(&mut scene),
            (None, range) => {
                range.iter().for_each(|range| range.apply(&mut scene));
                *range
            }
        };
        let cameras = std::mem::take(&mut scene.cameras);
        let camera = cameras[self.camera].clone();
        if self.headlight {
            scene.lights.extend(headlight(&camera));
        }
        let world = match self.structure {
            Some(structure) => self.world.prepare_another(scene, structure),
            None => self.world.under(scene.lights),
        };
        Ok(FrameWorld { world: Arc::new(world), camera, cameras, range })
    }
}

/// Has a camera go once round what it looks at, for scenes that say nothing of what moves. `None` for the camera stands for
/// one that sees the whole scene from all sides, beginning at `view`. Returns the camera; `None` where there is nothing to look at.
pub fn turntable(
    scene: &mut Scene,
    camera: Option<Camera>,
    view: StandardView,
    aspect: f64,
    projection: Projection,
) -> Option<Camera> {
    let (camera, around) = match camera {
        Some(camera) => {
            let target = camera.target;
            (camera, target)
        }
        None => turntable_camera(scene, view, aspect, projection)?,
    };
    let orbit = |property| Track {
        target: Target::Camera(camera.name.clone()),
        motion: Motion::Orbit { property, around, axis: glam::DVec3::Y, turns: 1.0 },
        place: std::path::Path::new("turntable").into(),
    };
    // A camera of that name that there was already would turn, too.
    scene.cameras.retain(|other| other.name != camera.name);
    scene.cameras.push(camera.clone());
    let (duration, fps) = TURNTABLE;
    let tracks = vec![orbit(Property::Position), orbit(Property::LookAt)];
    scene.animation = Some(Animation { fps, duration, repeat: true, tracks });
    Some(camera)
}
