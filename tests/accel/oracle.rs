//! Every acceleration structure returns the same hits as brute force, bit for bit, for every obvhs preset, on
//! numerically hard rays.

use crate::common::hard::times_factor;
use crate::common::{self, Numbers, origin_on_border};
use glam::DVec3;
use kiln::bvh::detail::{HitBuffer, Layout, Precision, RayBuffer, Slot, SurfacePoint, build};
use kiln::bvh::{AnalyticShape, Disk, Hit, Numerics, PrimId, Primitive, Ray, Sphere, Traversal, Triangle};

/// How many rays are asked about at once.
const BATCH: usize = 64;

fn slots(primitives: Vec<Primitive>) -> Vec<Slot> {
    (0..).zip(primitives).map(|(id, primitive)| Slot { primitive, id: PrimId(id) }).collect()
}

/// A mesh of a closed sphere over a grid, whose poles, seams and axis-aligned edges are on purpose.
fn globe(rings: u32, segments: u32, centre: DVec3, radius: f64) -> Vec<Primitive> {
    let point = |ring: u32, segment: u32| {
        let theta = f64::from(ring) / f64::from(rings) * std::f64::consts::PI;
        let phi = f64::from(segment % segments) / f64::from(segments) * std::f64::consts::TAU;
        // The poles are one point each, the seam is shared.
        let sine = if ring == 0 || ring == rings { 0.0 } else { theta.sin() };
        (centre + radius * DVec3::new(sine * phi.cos(), theta.cos(), sine * phi.sin())).as_vec3().as_dvec3()
    };
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for segment in 0..segments {
            let [a, b] = [point(ring, segment), point(ring, segment + 1)];
            let [c, d] = [point(ring + 1, segment), point(ring + 1, segment + 1)];
            if ring > 0 {
                triangles.push(Primitive::Triangle(Triangle([a, b, d])));
            }
            if ring + 1 < rings {
                triangles.push(Primitive::Triangle(Triangle([a, d, c])));
            }
        }
    }
    triangles
}

/// An integer height field: every edge and every vertex can be met exactly.
fn terrain(size: i32, numbers: &mut Numbers) -> Vec<Primitive> {
    let heights: Vec<f64> =
        (0..=size).flat_map(|_| (0..=size).map(|_| numbers.below(4) as f64).collect::<Vec<_>>()).collect();
    let point =
        |x: i32, y: i32| DVec3::new(f64::from(x), f64::from(y), heights[(y * (size + 1) + x) as usize]);
    let mut triangles = Vec::new();
    for y in 0..size {
        for x in 0..size {
            triangles.push(Primitive::Triangle(Triangle([
                point(x, y),
                point(x + 1, y),
                point(x + 1, y + 1),
            ])));
            triangles.push(Primitive::Triangle(Triangle([
                point(x, y),
                point(x + 1, y + 1),
                point(x, y + 1),
            ])));
        }
    }
    triangles
}

/// Everything at once: a globe, a terrain, a soup, spheres and disks among triangles, a giant triangle, and duplicates.
fn mixed(scale: f64, offset: DVec3) -> Vec<Slot> {
    let mut numbers = Numbers::new(7);
    let mut primitives = globe(8, 12, DVec3::new(4.0, 4.0, 6.0), 2.0);
    primitives.extend(terrain(8, &mut numbers));
    for _ in 0..150 {
        let at = numbers.vector() * 4.0 + 4.0;
        let corner = |numbers: &mut Numbers| at + numbers.vector();
        primitives.push(Primitive::Triangle(Triangle([
            corner(&mut numbers),
            corner(&mut numbers),
            corner(&mut numbers),
        ])));
    }
    for _ in 0..20 {
        let centre = numbers.vector() * 4.0 + 4.0;
        primitives.insert(
            numbers.below(primitives.len()),
            Primitive::from(Sphere { centre, radius: 0.1 + numbers.unit() }),
        );
    }
    for i in 0..20 {
        let normal = if i % 4 == 0 { DVec3::AXES[i % 3] } else { numbers.vector().normalize() };
        let (centre, radius) = (numbers.vector() * 4.0 + 4.0, 0.1 + numbers.unit());
        primitives.insert(numbers.below(primitives.len()), Primitive::from(Disk { centre, normal, radius }));
    }
    let giant = [DVec3::new(-1e3, -1e3, -1.0), DVec3::new(-1e3, 1e4, -1.0), DVec3::new(1e4, -1e3, -1.0)];
    primitives.push(Primitive::Triangle(Triangle(giant)));
    primitives.extend_from_within(0..40);
    let place = |p: DVec3| p * scale + offset;
    for primitive in &mut primitives {
        match primitive {
            Primitive::Triangle(Triangle(corners)) => {
                corners.iter_mut().for_each(|c| *c = place(*c));
            }
            Primitive::Analytic(shape) => {
                *shape.centre_mut() = place(*shape.centre_mut());
                *shape.radius_mut() *= scale;
            }
        }
    }
    slots(primitives)
}

