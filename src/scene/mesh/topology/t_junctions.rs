//! T-junctions: vertices of the boundary in the interior of a boundary edge, where rays pass between the triangles of
//! both sides. Found with a k-d tree over the vertices of the boundary (Bentley, Multidimensional Binary Search Trees
//! Used for Associative Searching, 1975).

use std::sync::atomic::{AtomicU32, Ordering};

use glam::DVec3;
use rayon::prelude::*;

use crate::bvh::Triangle;
use crate::scene::mesh::topology::{BoundaryEdge, Findings, Welded};

/// Vertices in a leaf.
const LEAF: usize = 8;

/// Vertices below which a subtree is built by one thread.
const SERIAL: usize = 4096;

/// Edges that are searched in parallel before the number of tests is checked.
const BATCH: usize = 1024;

/// Vertices tested for an edge, on average, above which the search ends. The leaves at the ends of an edge have 16; long
/// edges that all lie along one line need as many as there are vertices.
const MAX_TESTS: usize = 300;

/// Finds T-junctions, and tells whether the search ended before the last edge.
pub(super) fn find(mesh: &Welded, boundary: &[BoundaryEdge]) -> (Findings, bool) {
    find_within(mesh, boundary, MAX_TESTS * boundary.len().max(BATCH))
}

/// [`find`], ending after a batch with which more than `budget` vertices were tested. The result does not depend on
/// the number of threads.
pub(super) fn find_within(mesh: &Welded, boundary: &[BoundaryEdge], budget: usize) -> (Findings, bool) {
    let mut vertices: Vec<u32> = boundary.iter().flat_map(|edge| edge.vertices).collect();
    vertices.par_sort_unstable();
    vertices.dedup();
    // With their positions, which the tree reads in its own order.
    let mut vertices: Vec<Vertex> =
        vertices.into_iter().map(|vertex| (mesh.position(vertex), vertex)).collect();
    let Some(tree) = Node::new(&mut vertices) else { return (Findings::default(), false) };
    // For each vertex, the lowest triangle with an edge that it lies on.
    let lowest: Vec<AtomicU32> = mesh.positions.iter().map(|_| AtomicU32::new(u32::MAX)).collect();
    let search = |edge: &BoundaryEdge| {
        let mut tests = 0;
        let segment = Segment::new(edge.vertices.map(|vertex| mesh.position(vertex)));
        tree.visit(&segment, &mut |(position, vertex)| {
            tests += 1;
            if !edge.vertices.contains(&vertex) && segment.has(position) {
                lowest[vertex as usize].fetch_min(edge.triangle, Ordering::Relaxed);
            }
        });
        tests
    };
    // Edges in the order of the tree's vertices, so that successive searches read the same nodes.
    let mut rank = vec![0; mesh.positions.len()];
    tree.number(&mut 0, &mut rank);
    let mut order: Vec<(u32, &BoundaryEdge)> =
        boundary.iter().map(|edge| (rank[edge.vertices[0] as usize], edge)).collect();
    order.par_sort_unstable_by_key(|(rank, edge)| (*rank, edge.vertices[1], edge.triangle));
    let (mut tests, mut is_cut_off) = (0, false);
    for batch in order.chunks(BATCH) {
        if tests > budget {
            is_cut_off = true;
            break;
        }
        tests += batch.par_iter().map(|(_, edge)| search(edge)).sum::<usize>();
    }
    let mut findings = Findings::default();
    let lowest = lowest.into_iter().map(AtomicU32::into_inner);
    for (&position, triangle) in mesh.positions.iter().zip(lowest).filter(|(_, lowest)| *lowest != u32::MAX) {
        findings.add(triangle, || position);
    }
    (findings, is_cut_off)
}

/// A line segment.
struct Segment {
    ends: [DVec3; 2],
    min: DVec3,
    max: DVec3,
    /// Half the vector between the ends.
    half: DVec3,
}

impl Segment {
    fn new(ends: [DVec3; 2]) -> Self {
        let [a, b] = ends;
        Segment { ends, min: a.min(b), max: a.max(b), half: (b - a) / 2.0 }
    }

    /// Whether a point other than the ends lies on the segment, exactly.
    fn has(&self, point: DVec3) -> bool {
        let [a, b] = self.ends;
        let is_in_box = point.cmpge(self.min).all() && point.cmple(self.max).all();
        is_in_box && Triangle([a, b, point]).is_degenerate()
    }

    /// Whether the segment may overlap a box: no false negatives. Separating axes (Ericson, Real-Time Collision
    /// Detection, 2005, section 5.3.3), with margins for rounding.
    fn may_overlap(&self, min: DVec3, max: DVec3) -> bool {
        if self.max.cmplt(min).any() || self.min.cmpgt(max).any() {
            return false;
        }
        if self.min.cmpge(min).all() && self.max.cmple(max).all() {
            return true;
        }
        let reach = min.abs().max(max.abs()).max(self.min.abs()).max(self.max.abs()).max_element();
        let extent = (max - min) / 2.0 + 8.0 * f64::EPSILON * reach;
        let (middle, half) = (self.ends[0] + self.half - (min + max) / 2.0, self.half);
        (0..3).all(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let (p, q) = (middle[j] * half[k], middle[k] * half[j]);
            let radius = extent[j] * half[k].abs() + extent[k] * half[j].abs();
            (p - q).abs() <= radius + 8.0 * f64::EPSILON * (p.abs() + q.abs())
        })
    }
}

/// A position and the index of its vertex.
type Vertex = (DVec3, u32);

/// A node of the tree, with the bounding box of its vertices.
struct Node<'a> {
    min: DVec3,
    max: DVec3,
    content: Content<'a>,
}

enum Content<'a> {
    Leaf(&'a [Vertex]),
    Inner(Box<[Node<'a>; 2]>),
}

impl<'a> Node<'a> {
    /// A tree over vertices, which are reordered; `None` without any.
    fn new(vertices: &'a mut [Vertex]) -> Option<Self> {
        let (min, max) =
            vertices.iter().map(|&(p, _)| (p, p)).reduce(|(min, max), (p, _)| (min.min(p), max.max(p)))?;
        if vertices.len() <= LEAF {
            return Some(Node { min, max, content: Content::Leaf(vertices) });
        }
        let axis = (max - min).max_position();
        let half = vertices.len() / 2;
        vertices.select_nth_unstable_by(half, |(a, _), (b, _)| a[axis].total_cmp(&b[axis]));
        let is_serial = vertices.len() < SERIAL;
        let (below, above) = vertices.split_at_mut(half);
        let (below, above) = if is_serial {
            (Node::new(below), Node::new(above))
        } else {
            rayon::join(|| Node::new(below), || Node::new(above))
        };
        Some(Node { min, max, content: Content::Inner(Box::new([below?, above?])) })
    }

    /// Numbers the vertices in their order in the tree.
    fn number(&self, next: &mut u32, rank: &mut [u32]) {
        match &self.content {
            Content::Leaf(vertices) => {
                for &(_, vertex) in *vertices {
                    rank[vertex as usize] = *next;
                    *next += 1;
                }
            }
            Content::Inner(children) => children.iter().for_each(|child| child.number(next, rank)),
        }
    }

    /// Calls `visit` for each vertex that may lie on a segment.
    fn visit(&self, segment: &Segment, visit: &mut impl FnMut(Vertex)) {
        if !segment.may_overlap(self.min, self.max) {
            return;
        }
        match &self.content {
            Content::Leaf(vertices) => vertices.iter().for_each(|&vertex| visit(vertex)),
            Content::Inner(children) => children.iter().for_each(|child| child.visit(segment, visit)),
        }
    }
}
