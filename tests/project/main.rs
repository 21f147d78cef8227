//! The repository: layers of `src`, the papers, the files of `tests`.

#[path = "../common/mod.rs"]
mod common;

mod layers;
mod readme;
mod test_files;
