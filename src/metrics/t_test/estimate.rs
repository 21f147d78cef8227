//! The estimates of a picture: for each pixel the mean of independent samples, their variance and their number.

use std::path::Path;

use crate::error::{Error, Result};
use crate::film::channels::ExrChannels;
use crate::film::{ColourPipeline, FilterShape};
use crate::scene::PixelSampler;

/// The names of the channels.
pub const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// How to write a picture that can be tested.
const HINT: &str =
    "write it by `kiln render --samples N --sampler independent --aov samples,variance`, N at least 2";

/// The mean and variance of each pixel's samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// For each channel, the mean of each pixel's samples, row by row from the top.
    pub means: [Vec<f32>; 3],
    /// The same for the unbiased variance of the samples.
    pub variances: [Vec<f32>; 3],
    /// The number of samples of each pixel, 2 or more.
    pub counts: Vec<f32>,
    /// The seed of its random numbers, if it is known.
    pub seed: Option<u32>,
}

impl Estimate {
    /// Reads the channels `R`, `G` and `B`, `Variance.R`, `.G` and `.B`, and `Samples.X` of an OpenEXR file.
    ///
    /// # Errors
    /// [`Error::Input`] if the file cannot be read, a channel is missing or has impossible values, or its settings say that its
    /// samples are not independent and equally distributed linear light.
    pub fn open(file: &Path) -> Result<Self> {
        Self::of(&ExrChannels::open(file)?).map_err(|what| Error::input(file, what, HINT))
    }

    fn of(channels: &ExrChannels) -> std::result::Result<Self, String> {
        check_settings(channels)?;
        let estimate = Self::unchecked(channels)?;
        estimate.check_values()?;
        Ok(estimate)
    }

    /// The channels of a picture, without checks of settings and values. An error names a missing channel.
    pub fn unchecked(channels: &ExrChannels) -> std::result::Result<Self, String> {
        let channel = |name: &str| match channels.channel(name) {
            Some(values) => Ok(values.to_vec()),
            None => Err(format!("without the channel `{name}`, which a t-test needs")),
        };
        let all = |prefix: &str| -> std::result::Result<[Vec<f32>; 3], String> {
            let [r, g, b] = CHANNELS.map(|name| channel(&format!("{prefix}{name}")));
            Ok([r?, g?, b?])
        };
        Ok(Estimate {
            width: channels.width,
            height: channels.height,
            means: all("")?,
            variances: all("Variance.")?,
            counts: channel("Samples.X")?,
            seed: channels.setting("kiln:seed").and_then(|seed| seed.parse().ok()),
        })
    }

    /// The column and row of a pixel.
    fn position(&self, pixel: usize) -> (u32, u32) {
        (pixel as u32 % self.width, pixel as u32 / self.width)
    }

    fn check_values(&self) -> std::result::Result<(), String> {
        if let Some(pixel) = self.counts.iter().position(|count| !(2.0..1e9).contains(count)) {
            let (place, count) = (self.position(pixel), self.counts[pixel]);
            return Err(format!(
                "{count} sample(s) of the pixel at {place:?}, and a variance takes 2 or more"
            ));
        }
        for (name, (means, variances)) in CHANNELS.iter().zip(self.means.iter().zip(&self.variances)) {
            if let Some(pixel) = means.iter().position(|mean| !mean.is_finite()) {
                return Err(format!("not finite at {:?} in `{name}`", self.position(pixel)));
            }
            if let Some(pixel) =
                variances.iter().position(|variance| !(0.0..f32::INFINITY).contains(variance))
            {
                let (place, variance) = (self.position(pixel), variances[pixel]);
                return Err(format!("a variance of {variance} at {place:?} in `Variance.{name}`"));
            }
        }
        Ok(())
    }
}

/// Checks the settings of kiln; those of other programs are not known.
fn check_settings(channels: &ExrChannels) -> std::result::Result<(), String> {
    let is_linear = |colour: &str| colour == ColourPipeline::Linear.name();
    if let Some(colour) = channels.setting("kiln:colour").filter(|colour| !is_linear(colour)) {
        return Err(format!(
            "clamped values of `--colour {colour}`, whose means differ though the light does not"
        ));
    }
    if channels.setting("kiln:noise").is_some() {
        return Err("sampled with `--noise`, so the number of samples depends on their values".into());
    }
    let filter = channels.setting("kiln:filter").unwrap_or_default();
    if filter.split(' ').next() == Some(FilterShape::Mitchell.name()) {
        return Err(
            "seen through a filter with negative lobes, so pixels are not the mean of their samples".into()
        );
    }
    let is_kilns = channels.setting("kiln:samples").is_some();
    if is_kilns && channels.setting("kiln:sampler") != Some(PixelSampler::Independent.name()) {
        return Err("its samples are not independent (`--sampler sobol`)".into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channels(settings: &[(&str, &str)]) -> ExrChannels {
        let names = ["R", "G", "B", "Variance.R", "Variance.G", "Variance.B", "Samples.X"];
        ExrChannels {
            width: 2,
            height: 1,
            channels: names.iter().map(|&name| (name.to_owned(), vec![2.0, 3.0])).collect(),
            settings: settings.iter().map(|&(key, value)| (key.into(), value.into())).collect(),
        }
    }

    #[test]
    fn what_cannot_be_tested_is_refused_with_the_reason() {
        let own = [("kiln:samples", "8"), ("kiln:filter", "gaussian 1.5"), ("kiln:sampler", "independent")];
        assert!(Estimate::of(&channels(&own)).is_ok() && Estimate::of(&channels(&[])).is_ok());
        let with = |key, value| Estimate::of(&channels(&[&own[..], &[(key, value)]].concat()));
        assert!(with("kiln:noise", "0.01").is_err_and(|what| what.contains("--noise")));
        for (channel, value, part) in [
            (6, 1.0, "1 sample(s) of the pixel at (1, 0)"),
            (6, f32::NAN, "NaN sample(s)"),
            (0, f32::INFINITY, "not finite at (1, 0) in `R`"),
            (4, -0.5, "a variance of -0.5 at (1, 0) in `Variance.G`"),
            (5, f32::INFINITY, "a variance of inf"),
        ] {
            let mut broken = channels(&own);
            broken.channels[channel].1[1] = value;
            let result = Estimate::of(&broken);
            assert!(result.as_ref().is_err_and(|what| what.contains(part)), "{result:?}");
        }
    }
}
