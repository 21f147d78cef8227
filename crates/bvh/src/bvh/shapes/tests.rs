//! User geometry against the same spheres as primitives, and by hand.

use std::sync::atomic::{AtomicBool, Ordering};

use glam::DMat4;

use super::*;
use crate::bvh::splitmix64::splitmix64;
use crate::bvh::{Layout, Slot, Update, build};
use crate::geometry::{Mesh, Placed, Placement, Precision, RayBuffer, Sphere};

/// A sphere as a user writes it: with the formula of textbooks, and nothing else of this crate.
struct Ball {
    centre: DVec3,
    radius: f64,
}

impl UserGeometry for Ball {
    fn bounds(&self) -> [DVec3; 2] {
        [self.centre - self.radius, self.centre + self.radius]
    }

    fn intersect(&self, ray: &Ray, found: &mut dyn FnMut(f64, Side)) {
        let (f, d) = (ray.origin() - self.centre, ray.direction());
        let (a, b, c) = (d.dot(d), f.dot(d), f.dot(f) - self.radius * self.radius);
        let discriminant = b * b - a * c;
        if discriminant >= 0.0 {
            let root = discriminant.sqrt();
            // The far one first: the order does not matter.
            found((-b + root) / a, Side::Leaving);
            found((-b - root) / a, Side::Entering);
        }
    }

    fn normal(&self, point: DVec3) -> Option<DVec3> {
        (point - self.centre).try_normalize()
    }

    fn is_closed(&self) -> bool {
        true
    }

    fn closest_point(&self, point: DVec3) -> Option<DVec3> {
        Some(self.centre + (point - self.centre).try_normalize()? * self.radius)
    }
}

/// The square of half side 1 in the plane z = 0, normal +z. It has no closest points.
struct Square;

impl UserGeometry for Square {
    fn bounds(&self) -> [DVec3; 2] {
        [DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, 1.0, 0.0)]
    }

    fn intersect(&self, ray: &Ray, found: &mut dyn FnMut(f64, Side)) {
        let along = ray.direction().z;
        let t = -ray.origin().z / along;
        if along != 0.0 && ray.at(t).abs().truncate().max_element() <= 1.0 {
            found(t, if along < 0.0 { Side::Entering } else { Side::Leaving });
        }
    }
}

/// Two parallel planes of a slab that is entered and left twice: from -2 to -1 and from 1 to 2 along x.
struct Slabs;

impl UserGeometry for Slabs {
    fn bounds(&self) -> [DVec3; 2] {
        [DVec3::new(-2.0, -9.0, -9.0), DVec3::new(2.0, 9.0, 9.0)]
    }

    fn intersect(&self, ray: &Ray, found: &mut dyn FnMut(f64, Side)) {
        for (x, outwards) in [(-2.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (2.0, 1.0)] {
            let side = if ray.direction().x * outwards > 0.0 { Side::Leaving } else { Side::Entering };
            found((x - ray.origin().x) / ray.direction().x, side);
        }
    }

    fn is_closed(&self) -> bool {
        true
    }
}

/// A box that is hit at the same t by every ray.
struct AtDistance {
    bounds: [DVec3; 2],
    t: f64,
}

impl UserGeometry for AtDistance {
    fn bounds(&self) -> [DVec3; 2] {
        self.bounds
    }

    fn intersect(&self, _ray: &Ray, found: &mut dyn FnMut(f64, Side)) {
        found(self.t, Side::Entering);
    }
}

/// The unit ball around the origin; its t are checked to be in units of the direction's length, and it records whether
/// that was far from 1.
#[derive(Default)]
struct AnyLength(AtomicBool);

impl UserGeometry for AnyLength {
    fn bounds(&self) -> [DVec3; 2] {
        [-DVec3::ONE, DVec3::ONE]
    }

