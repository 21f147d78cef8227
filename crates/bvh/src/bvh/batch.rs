//! [`Bvh`]: queries of many rays or points on all threads of the current rayon pool.
//!
//! A task answers a group of consecutive queries. Those that traverse the tree one by one are answered along a Morton
//! curve through the six coordinates of origin and direction, so that neighbours follow each other. Streams prefetch
//! instead; sorting rays for them takes longer than it saves (docs/decisions.md). Rays of a picture are traced in tiles.
//! In every tier but `fast`, results are those of the queries one by one.

use std::ops::Range;

use crate::threads::*;
use glam::DVec3;

use super::crossings::{CONTAINS_DIRECTION, in_order, winding_ray};
use super::lists::{ListGroup, Lists};
use super::{Bvh, ClosestPoint, Containment, InsideRule, SignedHit, Traversal, WindingNumber};
use crate::geometry::simd::InstructionSet;
use crate::geometry::{Hit, HitBuffer, PACKET, Point, Ray, RayBuffer, Rays, Side};

/// The queries of a task.
pub(super) const GROUP: usize = 1 << 12;

/// The points of a task for queries that sort them: a share for each thread, but at most 2^14. The more are sorted
/// together, the closer are neighbours (docs/decisions.md).
fn points_of_task(count: usize) -> usize {
    count.div_ceil(current_num_threads()).clamp(1, 1 << 14)
}

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

/// Rays of a batch: a slice or a `Vec` of [`Ray`], or arrays of origins and directions ([`Bvh::rays`](super::Bvh::rays)).
pub trait RayList: Copy + Sync {
    /// The number of rays.
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The ray at `index`, which is below the number of rays.
    fn get(&self, index: usize) -> Ray;

    /// The origin of that ray, and its direction, scaled to a length or a longest component of 1. Rays are sorted by
    /// these.
    fn sort_key(&self, index: usize) -> [DVec3; 2] {
        let Ray { origin, direction, .. } = self.get(index);
        [origin, direction]
    }

    /// The number of rays in a row of a picture, if they are of one, row by row.
    fn width(&self) -> Option<usize> {
        None
    }
}

/// The side of a tile of a picture's rays: a packet.
const TILE: usize = 8;

/// The rays of a task: [`GROUP`], or about as many in rows of tiles. [`RayArrays::in_rows`](super::RayArrays::in_rows)
/// has at least one row of tiles within these.
fn rays_of_task(rays: &impl RayList) -> usize {
    rays.width().map_or(GROUP, |width| TILE * width * (GROUP / (TILE * width)).max(1))
}

impl RayList for Rays<'_> {
    fn len(&self) -> usize {
        Rays::len(self)
    }

    fn get(&self, index: usize) -> Ray {
        Rays::get(self, index)
    }
}

impl RayList for &[Ray] {
    fn len(&self) -> usize {
        <[Ray]>::len(self)
    }

    fn get(&self, index: usize) -> Ray {
        self[index]
    }
}

impl RayList for &Vec<Ray> {
    fn len(&self) -> usize {
        Vec::len(self)
    }

    fn get(&self, index: usize) -> Ray {
        self[index]
    }
}

/// The scratch buffers of a task.
#[derive(Default)]
struct Worker {
    traversal: Traversal,
    order: Order,
    rays: RayBuffer,
    hits: HitBuffer,
    occluded: Vec<bool>,
}

impl Worker {
    /// Loads `count` rays from index `first` on. `is_sorted`: along the curve.
    fn load(&mut self, rays: &impl RayList, first: usize, count: usize, is_sorted: bool) {
        self.order.fill(count, is_sorted, |index| rays.sort_key(first + index));
        if let Some(width) = rays.width().filter(|_| !is_sorted) {
            self.order.fill_tiles(first..first + count, width);
        }
        self.rays.clear();
        self.rays.extend(self.order.indices().map(|index| rays.get(first + index)));
    }
}

impl Bvh {
    /// Whether rays are sorted: without streams.
    fn sorts(&self) -> bool {
        !self.accelerator().has_streams()
    }

