//! [`Bvh`]: the primitives near a point or in a box, and the pairs of triangles of two structures that meet.

use crate::threads::*;
use glam::DVec3;

use super::{Bvh, ClosestPoint, Primitive, Traversal};
use crate::geometry::{Point, Precision, PrimId, Triangle, triangle_meets_box, triangles_meet};

impl Bvh {
    /// The closest points of the `count` nearest primitives that are no farther than `max_distance`, which may be
    /// infinite; in order of distance, at equal distance of id. With `usize::MAX`, of all within a radius. Empty
    /// where [`Bvh::closest_point`] is `None`; distances are as good as its.
    pub fn nearest(
        &self,
        point: impl Point,
        count: usize,
        max_distance: f64,
        traversal: &mut Traversal,
    ) -> Vec<ClosestPoint> {
        let point = point.to_dvec3();
        let mut found: Vec<ClosestPoint> = Vec::new();
        if count == 0 || !point.as_vec3().is_finite() {
            return found;
        }
        let keep = |found: &mut Vec<ClosestPoint>| {
            found.sort_unstable_by(|a, b| a.distance.total_cmp(&b.distance).then(a.prim.cmp(&b.prim)));
            // A split triangle is in several slots.
            found.dedup_by_key(|closest| closest.prim);
            found.truncate(count);
        };
        let mut limit = max_distance;
        let mut visit = |closest: ClosestPoint| {
            if closest.distance <= limit {
                found.push(closest);
            }
            if found.len() >= count.saturating_mul(2) {
                keep(&mut found);
                if found.len() == count {
                    limit = found[count - 1].distance;
                }
            }
            limit
        };
        self.each_closest_point(point, max_distance, &mut visit, traversal);
        keep(&mut found);
        found
    }

    /// The triangles that have a point in common with the box from `min` to `max`, borders included, and the other
    /// shapes whose bounds have; in order of id. Exact for triangles as stored; those without area are not found.
    pub fn in_box(&self, min: impl Point, max: impl Point, traversal: &mut Traversal) -> Vec<PrimId> {
        // All primitives are finite in f32.
        let most = f64::from(f32::MAX);
        let ends = [min.to_dvec3(), max.to_dvec3()]
            .map(|end| end.map(|x| Precision::Double.round(x.clamp(-most, most))));
        let is_found = |primitive: &Primitive| match primitive {
            Primitive::Triangle(triangle) => {
                triangle_meets_box(&triangle.0, ends) && !triangle.is_degenerate()
            }
            Primitive::Analytic(shape) => {
                let b = shape.bounds();
                b.min.as_dvec3().cmple(ends[1]).all() && b.max.as_dvec3().cmpge(ends[0]).all()
            }
        };
        let mut found = self.each_in_box(ends, is_found, traversal);
        if let Some(shapes) = self.own_shapes().filter(|_| ends[0].cmple(ends[1]).all()) {
            shapes.add_in_box(ends, &mut found, traversal);
        }
        found
    }

    /// The primitives of which `is_found` returns `true`, of those whose bounds have a point in common with a box and
    /// perhaps of others; in order of id. None for a box that is inverted or has NaN.
    fn each_in_box(
        &self,
        ends: [DVec3; 2],
        is_found: impl Fn(&Primitive) -> bool,
        traversal: &mut Traversal,
    ) -> Vec<PrimId> {
        let mut found = Vec::new();
        if !ends[0].cmple(ends[1]).all() {
            return found;
        }
        let mut visit = |prim, primitive: Primitive| {
            if is_found(&primitive) {
                found.push(prim);
            }
            0.0
        };
        self.accelerator().each_near_box(ends, 0.0, &mut visit, traversal);
        found.sort_unstable();
        found.dedup();
        found
    }

