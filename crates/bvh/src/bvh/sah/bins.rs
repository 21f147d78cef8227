//! Bins of references along the three axes: candidates for splits, and their cost by the surface area heuristic.

use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::node::Bvh2Node;

use super::{Corners, centre};
use crate::geometry::lanes::LANES4;

/// The most bins of an axis.
pub(super) const MAX_BINS: usize = 32;

/// Areas relative to that of the root, so that none overflows or underflows that matters.
#[derive(Clone, Copy)]
pub(super) struct Areas {
    /// A power of two, near the reciprocal of the longest side of the root.
    scale: f32,
}

impl Areas {
    pub(super) fn of_root(root: &Aabb) -> Self {
        // Of halves, because the difference may overflow.
        let side = (root.max * 0.5 - root.min * 0.5).max_element();
        let power = f32::from_bits(side.to_bits() & f32::INFINITY.to_bits());
        Areas { scale: power.max(f32::MIN_POSITIVE).recip().max(f32::MIN_POSITIVE) }
    }

    /// Half the surface area; 0 if the box is inverted.
    #[inline(always)]
    pub(super) fn of(self, b: &Aabb) -> f32 {
        let d = (b.max * self.scale - b.min * self.scale).max(Vec3A::ZERO);
        d.x * d.y + d.y * d.z + d.z * d.x
    }
}

/// The cost of a number of references: the leaves that they fill.
#[inline(always)]
pub(super) fn leaves(count: u32) -> f32 {
    count.div_ceil(LANES4 as u32) as f32
}

/// A map from the coordinates of a box to bins, the same for all axes, monotone.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    low: Vec3A,
    scale: Vec3A,
    last: Vec3A,
    len: usize,
}

impl Grid {
    /// `len` bins along each side of a box, at most [`MAX_BINS`].
    pub(super) fn new(within: &Aabb, len: usize) -> Self {
        let len = len.min(MAX_BINS);
        // A side of 0 gives NaN or infinity, which `index` takes to the first or last bin.
        let scale = Vec3A::splat(len as f32) / (within.max - within.min);
        Grid { low: within.min, scale, last: Vec3A::splat((len - 1) as f32), len }
    }

    /// The bins of a point, by axis.
    #[inline(always)]
    pub(super) fn index(&self, point: Vec3A) -> [usize; 3] {
        // Adding 2^23 rounds to a whole number and leaves it in the low bits. The operands are in the order in which
        // NaN becomes 0.
        const WHOLE: f32 = 8_388_608.0;
        let place = ((point - self.low) * self.scale - 0.5).max(Vec3A::ZERO).min(self.last);
        (place + WHOLE).to_array().map(|x| x.to_bits() as usize % MAX_BINS)
    }

    /// The lower plane of a bin.
    fn plane(&self, axis: usize, bin: usize) -> f32 {
        self.low[axis] + bin as f32 / self.scale[axis]
    }
}

/// A split between two bins of an axis.
#[derive(Clone, Copy)]
pub(super) struct Split {
    /// The area of each part times the cost of its tests, summed.
    pub cost: f32,
    pub axis: usize,
    /// The last bin of the first part.
    pub bin: usize,
    /// The plane between the bins.
    pub plane: f32,
    pub bounds: [Aabb; 2],
    pub counts: [u32; 2],
}

/// The bins of one axis: the bounds of the references in each, and how many of them begin and end there.
#[derive(Clone, Copy)]
struct AxisBins {
    bounds: [Aabb; MAX_BINS],
    begin: [u32; MAX_BINS],
    end: [u32; MAX_BINS],
}

/// The bins of all axes.
#[derive(Clone)]
pub(super) struct Bins([AxisBins; 3]);

impl Bins {
    pub(super) const EMPTY: Bins =
        Bins([AxisBins { bounds: [Aabb::INVALID; MAX_BINS], begin: [0; MAX_BINS], end: [0; MAX_BINS] }; 3]);

    /// Removes what is in the bins of a grid.
    pub(super) fn clear(&mut self, grid: &Grid) {
        for bins in &mut self.0 {
            bins.bounds[..grid.len].fill(Aabb::INVALID);
            bins.begin[..grid.len].fill(0);
            bins.end[..grid.len].fill(0);
        }
    }

    /// Adds what is in other bins.
    pub(super) fn add(&mut self, other: &Bins) {
        for (bins, other) in self.0.iter_mut().zip(&other.0) {
            for bin in 0..MAX_BINS {
                bins.bounds[bin] = bins.bounds[bin].union(&other.bounds[bin]);
                bins.begin[bin] += other.begin[bin];
                bins.end[bin] += other.end[bin];
            }
        }
    }

