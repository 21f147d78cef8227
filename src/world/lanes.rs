//! Arrays of vectors, coordinate by coordinate, as long as a tile has pixels, and loops over them in the widest
//! instructions that the machine has.
//!
//! A loop over such arrays whose body has no branches becomes vector instructions. They do what the scalar ones do, in the
//! same order and without fusing: the bits are the same on every machine. Arrays of a fixed size, side by side in one
//! struct, spare the compiler the question whether they overlap.

use glam::DVec3;

use crate::film::TILE;
use crate::geometry::Ray;

/// How many rays a level of a tile has at most: one a pixel.
pub const LANES: usize = (TILE * TILE) as usize;

/// A vector for each ray of a tile. What lies beyond the rays there are is left over from others.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub struct Lanes {
    x: [f64; LANES],
    y: [f64; LANES],
    z: [f64; LANES],
}

impl Default for Lanes {
    fn default() -> Self {
        Lanes { x: [0.0; LANES], y: [0.0; LANES], z: [0.0; LANES] }
    }
}

impl Lanes {
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

/// Rays of a tile, coordinate by coordinate. They begin at 0.
///
/// What a structure is asked about are whole [`Ray`]s: [`RayLanes::weave`] makes them of these, apart from the loops that
/// compute them, because wide instructions that scatter cost more than all of the arithmetic.
#[derive(Debug, Clone)]
pub struct RayLanes {
    origin: Lanes,
    /// Their directions.
    pub direction: Lanes,
    t_max: [f64; LANES],
}

impl Default for RayLanes {
    fn default() -> Self {
        RayLanes { origin: Lanes::default(), direction: Lanes::default(), t_max: [0.0; LANES] }
    }
}

impl RayLanes {
    /// The ray at `i`.
    #[inline(always)]
    pub fn get(&self, i: usize) -> Ray {
        Ray { origin: self.origin.get(i), direction: self.direction.get(i), t_min: 0.0, t_max: self.t_max[i] }
    }

    /// Sets the ray at `i`, which must begin at 0.
    #[inline(always)]
    pub fn set(&mut self, i: usize, ray: &Ray) {
        debug_assert!(ray.t_min == 0.0, "a ray that does not begin at 0: {ray:?}");
        self.origin.set(i, ray.origin);
        self.direction.set(i, ray.direction);
        self.t_max[i] = ray.t_max;
    }

    /// The first `len` rays in the place of `rays`.
    pub fn weave(&self, len: usize, rays: &mut Vec<Ray>) {
        rays.clear();
        rays.extend((0..len.min(LANES)).map(|i| self.get(i)));
    }

    /// The rays at `indices` in the place of `rays`.
    pub fn weave_some(&self, indices: &[u32], rays: &mut Vec<Ray>) {
        rays.clear();
        rays.extend(indices.iter().map(|&i| self.get(i as usize)));
    }
}

/// Does `work`, which must be inlined into this call, compiled for the widest instructions that the machine has.
#[inline(always)]
pub fn widely<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}
