//! Instanced meshes give the same hits and pictures, bit for bit, as copies of the mesh with transformed vertices, in
//! every tier and for all kinds of transforms.

use std::sync::Arc;

use crate::common::hard::rays::{At, targets};
use crate::common::hard::results::{Faults, RayResults, check_results};
use crate::common::hard::{Corners, meshes, times_factor};
use crate::common::picture::{bits, prepare};
use crate::common::places::{FAMILIES, Family};
use crate::common::{Numbers, picture};
use glam::{DMat4, DQuat, DVec2, DVec3, DVec4};
use kiln::bvh::detail::{
    HitBuffer, Instance, Layout, MeshSpace, RayBuffer, build_with_instances, can_be_instance,
};
use kiln::bvh::{Hit, Numerics, Preset, PrimId, Ray, SlotId, Sphere, Traversal};
use kiln::effects::whitted::{glaze, shadows};
use kiln::effects::{PlanSettings, RayKind};
use kiln::film::ColourPipeline;
use kiln::scene::{
    Attribute, DecodedImage, Glaze, ImageId, Material, MaterialId, Mesh, Object, Phong, Placed, Placement,
    Scene, Shape, Step, Texture, TextureSampler, TextureSlot, Textures,
};
use kiln::world::World;

/// Triangles as a mesh, corners at the same point shared.
fn mesh_of(triangles: &[Corners]) -> Mesh {
    let mut index = std::collections::HashMap::new();
    let mut positions = Vec::new();
    let mut corner = |p: DVec3| {
        *index.entry(p.to_array().map(f64::to_bits)).or_insert_with(|| {
            positions.push(p);
            positions.len() as u32 - 1
        })
    };
    let triangles = triangles.iter().map(|t| t.map(&mut corner)).collect();
    Mesh { positions, triangles, ..Mesh::default() }
}

/// A ball with normals, texture coordinates and colours of its own.
fn decorated(level: u32) -> Mesh {
    let mut mesh = mesh_of(&meshes::icosphere(level, DVec3::new(0.1, -0.3, 0.2), 1.0));
    let values =
        |f: fn(DVec3) -> DVec3| Some(Attribute::per_position(mesh.positions.iter().map(|&p| f(p)).collect()));
    let (normals, colours) = (values(|p| p * 3.0), values(|p| p.abs() / 2.0));
    (mesh.normals, mesh.colours) = (normals, colours);
    mesh.uvs = vec![Attribute::per_position(mesh.positions.iter().map(|p| DVec2::new(p.x, p.y)).collect())];
    let tangent = |p: &DVec3| DVec4::new(p.z, 0.0, -p.x, if p.y < 0.0 { -1.0 } else { 1.0 });
    mesh.tangents = Some(Attribute::per_position(mesh.positions.iter().map(tangent).collect()));
    mesh
}

fn object(shape: Shape) -> Object {
    Object { name: "it".into(), input: 0, material: MaterialId(0), shape }
}

fn scene_of(shapes: impl IntoIterator<Item = Shape>) -> Scene {
    let texel = |i: u32| [i * 37 % 256, i * 101 % 256, 128 + i % 128].map(|c| c as u8);
    let image = DecodedImage { name: "it".into(), width: 9, height: 6, pixels: (0..54).map(texel).collect() };
    let texture = Texture { image: ImageId(0), sampler: TextureSampler::default(), coordinates: 0 };
    let slots = [TextureSlot::BaseColour, TextureSlot::Normal];
    let mut textures = Textures::from(slots.map(|slot| (slot, Some(texture))));
    textures.normal_scale = 0.5;
    let phong = Phong { specular: 0.5, glaze: Some(Glaze::default()), textures, ..Phong::default() };
    Scene {
        materials: vec![Material::Phong(phong)],
        images: vec![image],
        objects: shapes.into_iter().map(object).collect(),
        ..Scene::default()
    }
}

