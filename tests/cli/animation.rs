//! Animations: the requirements of the assignment, frames rendered alone and in sequence, and video files.

use std::path::Path;

use glam::{DMat4, DQuat, DVec3};
use kiln::animation::turntable;
use kiln::bvh::Preset;
use kiln::bvh::detail::Layout;
use kiln::effects::{Plan, PlanSettings};
use kiln::error::{Place, Warnings};
use kiln::film::{ColourPipeline, Film, Window};
use kiln::job::{PreparedScene, RenderSettings};
use kiln::render::{RenderControl, render};
use kiln::scene::animation::{Animation, Easing, Moment, Motion, Property, Target, Track};
use kiln::scene::{
    AddedLight, AnalyticShape, Camera, DefaultLook, Numerics, Placed, Placement, Projection, Scene, Shape,
    Sphere,
};
use kiln::world::{StandardView, View, World, WorldInputs, headlight, recenter};

use crate::common::gltf::Model;
use crate::common::repository;
use crate::workshop::{Workshop, text};
#[cfg(unix)]
use rustix::process::{Pid, Signal, kill_process};

fn load(file: &Path) -> Scene {
    kiln::import::load(&[file.to_owned()], &mut Warnings::default()).expect("the file can be read")
}

fn assignment() -> Scene {
    load(&repository("scenes/animation.toml"))
}

fn sphere(scene: &Scene, name: &str) -> DVec3 {
    let object = scene.objects.iter().find(|object| object.name == name).expect("a sphere of the name");
    let Shape::Analytic(AnalyticShape::Sphere(Sphere { centre, .. })) = object.shape else {
        panic!("{name} is a sphere")
    };
    centre
}

/// Positions at time 0, as in the assignment: both spheres and the camera; and the objects that do not move.
#[test]
fn the_assignment_begins_where_it_says() {
    let scene = assignment();
    let first = scene.at(0.0).unwrap();
    assert_eq!(sphere(&first, "left sphere"), DVec3::new(-500.0, -425.0, 1200.0));
    assert_eq!(sphere(&first, "right sphere"), DVec3::new(300.0, -400.0, 1350.0));
    assert_eq!(first.cameras[0].position, DVec3::new(0.0, 300.0, 200.0));
    let still = |scene: &Scene| -> Vec<DVec3> {
        let meshes = scene.objects.iter().filter_map(|object| object.shape.mesh());
        meshes.flat_map(|mesh| mesh.positions.clone()).collect()
    };
    assert_eq!(still(&scene.at(0.37).unwrap()), still(&load(&repository("scenes/assignment.toml"))));
}

/// The spheres move once on circles about the vertical axis through TP = (-100, -200, 1216), with radii hypot(400, 16)
/// and hypot(400, 134), at constant height: the left one in the direction m = v x t with t = (0, -200, 0), the right
/// one in the opposite direction.
#[test]
fn the_spheres_go_round_in_opposite_directions_and_come_back() {
    let scene = assignment();
    let axis = DVec3::new(-100.0, -200.0, 1216.0);
    for (name, radius, sign) in
        [("left sphere", 400.0f64.hypot(16.0), 1.0), ("right sphere", 400.0f64.hypot(134.0), -1.0)]
    {
        let centres: Vec<DVec3> =
            (0..=300).map(|i| sphere(&scene.at(f64::from(i) / 300.0).unwrap(), name)).collect();
        let mut turned = 0.0;
        for (i, pair) in centres.windows(2).enumerate() {
            let [from, to] = [pair[0] - axis, pair[1] - axis];
            assert!((from.x.hypot(from.z) / radius - 1.0).abs() < 1e-6, "{name}, frame {i}");
            assert_eq!(pair[0].y, centres[0].y);
            // In the direction of the tangent, or opposite to it.
            let tangent = DVec3::new(from.x, 0.0, from.z).cross(DVec3::new(0.0, -200.0, 0.0));
            assert!(sign * (to - from).dot(tangent) > 0.0, "{name}, frame {i}");
            let step = (from.z * to.x - from.x * to.z).atan2(from.x * to.x + from.z * to.z);
            assert!((step - sign * std::f64::consts::TAU / 300.0).abs() < 1e-12, "{name}, frame {i}: {step}");
            turned += step;
        }
        assert!((turned - sign * std::f64::consts::TAU).abs() < 1e-9);
        assert_eq!(centres[300], centres[0], "{name}");
    }
    // At half time they are on the opposite side: (2 * -100 + 500, 2 * 1216 - 1200).
    let half = sphere(&scene.at(0.5).unwrap(), "left sphere");
    assert!((half - DVec3::new(300.0, -425.0, 1232.0)).length() < 1e-9, "{half}");
}

/// From (0, 300, 200) by (0, 200, -100) t, the tetrahedron's TP - CO = (-100, -300, 1216) in the middle of the picture.
#[test]
fn the_camera_draws_back_and_keeps_looking_at_the_tetrahedron() {
    let scene = assignment();
    for (frame, position) in
        [(0, [0.0, 300.0, 200.0]), (150, [0.0, 400.0, 150.0]), (300, [0.0, 500.0, 100.0])]
    {
        let camera = scene.at(f64::from(frame) / 300.0).unwrap().cameras[0].clone();
        assert_eq!(camera.position, DVec3::from(position), "frame {frame}");
        let view = View::new(&camera, Projection::Perspective, [1024, 1024]).unwrap();
        let (pixel, before) = view.project(DVec3::new(-100.0, -300.0, 1216.0));
        assert!(before && (pixel - 512.0).length() < 1e-9, "frame {frame}: {pixel}");
    }
}

const SIZE: [u32; 2] = [48, 32];
const STRUCTURE: Layout = Layout::Wide(Preset::Balanced);

