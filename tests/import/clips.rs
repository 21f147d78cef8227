//! Clips of glTF files: poses of nodes, skins, morph targets and cameras at a time, against poses worked out by hand.

use glam::DVec3;
use kiln::animation::{AnimationJob, FrameRequest, play_clip};
use kiln::error::{Error, Result, Warnings};
use kiln::import::load_with;
use kiln::job::{CameraChoice, RenderSettings};
use kiln::render::RenderControl;
use kiln::scene::{ClipChoice, ClipTime, ImportOptions, Material, Scene, Shape};
use serde_json::json;

use crate::common::gltf::Model;
use crate::common::models;

/// Adds a clip with one channel.
fn clip<const N: usize>(
    model: &mut Model,
    node: usize,
    path: &str,
    times: &[f32],
    values: &[[f32; N]],
    name: &str,
) {
    let times: Vec<[f32; 1]> = times.iter().map(|&time| [time]).collect();
    let (input, output) = (model.floats(&times), model.floats(values));
    if !model.json["animations"].is_array() {
        model.json["animations"] = json!([]);
    }
    let animation = json!({
        "name": name,
        "samplers": [{ "input": input, "output": output }],
        "channels": [{ "sampler": 0, "target": { "node": node, "path": path } }],
    });
    model.json["animations"].as_array_mut().expect("a list").push(animation);
}

fn posed(model: &Model, time: Option<f64>, clip: Option<&str>) -> Result<Scene> {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("model.glb");
    std::fs::write(&file, model.binary()).expect("the file is written");
    let choice = clip.map_or(ClipChoice::First, |clip| ClipChoice::Named(clip.into()));
    let asked = ClipTime { clip: choice, time: time.unwrap_or(0.0) };
    let pose = (time.is_some() || clip.is_some()).then_some(asked);
    load_with(&[file], &options(pose), &mut Warnings::default())
}

fn options(pose: Option<ClipTime>) -> ImportOptions {
    let options = ImportOptions::default();
    match pose {
        Some(pose) => options.posed(pose),
        None => options,
    }
}

fn positions(scene: &Scene) -> &[DVec3] {
    let Shape::Mesh(mesh) = &scene.objects[0].shape else { panic!("a mesh") };
    &mesh.positions
}

fn assert_near(found: DVec3, expected: [f64; 3]) {
    assert!((found - DVec3::from(expected)).length() < 1e-6, "{found} {expected:?}");
}

#[test]
fn a_node_moves_and_its_children_with_it() {
    let mut model = Model::triangle();
    model.json["nodes"] =
        json!([{ "children": [1], "translation": [0, 5, 0] }, { "mesh": 0, "translation": [0, 0, 2] }]);
    clip(&mut model, 0, "translation", &[1.0, 3.0], &[[0.0, 0.0, 0.0], [8.0, 0.0, 0.0]], "Walk");
    let first = |time| positions(&posed(&model, time, None).expect("a scene"))[0];
    assert_near(first(None), [0.0, 5.0, 2.0]);
    // A quarter of the way; before the first and after the last keyframe, their values hold.
    assert_near(first(Some(1.5)), [2.0, 0.0, 2.0]);
    assert_near(first(Some(-1.0)), [0.0, 0.0, 2.0]);
    assert_near(first(Some(99.0)), [8.0, 0.0, 2.0]);
    let scene = posed(&model, None, None).expect("a scene");
    assert_eq!(
        (scene.clips[0].name.as_str(), scene.clips[0].duration, scene.clips[0].channels),
        ("Walk", 3.0, 1)
    );
}

/// The `gltf` crate does not check the targets of channels, and panics where they are used. Channels without a node are
/// to be ignored (section 5.8), and count.
#[test]
fn channels_without_a_property_or_a_node_are_errors_with_their_place() {
    let paths = "its `path` is none of `translation`, `rotation`, `scale` and `weights`";
    for (path, node, expected) in [
        ("colour", 0, paths),
        ("", 0, paths),
        ("pointer", 0, paths),
        ("translation", 1, "its target is node 1; there are 1"),
        ("weights", 4_000_000_000u64, "its target is node 4000000000; there are 1"),
    ] {
        let mut model = Model::triangle();
        clip(&mut model, 0, "translation", &[0.0], &[[0.0; 3]], "Walk");
        let ignored = json!({ "sampler": 0, "target": { "path": "colour" } });
        let bad = json!({ "sampler": 0, "target": { "node": node, "path": path } });
        model.json["animations"][0]["channels"].as_array_mut().expect("a list").extend([ignored, bad]);
        for time in [None, Some(0.0)] {
            let e = posed(&model, time, None).expect_err("a channel is at fault");
            assert!(matches!(e, Error::Input { .. }), "{e:?}");
            let expected = format!("model.glb: animation 0, channel 2: {expected}");
            assert!(e.to_string().ends_with(&expected), "{path}: {e}");
        }
    }
}

