//! The torus of the examples: its exact intersections against closed forms and dense samples, and every query of a
//! structure that contains it.

use std::sync::Arc;

use kiln::bvh::detail::RayBuffer;
use kiln::bvh::{Bvh, Numerics, Preset, PrimId, Primitive, Ray, Side, SignedHit, Traversal, UserGeometry};
use kiln::glam::DVec3;

use crate::common::Numbers;

#[path = "../../crates/bvh/examples/torus/shape.rs"]
mod shape;

use shape::Torus;

/// Radii and centre have few binary digits, so that the points below are exact.
const TORUS: Torus = Torus { centre: DVec3::ZERO, major: 2.0, minor: 0.5 };

fn ray(origin: [f64; 3], direction: [f64; 3]) -> Ray {
    Ray::unchecked(origin.into(), direction.into(), 0.0, f64::INFINITY)
}

/// The distance from the surface, negative inside.
fn signed_distance(torus: &Torus, point: DVec3) -> f64 {
    let [x, y, z] = (point - torus.centre).to_array();
    (x.hypot(y) - torus.major).hypot(z) - torus.minor
}

fn points(torus: &Torus, ray: &Ray) -> Vec<(f64, Side)> {
    let mut found = Vec::new();
    torus.intersect(ray, &mut |t, side| found.push((t, side)));
    found
}

fn with_torus(others: &[Primitive], torus: Torus, numerics: Numerics) -> Bvh {
    let mut bvh = Bvh::with(others.iter().copied(), Preset::default(), numerics).expect("finite");
    bvh.set_user_geometry([Arc::new(torus) as Arc<dyn UserGeometry>]).expect("finite");
    bvh
}

#[test]
fn the_roots_of_rays_on_axes_and_tangents_are_exact() {
    let (into, out) = (Side::Entering, Side::Leaving);
    let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    // Along x through the centre: the tube is from -2.5 to -1.5 and from 1.5 to 2.5.
    let all = points(&TORUS, &ray([-5.0, 0.0, 0.0], x));
    assert_eq!(all, [(2.5, into), (3.5, out), (6.5, into), (7.5, out)]);
    // The same in units of a direction of length 1/4, and from within the tube and the hole.
    let all = points(&TORUS, &ray([-5.0, 0.0, 0.0], [0.25, 0.0, 0.0]));
    assert_eq!(all, [(10.0, into), (14.0, out), (26.0, into), (30.0, out)]);
    assert_eq!(points(&TORUS, &ray([-2.0, 0.0, 0.0], x)), [(0.5, out), (3.5, into), (4.5, out)]);
    assert_eq!(points(&TORUS, &ray([0.0; 3], x)), [(1.5, into), (2.5, out)]);
    // From a point of the surface, which is not at t > 0.
    assert_eq!(points(&TORUS, &ray([1.5, 0.0, 0.0], x)), [(1.0, out)]);
    assert_eq!(points(&TORUS, &ray([2.5, 0.0, 0.0], x)), []);
    // Along the axis, and elsewhere through the hole; and down through the middle of the tube.
    assert_eq!(points(&TORUS, &ray([0.0, 0.0, -5.0], z)), []);
    assert_eq!(points(&TORUS, &ray([1.25, 0.5, -5.0], z)), []);
    assert_eq!(points(&TORUS, &ray([2.0, 0.0, -5.0], z)), [(4.5, into), (5.5, out)]);
    // Touching: the outermost circle; the innermost, from within the tube, where x² + y² = 1.5² + 2² = 2.5² at y = ±2;
    // and the top, twice along x, and along y at a root of multiplicity four, for x² + y² = 4 + y².
    assert_eq!(points(&TORUS, &ray([2.5, -5.0, 0.0], y)), [(5.0, into), (5.0, out)]);
    let within = points(&TORUS, &ray([1.5, -5.0, 0.0], y));
    assert_eq!(within, [(3.0, into), (5.0, out), (5.0, into), (7.0, out)]);
    let top = points(&TORUS, &ray([-5.0, 0.0, 0.5], x));
    assert_eq!(top, [(3.0, into), (3.0, out), (7.0, into), (7.0, out)]);
    assert_eq!(points(&TORUS, &ray([2.0, -5.0, 0.5], y)), [(5.0, into), (5.0, out)]);
    // The least step to either side decides between none and two.
    for (near, count) in [(2.5f64.next_up(), 0), (2.5f64.next_down(), 2)] {
        let all = points(&TORUS, &ray([near, -5.0, 0.0], y));
        assert_eq!((all.len(), all.iter().all(|(t, _)| (t - 5.0).abs() < 1e-7)), (count, true), "{all:?}");
    }
    for (near, count) in [(0.5f64.next_up(), 0), (0.5f64.next_down(), 4)] {
        assert_eq!(points(&TORUS, &ray([-5.0, 0.0, near], x)).len(), count);
    }
    // At 1e6, along x in the plane of the centre: coordinates are exact, and so are the roots.
    let far = Torus { centre: DVec3::new(1e6, -3e6, 0.25), ..TORUS };
    let all: Vec<f64> = points(&far, &ray([0.0, -3e6, 0.25], x)).iter().map(|point| point.0).collect();
    assert_eq!(all, [999_997.5, 999_998.5, 1_000_001.5, 1_000_002.5]);
}

