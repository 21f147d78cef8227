//! Properties of each navigation function, tested by projected points ([`View::project`]), at all scales.

use proptest::prelude::*;

use super::*;
use kiln::bvh::Sphere;
use kiln::scene::{Scene, Shape};
use kiln::world::{StandardView, fitted_camera};

/// Picture height in pixels.
const PIXELS: u32 = 1000;

fn cameras() -> impl Strategy<Value = Camera> {
    let point = || [-3.0..3.0, -3.0..3.0, -3.0..3.0].prop_map(DVec3::from);
    let up = prop_oneof![4 => Just(DVec3::Y), 1 => Just(DVec3::Z), 1 => point()];
    let lens = (0.1f64..5.0, prop::option::of(0.1f64..5.0), 0.2f64..20.0);
    (point(), point(), up, any::<bool>(), lens, -9i32..9).prop_filter_map(
        "stands apart and has an up",
        |(position, target, up, parallel, (height, width, distance), exponent)| {
            let scale = 10f64.powi(exponent);
            let way = position - target;
            let apart = way.length() > 0.1 && up.length() > 0.1;
            // View directions almost parallel to up are ill-conditioned.
            (apart && up.normalize().cross(way.normalize()).length() > 0.01).then(|| Camera {
                name: "c".into(),
                position: position * scale,
                target: target * scale,
                up,
                projection: if parallel { Projection::Orthographic } else { Projection::Perspective },
                view_height: height * scale,
                view_width: width.map(|width| width * scale),
                viewpoint_distance: distance * scale,
                lens: None,
                sensor: kiln::scene::Sensor::default(),
                fitted: false,
            })
        },
    )
}

fn angles() -> impl Strategy<Value = DVec2> {
    [-4.0f64..4.0, -4.0f64..4.0].prop_map(DVec2::from)
}

fn view(camera: &Camera, aspect: f64) -> View {
    let width = (f64::from(PIXELS) * aspect).round() as u32;
    View::new(camera, camera.projection, [width, PIXELS]).expect("a usable camera")
}

/// The projected position relative to the picture's centre, in fractions of its height, with y up.
fn projected(camera: &Camera, aspect: f64, point: DVec3) -> DVec2 {
    let view = view(camera, aspect);
    let [width, height] = view.size().map(f64::from);
    let pixel = view.project(point).0;
    DVec2::new(pixel.x - width / 2.0, height / 2.0 - pixel.y) / height
}

/// Orbits around the camera's target.
fn orbit_target(camera: &mut Camera, by: DVec2) {
    orbit(camera, by, camera.target);
}

fn distance(camera: &Camera) -> f64 {
    camera.position.distance(camera.target)
}

fn axes(camera: &Camera) -> [DVec3; 3] {
    basis(camera.position, camera.target, camera.up).expect("a direction")
}

/// A point beside the target, at its distance.
fn beside(camera: &Camera, x: f64, y: f64) -> DVec3 {
    let [u, v, _] = axes(camera);
    camera.target + (x * u + y * v) * distance(camera)
}

fn elevation(camera: &Camera) -> f64 {
    let pose = CameraPose::of(camera).unwrap();
    pose.w.dot(vertical(camera, &pose)).clamp(-1.0, 1.0).asin()
}

