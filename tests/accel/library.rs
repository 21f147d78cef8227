//! `Bvh` for library users: maximum distances, all hits, geometric normals, and a scene as its source.

use std::sync::Arc;

use crate::common::Numbers;
use kiln::bvh::detail::{HitBuffer, Layout, Precision, RayBuffer, Slot, build};
use kiln::bvh::{
    Bvh, Hit, InvalidMesh, InvalidRays, NotFinite, Numerics, Preset, PrimId, Primitive, RayList, Traversal,
    Triangle,
};
use kiln::film::ColourPipeline;
use kiln::glam::{DMat4, DVec3};
use kiln::scene::{Material, Mesh, Object, Phong, Placed, Placement, Scene, Shape, Sphere as SceneSphere};
use kiln::world::World;

/// Each tier with guarantees, with each preset.
fn settings() -> impl Iterator<Item = (Numerics, Preset)> {
    Numerics::STRICT.into_iter().flat_map(|numerics| Preset::ALL.map(|preset| (numerics, preset)))
}

/// Ids and distances of all hits of a ray.
fn all(bvh: &Bvh, origin: [f64; 3], direction: [f64; 3]) -> Vec<(u32, f64)> {
    let ray = bvh.ray(origin, direction).expect("finite");
    let hits = bvh.all_hits(&ray, &mut Traversal::default());
    hits.into_iter().map(|hit| (hit.prim.0, hit.t)).collect()
}

/// The square from -1 to 1 in x and y at a height, as two triangles that share a diagonal. Counter-clockwise from +z.
fn square(z: f64) -> [Primitive; 2] {
    let [a, b, c, d] = [[-1.0, -1.0, z], [1.0, -1.0, z], [1.0, 1.0, z], [-1.0, 1.0, z]];
    [[a, b, c].into(), [a, c, d].into()]
}

/// Coordinates are small integers, so that every tier computes the distance 4 exactly.
#[test]
fn hits_are_before_the_maximum_distance() {
    let ball = Primitive::from(([0.0, 0.0, 5.0], 1.0));
    for (numerics, preset) in settings() {
        for primitives in [vec![ball], square(4.0).to_vec()] {
            let bvh = Bvh::with(primitives, preset, numerics).expect("finite");
            let is_hit = |t_max: f64| {
                let ray = bvh.ray_within([0.25, 0.0, 0.0], [0.0, 0.0, 2.0], t_max).expect("finite");
                let hits = bvh.all_hits(&ray, &mut Traversal::default()).len();
                let is_hit = bvh.occluded(&ray, &mut Traversal::default());
                assert_eq!(hits > 0, is_hit, "{t_max}");
                is_hit
            };
            // The ball is met at 5 - sqrt(1 - 1/16) = 4.03, the square at 4.
            assert!(!is_hit(3.9) && is_hit(4.1) && is_hit(f64::INFINITY), "{}", numerics.name());
        }
        let bvh = Bvh::with(square(4.0), preset, numerics).expect("finite");
        // Open: what is exactly at t_max is not hit.
        let ray = bvh.ray_within([0.5, 0.0, 0.0], [0.0, 0.0, 1.0], 4.0).expect("finite");
        assert!(!bvh.occluded(&ray, &mut Traversal::default()), "{}", numerics.name());
        for t_max in [f64::NAN, 0.0, -1.0, f64::NEG_INFINITY] {
            assert_eq!(bvh.ray_within([0.0; 3], [1.0; 3], t_max), Err(NotFinite::Distance));
        }
    }
}

