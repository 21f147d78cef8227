//! Packets of rays with a common origin, end or direction return the same hits as single rays, bit for bit.

use crate::common::Numbers;
use glam::DVec3;
use kiln::bvh::detail::{HitBuffer, Layout, Precision, RayBuffer, Slot, build};
use kiln::bvh::{AnalyticShape, Disk, Hit, Numerics, PrimId, Primitive, Ray, Sphere, Traversal, Triangle};

/// As many rays as a tile has.
const TILE: usize = 256;

/// A terrain of whole numbers, a soup, copies, copies right beside what they are of, slivers, a giant triangle and
/// spheres and disks; `scale` and `offset` move all of it.
fn slots(scale: f64, offset: DVec3) -> Vec<Slot> {
    let mut numbers = Numbers::new(21);
    let mut triangles = Vec::new();
    let heights: Vec<f64> = (0..81).map(|_| numbers.below(3) as f64).collect();
    let point = |x: usize, y: usize| DVec3::new(x as f64, heights[9 * y + x], y as f64);
    for (x, y) in (0..64).map(|i| (i % 8, i / 8)) {
        triangles.push([point(x, y), point(x + 1, y), point(x + 1, y + 1)]);
        triangles.push([point(x, y), point(x + 1, y + 1), point(x, y + 1)]);
    }
    for _ in 0..100 {
        let at = numbers.vector() * 4.0 + 4.0;
        triangles.push([0; 3].map(|_| at + numbers.vector()));
        triangles.push([at, at + numbers.vector() * 3.0, at + numbers.vector() * 1e-4]);
    }
    triangles.extend_from_within(..40);
    for index in 40..100 {
        // By some units in the last place of an f32 number of that size: which is nearer only f64 can tell.
        let aside = numbers.vector() * 1e-6;
        let moved = triangles[index].map(|corner: DVec3| corner + aside);
        triangles.push(moved);
    }
    triangles.push([DVec3::new(-1e4, -1.0, -1e4), DVec3::new(1e4, -1.0, -1e4), DVec3::new(0.0, -1.0, 1e5)]);
    let single = |p: DVec3| (offset + p * scale).as_vec3().as_dvec3();
    let mut primitives: Vec<Primitive> =
        triangles.into_iter().map(|t| Primitive::Triangle(Triangle(t.map(single)))).collect();
    for i in 0..6 {
        let centre = single(numbers.vector() * 4.0 + 4.0);
        primitives.push(Primitive::from(Sphere {
            centre,
            radius: f64::from((0.2 * scale * f64::from(i + 1)) as f32),
        }));
    }
    for i in 0..6 {
        let normal = if i % 2 == 0 { DVec3::AXES[i / 2] } else { numbers.vector().normalize() };
        let centre = single(numbers.vector() * 4.0 + 4.0);
        primitives.push(Primitive::from(Disk { centre, normal, radius: 0.3 * scale * (i + 1) as f64 }));
    }
    let degenerate = |p: &Primitive| matches!(p, Primitive::Triangle(t) if t.is_degenerate());
    primitives.retain(|p| !degenerate(p));
    (0..).zip(primitives).map(|(id, primitive)| Slot { primitive, id: PrimId(id) }).collect()
}

/// Where tiles are aimed: corners, points of edges and of faces, so that rays graze, tie and cancel.
fn target(slots: &[Slot], numbers: &mut Numbers) -> DVec3 {
    match &slots[numbers.below(slots.len())].primitive {
        Primitive::Triangle(Triangle([a, b, c])) => match numbers.below(3) {
            0 => *a,
            1 => a.lerp(*b, numbers.unit()),
            _ => a.lerp(*b, numbers.unit()).lerp(*c, numbers.unit()),
        },
        Primitive::Analytic(AnalyticShape::Sphere(sphere)) => {
            sphere.centre + sphere.radius * numbers.vector().normalize()
        }
        // Outside of the rim, on it and within.
        Primitive::Analytic(AnalyticShape::Disk(disk)) => {
            let aside = disk.normal.cross(numbers.vector()).normalize_or(disk.normal);
            disk.centre + aside * (disk.radius * [1.0, 1.0 + 1e-9, numbers.unit()][numbers.below(3)])
        }
        Primitive::Analytic(shape) => panic!("another shape: {shape:?}"),
    }
}