/// Points that rays are aimed at: vertices, edge midpoints, points on edges, points inside, points on spheres
/// and disks.
fn targets(slots: &[Slot], count: usize, numbers: &mut Numbers) -> Vec<DVec3> {
    (0..count)
        .map(|i| match slots[numbers.below(slots.len())].primitive {
            Primitive::Triangle(Triangle(corners)) => {
                let [a, b, c] = corners;
                match i % 4 {
                    0 => a,
                    1 => (a + b) / 2.0,
                    2 => b.lerp(c, numbers.unit()),
                    _ => a.lerp(b, numbers.unit()).lerp(c, numbers.unit()),
                }
            }
            Primitive::Analytic(AnalyticShape::Sphere(sphere)) => {
                let towards = numbers.vector().normalize();
                sphere.centre + sphere.radius * if i % 2 == 0 { towards } else { DVec3::X }
            }
            // The rim, the inside and the centre.
            Primitive::Analytic(AnalyticShape::Disk(disk)) => {
                let aside = disk.normal.cross(numbers.vector()).try_normalize().unwrap_or(disk.normal);
                disk.centre + aside * (disk.radius * [1.0, numbers.unit(), 0.0][i % 3])
            }
            Primitive::Analytic(shape) => panic!("another shape: {shape:?}"),
        })
        .collect()
}

fn rays(slots: &[Slot], scale: f64, offset: DVec3, numerics: Numerics) -> Vec<Ray> {
    let precision = numerics.ray_precision();
    let mut numbers = Numbers::new(11);
    let mut rays = Vec::new();
    let infinite = |origin, direction| precision.ray(origin, direction, 0.0, f64::INFINITY);
    for target in targets(slots, times_factor(3000), &mut numbers) {
        // From anywhere, at the target.
        let origin = offset + (numbers.vector() * 10.0 + 4.0) * scale;
        rays.push(infinite(origin, (target - origin).normalize()));
        // Ending just about there.
        let origin = origin.as_vec3().as_dvec3();
        let length = (target - origin).length();
        rays.push(precision.ray(origin, (target - origin).normalize(), 0.0, length));
    }
    // All 26 directions with components in {-1, -0.0, 0.0, 1}, every pattern of signed zeros, through the targets.
    let components = [-1.0, -0.0, 0.0, 1.0];
    for target in targets(slots, times_factor(24), &mut numbers) {
        for x in components {
            for y in components {
                for z in components {
                    let direction = DVec3::new(x, y, z);
                    if direction != DVec3::ZERO {
                        rays.push(infinite(target - direction * (16.0 * scale), direction.normalize()));
                        rays.push(infinite(target, direction.normalize()));
                    }
                }
            }
        }
    }
    // Bundles that keep together, as a tile's rays do: from one point, in parallel, and towards one point.
    for target in targets(slots, 20, &mut numbers) {
        let origin = offset + (numbers.vector() * 10.0 + 4.0) * scale;
        let aside = |i: usize| DVec3::new((i % 8) as f64, (i / 8) as f64, 0.0) * (0.05 * scale);
        rays.extend((0..BATCH).map(|i| infinite(origin, (target + aside(i) - origin).normalize())));
        rays.extend((0..BATCH).map(|i| infinite(target + aside(i) + DVec3::Z * (9.0 * scale), -DVec3::Z)));
        rays.extend((0..BATCH).map(|i| {
            let start = (target + aside(i)).as_vec3().as_dvec3();
            precision.ray(start, (origin - start).normalize(), 0.0, (origin - start).length())
        }));
    }
    // Secondary rays that leave triangles on their borders: anywhere, at other borders, and of every triangle a bundle
    // to one point.
    for (index, target) in targets(slots, times_factor(3000), &mut numbers).into_iter().enumerate() {
        let Primitive::Triangle(Triangle(corners)) = slots[index % slots.len()].primitive else { continue };
        let Some((origin, normal)) = origin_on_border(corners, numerics, &mut numbers) else { continue };
        let direction = if index % 2 == 0 { target - origin } else { numbers.vector() };
        let direction = direction * direction.dot(normal).signum();
        rays.extend(direction.try_normalize().map(|direction| infinite(origin, direction)));
    }
    for target in targets(slots, 12, &mut numbers) {
        let Primitive::Triangle(Triangle(corners)) = slots[numbers.below(slots.len())].primitive else {
            continue;
        };
        let lamp = target + numbers.vector() * (4.0 * scale);
        rays.extend((0..BATCH).filter_map(|_| {
            let (origin, _) = origin_on_border(corners, numerics, &mut numbers)?;
            let way = lamp - origin;
            Some(precision.ray(origin, way.normalize(), 0.0, way.length()))
        }));
    }
    for _ in 0..times_factor(2000) {
        rays.push(infinite(offset + (numbers.vector() * 8.0 + 4.0) * scale, numbers.vector().normalize()));
    }
    rays
}

