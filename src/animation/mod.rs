//! Animation: frame lists, the scene of each frame, and videos.
//!
//! A frame is a [`Scene`](crate::scene::Scene) computed from the description and the time alone. Rendered by itself it
//! has the same bits as in a run of all frames, so a render farm may distribute frames in any way.

pub mod frames;
mod job;
mod moving;
mod order;
pub mod video;

pub use frames::{FileNames, FrameList};
pub use job::{AnimationJob, FilmDefaults, FrameRequest};
pub use moving::{play_clip, turntable};
pub use order::in_order;
pub use video::{FrameData, Quality, VideoFormat, VideoSpec, VideoWriter};
