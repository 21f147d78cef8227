//! The traversal of a binary tree with a given box test and leaf function; used by `bvh2` and for both levels of
//! `instances`.

use std::ops::Range;

use glam::Vec3A;
use obvhs::bvh2::node::Bvh2Node;

use super::Next;

/// Calls `visit` with the range of each leaf whose box `enters` enters, and the entry distance; nearest boxes first.
/// Adds the number of boxes tested to `count`. Returns [`Next::Stop`] if `visit` did.
#[inline(always)]
pub(crate) fn traverse(
    nodes: &[Bvh2Node],
    mut t_max: f32,
    stack: &mut Vec<(u32, f32)>,
    count: &mut u64,
    enters: impl Fn(Vec3A, Vec3A, f32) -> Option<f32>,
    mut visit: impl FnMut(Range<u32>, f32) -> Next<f32>,
) -> Next<f32> {
    let test = |index: u32, t_max: f32| {
        let b = nodes[index as usize].aabb();
        enters(b.min, b.max, t_max)
    };
    stack.clear();
    *count += 1;
    if !nodes.is_empty() {
        stack.extend(test(0, t_max).map(|at| (0, at)));
    }
    while let Some((mut index, mut at)) = stack.pop() {
        if at > t_max {
            continue;
        }
        loop {
            let node = &nodes[index as usize];
            if node.is_leaf() {
                match visit(node.first_index..node.first_index + node.prim_count, at) {
                    Next::Continue => {}
                    Next::Shorten(t) => t_max = t,
                    Next::Stop => return Next::Stop,
                }
                break;
            }
            *count += 2;
            let (left, right) = (node.first_index, node.first_index + 1);
            (index, at) = match (test(left, t_max), test(right, t_max)) {
                (Some(l), Some(r)) => {
                    let (near, far) = if l <= r { ((left, l), (right, r)) } else { ((right, r), (left, l)) };
                    stack.push(far);
                    near
                }
                (Some(l), None) => (left, l),
                (None, Some(r)) => (right, r),
                (None, None) => break,
            };
        }
    }
    Next::Continue
}
