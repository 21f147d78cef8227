//! Structure-of-arrays code gives the same bits as code for single rays: primary rays and surfaces, over tiles of all
//! scenes, in every tier.

use std::path::PathBuf;

use crate::common;
use crate::common::picture::{Prepared, equip, load, prepare};
use crate::common::repository;
use glam::DVec3;
use kiln::bvh::detail::{HitBuffer, RayBuffer};
use kiln::bvh::{Ray, Traversal};
use kiln::film::Window;
use kiln::scene::{Numerics, Projection};
use kiln::world::{HitOrder, InteractionSoa, RAYS_PER_BATCH, SurfaceInteraction};

const SIZE: [u32; 2] = [96, 72];

/// Scenes with spheres, flat and smooth meshes, and several materials.
fn scenes() -> Vec<PathBuf> {
    let mut files = vec![repository("scenes/assignment.toml")];
    let hard = std::fs::read_dir(repository("scenes/hard")).expect("the hard scenes");
    files.extend(
        hard.map(|entry| entry.expect("a file").path()).filter(|p| p.extension() == Some("toml".as_ref())),
    );
    files
}

/// The windows of the picture's tiles, those at its border cut off.
fn tiles() -> impl Iterator<Item = Window> {
    let [width, height] = SIZE;
    (0..height).step_by(16).flat_map(move |y| {
        (0..width).step_by(16).map(move |x| Window {
            x,
            y,
            width: 16.min(width - x),
            height: 16.min(height - y),
        })
    })
}

fn bits(v: DVec3) -> [u64; 3] {
    v.to_array().map(f64::to_bits)
}

fn bits_of(surface: &SurfaceInteraction) -> Vec<u64> {
    let vectors = [
        surface.point.position,
        surface.point.start,
        surface.point.reach,
        surface.view,
        surface.geometric_normal,
        surface.shading_normal,
        surface.tint,
    ];
    let is_turned = u32::from(surface.is_turned);
    let indices = [surface.hit.prim.0, surface.object, surface.material, is_turned].map(u64::from);
    vectors.into_iter().flat_map(bits).chain(indices).collect()
}

/// A tile's rays and hits, one by one.
fn hits(prepared: &Prepared, window: Window) -> (Vec<Ray>, HitBuffer) {
    let precision = prepared.world.numerics().ray_precision();
    let pixels =
        (0..window.area() as u32).map(|i| (window.x + i % window.width, window.y + i / window.width));
    let rays: Vec<Ray> = pixels.map(|(x, y)| prepared.view.ray(x, y, precision)).collect();
    let mut traversal = Traversal::default();
    let mut hits = HitBuffer::default();
    for ray in &rays {
        hits.push(prepared.world.accelerator.closest_hit(ray, &mut traversal).as_ref());
    }
    (rays, hits)
}

fn check(prepared: &Prepared, what: &str) -> usize {
    let world = &prepared.world;
    let (mut soa, mut surfaces) = (RayBuffer::default(), Box::<InteractionSoa>::default());
    let mut seen = 0;
    for window in tiles() {
        let (rays, hits) = hits(prepared, window);
        prepared.view.rays(window, world.numerics().ray_precision(), &mut soa);
        assert_eq!(soa.rays().iter().collect::<Vec<_>>(), rays, "{what}");

        // In their order, which has runs of hits on one primitive, and in one that has none.
        for step in [1, 101] {
            let order = (0..rays.len()).map(|i| i * step % rays.len());
            let (mut scattered, mut scattered_hits) = (RayBuffer::default(), HitBuffer::default());
            for i in order {
                scattered.push(&rays[i]);
                scattered_hits.push(hits.get(i).as_ref());
            }
            for order in [HitOrder::Rays, HitOrder::Primitives] {
                world.interactions(&scattered, &scattered_hits, order, &mut surfaces);
                let count = scattered_hits.iter().flatten().count();
                assert_eq!(surfaces.len(), count);
                let parts: usize = surfaces.by_material().iter().map(|(_, range)| range.len()).sum();
                assert_eq!(parts, count);
                for (i, &ray) in surfaces.ray_of().iter().enumerate() {
                    let hit = scattered_hits.get(ray as usize).expect("rays of surfaces hit");
                    let expected = world.interaction(&scattered.get(ray as usize), &hit);
                    let found = bits_of(&surfaces.get(i));
                    assert_eq!(found, bits_of(&expected), "{what}, {window:?}, {order:?}, surface {i}");
                }
                let mut rays = surfaces.ray_of().to_vec();
                assert!(order != HitOrder::Rays || rays.is_sorted());
                rays.sort_unstable();
                rays.dedup();
                assert_eq!(rays.len(), count, "each ray once");
                seen += count;
            }
        }
    }
    seen
}

fn check_all(files: impl IntoIterator<Item = PathBuf>) {
    assert_eq!(RAYS_PER_BATCH, 2 * 16 * 16, "two rays for each pixel of the tiles above");
    for file in files {
        let mut scene = load(&file);
        equip(&mut scene);
        for (numerics, projection) in Numerics::ALL
            .into_iter()
            .zip([Projection::Perspective, Projection::Orthographic].into_iter().cycle())
        {
            let mut scene = scene.clone();
            scene.cameras[0].projection = projection;
            let what = format!("{}, {}", file.display(), numerics.name());
            check(&prepare(scene, SIZE, numerics), &what);
        }
    }
}

#[test]
fn many_are_as_each_alone() {
    check_all(scenes());
}

#[test]
#[ignore = "needs KILN_MODELS"]
fn with_models_many_are_as_each_alone() {
    let models = common::models();
    check_all(["CornellBox.glb", "Fox.glb", "spot.obj", "teapot.obj"].map(|name| models.join(name)));
}

/// The assignment's picture has its plane, both spheres and the tetrahedron in it, so that the loops have been asked.
#[test]
fn the_loops_are_asked() {
    let prepared = prepare(load(&repository("scenes/assignment.toml")), SIZE, Numerics::Watertight);
    assert!(check(&prepared, "assignment") > 8000);
}
