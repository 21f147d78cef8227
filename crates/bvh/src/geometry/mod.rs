//! Rays, boxes, triangles and analytic shapes, and the intersection tests of every numeric tier with their error
//! bounds.
//!
//! Used by `bvh`, which traverses, and by `world`, which makes surface interactions. There are four tiers
//! ([`Numerics`]), one type and one file each behind the trait [`Tier`]:
//!
//! | tier | rays and corners | triangles | spheres |
//! | ---- | ---------------- | --------- | ------- |
//! | [`Fast`] | f32 | Möller and Trumbore, f32 | Haines and others, f32 |
//! | [`Watertight`] | rays f64, corners f32 | Woop, Benthin and Wald, f64 | Haines and others, f64 |
//! | [`Double`] | f64 | the same | the same |
//! | [`Exact`] | f64 | the same with error bounds, then exact | the same with error bounds, then exact |
//!
//! In all of them:
//! - A ray's origin and direction are rounded to the tier's precision first ([`Numerics::ray_precision`]), so box
//!   tests and primitive tests see the same ray.
//! - Boxes are f32, rounded outwards, and tested in f32 with a margin that absorbs rounding; without one in `fast`.
//! - Triangles are hit from both sides, edges and corners included; a ray in a triangle's plane misses.
//! - Secondary rays start in front of the surface they leave and of its neighbours ([`spawn`]).
//!
//! No absolute constant decides a hit: every bound is relative to the numbers it applies to. [`Numerics::Fast`] lists
//! what `fast` gives up.

mod analytic;
mod bounds;
mod crossing;
mod disk;
mod distance;
mod double;
pub(crate) mod estimate;
mod exact;
pub(crate) mod expansion;
pub(crate) mod fast;
mod hit_buffer;
pub(crate) mod lanes;
mod mesh;
mod numerics;
mod placed;
pub(crate) mod plane;
mod point;
mod ray;
mod rays;
pub(crate) mod simd;
pub(crate) mod spawn;
mod sphere;
mod tier;
mod touch;
mod triangle;
mod user_geometry;
mod watertight;
mod woop;
pub(crate) mod woop_n;
mod woop_packet;

pub use analytic::AnalyticShape;
pub(crate) use analytic::{SHAPE_NUMBERS, ShapeN};
pub use bounds::Bounds;
pub(crate) use bounds::round_up;
pub use crossing::Side;
pub use disk::Disk;
pub use hit_buffer::HitBuffer;
pub use mesh::{Attribute, Mesh, is_mirror, moved_tangent, normal_matrix};
pub use numerics::Precision;
pub use placed::{Placed, Placement, Step};
pub use point::Point;
pub(crate) use ray::NO_PRIMITIVE;
pub use ray::{Hit, PrimId, Ray, SlotId};
pub(crate) use rays::{BATCH, PACKET, PER_LINE};
pub use rays::{RayBuffer, Rays};
pub use sphere::Sphere;
pub use tier::Numerics;
pub use triangle::Triangle;
pub use user_geometry::UserGeometry;

pub(crate) use bounds::{PRUNE_MARGIN, clamp_to_bounds, round_down};
pub(crate) use crossing::{LineTest, order_of_crossings};
pub(crate) use double::Double;
pub(crate) use exact::{Exact, is_before_exactly};
pub(crate) use fast::Fast;
pub(crate) use lanes::Triangle4;
pub(crate) use numerics::{Corner, PreparedPacket, PreparedRay, Stored, Tier};
pub(crate) use touch::{triangle_meets_box, triangles_meet};
pub(crate) use triangle::TriangleHit;
pub(crate) use watertight::Watertight;
#[cfg(test)]
pub(crate) use woop::sign_of_determinant;