/// A joint at (1, 0, 0) turns by 90 degrees about z: its vertex, at (2, 0, 0) at rest, comes to (1, 1, 0). The vertices of the
/// other joint stay; the transform of the skinned node does not count (section 3.7.3.3).
#[test]
fn a_skin_bends_at_its_joint() {
    let mut model = Model::new(&[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    model.attribute("JOINTS_0", &[[0.0f32; 4]; 3]);
    model.attribute("WEIGHTS_0", &[[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]);
    // Joints 0, 1, 0, 0 for every vertex, as bytes.
    let joints = model.primitive()["attributes"]["JOINTS_0"].as_u64().expect("an index") as usize;
    model.json["accessors"][joints]["componentType"] = json!(5121);
    model.json["accessors"][joints]["min"] = json!([0, 0, 0, 0]);
    model.set_bytes(joints, &[[0, 1, 0, 0]; 3].concat());
    let unmoved = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0f32];
    let mut back = unmoved;
    back[12] = -1.0;
    let matrices = model.floats(&[unmoved, back]);
    model.json["accessors"][matrices]["type"] = json!("MAT4");
    model.json["skins"] = json!([{ "joints": [1, 2], "inverseBindMatrices": matrices }]);
    model.json["nodes"] = json!([
        { "mesh": 0, "skin": 0, "translation": [100, 0, 0] }, { "children": [2] }, { "translation": [1, 0, 0] },
    ]);
    model.json["scenes"] = json!([{ "nodes": [0, 1] }]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    clip(&mut model, 2, "rotation", &[0.0, 1.0], &[[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, half, half]], "Bend");
    let rest = posed(&model, None, None).expect("a scene");
    assert_near(positions(&rest)[1], [2.0, 0.0, 0.0]);
    let bent = posed(&model, Some(1.0), None).expect("a scene");
    assert_near(positions(&bent)[0], [0.0, 0.0, 0.0]);
    assert_near(positions(&bent)[1], [1.0, 1.0, 0.0]);
    assert_near(positions(&bent)[2], [0.0, 1.0, 0.0]);
}

/// Two targets move the first vertex by (4, 0, 0) and (0, 4, 0). The mesh weighs them by 0.5 and 0, the clip by 0 to 1 and 0.25.
#[test]
fn morph_targets_are_weighed_by_mesh_node_and_clip() {
    let mut model = Model::triangle();
    let none = [0.0f32; 3];
    let targets = [[4.0, 0.0, 0.0], [0.0, 4.0, 0.0]].map(|by| model.floats(&[by, none, none]));
    model.primitive()["targets"] = json!([{ "POSITION": targets[0] }, { "POSITION": targets[1] }]);
    model.json["meshes"][0]["weights"] = json!([0.5, 0.0]);
    clip(&mut model, 0, "weights", &[0.0, 2.0], &[[0.0], [0.25], [1.0], [0.25]], "Smile");
    let first = |model: &Model, time| positions(&posed(model, time, None).expect("a scene"))[0];
    assert_near(first(&model, None), [2.0, 0.0, 0.0]);
    assert_near(first(&model, Some(1.0)), [2.0, 1.0, 0.0]);
    model.json["nodes"][0]["weights"] = json!([0.0, 1.0]);
    assert_near(first(&model, None), [0.0, 4.0, 0.0]);
}

#[test]
fn cameras_follow_their_node() {
    let mut model = Model::triangle();
    model.json["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }]);
    model.json["nodes"] = json!([{ "mesh": 0 }, { "camera": 0, "translation": [0, 0, 9] }]);
    model.json["scenes"] = json!([{ "nodes": [0, 1] }]);
    clip(&mut model, 1, "translation", &[0.0, 4.0], &[[0.0, 0.0, 9.0], [4.0, 0.0, 9.0]], "Pan");
    assert_near(posed(&model, Some(1.0), None).expect("a scene").cameras[0].position, [1.0, 0.0, 9.0]);
}

/// The file at `time` of its first clip, with the warnings.
fn at(model: &Model, time: f64) -> (Scene, Vec<String>) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("model.glb");
    std::fs::write(&file, model.binary()).expect("the file is written");
    let mut warnings = Warnings::default();
    let asked = options(Some(ClipTime { clip: ClipChoice::First, time }));
    let scene = load_with(&[file], &asked, &mut warnings).expect("a scene");
    (scene, warnings.messages().to_vec())
}

/// Animates the property at a JSON pointer by keyframes of numbers or vectors.
fn animate_pointer<const N: usize>(model: &mut Model, pointer: &str, times: &[f32], values: &[[f32; N]]) {
    let times: Vec<[f32; 1]> = times.iter().map(|&time| [time]).collect();
    let (input, output) = (model.floats(&times), model.floats(values));
    if !model.json["animations"].is_array() {
        model.json["animations"] = json!([{ "samplers": [], "channels": [] }]);
    }
    let animation = &mut model.json["animations"][0];
    let samplers = animation["samplers"].as_array_mut().expect("a list");
    samplers.push(json!({ "input": input, "output": output }));
    let target =
        json!({ "path": "pointer", "extensions": { "KHR_animation_pointer": { "pointer": pointer } } });
    let channel = json!({ "sampler": samplers.len() - 1, "target": target });
    animation["channels"].as_array_mut().expect("a list").push(channel);
    for key in ["extensionsUsed", "extensionsRequired"] {
        model.json[key] = json!(["KHR_animation_pointer"]);
    }
}

/// Materials, cameras, lights and nodes at a quarter of the way between two keyframes, and the channel of a node beside
/// them. What the pointers do not name keeps its value.
#[test]
fn pointers_animate_properties() {
    let mut model = Model::triangle();
    clip(&mut model, 0, "translation", &[0.0, 2.0], &[[0.0, 0.0, 0.0], [4.0, 0.0, 0.0]], "Walk");
    model.json["materials"] = json!([{ "pbrMetallicRoughness": { "metallicFactor": 0.25 } }]);
    model.primitive()["material"] = json!(0);
    model.json["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }]);
    let light = json!({ "type": "point", "intensity": 1.0, "color": [1, 0, 0] });
    model.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [light] } });
    let lit = json!({ "KHR_lights_punctual": { "light": 0 } });
    let nodes = model.json["nodes"].as_array_mut().expect("a list");
    nodes.extend([json!({ "camera": 0 }), json!({ "extensions": lit })]);
    model.json["scenes"] = json!([{ "nodes": [0, 1, 2] }]);
    let times = [0.0, 2.0];
    let colours = [[0.0, 0.0, 0.0, 1.0], [0.8, 0.4, 0.0, 1.0]];
    animate_pointer(&mut model, "/materials/0/pbrMetallicRoughness/baseColorFactor", &times, &colours);
    animate_pointer(&mut model, "/cameras/0/perspective/yfov", &times, &[[0.5], [1.5]]);
    let intensity = "/extensions/KHR_lights_punctual/lights/0/intensity";
    animate_pointer(&mut model, intensity, &times, &[[0.0], [4.0]]);
    animate_pointer(&mut model, "/nodes/2/translation", &times, &[[0.0, 0.0, 0.0], [0.0, 8.0, 0.0]]);
    let (scene, warnings) = at(&model, 0.5);
    assert_eq!(warnings, [] as [&str; 0]);
    assert_eq!((scene.clips[0].channels, scene.clips[0].duration), (5, 2.0));
    assert_near(positions(&scene)[0], [1.0, 0.0, 0.0]);
    let Material::MetallicRoughness(material) = &scene.materials[0] else { panic!("{:?}", scene.materials) };
    let kiln::film::Colour::Linear(colour) = material.base_colour else { panic!("{material:?}") };
    assert!((colour - DVec3::new(0.2, 0.1, 0.0)).length() < 1e-7, "{colour}");
    assert_eq!(material.metallic, 0.25);
    // 0.75 rad; the camera looks at the point nearest to the middle of the scene, and its height scales along.
    let camera = &scene.cameras[0];
    assert!((camera.view_height / camera.viewpoint_distance - 2.0 * 0.375f64.tan()).abs() < 1e-7);
    // Candela are divided by pi.
    assert!((scene.lights[0].intensity * std::f64::consts::PI - 1.0).abs() < 1e-7);
    let kiln::scene::LightKind::Point { position, .. } = scene.lights[0].kind else {
        panic!("a point light")
    };
    assert_near(position, [0.0, 2.0, 0.0]);
}

/// A property that does not exist, or that may not be animated: a warning, and the rest is played.
#[test]
fn pointers_that_cannot_be_played_are_left_out() {
    let mut model = Model::triangle();
    clip(&mut model, 0, "translation", &[0.0, 1.0], &[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]], "Walk");
    let pointers = ["/materials/7/alphaCutoff", "/accessors/0/count", "/nodes/0/mesh"];
    animate_pointer(&mut model, pointers[0], &[0.0, 1.0], &[[0.0], [1.0]]);
    animate_pointer(&mut model, pointers[1], &[0.0, 1.0], &[[9e9], [9e9]]);
    let (scene, warnings) = at(&model, 0.5);
    assert_near(positions(&scene)[0], [1.0, 0.0, 0.0]);
    let ends = pointers.map(|pointer| format!(": the animation of {pointer} cannot be played; left out"));
    assert!(
        warnings.len() == 2 && warnings.iter().zip(&ends).all(|(w, end)| w.ends_with(end)),
        "{warnings:?}"
    );
    // A document that is no longer valid is drawn without any of them.
    animate_pointer(&mut model, pointers[2], &[0.0, 1.0], &[[0.5], [0.5]]);
    let (scene, warnings) = at(&model, 0.5);
    assert_near(positions(&scene)[0], [1.0, 0.0, 0.0]);
    assert!(warnings[2].contains("properties that clips animate are at rest"), "{warnings:?}");
}

