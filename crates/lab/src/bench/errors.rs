//! The price of accuracy: the errors of a picture by their causes, each with the option that reduces it, what is left
//! then, and the time that this takes.
//!
//! An error is the difference of the displayed values of two renders, one of which has less of the cause or none of it:
//! of samples, a picture of many; of limits on bounces and of the clamp, one without, by the same samples; of the tier,
//! `exact` by the same samples; of texture filters, one that averages texels by samples alone.

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;

use super::light_left_out::{self, LightLeftOut, Share, without_limits};
use crate::timing::{Clock, Quartiles};
use kiln::effects::random::other_seed;
use kiln::effects::{PlanSettings, id};
use kiln::error::Result;
use kiln::film::ColourPipeline;
use kiln::job::{RenderJob, RoundingError};
use kiln::metrics::BEYOND_STEP;
use kiln::render::RenderControl;
use kiln::scene::{MAX_SAMPLES, Numerics, Sampling, TextureFilter};

/// Times are medians of this many pairs of renders.
const ROUNDS: usize = 3;

/// Samples of the picture that errors of sampling are measured against: this many times those of the picture with more
/// samples, within [`REFERENCE`].
const REFERENCE_TIMES: u32 = 4;
const REFERENCE: [u32; 2] = [256, 512];

/// How many times the samples are in the picture with more: half the noise.
const MORE: u32 = 4;

/// A clamp that changes nothing in pictures of displayable light.
const NO_CLAMP: f64 = 1e6;

/// The most samples of pictures that are compared by the same samples, of which one has limits on bounces.
const MAX_PAIRED: u32 = 32;

/// The error of a picture by one cause, and its price.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PictureError {
    /// The cause.
    pub cause: String,
    /// The error.
    pub now: ErrorInSteps,
    /// The options of `kiln render` that reduce it.
    pub options: String,
    /// The error with these options.
    pub then: ErrorInSteps,
    /// Time with these options over the time of the picture.
    pub time: Quartiles,
    /// What else is known of the cause; may be empty.
    pub note: String,
}

impl PictureError {
    /// Whether the cause changes the picture at all.
    fn is_any(&self) -> bool {
        self.now != self.then
    }
}

/// An error of displayed values, before they are rounded to 8 bits.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ErrorInSteps {
    /// The share of the pixels that are off by more than one step of 255 in a channel, 0 to 1.
    pub beyond_step: f64,
    /// The largest difference of a channel, in steps of 255.
    pub largest: f64,
}

impl ErrorInSteps {
    fn between(picture: &[DVec3], reference: &[DVec3]) -> Self {
        let difference = |(a, b): (&DVec3, &DVec3)| (*a - *b).abs().max_element();
        let differences = || picture.iter().zip(reference).map(difference);
        let beyond = differences().filter(|&difference| difference > BEYOND_STEP).count();
        ErrorInSteps {
            beyond_step: beyond as f64 / picture.len().max(1) as f64,
            largest: 255.0 * differences().fold(0.0, f64::max),
        }
    }

    /// The share of the pixels as text: `6.7 %`.
    pub fn share(&self) -> String {
        match 100.0 * self.beyond_step {
            0.0 => "0 %".to_owned(),
            percent => format!("{} %", significant(percent, 2)),
        }
    }

    /// As text: `6.7 % (84)`.
    pub fn text(&self) -> String {
        let largest = if self.largest == 0.0 { "0".to_owned() } else { significant(self.largest, 2) };
        format!("{} ({largest})", self.share())
    }
}

/// A positive number rounded to a number of significant digits, without an exponent.
fn significant(x: f64, digits: i32) -> String {
    if x < 0.01 {
        return "< 0.01".into();
    }
    let decimals = (digits - 1 - x.log10().floor() as i32).max(0) as usize;
    format!("{x:.decimals$}")
}

/// A ratio of times with as many digits as its quartiles allow, at most three.
pub fn ratio(time: &Quartiles) -> String {
    let spread = (time.upper - time.lower).max(time.median * 1e-3) / 2.0;
    let digits = 1 + (time.median / spread).log10().floor() as i32;
    significant(time.median, digits.clamp(1, 3))
}

