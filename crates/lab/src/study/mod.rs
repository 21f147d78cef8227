//! Error against time: a scene rendered in many settings, each with its render time and errors.
//!
//! [`study()`] varies one parameter of a [`StudySubject`] at a time, then some together. Every setting is timed in
//! every round, so that other load on the machine affects all settings equally. Each picture is compared with two
//! references:
//!
//! - the *limit*: a converged picture in the tier `exact`, with known noise (`reference`), where paths are traced without
//!   a clamp and with many bounces (`path_sweep`);
//! - the *twin*: the picture in `exact` at the same sample points, so that only the parameter differs.
//!
//! `geometry` compares the ray hits of the tiers with `exact`. [`page`] returns the results as an HTML page.

mod advice;
mod ambient;
mod data;
mod geometry;
mod leaks;
mod measure;
mod pareto;
mod path_sweep;
mod pictures;
mod plot;
mod reference;
mod report;
mod selection;
mod setting;
mod sweep;
mod table;
mod techniques;
mod work;

pub use advice::{Advice, ParameterStep, advice, steps};
pub use data::{GeometryErrors, NoiseFloor, ReferenceKind, SettingRow, Significance, Study, TechniqueTest};
pub use measure::{Options, Pools, StudySubject, study};
pub use pareto::{TimedError, front};
pub use pictures::{PageImages, RowImages};
pub use plot::error_against_time;
pub use report::{facts, headline, page, to_json};
pub use setting::{PathVariation, Setting};
pub use sweep::{Candidate, Omitted, parameters, sweep};
pub use table::to_csv;
