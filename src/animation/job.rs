//! An animation as render jobs, one per frame.

use std::sync::Arc;

use rayon::prelude::*;

use super::FrameList;
use crate::error::{Error, Result, Warnings};
use crate::farm::Shard;
use crate::job::{
    Metadata, Picture, RenderControl, RenderJob, RenderSettings, ResolvedPicture, Session, metadata,
};
use crate::scene::Scene;
use crate::scene::animation::{Animation, Timeline};

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
    /// Whether the frames have display values, which depend on an automatic exposure.
    pub is_displayed: bool,
    /// What a film has where neither its scene nor an option says it.
    pub film: Option<FilmDefaults>,
    /// Whether a frame with this metadata exists already and is skipped.
    pub is_there: &'a (dyn Fn(i32, &Metadata) -> bool + Sync),
}

/// Size and timing of a film where neither its scene nor an option says them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilmDefaults {
    /// The longer side of its pictures in pixels.
    pub longest_side: u32,
    /// Frames per second, and seconds, of a turntable.
    pub turntable: [f64; 2],
}

impl<'a> FrameRequest<'a> {
    /// All frames of a list, in display values.
    pub fn all(fps: Option<f64>, duration: Option<f64>, list: Option<&'a FrameList>) -> Self {
        FrameRequest {
            fps,
            duration,
            list,
            shard: Shard::ALL,
            is_displayed: true,
            film: None,
            is_there: &|_, _| false,
        }
    }
}

/// An animation prepared for rendering.
pub struct AnimationJob {
    session: Session,
    /// Frames and times.
    pub timeline: Timeline,
    /// The frames to render, in order.
    pub frames: Vec<i32>,
    /// The number of frames that were skipped.
    pub skipped: usize,
    /// What all frames share. The camera is that before anything moves.
    pub picture: Arc<ResolvedPicture>,
    is_displayed: bool,
}

impl AnimationJob {
    /// Prepares what all frames share: those of a scene in which nothing moves are of a turntable. `building` is called
    /// before the acceleration structure is built.
    ///
    /// # Errors
    /// Those of [`crate::job::prepare`], and [`Error::Usage`] for frames that the animation does not have.
    pub fn prepare(
        mut scene: Scene,
        settings: &RenderSettings,
        request: &FrameRequest,
        warnings: &mut Warnings,
        building: impl FnOnce(&Warnings),
    ) -> Result<Self> {
        let is_turntable = scene.animation.is_none();
        let mut turn = Animation::turntable(Vec::new());
        if let Some(FilmDefaults { turntable, .. }) = request.film {
            [turn.fps, turn.duration] = turntable;
        }
        let longest = request.film.filter(|_| scene.picture.size().is_none()).map(|film| film.longest_side);
        let settings =
            &RenderSettings { longest_side: settings.longest_side.or(longest), ..settings.clone() };
        let animation = scene.animation.as_mut().unwrap_or(&mut turn);
        animation.fps = request.fps.unwrap_or(animation.fps);
        animation.duration = request.duration.unwrap_or(animation.duration);
        let (fps, duration) = (animation.fps, animation.duration);
        let timeline = Timeline::new(fps, duration, animation.repeat).map_err(|_| {
            let what = format!("{duration} seconds at {fps} frames per second");
            Error::usage(what, "give --duration and --fps above 0, and at most a million frames")
        })?;
        let list = request.list.cloned().unwrap_or_else(|| FrameList::range(0, timeline.last()));
        if let Some(frame) = list.frames().iter().find(|&&frame| frame < 0 || frame > timeline.last()) {
            let what =
                format!("frame {frame} is not in the animation: its frames are 0 to {}", timeline.last());
            return Err(Error::usage(what, "give other --frames, or a longer animation"));
        }
        if is_turntable {
            warnings.note("nothing in the scene moves; the camera orbits once");
            note_of_part(&list, &timeline).into_iter().for_each(|note| warnings.note(note));
        }
        let mut session = Session::playing(scene)?;
        // The camera at the beginning decides for all frames: this ground is added only to files without cameras, and
        // turntables do not change height.
        let picture = match is_turntable {
            true => session.resolve_turntable(settings, [fps, duration], warnings)?,
            false => session.resolve(settings, warnings)?,
        };
        let mine = list.frames().iter().enumerate().filter(|(place, _)| request.shard.has(*place));
        let mine: Vec<i32> = mine.map(|(_, &frame)| frame).collect();
        // In parallel, since checking a file reads all of it.
        let to_do = mine.par_iter().filter(|&&frame| !(request.is_there)(frame, &picture.metadata));
        let frames: Vec<i32> = to_do.copied().collect();
        if !frames.is_empty() {
            building(warnings);
            session.consume(&picture)?;
        }
        let skipped = mine.len() - frames.len();
        Ok(AnimationJob { session, timeline, frames, skipped, picture, is_displayed: request.is_displayed })
    }

    /// Meters the exposure that all frames have, also those of other runs, if it is metered: that of frame 0. Returns the job
    /// of the first frame to render, with its warnings.
    ///
    /// # Errors
    /// Those of [`AnimationJob::frame`] and [`RenderJob::render`].
    pub fn first(&self, control: &RenderControl, warnings: &mut Warnings) -> Result<Option<RenderJob>> {
        let Some(&first) = self.frames.first() else { return Ok(None) };
        let picture = self.picture_of(first)?;
        let job = self.session.job(&picture, self.is_displayed, control)?;
        self.session.warn(&picture, &job, warnings);
        Ok(Some(job))
    }

    fn picture_of(&self, frame: i32) -> Result<Picture> {
        self.session.picture(&self.picture, self.timeline.moment(frame))
    }

    /// The render job of a frame. It does not depend on which other frames are rendered.
    ///
    /// # Errors
    /// [`Error::Input`] where a track takes a property out of its range, and those of [`RenderJob::new`] and
    /// [`RenderJob::render`].
    pub fn frame(&self, frame: i32) -> Result<RenderJob> {
        let mut job =
            self.session.job(&self.picture_of(frame)?, self.is_displayed, &RenderControl::default())?;
        metadata::set_frame(&mut job.metadata, frame);
        Ok(job)
    }
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
