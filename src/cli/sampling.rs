//! Sampling options of `kiln render`.

use clap::Args;

use super::numbers::number;
use crate::effects::{EffectId, id};
use crate::error::Warnings;
use crate::film::FilterShape;
use crate::sample_count::{ErrorTarget, Metric};
use crate::scene::{PixelSampler, Sampling};

#[derive(Args, Clone)]
pub(crate) struct SamplingArguments {
    /// Samples a pixel; with --noise the most of them [default: the scene's, or 1 at the pixel's centre]
    #[arg(long, allow_hyphen_values = true, value_name = "N", value_parser = parse_samples)]
    samples: Option<u32>,
    /// The filter that pixels are seen through [default: the scene's, or gaussian]
    #[arg(long, value_name = "FILTER", value_parser = FilterShape::ALL.map(FilterShape::name))]
    filter: Option<String>,
    /// How far the filter reaches from a pixel's centre, in pixels [default: box 0.5, tent 1, gaussian 1.5, mitchell 2]
    #[arg(long, allow_hyphen_values = true, value_name = "PIXELS", value_parser = |text: &str| number(text, "a radius in pixels").and_then(Sampling::check_radius))]
    filter_radius: Option<f64>,
    /// Sample a pixel no further once the standard error of its displayed value is below this; 1 is white
    #[arg(long, allow_hyphen_values = true, value_name = "LEVEL", value_parser = |text: &str| number(text, "a standard error, such as 0.01").and_then(Sampling::check_noise))]
    noise: Option<f64>,
    /// Samples that every pixel takes before --noise may end it [default: the scene's, or 4]
    #[arg(long, allow_hyphen_values = true, value_name = "N", value_parser = parse_samples)]
    min_samples: Option<u32>,
    /// What random numbers depend on besides pixel, sample and dimension [default: the scene's, or 0]
    #[arg(long, allow_hyphen_values = true, value_name = "N", value_parser = super::numbers::whole(0..=u32::MAX))]
    seed: Option<u32>,
    /// How the samples of a pixel are related: independent ones are for statistics, such as those of
    /// `kiln compare --t-test`, and converge more slowly [default: the scene's, or sobol]
    #[arg(long, value_name = "SAMPLER", value_parser = PixelSampler::ALL.map(PixelSampler::name))]
    sampler: Option<String>,
}

/// Options of `kiln render` with which the number of samples is chosen automatically.
#[derive(Args)]
pub(crate) struct AccuracyArguments {
    /// As many samples as it takes for FLIP, RMSE or MAX (of displayed values, 1 is white) to the truth to be below a
    /// value: the truth is the antialiased picture, that of ever more samples
    #[arg(long, allow_hyphen_values = true, value_name = "METRIC=VALUE", value_parser = parse_accuracy, conflicts_with_all = ["samples", "noise", "min_samples", "aov"])]
    accuracy: Option<(Metric, f64)>,
    /// As many samples as fit into so many seconds of rendering; with --accuracy no more than it needs
    #[arg(long, allow_hyphen_values = true, value_name = "SECONDS", value_parser = parse_seconds, conflicts_with_all = ["samples", "noise", "min_samples", "aov"])]
    budget: Option<f64>,
}

impl AccuracyArguments {
    /// The requested accuracy or budget.
    pub(crate) fn target(&self) -> Option<ErrorTarget> {
        let has_target = self.accuracy.is_some() || self.budget.is_some();
        has_target.then_some(ErrorTarget { accuracy: self.accuracy, seconds: self.budget })
    }
}

fn parse_accuracy(text: &str) -> Result<(Metric, f64), String> {
    let form = || "give it as FLIP=0.01, RMSE=0.005 or MAX=0.05".to_owned();
    let (name, value) = text.split_once('=').ok_or_else(form)?;
    let metric =
        Metric::ALL.into_iter().find(|m| m.name().eq_ignore_ascii_case(name.trim())).ok_or_else(form)?;
    match value.trim().parse::<f64>() {
        Ok(value) if value > 0.0 && value <= 1.0 => Ok((metric, value)),
        _ => Err(format!("`{value}` is not a number above 0, up to 1")),
    }
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds.is_finite() => Ok(seconds),
        _ => Err("give a number of seconds above 0".into()),
    }
}

fn parse_samples(text: &str) -> Result<u32, String> {
    // 0 is rejected with the message for values out of range.
    Sampling::check_samples(text.trim().parse().unwrap_or(0))
}

impl SamplingArguments {
    /// The sampling settings as typed.
    pub(crate) fn settings(&self) -> Sampling {
        let shape = |name: &String| FilterShape::ALL.into_iter().find(|shape| shape.name() == name);
        let sampler = |name: &String| PixelSampler::ALL.into_iter().find(|sampler| sampler.name() == name);
        Sampling {
            samples: self.samples,
            filter: self.filter.as_ref().and_then(shape),
            filter_radius: self.filter_radius,
            noise: self.noise,
            min_samples: self.min_samples,
            seed: self.seed,
            sampler: self.sampler.as_ref().and_then(sampler),
            first: None,
            total: None,
        }
    }

    /// Warns about typed options that do not affect a picture with the settings `sampling`. With `has_target`, the
    /// number of samples is chosen automatically, so `--seed` has an effect.
    pub(crate) fn warn_of_unused(
        &self,
        sampling: &Sampling,
        without: &[String],
        has_target: bool,
        warnings: &mut Warnings,
    ) {
        let is_without = |effect: EffectId| without.iter().any(|name| *name == effect.name());
        if is_without(id::ANTIALIASING) {
            let typed = [
                ("--samples", self.samples.is_some_and(|samples| samples > 1)),
                ("--filter", self.filter.is_some()),
                ("--filter-radius", self.filter_radius.is_some()),
                ("--noise", self.noise.is_some()),
                ("--min-samples", self.min_samples.is_some()),
                ("--seed", self.seed.is_some()),
                ("--sampler", self.sampler.is_some()),
            ];
            for (option, _) in typed.iter().filter(|(_, typed)| *typed) {
                warnings.push(format!("{option} changes nothing: there is no antialiasing"));
            }
            return;
        }
        if self.noise.is_some() && is_without(id::ADAPTIVE) {
            warnings.push("--noise changes nothing: every pixel takes all samples without adaptive");
        }
        if self.min_samples.is_some() && sampling.noise.is_none() {
            warnings.push("--min-samples changes nothing: without --noise every pixel takes all samples");
        }
        if self.seed.is_some() && !sampling.is_wanted() && !has_target {
            warnings.push(
                "--seed changes nothing: one sample a pixel, through its centre; --samples asks for more",
            );
        }
    }
}