proptest! {
    /// A point beside the target that is orbited keeps its position in the picture and its depth, and a camera that pans,
    /// flies or zooms takes it along.
    #[test]
    fn the_point_that_is_orbited_stays_where_it_is(
        before in cameras(),
        by in angles(),
        beside in [-0.3f64..0.3, -0.3..0.3, -0.3..0.3].prop_map(DVec3::from),
        factor in 0.5f64..2.0,
    ) {
        let place = |camera: &Camera, point: DVec3| {
            let [u, v, w] = axes(camera);
            let by = (point - camera.target) / distance(camera);
            DVec3::new(by.dot(u), by.dot(v), by.dot(w))
        };
        let point = before.target + beside * distance(&before);
        let mut camera = before.clone();
        orbit(&mut camera, by, point);
        prop_assert!((place(&camera, point) - place(&before, point)).length() < 1e-7);
        let mut moved = camera.clone();
        pan(&mut moved, by / 8.0, 1.5);
        fly(&mut moved, DVec3::new(0.1, 0.2, 0.3));
        if moved.projection == Projection::Perspective {
            zoom(&mut moved, factor);
        }
        let carried = carried(point, &camera, &moved);
        prop_assert!((place(&moved, carried) - place(&before, point)).length() < 1e-7);
    }

    #[test]
    fn orbiting_keeps_distance_lens_and_level(mut camera in cameras(), steps in prop::collection::vec(angles(), 1..20)) {
        let before = camera.clone();
        let axis = vertical(&camera, &CameraPose::of(&camera).unwrap());
        for by in steps {
            orbit_target(&mut camera, by);
            let [u, v, _] = axes(&camera);
            prop_assert!((distance(&camera) / distance(&before) - 1.0).abs() < 1e-12);
            prop_assert!(u.dot(axis).abs() < 1e-9, "level: {}", u.dot(axis));
            prop_assert!(v.dot(axis) > 0.0, "never upside down");
        }
        prop_assert_eq!(camera.target, before.target);
        prop_assert_eq!((camera.view_height, camera.view_width), (before.view_height, before.view_width));
        prop_assert_eq!(camera.viewpoint_distance, before.viewpoint_distance);
    }

    #[test]
    fn there_and_back(camera in cameras(), by in angles(), first in angles()) {
        let mut level = camera.clone();
        // A camera with roll is level after its first step.
        orbit_target(&mut level, first);
        let by = DVec2::new(by.x, by.y.clamp(-1.5 - elevation(&level), 1.5 - elevation(&level)));
        let mut moved = level.clone();
        orbit_target(&mut moved, by);
        orbit_target(&mut moved, -by);
        // At the minimum angle to a pole, the right axis keeps eleven digits.
        prop_assert!((moved.position - level.position).length() < 1e-9 * distance(&level));
        let mut moved = level.clone();
        look_around(&mut moved, DVec2::new(by.x, -by.y));
        look_around(&mut moved, DVec2::new(-by.x, by.y));
        prop_assert!((moved.target - level.target).length() < 1e-9 * distance(&level));
        let mut moved = level.clone();
        pan(&mut moved, by, 1.5);
        pan(&mut moved, -by, 1.5);
        fly(&mut moved, by.extend(0.5));
        fly(&mut moved, -by.extend(0.5));
        zoom(&mut moved, 3.0);
        zoom(&mut moved, 1.0 / 3.0);
        // Rounding of the new position and target rotates the backward axis by up to `turn`, and the right axis by
        // more, the nearer up is to the view direction. The way back has the same length, along the rotated axes. Six
        // steps round two points by half an epsilon each: a factor of 6; 16 allows for the larger rotation at the
        // smaller distance between the zooms.
        let pose = CameraPose::of(&level).unwrap();
        let size = pose.distance.max(height_at_target(&level, &pose, 1.5));
        let way = (by.length() + 0.5) * size;
        let rounding = f64::EPSILON * (way + level.target.length() + pose.distance);
        let turn = rounding / pose.distance / level.up.normalize().cross(pose.w).length();
        prop_assert!((moved.position - level.position).length() <= 16.0 * (rounding + turn * way));
        prop_assert!((field_of_view(&moved) - field_of_view(&level)).abs() < 1e-12 || moved.projection == Projection::Orthographic);
    }

    /// Elevation is clamped at the pole; from there the camera can be rotated in any direction.
    #[test]
    fn poles_neither_flip_nor_hold(mut camera in cameras(), up in prop::sample::select(vec![1.0, -1.0]), turn in 0.1f64..3.0) {
        let axis = vertical(&camera, &CameraPose::of(&camera).unwrap());
        orbit_target(&mut camera, DVec2::new(0.3, 0.0));
        let right = axes(&camera)[0];
        (0..10).for_each(|_| orbit_target(&mut camera, DVec2::new(0.0, up * 0.7)));
        prop_assert!((elevation(&camera) * up - (FRAC_PI_2 - POLE)).abs() < 1e-9);
        prop_assert!((axes(&camera)[0] - right).length() < 1e-9, "the picture does not turn on the way");
        orbit_target(&mut camera, DVec2::new(turn, 0.0));
        let turned = axes(&camera)[0];
        prop_assert!((turned.dot(right) - turn.cos()).abs() < 1e-9 && (right.cross(turned).dot(axis) - turn.sin()).abs() < 1e-9);
        orbit_target(&mut camera, DVec2::new(0.0, -up * 0.5));
        prop_assert!((elevation(&camera) * up - (FRAC_PI_2 - POLE - 0.5)).abs() < 1e-9);
        prop_assert!((axes(&camera)[0] - turned).length() < 1e-9);
    }

    #[test]
    fn panning_moves_the_picture(camera in cameras(), by in angles(), at in angles(), aspect in 0.3f64..3.0) {
        let aspect = (aspect * f64::from(PIXELS)).round() / f64::from(PIXELS);
        let point = beside(&camera, at.x, at.y);
        let mut moved = camera.clone();
        pan(&mut moved, by, aspect);
        let [before, after] = [&camera, &moved].map(|camera| projected(camera, aspect, point));
        // Far outside the picture, positions are large numbers.
        let size = 1.0 + before.abs().max_element() + by.abs().max_element();
        prop_assert!((after - before - by).length() < 1e-9 * size, "{before} {after} {by}");
        prop_assert!((distance(&moved) / distance(&camera) - 1.0).abs() < 1e-9 * size);
    }

    #[test]
    fn zooming_enlarges_the_target(camera in cameras(), factor in 0.01f64..100.0, at in angles(), aspect in 0.3f64..3.0) {
        let aspect = (aspect * f64::from(PIXELS)).round() / f64::from(PIXELS);
        // A small offset: the point stays beside the target, at its distance, before and after.
        let point = beside(&camera, 1e-3 * at.x, 1e-3 * at.y);
        let before = projected(&camera, aspect, point);
        let mut zoomed = camera.clone();
        zoom(&mut zoomed, factor);
        let after = projected(&zoomed, aspect, point);
        prop_assert!((after - factor * before).length() <= 1e-9 * (1.0 + factor) * (1.0 + before.length()), "{before} {after}");
        // Also in the other projection.
        for projection in [Projection::Perspective, Projection::Orthographic] {
            let mut switched = zoomed.clone();
            switched.projection = projection;
            prop_assert!((projected(&switched, aspect, point) - after).length() <= 1e-9 * (1.0 + after.length()));
            let mut switched = zoomed.clone();
            switch_projection(&mut switched, projection, 0.7);
            prop_assert!((projected(&switched, aspect, point) - after).length() <= 1e-9 * (1.0 + after.length()));
        }
        // The point under the mouse keeps its position.
        let half = DVec2::new(aspect, 1.0) / 2.0;
        let mouse = at / 4.0 * half;
        let mut zoomed = camera.clone();
        let pose = CameraPose::of(&camera).unwrap();
        let height = height_at_target(&camera, &pose, aspect);
        let under = camera.target + (mouse.x * pose.u + mouse.y * pose.v) * height;
        prop_assert!((projected(&camera, aspect, under) - mouse).length() < 1e-9);
        zoom_at(&mut zoomed, factor, mouse, aspect);
        prop_assert!((projected(&zoomed, aspect, under) - mouse).length() < 1e-7 * (1.0 + factor), "{}", projected(&zoomed, aspect, under));
        // At any depth in front of the camera.
        let deep = camera.position - pose.distance * (0.3 * pose.w - 0.05 * at.x * pose.u - 0.05 * at.y * pose.v);
        let mut zoomed = camera.clone();
        zoom_about(&mut zoomed, factor, deep);
        let (before, after) = (projected(&camera, aspect, deep), projected(&zoomed, aspect, deep));
        prop_assert!((before - after).length() < 1e-7 * (1.0 + factor) * (1.0 + before.length()), "{before} {after}");
    }

    #[test]
    fn the_angle_of_view_is_what_was_set(camera in cameras(), angle in 0.01f64..2.8) {
        let point = beside(&camera, 0.01, 0.02);
        let mut set = camera.clone();
        set_field_of_view(&mut set, angle);
        prop_assert!((field_of_view(&set) - angle).abs() < 1e-9);
        match camera.projection {
            Projection::Perspective => prop_assert_eq!(set.position, camera.position),
            _ => {
                prop_assert!((projected(&set, 1.0, point) - projected(&camera, 1.0, point)).length() < 1e-9);
            }
        }
        let mut set = camera.clone();
        set_lens(&mut set, angle);
        let (before, after) = (projected(&camera, 1.0, point), projected(&set, 1.0, point));
        prop_assert!((field_of_view(&set) - angle).abs() < 1e-9);
        prop_assert!((before - after).length() < 1e-9 * (1.0 + before.length()));
        prop_assert_eq!(set.target, camera.target);
    }

    #[test]
    fn what_is_focused_is_in_the_middle(camera in cameras(), at in angles(), depth in -2.0f64..4.0) {
        let pose = CameraPose::of(&camera).unwrap();
        let point = beside(&camera, at.x, at.y) - (depth - 1.0) * pose.distance * pose.w;
        let mut focused = camera.clone();
        focus(&mut focused, point);
        prop_assert_eq!(focused.target, point);
        let [u, v, w] = axes(&focused);
        for (a, b) in [u, v, w].into_iter().zip([pose.u, pose.v, pose.w]) {
            // The view direction of a camera a thousand times nearer has three digits less.
            prop_assert!((a - b).length() < 1e-9);
        }
        prop_assert!(distance(&focused) <= pose.distance * (1.0 + 1e-12));
        let kept = (field_of_view(&focused) - field_of_view(&camera)).abs() < 1e-9;
        prop_assert!(kept);
    }

    #[test]
    fn looking_around_stays_and_flying_goes(camera in cameras(), by in angles(), way in angles()) {
        let mut level = camera.clone();
        look_around(&mut level, DVec2::ZERO);
        prop_assert_eq!(level.position, camera.position);
        let mut looked = level.clone();
        look_around(&mut looked, DVec2::new(by.x * 0.1, 0.0));
        prop_assert_eq!(looked.position, camera.position);
        prop_assert!((distance(&looked) / distance(&camera) - 1.0).abs() < 1e-12);
        // Looking to the right moves a point on the right to the centre.
        let [u, _, w] = axes(&level);
        let forward = -axes(&looked)[2];
        prop_assert!(forward.dot(u) * by.x >= 0.0, "{} {}", forward.dot(u), by.x);
        let mut raised = level.clone();
        look_around(&mut raised, DVec2::new(0.0, 0.001));
        let axis = vertical(&level, &CameraPose::of(&level).unwrap());
        prop_assert!((-axes(&raised)[2]).dot(axis) >= (-w).dot(axis));
        let mut flown = level.clone();
        fly(&mut flown, DVec3::new(way.x, 0.0, way.y));
        let gone = (flown.position - level.position) / distance(&level);
        prop_assert!((gone - (way.x * u - way.y * w)).length() < 1e-9);
        prop_assert!((flown.target - level.target - (flown.position - level.position)).length() < 1e-9 * distance(&level));
    }

    /// Any change of any camera gives a valid camera, or leaves it unchanged.
    #[test]
    fn nothing_leads_out_of_the_numbers(
        camera in cameras(),
        steps in prop::collection::vec((0..8, any::<f64>(), any::<f64>(), any::<f64>()), 1..30),
    ) {
        let mut camera = camera;
        for (what, x, y, z) in steps {
            let by = DVec2::new(x, y);
            match what {
                0 => orbit_target(&mut camera, by),
                1 => look_around(&mut camera, by),
                2 => pan(&mut camera, by, z),
                3 => zoom(&mut camera, x),
                4 => zoom_at(&mut camera, x, DVec2::new(y, z), 1.5),
                5 => fly(&mut camera, by.extend(z)),
                6 => focus(&mut camera, by.extend(z)),
                _ => set_field_of_view(&mut camera, x),
            }
            for projection in [Projection::Perspective, Projection::Orthographic] {
                prop_assert!(View::new(&camera, projection, [3, 2]).is_ok(), "{what} {x} {y} {z}: {camera:?}");
            }
        }
    }
}

