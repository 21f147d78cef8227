//! Connected components, and the signed volume of closed ones.

use crate::scene::mesh::topology::{BoundaryEdge, Topology, Welded};

/// Disjoint sets (Tarjan, Efficiency of a Good But Not Linear Set Union Algorithm, 1975), with path halving.
pub(crate) struct Sets(Vec<u32>);

impl Sets {
    /// Sets of one member each.
    pub(crate) fn new(count: usize) -> Self {
        Sets((0..count as u32).collect())
    }

    /// The representative of a set: its lowest member.
    pub(crate) fn find(&mut self, mut member: u32) -> u32 {
        while self.0[member as usize] != member {
            let above = self.0[member as usize];
            self.0[member as usize] = self.0[above as usize];
            member = above;
        }
        member
    }

    /// Joins the sets of two members.
    pub(crate) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

/// The components of the triangles that are connected by edges.
pub(super) struct Components {
    sets: Sets,
    /// Whether a triangle has an edge that its component uses more often in one direction than in the other.
    is_open: Vec<bool>,
}

/// Six times the signed volume of a component.
#[derive(Clone, Copy, Default)]
struct Volume {
    triangles: usize,
    is_open: bool,
    sum: f64,
    /// Sum of the absolute values of all products.
    permanent: f64,
}

impl Volume {
    /// Whether the sum is negative beyond its rounding error: at most 8 roundings a product, and one an addition
    /// (Higham, Accuracy and Stability of Numerical Algorithms, 2nd edition, section 4.2).
    fn is_negative(&self) -> bool {
        self.sum < -((self.triangles + 16) as f64 * f64::EPSILON * self.permanent)
    }
}

impl Components {
    pub(super) fn new(triangles: usize) -> Self {
        Components { sets: Sets::new(triangles), is_open: vec![false; triangles] }
    }

    /// Joins the components of two triangles.
    pub(super) fn join(&mut self, a: u32, b: u32) {
        self.sets.join(a, b);
    }

    /// Marks the component of a triangle as not closed.
    pub(super) fn open(&mut self, triangle: u32) {
        self.is_open[triangle as usize] = true;
    }

    /// Counts the components, the closed and the inverted ones, and finds the closed objects, given by their first
    /// triangles.
    pub(super) fn measure(mut self, mesh: &Welded, firsts: &[u32], topology: &mut Topology) {
        let mut number = vec![u32::MAX; mesh.corners.len()];
        let mut volumes: Vec<(u32, Volume)> = Vec::new();
        for triangle in (0..mesh.corners.len()).filter(|&triangle| mesh.is_valid(triangle)) {
            let root = self.sets.find(triangle as u32);
            let number = &mut number[root as usize];
            if *number == u32::MAX {
                *number = volumes.len() as u32;
                volumes.push((root, Volume::default()));
            }
            let volume = &mut volumes[*number as usize].1;
            volume.triangles += 1;
            volume.is_open |= self.is_open[triangle];
            // Relative to a corner of the component, which keeps digits far from the origin.
            let origin = mesh.position(mesh.corners[root as usize][0]);
            let [a, b, c] = mesh.corners[triangle].map(|corner| mesh.position(corner) - origin);
            volume.sum += a.dot(b.cross(c));
            let (b, c) = (b.abs(), c.abs());
            volume.permanent += a.abs().dot(glam::DVec3::new(
                b.y * c.z + b.z * c.y,
                b.z * c.x + b.x * c.z,
                b.x * c.y + b.y * c.x,
            ));
        }
        topology.components = volumes.len();
        for (triangle, _) in volumes.iter().filter(|(_, volume)| !volume.is_open && volume.is_negative()) {
            let corners = mesh.corners[*triangle as usize];
            let middle = || corners.map(|corner| mesh.position(corner) / 3.0).into_iter().sum();
            topology.inverted_components.add(*triangle, middle);
        }
        topology.closed_components = volumes.iter().filter(|(_, volume)| !volume.is_open).count();
        let ends = firsts.iter().skip(1).copied().chain([mesh.corners.len() as u32]);
        let objects = firsts.iter().zip(ends).map(|(&first, end)| {
            let mut triangles = (first..end).filter(|&triangle| mesh.is_valid(triangle as usize)).peekable();
            triangles.peek()?;
            let mut component = |triangle| volumes[number[self.sets.find(triangle) as usize] as usize].1;
            Some(triangles.all(|triangle| !component(triangle).is_open))
        });
        topology.closed_objects = objects.collect();
    }
}

/// The number of connected components of edges.
pub(super) fn count_connected(edges: &[BoundaryEdge], vertices: usize) -> usize {
    if edges.is_empty() {
        return 0;
    }
    let mut sets = Sets::new(vertices);
    edges.iter().for_each(|edge| sets.join(edge.vertices[0], edge.vertices[1]));
    // Each component has one root.
    edges
        .iter()
        .flat_map(|edge| edge.vertices)
        .filter(|&vertex| sets.find(vertex) == vertex)
        .collect::<std::collections::HashSet<u32>>()
        .len()
}