/// Tiles of rays from an eye: narrow ones, wide ones, and ones of which every ray is aimed at something of its own.
fn tiles(slots: &[Slot], scale: f64, offset: DVec3, precision: Precision) -> Vec<Vec<Ray>> {
    let mut numbers = Numbers::new(5);
    let mut tiles = Vec::new();
    for index in 0..48 {
        let target_at = target(slots, &mut numbers);
        let eye = match index % 4 {
            // In the middle of things, far away, right before something, and level with a corner of the grid.
            0 => offset + (numbers.vector() * 3.0 + 4.0) * scale,
            1 => offset + numbers.vector() * (300.0 * scale),
            2 => target_at + numbers.vector() * (1e-3 * scale),
            _ => offset + DVec3::new(4.0, 4.0, -7.0) * scale,
        };
        let eye = eye.as_vec3().as_dvec3();
        let width = [1e-3, 0.05, 0.6][index % 3];
        let middle = (target_at - eye).normalize_or(DVec3::X);
        let (side, up) = middle.any_orthonormal_pair();
        let aimed = index % 5 == 0;
        let rays = (0..TILE).map(|i| {
            let (x, y) = ((i % 16) as f64 / 16.0 - 0.5, (i / 16) as f64 / 16.0 - 0.5);
            let towards = if aimed || i == 0 {
                let mut towards = target(slots, &mut numbers) - eye;
                for _ in 0..20 {
                    if towards.normalize_or(-middle).dot(middle) > 0.3 {
                        break;
                    }
                    towards = target(slots, &mut numbers) - eye;
                }
                towards
            } else {
                middle + width * (x * side + y * up)
            };
            precision.ray(eye, towards.normalize_or(middle), 0.0, f64::INFINITY)
        });
        // Not only whole tiles.
        tiles.push(rays.take(if index % 7 == 6 { 37 } else { TILE }).collect());
    }
    tiles
}

/// Rays from points on what is around to a lamp, as shadows cast them: open at both ends, exact at neither.
fn to_lamp(hits: &[(Ray, Hit)], lamp: DVec3, precision: Precision) -> Vec<Ray> {
    let to_lamp = |(ray, hit): &(Ray, Hit)| {
        let origin = precision.ray(ray.at(hit.t * (1.0 - 1e-6)), DVec3::X, 0.0, 1.0).origin();
        let way = lamp - origin;
        precision.ray(
            origin,
            way.normalize_or(DVec3::Y),
            0.0,
            way.length() * (1.0 - 4.0 * precision.epsilon()),
        )
    };
    hits.iter().map(to_lamp).collect()
}

/// Rays from right on what is around, on either side of it, to a lamp: whether that is in the way only f64 can tell.
fn from_surfaces(hits: &[(Ray, Hit)], lamp: DVec3, precision: Precision) -> Vec<Ray> {
    let ray = |(index, (ray, hit)): (usize, &(Ray, Hit))| {
        let beside = [0.0, 1e-7, -1e-7, 3e-7, -3e-7, 1e-12, -1e-12][index % 7];
        let origin = precision.ray(ray.at(hit.t * (1.0 + beside)), DVec3::X, 0.0, 1.0).origin();
        let way = lamp - origin;
        let t_min = if index % 11 == 0 { way.length() * 1e-6 } else { 0.0 };
        precision.ray(
            origin,
            way.normalize_or(DVec3::Y),
            t_min,
            way.length() * (1.0 - 4.0 * precision.epsilon()),
        )
    };
    hits.iter().enumerate().map(ray).collect()
}

