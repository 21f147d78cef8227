//! Sampling settings: sample count, reconstruction filter, adaptive sampling and seed.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::film::FilterShape;

/// Maximum number of samples per pixel: the length of a pixel's random sequence.
pub const MAX_SAMPLES: u32 = 1 << 16;

/// Default number of samples per pixel if a filter is given.
const DEFAULT_SAMPLES: u32 = 16;

/// Default maximum number of samples per pixel if a noise threshold is given.
const DEFAULT_MAX_SAMPLES: u32 = 256;

/// Default samples per pixel before adaptive sampling estimates the error. With its neighbours a pixel then has 36 samples
/// in three by three pixels, which few edges pass between.
const DEFAULT_MIN_SAMPLES: u32 = 4;

/// The samples per pixel that texture footprints are computed for where a picture is rendered in parts
/// ([`Sampling::part`]) and the total is not known. Fewer would blur textures, which no noise estimate detects.
const SAMPLES_OF_PARTS: u32 = 64;

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

names!(PixelSampler { Sobol = "sobol", Independent = "independent" });

/// Sampling settings of a render: those of [`crate::scene::PictureSettings`], and the part of them that it takes. `None` means
/// not given.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
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
    pub seed: u32,
    /// How the samples of a pixel are related.
    pub sampler: PixelSampler,
    /// Index of the first sample, below `samples`, if another render takes those before it. Not with `noise`.
    pub first: Option<u32>,
    /// Samples per pixel of the whole picture, if these are a part of it: the rays and texture footprints of a sample depend
    /// on it. `samples` if not given.
    pub total: Option<u32>,
}

impl Sampling {
    /// Whether the settings differ from one sample at each pixel's centre.
    pub fn is_wanted(&self) -> bool {
        let Sampling { samples, filter, filter_radius, noise, .. } = self;
        samples.is_some_and(|n| n > 1) || filter.is_some() || filter_radius.is_some() || noise.is_some()
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

    /// Samples per pixel before adaptive sampling estimates the error.
    pub fn min_samples(&self) -> u32 {
        self.min_samples.unwrap_or(DEFAULT_MIN_SAMPLES).clamp(1, self.max_samples())
    }

    /// Index of the first sample.
    pub fn first_sample(&self) -> u32 {
        self.first.unwrap_or(0)
    }

    /// Samples per pixel that texture footprints are computed for.
    pub fn samples_of_footprints(&self) -> u32 {
        let least = if self.first.is_some() { SAMPLES_OF_PARTS } else { 1 };
        self.total.unwrap_or_else(|| self.max_samples().max(least))
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
            ..*self
        }
    }
}
