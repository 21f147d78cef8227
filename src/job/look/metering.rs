//! Metering: the exposure of a picture from a small render of it.

use std::sync::Arc;

use glam::DVec3;

use crate::effects::Plan;
use crate::error::Result;
use crate::film::tone::{
    Exposure, auto_exposure, clipped_share, mean_exposure, white_exposure, white_mean_exposure,
};
use crate::film::write::OutputImage;
use crate::film::{ColourPipeline, DisplaySettings, DisplayTransform, FilterShape};
use crate::job::look::default_look;
use crate::job::{RenderControl, RenderJob, RenderSettings, metadata};
use crate::render::aov::{self, AovSelection};
use crate::scene::{Camera, Clamp, DefaultLook, Look, PictureSettings, Sampling, Scene};

/// Longest side in pixels of a picture that is metered before it is rendered, and its samples a pixel.
const METER_SIZE: u32 = 128;
const METER_SAMPLES: u32 = 8;

/// Samples per pixel of the render whose log-average is metered. Noise lowers the logarithm: E[log2 X] falls short of
/// log2 E[X] by about var X / (2 ln 2 E[X]^2). With 64 samples the exposure of path traced rooms is within 0.05 EV of
/// that with 1024 (docs/decisions.md).
const AUTO_SAMPLES: u32 = 64;

impl RenderJob {
    /// For each pixel, row by row from the top, whether its centre ray hits an object other than the ground; `true` for
    /// all where no pixel's does.
    ///
    /// # Errors
    /// As [`RenderJob::render`].
    pub fn subject(&self, control: &RenderControl) -> Result<Vec<bool>> {
        self.pixels_of_objects(|_| true, control)
    }

    /// As [`RenderJob::subject`], without unlit objects.
    fn exposed_subject(&self, control: &RenderControl) -> Result<Vec<bool>> {
        let objects = &self.world.objects;
        let is_unlit = |index: usize| self.world.materials[objects[index].material as usize].is_unlit();
        self.pixels_of_objects(|index| !is_unlit(index), control)
    }

    fn pixels_of_objects(
        &self,
        is_chosen: impl Fn(usize) -> bool,
        control: &RenderControl,
    ) -> Result<Vec<bool>> {
        let selection = AovSelection::new(&["object".to_owned()])?;
        let objects = aov::channels(&self.aov_source(None), &selection, control)?;
        let is_subject = |&object: &f32| object >= 0.0 && is_chosen(object as usize);
        let mut found: Vec<bool> = objects[0].values.iter().map(is_subject).collect();
        if !found.contains(&true) {
            found.fill(true);
        }
        Ok(found)
    }

    /// The whole picture in a small size with so many samples a pixel, to be metered: crops and shards agree.
    ///
    /// # Errors
    /// As [`RenderJob::new`].
    pub fn to_be_metered(&self, samples: Option<u32>) -> Result<Self> {
        let size = self.view.size();
        let scale = (f64::from(METER_SIZE) / f64::from(size[0].max(size[1]))).min(1.0);
        let mut small = self.with_size(size.map(|side| ((f64::from(side) * scale).round() as u32).max(1)))?;
        small.settings.picture.exposure = None;
        // Pictures with a backdrop have the range of a display.
        if let Some(world) = small.world.without_backdrop() {
            small.world = Arc::new(world);
        }
        // Without light from beside the objects, which a wider filter would mix in.
        let filter = samples.is_some().then_some(FilterShape::Box);
        // The same random numbers whatever the seed and the time are: noise does not change the exposure of a scene.
        small.set_sampling(Sampling { samples, filter, ..Sampling::default() })?;
        Ok(small)
    }

    /// Colours of the subject ([`RenderJob::subject`]) in a small render of the whole picture.
    fn metered_colours(&self, samples: u32, control: &RenderControl) -> Result<Vec<[f32; 3]>> {
        let mut small = self.to_be_metered(Some(samples))?;
        small.expose_fill(None);
        let control = RenderControl { progress: &|_, _| (), ..*control };
        let (film, _) = small.render::<[f32; 3]>(&control)?;
        small.subject_colours(film.rows(), &control)
    }

    /// Colours of [`RenderJob::subject`] without unlit objects, whose colours do not depend on the exposure. `colours`
    /// are those of the picture, row by row from the top.
    pub fn subject_colours(
        &self,
        colours: impl Iterator<Item = [f32; 3]>,
        control: &RenderControl,
    ) -> Result<Vec<[f32; 3]>> {
        let subject = colours.zip(self.exposed_subject(control)?).filter(|(_, is_shown)| *is_shown);
        Ok(subject.map(|(colour, _)| colour).collect())
    }