fn picture(world: &World, camera: &Camera) -> Film<[u8; 3]> {
    let view = View::new(camera, camera.projection, SIZE).unwrap();
    let plan = Plan::new(world, &PlanSettings::default()).unwrap();
    let window = Window { x: 0, y: 0, width: SIZE[0], height: SIZE[1] };
    render(world, &view, &plan, window, |_, _| true, &RenderControl::default()).unwrap().0
}

/// The world that [`PreparedScene`] makes for a frame from shared parts equals, bit for bit, the one prepared from
/// the scene at that time alone.
fn same_as_from_nothing(scene: &Scene, camera: usize) {
    with_look_as_from_nothing(scene, &DefaultLook::of_files(scene, scene.picture), camera);
}

fn with_look_as_from_nothing(scene: &Scene, look: &DefaultLook, camera: usize) {
    let (pipeline, numerics) = (ColourPipeline::Linear, Numerics::default());
    let look = DefaultLook { light: Some(AddedLight::Headlight), ..look.clone() };
    let inputs = WorldInputs::new(&look, pipeline, STRUCTURE, numerics);
    let animation = PreparedScene::new(scene.clone(), &inputs, true).unwrap();
    let mut pictures = Vec::new();
    for time in [0.0, 0.3, 0.75] {
        let frame = animation.at(Moment { part: time, seconds: 0.0 }).unwrap();
        let mut alone = scene.at(time).unwrap();
        recenter(&mut alone);
        let seen_by = alone.cameras[camera].clone();
        if alone.lights.is_empty() {
            alone.lights.extend(headlight(&seen_by));
        }
        assert_eq!(frame.cameras[camera], seen_by);
        let world = World::prepare_with(alone, &inputs);
        let ours = picture(&frame.world_for(&seen_by), &seen_by);
        assert!(ours == picture(&world, &seen_by), "at {time}");
        pictures.push(ours.bytes());
    }
    assert!(pictures[0] != pictures[1] && pictures[1] != pictures[2], "something moves");
}

fn moving(target: Target, motion: Motion) -> Track {
    Track { target, motion, place: Place::line(Path::new("a.toml"), 1) }
}

#[test]
fn frames_are_what_they_are_alone() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.obj");
    std::fs::write(&file, "o a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 1 3 4\n")
        .unwrap();
    for far in [0.0, 1e6] {
        let mut scene = load(&file);
        for object in &mut scene.objects {
            if let Shape::Mesh(mesh) = &mut object.shape {
                mesh.transform(&DMat4::from_translation(DVec3::splat(far)));
            }
        }
        // A second instance of the mesh.
        let Shape::Mesh(mesh) = &scene.objects[0].shape else { panic!("a mesh") };
        let beside = Placement::new(DMat4::from_rotation_translation(DQuat::from_rotation_y(0.4), DVec3::X));
        let placed = Placed::new(mesh.clone().into(), beside);
        let mut other = scene.objects[0].clone();
        other.name = "b".into();
        other.shape = Shape::Placed(placed);
        if far == 0.0 {
            scene.objects.push(other);
        }
        // Only the camera moves, and the headlight with it.
        let camera = turntable(&mut scene, None, StandardView::Auto, 1.5, Projection::Perspective).unwrap();
        let index = scene.cameras.iter().position(|known| *known == camera).unwrap();
        same_as_from_nothing(&scene, index);
        // The mesh moves, too.
        let to = DVec3::new(10.0, 80.0, -30.0);
        let turn = Motion::Lerp { property: Property::Rotate, from: None, to, easing: Easing::EaseIn };
        let animation = scene.animation.as_mut().unwrap();
        animation.tracks.push(moving(Target::Object("a".into()), turn));
        same_as_from_nothing(&scene, index);
    }
}

/// A light with an area follows the tracks of its name: position, direction and intensity.
#[test]
fn frames_have_the_area_lights_of_their_time() {
    let text = "[[camera]]\nposition = [0, 4, 9]\nlook_at = [0, 0, 0]\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 2\n\
        [[light]]\nname = 'panel'\ntype = 'rectangle'\nposition = [0, 4, 0]\ndirection = [0, -1, 0]\nsize = [2, 1]\n\
        [animation]\n[[animation.track]]\nlight = 'panel'\nlerp = { to = [3, 4, 2] }\n\
        [[animation.track]]\nlight = 'panel'\nproperty = 'intensity'\nlerp = { from = 9, to = 20 }\n\
        [[animation.track]]\nlight = 'panel'\nproperty = 'direction'\nlerp = { to = [-1, -1, 0] }\n";
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.toml");
    std::fs::write(&file, text).unwrap();
    same_as_from_nothing(&load(&file), 0);
}

/// The ground does not move with the objects above it, and is not built again if nothing moves.
#[test]
fn frames_have_the_ground_of_the_scene_at_rest() {
    let text = "[[camera]]\nname = 'eye'\nposition = [0, 4, 9]\nlook_at = [0, 0, 0]\n\
        [[sphere]]\nname = 'ball'\ncentre = [0, 0, 0]\nradius = 2\n[animation]\n";
    let moves =
        ["camera = 'eye'\nlerp = { to = [5, 4, 8] }\n", "object = 'ball'\nlerp = { to = [0, 3, 0] }\n"];
    for moves in moves {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.toml");
        std::fs::write(&file, format!("{text}[[animation.track]]\n{moves}")).unwrap();
        let scene = load(&file);
        let picture = kiln::scene::PictureSettings { ground: Some(true), ..Default::default() };
        let settings = RenderSettings::from(picture);
        let look = kiln::job::Session::still(scene.clone()).unwrap().look(&settings).unwrap().0;
        let ground = look.ground.expect("a ground");
        // The bounding box of the sphere has the radius 2 sqrt 3.
        assert!((ground.half_side - 40.0 * 3f64.sqrt()).abs() < 1e-9);
        with_look_as_from_nothing(&scene, &look, 0);
    }
}