/// Rays that end, or count from, right beside what they hit; in every third tile all count from 0.
fn cut_short(rays: &[Ray], hits: &[Option<Hit>], tile: usize) -> Vec<Ray> {
    let cut = |(index, (ray, hit)): (usize, (&Ray, &Option<Hit>))| {
        let Some(hit) = hit else { return *ray };
        let t = hit.t * (1.0 + [0.0, 1e-7, -1e-7, 1e-12, -1e-12, 1e-3][index % 6]);
        match (index + tile) % 4 {
            0 => Ray::unchecked(ray.origin(), ray.direction(), ray.t_min(), t),
            1 if !tile.is_multiple_of(3) => Ray::unchecked(ray.origin(), ray.direction(), t, ray.t_max()),
            2 if !tile.is_multiple_of(3) => {
                Ray::unchecked(ray.origin(), ray.direction(), t / 2.0, ray.t_max())
            }
            _ => *ray,
        }
    };
    rays.iter().zip(hits).enumerate().map(cut).collect()
}

/// The same towards a lamp that is infinitely far away.
fn towards(hits: &[(Ray, Hit)], direction: DVec3, precision: Precision) -> Vec<Ray> {
    let towards = |(ray, hit): &(Ray, Hit)| {
        let origin = precision.ray(ray.at(hit.t * (1.0 - 1e-6)), DVec3::X, 0.0, 1.0).origin();
        precision.ray(origin, direction, 0.0, f64::INFINITY)
    };
    hits.iter().map(towards).collect()
}

/// Tiles of rays that run the same way, from a plane before or within everything, some of them along an axis, and some
/// aimed.
fn parallel_tiles(slots: &[Slot], scale: f64, precision: Precision) -> Vec<Vec<Ray>> {
    let mut numbers = Numbers::new(6);
    (0..24)
        .map(|index| {
            let axes = [DVec3::X, DVec3::NEG_Y, DVec3::Z];
            let direction = if index % 4 == 0 { axes[index / 4 % 3] } else { numbers.vector().normalize() };
            let (side, up) = direction.any_orthonormal_pair();
            let back = [40.0, 400.0, 0.5][index % 3] * scale;
            let width = [0.05, 1.0, 10.0][index / 3 % 3] * scale;
            let middle = target(slots, &mut numbers);
            let ray = |i: usize, numbers: &mut Numbers| {
                let (x, y) = ((i % 16) as f64 / 16.0 - 0.5, (i / 16) as f64 / 16.0 - 0.5);
                let at = if index % 5 == 0 {
                    target(slots, numbers)
                } else {
                    middle + width * (x * side + y * up)
                };
                // Not all from one plane.
                let back = back * if index % 7 == 0 { 1.0 + numbers.unit() } else { 1.0 };
                precision.ray(at - direction * back, direction, 0.0, f64::INFINITY)
            };
            (0..TILE).map(|i| ray(i, &mut numbers)).collect()
        })
        .collect()
}

fn bits(hit: &Option<Hit>) -> Option<(u64, PrimId, [u64; 2])> {
    hit.map(|hit| (hit.t.to_bits(), hit.prim, hit.barycentrics.map(f64::to_bits)))
}