    fn intersect(&self, ray: &Ray, found: &mut dyn FnMut(f64, Side)) {
        self.0.fetch_or((ray.direction().length() - 1.0).abs() > 1e-3, Ordering::Relaxed);
        Ball { centre: DVec3::ZERO, radius: 1.0 }.intersect(ray, &mut |t, side| {
            let point = ray.origin() + ray.direction() * t;
            assert!((point.length() - 1.0).abs() < 1e-9, "{ray:?} {t}");
            found(t, side);
        });
    }

    fn is_closed(&self) -> bool {
        true
    }
}

fn number(seed: u64) -> f64 {
    (splitmix64(seed) >> 11) as f64 / f64::from(1 << 21) / f64::from(1u32 << 31) - 1.0
}

fn vector(seed: u64) -> DVec3 {
    DVec3::from([3 * seed, 3 * seed + 1, 3 * seed + 2].map(number))
}

/// Triangles and spheres of f32 coordinates, so that all tiers store the same.
fn crowd() -> Vec<Primitive> {
    let f32s = |v: DVec3| v.as_vec3().as_dvec3();
    let one = |id: u64| match id % 5 {
        0 => Sphere { centre: f32s(vector(900 + id)), radius: 0.125 }.into(),
        _ => Primitive::from([1, 2, 3].map(|k| f32s(vector(8 * id) + vector(8 * id + k) * 0.25))),
    };
    (0..60).map(one).collect()
}

fn balls() -> Vec<Ball> {
    (0..40).map(|id| Ball { centre: vector(5000 + id), radius: 0.05 + 0.1 * number(70 + id).abs() }).collect()
}

fn shared<S: UserGeometry + 'static>(shapes: impl IntoIterator<Item = S>) -> Vec<Arc<dyn UserGeometry>> {
    shapes.into_iter().map(|shape| Arc::new(shape) as Arc<dyn UserGeometry>).collect()
}

fn rays(precision: Precision) -> RayBuffer {
    let ray = |seed: u64| {
        let origin = vector(20_000 + seed) * 2.0;
        let towards = vector(30_000 + seed) - origin;
        let direction =
            if seed.is_multiple_of(7) { DVec3::AXES[seed as usize % 3] } else { towards.normalize() };
        // A third of them end within the crowd.
        let t_max = if seed.is_multiple_of(3) { 1.5 } else { f64::INFINITY };
        precision.ray(origin, direction, if seed.is_multiple_of(4) { 0.5 } else { 0.0 }, t_max)
    };
    // And a packet with a common origin.
    let from_one =
        |seed: u64| precision.ray(DVec3::Z * 3.0, (vector(seed) - DVec3::Z * 3.0).normalize(), 0.0, 1e9);
    (0..400).map(ray).chain((0..300).map(from_one)).collect()
}

