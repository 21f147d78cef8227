//! The formats: a reader for each.

pub(crate) mod gltf;
pub(crate) mod obj;
pub(crate) mod off;
pub(crate) mod ply;
pub(crate) mod scene_file;
pub(crate) mod stl;
pub(crate) mod threemf;