/// On an orbit around a long box every corner stays in the picture, and one of them reaches the margin of 5 %, so that
/// the camera is not farther away than needed.
#[test]
fn a_turntable_sees_everything_from_all_sides() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("box.obj");
    let corners =
        |i: u32| [f64::from(i & 1) * 9.0 + 3.0, f64::from(i >> 1 & 1), f64::from(i >> 2) * 2.0 - 7.0];
    let text: String = (0..8).map(corners).map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    std::fs::write(&file, text + "f 1 2 3\nf 4 5 6\nf 7 8 1\n").unwrap();
    for view in [StandardView::Auto, StandardView::Front, StandardView::Iso] {
        let mut scene = load(&file);
        let camera = turntable(&mut scene, None, view, 1.5, Projection::Perspective).unwrap();
        let mut closest = f64::INFINITY;
        for frame in 0..300 {
            let now = scene.at(f64::from(frame) / 300.0).unwrap().cameras[0].clone();
            let ready = View::new(&now, now.projection, [150, 100]).unwrap();
            for i in 0..8 {
                let (pixel, before) = ready.project(corners(i).into());
                let share = pixel / glam::DVec2::new(150.0, 100.0);
                assert!(before);
                closest = closest.min(share.min_element()).min((1.0 - share).min_element());
            }
        }
        // The prism around the path of the corners is at most 1 / cos^2(pi / 64) = 1.0024 times as wide as the path.
        assert!((0.0499..0.06).contains(&closest), "{view:?}: {closest}");
        // After a whole turn the camera is the same, bit for bit.
        assert_eq!(scene.at(1.0).unwrap().cameras[0], camera);
        let Animation { fps, duration, repeat, .. } = scene.animation.clone().unwrap();
        assert_eq!((fps, duration, repeat), (30.0, 10.0, true));
    }
}

// The command.

const SCENE: &str = include_str!("../../scenes/animation.toml");

/// The pixels of a PNG.
fn pixels(shop: &Workshop, name: &str) -> Vec<u8> {
    image::open(shop.path(name)).unwrap().to_rgb8().into_raw()
}

#[test]
fn a_frame_alone_has_the_bytes_of_one_among_others() {
    let shop = Workshop::with("scene.toml", SCENE);
    for arguments in [
        "render scene.toml --frames 7-9,300 -o f_####.png --threads 3",
        "render scene.toml --frames 8 -o alone.png --threads 1",
        "render scene.toml --frames 9-7:2 -o again_%02d.png",
        // `kiln animate` writes the same files.
        "animate scene.toml --frames 8 -o g_####.png",
    ] {
        shop.succeed(&format!("{arguments} --size 40x40"));
    }
    let expected = [
        "again_07.png",
        "again_09.png",
        "alone.png",
        "f_0007.png",
        "f_0008.png",
        "f_0009.png",
        "f_0300.png",
        "g_0008.png",
        "scene.toml",
    ];
    assert_eq!(shop.names(), expected);
    assert_eq!(shop.bytes("alone.png"), shop.bytes("f_0008.png"));
    assert_eq!(shop.bytes("again_07.png"), shop.bytes("f_0007.png"));
    assert_eq!(shop.bytes("again_09.png"), shop.bytes("f_0009.png"));
    assert_eq!(shop.bytes("g_0008.png"), shop.bytes("f_0008.png"));
    assert_ne!(pixels(&shop, "f_0007.png"), pixels(&shop, "f_0008.png"));
}

/// A film of the frames that a farm rendered is the film of one command.
#[test]
fn films_of_frames_have_the_bytes_of_films_at_once() {
    let shop = Workshop::with("scene.toml", SCENE);
    let films: &[_] = if cfg!(feature = "video") { &["png", "gif", "mp4"] } else { &["png", "gif"] };
    for options in ["", "--background transparent", "--bits 16"] {
        shop.succeed(&format!("animate scene.toml --frames 3-9:2 -o f_###.png --size 24x16 {options}"));
        // Only png has alpha and 16 bits.
        for film in if options.is_empty() { films } else { &films[..1] } {
            shop.succeed(&format!("animate scene.toml --frames 3-9:2 -o a.{film} --size 24x16 {options}"));
            let said = shop.succeed(&format!("animate f_###.png --frames 3-9:2 -o b.{film}"));
            assert!(!said.contains("warning"), "{said}");
            assert_eq!(
                shop.bytes(&format!("a.{film}")),
                shop.bytes(&format!("b.{film}")),
                "{film} {options}"
            );
        }
    }
    // Without --frames all that exist, at another rate.
    shop.succeed("render scene.toml --frames 20-22 -o g_%03d.png --size 24x16");
    shop.succeed("animate scene.toml --frames 20-22 -o a.png --size 24x16 --fps 30");
    shop.succeed("animate g_%03d.png -o b.png");
    assert_eq!(shop.bytes("a.png"), shop.bytes("b.png"));
    shop.succeed("animate scene.toml --frames 20-22 -o h_###.jpg --size 24x16");
    shop.succeed("animate h_###.jpg -o c.gif --fps 10");
    let said = shop.succeed("animate g_###.png -o b.png --size 8x8 --samples 4");
    for option in ["size", "samples"] {
        let warning = format!("--{option} changes nothing: the frames are pictures that exist");
        assert!(said.contains(&warning), "{said}");
    }

    std::fs::remove_file(shop.path("g_021.png")).unwrap();
    shop.succeed("render scene.toml --frames 20 -o e_##.exr --size 8x8");
    shop.succeed("render scene.toml --frames 5 -o f_###.png --size 8x8");
    let before = shop.names();
    for (arguments, code, message) in [
        ("g_###.png -o no.gif", 3, "g_021.png: no such file"),
        ("g_###.png --frames 20-22 -o no.gif", 3, "g_021.png: no such file"),
        ("k_###.png -o no.gif", 3, "k_###.png: no such frame"),
        ("g_020.png -o no.gif", 2, "g_020.png: one picture is no film"),
        ("g_###.png -o no_###.png", 2, "g_###.png: frames that are rendered already"),
        ("f_###.png --frames 3-9:2 -o no.png", 3, "f_005.png: 8 x 8 pixels, of another size or kind"),
        ("e_##.exr -o no.gif", 3, "e_##.exr: linear light"),
    ] {
        let (error, _) = shop.fail(&format!("animate {arguments}"), code);
        assert!(error.contains(message), "{arguments:?}: {error}");
    }
    assert_eq!(shop.names(), before);
}

