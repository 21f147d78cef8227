//! Cache of the painter between requests: fitted cameras, the last exposure, and render times.

use std::collections::HashMap;
use std::sync::Arc;

use rayon::prelude::*;

use crate::false_colour::DisplayMode;
use crate::refine::PassTime;
use crate::request::{CameraSource, Opened, RenderRequest};
use kiln::effects::{Decision, EFFECTS};
use kiln::error::{Result, Warnings};
use kiln::film::tone::Exposure;
use kiln::job::camera::nothing_to_look_at;
use kiln::job::{self, Picture, RenderJob, RenderSettings, Session};
use kiln::render::RenderControl;
use kiln::scene::animation::Moment;
use kiln::scene::{Camera, PictureSettings, Projection, Scene};
use kiln::world::{Framing, StandardView, fitted_to_poses};

/// What is prepared for a request.
pub(crate) struct Prepared {
    /// The session that it is a picture of.
    pub session: Arc<Session>,
    /// The final image.
    pub picture: Picture,
    /// The camera, in scene coordinates.
    pub camera: Camera,
    /// Decision about each effect that the scene or the sampling uses.
    pub decisions: Vec<Decision>,
    /// Warnings and notes of its look.
    pub of_look: Warnings,
    /// Samples per pixel of the final image, at most: 1 for one at the pixel's centre.
    pub samples: u32,
}

impl Prepared {
    /// The job before its exposure is metered.
    pub(crate) fn job(&self) -> &RenderJob {
        &self.picture.job
    }

    /// The job with its exposure and clamp.
    ///
    /// # Errors
    /// Those of rendering.
    pub(crate) fn exposed(&self, control: &RenderControl) -> Result<RenderJob> {
        self.session.job(&self.picture, true, control)
    }

    /// [`Prepared::exposed`] where that renders nothing, since the exposure is known.
    pub(crate) fn known_exposed(&self) -> Option<RenderJob> {
        self.picture.is_exposed().then(|| self.exposed(&RenderControl::default()).ok())?
    }

    /// The settings as the panel shows them: an exposure that is metered is `auto`.
    pub(crate) fn shown_settings(&self) -> PictureSettings {
        let picture = self.job().settings.picture;
        let exposure = if self.picture.is_metered() { Some(Exposure::Auto) } else { picture.exposure };
        PictureSettings { exposure, ..picture }
    }
}

/// What a camera that is fitted to a moment depends on: framing, moment or all of the clips, aspect ratio and projection.
type FitKey = (Framing, Option<Moment>, f64, Projection);

/// Cached data of the opened files.
#[derive(Default)]
pub(crate) struct RenderCache {
    opened: Option<Arc<Opened>>,
    /// The camera that was last fitted to a moment, with what it depends on.
    fitted_at: Option<(FitKey, Camera)>,
    /// The last exposure that was metered, for fill light until the next is.
    metered: Option<f64>,
    /// Render time at one sample, by display mode.
    times: HashMap<DisplayMode, PassTime>,
}

impl RenderCache {
    /// Empties the cache for other opened files.
    fn open(&mut self, opened: &Arc<Opened>) {
        if !self.opened.as_ref().is_some_and(|known| Arc::ptr_eq(known, opened)) {
            *self = RenderCache { opened: Some(Arc::clone(opened)), ..RenderCache::default() };
        }
    }

    /// Whether the world of a request is built.
    pub(crate) fn has_world(&mut self, request: &RenderRequest) -> bool {
        self.open(&request.opened);
        let session = &request.opened.session;
        let resolved = self.render_settings(request).and_then(|side| session.resolve_only(&side, false));
        resolved.is_ok_and(|resolved| session.has_world(&resolved))
    }

    /// Render time at one sample; `None` before the first measurement.
    pub(crate) fn pass_time(&self, request: &RenderRequest) -> Option<PassTime> {
        self.times.get(&request.display_mode).copied()
    }

    /// Records a render time.
    pub(crate) fn record_time(&mut self, request: &RenderRequest, time: PassTime) {
        let time = time.damped(self.pass_time(request));
        self.times.insert(request.display_mode, time);
    }

