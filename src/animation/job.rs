//! An animation as render jobs, one per frame.

use std::borrow::Cow;

use rayon::prelude::*;

use super::FrameList;
use super::turntable;
use crate::error::{Error, Result, Warnings};
use crate::farm::Shard;
use crate::film::tone::Exposure;
use crate::film::write::FRAME;
use crate::job::camera::{Viewpoint, nothing_to_look_at};
use crate::job::metadata::{self, set_auto_exposure};
use crate::job::{
    self, Metadata, PreparedScene, RenderControl, RenderJob, RenderSettings, ResolvedJob, ResolvedPicture,
    SceneAtTime,
};
use crate::scene::animation::Timeline;
use crate::scene::{Camera, Scene};
use crate::world::{Recentering, StandardView, recenter};

/// The frames of an animation to render, and its timing.
pub struct FrameRequest<'a> {
    /// Frames per second; `None` for the scene's.
    pub fps: Option<f64>,
    /// The duration in seconds; `None` for the scene's.
    pub duration: Option<f64>,
    /// The frames; `None` for all.
    pub list: Option<&'a FrameList>,
    /// The shard of the frames to render.
    pub shard: Shard,
    /// Whether a frame with this metadata exists already and is skipped.
    pub is_there: &'a (dyn Fn(i32, &Metadata) -> bool + Sync),
}

impl<'a> FrameRequest<'a> {
    /// All frames of a list.
    pub fn all(fps: Option<f64>, duration: Option<f64>, list: Option<&'a FrameList>) -> Self {
        FrameRequest { fps, duration, list, shard: Shard::ALL, is_there: &|_, _| false }
    }
}

/// An animation prepared for rendering.
pub struct AnimationJob {
    /// `None` where no frame is to be rendered.
    scene: Option<PreparedScene>,
    /// The index of the camera.
    camera: usize,
    /// A recentering and the camera in its coordinates, if it was fitted there: without the rounding of a conversion to
    /// scene coordinates and back.
    fitted: Option<(Recentering, Camera)>,
    /// Frames and times.
    pub timeline: Timeline,
    /// The frames to render, in order.
    pub frames: Vec<i32>,
    /// The number of frames that were skipped.
    pub skipped: usize,
    /// The number of effects that are on in the first frame. A light that is dark at first may add to them.
    pub effects_on: usize,
    /// Whether lights are in physical units.
    pub has_physical_lights: bool,
    /// What all frames share. The camera is that before anything moves.
    pub picture: ResolvedPicture,
}

