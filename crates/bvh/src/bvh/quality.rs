//! Measures of a tree that need no rays: depth and surface area heuristic.

/// Measures of a tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// The number of nodes on the longest path from the root to a leaf, both included.
    pub depth: u32,
    /// The expected number of inner nodes entered and primitives tested by a random line through the bounds: the
    /// surface area heuristic (Goldsmith and Salmon, Automatic Creation of Object Hierarchies for Ray Tracing, 1987;
    /// MacDonald and Booth, 1990) with cost 1 for each. Not comparable between trees of different width.
    pub sah_cost: f64,
}

/// What [`quality`] needs of a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VisitedNode {
    /// The surface area of its bounds, times any factor common to all nodes.
    pub area: f64,
    /// The number of primitives of a leaf; 0 for an inner node.
    pub primitives: usize,
}

/// Measures the tree at `root`. `visit` returns a node and appends its children. Not recursive: the tree may be of
/// any depth.
pub fn quality(root: usize, mut visit: impl FnMut(usize, &mut Vec<usize>) -> VisitedNode) -> Quality {
    let (mut stack, mut children) = (vec![(root, 1u32)], Vec::new());
    let (mut depth, mut cost, mut whole) = (0, 0.0, None);
    while let Some((index, level)) = stack.pop() {
        let node = visit(index, &mut children);
        let whole = *whole.get_or_insert(node.area);
        // Without area, every line enters every node.
        let share = if whole > 0.0 { node.area / whole } else { 1.0 };
        cost += share * if children.is_empty() { node.primitives as f64 } else { 1.0 };
        depth = depth.max(level);
        stack.extend(children.drain(..).map(|child| (child, level + 1)));
    }
    Quality { depth, sah_cost: cost }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tree_by_hand() {
        // A root of area 8 over a leaf of 3 primitives, area 4, and a node of area 2 over leaves of 1 and 2, areas 1
        // and 2: 1 + 3 * 4/8 + 2/8 + 1 * 1/8 + 2 * 2/8 = 3.375.
        let areas = [8.0, 4.0, 2.0, 1.0, 2.0];
        let primitives = [0, 3, 0, 1, 2];
        let tree = quality(0, |index, children| {
            children.extend(match index {
                0 => [1, 2].as_slice(),
                2 => &[3, 4],
                _ => &[],
            });
            VisitedNode { area: areas[index], primitives: primitives[index] }
        });
        assert_eq!(tree, Quality { depth: 3, sah_cost: 3.375 });
    }
}