/// A mesh in all of these places, between a sphere and a mesh that is not shared.
fn scene_with(mesh: Mesh, places: &[Placement]) -> Scene {
    let sphere = Shape::Analytic(Sphere { centre: DVec3::new(0.0, 0.5, -2.0), radius: 0.5 }.into());
    let ground = [[-9.0, -1.5, -9.0], [9.0, -1.5, -9.0], [0.0, -1.5, 9.0]].map(DVec3::from);
    let ground = Shape::Mesh(mesh_of(&[ground]));
    let mesh = Arc::new(mesh);
    let shared = places.iter().map(|place| Shape::Placed(Placed::new(mesh.clone(), place.clone())));
    scene_of([sphere].into_iter().chain(shared).chain([ground]))
}

fn world(scene: &Scene, structure: Layout, numerics: Numerics) -> World {
    World::prepare(scene.clone(), ColourPipeline::Linear, structure, numerics)
}

/// The triangles of a scene as its copies have them.
fn copies(scene: &Scene) -> Vec<Corners> {
    let mut copied = scene.clone();
    copied.bake(|_| true);
    let meshes = copied.objects.iter().filter_map(|object| object.shape.mesh());
    meshes
        .flat_map(|m| m.triangles.iter().map(|t| t.map(|i| m.positions[i as usize])).collect::<Vec<_>>())
        .collect()
}

/// Rays that aim at corners, edges and insides from around the scene and from close by, some that end there; and all
/// directions along axes.
fn rays(scene: &Scene, count: usize, numerics: Numerics, numbers: &mut Numbers) -> Vec<Ray> {
    let precision = numerics.ray_precision();
    let triangles = copies(scene);
    let (min, max) = scene.bounds().expect("something to see");
    let (centre, half) = ((min + max) / 2.0, (max - min).max_element() / 2.0);
    let mut rays = Vec::new();
    for (i, target) in targets(&triangles, &At::ALL, count, numbers).into_iter().enumerate() {
        let corners = triangles[numbers.below(triangles.len())];
        let near = (corners[1] - corners[0]).length();
        let from = match i % 4 {
            0 => centre + numbers.vector() * half * 2.0,
            1 => target + numbers.vector() * near * 3.0,
            2 => target + DVec3::AXES[i % 3] * numbers.signed() * half,
            _ => corners[0].lerp(corners[1], numbers.unit()),
        };
        let direction = target - from;
        if direction == DVec3::ZERO {
            continue;
        }
        let t_max = if i.is_multiple_of(5) {
            direction.length() * (1.0 + numbers.signed() * 1e-7)
        } else {
            f64::INFINITY
        };
        rays.push(precision.ray(from, direction.normalize(), 0.0, t_max));
    }
    rays
}

/// Every tree with instances against every copy tested by itself: closest hits, whether there are any, and all of them.
fn same_answers(what: &str, scene: &Scene, rays: usize, tiers: &[Numerics]) {
    for &numerics in tiers {
        let rays = self::rays(scene, rays, numerics, &mut Numbers::new(29));
        let flat = world(scene, Layout::BruteForce, numerics);
        let expected = RayResults::to_all(&*flat.accelerator, &rays);
        let hits: usize = expected.iter().map(|answer| answer.all.len()).sum();
        assert!(hits > rays.len() / 8, "{what}: {hits} hits");
        for layout in [Layout::Wide, Layout::Portable].iter().flat_map(|layout| Preset::ALL.map(layout)) {
            let shared = world(scene, layout, numerics);
            assert_eq!(shared.accelerator.describe().layout, "instances", "{what}");
            assert_eq!(shared.too_small, flat.too_small, "{what}");
            let found = RayResults::to_all(&*shared.accelerator, &rays);
            for ((found, expected), ray) in found.iter().zip(&expected).zip(&rays) {
                assert!(
                    found == expected,
                    "{what}, {}: {}\n{ray:?}",
                    numerics.name(),
                    found.unlike(expected)
                );
            }
            same_surfaces(&shared, &flat, &rays);
        }
    }
}

