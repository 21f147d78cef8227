//! The command, frames, the window and Python have the same pictures of a scene, and say the same about them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use base64::Engine;
use clap::Parser;
use serde_json::json;

use super::arguments::Arguments;
use super::output::render_image;
use super::picture::{PreparedScene, parse_options, render};
use super::prepare::Reporter;
use super::progress::Mode;
use super::view::open;
use kiln::animation::{FrameList, FrameRequest};
use kiln::error::{Error, Result, Warnings};
use kiln::film::write::{FRAME, Format, OutputImage, encode};
use kiln::job::{Findings, Metadata, PictureOptions, RenderJob, RenderSettings, Session};
use kiln::render::RenderControl;
use kiln::render::aov::AovSelection;
use kiln::scene::{ClipTime, GivenValue, Scene};
use kiln_viewer::{CameraSource, Opened};

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

/// A picture as a file, without the metadata that the window and frames add; its metadata, warnings and notes.
struct Made {
    file: Vec<u8>,
    metadata: Metadata,
    /// `None` for files that the window saves: it shows those of the picture on the screen.
    warnings: Option<Warnings>,
}

impl Made {
    fn new(image: &OutputImage, metadata: &Metadata, format: Format, warnings: Warnings) -> Result<Self> {
        let mut metadata = metadata.clone();
        metadata.retain(|(key, _)| *key != FRAME && key != "kiln:command");
        let mut file = Vec::new();
        encode(image, &Vec::new(), format, &mut file).map_err(|e| Error::output(Path::new("-"), e))?;
        Ok(Made { file, metadata, warnings: Some(warnings) })
    }

    /// Checks that both are the same.
    fn assert_same(&self, other: &Made, place: &str) {
        let metadata = |made: &Made| {
            let mut metadata = made.metadata.clone();
            metadata.sort();
            metadata
        };
        let texts = |made: &Made| {
            made.warnings.as_ref().map(|warnings| {
                let mut texts = [warnings.messages(), warnings.notes()].concat();
                texts.sort();
                texts
            })
        };
        assert!(self.file == other.file, "{place}: another picture");
        assert_eq!(metadata(self), metadata(other), "{place}");
        if let (Some(own), Some(other)) = (texts(self), texts(other)) {
            assert_eq!(own, other, "{place}");
        }
    }
}

/// The picture of a job as the command writes it, after `warnings`.
fn made(job: &RenderJob, format: Format, warnings: &mut Warnings) -> Result<Made> {
    let (control, selection) = (RenderControl::default(), AovSelection::new(&job.settings.aovs)?);
    let (image, statistics) = render_image(job, format, &selection, &control)?;
    Findings::of(job, &image, &statistics, &control)?.warn(warnings);
    Made::new(&image, &job.metadata, format, std::mem::take(warnings))
}

/// The picture of `kiln render`, at time 0 of clips.
fn still(arguments: &Arguments, format: Format, aovs: &[String]) -> Result<Made> {
    let mut reporter = Reporter::silent(Mode::None);
    let settings = RenderSettings { aovs: aovs.to_vec(), ..arguments.options.settings()? };
    let (session, resolved) = reporter.load_and_resolve(arguments, &settings, true)?;
    let (control, warnings) = (RenderControl::default(), &mut reporter.warnings);
    made(&session.into_job(&resolved, true, &control, warnings)?, format, warnings)
}

/// Frames of `kiln animate`, each with the warnings of all that is before it.
fn frames(arguments: &Arguments, list: &[i32], format: Format) -> Result<Vec<Made>> {
    let control = RenderControl::default();
    let made_one = |&frame: &i32| {
        let mut reporter = Reporter::silent(Mode::None);
        let one = FrameList::range(frame, frame);
        let is_displayed = format != Format::Exr;
        let request = FrameRequest { is_displayed, ..FrameRequest::all(None, None, Some(&one)) };
        let animation = reporter.load_animation(arguments, &arguments.options.settings()?, &request)?;
        animation.first(&control, &mut reporter.warnings)?;
        made(&animation.frame(frame)?, format, &mut reporter.warnings)
    };
    list.iter().map(made_one).collect()
}

/// The picture that the window shows, or saves in other formats. Its first camera of clips is fitted to all of their poses; here it
/// has that of the first, as the others.
fn in_the_window(arguments: &Arguments, frame: Option<i32>, format: Format) -> Result<Made> {
    let mut warnings = Warnings::default();
    let opened = opened(arguments, &mut warnings)?;
    if format == Format::Png && !opened.settings.picture.or(opened.scene().picture).is_transparent() {
        let (image, metadata) = kiln_viewer::final_picture(&opened, SIZE, frame, &mut warnings)?;
        return Made::new(&image, &metadata, format, warnings);
    }
    let (image, metadata) = kiln_viewer::saved_picture(&opened, SIZE, frame, format)?;
    Ok(Made { warnings: None, ..Made::new(&image, &metadata, format, warnings)? })
}

