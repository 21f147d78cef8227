//! [`Collapse`]: which nodes of the binary tree become children of wide nodes.
//!
//! Of all wide trees over the given leaves, finds the one whose nodes have the least total surface area, that is the
//! least cost by the surface area heuristic, by dynamic programming (Ylitie, Karras and Laine, Efficient Incoherent
//! Ray Traversal on GPUs Through Compressed Wide BVHs, 2017, section 3.2): from the leaves up, the least cost of
//! representing a subtree as at most 1, 2, ... 8 children of one wide node.

use super::node::WIDTH;
use super::preorder::{Entry, EntryContent};

/// The least total area of the wide nodes of a subtree that takes at most 1, 2, ... places in its parent.
type Costs = [f32; WIDTH];

/// The choices that lead to the least cost: for 2, 3, ... places the number of them that the first child takes, or 0
/// if the node itself becomes a child; at index 0, the same for a wide node of its own with all eight places. All 0
/// for leaves.
type Split = [u8; WIDTH];

/// Larger areas count as this, so that sums do not overflow.
const LARGEST: f32 = 1e28;

/// The choices for every node.
pub(crate) struct Collapse(Vec<Split>);

impl Collapse {
    /// The choices for a tree in preorder.
    pub(crate) fn new(entries: &[Entry]) -> Self {
        let mut splits = vec![[0; WIDTH]; entries.len()];
        // Backwards: at an inner node the costs of its children are the last two, the first child's last.
        let mut costs: Vec<Costs> = Vec::new();
        for (entry, split) in entries.iter().zip(&mut splits).rev() {
            if entry.is_leaf() {
                costs.push([0.0; WIDTH]);
                continue;
            }
            let (Some(first), Some(second)) = (costs.pop(), costs.pop()) else {
                unreachable!("two children for every node")
            };
            // At least a positive area, to minimise the number of nodes where there is none. NaN counts as the largest.
            let area = entry.bounds.half_area();
            let area = if area < LARGEST { area.max(f32::MIN_POSITIVE) } else { LARGEST };
            let cost;
            (cost, *split) = best_split(&first, &second, area);
            costs.push(cost);
        }
        Collapse(splits)
    }

    /// The entries that become children of the wide node at `root`, and their number.
    pub(crate) fn children(&self, entries: &[Entry], root: u32) -> ([u32; WIDTH], usize) {
        let (mut children, mut len) = ([root; WIDTH], 0);
        // The stack never exceeds the number of places.
        let (mut stack, mut top) = ([(root, WIDTH, self.0[root as usize][0]); WIDTH], 1);
        while top > 0 {
            top -= 1;
            let (node, places, of_first) = stack[top];
            let second = match entries[node as usize].content {
                EntryContent::Inner(second) if of_first > 0 => second,
                _ => {
                    children[len] = node;
                    len += 1;
                    continue;
                }
            };
            let of_first = usize::from(of_first);
            for (child, places) in [(second, places - of_first), (node + 1, of_first)] {
                let of_first = if places == 1 { 0 } else { self.0[child as usize][places - 1] };
                stack[top] = (child, places, of_first);
                top += 1;
            }
        }
        (children, len)
    }
}