/// In batches, and with all that is interpolated: points, normals, tints.
fn same_surfaces(shared: &World, flat: &World, rays: &[Ray]) {
    let mut traversal = Traversal::default();
    let mut closest = |world: &World| {
        let (mut hits, mut occluded) = (HitBuffer::default(), Vec::new());
        for batch in RayBuffer::from(rays).rays().chunks(64) {
            world.accelerator.closest_hits(batch, &mut hits, &mut traversal);
            world.accelerator.are_occluded(batch, &mut occluded, &mut traversal);
        }
        let surface = |(ray, hit): (&Ray, Option<Hit>)| {
            hit.as_ref().map(|hit| {
                let mut surface = world.interaction(ray, hit);
                let smooth = world.smooth_point(&surface);
                // Slots are those of the world's own structure.
                surface.hit.slot = SlotId::new(0);
                (hit.prim, surface.object, format!("{surface:?} {smooth:?}"))
            })
        };
        (rays.iter().zip(hits.iter()).map(surface).collect::<Vec<_>>(), occluded)
    };
    assert!(closest(shared) == closest(flat));
}

#[test]
fn placed_meshes_are_hit_as_their_copies_are() {
    for family in FAMILIES {
        let mut numbers = Numbers::new(family as u64);
        let places: Vec<Placement> = (0..26).map(|i| family.place(i, &mut numbers)).collect();
        let scene = scene_with(decorated(2), &places);
        same_answers(&format!("{family:?}"), &scene, times_factor(400), &Numerics::STRICT);
    }
}

/// Any placement: sizes over twelve powers of ten, mirrored, as thin as 1e-7 of its size along an axis of the mesh or
/// of the world, turned, and up to 1e5 sizes from the origin.
fn any_placement(numbers: &mut Numbers) -> Placement {
    let size = 10f64.powf(6.0 * numbers.signed());
    let mut thin = DVec3::ONE;
    thin[numbers.below(3)] = numbers.one_of(&[1.0, -1.0, 1e-2, -1e-4, 1e-7]);
    let [before, after] = numbers.one_of(&[[thin, DVec3::ONE], [DVec3::ONE, thin]]);
    let turn = DQuat::from_axis_angle(
        numbers.direction(),
        numbers.one_of(&[0.0, 1.0, 1.0]) * 4.0 * numbers.signed(),
    );
    let far = numbers.one_of(&[0.0, 1.0, 1e2, 1e5]);
    Placement::new(
        DMat4::from_translation(numbers.vector() * far * size)
            * DMat4::from_scale(after * size)
            * DMat4::from_quat(turn)
            * DMat4::from_scale(before),
    )
}

/// Rays that graze triangles: along their planes, up to a slope, at corners, edges and insides, from within and from far
/// away; some begin or end near what they aim at, some have directions that are not of length 1.
fn grazing(triangles: &[Corners], count: usize, numerics: Numerics, numbers: &mut Numbers) -> Vec<Ray> {
    let slopes = [0.0, 1e-17, -1e-12, 1e-9, -1e-7, 1e-5, -1e-3, 0.1];
    let ray = |i: usize| {
        let corners = triangles[numbers.below(triangles.len())];
        let [a, b, c] = corners;
        let weights = numbers.one_of(&[[1.0, 0.0, 0.0], [0.3, 0.7, 0.0], [0.25, 0.25, 0.5]]);
        let target = a * weights[0] + b * weights[1] + c * weights[2];
        let (along, size) = ((b - a) * numbers.signed() + (c - a) * numbers.signed(), (b - a).length());
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let mut direction = along.normalize_or(DVec3::X) + normal * numbers.one_of(&slopes);
        if i.is_multiple_of(6) {
            direction[numbers.below(3)] = 0.0;
        }
        let direction = direction.normalize_or(DVec3::Y);
        let away = size * numbers.one_of(&[0.0, 0.1, 3.0, 1e3, 1e6]);
        let near = |numbers: &mut Numbers| (away * (1.0 + 1e-7 * numbers.signed())).max(0.0);
        let t_min = if i.is_multiple_of(7) { near(numbers) * 0.999_999 } else { 0.0 };
        let t_max = if i.is_multiple_of(5) { near(numbers) + size * 1e-3 } else { f64::INFINITY };
        let length = if i.is_multiple_of(11) { numbers.one_of(&[1e-6, 0.3, 1e6]) } else { 1.0 };
        let origin = target - direction * away;
        numerics.ray_precision().ray(origin, direction * length, t_min / length, t_max / length)
    };
    (0..count).map(ray).collect()
}

