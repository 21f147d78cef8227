//! [`Bvh`]: queries of many rays or points on all threads of the current rayon pool.
//!
//! Rays that are near each other and point in similar directions are traced together, whatever their order: queries are
//! sorted along a Morton curve through the six coordinates of origin and direction. Results are in the order of the
//! queries; in every tier but `fast` they are those of the queries one by one.

use glam::DVec3;
use rayon::prelude::*;

use super::{Bvh, Closedness, ClosestPoint, Crossing, Traversal};
use crate::geometry::{Hit, HitBuffer, Ray, RayBuffer, Rays};

/// Queries of a parallel task.
const CHUNK: usize = 4096;

/// Bits of each coordinate on the Morton curve.
const BITS: usize = 10;

/// Numbers of [`BITS`] bits with five zeros before each bit.
const SPREAD: [u64; 1 << BITS] = {
    let mut table = [0; 1 << BITS];
    let mut number = 0;
    while number < table.len() {
        let mut bit = 0;
        while bit < BITS {
            table[number] |= (number as u64 >> bit & 1) << (6 * bit);
            bit += 1;
        }
        number += 1;
    }
    table
};

impl Bvh {
    /// [`Bvh::closest_hit`] of every ray.
    pub fn par_closest_hits(&self, rays: Rays) -> Vec<Option<Hit>> {
        batch(rays, |rays, traversal| {
            let mut hits = HitBuffer::default();
            self.accelerator().closest_hits(rays, &mut hits, traversal);
            hits.iter().collect()
        })
    }

    /// [`Bvh::occluded`] of every ray.
    pub fn par_are_occluded(&self, rays: Rays) -> Vec<bool> {
        batch(rays, |rays, traversal| self.are_occluded(rays, traversal))
    }

    /// [`Bvh::all_hits`] of every ray.
    pub fn par_all_hits(&self, rays: Rays) -> Vec<Vec<Hit>> {
        batch(rays, |rays, traversal| rays.iter().map(|ray| self.all_hits(&ray, traversal)).collect())
    }

    /// [`Bvh::crossings`] of every ray.
    pub fn par_crossings(&self, rays: Rays) -> Vec<Vec<Crossing>> {
        batch(rays, |rays, traversal| rays.iter().map(|ray| self.crossings(&ray, traversal)).collect())
    }

    /// [`Bvh::winding_number`] of every point.
    pub fn par_winding_numbers(&self, points: &[DVec3]) -> Vec<i32> {
        each_point(points, |point, traversal| self.winding_number(point, traversal))
    }

    /// [`Bvh::contains`] of every point: whether it is inside, and the closedness of the surface.
    pub fn par_contains(&self, points: &[DVec3]) -> (Vec<bool>, Closedness) {
        let is_inside = |point, traversal: &mut Traversal| self.winding_number(point, traversal) != 0;
        (each_point(points, is_inside), self.closedness())
    }

    /// [`Bvh::closest_point`] of every point.
    pub fn par_closest_points(&self, points: &[DVec3]) -> Vec<Option<ClosestPoint>> {
        each_point(points, |point, traversal| self.closest_point(point, traversal))
    }

    /// [`Bvh::signed_distance`] of every point.
    pub fn par_signed_distances(&self, points: &[DVec3]) -> Vec<Option<f64>> {
        each_point(points, |point, traversal| self.signed_distance(point, traversal))
    }
}

/// The results of `work`, which takes some rays, in the order of all rays.
fn batch<R: Default + Send>(rays: Rays, work: impl Fn(Rays, &mut Traversal) -> Vec<R> + Sync) -> Vec<R> {
    let of = |index: usize| {
        let Ray { origin, direction, .. } = rays.get(index);
        [origin, direction]
    };
    in_order(rays.len(), of, |indices, traversal| {
        let rays: RayBuffer = indices.iter().map(|&(_, index)| rays.get(index)).collect();
        work(rays.rays(), traversal)
    })
}

/// The results of `work` in the order of the points.
fn each_point<R: Default + Send>(
    points: &[DVec3],
    work: impl Fn(DVec3, &mut Traversal) -> R + Sync,
) -> Vec<R> {
    in_order(
        points.len(),
        |index| [points[index], DVec3::ZERO],
        |indices, traversal| indices.iter().map(|&(_, index)| work(points[index], traversal)).collect(),
    )
}

/// The results of `work`, which takes some of `count` indices at once, in the order of all indices. `of` is the origin
/// and direction of an index.
fn in_order<R: Default + Send>(
    count: usize,
    of: impl Fn(usize) -> [DVec3; 2] + Sync,
    work: impl Fn(&[(u64, usize)], &mut Traversal) -> Vec<R> + Sync,
) -> Vec<R> {
    let indices = || (0..count).into_par_iter().with_min_len(CHUNK);
    let bounds =
        |a: [[DVec3; 2]; 2], b: [[DVec3; 2]; 2]| [0, 1].map(|k| [a[k][0].min(b[k][0]), a[k][1].max(b[k][1])]);
    let none = || [[DVec3::INFINITY, DVec3::NEG_INFINITY]; 2];
    // What is not finite has no place.
    let finite = |vectors: [DVec3; 2]| vectors.iter().all(|v| v.is_finite()).then_some(vectors);
    let extents = indices()
        .filter_map(|index| finite(of(index)))
        .map(|vectors| vectors.map(|v| [v, v]))
        .reduce(none, bounds)
        .map(|[min, max]| (min, ((1 << BITS) as f64 - 0.5) / (max - min).max_element()));
    let key = |index: usize| {
        let mut key = 0;
        for (v, (min, scale)) in of(index).into_iter().zip(extents) {
            for axis in 0..3 {
                // NaN, of equal coordinates, becomes 0.
                let cell = ((v[axis] - min[axis]) * scale) as usize;
                key = key << 1 | SPREAD[cell.min((1 << BITS) - 1)];
            }
        }
        (key, index)
    };
    let mut order: Vec<(u64, usize)> = indices().map(key).collect();
    order.par_sort_unstable();
    let parts: Vec<Vec<R>> = order
        .par_chunks(CHUNK)
        .map_init(Traversal::default, |traversal, indices| work(indices, traversal))
        .collect();
    let mut results = Vec::new();
    results.resize_with(count, R::default);
    for (&(_, index), result) in order.iter().zip(parts.into_iter().flatten()) {
        results[index] = result;
    }
    results
}