impl AnimationJob {
    /// Prepares what all frames share. `building` is called before the acceleration structure is built.
    ///
    /// # Errors
    /// Those of [`job::prepare`], and [`Error::Usage`] for frames that the animation does not have.
    pub fn prepare(
        mut scene: Scene,
        settings: &RenderSettings,
        request: &FrameRequest,
        warnings: &mut Warnings,
        building: impl FnOnce(&Warnings),
    ) -> Result<Self> {
        crate::effects::check_scene(&scene.effects)?;
        crate::import::check_drawable(&scene)?;
        let look = settings.default_look(&scene, warnings)?;
        let is_turntable = scene.animation.is_none();
        let Seen { camera, fitted, size } = seen_by(&mut scene, settings, warnings)?;
        let Some(animation) = &mut scene.animation else { return Err(nothing_to_look_at(&scene)) };
        if is_turntable {
            warnings.note("nothing in the scene moves; the camera orbits once");
        }
        animation.fps = request.fps.unwrap_or(animation.fps);
        animation.duration = request.duration.unwrap_or(animation.duration);
        let timeline = Timeline::new(animation.fps, animation.duration, animation.repeat).map_err(|_| {
            let what = format!("{} seconds at {} frames per second", animation.duration, animation.fps);
            Error::usage(what, "give --duration and --fps above 0, and at most a million frames")
        })?;
        let list = request.list.cloned().unwrap_or_else(|| FrameList::range(0, timeline.last()));
        if let Some(frame) = list.frames().iter().find(|&&frame| frame < 0 || frame > timeline.last()) {
            let what =
                format!("frame {frame} is not in the animation: its frames are 0 to {}", timeline.last());
            return Err(Error::usage(what, "give other --frames, or a longer animation"));
        }
        if is_turntable && let Some(note) = note_of_part(&list, &timeline) {
            warnings.note(note);
        }
        // The camera at the beginning decides for all frames: this ground is added only to files without cameras, and
        // turntables do not change height.
        let resolved = job::resolve_for(scene, look, None, camera.clone(), size, settings)?;
        let ResolvedJob { mut scene, look, picture, .. } = resolved;
        let mine = list.frames().iter().enumerate().filter(|(place, _)| request.shard.has(*place));
        let mine: Vec<i32> = mine.map(|(_, &frame)| frame).collect();
        // In parallel, since checking a file reads all of it.
        let to_do = mine.par_iter().filter(|&&frame| !(request.is_there)(frame, &picture.metadata));
        let frames: Vec<i32> = to_do.copied().collect();
        let skipped = mine.len() - frames.len();
        let camera = index_of(&mut scene.cameras, &camera);
        let has_physical_lights = scene.has_physical_lights;
        let (first, light) = (frames.first().copied(), look.light);
        let mut made = AnimationJob {
            scene: None,
            camera,
            fitted,
            timeline,
            frames,
            skipped,
            effects_on: 0,
            has_physical_lights,
            picture,
        };
        let Some(first) = first else { return Ok(made) };
        let ResolvedPicture { settings, plan_settings, .. } = &made.picture;
        let (structure, numerics) = (made.picture.structure(), made.picture.numerics());
        job::check_memory(&scene, plan_settings, numerics)?;
        light.into_iter().for_each(|light| light.note(warnings));
        building(warnings);
        let pipeline = settings.picture.pipeline();
        made.scene = Some(PreparedScene::new(scene, &look, pipeline, structure, numerics)?);
        // Errors and warnings of the first frame come before any is rendered.
        let first = made.frame(first)?;
        made.effects_on = first.plan.effects_on().count();
        job::warn_of_recentering(first.recentering.as_ref(), warnings);
        job::warn_of_job(&first, warnings);
        Ok(made)
    }

    /// Replaces an automatic or metered exposure by that of frame 0, the animation's first, whichever frames are rendered: so
    /// all frames, also those of other runs, have the same. Returns its EV, if there is one.
    ///
    /// # Errors
    /// Those of [`AnimationJob::frame`] and [`RenderJob::render`].
    pub fn fix_exposure(&mut self, control: &RenderControl) -> Result<Option<f64>> {
        let display = self.picture.settings.picture.display();
        if self.frames.is_empty() || !(self.picture.meters || display.is_auto()) {
            return Ok(None);
        }
        let mut first = self.frame(0)?;
        let picture = &mut self.picture;
        if picture.meters {
            let ev = first.meter(control)?;
            (picture.settings.picture, picture.plan_settings.clamp) =
                (first.settings.picture, first.plan_settings.clamp);
            metadata::replace(&mut picture.metadata, &first.settings.picture);
            return Ok(Some(ev));
        }
        let ev = first.display_transform(control)?.ev();
        picture.settings.picture.exposure = Some(Exposure::Ev(ev));
        set_auto_exposure(&mut picture.metadata, ev);
        Ok(Some(ev))
    }

