//! Secondary rays (E2-E6; `hard_lit.rs` has E1) and smooth normals (K1): no self-shadowing, no light through walls.

use std::sync::Arc;

use crate::common::hard::{meshes, times_factor};
use crate::common::picture::{parse, prepare};
use crate::common::{Numbers, barycentrics_on_borders};
use glam::{DMat3, DMat4, DQuat, DVec3};
use kiln::bvh::detail::{
    Accelerator, EDGE_DISTANCE, HitBuffer, Layout, ORIGIN_OFFSET, RayBuffer, Slot, SurfacePoint, build,
    edge_distance,
};
use kiln::bvh::{Numerics, PrimId, Primitive, Ray, Traversal, Triangle};
use kiln::effects::whitted::glaze::mirrored_ray;
use kiln::effects::{PlanSettings, shadow_ray, terminator};
use kiln::film::ColourPipeline;
use kiln::scene::{Attribute, Mesh, Placed, Placement, Scene, Shape, Transport};
use kiln::shading::LightSample;
use kiln::world::World;

fn slots(triangles: &[[DVec3; 3]]) -> Vec<Slot> {
    let slot =
        |(id, t): (u32, &[DVec3; 3])| Slot { primitive: Primitive::Triangle(Triangle(*t)), id: PrimId(id) };
    (0..).zip(triangles).map(slot).collect()
}

fn tree(triangles: &[[DVec3; 3]], numerics: Numerics) -> Box<dyn Accelerator> {
    build(slots(triangles), Layout::default(), numerics)
}

/// An icosphere of f32 corners.
fn icosphere(level: u32, centre: DVec3, radius: f64) -> Vec<[DVec3; 3]> {
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    let corners: Vec<DVec3> = [(0.0, 1.0, g), (1.0, g, 0.0), (g, 0.0, 1.0)]
        .into_iter()
        .flat_map(|(x, y, z)| {
            [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)].map(|(s, t)| {
                // The component 0 stays, the other two take the signs.
                let (a, b) = (s, t);
                if x == 0.0 {
                    DVec3::new(0.0, a * y, b * z)
                } else if z == 0.0 {
                    DVec3::new(a * x, b * y, 0.0)
                } else {
                    DVec3::new(a * x, 0.0, b * z)
                }
            })
        })
        .map(DVec3::normalize)
        .collect();
    // Faces: triples of corners at the least distance from one another.
    let edge = corners[1..].iter().map(|c| c.distance(corners[0])).fold(f64::INFINITY, f64::min) * 1.01;
    let near = |a: usize, b: usize| corners[a].distance(corners[b]) < edge;
    let mut faces = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(a, c) {
                    faces.push([corners[a], corners[b], corners[c]]);
                }
            }
        }
    }
    assert_eq!(faces.len(), 20);
    for _ in 0..level {
        faces = faces
            .into_iter()
            .flat_map(|[a, b, c]| {
                let [d, e, f] = [a + b, b + c, c + a].map(DVec3::normalize);
                [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
            })
            .collect();
    }
    let place = |p: DVec3| (centre + radius * p).as_vec3().as_dvec3();
    faces.into_iter().map(|face| face.map(place)).collect()
}

/// The surface point of a hit on a triangle.
fn point_on(corners: [DVec3; 3], numbers: &mut Numbers, numerics: Numerics) -> SurfacePoint {
    let (u, v) = (numbers.unit(), numbers.unit());
    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
    SurfacePoint::on_triangle(corners, [1.0 - u - v, u, v], numerics)
}

fn light(direction: DVec3, distance: f64) -> LightSample {
    LightSample { direction, distance, radiance: DVec3::ONE, cosine: 1.0 }
}

/// E2: an icosphere is convex, so a shadow ray from it to a light above the plane of its triangle is not occluded. At
/// three scales and three positions, with lights as low as 1e-3 above the triangle.
#[test]
fn e2_convex_bodies_do_not_shadow_themselves() {
    let mut numbers = Numbers::new(21);
    for (scale, place) in [
        (1.0, 0.0),
        (1.0, 1e3),
        (1.0, 1e5),
        (2f64.powi(-20), 0.0),
        (2f64.powi(20), 0.0),
        (2f64.powi(-20), 1e-3),
    ] {
        let centre = DVec3::new(1.0, -0.4, 0.7) * place;
        let mut triangles = icosphere(5, centre, scale);
        triangles.retain(|t| (t[1] - t[0]).cross(t[2] - t[0]) != DVec3::ZERO);
        for numerics in Numerics::ALL {
            let accelerator = tree(&triangles, numerics);
            let mut shadowed = 0;
            let mut cast = 0;
            for _ in 0..20_000 {
                let corners = triangles[numbers.below(triangles.len())];
                let point = point_on(corners, &mut numbers, numerics);
                let outside = (point.position - centre).normalize();
                let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
                let normal = if normal.dot(outside) < 0.0 { -normal } else { normal };
                let direction = numbers.vector().normalize();
                // Away from the origin, rounding of corners makes some edges concave by more than the elevation of a
                // low light.
                if direction.dot(normal) < 1e-3 || (place > 0.0 && direction.dot(outside) < 0.5) {
                    continue;
                }
                cast += 1;
                let origin = point.origin_towards(normal, numerics);
                let ray = shadow_ray(origin, &light(direction, f64::INFINITY), numerics);
                shadowed += u32::from(accelerator.is_occluded(&ray, &mut Traversal::default()));
            }
            assert!(cast > 4000);
            assert_eq!(shadowed, 0, "of {cast} at {scale}, {place} in {}", numerics.name());
        }
    }
}

