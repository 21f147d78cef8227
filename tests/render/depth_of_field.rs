//! Depth of field against the thin lens equation.

use crate::common::picture::{bits, parse};
use glam::DVec2;
use kiln::effects::id;
use kiln::error::Warnings;
use kiln::film::{Film, FilterShape, Window};
use kiln::job::{RenderControl, RenderJob, RenderSettings, prepare};
use kiln::scene::{PictureSettings, Projection, Samples, Transport};

const SIZE: [u32; 2] = [64, 64];

/// The plane of focus and the pixels across a unit of it.
const FOCUS: f64 = 4.0;
const PIXELS: f64 = 200.0;

/// What the camera in the origin sees along -z, 64 pixels high.
fn scene(lens: &str, objects: &str) -> String {
    format!(
        "[image]\ncolour = 'linear'\nheadlight = false\n[ambient]\nintensity = 0\n\
         [[camera]]\nname = 'c'\nposition = [0, 0, 0]\nlook_at = [0, 0, -1]\n\
         viewpoint_distance = {FOCUS}\nviewing_height = {}\n{lens}\n\
         [material.lamp]\ncolour = '#000000'\nemission = '#ffffff'\n{objects}",
        f64::from(SIZE[1]) / PIXELS,
    )
}

/// A ball whose image has a radius of 2 pixels, at a distance.
const IMAGE: f64 = 2.0;

fn ball(distance: f64) -> String {
    let radius = IMAGE / PIXELS * distance / FOCUS;
    format!("[[sphere]]\ncentre = [0, 0, -{distance}]\nradius = {radius}\nmaterial = 'lamp'\n")
}

fn settings(samples: u32, transport: Transport) -> RenderSettings {
    PictureSettings {
        samples: Some(Samples::clamped(samples)),
        filter: Some(FilterShape::Box),
        transport: Some(transport),
        ..PictureSettings::of_size(SIZE)
    }
    .into()
}

fn job(scene: &str, settings: &RenderSettings) -> RenderJob {
    prepare(parse(scene), settings, &mut Warnings::default()).expect("a job")
}

fn film(job: &RenderJob) -> Film {
    job.render(&RenderControl::default()).expect("a picture").0
}

/// The mean square distance of light from its centre, in pixels.
fn second_moment(film: &Film) -> f64 {
    let pixels = || (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y)));
    let lights = || pixels().map(|(x, y)| (DVec2::new(x.into(), y.into()), f64::from(film.pixel(x, y)[0])));
    let total: f64 = lights().map(|(_, light)| light).sum();
    let centre: DVec2 = lights().map(|(place, light)| place * light).sum::<DVec2>() / total;
    lights().map(|(place, light)| place.distance_squared(centre) * light).sum::<f64>() / total
}

/// A point at the distance S is seen through a lens of radius r, focused at F, as a disc of radius r |S - F| / S of the plane of
/// focus, which is the circle of confusion over the magnification. Its second moment, half its square, adds to that of the ball's
/// own image.
#[test]
fn the_circle_of_confusion_is_that_of_a_thin_lens() {
    let radius = 0.1;
    for transport in [Transport::Whitted, Transport::Path] {
        for distance in [2.0, 3.0, FOCUS, 6.0, 12.0] {
            let moment = |lens: &str| {
                second_moment(&film(&job(&scene(lens, &ball(distance)), &settings(512, transport))))
            };
            let lens = format!("aperture_radius = {radius}\nfocus_distance = {FOCUS}");
            let found = 2.0 * (moment(&lens) - moment(""));
            let expected = radius * (distance - FOCUS).abs() / distance * PIXELS;
            // Two percent of the radius; in the plane of focus, one of the ball's own second moment.
            let tolerance = (0.04 * expected * expected).max(0.01 * IMAGE * IMAGE / 2.0);
            let error = found - expected * expected;
            assert!(error.abs() <= tolerance, "{transport:?} at {distance}: {found}, off by {error}");
        }
    }
}

