//! Tests of `inspect`.

use std::sync::Arc;

use glam::DVec2;

use super::*;
use kiln::bvh::detail::Layout;
use kiln::effects::PlanSettings;
use kiln::error::Warnings;
use kiln::scene::{Camera, Numerics, Projection, Scene};
use kiln::world::{World, recenter};

struct Ready {
    job: RenderJob,
    bounds: Option<(DVec3, DVec3)>,
}

fn assignment() -> Scene {
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/assignment.toml");
    kiln::import::load(&[file], &mut Warnings::default()).unwrap()
}

/// The scene in the tier `double`, at 101 x 101 pixels.
fn ready(mut scene: Scene, camera: &Camera) -> Ready {
    let recentering = recenter(&mut scene);
    let camera = recentering.map_or(camera.clone(), |recentering| recentering.moved(camera));
    let bounds = scene.bounds();
    let pipeline = scene.picture.pipeline();
    let plan_settings = PlanSettings { sampling: scene.picture.sampling(), ..PlanSettings::default() };
    let world = World::prepare(scene, pipeline, Layout::default(), Numerics::Double);
    let job = RenderJob::new(Arc::new(world), recentering, camera, [101, 101], plan_settings).unwrap();
    Ready { job, bounds }
}

impl Ready {
    fn inspect(&self, pixel: [u32; 2]) -> Inspection {
        inspect(&self.job, self.bounds, [DisplayTransform::default(); 2], pixel).unwrap()
    }
}

/// A camera whose middle pixel has its centre at `target`.
fn towards(position: DVec3, target: DVec3) -> Camera {
    Camera::from_field_of_view("c".into(), position, target, DVec3::Y, 0.2)
}

/// From (100, -400, 350) towards the middle of the right sphere, (100, -400, 1350) of radius 100: along +z, hit at
/// 1250 in a distance of 900, where the normal is -z.
fn middle_of_the_right_sphere() -> Camera {
    towards(DVec3::new(100.0, -400.0, 350.0), DVec3::new(100.0, -400.0, 1350.0))
}

#[test]
fn the_pixel_in_the_middle_of_a_sphere() {
    let ready = ready(assignment(), &middle_of_the_right_sphere());
    let pixel = ready.inspect([50, 50]);
    let surface = pixel.surface().cloned().unwrap();
    assert_eq!((surface.object.as_str(), surface.primitive, surface.shape), ("right sphere", 1, "sphere"));
    assert_eq!((surface.primitive_of_object, surface.barycentrics), (0, None));
    assert!((surface.t - 900.0).abs() < 1e-9);
    assert!((surface.position - DVec3::new(100.0, -400.0, 1250.0)).length() < 1e-9);
    assert!((surface.geometric_normal + DVec3::Z).length() < 1e-9);
    assert_eq!(surface.material, "midnight-blue");

    // One light: one shadow ray. The camera ray is reflected into itself, along -z above the plane at -500, and
    // misses, so the reflection has no shadow ray.
    let kinds: Vec<&str> = pixel.rays.iter().map(|ray| ray.kind.name).collect();
    assert_eq!(kinds, ["primary", "shadow", "glaze"]);
    let [primary, shadow, glaze] = &pixel.rays[..] else { unreachable!() };
    assert!(primary.hit && !shadow.hit);
    assert!((primary.to - surface.position).length() < 1e-9);
    let rays = &pixel.report.samples[0].rays;
    assert_eq!((rays[0].shadow_rays[0].light.as_deref(), rays.len()), (Some("lamp"), 2));
    // The lamp, at (-400, 100, 850).
    assert!((shadow.to - DVec3::new(-400.0, 100.0, 850.0)).length() < 1e-6);
    assert!((shadow.from - surface.position).length() < 1e-6);
    assert_eq!((rays[1].depth, rays[1].parent, glaze.hit), (1, Some(0), false));
    assert!(((glaze.to - glaze.from).normalize() + DVec3::Z).length() < 1e-9);
    let (min, max) = ready.bounds.unwrap();
    assert!(glaze.to.cmplt(min).any() || glaze.to.cmpgt(max).any(), "it leaves the scene: {}", glaze.to);
}