/// All queries over instances in any placement give the bits of brute force over their copies.
#[test]
fn grazing_rays_hit_any_placement_as_its_copy() {
    let ball = mesh_of(&meshes::icosphere(1, DVec3::new(0.1, -0.3, 0.2), 1.0));
    let slivers = mesh_of(&meshes::slivers(40, 1e-5, DVec3::splat(0.3), 3));
    let meshes =
        [ball, slivers].map(|mesh| (MeshSpace::of(&mesh).expect("it has an extent"), Arc::new(mesh)));
    let (mut placed, mut hit, mut aimed) = ([0; 2], 0, 0);
    for seed in 0..times_factor(40) as u64 {
        let mut numbers = Numbers::new(1000 + seed);
        let any: Vec<(MeshSpace, Placed)> = (0..4)
            .map(|i| {
                let (space, mesh) = &meshes[i % 2];
                (*space, Placed::new(mesh.clone(), any_placement(&mut numbers)))
            })
            .collect();
        for numerics in Numerics::STRICT {
            let usable: Vec<&Placed> = any
                .iter()
                .filter(|(space, placed)| can_be_instance(placed, space, numerics))
                .map(|(_, placed)| placed)
                .collect();
            placed[0] += any.len();
            placed[1] += usable.len();
            let instances = || {
                let mut first = 0;
                let instance = |placed: &&Placed| {
                    let instance = Instance { placed: (*placed).clone(), first: PrimId(first) };
                    first += placed.triangle_count() as u32;
                    instance
                };
                usable.iter().map(instance).collect()
            };
            let triangles: Vec<Corners> = usable
                .iter()
                .flat_map(|placed| {
                    (0..placed.triangle_count() as u32).map(|triangle| placed.corners_of(triangle))
                })
                .collect();
            if triangles.is_empty() {
                continue;
            }
            let rays = grazing(&triangles, 300, numerics, &mut numbers);
            let over = |layout| build_with_instances([], instances(), layout, numerics);
            let expected = RayResults::to_all(&*over(Layout::BruteForce), &rays);
            hit += expected.iter().filter(|results| results.occluded).count();
            aimed += rays.len();
            for layout in [Layout::default(), Layout::Portable(Preset::BestTrace)] {
                let tree = over(layout);
                assert_eq!(tree.describe().layout, "instances");
                let mut faults = Faults::new(format!("{seed}, {}, {layout:?}", numerics.name()));
                check_results("instances", &*tree, &rays, &expected, &mut faults);
                faults.none();
            }
        }
    }
    // Most can be instances, and rays within planes, which miss, are the minority.
    assert!(placed[1] * 2 > placed[0] && hit * 4 > aimed, "{placed:?}, {hit} of {aimed}");
}

#[test]
fn hard_meshes_are_hit_as_their_copies_are() {
    let hard: [(&str, Vec<Corners>); 6] = [
        ("slivers", meshes::slivers(60, 1e-6, DVec3::splat(0.3), 3)),
        ("fan", meshes::fan(90)),
        ("bicone", meshes::bicone(90)),
        ("cube", meshes::cube(3)),
        ("tiles, twice each", meshes::doubled_tiles(6)),
        ("thin boxes", meshes::thin_boxes(8, 4)),
    ];
    for (name, triangles) in hard {
        for family in [Family::Rows, Family::Turned, Family::Skewed] {
            let mut numbers = Numbers::new(17);
            let places: Vec<Placement> = (0..9).map(|i| family.place(i, &mut numbers)).collect();
            let scene = scene_with(mesh_of(&triangles), &places);
            same_answers(&format!("{name}, {family:?}"), &scene, times_factor(300), &Numerics::STRICT);
        }
    }
}

