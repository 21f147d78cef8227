//! Refitting: new positions for the same primitives. Bounds are recomputed; the topology stays.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::threads::*;
use glam::Vec3;

use super::{Content, Node, TriangleLeaf, WIDTH, Wide};
use crate::bvh::Primitive;
use crate::bvh::build::MIN_PARALLEL;
use crate::bvh::wide::all_pairs::SmallLeafBatch;
use crate::geometry::{Bounds, Corner, NO_PRIMITIVE, PrimId, Tier, Triangle};

/// Inverted bounds: those of nothing.
const NOTHING: Bounds = Bounds { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

impl<T: Tier> Wide<T> {
    /// A copy without the batch, which a refit makes anew.
    pub(crate) fn without_batch(&self) -> Self {
        Wide {
            nodes: self.nodes.clone(),
            triangles: self.triangles.clone(),
            analytic: self.analytic.clone(),
            batch: None,
            ..*self
        }
    }

    /// See [`Accelerator::refit`](crate::bvh::Accelerator::refit).
    pub(crate) fn refit_to(&mut self, primitive: &(dyn Fn(PrimId) -> Primitive + Sync)) -> Option<f64> {
        let before = self.cost_at_build.unwrap_or_else(|| self.cost());
        self.cost_at_build = Some(before);
        let (triangles, shapes, is_other_kind) = self.move_primitives(primitive);
        self.batch = SmallLeafBatch::new(self);
        // Every node stands before its descendants.
        for index in (0..self.nodes.len()).rev() {
            for place in 0..WIDTH {
                let union = |bounds: &[Bounds], range: Range<u32>| {
                    bounds[range.start as usize..range.end as usize].iter().fold(NOTHING, |a, b| a.union(*b))
                };
                let child = self.nodes[index].children[place];
                let b = match child.content() {
                    Content::Node(child) => match self.nodes.get(child as usize) {
                        Some(node) => node.whole(),
                        // A place that was always empty.
                        None => continue,
                    },
                    Content::Triangles(range) => union(&triangles, range),
                    Content::Analytic(range) => union(&shapes, range),
                };
                self.nodes[index].set(place, b, child);
                if b.min.x > b.max.x {
                    self.nodes[index].present &= !(1 << place);
                }
            }
        }
        if is_other_kind {
            return None;
        }
        let after = self.cost();
        // Without area all trees are equally good.
        Some(if before > 0.0 && after > 0.0 { after / before } else { 1.0 })
    }

    /// Writes the new primitives. Returns the bounds of triangle leaves and of analytic shapes, and whether a triangle
    /// became an analytic shape, or an analytic shape a triangle.
    fn move_primitives(
        &mut self,
        primitive: &(dyn Fn(PrimId) -> Primitive + Sync),
    ) -> (Vec<Bounds>, Vec<Bounds>, bool) {
        let precision = T::NUMERICS.precision();
        let is_other_kind = AtomicBool::new(false);
        let now = |id: PrimId| primitive(id).rounded(precision);
        let of_leaf = |leaf: &mut TriangleLeaf<T::Corner>| {
            let mut whole = NOTHING;
            for lane in 0..leaf.ids.len() {
                let id = leaf.ids[lane];
                if id == NO_PRIMITIVE {
                    continue;
                }
                match now(PrimId(id)) {
                    Some(Primitive::Triangle(Triangle(corners))) => {
                        let corners = corners.map(T::Corner::from_dvec3);
                        whole = whole.union(T::Corner::bounds(&corners));
                        leaf.corners.set(lane, &corners);
                    }
                    Some(Primitive::Analytic(_)) | None => is_other_kind.store(true, Ordering::Relaxed),
                }
            }
            whole
        };
        let triangles = self.triangles.par_iter_mut().with_min_len(MIN_PARALLEL).map(of_leaf).collect();
        let mut shapes = vec![NOTHING; self.analytic.len()];
        for ((shape, id), bounds) in self.analytic.iter_mut().zip(&mut shapes) {
            match now(*id) {
                Some(Primitive::Analytic(moved)) => {
                    *bounds = moved.bounds();
                    *shape = Some(moved);
                }
                None => *shape = None,
                Some(Primitive::Triangle(_)) => is_other_kind.store(true, Ordering::Relaxed),
            }
        }
        (triangles, shapes, is_other_kind.into_inner())
    }

    /// The expected number of nodes and leaves entered by a random line through the root (the surface area heuristic,
    /// MacDonald and Booth 1990); 0 without area.
    fn cost(&self) -> f64 {
        let area = |b: Bounds| {
            let size = (b.max.as_dvec3() - b.min.as_dvec3()).max(glam::DVec3::ZERO);
            size.x * size.y + size.y * size.z + size.z * size.x
        };
        let root = self.nodes.first().map_or(0.0, |root| area(root.whole()));
        if root <= 0.0 {
            return 0.0;
        }
        let of_node = |node: &Node| -> f64 { node.places().map(|place| area(node.bounds(place))).sum() };
        1.0 + self.nodes.iter().map(of_node).sum::<f64>() / root
    }
}
