//! The traversal for one ray: from the root down, the nearest child first, the others on a stack. [`descend`] leaves
//! leaves to its caller; it also serves instances and crossings.
//!
//! [`box_ray`] tests the ray against the eight boxes of a node, [`leaf`] against the primitives of a leaf.

pub(crate) mod box_ray;
pub(crate) mod leaf;

use super::layout::{Child, Node, WIDTH, Wide};
use crate::bvh::{Next, Tests};
use crate::geometry::simd::Simd;
use crate::geometry::{Hit, PreparedRay, Ray, Tier};
use box_ray::BoxRay;
use leaf::hits_in_leaf;

/// Calls `found` with the hits of the ray until it returns [`Next::Stop`]; nearest boxes first if `NEAREST`. `FUSED`
/// requires a direction without zeros.
#[inline(always)]
pub(crate) fn traverse<T: Tier, S: Simd, const FUSED: bool, const NEAREST: bool>(
    simd: S,
    wide: &Wide<T>,
    ray: &Ray,
    stack: &mut Vec<(Child, f32)>,
    tests: &mut Tests,
    mut found: impl FnMut(Hit) -> Next,
) {
    simd.run(
        #[inline(always)]
        move || {
            let boxes = BoxRay::new(ray, FUSED, T::IS_FAST);
            let mut prepared = T::Prepared::new(ray);
            descend::<S, FUSED, NEAREST>(
                (&wide.nodes, wide.depth),
                &boxes,
                ray.t_max,
                T::IS_FAST,
                stack,
                tests,
                #[inline(always)]
                |leaf, _, tests| {
                    tests.primitives += leaf.range().len() as u64;
                    let next = hits_in_leaf::<T, S>(wide, ray, &prepared, leaf, &mut found);
                    if let Next::Shorten(t) = next {
                        prepared.shorten(t);
                    }
                    next
                },
            );
        },
    );
}

/// Calls `visit` with each leaf whose box the ray enters before `t_max`, and the distance at which it does, until it
/// returns [`Next::Stop`]; nearest boxes first if `NEAREST`. `FUSED` and `fast` are those that `boxes` is prepared for.
/// Returns whether `visit` returned [`Next::Stop`].
#[inline(always)]
pub(crate) fn descend<S: Simd, const FUSED: bool, const NEAREST: bool>(
    (nodes, depth): (&[Node], usize),
    boxes: &BoxRay,
    t_max: f64,
    fast: bool,
    stack: &mut Vec<(Child, f32)>,
    tests: &mut Tests,
    mut visit: impl FnMut(Child, f32, &mut Tests) -> Next,
) -> bool {
    let Some(mut node) = nodes.first() else { return false };
    let mut t_max = boxes.prune_distance(t_max);
    // Every node on the path leaves at most seven children on the stack.
    let room = depth * WIDTH;
    if stack.len() < room {
        stack.resize(room, (Node::EMPTY.children[0], 0.0));
    }
    let stack = &mut stack[..];
    let mut top = 0;
    loop {
        tests.nodes += 1;
        let (mask, at) = boxes.enter::<S, FUSED>(node, t_max, fast);
        let mut next = push_children::<NEAREST>(node, mask, &at, stack, &mut top);
        // Visits leaves up to the next node.
        loop {
            let (child, at) = match next.take() {
                Some(child) => child,
                None => loop {
                    if top == 0 {
                        return false;
                    }
                    top -= 1;
                    let (child, at) = stack[top];
                    if !NEAREST || at <= t_max {
                        break (child, at);
                    }
                },
            };
            if !child.is_leaf() {
                node = &nodes[child.index()];
                break;
            }
            match visit(child, at, tests) {
                Next::Stop => return true,
                Next::Shorten(t) => t_max = boxes.prune_distance(t),
                Next::Continue => {}
            }
        }
    }
}

/// Pushes the children in `mask`, the farthest first if `NEAREST`, except the nearest, which it returns. `at` are the
/// entry distances.
#[inline(always)]
fn push_children<const NEAREST: bool>(
    node: &Node,
    mut mask: u32,
    at: &[f32; WIDTH],
    stack: &mut [(Child, f32)],
    top: &mut usize,
) -> Option<(Child, f32)> {
    if mask == 0 {
        return None;
    }
    let place = mask.trailing_zeros() as usize % WIDTH;
    mask &= mask - 1;
    let (mut nearest, mut nearest_at) = (node.children[place], at[place]);
    let first = *top;
    while mask != 0 {
        let place = mask.trailing_zeros() as usize % WIDTH;
        mask &= mask - 1;
        let mut item = (node.children[place], at[place]);
        let mut j = *top;
        if NEAREST {
            if item.1 < nearest_at {
                (nearest, nearest_at, item) = (item.0, item.1, (nearest, nearest_at));
            }
            while j > first && stack[j - 1].1 < item.1 {
                stack[j] = stack[j - 1];
                j -= 1;
            }
        }
        stack[j] = item;
        *top += 1;
    }
    Some((nearest, nearest_at))
}