/// KHR_node_visibility holds for all nodes below, and a pointer may animate it. Hidden joints still move their skins.
#[test]
fn hidden_nodes_are_not_drawn() {
    let visible = |is: bool| json!({ "KHR_node_visibility": { "visible": is } });
    let mut model = Model::triangle();
    model.json["nodes"] = json!([{ "children": [1], "extensions": visible(false) }, { "mesh": 0, "extensions": visible(true) }]);
    model.json["scenes"] = json!([{ "nodes": [0] }]);
    let pointer = "/nodes/0/extensions/KHR_node_visibility/visible";
    animate_pointer(&mut model, pointer, &[0.0, 1.0], &[[0.0], [1.0]]);
    model.json["animations"][0]["samplers"][0]["interpolation"] = json!("STEP");
    assert_eq!(at(&model, 0.0).0.objects.len(), 0);
    assert_eq!(at(&model, 1.0).0.objects.len(), 1);
}

/// Another pose of the same files takes the images that the scene has: the image is damaged in between.
#[test]
fn another_pose_keeps_the_images() {
    let folder = tempfile::tempdir().expect("a folder");
    let image = folder.path().join("a.png");
    image::RgbImage::from_pixel(1, 1, image::Rgb([1, 2, 3])).save(&image).expect("a file");
    let mut model = Model::triangle();
    model.attribute("TEXCOORD_0", &[[0.0, 0.0]; 3]);
    model.json["images"] = json!([{ "uri": "a.png" }]);
    model.json["textures"] = json!([{ "source": 0 }]);
    model.json["materials"] = json!([{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }]);
    clip(&mut model, 0, "translation", &[0.0, 1.0], &[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]], "Walk");
    let file = folder.path().join("model.glb");
    std::fs::write(&file, model.binary()).expect("the file is written");
    let mut warnings = Warnings::default();
    let scene = load_with(&[file], &options(None), &mut warnings).expect("a scene");
    std::fs::write(&image, "damaged").expect("the file is written");
    let moment = options(Some(ClipTime { clip: ClipChoice::First, time: 0.5 }));
    let posed = kiln::import::reload(&scene, &moment, &mut warnings).expect("a scene");
    assert_near(positions(&posed)[0], [1.0, 0.0, 0.0]);
    assert_eq!((&posed.images, warnings.messages().len()), (&scene.images, 0));
}

