//! Arrays of vectors, coordinate by coordinate, as long as a tile has pixels, and loops over them in the widest
//! instructions that the machine has.
//!
//! A loop over such arrays whose body has no branches becomes vector instructions. They do what the scalar ones do, in the
//! same order and without fusing: the bits are the same on every machine. Arrays of a fixed size, side by side in one
//! struct, spare the compiler the question whether they overlap.

use glam::DVec3;

use crate::film::TILE;

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

/// Does `work`, which must be inlined into this call, compiled for the widest instructions that the machine has.
#[inline(always)]
pub fn widely<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}