#[test]
fn what_loses_its_area_in_one_place_is_not_hit_there() {
    // A square and a needle of width 1e-5 on its edge. A thousand sizes off, f32 steps are 6e-5: the needle is a line.
    let [a, b, c, d] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]].map(DVec3::from);
    let tip = DVec3::new(0.5, 1.0 + 1e-5, 0.0);
    let mesh = mesh_of(&[[a, b, c], [a, c, d], [d, c, tip]]);
    let place = |x: f64| Placement::new(DMat4::from_translation(DVec3::new(x, 1000.0, 0.0)));
    let places: Vec<Placement> = [0.0, 2.0, 4.0].map(place).into();
    let mesh = Arc::new(mesh);
    let scene = scene_of(places.into_iter().map(|place| Shape::Placed(Placed::new(mesh.clone(), place))));
    same_answers("needles", &scene, 400, &Numerics::STRICT);
}

#[test]
fn nothing_gets_out_of_a_closed_mesh_in_any_place() {
    let ball = meshes::icosphere(3, DVec3::ZERO, 1.0);
    for family in FAMILIES {
        if matches!(family, Family::Squeezed | Family::Lost) {
            // Of these f32 makes something that has no inside.
            continue;
        }
        let mut numbers = Numbers::new(5);
        for i in 0..10 {
            let placement = family.place(i, &mut numbers);
            let scene = scene_of([Shape::Placed(Placed::new(Arc::new(mesh_of(&ball)), placement.clone()))]);
            let corners = copies(&scene);
            let middle = placement.point(DVec3::ZERO);
            let aims = targets(&corners, &At::SHARED, times_factor(400), &mut numbers);
            for numerics in [Numerics::Watertight, Numerics::Double, Numerics::Exact] {
                let world = world(&scene, Layout::default(), numerics);
                assert_eq!(world.accelerator.describe().layout, "instances");
                let mut traversal = Traversal::default();
                for target in &aims {
                    let ray = numerics.ray_precision().ray(
                        middle,
                        (target - middle).normalize(),
                        0.0,
                        f64::INFINITY,
                    );
                    let hit = world.accelerator.closest_hit(&ray, &mut traversal);
                    assert!(hit.is_some(), "{family:?}, {}: {ray:?}", numerics.name());
                }
            }
        }
    }
}

#[test]
fn what_cannot_be_brought_back_is_copied() {
    // Flat: no ray finds the way back.
    let place = Placement::new(DMat4::from_rotation_x(0.5) * DMat4::from_scale(DVec3::new(1.0, 1.0, 0.0)));
    let scene = scene_with(mesh_of(&meshes::icosphere(1, DVec3::ZERO, 1.0)), &[place.clone(), place]);
    for numerics in Numerics::STRICT {
        let [shared, flat] = [Layout::default(), Layout::BruteForce].map(|s| world(&scene, s, numerics));
        assert_ne!(shared.accelerator.describe().layout, "instances");
        let rays = rays(&scene, 400, numerics, &mut Numbers::new(8));
        let answers = |world: &World| RayResults::to_all(&*world.accelerator, &rays);
        assert!(answers(&shared) == answers(&flat));
    }
}

