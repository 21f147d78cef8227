//! A refitted structure returns the same hits as a newly built one, bit for bit.

use crate::common::Numbers;
use glam::DVec3;
use kiln::bvh::detail::{HitBuffer, Layout, RayBuffer, Slot, build};
use kiln::bvh::{
    Bvh, Disk, Hit, NotFinite, Numerics, Preset, PrimId, Primitive, Ray, Sphere, Traversal, Triangle, Update,
};

/// Triangles with corners within 0.1 of a point of the cube, and a ball or a disk for every tenth.
fn crowd(count: usize, numbers: &mut Numbers) -> Vec<Primitive> {
    let mut primitive = |index: usize| {
        let middle = numbers.vector();
        if index % 10 == 9 {
            return match index % 30 {
                29 => Primitive::from(Disk {
                    centre: middle,
                    normal: numbers.vector().normalize(),
                    radius: 0.1,
                }),
                _ => Primitive::from(Sphere { centre: middle, radius: 0.05 }),
            };
        }
        Primitive::Triangle(Triangle([0; 3].map(|_| middle + numbers.vector() * 0.1)))
    };
    (0..count).map(&mut primitive).collect()
}

/// Every primitive moved a little, some far; some triangles end up on a line or in a point, some balls and disks
/// without size.
fn moved(primitives: &[Primitive], numbers: &mut Numbers) -> Vec<Primitive> {
    let mut one = |(index, primitive): (usize, &Primitive)| {
        let step = numbers.vector() * if index % 7 == 0 { 3.0 } else { 0.1 };
        match *primitive {
            Primitive::Triangle(Triangle([a, b, c])) => Primitive::Triangle(Triangle(match index % 11 {
                3 => [a, a, a],
                5 => [a, b, a],
                _ => [a + step, b + step, c + step * 1.5],
            })),
            Primitive::Analytic(mut shape) => {
                *shape.centre_mut() += step;
                *shape.radius_mut() *= if index % 20 == 9 { 0.0 } else { 2.0 };
                Primitive::Analytic(shape)
            }
        }
    };
    primitives.iter().enumerate().map(&mut one).collect()
}

/// What a fresh structure is built from: shapes of no radius have no slot.
fn slots(primitives: &[Primitive], numerics: Numerics) -> Vec<Slot> {
    let rounded = primitives.iter().map(|p| p.rounded(numerics.precision()));
    (0..).zip(rounded).filter_map(|(id, p)| Some(Slot { primitive: p?, id: PrimId(id) })).collect()
}

/// A pencil of rays, which are taken together, and rays from around, half of them aimed at corners and centres, hit or
/// not.
fn rays(primitives: &[Primitive], numerics: Numerics, numbers: &mut Numbers) -> Vec<Ray> {
    let mut one = |index: usize| {
        let origin = numbers.vector() * 4.0;
        let target = match primitives[index % primitives.len()] {
            Primitive::Triangle(Triangle(corners)) if index.is_multiple_of(2) => corners[index % 3],
            Primitive::Analytic(shape) => shape.bounding_sphere().0,
            Primitive::Triangle(_) => numbers.vector(),
        };
        let direction = (target - origin).try_normalize().unwrap_or(DVec3::Z);
        numerics.ray_precision().ray(origin, direction, 0.0, f64::INFINITY)
    };
    let around: Vec<Ray> = (0..if primitives.is_empty() { 0 } else { 600 }).map(&mut one).collect();
    let direction = |i: i32| DVec3::new(f64::from(i % 16 - 8) / 20.0, f64::from(i / 16 - 8) / 20.0, -1.0);
    let precision = numerics.ray_precision();
    let pencil =
        (0..256).map(|i| precision.ray(DVec3::Z * 4.0, direction(i).normalize(), 0.0, f64::INFINITY));
    pencil.chain(around).collect()
}

/// A hit without its place, which differs from one structure to another.
fn bits(hit: Option<Hit>) -> Option<(PrimId, u64, [u64; 2])> {
    hit.map(|hit| (hit.prim, hit.t.to_bits(), hit.barycentrics.map(f64::to_bits)))
}

