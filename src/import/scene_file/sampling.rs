//! Sampling settings of the `[image]` section.

use std::fmt::Display;

use toml::Spanned;

use super::Builder;
use crate::error::Result;
use crate::scene::Sampling;
use crate::scene::file::ImageSection;

impl Builder<'_> {
    /// Converts and checks the sampling settings.
    pub(super) fn sampling(&self, image: &ImageSection) -> Result<Sampling> {
        let samples = self.checked(image.samples.as_ref(), "samples", Sampling::check_samples)?;
        let min_samples = self.checked(image.min_samples.as_ref(), "min_samples", Sampling::check_samples)?;
        if let (Some(least), Some(most)) = (min_samples, samples)
            && least > most
        {
            let start = image.min_samples.as_ref().map_or(0, |value| value.span().start);
            let what = format!("`min_samples` is {least}, and `samples` {most}");
            return Err(self.error(start, what, "give `min_samples` at most as many as `samples`"));
        }
        Ok(Sampling {
            samples,
            filter: image.filter,
            filter_radius: self.checked(
                image.filter_radius.as_ref(),
                "filter_radius",
                Sampling::check_radius,
            )?,
            noise: self.checked(image.noise.as_ref(), "noise", Sampling::check_noise)?,
            min_samples,
            first: None,
            total: None,
            seed: image.seed,
            sampler: image.sampler,
        })
    }

    /// Checks an optional value.
    pub(super) fn checked<T: Copy + Display, U>(
        &self,
        value: Option<&Spanned<T>>,
        key: &str,
        check: impl Fn(T) -> std::result::Result<U, String>,
    ) -> Result<Option<U>> {
        let Some(value) = value else { return Ok(None) };
        check(*value.get_ref())
            .map(Some)
            .map_err(|hint| self.error(value.span().start, format!("`{key}` is {}", value.get_ref()), &hint))
    }
}