    /// Records a metered exposure.
    pub(crate) fn record_exposure(&mut self, metered: &RenderJob) {
        if let Some(Exposure::Ev(ev)) = metered.settings.picture.exposure {
            self.metered = Some(ev);
        }
    }

    /// The settings of a request, with the camera that the command is given where it is fitted to a moment.
    fn render_settings(&mut self, request: &RenderRequest) -> Result<RenderSettings> {
        let CameraSource::FittedAt(view, moment) = request.camera_source else {
            return Ok(request.render_settings());
        };
        let camera_source = CameraSource::Free(self.fit_at(request, view, moment)?);
        Ok(RenderRequest { camera_source, ..request.clone() }.render_settings())
    }

    /// Prepares the scene for a request.
    pub(crate) fn prepare(&mut self, request: &RenderRequest) -> Result<Arc<Prepared>> {
        self.open(&request.opened);
        let settings = self.render_settings(request)?;
        let session = Arc::clone(&request.opened.session);
        let resolved = session.resolve_only(&settings, false)?.into();
        let mut picture = session.picture(&resolved, request.time)?;
        if resolved.meters {
            picture.job.expose_fill(self.metered);
        }
        let camera = match &request.camera_source {
            CameraSource::Free(free) => Camera { projection: resolved.camera.projection, ..free.clone() },
            _ => picture.camera(),
        };
        let (sampling, plan_settings, whole) =
            (picture.job.plan_settings.sampling, &picture.job.plan_settings, &picture.job.plan);
        let samples = if whole.takes_samples() { sampling.max_samples() } else { 1 };
        let decisions = EFFECTS.iter().zip(&whole.decisions);
        let decisions = decisions
            .filter(|(effect, _)| (effect.called_for)(&picture.job.world, plan_settings).is_ok())
            .map(|(_, decision)| decision.clone())
            .collect();
        let of_look = session.look(&settings)?.1;
        Ok(Arc::new(Prepared { session, picture, camera, decisions, of_look, samples }))
    }

    /// A camera fitted to the scene at a moment of its animation, in scene coordinates; to poses of all of its clips without
    /// a moment.
    fn fit_at(
        &mut self,
        request: &RenderRequest,
        view: StandardView,
        moment: Option<Moment>,
    ) -> Result<Camera> {
        let scene = request.opened.scene();
        let settings = request.render_settings();
        let framing = settings.framing(view, scene);
        let aspect = f64::from(request.size[0]) / f64::from(request.size[1]);
        let projection = request.projection.unwrap_or_default();
        let key = (framing, moment, aspect, projection);
        if let Some((_, camera)) = self.fitted_at.as_ref().filter(|(known, _)| *known == key) {
            return Ok(camera.clone());
        }
        let seen_at = |moment| {
            let pose = job::scene_at(scene, moment)?;
            Ok(settings.looked_at(&pose)?.into_owned())
        };
        let animation = scene.animation.as_ref().filter(|_| moment.is_none());
        let others = animation.map_or(Vec::new(), |animation| fitted_moments(scene, animation.duration));
        // A pose that cannot be read is the error of its frame.
        let others = others.into_par_iter().filter_map(|moment| seen_at(moment).ok());
        let first = seen_at(moment.unwrap_or_default())?;
        let camera = fitted_to_poses(&first, others, framing, aspect, projection);
        let camera = camera.ok_or_else(|| nothing_to_look_at(scene, &settings))?;
        self.fitted_at = Some((key, camera.clone()));
        Ok(camera)
    }
}

/// The most moments of clips that a camera is fitted to besides the first, and the most triangles of all of them together,
/// since each pose is read from the files.
const FITTED_MOMENTS: usize = 16;
const FITTED_TRIANGLES: usize = 4_000_000;

/// Moments after the first that a camera is fitted to, at equal distances up to the end of clips of `duration` seconds.
fn fitted_moments(scene: &Scene, duration: f64) -> Vec<Moment> {
    let count = (FITTED_TRIANGLES / scene.primitive_count().max(1)).clamp(2, FITTED_MOMENTS);
    let parts = (1..=count).map(|index| index as f64 / count as f64);
    parts.map(|part| Moment { part, seconds: part * duration }).collect()
}
