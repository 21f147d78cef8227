//! [`Bvh`]: queries of many rays or points on all threads of the current rayon pool.
//!
//! Queries that traverse the tree one by one are sorted along a Morton curve through the six coordinates of origin and
//! direction, so that those near each other follow each other, whatever their order. Streams prefetch instead; sorting
//! rays for them takes longer than it saves (docs/decisions.md). Results are in the order of the queries; in every tier
//! but `fast` they are those of the queries one by one.

use std::ops::Index;
use std::sync::{Mutex, PoisonError};

use glam::DVec3;
use rayon::prelude::*;

use super::{Bvh, Closedness, ClosestPoint, Crossing, Traversal};
use crate::geometry::{Hit, HitBuffer, Ray, RayBuffer, Rays};

/// Queries of a parallel task.
const CHUNK: usize = 4096;

/// Bits of each coordinate on the Morton curve.
const BITS: usize = 5;

/// Numbers of [`BITS`] bits with five zeros before each bit.
const SPREAD: [u32; 1 << BITS] = {
    let mut table = [0; 1 << BITS];
    let mut number = 0;
    while number < table.len() {
        let mut bit = 0;
        while bit < BITS {
            table[number] |= (number as u32 >> bit & 1) << (6 * bit);
            bit += 1;
        }
        number += 1;
    }
    table
};

/// Rays of a batch.
pub trait RayList: Copy + Sync {
    /// The number of rays.
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The ray at `index`, which is below the number of rays.
    fn get(&self, index: usize) -> Ray;

    /// The origin of that ray, and its direction, whose longest component or length is 1, by which rays are sorted.
    fn place(&self, index: usize) -> [DVec3; 2] {
        let Ray { origin, direction, .. } = self.get(index);
        [origin, direction]
    }
}

impl RayList for Rays<'_> {
    fn len(&self) -> usize {
        Rays::len(self)
    }

    fn get(&self, index: usize) -> Ray {
        Rays::get(self, index)
    }
}

/// A list of results for each query.
#[derive(Debug, Clone, PartialEq)]
pub struct Lists<T> {
    /// The end of each list among the values.
    ends: Vec<usize>,
    values: Vec<T>,
}

impl<T> Lists<T> {
    /// The number of lists.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The lists.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[T]> {
        (0..self.len()).map(|index| &self[index])
    }

    /// The values of all lists.
    pub fn values(&self) -> &[T] {
        &self.values
    }
}

impl<T> Index<usize> for Lists<T> {
    type Output = [T];

    fn index(&self, index: usize) -> &[T] {
        let start = index.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.values[start..self.ends[index]]
    }
}

/// The memory of a thread.
#[derive(Default)]
struct Worker {
    traversal: Traversal,
    rays: RayBuffer,
    hits: HitBuffer,
    occluded: Vec<bool>,
}

impl Bvh {
    /// Whether rays are sorted: without streams.
    fn sorts(&self) -> bool {
        !self.accelerator().has_streams()
    }

    /// Calls `found` with the index of every ray, the ray and [`Bvh::closest_hit`] of it, in no order.
    pub fn par_each_closest_hit(
        &self,
        rays: &impl RayList,
        mut found: impl FnMut(usize, &Ray, Option<Hit>) + Send,
    ) {
        let trace = |worker: &mut Worker| {
            worker.hits.clear();
            self.accelerator().closest_hits(worker.rays.rays(), &mut worker.hits, &mut worker.traversal);
        };
        trace_groups(rays, self.sorts(), trace, |indices, (), worker| {
            for ((index, ray), hit) in indices.zip(worker.rays.rays().iter()).zip(worker.hits.iter()) {
                found(index, &ray, hit);
            }
        });
    }

    /// [`Bvh::closest_hit`] of every ray.
    pub fn par_closest_hits(&self, rays: impl RayList) -> Vec<Option<Hit>> {
        let mut hits = vec![None; rays.len()];
        self.par_each_closest_hit(&rays, |index, _, hit| hits[index] = hit);
        hits
    }

    /// [`Bvh::occluded`] of every ray.
    pub fn par_are_occluded(&self, rays: impl RayList) -> Vec<bool> {
        let mut occluded = vec![false; rays.len()];
        let trace = |worker: &mut Worker| {
            worker.occluded.clear();
            self.accelerator().are_occluded(worker.rays.rays(), &mut worker.occluded, &mut worker.traversal);
        };
        trace_groups(&rays, self.sorts(), trace, |indices, (), worker| {
            indices.zip(&worker.occluded).for_each(|(index, &is_occluded)| occluded[index] = is_occluded);
        });
        occluded
    }

    /// [`Bvh::all_hits`] of every ray.
    pub fn par_all_hits(&self, rays: impl RayList) -> Lists<Hit> {
        lists(&rays, self.sorts(), |rays, found, traversal| {
            self.accelerator().each_hit(rays, found, traversal);
            found.sort_unstable_by(|(i, a), (j, b)| {
                i.cmp(j).then(a.t.total_cmp(&b.t)).then(a.prim.cmp(&b.prim))
            });
            // A split triangle is in several slots.
            found.dedup_by_key(|(index, hit)| (*index, hit.prim));
        })
    }