/// Corners at the distance r have a second moment of r^2 (2 + cos(2 pi / n)) / 6: tests of `world::lens`.
#[test]
fn blades_make_the_disc_a_polygon() {
    let lens = format!("aperture_radius = 0.1\nblades = 3\nfocus_distance = {FOCUS}");
    let film = film(&job(&scene(&lens, &ball(12.0)), &settings(512, Transport::Whitted)));
    let radius = 0.1 * 8.0 / 12.0 * PIXELS;
    let expected = radius * radius / 4.0 + IMAGE * IMAGE / 2.0 + 1.0 / 6.0;
    let found = second_moment(&film);
    // Two percent of the radius.
    assert!((found / expected - 1.0).abs() < 0.04, "{found}, expected {expected}");
    // Behind the plane of focus the image is upright, with one corner on the right; the others are above and below on the
    // left, at half the distance.
    let extent = |right: bool| {
        let lit = (0..SIZE[0]).filter(|&x| (0..SIZE[1]).any(|y| film.pixel(x, y)[0] > 0.0));
        let middle = f64::from(SIZE[0]) / 2.0;
        let distances = lit.map(|x| f64::from(x) + 0.5 - middle).map(|x| if right { x } else { -x });
        distances.fold(0.0, f64::max)
    };
    assert!((extent(true) - radius - IMAGE).abs() < 2.0, "{}", extent(true));
    assert!((extent(false) - radius / 2.0 - IMAGE).abs() < 1.0, "{}", extent(false));
}

/// The edges of a square in the plane of focus lie between pixels: every sample sees what the pinhole sees.
#[test]
fn the_plane_of_focus_is_sharp() {
    let half = 16.0 / PIXELS;
    let square = format!(
        "[[triangles]]\nmaterial = 'lamp'\nindices = [[0, 1, 2], [0, 2, 3]]\nvertices = [[-{half}, -{half}, -{FOCUS}], \
         [{half}, -{half}, -{FOCUS}], [{half}, {half}, -{FOCUS}], [-{half}, {half}, -{FOCUS}]]\n"
    );
    let lens = format!("aperture_radius = 0.1\nfocus_at = [7, -3, -{FOCUS}]\nblades = 5");
    for transport in [Transport::Whitted, Transport::Path] {
        let of = |lens: &str| film(&job(&scene(lens, &square), &settings(64, transport)));
        let sharp = of(&lens);
        assert_eq!(bits(&sharp, SIZE), bits(&of(""), SIZE));
        assert_eq!((sharp.pixel(16, 16)[0], sharp.pixel(15, 16)[0]), (1.0, 0.0));
        // The test itself: not so with another focus.
        let blurred = of("aperture_radius = 0.1\nfocus_distance = 4.2");
        assert_ne!(bits(&blurred, SIZE), bits(&sharp, SIZE));
    }
}

/// Neither an aperture of 0 nor one that is turned off takes a stage, a byte or a ray, or changes a bit.
#[test]
fn without_an_aperture_it_is_the_pinhole() {
    for transport in [Transport::Whitted, Transport::Path] {
        let settings = settings(4, transport);
        let pinhole = film(&job(&scene("", &ball(2.0)), &settings));
        let closed =
            job(&scene("aperture_radius = 0\nfocus_distance = 3\nblades = 6", &ball(2.0)), &settings);
        let off = RenderSettings { without: vec![id::DEPTH_OF_FIELD.name().into()], ..settings };
        let off = job(&scene("aperture_radius = 0.1", &ball(2.0)), &off);
        for job in [closed, off] {
            assert_eq!(bits(&film(&job), SIZE), bits(&pinhole, SIZE));
            assert!(job.plan.stages().iter().all(|stage| stage.effect != Some(id::DEPTH_OF_FIELD)));
        }
    }
}