/// The least costs of a node of the given area from those of its two children, and the choices for them.
#[inline(always)]
fn best_split(first: &Costs, second: &Costs, area: f32) -> (Costs, Split) {
    // Costs of the second child for ... -1, 0, 1, 2, ... places.
    let mut shifted = [f32::INFINITY; 2 * WIDTH];
    shifted[WIDTH..].copy_from_slice(second);
    let (mut costs, mut split) = ([f32::INFINITY; WIDTH], [1u32; WIDTH]);
    // For all numbers of places at once, without branches, which would be mispredicted.
    for taken in 1..WIDTH {
        for place in 0..WIDTH {
            let cost = first[taken - 1] + shifted[WIDTH + place - taken];
            let less = cost < costs[place];
            costs[place] = if less { cost } else { costs[place] };
            split[place] = if less { taken as u32 } else { split[place] };
        }
    }
    let mut split = split.map(|taken| taken as u8);
    // More places never cost more, so a wide node may use all eight.
    costs[0] = costs[WIDTH - 1] + area;
    split[0] = split[WIDTH - 1];
    for places in 2..=WIDTH {
        if costs[0] < costs[places - 1] {
            (costs[places - 1], split[places - 1]) = (costs[0], 0);
        }
    }
    (costs, split)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::splitmix64::{GOLDEN, splitmix64};
    use crate::geometry::Bounds;
    use glam::Vec3;

    fn cube(side: f32) -> Bounds {
        Bounds { min: Vec3::ZERO, max: Vec3::splat(side) }
    }

    /// Appends a tree of that many leaves. Bounds have random sizes and need not contain each other.
    fn grow(entries: &mut Vec<Entry>, leaves: usize, below: &mut impl FnMut(usize) -> usize) {
        let place = entries.len();
        let leaf = EntryContent::Triangles(0, 1);
        entries.push(Entry { bounds: cube(below(100) as f32), content: leaf });
        if leaves == 1 {
            return;
        }
        let left = 1 + below(leaves - 1);
        grow(entries, left, below);
        entries[place].content = EntryContent::Inner(entries.len() as u32);
        grow(entries, leaves - left, below);
    }

    fn tree(leaves: usize, seed: u64) -> Vec<Entry> {
        let mut state = seed;
        let mut below = |end: usize| {
            state = state.wrapping_add(GOLDEN);
            splitmix64(state) as usize % end
        };
        let mut entries = Vec::new();
        grow(&mut entries, leaves, &mut below);
        entries
    }

    /// Every possible set of children of a wide node at `node`.
    fn sets(entries: &[Entry], node: u32) -> Vec<Vec<u32>> {
        let EntryContent::Inner(second) = entries[node as usize].content else { return vec![vec![node]] };
        let of = |child: u32| {
            let opened = sets(entries, child);
            let closed = (!entries[child as usize].is_leaf()).then(|| vec![child]);
            opened.into_iter().chain(closed).collect::<Vec<_>>()
        };
        let (first, second) = (of(node + 1), of(second));
        let both = first.iter().flat_map(|a| second.iter().map(|b| [a.as_slice(), b].concat()));
        both.filter(|set| set.len() <= WIDTH).collect()
    }

    /// The least total area of wide nodes, by exhaustive search.
    fn least(entries: &[Entry], node: u32) -> f32 {
        if entries[node as usize].is_leaf() {
            return 0.0;
        }
        let costs = sets(entries, node)
            .into_iter()
            .map(|set| set.into_iter().map(|child| least(entries, child)).sum::<f32>());
        entries[node as usize].bounds.half_area() + costs.fold(f32::INFINITY, f32::min)
    }

    /// The total area and number of wide nodes, the least number of children, and the number of leaves.
    fn taken(entries: &[Entry]) -> (f32, usize, usize, usize) {
        let collapse = Collapse::new(entries);
        let (mut waiting, mut area, mut count, mut fewest, mut leaves) = (vec![0u32], 0.0, 0, WIDTH, 0);
        while let Some(node) = waiting.pop() {
            count += 1;
            area += entries[node as usize].bounds.half_area();
            let (children, len) = collapse.children(entries, node);
            fewest = fewest.min(len);
            let inner = children[..len].iter().filter(|&&child| !entries[child as usize].is_leaf());
            waiting.extend(inner);
            leaves += children[..len].iter().filter(|&&child| entries[child as usize].is_leaf()).count();
        }
        (area, count, fewest, leaves)
    }

    #[test]
    fn no_other_choice_has_less_area() {
        for seed in 0..60 {
            let leaves = 2 + seed as usize % 13;
            let entries = tree(leaves, seed);
            let (area, _, fewest, held) = taken(&entries);
            // Whole numbers.
            assert_eq!(area, least(&entries, 0), "tree {seed}");
            assert!(fewest >= 2 && held == leaves, "tree {seed}");
        }
    }

    /// A full tree of sixteen leaves. Opening the root as far as possible gives eight nodes of two leaves, of total
    /// area 8 * 1200; two nodes of eight leaves have less.
    #[test]
    fn small_nodes_stay_closed() {
        fn full(entries: &mut Vec<Entry>, leaves: usize) {
            let place = entries.len();
            let bounds = cube(if leaves < 8 { 20.0 } else { 10.0 });
            entries.push(Entry { bounds, content: EntryContent::Triangles(0, 1) });
            if leaves > 1 {
                full(entries, leaves / 2);
                entries[place].content = EntryContent::Inner(entries.len() as u32);
                full(entries, leaves / 2);
            }
        }
        let mut entries = Vec::new();
        full(&mut entries, 16);
        // Fifteen entries hold eight leaves.
        assert_eq!(Collapse::new(&entries).children(&entries, 0), ([1, 16, 0, 0, 0, 0, 0, 0], 2));
        assert_eq!(least(&entries, 0), 3.0 * 300.0);
    }

    #[test]
    fn areas_that_overflow_are_alike() {
        let mut entries = tree(64, 5);
        let mut wide_nodes_of_boxes = |half: f32| {
            for entry in &mut entries {
                entry.bounds = Bounds { min: Vec3::splat(-half), max: Vec3::splat(half) };
            }
            taken(&entries).1
        };
        assert_eq!(wide_nodes_of_boxes(f32::MAX), wide_nodes_of_boxes(1.0));
        assert_eq!(wide_nodes_of_boxes(1e18), wide_nodes_of_boxes(1.0));
    }

    #[test]
    fn without_area_nodes_are_as_few_as_can_be() {
        let mut entries = tree(8, 1);
        for entry in &mut entries {
            entry.bounds = Bounds { min: Vec3::ZERO, max: Vec3::X };
        }
        assert_eq!(Collapse::new(&entries).children(&entries, 0).1, 8);
    }

    #[test]
    fn a_leaf_is_its_own_child() {
        let entries = tree(1, 1);
        assert_eq!(Collapse::new(&entries).children(&entries, 0), ([0; WIDTH], 1));
    }
}
