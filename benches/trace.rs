//! Benchmarks of building and tracing, on the assignment scene and a mesh: `cargo bench --bench trace`.
//!
//! The mesh is the Stanford bunny where KILN_MODELS names the folder it is in, and a generated one otherwise. Rays are
//! counted, so criterion's throughput is rays a second on one thread. Compare within one run only.

use std::f64::consts::{PI, TAU};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use kiln::bvh::{self, Layout, Slot, Traversal};
use kiln::effects::glaze::mirrored_ray;
use kiln::effects::shadows::shadow_ray;
use kiln::effects::{Choices, Plan};
use kiln::error::Warnings;
use kiln::film::{ColourPipeline, TILE, Window};
use kiln::geometry::{HitBuffer, Numerics, Precision, PrimId, RayBuffer, SlotId};
use kiln::render::{RenderControl, render};
use kiln::scene::{MaterialId, Mesh, Object, Scene, Shape};
use kiln::shading::LightSample;
use kiln::world::{StandardView, SurfaceInteraction, View, World, fitted_camera, headlight};

const SIZE: [u32; 2] = [512, 512];

/// Rays per batch: those of a tile.
const BATCH: usize = (TILE * TILE) as usize;

/// A displaced sphere of about 80,000 triangles.
fn generated() -> Scene {
    const N: u32 = 200;
    let point = |i: u32, j: u32| {
        let (theta, phi) = (f64::from(i) / f64::from(N) * PI, f64::from(j) / f64::from(N) * TAU);
        let radius = 1.0 + 0.1 * (7.0 * theta).sin() * (9.0 * phi).cos();
        radius * DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin())
    };
    let positions = (0..=N).flat_map(|i| (0..=N).map(move |j| point(i, j))).collect();
    let corner = |i: u32, j: u32| i * (N + 1) + j;
    let quad = |i: u32, j: u32| {
        let [a, b, c, d] = [corner(i, j), corner(i, j + 1), corner(i + 1, j + 1), corner(i + 1, j)];
        [[a, b, c], [a, c, d]]
    };
    let triangles = (0..N).flat_map(|i| (0..N).flat_map(move |j| quad(i, j))).collect();
    let mut scene = Scene::default();
    scene.add_material(kiln::scene::Material::Phong(Default::default()));
    let shape = Shape::Mesh(Mesh { positions, triangles, ..Mesh::default() });
    scene.objects.push(Object { name: "generated".into(), input: 0, material: MaterialId(0), shape });
    scene
}

fn load(file: &Path) -> Scene {
    kiln::import::load(&[file.to_owned()], &mut Warnings::default()).expect("a usable file")
}

fn scenes() -> Vec<(&'static str, Scene)> {
    let assignment = load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/assignment.toml"));
    let mesh = match std::env::var_os("KILN_MODELS").map(PathBuf::from) {
        Some(folder) => ("bunny", load(&folder.join("stanford-bunny.obj"))),
        None => ("generated mesh", generated()),
    };
    vec![("assignment", assignment), mesh]
}

/// Rays of each kind for one picture.
struct Rays {
    primary: RayBuffer,
    shadow: RayBuffer,
    glaze: RayBuffer,
}

fn rays(world: &World, view: &View) -> Rays {
    // In tiles, as in the renderer.
    let tiles = (0..SIZE[1] / TILE).flat_map(|y| (0..SIZE[0] / TILE).map(move |x| (x * TILE, y * TILE)));
    let pixels = tiles.flat_map(|(x, y)| (0..TILE * TILE).map(move |i| (x + i % TILE, y + i / TILE)));
    let primary: RayBuffer = pixels.map(|(x, y)| view.ray(x, y, Precision::Double)).collect();
    let mut hits = HitBuffer::default();
    world.accelerator.closest_hits(primary.rays(), &mut hits, &mut Traversal::default());
    let surfaces: Vec<SurfaceInteraction> = primary
        .rays()
        .iter()
        .zip(hits.iter())
        .filter_map(|(ray, hit)| Some(world.interaction(&ray, &hit?)))
        .collect();
    let origin = |s: &SurfaceInteraction| s.point.origin_towards(s.geometric_normal, Numerics::Watertight);
    let to_light = |s: &SurfaceInteraction| {
        let light = LightSample::new(world.lights.first()?, s, false)?;
        Some(shadow_ray(origin(s), &light, Numerics::Watertight))
    };
    let shadow = surfaces.iter().filter_map(to_light).collect();
    Rays {
        primary,
        shadow,
        glaze: surfaces.iter().map(|s| mirrored_ray(origin(s), s, Precision::Double)).collect(),
    }
}

fn trace(c: &mut Criterion) {
    for (name, mut scene) in scenes() {
        let camera = scene.cameras.first().cloned();
        let camera = camera
            .or_else(|| fitted_camera(&scene, StandardView::Auto, 1.0, Default::default()))
            .expect("a camera");
        if scene.lights.is_empty() {
            scene.lights.extend(headlight(&camera));
        }
        let view = View::new(&camera, camera.projection, SIZE).expect("a usable camera");
        let world = World::prepare(scene, ColourPipeline::Linear, Layout::default(), Numerics::Watertight);
        let mut group = c.benchmark_group(name);
        group.sample_size(20);

        let count = world.accelerator.describe().slots as u32;
        let slot =
            |index| Slot { primitive: world.accelerator.primitive(SlotId::new(index)), id: PrimId(index) };
        let slots: Vec<Slot> = (0..count).map(slot).collect();
        group.throughput(Throughput::Elements(slots.len() as u64));
        group.bench_function("build", |b| {
            let build = |slots: &Vec<Slot>| {
                bvh::build(slots.iter().copied(), Layout::default(), Numerics::Watertight)
            };
            b.iter_batched(|| &slots, build, BatchSize::LargeInput);
        });

        let Rays { primary, shadow, glaze } = rays(&world, &view);
        let mut traversal = Traversal::default();
        for (kind, rays) in [("primary", &primary), ("glaze", &glaze)] {
            group.throughput(Throughput::Elements(rays.len() as u64));
            group.bench_function(kind, |b| {
                let mut hits = HitBuffer::default();
                b.iter(|| {
                    hits.clear();
                    for tile in rays.rays().chunks(BATCH) {
                        world.accelerator.closest_hits(tile, &mut hits, &mut traversal);
                    }
                });
            });
        }
        group.throughput(Throughput::Elements(shadow.len() as u64));
        group.bench_function("shadow", |b| {
            let mut occluded = Vec::with_capacity(shadow.len());
            b.iter(|| {
                occluded.clear();
                for tile in shadow.rays().chunks(BATCH) {
                    world.accelerator.are_occluded(tile, &mut occluded, &mut traversal);
                }
            });
        });

        let plan = Plan::new(&world, &Choices::default()).expect("a plan");
        let window = Window { x: 0, y: 0, width: SIZE[0], height: SIZE[1] };
        let cancel = AtomicBool::new(false);
        let control = RenderControl { cancel: &cancel, progress: &|_, _| {}, time_stages: false };
        group.throughput(Throughput::Elements(u64::from(SIZE[0] * SIZE[1])));
        group.bench_function("picture, all threads", |b| {
            b.iter(|| -> (kiln::film::Film, _) {
                render(&world, &view, &plan, window, |_, _| true, &control).expect("a picture")
            });
        });
        group.finish();
    }
}

criterion_group!(benches, trace);
criterion_main!(benches);
