//! A top-down builder: object splits by the surface area heuristic in bins (Wald, On Fast Construction of SAH-based
//! Bounding Volume Hierarchies, 2007), and spatial splits (Stich, Friedrich and Dietrich, Spatial Splits in Bounding
//! Volume Hierarchies, 2009).
//!
//! A reference is a leaf of the tree to be: the bounds of a primitive or of a part of one, and its slot. Each node has
//! a range of a list of references, with room for those that its spatial splits may add, and a range of the list of
//! nodes with room for the tree over as many. Ranges are divided before their subtrees are built, so these are
//! independent of each other, and the tree does not depend on the number of threads.

mod bins;
mod clip;
#[cfg(test)]
mod tests;

use crate::threads::*;
use glam::{DVec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;

use self::bins::{Areas, Bins, Grid, Split, leaves};
use super::build::MIN_PARALLEL;
use crate::geometry::Bounds;
use crate::geometry::lanes::LANES4;

/// The corners of the triangle in a slot; `None` for other shapes, which are not split.
pub(super) type Corners<'a> = dyn Fn(u32) -> Option<[DVec3; 3]> + Sync + 'a;

/// How many references spatial splits may add, relative to the number of primitives.
#[derive(Debug, Clone, Copy)]
pub(super) struct Budget(pub f32);

/// The most levels of a tree, of which 28 hold as many references as a structure can number. Nodes near it are
/// split in halves by number, so that a row of ever larger primitives does not go beyond it.
const MAX_LEVELS: u32 = 48;

/// Spatial splits are considered where the bounds of the two sides of the best object split overlap in more than these
/// shares of the node's area and of the root's (α of Stich et al.). Smaller shares change the cost by less than 1 %.
const LEAST_OVERLAP: [f32; 2] = [0.3, 1e-3];

/// References per task in loops over all of a node.
const CHUNK: usize = 1 << 14;

/// Builds a tree over the bounds of slots, one reference per leaf. [`Bvh2::primitive_indices`] maps slots to
/// themselves.
pub(super) fn build(boxes: &[Bounds], corners: &Corners, budget: Budget) -> Bvh2 {
    if boxes.is_empty() {
        return Bvh2::default();
    }
    let count = boxes.len();
    let capacity = count + (count as f32 * budget.0) as usize;
    let mut references = vec![Bvh2Node::default(); capacity];
    let reference =
        |(slot, b): (usize, &Bounds)| Bvh2Node::new(Aabb::new(b.min.into(), b.max.into()), 1, slot as u32);
    references.par_iter_mut().zip(boxes).enumerate().for_each(|(slot, (r, b))| *r = reference((slot, b)));
    let mut spare = references.clone();
    let mut nodes = vec![Bvh2Node::default(); 2 * capacity - 2];
    let side = Side::of(&references[..count]);
    let areas = Areas::of_root(&side.bounds);
    let builder = Builder { corners, areas, least_overlap: areas.of(&side.bounds) * LEAST_OVERLAP[1] };
    let work = Work {
        side,
        references: &mut references,
        spare: &mut spare,
        nodes: &mut nodes,
        first_node: 0,
        levels: MAX_LEVELS,
    };
    let root = builder.build(work, &mut Bins::EMPTY.clone());
    Bvh2 {
        nodes: level_order(root, &nodes),
        primitive_indices: (0..count as u32).collect(),
        children_are_ordered_after_parents: true,
        uses_spatial_splits: budget.0 > 0.0,
        ..Bvh2::default()
    }
}

/// The nodes of a tree level by level, without gaps. `first_index` of `root` and of `nodes` are indices into `nodes`.
///
/// obvhs's reinsertion considers the first nodes of the list, which are then the largest.
fn level_order(root: Bvh2Node, nodes: &[Bvh2Node]) -> Vec<Bvh2Node> {
    let mut list = Vec::with_capacity(nodes.len() + 1);
    list.push(root);
    let mut index = 0;
    while index < list.len() {
        let (place, node) = (list.len() as u32, &mut list[index]);
        index += 1;
        if !node.is_leaf() {
            let first = std::mem::replace(&mut node.first_index, place) as usize;
            list.extend_from_slice(&nodes[first..first + 2]);
        }
    }
    list
}

/// The references on one side of a split.
#[derive(Clone, Copy)]
struct Side {
    count: usize,
    bounds: Aabb,
    /// The bounds of the centres.
    centres: Aabb,
}

impl Side {
    const EMPTY: Side = Side { count: 0, bounds: Aabb::INVALID, centres: Aabb::INVALID };

    fn of(references: &[Bvh2Node]) -> Self {
        let side = |references: &[Bvh2Node]| {
            references.iter().fold(Side::EMPTY, |side, reference| side.with(reference))
        };
        let both = |a: Side, b: Side| Side {
            count: a.count + b.count,
            bounds: a.bounds.union(&b.bounds),
            centres: a.centres.union(&b.centres),
        };
        references.par_chunks(CHUNK).map(side).reduce_with(both).unwrap_or(Side::EMPTY)
    }

    #[inline(always)]
    fn with(self, reference: &Bvh2Node) -> Self {
        let centre = centre(reference);
        Side {
            count: self.count + 1,
            bounds: self.bounds.union(reference.aabb()),
            centres: Aabb::new(self.centres.min.min(centre), self.centres.max.max(centre)),
        }
    }
}

/// The halves of a list.
fn in_halves(references: &[Bvh2Node]) -> ([&[Bvh2Node]; 2], [Side; 2]) {
    let (first, second) = references.split_at(references.len() / 2);
    ([first, second], [Side::of(first), Side::of(second)])
}

/// The centre of a reference's bounds.
#[inline(always)]
fn centre(reference: &Bvh2Node) -> Vec3A {
    let b = reference.aabb();
    // Halves, because the sum may overflow.
    b.min * 0.5 + b.max * 0.5
}

/// A node to be built.
struct Work<'a> {
    side: Side,
    /// The references, and room for more.
    references: &'a mut [Bvh2Node],
    /// As long, for the next level.
    spare: &'a mut [Bvh2Node],
    /// Room for the nodes below: two less than two for each of `references`.
    nodes: &'a mut [Bvh2Node],
    /// The index of the first of `nodes` in the list of all.
    first_node: usize,
    /// How many levels may be below.
    levels: u32,
}

