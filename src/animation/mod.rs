//! Animation: frame lists, the scene of each frame, and videos.
//!
//! A frame is a [`Scene`](crate::scene::Scene) computed from the description and the time alone. Rendered by itself it
//! has the same bits as in a run of all frames, so a render farm may distribute frames in any way.

pub mod frames;
mod job;
mod order;
mod prepared;
pub mod video;

pub use frames::{FileNames, FrameList};
pub use job::{AnimationJob, FrameRequest};
pub use order::in_order;
pub use prepared::{FrameWorld, PreparedAnimation, play_clip, turntable};
pub use video::{FrameData, Quality, VideoFormat, VideoSpec, VideoWriter};
