//! [`StoredSlot`]: a primitive in the precision of a tier, as builds and brute force read it from [`Slots`].

use glam::DVec3;

use super::{Primitive, Slot};
use crate::geometry::simd::prefetch;
use crate::geometry::{Bounds, Corner, NO_PRIMITIVE, PrimId, Stored, Triangle};

/// A primitive in the precision of a tier, and its id.
#[derive(Clone, Copy)]
pub(crate) struct StoredSlot<C> {
    pub(super) primitive: Stored<C>,
    pub(super) id: PrimId,
}

impl<C: Corner> StoredSlot<C> {
    /// Rounds a primitive to the precision of the tier.
    ///
    /// # Panics
    /// If its id is [`NO_PRIMITIVE`].
    #[inline]
    pub(crate) fn new(slot: Slot) -> Self {
        assert!(slot.id.0 != NO_PRIMITIVE, "the primitive id {NO_PRIMITIVE} is reserved");
        StoredSlot { primitive: slot.primitive.into(), id: slot.id }
    }

    /// The corners of a triangle in f64; `None` for an analytic shape.
    pub(super) fn corners(&self) -> Option<[DVec3; 3]> {
        match self.primitive {
            Stored::Triangle(corners) => Some(corners.map(C::to_dvec3)),
            Stored::Analytic(_) => None,
        }
    }

    /// A box of it: see [`Primitive::bounds`].
    pub(crate) fn bounds(&self) -> Bounds {
        match &self.primitive {
            Stored::Triangle(corners) => C::bounds(corners),
            Stored::Analytic(shape) => shape.bounds(),
        }
    }
}

/// What a structure is built over: primitives in the precision of a tier, read in any order.
pub(crate) trait Slots<C: Corner>: Sync {
    /// The number of slots.
    fn len(&self) -> usize;

    /// The primitive in a slot.
    fn get(&self, slot: u32) -> StoredSlot<C>;

    /// Prefetches what [`Slots::get`] reads.
    fn prefetch(&self, slot: u32);
}

impl<C: Corner> Slots<C> for Vec<StoredSlot<C>> {
    fn len(&self) -> usize {
        self.len()
    }

    fn get(&self, slot: u32) -> StoredSlot<C> {
        self[slot as usize]
    }

    fn prefetch(&self, slot: u32) {
        prefetch(self, slot as usize);
    }
}

/// The triangles of a mesh, whose vertices are not copied.
#[derive(Clone, Copy)]
pub(super) struct MeshSlots<'a> {
    /// For each triangle, the indices of its vertices.
    pub triangles: &'a [[u32; 3]],
    /// A vertex.
    pub vertex: &'a (dyn Fn(u32) -> DVec3 + Sync),
}

impl<C: Corner> Slots<C> for MeshSlots<'_> {
    fn len(&self) -> usize {
        self.triangles.len()
    }

    fn get(&self, slot: u32) -> StoredSlot<C> {
        let corners = self.triangles[slot as usize].map(|index| C::from_dvec3((self.vertex)(index)));
        StoredSlot { primitive: Stored::Triangle(corners), id: PrimId(slot) }
    }

    fn prefetch(&self, slot: u32) {
        prefetch(self.triangles, slot as usize);
    }
}

/// The primitive rounded to the precision of a tier.
impl<C: Corner> From<Primitive> for Stored<C> {
    #[inline]
    fn from(primitive: Primitive) -> Self {
        match primitive {
            Primitive::Triangle(Triangle(corners)) => Stored::Triangle(corners.map(C::from_dvec3)),
            Primitive::Analytic(shape) => Stored::Analytic(shape),
        }
    }
}

/// The primitive in f64, without further rounding.
impl<C: Corner> From<Stored<C>> for Primitive {
    #[inline]
    fn from(stored: Stored<C>) -> Self {
        match stored {
            Stored::Triangle(corners) => Primitive::Triangle(Triangle(corners.map(C::to_dvec3))),
            Stored::Analytic(shape) => Primitive::Analytic(shape),
        }
    }
}
