//! Results of a study, as in its JSON and CSV files.

use serde::{Deserialize, Serialize};

use super::advice::{Advice, ParameterStep};
use crate::bench::ResultFile;
use crate::bench::errors::PictureError;
use crate::timing::Quartiles;
use kiln::metrics::Figures;
use kiln::metrics::t_test::TTest;

/// Version of the JSON schema, incremented when a field is removed or changes its meaning.
pub(crate) const SCHEMA: u32 = 3;

/// Results of a study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Study {
    /// Schema, version, scene, command line and machine.
    #[serde(flatten)]
    pub envelope: ResultFile,
    /// Metadata of the pictures, as names and values.
    pub settings: Vec<[String; 2]>,
    /// Width and height of the pictures in pixels.
    pub size: [u32; 2],
    /// Timing rounds.
    pub rounds: u32,
    /// Number of threads during timing.
    pub threads: usize,
    /// Clock: `processor` or `wall`.
    pub clock: String,
    /// Time for reading the inputs in ms, unless they come from standard input.
    pub load_ms: Option<Quartiles>,
    /// Noise of the references, one per filter.
    pub floors: Vec<NoiseFloor>,
    /// Differences in ray hits between each tier and `exact`.
    pub geometry: Vec<GeometryErrors>,
    /// Errors of the picture by their causes, which the command measures as `kiln explain` does; may be empty.
    #[serde(default)]
    pub errors: Vec<PictureError>,
    /// Render time of the limit of the base's filter in ms; `None` if there is no limit.
    #[serde(default)]
    pub limit_ms: Option<f64>,
    /// Options of `kiln render` for a picture like the limit; `None` if there are none.
    #[serde(default)]
    pub limit_options: Option<String>,
    /// The command line of `kiln render` with the study's inputs and options, in words.
    #[serde(default)]
    pub render_command: Vec<String>,
    /// One row per setting.
    pub rows: Vec<SettingRow>,
    /// Parameters without effect on the scene, with the reason.
    pub left_out: Vec<[String; 2]>,
    /// The fastest settings below error bounds.
    pub advice: Vec<Advice>,
    /// Comparisons of adjacent settings.
    pub steps: Vec<ParameterStep>,
    /// Tests of the techniques of direct light in path tracing.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub technique_tests: Vec<TechniqueTest>,
}

impl Study {
    /// Noise of the limit of the base's filter; 0 if there is no limit.
    pub fn noise_floor(&self) -> f64 {
        self.floors.first().map_or(0.0, |floor| floor.rmse)
    }

    /// The command line that renders with the study's options and `options` of a setting.
    pub fn command_with(&self, options: &str) -> String {
        let own: Vec<&str> = options.split_whitespace().collect();
        let is_repeatable = |name: &str| name == "--with" || name == "--without";
        let mut words: Vec<&str> = Vec::new();
        let mut given = self.render_command.iter().map(String::as_str);
        while let Some(word) = given.next() {
            let (name, value) =
                word.split_once('=').map_or((word, None), |(name, value)| (name, Some(value)));
            if !name.starts_with("--") || is_repeatable(name) || !own.contains(&name) {
                words.push(word);
            } else if value.is_none() {
                given.next();
            }
        }
        words.extend(own);
        words.join(" ")
    }
}

/// A t-test of a technique of direct light against multiple importance sampling.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TechniqueTest {
    /// Name of the technique; `control` for multiple importance sampling with another seed.
    pub name: String,
    /// Samples per pixel of both pictures.
    pub samples: u32,
    /// The result.
    #[serde(flatten)]
    pub test: TTest,
}

/// Noise of a converged reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NoiseFloor {
    /// Name of the reconstruction filter.
    pub filter: String,
    /// Samples per pixel, both halves together.
    pub samples: u32,
    /// Standard error, RMS over channels and pixels: half the RMS difference of the two halves.
    pub rmse: f64,
    /// Maximum number of bounces, where paths are traced.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bounces: Option<u32>,
}

