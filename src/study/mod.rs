//! What accuracy costs in time: a scene rendered in many settings, each with its time and its error; and rendering to
//! an error or a time ([`choose`]).
//!
//! [`study()`] takes a [`Subject`] through a sweep of settings, one knob at a time and then some together. Every setting
//! is timed in every round, so that what else the machine does hits all alike, and its picture is held against two others:
//!
//! - the *limit*: the scene in the tier `exact` with so many samples that what they leave open is known (`reference`);
//! - the *twin*: the scene in `exact` at the very same sample points, so that nothing but the knob differs.
//!
//! `geometry` asks before any picture what the tiers decide otherwise than `exact` does. [`page`] makes a page of it.

mod advice;
mod data;
mod errors;
mod geometry;
mod html;
mod leaks;
mod machine;
mod measure;
mod meter;
mod pareto;
mod pictures;
mod plot;
mod reference;
mod report;
mod setting;
mod sweep;
mod table;
mod work;

pub use advice::{advice, steps, Advice, Step};
pub use data::{Floor, Geometry, Judge, Quartiles, Row, Study, Told};
pub use errors::PictureErrors;
pub use measure::{study, Options, Pools, Subject};
pub use pareto::front;
pub use pictures::{Picture, Pictures};
pub use plot::error_against_time;
pub use report::{facts, page};
pub use setting::Setting;
pub use sweep::{knobs, sweep, Absent, Candidate};
pub use table::{from_csv, to_csv};
