//! Sizes and quality of a tree, for `kiln info`, statistics and benchmarks.

use super::{Content, Node, TriangleLeaf, WIDTH, Wide};
use crate::bvh::{Description, Quality, VisitedNode, compiled_isa, quality};
use crate::geometry::{AnalyticShape, NO_PRIMITIVE, PrimId, Tier};

impl<T: Tier> Wide<T> {
    /// See [`Accelerator::quality`](crate::bvh::Accelerator::quality).
    pub(crate) fn measure(&self) -> Option<Quality> {
        // Nodes are numbered by their index, leaves by the number of nodes plus their node's index and place.
        let nodes = self.nodes.len();
        let visit = |index: usize, children: &mut Vec<usize>| {
            if index < nodes {
                let node = &self.nodes[index];
                children.extend(node.places().map(|place| match node.children[place].content() {
                    Content::Node(child) => child as usize,
                    _ => nodes + index * WIDTH + place,
                }));
                return VisitedNode { area: f64::from(node.whole().half_area()), primitives: 0 };
            }
            let (node, place) = (&self.nodes[(index - nodes) / WIDTH], (index - nodes) % WIDTH);
            let primitives = match node.children[place].content() {
                Content::Triangles(range) | Content::Analytic(range) => range.len(),
                Content::Node(_) => 0,
            };
            VisitedNode { area: f64::from(node.bounds(place).half_area()), primitives }
        };
        (nodes > 0).then(|| quality(0, visit))
    }

    /// See [`Accelerator::describe`](crate::bvh::Accelerator::describe).
    pub(crate) fn description(&self) -> Description {
        let ids = self.triangles.iter().flat_map(|leaf| leaf.ids);
        let slots = ids.filter(|&id| id != NO_PRIMITIVE).count() + self.analytic.len();
        let bytes = self.nodes.len() * size_of::<Node>()
            + self.triangles.len() * size_of::<TriangleLeaf<T::Corner>>()
            + self.analytic.len() * size_of::<(Option<AnalyticShape>, PrimId)>()
            + self.batch.as_ref().map_or(0, |batch| batch.bytes());
        let isa = self.instructions.name().unwrap_or(compiled_isa());
        Description { layout: "bvh8", isa, nodes: self.nodes.len(), slots, bytes }
    }
}