/// All hits of a ray: those of the primitives by brute force, those of the balls one by one; sorted.
fn by_hand(flat: &dyn Accelerator, balls: &[Ball], first: u32, ray: &Ray) -> Vec<(f64, PrimId)> {
    let mut hits = Vec::new();
    flat.all_hits(ray, &mut hits, &mut Traversal::default());
    let mut all: Vec<(f64, PrimId)> = hits.into_iter().map(|hit| (hit.t, hit.prim)).collect();
    for (id, ball) in (first..).zip(balls) {
        let mut least = f64::INFINITY;
        ball.intersect(ray, &mut |t, _| {
            let [min, max] = ball.bounds();
            let t = clamp_to_bounds(min, max, ray, t).unwrap_or(f64::NAN);
            if ray.t_min() < t && t < ray.t_max() {
                least = least.min(t);
            }
        });
        all.extend(least.is_finite().then_some((least, PrimId(id))));
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    all
}

#[test]
fn every_query_of_rays_finds_shapes_in_every_layout_and_tier() {
    let (primitives, balls) = (crowd(), balls());
    let first = primitives.len() as u32;
    for numerics in Numerics::ALL {
        let slots = || (0..).zip(&primitives).map(|(id, &primitive)| Slot { primitive, id: PrimId(id) });
        let exhaustive = build(slots(), Layout::BruteForce, numerics);
        let rays = rays(numerics.ray_precision());
        let expected: Vec<_> =
            rays.rays().iter().map(|ray| by_hand(&*exhaustive, &balls, first, &ray)).collect();
        let of_shapes = expected.iter().flatten().filter(|hit| hit.1.0 >= first).count();
        assert!(of_shapes > 100, "{of_shapes}");
        for layout in Layout::trees().chain([Layout::BruteForce]) {
            let mut bvh = Bvh::over(&primitives, layout, numerics);
            bvh.set_user_geometry(shared(self::balls())).expect("finite");
            let traversal = &mut Traversal::default();
            let batch = bvh.closest_hits(rays.rays(), traversal);
            let occluded = bvh.are_occluded(rays.rays(), traversal);
            let lists = bvh.par_all_hits(rays.rays());
            let mut lists = lists.iter();
            let in_parallel = bvh.par_closest_hits(rays.rays());
            for (index, (ray, expected)) in rays.rays().iter().zip(&expected).enumerate() {
                let of = |hit: &Hit| (hit.t, hit.prim);
                let all: Vec<_> = bvh.all_hits(&ray, traversal).iter().map(of).collect();
                if numerics != Numerics::Fast {
                    assert_eq!(&all, expected, "{layout:?} {numerics:?} {ray:?}");
                }
                let listed: Vec<_> = lists.next().expect("a list").iter().map(of).collect();
                assert_eq!(listed.len(), all.len());
                let closest = bvh.closest_hit(&ray, traversal);
                if numerics == Numerics::Fast {
                    assert_eq!(closest.is_some(), !expected.is_empty());
                } else {
                    assert_eq!(listed, all);
                    assert_eq!(
                        closest.as_ref().map(of),
                        expected.first().copied(),
                        "{layout:?} {numerics:?}"
                    );
                    assert_eq!(batch.get(index), closest);
                    assert_eq!(in_parallel[index], closest);
                }
                assert_eq!(bvh.occluded(&ray, traversal), !expected.is_empty());
                assert_eq!(occluded[index], !expected.is_empty());
                let is_shape = |prim: PrimId| bvh.user_geometry(prim).is_some();
                let any_shape = expected.iter().any(|hit| hit.1.0 >= first);
                assert_eq!(bvh.occluded_by(&ray, is_shape, traversal), any_shape);
                let accepts = |hit: &Hit| hit.prim.0.is_multiple_of(3);
                let of_some = bvh.closest_hit_by(&ray, accepts, traversal).as_ref().map(of);
                let expected_of_some = expected.iter().find(|hit| hit.1.0.is_multiple_of(3)).copied();
                assert!(numerics == Numerics::Fast || of_some == expected_of_some);
                if let Some(hit) = closest.filter(|hit| bvh.user_geometry(hit.prim).is_some()) {
                    let ball = &balls[(hit.prim.0 - first) as usize];
                    let normal = bvh.geometric_normal(&ray, &hit).expect("a normal");
                    assert!((ray.at(hit.t) - ball.centre - normal * ball.radius).length() < 1e-9);
                    let Primitive::Triangle(none) = bvh.accelerator().primitive(hit.slot) else {
                        panic!("a shape")
                    };
                    assert_eq!(none.unit_normal(), None);
                }
            }
        }
    }
}

/// Balls as shapes beside balls as primitives: the same crossings, winding numbers and closest points but for rounding.
#[test]
fn closed_shapes_are_crossed_contain_and_are_near() {
    for numerics in Numerics::STRICT {
        let spheres = balls().into_iter().map(|Ball { centre, radius }| Sphere { centre, radius }.into());
        let reference =
            Bvh::with(crowd().into_iter().chain(spheres), Preset::default(), numerics).expect("finite");
        let mut bvh = Bvh::with(crowd(), Preset::default(), numerics).expect("finite");
        bvh.set_user_geometry(shared(balls())).expect("finite");
        let traversal = &mut Traversal::default();
        assert_eq!(bvh.closedness(), reference.closedness());
        let rays = rays(numerics.ray_precision());
        let lists = bvh.par_crossings(rays.rays());
        for (list, ray) in lists.iter().zip(rays.rays().iter()) {
            let [crossings, expected] =
                [&bvh, &reference].map(|bvh| bvh.crossings(&ray, &mut Traversal::default()));
            assert_eq!(crossings.len(), expected.len(), "{ray:?}");
            assert_eq!(list, crossings);
            for (a, b) in crossings.iter().zip(&expected) {
                assert!(a.prim == b.prim && a.side == b.side && (a.t - b.t).abs() < 1e-12, "{a:?} {b:?}");
            }
        }
        let points: Vec<DVec3> = (0..3000).map(|seed| vector(80_000 + seed)).collect();
        assert_eq!(bvh.par_winding_numbers(&points), reference.par_winding_numbers(&points));
        let closest = bvh.par_closest_points(&points);
        let generalised = bvh.par_generalised_winding_numbers(&points, 2.0);
        let mut inside = 0;
        for (index, &point) in points.iter().enumerate() {
            let number = bvh.winding_number(point, traversal);
            assert_eq!(number, reference.winding_number(point, traversal));
            let [found, expected] = [&bvh, &reference].map(|bvh| bvh.contains(point, traversal));
            assert_eq!((found.is_inside, found.rule), (expected.is_inside, expected.rule));
            inside += usize::from(number != 0);
            let (a, b) =
                (closest[index].expect("one"), reference.closest_point(point, traversal).expect("one"));
            assert!(a.prim == b.prim && a.point.distance(b.point) < 1e-9, "{a:?} {b:?}");
            let [a, b] = [&bvh, &reference].map(|bvh| bvh.nearest(point, 5, 0.4, &mut Traversal::default()));
            assert!(a.iter().map(|a| a.prim).eq(b.iter().map(|b| b.prim)), "{a:?} {b:?}");
            let [a, b] = [&bvh, &reference]
                .map(|bvh| bvh.generalised_winding_number(point, 2.0, &mut Traversal::default()));
            assert!((a.value - b.value).abs() <= a.error + b.error, "{a:?} {b:?}");
            assert_eq!(generalised[index], a);
            let corner = point + 0.125;
            let found = bvh.in_box(point, corner, traversal);
            let is_near = |ball: &Ball| {
                let [min, max] = ball.bounds();
                min.cmple(corner).all() && max.cmpge(point).all()
            };
            let expected = balls().iter().filter(|ball| is_near(ball)).count();
            assert_eq!(found.iter().filter(|prim| bvh.user_geometry(**prim).is_some()).count(), expected);
            assert!(found.is_sorted());
        }
        assert!(inside > 50, "{inside}");
        assert_eq!(bvh.in_box([1.0; 3], [-1.0; 3], traversal), []);
    }
}

#[test]
fn shapes_may_be_crossed_more_than_twice() {
    let mut bvh = Bvh::new([]).expect("nothing");
    bvh.set_user_geometry(shared([Slabs])).expect("finite");
    let traversal = &mut Traversal::default();
    let ray = bvh.ray([-5.0, 0.5, 0.25], [1.0, 0.0, 0.0]).expect("a ray");
    let crossings = bvh.crossings(&ray, traversal);
    let found: Vec<_> = crossings.iter().map(|crossing| (crossing.t, crossing.side)).collect();
    let [into, out] = [Side::Entering, Side::Leaving];
    assert_eq!(found, [(3.0, into), (4.0, out), (6.0, into), (7.0, out)]);
    assert!(bvh.par_crossings(RayBuffer::from_iter([ray]).rays()).iter().eq([crossings]));
    for (x, number) in [(-3.0, 0), (-1.5, 1), (0.0, 0), (1.5, 1), (3.0, 0)] {
        assert_eq!(bvh.winding_number([x, 0.0, 0.0], traversal), number, "{x}");
        assert_eq!(bvh.par_winding_numbers(&[DVec3::X * x]), [number]);
    }
    // The second slab, from between: hits begin at t_min.
    let from_between = ray.between(5.0, f64::INFINITY).expect("ends");
    assert_eq!(bvh.closest_hit(&from_between, traversal).map(|hit| hit.t), Some(6.0));
    assert!(!bvh.occluded(&ray.between(4.0, 6.0).expect("ends"), traversal));
    assert_eq!(bvh.all_hits(&ray, traversal).len(), 1);
}

#[test]
fn open_shapes_without_closest_points_are_left_out_of_queries_of_these() {
    let mut bvh = Bvh::new([Primitive::from(([0.0, 0.0, 9.0], 1.0))]).expect("finite");
    let traversal = &mut Traversal::default();
    assert!(bvh.closedness().is_closed());
    bvh.set_user_geometry(shared([Square])).expect("finite");
    let closedness = bvh.closedness();
    assert_eq!((closedness.boundary_edges, closedness.unbalanced_edges), (1, 1));
    assert!(bvh.contains_if_closed([0.0; 3], traversal).is_err());
    // The ball, at 9 - 1 - 1; the square at 1 has no closest point.
    assert_eq!(
        bvh.closest_point([0.0, 0.0, 1.0], traversal).map(|on| (on.prim, on.distance)),
        Some((PrimId(0), 7.0))
    );
    assert_eq!(bvh.nearest([0.0, 0.0, 1.0], 9, 100.0, traversal).len(), 1);
    assert_eq!(bvh.in_box([-0.1; 3], [0.1; 3], traversal), [PrimId(1)]);
    let number = bvh.generalised_winding_number([0.0, 0.0, 9.0], 2.0, traversal);
    // What an open surface adds may be any number: a sphere with a pinhole adds nearly 1.
    assert_eq!((number.value, number.error), (1.0, f64::INFINITY));
    assert!(number.margin() < 0.0);
    assert_eq!(bvh.par_generalised_winding_numbers(&[DVec3::Z * 9.0], 2.0), [number]);
    let down = bvh.ray([0.5, 0.5, 3.0], [0.0, 0.0, -1.0]).expect("a ray");
    let hit = bvh.closest_hit(&down, traversal).expect("the square");
    assert_eq!((hit.t, bvh.geometric_normal(&down, &hit)), (3.0, None));
    assert_eq!(bvh.crossings(&down, traversal)[0].side, Side::Entering);
}

#[test]
fn equal_distances_are_decided_by_id_and_in_exact_by_exact_distances() {
    // z = 0 by a triangle too: hit by the ray at t = 1/3 exactly or rounded, by both.
    let triangle = Primitive::from([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]);
    for numerics in Numerics::STRICT {
        let mut bvh = Bvh::with([triangle], Preset::default(), numerics).expect("finite");
        bvh.set_user_geometry(shared([Square])).expect("finite");
        // In units of a direction of length 3, t = 1/3 is rounded: up or down from the exact distance of the triangle.
        let ray = Ray::unchecked(DVec3::Z, DVec3::Z * -3.0, 0.0, 1.0);
        let hit = bvh.closest_hit(&ray, &mut Traversal::default()).expect("a hit");
        // 1/3 is 0.0101...; its f64 is below, so in `exact` the square's t comes first.
        let expected = if numerics == Numerics::Exact { 1 } else { 0 };
        assert_eq!((hit.prim, hit.t), (PrimId(expected), 1.0 / 3.0), "{numerics:?}");
        // The same with two instances of the triangle, the other one far below.
        let triangle = Mesh {
            positions: vec![DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, -1.0, 0.0), DVec3::Y],
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        };
        let triangle = Arc::new(triangle);
        let at =
            |z: f64| Placed::new(triangle.clone(), Placement::new(DMat4::from_translation(DVec3::Z * z)));
        let mut bvh = Bvh::from_instances(&[at(0.0), at(-9.0)], Preset::default(), numerics).expect("finite");
        assert_eq!(bvh.accelerator().slots_end(), u32::MAX - 2, "instances");
        bvh.set_user_geometry(shared([Square])).expect("finite");
        let hit = bvh.closest_hit(&ray, &mut Traversal::default()).expect("a hit");
        let expected = if numerics == Numerics::Exact { 2 } else { 0 };
        assert_eq!((hit.prim, hit.t), (PrimId(expected), 1.0 / 3.0), "instances {numerics:?}");
    }
}

