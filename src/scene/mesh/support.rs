//! Maxima of affine functions over what can be seen of a scene (support function values), such as its bounds: analytic
//! shapes, and the vertices of triangles with an area ([`can_be_seen`]).
//!
//! The results equal those of an exhaustive search bit by bit. Bounding boxes of the vertices of each mesh, in a tree, give
//! upper bounds, rounding included; only the vertices of boxes that may contain the maximum are evaluated.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DMat3, DVec3, Vec3Swizzles};

use crate::scene::{Mesh, Object, Placed, Primitive, Shape, Triangle, triangle};

/// A function of points that is affine up to rounding.
pub struct AffineFunction<'a> {
    /// Its maximum over a sphere, given centre and radius, as computed, rounding included; of a point with a radius of 0.
    pub of_sphere: Box<dyn Fn(DVec3, f64) -> f64 + 'a>,
    /// Its gradient.
    pub gradient: DVec3,
    /// Upper bound, on each axis, of the gradient and of every term that it is summed from.
    pub weight: DVec3,
    /// Upper bound, on each axis, of the absolute value added to a point's coordinates.
    pub offset: DVec3,
}

/// Bound of the rounding error of a value, relative to the magnitudes that it is computed from: a few roundings in f64,
/// with a margin.
const ROUNDING: f64 = 1.0 / (1u64 << 44) as f64;

/// Whether a primitive counts.
type Counts = fn(&Primitive) -> bool;

/// Whether a primitive can be seen. A triangle is higher than the rounding of its coordinates; if one is not finite, it
/// cannot.
pub(crate) fn can_be_seen(primitive: &Primitive) -> bool {
    let Primitive::Triangle(triangle) = primitive else { return true };
    let [a, b, c] = triangle.0;
    let (reach, edges) = (a.abs().max(b.abs()).max(c.abs()), (b - a).abs() + (c - a).abs());
    // What rounding of the coordinates changes in the products of two axes.
    let rounding = (reach.yzx() * edges.zxy() + reach.zxy() * edges.yzx()) * ROUNDING;
    let normal = triangle.normal();
    normal.is_finite() && normal.abs().cmpgt(rounding).any()
}

/// The trees over the vertices of the shared meshes of `objects`, which must live as long.
pub(crate) struct PointTrees {
    of_meshes: HashMap<*const Mesh, PointTree>,
    counts: Counts,
}

impl PointTrees {
    pub(crate) fn of(objects: &[Object]) -> Self {
        PointTrees::counting(objects, can_be_seen)
    }

    /// Those of the vertices of triangles that count.
    pub(crate) fn counting(objects: &[Object], counts: Counts) -> Self {
        let mut of_meshes = HashMap::new();
        for object in objects {
            if let Shape::Placed(Placed { mesh, .. }) = &object.shape {
                of_meshes.entry(Arc::as_ptr(mesh)).or_insert_with(|| PointTree::of(mesh, counts));
            }
        }
        PointTrees { of_meshes, counts }
    }
}

/// Maximum of each function over the analytic shapes and the triangles that count of `objects`, among those of `trees`;
/// negative infinity if there are none.
pub(crate) fn maxima<const N: usize>(
    trees: &PointTrees,
    objects: &[Object],
    functions: &[AffineFunction; N],
) -> [f64; N] {
    let mut best = [f64::NEG_INFINITY; N];
    let mut placed: Vec<(&Placed, &PointTree)> = Vec::new();
    for object in objects {
        match &object.shape {
            Shape::Placed(one) if !flattens(one) => {
                placed.push((one, &trees.of_meshes[&Arc::as_ptr(&one.mesh)]));
            }
            // At a scale of 0 all triangles are one point.
            Shape::Placed(Placed { placement, .. })
                if placement.as_one().0 == DMat3::ZERO
                    && !(trees.counts)(&triangle([placement.point(DVec3::ZERO); 3])) => {}
            shape => shape.primitives().for_each(|one| include(&mut best, functions, &one, trees.counts)),
        }
    }
    for (best, function) in best.iter_mut().zip(functions) {
        let bounds: Vec<f64> =
            placed.iter().map(|(one, tree)| Bound::of(function, one, tree).above(&tree.nodes[0])).collect();
        // From the placement of the highest bound on, most bounds are not above the maximum so far.
        let highest = (0..bounds.len()).max_by(|&a, &b| bounds[a].total_cmp(&bounds[b]));
        for index in highest.into_iter().chain(0..bounds.len()) {
            if bounds[index] > *best {
                let (one, tree) = placed[index];
                *best = tree.maximum(function, one, *best);
            }
        }
    }
    best
}

/// Whether a placement takes the area of some triangles.
fn flattens(placed: &Placed) -> bool {
    let linear = placed.placement.as_one().0;
    let lengths = [linear.x_axis, linear.y_axis, linear.z_axis].map(DVec3::length);
    linear.determinant().abs() <= ROUNDING * lengths.iter().product::<f64>()
}

/// Includes a primitive, if it counts.
fn include(best: &mut [f64], functions: &[AffineFunction], primitive: &Primitive, counts: Counts) {
    for (best, function) in best.iter_mut().zip(functions) {
        let of_sphere = |(centre, radius): (DVec3, f64)| (function.of_sphere)(centre, radius);
        let most = match primitive {
            Primitive::Analytic(shape) => of_sphere(shape.support(function.gradient)),
            Primitive::Triangle(Triangle(corners)) => {
                corners.iter().fold(*best, |most, &p| most.max(of_sphere((p, 0.0))))
            }
        };
        if most > *best && counts(primitive) {
            *best = most;
        }
    }
}

/// Upper bound of a function over boxes in the space of a placed mesh: `gradient * point + offset`, rounding included.
struct Bound {
    gradient: DVec3,
    offset: f64,
}