/// Without scenes, nodes without a parent are drawn, with what is below them.
#[test]
fn without_scenes_the_hierarchy_stands() {
    let mut model = Model::triangle();
    model.json["nodes"] = json!([{ "mesh": 0 }, { "translation": [1, 0, 0], "children": [0] }]);
    let json = model.json.as_object_mut().expect("an object");
    json.remove("scene");
    json.remove("scenes");
    assert_near(positions(&posed(&model, None, None).expect("a scene"))[0], [1.0, 0.0, 0.0]);
}

/// Frame 15 of 30 a second is the picture of 0.5 seconds; the clip moves the triangle out of the middle by then.
#[test]
fn frames_play_a_clip() {
    let mut model = Model::triangle();
    // Two clips of one name: the second is chosen by its index.
    clip(&mut model, 0, "translation", &[0.0, 1.0], &[[9.0, 0.0, 0.0], [9.0, 0.0, 0.0]], "Walk");
    clip(&mut model, 0, "translation", &[0.0, 1.0], &[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]], "Walk");
    let second = ClipChoice::Named("1".into());
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("model.glb");
    std::fs::write(&file, model.binary()).expect("the file is written");
    let inputs = [file];
    let camera = kiln::import::inline_camera("{ position = [0, 0, 5], look_at = [0.3, 0.3, 0] }", None)
        .expect("a camera");
    let settings = RenderSettings {
        camera: CameraChoice::Given(camera),
        ..kiln::scene::PictureSettings::of_size([32; 2]).into()
    };
    let still = |time: f64| {
        let moment = ClipTime { clip: second.clone(), time };
        let scene = load_with(&inputs, &options(Some(moment)), &mut Warnings::default()).expect("a scene");
        let job = kiln::job::prepare(scene, &settings, &mut Warnings::default()).expect("a job");
        job.render::<[u8; 3]>(&RenderControl::default()).expect("a picture").0.bytes()
    };
    let mut scene = load_with(&inputs, &options(None), &mut Warnings::default()).expect("a scene");
    play_clip(&mut scene, &second).expect("it is a file");
    let request = FrameRequest::all(None, None, None);
    let animation = AnimationJob::prepare(scene, &settings, &request, &mut Warnings::default(), |_| ())
        .expect("an animation");
    assert_eq!(animation.frames.len(), 30);
    let frame = |number| {
        let job = animation.frame(number).expect("a frame");
        job.render::<[u8; 3]>(&RenderControl::default()).expect("a picture").0.bytes()
    };
    assert!(frame(0) == still(0.0) && frame(15) == still(0.5) && frame(0) != frame(15));
}

