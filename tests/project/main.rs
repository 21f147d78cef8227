//! Tests of the repository: layers of `src`, documentation, test files.

#[path = "../common/mod.rs"]
mod common;

mod examples;
mod layers;
mod readme;
mod test_files;
