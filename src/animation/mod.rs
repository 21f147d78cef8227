//! Animation: which frames there are, what the scene is in each of them, and films of them.
//!
//! A frame is a [`Scene`](crate::scene::Scene) like any other, made from the description for a time, and from nothing
//! else: rendered alone it has the same bits as in a run of all. So a farm may deal frames out as it likes.

pub mod frames;
mod job;
pub mod moving;
mod order;
mod prepared;

pub use frames::{FileNames, FrameList};
pub use job::{AnimationJob, FrameRequest};
pub use moving::{Form, Outline, Prepared, Quality, Recorder};
pub use order::in_order;
pub use prepared::{FrameWorld, PreparedAnimation, turntable};
