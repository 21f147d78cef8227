//! The errors of a picture by their causes, each with the option that reduces it and what that costs: noise, light left
//! out, the tier of numerics, and quantisation to 8 bits.

use std::time::Instant;

use glam::DVec3;

use super::light_left_out::{self, LightLeftOut, Share};
use kiln::effects::convergence::displayed_error;
use kiln::error::Result;
use kiln::film::Film;
use kiln::film::write::Channel;
use kiln::job::{RenderJob, RoundingError};
use kiln::render::RenderControl;
use kiln::render::aov::{self, AovSelection};
use kiln::scene::Numerics;

/// The error of a picture by one cause.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PictureError {
    /// The cause.
    pub cause: String,
    /// The error in `unit`; `None` where it is not known.
    pub error: Option<f64>,
    /// The standard error of `error`, where that is an estimate.
    pub standard_error: Option<f64>,
    /// What `error` is: `displayed` (the standard error of display values, 1 is white; the root mean square of the
    /// pixels), `share of the light`, or `8-bit steps` (the largest difference of display values).
    pub unit: String,
    /// The error in words.
    pub text: String,
    /// The option that reduces it.
    pub option: String,
    /// The time of the picture with that option over its time; `None` where that is not known.
    pub time: Option<f64>,
}

/// Measures the errors of a picture. `exact` is the same picture in the tier `exact`; `None` leaves the tier out.
///
/// # Errors
/// As [`RenderJob::render`].
pub fn measure(
    job: &RenderJob,
    exact: Option<&RenderJob>,
    control: &RenderControl,
) -> Result<Vec<PictureError>> {
    let started = Instant::now();
    let (film, _) = job.render::<[f32; 3]>(control)?;
    let seconds = started.elapsed().as_secs_f64();
    let mut errors = vec![noise(job, &film, control)?];
    errors.extend(light_left_out(job, control)?);
    errors.extend(exact.map(|exact| tier(job, exact, seconds, control)).transpose()?);
    errors.extend(quantisation(job));
    Ok(errors)
}

/// The light that limits leave out.
fn light_left_out(job: &RenderJob, control: &RenderControl) -> Result<Vec<PictureError>> {
    let Some(LightLeftOut { by_depth, by_clamp }) = light_left_out::measure(job, control)? else {
        return Ok(Vec::new());
    };
    let limits = job.plan.bounce_limits();
    let row = |cause: &str, share: Share, beyond: String, option: String| PictureError {
        cause: cause.into(),
        error: Some(share.mean),
        standard_error: Some(share.error),
        unit: "share of the light".into(),
        text: format!("{share} of the light left out{beyond}"),
        option,
        time: None,
    };
    let mut errors = vec![row("bounces", by_depth, format!(", beyond {limits}"), limits.doubled())];
    if job.plan_settings.clamp.is_some() {
        errors.push(row("clamp", by_clamp, String::new(), "larger --clamp".into()));
    }
    Ok(errors)
}

/// The rounding of display values to 8 bits; `None` where values have more.
fn quantisation(job: &RenderJob) -> Option<PictureError> {
    let RoundingError { largest, text, option } = job.rounding_error()?;
    Some(PictureError {
        cause: "8 bits".into(),
        error: largest,
        standard_error: None,
        unit: "8-bit steps".into(),
        text: text.into(),
        option: option.into(),
        time: Some(1.0),
    })
}

/// The noise: the root mean square, over pixels, of the standard error of the displayed value.
fn noise(job: &RenderJob, film: &Film, control: &RenderControl) -> Result<PictureError> {
    let samples = job.plan_settings.sampling.max_samples();
    let unknown = |text: &str, option: &str| PictureError {
        cause: "noise".into(),
        error: None,
        standard_error: None,
        unit: "displayed".into(),
        text: text.into(),
        option: option.into(),
        time: None,
    };
    if samples < 2 || !job.plan.takes_samples() {
        return Ok(unknown("not known from one sample a pixel", "--samples 16"));
    }
    let selection = AovSelection::new(&["samples".into(), "variance".into()])?;
    let channels = aov::channels(&job.aov_source(Some(film)), &selection, control)?;
    let display = job.display_transform(control)?;
    let value = |channel: &Channel, pixel: usize| f64::from(channel.values[pixel]);
    let [counts, red, green, blue] = &channels[..] else { return Ok(unknown("not known", "--samples")) };
    let (mut squares, mut count) = (0.0, 0.0);
    for (pixel, colour) in film.rows().enumerate() {
        let variance = DVec3::from([red, green, blue].map(|channel| value(channel, pixel)));
        let error = DVec3::from((variance / value(counts, pixel)).to_array().map(f64::sqrt));
        let displayed = |colour| display.displayed(job.pipeline(), colour);
        let error = displayed_error(DVec3::from(colour.map(f64::from)), error, displayed);
        squares += error * error;
        count += 1.0;
    }
    let error = f64::sqrt(squares / count);
    let (option, time) = match job.plan_settings.sampling.noise {
        // A quarter of the variance takes four times the samples.
        Some(noise) => (format!("--noise {:.2e} halves it", noise / 2.0), None),
        None => (format!("--samples {} halves it", samples.saturating_mul(4)), Some(4.0)),
    };
    Ok(PictureError {
        cause: "noise".into(),
        error: Some(error),
        standard_error: None,
        unit: "displayed".into(),
        text: format!("{error:.4} of white, standard error, RMS of the pixels"),
        option,
        time,
    })
}

/// The largest difference of display values to the tier `exact`.
fn tier(job: &RenderJob, exact: &RenderJob, seconds: f64, control: &RenderControl) -> Result<PictureError> {
    let own = job.world.numerics();
    let started = Instant::now();
    let (of_exact, _) = exact.render::<[u8; 3]>(control)?;
    let time = started.elapsed().as_secs_f64() / seconds;
    let (film, _) = job.render::<[u8; 3]>(control)?;
    let pixels = film.rows().zip(of_exact.rows());
    let differences: Vec<u8> = pixels
        .map(|(a, b): ([u8; 3], [u8; 3])| (0..3).map(|c| a[c].abs_diff(b[c])).max().unwrap_or(0))
        .collect();
    let largest = differences.iter().copied().max().unwrap_or(0);
    let different = differences.iter().filter(|&&difference| difference > 0).count();
    let share = 100.0 * different as f64 / differences.len().max(1) as f64;
    Ok(PictureError {
        cause: "tier".into(),
        error: Some(largest.into()),
        standard_error: None,
        unit: "8-bit steps".into(),
        text: format!(
            "`{}` differs from `exact` in {share:.3} % of the pixels, by up to {largest} of 255",
            own.name()
        ),
        option: if own == Numerics::Exact { String::new() } else { "--numerics exact".into() },
        time: Some(time),
    })
}
