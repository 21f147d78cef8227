//! Rays that start inside a closed mesh, nearer to a ridge than 2^-23 of its length, and pass it as nearly as f64 can
//! say.
//!
//! The ridge lies in the border of the mesh's box. The triangle test sees its ends moved by some 2^-53 of their
//! distance, so a ray may cross a face as the test sees it beside the border, by more than any share of the ray's
//! distance from it: all box tests must allow for that.

use std::sync::Arc;

use glam::{DMat4, DVec3};

use crate::bvh::splitmix64::splitmix64;
use crate::bvh::{Accelerator, Instance, Layout, Primitive, Slot, Traversal, build, build_with_instances};
use crate::geometry::{
    Hit, HitBuffer, Mesh, Numerics, PACKET, Placed, Placement, PrimId, Ray, RayBuffer, Triangle,
};

/// Numbers between -1 and 1.
fn numbers(mut seed: u64) -> impl FnMut() -> f64 {
    move || {
        seed += 1;
        splitmix64(seed) as f64 / 2f64.powi(63) - 1.0
    }
}

/// A tetrahedron with a ridge at `border` on `axis`, along the second axis after it or tilted; and a packet of rays
/// from a common origin that is `near` to the ridge, towards points within 2^-52 of the ridge and as near.
fn ridge(axis: usize, border: f64, near: f64, seed: u64) -> ([[DVec3; 3]; 4], Vec<Ray>) {
    let mut number = numbers(seed);
    let placed = |x: f64, y: f64, z: f64| {
        let mut p = [0.0; 3];
        (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (x, y, z);
        DVec3::from(p)
    };
    let inwards = if seed & 1 == 0 { 1.0 } else { -1.0 };
    let in_f32 = |p: DVec3| p.as_vec3().as_dvec3();
    // Parallel to an axis, so that bounds of a face have a second border at the ridge, or not.
    let tilt = if (seed / 4).is_multiple_of(4) { number() * 0.3 } else { 0.0 };
    let [middle, off] = [number() * 0.2, number() * 0.4].map(|x| f64::from(x as f32));
    let sides = if (seed / 16).is_multiple_of(4) { [-0.2, 0.2] } else { [0.0, -0.4] };
    let [a, b] = [-1.0, 1.0].map(|end| in_f32(placed(border, off + tilt * end, end)));
    let [c, d] = sides.map(|side| in_f32(placed(border + inwards, off + side, middle)));
    let on_ridge = |along: f64| a.lerp(b, 0.5 + along * 0.5);
    let at = 0.5 * number();
    let origin = on_ridge(at) + placed(inwards, (sides[0] + sides[1]) / 2.0 + 0.05 * number(), 0.0) * near;
    let spread = [4.0, 0.1][seed as usize / 2 % 2];
    let middle = number();
    let rays = (0..PACKET).map(|_| {
        let to = on_ridge(at + near * (middle + spread * number())) - origin;
        let aside = DVec3::new(number(), number(), number()) * 2f64.powi(-52);
        Ray { origin, direction: (to + aside).normalize(), t_min: 0.0, t_max: f64::INFINITY }
    });
    ([[a, b, c], [a, b, d], [a, c, d], [b, c, d]], rays.collect())
}

/// Triangles as an instance of a mesh. Its placement is exact: another scale on each axis, one of them mirrored.
fn instance(triangles: &[[DVec3; 3]; 4], layout: Layout, numerics: Numerics) -> Box<dyn Accelerator> {
    let scale = DVec3::new(0.25, -2.0, 1024.0);
    let mesh = Mesh {
        positions: triangles.as_flattened().iter().map(|corner| corner / scale).collect(),
        triangles: (0..4).map(|triangle| [0, 1, 2].map(|corner| 3 * triangle + corner)).collect(),
        ..Mesh::default()
    };
    let placed = Placed::new(Arc::new(mesh), Placement::new(DMat4::from_scale(scale)));
    build_with_instances([], vec![Instance { placed, first: PrimId(0) }], layout, numerics)
}

#[test]
fn no_ray_escapes_past_a_ridge_near_its_origin() {
    let mut traversal = Traversal::default();
    for numerics in Numerics::STRICT {
        let (mut rays_inside, mut lost) = (0, 0);
        for seed in 0..120 {
            let border = [0.0, 0.5, 1.0, f64::from(0.3f32), -0.0, 1.0 / 1024.0][seed as usize / 3 % 6];
            let near = 2f64.powi(-24 - (seed as i32 / 5 % 10) * 2);
            let (triangles, rays) = ridge(seed as usize % 3, border, near, seed);
            let of_triangles = |layout: Layout, numerics: Numerics| {
                let slot = |(id, corners): (u32, [DVec3; 3])| Slot {
                    primitive: Primitive::Triangle(Triangle(corners)),
                    id: PrimId(id),
                };
                build((0..).zip(triangles).map(slot), layout, numerics)
            };
            // Rounding may have moved the origin outside: then a ray passes an even number of faces.
            let exact = of_triangles(Layout::BruteForce, Numerics::Exact);
            let brute_force = of_triangles(Layout::BruteForce, numerics);
            let mut buffer = RayBuffer::default();
            let mut expected = Vec::new();
            for ray in rays {
                if exact.is_occluded(&ray, &mut traversal) {
                    buffer.push(&ray);
                    expected.push((brute_force.closest_hit(&ray, &mut traversal), all(&*brute_force, &ray)));
                }
            }
            rays_inside += expected.len();
            lost += expected.iter().filter(|(closest, _)| closest.is_none()).count();
            let of_layout = |layout: Layout| {
                let mut tree = of_triangles(layout, numerics);
                if seed & 4 != 0 {
                    tree.refit(&|id| Primitive::Triangle(Triangle(triangles[id.0 as usize])));
                }
                [("mesh", tree), ("instance", instance(&triangles, layout, numerics))]
                    .map(|tree| (layout, tree))
            };
            for (layout, (kind, tree)) in Layout::trees().flat_map(of_layout) {
                let name = numerics.name();
                let what = format!("{name} {layout:?}, {kind}, border {border}, near {near:e}");
                let (mut hits, mut occluded) = (HitBuffer::default(), Vec::new());
                tree.closest_hits(buffer.rays(), &mut hits, &mut traversal);
                tree.are_occluded(buffer.rays(), &mut occluded, &mut traversal);
                for (i, (ray, (closest, all_of_them))) in buffer.rays().iter().zip(&expected).enumerate() {
                    let found = [tree.closest_hit(&ray, &mut traversal), hits.get(i)];
                    let bits = |hit: &Option<Hit>| hit.map(|hit| (hit.t.to_bits(), hit.prim));
                    assert_eq!(found.each_ref().map(bits), [bits(closest); 2], "{what}, {ray:?}");
                    let found = [tree.is_occluded(&ray, &mut traversal), occluded[i]];
                    assert_eq!(found, [closest.is_some(); 2], "{what}, {ray:?}");
                    assert_eq!(all(&*tree, &ray), *all_of_them, "{what}, {ray:?}");
                }
            }
        }
        assert!(rays_inside > 10_000, "{rays_inside}");
        assert_eq!(lost, 0, "of {rays_inside}, {}", numerics.name());
    }
}

/// All hits by distance.
fn all(structure: &dyn Accelerator, ray: &Ray) -> Vec<(u64, PrimId)> {
    let mut hits = Vec::new();
    structure.all_hits(ray, &mut hits, &mut Traversal::default());
    let mut hits: Vec<_> = hits.into_iter().map(|hit| (hit.t.to_bits(), hit.prim)).collect();
    hits.sort();
    hits
}

/// Rays whose direction has a length of powers of two, from a point near to a large triangle, so that the side of its
/// plane decides. All numbers are exact: t is 2^-8 of the scene's size over the length.
#[test]
fn directions_of_any_length_hit_what_is_near() {
    let mut traversal = Traversal::default();
    for (size, length) in [(0, 0), (-120, 0), (-120, 840), (-120, -840), (0, 900), (100, -700), (0, -900)] {
        let [size, length] = [size, length].map(|exponent| f64::from(exponent).exp2());
        let corners = [[-1.0, -1.0, 0.0], [3.0, -1.0, 0.0], [-1.0, 3.0, 0.0]];
        let triangle = Triangle(corners.map(|corner| DVec3::from(corner) * size));
        let slot = Slot { primitive: Primitive::Triangle(triangle), id: PrimId(0) };
        for (numerics, side) in Numerics::STRICT.into_iter().flat_map(|tier| [(tier, 1.0), (tier, -1.0)]) {
            let origin = DVec3::new(0.0, 0.0, -side / 256.0) * size;
            let direction = DVec3::new(0.25, 0.5, side) * length;
            let ray = Ray { origin, direction, t_min: 0.0, t_max: f64::INFINITY };
            let away = Ray { direction: -direction, ..ray };
            let t = 2f64.powi(-8) * size / length;
            for layout in Layout::trees().chain([Layout::BruteForce]) {
                let structure = build([slot], layout, numerics);
                let hit = |ray: &Ray, traversal: &mut Traversal| {
                    let hit = structure.closest_hit(ray, traversal).map(|hit| hit.t);
                    let rays = RayBuffer::from_iter([*ray; 20]);
                    let mut hits = HitBuffer::default();
                    structure.closest_hits(rays.rays(), &mut hits, traversal);
                    assert!(hits.iter().all(|other| other.map(|hit| hit.t) == hit), "{ray:?}");
                    hit
                };
                let found = [&ray, &away].map(|ray| hit(ray, &mut traversal));
                assert_eq!(found, [Some(t), None], "{} {layout:?}: {ray:?}", numerics.name());
            }
        }
    }
}

/// Rays of numbers that are not finite have any hits, without a panic.
#[test]
fn rays_that_are_not_finite_do_not_panic() {
    let number = |seed: u64| (splitmix64(seed) >> 44) as f64 / f64::from(1 << 19) - 1.0;
    let point = |seed: u64| DVec3::from([3 * seed, 3 * seed + 1, 3 * seed + 2].map(number));
    let slots: Vec<Slot> = (0..100)
        .map(|id| {
            let corners = [0, 1, 2].map(|k| point(3 * u64::from(id) + k));
            let ball = Primitive::from((corners[0].to_array(), 0.1));
            let primitive = if id % 7 == 0 { ball } else { Primitive::Triangle(Triangle(corners)) };
            Slot { primitive, id: PrimId(id) }
        })
        .collect();
    let mut rays = Vec::new();
    for x in [f64::NAN, f64::INFINITY, -f64::INFINITY] {
        for place in 0..8 {
            let mut numbers = [0.1, 0.2, 0.3, 0.48, 0.6, 0.64, 0.0, 9.0];
            numbers[place] = x;
            let [a, b, c, d, e, f, t_min, t_max] = numbers;
            rays.push(Ray { origin: DVec3::new(a, b, c), direction: DVec3::new(d, e, f), t_min, t_max });
        }
    }
    rays.push(Ray { origin: DVec3::ZERO, direction: DVec3::ZERO, t_min: -1.0, t_max: -2.0 });
    let (mut traversal, mut occluded) = (Traversal::default(), Vec::new());
    for numerics in Numerics::ALL {
        for (layout, count) in Layout::trees().chain([Layout::BruteForce]).flat_map(|l| [(l, 100), (l, 20)]) {
            let structure = build(slots[..count].iter().copied(), layout, numerics);
            for ray in &rays {
                let valid = Ray { direction: DVec3::new(0.48, 0.6, 0.64), t_min: 0.0, ..rays[7] };
                structure.closest_hit(ray, &mut traversal);
                structure.all_hits(ray, &mut Vec::new(), &mut traversal);
                // Among others, by themselves, and all alike.
                for buffer in [vec![valid; 40], vec![*ray; 40]].map(|mut rays| {
                    rays[20] = *ray;
                    RayBuffer::from_iter(rays)
                }) {
                    structure.closest_hits(buffer.rays(), &mut HitBuffer::default(), &mut traversal);
                    structure.are_occluded(buffer.rays(), &mut occluded, &mut traversal);
                    structure.each_hit(buffer.rays(), &mut Vec::new(), &mut traversal);
                    structure.each_near_rays(buffer.rays(), &mut |_, _, _, _| {}, &mut traversal);
                }
            }
        }
    }
}
