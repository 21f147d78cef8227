//! The command, frames, the window and Python have the same picture of a scene at time 0.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use base64::Engine;
use clap::Parser;
use serde_json::json;

use super::arguments::Arguments;
use super::picture::{Options, Picture, PreparedScene, Value, render};
use super::prepare::Reporter;
use super::progress::Mode;
use super::view::open;
use crate::animation::FrameRequest;
use crate::error::{Result, Warnings};
use crate::film::check::state_of;
use crate::film::write::{FINGERPRINT, Format, OutputImage};
use crate::job::RenderJob;
use crate::metrics::ComparedImage;
use crate::render::RenderControl;
use crate::scene::{ClipTime, Scene};
use crate::viewer::{CameraSource, Opened};

const SIZE: [u32; 2] = [20, 16];

#[derive(Parser)]
struct Line {
    #[command(flatten)]
    arguments: Arguments,
}

/// Options by name, and their values if they take one.
type NamedOptions = [(&'static str, Option<&'static str>)];

/// The arguments of a file, with further options.
fn arguments(file: &Path, options: &NamedOptions) -> Arguments {
    let size = SIZE.map(|side| side.to_string()).join("x");
    let options = options.iter().map(|(name, value)| match value {
        Some(value) => format!("--{name}={value}"),
        None => format!("--{name}"),
    });
    let words = ["kiln".to_owned(), file.display().to_string(), format!("--size={size}")];
    Line::parse_from(words.into_iter().chain(options)).arguments
}

type Pixels = Vec<[u8; 3]>;

fn pixels(job: &RenderJob) -> Result<Pixels> {
    Ok(job.render::<[u8; 3]>(&RenderControl::default())?.0.rows().collect())
}

/// The picture of `kiln render`, at time 0 of clips.
fn still(arguments: &Arguments) -> Result<Pixels> {
    let mut reporter = Reporter::silent(Mode::None);
    let resolved = reporter.load_and_resolve(arguments, &arguments.settings()?)?;
    pixels(&resolved.build(&mut reporter.warnings)?)
}

/// Frame 0 of `kiln animate`.
fn frame_0(arguments: &Arguments) -> Result<Pixels> {
    let mut reporter = Reporter::silent(Mode::None);
    let request = FrameRequest::all(None, None, None);
    let mut animation = reporter.load_animation(arguments, &arguments.settings()?, &request)?;
    animation.fix_exposure(&RenderControl::default())?;
    pixels(&animation.frame(0)?)
}

/// The picture that the window ends with. Its first camera of clips is fitted to all of their poses; here it has that of the
/// first, as the others.
fn in_the_window(arguments: &Arguments) -> Result<Pixels> {
    crate::viewer::final_picture(&opened(arguments)?, SIZE)
}

fn opened(arguments: &Arguments) -> Result<Arc<Opened>> {
    let mut opened = open(arguments, &arguments.inputs, None, &mut Warnings::default()).0?;
    if let CameraSource::FittedAt(view, None) = opened.camera_source {
        opened.camera_source = CameraSource::Fitted(view);
    }
    Ok(Arc::new(opened))
}

fn load(arguments: &Arguments) -> Result<Scene> {
    crate::import::load_with(&arguments.inputs, &arguments.reading(), &mut Warnings::default())
}

/// The options of Python's functions.
fn in_python(options: &NamedOptions) -> Result<Options> {
    let size = SIZE.map(|side| side.to_string());
    let value =
        |value: Option<&str>| value.map_or(Value::Switch(true), |value| Value::Text(value.to_owned()));
    let options = options.iter().map(|(name, given)| (name.replace('-', "_"), value(*given)));
    let options: Vec<_> = options.chain([("size".to_owned(), Value::List(size.into()))]).collect();
    Options::parse(&options)
}

fn pixels_of(picture: &Picture) -> Pixels {
    let OutputImage::Rgb8(film, _) = picture.image() else { panic!("a picture without alpha") };
    film.rows().collect()
}

/// The picture of Python's `kiln.render` of a scene.
fn python(scene: Scene, options: &NamedOptions) -> Result<Picture> {
    let control = RenderControl::default();
    render(scene, &in_python(options)?, Format::Png, &[], &control, &mut Warnings::default())
}

/// The picture of Python's `kiln.Prepared`.
fn prepared(scene: &PreparedScene, options: &NamedOptions) -> Result<Picture> {
    let control = RenderControl::default();
    scene.render(&in_python(options)?, Format::Png, &[], &control, &mut Warnings::default())
}

