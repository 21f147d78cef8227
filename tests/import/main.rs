//! Scene, OBJ and glTF files, valid and broken.

#[path = "../common/mod.rs"]
mod common;

mod clips;
mod codecs;
mod formats;
mod gltf;
mod gltf_features;
mod helpers;
mod mutations;
mod obj;
mod options;
mod references;
mod scene_files;
mod shared_meshes;
