//! Sampling settings: sample count, reconstruction filter, adaptive sampling and seed.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::film::FilterShape;
use crate::film::filter::RADII;

/// Maximum number of samples per pixel: the length of a pixel's random sequence.
pub const MAX_SAMPLES: u32 = 1 << 16;

/// Default number of samples per pixel if a filter is given.
const DEFAULT_SAMPLES: u32 = 16;

/// Default maximum number of samples per pixel if a noise threshold is given.
const DEFAULT_MAX_SAMPLES: u32 = 256;

/// Smallest noise threshold; f32 display values are not much more accurate.
const MIN_NOISE: f64 = 1e-6;

/// How the random numbers of a pixel's samples are related.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum PixelSampler {
    /// Owen-scrambled Sobol points: evenly distributed, so the mean converges faster, but samples depend on each other.
    #[default]
    Sobol,
    /// Independent uniform numbers, for statistics that assume independent samples.
    Independent,
}

impl PixelSampler {
    /// Every sampler.
    pub const ALL: [PixelSampler; 2] = [PixelSampler::Sobol, PixelSampler::Independent];

    /// The name as typed by users.
    pub fn name(self) -> &'static str {
        match self {
            PixelSampler::Sobol => "sobol",
            PixelSampler::Independent => "independent",
        }
    }
}

/// Sampling settings; `None` means not given.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sampling {
    /// Samples per pixel, 1 to 65536; with `noise`, the maximum.
    pub samples: Option<u32>,
    /// Shape of the reconstruction filter.
    pub filter: Option<FilterShape>,
    /// Radius of the filter in pixels.
    pub filter_radius: Option<f64>,
    /// Noise threshold of adaptive sampling: a pixel is sampled until the standard error of its displayed value (1 is
    /// white) is below this.
    pub noise: Option<f64>,
    /// Samples per pixel before adaptive sampling estimates the error.
    pub min_samples: Option<u32>,
    /// Seed of the random numbers, besides pixel, sample and dimension.
    pub seed: Option<u32>,
    /// How the samples of a pixel are related.
    pub sampler: Option<PixelSampler>,
    /// Index of the first sample, below `samples`, if another render takes those before it. Not with `noise`.
    pub first: Option<u32>,
    /// Samples per pixel of the whole picture, if these are a part of it: the rays and texture footprints of a sample depend
    /// on it. `samples` if not given.
    pub total: Option<u32>,
}

impl Sampling {
    /// Merges two sets of settings; those of `self` take precedence.
    pub fn or(self, other: Self) -> Self {
        Sampling {
            samples: self.samples.or(other.samples),
            filter: self.filter.or(other.filter),
            filter_radius: self.filter_radius.or(other.filter_radius),
            noise: self.noise.or(other.noise),
            min_samples: self.min_samples.or(other.min_samples),
            seed: self.seed.or(other.seed),
            sampler: self.sampler.or(other.sampler),
            first: self.first.or(other.first),
            total: self.total.or(other.total),
        }
    }

    /// Whether the settings differ from one sample at each pixel's centre.
    pub fn is_wanted(&self) -> bool {
        let Sampling { samples, filter, filter_radius, noise, .. } = self;
        samples.is_some_and(|n| n > 1) || filter.is_some() || filter_radius.is_some() || noise.is_some()
    }

    /// Whether the settings say how many samples are taken or how they are filtered.
    pub fn says_quality(&self) -> bool {
        let Sampling { samples, filter, filter_radius, noise, min_samples, .. } = self;
        samples.or(*min_samples).is_some() || filter.is_some() || filter_radius.or(*noise).is_some()
    }

    /// Samples per pixel; with `noise`, the maximum. At least 1.
    pub fn max_samples(&self) -> u32 {
        let default = if self.noise.is_some() { DEFAULT_MAX_SAMPLES } else { DEFAULT_SAMPLES };
        self.samples.unwrap_or(default).max(1)
    }

    /// Samples per pixel that are taken, at most: 1 without antialiasing.
    pub fn samples_taken(&self) -> u32 {
        if self.is_wanted() { self.max_samples() } else { 1 }
    }

    /// Shape and radius in pixels of the filter.
    pub fn shape_and_radius(&self) -> (FilterShape, f64) {
        let shape = self.filter.unwrap_or_default();
        (shape, self.filter_radius.unwrap_or(shape.default_radius()))
    }

    /// Sampling of the samples `from..to` of these settings, the same for all pixels: the mean of consecutive parts,
    /// weighted by their sample counts, is that of the whole. A single sample is also placed by the filter, not at the
    /// pixel's centre.
    pub fn part(&self, from: u32, to: u32) -> Sampling {
        let (shape, radius) = self.shape_and_radius();
        Sampling {
            samples: Some(to),
            first: Some(from),
            total: self.total.or(self.samples),
            filter: Some(shape),
            filter_radius: Some(radius),
            noise: None,
            min_samples: None,
            seed: self.seed,
            sampler: self.sampler,
        }
    }

    /// Sampling metadata of a picture; empty for one sample at each pixel's centre.
    pub fn settings(&self) -> Vec<(String, String)> {
        if !self.is_wanted() {
            return Vec::new();
        }
        let (shape, radius) = self.shape_and_radius();
        let mut settings = vec![
            ("kiln:samples".to_owned(), self.max_samples().to_string()),
            ("kiln:filter".into(), format!("{} {radius}", shape.name())),
            ("kiln:seed".into(), self.seed.unwrap_or(0).to_string()),
        ];
        let sampler = self.sampler.filter(|&sampler| sampler != PixelSampler::default());
        settings.extend(sampler.map(|sampler| ("kiln:sampler".into(), sampler.name().into())));
        settings.extend(self.noise.map(|level| ("kiln:noise".into(), level.to_string())));
        settings.extend(self.min_samples.map(|least| ("kiln:min-samples".into(), least.to_string())));
        settings
    }

    /// Checks a number of samples per pixel.
    ///
    /// # Errors
    /// A message that states the valid range.
    pub fn check_samples(samples: i64) -> Result<u32, String> {
        match u32::try_from(samples) {
            Ok(samples @ 1..=MAX_SAMPLES) => Ok(samples),
            _ => Err(format!("give a number of samples from 1 to {MAX_SAMPLES}")),
        }
    }

    /// Checks a filter radius in pixels.
    ///
    /// # Errors
    /// A message that states the valid range.
    pub fn check_radius(radius: f64) -> Result<f64, String> {
        if RADII.contains(&radius) {
            return Ok(radius);
        }
        Err(format!("give a radius in pixels from {} to {}", RADII.start(), RADII.end()))
    }

    /// Checks a noise threshold; 1 is white.
    ///
    /// # Errors
    /// A message that states the valid range.
    pub fn check_noise(level: f64) -> Result<f64, String> {
        if (MIN_NOISE..=1.0).contains(&level) {
            return Ok(level);
        }
        Err("give a standard error from 0.000001 to 1, 1 being white; one step of 8 bits is 0.004".into())
    }
}
