//! Limits on times of building and preparing. A binary of its own, because Cargo runs no other binary at the same time.

#[path = "../common/mod.rs"]
mod common;

mod hard_build_times;
mod preparing;