#[test]
fn zooming_in_ends_before_the_digits_do() {
    let mut camera =
        Camera::from_field_of_view("c".into(), DVec3::new(5.0, 7.0, 9.0), DVec3::ONE, DVec3::Y, 0.7);
    let before = axes(&camera)[2];
    (0..10_000).for_each(|_| zoom(&mut camera, 1.5));
    assert!((axes(&camera)[2] - before).length() < 1e-6, "the direction stays");
    (0..100).for_each(|_| zoom(&mut camera, 1.0 / 1.5));
    assert!(distance(&camera) > 1e3);
}

#[test]
fn a_fitted_camera_turns_about_the_scenes_vertical() {
    let ball = Sphere { centre: DVec3::ZERO, radius: 2.0 };
    let scene = Scene::from_iter([Shape::Analytic(ball.into())]);
    for view in StandardView::ALL {
        for projection in [Projection::Perspective, Projection::Orthographic] {
            let mut camera = fitted_camera(&scene, view, 1.0, projection).unwrap();
            let before = axes(&camera);
            // By zero angles: the picture stays the same, except for the clamping at the poles, a hundredth of a pixel.
            orbit_target(&mut camera, DVec2::ZERO);
            assert_eq!(camera.up, DVec3::Y, "{view:?}");
            for (a, b) in axes(&camera).into_iter().zip(before) {
                assert!((a - b).length() < 2.0 * POLE, "{view:?}: {a} {b}");
            }
        }
    }
}