/// Prepares the same picture in another tier, or in another colour pipeline.
pub type OtherJobs<'a> = &'a dyn Fn(Option<Numerics>, Option<ColourPipeline>) -> Result<RenderJob>;

/// Measures the errors of a picture. `others` prepares it in another tier or colour pipeline. Progress is that of all renders.
///
/// # Errors
/// As [`RenderJob::render`].
pub fn measure(job: &RenderJob, others: OtherJobs, control: &RenderControl) -> Result<Vec<PictureError>> {
    const STEPS: usize = 1000;
    let (done, total) = (AtomicUsize::new(0), renders(job));
    let progress = |tiles: usize, of: usize| {
        let before =
            if tiles == of { done.fetch_add(1, Ordering::Relaxed) } else { done.load(Ordering::Relaxed) };
        (control.progress)((STEPS * before + STEPS * tiles / of).min(STEPS * total), STEPS * total);
    };
    let control = &RenderControl { progress: &progress, ..*control };
    let own = displayed(job, control)?;
    let mut errors = sampling(job, &own, control)?;
    errors.extend(bounces(job, &own, control)?);
    if job.world.numerics() != Numerics::Exact {
        let exact = others(Some(Numerics::Exact), None)?;
        errors.push(of_same_samples("tier", "--numerics exact", [job, &exact], &own, control)?);
    }
    errors.extend(rounding(job, others, &own, control)?);
    Ok(errors)
}

/// About the number of renders of a measurement: those of each cause, and the pairs that are timed.
fn renders(job: &RenderJob) -> usize {
    let is_on = |effect| job.plan.decisions.iter().any(|decision| decision.on && decision.effect == effect);
    let paths = if job.plan.transport.traces_paths() { 10 + 4 * ROUNDS } else { 0 };
    let others = [
        is_on(id::TEXTURES),
        is_on(id::GLAZE),
        job.world.numerics() != Numerics::Exact,
        job.pipeline() == ColourPipeline::U8,
    ];
    let causes = others.iter().filter(|is_cause| **is_cause).count();
    3 + 2 * ROUNDS + paths + causes * (1 + 2 * ROUNDS)
}

/// Displayed values of a picture.
fn displayed(job: &RenderJob, control: &RenderControl) -> Result<Vec<DVec3>> {
    let (film, _) = job.render::<[f32; 3]>(control)?;
    let display = job.display_transform(control)?;
    let value = |pixel: [f32; 3]| display.displayed(job.pipeline(), DVec3::from(pixel.map(f64::from)));
    Ok(film.rows().map(value).collect())
}

/// The time of the second picture over that of the first.
fn time_of([from, to]: [&RenderJob; 2], control: &RenderControl) -> Result<Quartiles> {
    let threads = rayon::current_num_threads();
    let seconds = |job: &RenderJob| -> Result<f64> {
        let clock = Clock::start(threads);
        job.render::<[u8; 3]>(control)?;
        Ok(clock.seconds())
    };
    let ratios = (0..ROUNDS).map(|_| {
        let first = seconds(from)?;
        Ok(seconds(to)? / first)
    });
    let ratios = ratios.collect::<Result<Vec<f64>>>()?;
    Ok(Quartiles::of(&ratios).unwrap_or(Quartiles::exact(1.0)))
}

/// The error that another picture by the same samples does not have.
fn of_same_samples(
    cause: &str,
    options: &str,
    [job, other]: [&RenderJob; 2],
    own: &[DVec3],
    control: &RenderControl,
) -> Result<PictureError> {
    Ok(PictureError {
        cause: cause.into(),
        now: ErrorInSteps::between(own, &displayed(other, control)?),
        options: options.into(),
        then: ErrorInSteps::default(),
        time: time_of([job, other], control)?,
        note: String::new(),
    })
}

