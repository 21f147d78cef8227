//! The lens of a picture: the camera's, or the one that depth of field is asked for with.

use crate::effects::{PlanSettings, id};
use crate::error::{Error, Result};
use crate::scene::{Camera, Focus, Lens, PictureSettings, Samples};
use crate::world::{Recentering, View, World};

/// Samples a pixel of pictures with a lens where none are asked for: those of paths in the default look.
const SAMPLES: u32 = crate::job::look::default_look::PATH_SAMPLES;

/// Blur of points infinitely far away, in heights of the picture, where depth of field is asked for without a value and the
/// camera has no aperture.
const BLUR: f64 = 0.05;

/// The lens of a picture and the blur that replaces its radius; `None` for a pinhole. A camera that says nothing of its lens
/// focuses on its target, which for one that fits a scene is in the plane of the centre of the bounds.
fn lens(camera: &Camera, plan_settings: &PlanSettings) -> Option<(Lens, Option<f64>)> {
    let (switch, value) = plan_settings.switch(id::DEPTH_OF_FIELD);
    let lens = camera.lens.unwrap_or(Lens { focus: Focus::Point(camera.target), ..Lens::default() });
    let blur = value.and_then(|value| value.parse().ok());
    let blur = blur.or((switch == Some(true) && lens.radius == 0.0).then_some(BLUR));
    (lens.radius > 0.0 || blur.is_some()).then_some((lens, blur))
}

/// Gives the view of a camera its lens, and the plan settings what [`PlanSettings::lens`] says of it.
///
/// # Errors
/// As [`View::set_lens`].
pub(crate) fn set(
    view: &mut View,
    plan_settings: &mut PlanSettings,
    camera: &Camera,
    world: &World,
    recentering: Option<&Recentering>,
) -> Result<()> {
    plan_settings.lens = None;
    if let (Some((lens, blur)), true) = (lens(camera, plan_settings), camera.projection.has_lens()) {
        let name = format!("camera `{}`", camera.name);
        if is_off(plan_settings) {
            plan_settings.lens = Some(name);
            return Ok(());
        }
        view.set_lens(camera, lens, blur, world)?;
        let scale = recentering.map_or(1.0, |recentering| recentering.scale);
        plan_settings.lens = view.lens().map(|lens| {
            let [radius, focus] = [lens.radius, lens.focus].map(|length| (length / scale) as f32);
            format!("{name}: an aperture of radius {radius}, in focus at a distance of {focus}")
        });
    }
    Ok(())
}

/// Whether options or the scene turn depth of field off.
fn is_off(plan_settings: &PlanSettings) -> bool {
    plan_settings.switch(id::DEPTH_OF_FIELD).0 == Some(false)
}

/// Gives a picture with a lens several samples a pixel, where its settings say nothing of them: one is noise.
///
/// # Errors
/// [`Error::Usage`] for an orthographic camera.
pub(crate) fn complete(
    picture: &mut PictureSettings,
    plan_settings: &mut PlanSettings,
    camera: &Camera,
) -> Result<()> {
    if is_off(plan_settings) || lens(camera, plan_settings).is_none() {
        return Ok(());
    }
    if !camera.projection.has_lens() {
        let projection = camera.projection.name();
        let what =
            format!("camera `{}` is {projection}, and only perspective cameras have a lens", camera.name);
        let hint = format!("give --projection perspective, or --without {}", id::DEPTH_OF_FIELD);
        return Err(Error::usage(what, hint));
    }
    if picture.samples.is_none() && !plan_settings.sampling.is_wanted() {
        picture.samples = Some(Samples::clamped(SAMPLES));
        plan_settings.sampling = picture.sampling();
    }
    Ok(())
}
