//! Work divided among machines: shares of frames or tiles, and the parts of a picture.

mod part;
mod share;

pub use part::{Joined, join, part_name, part_state, write_part};
pub use share::Share;
