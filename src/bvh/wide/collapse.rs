//! Which nodes of a binary tree become the children of wide ones.
//!
//! Of all ways to take wide nodes from a binary tree with given leaves, this finds the one whose boxes have the least area in sum, that is,
//! of the least cost by the surface area heuristic (Ylitie, Karras and Laine, Efficient Incoherent Ray Traversal on GPUs Through
//! Compressed Wide BVHs, 2017, section 3.2): from the leaves up, what it costs at least to hold what is below a node as at most
//! 1, 2, ... 8 children of one wide node.

use obvhs::bvh2::Bvh2;

use super::node::WIDTH;

/// The least area of the wide nodes below a node of the binary tree, where it may take 1, 2, ... places of the one above.
type Costs = [f32; WIDTH];

/// What leads to the least, for a node of the binary tree: of 2, 3, ... places the number that its first child takes, or 0 where it is
/// better to be one child; and in the first place, the same for a wide node of its own, which has all places. Of leaves all are 0.
type Split = [u8; WIDTH];

/// Areas beyond this are all alike: any number of them can be added.
const LARGEST: f32 = 1e28;

/// The choice for every node.
pub struct Collapse(Vec<Split>);

impl Collapse {
    /// Of a tree. Without recursion, for trees of any depth.
    pub fn new(tree: &Bvh2, is_leaf: impl Fn(u32) -> bool) -> Self {
        let mut splits = vec![[0; WIDTH]; tree.nodes.len()];
        // Every node before those below it, those of its first child first.
        let (mut order, mut waiting) = (Vec::with_capacity(tree.nodes.len() / 2), vec![0u32]);
        while let Some(node) = waiting.pop() {
            order.push(node);
            if !is_leaf(node) {
                let first = tree.nodes[node as usize].first_index;
                waiting.extend([first + 1, first]);
            }
        }
        // Backwards: where a node is met, the costs of its children are the last two, the first child's last.
        let mut costs: Vec<Costs> = Vec::new();
        for node in order.into_iter().rev() {
            if is_leaf(node) {
                costs.push([0.0; WIDTH]);
                continue;
            }
            let (Some(first), Some(second)) = (costs.pop(), costs.pop()) else {
                unreachable!("two children for every node")
            };
            // Where nothing has area, there are still to be as few nodes as can be; nor may sums of areas overflow.
            let area = tree.nodes[node as usize].aabb().half_area();
            let area = if area < LARGEST { area.max(f32::MIN_POSITIVE) } else { LARGEST };
            let (below, split) = best_split(&first, &second, area);
            splits[node as usize] = split;
            costs.push(below);
        }
        Collapse(splits)
    }

    /// The nodes of the binary tree that a wide node over `root` holds.
    pub fn children(&self, tree: &Bvh2, root: u32) -> ([u32; WIDTH], usize) {
        let (mut children, mut len) = ([root; WIDTH], 0);
        // Not more than there are places wait.
        let (mut waiting, mut top) = ([(root, WIDTH, self.0[root as usize][0]); WIDTH], 1);
        while top > 0 {
            top -= 1;
            let (node, places, of_first) = waiting[top];
            if of_first == 0 {
                children[len] = node;
                len += 1;
                continue;
            }
            let first = tree.nodes[node as usize].first_index;
            let of_first = usize::from(of_first);
            for (child, places) in [(first + 1, places - of_first), (first, of_first)] {
                let of_first = if places == 1 { 0 } else { self.0[child as usize][places - 1] };
                waiting[top] = (child, places, of_first);
                top += 1;
            }
        }
        (children, len)
    }
}