impl<'a> Work<'a> {
    /// The two nodes below, whose references are in `spare`: those of the first from its start, those of the second
    /// from `room` on. And the places for the nodes themselves.
    fn divided(self, sides: [Side; 2], room: usize) -> (&'a mut [Bvh2Node], [Work<'a>; 2]) {
        let (references, spare) = (self.spare.split_at_mut(room), self.references.split_at_mut(room));
        let (pair, below) = self.nodes.split_at_mut(2);
        let nodes = below.split_at_mut(2 * room - 2);
        let levels = self.levels.saturating_sub(1);
        let first_node = [self.first_node + 2, self.first_node + 2 * room];
        let [first, second] = sides;
        let work = |side, references, spare, nodes, first_node| Work {
            side,
            references,
            spare,
            nodes,
            first_node,
            levels,
        };
        let first = work(first, references.0, spare.0, nodes.0, first_node[0]);
        (pair, [first, work(second, references.1, spare.1, nodes.1, first_node[1])])
    }
}

/// What all nodes have in common.
struct Builder<'a> {
    corners: &'a Corners<'a>,
    areas: Areas,
    /// The least area of an overlap for a spatial split, by the root.
    least_overlap: f32,
}

impl Builder<'_> {
    /// Builds the tree over references and returns its root. Recursive, at most [`MAX_LEVELS`] deep.
    fn build(&self, work: Work, bins: &mut Bins) -> Bvh2Node {
        let count = work.side.count;
        if count <= LANES4 {
            return leaf(&work.references[..count], work.nodes, work.first_node);
        }
        let first_node = work.first_node;
        let (pair, [first, second]) = self.divide(work, bins);
        let nodes = if count < MIN_PARALLEL {
            [self.build(first, bins), self.build(second, bins)]
        } else {
            let (a, b) = join(|| self.build(first, bins), || self.build(second, &mut Bins::EMPTY.clone()));
            [a, b]
        };
        pair.copy_from_slice(&nodes);
        Bvh2Node::new(nodes[0].aabb().union(nodes[1].aabb()), 0, first_node as u32)
    }

    /// Divides the references of a node.
    fn divide<'w>(&self, work: Work<'w>, bins: &mut Bins) -> (&'w mut [Bvh2Node], [Work<'w>; 2]) {
        let Side { count, bounds, centres } = work.side;
        let levels_of_halves = usize::BITS - (count - 1).leading_zeros();
        if work.levels <= levels_of_halves {
            return self.halves(work);
        }
        let references = &work.references[..count];
        let grid = Grid::new(&centres, object_bins(count));
        binned(bins, &grid, references, |bins, r| bins.add_by_centre(&grid, r));
        let object = bins.best_of_objects(&grid, self.areas);
        let overlap =
            object.map_or(f32::INFINITY, |s| self.areas.of(&s.bounds[0].intersection(&s.bounds[1])));
        let least = self.least_overlap.max(self.areas.of(&bounds) * LEAST_OVERLAP[0]);
        if work.references.len() > count && overlap > least {
            let (grid, axis) = (Grid::new(&bounds, SPATIAL_BINS), bounds.largest_axis());
            binned(bins, &grid, references, |bins, r| bins.add_by_extent(&grid, axis, r, self.corners));
            if let Some(split) = bins.best_of_space(&grid, axis, self.areas)
                && split.counts.iter().sum::<u32>() as usize <= work.references.len()
                && split.cost < object.map_or_else(|| self.cost_of_halves(references), |object| object.cost)
            {
                return self.split_space(work, &grid, split);
            }
        }
        match object {
            Some(split) => self.split_objects(work, &grid, &split),
            None => self.halves(work),
        }
    }

    /// The place from which the second part's references are stored: each part has room for its own and for a share of
    /// the rest by its area and number of references.
    fn room(&self, len: usize, bounds: [&Aabb; 2], counts: [usize; 2]) -> usize {
        let rest = len - counts[0] - counts[1];
        let weight = |side: usize| self.areas.of(bounds[side]) * counts[side] as f32;
        let (first, second) = (weight(0), weight(1));
        // NaN, of 0 / 0, becomes 0.
        counts[0] + ((rest as f32 * (first / (first + second))) as usize).min(rest)
    }

    /// The cost of [`Builder::halves`], as [`Split::cost`].
    fn cost_of_halves(&self, references: &[Bvh2Node]) -> f32 {
        let (_, sides) = in_halves(references);
        sides.iter().map(|side| self.areas.of(&side.bounds) * leaves(side.count as u32)).sum()
    }

    /// Divides the list in the middle.
    fn halves<'w>(&self, work: Work<'w>) -> (&'w mut [Bvh2Node], [Work<'w>; 2]) {
        let count = work.side.count;
        let ([first, second], sides) = in_halves(&work.references[..count]);
        let room = self.room(
            work.references.len(),
            [&sides[0].bounds, &sides[1].bounds],
            [first.len(), second.len()],
        );
        work.spare[..first.len()].copy_from_slice(first);
        work.spare[room..room + second.len()].copy_from_slice(second);
        work.divided(sides, room)
    }

    /// Divides the references by the bins of their centres.
    fn split_objects<'w>(
        &self,
        work: Work<'w>,
        grid: &Grid,
        split: &Split,
    ) -> (&'w mut [Bvh2Node], [Work<'w>; 2]) {
        let counts = split.counts.map(|count| count as usize);
        let room = self.room(work.references.len(), [&split.bounds[0], &split.bounds[1]], counts);
        let mut sides = [Side::EMPTY; 2];
        for reference in &work.references[..work.side.count] {
            let centre = centre(reference);
            let side = usize::from(grid.index(centre)[split.axis] > split.bin);
            let Side { count, centres, .. } = &mut sides[side];
            work.spare[side * room + *count] = *reference;
            *count += 1;
            *centres = centres.union(&Aabb::from_point(centre));
        }
        sides[0].bounds = split.bounds[0];
        sides[1].bounds = split.bounds[1];
        work.divided(sides, room)
    }

    /// Divides the references by a plane, and those on both sides of it into two, unless it costs less to leave one of
    /// them on one side ("unsplitting" of Stich et al., section 4.4).
    fn split_space<'w>(
        &self,
        work: Work<'w>,
        grid: &Grid,
        split: Split,
    ) -> (&'w mut [Bvh2Node], [Work<'w>; 2]) {
        let (mut bounds, mut counts) = (split.bounds, split.counts);
        let room =
            self.room(work.references.len(), [&bounds[0], &bounds[1]], counts.map(|count| count as usize));
        let mut sides = [Side::EMPTY; 2];
        let mut put = |side: usize, reference: &Bvh2Node| {
            work.spare[side * room + sides[side].count] = *reference;
            sides[side] = sides[side].with(reference);
        };
        for reference in &work.references[..work.side.count] {
            let b = *reference.aabb();
            let [first, last] = [b.min, b.max].map(|point| grid.index(point)[split.axis]);
            if last <= split.bin || first > split.bin {
                put(usize::from(first > split.bin), reference);
                continue;
            }
            let parts = (self.corners)(reference.first_index).map(|corners| parts(&corners, &split, &b));
            let cost =
                |side: usize, b: &Aabb, count: u32| self.areas.of(&bounds[side].union(b)) * leaves(count);
            let [first, second] = [0, 1].map(|side| {
                cost(side, &b, counts[side]) + self.areas.of(&bounds[1 - side]) * leaves(counts[1 - side] - 1)
            });
            let whole = usize::from(second < first);
            match parts {
                Some([Some(low), Some(high)])
                    if counts[1 - whole] == 1
                        || cost(0, &low, counts[0]) + cost(1, &high, counts[1]) <= first.min(second) =>
                {
                    for (side, part) in [low, high].into_iter().enumerate() {
                        bounds[side] = bounds[side].union(&part);
                        put(side, &Bvh2Node::new(part, 1, reference.first_index));
                    }
                }
                _ => {
                    bounds[whole] = bounds[whole].union(&b);
                    counts[1 - whole] -= 1;
                    put(whole, reference);
                }
            }
        }
        if let Some(empty) = sides.iter().position(|side| side.count == 0) {
            // All were left on one side.
            let count = sides[1 - empty].count;
            let from = if empty == 0 { room } else { 0 };
            work.references[..count].copy_from_slice(&work.spare[from..from + count]);
            return self.halves(Work { side: sides[1 - empty], ..work });
        }
        work.divided(sides, room)
    }
}