    /// Calls `set` with the place of every ray among `places`, the ray and [`Bvh::closest_hit`] of it. There must be as
    /// many places as rays.
    ///
    /// # Panics
    /// If there are more.
    #[cfg_attr(not(feature = "rayon"), allow(private_bounds))]
    pub fn par_each_closest_hit<P: Send>(
        &self,
        rays: &impl RayList,
        places: impl IndexedParallelIterator<Item = P>,
        set: impl Fn(&mut P, &Ray, Option<Hit>) + Sync,
    ) {
        let task = rays_of_task(rays);
        places.chunks(task).enumerate().for_each_init(Worker::default, |worker, (group, mut places)| {
            worker.load(rays, group * task, places.len(), self.sorts());
            let Worker { rays, hits, traversal, order, .. } = worker;
            hits.clear();
            self.accelerator().closest_hits(rays.rays(), hits, traversal);
            for ((index, ray), hit) in order.indices().zip(rays.rays().iter()).zip(hits.iter()) {
                set(&mut places[index], &ray, hit);
            }
        });
    }

    /// [`Bvh::closest_hit`] of every ray.
    pub fn par_closest_hits(&self, rays: impl RayList) -> Vec<Option<Hit>> {
        let mut hits = vec![None; rays.len()];
        self.par_each_closest_hit(&rays, hits.par_iter_mut(), |place, _, hit| **place = hit);
        hits
    }

    /// [`Bvh::closest_hit_by`] of every ray; `accepts` is called with the ray, too. Rays whose closest hit is not
    /// accepted are traced again, one by one.
    pub fn par_closest_hits_by(
        &self,
        rays: impl RayList,
        accepts: impl Fn(&Ray, &Hit) -> bool + Sync,
    ) -> Vec<Option<Hit>> {
        let mut results = vec![None; rays.len()];
        let task = rays_of_task(&rays);
        results.par_chunks_mut(task).enumerate().for_each_init(
            Worker::default,
            |worker, (group, results)| {
                worker.load(&rays, group * task, results.len(), self.sorts());
                let Worker { rays, hits, traversal, order, .. } = worker;
                hits.clear();
                self.accelerator().closest_hits(rays.rays(), hits, traversal);
                for ((index, ray), hit) in order.indices().zip(rays.rays().iter()).zip(hits.iter()) {
                    results[index] = match hit {
                        Some(hit) if !accepts(&ray, &hit) => {
                            self.closest_hit_by(&ray, |hit| accepts(&ray, hit), traversal)
                        }
                        accepted => accepted,
                    };
                }
            },
        );
        results
    }

    /// [`Bvh::occluded`] of every ray.
    pub fn par_are_occluded(&self, rays: impl RayList) -> Vec<bool> {
        let mut results = vec![false; rays.len()];
        let task = rays_of_task(&rays);
        results.par_chunks_mut(task).enumerate().for_each_init(
            Worker::default,
            |worker, (group, results)| {
                worker.load(&rays, group * task, results.len(), self.sorts());
                let Worker { rays, occluded, traversal, order, .. } = worker;
                occluded.clear();
                self.accelerator().are_occluded(rays.rays(), occluded, traversal);
                order.indices().zip(occluded).for_each(|(index, is_occluded)| results[index] = *is_occluded);
            },
        );
        results
    }

    /// [`Bvh::all_hits`] of every ray.
    pub fn par_all_hits(&self, rays: impl RayList) -> Lists<Hit> {
        self.par_all_hits_by(rays, |_, _| true)
    }

    /// [`Bvh::all_hits`] of every ray, of which those are left that `accepts` returns `true` for.
    pub fn par_all_hits_by(
        &self,
        rays: impl RayList,
        accepts: impl Fn(&Ray, &Hit) -> bool + Sync,
    ) -> Lists<Hit> {
        self.hit_lists(&rays, accepts, |hit| *hit)
    }

    /// The number of hits of every ray that `accepts` returns `true` for: the lengths of [`Bvh::par_all_hits_by`],
    /// whose lists are not stored.
    pub fn par_hit_counts(
        &self,
        rays: impl RayList,
        accepts: impl Fn(&Ray, &Hit) -> bool + Sync,
    ) -> Vec<usize> {
        self.hit_lists(&rays, accepts, |_| ()).iter().map(<[()]>::len).collect()
    }