/// The least costs below a node of that area, by those below its two children, and how its places are split for that.
#[inline(always)]
fn best_split(first: &Costs, second: &Costs, area: f32) -> (Costs, Split) {
    // What is below the second child if it has 1, 2, ... places, and before that what it cannot have.
    let mut shifted = [f32::INFINITY; 2 * WIDTH];
    shifted[WIDTH..].copy_from_slice(second);
    let (mut costs, mut split) = ([f32::INFINITY; WIDTH], [1u32; WIDTH]);
    // All numbers of places at once, without branches, which nobody could foresee.
    for taken in 1..WIDTH {
        for place in 0..WIDTH {
            let cost = first[taken - 1] + shifted[WIDTH + place - taken];
            let less = cost < costs[place];
            costs[place] = if less { cost } else { costs[place] };
            split[place] = if less { taken as u32 } else { split[place] };
        }
    }
    let mut split = split.map(|taken| taken as u8);
    // More places never cost more, so a wide node uses all that it may.
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
    use crate::bvh::mix::{GOLDEN, mix};
    use obvhs::aabb::Aabb;
    use obvhs::bvh2::node::Bvh2Node;

    /// A tree of boxes of any size, which need not lie in each other here.
    fn tree(leaves: usize, seed: u64) -> (Bvh2, Vec<bool>) {
        let mut state = seed;
        let mut below = |end: usize| {
            state = state.wrapping_add(GOLDEN);
            mix(state) as usize % end
        };
        let (mut nodes, mut is_leaf) = (vec![Bvh2Node::default()], vec![false]);
        let mut waiting = vec![(0, leaves)];
        while let Some((node, count)) = waiting.pop() {
            let size = glam::Vec3A::splat(below(100) as f32);
            let aabb = Aabb { min: glam::Vec3A::ZERO, max: size };
            let first = nodes.len();
            if count == 1 {
                (nodes[node], is_leaf[node]) = (Bvh2Node::new(aabb, 1, 0), true);
                continue;
            }
            nodes[node] = Bvh2Node::new(aabb, 0, first as u32);
            nodes.extend([Bvh2Node::default(); 2]);
            is_leaf.extend([false; 2]);
            let left = 1 + below(count - 1);
            waiting.extend([(first, left), (first + 1, count - left)]);
        }
        (Bvh2 { nodes, ..Bvh2::default() }, is_leaf)
    }

    /// Every set of nodes that a wide node over `node` could hold.
    fn sets(tree: &Bvh2, is_leaf: &[bool], node: usize) -> Vec<Vec<usize>> {
        if is_leaf[node] {
            return vec![vec![node]];
        }
        let first = tree.nodes[node].first_index as usize;
        let of = |child| {
            let opened = sets(tree, is_leaf, child);
            let closed = (!is_leaf[child]).then(|| vec![child]);
            opened.into_iter().chain(closed).collect::<Vec<_>>()
        };
        let (first, second) = (of(first), of(first + 1));
        let both = first.iter().flat_map(|a| second.iter().map(|b| [a.as_slice(), b].concat()));
        both.filter(|set| set.len() <= WIDTH).collect()
    }

    /// The least area of all wide nodes, by trying everything.
    fn least(tree: &Bvh2, is_leaf: &[bool], node: usize) -> f32 {
        if is_leaf[node] {
            return 0.0;
        }
        let costs = sets(tree, is_leaf, node)
            .into_iter()
            .map(|set| set.into_iter().map(|child| least(tree, is_leaf, child)).sum::<f32>());
        tree.nodes[node].aabb().half_area() + costs.fold(f32::INFINITY, f32::min)
    }

    #[test]
    fn no_other_choice_has_less_area() {
        for seed in 0..60 {
            let (tree, is_leaf) = tree(2 + seed as usize % 13, seed);
            let leaf = |node: u32| is_leaf[node as usize];
            let collapse = Collapse::new(&tree, leaf);
            let (mut waiting, mut area, mut leaves) = (vec![0u32], 0.0, 0);
            while let Some(node) = waiting.pop() {
                area += tree.nodes[node as usize].aabb().half_area();
                let (children, len) = collapse.children(&tree, node);
                assert!((2..=WIDTH).contains(&len));
                leaves += children[..len].iter().filter(|&&child| leaf(child)).count();
                waiting.extend(children[..len].iter().filter(|&&child| !leaf(child)));
            }
            // Whole numbers.
            assert_eq!(area, least(&tree, &is_leaf, 0), "tree {seed}");
            assert_eq!(leaves, is_leaf.iter().filter(|&&leaf| leaf).count());
        }
    }

    /// Sixteen leaves, nodes numbered level by level. Opened as far as there are places, the wide root would hold eight nodes of two leaves, of
    /// area 8 * 1200; two nodes of eight leaves have less, for they are smaller.
    #[test]
    fn small_nodes_stay_closed() {
        let sized = |size: f32| Aabb { min: glam::Vec3A::ZERO, max: glam::Vec3A::splat(size) };
        let node = |index: u32| {
            let aabb = sized(if index < 3 { 10.0 } else { 20.0 });
            if index < 15 { Bvh2Node::new(aabb, 0, 2 * index + 1) } else { Bvh2Node::new(aabb, 1, 0) }
        };
        let tree = Bvh2 { nodes: (0..31).map(node).collect(), ..Bvh2::default() };
        let is_leaf: Vec<bool> = (0..31).map(|index| index >= 15).collect();
        let collapse = Collapse::new(&tree, |node| is_leaf[node as usize]);
        assert_eq!(collapse.children(&tree, 0), ([1, 2, 0, 0, 0, 0, 0, 0], 2));
        assert_eq!(least(&tree, &is_leaf, 0), 3.0 * 300.0);
    }

    #[test]
    fn areas_that_overflow_are_alike() {
        let (mut tree, is_leaf) = tree(64, 5);
        let leaf = |node: u32| is_leaf[node as usize];
        let mut wide_nodes_of_boxes = |half: f32| {
            let corner = glam::Vec3A::splat(half);
            for node in &mut tree.nodes {
                node.set_aabb(Aabb { min: -corner, max: corner });
            }
            let collapse = Collapse::new(&tree, leaf);
            let (mut waiting, mut count) = (vec![0u32], 0);
            while let Some(node) = waiting.pop() {
                count += 1;
                let (children, len) = collapse.children(&tree, node);
                waiting.extend(children[..len].iter().filter(|&&child| !leaf(child)));
            }
            count
        };
        assert_eq!(wide_nodes_of_boxes(f32::MAX), wide_nodes_of_boxes(1.0));
        assert_eq!(wide_nodes_of_boxes(1e18), wide_nodes_of_boxes(1.0));
    }

    #[test]
    fn without_area_nodes_are_as_few_as_can_be() {
        let (mut tree, is_leaf) = tree(8, 1);
        for node in &mut tree.nodes {
            node.set_aabb(Aabb { min: glam::Vec3A::ZERO, max: glam::Vec3A::X });
        }
        let leaf = |node: u32| is_leaf[node as usize];
        assert_eq!(Collapse::new(&tree, leaf).children(&tree, 0).1, 8);
    }

    #[test]
    fn a_leaf_is_its_own_child() {
        let (tree, is_leaf) = tree(1, 1);
        let leaf = |node: u32| is_leaf[node as usize];
        assert_eq!(Collapse::new(&tree, leaf).children(&tree, 0), ([0; WIDTH], 1));
    }
}
