//! Primitives as structures keep them, in the numbers of a tier, and how rays are tested against them.

use super::{Primitive, Slot};
use crate::geometry::{Bounds, Corner, Hit, PrimId, Ray, SlotId, Stored, Tier, Triangle, TriangleHit};

/// A primitive as an acceleration structure keeps it, next to those it is tested with.
pub struct StoredSlot<T: Tier> {
    pub(super) primitive: Stored<T::Corner>,
    pub(super) id: PrimId,
}

impl<T: Tier> Clone for StoredSlot<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T: Tier> Copy for StoredSlot<T> {}

impl<T: Tier> StoredSlot<T> {
    /// Rounded to the numbers of the tier.
    pub fn new(slot: Slot) -> Self {
        let primitive = match slot.primitive {
            Primitive::Triangle(Triangle(corners)) => Stored::Triangle(corners.map(T::Corner::lower)),
            Primitive::Sphere(sphere) => Stored::Sphere(sphere),
        };
        StoredSlot { primitive, id: slot.id }
    }

    /// The geometry, without further rounding.
    pub fn primitive(&self) -> Primitive {
        match self.primitive {
            Stored::Triangle(corners) => Primitive::Triangle(Triangle(corners.map(Corner::raise))),
            Stored::Sphere(sphere) => Primitive::Sphere(sphere),
        }
    }

    /// The smallest f32 box that holds it.
    pub fn bounds(&self) -> Bounds {
        match &self.primitive {
            Stored::Triangle(corners) => T::Corner::bounds(corners),
            Stored::Sphere(sphere) => sphere.bounds(),
        }
    }
}

/// A ray made ready for primitives of every kind, once the first of them is met: many rays meet none.
pub struct PrimitiveTest<'a, T: Tier> {
    ray: &'a Ray,
    triangles: Option<T::Prepared>,
}

impl<'a, T: Tier> PrimitiveTest<'a, T> {
    #[inline]
    pub fn new(ray: &'a Ray) -> Self {
        PrimitiveTest { ray, triangles: None }
    }

    /// Whether and where the ray hits the primitive that stands at `index`.
    #[inline(always)]
    pub fn hit(&mut self, slot: &StoredSlot<T>, index: u32) -> Option<Hit> {
        let TriangleHit { t, weights } = match &slot.primitive {
            Stored::Triangle(corners) => {
                let prepared = self.triangles.get_or_insert_with(|| T::prepare(self.ray));
                T::hit_triangle(prepared, self.ray, corners)?
            }
            Stored::Sphere(sphere) => TriangleHit { t: T::hit_sphere(self.ray, sphere)?, weights: [0.0; 2] },
        };
        Some(Hit { t, prim: slot.id, slot: SlotId(index), weights })
    }

    /// Whether `hit` comes before the best so far. Both are hits of `slots`.
    #[inline(always)]
    pub fn is_better(&self, hit: &Hit, best: Option<&Hit>, slots: &[StoredSlot<T>]) -> bool {
        let with = |hit: &Hit| &slots[hit.slot.0 as usize].primitive;
        // A large triangle may be kept in several places.
        best.is_none_or(|best| {
            hit.prim != best.prim && T::is_before(self.ray, [(hit, with(hit)), (best, with(best))])
        })
    }
}