fn bits(hit: Option<Hit>) -> Option<(u64, PrimId)> {
    hit.map(|hit| (hit.t.to_bits(), hit.prim))
}

fn assert_equal_to_brute_force(slots: &[Slot], rays: &[Ray], what: &str, numerics: Numerics) {
    let what = format!("{what}, {}", numerics.name());
    let oracle = build(slots.iter().copied(), Layout::BruteForce, numerics);
    let mut traversal = Traversal::default();
    let expected: Vec<_> = rays.iter().map(|ray| bits(oracle.closest_hit(ray, &mut traversal))).collect();
    let count = expected.iter().flatten().count();
    assert!(count * 2 > rays.len(), "{what}: only {count} of {} rays hit; they test too little", rays.len());
    for structure in Layout::trees() {
        let tree = build(slots.iter().copied(), structure, numerics);
        let wrong = rays
            .iter()
            .zip(&expected)
            .filter(|(ray, expected)| {
                bits(tree.closest_hit(ray, &mut traversal)) != **expected
                    || tree.is_occluded(ray, &mut traversal) != expected.is_some()
            })
            .count();
        assert_eq!(wrong, 0, "{what}, {structure:?}: {wrong} of {} rays differ from brute force", rays.len());

        // The same in batches, in which rays share their way down the tree.
        let (mut hits, mut occluded) = (HitBuffer::default(), Vec::new());
        for batch in RayBuffer::from(rays).rays().chunks(BATCH) {
            tree.closest_hits(batch, &mut hits, &mut traversal);
            tree.are_occluded(batch, &mut occluded, &mut traversal);
        }
        let found = hits.iter().zip(occluded);
        let wrong =
            found.zip(&expected).filter(|((hit, blocked), e)| bits(*hit) != **e || *blocked != e.is_some());
        assert_eq!(wrong.count(), 0, "{what}, {structure:?}, in batches");

        let all = |accelerator: &dyn kiln::bvh::detail::Accelerator, ray: &Ray| {
            let mut hits = Vec::new();
            accelerator.all_hits(ray, &mut hits, &mut Traversal::default());
            let mut hits: Vec<_> = hits.into_iter().map(|hit| bits(Some(hit))).collect();
            hits.sort_unstable();
            hits
        };
        let wrong = rays.iter().step_by(7).filter(|ray| all(&*tree, ray) != all(&*oracle, ray)).count();
        assert_eq!(wrong, 0, "{what}, {structure:?}, all hits");
    }
}

fn assert_equal_in_every_tier(slots: &[Slot], rays: impl Fn(Precision) -> Vec<Ray>, what: &str) {
    for numerics in Numerics::STRICT {
        assert_equal_to_brute_force(slots, &rays(numerics.ray_precision()), what, numerics);
    }
}