fn opened(arguments: &Arguments, warnings: &mut Warnings) -> Result<Arc<Opened>> {
    let mut opened = open(arguments, &arguments.inputs, None, warnings).0?;
    if let CameraSource::FittedAt(view, None) = opened.camera_source {
        opened.camera_source = CameraSource::Fitted(view);
    }
    Ok(Arc::new(opened))
}

fn load(arguments: &Arguments, warnings: &mut Warnings) -> Result<Scene> {
    kiln::import::load_with(&arguments.inputs, &arguments.options.reading(), warnings)
}

/// The options of Python's functions.
fn in_python(options: &NamedOptions) -> Result<PictureOptions> {
    let size = GivenValue::Texts(SIZE.map(|side| side.to_string()).into());
    let value = |value: Option<&str>| value.map_or(GivenValue::Switch(true), GivenValue::from);
    let options = options.iter().map(|(name, given)| (name.replace('-', "_"), Some(value(*given))));
    parse_options(options.chain([("size".to_owned(), Some(size))]).collect())
}

/// The picture of Python's `kiln.render` of a scene, after the warnings of its files.
fn python(
    (scene, mut warnings): (Scene, Warnings),
    options: &NamedOptions,
    format: Format,
    aovs: &[String],
) -> Result<Made> {
    let control = RenderControl::default();
    let picture = render(scene, &in_python(options)?, format, aovs, &control, &mut warnings)?;
    Made::new(picture.image(), picture.metadata(), format, warnings)
}

/// The picture of Python's `kiln.Prepared`, after the warnings of its files.
fn prepared(
    (scene, of_files): (&PreparedScene, &Warnings),
    options: &NamedOptions,
    format: Format,
    aovs: &[String],
) -> Result<Made> {
    let (mut warnings, control) = (of_files.clone(), RenderControl::default());
    let picture = scene.render(&in_python(options)?, format, aovs, &control, &mut warnings)?;
    Made::new(picture.image(), picture.metadata(), format, warnings)
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
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
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

/// Frames that are compared: the first, and two later ones.
const FRAMES: [i32; 3] = [0, 8, 24];

/// Checks that all ways to a picture of a file have the same: files, metadata with the fingerprint, warnings and notes.
/// `of_file` is a scene that was prepared for other options before, so that what is stale is found. Returns whether there is a
/// picture, and whether there are frames.
fn assert_same_pictures(
    arguments: &Arguments,
    options: &NamedOptions,
    (format, aovs): (Format, &[String]),
    of_file: &mut Option<(PreparedScene, Warnings)>,
) -> [bool; 2] {
    let place = format!("{:?}, {options:?}, {format:?}", arguments.inputs);
    let mut posed = arguments.clone();
    let scene = load(arguments, &mut Warnings::default());
    let has_clips = scene.as_ref().is_ok_and(|scene| !scene.clips.is_empty());
    let moves = has_clips || scene.as_ref().is_ok_and(|scene| scene.animation.is_some());
    if has_clips {
        let clip = posed.options.import.clip();
        posed.options.import = posed.options.import.clone().posed(ClipTime { clip, time: 0.0 });
    }
    // An option that does not suit the scene is an error in all of them.
    let expected = match still(&posed, format, aovs) {
        Ok(expected) => expected,
        Err(error) => {
            let same = |other: Result<Made>, way| {
                let other = other.err().unwrap_or_else(|| panic!("{place}: {way} has a picture"));
                assert_eq!(other.to_string(), error.to_string(), "{place}: {way}");
            };
            same(in_the_window(arguments, None, format), "window");
            let mut of_files = Warnings::default();
            let scene = load(&posed, &mut of_files);
            same(scene.and_then(|scene| python((scene, of_files), options, format, aovs)), "Python");
            if let Some((scene, warnings)) = of_file {
                same(prepared((scene, warnings), options, format, aovs), "prepared");
            }
            assert!(frames(arguments, &[0], format).is_err(), "{place}: frame 0");
            return [false; 2];
        }
    };
    let same = |other: Result<Made>, expected: &Made, way: &str| {
        let other = other.unwrap_or_else(|e| panic!("{place}: {way}: {e}"));
        other.assert_same(expected, &format!("{place}: {way}"));
    };
    let mut of_files = Warnings::default();
    let scene = load(&posed, &mut of_files).unwrap_or_else(|e| panic!("{place}: {e}"));
    same(python((scene.clone(), of_files.clone()), options, format, aovs), &expected, "Python");
    let (session, of_files) = of_file.get_or_insert_with(|| {
        (PreparedScene::new(scene.into()).unwrap_or_else(|e| panic!("{place}: {e}")), of_files)
    });
    // Options also say how files are read, which is done once here.
    let again = python((session.scene().clone(), of_files.clone()), options, format, aovs);
    let again = again.unwrap_or_else(|e| panic!("{place}: {e}"));
    same(prepared((session, of_files), options, format, aovs), &again, "prepared");
    // The window has no AOVs of a file.
    let is_shown = aovs.is_empty();
    if !moves {
        if is_shown {
            same(in_the_window(arguments, None, format), &expected, "window");
        }
        return [true, false];
    }
    let all = frames(arguments, &FRAMES, format).unwrap_or_else(|e| panic!("{place}: frames: {e}"));
    if aovs.is_empty() && format != Format::Exr {
        assert!(all[0].file == expected.file, "{place}: frame 0");
    }
    for (made, &frame) in all.iter().zip(&FRAMES).filter(|_| is_shown) {
        same(in_the_window(arguments, Some(frame), format), made, &format!("window, frame {frame}"));
    }
    [true; 2]
}

/// With the same files and options, the command, frames, the window and Python have the same picture at three moments, byte for
/// byte: the same look, camera, exposure, clamp and sampling, and say the same about it.
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
        &[("background", Some("#3040c0")), ("dither", None), ("seed", Some("3"))],
    ];
    let (mut compared, mut with_frames) = (0, 0);
    for file in files(folder.path()) {
        let mut of_file = None;
        for options in variants {
            let arguments = arguments(&file, options);
            let [is_there, has_frames] =
                assert_same_pictures(&arguments, options, (Format::Png, &[]), &mut of_file);
            compared += usize::from(is_there);
            with_frames += usize::from(has_frames);
        }
    }
    assert!(compared > 200 && with_frames > 30, "{compared}, {with_frames}");
}