#[test]
fn clips_are_chosen_by_name_or_number() {
    let mut model = Model::triangle();
    for (name, x) in [("Walk", 1.0), ("Run", 2.0)] {
        clip(&mut model, 0, "translation", &[0.0], &[[x, 0.0, 0.0]], name);
    }
    let x = |clip| posed(&model, None, clip).map(|scene| positions(&scene)[0].x);
    assert_eq!(x(Some("Run")).expect("a scene"), 2.0);
    assert_eq!(x(Some("1")).expect("a scene"), 2.0);
    let error = x(Some("Fly")).expect_err("there is none");
    assert!(matches!(error, Error::Usage { .. }));
    assert_eq!(
        (error.to_string().as_str(), error.hint()),
        ("no input has a clip `Fly`", "their clips: `Walk`, `Run`")
    );
    let none = posed(&Model::triangle(), Some(1.0), None).expect_err("no clips");
    assert_eq!(none.to_string(), "no input has clips");
}

/// Three clips of a real, skinned model, each at three times: finite, not as at rest, and each different.
#[test]
#[ignore = "needs KILN_MODELS"]
fn with_models_the_fox_moves() {
    let folder = models();
    let file = folder.join("Fox.glb");
    let at = |pose: Option<ClipTime>| {
        let scene = load_with(std::slice::from_ref(&file), &options(pose), &mut Warnings::default())
            .expect("a scene");
        scene.bounds().expect("bounds")
    };
    let mut bounds = vec![at(None)];
    for clip in ["Survey", "Walk", "Run"] {
        for time in [0.1, 0.3, 0.5] {
            bounds.push(at(Some(ClipTime { clip: ClipChoice::Named(clip.into()), time })));
        }
    }
    for (i, (min, max)) in bounds.iter().enumerate() {
        assert!(min.is_finite() && max.is_finite() && (*max - *min).length() < 400.0);
        assert!(bounds[..i].iter().all(|other| other != &(*min, *max)), "{i}");
    }
}