    /// Display transform of the picture. An automatic exposure is metered at the first call in a small render of the
    /// whole picture ([`auto_exposure`]), so that it does not depend on the samples, the crop or the shard.
    ///
    /// # Errors
    /// As [`RenderJob::render`].
    pub fn display_transform(&self, control: &RenderControl) -> Result<DisplayTransform> {
        let display = self.display();
        if !display.is_auto() {
            return Ok(display.known());
        }
        let ev = match self.auto_exposure.get() {
            Some(&ev) => ev,
            None => {
                let ev = auto_exposure(self.metered_colours(AUTO_SAMPLES, control)?.into_iter());
                *self.auto_exposure.get_or_init(|| ev)
            }
        };
        Ok(display.transform(ev))
    }

    /// The exposure in EV for colours of the subject.
    pub fn exposure_of(&self, subject: &[[f32; 3]]) -> f64 {
        let tone_map = self.settings.picture.tone_map.unwrap_or_default();
        match &self.world.environment {
            Some(environment) if environment.is_sky => white_mean_exposure(subject, tone_map),
            _ => mean_exposure(subject, tone_map),
        }
    }

    /// Sets the exposure from a small render of the whole picture, and the clamp of paths that materials call for. Returns the EV.
    ///
    /// # Errors
    /// As [`RenderJob::render`].
    pub(crate) fn meter(&mut self, control: &RenderControl) -> Result<f64> {
        let subject = self.metered_colours(METER_SAMPLES, control)?;
        let ev = self.exposure_of(&subject);
        self.expose_fill(Some(ev));
        let picture = &mut self.settings.picture;
        picture.exposure = Some(Exposure::Ev(ev));
        if self.plan_settings.clamp.is_none() && self.world.path_tracing_reason.is_some() {
            picture.clamp = Some(default_look::white_clamp(ev));
            self.plan_settings.clamp = picture.clamp.map(Clamp::get);
            self.plan = Plan::new(&self.world, &self.plan_settings)?;
        }
        metadata::replace(&mut self.metadata, &self.settings.picture);
        Ok(ev)
    }

    /// An exposure in EV for a picture of which more than half of the pixels are clipped: it takes the 99th percentile of
    /// luminance to white. From a small render of the whole picture with one sample a pixel, so that crops agree.
    ///
    /// `None` if less is clipped, if an exposure or a tone map was chosen, or if a lower exposure does not help.
    ///
    /// # Errors
    /// As [`RenderJob::render`].
    pub fn exposure_for_clipped(
        &self,
        picture: &OutputImage,
        control: &RenderControl,
    ) -> Result<Option<f64>> {
        let clipped = match picture {
            OutputImage::Rgb8(film, _) => clipped_share(film),
            OutputImage::Rgb16(film, _) => clipped_share(film),
            _ => return Ok(None),
        };
        let DisplaySettings { exposure, tone_map, .. } = self.settings.picture.display();
        if exposure.is_some()
            || tone_map.is_some()
            || self.pipeline() != ColourPipeline::Linear
            || clipped <= 0.5
        {
            return Ok(None);
        }
        let small = self.to_be_metered(None)?;
        let control = RenderControl { progress: &|_, _| (), ..*control };
        let (film, _) = small.render::<[f32; 3]>(&control)?;
        Ok(white_exposure(film.rows()).filter(|&ev| ev < 0.0))
    }
}

/// Whether the exposure of a scene is metered once it is built. If so, the settings of its look get none.
pub(crate) fn leave_to_metering(
    look: &mut DefaultLook,
    scene: &Scene,
    bounds: &dyn Fn() -> Option<(DVec3, DVec3)>,
    settings: &RenderSettings,
    camera: &Camera,
) -> bool {
    let chosen = settings.picture.exposure.or(scene.picture.exposure);
    let picture = &mut look.picture;
    let is_studio = settings.look(scene) == Look::Studio;
    let is_auto = picture.exposure == Some(Exposure::Auto);
    let is_default = chosen.is_none() && (is_auto || is_studio && is_inside(bounds, picture, camera));
    // Colours that bypass the tone map are composited during rendering, so the exposure must be known first.
    let has_exposed_fill = look.fill.is_some_and(|fill| fill.is_exposed);
    let is_kept = picture.background.is_some() || scene.has_unlit() || has_exposed_fill;
    let meters = is_default || is_auto && is_studio && is_kept;
    if meters {
        picture.exposure = None;
    }
    meters
}

/// Whether a scene is seen from within its bounds, where little of its light may arrive.
fn is_inside(
    bounds: &dyn Fn() -> Option<(DVec3, DVec3)>,
    picture: &PictureSettings,
    camera: &Camera,
) -> bool {
    let contains =
        |(min, max): (DVec3, DVec3)| (camera.position.cmpgt(min) & camera.position.cmplt(max)).all();
    camera.projection.is_central()
        && picture.pipeline() == ColourPipeline::Linear
        && picture.shading().uses_lights()
        && bounds().is_some_and(contains)
}