/// glTF of a square above a floor, of a material, which a clip moves. At rest it is elsewhere.
fn clip(material: &serde_json::Value) -> String {
    let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let square = floats(&[0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 0., 0., 1., 1., 0., 0., 1., 0.]);
    let (times, moved) = (floats(&[0.0, 1.0]), floats(&[0.0, 0.5, 0.0, 0.0, 2.5, 0.0]));
    let bytes = [square, times, moved].concat();
    let uri = base64::engine::general_purpose::STANDARD.encode(&bytes);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let mesh =
        |material: u32| json!({ "primitives": [{ "attributes": { "POSITION": 0 }, "material": material }] });
    json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0, 1] }],
        "buffers": [{ "byteLength": bytes.len(), "uri": format!("data:application/octet-stream;base64,{uri}") }],
        "bufferViews": [
            { "buffer": 0, "byteLength": 72 }, { "buffer": 0, "byteOffset": 72, "byteLength": 8 },
            { "buffer": 0, "byteOffset": 80, "byteLength": 24 },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 6, "min": [0, 0, 0], "max": [1, 1, 0] },
            { "bufferView": 1, "componentType": 5126, "type": "SCALAR", "count": 2, "min": [0], "max": [1] },
            { "bufferView": 2, "componentType": 5126, "type": "VEC3", "count": 2 },
        ],
        "materials": [{ "doubleSided": true }, material],
        "meshes": [mesh(0), mesh(1)],
        "nodes": [
            { "mesh": 0, "scale": [4, 4, 4], "rotation": [-half, 0, 0, half], "translation": [-2, 0, 2] },
            { "mesh": 1, "translation": [4, 3, 0] },
        ],
        "animations": [{
            "samplers": [{ "input": 1, "output": 2 }],
            "channels": [{ "sampler": 0, "target": { "node": 1, "path": "translation" } }],
        }],
    })
    .to_string()
}

/// Scene files, a mesh of each format, and clips of materials that call for another look.
fn files(folder: &Path) -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = ["scenes", "scenes/effects", "scenes/hard"].map(|folder| root.join(folder));
    let files = folders.iter().flat_map(|folder| std::fs::read_dir(folder).expect("a folder"));
    let files = files.map(|entry| entry.expect("a file").path());
    let mut files: Vec<PathBuf> =
        files.filter(|file| file.extension().is_some_and(|ending| ending == "toml")).collect();
    assert!(files.len() > 30, "{}", files.len());
    let meshes = ["l.obj", "materials.obj", "square.gltf", "square.ply", "tetrahedron.stl"];
    files.extend(meshes.map(|file| root.join("assets/import").join(file)));
    let strength = json!({ "KHR_materials_emissive_strength": { "emissiveStrength": 5 } });
    let glass = json!({ "KHR_materials_transmission": { "transmissionFactor": 1 } });
    for (name, material) in [
        ("plain.gltf", json!({})),
        ("lamp.gltf", json!({ "emissiveFactor": [1, 1, 1], "extensions": strength })),
        ("glass.gltf", json!({ "extensions": glass })),
    ] {
        files.push(folder.join(name));
        std::fs::write(folder.join(name), clip(&material)).expect("a file");
    }
    // A sun of 2000 lux, whose exposure is metered, with fill light by that.
    let mut lit: serde_json::Value = serde_json::from_str(&clip(&json!({}))).expect("a glTF");
    let sun = json!({ "type": "directional", "intensity": 2000 });
    lit["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    lit["extensions"] = json!({ "KHR_lights_punctual": { "lights": [sun] } });
    let node =
        json!({ "rotation": [-0.6, 0, 0, 0.8], "extensions": { "KHR_lights_punctual": { "light": 0 } } });
    lit["nodes"].as_array_mut().expect("nodes").push(node);
    lit["scenes"][0]["nodes"] = json!([0, 1, 2]);
    files.push(folder.join("lit.gltf"));
    std::fs::write(folder.join("lit.gltf"), lit.to_string()).expect("a file");
    files
}