#[test]
fn every_preset_answers_as_brute_force() {
    for (scale, offset) in [
        (1.0, DVec3::ZERO),
        (1e-5, DVec3::ZERO),
        (1e5, DVec3::ZERO),
        (1.0, DVec3::new(1000.0, -500.0, 2000.0)),
        (1.0, DVec3::splat(1e5)),
        (1e-12, DVec3::ZERO),
        (1e12, DVec3::ZERO),
    ] {
        let slots = mixed(scale, offset);
        for numerics in Numerics::STRICT {
            let rays = rays(&slots, scale, offset, numerics);
            assert_equal_to_brute_force(&slots, &rays, &format!("scale {scale}, offset {offset}"), numerics);
        }
    }
}

/// Coordinates up to the largest that f32 boxes hold, as far as the products of f64 reach: with the giant triangle of
/// 1e4, and without it.
#[test]
fn huge_coordinates_answer_as_brute_force() {
    // The last scales are on either side of the largest coordinates of packets, 2^126, and up to 3e38.
    for (scale, is_giant) in [(1e25, true), (2e34, true), (5e36, false), (1e37, false), (3e37, false)] {
        let mut slots = mixed(scale, DVec3::ZERO);
        let reaches = |slot: &Slot| {
            let bounds = slot.primitive.bounds();
            bounds.min.abs().max(bounds.max.abs()).max_element()
        };
        slots.retain(|slot| is_giant || f64::from(reaches(slot)) < 100.0 * scale);
        assert!(is_giant || slots.iter().any(|slot| f64::from(reaches(slot)) > 8.0 * scale));
        for numerics in Numerics::STRICT {
            let mut rays = rays(&slots, scale, DVec3::ZERO, numerics);
            rays.retain(|ray| ray.origin().as_vec3().is_finite() && !ray.t_max().is_nan());
            assert_equal_to_brute_force(&slots, &rays, &format!("scale {scale}"), numerics);
        }
    }
}

#[test]
fn lattice_rays_answer_as_brute_force() {
    let slots = slots(terrain(16, &mut Numbers::new(3)));
    let rays = |precision: Precision| {
        let mut rays = Vec::new();
        for half_x in -2..=34 {
            for half_y in -2..=34 {
                let (x, y) = (f64::from(half_x) / 2.0, f64::from(half_y) / 2.0);
                for z in [-1.0, 1.0] {
                    for zero in [0.0, -0.0] {
                        let direction = DVec3::new(zero, -zero, -z);
                        rays.push(precision.ray(DVec3::new(x, y, 9.0 * z), direction, 0.0, f64::INFINITY));
                    }
                }
            }
        }
        rays
    };
    assert_equal_in_every_tier(&slots, rays, "lattice");
}

#[test]
fn few_primitives_answer_as_brute_force() {
    let all = mixed(1.0, DVec3::ZERO);
    for numerics in Numerics::STRICT {
        let rays = rays(&all, 1.0, DVec3::ZERO, numerics);
        for count in 0..=5 {
            let few: Vec<Slot> = all.iter().rev().take(count).copied().collect();
            let oracle = build(few.iter().copied(), Layout::BruteForce, numerics);
            let mut traversal = Traversal::default();
            for structure in Layout::trees() {
                let tree = build(few.iter().copied(), structure, numerics);
                for ray in &rays {
                    let expected = bits(oracle.closest_hit(ray, &mut traversal));
                    let found = bits(tree.closest_hit(ray, &mut traversal));
                    assert_eq!(found, expected, "{count} primitives, {structure:?}, {}", numerics.name());
                }
            }
        }
    }
}

