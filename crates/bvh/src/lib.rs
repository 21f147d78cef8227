//! Ray queries: intersection tests of four tiers of numerics ([`geometry`]), and bounding volume hierarchies over triangles and
//! analytic shapes together ([`bvh`]).
//!
//! The crate `kiln` exports both modules under the same names.

#![warn(unreachable_pub)]
// Documentation of modules links to what they are made of.
#![allow(rustdoc::private_intra_doc_links)]

pub mod bvh;
pub mod geometry;

/// The vectors of the interface; with this export, users need no dependency of the same version.
pub use glam;