/// With the same files and options, all have the same picture at time 0, byte for byte: the same look, camera, exposure,
/// clamp and sampling.
#[test]
fn all_ways_to_a_picture_have_the_same() {
    let folder = tempfile::tempdir().expect("a folder");
    let variants: [&NamedOptions; 9] = [
        &[],
        &[("draft", None)],
        &[("exposure", Some("1"))],
        &[("exposure", Some("auto"))],
        &[("ground", Some("true"))],
        &[("elevation", Some("-30"))],
        &[("without", Some("path"))],
        &[("background", Some("#c04030")), ("azimuth", Some("20"))],
        &[("background", Some("#3040c0"))],
    ];
    let (mut compared, mut frames) = (0, 0);
    for file in files(folder.path()) {
        // One prepared scene for all options, so that stale caches are found.
        let mut of_file = None;
        for options in variants {
            let arguments = arguments(&file, options);
            let has_clips = file.starts_with(folder.path());
            let mut at_0 = arguments.clone();
            if has_clips {
                let clip = at_0.import.clip();
                at_0.import = at_0.import.posed(ClipTime { clip, time: 0.0 });
            }
            let place = format!("{}, {options:?}", file.display());
            // An option that does not suit the scene is an error in all of them.
            let Ok(expected) = still(&at_0) else {
                assert!(in_the_window(&arguments).is_err(), "{place}: window");
                assert!(frame_0(&arguments).is_err(), "{place}: frame 0");
                assert!(load(&at_0).and_then(|scene| python(scene, options)).is_err(), "{place}: Python");
                if let Some(scene) = &of_file {
                    assert!(prepared(scene, options).is_err(), "{place}: prepared");
                }
                continue;
            };
            compared += 1;
            assert!(
                in_the_window(&arguments).unwrap_or_else(|e| panic!("{place}: {e}")) == expected,
                "{place}: window"
            );
            let scene = load(&at_0).unwrap_or_else(|e| panic!("{place}: {e}"));
            // Without a camera and something that moves, frames are those of a turntable.
            if scene.default_camera().is_some() || has_clips {
                frames += 1;
                assert!(
                    frame_0(&arguments).unwrap_or_else(|e| panic!("{place}: {e}")) == expected,
                    "{place}: frame 0"
                );
            }
            let of_file = of_file.get_or_insert_with(|| {
                PreparedScene::new(scene.clone().into()).unwrap_or_else(|e| panic!("{place}: {e}"))
            });
            let picture = python(scene, options).unwrap_or_else(|e| panic!("{place}: {e}"));
            assert!(pixels_of(&picture) == expected, "{place}: Python");
            // Options also say how files are read, which is done once here.
            let again = prepared(of_file, options).unwrap_or_else(|e| panic!("{place}: {e}"));
            let picture = python(of_file.scene().clone(), options).unwrap_or_else(|e| panic!("{place}: {e}"));
            assert!(pixels_of(&picture) == pixels_of(&again), "{place}: prepared");
            assert_eq!(picture.metadata(), again.metadata(), "{place}: prepared");
        }
    }
    assert!(compared > 200 && frames > 150, "{compared}, {frames}");
}

/// Objects hidden by options are hidden in all of them, also those of clips and tracks, and in the window where they are
/// hidden once the file is open.
#[test]
fn hidden_objects_are_in_no_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    let clip_file = folder.path().join("clip.gltf");
    std::fs::write(&clip_file, clip(&json!({}))).expect("a file");
    let tracks_file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/animation.toml");
    for (file, name) in [(clip_file, None), (tracks_file, Some("left sphere"))] {
        let plain = arguments(&file, &[]);
        let names: Vec<String> =
            load(&plain).expect("a scene").objects.into_iter().map(|object| object.name).collect();
        // The square that the clip moves.
        let name: &'static str = name.unwrap_or_else(|| names[1].clone().leak());
        let options: &NamedOptions = &[("hide", Some(name))];
        let mut hiding = arguments(&file, options);
        let in_window = in_the_window(&hiding).expect("a picture");
        let mut opened = open(&plain, &plain.inputs, None, &mut Warnings::default()).0.expect("a scene");
        opened.scene.set_visible(&[], &[name.to_owned()]).expect("a name");
        opened.scene.import_options.hide = vec![name.to_owned()];
        let hidden_later = crate::viewer::final_picture(&Arc::new(opened), SIZE).expect("a picture");
        let frame = frame_0(&hiding).expect("a picture");
        if names.len() == 2 {
            let clip = hiding.import.clip();
            hiding.import = hiding.import.posed(ClipTime { clip, time: 0.0 });
        }
        let expected = still(&hiding).expect("a picture");
        assert!(in_window == expected && hidden_later == expected && frame == expected, "{name}");
        let scene = load(&hiding).expect("a scene");
        assert!(pixels_of(&python(scene, options).expect("a picture")) == expected, "{name}");
        assert!(in_the_window(&plain).expect("a picture") != expected, "{name}");
    }
}