fn packets_answer_as_single_rays(scale: f64, offset: DVec3) {
    let slots = slots(scale, offset);
    for numerics in Numerics::STRICT {
        let precision = numerics.ray_precision();
        let oracle = build(slots.iter().copied(), Layout::BruteForce, numerics);
        let mut traversal = Traversal::default();
        let (mut all, mut hit, mut lit, mut dark) = (0, 0, 0, 0);
        let mut tiles = tiles(&slots, scale, offset, precision);
        tiles.extend(parallel_tiles(&slots, scale, precision));
        let trees: Vec<_> =
            [Layout::default(), Layout::Avx2(Default::default()), Layout::Portable(Default::default())]
                .map(|structure| (structure, build(slots.iter().copied(), structure, numerics)))
                .into();
        for (index, rays) in tiles.iter().enumerate() {
            let expected: Vec<_> = rays.iter().map(|ray| oracle.closest_hit(ray, &mut traversal)).collect();
            let seen: Vec<_> =
                rays.iter().zip(&expected).filter_map(|(ray, hit)| Some((*ray, (*hit)?))).collect();
            let lamp = if index % 2 == 0 {
                offset + DVec3::new(4.0, 9.0, 3.0) * scale
            } else {
                // On a surface: every ray ends at it.
                target(&slots, &mut Numbers::new(index as u64))
            };
            let shadows = if index % 3 == 0 {
                towards(&seen, (lamp - offset).normalize_or(DVec3::Y), precision)
            } else {
                to_lamp(&seen, lamp, precision)
            };
            let short = cut_short(rays, &expected, index);
            let expected_short: Vec<_> =
                short.iter().map(|ray| oracle.closest_hit(ray, &mut traversal)).collect();
            let on = from_surfaces(&seen, lamp, precision);
            let expected_on: Vec<_> = on.iter().map(|ray| oracle.is_occluded(ray, &mut traversal)).collect();
            let blocked: Vec<_> = shadows.iter().map(|ray| oracle.is_occluded(ray, &mut traversal)).collect();
            (all, hit) = (all + rays.len(), hit + seen.len());
            dark += blocked.iter().filter(|&&b| b).count();
            lit += blocked.iter().filter(|&&b| !b).count();
            for (structure, tree) in &trees {
                let (mut hits, mut occluded) = (HitBuffer::default(), Vec::new());
                // Rays without an end have none in common.
                tree.are_occluded(RayBuffer::from(rays).rays(), &mut occluded, &mut traversal);
                let expected_occluded: Vec<bool> = expected.iter().map(Option::is_some).collect();
                assert_eq!(occluded, expected_occluded, "tile {index}, {structure:?}, {}", numerics.name());
                occluded.clear();
                tree.closest_hits(RayBuffer::from(rays).rays(), &mut hits, &mut traversal);
                tree.are_occluded(RayBuffer::from(&shadows).rays(), &mut occluded, &mut traversal);
                for ((ray, found), expected) in rays.iter().zip(hits.iter()).zip(&expected) {
                    let what = format!("tile {index}, {structure:?}, {}: {ray:?}", numerics.name());
                    assert_eq!(bits(&found), bits(expected), "{what}");
                }
                let (mut short_hits, mut from_surface) = (HitBuffer::default(), Vec::new());
                tree.closest_hits(RayBuffer::from(&short).rays(), &mut short_hits, &mut traversal);
                tree.are_occluded(RayBuffer::from(&on).rays(), &mut from_surface, &mut traversal);
                for ((ray, found), expected) in short.iter().zip(short_hits.iter()).zip(&expected_short) {
                    let what = format!("tile {index}, {structure:?}, {}: {ray:?}", numerics.name());
                    assert_eq!(bits(&found), bits(expected), "cut short: {what}");
                }
                for ((ray, found), expected) in on.iter().zip(&from_surface).zip(&expected_on) {
                    let what = format!("tile {index}, {structure:?}, {}: {ray:?}", numerics.name());
                    assert_eq!(found, expected, "from a surface: {what}");
                }
                for ((ray, found), expected) in shadows.iter().zip(&occluded).zip(&blocked) {
                    assert_eq!(found, expected, "tile {index}, {structure:?}, {}: {ray:?}", numerics.name());
                }
            }
        }
        assert!(hit * 3 > all && lit * 20 > hit && dark * 20 > hit, "{hit} of {all}, {lit} lit, {dark} dark");
    }
}

#[test]
fn at_unit_size() {
    packets_answer_as_single_rays(1.0, DVec3::ZERO);
}

#[test]
fn far_from_the_origin() {
    packets_answer_as_single_rays(1.0, DVec3::new(1000.0, -500.0, 2000.0));
}

#[test]
fn tiny_and_large() {
    packets_answer_as_single_rays(2f64.powi(-30), DVec3::ZERO);
    packets_answer_as_single_rays(1e5, DVec3::ZERO);
}