/// E3: two parallel walls at a distance of 16, 64 and 200 units in the last place, at random angles: every shadow ray
/// from one to a light behind the other is occluded by the other, and none by the wall that it leaves.
#[test]
fn e3_no_light_leaks_through_close_walls() {
    let mut numbers = Numbers::new(22);
    for numerics in Numerics::ALL {
        for far in [1e2, 1e4, 1e5] {
            for gap in [16.0, 64.0, 200.0] {
                let (mut leaks, mut self_hits, mut tried) = (0, 0, 0);
                for _ in 0..2000 {
                    let at = numbers.vector().normalize() * far;
                    let normal = numbers.vector().normalize();
                    let (u, v) = normal.any_orthonormal_pair();
                    let ulp = f64::from((far as f32).next_up()) - f64::from(far as f32);
                    let single = |p: DVec3| p.as_vec3().as_dvec3();
                    let size = far * 0.5;
                    let wall = |offset: f64| {
                        let corner = |a: f64, b: f64| single(at + size * (a * u + b * v) + offset * normal);
                        [corner(-1.0, -1.0), corner(2.0, -1.0), corner(-1.0, 2.0)]
                    };
                    let (own, other) = (wall(0.0), wall(gap * ulp));
                    let point = point_on(own, &mut numbers, numerics);
                    let direction = (normal + 0.5 * numbers.vector()).normalize();
                    // Rounding moves the corners: the distance of the walls where the ray crosses is measured, in f64.
                    let plane = |w: [DVec3; 3]| ((w[1] - w[0]).cross(w[2] - w[0]).normalize(), w[0]);
                    let (n, p) = plane(other);
                    let distance = (p - point.position).dot(n) * n.dot(normal).signum();
                    let (own_normal, _) = plane(own);
                    let own_normal = own_normal * own_normal.dot(normal).signum();
                    // The offset of a tier's ray origins: at most two f32 steps, and in `fast` the error of its test.
                    let error = if numerics == Numerics::Fast { 4.0 * f64::from(f32::EPSILON) } else { 0.0 };
                    let start = error * point.reach.dot(own_normal.abs()) + 4.0 * ulp;
                    if distance < start {
                        continue;
                    }
                    tried += 1;
                    let origin = point.origin_towards(own_normal, numerics);
                    let ray = shadow_ray(origin, &light(direction, 2.0 * far), numerics);
                    let hits = |wall: [DVec3; 3]| {
                        tree(&[wall], numerics).is_occluded(&ray, &mut Traversal::default())
                    };
                    self_hits += u32::from(hits(own));
                    // Only rays that cross the other wall well inside.
                    let t = (p - point.position).dot(n) / direction.dot(n);
                    if t > 0.0 && t < far {
                        leaks += u32::from(!hits(other));
                    }
                }
                assert!(tried > 1000, "{tried} with gap {gap} at {far} in {}", numerics.name());
                assert_eq!(
                    (leaks, self_hits),
                    (0, 0),
                    "leaks and self-hits, gap {gap} at {far} in {}",
                    numerics.name()
                );
            }
        }
    }
}

/// E2: needles of length 1 and of widths down to 1e-8, at random angles: no ray that leaves one hits it again.
#[test]
fn e2_needles_do_not_shadow_themselves() {
    let mut numbers = Numbers::new(25);
    for numerics in [Numerics::Watertight, Numerics::Double, Numerics::Exact] {
        for width in [1e-1, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8] {
            let mut hits = 0;
            for _ in 0..4000 {
                let at = numbers.vector();
                let along = numbers.vector().normalize();
                let across = along.any_orthonormal_vector() * width;
                let corners = [at, at + along, at + along * numbers.unit() + across]
                    .map(|p| if numerics == Numerics::Watertight { p.as_vec3().as_dvec3() } else { p });
                let Some(normal) = (corners[1] - corners[0]).cross(corners[2] - corners[0]).try_normalize()
                else {
                    continue;
                };
                let origin = point_on(corners, &mut numbers, numerics).origin_towards(normal, numerics);
                let direction = numbers.vector().normalize();
                let direction = direction * direction.dot(normal).signum();
                let ray = shadow_ray(origin, &light(direction, f64::INFINITY), numerics);
                hits += u32::from(tree(&[corners], numerics).is_occluded(&ray, &mut Traversal::default()));
            }
            assert_eq!(hits, 0, "width {width} in {}", numerics.name());
        }
    }
}

/// K1: the smooth surface over a triangle, from which shadow rays start, would pass through a roof close above it: the
/// light above the roof must not be visible from there.
#[test]
fn k1_the_smooth_surface_does_not_pass_through_a_roof() {
    let mut scene = parse(
        "[image]\nwidth = 32\nheight = 32\ncolour = \"display\"\n[[camera]]\nposition = [0.1, -0.2, 0.08]\nlook_at = [0, 0, 0]\n\
         vertical_fov = 60\n[ambient]\nintensity = 0\n[material.m]\ncolour = [255, 255, 255]\ndiffuse = 1\nspecular = 0\n\
         [[light]]\ntype = \"directional\"\ndirection = [0, 0, -1]\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\nmaterial = \"m\"\n\
         [[triangles]]\nmaterial = \"m\"\nvertices = [[-9, -9, 0.1], [20, -9, 0.1], [-9, 20, 0.1]]\nindices = [[0, 1, 2]]\n",
    );
    let positions = vec![DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, -1.0, 0.0), DVec3::new(0.0, 1.0, 0.0)];
    let values = positions.iter().map(|p| (p + DVec3::Z).normalize()).collect();
    let normals = Some(Attribute { values, triangles: None });
    scene.objects[0].shape =
        Shape::Mesh(Mesh { positions, triangles: vec![[0, 1, 2]], normals, ..Mesh::default() });
    for numerics in Numerics::ALL {
        let prepared = prepare(scene.clone(), [32, 32], numerics);
        let film = prepared.render(PlanSettings::default()).0;
        let seen = prepared.hits().iter().flatten().filter(|hit| hit.prim == PrimId(0)).count();
        assert!(seen > 100, "the triangle is seen by {seen} pixels");
        let lit = (0..1024u32).filter(|at| film.pixel(at % 32, at / 32)[0] > 0.0).count();
        assert_eq!(lit, 0, "pixels under the roof are lit in {}", numerics.name());
    }
}

/// E4: a light at the shaded point, on the surface, and at the end of the shadow ray: the radiance is finite, and the
/// surface that the light is on does not occlude it.
#[test]
fn e4_the_end_of_a_shadow_ray() {
    let floor = [DVec3::new(-10.0, 0.0, -10.0), DVec3::new(-10.0, 0.0, 30.0), DVec3::new(30.0, 0.0, -10.0)];
    let mut numbers = Numbers::new(23);
    for numerics in Numerics::ALL {
        let accelerator = tree(&[floor], numerics);
        for _ in 0..5000 {
            // From above the floor to a light on it.
            let start = DVec3::new(numbers.unit() * 5.0, 1.0 + numbers.unit(), numbers.unit() * 5.0);
            let lamp = DVec3::new(numbers.unit() * 5.0, 0.0, numbers.unit() * 5.0);
            let to_lamp = lamp - start;
            let origin = start.as_vec3().as_dvec3();
            let sample = light((lamp - origin).normalize(), (lamp - origin).length());
            assert!(to_lamp.is_finite());
            let ray = shadow_ray(origin, &sample, numerics);
            assert!(
                !accelerator.is_occluded(&ray, &mut Traversal::default()),
                "{lamp} from {start}, {}",
                numerics.name()
            );
        }
    }
}