/// A later frame has the automatic exposure of the first, in the window as in frames, though it is another one alone.
#[test]
fn a_later_frame_has_the_exposure_of_the_first() {
    let folder = tempfile::tempdir().expect("a folder");
    let strength = json!({ "KHR_materials_emissive_strength": { "emissiveStrength": 5 } });
    let lamp = clip(&json!({ "emissiveFactor": [1, 1, 1], "extensions": strength }));
    for (name, text, options) in [
        ("plain.gltf", clip(&json!({})), &[("exposure", Some("auto"))][..]),
        ("lamp.gltf", lamp, &[("transport", Some("path"))]),
    ] {
        let file = folder.path().join(name);
        std::fs::write(&file, text).expect("a file");
        let arguments = arguments(&file, options);
        let mut reporter = Reporter::silent(Mode::None);
        let (settings, request) =
            (arguments.settings().expect("settings"), FrameRequest::all(None, None, None));
        let mut animation = reporter.load_animation(&arguments, &settings, &request).expect("frames");
        let alone = animation.frame(24).and_then(|mut job| {
            if animation.picture.meters {
                job.meter(&RenderControl::default())?;
            }
            pixels(&job)
        });
        animation.fix_exposure(&RenderControl::default()).expect("an exposure");
        let expected = pixels(&animation.frame(24).expect("a frame")).expect("a picture");
        let shown = crate::viewer::final_picture_at(&opened(&arguments).expect("a scene"), SIZE, 24);
        assert!(shown.expect("a picture") == expected, "{name}");
        assert!(alone.expect("a picture") != expected, "{name}: the frames have one exposure");
    }
}

/// The window saves what the command writes: alpha in floating point, the fingerprint and the number of a frame, and
/// OpenEXR with the samples of its own automatic exposure, which decides where adaptive sampling stops.
#[test]
fn the_window_saves_the_file_of_the_command() {
    let folder = tempfile::tempdir().expect("a folder");
    let clip_file = folder.path().join("clip.gltf");
    std::fs::write(&clip_file, clip(&json!({}))).expect("a file");
    let mesh = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/import/l.obj");
    let (saved, control) = (folder.path().join("saved.exr"), RenderControl::default());
    let transparent: &NamedOptions = &[("background", Some("transparent"))];
    let auto: &NamedOptions = &[("exposure", Some("auto")), ("noise", Some("0.02")), ("samples", Some("64"))];
    for (file, frame, options) in
        [(mesh, None, transparent), (clip_file.clone(), Some(0), transparent), (clip_file, Some(24), auto)]
    {
        let arguments = arguments(&file, options);
        let opened = opened(&arguments).expect("a scene");
        crate::viewer::save_picture(&opened, SIZE, frame, &saved).expect("a file");
        let mut reporter = Reporter::silent(Mode::None);
        let settings = arguments.settings().expect("settings");
        let job = match frame {
            None => {
                let resolved = reporter.load_and_resolve(&arguments, &settings).expect("a scene");
                resolved.build(&mut reporter.warnings).expect("a job")
            }
            Some(frame) => {
                let request = FrameRequest::all(None, None, None);
                let animation = reporter.load_animation(&arguments, &settings, &request).expect("frames");
                animation.frame(frame).expect("a frame")
            }
        };
        let (film, alpha, _) = job.render_float(false, &control).expect("a picture");
        let read = ComparedImage::open(&saved).expect("a picture");
        assert!(read.pixels.iter().eq(&film.rows().collect::<Vec<_>>()), "{file:?}");
        assert_eq!(read.alpha.map(|alpha| alpha.values), alpha.map(|alpha| alpha.values), "{file:?}");
        let fingerprint = job.metadata.iter().find(|(key, _)| key == FINGERPRINT).expect("a fingerprint");
        assert!(state_of(&saved, Format::Exr).is(&fingerprint.1, frame), "{file:?}");
    }
}

/// The window ends with the picture of the command, byte for byte, for real files: a room from inside and a box of paths,
/// whose exposure and clamp are metered, textures, and an animation at rest.
#[test]
#[ignore = "needs KILN_MODELS"]
fn with_models_the_window_shows_the_picture_of_the_command() {
    let models = PathBuf::from(std::env::var_os("KILN_MODELS").expect("KILN_MODELS names a folder"));
    let inside = "{ position = [0, 1.5, 0], look_at = [1, 1.2, 0.3], vertical_fov = 60 }";
    let cases: [(&str, &NamedOptions); 6] = [
        ("kitchen.obj", &[("camera", Some(inside))]),
        ("kitchen.obj", &[("camera", Some(inside)), ("transport", Some("path"))]),
        ("CornellBox.glb", &[]),
        ("CornellBox.glb", &[("exposure", Some("auto"))]),
        ("Duck.glb", &[("samples", Some("6"))]),
        ("spot.obj", &[("environment", Some("sky"))]),
    ];
    for (file, options) in cases {
        let arguments = arguments(&models.join(file), options);
        let place = format!("{file}, {options:?}");
        let [expected, shown] = [still(&arguments), in_the_window(&arguments)]
            .map(|picture| picture.unwrap_or_else(|e| panic!("{place}: {e}")));
        assert!(shown == expected, "{place}");
    }
}
