//! Rays that start inside a closed mesh, nearer to a ridge than 2^-23 of its length, and pass it as nearly as f64 can
//! say.
//!
//! The ridge lies in the border of the mesh's box. The triangle test sees its ends moved by some 2^-53 of their
//! distance, so a ray may cross a face as the test sees it beside the border, by more than any share of the ray's
//! distance from it: all box tests must allow for that.

use glam::DVec3;

use crate::bvh::splitmix64::splitmix64;
use crate::bvh::{Accelerator, Layout, Primitive, Slot, Traversal, build};
use crate::geometry::{Hit, HitBuffer, Numerics, PACKET, PrimId, Ray, RayBuffer, Triangle};

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
            for layout in Layout::trees() {
                let mut tree = of_triangles(layout, numerics);
                if seed & 4 != 0 {
                    tree.refit(&|id| Primitive::Triangle(Triangle(triangles[id.0 as usize])));
                }
                let what = format!("{} {layout:?}, border {border}, near {near:e}", numerics.name());
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