/// E5: reflected rays at grazing angles leave the surface: 10^5 rays per elevation, in f32 and f64.
#[test]
fn e5_mirrored_rays_at_grazing_angles_leave() {
    let mut numbers = Numbers::new(24);
    let scene = parse(
        "[[camera]]\nposition = [0, 0, 9]\nlook_at = [0, 0, 0]\nvertical_fov = 10\n\
         [material.m]\ncolour = [9, 9, 9]\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 2\nmaterial = \"m\"\n",
    );
    for numerics in [Numerics::Watertight, Numerics::Double] {
        let prepared = prepare(scene.clone(), [8, 8], numerics);
        let ray = prepared.rays()[36];
        let hit = prepared.world.accelerator.closest_hit(&ray, &mut Traversal::default()).expect("the ball");
        let mut surface = prepared.world.interaction(&ray, &hit);
        for height in [1e-4, 1e-6, 1e-7, 1e-8, 1e-10] {
            let mut inwards = 0;
            for _ in 0..100_000 {
                let normal = numbers.vector().normalize();
                let along = normal.any_orthonormal_vector();
                surface.geometric_normal = normal;
                surface.shading_normal = normal;
                surface.view = (along + height * numbers.unit() * normal).normalize();
                let mirrored = mirrored_ray(DVec3::ZERO, &surface, numerics.ray_precision());
                inwards += u32::from(mirrored.direction().dot(normal) <= 0.0);
            }
            assert_eq!(inwards, 0, "height {height}, {}", numerics.name());
        }
    }
}

/// E6: two mirrors that face each other at a distance of 1e-3, far from the origin, with many bounces: rendering ends,
/// and every pixel is finite and at most as bright as the colours that the mirrors blend.
#[test]
fn e6_parallel_mirrors_end() {
    for far in [0.0, 1e3, 1e5] {
        let gap = 1e-3;
        let wall = |z: f64| {
            format!(
                "[[triangles]]\nmaterial = \"m\"\nvertices = [[{a}, {a}, {z}], [{b}, {a}, {z}], [{a}, {b}, {z}]]\nindices = [[0, 1, 2]]\n",
                a = far - 1.0,
                b = far + 3.0,
            )
        };
        let toml = format!(
            "[image]\nwidth = 16\nheight = 16\ncolour = \"display\"\n[[camera]]\nposition = [{far}, {far}, {eye}]\n\
             look_at = [{aside}, {far}, {near}]\nvertical_fov = 40\n[ambient]\nintensity = 1\n[material.m]\ncolour = [255, 128, 0]\n\
             ambient = 1\ndiffuse = 0\nspecular = 0\nglaze = {{ weight = 0.5, bounces = 40 }}\n{}{}",
            wall(far),
            wall(far + gap),
            eye = far + gap / 2.0,
            near = far,
            aside = far + gap / 4.0,
        );
        for numerics in Numerics::ALL {
            let prepared = prepare(parse(&toml), [16, 16], numerics);
            let film = prepared.render(PlanSettings::default()).0;
            for at in 0..256u32 {
                let [r, g, b] = film.pixel(at % 16, at / 16);
                assert!(r.is_finite() && r <= 1.0 && g <= 0.502 && b == 0.0, "{r} {g} {b}");
            }
        }
    }
}

/// Each of some tiers, with each transport.
fn by_transports(tiers: &[Numerics]) -> impl Iterator<Item = (Numerics, Transport)> {
    tiers.iter().flat_map(|&tier| Transport::ALL.map(|transport| (tier, transport)))
}

/// K1: an icosphere with the normals of its sphere under a light. With the terminator effect every point with N.L of at
/// least 0.05 is lit; without it some of these are in the mesh's own shadow. Points that both normals turn away from
/// the light are dark in both. By local shading, and by direct light of paths.
#[test]
fn k1_the_terminator_of_a_coarse_smooth_sphere() {
    let triangles = icosphere(2, DVec3::ZERO, 1.0);
    let lamp = DVec3::new(8.0, 3.0, 2.0);
    let scene = |lamp: DVec3| {
        let mut scene = parse(&format!(
            "[image]\nwidth = 160\nheight = 160\ncolour = \"display\"\n[[camera]]\nposition = [0, 0, 9]\nlook_at = [0, 0, 0]\n\
             vertical_fov = 16\n[ambient]\nintensity = 0\n[material.m]\ncolour = [255, 255, 255]\ndiffuse = 1\nspecular = 0\n\
             [[light]]\ntype = \"point\"\nposition = [{}, {}, {}]\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\nmaterial = \"m\"\n",
            lamp.x, lamp.y, lamp.z
        ));
        let positions: Vec<DVec3> = triangles.iter().flatten().copied().collect();
        let corners = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let normals =
            Attribute { values: positions.iter().map(|p| p.normalize()).collect(), triangles: None };
        scene.objects[0].shape =
            Shape::Mesh(Mesh { positions, triangles: corners, normals: Some(normals), ..Mesh::default() });
        scene
    };
    for (numerics, transport) in by_transports(&Numerics::ALL) {
        let prepared = prepare(scene(lamp), [160, 160], numerics);
        let with = Vec::from_iter((transport == Transport::Path).then(|| "path=1".into()));
        let settings = PlanSettings { transport: Some(transport), with, ..PlanSettings::default() };
        let smooth = prepared.render(settings.clone()).0;
        let without = PlanSettings { without: vec!["terminator".into()], ..settings };
        let jagged = prepared.render(without).0;
        let (mut lit, mut shadowed, mut shadowed_without) = (0, 0, 0);
        for ((ray, hit), at) in prepared.rays().iter().zip(prepared.hits()).zip(0u32..) {
            let Some(hit) = hit else { continue };
            let surface = prepared.world.interaction(ray, &hit);
            let to_lamp = (lamp - surface.point.position).normalize();
            let bright = |film: &kiln::film::Film| film.pixel(at % 160, at / 160)[0] > 0.0;
            if surface.shading_normal.dot(to_lamp) > 0.05 {
                lit += 1;
                shadowed += u32::from(!bright(&smooth));
                shadowed_without += u32::from(!bright(&jagged));
            }
            if surface.shading_normal.dot(to_lamp) < 0.0 && surface.geometric_normal.dot(to_lamp) < 0.0 {
                assert!(!bright(&smooth) && !bright(&jagged));
            }
        }
        assert!(lit > 3000 && shadowed_without > 50, "{shadowed_without} of {lit} without");
        assert_eq!(shadowed, 0, "of {lit}, {}, {}", numerics.name(), transport.name());
    }
}

