//! What is asked of the files of a scene when they are read.

use super::{ClipTime, UpAxis};
use crate::limits::Limits;

/// Choices that importers take.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ImportOptions {
    /// The moment of a clip at which the scene is posed; at rest if `None`.
    pub pose: Option<ClipTime>,
    /// The name of a variant of the materials (KHR_materials_variants); as the file has them if `None`.
    pub variant: Option<String>,
    /// Whether glTF files are read although they require extensions that kiln does not read.
    pub ignore_required_extensions: bool,
    /// Whether files are read that a mesh file references outside of its folder.
    pub allow_outside_references: bool,
    /// The axis that points up in files that are no scene files; +y if `None`.
    pub up: Option<UpAxis>,
    /// The greatest angle in radians between triangles that are shaded as one smooth surface, for meshes without normals of
    /// files that are no scene files; flat if `None`.
    pub smooth: Option<f64>,
    /// The most that the files may hold.
    pub limits: Limits,
}
