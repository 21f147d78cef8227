//! Tests of `inspect`.

use super::*;
use crate::bvh::Layout;
use crate::effects::PlanSettings;
use crate::error::Warnings;
use crate::scene::{Camera, Numerics, Projection, Scene};
use crate::world::recenter;

struct Ready {
    world: World,
    view: View,
    plan: Plan,
    bounds: Option<(DVec3, DVec3)>,
    recentering: Option<Recentering>,
}

fn assignment() -> Scene {
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/assignment.toml");
    crate::import::load(&[file], &mut Warnings::default()).unwrap()
}

/// The scene in the tier `double`, at 101 x 101 pixels.
fn ready(mut scene: Scene, camera: &Camera) -> Ready {
    let recentering = recenter(&mut scene);
    let camera = recentering.map_or(camera.clone(), |recentering| recentering.moved(camera));
    let view = View::new(&camera, camera.projection, [101, 101]).unwrap();
    let bounds = scene.bounds();
    let pipeline = scene.picture.pipeline();
    let plan_settings = PlanSettings { sampling: scene.picture.sampling(), ..PlanSettings::default() };
    let world = World::prepare(scene, pipeline, Layout::default(), Numerics::Double);
    let plan = Plan::new(&world, &plan_settings).unwrap();
    Ready { world, view, plan, bounds, recentering }
}

impl Ready {
    fn inspect(&self, pixel: [u32; 2]) -> Inspection {
        let displays = [DisplayTransform::default(); 2];
        inspect(&self.world, &self.view, &self.plan, self.recentering.as_ref(), self.bounds, displays, pixel)
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
    let surface = pixel.surface.clone().unwrap();
    assert_eq!(
        (surface.object_name.as_str(), surface.primitive, surface.kind),
        ("right sphere", 1, "sphere")
    );
    assert_eq!((surface.object, surface.primitive_of_object, surface.barycentrics), (1, 0, None));
    assert!((surface.distance - 900.0).abs() < 1e-9);
    assert!((surface.position - DVec3::new(100.0, -400.0, 1250.0)).length() < 1e-9);
    assert!((surface.geometric_normal + DVec3::Z).length() < 1e-9);
    assert_eq!(surface.material, "midnight-blue");
    assert!(surface.material_values.contains(&("colour", "#191970".into())), "{:?}", surface.material_values);
    assert!(surface.material_values.contains(&("specular", "3".into())));

    // One light: one shadow ray. The camera ray is reflected into itself, along -z above the plane at -500, and
    // misses, so the reflection has no shadow ray.
    let kinds: Vec<&str> = pixel.rays.iter().map(|ray| ray.kind.name).collect();
    assert_eq!(kinds, ["primary", "shadow", "glaze"]);
    let [primary, shadow, glaze] = &pixel.rays[..] else { unreachable!() };
    assert_eq!((primary.hit, primary.effect, primary.object.as_deref()), (true, None, Some("right sphere")));
    assert_eq!(primary.to, surface.position);
    // The lamp, at (-400, 100, 850).
    assert_eq!(
        (shadow.effect.map(EffectId::name), shadow.light.as_deref(), shadow.hit),
        (Some("shadows"), Some("lamp"), false)
    );
    assert!((shadow.to - DVec3::new(-400.0, 100.0, 850.0)).length() < 1e-6);
    assert!((shadow.from - surface.position).length() < 1e-6);
    assert_eq!((glaze.effect.map(EffectId::name), glaze.depth, glaze.hit), (Some("glaze"), 1, false));
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
    let surface = pixel.surface.clone().unwrap();
    assert_eq!((surface.object_name.as_str(), surface.kind, surface.primitive), ("plane", "triangle", 2));
    assert!((surface.distance - 100.0 * 2f64.sqrt()).abs() < 1e-9);
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
    let whole = Window { x: 0, y: 0, width: 101, height: 101 };
    let control = crate::render::RenderControl::default();
    let (film, _): (crate::film::Film, _) =
        crate::render::render(&ready.world, &ready.view, &ready.plan, whole, |_, _| true, &control).unwrap();
    for [x, y] in [[50, 50], [0, 0], [100, 3], [17, 80]] {
        let pixel = ready.inspect([x, y]);
        assert_eq!(pixel.colour, film.pixel(x, y), "{x} {y}");
        assert_eq!(pixel.displayed, ready.world.pipeline.encode(film.pixel(x, y)));
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
    assert_eq!(shadow.object.as_deref(), Some("left sphere"));
    assert!(((shadow.to - middle).length() - 75.0).abs() < 1e-6, "on the sphere");
    assert!((shadow.to - shadow.from).length() < 2.0 * 75.0, "the near side");
}

#[test]
fn a_pixel_that_sees_nothing() {
    let ready = ready(assignment(), &towards(DVec3::new(0.0, 0.0, 0.0), DVec3::new(0.0, 1.0, -0.1)));
    let pixel = ready.inspect([50, 50]);
    assert_eq!((pixel.surface.as_ref(), pixel.displayed, pixel.rays.len()), (None, [0; 3], 1));
    assert!(!pixel.rays[0].hit);
}

/// The rays do not depend on the number of samples of the picture.
#[test]
fn samples_make_the_colour_and_the_centre_the_rays() {
    let mut scene = assignment();
    let camera = scene.cameras[0].clone();
    let one = ready(scene.clone(), &camera);
    scene.picture.samples = Some(crate::scene::Samples::clamped(9));
    let nine = ready(scene, &camera);
    let (a, b) = (one.inspect([40, 60]), nine.inspect([40, 60]));
    assert_eq!((a.samples, b.samples), (1, 9));
    assert_eq!((&a.rays, &a.surface), (&b.rays, &b.surface));
}

/// Positions and distances are in scene coordinates, also if the scene was recentered: a sphere of radius 2 at a
/// distance of 1e6.
#[test]
fn a_moved_scene_speaks_of_its_own_places() {
    let text = "[[sphere]]\ncentre = [1e6, 0, 1e6]\nradius = 2\n";
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.toml");
    std::fs::write(&file, text).unwrap();
    let scene = crate::import::load(&[file], &mut Warnings::default()).unwrap();
    let far = DVec3::new(1e6, 0.0, 1e6);
    let mut camera = towards(far + DVec3::Z * 10.0, far);
    camera.projection = Projection::Orthographic;
    let ready = ready(scene, &camera);
    assert!(ready.recentering.is_some());
    let pixel = ready.inspect([50, 50]);
    let surface = pixel.surface.unwrap();
    assert!(
        (surface.position - (far + DVec3::Z * 2.0)).length() < 1e-9 && (surface.distance - 8.0).abs() < 1e-9
    );
    let [from, to] = ready.view.project_segment(pixel.rays[0].from, pixel.rays[0].to).unwrap();
    assert!((from - DVec2::splat(50.5)).length() < 1e-9 && (to - from).length() < 1e-9, "{from} {to}");
}