/// Between two of the points that are found, all samples are on the side of the surface that these say.
#[test]
fn dense_samples_of_rays_agree_with_the_roots() {
    let mut numbers = Numbers::new(41);
    let mut counts = [0; 5];
    for k in 0..300 {
        let torus = Torus {
            centre: numbers.vector(),
            major: 1.0 + numbers.unit(),
            minor: if k % 3 == 0 { 0.01 } else { 0.1 + 0.8 * numbers.unit() },
        };
        let across = numbers.vector().with_z(0.0).normalize() * torus.major;
        let near = numbers.vector();
        // Towards the tube; every fifth from within it through the hole, and every fourth along an axis.
        let (origin, target) = match k % 5 {
            0 => (torus.centre - across, torus.centre + near * 0.02),
            _ => (torus.centre + near * 3.0, torus.centre + across + numbers.vector() * 0.2),
        };
        let direction = if k % 4 == 0 { DVec3::AXES[k % 3] } else { (target - origin).normalize() };
        let ray = Ray::unchecked(origin, direction, 0.0, f64::INFINITY);
        let mut found = points(&torus, &ray);
        assert!(found.is_sorted_by(|a, b| a.0 <= b.0));
        counts[found.len()] += 1;
        for &(t, _) in &found {
            // Rounding of the point and of the distance, in coordinates below 16.
            assert!(signed_distance(&torus, ray.at(t)).abs() < 1e-14 * 16.0, "{torus:?} {ray:?} {t}");
        }
        found.push((f64::INFINITY, Side::Leaving));
        let (mut next, mut inside) = (0, signed_distance(&torus, origin) < 0.0);
        for sample in 0..8000 {
            let t = f64::from(sample) / 1000.0;
            while found[next].0 < t {
                inside = found[next].1 == Side::Entering;
                next += 1;
            }
            let distance = signed_distance(&torus, ray.at(t));
            assert!(distance.abs() < 1e-12 || (distance < 0.0) == inside, "{torus:?} {ray:?} {t}");
        }
    }
    // From outside 0, 2 and 4; from inside 1 and 3.
    assert!(counts.iter().all(|&count| count > 0), "{counts:?}");
}

#[test]
fn every_query_of_a_structure_finds_a_torus() {
    let mut numbers = Numbers::new(42);
    let ball = Primitive::from(([0.0; 3], 1.0));
    let floor = Primitive::from([[-4.0, -4.0, -1.0], [4.0, -4.0, -1.0], [0.0, 4.0, -1.0]]);
    let id = PrimId(2);
    for numerics in Numerics::ALL {
        let bvh = with_torus(&[ball, floor], TORUS, numerics);
        let traversal = &mut Traversal::default();
        // Along x: torus, ball, torus.
        let along = bvh.ray([-5.0, 0.0, 0.0], [1.0, 0.0, 0.0]).expect("a ray");
        let crossings = bvh.crossings(&along, traversal);
        let of = |SignedHit { t, prim, .. }: &SignedHit| (*t, prim.0);
        let found: Vec<_> = crossings.iter().map(of).collect();
        assert_eq!(found, [(2.5, 2), (3.5, 2), (4.0, 0), (6.0, 0), (6.5, 2), (7.5, 2)]);
        assert_eq!(bvh.closest_hit(&along, traversal).map(|hit| (hit.t, hit.prim)), Some((2.5, id)));
        let hits: Vec<_> = bvh.all_hits(&along, traversal).iter().map(|hit| (hit.t, hit.prim.0)).collect();
        assert_eq!(hits, [(2.5, 2), (4.0, 0)]);
        // Through the hole beside the ball, down to the floor.
        let down = bvh.ray([1.25, 0.0, 5.0], [0.0, 0.0, -1.0]).expect("a ray");
        assert_eq!(bvh.closest_hit(&down, traversal).map(|hit| (hit.t, hit.prim.0)), Some((6.0, 1)));
        assert!(!bvh.occluded_by(&down, |prim| prim == id, traversal));

        let mut rays = Vec::new();
        for _ in 0..200 {
            let origin = numbers.vector() * 4.0;
            rays.push(bvh.ray(origin, numbers.vector() * 1.5 - origin).expect("a ray"));
        }
        let batch = RayBuffer::from_iter(rays.iter().copied());
        let hits = bvh.closest_hits(batch.rays(), traversal);
        let alone = with_torus(&[], TORUS, numerics);
        for (index, ray) in rays.iter().enumerate() {
            let hit = bvh.closest_hit(ray, traversal);
            let of_torus = points(&TORUS, ray).first().map(|point| point.0);
            assert_eq!(alone.closest_hit(ray, traversal).map(|hit| hit.t), of_torus);
            match hit {
                Some(hit) if hit.prim == id => {
                    assert_eq!(Some(hit.t), of_torus);
                    let normal = bvh.geometric_normal(ray, &hit).expect("a normal");
                    let outwards = signed_distance(&TORUS, ray.at(hit.t) + normal * 0.01);
                    assert!((outwards - 0.01).abs() < 1e-12);
                }
                other => assert!(of_torus.is_none_or(|t| other.is_some_and(|hit| hit.t <= t))),
            }
            assert_eq!(bvh.occluded(ray, traversal), hit.is_some());
            if numerics != Numerics::Fast {
                assert_eq!(hits.get(index), hit);
            }
        }
        let points: Vec<DVec3> = (0..300).map(|_| numbers.vector() * DVec3::new(3.0, 3.0, 0.6)).collect();
        let alone_distances = alone.par_signed_distances(&points);
        let numbers_of_points = alone.par_winding_numbers(&points);
        for ((&point, distance), number) in points.iter().zip(alone_distances).zip(numbers_of_points) {
            let expected = signed_distance(&TORUS, point);
            assert!(distance.is_some_and(|distance| (distance - expected).abs() < 1e-12), "{point}");
            assert_eq!(number, i32::from(expected < 0.0), "{point}");
        }
    }
}