    /// What `of` returns for the accepted hits of every ray.
    fn hit_lists<T: Send>(
        &self,
        rays: &impl RayList,
        accepts: impl Fn(&Ray, &Hit) -> bool + Sync,
        of: impl Fn(&Hit) -> T + Sync,
    ) -> Lists<T> {
        let trace = |rays: Rays, found: &mut Vec<(usize, Hit)>, traversal: &mut Traversal| {
            self.accelerator().each_hit(rays, found, traversal);
        };
        let finish = |index, found: &[(usize, Hit)], places: &mut [u32], list: &mut Vec<T>| {
            let hit = |place: &u32| &found[*place as usize].1;
            places.sort_unstable_by(|a, b| {
                let [a, b] = [a, b].map(hit);
                a.t.total_cmp(&b.t).then(a.prim.cmp(&b.prim))
            });
            // A split triangle is in several slots.
            let found = places.chunk_by(|a, b| hit(a).prim == hit(b).prim).map(|same| hit(&same[0]));
            list.extend(found.filter(|hit| accepts(&rays.get(index), hit)).map(&of));
        };
        self.lists(rays, trace, finish)
    }

    /// [`Bvh::crossings`] of every ray.
    pub fn par_crossings(&self, rays: impl RayList) -> Lists<SignedHit> {
        let trace = |rays: Rays, found: &mut Vec<(usize, _)>, traversal: &mut Traversal| {
            self.each_crossing_of_rays(rays, traversal, |index, crossing, primitive| {
                found.push((index, (crossing, primitive.into())));
            });
        };
        let finish = |index, found: &[_], places: &mut [u32], list: &mut Vec<SignedHit>| {
            let (ray, first) = (rays.get(index), list.len());
            list.extend(in_order(&ray, found, places));
            if let Some(shapes) = self.own_shapes() {
                shapes.add_crossings(&ray, list, first, &mut Traversal::default());
            }
        };
        self.lists(&rays, trace, finish)
    }

    /// The lists of rays. `trace` appends results of the rays of a packet, each with the index of its ray among them,
    /// in any order; `finish` appends the list of a ray, given its index, all results and the places of its own among
    /// them.
    fn lists<R: Send, T: Send>(
        &self,
        rays: &impl RayList,
        trace: impl Fn(Rays, &mut Vec<(usize, R)>, &mut Traversal) + Sync,
        finish: impl Fn(usize, &[(usize, R)], &mut [u32], &mut Vec<T>) + Sync,
    ) -> Lists<T> {
        let scratch = || (Worker::default(), Vec::new(), Vec::new());
        let of_group = |(worker, found, places): &mut (Worker, Vec<_>, Vec<u32>), group| {
            let first = group * GROUP;
            let count = GROUP.min(rays.len() - first);
            worker.load(rays, first, count, self.sorts());
            found.clear();
            for (packet, rays) in worker.rays.rays().chunks(PACKET).enumerate() {
                let before = found.len();
                trace(rays, found, &mut worker.traversal);
                for (index, _) in &mut found[before..] {
                    *index = worker.order.index(packet * PACKET + *index);
                }
            }
            // Sorted by ray, by counting.
            let mut ends = vec![0; count];
            found.iter().for_each(|(index, _)| ends[*index] += 1);
            let mut sum = 0;
            for end in &mut ends {
                (*end, sum) = (sum, sum + *end);
            }
            places.resize(found.len(), 0);
            for (place, (index, _)) in (0..).zip(found.iter()) {
                places[ends[*index]] = place;
                ends[*index] += 1;
            }
            let (mut values, mut start) = (Vec::with_capacity(found.len()), 0);
            for (index, end) in ends.iter_mut().enumerate() {
                finish(first + index, found, &mut places[start..*end], &mut values);
                (start, *end) = (*end, values.len());
            }
            ListGroup { ends, values }
        };
        let groups = (0..rays.len().div_ceil(GROUP)).into_par_iter().map_init(scratch, of_group);
        Lists::of(groups.collect())
    }

