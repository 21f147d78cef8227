use std::path::Path;

use glam::DVec3;

use super::*;
use crate::scene::{
    AnalyticShape, Camera, Focus, Lens, Light, LightKind, MaterialId, Mesh, Object, Placed, Placement, Shape,
    Sphere,
};

fn scene(motion: Motion, target: Target) -> Scene {
    let object = |name: &str, shape| Object { name: name.into(), input: 0, material: MaterialId(0), shape };
    let corners = [DVec3::ZERO, DVec3::new(2.0, 0.0, 0.0), DVec3::new(0.0, 2.0, 4.0)];
    let mesh = Mesh { positions: corners.to_vec(), triangles: vec![[0, 1, 2]], ..Mesh::default() };
    let placed = Placed::new(mesh.clone().into(), Placement::default());
    Scene {
        cameras: vec![Camera::from_field_of_view("c".into(), DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, 1.0)],
        lights: vec![Light {
            name: "sun".into(),
            colour: crate::film::Colour::from_u8([255; 3]),
            intensity: 1.0,
            kind: LightKind::Directional { direction: DVec3::NEG_Y, angle: 0.0 },
        }],
        objects: vec![
            object("ball", Shape::Analytic(Sphere { centre: DVec3::new(3.0, 1.0, 0.0), radius: 1.0 }.into())),
            object("m/a", Shape::Mesh(mesh)),
            object("m/b", Shape::Placed(placed)),
        ],
        animation: Some(Animation {
            clips: Vec::new(),
            fps: 10.0,
            duration: 4.0,
            repeat: false,
            tracks: vec![Track { target, motion, place: Place::line(Path::new("a.toml"), 7) }],
        }),
        ..Scene::default()
    }
}

fn ball() -> Target {
    Target::Object("ball".into())
}

fn first_sphere(scene: &Scene) -> Sphere {
    let Shape::Analytic(AnalyticShape::Sphere(sphere)) = scene.objects[0].shape else { panic!("a sphere") };
    sphere
}

fn centre(scene: &Scene) -> DVec3 {
    first_sphere(scene).centre
}

/// Focus distances are those of lenses that have one.
#[test]
fn a_focus_distance_moves() {
    let motion = Motion::Lerp {
        property: Property::FocusDistance,
        from: None,
        to: DVec3::splat(6.0),
        easing: Easing::Linear,
    };
    let mut scene = scene(motion, Target::Camera("c".into()));
    let at = |scene: &Scene, time| scene.at(time).map(|scene| scene.cameras[0].lens);
    for lens in [None, Some(Lens::default())] {
        scene.cameras[0].lens = lens;
        assert!(at(&scene, 0.5).unwrap_err().to_string().contains("no `focus_distance`"));
    }
    let lens = |distance| Some(Lens { radius: 1.0, focus: Focus::Distance(distance), ..Lens::default() });
    scene.cameras[0].lens = lens(2.0);
    assert_eq!(at(&scene, 0.25).unwrap(), lens(3.0));
    let Some(Animation { tracks, .. }) = &mut scene.animation else { panic!("an animation") };
    let Motion::Lerp { to, .. } = &mut tracks[0].motion else { panic!("a lerp") };
    *to = DVec3::splat(-2.0);
    assert!(at(&scene, 1.0).unwrap_err().to_string().contains("a focus distance of -2"));
}

#[test]
fn lerp_is_a_plus_b_minus_a_times_t() {
    let to = DVec3::new(5.0, 1.0, 8.0);
    let lerp = Motion::Lerp { property: Property::Position, from: None, to, easing: Easing::Linear };
    let scene = scene(lerp, ball());
    assert_eq!(centre(&scene.at(0.0).unwrap()), DVec3::new(3.0, 1.0, 0.0));
    assert_eq!(centre(&scene.at(0.25).unwrap()), DVec3::new(3.5, 1.0, 2.0));
    assert_eq!(centre(&scene.at(1.0).unwrap()), to);
}

#[test]
fn keys_hold_before_the_first_and_after_the_last() {
    let key = |time, x, easing| Key { time, value: DVec3::splat(x), easing };
    let keys =
        vec![key(1.0, 2.0, Easing::Linear), key(2.0, 4.0, Easing::EaseIn), key(3.0, 1.0, Easing::Hold)];
    let scene = scene(Motion::Keys { property: Property::Radius, keys }, ball());
    let radius = |seconds: f64| first_sphere(&scene.at(seconds / 4.0).unwrap()).radius;
    // Half of the way to 4 by the cube of a half: an eighth of 2.
    assert_eq!([0.0, 1.0, 1.5, 2.0, 2.9, 3.0, 4.0].map(radius), [2.0, 2.0, 2.25, 4.0, 4.0, 1.0, 1.0]);
}

