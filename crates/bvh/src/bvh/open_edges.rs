//! The edges that keep placed meshes from being closed together, from those of each mesh by itself.
//!
//! What counts is how much more often the triangles use an edge in one direction than in the other. A placement may
//! give several vertices the same position; a triangle with two equal vertices then uses its two other edges, which
//! are the same, in both directions, so that the sums remain those of all triangles that have area. So an edge that is
//! balanced in its mesh adds nothing where it is placed, and the sums of meshes that are placed edge to edge are those
//! of their unbalanced edges.

use std::sync::{Arc, OnceLock};

use crate::threads::*;

use super::crossings::{Vertex, vertex_of};
use super::generalised::Expansions;
use super::{Bvh, InsideRule, Primitive, Shapes};
use crate::geometry::{Mesh, Numerics, Placed, Triangle};

/// An edge between two vertices of a mesh, and how much more often its triangles use it from the first to the second.
type OpenEdge = ([u32; 2], i32);

/// An instance, and what is known of its surface.
#[derive(Clone)]
pub(super) struct Part {
    pub placed: Placed,
    /// Of its mesh.
    pub open_edges: Arc<OnceLock<Vec<OpenEdge>>>,
    /// In the world.
    pub expansions: Arc<OnceLock<Arc<Expansions>>>,
}

impl Part {
    /// The expansions of its triangles as stored, turned over if they are mirrored.
    pub(super) fn expansions(&self, numerics: Numerics) -> Arc<Expansions> {
        if let Some(known) = self.expansions.get() {
            return known.clone();
        }
        let is_mirrored = self.placed.is_mirrored();
        let stored = |triangle| {
            let [a, b, c] = self.placed.corners_of(triangle);
            let corners = if is_mirrored { [a, c, b] } else { [a, b, c] };
            Primitive::Triangle(Triangle(corners)).rounded(numerics.precision())
        };
        let found = Expansions::new((0..self.placed.triangle_count() as u32).filter_map(stored).collect());
        // Not while the cell is locked: see `Bvh::closedness`.
        self.expansions.get_or_init(|| Arc::new(found)).clone()
    }

    fn open_edges(&self) -> &[OpenEdge] {
        if let Some(known) = self.open_edges.get() {
            return known;
        }
        let found = open_edges(&self.placed.mesh);
        self.open_edges.get_or_init(|| found)
    }
}

/// The edges of a mesh that are not used as often in one direction as in the other. Vertices at the same position are
/// the same.
fn open_edges(mesh: &Mesh) -> Vec<OpenEdge> {
    let position = |index: u32| vertex_of(mesh.positions[index as usize]);
    let mut order: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    order.par_sort_unstable_by_key(|index| position(*index));
    let mut same = vec![0; order.len()];
    for equal in order.chunk_by(|a, b| position(*a) == position(*b)) {
        equal.iter().for_each(|index| same[*index as usize] = equal[0]);
    }
    let mut edges = Vec::with_capacity(3 * mesh.triangles.len());
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|index| same[index as usize]);
        if a != b && b != c && c != a {
            edges.extend([[a, b], [b, c], [c, a]].map(|ends| directed(ends, 1)));
        }
    }
    sums(edges)
}

/// An edge from its lesser to its greater end, with the sign of that direction.
fn directed<V: Ord>([from, to]: [V; 2], count: i32) -> ([V; 2], i32) {
    if from < to { ([from, to], count) } else { ([to, from], -count) }
}

/// The edges whose counts have a sum, and that sum.
fn sums<V: Ord + Copy + Send>(mut edges: Vec<([V; 2], i32)>) -> Vec<([V; 2], i32)> {
    edges.par_sort_unstable();
    let sum = |same: &[([V; 2], i32)]| (same[0].0, same.iter().map(|edge| edge.1).sum());
    edges.chunk_by(|a, b| a.0 == b.0).map(sum).filter(|(_, sum)| *sum != 0).collect()
}

/// [`Closedness::unbalanced_edges`](super::Closedness) and `inconsistent_edges`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Unbalanced {
    pub edges: usize,
    pub inconsistent: usize,
}

impl Bvh {
    /// What decides whether a point is inside of the surface: [`Closedness::rule`](super::Closedness::rule) of
    /// [`Bvh::closedness`]. Of instances it is found from the open edges of each mesh, which motion does not change.
    pub fn inside_rule(&self) -> InsideRule {
        self.unbalanced().rule()
    }

    /// The number of edges that triangles use more often in one direction than in the other, as that of
    /// [`Bvh::closedness`]; found as [`Bvh::inside_rule`] is.
    pub fn unbalanced_edges(&self) -> usize {
        self.unbalanced().edges
    }

    pub(super) fn unbalanced(&self) -> Unbalanced {
        let Some(parts) = self.instances.parts() else {
            let closedness = self.closedness();
            let (edges, inconsistent) = (closedness.unbalanced_edges, closedness.inconsistent_edges);
            return Unbalanced { edges, inconsistent };
        };
        if let Some(known) = self.unbalanced.get() {
            return *known;
        }
        let precision = self.numerics.precision();
        let mut edges: Vec<([Vertex; 2], i32)> = Vec::new();
        for part in parts {
            let Placed { mesh, placement } = &part.placed;
            let is_mirrored = part.placed.is_mirrored();
            let vertex = |index: u32| {
                vertex_of(placement.point(mesh.positions[index as usize]).map(|x| precision.round(x)))
            };
            let open = part.open_edges().iter().map(|(ends, sum)| (ends.map(vertex), *sum));
            let open = open.filter(|([a, b], _)| a != b);
            edges.extend(open.map(|(ends, sum)| directed(ends, if is_mirrored { -sum } else { sum })));
        }
        let sums = sums(edges);
        let open = self.own_shapes().map_or(0, Shapes::open);
        let found = Unbalanced {
            edges: open + sums.len(),
            inconsistent: sums.iter().filter(|(_, sum)| sum.unsigned_abs() > 1).count(),
        };
        *self.unbalanced.get_or_init(|| found)
    }
}

impl Unbalanced {
    /// See [`Bvh::inside_rule`].
    pub(super) fn rule(self) -> InsideRule {
        match self {
            Unbalanced { edges: 0, .. } => InsideRule::Crossings,
            Unbalanced { inconsistent: 0, .. } => InsideRule::GeneralisedWindingNumber,
            _ => InsideRule::Vote,
        }
    }
}
