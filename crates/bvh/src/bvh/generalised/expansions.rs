//! The tree of expansions: built once over the primitives of a surface, of no other layout or preset; over placed
//! meshes, once for each placement, and a tree over these.

use std::f64::consts::PI;
use std::sync::Arc;

use crate::threads::*;
use glam::DVec3;

use crate::bvh::Primitive;
use crate::geometry::{AnalyticShape, Triangle};

/// The bound on the error of a node's expansion within which it is taken.
pub(super) const NODE_ERROR: f64 = 1.0 / 4096.0;

/// The most triangles of a leaf. With more, nodes take less memory.
const LEAF: usize = 8;

/// u, half of [`f64::EPSILON`].
pub(super) const U: f64 = f64::EPSILON / 2.0;

/// More than the rounding of bounds that are computed in f64.
pub(super) const SLACK: f64 = 1.0 + 1.0 / 1024.0;

/// A binary tree of expansions, every node before its descendants.
pub(in crate::bvh) struct Expansions {
    pub(super) nodes: Vec<Node>,
    pub(super) content: Content,
    /// The number of primitives, in parts as well.
    pub(super) count: usize,
    /// Of all primitives, in units of the root's radius.
    sizes: Sizes,
}

/// What nodes have a range of, in the order of leaves.
pub(super) enum Content {
    /// Triangles without area are left out.
    Primitives(Vec<Primitive>),
    /// Parts with primitives; each leaf has one.
    Parts(Vec<Arc<Expansions>>),
}

/// Sums over primitives.
#[derive(Clone, Copy, Default)]
struct Sizes {
    area: f64,
    /// See [`Moments::edges`].
    edges: f64,
    /// At least the integral of |d|³.
    cubes: f64,
}

/// The expansion of consecutive primitives or parts. Lengths are in units of `radius`; factors and 1 / 4 pi are
/// included.
#[derive(Clone, Copy)]
pub(super) struct Node {
    pub first: u32,
    pub end: u32,
    /// The second child; the first follows its parent. 0 for a leaf.
    pub second: u32,
    pub centre: [f64; 3],
    /// No point of the primitives is farther from the centre.
    pub radius: f64,
    /// The square of the distance from which the expansion is taken at a `beta` of 1.
    pub reach_squared: f64,
    /// The error of the expansion, times t⁵, is not more than this.
    pub truncation: f64,
    /// The error by rounding, times t², is not more than this. With A the area of n triangles: their sums and those of
    /// nodes are off by n u of the sum of absolute values, which is less than 5 A t² / 4 pi for t <= 1/2; the
    /// expansion has fewer than 100 roundings.
    pub rounding: f64,
    /// N.
    pub vector: [f64; 3],
    /// xx, yy, xy, xz and yz of M.
    pub matrix: [f64; 5],
    /// xxx, yyy, xxy, xxz, xyy, yyz and xyz of T.
    pub tensor: [f64; 7],
}

/// The integrals of a primitive over d, the vector from a centre, in units of a radius.
struct Moments {
    area: f64,
    /// The lengths of its edges: rounding of its corners moves the normal by less than that share of the radius.
    edges: f64,
    /// The integral of the normal.
    normal: DVec3,
    /// The mean of d.
    mean: DVec3,
    /// The means of d d: xx, yy, zz, xy, xz, yz.
    squares: [f64; 6],
    /// At least the integral of |d|³.
    cubes: f64,
}