#[test]
fn an_orbit_keeps_its_radius_and_comes_back() {
    let around = DVec3::new(1.0, -7.0, 0.5);
    let orbit = |turns| Motion::Orbit { property: Property::Position, around, axis: DVec3::Y, turns };
    let [left, right] = [1.0, -2.0].map(|turns| scene(orbit(turns), ball()));
    let start = centre(&left);
    // In the plane: (2, -0.5).
    let radius = 4.25f64.sqrt();
    for i in 0..=300 {
        let time = f64::from(i) / 300.0;
        for scene in [&left, &right] {
            let now = centre(&scene.at(time).unwrap());
            let off = now - around;
            assert!((off.x.hypot(off.z) / radius - 1.0).abs() < 1e-12, "frame {i}");
            assert!((now.y - start.y).abs() < 1e-12);
        }
    }
    assert_eq!([centre(&left.at(1.0).unwrap()), centre(&right.at(1.0).unwrap())], [start; 2]);
    // A quarter turn about +y takes +z to +x and +x to -z: (2, -0.5) to (-0.5, -2). Two turns back, at an eighth of the
    // time, are a quarter turn the other way: (0.5, 2).
    let quarter = centre(&left.at(0.25).unwrap()) - around;
    assert!((quarter - DVec3::new(-0.5, 8.0, -2.0)).length() < 1e-12, "{quarter}");
    let other = centre(&right.at(0.125).unwrap()) - around;
    assert!((other - DVec3::new(0.5, 8.0, 2.0)).length() < 1e-12, "{other}");
}

#[test]
fn meshes_are_turned_as_a_whole_in_all_their_parts() {
    // Half a turn about the vertical axis through (1, 0, 0): x becomes 2 - x, z becomes -z.
    let orbit = Motion::Orbit { property: Property::Position, around: DVec3::X, axis: DVec3::Y, turns: 1.0 };
    let turned = scene(orbit, Target::Object("m".into())).at(0.5).unwrap();
    let Shape::Mesh(mesh) = &turned.objects[1].shape else { panic!("a mesh") };
    let Shape::Placed(placed) = &turned.objects[2].shape else { panic!("a placed mesh") };
    let expected = [DVec3::new(2.0, 0.0, 0.0), DVec3::ZERO, DVec3::new(2.0, 2.0, -4.0)];
    for (i, expected) in expected.into_iter().enumerate() {
        assert!((mesh.positions[i] - expected).length() < 1e-12);
        assert_eq!(placed.corners_of(0)[i], mesh.positions[i]);
    }
}

#[test]
fn meshes_are_rotated_and_scaled_about_their_middle() {
    // The box of the mesh reaches from (0, 0, 0) to (2, 2, 4): its middle is (1, 1, 2).
    let value = |property, to| Motion::Lerp { property, from: None, to, easing: Easing::Linear };
    let corner = |motion| {
        let scene = scene(motion, Target::Object("m".into())).at(1.0).unwrap();
        let Shape::Mesh(mesh) = &scene.objects[1].shape else { panic!("a mesh") };
        mesh.positions[1]
    };
    assert_eq!(corner(value(Property::Scale, DVec3::splat(2.0))), DVec3::new(3.0, -1.0, -2.0));
    assert_eq!(corner(value(Property::Translate, DVec3::ONE)), DVec3::new(3.0, 1.0, 1.0));
    // A quarter turn about x takes (1, -1, -2) to (1, 2, -1).
    let turned = corner(value(Property::Rotate, DVec3::X * 90.0));
    assert!((turned - DVec3::new(2.0, 3.0, 1.0)).length() < 1e-12, "{turned}");
}

#[test]
fn cameras_look_where_things_are_by_then() {
    let to = DVec3::new(3.0, 9.0, 0.0);
    let lerp = Motion::Lerp { property: Property::Position, from: None, to, easing: Easing::Linear };
    let mut scene = scene(lerp, ball());
    let look = Motion::LookAt { goal: Goal::Object("ball".into()), offset: DVec3::NEG_Y };
    let place = Place::line(Path::new("a.toml"), 9);
    let tracks = &mut scene.animation.as_mut().unwrap().tracks;
    tracks.push(Track { target: Target::Camera("c".into()), motion: look, place });
    assert_eq!(scene.at(0.5).unwrap().cameras[0].target, DVec3::new(3.0, 4.0, 0.0));
    assert!(scene.animation.as_ref().unwrap().moves_surfaces(&scene));
    // Look-at objects that do not move are replaced by points, so that the objects can be removed.
    let animation = scene.animation.as_mut().unwrap();
    animation.tracks.remove(0);
    let settled = scene.animation.as_ref().unwrap().without_objects(&scene).unwrap();
    let empty = Scene { objects: Vec::new(), animation: Some(settled), ..scene.clone() };
    assert_eq!(empty.at(0.5).unwrap().cameras, scene.at(0.5).unwrap().cameras);
}

#[test]
fn what_cannot_be_is_said_with_its_line() {
    let number =
        |property, to| Motion::Lerp { property, from: None, to: DVec3::splat(to), easing: Easing::Linear };
    for (motion, target, expected) in [
        (
            number(Property::Radius, 1.0),
            Target::Object("bell".into()),
            "a.toml:7: there is no object `bell` to animate",
        ),
        (number(Property::Radius, -1.0), ball(), "a.toml:7: comes to a radius of -1"),
        (number(Property::Translate, 1.0), ball(), "a.toml:7: a sphere has no `translate`"),
        (number(Property::Position, 1.0), Target::Object("m".into()), "a.toml:7: a mesh has no `position`"),
        (
            number(Property::Position, 1.0),
            Target::Light("sun".into()),
            "a.toml:7: a directional light has no `position`",
        ),
        (
            number(Property::Intensity, -2.0),
            Target::Light("sun".into()),
            "a.toml:7: comes to an intensity of -2",
        ),
    ] {
        let e = scene(motion, target).at(1.0).unwrap_err();
        assert_eq!(e.to_string(), expected);
        assert!(!e.hint().is_empty());
    }
}