/// What a ray is made of is checked, also when its ends are changed.
#[test]
fn rays_are_valid_however_they_are_made() {
    for numerics in Numerics::ALL {
        let bvh = Bvh::with(square(4.0), Preset::default(), numerics).expect("finite");
        let ray = bvh.ray([0.0; 3], [0.0, 3e200, 4e200]).expect("finite");
        // Of length 1 up to the rounding of the tier.
        assert!((ray.direction().length() - 1.0).abs() < 1e-7, "{ray:?}");
        let later = ray.between(2.0, 5.0).expect("in order");
        assert_eq!((later.t_min(), later.t_max()), (2.0, 5.0));
        assert_eq!((later.origin(), later.direction()), (ray.origin(), ray.direction()));
        for t_min in [f64::NAN, -1.0, -f64::MIN_POSITIVE, f64::NEG_INFINITY] {
            assert_eq!(ray.between(t_min, 5.0), Err(NotFinite::MinDistance));
            let made = std::panic::catch_unwind(|| {
                numerics.ray_precision().ray(ray.origin(), ray.direction(), t_min, 5.0)
            });
            assert!(made.is_err(), "{t_min}");
        }
        for (t_min, t_max) in
            [(0.0, 0.0), (2.0, 2.0), (2.0, 1.0), (0.0, f64::NAN), (f64::INFINITY, f64::INFINITY)]
        {
            assert_eq!(ray.between(t_min, t_max), Err(NotFinite::Distance));
        }
    }
}

/// `fast` rounds the rays of other tiers to f32 itself, for every query, and other tiers take those of `fast` as they
/// are.
#[test]
fn rays_of_another_tier_are_converted() {
    let mut numbers = Numbers::new(9);
    let slots: Vec<Slot> = (0..500)
        .map(|id| {
            let middle = numbers.vector() * 3.0;
            let corners = [(); 3].map(|()| middle + numbers.vector());
            let primitive = match id % 9 {
                0 => Primitive::from((middle.to_array(), 0.3)),
                _ => Primitive::Triangle(Triangle(corners)),
            };
            Slot { primitive, id: PrimId(id) }
        })
        .collect();
    let given: Vec<(DVec3, DVec3)> = (0..700)
        .map(|i| {
            // Others are in a plane, along an axis, or nearly so: components that f32 hardly has.
            let mut direction = numbers.direction();
            match i % 7 {
                0 => direction.x = 0.0,
                1 => direction.x *= 1e-40,
                2 => (direction.x, direction.y) = (1e-25, -1e-38),
                _ => {}
            }
            (numbers.vector() * 4.0, direction.normalize())
        })
        .collect();
    let of = |precision: Precision| {
        given.iter().map(move |&(origin, direction)| precision.ray(origin, direction, 0.0, f64::INFINITY))
    };
    let [double, single] =
        [Precision::Double, Precision::Single].map(|precision| RayBuffer::from_iter(of(precision)));
    for layout in Layout::trees().chain([Layout::BruteForce]) {
        let tree = build(slots.iter().copied(), layout, Numerics::Fast);
        let found = |rays: &RayBuffer| {
            let (traversal, mut hits) = (&mut Traversal::default(), HitBuffer::default());
            let (mut occluded, mut each) = (Vec::new(), Vec::new());
            tree.closest_hits(rays.rays(), &mut hits, traversal);
            tree.are_occluded(rays.rays(), &mut occluded, traversal);
            for (index, ray) in rays.rays().iter().enumerate() {
                let one = tree.closest_hit(&ray, traversal);
                let mut all = Vec::new();
                tree.all_hits(&ray, &mut all, traversal);
                all.sort_unstable_by_key(|hit| hit.prim);
                each.push((hits.get(index), occluded[index], one, tree.is_occluded(&ray, traversal), all));
            }
            each
        };
        let (of_double, of_single) = (found(&double), found(&single));
        assert!(of_single.iter().filter(|found| found.1).count() > 300);
        for (index, (a, b)) in of_double.iter().zip(&of_single).enumerate() {
            assert_eq!(a, b, "{layout:?}: {:?} and {:?}", double.get(index), single.get(index));
        }
    }
    // And those of `fast` are of f64, too.
    for ray in single.rays().iter() {
        let again = Precision::Double.ray(ray.origin(), ray.direction(), 0.0, f64::INFINITY);
        assert_eq!(ray, again);
    }
}