/// The box from -1 to 1, or one that ends at 0.1, whose f32 box ends at 0.1 + 1.5e-9.
#[test]
fn points_outside_the_bounds_are_moved_into_them_along_the_ray() {
    let traversal = &mut Traversal::default();
    let mut bvh = Bvh::with([], Preset::default(), Numerics::Double).expect("nothing");
    let with = |bvh: &mut Bvh, bounds: [DVec3; 2], t: f64| {
        bvh.set_user_geometry(shared([AtDistance { bounds, t }])).expect("finite");
    };
    let one = [-DVec3::ONE, DVec3::ONE];
    // Down from z = 5, the ray is in the box where 4 <= t <= 6; in units of a direction of length 1/2, twice that.
    for (t, expected) in [(1.0, 4.0), (4.5, 4.5), (6.0, 6.0), (10.0, 6.0), (f64::INFINITY, 6.0)] {
        with(&mut bvh, one, t);
        for length in [1.0, 0.5] {
            let ray = Ray::unchecked(DVec3::Z * 5.0, DVec3::Z * -length, 0.0, f64::INFINITY);
            let expected = if length == 1.0 { expected } else { (2.0 * t).clamp(8.0, 12.0) };
            with(&mut bvh, one, t / length);
            assert_eq!(bvh.closest_hit(&ray, traversal).map(|hit| hit.t), Some(expected), "{t} {length}");
            assert_eq!(bvh.crossings(&ray, traversal).len(), 1);
            // Whether it is between the ends of the ray is decided after that.
            assert!(bvh.occluded(&ray.between(0.0, expected.next_up()).expect("ends"), traversal));
            assert!(!bvh.occluded(&ray.between(0.0, expected).expect("ends"), traversal));
        }
    }
    // A ray that misses the box: by far, by less than f32 resolves, and by nothing.
    let beside = |x: f64| Ray::unchecked(DVec3::new(x, 0.0, 5.0), -DVec3::Z, 0.0, f64::INFINITY);
    with(&mut bvh, [-DVec3::ONE, DVec3::new(0.1, 1.0, 1.0)], 5.0);
    for (x, expected) in [(3.0, None), (0.1 + 1e-9, None), (0.1, Some(5.0))] {
        let ray = beside(x);
        assert_eq!(bvh.closest_hit(&ray, traversal).map(|hit| hit.t), expected, "{x}");
        assert_eq!(bvh.occluded(&ray, traversal), expected.is_some(), "{x}");
        assert_eq!(bvh.crossings(&ray, traversal).len(), usize::from(expected.is_some()), "{x}");
    }
}

