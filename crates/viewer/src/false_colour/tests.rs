//! Tests of `false_colour`.

use std::sync::atomic::AtomicBool;

use super::*;
use kiln::bvh::detail::Layout;
use kiln::effects::{Plan, PlanSettings};
use kiln::error::Warnings;
use kiln::farm::Shard;
use kiln::film::Window;
use kiln::scene::Numerics;
use kiln::world::View;

/// False colours of the assignment scene from view 2, at `size` x `size` pixels.
fn false_colours_of_scene(mode: DisplayMode, size: u32) -> FalseColours {
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/assignment.toml");
    let scene = kiln::import::load(&[file], &mut Warnings::default()).unwrap();
    let camera = scene.cameras[0].clone();
    let view = View::new(&camera, camera.projection, [size, size]).unwrap();
    let world = World::prepare(scene, Default::default(), Layout::default(), Numerics::default());
    let plan = Plan::new(&world, &PlanSettings::default()).unwrap();
    let window = Window { x: 0, y: 0, width: size, height: size };
    let source = AovSource {
        world: &world,
        recentering: None,
        view: &view,
        plan: &plan,
        window,
        shard: Shard::ALL,
        film: None,
        display: Default::default(),
    };
    let control = RenderControl { cancel: &AtomicBool::new(false), progress: &|_, _| {}, time_stages: false };
    false_colours(mode, &source, &control).unwrap()
}

#[test]
fn the_plane_is_green_from_above_and_the_sky_is_nothing() {
    let normals = false_colours_of_scene(DisplayMode::Normals, 32);
    // The bottom row sees the plane, whose normal is (0, 1, 0); the top row sees above its horizon.
    assert_eq!(normals.pixels[31 * 32], [128, 255, 128]);
    assert_eq!(normals.pixels[0], NOTHING);
}

#[test]
fn near_is_light() {
    let depths = false_colours_of_scene(DisplayMode::Depth, 32);
    let [bottom, higher] = [31, 24].map(|row| depths.pixels[row * 32][0]);
    assert!(bottom > higher, "{bottom} {higher}");
    assert_eq!(depths.pixels.iter().map(|p| p[0]).max(), Some(250));
    assert_eq!(depths.pixels.iter().filter(|p| **p != NOTHING).map(|p| p[0]).min(), Some(40));
    let even = super::depths(&[2.0, 2.0, f32::INFINITY], |_| false);
    assert_eq!(even.pixels, [[250; 3], [250; 3], NOTHING]);
    assert_eq!(even.legend.ends, Some(["2".into(), "2".into()]));
    assert_eq!(super::depths(&[f32::INFINITY], |_| false).legend.ends, None);
    // Of 101 depths the percentiles 5 and 95 have the indices 5 and 95: a far pixel does not change them.
    let mut ramp: Vec<f32> = (0..=100).map(|i| i as f32).collect();
    ramp[100] = 1e9;
    let scaled = super::depths(&ramp, |_| false);
    assert_eq!(scaled.legend.ends, Some(["5".into(), "95".into()]));
    // Half-way between them: 250 - 210 / 2.
    let grey = [0, 5, 50, 95, 100].map(|i| scaled.pixels[i][0]);
    assert_eq!(grey, [250, 250, 145, 40, 40]);
    // Where all from 21 on are the ground, the 21 others have their indices 1 and 19 at the ends.
    assert_eq!(super::depths(&ramp, |i| i > 20).legend.ends, Some(["1".into(), "19".into()]));
    // A ground alone is scaled by its own depths.
    assert_eq!(super::depths(&ramp, |_| true).pixels, scaled.pixels);
}

#[test]
fn objects_are_named_and_have_their_colours() {
    let objects = false_colours_of_scene(DisplayMode::Objects, 64);
    let names: Vec<&str> = objects.legend.swatches.iter().map(|(_, name)| name.as_str()).collect();
    // The plane covers the most pixels.
    assert_eq!(names[0], "plane");
    for name in ["left sphere", "right sphere", "tetrahedron", "background"] {
        assert!(names.contains(&name), "{names:?}");
    }
    for (colour, name) in &objects.legend.swatches {
        assert!(objects.pixels.contains(colour), "{name}");
    }
    // Object 0 is the left sphere, 1 the right sphere, 2 the plane.
    assert_eq!(objects.legend.swatches[0].0, colour_of(2));
    assert!(
        false_colours_of_scene(DisplayMode::Materials, 64)
            .legend
            .swatches
            .iter()
            .any(|(_, name)| name == "patriarch")
    );
}

#[test]
fn counts_end_at_their_largest_number() {
    let counts = super::counts("rays", &[0.0, 8.0, 16.0]);
    assert_eq!(counts.pixels, heat_map(&[0.0, 0.5, 1.0]));
    assert_eq!(counts.legend.ends, Some(["0".into(), "16".into()]));
    // Without antialiasing each pixel has one.
    let rays = false_colours_of_scene(DisplayMode::Rays, 4);
    assert_eq!(
        (rays.pixels, rays.legend.ends),
        (vec![heat_map(&[1.0])[0]; 16], Some(["0".into(), "1".into()]))
    );
}

#[test]
fn numbers_have_colours_far_apart() {
    // A channel differs by at least 100 of 255 for adjacent numbers, 60 for any two of the first 8, 35 for any two of 8
    // in a row and 15 for any two of 24; all are far from `NOTHING`.
    let apart = |a: [u8; 3], b: [u8; 3]| (0..3).map(|c| a[c].abs_diff(b[c])).max().unwrap();
    for start in [0, 1000, 123_456] {
        let colours: Vec<_> = (start..start + 24).map(colour_of).collect();
        for (i, &a) in colours.iter().enumerate() {
            assert!(apart(a, NOTHING) > 60, "{a:?}");
            for (k, &b) in colours[..i].iter().enumerate() {
                let least = match i - k {
                    1 => 100,
                    2..8 if start + i as u32 <= 7 => 60,
                    2..8 => 35,
                    _ => 15,
                };
                assert!(apart(a, b) >= least, "{a:?} {b:?}");
            }
        }
    }
}

#[test]
fn numbers_are_short() {
    for (x, text) in
        [(0.0, "0"), (2.0, "2"), (1234.5, "1234"), (100.0, "100"), (0.25, "0.25"), (1e-9, "1.000e-9")]
    {
        assert_eq!(short(x), text);
    }
}