#[test]
fn wrong_frames_are_one_clear_line() {
    let shop = Workshop::with("scene.toml", SCENE);
    for (arguments, code, message) in [
        ("--frames 299-301 -o f_##.png", 2, "frame 301 is not in the animation: its frames are 0 to 300"),
        ("--frames -2-0 -o f_##.png", 2, "frame -2 is not in the animation: its frames are 0 to 300"),
        ("--frames 1-3 -o f.png", 2, "f.png: one name for 3 frames"),
        ("--frames 1- -o f_##.png", 2, "`1-` lacks a frame; write ranges as 1-10 or 1-10:2"),
        ("--frames 1 -o no/f_##.png", 4, "its folder does not exist"),
        ("--frames 1 -o ##_##.png", 2, "##_##.png: several places for the number of the frame"),
    ] {
        let (error, _) = shop.fail(&format!("render scene.toml --size 8x8 {arguments}"), code);
        assert!(error.contains(message), "{arguments:?}: {error}");
    }
    assert_eq!(shop.names(), ["scene.toml"]);
}

#[test]
fn wrong_tracks_are_errors_with_their_line() {
    let scene =
        "[[sphere]]\nname = \"ball\"\ncentre = [0, 0, 0]\nradius = 1\n\n[animation]\n\n[[animation.track]]\n";
    for (track, message) in [
        (
            "object = \"bal\"\nlerp = { to = [1, 0, 0] }\n",
            "a.toml:8: there is no object `bal` to animate\nhint: did you mean `ball`?",
        ),
        ("object = \"ball\"\n", "a.toml:8: a track needs one motion"),
        ("lerp = { to = [1, 0, 0] }\n", "a.toml:8: a track needs one thing that moves"),
        (
            "object = \"ball\"\norbit = { arround = [0, 0, 0] }\n",
            "a.toml:10: unknown key `arround`\nhint: did you mean `around`?",
        ),
        (
            "object = \"ball\"\norbit = { around = [0, 0, 0], axis = [0, 0, 0] }\n",
            "a.toml:8: the axis of an orbit has no length",
        ),
        ("object = \"ball\"\nlerp = { to = 3 }\n", "a.toml:8: `position` takes three numbers"),
        (
            "object = \"ball\"\nproperty = \"radius\"\nlerp = { from = 0, to = 3 }\n",
            "a.toml:8: comes to a radius of 0",
        ),
        (
            "object = \"ball\"\nkeyframes = [{ time = 1, value = [0, 0, 0] }, { time = 1, value = [1, 0, 0] }]\n",
            "a.toml:8: `keyframes` are not in order",
        ),
        ("object = \"ball\"\nlook_at = { point = [0, 0, 0] }\n", "a.toml:8: only cameras look at things"),
        (
            "object = \"ball\"\nproperty = \"radios\"\nlerp = { to = 3 }\n",
            "a.toml:10: unknown value `radios`\nhint: did you mean `radius`?",
        ),
    ] {
        let shop = Workshop::with("a.toml", format!("{scene}{track}"));
        let (_, error) = shop.code("render a.toml -o a.png --size 8x8", 3);
        assert!(error.contains(message), "{track}: {error}");
    }
}

#[test]
fn a_mesh_without_animation_is_gone_round_once() {
    let shop = Workshop::with("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let animate = |output: &str| {
        let run = shop.run(&format!("animate a.obj --size 32x32 --fps 4 --duration 1 -o {output}"));
        assert!(run.status.success(), "{}", text(&run.stderr));
        run.stdout
    };
    animate("f_#.png");
    // Four steps of a quarter turn; a fifth frame would equal the first.
    assert_eq!(shop.names(), ["a.obj", "f_0.png", "f_1.png", "f_2.png", "f_3.png"]);
    let all: Vec<Vec<u8>> = (0..4).map(|i| pixels(&shop, &format!("f_{i}.png"))).collect();
    assert!((0..4).all(|i| all[..i].iter().all(|other| *other != all[i])), "all differ");
    // Raw frames have the pixels of the PNG files.
    assert_eq!(animate("- --raw rgb"), all.concat());
    let film = animate("-");
    let header: &[u8] = b"YUV4MPEG2 W32 H32 F4000:1000 Ip A1:1 C444 XCOLORRANGE=LIMITED\n";
    assert!(film.starts_with(header));
    assert_eq!(film.len(), header.len() + 4 * (b"FRAME\n".len() + 3 * 32 * 32));
}

/// The bytes of a frame and its delay as a fraction.
type ApngFrame = (Vec<u8>, [u16; 2]);

/// The frames of an animated PNG, and the delay of each as a fraction of seconds.
fn frames_of(shop: &Workshop, name: &str) -> (png::ColorType, png::BitDepth, Vec<ApngFrame>) {
    let file = std::io::BufReader::new(std::fs::File::open(shop.path(name)).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let control = *reader.info().animation_control().expect("it is animated");
    assert_eq!(control.num_plays, 0, "it plays forever");
    let frames = (0..control.num_frames).map(|_| {
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut bytes).unwrap();
        let control = *reader.info().frame_control().unwrap();
        // The whole frame, which replaces the one before it with its alpha.
        assert_eq!((control.x_offset, control.y_offset), (0, 0));
        assert_eq!((control.blend_op, control.dispose_op), (png::BlendOp::Source, png::DisposeOp::None));
        (bytes, [control.delay_num, control.delay_den])
    });
    let frames = frames.collect();
    (reader.info().color_type, reader.info().bit_depth, frames)
}