/// A batch has the rays that are made one by one, and names the first that is not valid.
#[test]
fn batches_of_rays_are_those_made_one_by_one() {
    let bvh = Bvh::new(square(4.0)).expect("finite");
    let (origins, directions) =
        ([[0.0; 3], [1.0, 2.0, 3.0], [0.5; 3]], [[0.0, 0.0, 2.0], [1.0; 3], [3.0; 3]]);
    let distances = [1.0, 2.0, 3.0];
    for t_max in [None, Some(&distances[..1]), Some(&distances[..])] {
        let rays = bvh.rays(&origins, &directions, t_max).expect("finite");
        assert_eq!(rays.len(), 3);
        for index in 0..3 {
            let t_max = t_max.map_or(f64::INFINITY, |each| each[index.min(each.len() - 1)]);
            let ray = bvh.ray_within(origins[index], directions[index], t_max);
            assert_eq!(Ok(rays.get(index)), ray, "{index}");
        }
    }
    let of = |origins: &[[f64; 3]], directions: &[[f64; 3]], t_max: f64| {
        bvh.rays(origins, directions, Some(&[t_max])).err()
    };
    let nan = [[0.0; 3], [f64::NAN; 3], [f64::NAN; 3]];
    assert_eq!(of(&nan, &directions, 1.0), Some(InvalidRays::Ray { index: 1, why: NotFinite::Origin }));
    assert_eq!(of(&origins, &nan, 1.0), Some(InvalidRays::Ray { index: 0, why: NotFinite::Direction }));
    assert_eq!(
        of(&origins, &directions, f64::NAN),
        Some(InvalidRays::Ray { index: 0, why: NotFinite::Distance })
    );
    assert_eq!(of(&[], &[], 0.0), None);
}

/// Arrays that do not fit are an error with both lengths, which says what is wrong as any error does.
#[test]
fn batches_of_other_lengths_are_errors() {
    let bvh = Bvh::new(square(4.0)).expect("finite");
    let (origins, directions) = ([[0.0; 3]; 3], [[1.0; 3]; 2]);
    let error = bvh.rays(&origins, &directions, None).expect_err("two directions of three");
    assert_eq!(error, InvalidRays::Directions { directions: 2, origins: 3 });
    let error = bvh.rays(&origins[..2], &directions, Some(&[1.0; 3])).expect_err("three distances of two");
    assert_eq!(error, InvalidRays::Distances { distances: 3, origins: 2 });
    assert!(bvh.rays(&origins[..2], &directions, Some(&[])).is_err());
    let error: Box<dyn std::error::Error> = Box::new(error);
    assert!(error.to_string().contains('3') && error.to_string().contains('2'), "{error}");
    let of_ray = bvh.rays(&[[f64::NAN; 3]], &[[1.0; 3]], None).expect_err("NaN");
    let source = std::error::Error::source(&of_ray).expect("why");
    assert_eq!(source.to_string(), NotFinite::Origin.to_string());
    assert!(of_ray.to_string().starts_with("ray 0: "), "{of_ray}");
}

/// Vertices and indices give the structure of their triangles; an index beyond the vertices is an error.
#[test]
fn meshes_are_built_from_vertices_and_indices() {
    let vertices = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let triangles = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let bvh = Bvh::from_mesh(&vertices, &triangles).expect("valid");
    assert!(bvh.closedness().is_closed());
    let of_glam = Bvh::from_mesh(&vertices.map(DVec3::from), &triangles).expect("valid");
    let corners =
        triangles.map(|triangle| Primitive::from(triangle.map(|i| DVec3::from(vertices[i as usize]))));
    let of_corners = Bvh::new(corners).expect("finite");
    let traversal = &mut Traversal::default();
    let ray = bvh.ray([0.1, 0.2, -1.0], [0.0, 0.0, 1.0]).expect("finite");
    let hit = bvh.closest_hit(&ray, traversal);
    assert_eq!(hit.map(|hit| (hit.prim.0, hit.t)), Some((0, 1.0)));
    assert_eq!([&of_glam, &of_corners].map(|bvh| bvh.closest_hit(&ray, traversal)), [hit; 2]);
    let error = Bvh::from_mesh(&vertices, &[[0, 1, 2], [0, 4, 1]]).err();
    assert_eq!(error, Some(InvalidMesh::Index { triangle: 1, vertex: 4, vertices: 4 }));
    let error = Bvh::from_mesh(&[[0.0; 3], [1.0; 3], [f64::NAN; 3]], &[[0, 1, 2]]).err();
    assert_eq!(error, Some(InvalidMesh::NotFinite(NotFinite::Primitive(0))));
    assert!(Bvh::from_mesh(&[[0.0; 3]; 0], &[]).is_ok());
}