impl Bound {
    fn of(function: &AffineFunction, placed: &Placed, tree: &PointTree) -> Self {
        let (linear, offset) = placed.placement.as_one();
        let numbers = placed.placement.reach(tree.reach) + function.offset;
        let offset = (function.of_sphere)(offset, 0.0) + function.weight.dot(numbers) * ROUNDING;
        Bound { gradient: linear.transpose() * function.gradient, offset }
    }

    /// The bound over a node.
    fn above(&self, node: &Node) -> f64 {
        let bound = self.gradient.dot(node.centre) + self.gradient.abs().dot(node.half) + self.offset;
        // A bound that overflowed to NaN excludes nothing.
        if bound.is_nan() { f64::INFINITY } else { bound }
    }
}

/// The vertices of the triangles of a mesh that count, as a tree of bounding boxes. Inner nodes have 2 children.
struct PointTree {
    /// The root first.
    nodes: Vec<Node>,
    points: Vec<DVec3>,
    /// Largest absolute coordinates.
    reach: DVec3,
}

/// The bounding box of the points from `first` to `end`, and the first of its children, which follow one another; 0 in
/// a leaf.
struct Node {
    centre: DVec3,
    half: DVec3,
    first: usize,
    end: usize,
    children: usize,
}

/// Maximum number of points in a leaf.
const MAX_LEAF_POINTS: usize = 16;

impl PointTree {
    /// Splits the points at the median along the longest axis.
    fn of(mesh: &Mesh, counts: Counts) -> Self {
        let mut used = vec![false; mesh.positions.len()];
        let corners = |t: &[u32; 3]| triangle(t.map(|i| mesh.positions[i as usize]));
        let counting = mesh.triangles.iter().filter(|t| counts(&corners(t)));
        counting.flatten().for_each(|&i| used[i as usize] = true);
        let mut points: Vec<DVec3> =
            mesh.positions.iter().zip(used).filter(|(_, used)| *used).map(|(&p, _)| p).collect();
        let mut nodes = vec![Node::new(&points, 0, points.len())];
        let mut index = 0;
        while let Some(&Node { half, first, end, .. }) = nodes.get(index) {
            if end - first > MAX_LEAF_POINTS {
                let (axis, middle) = (half.max_position(), (end - first) / 2);
                points[first..end].select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
                nodes[index].children = nodes.len();
                let middle = first + middle;
                nodes.push(Node::new(&points, first, middle));
                nodes.push(Node::new(&points, middle, end));
            }
            index += 1;
        }
        let reach = points.iter().fold(DVec3::ZERO, |reach, p| p.abs().max(reach));
        PointTree { nodes, points, reach }
    }

    /// The maximum of a function over the placed points, and `best`.
    fn maximum(&self, function: &AffineFunction, placed: &Placed, mut best: f64) -> f64 {
        let bound = Bound::of(function, placed, self);
        let mut open = vec![0];
        while let Some(index) = open.pop() {
            let node = &self.nodes[index];
            if bound.above(node) <= best {
                continue;
            }
            if node.children == 0 {
                let points = &self.points[node.first..node.end];
                let values = points.iter().map(|&p| (function.of_sphere)(placed.placement.point(p), 0.0));
                best = values.fold(best, f64::max);
                continue;
            }
            let [a, b] = [node.children, node.children + 1];
            // The higher one is visited first.
            let is_a_higher = bound.above(&self.nodes[a]) > bound.above(&self.nodes[b]);
            open.extend(if is_a_higher { [b, a] } else { [a, b] });
        }
        best
    }
}

impl Node {
    fn new(points: &[DVec3], first: usize, end: usize) -> Self {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        // In this argument order `min` and `max` ignore NaN.
        for p in &points[first..end] {
            (min, max) = (p.min(min), p.max(max));
        }
        Node { centre: min / 2.0 + max / 2.0, half: max / 2.0 - min / 2.0, first, end, children: 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Placement, Scene};
    use glam::{DMat4, DQuat};

    /// Points on a sphere, instanced a hundred times, a few of them flattened, and one to a point: the bounds equal
    /// those of the baked copies, bit by bit.
    #[test]
    fn placed_meshes_reach_as_far_as_their_copies() {
        let turn = |i: u32| {
            let angle = f64::from(i) * 2.399_963;
            let z = 1.0 - 2.0 * f64::from(i % 997) / 997.0;
            DVec3::new(angle.cos() * (1.0 - z * z).sqrt(), angle.sin() * (1.0 - z * z).sqrt(), z)
        };
        let mesh = Arc::new(Mesh {
            positions: (0..3000).map(turn).collect(),
            triangles: (0..1000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            ..Mesh::default()
        });
        for far in [0.0, 1e6] {
            let places = (0..100).map(|i| {
                let [mut at, mut scale] = [turn(i) * 3.0 + far, turn(i * 7 + 3).abs() + 0.1];
                if i % 16 < 3 {
                    scale[i as usize % 3] = 0.0;
                }
                if i == 50 {
                    (at, scale) = (at * 2.0 + 9.0, DVec3::ZERO);
                }
                let rotation = DQuat::from_rotation_y(f64::from(i)) * DQuat::from_rotation_x(0.3);
                let map = DMat4::from_scale_rotation_translation(scale, rotation, at);
                Placed::new(mesh.clone(), Placement::new(map))
            });
            let placed: Vec<Placed> = places.collect();
            let copies: Scene = placed.iter().map(|p| Shape::Mesh(p.bake())).collect();
            let shared: Scene = placed.into_iter().map(Shape::Placed).collect();
            assert_eq!(shared.bounds(), copies.bounds());
            assert!(shared.bounds().is_some_and(|(_, max)| max.max_element() < far + 5.0));
        }
    }
}