/// The tiers in which secondary rays do not escape from closed meshes.
const CLOSED: [Numerics; 3] = [Numerics::Watertight, Numerics::Double, Numerics::Exact];

/// A closed prism along z over the triangle (0, 0), (1, 0), (cos a, sin a): two walls with a dihedral angle of `angle`
/// at the z axis, the wall between them and two ends.
fn wedge(angle: f64) -> Vec<[DVec3; 3]> {
    let across = [DVec3::ZERO, DVec3::X, DVec3::new(angle.cos(), angle.sin(), 0.0)];
    let [a, b, c] = across.map(|p| p - DVec3::Z);
    let [d, e, f] = across.map(|p| p + DVec3::Z);
    vec![[a, c, b], [d, e, f], [a, b, e], [a, e, d], [b, c, f], [b, f, e], [c, a, d], [c, d, f]]
}

/// A point inside a [`wedge`].
fn middle_of(angle: f64) -> DVec3 {
    DVec3::new((1.0 + angle.cos()) / 3.0, angle.sin() / 3.0, 0.1)
}

/// A world of one closed mesh, or of two instances of it at a distance of 64.
fn closed_world(triangles: &[[DVec3; 3]], numerics: Numerics, structure: Layout, shared: bool) -> World {
    let mesh = Mesh {
        positions: triangles.iter().flatten().copied().collect(),
        triangles: (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        ..Mesh::default()
    };
    let shapes = if shared {
        let mesh = Arc::new(mesh);
        let away = DMat4::from_translation(DVec3::X * 64.0);
        [DMat4::IDENTITY, away]
            .map(|at| Shape::Placed(Placed::new(mesh.clone(), Placement::new(at))))
            .to_vec()
    } else {
        vec![Shape::Mesh(mesh)]
    };
    let scene = Scene::from_iter(shapes);
    World::prepare(scene, ColourPipeline::Linear, structure, numerics)
}

/// A triangle rounded to the precision of a tier.
fn rounded(corners: &[DVec3; 3], numerics: Numerics) -> [DVec3; 3] {
    corners.map(|p| p.map(|c| numerics.precision().round(c)))
}

/// Rays from points on the borders of triangles, on the side that faces `inside`: in directions of all elevations above
/// the triangle, towards corners and edges of the mesh, and to a light outside, at `lamp`.
fn leaving(
    world: &World,
    triangles: &[[DVec3; 3]],
    inside: DVec3,
    lamp: DVec3,
    count: usize,
    numbers: &mut Numbers,
) -> [Vec<Ray>; 2] {
    let numerics = world.numerics();
    let (mut free, mut to_lamp) = (Vec::new(), Vec::new());
    // Consecutive rays start on one triangle, as those of neighbouring pixels do, so that rays to the light form
    // packets.
    for i in 0..count {
        let index = i / 32 % triangles.len();
        let corners = rounded(&triangles[index], numerics);
        let own = SurfacePoint::on_triangle(corners, barycentrics_on_borders(numbers), numerics);
        // Triangles visible from inside only: those that close T-vertices may lie outside, behind their neighbours.
        let Some(way) = (own.position - inside).try_normalize() else { continue };
        let ray = numerics.ray_precision().ray(inside, way, 0.0, f64::INFINITY);
        let hit = world.accelerator.closest_hit(&ray, &mut Traversal::default()).expect("a closed mesh");
        let surface = world.interaction(&ray, &hit);
        let normal = surface.geometric_normal;
        // Exactly on the border, for triangles that cannot lie behind others.
        let [a, b, c] = corners;
        let perimeter = a.distance(b) + b.distance(c) + c.distance(a);
        let inradius = Triangle(corners).normal().length() / perimeter;
        let is_thin = inradius < 2.0 * edge_distance(numerics) * own.reach.max_element();
        let point = if hit.prim == PrimId(index as u32) && !is_thin { own } else { surface.point };
        let origin = point.origin_towards(normal, numerics);
        let direction = match i % 3 {
            0 => numbers.direction(),
            1 => {
                let along = normal.cross(numbers.direction()).normalize_or_zero();
                along + normal * 10f64.powi(-(numbers.below(9) as i32))
            }
            _ => {
                let other = rounded(&triangles[numbers.below(triangles.len())], numerics);
                let barycentrics = barycentrics_on_borders(numbers);
                other[0] * barycentrics[0] + other[1] * barycentrics[1] + other[2] * barycentrics[2] - origin
            }
        };
        let precision = numerics.ray_precision();
        if let Some(direction) = direction.try_normalize().filter(|d| d.dot(normal) > 1e-9) {
            free.push(precision.ray(origin, direction, 0.0, f64::INFINITY));
        }
        let way = lamp - origin;
        if way.dot(normal) > 1e-9 * way.length() {
            to_lamp.push(shadow_ray(origin, &light(way.normalize(), way.length()), numerics));
        }
    }
    [free, to_lamp]
}

/// The number of rays without a hit: traced singly, as a batch of closest hits, and as a batch of occlusion tests.
fn escaped(world: &World, rays: &[Ray]) -> [usize; 3] {
    let (mut traversal, mut hits, mut occluded) = (Traversal::default(), HitBuffer::default(), Vec::new());
    for batch in RayBuffer::from(rays).rays().chunks(256) {
        world.accelerator.closest_hits(batch, &mut hits, &mut traversal);
        world.accelerator.are_occluded(batch, &mut occluded, &mut traversal);
    }
    let single = rays.iter().filter(|ray| world.accelerator.closest_hit(ray, &mut traversal).is_none());
    [
        single.count(),
        hits.iter().filter(|hit| hit.is_none()).count(),
        occluded.iter().filter(|met| !**met).count(),
    ]
}

/// No ray escapes from a closed mesh, in any structure, at any rotation and position of the mesh.
fn nothing_escapes(name: &str, mesh: &[[DVec3; 3]], inside: DVec3, lamp: DVec3, least_size: f64) {
    let mut numbers = Numbers::new(31);
    for (scale, offset) in [(1.0, 0.0), (1.0, 30.0), (1.0, 1e3), (2f64.powi(-20), 0.0), (2f64.powi(20), 0.0)]
    {
        for turned in [false, true] {
            let turn = if turned {
                DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(0.4)
            } else {
                DQuat::IDENTITY
            };
            let place = |p: DVec3| scale * (DMat3::from_quat(turn) * p + offset * DVec3::new(1.0, -0.5, 2.0));
            let triangles: Vec<[DVec3; 3]> = mesh.iter().map(|t| t.map(place)).collect();
            for numerics in CLOSED {
                // With fewer than 64 f32 steps for the mesh's smallest height, rounding of its corners changes its
                // shape.
                if numerics == Numerics::Watertight
                    && (turned || offset > 0.0)
                    && least_size < (1.0 + 2.0 * offset) * 64.0 * f64::from(f32::EPSILON)
                {
                    continue;
                }
                for (structure, shared) in [
                    (Layout::default(), false),
                    (Layout::default(), true),
                    (Layout::Portable(Default::default()), false),
                    (Layout::BruteForce, false),
                ] {
                    // Instances are tested near the origin only: a world far from it would be recentered.
                    if shared && (offset > 0.0 || scale != 1.0) {
                        continue;
                    }
                    let world = closed_world(&triangles, numerics, structure, shared);
                    let count = times_factor(1000);
                    let rays = leaving(&world, &triangles, place(inside), place(lamp), count, &mut numbers);
                    for (kind, rays) in ["free", "shadow"].into_iter().zip(&rays) {
                        let what = format!(
                            "{name}, scale {scale}, offset {offset}, turned: {turned}, {}, {structure:?}, shared: {shared}, {kind}",
                            numerics.name()
                        );
                        assert!(rays.len() > count / 10, "{what}: {} rays", rays.len());
                        assert_eq!(escaped(&world, rays), [0; 3], "{what}: of {}", rays.len());
                    }
                }
            }
        }
    }
}

/// E7: rays that start on the edges and corners of a wedge, at dihedral angles from 90 degrees down to a thousandth.
#[test]
fn e7_nothing_escapes_from_the_edge_of_a_wedge() {
    for degrees in [90.0, 30.0, 5.0, 0.5, 0.05, 0.01, 0.001] {
        let angle = f64::to_radians(degrees);
        let (inside, lamp) = (middle_of(angle), DVec3::new(-1.0, -2.0, 0.3));
        nothing_escapes(&format!("wedge of {degrees} degrees"), &wedge(angle), inside, lamp, angle.sin());
    }
}

/// E7: the same at corners with 3 to 1000 triangles.
#[test]
fn e7_nothing_escapes_from_corners_of_any_valence() {
    for valence in [3, 4, 7, 30, 200, 1000] {
        let lamp = DVec3::new(0.3, 0.2, 1.5);
        nothing_escapes(
            &format!("valence {valence}"),
            &meshes::bicone(valence),
            DVec3::ZERO,
            lamp,
            6.0 / valence as f64,
        );
    }
}

/// E7: the same near T-vertices that triangles without area close.
#[test]
fn e7_nothing_escapes_beside_t_vertices() {
    let lamp = DVec3::new(-1.0, -2.0, 0.3);
    let t_vertices = meshes::with_t_vertices(&wedge(1.0), 7);
    nothing_escapes("T-vertices", &t_vertices, middle_of(1.0), lamp, 0.1);
}

/// E7: the same in rods whose long triangles are thinner than 6 [`edge_distance`] of their length, in the strict tiers
/// with corners in f32 or in f64, so that no point of them is as far as that from all edges.
#[test]
fn e7_nothing_escapes_from_triangles_without_an_interior() {
    let [single, double] = [Numerics::Watertight, Numerics::Double];
    for (width, numerics) in [(4e-7, single), (1e-7, single), (6e-9, double)] {
        let rod: Vec<[DVec3; 3]> = meshes::cube(1)
            .iter()
            .map(|t| t.map(|p| p * DVec3::new(1.0, width / 2.0, width / 2.0)))
            .collect();
        assert!(width < 6.0 * edge_distance(numerics));
        nothing_escapes(
            &format!("rod of width {width}"),
            &rod,
            DVec3::ZERO,
            DVec3::new(0.3, 2.0, 1.5),
            width,
        );
    }
}

/// E7: wedges with vertex normals whose smooth surface bulges inwards, seen from inside: shadow rays start on the
/// smooth surface, and the light outside reaches no point.
#[test]
fn e7_the_smooth_surface_of_a_wedge_stays_inside() {
    for degrees in [90.0, 30.0, 5.0] {
        let angle = f64::to_radians(degrees);
        let (triangles, inside) = (wedge(angle), middle_of(angle));
        let normals = triangles.iter().flat_map(|&corners| {
            let normal = Triangle(corners).unit_normal().expect("an area");
            let normal = normal * (inside - corners[0]).dot(normal).signum();
            let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            corners.map(|corner| (normal + 0.5 * (corner - middle)).normalize())
        });
        let mesh = Mesh {
            positions: triangles.iter().flatten().copied().collect(),
            triangles: (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            normals: Some(Attribute { values: normals.collect(), triangles: None }),
            ..Mesh::default()
        };
        // The rows of pixels cross the edge along z, and its ends.
        for target in [[0.0, 0.0, 0.1], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]] {
            let mut scene = parse(&format!(
                "[image]\nwidth = 48\nheight = 48\ncolour = \"display\"\n[[camera]]\nposition = {:?}\nlook_at = {target:?}\n\
                 up = [0.3, 1, 0.2]\nvertical_fov = 40\n[ambient]\nintensity = 0\n[material.m]\ncolour = [255, 255, 255]\n\
                 diffuse = 1\nspecular = 0\n[[light]]\ntype = \"point\"\nposition = [-1, -2, 0.3]\n[[sphere]]\n\
                 centre = [0, 0, 0]\nradius = 1\nmaterial = \"m\"\n",
                inside.to_array()
            ));
            scene.objects[0].shape = Shape::Mesh(mesh.clone());
            for (numerics, transport) in by_transports(&CLOSED) {
                let prepared = prepare(scene.clone(), [48, 48], numerics);
                let settings = PlanSettings { transport: Some(transport), ..PlanSettings::default() };
                let (film, statistics) = prepared.render(settings);
                let lit = (0..48 * 48u32).filter(|at| film.pixel(at % 48, at / 48)[0] > 0.0).count();
                assert_eq!(lit, 0, "{degrees} degrees to {target:?}, {}, {transport:?}", numerics.name());
                let lifted = statistics.rays(terminator::RAYS);
                assert!(lifted.cast > 100 && lifted.hit > 0, "{degrees} degrees: {lifted:?}");
            }
        }
    }
}

/// E7: inside an L-shaped mesh, rays along the x and y axes and their diagonals hit its reflex edge exactly, where one
/// of its two faces is hidden by the other. Whichever of the two is reported, no secondary ray escapes.
#[test]
fn e7_nothing_escapes_from_an_edge_that_hides_a_face() {
    // Three square cells of side 2 in an L, extruded from z = -1 to 1; the edge is at the origin.
    let outline = [[0, 0], [0, 2], [-2, 2], [-2, 0], [-2, -2], [0, -2], [2, -2], [2, 0]]
        .map(|[x, y]| [x as f64, y as f64]);
    let at = |i: usize, z: f64| DVec3::new(outline[i % 8][0], outline[i % 8][1], z);
    let mut triangles: Vec<[DVec3; 3]> = Vec::new();
    for i in 0..8 {
        let [a, b, c, d] = [at(i, -1.0), at(i + 1, -1.0), at(i + 1, 1.0), at(i, 1.0)];
        triangles.extend([[a, b, c], [a, c, d]]);
        // Floor and ceiling: a fan around the origin, without the walls that start there.
        if (1..7).contains(&i) {
            triangles.extend([-1.0, 1.0].map(|z| [at(0, z), at(i, z), at(i + 1, z)]));
        }
    }
    let mut numbers = Numbers::new(36);
    let mut hidden = 0;
    for reversed in [false, true] {
        if reversed {
            triangles.reverse();
        }
        for numerics in CLOSED {
            let world = closed_world(&triangles, numerics, Layout::default(), false);
            let (mut rays, mut uncorrected) = (Vec::new(), Vec::new());
            for i in 0..times_factor(3000) {
                // From the cells on either side of the edge, where one of the faces x = 0 and y = 0 is hidden.
                let [u, v] = [1.0 - numbers.below(8) as f64 / 8.0, -1.0 + numbers.below(8) as f64 / 8.0];
                let from = if i % 2 == 0 { [-u, u] } else { [u, -u] };
                let from = DVec3::new(from[0], from[1], v * 0.5);
                let height = if i % 3 == 0 { from.z } else { from.z + 0.25 };
                let way = DVec3::new(0.0, 0.0, height) - from;
                let ray = numerics.ray_precision().ray(from, way.normalize(), 0.0, f64::INFINITY);
                let hit = world.accelerator.closest_hit(&ray, &mut Traversal::default()).expect("the edge");
                let surface = world.interaction(&ray, &hit);
                let origin = surface.point.origin_towards(surface.geometric_normal, numerics);
                let precision = numerics.ray_precision();
                let ray = |origin, numbers: &mut Numbers| {
                    precision.ray(origin, numbers.direction(), 0.0, f64::INFINITY)
                };
                rays.extend((0..8).map(|_| ray(origin, &mut numbers)));
                let triangle = world.accelerator.primitive(hit.slot);
                let Primitive::Triangle(Triangle(corners)) = triangle else { unreachable!("a mesh") };
                let [v, w] = hit.barycentrics;
                let within = SurfacePoint::on_triangle(corners, [1.0 - v - w, v, w], numerics);
                let offset = within.origin_towards(surface.geometric_normal, numerics);
                uncorrected.extend((0..8).map(|_| ray(offset, &mut numbers)));
            }
            assert_eq!(escaped(&world, &rays), [0; 3], "{}, reversed: {reversed}", numerics.name());
            // Without the correction of the start, rays from the reported face do escape where it is the hidden one.
            hidden += escaped(&world, &uncorrected)[0];
        }
    }
    assert!(hidden > 0, "no hidden face was reported");
}

/// E7: rays in the planes of the walls of a box that hit the opposite wall exactly on its edges and corners.
#[test]
fn e7_nothing_escapes_from_an_edge_that_is_seen_along_a_wall() {
    let triangles = meshes::cube(2);
    let mut numbers = Numbers::new(37);
    for numerics in CLOSED {
        let world = closed_world(&triangles, numerics, Layout::default(), false);
        let precision = numerics.ray_precision();
        let mut rays = Vec::new();
        for x in -8..=8 {
            for y in -8..=8 {
                let from = DVec3::new(f64::from(x) / 4.0, f64::from(y) / 4.0, 1.5);
                let ray = precision.ray(from, -DVec3::Z, 0.0, f64::INFINITY);
                let hit =
                    world.accelerator.closest_hit(&ray, &mut Traversal::default()).expect("the far wall");
                let surface = world.interaction(&ray, &hit);
                assert_eq!(surface.point.position, DVec3::new(from.x, from.y, -2.0));
                let origin = surface.point.origin_towards(DVec3::Z, numerics);
                rays.extend((0..8).map(|_| precision.ray(origin, numbers.direction(), 0.0, f64::INFINITY)));
            }
        }
        assert_eq!(escaped(&world, &rays), [0; 3], "{}", numerics.name());
    }
}

/// E7: the same in a rotated box, where rays along a wall start on either side of it by rounding. Those that hit the
/// next wall from inside continue inside.
#[test]
fn e7_nothing_escapes_from_an_edge_that_is_seen_along_a_turned_wall() {
    let turn = DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(0.4);
    let triangles: Vec<_> = meshes::cube(2).iter().map(|corners| corners.map(|p| turn * p)).collect();
    let mut numbers = Numbers::new(38);
    for numerics in CLOSED {
        let world = closed_world(&triangles, numerics, Layout::default(), false);
        let precision = numerics.ray_precision();
        let (mut rays, mut reached) = (Vec::new(), 0);
        for _ in 0..times_factor(80_000) {
            let wall = rounded(&triangles[numbers.below(triangles.len())], numerics);
            let [u, v, w] = [(); 3].map(|()| 0.01 + numbers.fine_unit());
            let from = (wall[0] * u + wall[1] * v + wall[2] * w) / (u + v + w);
            let side = numbers.below(3);
            let to = wall[side].lerp(wall[(side + 1) % 3], numbers.fine_unit());
            let ray = precision.ray(from, (to - from).normalize(), 0.0, f64::INFINITY);
            let Some(hit) = world.accelerator.closest_hit(&ray, &mut Traversal::default()) else { continue };
            let surface = world.interaction(&ray, &hit);
            let turned = surface.geometric_normal.dot(Triangle(wall).unit_normal().expect("an area")).abs();
            // Hits on another wall, from inside.
            if turned > 0.5 || surface.geometric_normal.dot(surface.point.position) >= 0.0 {
                continue;
            }
            reached += 1;
            let origin = surface.point.origin_towards(surface.geometric_normal, numerics);
            rays.extend((0..8).map(|_| precision.ray(origin, numbers.direction(), 0.0, f64::INFINITY)));
        }
        assert!(reached > 1000, "{}: {reached}", numerics.name());
        assert_eq!(escaped(&world, &rays), [0; 3], "{} of {reached}", numerics.name());
    }
}

/// E7: rays along a wall, on either side of it by rounding or up to 1e-9 above it, that hit another wall on the common
/// edge, at dihedral angles up to nearly 180 degrees. The wall that they run along does not count as an occluder.
#[test]
fn e7_nothing_escapes_from_a_flat_edge_that_is_seen_along_a_wall() {
    let mut numbers = Numbers::new(39);
    let turn = DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(0.4);
    for degrees in [90.0, 170.0, 179.0, 179.7, 179.95, 179.99] {
        let angle = f64::to_radians(degrees);
        let triangles: Vec<_> = wedge(angle).iter().map(|corners| corners.map(|p| turn * p)).collect();
        for numerics in CLOSED {
            let world = closed_world(&triangles, numerics, Layout::default(), false);
            let precision = numerics.ray_precision();
            let (mut rays, mut reached) = (Vec::new(), 0);
            for _ in 0..times_factor(10_000) {
                // The wall is y = 0, the edge is along z.
                let above = [0.0, 1e-16, 1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9][numbers.below(8)];
                let from = DVec3::new(0.1 + 0.8 * numbers.fine_unit(), above, numbers.fine_unit() - 0.5);
                let to = DVec3::new(0.0, 0.0, numbers.fine_unit() - 0.5);
                let [from, to] = [from, to].map(|p| turn * p);
                let ray = precision.ray(from, (to - from).normalize(), 0.0, f64::INFINITY);
                let Some(hit) = world.accelerator.closest_hit(&ray, &mut Traversal::default()) else {
                    continue;
                };
                let surface = world.interaction(&ray, &hit);
                let other = turn * DVec3::new(-angle.sin(), angle.cos(), 0.0);
                // Hits on the other wall, from inside.
                if surface.geometric_normal.dot(-other) < 1.0 - 1e-6 || surface.view.dot(-other) < 0.0 {
                    continue;
                }
                reached += 1;
                let origin = surface.point.origin_towards(surface.geometric_normal, numerics);
                rays.extend((0..8).map(|_| precision.ray(origin, numbers.direction(), 0.0, f64::INFINITY)));
            }
            assert!(reached > 500, "{degrees}, {}: {reached}", numerics.name());
            assert_eq!(escaped(&world, &rays), [0; 3], "{degrees}, {} of {reached}", numerics.name());
        }
    }
}

/// E7: a ray that leaves a convex mesh to the outside does not hit it, also from edges and corners: the origin is moved
/// away from edges within the triangle, not away from the mesh.
#[test]
fn e7_convex_edges_do_not_shadow_themselves() {
    let mut numbers = Numbers::new(32);
    let bodies =
        [("cube", meshes::cube(2), 1e-9), ("wedge", wedge(0.5), 1e-6), ("bicone", meshes::bicone(7), 1e-6)];
    for (name, triangles, least_rise) in bodies {
        let middle = triangles.iter().flatten().sum::<DVec3>() / (3 * triangles.len()) as f64;
        for numerics in CLOSED {
            let world = closed_world(&triangles, numerics, Layout::default(), false);
            let mut rays = Vec::new();
            for _ in 0..times_factor(20_000) {
                let corners = rounded(&triangles[numbers.below(triangles.len())], numerics);
                let normal = Triangle(corners).unit_normal().expect("an area");
                let normal = normal * (corners[0] - middle).dot(normal).signum();
                let origin =
                    SurfacePoint::on_triangle(corners, barycentrics_on_borders(&mut numbers), numerics)
                        .origin_towards(normal, numerics);
                let direction = numbers.direction();
                let direction = direction * direction.dot(normal).signum();
                if direction.dot(normal) > least_rise {
                    rays.push(numerics.ray_precision().ray(origin, direction, 0.0, f64::INFINITY));
                }
            }
            assert_eq!(escaped(&world, &rays), [rays.len(); 3], "{name}, {}", numerics.name());
        }
    }
}

/// E7: rays that start in f64 inside a tetrahedron, at a given distance from an edge relative to its size. At 2^-47 and
/// more none escapes in any tier of [`CLOSED`]; below 2^-52, the rounding of sheared corners, some escape except in
/// `exact`.
#[test]
fn e7_starts_closer_to_an_edge_than_rounding_are_safe_in_exact_only() {
    let corners = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]].map(DVec3::from);
    let turn = DQuat::from_rotation_z(0.3) * DQuat::from_rotation_x(1.1);
    let [a, b, c, d] = corners.map(|p| (turn * p).as_vec3().as_dvec3());
    let triangles = [[a, b, c], [a, b, d], [a, c, d], [b, c, d]];
    let mut numbers = Numbers::new(33);
    for numerics in CLOSED {
        let world = closed_world(&triangles, numerics, Layout::default(), false);
        let exact = closed_world(&triangles, Numerics::Exact, Layout::default(), false);
        for (exponent, safe) in [(-20, true), (-40, true), (-47, true), (-53, numerics == Numerics::Exact)] {
            let mut rays = Vec::new();
            for _ in 0..times_factor(20_000) {
                let edge = a.lerp(b, 0.1 + 0.8 * numbers.fine_unit());
                let origin = edge + ((c + d) / 2.0 - edge) * 2f64.powi(exponent);
                let ray = numerics.ray_precision().ray(origin, numbers.direction(), 0.0, f64::INFINITY);
                // Rounding may have moved the start outside: then the ray crosses an even number of triangles.
                let mut all = Vec::new();
                exact.accelerator.all_hits(&ray, &mut all, &mut Traversal::default());
                if !all.is_empty() {
                    rays.push(ray);
                }
            }
            let lost = escaped(&world, &rays)[0];
            assert!((lost == 0) == safe, "2^{exponent}, {}: {lost} of {}", numerics.name(), rays.len());
        }
    }
}

