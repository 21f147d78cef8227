//! The way through a tree of boxes, whatever its boxes are tested with and whatever its leaves hold.

use std::ops::Range;

use glam::Vec3A;
use obvhs::bvh2::node::Bvh2Node;

/// What to do after a leaf.
pub enum Step {
    /// Go on.
    Go,
    /// Go on, but not into boxes that are entered beyond this distance.
    Prune(f32),
    /// Nothing more is wanted.
    Stop,
}

/// Calls `visit` with the range of each leaf that `enters` finds, and with where it is entered: nearest boxes first.
/// `count` is the number of boxes tested.
#[inline(always)]
pub fn walk(
    nodes: &[Bvh2Node],
    mut t_max: f32,
    stack: &mut Vec<(u32, f32)>,
    count: &mut u64,
    enters: impl Fn(Vec3A, Vec3A, f32) -> Option<f32>,
    mut visit: impl FnMut(Range<u32>, f32) -> Step,
) -> Step {
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
                    Step::Go => {}
                    Step::Prune(t) => t_max = t,
                    Step::Stop => return Step::Stop,
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
    Step::Go
}