/// An animated PNG has the pixels of `kiln render --frames`, in all forms of PNG, and their exact delay.
#[test]
fn an_animated_png_holds_the_frames() {
    let shop = Workshop::with("scene.toml", SCENE);
    shop.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    for (options, colour, depth, delay) in [
        ("--fps 30", png::ColorType::Rgb, png::BitDepth::Eight, [1, 30]),
        ("--fps 29.97", png::ColorType::Rgb, png::BitDepth::Sixteen, [100, 2997]),
        ("--fps 0.75", png::ColorType::Rgba, png::BitDepth::Eight, [4, 3]),
        ("--fps 23.976023976023978", png::ColorType::Rgba, png::BitDepth::Sixteen, [1001, 24000]),
    ] {
        let bits = if depth == png::BitDepth::Sixteen { " --bits 16" } else { "" };
        let alpha = if colour == png::ColorType::Rgba { " --background transparent" } else { "" };
        // The floor of the scene fills the picture; the turntable of a triangle does not.
        let input = if alpha.is_empty() { "scene.toml" } else { "a.obj --draft" };
        let options = format!("{input} --size 24x24 --frames 0-6:3 --duration 10 {options}{bits}{alpha}");
        shop.succeed(&format!("render {options} -o f_#.png"));
        shop.succeed(&format!("animate {options} -o film.png"));
        let (found_colour, found_depth, frames) = frames_of(&shop, "film.png");
        assert_eq!((found_colour, found_depth, frames.len()), (colour, depth, 3), "{options}");
        for ((bytes, found_delay), frame) in frames.into_iter().zip([0, 3, 6]) {
            let still = image::open(shop.path(&format!("f_{frame}.png"))).unwrap();
            // The decoder of the test leaves 16 bits as they are in the file, with the high byte first.
            let still: Vec<u8> = match depth {
                png::BitDepth::Sixteen if alpha.is_empty() => {
                    still.into_rgb16().iter().flat_map(|c| c.to_be_bytes()).collect()
                }
                png::BitDepth::Sixteen => still.into_rgba16().iter().flat_map(|c| c.to_be_bytes()).collect(),
                _ if alpha.is_empty() => still.into_rgb8().into_raw(),
                _ => still.into_rgba8().into_raw(),
            };
            assert!(bytes == still, "{options}, frame {frame}");
            assert_eq!(found_delay, delay, "{options}");
            let pixel = if depth == png::BitDepth::Sixteen { 8 } else { 4 };
            let is_clear = bytes.chunks(pixel).any(|pixel| pixel.iter().all(|byte| *byte == 0));
            assert!(alpha.is_empty() || is_clear, "{options}: beside it is nothing");
        }
    }
    for (output, message) in [("a.gif", "a film has no alpha channel"), ("-", "a film has no alpha channel")]
    {
        let said = shop.code(&format!("animate scene.toml --background transparent -o {output}"), 2).1;
        assert!(said.contains(message), "{said}");
    }
}

/// A film of frames has all of the pattern, whose places are as wide as the numbers; options of rendering change nothing.
#[test]
fn a_film_of_frames_has_all_of_them() {
    let shop = Workshop::with("scene.toml", SCENE);
    shop.succeed("render scene.toml --size 8x8 --frames 98-101 -o f_###.png");
    shop.succeed("animate f_###.png -o all.png");
    assert_eq!(frames_of(&shop, "all.png").2.len(), 4);
    let said = shop.succeed("animate f_###.png -o a.gif --up z --without shadows --size 9x9");
    for option in ["--up", "--without", "--size"] {
        let warning =
            format!("kiln: warning: {option} changes nothing: the frames are pictures that exist\n");
        assert!(said.contains(&warning), "{said}");
    }
    // f_100.png and f_101.png are names of two digits at least, too.
    let (said, hint) = shop.fail("animate f_##.png -o a.gif", 3);
    assert!(said.starts_with("f_##.png: the number in `f_0"), "{said}");
    assert_eq!(hint, "give the name a # for each digit");
}

#[cfg(unix)]
#[test]
fn a_signal_leaves_nothing_behind() {
    for (signal, code, output) in [(Signal::INT, 130, "film.png"), (Signal::TERM, 143, "f_####.png")] {
        let shop = Workshop::with("scene.toml", SCENE);
        let mut child =
            shop.command(&format!("animate scene.toml -o {output} --progress none")).spawn().unwrap();
        std::thread::sleep(std::time::Duration::from_millis(700));
        kill_process(Pid::from_child(&child), signal).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(code));
        // Only complete frames may be left.
        for name in shop.names().into_iter().filter(|name| name != "scene.toml") {
            assert!(output == "f_####.png" && name.starts_with("f_"), "{name}");
            assert_eq!(pixels(&shop, &name).len(), 1024 * 1024 * 3);
        }
    }
}

#[cfg(not(feature = "video"))]
#[test]
fn a_build_without_mp4_names_the_feature_that_has_it() {
    let shop = Workshop::with("scene.toml", SCENE);
    let (error, hint) = shop.fail("animate scene.toml -o a.mp4", 2);
    assert!(
        error == "this kiln was built without .mp4" && hint.contains("--features full"),
        "{error}; {hint}"
    );
    assert_eq!(shop.names(), ["scene.toml"]);
}

/// A film of 76 frames: every fourth of the scene's.
fn make(shop: &Workshop, name: &str, more: &str) -> Vec<u8> {
    let said = shop.succeed(&format!("animate scene.toml --frames 0-300:4 -o {name} {more}"));
    // The encoder prints nothing.
    assert!(!said.contains("OpenH264"));
    shop.bytes(name)
}