/// The normal is that of the sum of all targets, whichever comes first: (0, 0, 1) + (4, 0, 0) + (0, 4, 0), normalised.
#[test]
fn normals_are_normalised_after_all_morph_targets() {
    let normal = |order: [usize; 2]| {
        let mut model = Model::triangle();
        model.attribute("NORMAL", &[[0.0f32, 0.0, 1.0]; 3]);
        let none = [0.0f32; 3];
        let targets = [[4.0, 0.0, 0.0], [0.0, 4.0, 0.0]].map(|by| model.floats(&[by, none, none]));
        model.primitive()["targets"] =
            json!([{ "NORMAL": targets[order[0]] }, { "NORMAL": targets[order[1]] }]);
        model.json["meshes"][0]["weights"] = json!([1.0, 1.0]);
        let scene = posed(&model, None, None).expect("a scene");
        let Shape::Mesh(mesh) = &scene.objects[0].shape else { panic!("a mesh") };
        mesh.normals.as_ref().expect("normals").values[0]
    };
    let expected = DVec3::new(4.0, 4.0, 1.0).normalize();
    assert!((normal([0, 1]) - expected).length() < 1e-12, "{}", normal([0, 1]));
    assert_eq!(normal([0, 1]), normal([1, 0]));
}

/// The rotation of a texture transform is an angle: half way from 0 to 1 it is 0.5.
#[test]
fn pointers_animate_angles_of_texture_transforms() {
    let mut model = Model::triangle();
    model.attribute("TEXCOORD_0", &[[0.0f32, 0.0], [1.0, 0.0], [0.0, 1.0]]);
    let image = "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==";
    model.json["images"] = json!([{ "uri": image }]);
    model.json["textures"] = json!([{ "source": 0 }]);
    let transform = json!({ "KHR_texture_transform": { "rotation": 0.0 } });
    let texture = json!({ "index": 0, "extensions": transform });
    model.json["materials"] = json!([{ "pbrMetallicRoughness": { "baseColorTexture": texture } }]);
    model.primitive()["material"] = json!(0);
    let pointer =
        "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions/KHR_texture_transform/rotation";
    animate_pointer(&mut model, pointer, &[0.0, 2.0], &[[0.0], [1.0]]);
    let (scene, warnings) = at(&model, 1.0);
    assert_eq!(warnings, [""; 0]);
    let Shape::Mesh(mesh) = &scene.objects[0].shape else { panic!("a mesh") };
    // (1, 0) turned by 0.5: u = cos, v = -sin (KHR_texture_transform).
    let turned = mesh.uvs[0].values[1];
    assert!((turned.x - 0.5f64.cos()).abs() < 1e-6 && (turned.y + 0.5f64.sin()).abs() < 1e-6, "{turned}");
}