/// The picture with other samples.
fn sampled(job: &RenderJob, sampling: Sampling) -> Result<RenderJob> {
    job.with_plan_settings(PlanSettings { sampling, ..job.plan_settings.clone() })
}

/// Too few samples, and filters of textures.
fn sampling(job: &RenderJob, own: &[DVec3], control: &RenderControl) -> Result<Vec<PictureError>> {
    let sampling = job.plan_settings.sampling;
    if !job.plan.takes_samples() && sampling.is_wanted() {
        return Ok(Vec::new());
    }
    let count = if sampling.is_wanted() { sampling.max_samples() } else { 4 };
    let more = count.saturating_mul(MORE).min(MAX_SAMPLES);
    let (noise, options) = match sampling.noise {
        Some(noise) => (Some(noise / 2.0), format!("--noise {} --samples {more}", noise / 2.0)),
        None => (None, format!("--samples {more}")),
    };
    let then = sampled(job, Sampling { samples: Some(more), noise, ..sampling })?;
    let many = more.saturating_mul(REFERENCE_TIMES).clamp(REFERENCE[0], REFERENCE[1].max(more));
    let many = Sampling { samples: Some(many), noise: None, seed: other_seed(sampling.seed), ..sampling };
    let reference_job = sampled(job, many)?;
    let reference = displayed(&reference_job, control)?;
    let name = if sampling.is_wanted() { "noise" } else { "one sample a pixel" };
    let mut errors = vec![PictureError {
        cause: name.into(),
        now: ErrorInSteps::between(own, &reference),
        options,
        then: ErrorInSteps::between(&displayed(&then, control)?, &reference),
        time: time_of([job, &then], control)?,
        note: String::new(),
    }];
    if job.plan.decisions.iter().any(|decision| decision.on && decision.effect == id::TEXTURES) {
        let bilinear = |job: &RenderJob| {
            let mut settings = job.plan_settings.clone();
            settings.with.push(id::TEXTURES.with_value(TextureFilter::Bilinear.name()));
            job.with_plan_settings(settings)
        };
        let unfiltered = bilinear(&reference_job)?;
        let error = PictureError {
            cause: "texture filter".into(),
            now: ErrorInSteps::between(&reference, &displayed(&unfiltered, control)?),
            options: format!("--with {}", id::TEXTURES.with_value(TextureFilter::Bilinear.name())),
            then: ErrorInSteps::default(),
            time: time_of([job, &bilinear(job)?], control)?,
            note: "averages texels by samples: more noise".into(),
        };
        errors.extend(Some(error).filter(PictureError::is_any));
    }
    Ok(errors)
}

/// Light that limits cut off: bounces of paths and of glaze, and the clamp.
fn bounces(job: &RenderJob, own: &[DVec3], control: &RenderControl) -> Result<Vec<PictureError>> {
    let with = |value: String| {
        let mut settings = job.plan_settings.clone();
        settings.with.push(value);
        settings
    };
    if job.plan.decisions.iter().any(|decision| decision.on && decision.effect == id::GLAZE) {
        let option = id::GLAZE.with_value("every-bounce");
        let all = job.with_plan_settings(with(option.clone()))?;
        let options = format!("--with {option}");
        let error = of_same_samples("bounces of glaze", &options, [job, &all], own, control)?;
        return Ok(Some(error).filter(PictureError::is_any).into_iter().collect());
    }
    let Some(LightLeftOut { by_depth, by_clamp }) = light_left_out::measure(job, control)? else {
        return Ok(Vec::new());
    };
    let sampling = job.plan_settings.sampling;
    let paired = sampling.part(0, sampling.samples_taken().min(MAX_PAIRED));
    let picture = sampled(job, paired)?;
    let unclamped =
        picture.with_plan_settings(PlanSettings { clamp: None, ..picture.plan_settings.clone() })?;
    let limits = job.plan.bounce_limits().doubled();
    let mut doubled =
        PlanSettings { sampling: paired, clamp: None, ..with(id::PATH.with_value(limits.depth)) };
    doubled.path.depth_specular = limits.specular;
    let doubled = job.with_plan_settings(doubled)?;
    let all = displayed(&without_limits(&picture)?, control)?;
    let note = |share: Share| format!("{share} of the light");
    let within = displayed(&unclamped, control)?;
    let mut errors = vec![PictureError {
        cause: format!("{} of paths", job.plan.bounce_limits()),
        now: ErrorInSteps::between(&within, &all),
        options: limits.options(),
        then: ErrorInSteps::between(&displayed(&doubled, control)?, &all),
        time: time_of([&unclamped, &doubled], control)?,
        note: note(by_depth),
    }];
    if job.plan_settings.clamp.is_some() {
        errors.push(PictureError {
            cause: "clamp".into(),
            now: ErrorInSteps::between(&displayed(&picture, control)?, &within),
            options: format!("--clamp {NO_CLAMP:e}"),
            then: ErrorInSteps::default(),
            time: time_of([&picture, &unclamped], control)?,
            note: note(by_clamp),
        });
    }
    errors.retain(PictureError::is_any);
    Ok(errors)
}