/// The same of 16 bits, and of OpenEXR with AOVs and with alpha.
#[test]
fn all_formats_are_the_same_in_all_ways() {
    let folder = tempfile::tempdir().expect("a folder");
    let all = files(folder.path());
    let chosen = ["animation.toml", "l.obj", "lit.gltf", "glass.gltf", "path.toml"];
    let chosen = all.iter().filter(|file| chosen.iter().any(|name| file.ends_with(name)));
    let aovs = ["depth", "normal", "shading-normal", "albedo", "samples"].map(str::to_owned);
    let noise = [("noise", Some("0.02")), ("samples", Some("16"))];
    for file in chosen {
        let mut of_file = None;
        let auto = [&noise[..], &[("exposure", Some("auto"))]].concat();
        let deep = [&noise[..], &[("bits", Some("16"))]].concat();
        let transparent = [("background", Some("transparent"))];
        for (options, format, aovs) in [
            (&deep[..], Format::Png, &[][..]),
            (&auto, Format::Exr, &aovs),
            (&auto, Format::Exr, &[]),
            (&transparent, Format::Exr, &[]),
            (&transparent, Format::Png, &[]),
        ] {
            assert_same_pictures(&arguments(file, options), options, (format, aovs), &mut of_file);
        }
    }
}

/// Cameras whose names are the indices of others: the window's camera is that of its index.
#[test]
fn cameras_are_those_of_their_index() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("names.toml");
    let camera = |name: &str, x: f64| {
        format!("[[camera]]\nname = '{name}'\nposition = [{x}, 1, 5]\nlook_at = [0, 0, 0]\n")
    };
    let ball = "[[sphere]]\ncentre = [0.3, 0, 0]\nradius = 1\n";
    std::fs::write(&file, camera("1", 2.0) + &camera("0", -2.0) + ball).expect("a file");
    for (index, name) in [(0, "1"), (1, "0")] {
        let options: &NamedOptions = &[("camera", Some(name))];
        let expected = still(&arguments(&file, options), Format::Png, &[]).expect("a picture");
        let plain = arguments(&file, &[]);
        let mut warnings = Warnings::default();
        let mut opened = open(&plain, &plain.inputs, None, &mut warnings).0.expect("a scene");
        opened.camera_source = CameraSource::Scene(index);
        let shown = kiln_viewer::final_picture(&Arc::new(opened), SIZE, None, &mut warnings);
        let (image, metadata) = shown.expect("a picture");
        let made = Made::new(&image, &metadata, Format::Png, warnings).expect("a file");
        made.assert_same(&expected, name);
    }
}