/// Rays that end a little before and a little beyond a triangle that they meet head-on: it lies behind the middle of
/// their ends, and right before some of these.
#[test]
fn ends_on_both_sides_of_a_triangle() {
    // A triangle across z, and one far aside.
    let behind = 2f64.powi(-16);
    let across = |z: f64, x: f64| {
        let corners = [(x - 4.0, -4.0), (x + 4.0, -4.0), (x, 6.0)];
        Primitive::Triangle(Triangle(corners.map(|(x, y)| DVec3::new(x, y, z))))
    };
    let slots: Vec<Slot> = (0..)
        .zip([across(behind, 0.0), across(0.0, 50.0)])
        .map(|(id, primitive)| Slot { primitive, id: PrimId(id) })
        .collect();
    for numerics in Numerics::STRICT {
        let precision = numerics.ray_precision();
        let mut traversal = Traversal::default();
        let oracle = build(slots.iter().copied(), Layout::BruteForce, numerics);
        let rays: Vec<Ray> = (0..TILE)
            .map(|i| {
                let (x, y) = ((i % 16) as f64 / 16.0 - 0.5, (i / 16) as f64 / 16.0 - 0.5);
                let origin = DVec3::new(x, y, -10.0);
                // They end at z = -2^-15 and at z = 2^-15.
                let end = DVec3::new(0.0, 0.0, if i % 2 == 0 { -2.0 * behind } else { 2.0 * behind });
                let way = end - origin;
                precision.ray(origin, way.normalize(), 0.0, way.length())
            })
            .collect();
        let expected: Vec<_> = rays.iter().map(|ray| oracle.is_occluded(ray, &mut traversal)).collect();
        assert_eq!(expected, (0..TILE).map(|i| i % 2 == 1).collect::<Vec<_>>());
        for structure in
            [Layout::default(), Layout::Avx2(Default::default()), Layout::Portable(Default::default())]
        {
            let tree = build(slots.iter().copied(), structure, numerics);
            let mut occluded = Vec::new();
            tree.are_occluded(RayBuffer::from(&rays).rays(), &mut occluded, &mut traversal);
            assert_eq!(occluded, expected, "{structure:?}, {}", numerics.name());
        }
    }
}

/// Rays in packets are answered as one by one: all of them but those that are not numbers.
fn assert_as_single_rays(slots: &[Slot], rays: &[Ray], numerics: Numerics, what: &str) {
    let mut traversal = Traversal::default();
    for structure in [Layout::default(), Layout::Avx2(Default::default())] {
        let tree = build(slots.iter().copied(), structure, numerics);
        let (mut hits, mut occluded) = (HitBuffer::default(), Vec::new());
        tree.closest_hits(RayBuffer::from(rays).rays(), &mut hits, &mut traversal);
        tree.are_occluded(RayBuffer::from(rays).rays(), &mut occluded, &mut traversal);
        for (index, ray) in rays.iter().enumerate().filter(|(_, ray)| !ray.origin().is_nan()) {
            let expected = tree.closest_hit(ray, &mut traversal);
            let what = format!("{what}, ray {index}, {structure:?}, {}", numerics.name());
            assert_eq!(bits(&hits.get(index)), bits(&expected), "{what}");
            assert_eq!(occluded[index], expected.is_some(), "{what}");
        }
    }
}

/// Depths beyond the range of f32: a slope of 0 times an infinite depth would leave out a box that is hit.
#[test]
fn depths_that_overflow() {
    let corners = [(-1e38, -1e38), (1e38, -1e38), (0.0, 1e38)].map(|(x, y)| DVec3::new(x, y, 3e38));
    let slots = [Slot { primitive: Primitive::Triangle(Triangle(corners)), id: PrimId(0) }];
    for numerics in Numerics::STRICT {
        let origin = DVec3::new(0.0, 0.0, -2e38);
        let towards = |i: usize| DVec3::new(1e36 * (i % 8) as f64 - 4e36, 1e36 * (i / 8) as f64 - 4e36, 3e38);
        let ray = |i| {
            let direction = ((towards(i) - origin) / 1e38).normalize();
            numerics.ray_precision().ray(origin, direction, 0.0, f64::INFINITY)
        };
        let rays: Vec<Ray> = (0..64).map(ray).collect();
        let tree = build(slots.iter().copied(), Layout::default(), numerics);
        assert!(rays.iter().all(|ray| tree.closest_hit(ray, &mut Traversal::default()).is_some()));
        assert_as_single_rays(&slots, &rays, numerics, "overflow");
    }
}