    /// The render job of a frame. It does not depend on which other frames are rendered.
    ///
    /// # Errors
    /// [`Error::Input`] where a track takes a property out of its range, and those of [`RenderJob::new`].
    pub fn frame(&self, frame: i32) -> Result<RenderJob> {
        let Some(scene) = &self.scene else {
            return Err(Error::Failed { what: "no frame to render".into(), hint: String::new() });
        };
        let scene = scene.at(self.timeline.moment(frame))?;
        let SceneAtTime { cameras, recentering, .. } = &scene;
        let camera = match (&self.fitted, recentering) {
            (Some((fitted_in, camera)), Some(recentering)) if fitted_in == recentering => camera,
            _ => &cameras[self.camera],
        };
        let camera = Camera { projection: self.picture.camera.projection, ..camera.clone() };
        let mut picture = ResolvedPicture { camera, ..self.picture.clone() };
        picture.metadata.push((FRAME.to_owned(), frame.to_string()));
        scene.job_for(picture)
    }
}

/// The index of a camera among those of a scene, to which it is added if it is none of them.
fn index_of(cameras: &mut Vec<Camera>, camera: &Camera) -> usize {
    cameras.iter().position(|known| known == camera).unwrap_or_else(|| {
        cameras.push(camera.clone());
        cameras.len() - 1
    })
}

/// The note for consecutive frames of a turntable that are a part of the turn. A single frame has none: it does not look
/// like a turn.
fn note_of_part(list: &FrameList, timeline: &Timeline) -> Option<String> {
    let (count, total) = (list.frames().len() as i32, timeline.last() + 1);
    let is_consecutive = list.frames().windows(2).all(|pair| pair[1] == pair[0] + 1);
    if count < 2 || count == total || !is_consecutive {
        return None;
    }
    let degrees = (3600.0 * timeline.time(count)).round() / 10.0;
    Some(format!(
        "{count} of {total} frames cover {degrees} of the 360 degrees; --duration sets the seconds of the whole turn"
    ))
}

/// Camera and size of the frames.
struct Seen {
    /// The camera, in the scene's coordinates.
    camera: Camera,
    /// A recentering and the camera in its coordinates, if it was fitted there.
    fitted: Option<(Recentering, Camera)>,
    size: [u32; 2],
}

/// The camera and the size of the frames. A scene without animation becomes a turntable.
fn seen_by(scene: &mut Scene, settings: &RenderSettings, warnings: &mut Warnings) -> Result<Seen> {
    let viewpoint = Viewpoint::of(&settings.camera, scene, None)?;
    viewpoint.report(settings, scene, warnings);
    let size = viewpoint.size(settings, scene);
    let (camera, view) = match viewpoint {
        Viewpoint::Camera(camera) => (Some(camera.into_owned()), StandardView::Auto),
        Viewpoint::Fitted(view) => (None, view),
    };
    match (camera, scene.animation.is_some()) {
        (Some(camera), true) => Ok(Seen { camera, fitted: None, size }),
        (None, true) => {
            // Fitted to the recentered scene, as for single pictures.
            let mut recentered = scene.clone();
            let recentering = recenter(&mut recentered);
            let camera = Viewpoint::Fitted(view).camera(settings, &recentered, size)?;
            Ok(match recentering {
                Some(by) => Seen { camera: by.moved_back(&camera), fitted: Some((by, camera)), size },
                None => Seen { camera, fitted: None, size },
            })
        }
        (camera, false) => {
            let aspect = f64::from(size[0]) / f64::from(size[1]);
            let framing = settings.framing(view, scene);
            let projection = settings.projection.unwrap_or_default();
            let object = match settings.looked_at(scene)? {
                Cow::Owned(object) if camera.is_none() => Some(object),
                _ => None,
            };
            let orbit = |seen: &mut Scene| turntable(seen, camera, framing, aspect, projection);
            let camera = match object {
                Some(mut object) => {
                    let camera = orbit(&mut object);
                    scene.animation = object.animation;
                    scene.cameras.extend(camera.clone());
                    camera
                }
                None => orbit(scene),
            };
            let camera = camera.ok_or_else(|| nothing_to_look_at(scene))?;
            Ok(Seen { camera, fitted: None, size })
        }
    }
}