#[test]
fn a_refitted_structure_answers_as_brute_force_does() {
    let mut numbers = Numbers::new(71);
    for (numerics, preset) in Numerics::STRICT.into_iter().flat_map(|n| Preset::ALL.map(|preset| (n, preset)))
    {
        for structure in [Layout::Wide(preset), Layout::Avx2(preset), Layout::Portable(preset)] {
            let first = crowd(500, &mut numbers);
            let mut refitted = build(slots(&first, numerics), structure, numerics);
            // There and on, and back to where it came from: what has shrunk to nothing is there again.
            let then = moved(&first, &mut numbers);
            let last = moved(&then, &mut numbers);
            for now in [&then, &last, &first] {
                let times_worse = refitted.refit(&|id| now[id.0 as usize]).expect("a structure that can");
                assert!(times_worse.is_finite() && times_worse > 0.0, "{times_worse}");
                let oracle = build(slots(now, numerics), Layout::BruteForce, numerics);
                let (mut traversal, mut hits, mut expected) =
                    (Traversal::default(), HitBuffer::default(), HitBuffer::default());
                let rays = rays(now, numerics, &mut numbers);
                let batch = RayBuffer::from(&rays);
                refitted.closest_hits(batch.rays(), &mut hits, &mut traversal);
                oracle.closest_hits(batch.rays(), &mut expected, &mut traversal);
                for (ray, (hit, expected)) in rays.iter().zip(hits.iter().zip(expected.iter())) {
                    let what = format!("{structure:?}, {}, {ray:?}", numerics.name());
                    assert_eq!(bits(hit), bits(expected), "{what}");
                    assert_eq!(bits(refitted.closest_hit(ray, &mut traversal)), bits(expected), "{what}");
                    assert_eq!(refitted.is_occluded(ray, &mut traversal), expected.is_some(), "{what}");
                    let all = |accelerator: &dyn kiln::bvh::detail::Accelerator| {
                        let mut hits = Vec::new();
                        accelerator.all_hits(ray, &mut hits, &mut Traversal::default());
                        hits.sort_unstable_by_key(|hit| hit.prim);
                        hits.into_iter().map(|hit| bits(Some(hit))).collect::<Vec<_>>()
                    };
                    assert_eq!(all(&*refitted), all(&*oracle), "{what}");
                }
            }
            let again = refitted.refit(&|id| first[id.0 as usize]).expect("a structure that can");
            assert!((again - 1.0).abs() < 1e-6 || preset == Preset::BestTrace, "as it was built: {again}");
        }
    }
}

#[test]
fn all_degenerate_at_once_is_nothing_to_hit() {
    let mut numbers = Numbers::new(72);
    let first = crowd(100, &mut numbers);
    let mut structure = build(slots(&first, Numerics::Exact), Layout::default(), Numerics::Exact);
    let nothing = |id: PrimId| match first[id.0 as usize] {
        Primitive::Triangle(_) => Primitive::Triangle(Triangle([DVec3::ZERO; 3])),
        Primitive::Analytic(_) => Primitive::from(([0.0; 3], 0.0)),
    };
    structure.refit(&nothing).expect("a structure that can");
    for ray in rays(&first, Numerics::Exact, &mut numbers) {
        assert_eq!(structure.closest_hit(&ray, &mut Traversal::default()), None);
    }
}

/// The cost is 1 and the area of every node's children, in areas of the whole. Triangles that all fill one box,
/// whichever corner of it they have beside a diagonal, make children that are each the whole, before and after.
#[test]
fn boxes_that_all_shrink_alike_cost_as_much_as_before() {
    let mut numbers = Numbers::new(72);
    let first: Vec<Primitive> = (0..100)
        .map(|_| {
            let inside = (numbers.vector() + DVec3::ONE) / 2.0;
            Primitive::Triangle(Triangle([DVec3::ZERO, DVec3::ONE, inside.clamp(DVec3::ZERO, DVec3::ONE)]))
        })
        .collect();
    for numerics in Numerics::STRICT {
        let mut structure = build(slots(&first, numerics), Layout::default(), numerics);
        let point = Primitive::Triangle(Triangle([DVec3::ZERO; 3]));
        assert_eq!(structure.refit(&|_| point), Some(1.0), "{}", numerics.name());
    }
}

