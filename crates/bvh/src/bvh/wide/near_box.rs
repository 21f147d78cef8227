//! The traversal for what is near a point or a box: nearest nodes first, up to a distance.

use glam::DVec3;

use super::layout::{Child, Content, Node, WIDTH, Wide};
use crate::bvh::{Primitive, Tests, Traversal};
use crate::geometry::{NO_PRIMITIVE, PrimId, Tier, Triangle, round_down};

/// See [`Nearby::each_near_box`](crate::bvh::Nearby::each_near_box).
pub(super) fn visit<T: Tier>(
    wide: &Wide<T>,
    corners: [DVec3; 2],
    mut limit: f64,
    visit: &mut dyn FnMut(PrimId, Primitive) -> f64,
    Traversal { children: stack, tests, .. }: &mut Traversal,
) {
    descend_near(&wide.nodes, corners, limit, stack, tests, |leaf, tests| {
        match leaf.content() {
            Content::Node(_) => {}
            Content::Triangles(leaves) => {
                for leaf in &wide.triangles[leaves.start as usize..leaves.end as usize] {
                    for (lane, &id) in leaf.ids.iter().enumerate().filter(|(_, id)| **id != NO_PRIMITIVE) {
                        tests.primitives += 1;
                        let corners = leaf.corners.corners_f64(lane).map(Into::into);
                        limit = visit(PrimId(id), Primitive::Triangle(Triangle(corners)));
                    }
                }
            }
            Content::Analytic(shapes) => {
                for (shape, prim) in &wide.analytic[shapes.start as usize..shapes.end as usize] {
                    tests.primitives += 1;
                    limit = shape.map_or(limit, |shape| visit(*prim, Primitive::Analytic(shape)));
                }
            }
        }
        limit
    });
}

/// Calls `leaf` with the leaves that are no farther from a box than `limit`, or than the distance that it returned
/// last, the nearest nodes first.
#[inline(always)]
pub(crate) fn descend_near(
    nodes: &[Node],
    corners: [DVec3; 2],
    mut limit: f64,
    stack: &mut Vec<(Child, f32)>,
    tests: &mut Tests,
    mut leaf: impl FnMut(Child, &mut Tests) -> f64,
) {
    stack.clear();
    stack.extend((!nodes.is_empty()).then_some((Child::node(0), 0.0)));
    while let Some((child, distance)) = stack.pop() {
        if f64::from(distance) > limit {
            continue;
        }
        let Content::Node(index) = child.content() else {
            limit = leaf(child, tests);
            continue;
        };
        tests.nodes += 1;
        let node = &nodes[index as usize];
        let (distances, first) = (distances(node, corners), stack.len());
        let near = node.places().filter(|&place| f64::from(distances[place]) <= limit);
        stack.extend(near.map(|place| (node.children[place], distances[place])));
        stack[first..].sort_unstable_by(|a, b| b.1.total_cmp(&a.1));
    }
}

/// The distances of a box from those of a node, rounded down, and by 2^-23 more for the rounding of the closest
/// points.
#[inline(always)]
fn distances(node: &Node, [min, max]: [DVec3; 2]) -> [f32; WIDTH] {
    let mut squares = [0.0; WIDTH];
    for (axis, [lower, upper]) in node.planes.iter().enumerate() {
        for place in 0..WIDTH {
            let below = f64::from(lower[place]) - max[axis];
            let above = min[axis] - f64::from(upper[place]);
            let beside = below.max(above).max(0.0);
            squares[place] += beside * beside;
        }
    }
    const SHORTER: f64 = 1.0 - f32::EPSILON as f64;
    squares.map(|square: f64| round_down(square.sqrt() * SHORTER))
}