/// With an error limit, filters and both transports: a crop, and one thread, have the bits of the whole picture.
#[test]
fn crops_and_threads_have_the_same_bits() {
    let lens = "f_stop = 0.1\nfocus_distance = 3";
    for transport in [Transport::Whitted, Transport::Path] {
        let noise = Some(kiln::scene::Noise::clamped(0.05));
        let picture =
            PictureSettings { noise, filter: Some(FilterShape::Gaussian), ..settings(32, transport).picture };
        let whole = job(&scene(lens, &ball(2.0)), &picture.into());
        assert!(whole.plan.is_adaptive());
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
        let alone = pool.install(|| film(&whole));
        let whole = film(&whole);
        assert_eq!(bits(&alone, SIZE), bits(&whole, SIZE));
        let crop = Window { x: 21, y: 30, width: 19, height: 9 };
        let part = job(&scene(lens, &ball(2.0)), &RenderSettings { crop: Some(crop), ..picture.into() });
        let part = film(&part);
        for (x, y) in (0..crop.height).flat_map(|y| (0..crop.width).map(move |x| (x, y))) {
            assert_eq!(part.pixel(x, y), whole.pixel(crop.x + x, crop.y + y), "{x} {y}");
        }
    }
}

/// The focus of a job: of the first surface in the centre, or, where nothing is there, of the target.
#[test]
fn what_is_in_the_centre_is_in_focus() {
    let none = RenderSettings::default();
    let focus = |scene: &str| job(scene, &none).view.lens().expect("a lens").focus;
    let in_front = format!("{}[[sphere]]\ncentre = [0, 0, -6]\nradius = 0.5\nmaterial = 'lamp'\n", ball(9.0));
    assert_eq!(focus(&scene("aperture_radius = 0.1", &in_front)), 5.5);
    let beside = "[[sphere]]\ncentre = [2, 0, -6]\nradius = 0.5\nmaterial = 'lamp'\n";
    assert_eq!(focus(&scene("aperture_radius = 0.1", beside)), 1.0);
    // A point behind the camera is an error, but not of a picture without a lens.
    let behind = scene("aperture_radius = 0.1\nfocus_at = [0, 0, 1]", beside);
    let error = prepare(parse(&behind), &none, &mut Warnings::default()).err().expect("no focus");
    assert!(error.to_string().contains("`c` focuses behind itself"), "{error}");
    let off = RenderSettings { without: vec![id::DEPTH_OF_FIELD.name().into()], ..none };
    assert!(job(&behind, &off).view.lens().is_none());
}

/// A fitted camera's target is in the plane of the centre of the bounds. Asked for without a value, the diameter of the lens is 0.05 of
/// the height of the plane of focus, and 0.2 of it with that value.
#[test]
fn it_can_be_asked_for() {
    let ball = "[[sphere]]\ncentre = [1, 2, 3]\nradius = 0.5\n";
    for (value, blur) in [("", 0.05), ("=0.2", 0.2)] {
        let with = vec![format!("{}{value}", id::DEPTH_OF_FIELD)];
        let settings = RenderSettings { with, ..PictureSettings::of_size(SIZE).into() };
        let job = job(ball, &settings);
        let lens = job.view.lens().expect("a lens");
        assert!((lens.focus / job.camera.viewpoint_distance - 1.0).abs() < 1e-12, "{lens:?}");
        assert!((lens.radius / (blur * job.camera.view_height / 2.0) - 1.0).abs() < 1e-12, "{lens:?}");
        // One sample is noise; but who says so gets it.
        assert_eq!(job.plan_settings.sampling.samples, Some(64));
        let one = PictureSettings { samples: Some(Samples::clamped(1)), ..settings.picture };
        let one = prepare(
            parse(ball),
            &RenderSettings { picture: one, ..settings.clone() },
            &mut Warnings::default(),
        );
        assert_eq!(one.expect("a job").plan_settings.sampling.samples, Some(1));
        let flat = RenderSettings { projection: Some(Projection::Orthographic), ..settings };
        let error = prepare(parse(ball), &flat, &mut Warnings::default()).err().expect("no lens");
        assert!(error.to_string().contains("only perspective cameras have a lens"), "{error}");
    }
}