impl Moments {
    fn of(primitive: &Primitive, centre: DVec3, radius: f64) -> Self {
        let products = |a: DVec3| [a.x * a.x, a.y * a.y, a.z * a.z, a.x * a.y, a.x * a.z, a.y * a.z];
        match primitive {
            Primitive::Triangle(Triangle(corners)) => {
                let corners = corners.map(|corner| (corner - centre) / radius);
                let normal = Triangle(corners).normal() / 2.0;
                let (area, mean) = (normal.length(), (corners[0] + corners[1] + corners[2]) / 3.0);
                // The mean of the products of two barycentrics is 1/6 if they are the same, else 1/12.
                let [a, b, c] = corners.map(products);
                let of_mean = products(mean);
                let squares =
                    [0, 1, 2, 3, 4, 5].map(|i: usize| (a[i] + b[i] + c[i] + 9.0 * of_mean[i]) / 12.0);
                // |d|³ is convex, so its mean is not above that of the corners.
                let cubes = corners.iter().map(|d| d.length().powi(3)).sum::<f64>() / 3.0 * area;
                let [a, b, c] = corners;
                let edges = a.distance(b) + b.distance(c) + c.distance(a);
                Moments { area, edges, normal, mean, squares, cubes }
            }
            // Seen from outside, the whole of a closed surface has no solid angle.
            Primitive::Analytic(AnalyticShape::Sphere(_)) => {
                let (normal, mean) = (DVec3::ZERO, DVec3::ZERO);
                Moments { area: 0.0, edges: 0.0, normal, mean, squares: [0.0; 6], cubes: 0.0 }
            }
            Primitive::Analytic(AnalyticShape::Disk(disk)) => {
                let (normal, mean) = (disk.normal.normalize(), (disk.centre - centre) / radius);
                let size = disk.radius / radius;
                let area = PI * size * size;
                // A quarter of the square of the radius in every direction of the plane.
                let (flat, of_mean) = (products(normal), products(mean));
                let quarter = size * size / 4.0;
                let squares = [0, 1, 2, 3, 4, 5]
                    .map(|i: usize| of_mean[i] + quarter * (if i < 3 { 1.0 - flat[i] } else { -flat[i] }));
                let cubes = (mean.length() + size).powi(3) * area;
                Moments { area, edges: 0.0, normal: normal * area, mean, squares, cubes }
            }
        }
    }
}

/// The centre of a primitive.
fn centre(primitive: &Primitive) -> DVec3 {
    match primitive {
        Primitive::Triangle(Triangle([a, b, c])) => (*a + *b + *c) / 3.0,
        Primitive::Analytic(AnalyticShape::Sphere(sphere)) => sphere.centre,
        Primitive::Analytic(AnalyticShape::Disk(disk)) => disk.centre,
    }
}

/// The greatest distance of its points from a point.
fn farthest(primitive: &Primitive, from: DVec3) -> f64 {
    match primitive {
        Primitive::Triangle(Triangle(corners)) => {
            corners.map(|p| p.distance(from)).into_iter().fold(0.0, f64::max)
        }
        Primitive::Analytic(AnalyticShape::Sphere(sphere)) => sphere.centre.distance(from) + sphere.radius,
        Primitive::Analytic(AnalyticShape::Disk(disk)) => disk.centre.distance(from) + disk.radius,
    }
}

/// The parts xx, yy, xy, xz and yz of the symmetric tensor of `n d`, with its trace.
fn symmetric(n: DVec3, d: DVec3) -> [f64; 5] {
    [
        n.x * d.x,
        n.y * d.y,
        (n.x * d.y + n.y * d.x) / 2.0,
        (n.x * d.z + n.z * d.x) / 2.0,
        (n.y * d.z + n.z * d.y) / 2.0,
    ]
}

/// The parts of [`Node::tensor`] of the symmetric tensor without trace of `n` and a symmetric matrix, given as
/// [`Moments::squares`].
fn harmonic(n: DVec3, [xx, yy, zz, xy, xz, yz]: [f64; 6]) -> [f64; 7] {
    // The trace of the symmetric tensor, times 3/5 for the components xxx and 1/5 for xxy.
    let all = n * (xx + yy + zz);
    let with = DVec3::new(
        n.x * xx + n.y * xy + n.z * xz,
        n.x * xy + n.y * yy + n.z * yz,
        n.x * xz + n.y * yz + n.z * zz,
    );
    let fifth = (2.0 * with + all) / 15.0;
    [
        n.x * xx - 3.0 * fifth.x,
        n.y * yy - 3.0 * fifth.y,
        (n.y * xx + 2.0 * n.x * xy) / 3.0 - fifth.y,
        (n.z * xx + 2.0 * n.x * xz) / 3.0 - fifth.z,
        (n.x * yy + 2.0 * n.y * xy) / 3.0 - fifth.x,
        (n.z * yy + 2.0 * n.y * yz) / 3.0 - fifth.z,
        (n.x * yz + n.y * xz + n.z * xy) / 3.0,
    ]
}

/// The factors of N, M and T in a node.
const FACTORS: [f64; 3] = [1.0 / (4.0 * PI), -3.0 / (4.0 * PI), 7.5 / (4.0 * PI)];

/// What is added up over primitives, or parts, around a centre and in units of a radius.
#[derive(Default)]
struct MomentSums {
    sizes: Sizes,
    vector: DVec3,
    /// With the trace, which is beside it.
    matrix: [f64; 5],
    trace: f64,
    tensor: [f64; 7],
}

impl MomentSums {
    fn add_primitive(&mut self, primitive: &Primitive, centre: DVec3, radius: f64) {
        let Moments { area, edges, normal, mean, squares, cubes } = Moments::of(primitive, centre, radius);
        self.add_sizes(Sizes { area, edges, cubes });
        self.vector += normal;
        self.trace += normal.dot(mean);
        add(&mut self.matrix, symmetric(normal, mean));
        add(&mut self.tensor, harmonic(normal, squares));
    }

