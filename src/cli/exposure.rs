//! The warning for pictures that lights in physical units clip.

use crate::error::Result;
use crate::film::tone::{clipped_share, white_exposure};
use crate::film::{ColourPipeline, DisplaySettings, Film};
use crate::job::RenderJob;
use crate::render::RenderControl;

/// An exposure in EV for a picture of which more than half of the pixels are clipped: it takes the 99th percentile of
/// luminance to white. From a small render of the whole picture with one sample a pixel, so that crops agree.
///
/// `None` if less is clipped, if an exposure or a tone map was chosen, or if a lower exposure does not help.
pub(crate) fn exposure_for_clipped(
    film: &Film<[u8; 3]>,
    job: &RenderJob,
    control: &RenderControl,
) -> Result<Option<f64>> {
    let DisplaySettings { exposure, tone_map } = job.settings.picture.display();
    if exposure.is_some()
        || tone_map.is_some()
        || job.pipeline() != ColourPipeline::Linear
        || clipped_share(film) <= 0.5
    {
        return Ok(None);
    }
    let small = job.to_be_metered(None)?;
    let control = RenderControl { progress: &|_, _| (), ..*control };
    let (film, _) = small.render::<[f32; 3]>(&control)?;
    Ok(white_exposure(film.rows()).filter(|&ev| ev < 0.0))
}

/// The warning for a clipped picture.
pub(crate) fn clipped_warning(ev: f64) -> String {
    format!("most of the picture is clipped, because lights are in physical units; try `--exposure {ev}`")
}