/// E7: a sphere far smaller than its distance from the origin does not shadow itself, outside or inside.
#[test]
fn e7_tiny_spheres_far_away_do_not_shadow_themselves() {
    let mut numbers = Numbers::new(34);
    for (radius, far) in
        [(1e-3, 900.0), (1e-6, 900.0), (900.0 * 2f64.powi(-37), 900.0), (1.0, 1e6), (1.0, 0.0)]
    {
        let centre = DVec3::new(1.0, -0.3, 0.6) * far;
        let sphere = kiln::bvh::Sphere { centre, radius };
        let slot = Slot { primitive: Primitive::from(sphere), id: PrimId(0) };
        for numerics in CLOSED {
            let accelerator = build([slot], Layout::default(), numerics);
            let mut traversal = Traversal::default();
            for _ in 0..times_factor(20_000) {
                let (outwards, direction) = (numbers.direction(), numbers.direction());
                let direction = direction * direction.dot(outwards).signum();
                if direction.dot(outwards) < 1e-3 {
                    continue;
                }
                let point = SurfacePoint::new(centre + outwards * radius, centre.abs() + radius);
                let ray = |normal: DVec3, direction: DVec3| {
                    let origin = point.origin_towards(normal, numerics);
                    numerics.ray_precision().ray(origin, direction, 0.0, f64::INFINITY)
                };
                assert!(!accelerator.is_occluded(&ray(outwards, direction), &mut traversal));
                let inwards = ray(-outwards, -direction);
                let hit = accelerator.closest_hit(&inwards, &mut traversal).expect("the far side");
                // The chord is 2 r cos, up to the offset of the origin and rounding.
                let chord = 2.0 * radius * direction.dot(outwards);
                let off = 4.0 * ORIGIN_OFFSET * (far * 2.0 + radius) / direction.dot(outwards);
                assert!((hit.t - chord).abs() <= off, "{} {chord} {off}", hit.t);
            }
        }
    }
}

