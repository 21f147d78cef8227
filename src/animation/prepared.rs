//! An animation prepared once, and the prepared scene at any time.
//!
//! All frames share the images, and the acceleration structure where only cameras and lights move. Where objects move,
//! each frame builds its own: refitting would need a structure per frame in flight as well, and gives a tree that is
//! slower to traverse.

use std::sync::Arc;

use crate::bvh::Layout;
use crate::error::{Error, Result, Warnings};
use crate::film::ColourPipeline;
use crate::import;
use crate::scene::animation::{Motion, Property, Target, Track};
use crate::scene::{Animation, Camera, Clip, ClipChoice, ClipTime, DefaultLook, Numerics, Projection, Scene};
use crate::world::{Framing, Recentering, World, recenter, turntable_camera};

/// The default duration of a turntable in seconds, and its frames per second.
const TURNTABLE: (f64, f64) = (10.0, 30.0);

/// An animation with everything its frames share.
pub struct PreparedAnimation {
    /// The description. Without objects where neither surfaces nor lights move: `world` has them.
    scene: Scene,
    /// The index of the camera.
    camera: usize,
    /// A recentering and the camera in its coordinates, if it was fitted there.
    fitted: Option<(Recentering, Camera)>,
    /// Its look.
    look: DefaultLook,
    world: World,
    /// How `world` was recentered.
    recentering: Option<Recentering>,
    /// The structure to build for each frame; `None` where no surface moves.
    structure: Option<Layout>,
}

/// The prepared scene at a time.
pub struct FrameWorld {
    /// The prepared scene.
    pub world: Arc<World>,
    /// The camera.
    pub camera: Camera,
    /// All cameras of the scene, and `camera` if it is none of them.
    pub cameras: Vec<Camera>,
    /// How the scene was recentered.
    pub recentering: Option<Recentering>,
}

impl PreparedAnimation {
    /// Prepares what all frames share. `camera` is one of the scene's or another, in the scene's coordinates.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] for a track whose target does not exist.
    pub fn new(
        mut scene: Scene,
        mut look: DefaultLook,
        camera: &Camera,
        pipeline: ColourPipeline,
        structure: Layout,
        numerics: Numerics,
    ) -> Result<Self> {
        let known = scene.cameras.iter().position(|known| known == camera);
        let camera = known.unwrap_or_else(|| {
            scene.cameras.push(camera.clone());
            scene.cameras.len() - 1
        });
        let moves = scene.animation.as_ref().is_some_and(|animation| animation.moves_surfaces(&scene));
        let mut base = scene.clone();
        if !moves {
            scene.animation = match &scene.animation {
                Some(animation) => Some(animation.without_objects(&scene)?),
                None => None,
            };
        }
        // A clip imports the objects again at each time. Lights that move may come to lie on surfaces.
        let (has_clips, moves_lights) = scene
            .animation
            .as_ref()
            .map_or((false, false), |animation| (!animation.clips.is_empty(), animation.moves_lights()));
        if has_clips || !moves && !moves_lights {
            scene.objects = Vec::new();
        }
        let recentering = recenter(&mut base);
        let moved = look.recentered(recentering.as_ref());
        let world = World::prepare_look(base, &moved, pipeline, structure, numerics);
        look.light = look.light.filter(|_| scene.lights.is_empty());
        Ok(PreparedAnimation {
            scene,
            look,
            camera,
            fitted: None,
            world,
            recentering,
            structure: moves.then_some(structure),
        })
    }

    /// Uses a camera in the coordinates of `recentering`, without the rounding of a conversion to scene coordinates and
    /// back.
    pub(super) fn fitted(self, recentering: Recentering, camera: Camera) -> Self {
        PreparedAnimation { fitted: Some((recentering, camera)), ..self }
    }

    /// The prepared scene before the animation begins.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// How [`PreparedAnimation::world`] was recentered.
    pub fn recentering(&self) -> Option<Recentering> {
        self.recentering
    }

