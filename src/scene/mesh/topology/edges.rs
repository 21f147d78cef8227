//! Edges and the triangles that use them.

use rayon::prelude::*;

use crate::scene::mesh::topology::components::Components;
use crate::scene::mesh::topology::{BoundaryEdge, Topology, Welded};

/// The use of an edge by a triangle.
#[derive(Clone, Copy)]
struct EdgeUse {
    /// The lower vertex in the upper 32 bits, the higher one in the lower.
    edge: u64,
    triangle: u32,
    /// Whether the triangle runs from the lower to the higher vertex.
    is_forward: bool,
}

impl EdgeUse {
    fn new([from, to]: [u32; 2], triangle: u32) -> Self {
        let edge = u64::from(from.min(to)) << 32 | u64::from(from.max(to));
        EdgeUse { edge, triangle, is_forward: from < to }
    }

    fn vertices(&self) -> [u32; 2] {
        [(self.edge >> 32) as u32, self.edge as u32]
    }

    /// The corner of the triangle that is not on the edge.
    fn opposite(&self, mesh: &Welded) -> u32 {
        let [low, high] = self.vertices();
        let corners = mesh.corners[self.triangle as usize];
        corners.into_iter().find(|&corner| corner != low && corner != high).expect("three distinct corners")
    }
}

/// The uses of all edges, sorted by edge and triangle.
pub(super) struct Edges(Vec<EdgeUse>);

impl Edges {
    pub(super) fn new(mesh: &Welded) -> Self {
        let valid = (0..mesh.corners.len()).into_par_iter().filter(|&triangle| mesh.is_valid(triangle));
        let mut uses: Vec<EdgeUse> = valid
            .flat_map_iter(|triangle| {
                let [a, b, c] = mesh.corners[triangle];
                [[a, b], [b, c], [c, a]].into_iter().map(move |edge| EdgeUse::new(edge, triangle as u32))
            })
            .collect();
        uses.par_sort_unstable_by_key(|edge_use| (edge_use.edge, edge_use.triangle));
        Edges(uses)
    }

    /// Counts the edges by kind, joins the triangles that share one, and returns those of one triangle.
    pub(super) fn classify(
        &self,
        mesh: &Welded,
        topology: &mut Topology,
        components: &mut Components,
    ) -> Vec<BoundaryEdge> {
        let mut boundary = Vec::new();
        for uses in self.0.chunk_by(|a, b| a.edge == b.edge) {
            let EdgeUse { triangle, is_forward, .. } = uses[0];
            let [low, high] = uses[0].vertices();
            let middle = || (mesh.position(low) + mesh.position(high)) / 2.0;
            topology.edges += 1;
            for other in &uses[1..] {
                components.join(triangle, other.triangle);
            }
            match uses {
                [_] => {
                    topology.boundary_edges.add(triangle, middle);
                    boundary.push(BoundaryEdge { vertices: [low, high], triangle });
                }
                [_, other] if other.is_forward == is_forward => {
                    topology.inconsistent_edges.add(triangle, middle);
                }
                [_, _] => {}
                _ => topology.non_manifold_edges.add(triangle, middle),
            }
            let forward = uses.iter().filter(|edge_use| edge_use.is_forward).count();
            if 2 * forward != uses.len() {
                components.open(triangle);
            }
            count_duplicates(uses, mesh, topology);
        }
        boundary
    }
}

/// Counts the triangles on an edge that have the vertices of an earlier one, where the edge is that of the lower two
/// vertices, so that each is counted once.
fn count_duplicates(uses: &[EdgeUse], mesh: &Welded, topology: &mut Topology) {
    let [low, high] = uses[0].vertices();
    let mut opposites: Vec<(u32, u32)> = match uses {
        [_] => return,
        [a, b] if a.opposite(mesh) != b.opposite(mesh) => return,
        _ => uses.iter().map(|edge_use| (edge_use.opposite(mesh), edge_use.triangle)).collect(),
    };
    opposites.sort_unstable();
    for pair in opposites.windows(2) {
        let [(before, _), (vertex, triangle)] = [pair[0], pair[1]];
        if before == vertex && vertex > high {
            let middle = || [low, high, vertex].map(|v| mesh.position(v) / 3.0).into_iter().sum();
            topology.duplicate_triangles.add(triangle, middle);
        }
    }
}