    /// The pairs of a triangle of this structure and one of another that have a point in common, borders included, in
    /// order of both ids. Exact for triangles as stored, also where they touch or lie in one plane; triangles without
    /// area meet none. On all threads of the current rayon pool.
    pub fn par_intersecting_triangles(&self, other: &Bvh) -> Vec<[PrimId; 2]> {
        let mut triangles = Vec::new();
        self.accelerator().each_primitive(&mut |prim, primitive| {
            if let Primitive::Triangle(triangle) = primitive
                && !triangle.is_degenerate()
            {
                triangles.push((prim, triangle));
            }
        });
        triangles.par_sort_unstable_by_key(|(prim, _)| *prim);
        triangles.dedup_by_key(|(prim, _)| *prim);
        let meeting = |traversal: &mut Traversal, (prim, triangle): &(PrimId, Triangle)| {
            let [a, b, c] = triangle.0;
            let is_met = |primitive: &Primitive| match primitive {
                Primitive::Triangle(other) => triangles_meet(&triangle.0, &other.0) && !other.is_degenerate(),
                Primitive::Analytic(_) => false,
            };
            let met = other.each_in_box([a.min(b).min(c), a.max(b).max(c)], is_met, traversal);
            met.into_iter().map(|other| [*prim, other]).collect::<Vec<_>>()
        };
        triangles.par_iter().map_init(Traversal::default, meeting).flatten_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Preset;
    use crate::bvh::closest_point::closest_on;
    use crate::bvh::splitmix64::splitmix64;
    use crate::geometry::Numerics;

    /// A point of a grid of spacing 1/8, from -1 to 1: coordinates that f32 holds, and ties.
    fn point(seed: u64) -> DVec3 {
        DVec3::from([0, 1, 2].map(|axis| (splitmix64(3 * seed + axis) >> 60) as f64 / 8.0 - 1.0))
    }

    fn triangles(first: u64, count: u64, size: f64) -> Vec<Primitive> {
        let of = |seed: u64| {
            let at = point(seed) * 2.0;
            Primitive::from([1, 2, 3].map(|k| at + point(1000 * k + seed) * size))
        };
        (first..first + count).map(of).collect()
    }

    fn each_build(primitives: &[Primitive], mut check: impl FnMut(&Bvh)) {
        for (preset, numerics) in Preset::ALL.into_iter().flat_map(|p| Numerics::ALL.map(|n| (p, n))) {
            check(&Bvh::with(primitives.iter().copied(), preset, numerics).expect("finite"));
        }
    }

    #[test]
    fn the_nearest_are_those_of_all() {
        let mut primitives = triangles(0, 300, 0.5);
        primitives.push(Primitive::from(([0.5, 0.5, 0.5], 0.25)));
        // A large one, which presets split, and copies at equal distances.
        primitives.push(Primitive::from([[-2.0, -2.0, -2.0], [2.0, -2.0, 2.0], [0.0, 2.0, 0.5]]));
        primitives.extend_from_within(0..20);
        each_build(&primitives, |bvh| {
            let traversal = &mut Traversal::default();
            for seed in 5000..5040 {
                let q = point(seed) * 1.5;
                let mut all: Vec<ClosestPoint> =
                    (0..).zip(&primitives).map(|(id, p)| closest_on(p, PrimId(id), q)).collect();
                all.sort_unstable_by(|a, b| a.distance.total_cmp(&b.distance).then(a.prim.cmp(&b.prim)));
                assert_eq!(bvh.closest_point(q, traversal), Some(all[0]));
                for count in [1, 2, 7, 50, 400] {
                    assert_eq!(bvh.nearest(q, count, f64::INFINITY, traversal), all[..count.min(all.len())]);
                }
                for radius in [0.0, 0.25, 0.7, 10.0] {
                    let within: Vec<_> = all.iter().copied().filter(|p| p.distance <= radius).collect();
                    assert_eq!(bvh.nearest(q, usize::MAX, radius, traversal), within, "{q} {radius}");
                    assert_eq!(bvh.nearest(q, 3, radius, traversal), within[..within.len().min(3)]);
                    let closest = bvh.closest_point_within(q, radius, traversal);
                    assert_eq!(closest, within.first().copied());
                }
            }
            for q in [f64::NAN, 1e39] {
                assert_eq!(bvh.nearest([q, 0.0, 0.0], 3, f64::INFINITY, traversal), []);
            }
            assert_eq!(bvh.nearest([0.0; 3], 3, f64::NAN, traversal), []);
            assert_eq!(bvh.closest_point_within([0.0; 3], f64::NAN, traversal), None);
            assert_eq!(bvh.nearest([0.0; 3], 0, f64::INFINITY, traversal), []);
        });
    }

    #[test]
    fn batches_are_the_points_one_by_one() {
        let bvh = Bvh::new(triangles(0, 300, 0.5)).expect("finite");
        let points: Vec<DVec3> = (0..5000).map(|seed| point(seed) * 1.5).collect();
        let traversal = &mut Traversal::default();
        for (count, radius) in [(3, f64::INFINITY), (usize::MAX, 0.2), (0, 1.0)] {
            let lists = bvh.par_nearest(&points, count, radius);
            assert_eq!(lists.len(), points.len());
            for (list, q) in lists.iter().zip(&points) {
                assert_eq!(list, bvh.nearest(*q, count, radius, traversal));
            }
        }
    }

    /// A far point with a maximum distance visits no node but the root.
    #[test]
    fn a_maximum_distance_leaves_out_nodes() {
        let bvh = Bvh::new(triangles(0, 1000, 0.1)).expect("finite");
        let traversal = &mut Traversal::default();
        assert_eq!(bvh.closest_point_within([100.0; 3], 1.0, traversal), None);
        assert_eq!((traversal.tests.nodes, traversal.tests.primitives), (1, 0));
    }

    #[test]
    fn boxes_have_those_of_all() {
        let primitives = triangles(0, 300, 0.5);
        let mut count = 0;
        each_build(&primitives, |bvh| {
            let traversal = &mut Traversal::default();
            for seed in 6000..6040 {
                let [min, size] = [point(seed) * 1.5, (point(seed + 100) + 1.0) * 0.5];
                let ends = [min, min + size];
                let meets = |p: &Primitive| match p {
                    Primitive::Triangle(t) => !t.is_degenerate() && triangle_meets_box(&t.0, ends),
                    Primitive::Analytic(_) => false,
                };
                let expected: Vec<PrimId> =
                    (0..).zip(&primitives).filter(|(_, p)| meets(p)).map(|(id, _)| PrimId(id)).collect();
                assert_eq!(bvh.in_box(ends[0], ends[1], traversal), expected);
                count += expected.len();
            }
            assert_eq!(bvh.in_box([f64::NAN; 3], [9.0; 3], traversal), []);
            assert_eq!(bvh.in_box([1.0; 3], [-1.0; 3], traversal), []);
            let everything = bvh.in_box([f64::NEG_INFINITY; 3], [f64::INFINITY; 3], traversal);
            assert!(everything.len() > 250);
        });
        assert!(count > 1000, "{count}");
    }

    #[test]
    fn meeting_triangles_are_those_of_all_pairs() {
        let (these, those) = (triangles(0, 150, 0.5), triangles(400, 150, 0.75));
        let of = |p: &Primitive| match p {
            Primitive::Triangle(triangle) if !triangle.is_degenerate() => Some(triangle.0),
            _ => None,
        };
        let mut expected = Vec::new();
        for (i, a) in (0..).zip(&these).filter_map(|(i, p)| Some((i, of(p)?))) {
            for (j, b) in (0..).zip(&those).filter_map(|(j, p)| Some((j, of(p)?))) {
                if triangles_meet(&a, &b) {
                    expected.push([PrimId(i), PrimId(j)]);
                }
            }
        }
        assert!(expected.len() > 50, "{}", expected.len());
        let other = Bvh::new(those.iter().copied()).expect("finite");
        each_build(&these, |bvh| assert_eq!(bvh.par_intersecting_triangles(&other), expected));
        let swapped: Vec<_> = other.par_intersecting_triangles(&Bvh::new(these).expect("finite"));
        let mut again: Vec<_> = swapped.into_iter().map(|[a, b]| [b, a]).collect();
        again.sort_unstable();
        assert_eq!(again, expected);
    }
}
