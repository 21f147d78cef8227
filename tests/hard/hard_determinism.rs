//! Pictures are equal bit for bit for any number of threads, structure, crop and run, and subnormal numbers are not
//! flushed to zero on any thread.
//!
//! Not tested here: other machines. kiln uses no operation whose rounding depends on the machine: no FMA outside of box
//! tests, and powers by repeated squaring.

use std::hint::black_box;
use std::process::Command;
use std::sync::atomic::AtomicBool;

use crate::common::borders::{Folder, camera, scene, sound, tiers};
use crate::common::picture::{bits, prepare};
use glam::DVec3;
use kiln::bvh::detail::Layout;
use kiln::effects::{Plan, PlanSettings};
use kiln::film::Window;
use kiln::render::{RenderControl, render};
use kiln::scene::{Numerics, Projection, Scene};
use kiln::world::World;

const SIZE: [u32; 2] = [72, 56];

/// A scene where order matters: ties (duplicates, shared edges), glaze that mirrors glaze, shadows, lattice rays,
/// spheres that touch, a giant triangle. Coordinates are multiples of 1/2.
fn everything() -> String {
    let colours = ["#ff8000", "#0080ff", "#ffffff"];
    let glaze = "glaze = { weight = 0.5, bounces = 4 }";
    let materials: String = (0..3)
        .map(|i| format!("[material.m{i}]\ncolour = '{}'\nspecular = 0.5\n{glaze}\n", colours[i]))
        .collect();
    let tile = |i: usize| {
        let (x, z) = (i % 4, i / 4 % 4);
        format!(
            "[[triangles]]\nmaterial = 'm{}'\nvertices = [[{x}, 0, {z}], [{}, 0, {z}], [{}, 0, {}], [{x}, 0, {}]]\n\
             indices = [[0, 1, 2], [0, 2, 3]]\n",
            i % 3,
            x + 1,
            x + 1,
            z + 1,
            z + 1
        )
    };
    let ball =
        |i: usize| format!("[[sphere]]\nmaterial = 'm{i}'\ncentre = [{}.5, 0.5, 1.5]\nradius = 0.5\n", i + 1);
    // Every tile twice, in two colours.
    let tiles: String = (0..32).map(tile).collect();
    let balls: String = (0..3).map(ball).collect();
    format!(
        "[[camera]]\nposition = [2, 3, 6]\nlook_at = [2, 0, 2]\nvertical_fov = 50\n{materials}{tiles}{balls}\
         [[triangles]]\nvertices = [[-9000, -1, -9000], [9000, -1, -9000], [0, -1, 9000]]\n\
         [[light]]\ntype = 'point'\nposition = [0, 4, 3]\n[[light]]\ntype = 'directional'\ndirection = [-1, -1, 0]\n"
    )
}

/// The scene in perspective, and in orthographic projection with rays on its lattice.
fn views() -> [Scene; 2] {
    let eye = DVec3::new(2.0, 4.0, 2.0);
    let mut above = scene(&everything());
    let mut down = camera(eye, eye - DVec3::Y, Projection::Orthographic, 7.0, 4.0);
    // 72 x 56 pixels with a spacing of 1/8: every eighth ray runs through an edge of tiles.
    down.view_width = Some(9.0);
    above.cameras = vec![down];
    [scene(&everything()), above]
}

#[test]
fn l1_the_picture_does_not_depend_on_the_number_of_threads() {
    for (scene, numerics) in views().iter().flat_map(|scene| Numerics::ALL.map(|numerics| (scene, numerics)))
    {
        let prepared = prepare(scene.clone(), SIZE, numerics);
        let expected = bits(&sound(&prepared), SIZE);
        for threads in [1, 2, 3, 8] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            // The tree is built by the same threads.
            let film = pool.install(|| sound(&prepare(scene.clone(), SIZE, numerics)));
            assert!(bits(&film, SIZE) == expected, "{}: {threads} threads", numerics.name());
        }
    }
}

#[test]
fn l1_the_picture_does_not_depend_on_the_structure() {
    for (scene, numerics) in
        views().iter().flat_map(|scene| Numerics::STRICT.map(|numerics| (scene, numerics)))
    {
        let mut prepared = prepare(scene.clone(), SIZE, numerics);
        let expected = bits(&sound(&prepared), SIZE);
        for structure in Layout::trees().chain([Layout::BruteForce]) {
            prepared.world = World::prepare(scene.clone(), prepared.world.pipeline, structure, numerics);
            assert!(bits(&sound(&prepared), SIZE) == expected, "{}: {structure:?}", numerics.name());
        }
    }
}

