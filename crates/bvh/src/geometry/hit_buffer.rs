//! [`HitBuffer`]: closest hits as a structure of arrays, which queries of many rays return.

use super::lanes::{HitN, MAX_LANES};
use super::simd::{Doubles, prefetch};
use super::{Hit, NO_PRIMITIVE, PrimId, SlotId};

/// The closest hits of rays.
///
/// Arrays are longer than `len`, so that whole vectors can be written at the end, and clearing costs nothing.
#[derive(Debug, Clone, Default)]
pub struct HitBuffer {
    len: usize,
    t: Vec<f64>,
    /// [`NO_PRIMITIVE`] for a ray without a hit; its other numbers have no meaning.
    prim: Vec<u32>,
    slot: Vec<u32>,
    barycentrics: [Vec<f64>; 2],
}

impl HitBuffer {
    /// The hit of the ray at `i`; `None` if it hit nothing.
    ///
    /// # Panics
    /// If there is no such ray.
    #[inline(always)]
    pub fn get(&self, i: usize) -> Option<Hit> {
        let prim = self.prim[..self.len][i];
        let [v, w] = &self.barycentrics;
        (prim != NO_PRIMITIVE).then(|| Hit {
            t: self.t[i],
            prim: PrimId(prim),
            slot: SlotId::new(self.slot[i]),
            barycentrics: [v[i], w[i]],
        })
    }

    /// Replaces the hit of the ray at `i`.
    ///
    /// # Panics
    /// If there is no such ray.
    #[inline]
    pub fn set(&mut self, i: usize, hit: Option<&Hit>) {
        self.prim[..self.len][i] = hit.map_or(NO_PRIMITIVE, |hit| hit.prim.0);
        if let Some(hit) = hit {
            self.t[i] = hit.t;
            self.slot[i] = hit.slot.index();
            self.barycentrics.iter_mut().zip(hit.barycentrics).for_each(|(x, number)| x[i] = number);
        }
    }

    /// Appends the result of a ray.
    #[inline]
    pub fn push(&mut self, hit: Option<&Hit>) {
        self.reserve(1);
        self.len += 1;
        self.set(self.len - 1, hit);
    }

    /// Appends results of the first `count` of a group of rays; primitives are [`NO_PRIMITIVE`] for misses. There must be
    /// room ([`HitBuffer::reserve`]).
    #[inline(always)]
    pub(crate) fn append<D: Doubles>(
        &mut self,
        count: usize,
        prims: &[u32; MAX_LANES],
        slots: &[u32; MAX_LANES],
        hits: &HitN<D>,
    ) {
        let first = self.len;
        self.prim[first..first + D::LANES].copy_from_slice(&prims[..D::LANES]);
        self.slot[first..first + D::LANES].copy_from_slice(&slots[..D::LANES]);
        self.t[first..first + D::LANES].copy_from_slice(hits.t.as_ref());
        let [v, w] = &hits.barycentrics;
        self.barycentrics[0][first..first + D::LANES].copy_from_slice(v.as_ref());
        self.barycentrics[1][first..first + D::LANES].copy_from_slice(w.as_ref());
        self.len += count;
    }

    /// Prefetches a cache line of each number for the ray at `i`, which need not exist.
    #[inline(always)]
    pub(crate) fn prefetch(&self, i: usize) {
        let [v, w] = &self.barycentrics;
        prefetch(&self.t, i);
        prefetch(v, i);
        prefetch(w, i);
        prefetch(&self.prim, i);
        prefetch(&self.slot, i);
    }

    /// Removes the results from `len` on, or appends misses.
    pub fn resize(&mut self, len: usize) {
        let before = self.len;
        self.reserve(len.saturating_sub(before));
        self.len = len;
        self.prim[before.min(len)..len].fill(NO_PRIMITIVE);
    }

    /// Makes room for further rays.
    #[inline]
    pub fn reserve(&mut self, count: usize) {
        let size = self.len + count + MAX_LANES;
        if size > self.prim.len() {
            self.grow(size);
        }
    }

    #[cold]
    fn grow(&mut self, size: usize) {
        let size = size.max(2 * self.prim.len());
        self.t.resize(size, 0.0);
        self.prim.resize(size, NO_PRIMITIVE);
        self.slot.resize(size, 0);
        self.barycentrics.iter_mut().for_each(|x| x.resize(size, 0.0));
    }

    /// Removes all results; memory is kept.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// The number of rays.
    #[inline]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The result of every ray.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Option<Hit>> + Clone + '_ {
        let [v, w] = &self.barycentrics;
        let numbers = self.prim[..self.len].iter().zip(&self.slot).zip(&self.t).zip(v).zip(w);
        numbers.map(|((((&prim, &slot), &t), &v), &w)| {
            // The slot of a miss may be any number, also one that no `SlotId` holds.
            let hit = || Hit { t, prim: PrimId(prim), slot: SlotId::new(slot), barycentrics: [v, w] };
            (prim != NO_PRIMITIVE).then(hit)
        })
    }

    /// Bytes of memory of the arrays.
    pub fn bytes(&self) -> usize {
        self.t.capacity() * (3 * size_of::<f64>() + 2 * size_of::<u32>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::simd::{Portable, Simd};

    #[test]
    fn hits_come_back() {
        let hit = Hit { t: 2.5, prim: PrimId(7), slot: SlotId::new(3), barycentrics: [0.25, 0.5] };
        let mut hits = HitBuffer::default();
        hits.push(Some(&hit));
        hits.push(None);
        hits.reserve(2);
        let two = HitN::<<Portable as Simd>::D> {
            t: [2.5, 1.0, 1.0, 1.0],
            barycentrics: [[0.25; 4], [0.5; 4]],
            ..HitN::NONE
        };
        // Traversals leave any slot with a miss.
        let slots = [3, u32::MAX, 3, 3, 3, 3, 3, 3];
        hits.append(2, &[7, NO_PRIMITIVE, 1, 1, 1, 1, 1, 1], &slots, &two);
        assert_eq!(hits.iter().collect::<Vec<_>>(), [Some(hit), None, Some(hit), None]);
        hits.set(0, None);
        hits.resize(5);
        assert_eq!(hits.iter().collect::<Vec<_>>(), [None, None, Some(hit), None, None]);
    }
}