/// The parts of a triangle on both sides of a plane, within the bounds of its reference; `None` for one without points.
///
/// Every point of the triangle within the bounds is in a part, whatever the plane: the parts are what is between the
/// lower side of the bounds and the plane, and between that and the upper side.
fn parts(corners: &[DVec3; 3], split: &Split, within: &Aabb) -> [Option<Aabb>; 2] {
    let (axis, plane) = (split.axis, split.plane);
    [(within.min[axis], plane), (plane, within.max[axis])].map(|(low, high)| {
        let part = clip::between(corners, axis, low, high);
        let part = Aabb::new(part.min.into(), part.max.into()).intersection(within);
        part.min.cmple(part.max).all().then_some(part)
    })
}

/// The tree over at most four references, which share a leaf of the wide tree: halves.
fn leaf(references: &[Bvh2Node], nodes: &mut [Bvh2Node], first_node: usize) -> Bvh2Node {
    if let [reference] = references {
        return *reference;
    }
    let (first, second) = references.split_at(references.len() / 2);
    let (pair, below) = nodes.split_at_mut(2);
    let room = 2 * first.len() - 2;
    let (of_first, of_second) = below.split_at_mut(room);
    pair[0] = leaf(first, of_first, first_node + 2);
    pair[1] = leaf(second, of_second, first_node + 2 + room);
    Bvh2Node::new(pair[0].aabb().union(pair[1].aabb()), 0, first_node as u32)
}

/// Bins of an axis for object splits of so many references.
fn object_bins(count: usize) -> usize {
    4 + count / LANES4
}

/// Bins of an axis for spatial splits.
const SPATIAL_BINS: usize = 16;

/// Bins references, in parallel if they are many. The result does not depend on the order of the chunks.
#[inline(always)]
fn binned(
    bins: &mut Bins,
    grid: &Grid,
    references: &[Bvh2Node],
    add: impl Fn(&mut Bins, &[Bvh2Node]) + Sync,
) {
    bins.clear(grid);
    if references.len() <= CHUNK {
        return add(bins, references);
    }
    let of_chunk = |chunk: &[Bvh2Node]| {
        let mut bins = Bins::EMPTY.clone();
        add(&mut bins, chunk);
        bins
    };
    let both = |mut a: Bins, b: Bins| {
        a.add(&b);
        a
    };
    *bins = references.par_chunks(CHUNK).map(of_chunk).reduce_with(both).unwrap_or(Bins::EMPTY.clone());
}
