//! Processing of meshes after reading.

pub(crate) mod colours;
pub(crate) mod parts;
pub(crate) mod polygon;
pub(crate) mod sanitise;
pub mod sharing;
pub(crate) mod smooth;
pub(crate) mod tangents;
pub(crate) mod untextured;
pub(crate) mod up;