    /// [`Bvh::winding_number`] of every point.
    pub fn par_winding_numbers(&self, points: &[impl Point]) -> Vec<i32> {
        let points = &*Point::all(points);
        let mut results = vec![0; points.len()];
        let scratch = || (Worker::default(), Vec::new(), Vec::new());
        results.par_chunks_mut(GROUP).zip(points.par_chunks(GROUP)).for_each_init(
            scratch,
            |(worker, indices, sides), (results, points)| {
                worker.order.fill(points.len(), self.sorts(), |index| [points[index], DVec3::ZERO]);
                indices.clear();
                worker.rays.clear();
                for index in worker.order.indices() {
                    if let Some(ray) = winding_ray(points[index], CONTAINS_DIRECTION) {
                        indices.push(index);
                        worker.rays.push(&ray);
                    }
                }
                for (indices, rays) in indices.chunks(PACKET).zip(worker.rays.rays().chunks(PACKET)) {
                    let found = |index: usize, SignedHit { prim, side, .. }, _| {
                        sides.push((index, prim, if side == Side::Leaving { 1 } else { -1 }));
                    };
                    self.each_crossing_of_rays(rays, &mut worker.traversal, found);
                    // A split triangle is in several slots; a sphere has two sides.
                    sides.sort_unstable();
                    sides.dedup();
                    sides.drain(..).for_each(|(index, _, side)| results[indices[index]] += side);
                }
                if let Some(shapes) = self.own_shapes() {
                    for (&index, ray) in indices.iter().zip(worker.rays.rays().iter()) {
                        results[index] += shapes.winding_number(&ray, &mut worker.traversal);
                    }
                }
            },
        );
        results
    }

    /// [`Bvh::contains`] of every point.
    pub fn par_contains(&self, points: &[impl Point]) -> Vec<Containment> {
        let points = &*Point::all(points);
        let rule = self.inside_rule();
        if rule == InsideRule::Vote {
            let single = |point, traversal: &mut Traversal| Some(self.contains(point, traversal));
            return self.of_points(points, single).into_iter().flatten().collect();
        }
        let numbers = self.par_generalised_winding_numbers(points, 1.0);
        numbers.into_iter().map(|number| Containment::of(number, rule)).collect()
    }

    /// [`Bvh::generalised_winding_number`] of every point.
    pub fn par_generalised_winding_numbers(&self, points: &[impl Point], beta: f64) -> Vec<WindingNumber> {
        let points = &*Point::all(points);
        if self.inside_rule() == InsideRule::Crossings {
            let exact = |(&point, number)| WindingNumber::exact(point, number);
            return points.iter().zip(self.par_winding_numbers(points)).map(exact).collect();
        }
        let expansions = self.expansions();
        let mut results = vec![WindingNumber { value: 0.0, error: 0.0 }; points.len()];
        let task = points_of_task(points.len());
        results.par_chunks_mut(task).zip(points.par_chunks(task)).for_each_init(
            || (Order::default(), Vec::new(), Vec::new()),
            |(order, sorted, stack), (results, points)| {
                order.fill(points.len(), true, |index| [points[index], DVec3::ZERO]);
                sorted.clear();
                sorted.extend(order.indices().map(|index| points[index]));
                let set = &mut |place, number| results[order.index(place)] = number;
                expansions.evaluate(sorted, beta, InstructionSet::widest(), stack, set);
                if self.own_shapes().is_some() {
                    let traversal = &mut Traversal::default();
                    points.iter().zip(results).for_each(|(point, number)| {
                        *number = self.with_shapes(*number, *point, traversal);
                    });
                }
            },
        );
        results
    }

    /// [`Bvh::closest_point`] of every point.
    pub fn par_closest_points(&self, points: &[impl Point]) -> Vec<Option<ClosestPoint>> {
        self.par_closest_points_within(points, f64::INFINITY)
    }

    /// [`Bvh::closest_point_within`] of every point.
    pub fn par_closest_points_within(
        &self,
        points: &[impl Point],
        max_distance: f64,
    ) -> Vec<Option<ClosestPoint>> {
        let points = &*Point::all(points);
        self.of_points(points, |point, traversal| self.closest_point_within(point, max_distance, traversal))
    }

