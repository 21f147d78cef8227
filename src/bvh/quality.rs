//! How good a tree is, by numbers that need no ray.

/// Measures of a tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// How many nodes there are on the longest way from the root to a leaf, both included.
    pub depth: u32,
    /// How many inner nodes a random line through the bounds enters, and how many primitives it is tested against, on
    /// average: the surface area heuristic (Goldsmith and Salmon, Automatic Creation of Object Hierarchies for Ray
    /// Tracing, 1987; MacDonald and Booth, 1990) where each of both costs 1. Trees of different width are not alike in it:
    /// a node with eight children is entered once where several with two are.
    pub sah_cost: f64,
}

/// A node as [`quality`] sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// The area of its box, or any multiple of it that is the same for all nodes.
    pub area: f64,
    /// The primitives of a leaf; 0 for an inner node.
    pub primitives: usize,
}

/// Measures the tree below `root`. `look` says what a node is, and appends its children. Without recursion, for trees of
/// any depth.
pub fn quality(root: usize, mut look: impl FnMut(usize, &mut Vec<usize>) -> Seen) -> Quality {
    let (mut waiting, mut children) = (vec![(root, 1u32)], Vec::new());
    let (mut depth, mut cost, mut whole) = (0, 0.0, None);
    while let Some((index, level)) = waiting.pop() {
        let seen = look(index, &mut children);
        let whole = *whole.get_or_insert(seen.area);
        // A scene without area is met by every line there is.
        let share = if whole > 0.0 { seen.area / whole } else { 1.0 };
        cost += share * if children.is_empty() { seen.primitives as f64 } else { 1.0 };
        depth = depth.max(level);
        waiting.extend(children.drain(..).map(|child| (child, level + 1)));
    }
    Quality { depth, sah_cost: cost }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tree_by_hand() {
        // A root of area 8 over a leaf of 3 primitives, area 4, and a node of area 2 over leaves of 1 and 2, areas 1 and 2:
        // 1 + 3 * 4/8 + 2/8 + 1 * 1/8 + 2 * 2/8 = 3.375.
        let areas = [8.0, 4.0, 2.0, 1.0, 2.0];
        let primitives = [0, 3, 0, 1, 2];
        let tree = quality(0, |index, children| {
            children.extend(match index {
                0 => [1, 2].as_slice(),
                2 => &[3, 4],
                _ => &[],
            });
            Seen { area: areas[index], primitives: primitives[index] }
        });
        assert_eq!(tree, Quality { depth: 3, sah_cost: 3.375 });
    }
}