#[test]
fn directions_are_of_any_length_and_t_in_units_of_it() {
    let ball = Arc::new(AnyLength::default());
    for numerics in Numerics::ALL {
        let mut bvh = Bvh::with([], Preset::default(), numerics).expect("nothing");
        bvh.set_user_geometry([ball.clone() as Arc<dyn UserGeometry>]).expect("finite");
        let traversal = &mut Traversal::default();
        let points: Vec<DVec3> = (0..200).map(|seed| vector(seed) * 1.5).collect();
        let expected: Vec<i32> = points.iter().map(|point| i32::from(point.length() < 1.0)).collect();
        assert_eq!(bvh.par_winding_numbers(&points), expected);
        for (&point, &number) in points.iter().zip(&expected) {
            assert_eq!(bvh.contains(point, traversal).is_inside, number == 1, "{point}");
        }
    }
    assert!(ball.0.load(Ordering::Relaxed), "the direction of winding numbers has a length of 1.004");
    let mut bvh = Bvh::with([], Preset::default(), Numerics::Double).expect("nothing");
    bvh.set_user_geometry([ball as Arc<dyn UserGeometry>]).expect("finite");
    // From 3 to 1, in quarters and in fours.
    for (length, expected) in [(0.25, 8.0), (4.0, 0.5)] {
        let ray = Ray::unchecked(DVec3::X * 3.0, DVec3::X * -length, 0.0, f64::INFINITY);
        let t = bvh.closest_hit(&ray, &mut Traversal::default()).map(|hit| hit.t);
        assert_eq!(t, Some(expected));
    }
}