/// Kind of reference picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ReferenceKind {
    /// Converged picture in `exact`: the reference for sampling parameters.
    Limit,
    /// Picture in `exact` at the same sample points: the reference for all other parameters.
    #[serde(rename = "twin")]
    SameSamples,
}

/// Whether an error can be distinguished from the noise of the reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Significance {
    /// It is at least ten times the noise of the reference.
    Significant,
    /// It is smaller: the true error is between 0 and about this value.
    Insignificant,
}

/// Times, sizes and errors of a setting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SettingRow {
    /// Index of the row.
    pub id: usize,
    /// Name of the varied parameter.
    pub parameter: String,
    /// Value of the parameter.
    pub setting: String,
    /// Whether this is the base setting.
    pub base: bool,
    /// Options of `kiln render` that give this picture, in addition to the options of the study. An option replaces a
    /// given one of the same name.
    pub options: String,
    /// Whether such options exist; not every parameter has one.
    pub has_options: bool,
    /// Whether an effect of the base is turned off.
    #[serde(default)]
    pub has_effect_off: bool,
    /// Numerics tier.
    pub numerics: String,
    /// Layout of the acceleration structure.
    pub layout: String,
    /// Build preset; `None` for brute force.
    pub preset: Option<String>,
    /// Colour pipeline.
    pub colour: String,
    /// Reconstruction filter and its radius in pixels.
    pub filter: String,
    /// Time for preparing the scene, including the acceleration structure, in ms.
    pub build_ms: Quartiles,
    /// Render time in ms.
    pub trace_ms: Quartiles,
    /// Number of rays of all kinds.
    pub rays: u64,
    /// Number of primary rays.
    pub primary_rays: u64,
    /// Average number of primary rays per pixel.
    pub samples_per_pixel: f64,
    /// Size of the acceleration structure in bytes.
    pub structure_bytes: usize,
    /// Maximum size of a thread's tile buffers in bytes; depends on the number of threads.
    pub tile_bytes: usize,
    /// Reference for the error of this parameter.
    pub reference: ReferenceKind,
    /// Number of non-finite pixels. If there are any, there are no errors.
    pub non_finite: usize,
    /// Errors against the limit.
    pub limit: Option<Figures>,
    /// Whether the error against the limit exceeds the noise of the limit.
    pub significance: Significance,
    /// Errors against the twin.
    pub twin: Option<Figures>,
    /// Hash of the picture's bits.
    pub fingerprint: String,
}

impl SettingRow {
    /// Errors against the reference for this parameter.
    pub fn errors(&self) -> Option<&Figures> {
        match self.reference {
            ReferenceKind::Limit => self.limit.as_ref(),
            ReferenceKind::SameSamples => self.twin.as_ref(),
        }
    }

    /// Parameter and setting in a few words.
    pub fn name(&self) -> String {
        format!("{}: {}", self.parameter, self.setting)
    }
}

/// Differences in ray hits between a tier and `exact`, for the rays through the pixel centres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GeometryErrors {
    /// Numerics tier.
    pub numerics: String,
    /// Number of rays.
    pub rays: u64,
    /// Rays that hit where `exact` misses.
    pub false_hits: u64,
    /// Rays that miss where `exact` hits.
    pub false_misses: u64,
    /// Rays that hit another primitive than in `exact`.
    pub wrong_primitives: u64,
    /// Hits with a non-finite distance or normal; excluded from the errors below.
    pub non_finite: u64,
    /// Errors of the distance of equal hits in f32 ulp: median, 99.9 % quantile, maximum; `None` without hits.
    pub t_ulps: Option<[f64; 3]>,
    /// Angles between the geometric normals of equal hits in degrees: the same quantiles.
    pub normal_degrees: Option<[f64; 3]>,
    /// Leaking rays per million from inside the scene's closed meshes; `None` without such meshes.
    pub leaks_per_million: Option<f64>,
    /// Number of rays cast inside closed meshes.
    pub leak_rays: u64,
}

impl GeometryErrors {
    /// `count` of the rays, per million.
    pub(crate) fn per_million(&self, count: u64) -> f64 {
        count as f64 * 1e6 / self.rays.max(1) as f64
    }
}
