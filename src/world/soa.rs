//! A vector for each ray of a batch as a structure of arrays, and the dispatch of loops over arrays to the widest SIMD
//! instructions.
//!
//! A loop over such arrays without branches is vectorised by the compiler. Vector instructions do the operations of the scalar code
//! in the same order and without fusing, so the bits are the same on every machine. The arrays have a fixed length and lie in one
//! struct, so the compiler can rule out that they overlap.

use std::ops::{Deref, DerefMut};

use glam::DVec3;

use crate::film::TILE;

/// The most rays of a ray generation: two per pixel of a tile. Smaller batches are nearly empty after some bounces; larger ones
/// gain nothing (docs/decisions.md).
pub const RAYS_PER_BATCH: usize = 2 * (TILE * TILE) as usize;

/// Unused values behind those of the rays. Arrays of numbers then have an odd number of cache lines: a loop over many
/// arrays would otherwise read and write lines that compete for the same cache sets.
const PADDING: usize = 8;

/// A value per ray. Entries beyond the rays in use are stale.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub struct PerRay<T>([T; RAYS_PER_BATCH + PADDING]);

impl<T: Copy + Default> Default for PerRay<T> {
    fn default() -> Self {
        PerRay([T::default(); RAYS_PER_BATCH + PADDING])
    }
}

impl<T> Deref for PerRay<T> {
    type Target = [T; RAYS_PER_BATCH];

    #[inline(always)]
    fn deref(&self) -> &Self::Target {
        let Some(values) = self.0.first_chunk() else { unreachable!("as many and the padding") };
        values
    }
}

impl<T> DerefMut for PerRay<T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut Self::Target {
        let Some(values) = self.0.first_chunk_mut() else { unreachable!("as many and the padding") };
        values
    }
}

/// A vector per ray, as a structure of arrays.
#[derive(Debug, Clone, Default)]
#[repr(align(64))]
pub struct Vec3Soa {
    x: PerRay<f64>,
    y: PerRay<f64>,
    z: PerRay<f64>,
}

impl Vec3Soa {
    /// The vector at `i`.
    #[inline(always)]
    pub fn get(&self, i: usize) -> DVec3 {
        DVec3::new(self.x[i], self.y[i], self.z[i])
    }

    /// Sets the first vectors to the given ones negated.
    pub fn set_negated(&mut self, [x, y, z]: [&[f64]; 3]) {
        for (to, from) in [(&mut self.x, x), (&mut self.y, y), (&mut self.z, z)] {
            to.iter_mut().zip(from).for_each(|(to, &from)| *to = -from);
        }
    }

    /// Sets the vector at `i`.
    #[inline(always)]
    pub fn set(&mut self, i: usize, v: DVec3) {
        (self.x[i], self.y[i], self.z[i]) = (v.x, v.y, v.z);
    }
}

/// `a` if the condition holds, otherwise `b`, without a branch.
#[inline(always)]
pub(crate) fn select(condition: bool, a: DVec3, b: DVec3) -> DVec3 {
    let select = |a: f64, b: f64| if condition { a } else { b };
    DVec3::new(select(a.x, b.x), select(a.y, b.y), select(a.z, b.z))
}

/// A flag per ray, as wide as a coordinate: loops that store numbers of several sizes are not vectorised.
#[derive(Debug, Clone, Default)]
pub struct Flags(PerRay<u64>);

impl Flags {
    /// The flag at `i`.
    #[inline(always)]
    pub fn get(&self, i: usize) -> bool {
        self.0[i] != 0
    }

    /// Unsets all flags.
    pub fn clear(&mut self) {
        self.0.fill(0);
    }

    /// Sets the flag at `i`.
    #[inline(always)]
    pub fn set(&mut self, i: usize, flag: bool) {
        self.0[i] = u64::from(flag);
    }
}
