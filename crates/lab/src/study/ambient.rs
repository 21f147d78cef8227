//! The ambient term that stands in for indirect light. Its intensity is fitted to the limit, so that the error of
//! ambient occlusion is not that of a wrong brightness.

use std::sync::Arc;

use super::setting::Setting;
use super::sweep::Candidate;
use super::work::{MeasuredSetting, StudyRun, prepare};
use kiln::error::{Error, Result};
use kiln::metrics::ComparedImage;

/// Halvings of the interval of the intensity: to 1e-4 of its upper bound.
const HALVINGS: u32 = 13;

/// The base-2 logarithm of the largest intensity.
const MAX_DOUBLINGS: u32 = 10;

/// Sets the ambient intensity of all settings of local shading so that the mean of their picture is that of the limit.
///
/// # Errors
/// Those of rendering.
pub(crate) fn fit(
    run: &StudyRun,
    candidates: &mut [Candidate],
    settings: &mut [MeasuredSetting],
    limit: &ComparedImage,
) -> Result<()> {
    let is_local = |setting: &&Setting| setting.path.ambient.is_some();
    let Some(first) = settings.iter().map(|measured| &measured.setting).find(is_local) else {
        return Ok(());
    };
    let intensity = intensity(run, first.clone(), mean(limit))?;
    for candidate in candidates.iter_mut().filter(|candidate| candidate.setting.path.ambient.is_some()) {
        candidate.name = format!("ambient light of {intensity:.3}, {}", candidate.name);
    }
    let own = candidates.iter_mut().map(|candidate| &mut candidate.setting);
    for setting in own.chain(settings.iter_mut().map(|measured| &mut measured.setting)) {
        setting.path.ambient = setting.path.ambient.map(|_| intensity);
    }
    Ok(())
}

/// Mean of all channels.
fn mean(picture: &ComparedImage) -> f64 {
    let channels = picture.pixels.as_flattened();
    channels.iter().map(|&channel| f64::from(channel)).sum::<f64>() / channels.len().max(1) as f64
}

/// The intensity at which the mean of a picture of one sample is `target`, by bisection: the mean never falls with it.
/// The nearest bound of the search, 0 or 1024, where no intensity gives that mean.
fn intensity(run: &StudyRun, mut setting: Setting, target: f64) -> Result<f64> {
    (setting.sampling.samples, setting.sampling.noise) = (Some(1), None);
    let mut job = prepare(run.subject, &setting)?;
    let mut mean_at = |intensity: f64| {
        if let Some(world) = Arc::get_mut(&mut job.world) {
            world.ambient = intensity;
        }
        let (film, _) = run.render::<[f32; 3]>(&job, &setting)?;
        Ok::<_, Error>(mean(&ComparedImage::of_film(&film, setting.pipeline)))
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..MAX_DOUBLINGS {
        if mean_at(high)? >= target {
            break;
        }
        (low, high) = (high, 2.0 * high);
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if mean_at(middle)? < target { low = middle } else { high = middle }
    }
    Ok(high)
}