    /// The results of single queries of points.
    fn of_points<R: Clone + Default + Send>(
        &self,
        points: &[DVec3],
        query: impl Fn(DVec3, &mut Traversal) -> R + Sync,
    ) -> Vec<R> {
        let mut results = vec![R::default(); points.len()];
        let task = points_of_task(points.len());
        results.par_chunks_mut(task).zip(points.par_chunks(task)).for_each_init(
            Worker::default,
            |worker, (results, points)| {
                worker.order.fill(points.len(), true, |index| [points[index], DVec3::ZERO]);
                for index in worker.order.indices() {
                    results[index] = query(points[index], &mut worker.traversal);
                }
            },
        );
        results
    }

    /// [`Bvh::nearest`] of every point.
    pub fn par_nearest(&self, points: &[impl Point], count: usize, max_distance: f64) -> Lists<ClosestPoint> {
        let points = &*Point::all(points);
        let lists =
            self.of_points(points, |point, traversal| self.nearest(point, count, max_distance, traversal));
        let of_group = |lists: &[Vec<_>]| {
            let mut end = 0;
            let ends = lists.iter().map(|list| {
                end += list.len();
                end
            });
            ListGroup { ends: ends.collect(), values: lists.concat() }
        };
        Lists::of(lists.par_chunks(GROUP).map(of_group).collect())
    }

    /// [`Bvh::signed_distance`] of every point.
    pub fn par_signed_distances(&self, points: &[impl Point]) -> Vec<Option<f64>> {
        let points = &*Point::all(points);
        let closest = self.par_closest_points(points);
        let signed = |(closest, containment): (&Option<ClosestPoint>, Containment)| {
            closest.map(|closest| containment.signed(closest.distance))
        };
        closest.iter().zip(self.par_contains(points)).map(signed).collect()
    }
}

/// The order in which the queries of a group are answered.
#[derive(Default)]
struct Order {
    /// The index of a query in the lower half of each; its place on the curve in the upper half.
    keys: Vec<u64>,
}

impl Order {
    /// The order of `count` queries, whose origin and direction are `of` their index; `is_sorted`: along the curve.
    fn fill(&mut self, count: usize, is_sorted: bool, of: impl Fn(usize) -> [DVec3; 2]) {
        self.keys.clear();
        self.keys.extend(0..count as u64);
        if !is_sorted {
            return;
        }
        // NaN and infinity do not count.
        let finite = (0..count).map(&of).filter(|vectors| vectors.iter().all(|v| v.is_finite()));
        let none = [[DVec3::INFINITY, DVec3::NEG_INFINITY]; 2];
        let bounds = finite.fold(none, |bounds, vectors| {
            [0, 1].map(|k| [bounds[k][0].min(vectors[k]), bounds[k][1].max(vectors[k])])
        });
        let grid = bounds.map(|[min, max]| (min, ((1 << BITS) as f64 - 0.5) / (max - min).max_element()));
        for (index, key) in self.keys.iter_mut().enumerate() {
            let mut place = 0;
            for (v, (min, scale)) in of(index).into_iter().zip(grid) {
                for axis in 0..3 {
                    // NaN, of equal coordinates, becomes 0.
                    let cell = ((v[axis] - min[axis]) * scale) as usize;
                    place = place << 1 | SPREAD[cell.min((1 << BITS) - 1)];
                }
            }
            *key |= u64::from(place) << 32;
        }
        self.keys.sort_unstable();
    }

    /// The order of rays of a picture, at these indices of it, by tiles.
    fn fill_tiles(&mut self, rays: Range<usize>, width: usize) {
        self.keys.clear();
        self.keys.extend((0..).zip(rays).map(|(index, ray): (u64, usize)| {
            let (x, y) = (ray % width, ray / width);
            let tile = y / TILE * width.div_ceil(TILE) + x / TILE;
            ((tile * TILE + y % TILE) as u64) << 32 | index
        }));
        self.keys.sort_unstable();
    }