/// A vertex whose weights are 0 moves with the first joint; the others as their weights say.
#[test]
fn a_vertex_without_weights_does_not_undo_its_skin() {
    let mut model = Model::triangle();
    model.attribute("JOINTS_0", &[[0.0f32; 4]; 3]);
    model.attribute("WEIGHTS_0", &[[0.0f32; 4], [1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]);
    let joints = model.primitive()["attributes"]["JOINTS_0"].as_u64().expect("an index") as usize;
    model.json["accessors"][joints]["componentType"] = json!(5121);
    model.json["accessors"][joints]["min"] = json!([0, 0, 0, 0]);
    model.set_bytes(joints, &[[0u8; 4]; 3].concat());
    model.json["skins"] = json!([{ "joints": [1] }]);
    model.json["nodes"] = json!([{ "mesh": 0, "skin": 0 }, { "translation": [5, 0, 0] }]);
    model.json["scenes"] = json!([{ "nodes": [0, 1] }]);
    let scene = posed(&model, None, None).expect("a scene");
    assert_near(positions(&scene)[0], [5.0, 0.0, 0.0]);
    assert_near(positions(&scene)[1], [6.0, 0.0, 0.0]);
}

/// Several clips, by name or all, pose a file together, each at the time or at its end. Of two that animate one
/// property the last is used, with a note.
#[test]
fn several_clips_play_together() {
    let mut model = Model::triangle();
    model.json["nodes"] = json!([{ "mesh": 0 }, { "mesh": 0 }]);
    model.json["scenes"] = json!([{ "nodes": [0, 1] }]);
    let ends = |x: f32, y: f32| [[0.0, 0.0, 0.0], [x, y, 0.0]];
    clip(&mut model, 0, "translation", &[0.0, 2.0], &ends(2.0, 0.0), "Left");
    clip(&mut model, 1, "translation", &[0.0, 1.0], &ends(0.0, 3.0), "Right");
    clip(&mut model, 0, "translation", &[0.0, 2.0], &ends(0.0, 8.0), "Other");
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("model.glb");
    std::fs::write(&file, model.binary()).expect("the file is written");
    let named = |names: &[&str]| {
        let choices = names.iter().map(|name| ClipChoice::Named((*name).to_owned())).collect();
        ClipChoice::together(choices).expect("a choice")
    };
    let posed = |clip: ClipChoice, time| {
        let mut warnings = Warnings::default();
        let scene =
            load_with(std::slice::from_ref(&file), &options(Some(ClipTime { clip, time })), &mut warnings);
        let corner = |object: &kiln::scene::Object| {
            let (min, _) =
                Scene { objects: vec![object.clone()], ..Scene::default() }.bounds().expect("bounds");
            [min.x, min.y]
        };
        let places = scene.map(|scene| scene.objects.iter().map(corner).collect::<Vec<_>>());
        (places, warnings.notes().to_vec())
    };
    let (places, notes) = posed(named(&["Left", "Right"]), 1.5);
    // Three quarters of the way, and the end of the shorter one.
    assert_eq!(places.expect("a scene"), [[1.5, 0.0], [0.0, 3.0]]);
    assert_eq!(notes, [] as [&str; 0]);
    for (choice, expected) in [("all", [0.0, 6.0]), ("Left Other", [0.0, 6.0]), ("2 0", [1.5, 0.0])] {
        let names: Vec<&str> = choice.split(' ').collect();
        let (places, notes) = posed(named(&names), 1.5);
        assert_eq!(places.expect("a scene")[0], expected, "{choice}");
        assert!(notes[0].contains("animate the same property"), "{choice}: {notes:?}");
    }
    // Of three, the note names the last, which is used.
    let mut three = Model::triangle();
    for (name, x) in [("Survey", 1.0), ("Walk", 2.0), ("Run", 4.0)] {
        clip(&mut three, 0, "translation", &[0.0, 2.0], &ends(x, 0.0), name);
    }
    std::fs::write(&file, three.binary()).expect("the file is written");
    let (places, notes) = posed(named(&["all"]), 1.0);
    assert_eq!(places.expect("a scene")[0], [2.0, 0.0]);
    assert!(
        notes[0].ends_with("clips `Walk` and `Run` animate the same property; that of `Run` is used"),
        "{notes:?}"
    );
    std::fs::write(&file, model.binary()).expect("the file is written");
    let (missing, _) = posed(named(&["Left", "Fly"]), 0.0);
    assert_eq!(missing.expect_err("there is none").to_string(), "no input has a clip `Fly`");
    // The animation lasts as long as the longest, and its frames are the poses.
    let mut scene =
        load_with(std::slice::from_ref(&file), &options(None), &mut Warnings::default()).expect("a scene");
    play_clip(&mut scene, &named(&["Right", "Left"])).expect("clips of a file");
    let animation = scene.animation.expect("an animation");
    assert_eq!((animation.duration, animation.clips.len()), (2.0, 2));
}

/// A skin with a joint that mirrors x and one that does not: triangles of either, and one with most vertices of the
/// mirroring joint, keep their fronts at +z, and so do normals, of the file and computed for a normal map.
#[test]
fn a_mirrored_joint_turns_its_own_triangles_alone() {
    // Of the last triangle, two vertices are mirrored: (-1, 0), (-2, 0) and (-3, 5) come to (1, 0), (2, 0) and (-3, 5),
    // which is counterclockwise only in the other order.
    let corners = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [-1.0, 0.0, 0.0],
        [-3.0, 5.0, 0.0],
        [-2.0, 0.0, 0.0],
    ];
    for order in [[0, 1, 2], [1, 0, 2]] {
        for has_normals in [true, false] {
            let at = |part: usize| (0..3).map(move |corner| 3 * part + corner);
            let places: Vec<usize> = order.iter().flat_map(|&part| at(part)).collect();
            let positions: Vec<[f32; 3]> = places.iter().map(|&i| corners[i]).collect();
            let mut model = Model::new(&positions);
            if has_normals {
                model.attribute("NORMAL", &[[0.0, 0.0, 1.0]; 9]);
            } else {
                let flat = crate::common::gltf::png_uri(1, &[[128, 128, 255, 255]]);
                model.attribute("TEXCOORD_0", &positions.iter().map(|p| [p[0], p[1]]).collect::<Vec<_>>());
                model = model.with_texture(&flat, &json!({}), &json!({ "normalTexture": { "index": 0 } }));
            }
            let joint = |i: usize| u8::from((3..6).contains(&i) || i == 6 || i == 8);
            let bytes: Vec<u8> = places.iter().flat_map(|&i| [joint(i), 0, 0, 0]).collect();
            let joints = model.accessor(bytes, 5121, 9, "VEC4");
            model.primitive()["attributes"]["JOINTS_0"] = json!(joints);
            model.attribute("WEIGHTS_0", &[[1.0, 0.0, 0.0, 0.0]; 9]);
            model.json["skins"] = json!([{ "joints": [1, 2] }]);
            model.json["nodes"] = json!([{ "mesh": 0, "skin": 0 }, {}, { "scale": [-1, 1, 1] }]);
            model.json["scenes"] = json!([{ "nodes": [0, 1, 2] }]);
            let scene = posed(&model, None, None).expect("a scene");
            let Shape::Mesh(mesh) = &scene.objects[0].shape else { panic!("a mesh") };
            for (index, triangle) in mesh.triangles.iter().enumerate() {
                let [a, b, c] = mesh.front(*triangle).map(|i| mesh.positions[i as usize]);
                assert!((b - a).cross(c - a).z > 0.0, "{order:?}: triangle {index}");
                let normals = mesh.normals.as_ref().expect("normals");
                let corners = normals.triangles.as_ref().map_or(*triangle, |all| all[index]);
                assert!(
                    corners.iter().all(|&i| normals.values[i as usize].z > 0.0),
                    "{order:?} {has_normals}"
                );
            }
        }
    }
}

