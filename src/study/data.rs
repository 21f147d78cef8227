//! What a study found, as plain data: what its JSON and its CSV hold, and what every plot is made from.

use serde::{Deserialize, Serialize};

use super::advice::{Advice, Step};
use super::errors::PictureErrors;
use crate::bench::Spread;

/// The version of the JSON's schema; it goes up when a field changes its meaning or goes.
pub const SCHEMA: u32 = 1;

/// A whole study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Study {
    /// The version of the schema.
    pub schema: u32,
    /// kiln's version.
    pub kiln: String,
    /// What was studied, such as the names of the inputs.
    pub subject: String,
    /// The command that made it.
    pub command: String,
    /// Where it was made, as names and values.
    pub machine: Vec<[String; 2]>,
    /// What made the pictures, as names and values.
    pub settings: Vec<[String; 2]>,
    /// Width and height of the pictures, in pixels.
    pub size: [u32; 2],
    /// How often everything was timed, after a round to warm up.
    pub rounds: u32,
    /// Threads that were timed.
    pub threads: usize,
    /// What the clock went by: `processor` or `wall`.
    pub clock: String,
    /// Reading the inputs, where they can be read again.
    pub load_ms: Option<Quartiles>,
    /// Errors of the references themselves.
    pub floors: Vec<Floor>,
    /// What each tier decides otherwise than `exact`.
    pub geometry: Vec<Geometry>,
    /// What was varied.
    pub rows: Vec<Row>,
    /// Knobs that were left out, each with the reason.
    pub left_out: Vec<[String; 2]>,
    /// For an error below so much, what is cheapest.
    pub advice: Vec<Advice>,
    /// What one step along a knob costs and buys.
    pub steps: Vec<Step>,
}

/// Quartiles of repeated measurements.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Quartiles {
    /// A quarter of the measurements is not above it.
    pub lower: f64,
    /// Half of them.
    pub median: f64,
    /// Three quarters of them.
    pub upper: f64,
}

impl Quartiles {
    /// Of measurements in any order. `None` where there are none.
    pub fn of(measurements: &[f64]) -> Option<Self> {
        let Spread { lower, median, upper } = Spread::of(measurements)?;
        Some(Quartiles { lower, median, upper })
    }

    /// Whether one lies apart from the other, quartile from quartile.
    pub fn is_apart_from(&self, other: &Self) -> bool {
        self.lower > other.upper || other.lower > self.upper
    }
}

/// A reference, and how far it may be from what it stands for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Floor {
    /// The filter that pixels are seen through.
    pub filter: String,
    /// Samples a pixel, both halves together.
    pub samples: u32,
    /// The standard error of a channel of a pixel, root mean square over the picture: half the difference of its two halves.
    pub rmse: f64,
}

/// What errors are measured against.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Judge {
    /// The picture of so many samples that more would change little: what sampling is judged by.
    Limit,
    /// `exact` at the same sample points: what everything else is judged by, so that only the knob differs.
    Twin,
}

/// Whether an error can be told from that of the reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Told {
    /// It is ten times the reference's own and more, or the reference has none.
    Apart,
    /// It is not: the true error may be anything up to about it.
    Within,
}

/// A setting, what it costs, and what it gets wrong.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Its number, from 0.
    pub id: usize,
    /// What was varied: the name of the knob.
    pub knob: String,
    /// What it was set to.
    pub setting: String,
    /// Whether it is the picture as it was asked for.
    pub base: bool,
    /// The options of `kiln render` that make this picture beside those that were given; one of the same name takes the place of
    /// one that was given.
    pub options: String,
    /// Whether they do: not everything that is varied has an option.
    pub has_options: bool,
    /// The tier of numerics.
    pub numerics: String,
    /// The acceleration structure.
    pub layout: String,
    /// How it was built; missing where there is nothing to build.
    pub preset: Option<String>,
    /// The colour pipeline.
    pub colour: String,
    /// The filter that its pixels, and its limit, are seen through, with its radius.
    pub filter: String,
    /// Building the structure and preparing the scene.
    pub build_ms: Quartiles,
    /// Making the picture.
    pub trace_ms: Quartiles,
    /// Rays of all kinds.
    pub rays: u64,
    /// Of them, those from the camera.
    pub primary_rays: u64,
    /// Of these, how many go through a pixel on average.
    pub samples_per_pixel: f64,
    /// Bytes of the structure.
    pub structure_bytes: usize,
    /// Bytes that a thread's tile holds at most; which tiles that are depends on the threads.
    pub tile_bytes: usize,
    /// Which of the two errors counts.
    pub judge: Judge,
    /// Pixels that are no finite numbers. Where there are any, there is no error: nothing measured it would mean anything.
    pub non_finite: usize,
    /// Against the limit.
    pub limit: Option<PictureErrors>,
    /// Whether the error against the limit can be told from the limit's own.
    pub told: Told,
    /// Against the twin.
    pub twin: Option<PictureErrors>,
    /// A hash of the picture's bits.
    pub fingerprint: String,
}

impl Row {
    /// The errors that count for this knob.
    pub fn errors(&self) -> Option<&PictureErrors> {
        match self.judge {
            Judge::Limit => self.limit.as_ref(),
            Judge::Twin => self.twin.as_ref(),
        }
    }

    /// Knob and setting in a few words.
    pub fn name(&self) -> String {
        format!("{}: {}", self.knob, self.setting)
    }
}

/// What a tier decides otherwise than `exact`, about the rays through the centres of a picture's pixels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Geometry {
    /// The tier.
    pub numerics: String,
    /// How many rays.
    pub rays: u64,
    /// Rays that hit where `exact` misses.
    pub false_hits: u64,
    /// Rays that miss where `exact` hits.
    pub false_misses: u64,
    /// Rays that hit something else than `exact` does.
    pub wrong_primitives: u64,
    /// Hits whose distance or normal is no finite number; they are left out of what follows.
    pub non_finite: u64,
    /// Errors of the distance where both hit the same, in units of the last place of f32: median, 99.9th percentile, worst.
    /// Missing where no ray hits.
    pub t_ulps: Option<[f64; 3]>,
    /// Angles between the geometric normals there, in degrees: the same.
    pub normal_degrees: Option<[f64; 3]>,
    /// Rays of a million that slip out of the scene's closed meshes; missing where there is none.
    pub leaks_per_million: Option<f64>,
    /// How many rays were cast to find them.
    pub leak_rays: u64,
}
