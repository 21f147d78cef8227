//! kiln: a BVH-accelerated mesh ray tracer.
//!
//! The way of the data, top to bottom; every arrow is one function:
//!
//! ```text
//! scene.toml ─┐
//! mesh.obj   ─┼─ import::load ─> Scene ─ World::prepare ─> World ─ render::render ─> Film ─ film::write ─> PNG, JPEG, EXR
//! mesh.glb   ─┘                  (what)                    (how)                     (pixels)
//! ```
//!
//! Conventions: right-handed, +y up, no physical unit; column vectors, transforms named `b_from_a`; row 0 of a picture
//! is its top row; directions have length 1, so t is a distance.

pub mod bench;
pub mod bvh;
pub mod cli;
pub mod effects;
pub mod error;
pub mod film;
pub mod geometry;
pub mod import;
pub mod render;
pub mod scene;
pub mod shading;
pub mod world;