/// Rays that leave the surfaces which others hit: with and without an end, at a point of another primitive.
fn secondary_rays(slots: &[Slot], rays: &[Ray], numerics: Numerics, numbers: &mut Numbers) -> Vec<Ray> {
    let oracle = build(slots.iter().copied(), Layout::BruteForce, numerics);
    let mut traversal = Traversal::default();
    let targets = targets(slots, rays.len(), numbers);
    let mut secondary = Vec::new();
    for (ray, target) in rays.iter().zip(targets) {
        let Some(hit) = oracle.closest_hit(ray, &mut traversal) else { continue };
        let (point, normal) = match oracle.primitive(hit.slot) {
            Primitive::Analytic(shape) => shape.surface(ray.at(hit.t)),
            Primitive::Triangle(triangle) => {
                let [v, w] = hit.barycentrics;
                let Some(normal) = triangle.unit_normal() else { continue };
                (SurfacePoint::on_triangle(triangle.0, [1.0 - v - w, v, w], numerics), normal)
            }
        };
        for side in [1.0, -1.0] {
            let origin = point.origin_towards(normal * side, numerics);
            let Some(direction) = (target - origin).try_normalize() else { continue };
            for t_max in [f64::INFINITY, origin.distance(target)] {
                secondary.push(numerics.ray_precision().ray(origin, direction, 0.0, t_max));
            }
        }
    }
    secondary
}

/// Small scenes, up to and beyond the number of primitives that are tested without a tree: batches of camera-like,
/// secondary and shadow rays, of any length; equal primitives, whose hits are ties; rays that f32 cannot represent.
#[test]
fn batches_in_small_scenes_answer_as_brute_force() {
    let mut numbers = Numbers::new(5);
    let all = mixed(1.0, DVec3::ZERO);
    for numerics in Numerics::STRICT {
        let mut hit_count = 0;
        for count in [1, 2, 3, 7, 12, 31, 32, 33, 40] {
            let mut slots: Vec<Slot> = all.iter().step_by(all.len() / count).take(count).copied().collect();
            if count > 2 {
                slots[count - 1].primitive = slots[0].primitive;
            }
            let mut rays = rays(&slots, 1.0, DVec3::ZERO, numerics);
            let secondary = secondary_rays(&slots, &rays, numerics, &mut numbers);
            rays.extend(secondary);
            let odd = |origin: DVec3, direction| Ray::unchecked(origin, direction, 0.0, f64::INFINITY);
            rays.push(odd(DVec3::splat(1e10), DVec3::splat(-1.0).normalize()));
            rays.push(odd(rays[0].origin(), rays[0].direction() * 0.5));
            let oracle = build(slots.iter().copied(), Layout::BruteForce, numerics);
            let mut traversal = Traversal::default();
            let expected: Vec<_> =
                rays.iter().map(|ray| bits(oracle.closest_hit(ray, &mut traversal))).collect();
            hit_count += expected.iter().flatten().count();
            for structure in Layout::trees() {
                let tree = build(slots.iter().copied(), structure, numerics);
                for size in [1, 7, 17, 256] {
                    let (mut hits, mut occluded) = (HitBuffer::default(), Vec::new());
                    for batch in RayBuffer::from(&rays[..]).rays().chunks(size) {
                        tree.closest_hits(batch, &mut hits, &mut traversal);
                        tree.are_occluded(batch, &mut occluded, &mut traversal);
                    }
                    for (i, (ray, expected)) in rays.iter().zip(&expected).enumerate() {
                        let what = || format!("{count} primitives, {structure:?}, {size} rays, {ray:?}");
                        assert_eq!(bits(hits.get(i)), *expected, "{numerics:?}, {}", what());
                        assert_eq!(occluded[i], expected.is_some(), "{numerics:?}, {}", what());
                    }
                }
            }
        }
        assert!(hit_count > 5000, "{hit_count}");
    }
}