/// A mesh whose vertices are read where they are has the tree of the list of its triangles: the same nodes, and the
/// same primitives, rounded alike, in the same slots.
#[test]
fn a_mesh_has_the_tree_of_its_triangles() {
    let mut numbers = Numbers::new(14);
    let vertices: Vec<DVec3> = (0..500).map(|_| numbers.vector() * 1e3).collect();
    let triangles: Vec<[u32; 3]> = (0..1500).map(|_| [0; 3].map(|_| numbers.below(500) as u32)).collect();
    let of_triangles = || triangles.iter().map(|t| Primitive::from(t.map(|i| vertices[i as usize])));
    for (numerics, preset) in Numerics::ALL.into_iter().flat_map(|n| Preset::ALL.map(|preset| (n, preset))) {
        let [of_list, of_mesh] = [
            Bvh::with(of_triangles(), preset, numerics).expect("finite"),
            Bvh::from_mesh_with(&vertices, &triangles, preset, numerics).expect("valid"),
        ]
        .map(|bvh| {
            let mut slots = Vec::new();
            bvh.accelerator().each_primitive(&mut |id, primitive| slots.push((id, primitive)));
            (slots, bvh.accelerator().quality(), bvh.accelerator().describe().nodes)
        });
        assert!(of_list == of_mesh, "{} {}", numerics.name(), preset.name());
    }
}

/// Squares at the heights 3, 1 and 2, the last of them twice, and a ball from 5 to 7.
#[test]
fn all_hits_are_sorted_by_distance_and_id() {
    let ball = Primitive::from(([0.0, 0.0, 6.0], 1.0));
    let primitives: Vec<Primitive> =
        [square(3.0), square(1.0), square(2.0), square(2.0)].concat().into_iter().chain([ball]).collect();
    for (numerics, preset) in settings() {
        let bvh = Bvh::with(primitives.iter().copied(), preset, numerics).expect("finite");
        let up = [0.0, 0.0, 1.0];
        // Below the diagonal x = y: the first triangle of each square. The ball has its nearer hit alone, at
        // 6 - sqrt(1 - (1/4 + 1/16)) = 6 - sqrt(11) / 4.
        let hits = all(&bvh, [0.5, 0.25, 0.0], up);
        assert_eq!(hits[..4], [(2, 1.0), (4, 2.0), (6, 2.0), (0, 3.0)], "{}", numerics.name());
        assert_eq!((hits.len(), hits[4].0), (5, 8));
        assert!((hits[4].1 - (6.0 - 11f64.sqrt() / 4.0)).abs() < 1e-6, "{}", numerics.name());
        // On the diagonal: both triangles of each square, at equal t.
        let hits = all(&bvh, [0.5, 0.5, 0.0], up);
        let expected = [(2, 1.0), (3, 1.0), (4, 2.0), (5, 2.0), (6, 2.0), (7, 2.0), (0, 3.0), (1, 3.0)];
        assert_eq!(hits[..8], expected, "{}", numerics.name());
        // At a corner of both triangles, backwards, from between the squares; the ball is behind.
        assert_eq!(all(&bvh, [1.0, 1.0, 1.5], [0.0, 0.0, -1.0]), [(2, 0.5), (3, 0.5)]);
        assert_eq!(all(&bvh, [2.0, 0.0, 0.0], up), []);
        // From inside the ball its farther hit is the nearer one in front.
        assert_eq!(all(&bvh, [0.0, 0.0, 6.0], up), [(8, 1.0)]);
    }
}

/// Triangles and balls at random, some of them large, which `best-trace` splits.
fn crowd(numbers: &mut Numbers) -> Vec<Primitive> {
    let mut primitive = |index: usize| {
        let middle = numbers.vector();
        let size = if index.is_multiple_of(50) { 2.0 } else { 0.2 };
        match index % 10 {
            9 => Primitive::from((middle.to_array(), 0.1)),
            _ => Primitive::from([0; 3].map(|_| (middle + numbers.vector() * size).to_array())),
        }
    };
    (0..400).map(&mut primitive).collect()
}

