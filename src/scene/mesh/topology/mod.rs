//! Topology of triangle meshes: what makes a mesh leak, turn inside out or shade wrongly.
//!
//! Vertices are welded by exact position (-0 equals 0), because meshes repeat a vertex where its attributes differ.
//! Triangles with two equal vertices are ignored; those with three distinct collinear vertices are not, because they
//! close T-junctions.
//!
//! ```
//! use kiln::scene::mesh::topology::Topology;
//!
//! // A square of two triangles: five edges, of which four have one triangle only and surround it.
//! let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]].map(Into::into);
//! let topology = Topology::of_triangles(&square, &[[0, 1, 2], [0, 2, 3]]);
//! assert_eq!((topology.edges, topology.boundary_edges.count, topology.holes), (5, 4, 1));
//! ```

mod components;
mod edges;
mod normals;
mod of_scene;
mod t_junctions;
#[cfg(test)]
mod tests;
mod weld;

use glam::DVec3;

use components::Components;
pub(crate) use components::Sets;
use edges::Edges;

/// Topology of triangles.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Topology {
    /// Number of distinct vertices of the triangles.
    pub vertices: usize,
    /// Number of distinct edges.
    pub edges: usize,
    /// Edges of exactly one triangle.
    pub boundary_edges: Findings,
    /// Connected components of the boundary edges: holes of a closed surface, rims of an open one.
    pub holes: usize,
    /// Edges of more than two triangles.
    pub non_manifold_edges: Findings,
    /// Edges of two triangles that run along them in the same direction, so that their normals disagree.
    pub inconsistent_edges: Findings,
    /// Vertices of the boundary that lie in the interior of a boundary edge, by an exact collinearity test.
    pub t_junctions: Findings,
    /// Whether there may be more T-junctions, because the search was cut off: too many edges lie along one line.
    pub t_junctions_cut_off: bool,
    /// Triangles with the vertices of an earlier triangle, in any order.
    pub duplicate_triangles: Findings,
    /// Sets of triangles that are connected by edges.
    pub components: usize,
    /// Components that use each edge as often in one direction as in the other, so that they enclose a volume.
    pub closed_components: usize,
    /// For each object of the scene, in order, whether all of its triangles are in closed components, which may go on in
    /// other objects; `None` for an object without triangles of three distinct vertices.
    pub closed_objects: Vec<Option<bool>>,
    /// Closed components of negative signed volume: their normals point inwards. The inner wall of a hollow body is
    /// one by design.
    pub inverted_components: Findings,
    /// Triangles whose geometric normal opposes the shading normals of at least two of their corners.
    pub opposed_to_normals: Findings,
}

/// The number of findings of a kind, and where the first is.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Findings {
    /// Their number.
    pub count: usize,
    /// The one with the lowest triangle.
    pub first: Option<Location>,
}

/// A place on a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Location {
    /// Index of the object in [`crate::scene::Scene::objects`]; 0 for triangles without a scene.
    pub object: usize,
    /// Index of a triangle.
    pub triangle: u32,
    /// The middle of the edge or triangle, or the vertex.
    pub position: DVec3,
}

impl Findings {
    fn add(&mut self, triangle: u32, position: impl FnOnce() -> DVec3) {
        self.count += 1;
        if self.first.is_none_or(|first| triangle < first.triangle) {
            self.first = Some(Location { object: 0, triangle, position: position() });
        }
    }
}

impl Topology {
    /// Topology of triangles as one object, without [`Topology::opposed_to_normals`]. Positions must be finite. Takes
    /// time O(n log n), in parallel.
    pub fn of_triangles(positions: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        Topology::of_objects(positions, triangles, &[0])
    }

    /// [`Topology::of_triangles`] of objects, given by the first triangle of each, in order.
    fn of_objects(positions: &[DVec3], triangles: &[[u32; 3]], firsts: &[u32]) -> Self {
        let corners = weld::welded_corners(positions, triangles);
        let mesh = Welded { positions, corners: &corners };
        let edges = Edges::new(&mesh);
        let mut components = Components::new(triangles.len());
        let mut topology =
            Topology { vertices: weld::count_vertices(&corners, positions.len()), ..Self::default() };
        let boundary = edges.classify(&mesh, &mut topology, &mut components);
        drop(edges);
        components.measure(&mesh, firsts, &mut topology);
        topology.holes = components::count_connected(&boundary, positions.len());
        (topology.t_junctions, topology.t_junctions_cut_off) = t_junctions::find(&mesh, &boundary);
        topology
    }

    /// All findings, with a name and what they are, for people.
    pub fn findings(&self) -> [(&'static str, &Findings, &'static str); 7] {
        [
            ("boundary_edges", &self.boundary_edges, "boundary edge(s) of one triangle only"),
            ("non_manifold_edges", &self.non_manifold_edges, "edge(s) of more than two triangles"),
            (
                "inconsistent_edges",
                &self.inconsistent_edges,
                "edge(s) with inconsistent winding, between a front and a back side",
            ),
            ("t_junctions", &self.t_junctions, "T-junction(s), vertices inside a boundary edge"),
            (
                "duplicate_triangles",
                &self.duplicate_triangles,
                "triangle(s) with the vertices of an earlier one",
            ),
            (
                "inverted_components",
                &self.inverted_components,
                "closed component(s) inside out, unless they are inner walls of hollow bodies",
            ),
            (
                "opposed_to_normals",
                &self.opposed_to_normals,
                "triangle(s) wound against their vertex normals",
            ),
        ]
    }
}

/// Triangles with welded corners.
struct Welded<'a> {
    positions: &'a [DVec3],
    /// Of the positions that are equal, the index of the first.
    corners: &'a [[u32; 3]],
}

impl Welded<'_> {
    fn position(&self, vertex: u32) -> DVec3 {
        self.positions[vertex as usize]
    }

    /// Whether the corners are distinct.
    fn is_valid(&self, triangle: usize) -> bool {
        let [a, b, c] = self.corners[triangle];
        a != b && b != c && c != a
    }
}

/// An edge of exactly one triangle.
struct BoundaryEdge {
    vertices: [u32; 2],
    triangle: u32,
}