/// Packets, vectors and their last, partly filled ones.
#[test]
fn any_number_of_rays_is_answered_as_one_by_one() {
    let slots = mixed(1.0, DVec3::ZERO);
    let mut traversal = Traversal::default();
    for numerics in Numerics::STRICT {
        let mut all = rays(&slots, 1.0, DVec3::ZERO, numerics);
        // A common origin, which packets need, between incoherent rays.
        let (target, start) = (all[0].origin(), all.len());
        all.extend((0..300).map(|i| {
            let aside = DVec3::new(f64::from(i % 17) - 8.0, f64::from(i / 17) - 8.0, 0.0) / 40.0;
            numerics.precision().ray(target, (aside - target).normalize(), 0.0, f64::INFINITY)
        }));
        all.extend_from_within(..700);
        for structure in Layout::trees() {
            let tree = build(slots.iter().copied(), structure, numerics);
            for count in [0, 1, 7, 8, 9, 15, 16, 17, 31, 33, 255, 256, 257, 300, 511, 513, 900] {
                for first in [0, start, start - 256, start - 300] {
                    let some = &all[first..(first + count).min(all.len())];
                    let (mut hits, mut occluded) = (HitBuffer::default(), Vec::new());
                    tree.closest_hits(RayBuffer::from(some).rays(), &mut hits, &mut traversal);
                    tree.are_occluded(RayBuffer::from(some).rays(), &mut occluded, &mut traversal);
                    let found: Vec<_> = hits.iter().map(bits).collect();
                    let expected: Vec<_> =
                        some.iter().map(|ray| bits(tree.closest_hit(ray, &mut traversal))).collect();
                    let name = numerics.name();
                    assert_eq!(found, expected, "{count} rays from {first}, {structure:?}, {name}");
                    let hit: Vec<_> = expected.iter().map(Option::is_some).collect();
                    assert_eq!(occluded, hit, "{count} rays from {first}, {structure:?}, {name}");
                }
            }
        }
    }
}

/// Real data, with its real degeneracies.
#[test]
#[ignore = "needs KILN_MODELS"]
fn with_models_suzanne_answers_as_brute_force() {
    let folder = common::models();
    let mut warnings = kiln::error::Warnings::default();
    let scene = kiln::import::load(&[folder.join("suzanne.obj")], &mut warnings).unwrap();
    let kiln::scene::Shape::Mesh(mesh) = &scene.objects[0].shape else { panic!("not a mesh") };
    let triangles = mesh.triangles.iter().map(|t| Triangle(t.map(|i| mesh.positions[i as usize])));
    let slots = slots(triangles.map(Primitive::Triangle).collect());
    let rays = |precision: Precision| {
        let mut numbers = Numbers::new(5);
        let targets = targets(&slots, times_factor(4000), &mut numbers);
        let aimed = targets.into_iter().map(|target| {
            let origin = numbers.vector() * 3.0;
            precision.ray(origin, (target - origin).normalize(), 0.0, f64::INFINITY)
        });
        aimed.collect()
    };
    assert_equal_in_every_tier(&slots, rays, "suzanne");
}