#[test]
fn l1_the_picture_does_not_depend_on_where_tiles_begin() {
    // Crops at any pixel have other tiles and other batches of rays; 1 x 1 is a batch of one ray.
    let windows =
        [[0, 0, 72, 56], [1, 1, 71, 55], [7, 13, 33, 17], [15, 15, 2, 2], [0, 40, 72, 1], [71, 0, 1, 56]];
    let dots = (0..9).map(|i| [8 * i, 6 * i, 1, 1]);
    for (scene, numerics) in
        views().iter().flat_map(|scene| Numerics::STRICT.map(|numerics| (scene, numerics)))
    {
        let prepared = prepare(scene.clone(), SIZE, numerics);
        let whole = sound(&prepared);
        let plan =
            Plan::new(&prepared.world, &prepared.plan_settings(PlanSettings::default())).expect("a plan");
        let control =
            RenderControl { cancel: &AtomicBool::new(false), progress: &|_, _| {}, time_stages: false };
        for [x, y, width, height] in windows.into_iter().chain(dots.clone()) {
            let window = Window { x, y, width, height };
            let (part, _) = render(&prepared.world, &prepared.view, &plan, window, |_, _| true, &control)
                .expect("a picture");
            for (i, j) in (0..width).flat_map(|i| (0..height).map(move |j| (i, j))) {
                let [a, b] = [part.pixel(i, j), whole.pixel(x + i, y + j)].map(|p| p.map(f32::to_bits));
                assert_eq!(a, b, "{}: ({i}, {j}) of {window:?}", numerics.name());
            }
        }
    }
}

#[test]
fn l1_two_runs_of_the_command_write_the_same_bytes() {
    let folder = Folder::new();
    let file = folder.write("scene.toml", everything());
    let run = |numerics: Numerics, threads: &str| {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("kiln"));
        command.arg("render").arg(&file).args(["-o", "-", "--size", "72x56", "--threads", threads]);
        let output = command.args(["--numerics", numerics.name()]).output().expect("the command starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        output.stdout
    };
    for numerics in Numerics::ALL {
        let first = run(numerics, "1");
        assert!(first.starts_with(b"\x89PNG") && ["1", "2", "8"].iter().all(|n| run(numerics, n) == first));
    }
}

/// Whether this thread keeps subnormal numbers: half of the least normal number is not 0.
fn holds_subnormal_numbers() -> bool {
    let single = black_box(f32::MIN_POSITIVE) / 2.0 * black_box(1.0);
    let double = black_box(f64::MIN_POSITIVE) / 2.0 * black_box(1.0);
    single != 0.0 && double != 0.0 && f64::from(black_box(f32::from_bits(1))) > 0.0
}

#[test]
fn h4_subnormal_numbers_are_numbers_on_every_thread() {
    assert!(holds_subnormal_numbers());
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        assert!(pool.broadcast(|_| holds_subnormal_numbers()).into_iter().all(|held| held));
        // The same after a picture was rendered by the threads.
        pool.install(|| tiers(&views()[0], [32, 32]).iter().for_each(|prepared| drop(sound(prepared))));
        assert!(pool.broadcast(|_| holds_subnormal_numbers()).into_iter().all(|held| held));
    }
}

#[test]
fn h4_sheets_a_subnormal_distance_apart_are_told_apart() {
    // Two floors at 0 and at 1e-40, which is 71,362 times the least f32; the camera is 2e-40 above the lower one. A
    // third floor, first in the list, is at 3e-40, behind the camera. The closest hit is on the floor at 1e-40.
    let floor = |y: &str| {
        format!(
            "[[triangles]]\nvertices = [[-9, {y}, -9], [9, {y}, -9], [9, {y}, 9], [-9, {y}, 9]]\nindices = [[0, 1, 2], [0, 2, 3]]\n"
        )
    };
    let text = format!(
        "[[camera]]\nposition = [0.3, 2e-40, 0.2]\nlook_at = [0.3, -1, 0.2]\nvertical_fov = 60\n{}{}{}",
        floor("3e-40"),
        floor("0"),
        floor("1e-40")
    );
    for prepared in tiers(&scene(&text), [32, 32]) {
        sound(&prepared);
        for (ray, hit) in prepared.rays().iter().zip(prepared.hits()) {
            let hit = hit.expect("a floor is below");
            let exact = (f64::from(1e-40f32) - ray.origin().y) / ray.direction().y;
            let numerics = prepared.world.numerics().name();
            assert!([4, 5].contains(&hit.prim.0), "{numerics}: {hit:?}");
            assert!((hit.t - exact).abs() <= 1e-4 * exact, "{numerics}: {} {exact}", hit.t);
        }
    }
}
