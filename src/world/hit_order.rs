//! The order of the surface interactions of a generation.

use super::soa::{PerRay, RAYS_PER_BATCH};
use crate::bvh::detail::HitBuffer;

/// Batches are sorted whose hits are on primitives of lower numbers than this.
const MAX_SORTED: usize = 64;

/// The order of surface interactions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HitOrder {
    /// That of the rays.
    Rays,
    /// By primitive in batches that hit the first 64 of a scene alone, else that of the rays: for incoherent rays.
    Primitives,
}

/// Sorts the indices of rays by the primitives that they hit, so that runs are long; rays that hit nothing are last. Returns
/// whether it did: see [`HitOrder`].
pub(super) fn sort(hits: &HitBuffer, sorted: &mut PerRay<u32>) -> bool {
    // A hit on primitive 64 has the key of a miss; `gather` leaves out misses only.
    let key = |i: usize| hits.get(i).map_or(MAX_SORTED, |hit| hit.prim.0 as usize);
    let mut ends = [0; MAX_SORTED + 1];
    for i in 0..hits.len() {
        match ends.get_mut(key(i)) {
            Some(count) => *count += 1,
            None => return false,
        }
    }
    let mut end = 0;
    for count in &mut ends {
        end += *count;
        *count = end - *count;
    }
    for i in 0..hits.len() {
        let place = &mut ends[key(i)];
        sorted[*place % RAYS_PER_BATCH] = i as u32;
        *place += 1;
    }
    true
}