/// A hit without its slot, which differs between structures.
fn bits(hit: &Hit) -> (u64, PrimId, [u64; 2]) {
    (hit.t.to_bits(), hit.prim, hit.barycentrics.map(f64::to_bits))
}

#[test]
fn all_hits_are_those_of_brute_force() {
    let mut numbers = Numbers::new(91);
    let primitives = crowd(&mut numbers);
    for (numerics, preset) in settings() {
        let bvh = Bvh::with(primitives.iter().copied(), preset, numerics).expect("finite");
        let rounded = primitives.iter().filter_map(|primitive| primitive.rounded(numerics.precision()));
        let slots = (0..).zip(rounded).map(|(id, primitive)| Slot { primitive, id: PrimId(id) });
        let oracle = build(slots, Layout::BruteForce, numerics);
        let (mut traversal, mut count) = (Traversal::default(), 0);
        for index in 0..300 {
            let origin = numbers.vector() * 2.0;
            // Through the middle of the crowd.
            let direction = numbers.vector() * 0.5 - origin;
            let t_max = if index % 3 == 0 { f64::INFINITY } else { 2.0 };
            let ray = bvh.ray_within(origin, direction, t_max).expect("finite");
            let mut expected = Vec::new();
            oracle.all_hits(&ray, &mut expected, &mut traversal);
            // Positive numbers are ordered as their bits are.
            let mut expected: Vec<_> = expected.iter().map(bits).collect();
            expected.sort_unstable();
            let hits = bvh.all_hits(&ray, &mut traversal);
            assert_eq!(
                hits.iter().map(bits).collect::<Vec<_>>(),
                expected,
                "{}, {preset:?}",
                numerics.name()
            );
            let closest = bvh.closest_hit(&ray, &mut traversal);
            assert_eq!(closest.map(|hit| hit.prim), hits.first().map(|hit| hit.prim));
            count += hits.len();
        }
        assert!(count > 300, "{count} hits");
    }
}

#[test]
fn the_normal_is_that_of_the_winding_or_outwards() {
    // 3-4-5: (4, 0, 0) x (0, 4, 3) = (0, -12, 16), of length 20.
    let ramp = Primitive::from([[-1.0, -1.0, 0.0], [3.0, -1.0, 0.0], [-1.0, 3.0, 3.0]]);
    let turned = Primitive::from([[-1.0, -1.0, 0.0], [-1.0, 3.0, 3.0], [3.0, -1.0, 0.0]]);
    let ball = Primitive::from(([0.0, 0.0, 0.0], 5.0));
    let normal = |numerics, primitive, origin: [f64; 3], direction: [f64; 3]| {
        let bvh = Bvh::with([primitive], Preset::default(), numerics).expect("finite");
        let ray = bvh.ray(origin, direction).expect("finite");
        let hit = bvh.closest_hit(&ray, &mut Traversal::default()).expect("a hit");
        bvh.geometric_normal(&ray, &hit)
    };
    let is_near =
        |found: Option<DVec3>, expected: [f64; 3]| found.expect("a normal").distance(expected.into()) < 1e-6;
    for numerics in Numerics::ALL {
        for (origin, direction) in [([0.0, 0.0, 9.0], [0.0, 0.0, -1.0]), ([0.0, 0.0, -9.0], [0.0, 0.0, 1.0])]
        {
            assert!(is_near(normal(numerics, ramp, origin, direction), [0.0, -0.6, 0.8]));
            assert!(is_near(normal(numerics, turned, origin, direction), [0.0, 0.6, -0.8]));
        }
        // At (3, 0, 4) from outside, and from inside.
        assert!(is_near(normal(numerics, ball, [3.0, 0.0, 9.0], [0.0, 0.0, -1.0]), [0.6, 0.0, 0.8]));
        assert!(is_near(normal(numerics, ball, [0.0; 3], [3.0, 0.0, 4.0]), [0.6, 0.0, 0.8]));
    }
    // A triangle without area is hit where exact arithmetic says so, and has no normal.
    let flat = Primitive::from([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]);
    let bvh = Bvh::new([flat]).expect("finite");
    let ray = bvh.ray([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]).expect("finite");
    for hit in bvh.all_hits(&ray, &mut Traversal::default()) {
        assert_eq!(bvh.geometric_normal(&ray, &hit), None);
    }
}