#[test]
fn equal_films_have_equal_bytes() {
    let shop = Workshop::with("scene.toml", SCENE);
    let films = if cfg!(feature = "video") { vec!["a.gif", "a.mp4"] } else { vec!["a.gif"] };
    for name in &films {
        let one = make(&shop, name, "--size 63x41 --threads 1");
        assert_eq!(one, make(&shop, name, "--size 63x41 --threads 4"), "{name}");
    }
    assert_eq!(shop.names(), [&films[..], &["scene.toml"]].concat());
}

#[test]
fn a_gif_lasts_as_long_as_the_animation() {
    let bytes = make(&Workshop::with("scene.toml", SCENE), "a.gif", "--size 20x20");
    let mut decoder = gif::DecodeOptions::new().read_info(&bytes[..]).unwrap();
    let mut delays = Vec::new();
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        delays.push(frame.delay);
    }
    // 76 frames at 30 a second: 253.3 hundredths, in steps of three and four.
    assert_eq!((delays.len(), delays.iter().sum::<u16>()), (76, 253));
    assert!(delays.iter().all(|delay| [3, 4].contains(delay)));
}

#[cfg(feature = "video")]
mod film {
    use super::*;

    /// A box of ISO/IEC 14496-12: its name, where its contents begin, and those.
    type Box<'a> = (&'a [u8], usize, &'a [u8]);

    fn boxes(bytes: &[u8], start: usize) -> Vec<Box<'_>> {
        let mut found = Vec::new();
        let mut at = 0;
        while at < bytes.len() {
            let size = u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
            assert!(size >= 8 && at + size <= bytes.len());
            found.push((&bytes[at + 4..at + 8], start + at + 8, &bytes[at + 8..at + size]));
            at += size;
        }
        found
    }

    fn inside<'a>(bytes: &'a [u8], path: &[&[u8]]) -> &'a [u8] {
        let mut bytes = bytes;
        for name in path {
            let (_, _, inner) =
                boxes(bytes, 0).into_iter().find(|(n, ..)| n == name).expect("a box of the name");
            bytes = inner;
        }
        bytes
    }

    fn number(bytes: &[u8], at: usize) -> u32 {
        u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap())
    }

    #[test]
    fn an_mp4_has_its_boxes_before_its_pictures() {
        let bytes = make(&Workshop::with("scene.toml", SCENE), "a.mp4", "--size 62x40");
        let top = boxes(&bytes, 0);
        let order: Vec<&[u8]> = top.iter().map(|(name, ..)| *name).collect();
        assert_eq!(order, [b"ftyp", b"moov", b"mdat"]);
        let (_, mdat, pictures) = top[2];
        let trak = inside(top[1].2, &[b"trak"]);
        let stbl = inside(trak, &[b"mdia", b"minf", b"stbl"]);
        // 76 frames, 30 a second: 1000 ticks of 30000 each (8.6.1.2, 8.7.3.2, 8.7.5).
        let mdhd = inside(trak, &[b"mdia", b"mdhd"]);
        assert_eq!((number(mdhd, 20), number(mdhd, 28)), (30_000, 76_000));
        let stts = inside(stbl, &[b"stts"]);
        assert_eq!([4, 8, 12].map(|at| number(stts, at)), [1, 76, 1000]);
        let stsz = inside(stbl, &[b"stsz"]);
        assert_eq!((number(stsz, 4), number(stsz, 8)), (0, 76));
        let sizes: Vec<usize> = (0..76).map(|i| number(stsz, 12 + 4 * i) as usize).collect();
        assert_eq!(sizes.iter().sum::<usize>(), pictures.len());
        let stco = inside(stbl, &[b"stco"]);
        assert_eq!((number(stco, 4), number(stco, 8) as usize), (1, mdat));
        // A key frame every two seconds.
        let stss = inside(stbl, &[b"stss"]);
        assert_eq!([4, 8, 12].map(|at| number(stss, at)), [2, 1, 61]);
        // NAL units fill every sample exactly; the first of a key frame has type 5.
        let mut at = 0;
        for (i, size) in sizes.iter().enumerate() {
            let end = at + size;
            assert_eq!(pictures[at + 4] & 31, if i % 60 == 0 { 5 } else { 1 }, "picture {i}");
            while at < end {
                at += 4 + number(pictures, at) as usize;
            }
            assert_eq!(at, end);
        }
        // One entry, avc1: 8 bytes of the list, 8 of its header, 78 of the fields of every visual sample entry.
        let stsd = inside(stbl, &[b"stsd"]);
        assert_eq!(&stsd[12..16], b"avc1");
        let entry = &stsd[16..];
        assert_eq!([24, 26].map(|at| u16::from_be_bytes([entry[at], entry[at + 1]])), [62, 40]);
        let avcc = inside(&entry[78..], &[b"avcC"]);
        // Baseline with constraint_set1: Constrained Baseline (ITU-T H.264, A.2.1.1).
        assert_eq!((avcc[0], avcc[1], avcc[2] & 0x40), (1, 66, 0x40));
        assert_eq!(inside(&entry[78..], &[b"colr"]), b"nclx\0\x01\0\x01\0\x01\0");
    }

    #[test]
    fn low_quality_is_smaller() {
        let shop = Workshop::with("scene.toml", SCENE);
        let [high, low] = ["high", "low"]
            .map(|quality| make(&shop, "b.mp4", &format!("--size 256x256 --quality {quality}")).len());
        assert!(2 * low < high, "{low} {high}");
    }

    #[test]
    fn sizes_that_h264_has_not_are_refused_before_any_work() {
        let shop = Workshop::with("scene.toml", SCENE);
        for size in ["4000x100", "2200x2200", "8x100"] {
            let (error, _) = shop.fail(&format!("animate scene.toml -o a.mp4 --size {size}"), 2);
            assert!(error.contains("cannot write an .mp4"), "{error}");
        }
        assert_eq!(shop.names(), ["scene.toml"]);
    }
}