    fn add_sizes(&mut self, Sizes { area, edges, cubes }: Sizes) {
        self.sizes.area += area;
        self.sizes.edges += edges;
        self.sizes.cubes += cubes;
    }

    /// Adds the expansion of a part. With its centre at s, a point at d from there is at s + d: `n (s + d)` and
    /// `n (s + d) (s + d)` are sums of products, whose symmetric parts without trace depend on those of the factors
    /// alone. The cubic root of the integral of |d|³ is a norm.
    fn add_part(&mut self, part: &Expansions, centre: DVec3, radius: f64) {
        let Some(root) = part.nodes.first() else { return };
        let (shift, unit) = ((DVec3::from(root.centre) - centre) / radius, root.radius / radius);
        let Sizes { area, edges, cubes } = part.sizes;
        let area = area * unit * unit;
        let norm = (cubes * unit * unit).cbrt() * unit + shift.length() * area.cbrt();
        self.add_sizes(Sizes { area, edges: edges * unit, cubes: norm.powi(3) });
        let vector = DVec3::from(root.vector) / FACTORS[0] * (unit * unit);
        let matrix = root.matrix.map(|m| m / FACTORS[1] * unit.powi(3));
        self.vector += vector;
        self.trace += vector.dot(shift);
        add(&mut self.matrix, matrix);
        add(&mut self.matrix, symmetric(vector, shift));
        let [xx, yy, xy, xz, yz] = matrix;
        add(&mut self.tensor, root.tensor.map(|m| m / FACTORS[2] * unit.powi(4)));
        add(&mut self.tensor, harmonic(2.0 * shift, [xx, yy, -xx - yy, xy, xz, yz]));
        let DVec3 { x, y, z } = shift;
        add(&mut self.tensor, harmonic(vector, [x * x, y * y, z * z, x * y, x * z, y * z]));
    }

    /// The expansion of a node with `count` primitives in all.
    fn set(mut self, node: &mut Node, centre: DVec3, radius: f64, count: usize) -> Sizes {
        self.matrix[0] -= self.trace / 3.0;
        self.matrix[1] -= self.trace / 3.0;
        let Sizes { area, edges, cubes } = self.sizes;
        let truncation = |t: f64| cubes * SLACK / (4.0 * PI) * (4.5 / (1.0 - t) + t / (1.0 - t).powi(2));
        let mut reach = 0.5;
        while truncation(reach) * f64::powi(reach, 5) > NODE_ERROR {
            reach *= 15.0 / 16.0;
        }
        *node = Node {
            centre: centre.to_array(),
            radius,
            reach_squared: (radius / reach).powi(2),
            truncation: truncation(reach),
            rounding: (512 + count) as f64 * U * (area + edges),
            vector: (self.vector * FACTORS[0]).to_array(),
            matrix: self.matrix.map(|m| m * FACTORS[1]),
            tensor: self.tensor.map(|m| m * FACTORS[2]),
            ..*node
        };
        self.sizes
    }
}

fn add<const N: usize>(sums: &mut [f64; N], parts: [f64; N]) {
    sums.iter_mut().zip(parts).for_each(|(sum, part)| *sum += part);
}

impl Node {
    /// A node without an expansion.
    fn of(first: usize, end: usize) -> Self {
        Node {
            first: first as u32,
            end: end as u32,
            second: 0,
            centre: [0.0; 3],
            radius: 0.0,
            reach_squared: 0.0,
            truncation: 0.0,
            rounding: 0.0,
            vector: [0.0; 3],
            matrix: [0.0; 5],
            tensor: [0.0; 7],
        }
    }

    /// The expansion of primitives of which there are `count` in all.
    fn expand(&mut self, primitives: &[Primitive], count: usize) -> Sizes {
        // Any centre serves; errors are least near that of the area.
        let (mut sum, mut area) = (DVec3::ZERO, 0.0);
        let origin = centre(&primitives[0]);
        for primitive in primitives {
            let weight = match primitive {
                Primitive::Triangle(triangle) => triangle.normal().length(),
                Primitive::Analytic(shape) => 2.0 * shape.area(),
            };
            (sum, area) = (sum + (centre(primitive) - origin) * weight, area + weight);
        }
        let middle = if area > 0.0 { origin + sum / area } else { origin };
        let radius = primitives.iter().map(|p| farthest(p, middle)).fold(0.0, f64::max) * SLACK;
        let mut sums = MomentSums::default();
        primitives.iter().for_each(|primitive| sums.add_primitive(primitive, middle, radius));
        sums.set(self, middle, radius, count)
    }