/// A filter is called with the first point between the ends of the ray alone, as of a sphere.
#[test]
fn a_filter_is_called_once_a_shape() {
    let mut bvh = Bvh::new([]).expect("nothing");
    bvh.set_user_geometry(shared([Slabs])).expect("finite");
    let traversal = &mut Traversal::default();
    let ray = bvh.ray([-5.0, 0.5, 0.25], [1.0, 0.0, 0.0]).expect("a ray");
    let mut seen = Vec::new();
    let none = bvh.closest_hit_by(
        &ray,
        |hit| {
            seen.push(hit.t);
            hit.t > 3.5
        },
        traversal,
    );
    assert_eq!((none, &seen[..]), (None, &[3.0][..]));
    // The next one is that of a ray that begins there.
    let further = ray.between(3.0, f64::INFINITY).expect("ends");
    let next = bvh.closest_hit_by(&further, |hit| hit.t > 3.5, traversal);
    assert_eq!(next.map(|hit| hit.t), Some(4.0));
}

#[test]
fn ids_and_slots_that_32_bits_cannot_number_are_an_error() {
    let new = |count: usize, first: u32, slots_end: u32| {
        let all = shared((0..count).map(|_| Square));
        Shapes::new(all, Preset::default(), [first, slots_end]).err()
    };
    // The largest id is that before `NO_PRIMITIVE`, the largest number.
    assert_eq!(new(2, u32::MAX - 2, u32::MAX), None);
    assert_eq!(new(3, u32::MAX - 2, u32::MAX), Some(NotFinite::Id(2)));
    assert_eq!(new(1, u32::MAX, u32::MAX), Some(NotFinite::Id(0)));
    assert_eq!(new(2, 7, 2), None);
    assert_eq!(new(3, 7, 2), Some(NotFinite::Id(2)));
}

