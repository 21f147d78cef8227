//! Acceleration structures over triangles and spheres alike.
//!
//! obvhs builds the tree; kiln walks it itself. obvhs's own traversal and intersectors are fast but not conservative:
//! its boxes are tested without margin, tiny direction components are clamped, ties depend on the layout, and its
//! triangle test loses rays on edges seen from behind. The picture must not depend on the structure, so every
//! structure here answers exactly as [`BruteForce`] does: the least t, ties to the lowest primitive id.

mod brute_force;
mod build;
mod tree;

pub use brute_force::BruteForce;
pub use build::{Preset, build};
pub use tree::Tree;

use crate::geometry::{Bounds, Hit, PrimId, Ray, SlotId, Sphere, Triangle, TriangleHit, TriangleTest};

/// The geometry of one primitive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Primitive {
    /// A triangle.
    Triangle(Triangle),
    /// An analytic sphere.
    Sphere(Sphere),
}

impl Primitive {
    /// The smallest f32 box that holds the primitive.
    pub fn bounds(&self) -> Bounds {
        match self {
            Primitive::Triangle(triangle) => triangle.bounds(),
            Primitive::Sphere(sphere) => sphere.bounds(),
        }
    }
}

/// A primitive as an acceleration structure keeps it, next to those it is tested with.
#[derive(Debug, Clone, Copy)]
pub struct Slot {
    /// Its geometry.
    pub primitive: Primitive,
    /// Its place in the description.
    pub id: PrimId,
}

/// What a traversal needs from one ray to the next, and what it counted.
#[derive(Debug, Default)]
pub struct Traversal {
    stack: Vec<(u32, f32)>,
    /// Where the rays of a batch begin.
    entries: Vec<(u32, f32)>,
    /// The work done so far.
    pub tests: Tests,
}

/// Deterministic measures of work.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tests {
    /// Boxes tested.
    pub nodes: u64,
    /// Primitives tested.
    pub primitives: u64,
}

impl std::ops::AddAssign for Tests {
    fn add_assign(&mut self, other: Self) {
        self.nodes += other.nodes;
        self.primitives += other.primitives;
    }
}

/// What answers "what does this ray hit".
pub trait Accelerator: Send + Sync {
    /// The hit with the least t, and among those at the same t the one with the lowest primitive id.
    fn closest_hit(&self, ray: &Ray, traversal: &mut Traversal) -> Option<Hit>;

    /// Whether the ray hits anything at all.
    fn is_occluded(&self, ray: &Ray, traversal: &mut Traversal) -> bool;

    /// The slots that [`Hit::slot`] refers to.
    fn slots(&self) -> &[Slot];

    /// What there is to say about the structure.
    fn describe(&self) -> Description;

    /// The closest hit of every ray, in order, appended to `hits`.
    fn closest_hits(&self, rays: &[Ray], hits: &mut Vec<Option<Hit>>, traversal: &mut Traversal) {
        hits.extend(rays.iter().map(|ray| self.closest_hit(ray, traversal)));
    }

    /// Whether every ray hits anything at all, in order, appended to `occluded`.
    fn are_occluded(&self, rays: &[Ray], occluded: &mut Vec<bool>, traversal: &mut Traversal) {
        occluded.extend(rays.iter().map(|ray| self.is_occluded(ray, traversal)));
    }
}

/// What there is to say about an acceleration structure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Description {
    /// Its name.
    pub layout: &'static str,
    /// How many nodes it has.
    pub nodes: usize,
    /// How many slots it has; may exceed the primitives where large ones are kept in several places.
    pub slots: usize,
    /// Its size in bytes.
    pub bytes: usize,
}

/// A ray made ready for primitives of every kind, once the first of them is met: many rays meet none.
struct PrimitiveTest<'a> {
    ray: &'a Ray,
    triangles: Option<TriangleTest>,
}

impl<'a> PrimitiveTest<'a> {
    #[inline]
    fn new(ray: &'a Ray) -> Self {
        PrimitiveTest { ray, triangles: None }
    }

    #[inline(always)]
    fn hit(&mut self, slot: &Slot, index: u32) -> Option<Hit> {
        let TriangleHit { t, weights } = match &slot.primitive {
            Primitive::Triangle(triangle) => {
                let test = self.triangles.get_or_insert_with(|| TriangleTest::new(self.ray));
                test.hit(self.ray, triangle)?
            }
            Primitive::Sphere(sphere) => TriangleHit { t: sphere.hit(self.ray)?, weights: [0.0; 2] },
        };
        Some(Hit { t, prim: slot.id, slot: SlotId(index), weights })
    }
}
