//! Tests of the repository: layers of `src`, documentation, test files.

#[path = "../common/mod.rs"]
mod common;

mod examples;
mod interface;
mod layers;
mod readme;
mod test_files;