#[test]
fn updates_keep_shapes_and_shapes_are_replaced() {
    let traversal = &mut Traversal::default();
    let ball = |x: f64| Ball { centre: DVec3::X * x, radius: 1.0 };
    let floor = Primitive::from([[-90.0, -90.0, -5.0], [90.0, -90.0, -5.0], [0.0, 90.0, -5.0]]);
    let mut bvh = Bvh::new([floor]).expect("finite");
    bvh.set_user_geometry(shared([ball(0.0), ball(5.0)])).expect("finite");
    let down = |x: f64| Precision::Double.ray(DVec3::new(x, 0.0, 9.0), -DVec3::Z, 0.0, f64::INFINITY);
    let hit = |bvh: &Bvh, x: f64, traversal: &mut Traversal| {
        bvh.closest_hit(&down(x), traversal).map(|hit| (hit.prim.0, hit.t))
    };
    assert_eq!(
        [0.0, 5.0, 2.5].map(|x| hit(&bvh, x, traversal)),
        [Some((1, 8.0)), Some((2, 8.0)), Some((0, 14.0))]
    );
    assert!(matches!(bvh.update([floor]), Ok(Update::Refitted(_))));
    assert_eq!(hit(&bvh, 5.0, traversal), Some((2, 8.0)));
    assert_eq!(bvh.update([floor, floor]), Ok(Update::Rebuilt));
    assert_eq!(hit(&bvh, 5.0, traversal), Some((3, 8.0)));
    assert!(bvh.contains([5.0, 0.0, 0.0], traversal).is_inside);
    bvh.set_user_geometry(shared([ball(7.0)])).expect("finite");
    assert_eq!([5.0, 7.0].map(|x| hit(&bvh, x, traversal)), [Some((0, 14.0)), Some((2, 8.0))]);
    let error = bvh.set_user_geometry(shared([ball(0.0), ball(f64::NAN)])).err();
    assert_eq!(error, Some(NotFinite::Bounds(1)));
    let error = bvh.set_user_geometry(shared([Ball { centre: DVec3::ZERO, radius: -1.0 }])).err();
    assert_eq!(error, Some(NotFinite::Bounds(0)));
    assert_eq!(hit(&bvh, 7.0, traversal), Some((2, 8.0)), "nothing changes on an error");
    // A clone that is changed, and instances in place of the primitives.
    let clone = bvh.clone();
    assert_eq!(bvh.update([floor, floor]), Ok(Update::Rebuilt));
    bvh.set_user_geometry(shared([ball(18.0)])).expect("finite");
    assert_eq!(
        [&clone, &bvh].map(|bvh| hit(bvh, 7.0, &mut Traversal::default())),
        [Some((2, 8.0)), Some((0, 14.0))]
    );
    let mesh = Mesh {
        positions: vec![DVec3::X * 17.0, DVec3::X * 19.0, DVec3::new(18.0, 2.0, 0.0)],
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    let mesh = Arc::new(mesh);
    let at =
        |z: f64| Placed::new(mesh.clone(), Placement::new(DMat4::from_translation(DVec3::new(0.0, -0.5, z))));
    for (z, expected) in [(0.0, (2, 8.0)), (2.0, (1, 7.0)), (-2.0, (2, 8.0))] {
        bvh.set_instances(&[at(-9.0), at(z)]).expect("finite");
        assert_eq!(hit(&bvh, 18.0, traversal), Some(expected), "{z}");
        // Normals are those of instances and of shapes: both upwards.
        let closest = bvh.closest_hit(&down(18.0), traversal).expect("a hit");
        assert_eq!(bvh.geometric_normal(&down(18.0), &closest), Some(DVec3::Z), "{z}");
        let is_triangle = closest.prim == PrimId(1);
        let Primitive::Triangle(stored) = bvh.accelerator().primitive(closest.slot) else { panic!("{z}") };
        assert_eq!(stored.unit_normal().is_some(), is_triangle, "{z}");
    }
    bvh.set_user_geometry([]).expect("nothing");
    assert_eq!(hit(&bvh, 18.0, traversal), Some((1, 11.0)));
    bvh.update([floor, floor]).expect("finite");
    assert_eq!((hit(&bvh, 7.0, traversal), bvh.user_geometries().count()), (Some((0, 14.0)), 0));
    // Without user geometry it is again a structure that was never given any: a copy of a shared tree is refitted.
    bvh.set_user_geometry(shared([ball(0.0)])).expect("finite");
    bvh.set_user_geometry([]).expect("nothing");
    assert!(bvh.own_shapes().is_none());
    let clone = bvh.clone();
    assert!(matches!(bvh.update([floor, floor]), Ok(Update::Refitted(_))));
    assert_eq!(hit(&clone, 7.0, traversal), Some((0, 14.0)));
}