    /// The index of the query at a place.
    fn index(&self, place: usize) -> usize {
        self.keys[place] as u32 as usize
    }

    /// The indices of the queries.
    fn indices(&self) -> impl ExactSizeIterator<Item = usize> {
        self.keys.iter().map(|&key| key as u32 as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::splitmix64::splitmix64;
    use crate::bvh::{Layout, Preset, Primitive, Slot, Traversal, build};
    use crate::geometry::{Numerics, PrimId};

    fn point(seed: u64) -> DVec3 {
        DVec3::from([0, 1, 2].map(|axis| (splitmix64(3 * seed + axis) >> 60) as f64 / 8.0 - 1.0))
    }

    /// Triangles on a grid, with copies and ties, a large one that presets split, and a sphere.
    fn primitives() -> Vec<Primitive> {
        let mut all: Vec<Primitive> = (0..200)
            .map(|seed| [1, 2, 3].map(|k| point(seed) * 2.0 + point(1000 * k + seed)).into())
            .collect();
        all.push([[-2.0, -2.0, -2.0], [2.0, -2.0, 2.0], [0.0, 2.0, 0.5]].into());
        all.push(([0.5, 0.5, 0.5], 0.25).into());
        all.extend_from_within(0..30);
        all
    }

    fn rays(bvh: &Bvh) -> RayBuffer {
        let ray = |seed| bvh.ray_within(point(seed) * 4.0, point(seed + 7000) + 0.01, 9.0).expect("finite");
        (0..1000).map(ray).collect()
    }

    /// Hits without their slots, which depend on the structure.
    fn numbers(hit: &Hit) -> (f64, PrimId, [f64; 2]) {
        (hit.t, hit.prim, hit.barycentrics)
    }

    /// Hits by a filter are those of a list of the accepted primitives alone.
    #[test]
    fn accepted_hits_are_those_of_the_accepted_primitives() {
        let all = primitives();
        let accepts = |prim: PrimId| prim.0 % 3 != 1;
        for (preset, numerics) in Preset::ALL.into_iter().flat_map(|p| Numerics::ALL.map(|n| (p, n))) {
            if numerics == Numerics::Fast {
                continue;
            }
            let bvh = Bvh::with(all.iter().copied(), preset, numerics).expect("finite");
            let kept = (0..).zip(&all).filter(|(id, _)| accepts(PrimId(*id)));
            let slots = kept.filter_map(|(id, primitive)| {
                Some(Slot { primitive: primitive.rounded(numerics.precision())?, id: PrimId(id) })
            });
            let list = build(slots, Layout::BruteForce, numerics);
            let (buffer, traversal) = (rays(&bvh), &mut Traversal::default());
            let of_batch = bvh.par_closest_hits_by(buffer.rays(), |_, hit| accepts(hit.prim));
            let lists = bvh.par_all_hits_by(buffer.rays(), |_, hit| accepts(hit.prim));
            let counts = bvh.par_hit_counts(buffer.rays(), |_, hit| accepts(hit.prim));
            let mut count = 0;
            for (index, ray) in buffer.rays().iter().enumerate() {
                let expected = list.closest_hit(&ray, traversal).as_ref().map(numbers);
                let found = bvh.closest_hit_by(&ray, |hit| accepts(hit.prim), traversal);
                assert_eq!(found.as_ref().map(numbers), expected, "{numerics:?} {preset:?} {index}");
                assert_eq!(of_batch[index].as_ref().map(numbers), expected);
                let of_ray: Vec<Hit> = bvh.all_hits(&ray, traversal);
                let of_ray: Vec<Hit> = of_ray.into_iter().filter(|hit| accepts(hit.prim)).collect();
                assert_eq!(
                    lists[index].iter().map(numbers).collect::<Vec<_>>(),
                    of_ray.iter().map(numbers).collect::<Vec<_>>()
                );
                assert_eq!(counts[index], of_ray.len());
                count += of_ray.len();
            }
            assert!(count > 300, "{count}");
            assert!(bvh.closest_hit_by(&buffer.get(0), |_| false, traversal).is_none());
        }
    }
}
