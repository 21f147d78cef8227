//! Sampling options of `kiln render`.

use clap::Args;

use crate::sample_count::{ErrorTarget, Metric};
use kiln::scene::option::group;

/// Options of `kiln render` with which the number of samples is chosen automatically.
#[derive(Args, Clone)]
pub(crate) struct AccuracyArguments {
    /// Sample until the estimated error is below a value: FLIP, RMSE or MAX of displayed values (1 is white) against the
    /// converged picture
    #[arg(long, help_heading = group::QUALITY, display_order = 2, allow_hyphen_values = true, value_name = "METRIC=VALUE", value_parser = parse_accuracy, conflicts_with_all = ["samples", "noise", "min_samples", "aov"])]
    accuracy: Option<(Metric, f64)>,
    /// Sample for this time in seconds; with --accuracy, stop early where its error is reached
    #[arg(long, help_heading = group::QUALITY, display_order = 2, allow_hyphen_values = true, value_name = "SECONDS", value_parser = parse_seconds, conflicts_with_all = ["samples", "noise", "min_samples", "aov"])]
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