#[test]
fn a_mirrored_ray_leaves_as_it_came() {
    // Down on the plane y = -500 at (-600, -500, 1000) at 45 degrees along +z: hit at 100 sqrt 2.
    let ready =
        ready(assignment(), &towards(DVec3::new(-600.0, -400.0, 900.0), DVec3::new(-600.0, -500.0, 1000.0)));
    let pixel = ready.inspect([50, 50]);
    let surface = pixel.surface().cloned().unwrap();
    assert_eq!((surface.object.as_str(), surface.shape, surface.primitive), ("plane", "triangle", 2));
    assert!((surface.t - 100.0 * 2f64.sqrt()).abs() < 1e-9);
    // Corners at (-10000, -10000), (-10000, 100000) and (10000, -10000) in x and z: of the way from the first,
    // 11000 / 110000 are towards the second, 9400 / 20000 towards the third.
    for (weight, expected) in surface.barycentrics.unwrap().iter().zip([0.43, 0.1, 0.47]) {
        assert!((weight - expected).abs() < 1e-12, "{weight} {expected}");
    }
    // Mirrored about +y: at 45 degrees upwards along +z.
    let glaze = pixel.rays.iter().find(|ray| ray.kind.name == "glaze").unwrap();
    let direction = (glaze.to - glaze.from).normalize();
    assert!((direction - DVec3::new(0.0, 1.0, 1.0).normalize()).length() < 1e-9, "{direction}");
    // The inspected colour is that of the rendered picture.
    let control = kiln::render::RenderControl::default();
    let (film, _): (kiln::film::Film, _) = ready.job.render(&control).unwrap();
    for [x, y] in [[50, 50], [0, 0], [100, 3], [17, 80]] {
        let pixel = ready.inspect([x, y]);
        assert_eq!(pixel.report.colour.film, Some(film.pixel(x, y)), "{x} {y}");
        assert_eq!(pixel.report.displayed, ready.job.pipeline().encode(film.pixel(x, y)));
    }
}

/// An occluded shadow ray ends at its occluder.
#[test]
fn a_shadow_ray_ends_at_what_is_in_its_way() {
    // Where the line from the lamp (-400, 100, 850) through the middle of the left sphere (-300, -425, 1200) meets
    // the plane, at y = -500: 600 / 525 of the way.
    let (lamp, middle) = (DVec3::new(-400.0, 100.0, 850.0), DVec3::new(-300.0, -425.0, 1200.0));
    let shaded = lamp + (middle - lamp) * (600.0 / 525.0);
    let ready = ready(assignment(), &towards(shaded + DVec3::new(-300.0, 200.0, 200.0), shaded));
    let pixel = ready.inspect([50, 50]);
    let shadow = pixel.rays.iter().find(|ray| ray.kind.is_shadow).unwrap();
    assert!(shadow.hit);
    let occluder = pixel.report.samples[0].rays[0].shadow_rays[0].occluder.clone().unwrap();
    assert_eq!(occluder.object, "left sphere");
    assert!(((shadow.to - middle).length() - 75.0).abs() < 1e-6, "on the sphere");
    assert!((shadow.to - shadow.from).length() < 2.0 * 75.0, "the near side");
}

#[test]
fn a_pixel_that_sees_nothing() {
    let ready = ready(assignment(), &towards(DVec3::new(0.0, 0.0, 0.0), DVec3::new(0.0, 1.0, -0.1)));
    let pixel = ready.inspect([50, 50]);
    assert!(pixel.surface().is_none());
    assert_eq!((pixel.report.displayed, pixel.rays.len()), ([0; 3], 1));
    assert!(!pixel.rays[0].hit);
}

/// The rays are those of the first sample: without antialiasing through the pixel's centre.
#[test]
fn the_rays_are_those_of_the_first_sample() {
    let mut scene = assignment();
    let camera = scene.cameras[0].clone();
    let one = ready(scene.clone(), &camera);
    scene.picture.samples = Some(kiln::scene::Samples::clamped(9));
    let nine = ready(scene, &camera);
    let (a, b) = (one.inspect([40, 60]), nine.inspect([40, 60]));
    assert_eq!((a.report.samples_taken, b.report.samples_taken, b.report.samples.len()), (1, 9, 9));
    assert_eq!(a.report.samples[0].film_position, [40.5, 60.5]);
    let [x, y] = b.report.samples[0].film_position;
    let [through, _] = nine.job.view.project_segment(b.rays[0].from, b.rays[0].to).unwrap();
    assert!((through - DVec2::new(x, y)).length() < 1e-9, "{through} {x} {y}");
}

/// Positions and distances are in scene coordinates, also if the scene was recentered: a sphere of radius 2 at a
/// distance of 1e6.
#[test]
fn a_moved_scene_speaks_of_its_own_places() {
    let text = "[[sphere]]\ncentre = [1e6, 0, 1e6]\nradius = 2\n";
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.toml");
    std::fs::write(&file, text).unwrap();
    let scene = kiln::import::load(&[file], &mut Warnings::default()).unwrap();
    let far = DVec3::new(1e6, 0.0, 1e6);
    let mut camera = towards(far + DVec3::Z * 10.0, far);
    camera.projection = Projection::Orthographic;
    let ready = ready(scene, &camera);
    assert!(ready.job.recentering.is_some());
    let pixel = ready.inspect([50, 50]);
    let surface = pixel.surface().unwrap();
    assert!((surface.position - (far + DVec3::Z * 2.0)).length() < 1e-9 && (surface.t - 8.0).abs() < 1e-9);
    let [from, to] = ready.job.view.project_segment(pixel.rays[0].from, pixel.rays[0].to).unwrap();
    assert!((from - DVec2::splat(50.5)).length() < 1e-9 && (to - from).length() < 1e-9, "{from} {to}");
}
