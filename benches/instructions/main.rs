//! Traces rays of one kind against a generated mesh: `instructions KIND ROUNDS`, for
//! `benches/instructions/count-instructions`.
//!
//! The preparation does not depend on ROUNDS: a mesh of 80,000 triangles, its tree, and 65,536 rays of
//! the kind. Then all of them are cast ROUNDS times, a tile's worth at once, on one thread. Two runs of different
//! ROUNDS differ by the instructions of traversal alone.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use kiln::bvh::detail::{Accelerator, HitBuffer, Layout, Precision, RayBuffer, Slot, SurfacePoint};
use kiln::bvh::{self, Hit, Numerics, PrimId, Primitive, Ray, Traversal, Triangle};
use kiln::film::TILE;
use kiln_lab::bench::Numbers;

/// Width and height in pixels of the picture whose rays are traced.
const SIDE: u32 = 256;

/// Rays per batch.
const BATCH: usize = (TILE * TILE) as usize;

const LIGHT: DVec3 = DVec3::new(2.0, 3.0, 4.0);

/// A displaced sphere of 80,000 triangles.
fn triangles() -> impl Iterator<Item = [DVec3; 3]> {
    const N: u32 = 200;
    let point = |i: u32, j: u32| {
        let (theta, phi) = (f64::from(i) / f64::from(N) * PI, f64::from(j) / f64::from(N) * TAU);
        let radius = 1.0 + 0.1 * (7.0 * theta).sin() * (9.0 * phi).cos();
        let p = radius * DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
        p.as_vec3().as_dvec3()
    };
    let quads = (0..N).flat_map(|i| (0..N).map(move |j| (i, j)));
    let halves = quads.flat_map(move |(i, j)| {
        let [a, b, c, d] = [point(i, j), point(i, j + 1), point(i + 1, j + 1), point(i + 1, j)];
        [[a, b, c], [a, c, d]]
    });
    // At the poles two corners coincide.
    halves.filter(|corners| !Triangle(*corners).is_degenerate())
}

/// The rays of a picture, tile by tile.
fn primary() -> RayBuffer {
    let tiles = (0..SIDE / TILE).flat_map(|y| (0..SIDE / TILE).map(move |x| (x * TILE, y * TILE)));
    let pixels = tiles.flat_map(|(x, y)| (0..TILE * TILE).map(move |i| (x + i % TILE, y + i / TILE)));
    let eye = DVec3::new(0.0, 0.0, 3.0);
    let at = |pixel: u32| (f64::from(pixel) + 0.5) / f64::from(SIDE) * 2.4 - 1.2;
    let ray = |(x, y): (u32, u32)| (DVec3::new(at(x), -at(y), 0.0) - eye).normalize();
    pixels.map(|pixel| Precision::Double.ray(eye, ray(pixel), 0.0, f64::INFINITY)).collect()
}

/// Secondary rays from the hits of the primary rays, repeated until there are as many as primary rays.
fn leaving(tree: &dyn Accelerator, direction: impl Fn(u64, DVec3, DVec3) -> (DVec3, f64)) -> RayBuffer {
    let rays = primary();
    let mut hits = HitBuffer::default();
    tree.closest_hits(rays.rays(), &mut hits, &mut Traversal::default());
    let points: Vec<(DVec3, DVec3)> = rays
        .rays()
        .iter()
        .zip(hits.iter())
        .filter_map(|(ray, hit)| Some(origin(tree, &ray, &hit?)))
        .collect();
    let leave = |(index, &(origin, normal)): (u64, &(DVec3, DVec3))| {
        let (direction, length) = direction(index, origin, normal);
        Precision::Double.ray(origin, direction, 0.0, length)
    };
    (0..).zip(points.iter().cycle()).take(rays.len()).map(leave).collect()
}

/// Origin of the secondary ray at a hit, and the normal there.
fn origin(tree: &dyn Accelerator, ray: &Ray, hit: &Hit) -> (DVec3, DVec3) {
    let Primitive::Triangle(triangle) = tree.primitive(hit.slot) else { unreachable!("a mesh of triangles") };
    let normal = triangle.normal().normalize();
    let normal = if normal.dot(ray.direction()) > 0.0 { -normal } else { normal };
    let [v, w] = hit.barycentrics;
    let point = SurfacePoint::on_triangle(triangle.0, [1.0 - v - w, v, w], Numerics::Watertight);
    (point.origin_towards(normal, Numerics::Watertight), normal)
}

fn shadow(tree: &dyn Accelerator) -> RayBuffer {
    leaving(tree, |_, origin, _| ((LIGHT - origin).normalize(), (LIGHT - origin).length()))
}

/// A cosine-weighted direction in the hemisphere about the normal.
fn diffuse(tree: &dyn Accelerator) -> RayBuffer {
    leaving(tree, |index, _, normal| {
        let mut numbers = Numbers::new(0, index);
        let (z, phi) = (2.0 * numbers.unit() - 1.0, TAU * numbers.unit());
        let r = (1.0 - z * z).sqrt();
        let aside = DVec3::new(r * phi.cos(), r * phi.sin(), z);
        ((normal * 1.0001 + aside).normalize(), f64::INFINITY)
    })
}

fn main() {
    // `cargo test --benches` and `cargo bench` run this with other arguments or none; nothing is done then.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let [kind, rounds] = arguments.as_slice() else { return };
    let rounds: usize = rounds.parse().expect("how often all rays are cast");

    let slots = (0..)
        .zip(triangles())
        .map(|(id, corners)| Slot { primitive: Primitive::Triangle(Triangle(corners)), id: PrimId(id) });
    let tree = bvh::detail::build(slots, Layout::default(), Numerics::Watertight);
    let rays = match kind.as_str() {
        "primary" => primary(),
        "shadow" => shadow(&*tree),
        "diffuse" => diffuse(&*tree),
        other => panic!("`{other}` is no kind of ray: primary, shadow or diffuse"),
    };
    let mut traversal = Traversal::default();
    let (mut hits, mut occluded) = (HitBuffer::default(), Vec::with_capacity(BATCH));
    let mut met = 0;
    for _ in 0..rounds {
        for batch in rays.rays().chunks(BATCH) {
            if kind == "shadow" {
                occluded.clear();
                tree.are_occluded(batch, &mut occluded, &mut traversal);
                met += occluded.iter().filter(|&&blocked| blocked).count();
            } else {
                hits.clear();
                tree.closest_hits(batch, &mut hits, &mut traversal);
                met += hits.iter().flatten().count();
            }
        }
    }
    println!("{} rays, {met} of them hit", rounds * rays.len());
}