#[test]
fn pictures_are_those_of_the_copies() {
    let mut numbers = Numbers::new(12);
    let places: Vec<Placement> = (0..30).map(|i| Family::Turned.place(i, &mut numbers)).collect();
    let mut shared = scene_with(decorated(2), &places);
    picture::equip(&mut shared);
    let mut copied = shared.clone();
    copied.bake(|_| true);
    let size = [96, 64];
    let mut seen = Vec::new();
    for numerics in Numerics::STRICT {
        let [shared, copied] = [&shared, &copied].map(|scene| prepare(scene.clone(), size, numerics));
        assert_eq!(shared.world.accelerator.describe().layout, "instances");
        let [(shared, statistics), (copied, _)] = [shared, copied].map(|p| p.render(PlanSettings::default()));
        assert!(bits(&shared, size) == bits(&copied, size), "{}", numerics.name());
        // Shadows, the shadow line and the mirror are in it, and pictures, which tilt normals, too.
        let on = |effect: &str| {
            statistics.effect_costs.iter().any(|cost| cost.effect.name() == effect && cost.stages > 0)
        };
        assert!(on("textures") && on("normal-maps"));
        let hits = [RayKind::PRIMARY, shadows::RAYS, glaze::RAYS].map(|kind| statistics.rays(kind).hit);
        assert!(hits.iter().all(|&hits| hits > 0), "{:?}", statistics.rays);
        seen.push(bits(&shared, size));
    }
    assert!(seen[0].iter().any(|pixel| *pixel != seen[0][0]));
}

#[test]
fn far_and_extreme_scenes_are_brought_into_range_alike() {
    for (scale, far) in [(1.0, 1e7), (1e-14, 0.0), (1e15, 0.0)] {
        let mut numbers = Numbers::new(21);
        let places: Vec<Placement> = (0..12)
            .map(|i| {
                let mut placement = Family::Turned.place(i, &mut numbers);
                let map = DMat4::from_translation(DVec3::splat(far)) * DMat4::from_scale(DVec3::splat(scale));
                placement.then(Step::Affine(map));
                placement
            })
            .collect();
        let mesh = Arc::new(decorated(2));
        let mut shared = scene_of(places.into_iter().map(|p| Shape::Placed(Placed::new(mesh.clone(), p))));
        let mut copied = shared.clone();
        copied.bake(|_| true);
        picture::equip(&mut shared);
        picture::equip(&mut copied);
        assert_eq!(shared.cameras, copied.cameras);
        for numerics in [Numerics::Watertight, Numerics::Double] {
            let size = [48, 48];
            let [shared, copied] = [&shared, &copied].map(|scene| prepare(scene.clone(), size, numerics));
            assert_eq!(shared.world.accelerator.describe().layout, "instances");
            let [shared, copied] = [shared, copied].map(|p| bits(&p.render(PlanSettings::default()).0, size));
            assert!(shared == copied && shared.iter().any(|pixel| *pixel != shared[0]), "{scale} {far}");
        }
    }
}

#[test]
fn places_cost_no_triangles() {
    // 20,480 triangles at 16 bytes, 10,242 corners at 24, nodes of 32 bytes of which there are less than two a
    // triangle; and for each of 10,000 places at most 1 KiB. As copies, 204,800,000 triangles of 36 bytes are 7 GB.
    let mesh = Arc::new(mesh_of(&meshes::icosphere(5, DVec3::ZERO, 1.0)));
    let place = |i: u32| {
        let at = DVec3::new(f64::from(i % 100), 0.0, f64::from(i / 100)) * 3.0;
        Shape::Placed(Placed::new(mesh.clone(), Placement::new(DMat4::from_translation(at))))
    };
    let scene = scene_of((0..10_000).map(place));
    assert_eq!((scene.primitive_count(), mesh.triangles.len()), (204_800_000, 20_480));
    let world = world(&scene, Layout::default(), Numerics::Watertight);
    let description = world.accelerator.describe();
    assert_eq!((description.layout, description.slots), ("instances", 20_480));
    assert!(description.bytes < 20_480 * (16 + 2 * 32) + 10_242 * 24 + 10_000 * 1024, "{description:?}");
    assert_eq!((world.primitive_count(), world.object_of(PrimId(204_799_999))), (204_800_000, 9_999));
}