#[test]
fn a_triangle_that_becomes_a_sphere_asks_for_a_new_structure() {
    let slot = |primitive| Slot { primitive, id: PrimId(0) };
    let triangle = Primitive::from([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let ball = Primitive::from(([0.0; 3], 1.0));
    for (from, to) in [(triangle, ball), (ball, triangle)] {
        let mut structure = build([slot(from)], Layout::default(), Numerics::default());
        assert_eq!(structure.refit(&|_| to), None);
        assert_eq!(build([slot(from)], Layout::BruteForce, Numerics::default()).refit(&|_| from), None);
    }
}

#[test]
fn an_update_refits_what_it_can_and_builds_what_it_must() {
    fn is_shared<T: Send + Sync>(_: &T) {}
    let mut numbers = Numbers::new(73);
    let first = crowd(2000, &mut numbers);
    let mut bvh = Bvh::new(first.iter().copied()).expect("finite");
    is_shared(&bvh);
    let hits = |bvh: &Bvh, rays: &[Ray]| {
        let hits = bvh.closest_hits(RayBuffer::from(rays).rays(), &mut Traversal::default());
        hits.iter().map(bits).collect::<Vec<_>>()
    };
    let rays_of_first = rays(&first, Numerics::default(), &mut numbers);
    let mut held_to_fresh = |bvh: &mut Bvh, now: &[Primitive], refits: bool| {
        let update = bvh.update(now.iter().copied()).expect("finite");
        assert_eq!(matches!(update, Update::Refitted(_)), refits, "{update:?}");
        let fresh = Bvh::new(now.iter().copied()).expect("finite");
        let rays = rays(now, Numerics::default(), &mut numbers);
        assert_eq!(hits(bvh, &rays), hits(&fresh, &rays));
        let expected: Vec<bool> = hits(&fresh, &rays).iter().map(Option::is_some).collect();
        assert_eq!(bvh.are_occluded(RayBuffer::from(&rays).rays(), &mut Traversal::default()), expected);
    };
    // A step aside changes nothing but the numbers.
    let step = |p: &Primitive| match *p {
        Primitive::Triangle(Triangle(corners)) => {
            Primitive::Triangle(Triangle(corners.map(|c| c + DVec3::X)))
        }
        Primitive::Analytic(shape) => Primitive::Analytic(shape.recentred(-DVec3::X, 1.0)),
    };
    let aside: Vec<Primitive> = first.iter().map(step).collect();
    held_to_fresh(&mut bvh, &aside, true);
    // A clone refits a copy of the tree, and leaves the other its hits.
    let (mut clone, before) = (bvh.clone(), hits(&bvh, &rays_of_first));
    held_to_fresh(&mut clone, &first, true);
    assert_eq!(hits(&bvh, &rays_of_first), before);
    assert_ne!(hits(&clone, &rays_of_first), before);
    // Everyone somewhere else: no tree stands that.
    let elsewhere: Vec<Primitive> = first.iter().rev().copied().collect();
    held_to_fresh(&mut bvh, &elsewhere, false);
    // More of them, then fewer.
    let more: Vec<Primitive> = first.iter().chain(&aside).copied().collect();
    held_to_fresh(&mut bvh, &more, false);
    held_to_fresh(&mut bvh, &first, false);
    // A triangle may lose its area and get it back, a sphere its radius; one that had none when the tree was built has
    // no place there.
    let mut flat = first.clone();
    flat[0] = Primitive::from([[0.0; 3]; 3]);
    held_to_fresh(&mut bvh, &flat, true);
    held_to_fresh(&mut bvh, &first, true);
    let ball = first.iter().position(|p| matches!(p, Primitive::Analytic(_))).expect("a sphere");
    flat[ball] = Primitive::from(([0.0; 3], 0.0));
    held_to_fresh(&mut bvh, &flat, true);
    held_to_fresh(&mut bvh, &first, true);
    let mut bvh = Bvh::new(flat.iter().copied()).expect("finite");
    assert_eq!(bvh.left_out(), 1);
    held_to_fresh(&mut bvh, &first, false);
    assert_eq!(bvh.left_out(), 0);
    held_to_fresh(&mut bvh, &[], false);
}

#[test]
fn what_is_not_finite_is_an_error_and_changes_nothing() {
    let floor = Primitive::from([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
    let bad = [
        Primitive::from([[0.0, f64::NAN, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
        Primitive::from([[0.0, 1e39, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
        Primitive::from(([0.0, f64::INFINITY, 0.0], 1.0)),
        Primitive::from(([0.0; 3], f64::NAN)),
        Primitive::from(([0.0; 3], 1e39)),
    ];
    let mut bvh = Bvh::new([floor]).expect("finite");
    for primitive in bad {
        assert_eq!(Bvh::new([floor, primitive]).err(), Some(NotFinite::Primitive(1)));
        assert_eq!(bvh.update([primitive]), Err(NotFinite::Primitive(0)));
    }
    let down = bvh.ray([0.0, 1.0, 0.25], [0.0, -1.0, 0.0]).expect("finite");
    assert!(bvh.occluded(&down, &mut Traversal::default()));
    for (origin, direction, why) in [
        ([f64::NAN; 3], [1.0; 3], NotFinite::Origin),
        ([0.0; 3], [0.0; 3], NotFinite::Direction),
        ([0.0; 3], [f64::INFINITY; 3], NotFinite::Direction),
        ([1e39; 3], [1.0; 3], NotFinite::Origin),
    ] {
        assert_eq!(bvh.ray(origin, direction), Err(why));
    }
}

/// Coordinates up to the largest that f32 holds are taken or refused, in every tier; none is a panic.
#[test]
fn coordinates_that_boxes_cannot_hold_are_an_error_in_every_tier() {
    for numerics in Numerics::ALL {
        for (size, is_held) in [(1e18, true), (1e30, true), (3e38, true), (1e39, false), (1e300, false)] {
            let corner = |x: f64, y: f64| [x * size, y * size, size];
            let floor = Primitive::from([corner(-1.0, -1.0), corner(1.0, -1.0), corner(0.0, 1.0)]);
            let above = Primitive::from([corner(-1.0, -1.0), corner(1.0, -1.0), corner(0.5, 1.0)]);
            let built = Bvh::with([floor, above], Preset::default(), numerics);
            assert_eq!(built.is_ok(), is_held, "{size}, {}", numerics.name());
        }
    }
}

/// Batches of rays from the ends of f32, where distances to boxes are infinite, have the hits of single rays.
#[test]
fn batches_from_the_ends_of_f32_are_those_of_single_rays() {
    let triangles = (0..200u32).map(|i| {
        let (x, y) = (f64::from(i % 20), f64::from(i / 20));
        Primitive::from([[x, y, 0.0], [x + 1.0, y, 0.0], [x, y + 1.0, 1.0]])
    });
    for numerics in Numerics::STRICT {
        let bvh = Bvh::with(triangles.clone(), Preset::default(), numerics).expect("finite");
        for size in [1.0, 1e30, 3.4e38] {
            let corners = (0..300).map(|i| [-1.0, 1.0, 0.5].map(|x| x * size * f64::from(1 - 2 * (i % 2))));
            let origins: Vec<[f64; 3]> = corners.collect();
            let towards = |(i, origin): (usize, &[f64; 3])| {
                [0, 1, 2].map(|k| -origin[k] / size + ((3 * i + k) % 7) as f64 * 0.01)
            };
            let directions: Vec<[f64; 3]> = origins.iter().enumerate().map(towards).collect();
            let rays = bvh.rays(&origins, &directions, None).expect("finite");
            let (hits, traversal) = (bvh.par_closest_hits(rays), &mut Traversal::default());
            for (i, hit) in hits.into_iter().enumerate() {
                let ray = bvh.ray(origins[i], directions[i]).expect("finite");
                assert_eq!(hit, bvh.closest_hit(&ray, traversal), "{size:e}, {}", numerics.name());
            }
        }
    }
}

/// A direction of any length is normalised: the same hits, at the same distances, from 1e-300 to 1e300.
#[test]
fn directions_of_any_length_give_the_same_distance() {
    let floor = Primitive::from([[-9.0, -9.0, 0.0], [9.0, -9.0, 0.0], [0.0, 9.0, 0.0]]);
    for numerics in Numerics::ALL {
        let bvh = Bvh::with([floor], Preset::default(), numerics).expect("finite");
        for length in [1e-300, 1e-34, 1e-25, 1.0, 2f64.powi(301), 1e300] {
            // 3-4-5: the floor is 4 below, so the ray meets it at 5.
            let ray = bvh.ray([0.0, 0.0, 4.0], [0.0, 0.6 * length, -0.8 * length]).expect("finite");
            let hit = bvh.closest_hit(&ray, &mut Traversal::default()).expect("the floor");
            let off = 8.0 * numerics.ray_precision().epsilon();
            assert!((hit.t - 5.0).abs() <= off, "{length:e}, {}: {}", numerics.name(), hit.t);
        }
    }
}