    /// [`Bvh::crossings`] of every ray.
    pub fn par_crossings(&self, rays: impl RayList) -> Lists<Crossing> {
        lists(&rays, true, |rays, found, traversal| {
            for (index, ray) in rays.iter().enumerate() {
                found.extend(self.crossings(&ray, traversal).into_iter().map(|crossing| (index, crossing)));
            }
        })
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

/// Results of rays, each with the index of its ray.
type Found<T> = Vec<(usize, T)>;

/// The results of `work`, which appends those of some rays with the index of each ray among them, in order.
fn lists<T: Copy + Send>(
    rays: &impl RayList,
    is_sorted: bool,
    work: impl Fn(Rays, &mut Found<T>, &mut Traversal) + Sync,
) -> Lists<T> {
    let mut ends = vec![0; rays.len()];
    let mut groups: Vec<(Vec<usize>, Found<T>)> = Vec::new();
    let trace = |worker: &mut Worker| {
        let mut found = Vec::new();
        work(worker.rays.rays(), &mut found, &mut worker.traversal);
        found
    };
    trace_groups(rays, is_sorted, trace, |indices, found, _| groups.push((indices.collect(), found)));
    for (indices, found) in &groups {
        found.iter().for_each(|(place, _)| ends[indices[*place]] += 1);
    }
    // Where each list starts, and after it is filled, ends.
    let mut count = 0;
    for end in &mut ends {
        (*end, count) = (count, count + *end);
    }
    let Some(&(_, any)) = groups.iter().find_map(|(_, found)| found.first()) else {
        return Lists { ends, values: Vec::new() };
    };
    let mut values = vec![any; count];
    for (indices, found) in groups {
        for (place, value) in found {
            let end = &mut ends[indices[place]];
            values[*end] = value;
            *end += 1;
        }
    }
    Lists { ends, values }
}

/// Calls `trace` with groups of rays in [`Worker::rays`], and `done` with the indices of a group and its result, a
/// group at a time.
fn trace_groups<G: Send>(
    rays: &impl RayList,
    is_sorted: bool,
    trace: impl Fn(&mut Worker) -> G + Sync,
    mut done: impl FnMut(Indices, G, &Worker) + Send,
) {
    in_groups(
        rays.len(),
        is_sorted,
        |index| rays.place(index),
        |indices, worker| {
            worker.rays.clear();
            worker.rays.extend(indices.map(|index| rays.get(index)));
            trace(worker)
        },
        |indices, group, worker| done(indices, group, worker),
    );
}

/// The results of `work` in the order of the points.
fn each_point<R: Default + Clone + Send>(
    points: &[DVec3],
    work: impl Fn(DVec3, &mut Traversal) -> R + Sync,
) -> Vec<R> {
    let mut results = vec![R::default(); points.len()];
    in_groups(
        points.len(),
        true,
        |index| [points[index], DVec3::ZERO],
        |indices, worker| -> Vec<R> {
            indices.map(|index| work(points[index], &mut worker.traversal)).collect()
        },
        |indices, group, _| indices.zip(group).for_each(|(index, result)| results[index] = result),
    );
    results
}

/// Indices of queries.
#[derive(Clone)]
struct Indices<'a> {
    first: usize,
    /// The index beyond `first` in the lower half of each.
    keys: std::slice::Iter<'a, u64>,
}

impl Iterator for Indices<'_> {
    type Item = usize;

    fn next(&mut self) -> Option<usize> {
        self.keys.next().map(|&key| self.first + key as u32 as usize)
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        self.keys.size_hint()
    }
}

/// Calls `work` on all threads with groups of neighbouring queries of `count`, and `done` with each group and its
/// result, a group at a time in no order. `of` is the origin and direction of a query, by which queries are sorted if
/// `is_sorted`.
fn in_groups<G: Send>(
    count: usize,
    is_sorted: bool,
    of: impl Fn(usize) -> [DVec3; 2] + Sync,
    work: impl Fn(Indices, &mut Worker) -> G + Sync,
    done: impl FnMut(Indices, G, &Worker) + Send,
) {
    let bounds =
        |a: [[DVec3; 2]; 2], b: [[DVec3; 2]; 2]| [0, 1].map(|k| [a[k][0].min(b[k][0]), a[k][1].max(b[k][1])]);
    let none = || [[DVec3::INFINITY, DVec3::NEG_INFINITY]; 2];
    // What is not finite has no place.
    let finite = |vectors: [DVec3; 2]| vectors.iter().all(|v| v.is_finite()).then_some(vectors);
    let placed = if is_sorted { count } else { 0 };
    let extents = (0..placed)
        .into_par_iter()
        .with_min_len(CHUNK)
        .filter_map(|index| finite(of(index)))
        .map(|vectors| vectors.map(|v| [v, v]))
        .reduce(none, bounds)
        .map(|[min, max]| (min, ((1 << BITS) as f64 - 0.5) / (max - min).max_element()));
    let key = |index: usize| {
        let mut key = 0;
        if !is_sorted {
            return key;
        }
        for (v, (min, scale)) in of(index).into_iter().zip(extents) {
            for axis in 0..3 {
                // NaN, of equal coordinates, becomes 0.
                let cell = ((v[axis] - min[axis]) * scale) as usize;
                key = key << 1 | SPREAD[cell.min((1 << BITS) - 1)];
            }
        }
        key
    };
    let done = Mutex::new(done);
    let mut first = 0;
    while first < count {
        let end = count.min(first.saturating_add(1 << 31));
        let part = (0..(end - first) as u32).into_par_iter().with_min_len(CHUNK);
        let mut keys: Vec<u64> =
            part.map(|index| u64::from(key(first + index as usize)) << 32 | u64::from(index)).collect();
        if is_sorted {
            keys.par_sort_unstable();
        }
        keys.par_chunks(CHUNK).for_each_init(Worker::default, |worker, keys| {
            let indices = Indices { first, keys: keys.iter() };
            let group = work(indices.clone(), worker);
            done.lock().unwrap_or_else(PoisonError::into_inner)(indices, group, worker);
        });
        first = end;
    }
}
