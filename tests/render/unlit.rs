//! Unlit materials and backgrounds, which bypass exposure and tone map.

use glam::DVec3;
use kiln::error::Warnings;
use kiln::film::tone::{Exposure, ToneMap};
use kiln::film::{Colour, Film, Pixel};
use kiln::job::{RenderControl, RenderJob, prepare};
use kiln::scene::{
    Background, Camera, ColourValue, Look, Material, MaterialId, Mesh, MetallicRoughness, Object, Opacity,
    PictureSettings, Projection, Samples, Scene, Sensor, Shape, Transport,
};

/// A square of side 2 at z = 0, of an unlit material of this 8-bit colour, seen by a camera that sees a square of side
/// 4: the middle quarter of the picture.
fn scene(colour: [u8; 3], opacity: Option<f64>) -> Scene {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let mesh = Mesh {
        positions: corners.iter().map(|[x, y]| DVec3::new(*x, *y, 0.0)).collect(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let material = Material::MetallicRoughness(MetallicRoughness {
        base_colour: Colour::from_u8(colour),
        unlit: true,
        opacity: opacity.map(|factor| Opacity { factor, cutoff: None }),
        ..MetallicRoughness::default()
    });
    let camera = Camera {
        name: "c".into(),
        position: DVec3::new(0.0, 0.0, 5.0),
        target: DVec3::ZERO,
        up: DVec3::Y,
        projection: Projection::Orthographic,
        view_height: 4.0,
        view_width: Some(4.0),
        viewpoint_distance: 5.0,
        lens: None,
        sensor: Sensor::default(),
        fitted: false,
    };
    let object = Object { name: "a".into(), input: 0, material: MaterialId(0), shape: Shape::Mesh(mesh) };
    Scene { cameras: vec![camera], materials: vec![material], objects: vec![object], ..Scene::default() }
}

fn job(scene: Scene, picture: PictureSettings) -> RenderJob {
    let picture = picture.or(PictureSettings::of_size([16, 16]));
    prepare(scene, &picture.into(), &mut Warnings::default()).expect("a job")
}

fn film<P: Pixel>(scene: Scene, picture: PictureSettings) -> Film<P> {
    job(scene, picture).render(&RenderControl::default()).expect("a picture").0
}

fn background(colour: [u8; 3]) -> Option<Background> {
    Some(Background::Colour(ColourValue(colour)))
}

/// 8-bit colours, also outside the gamut of the tone maps, under every tone map, with several exposures, transports and
/// numbers of samples: unlit surface and background have exactly their colours.
#[test]
fn unlit_colours_and_backgrounds_are_their_own() {
    for colour in [[128; 3], [255, 0, 0], [0, 255, 255], [3, 200, 90], [255; 3], [0; 3]] {
        for tone_map in ToneMap::ALL {
            for (transport, ev, samples) in [
                (Transport::Whitted, Exposure::Ev(2.0), None),
                (Transport::Whitted, Exposure::Ev(-3.5), Some(4)),
                (Transport::Path, Exposure::Ev(1.0), Some(4)),
                (Transport::Whitted, Exposure::Auto, None),
            ] {
                let picture = PictureSettings {
                    look: Some(Look::Draft),
                    tone_map: Some(tone_map),
                    exposure: Some(ev),
                    transport: Some(transport),
                    samples: samples.map(Samples::clamped),
                    background: background([32, 34, 38]),
                    ..PictureSettings::default()
                };
                let film: Film<[u8; 3]> = film(scene(colour, None), picture);
                let at = |x, y| film.pixel(x, y);
                let what = format!("{tone_map:?} {transport:?} {ev:?} {samples:?}");
                assert_eq!(at(8, 8), colour, "{what}");
                assert_eq!(at(1, 1), [32, 34, 38], "{what}");
            }
        }
    }
}

/// With the default look of meshes, which has a tone map and several samples.
#[test]
fn the_default_look_shows_unlit_colours() {
    for colour in [[128; 3], [255, 0, 0]] {
        let picture = PictureSettings { look: Some(Look::Studio), ..PictureSettings::default() };
        assert_eq!(film::<[u8; 3]>(scene(colour, None), picture).pixel(8, 8), colour);
    }
}

/// Half of an unlit 200 over a backdrop of 100 is the mean of both in displayed linear light; with an alpha channel the
/// colour is 200 and alpha 1/2. srgb_decode(200) = 0.5776, of 100 0.1274: the mean 0.3525 is 160.2 in 8 bits.
#[test]
fn translucent_unlit_surfaces_are_blended_as_displayed() {
    for tone_map in ToneMap::ALL {
        let picture = PictureSettings {
            look: Some(Look::Draft),
            tone_map: Some(tone_map),
            exposure: Some(Exposure::Ev(1.5)),
            background: background([100; 3]),
            ..PictureSettings::default()
        };
        let over: Film<[u8; 3]> = film(scene([200; 3], Some(0.5)), picture);
        assert_eq!(over.pixel(8, 8), [160; 3], "{tone_map:?}");
        let clear = PictureSettings { background: Some(Background::Transparent), ..picture };
        let job = job(scene([200; 3], Some(0.5)), clear);
        let (film, _) =
            job.render_to_develop::<[f32; 4]>(|_, _| true, &RenderControl::default()).expect("a picture");
        let (colours, alpha) = film.split_alpha().expect("both");
        assert_eq!(alpha[8 * 16 + 8], 0.5);
        let display = job.display().known();
        assert_eq!(display.encode(job.pipeline(), colours.pixel(8, 8)), [200; 3], "{tone_map:?}");
    }
}

/// Linear films hold the linear base colour at any exposure: 188 is 0.5029.
#[test]
fn films_of_light_hold_the_linear_colour() {
    let picture = PictureSettings {
        look: Some(Look::Draft),
        tone_map: Some(ToneMap::Agx),
        exposure: Some(Exposure::Ev(3.0)),
        ..PictureSettings::default()
    };
    let [r, ..] = film::<[f32; 3]>(scene([188; 3], None), picture).pixel(8, 8);
    assert!((r - 0.5029).abs() < 1e-4, "{r}");
}
