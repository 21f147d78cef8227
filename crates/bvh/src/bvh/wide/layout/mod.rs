//! The memory layout of the BVH8 and its construction from obvhs's binary tree.
//!
//! Construction: [`preorder`] reads the binary tree once and finds its leaves; [`collapse`] chooses which binary
//! nodes become wide ones; [`convert`](mod@convert) writes [`node`]s and leaves. [`refit`] moves the primitives of a
//! tree that was built before. [`describe`] reports sizes and quality.

mod collapse;
mod convert;
mod describe;
mod node;
mod preorder;
mod refit;

pub(crate) use convert::{Tree, convert};
pub(crate) use node::{Child, Content, Node, WIDTH};

use super::all_pairs::SmallLeafBatch;
use crate::geometry::lanes::LANES4;
use crate::geometry::simd::InstructionSet;
use crate::geometry::{AnalyticShape, Corner, Hit, PrimId, Ray, SlotId, Stored, Tier, Triangle4};

/// A bounding volume hierarchy of eight children per node.
pub(crate) struct Wide<T: Tier> {
    /// The nodes, every node before its descendants; the root is the first. Empty without primitives.
    pub nodes: Vec<Node>,
    /// The leaves of triangles. Slot `LANES4 * i + lane` is a lane of leaf i.
    pub triangles: Vec<TriangleLeaf<T::Corner>>,
    /// The analytic shapes of all leaves; `None` where a refit left nothing of one. Their slots follow those of
    /// triangles.
    pub analytic: Vec<(Option<AnalyticShape>, PrimId)>,
    /// The number of nodes on the longest path from the root.
    pub depth: usize,
    /// Copies of the primitives for [`all_pairs`](super::all_pairs); `None` in larger scenes.
    pub batch: Option<Box<SmallLeafBatch>>,
    /// The instruction set of its traversals.
    pub instructions: InstructionSet,
    /// The cost by the surface area heuristic before the first refit.
    pub cost_at_build: Option<f64>,
}

/// Up to four triangles and their primitive ids.
#[derive(Clone, Copy)]
pub(crate) struct TriangleLeaf<C: Corner> {
    pub corners: Triangle4<C>,
    /// Primitive ids; [`NO_PRIMITIVE`](crate::geometry::NO_PRIMITIVE) in empty lanes.
    pub ids: [u32; LANES4],
}

impl<T: Tier> Wide<T> {
    /// The slot of an analytic shape.
    #[inline(always)]
    pub(crate) fn slot_of_analytic(&self, index: u32) -> SlotId {
        SlotId::new((self.triangles.len() * LANES4) as u32 + index)
    }

    /// The primitive in a slot, in the precision of the tier.
    #[inline(always)]
    pub(crate) fn stored(&self, slot: SlotId) -> Stored<T::Corner> {
        let slot = slot.index() as usize;
        match self.triangles.get(slot / LANES4) {
            Some(leaf) => Stored::Triangle(leaf.corners.triangle(slot % LANES4)),
            None => Stored::Analytic(
                self.analytic[slot - self.triangles.len() * LANES4].0.expect("a shape that was hit"),
            ),
        }
    }

    /// The primitive id in a slot.
    #[inline(always)]
    pub(crate) fn prim_in(&self, slot: u32) -> u32 {
        let slot = slot as usize;
        match self.triangles.get(slot / LANES4) {
            Some(leaf) => leaf.ids[slot % LANES4],
            None => self.analytic[slot - self.triangles.len() * LANES4].1.0,
        }
    }

    /// Whether `hit` comes before the best hit so far.
    #[inline(always)]
    pub(crate) fn is_better(&self, ray: impl FnOnce() -> Ray, hit: &Hit, best: Option<&Hit>) -> bool {
        best.is_none_or(|best| {
            // A split triangle is in several slots.
            hit.prim != best.prim
                && T::is_before(ray, [(hit, &self.stored(hit.slot)), (best, &self.stored(best.slot))])
        })
    }
}