    /// The prepared scene at a time, 0 being the beginning and 1 the end.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] where a track takes a property out of its range.
    pub fn at(&self, time: f64) -> Result<FrameWorld> {
        let mut scene = self.scene.at(time)?;
        if let Some(Animation { clips, duration, .. }) = &self.scene.animation
            && !clips.is_empty()
        {
            pose(&mut scene, time * duration)?;
        }
        let recentering = match (self.structure, &self.recentering) {
            (Some(_), _) => recenter(&mut scene),
            (None, recentering) => {
                recentering.iter().for_each(|recentering| recentering.apply(&mut scene));
                *recentering
            }
        };
        let cameras = std::mem::take(&mut scene.cameras);
        let camera = match (&self.fitted, recentering) {
            (Some((fitted_in, camera)), Some(recentering)) if *fitted_in == recentering => camera.clone(),
            _ => cameras[self.camera].clone(),
        };
        scene.lights.extend(self.look.light.and_then(|light| light.at(&camera)));
        let world = match self.structure {
            Some(structure) => {
                let look = self.look.recentered(recentering.as_ref());
                self.world.prepare_another(scene, &look, structure)
            }
            None => self.world.under(scene.lights, &scene.objects),
        };
        Ok(FrameWorld { world: Arc::new(world), camera, cameras, recentering })
    }
}

/// Poses a scene by clips at a time in seconds. Imports objects, cameras, lights, materials and images again, and keeps
/// all else, such as settings, default look and added cameras.
fn pose(scene: &mut Scene, seconds: f64) -> Result<()> {
    let moment = ClipTime { clip: scene.import_options.clip(), time: seconds };
    let options = scene.import_options.clone().posed(moment);
    let Scene { objects, mut cameras, lights, materials, images, .. } =
        import::reload(scene, &options, &mut Warnings::default())?;
    cameras.extend(scene.cameras.drain(..).skip(cameras.len()));
    (scene.objects, scene.cameras, scene.lights) = (objects, cameras, lights);
    (scene.materials, scene.images) = (materials, images);
    Ok(())
}

/// Makes an animation of a scene without one: plays the chosen clips of its files together, for as long as the longest,
/// and poses the scene at their beginning. Without clips nothing changes.
///
/// # Errors
/// [`Error::Usage`] for a scene from standard input, which cannot be read again, and those of [`import::reload`].
pub fn play_clip(scene: &mut Scene, clip: &ClipChoice) -> Result<()> {
    let clips: Vec<Clip> = clip.find(&scene.clips).into_iter().cloned().collect();
    if clips.is_empty() || scene.animation.is_some() {
        return Ok(());
    }
    if scene.inputs.iter().any(|input| input.as_os_str() == "-") {
        let hint = "name a file, or hold one moment by --time";
        return Err(Error::usage(
            "clips of standard input cannot be played: each frame reads the file again",
            hint,
        ));
    }
    // Without --clip, the first is played.
    let choices = if *clip == ClipChoice::First { &[] } else { clip.choices() };
    scene.import_options.clips = choices.to_vec();
    // The camera and the default look are made for this pose, as for a picture at this time.
    pose(scene, 0.0)?;
    let (_, fps) = TURNTABLE;
    // At least one frame.
    let duration = clips.iter().map(|clip| clip.duration).fold(1.0 / fps, f64::max);
    scene.animation = Some(Animation { fps, duration, repeat: true, tracks: Vec::new(), clips });
    Ok(())
}

/// Adds an animation to the scene: `camera` orbits once around the point it looks at. Without a camera, one that sees
/// the whole scene from all sides, beginning as `framing` says. Returns the camera; `None` for a scene without extent.
pub fn turntable(
    scene: &mut Scene,
    camera: Option<Camera>,
    framing: impl Into<Framing>,
    aspect: f64,
    projection: Projection,
) -> Option<Camera> {
    let (camera, around) = match camera {
        Some(camera) => {
            let target = camera.target;
            (camera, target)
        }
        None => turntable_camera(scene, framing, aspect, projection)?,
    };
    let orbit = |property| Track {
        target: Target::Camera(camera.name.clone()),
        motion: Motion::Orbit { property, around, axis: glam::DVec3::Y, turns: 1.0 },
        place: std::path::Path::new("turntable").into(),
    };
    // The tracks name the camera, and would move another of the same name, too.
    scene.cameras.retain(|other| other.name != camera.name);
    scene.cameras.push(camera.clone());
    let (duration, fps) = TURNTABLE;
    let tracks = vec![orbit(Property::Position), orbit(Property::LookAt)];
    scene.animation = Some(Animation { fps, duration, repeat: true, tracks, clips: Vec::new() });
    Some(camera)
}