#[test]
fn switching_there_and_back_keeps_the_lens() {
    let mut camera =
        Camera::from_field_of_view("c".into(), DVec3::new(5.0, 7.0, 9.0), DVec3::ONE, DVec3::Y, 0.7);
    let before = camera.clone();
    switch_projection(&mut camera, Projection::Orthographic, 0.7);
    zoom(&mut camera, 10.0);
    assert_eq!(camera.position, before.position);
    switch_projection(&mut camera, Projection::Perspective, 0.7);
    assert!((field_of_view(&camera) - 0.7).abs() < 1e-12);
    assert!((distance(&camera) * 10.0 / distance(&before) - 1.0).abs() < 1e-12);
}

/// Heights of the picture at the target: 2 * 10 * tan(0.35), of a scene of size 10.
#[test]
fn zooming_ends_in_proportion_to_the_scene() {
    let size = 10.0;
    for projection in [Projection::Perspective, Projection::Orthographic] {
        for (step, end) in [(2.0, HEIGHTS[0] * size), (0.5, HEIGHTS[1] * size)] {
            let mut camera =
                Camera::from_field_of_view("c".into(), DVec3::Z * 10.0, DVec3::ZERO, DVec3::Y, 0.7);
            camera.projection = projection;
            for _ in 0..100 {
                let factor = limited_zoom(&camera, step, size);
                zoom(&mut camera, factor);
            }
            let pose = CameraPose::of(&camera).unwrap();
            let height = height_at_target(&camera, &pose, f64::INFINITY);
            assert!((height / end - 1.0).abs() < 1e-9, "{projection:?} {height} {end}");
            // The other way is free.
            assert_eq!(limited_zoom(&camera, 1.0 / step, size), 1.0 / step);
        }
    }
}

/// A surface point that is zoomed to stays in front of the camera and in its place of the picture.
#[test]
fn zooming_to_a_surface_does_not_pass_it() {
    let mut camera = Camera::from_field_of_view("c".into(), DVec3::Z * 10.0, DVec3::ZERO, DVec3::Y, 0.7);
    let point = DVec3::new(0.5, 0.25, 4.0);
    let before = projected(&camera, 1.0, point);
    for _ in 0..60 {
        zoom_about(&mut camera, 1.25, point);
        assert!(camera.position.z > point.z);
        assert!((projected(&camera, 1.0, point) - before).length() < 1e-6);
    }
    // 6 * 1.25^-60 = 9.2e-6 above the surface.
    assert!((camera.position.z - point.z) < 1e-5);
}