/// A triangle at z = 1, a ball from 2 to 4, and the triangle again, placed at z = 5 and at z = 6.
fn scene() -> Scene {
    let mut scene = Scene::default();
    let material = scene.add_material(Material::Phong(Phong::default()));
    let mesh = Mesh {
        positions: [[-9.0, -9.0, 1.0], [9.0, -9.0, 1.0], [0.0, 9.0, 1.0]].map(DVec3::from).into(),
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    let shared = Arc::new(mesh.clone());
    let placed = |z: f64| {
        let placement = Placement::new(DMat4::from_translation(DVec3::Z * z));
        Shape::Placed(Placed::new(Arc::clone(&shared), placement))
    };
    let ball = SceneSphere { centre: DVec3::Z * 3.0, radius: 1.0 };
    for shape in [Shape::Mesh(mesh), Shape::Analytic(ball.into()), placed(4.0), placed(5.0)] {
        scene.objects.push(Object { name: String::new(), input: 0, material, shape });
    }
    scene
}

#[test]
fn a_scene_is_queried_by_the_numbers_of_its_primitives() {
    let scene = scene();
    assert_eq!(scene.primitives().count(), scene.primitive_count());
    let up = [0.0, 0.0, 1.0];
    let expected = [(0, 1.0), (1, 2.0), (2, 5.0), (3, 6.0)];
    assert_eq!(all(&scene.bvh().expect("finite"), [0.0; 3], up), expected);
    let objects = (0..5).map(|prim| scene.object_of(PrimId(prim))).collect::<Vec<_>>();
    assert_eq!(objects, [Some((0, 0)), Some((1, 0)), Some((2, 0)), Some((3, 0)), None]);
    // The tier is the scene's.
    for numerics in Numerics::ALL {
        let mut scene = scene.clone();
        scene.picture.numerics = Some(numerics);
        assert_eq!(scene.bvh().expect("finite").accelerator().numerics(), numerics);
    }
    // A picture's structure hits the same.
    let world = World::prepare(scene, ColourPipeline::Linear, Layout::default(), Numerics::default());
    let ray = Numerics::default().ray_precision().ray(DVec3::ZERO, DVec3::Z, 0.0, f64::INFINITY);
    let mut hits = Vec::new();
    world.accelerator.all_hits(&ray, &mut hits, &mut Traversal::default());
    let mut hits: Vec<_> = hits.into_iter().map(|hit| (hit.prim.0, hit.t)).collect();
    hits.sort_unstable_by_key(|hit| hit.0);
    assert_eq!(hits, expected);
    // An unchecked scene is an error by the number of its primitive.
    let mut broken = scene_with_nan();
    assert_eq!(broken.bvh().err(), Some(NotFinite::Primitive(1)));
    broken.objects.pop();
    assert!(broken.bvh().is_ok());
}

fn scene_with_nan() -> Scene {
    let mut scene = scene();
    scene.objects.truncate(1);
    let mut object = scene.objects[0].clone();
    let mut positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
    positions[2].x = f64::NAN;
    object.shape = Shape::Mesh(Mesh { positions, triangles: vec![[0, 1, 2]], ..Mesh::default() });
    scene.objects.push(object);
    scene
}

/// Triangles keep their corners: what is queried is what the scene has, in f64.
#[test]
fn primitives_of_a_scene_are_not_rounded() {
    let corners = [[0.1, 0.2, 0.3], [1.1, 0.2, 0.3], [0.1, 1.2, 0.3]].map(DVec3::from);
    let mesh = Mesh { positions: corners.into(), triangles: vec![[0, 1, 2]], ..Mesh::default() };
    assert_eq!(Shape::Mesh(mesh).primitives().collect::<Vec<_>>(), [Primitive::Triangle(Triangle(corners))]);
}
