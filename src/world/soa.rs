//! Structures of arrays for the rays of a tile, and the dispatch of loops over them to the widest SIMD instructions.
//!
//! A loop over such arrays without branches is vectorised by the compiler. Vector instructions do the operations of the scalar code
//! in the same order and without fusing, so the bits are the same on every machine. The arrays have a fixed length and lie in one
//! struct, so the compiler can rule out that they overlap.

use glam::DVec3;

use crate::film::TILE;
use crate::geometry::Ray;

/// The most rays of a ray generation: one per pixel of a tile.
pub const RAYS_PER_BATCH: usize = (TILE * TILE) as usize;

/// A vector per ray, as a structure of arrays. Entries beyond the rays in use are stale.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub struct Vec3Soa {
    x: [f64; RAYS_PER_BATCH],
    y: [f64; RAYS_PER_BATCH],
    z: [f64; RAYS_PER_BATCH],
}

impl Default for Vec3Soa {
    fn default() -> Self {
        Vec3Soa { x: [0.0; RAYS_PER_BATCH], y: [0.0; RAYS_PER_BATCH], z: [0.0; RAYS_PER_BATCH] }
    }
}

impl Vec3Soa {
    /// The vector at `i`.
    #[inline(always)]
    pub fn get(&self, i: usize) -> DVec3 {
        DVec3::new(self.x[i], self.y[i], self.z[i])
    }

    /// Sets the vector at `i`.
    #[inline(always)]
    pub fn set(&mut self, i: usize, v: DVec3) {
        (self.x[i], self.y[i], self.z[i]) = (v.x, v.y, v.z);
    }
}

/// The rays of a generation as a structure of arrays. Their `t_min` is 0.
///
/// Traversal takes arrays of [`Ray`]s. [`RaySoa::to_rays`] makes them after the loops that compute the components, since
/// scattering vector registers into structs costs more than those loops.
#[derive(Debug, Clone)]
pub struct RaySoa {
    origin: Vec3Soa,
    /// The directions, of length 1 up to rounding.
    pub direction: Vec3Soa,
    t_max: [f64; RAYS_PER_BATCH],
}

impl Default for RaySoa {
    fn default() -> Self {
        RaySoa { origin: Vec3Soa::default(), direction: Vec3Soa::default(), t_max: [0.0; RAYS_PER_BATCH] }
    }
}

impl RaySoa {
    /// The ray at `i`.
    #[inline(always)]
    pub fn get(&self, i: usize) -> Ray {
        Ray { origin: self.origin.get(i), direction: self.direction.get(i), t_min: 0.0, t_max: self.t_max[i] }
    }

    /// Sets the ray at `i`, whose `t_min` must be 0.
    #[inline(always)]
    pub fn set(&mut self, i: usize, ray: &Ray) {
        debug_assert!(ray.t_min == 0.0, "a ray with t_min other than 0: {ray:?}");
        self.origin.set(i, ray.origin);
        self.direction.set(i, ray.direction);
        self.t_max[i] = ray.t_max;
    }

    /// Replaces `rays` by the first `len` rays.
    pub fn to_rays(&self, len: usize, rays: &mut Vec<Ray>) {
        rays.clear();
        rays.extend((0..len.min(RAYS_PER_BATCH)).map(|i| self.get(i)));
    }

    /// Replaces `rays` by the rays at `indices`.
    pub fn to_rays_at(&self, indices: &[u32], rays: &mut Vec<Ray>) {
        rays.clear();
        rays.extend(indices.iter().map(|&i| self.get(i as usize)));
    }
}

/// Calls `work` compiled for the widest SIMD instructions of this machine. `work` must be `#[inline(always)]`.
#[inline(always)]
pub fn simd_dispatch<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}