/// The tier `fast`: rays that meet triangles well inside are answered as by `exact`, in every structure, alone and in
/// batches; at edges, structures differ.
#[test]
fn fast_is_right_inside_of_triangles_and_depends_on_structures_at_edges() {
    let slots = slots(globe(32, 64, DVec3::ZERO, 1.0));
    let origin = DVec3::new(0.125, -0.25, 0.0625);
    let ray = |origin: DVec3, target: DVec3| {
        let (direction, distance) = ((target - origin).normalize(), (target - origin).length());
        Precision::Single.ray(origin, direction, 0.0, distance)
    };
    // Batches with a common sign of the longest component are packets.
    let sorted = |mut points: Vec<DVec3>| {
        points.sort_by_key(|p| {
            let axis = p.abs().max_position();
            (axis, p[axis] > 0.0)
        });
        points
    };
    let corners = || {
        slots.iter().filter_map(|slot| match slot.primitive {
            Primitive::Triangle(Triangle(corners)) => Some(corners),
            Primitive::Analytic(_) => None,
        })
    };
    let centres = sorted(corners().map(|[a, b, c]| (a + b + c) / 3.0).collect());
    let edges = sorted(corners().map(|[a, b, _]| (a + b) / 2.0).collect());
    let outwards = |to: &[DVec3]| to.iter().map(|p| ray(origin, *p * 2.0)).collect::<Vec<_>>();
    let answers = |tree: &dyn kiln::bvh::detail::Accelerator, rays: &[Ray]| {
        let (mut hits, mut traversal) = (HitBuffer::default(), Traversal::default());
        RayBuffer::from(rays)
            .rays()
            .chunks(BATCH)
            .for_each(|b| tree.closest_hits(b, &mut hits, &mut traversal));
        let alone: Vec<_> = rays.iter().map(|ray| tree.closest_hit(ray, &mut traversal)).collect();
        [alone, hits.iter().collect::<Vec<_>>()]
    };
    let occluded = |tree: &dyn kiln::bvh::detail::Accelerator, rays: &[Ray]| {
        let (mut occluded, mut traversal) = (Vec::new(), Traversal::default());
        RayBuffer::from(rays)
            .rays()
            .chunks(BATCH)
            .for_each(|b| tree.are_occluded(b, &mut occluded, &mut traversal));
        let alone = rays.iter().map(|ray| tree.is_occluded(ray, &mut traversal));
        occluded.iter().copied().chain(alone).filter(|x| *x).count()
    };
    let exact = build(slots.iter().copied(), Layout::default(), Numerics::Exact);
    let [expected, _] = answers(&*exact, &outwards(&centres));
    // Shadow rays from both sides of a triangle, to a point and to a direction.
    let near = |side: f64| centres.iter().map(move |p| *p * side);
    let to_point = |side: f64| near(side).map(|p| ray(p, origin)).collect::<Vec<_>>();
    let parallel = |side: f64| {
        let facing = near(side).filter(|p| p.z > 0.5);
        facing.map(|p| Precision::Single.ray(p, DVec3::new(0.125, 0.25, 0.75), 0.0, 1e9)).collect::<Vec<_>>()
    };
    let mut at_edges = std::collections::BTreeSet::new();
    for structure in Layout::trees().chain([Layout::BruteForce]) {
        let tree = build(slots.iter().copied(), structure, Numerics::Fast);
        for found in answers(&*tree, &outwards(&centres)) {
            for (found, expected) in found.iter().zip(&expected) {
                let (found, expected) = (found.expect("a hit"), expected.expect("a hit"));
                assert_eq!(found.prim, expected.prim, "{structure:?}");
                assert!((found.t - expected.t).abs() < 1e-5, "{structure:?}: {found:?}, {expected:?}");
                for (found, expected) in found.barycentrics.iter().zip(expected.barycentrics) {
                    assert!((found - expected).abs() < 1e-3, "{structure:?}");
                }
            }
        }
        let count = parallel(1.0).len();
        assert_eq!(occluded(&*tree, &to_point(1.0001)), 2 * centres.len(), "{structure:?}");
        assert_eq!(occluded(&*tree, &to_point(0.9999)), 0, "{structure:?}");
        assert_eq!(occluded(&*tree, &parallel(0.9999)), 2 * count, "{structure:?}");
        assert_eq!(occluded(&*tree, &parallel(1.0001)), 0, "{structure:?}");
        at_edges.extend(
            answers(&*tree, &outwards(&edges)).map(|hits| hits.into_iter().map(bits).collect::<Vec<_>>()),
        );
    }
    assert!(at_edges.len() > 2, "structures do not differ");
}

/// No ray from inside a closed mesh gets out, wherever it is aimed, at any scale or place; in the fast tier some do.
#[test]
fn closed_meshes_do_not_leak() {
    for (scale, offset) in [
        (1.0, DVec3::ZERO),
        (1e-5, DVec3::ZERO),
        (1e5, DVec3::ZERO),
        (1.0, DVec3::new(1000.0, -500.0, 2000.0)),
    ] {
        let slots = slots(globe(32, 64, offset, scale));
        for numerics in Numerics::ALL {
            let tree = build(slots.iter().copied(), Layout::default(), numerics);
            let precision = numerics.ray_precision();
            let mut numbers = Numbers::new(13);
            let mut traversal = Traversal::default();
            let mut leaks = 0;
            for target in targets(&slots, times_factor(40_000), &mut numbers) {
                let origin = offset + numbers.vector() * (0.3 * scale);
                let ray = precision.ray(origin, (target - origin).normalize(), 0.0, f64::INFINITY);
                leaks += usize::from(tree.closest_hit(&ray, &mut traversal).is_none());
            }
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                for sign in [1.0, -1.0] {
                    let ray = precision.ray(offset, axis * sign, 0.0, f64::INFINITY);
                    leaks += usize::from(tree.closest_hit(&ray, &mut traversal).is_none());
                }
            }
            assert_eq!(
                leaks > 0,
                numerics == Numerics::Fast,
                "{leaks} leaks, scale {scale}, offset {offset}, {}",
                numerics.name()
            );
        }
    }
}
