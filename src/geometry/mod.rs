//! Rays, boxes, triangles and spheres, with the error bounds that keep them honest.
//!
//! The numerics here are *watertight*: geometry is stored in f32 and decided in f64.
//! - A ray's origin and direction are numbers that f32 can hold, so that the f32 box tests and the f64 primitive tests
//!   speak of the same ray ([`Ray::new`]).
//! - Triangles: Woop, Benthin and Wald's test in f64, closed at the edges ([`TriangleTest`]). Two triangles that share
//!   an edge see the same two numbers for its ends and opposite signs for its edge function; a sign is right or zero,
//!   and zero counts as inside for both, so no ray passes between them.
//! - Spheres: Haines, Günther and Akenine-Möller's form in f64 ([`sphere`]).
//! - Boxes: rounded outwards, and tested with Ize's margin ([`BoxTest`]).
//! - A hit's distance is held within its primitive's own box, so that no box around it can be pruned before it.
//! - Secondary rays start on the outer side of the surface they leave ([`spawn`]).
//!
//! No constant here decides a hit; every bound is relative to the numbers it guards.

mod beam;
mod bounds;
mod ray;
pub mod spawn;
pub mod sphere;
mod triangle;

pub use beam::Beam;
pub use bounds::{Bounds, BoxTest, PRUNE_MARGIN, round_up};
pub use ray::{Hit, PrimId, Ray, SlotId};
pub use sphere::Sphere;
pub use triangle::{Triangle, TriangleHit, TriangleTest};