/// The rounding of display values to 8 bits; `None` where values have more.
fn rounding(
    job: &RenderJob,
    others: OtherJobs,
    own: &[DVec3],
    control: &RenderControl,
) -> Result<Option<PictureError>> {
    let Some(RoundingError { largest, text, option }) = job.rounding_error() else { return Ok(None) };
    let Some(largest) = largest else {
        let unrounded = others(None, Some(ColourPipeline::Display))?;
        let error = of_same_samples("8 bits", option, [job, &unrounded], own, control)?;
        return Ok(Some(PictureError { note: text.into(), ..error }));
    };
    // Rounding after noise of a triangular distribution two steps wide: the density of the error is the quadratic
    // B-spline, of which 1/24 lies beyond one step. Black and white are not dithered.
    let is_dithered = job.settings.picture.dither == Some(true);
    let stays =
        |value: f64| if (0.5 / 255.0..1.0 - 0.5 / 255.0).contains(&value) { 23.0 / 24.0 } else { 1.0 };
    let beyond = |pixel: &DVec3| 1.0 - pixel.to_array().map(stays).iter().product::<f64>();
    let beyond_step = match is_dithered {
        true => own.iter().map(beyond).sum::<f64>() / own.len().max(1) as f64,
        false => 0.0,
    };
    Ok(Some(PictureError {
        cause: "8 bits".into(),
        now: ErrorInSteps { beyond_step, largest },
        options: "--bits 16".into(),
        // 65,535 steps instead of 255.
        then: ErrorInSteps { beyond_step: 0.0, largest: largest / 257.0 },
        time: Quartiles::exact(1.0),
        note: if is_dithered { text.into() } else { String::new() },
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_in_steps_of_255() {
        let reference = [DVec3::ZERO, DVec3::splat(0.5), DVec3::ONE, DVec3::ONE];
        let picture = [
            DVec3::new(0.0, 2.0 / 255.0, 0.0),
            DVec3::splat(0.5),
            DVec3::splat(254.0 / 255.0),
            DVec3::new(1.0, 1.0, 1.0 - 40.0 / 255.0),
        ];
        let error = ErrorInSteps::between(&picture, &reference);
        // Two and forty steps are beyond one, a whole step is not.
        assert_eq!(error.beyond_step, 0.5);
        assert!((error.largest - 40.0).abs() < 1e-9);
        assert_eq!(error.text(), "50 % (40)");
        assert_eq!(ErrorInSteps::default().text(), "0 % (0)");
    }

    #[test]
    fn ratios_have_the_digits_of_their_spread() {
        let ratio = |lower, median, upper| ratio(&Quartiles { lower, median, upper });
        assert_eq!(ratio(2.1, 2.56, 3.1), "3");
        assert_eq!(ratio(2.5, 2.56, 2.6), "2.6");
        assert_eq!(ratio(13.9, 14.2, 14.6), "14");
        assert_eq!(ratio(1.0, 1.0, 1.0), "1.00");
    }
}