    /// The expansion of parts, which have `count` primitives together.
    fn expand_parts(&mut self, parts: &[Arc<Expansions>], count: usize) -> Sizes {
        let roots = || parts.iter().map(|part| (&part.nodes[0], part.sizes.area));
        let (mut sum, mut total) = (DVec3::ZERO, 0.0);
        let origin = DVec3::from(parts[0].nodes[0].centre);
        for (root, area) in roots() {
            let weight = area * root.radius * root.radius;
            (sum, total) = (sum + (DVec3::from(root.centre) - origin) * weight, total + weight);
        }
        let middle = if total > 0.0 { origin + sum / total } else { origin };
        let reach = |(root, _): (&Node, f64)| middle.distance(root.centre.into()) + root.radius;
        let radius = roots().map(reach).fold(0.0, f64::max) * SLACK;
        let mut sums = MomentSums::default();
        parts.iter().for_each(|part| sums.add_part(part, middle, radius));
        sums.set(self, middle, radius, count)
    }
}

impl Expansions {
    /// Those of primitives, which depend on their order.
    pub(in crate::bvh) fn new(mut primitives: Vec<Primitive>) -> Self {
        primitives.retain(|primitive| match primitive {
            Primitive::Triangle(triangle) => !triangle.is_degenerate(),
            Primitive::Analytic(_) => true,
        });
        let count = primitives.len();
        let has_shape =
            |primitives: &[Primitive]| primitives.iter().any(|p| matches!(p, Primitive::Analytic(_)));
        // Other shapes have leaves of their own: an open one has no value but by its expansion.
        let is_leaf = |all: &[Primitive]| all.len() <= if has_shape(all) { 1 } else { LEAF };
        let mut nodes = split_all(&mut primitives, is_leaf, centre);
        let sizes = nodes
            .par_iter_mut()
            .with_max_len(64)
            .map(|node| node.expand(&primitives[node.first as usize..node.end as usize], count))
            .collect::<Vec<_>>();
        let sizes = sizes.first().copied().unwrap_or_default();
        Expansions { nodes, content: Content::Primitives(primitives), count, sizes }
    }

    /// Those of parts, which depend on their order.
    pub(in crate::bvh) fn of_parts(parts: impl Iterator<Item = Arc<Expansions>>) -> Self {
        let mut parts: Vec<_> = parts.filter(|part| part.count > 0).collect();
        let count = parts.iter().map(|part| part.count).sum();
        let centre = |part: &Arc<Expansions>| DVec3::from(part.nodes[0].centre);
        let mut nodes = split_all(&mut parts, |parts| parts.len() == 1, centre);
        let expand =
            |node: &mut Node| node.expand_parts(&parts[node.first as usize..node.end as usize], count);
        let sizes: Vec<Sizes> = nodes.iter_mut().map(expand).collect();
        let sizes = sizes.first().copied().unwrap_or_default();
        Expansions { nodes, content: Content::Parts(parts), count, sizes }
    }
}

/// The nodes of items, without expansions; orders the items.
fn split_all<T>(items: &mut [T], is_leaf: impl Fn(&[T]) -> bool, centre: impl Fn(&T) -> DVec3) -> Vec<Node> {
    let mut nodes = Vec::new();
    if !items.is_empty() {
        split(items, 0, &mut nodes, &is_leaf, &centre);
    }
    nodes.shrink_to_fit();
    nodes
}

/// Appends the nodes of items, the first of which is at `first`: halves along the longest side of the bounds of
/// their centres. The depth is the logarithm of their number.
fn split<T>(
    items: &mut [T],
    first: usize,
    nodes: &mut Vec<Node>,
    is_leaf: &impl Fn(&[T]) -> bool,
    centre: &impl Fn(&T) -> DVec3,
) {
    let index = nodes.len();
    nodes.push(Node::of(first, first + items.len()));
    if is_leaf(items) {
        return;
    }
    let bounds = items
        .iter()
        .map(centre)
        .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[min, max], p| [min.min(p), max.max(p)]);
    let axis = (bounds[1] - bounds[0]).max_position();
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |a, b| centre(a)[axis].total_cmp(&centre(b)[axis]));
    let (low, high) = items.split_at_mut(middle);
    split(low, first, nodes, is_leaf, centre);
    nodes[index].second = nodes.len() as u32;
    split(high, first + middle, nodes, is_leaf, centre);
}
