//! BVH8: inner nodes of eight children, leaves of up to four triangles or analytic shapes, and four traversals over
//! them.
//!
//! A ray passes these files:
//! 1. [`dispatch`] implements [`Accelerator`](super::Accelerator): it chooses the traversal by the rays of the batch,
//!    and the instruction set. Queries of many rays append to [`results`], whichever they are.
//! 2. The rays are traced by one of
//!    - [`packet`]: rays with a common origin, end or direction are culled together by a frustum, and hit triangles by
//!      edge functions in f32 with error bounds;
//!    - [`stream`]: 64 incoherent rays in turns, which hides memory latency;
//!    - [`all_pairs`]: every ray against every primitive, for scenes of a few primitives;
//!    - [`single`]: one ray, ordered front to back with a stack.
//! 3. All of them read the nodes and leaves of [`layout`] and decide hits by the primitive tests of the
//!    [`Tier`](crate::geometry::Tier), so a hit has the same bits whichever traversal found it, except in `fast`.
//!
//! The instruction sets ([`Simd`](crate::geometry::simd::Simd)) give the same results: AVX2 with FMA has all
//! traversals, AVX-512 all but [`single`], portable Rust [`packet`], [`all_pairs`] and [`single`].

mod all_pairs;
mod dispatch;
mod layout;
mod near_box;
mod near_ray;
mod packet;
mod results;
mod single;
mod stream;
#[cfg(test)]
mod tests;

pub(crate) use all_pairs::SmallLeafBatch;
pub(crate) use layout::{Child, Content, Node, Tree, TriangleLeaf, WIDTH, Wide, convert};
pub(crate) use near_box::descend_near;
pub(crate) use packet::Scratches;
pub(crate) use single::{box_ray::BoxRay, descend};
pub(crate) use stream::Scratch as StreamScratch;
