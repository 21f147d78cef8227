//! [`StoredSlot`]: a primitive in the precision of a tier, as builds, brute force and the binary tree store it.

use std::ops::Range;

use glam::DVec3;

use super::{Primitive, Slot};
use crate::geometry::{
    Bounds, Corner, Hit, NO_PRIMITIVE, PreparedRay, PrimId, Ray, SlotId, Stored, Tier, Triangle, TriangleHit,
};

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

    /// The smallest f32 box around it.
    pub(crate) fn bounds(&self) -> Bounds {
        match &self.primitive {
            Stored::Triangle(corners) => C::bounds(corners),
            Stored::Analytic(shape) => shape.bounds(),
        }
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

/// A ray to be tested against stored primitives. It is prepared for triangles at the first one, as many rays reach
/// none.
pub(crate) struct PrimitiveTest<'a, T: Tier> {
    ray: &'a Ray,
    triangles: Option<T::Prepared>,
}

impl<'a, T: Tier> PrimitiveTest<'a, T> {
    #[inline]
    pub(crate) fn new(ray: &'a Ray) -> Self {
        PrimitiveTest { ray, triangles: None }
    }

    /// The hit of the ray on the primitive in slot `index`.
    #[inline(always)]
    pub(crate) fn hit(&mut self, slot: &StoredSlot<T::Corner>, index: u32) -> Option<Hit> {
        let TriangleHit { t, barycentrics } = match &slot.primitive {
            Stored::Triangle(corners) => {
                let prepared = self.triangles.get_or_insert_with(|| T::Prepared::new(self.ray));
                T::hit_triangle(prepared, self.ray, corners)?
            }
            Stored::Analytic(shape) => {
                TriangleHit { t: shape.hit(self.ray, T::NUMERICS)?, barycentrics: [0.0; 2] }
            }
        };
        Some(Hit { t, prim: slot.id, slot: SlotId::new(index), barycentrics })
    }

    /// The closest of `best`, which is a hit on one of `slots`, and the hits on the slots of a range.
    #[inline(always)]
    pub(crate) fn closest(
        &mut self,
        slots: &[StoredSlot<T::Corner>],
        range: Range<u32>,
        mut best: Option<Hit>,
    ) -> Option<Hit> {
        let primitive = |hit: &Hit| &slots[hit.slot.index() as usize].primitive;
        for index in range {
            let Some(hit) = self.hit(&slots[index as usize], index) else { continue };
            // A split triangle is in several slots.
            let is_better = best.as_ref().is_none_or(|best| {
                hit.prim != best.prim
                    && T::is_before(|| *self.ray, [(&hit, primitive(&hit)), (best, primitive(best))])
            });
            if is_better {
                best = Some(hit);
            }
        }
        best
    }
}