/// A clip at half its time weighs a morph target by 0.5; then a joint at (5, 0, 0) mirrors x. The corners (0, 0, 0),
/// (1, 0, 0) and (0, 1, 0) move by half of (2, 0, 1), and come to 5 - x. A normal (0, 0, 1) and half of (2, 0, 0) is
/// (1, 0, 1) before the joint and (-1, 0, 1) after it, normalised. The front stays at +z, as all corners move alike.
#[test]
fn morph_targets_under_a_mirrored_joint() {
    let mut model = Model::triangle();
    model.attribute("NORMAL", &[[0.0, 0.0, 1.0]; 3]);
    let [by, turned] = [[2.0f32, 0.0, 1.0], [2.0, 0.0, 0.0]].map(|by| model.floats(&[by; 3]));
    model.primitive()["targets"] = json!([{ "POSITION": by, "NORMAL": turned }]);
    let joints = model.accessor([1, 0, 0, 0].repeat(3), 5121, 3, "VEC4");
    model.primitive()["attributes"]["JOINTS_0"] = json!(joints);
    model.attribute("WEIGHTS_0", &[[1.0, 0.0, 0.0, 0.0]; 3]);
    model.json["skins"] = json!([{ "joints": [1, 2] }]);
    let joint = json!({ "translation": [5, 0, 0], "scale": [-1, 1, 1] });
    model.json["nodes"] = json!([{ "mesh": 0, "skin": 0 }, {}, joint]);
    model.json["scenes"] = json!([{ "nodes": [0, 1, 2] }]);
    clip(&mut model, 0, "weights", &[0.0, 1.0], &[[0.0], [1.0]], "Bulge");
    let scene = posed(&model, Some(0.5), None).expect("a scene");
    for (found, expected) in positions(&scene).iter().zip([[4.0, 0.0, 0.5], [3.0, 0.0, 0.5], [4.0, 1.0, 0.5]])
    {
        assert_near(*found, expected);
    }
    let Shape::Mesh(mesh) = &scene.objects[0].shape else { panic!("a mesh") };
    let [a, b, c] = mesh.front(mesh.triangles[0]).map(|i| mesh.positions[i as usize]);
    assert_near((b - a).cross(c - a), [0.0, 0.0, 1.0]);
    let normal = mesh.normals.as_ref().expect("normals").values[0].normalize();
    let half = 0.5f64.sqrt();
    assert_near(normal, [-half, 0.0, half]);
}