/// Notes on added light, ground and background are those of the light that is chosen in the window.
#[test]
fn notes_are_those_of_the_picture() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/import/l.obj");
    let lit = arguments(&file, &[("environment", Some("sky"))]);
    let expected = still(&lit, Format::Png, &[]).expect("a picture");
    let (plain, mut warnings) = (arguments(&file, &[]), Warnings::default());
    let mut opened = open(&plain, &plain.inputs, None, &mut warnings).0.expect("a scene");
    opened.settings.environment.environment = Some("sky".to_owned());
    let shown = kiln_viewer::final_picture(&Arc::new(opened), SIZE, None, &mut warnings);
    let (image, metadata) = shown.expect("a picture");
    Made::new(&image, &metadata, Format::Png, warnings).expect("a file").assert_same(&expected, "sky");
}

/// Objects hidden by options are hidden in all of them, also those of clips and tracks, and in the window where they are
/// hidden once the file is open.
#[test]
fn hidden_objects_are_in_no_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    let clip_file = folder.path().join("clip.gltf");
    std::fs::write(&clip_file, clip(&json!({}))).expect("a file");
    let tracks_file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/animation.toml");
    for (file, name) in [(clip_file, None), (tracks_file, Some("left sphere"))] {
        let plain = arguments(&file, &[]);
        let scene = load(&plain, &mut Warnings::default()).expect("a scene");
        // The square that the clip moves.
        let name: &'static str = name.unwrap_or_else(|| scene.objects[1].name.clone().leak());
        let options: &NamedOptions = &[("hide", Some(name))];
        let hiding = arguments(&file, options);
        assert_same_pictures(&hiding, options, (Format::Png, &[]), &mut None);
        let expected = frames(&hiding, &[0], Format::Png).expect("a picture").swap_remove(0);
        let opened = opened(&plain, &mut Warnings::default()).expect("a scene");
        let mut scene = opened.scene().clone();
        scene.set_visible(&[], &[name.to_owned()]).expect("a name");
        scene.import_options.hide = vec![name.to_owned()];
        let session = Session::playing(scene).expect("a scene").into();
        let later = Arc::new(Opened { session, ..Opened::clone(&opened) });
        let mut warnings = Warnings::default();
        let later = kiln_viewer::final_picture(&later, SIZE, Some(0), &mut warnings);
        let (image, metadata) = later.expect("a picture");
        // What was said when the file was opened is not said again.
        let made = Made::new(&image, &metadata, Format::Png, warnings).expect("a file");
        Made { warnings: None, ..made }.assert_same(&expected, name);
        let shown = in_the_window(&plain, Some(0), Format::Png).expect("a picture");
        assert!(shown.file != expected.file, "{name}");
    }
}

/// A later frame has the automatic exposure of the first, though it is another one alone.
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
        let mut arguments = arguments(&file, options);
        let shared = frames(&arguments, &[24], Format::Png).expect("a frame").swap_remove(0);
        let time = 24.0 / 30.0;
        let clip = arguments.options.import.clip();
        arguments.options.import = arguments.options.import.clone().posed(ClipTime { clip, time });
        let alone = still(&arguments, Format::Png, &[]).expect("a picture");
        assert!(alone.file != shared.file, "{name}: the frames have one exposure");
    }
}

/// The same for real files: a room from inside and a box of paths, whose exposure and clamp are metered, textures, and an
/// animation.
#[test]
#[ignore = "needs KILN_MODELS"]
fn with_models_all_ways_to_a_picture_have_the_same() {
    let models = PathBuf::from(std::env::var_os("KILN_MODELS").expect("KILN_MODELS names a folder"));
    let inside = "{ position = [0, 1.5, 0], look_at = [1, 1.2, 0.3], vertical_fov = 60 }";
    let cases: [(&str, &NamedOptions); 7] = [
        ("kitchen.obj", &[("camera", Some(inside))]),
        ("kitchen.obj", &[("camera", Some(inside)), ("transport", Some("path"))]),
        ("CornellBox.glb", &[]),
        ("CornellBox.glb", &[("exposure", Some("auto"))]),
        ("Duck.glb", &[("samples", Some("6"))]),
        ("spot.obj", &[("environment", Some("sky"))]),
        ("Fox.glb", &[]),
    ];
    for (file, options) in cases {
        assert_same_pictures(&arguments(&models.join(file), options), options, (Format::Png, &[]), &mut None);
    }
}
