//! `scenes/course`: the scenes of *Ray Tracing in One Weekend* have the book's settings and look as its pictures do.

use kiln::error::Warnings;
use kiln::film::Film;
use kiln::film::read::decode_pixels;
use kiln::import::load;
use kiln::job::{RenderControl, RenderSettings, prepare};
use kiln::scene::{PictureSettings, Samples, Scene, Shape};

use crate::common::repository;

fn scene(name: &str) -> Scene {
    let file = repository(&format!("scenes/course/{name}.toml"));
    load(&[file], &mut Warnings::default()).unwrap_or_else(|e| panic!("{e}"))
}

/// A small picture of a few samples, in linear light.
fn picture(scene: Scene, size: [u32; 2]) -> Film {
    let samples = Some(Samples::clamped(64));
    let picture = PictureSettings { samples, ..PictureSettings::of_size(size) };
    let job = prepare(scene, &RenderSettings::from(picture), &mut Warnings::default()).expect("a job");
    job.render(&RenderControl::default()).expect("a picture").0
}

/// 4 large spheres, the ground, and up to 22 x 22 small ones, of which those within 0.9 of (4, 0.2, 0) are left out: a
/// disc that covers about pi 0.9^2 = 2.5 cells. The lens has the radius 10 tan(0.3 degrees).
#[test]
fn the_cover_is_that_of_the_book() {
    let scene = scene("cover");
    let radii: Vec<f64> = scene
        .objects
        .iter()
        .map(|object| {
            let Shape::Analytic(kiln::bvh::AnalyticShape::Sphere(sphere)) = &object.shape else {
                panic!("{} is no sphere", object.name)
            };
            sphere.radius
        })
        .collect();
    let count = |radius: f64| radii.iter().filter(|r| **r == radius).count();
    assert_eq!((count(1000.0), count(1.0), radii.len() - count(0.2)), (1, 3, 4));
    assert!((476..=484).contains(&count(0.2)), "{}", count(0.2));
    let own = scene.picture;
    assert_eq!((own.size(), own.samples.map(Samples::get)), (Some([1200, 675]), Some(500)));
    let lens = scene.cameras[0].lens.expect("a lens");
    assert!((lens.radius - 10.0 * 0.3f64.to_radians().tan()).abs() < 1e-8);
    let film = picture(scene, [120, 68]);
    // The sky in the upper corner, of a direction a little above the horizon, is almost white, bluest in blue.
    let [r, g, b] = film.pixel(1, 1);
    assert!(0.7 < r && r < g && g < b && (b - 1.0).abs() < 0.02, "{r} {g} {b}");
    // The mirror of (0.7, 0.6, 0.5) shows the sky in its upper half: from (0.35, 0.42, 0.5) to (0.7, 0.6, 0.5), as its
    // blue is 1 everywhere.
    let [r, g, b] = film.pixel(78, 16);
    assert!((0.35..0.7).contains(&r) && (0.42..0.6).contains(&g) && (b - 0.5).abs() < 0.01, "{r} {g} {b}");
    // The brown sphere behind the glass one.
    let [r, g, b] = film.pixel(42, 15);
    assert!(r > 1.4 * g && g > 1.2 * b, "{r} {g} {b}");
}

/// The gradient of the book, white below to (0.5, 0.7, 1) above, by the cosine of the angle to +y at the centre of each
/// row, within half a step of RGBE, which is 1/128 beside a blue of 1.
#[test]
fn the_sky_is_the_gradient_of_the_book() {
    let bytes = std::fs::read(repository("scenes/course/sky.hdr")).expect("a file");
    let sky = decode_pixels(bytes).expect("a picture");
    assert_eq!((sky.width, sky.height), (1, 64));
    for (row, texel) in sky.values.iter().enumerate() {
        let share = 0.5 * ((std::f64::consts::PI * (row as f64 + 0.5) / 64.0).cos() + 1.0);
        for (found, top) in texel.iter().zip([0.5, 0.7, 1.0]) {
            let expected = (1.0 - share) + share * top;
            assert!((f64::from(*found) - expected).abs() <= 0.5 / 128.0, "row {row}: {texel:?}");
        }
    }
}

/// Walls of the book's colours, green to the left as the camera looks along +z, and a lamp of radiance 15.
#[test]
fn the_cornell_box_is_that_of_the_book() {
    let scene = scene("cornell-box");
    let own = scene.picture;
    assert_eq!((own.size(), own.samples.map(Samples::get)), (Some([600, 600]), Some(200)));
    let film = picture(scene, [60, 60]);
    let [left, right] = [(4, 25), (55, 25)].map(|(x, y)| film.pixel(x, y));
    assert!(left[1] > 2.0 * left[0] && left[1] > 2.0 * left[2], "{left:?}");
    assert!(right[0] > 4.0 * right[1] && right[0] > 4.0 * right[2], "{right:?}");
    // The lamp spans x from 213 to 343 and z from 227 to 332 at the height 554: its middle is seen at the height
    // 30 - 30 (554 - 278) / (800 + 280) / tan(20 degrees) = 8.9.
    assert!(film.pixel(30, 8).iter().all(|c| (c - 15.0).abs() < 0.02), "{:?}", film.pixel(30, 8));
    // The background is black, beside the box and beyond its open front nothing is.
    assert_eq!(film.pixel(0, 0), [0.0; 3]);
}
