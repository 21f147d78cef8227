//! The tree of expansions: built once over the primitives of a surface, of no other layout or preset.

use std::f64::consts::PI;

use crate::threads::*;
use glam::DVec3;

use crate::bvh::{Bvh, Primitive};
use crate::geometry::{AnalyticShape, Triangle};

/// The bound on the error of a node's expansion within which it is taken.
pub(super) const NODE_ERROR: f64 = 1.0 / 4096.0;

/// The most triangles of a leaf.
const LEAF: usize = 4;

/// u, half of [`f64::EPSILON`].
pub(super) const U: f64 = f64::EPSILON / 2.0;

/// More than the rounding of bounds that are computed in f64.
pub(super) const SLACK: f64 = 1.0 + 1.0 / 1024.0;

/// A binary tree of expansions, every node before its descendants.
pub(in crate::bvh) struct Expansions {
    pub(super) nodes: Vec<Node>,
    /// In the order of leaves. Triangles without area are left out.
    pub(super) primitives: Vec<Primitive>,
}

/// The expansion of consecutive primitives. Lengths are in units of `radius`, factors and 1 / 4 pi are included.
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

impl Node {
    /// The expansion of primitives of which there are `count` in all.
    fn expand(&mut self, primitives: &[Primitive], count: usize) {
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
        let (mut area, mut edges, mut cubes, mut vector, mut trace) = (0.0, 0.0, 0.0, DVec3::ZERO, 0.0);
        let (mut matrix, mut tensor) = ([0.0; 5], [0.0; 7]);
        for primitive in primitives {
            let Moments { area: of_area, edges: of_edges, normal: n, mean: d, squares, cubes: of_cubes } =
                Moments::of(primitive, middle, radius);
            let [xx, yy, zz, xy, xz, yz] = squares;
            area += of_area;
            edges += of_edges;
            cubes += of_cubes;
            vector += n;
            trace += n.dot(d);
            let symmetric = [
                n.x * d.x,
                n.y * d.y,
                (n.x * d.y + n.y * d.x) / 2.0,
                (n.x * d.z + n.z * d.x) / 2.0,
                (n.y * d.z + n.z * d.y) / 2.0,
            ];
            // The trace of the symmetric tensor, times 3/5 for the components xxx and 1/5 for xxy.
            let all = n * (xx + yy + zz);
            let with = DVec3::new(
                n.x * xx + n.y * xy + n.z * xz,
                n.x * xy + n.y * yy + n.z * yz,
                n.x * xz + n.y * yz + n.z * zz,
            );
            let fifth = (2.0 * with + all) / 15.0;
            let harmonic = [
                n.x * xx - 3.0 * fifth.x,
                n.y * yy - 3.0 * fifth.y,
                (n.y * xx + 2.0 * n.x * xy) / 3.0 - fifth.y,
                (n.z * xx + 2.0 * n.x * xz) / 3.0 - fifth.z,
                (n.x * yy + 2.0 * n.y * xy) / 3.0 - fifth.x,
                (n.z * yy + 2.0 * n.y * yz) / 3.0 - fifth.z,
                (n.x * yz + n.y * xz + n.z * xy) / 3.0,
            ];
            matrix.iter_mut().zip(symmetric).for_each(|(sum, part)| *sum += part);
            tensor.iter_mut().zip(harmonic).for_each(|(sum, part)| *sum += part);
        }
        matrix[0] -= trace / 3.0;
        matrix[1] -= trace / 3.0;
        let over = 1.0 / (4.0 * PI);
        let truncation = |t: f64| cubes * SLACK * over * (4.5 / (1.0 - t) + t / (1.0 - t).powi(2));
        let mut reach = 0.5;
        while truncation(reach) * f64::powi(reach, 5) > NODE_ERROR {
            reach *= 15.0 / 16.0;
        }
        *self = Node {
            centre: middle.to_array(),
            radius,
            reach_squared: (radius / reach).powi(2),
            truncation: truncation(reach),
            rounding: (512 + count) as f64 * U * (area + edges),
            vector: (vector * over).to_array(),
            matrix: matrix.map(|m| -3.0 * over * m),
            tensor: tensor.map(|m| 7.5 * over * m),
            ..*self
        };
    }
}

impl Expansions {
    /// Those of the primitives of a structure, which depend on nothing else of it.
    pub(super) fn new(bvh: &Bvh) -> Self {
        let mut found = Vec::new();
        bvh.each_oriented(|prim, primitive| {
            let is_flat = matches!(primitive, Primitive::Triangle(triangle) if triangle.is_degenerate());
            if !is_flat {
                found.push((prim, primitive));
            }
        });
        // A split triangle is in several slots.
        found.sort_unstable_by_key(|(prim, _)| *prim);
        found.dedup_by_key(|(prim, _)| *prim);
        let mut primitives: Vec<Primitive> = found.into_iter().map(|(_, primitive)| primitive).collect();
        let mut nodes = Vec::with_capacity(primitives.len());
        if !primitives.is_empty() {
            split(&mut primitives, 0, &mut nodes);
        }
        let count = primitives.len();
        nodes.par_iter_mut().with_max_len(64).for_each(|node| {
            node.expand(&primitives[node.first as usize..node.end as usize], count);
        });
        Expansions { nodes, primitives }
    }
}

/// Appends the nodes of primitives, the first of which is at `first`: halves along the longest side of the bounds of
/// their centres. The depth is the logarithm of their number.
fn split(primitives: &mut [Primitive], first: usize, nodes: &mut Vec<Node>) {
    let (index, end) = (nodes.len(), first + primitives.len());
    nodes.push(Node {
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
    });
    // Other shapes have leaves of their own: an open one has no value but by its expansion.
    let has_shape = primitives.iter().any(|primitive| matches!(primitive, Primitive::Analytic(_)));
    if primitives.len() <= if has_shape { 1 } else { LEAF } {
        return;
    }
    let bounds = primitives
        .iter()
        .map(centre)
        .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[min, max], p| [min.min(p), max.max(p)]);
    let axis = (bounds[1] - bounds[0]).max_position();
    let middle = primitives.len() / 2;
    primitives.select_nth_unstable_by(middle, |a, b| centre(a)[axis].total_cmp(&centre(b)[axis]));
    let (low, high) = primitives.split_at_mut(middle);
    split(low, first, nodes);
    nodes[index].second = nodes.len() as u32;
    split(high, first + middle, nodes);
}