/// The pixels of a PNG, with alpha.
fn rgba(shop: &Workshop, name: &str) -> Vec<u8> {
    image::open(shop.path(name)).unwrap().to_rgba8().into_raw()
}

/// Renders frame 0 by both commands with these arguments, and returns its pixels.
fn frame_0(shop: &Workshop, arguments: &str) -> Vec<u8> {
    shop.succeed(&format!("render {arguments} --frames 0 -o frame_#.png"));
    shop.succeed(&format!("animate {arguments} --frames 0 -o film_#.png"));
    let [frame, film] = ["frame_0.png", "film_0.png"].map(|name| rgba(shop, name));
    assert!(frame == film, "{arguments}: frame 0 of `render` is not that of `animate`");
    frame
}

/// GLB file of a floor and a square of `material`, which a clip moves from (0.3, 0.5, 0) at its beginning; at rest it
/// is elsewhere. All is moved by `x`.
fn clip_of(material: &serde_json::Value, x: f32) -> Vec<u8> {
    clips_of(material, x, &["clip"])
}

/// As [`clip_of`], with a clip of each name, the heights of which differ by 1/2.
fn clips_of(material: &serde_json::Value, x: f32, names: &[&str]) -> Vec<u8> {
    use serde_json::json;
    let mut model = Model::square();
    let mut square = model.primitive().clone();
    square["material"] = json!(1);
    model.primitive()["material"] = json!(0);
    model.json["meshes"].as_array_mut().unwrap().push(json!({ "primitives": [square] }));
    model.json["materials"] = json!([{ "doubleSided": true }, material]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    model.json["nodes"] = json!([
        { "mesh": 0, "scale": [4, 4, 4], "rotation": [-half, 0, 0, half], "translation": [x - 2.0, 0, 2] },
        { "mesh": 1, "translation": [x + 4.0, 3, 0] },
    ]);
    model.json["scenes"] = json!([{ "nodes": [0, 1] }]);
    let input = model.floats(&[[0.0], [1.0]]);
    let clips = names.iter().zip([0.5, 1.0]).map(|(name, y)| {
        let output = model.floats(&[[x, y, 0.0], [x, y + 2.0, 0.0]]);
        json!({
            "name": name,
            "samplers": [{ "input": input, "output": output }],
            "channels": [{ "sampler": 0, "target": { "node": 1, "path": "translation" } }],
        })
    });
    let clips: Vec<_> = clips.collect();
    model.json["animations"] = clips.into();
    model.binary()
}

/// Frame 0 equals the picture at time 0: emission, glass, background, camera, ground and exposure are those of the pose
/// at that time.
#[test]
fn frame_0_of_a_clip_is_the_picture_of_time_0() {
    use serde_json::json;
    let extension = |name: &str, value: serde_json::Value| json!({ "extensions": { name: value } });
    let mut lamp = extension("KHR_materials_emissive_strength", json!({ "emissiveStrength": 5 }));
    lamp["emissiveFactor"] = json!([1, 1, 1]);
    let shop = Workshop::with("lamp.glb", clip_of(&lamp, 0.0));
    let glass = extension("KHR_materials_transmission", json!({ "transmissionFactor": 1 }));
    shop.write("glass.glb", clip_of(&glass, 0.0));
    shop.write("plain.glb", clip_of(&json!({}), 0.0));
    shop.write("far.glb", clip_of(&json!({}), 1_048_576.0));
    shop.write("studio.toml", "[image]\nlook = 'studio'\n[[mesh]]\nfile = 'plain.glb'\n");
    for (file, options) in [
        ("lamp.glb", ""),
        ("lamp.glb", "--ground --view front"),
        ("glass.glb", ""),
        ("glass.glb", "--background transparent"),
        ("plain.glb", ""),
        ("plain.glb", "--background transparent"),
        ("plain.glb", "--background #804020"),
        ("plain.glb", "--elevation -30"),
        ("plain.glb", "--elevation -30 --ground"),
        ("plain.glb", "--exposure auto --samples 4"),
        ("plain.glb", "--exposure auto --noise 0.05"),
        ("lamp.glb", "--exposure auto --noise 0.05"),
        ("plain.glb", "--draft --camera {position=[1,2,9],look_at=[0,1,0]}"),
        ("far.glb", ""),
        ("studio.toml", ""),
    ] {
        let arguments = format!("{file} --size 24x20 {options}");
        let frame = frame_0(&shop, &arguments);
        shop.succeed(&format!("render {arguments} --time 0 -o still.png"));
        let still = rgba(&shop, "still.png");
        let differing = frame.iter().zip(&still).filter(|(a, b)| a != b).count();
        assert_eq!(differing, 0, "{arguments}: of {}", still.len());
    }
}

/// A lamp on a floor, whose height f32 does not have, lights the foot of a wall in frames as in stills: one that stays, and one
/// that a track puts there.
#[test]
fn frames_have_lights_on_surfaces() {
    let floor = "[[-5, 1.1, -5], [-5, 1.1, 5], [5, 1.1, 5], [-5, 1.1, -5], [5, 1.1, 5], [5, 1.1, -5]]";
    let wall = "[[-5, 1.1, -2], [5, 1.1, -2], [5, 4, -2], [-5, 1.1, -2], [5, 4, -2], [-5, 4, -2]]";
    let scene = |light: &str, track: &str| {
        format!(
            "[[camera]]\nname = 'eye'\nposition = [0, 1.6, 4]\nlook_at = [0, 1.3, 0]\nvertical_fov = 40\n\
             [[light]]\nname = 'lamp'\ntype = 'point'\nposition = {light}\nfalloff = 'inverse-square'\n\
             [[triangles]]\nvertices = {floor}\n[[triangles]]\nvertices = {wall}\n\
             [animation]\n[[animation.track]]\n{track}\n"
        )
    };
    let shop =
        Workshop::with("stays.toml", scene("[0, 1.1, 0]", "camera = 'eye'\nlerp = { to = [1, 1.6, 4] }"));
    let track = "light = 'lamp'\nlerp = { from = [0, 1.1, 0], to = [1, 2, 0] }";
    shop.write("moves.toml", scene("[0, 3, 0]", track));
    shop.succeed("render stays.toml --size 48x48 -o still.png");
    let still = rgba(&shop, "still.png");
    for file in ["stays.toml", "moves.toml"] {
        assert!(frame_0(&shop, &format!("{file} --size 48x48")) == still, "{file}");
    }
}

/// Clips are chosen in each file by themselves, as for a picture: by all, of which the last counts, and by a name that has
/// another index in another file.
#[test]
fn clips_of_several_files_are_those_of_each() {
    let plain = serde_json::json!({});
    let shop = Workshop::with("a.glb", clips_of(&plain, 0.0, &["low", "high"]));
    shop.write("b.glb", clips_of(&plain, 4.0, &["high"]));
    let pictures = ["", "--clip all", "--clip high", "--clip low --clip high"].map(|options| {
        let arguments = format!("a.glb b.glb --size 24x20 --view front {options}");
        let frame = frame_0(&shop, &arguments);
        shop.succeed(&format!("render {arguments} --time 0 -o still.png"));
        assert!(frame == rgba(&shop, "still.png"), "{options}");
        frame
    });
    let [first, others @ ..] = &pictures;
    assert!(others.iter().all(|other| other == &others[0] && other != first));
}

/// One bounce ends paths at the back of a glass tetrahedron: pictures and frames say so.
#[test]
fn frames_say_what_limits_cut() {
    let shop = Workshop::with("a.mtl", "newmtl glass\nKd 1 1 1\nNi 1.5\nillum 7\n");
    let corners = "v 0 0 0\nv 4 0 0\nv 0 3 0\nv 0 0 2\n";
    shop.write("a.obj", format!("mtllib a.mtl\n{corners}usemtl glass\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"));
    for command in [
        "render -o a.png",
        "render --frames 0 -o a.png",
        "render --frames 0-1 -o a#.exr",
        "animate --frames 0-1 -o a.gif",
    ] {
        let said = shop.succeed(&format!("{command} a.obj --size 24x20 --samples 4 --depth 1"));
        assert!(said.contains("limit of 1 bounce cuts "), "{command}: {said}");
    }
}

/// The ground of the default look is hidden from a camera below it; a requested one is not.
#[test]
fn the_ground_of_the_look_is_hidden_from_below() {
    let shop = Workshop::with("a.glb", clip_of(&serde_json::json!({}), 0.0));
    let of = |command: &str, options: &str| {
        shop.succeed(&format!("render a.glb --size 24x20 --elevation -30 {options} {command}"));
        rgba(&shop, "a.png")
    };
    for command in ["--time 0 -o a.png", "--frames 0 -o a.png"] {
        let [default, without, with] = ["", "--ground=false", "--ground"].map(|options| of(command, options));
        assert!(default == without && default != with, "{command}");
    }
}

/// A moment of a scene's tracks is its frame, and outside of them an error.
#[test]
fn a_time_is_a_moment_of_the_tracks_of_a_scene() {
    let scene = std::fs::read(crate::common::repository("scenes/animation.toml")).expect("a scene");
    let workshop = Workshop::with("a.toml", scene);
    workshop.succeed("render a.toml --size 24x24 --time 2s -o still.png");
    workshop.succeed("render a.toml --size 24x24 --frames 60 -o frame_#.png");
    assert_eq!(workshop.pixels("still.png"), workshop.pixels("frame_60.png"));
    workshop.succeed("render a.toml --size 24x24 -o rest.png");
    assert_ne!(workshop.pixels("still.png"), workshop.pixels("rest.png"));
    for time in ["-1", "10.5"] {
        let (said, hint) = workshop.fail(&format!("render a.toml -o a.png --time {time}"), 2);
        assert_eq!(said, format!("--time {time}: the animation lasts from 0 to 10 seconds"));
        assert_eq!(hint, "give a time in it");
    }
    let (_, said) = workshop.code("animate a.toml --size 8x8 --frames 10 -o a.gif", 0);
    assert!(
        said.contains("kiln: note: --frames 10 is one frame; --frames 0-10 are those up to it\n"),
        "{said}"
    );
}

/// Films of what has no size are small, also at another aspect; those of scene files with a size have that.
#[test]
fn films_have_sizes_and_times_of_their_own() {
    let workshop = Workshop::with("ball.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let sized = "[image]\nwidth = 20\nheight = 10\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n";
    workshop.write("sized.toml", sized);
    for (command, wanted) in [
        ("ball.obj -o a.gif", "(512 x 512, 2 frames, 0.13 s at 15 frames per second)"),
        ("ball.obj -o a.png", "(512 x 512, 2 frames, 0.13 s at 15 frames per second)"),
        ("ball.obj -o a.y4m", "(512 x 512, 2 frames, 0.07 s at 30 frames per second)"),
        ("ball.obj -o a.gif --size 64 --fps 10", "(64 x 64, 2 frames, 0.20 s at 10 frames per second)"),
        ("sized.toml -o a.gif", "(20 x 10, 2 frames, 0.13 s at 15 frames per second)"),
    ] {
        let (_, said) = workshop.code(&format!("animate {command} --frames 0-1 --draft"), 0);
        assert!(said.contains(wanted), "{command}: {said}");
    }
    let (_, said) = workshop.code("animate ball.obj -o a.gif --frames 75 --size 8", 2);
    assert!(said.contains("frame 75 is not in the animation: its frames are 0 to 74"), "{said}");
}
