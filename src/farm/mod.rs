//! Shards of a render on several machines: of frames, or of the tiles of a picture.

mod shard;
mod shard_file;

pub use shard::Shard;
pub use shard_file::{Joined, join, shard_name, shard_state, write_shard};
