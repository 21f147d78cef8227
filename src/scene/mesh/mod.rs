//! Geometry of meshes as described: topology, attributes, support functions.

pub mod support;
pub mod topology;
pub(crate) mod vertex_attributes;