/// E7: the shadow of a kerb of 0.2 m at coordinates of 1e6 m ends 0.2 m / slope of the light from it. From points on the
/// borders of the road's triangles, shadow rays start 2 e R / sin(pi / 8) = 9.8 mm away at most, with e = 2^-29.
#[test]
fn e7_the_shadow_of_a_kerb_far_from_the_origin_ends_where_it_should() {
    const HEIGHT: f64 = 0.2;
    const CELL: f64 = 0.25;
    let at = DVec3::new(1e6, 0.0, -1e6);
    let rectangle = |a: [f64; 3], along: DVec3, up: DVec3| {
        let a = at + DVec3::from(a);
        [[a, a + along, a + along + up], [a, a + along + up, a + up]]
    };
    let cells = (0..16).map(|i| [i % 4, i / 4].map(|k| f64::from(k) * CELL));
    let road = cells.flat_map(|[x, z]| rectangle([x, 0.0, z], DVec3::Z * CELL, DVec3::X * CELL));
    let long = DVec3::Z * 20.0;
    let face = rectangle([0.0, 0.0, -10.0], long, DVec3::Y * HEIGHT);
    let top = rectangle([-0.3, HEIGHT, -10.0], long, DVec3::X * 0.3);
    let triangles: Vec<[DVec3; 3]> = road.chain(face).chain(top).collect();
    let mut numbers = Numbers::new(40);
    for numerics in [Numerics::Double, Numerics::Exact] {
        let world = closed_world(&triangles, numerics, Layout::default(), false);
        let (mut checked, mut shaded, mut traversal) = (0, 0, Traversal::default());
        for i in 0..times_factor(20_000) {
            let [a, b, c] = triangles[i % 32];
            let [u, v, w] = barycentrics_on_borders(&mut numbers);
            let point = a * u + b * v + c * w;
            let from = point + DVec3::new(0.01, 1.0, 0.02);
            let ray = numerics.ray_precision().ray(from, (point - from).normalize(), 0.0, f64::INFINITY);
            let Some(hit) = world.accelerator.closest_hit(&ray, &mut traversal).filter(|hit| hit.prim.0 < 32)
            else {
                continue;
            };
            let surface = world.interaction(&ray, &hit);
            let slope = 0.2 + 0.6 * numbers.unit();
            let before_end = HEIGHT / slope - (surface.point.position.x - at.x);
            if before_end.abs() < 0.0098 {
                continue;
            }
            let origin = surface.point.origin_towards(surface.geometric_normal, numerics);
            let to_light = DVec3::new(-1.0, slope, 0.1);
            let ray = numerics.ray_precision().ray(origin, to_light.normalize(), 0.0, f64::INFINITY);
            let is_occluded = world.accelerator.is_occluded(&ray, &mut traversal);
            assert_eq!(is_occluded, before_end > 0.0, "{}, {before_end} m", numerics.name());
            checked += 1;
            shaded += usize::from(is_occluded);
        }
        assert!(
            checked * 2 > times_factor(20_000) && shaded * 4 > checked && shaded * 4 < 3 * checked,
            "{shaded} of {checked}"
        );
    }
}

/// E7: beyond the stated bound rays do escape, in a wedge far narrower than [`ORIGIN_OFFSET`] / [`EDGE_DISTANCE`]. This
/// shows that the tests above can fail.
#[test]
fn e7_a_wedge_beyond_the_bound_leaks() {
    let angle = ORIGIN_OFFSET / EDGE_DISTANCE / 64.0;
    let triangles = wedge(angle);
    let world = closed_world(&triangles, Numerics::Double, Layout::default(), false);
    let [free, _] =
        leaving(&world, &triangles, middle_of(angle), DVec3::X * 9.0, 10_000, &mut Numbers::new(35));
    assert!(escaped(&world, &free)[0] > 0);
}
