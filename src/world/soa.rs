//! Structures of arrays for the rays of a tile, and the dispatch of loops over them to the widest SIMD instructions.
//!
//! A loop over such arrays without branches is vectorised by the compiler. Vector instructions do the operations of the scalar code
//! in the same order and without fusing, so the bits are the same on every machine. The arrays have a fixed length and lie in one
//! struct, so the compiler can rule out that they overlap.

use glam::DVec3;

use crate::film::TILE;
use crate::geometry::{Ray, Rays};

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

    /// The coordinates of the first `len` vectors.
    fn first(&self, len: usize) -> [&[f64]; 3] {
        [&self.x[..len], &self.y[..len], &self.z[..len]]
    }

    /// Sets the vector at `i`.
    #[inline(always)]
    pub fn set(&mut self, i: usize, v: DVec3) {
        (self.x[i], self.y[i], self.z[i]) = (v.x, v.y, v.z);
    }
}

/// At most [`RAYS_PER_BATCH`] rays as a structure of arrays. Their `t_min` is 0.
///
/// The numbers of all [`RAYS_PER_BATCH`] may be written by [`RaySoa::set`]; those of the first [`RaySoa::len`] are rays.
#[derive(Debug, Clone)]
pub struct RaySoa {
    len: usize,
    origin: Vec3Soa,
    /// The directions, of length 1 up to rounding.
    pub direction: Vec3Soa,
    t_max: [f64; RAYS_PER_BATCH],
}

/// `t_min` of all rays.
static ZEROS: [f64; RAYS_PER_BATCH] = [0.0; RAYS_PER_BATCH];

impl Default for RaySoa {
    fn default() -> Self {
        let (origin, direction) = (Vec3Soa::default(), Vec3Soa::default());
        RaySoa { len: 0, origin, direction, t_max: [0.0; RAYS_PER_BATCH] }
    }
}

impl RaySoa {
    /// The number of rays.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Sets the number of rays.
    ///
    /// # Panics
    /// If it is above [`RAYS_PER_BATCH`].
    pub fn set_len(&mut self, len: usize) {
        assert!(len <= RAYS_PER_BATCH, "{len} rays");
        self.len = len;
    }

    /// The rays.
    pub fn rays(&self) -> Rays<'_> {
        let (origin, direction) = (self.origin.first(self.len), self.direction.first(self.len));
        Rays::new(origin, direction, &ZEROS[..self.len], &self.t_max[..self.len])
    }

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

    /// Appends a ray, whose `t_min` must be 0.
    ///
    /// # Panics
    /// If there are [`RAYS_PER_BATCH`].
    pub fn push(&mut self, ray: &Ray) {
        self.set(self.len, ray);
        self.len += 1;
    }

    /// Moves the rays at `indices`, which ascend, to the front; these are the rays then.
    ///
    /// # Panics
    /// If there is no ray at an index.
    pub fn keep(&mut self, indices: &[u32]) {
        debug_assert!(indices.is_sorted_by(|a, b| a < b), "indices do not ascend");
        assert!(indices.last().is_none_or(|&last| (last as usize) < self.len), "no ray at an index");
        for (to, &from) in indices.iter().enumerate().skip_while(|(to, from)| *to == **from as usize) {
            self.set(to, &self.get(from as usize));
        }
        self.set_len(indices.len());
    }
}

/// [`simd_dispatch`] of an expression.
macro_rules! simd {
    ($work:expr) => {
        $crate::world::simd_dispatch(
            #[inline(always)]
            || $work,
        )
    };
}
pub(crate) use simd;

/// Calls `work` compiled for the widest SIMD instructions of this machine. `work` must be `#[inline(always)]`.
#[inline(always)]
pub fn simd_dispatch<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}
