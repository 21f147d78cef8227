//! Scene, OBJ and glTF files, valid and broken.

#[path = "../common/mod.rs"]
mod common;

mod clips;
mod codecs;
mod gltf_features;
mod import;
mod mutations;
mod references;
mod shared_meshes;
