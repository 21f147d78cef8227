//! How often and where in its pixels a picture is looked at.

use crate::film::FilterShape;
use crate::film::filter::RADII;

/// The most samples a pixel can have: so many numbers its random sequence has.
pub const MOST_SAMPLES: u32 = 1 << 16;

/// Samples a pixel where a filter is asked for and no number of samples is.
const USUAL_SAMPLES: u32 = 16;

/// The most samples a pixel where a level of noise is given and no number of samples is.
const USUAL_MOST: u32 = 256;

/// The least error that can be asked for: what f32 makes of display values is not much better.
const LEAST_NOISE: f64 = 1e-6;

/// What is said of samples; what is `None` was not said.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sampling {
    /// Samples a pixel, 1 to 65536; the most of them where there is a `noise`.
    pub samples: Option<u32>,
    /// The filter that a pixel is seen through.
    pub filter: Option<FilterShape>,
    /// How far the filter reaches from the pixel's centre, in pixels.
    pub filter_radius: Option<f64>,
    /// The standard error of a pixel's displayed value, 1 being white, below which it is sampled no further.
    pub noise: Option<f64>,
    /// Samples that every pixel takes before its error is looked at.
    pub min_samples: Option<u32>,
    /// What the random numbers depend on besides pixel, sample and dimension.
    pub seed: Option<u32>,
    /// The first sample that is taken, below `samples`; those before it are another picture's. Not with `noise`.
    pub first: Option<u32>,
}

impl Sampling {
    /// These settings where they say something, the others' where not.
    pub fn or(self, other: Self) -> Self {
        Sampling {
            samples: self.samples.or(other.samples),
            filter: self.filter.or(other.filter),
            filter_radius: self.filter_radius.or(other.filter_radius),
            noise: self.noise.or(other.noise),
            min_samples: self.min_samples.or(other.min_samples),
            seed: self.seed.or(other.seed),
            first: self.first.or(other.first),
        }
    }

    /// Whether anything is asked for but one sample at each pixel's centre.
    pub fn is_wanted(&self) -> bool {
        let Sampling { samples, filter, filter_radius, noise, .. } = self;
        samples.is_some_and(|n| n > 1) || filter.is_some() || filter_radius.is_some() || noise.is_some()
    }

    /// Samples a pixel; the most of them where there is a `noise`.
    pub fn most_samples(&self) -> u32 {
        self.samples.unwrap_or(if self.noise.is_some() { USUAL_MOST } else { USUAL_SAMPLES })
    }

    /// The filter's shape and its radius in pixels.
    pub fn shape_and_radius(&self) -> (FilterShape, f64) {
        let shape = self.filter.unwrap_or_default();
        (shape, self.filter_radius.unwrap_or(shape.usual_radius()))
    }

    /// The same sampling, of the samples from one number up to another, the same for all pixels: of parts that follow on each
    /// other, the mean, weighted by their numbers, is that of all. Also one sample is one of the filter's and not the pixel's centre.
    pub fn part(&self, from: u32, to: u32) -> Sampling {
        let (shape, radius) = self.shape_and_radius();
        Sampling {
            samples: Some(to),
            first: Some(from),
            filter: Some(shape),
            filter_radius: Some(radius),
            noise: None,
            min_samples: None,
            seed: self.seed,
        }
    }

    /// What made a picture of more than its pixels' centres, for its metadata; nothing for others.
    pub fn settings(&self) -> Vec<(String, String)> {
        if !self.is_wanted() {
            return Vec::new();
        }
        let (shape, radius) = self.shape_and_radius();
        let mut settings = vec![
            ("kiln:samples".to_owned(), self.most_samples().to_string()),
            ("kiln:filter".into(), format!("{} {radius}", shape.name())),
            ("kiln:seed".into(), self.seed.unwrap_or(0).to_string()),
        ];
        settings.extend(self.noise.map(|level| ("kiln:noise".into(), level.to_string())));
        settings.extend(self.min_samples.map(|least| ("kiln:min-samples".into(), least.to_string())));
        settings
    }

    /// A number of samples a pixel; or which there may be.
    ///
    /// # Errors
    /// What to give instead.
    pub fn check_samples(samples: i64) -> Result<u32, String> {
        match u32::try_from(samples) {
            Ok(samples @ 1..=MOST_SAMPLES) => Ok(samples),
            _ => Err(format!("give a number of samples from 1 to {MOST_SAMPLES}")),
        }
    }

    /// A radius of a filter, in pixels; or which there may be.
    ///
    /// # Errors
    /// What to give instead.
    pub fn check_radius(radius: f64) -> Result<f64, String> {
        if RADII.contains(&radius) {
            return Ok(radius);
        }
        Err(format!("give a radius in pixels from {} to {}", RADII.start(), RADII.end()))
    }

    /// A level of noise, 1 being white; or which there may be.
    ///
    /// # Errors
    /// What to give instead.
    pub fn check_noise(level: f64) -> Result<f64, String> {
        if (LEAST_NOISE..=1.0).contains(&level) {
            return Ok(level);
        }
        Err("give a standard error from 0.000001 to 1, 1 being white; one step of 8 bits is 0.004".into())
    }
}