    /// Adds references, each to the bins of its centre.
    #[inline(always)]
    pub(super) fn add_by_centre(&mut self, grid: &Grid, references: &[Bvh2Node]) {
        for reference in references {
            for (bins, bin) in self.0.iter_mut().zip(grid.index(centre(reference))) {
                bins.bounds[bin] = bins.bounds[bin].union(reference.aabb());
                bins.begin[bin] += 1;
            }
        }
    }

    /// Adds references to all bins of an axis that they overlap, the part in each. Bounds of parts are approximate:
    /// they decide what is split, not what the split yields.
    pub(super) fn add_by_extent(
        &mut self,
        grid: &Grid,
        axis: usize,
        references: &[Bvh2Node],
        corners: &Corners,
    ) {
        let bins = &mut self.0[axis];
        for reference in references {
            let b = reference.aabb();
            let [first, last] = [b.min, b.max].map(|point| grid.index(point)[axis]);
            bins.begin[first] += 1;
            bins.end[last] += 1;
            let corners = if first == last { None } else { corners(reference.first_index) };
            match corners {
                Some(corners) => {
                    let corners = corners.map(|corner| corner.as_vec3a());
                    let parts = parts(grid, axis, [first, last], &corners);
                    for (bin, part) in bins.bounds[first..=last].iter_mut().zip(&parts[first..=last]) {
                        *bin = bin.union(&part.intersection(b));
                    }
                }
                None => bins.bounds[first..=last].iter_mut().for_each(|bin| *bin = bin.union(b)),
            }
        }
    }

    /// The object split of least cost; `None` if all centres are in one bin on every axis.
    pub(super) fn best_of_objects(&self, grid: &Grid, areas: Areas) -> Option<Split> {
        let mut best = None;
        for (axis, bins) in self.0.iter().enumerate() {
            bins.sweep(&bins.begin, grid, axis, areas, &mut best);
        }
        best
    }

    /// The spatial split of an axis of least cost; `None` if all references are in one bin.
    pub(super) fn best_of_space(&self, grid: &Grid, axis: usize, areas: Areas) -> Option<Split> {
        let mut best = None;
        self.0[axis].sweep(&self.0[axis].end, grid, axis, areas, &mut best);
        best
    }
}

impl AxisBins {
    /// Replaces the best split by one of this axis that costs less.
    fn sweep(&self, end: &[u32; MAX_BINS], grid: &Grid, axis: usize, areas: Areas, best: &mut Option<Split>) {
        let mut after = [(Aabb::INVALID, 0u32, 0.0f32); MAX_BINS];
        let (mut b, mut count) = (Aabb::INVALID, 0);
        for bin in (1..grid.len).rev() {
            b = b.union(&self.bounds[bin]);
            count += end[bin];
            after[bin] = (b, count, areas.of(&b) * leaves(count));
        }
        let (mut b, mut count) = (Aabb::INVALID, 0);
        for bin in 0..grid.len - 1 {
            b = b.union(&self.bounds[bin]);
            count += self.begin[bin];
            let (other, others, cost) = after[bin + 1];
            let cost = cost + areas.of(&b) * leaves(count);
            if count > 0 && others > 0 && best.is_none_or(|best| cost < best.cost) {
                let plane = grid.plane(axis, bin + 1);
                *best = Some(Split { cost, axis, bin, plane, bounds: [b, other], counts: [count, others] });
            }
        }
    }
}

/// The approximate bounds of the parts of a triangle in a range of bins.
fn parts(grid: &Grid, axis: usize, [first, last]: [usize; 2], corners: &[Vec3A; 3]) -> [Aabb; MAX_BINS] {
    let mut parts = [Aabb::INVALID; MAX_BINS];
    for i in 0..3 {
        let (p, q) = (corners[i], corners[(i + 1) % 3]);
        parts[grid.index(p)[axis].clamp(first, last)].extend(p);
        let (from, to) = (p[axis].min(q[axis]), p[axis].max(q[axis]));
        let step = (q - p) / (q[axis] - p[axis]);
        for bin in first..last {
            let at = grid.plane(axis, bin + 1);
            if from < at && at < to {
                let point = p + step * (at - p[axis]);
                parts[bin].extend(point);
                parts[bin + 1].extend(point);
            }
        }
    }
    parts
}