/// A ray that is not a number changes no other ray of its packet, wherever it is among them.
#[test]
fn a_ray_that_is_not_a_number() {
    let slots = slots(1.0, DVec3::ZERO);
    for numerics in Numerics::STRICT {
        let precision = numerics.ray_precision();
        let mut tiles = tiles(&slots, 1.0, DVec3::ZERO, precision);
        tiles.extend(parallel_tiles(&slots, 1.0, precision));
        for (index, rays) in tiles.iter_mut().enumerate() {
            let place = (37 * index) % rays.len();
            rays[place] = Ray::unchecked(DVec3::NAN, rays[place].direction(), 0.0, f64::INFINITY);
            assert_as_single_rays(&slots, rays, numerics, &format!("tile {index}"));
        }
    }
}

/// Packets of one call, most of which diverge over 32,768 triangles and are abandoned or left out, some of which do not,
/// the last of which is not full.
#[test]
fn a_call_of_many_packets_answers_as_single_rays() {
    let mut numbers = Numbers::new(5);
    let side = 128;
    let heights: Vec<f64> = (0..(side + 1) * (side + 1)).map(|_| numbers.unit()).collect();
    let point = |x: usize, y: usize| DVec3::new(x as f64, heights[(side + 1) * y + x], y as f64);
    let triangles = (0..side * side).map(|i| (i % side, i / side)).flat_map(|(x, y)| {
        [
            [point(x, y), point(x + 1, y), point(x + 1, y + 1)],
            [point(x, y), point(x + 1, y + 1), point(x, y + 1)],
        ]
    });
    let single = |p: DVec3| p.as_vec3().as_dvec3();
    let slots: Vec<Slot> = (0..)
        .zip(triangles)
        .map(|(id, t)| Slot { primitive: Primitive::Triangle(Triangle(t.map(single))), id: PrimId(id) })
        .collect();
    let eye = DVec3::new(64.0, 60.0, 40.0);
    let targets: Vec<DVec3> = (0..15 * TILE + 100)
        .map(|i| {
            let is_near = matches!(i / TILE, 5..8);
            let at = DVec3::new(numbers.unit(), 2.0 * numbers.unit() / 128.0, numbers.unit());
            if is_near { DVec3::new(50.0, 0.0, 50.0) + at } else { at * 128.0 }
        })
        .collect();
    for numerics in Numerics::STRICT {
        let ray = |from: DVec3, to: DVec3, t_max| {
            numerics.ray_precision().ray(from, (to - from).normalize(), 0.0, t_max)
        };
        let from_eye: Vec<Ray> = targets.iter().map(|&target| ray(eye, target, f64::INFINITY)).collect();
        let to_eye: Vec<Ray> = targets.iter().map(|&target| ray(target, eye, target.distance(eye))).collect();
        for structure in Layout::trees() {
            let tree = build(slots.iter().copied(), structure, numerics);
            let (mut traversal, mut hits, mut occluded) =
                (Traversal::default(), HitBuffer::default(), Vec::new());
            tree.closest_hits(RayBuffer::from(&from_eye).rays(), &mut hits, &mut traversal);
            tree.are_occluded(RayBuffer::from(&to_eye).rays(), &mut occluded, &mut traversal);
            for (index, (ray, found)) in from_eye.iter().zip(hits.iter()).enumerate() {
                let expected = tree.closest_hit(ray, &mut traversal);
                assert_eq!(bits(&found), bits(&expected), "ray {index}, {structure:?}, {}", numerics.name());
            }
            for (index, (ray, found)) in to_eye.iter().zip(&occluded).enumerate() {
                let expected = tree.is_occluded(ray, &mut traversal);
                assert_eq!(*found, expected, "ray {index}, {structure:?}, {}", numerics.name());
            }
            let (hit, blocked) =
                (hits.iter().flatten().count(), occluded.iter().filter(|&&occluded| occluded).count());
            assert!(
                hit > 2000 && blocked > 500 && blocked < targets.len() - 500,
                "{hit} hit, {blocked} blocked"
            );
        }
    }
}
