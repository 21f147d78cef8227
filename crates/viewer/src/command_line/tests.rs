//! Tests of `command_line`.

use std::sync::LazyLock;

use glam::DVec3;
use proptest::prelude::*;

use super::*;
use kiln::limits::{Counted, Limits};
use kiln::scene::INLINE_NAME;
use kiln::scene::{GivenValue, Options, ValueCount};

static NO_IMPORT_OPTIONS: LazyLock<ImportOptions> = LazyLock::new(ImportOptions::default);

static STUDIO: LazyLock<RenderSettings> =
    LazyLock::new(|| RenderSettings { mesh_look: Look::Studio, ..RenderSettings::default() });

/// Arguments into which `sh` splits the line.
fn read_by_sh(line: &str) -> Vec<String> {
    let script = format!("kiln() {{ printf '%s\\0' kiln \"$@\"; }}; {line}");
    let output = std::process::Command::new("sh").args(["-c", &script]).output().expect("a shell");
    assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    text.split_terminator('\0').map(str::to_owned).collect()
}

fn camera(name: &str, x: f64) -> Camera {
    Camera::from_field_of_view(name.into(), DVec3::new(x, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 0.7)
}

fn scene() -> Scene {
    let cameras = vec![camera("front", 0.0), camera("a'side", 1.0), camera("-x", 2.0), camera("auto", 3.0)];
    Scene { cameras, picture: PictureSettings::of_size([640, 480]), ..Scene::default() }
}

fn plain<'a>(scene: &'a Scene, inputs: &'a [PathBuf], viewpoint: &'a CameraSource) -> RenderCommand<'a> {
    RenderCommand {
        inputs,
        scene,
        viewpoint,
        projection: Projection::Perspective,
        size: [640, 480],
        settings: &STUDIO,
        import_options: &NO_IMPORT_OPTIONS,
        output: Path::new("picture.png"),
    }
}

/// The command line after input `a.toml` and output.
#[track_caller]
fn line(command: &RenderCommand) -> String {
    let line = command_line(command);
    assert_eq!(read_by_sh(&line), arguments(command), "{line}");
    let rest = line.strip_prefix("kiln render a.toml -o picture.png").unwrap_or_else(|| panic!("{line}"));
    rest.trim_start().to_owned()
}

#[test]
fn what_kiln_does_by_itself_is_not_said() {
    let (scene, inputs) = (scene(), [PathBuf::from("a.toml")]);
    let of = |viewpoint: &CameraSource| line(&plain(&scene, &inputs, viewpoint));
    let cameras = [0, 1, 2, 3].map(CameraSource::Scene);
    assert_eq!(of(&cameras[0]), "");
    assert_eq!(of(&cameras[1]), r"--camera 'a'\''side'");
    assert_eq!(of(&cameras[2]), "--camera=-x");
    // `auto` has another meaning.
    assert!(of(&cameras[3]).starts_with("--camera '{ position = [3, 0, 5], "));
    let parallel =
        RenderCommand { projection: Projection::Orthographic, ..plain(&scene, &inputs, &cameras[1]) };
    assert_eq!(line(&parallel), r"--camera 'a'\''side' --projection orthographic");
    let of = |view| of(&CameraSource::Fitted(view));
    assert_eq!(
        (of(StandardView::Iso), of(StandardView::Auto)),
        ("--view iso".into(), "--camera auto".into())
    );
    let bare = Scene { picture: scene.picture, ..Scene::default() };
    assert_eq!(line(&plain(&bare, &inputs, &CameraSource::Fitted(StandardView::Auto))), "");
}

#[test]
fn a_moved_camera_is_in_braces_with_its_projection() {
    let (scene, inputs) = (scene(), [PathBuf::from("a.toml")]);
    let moved = camera("front", 0.1);
    let viewpoint = CameraSource::Free(moved.clone());
    let command =
        RenderCommand { projection: Projection::Orthographic, ..plain(&scene, &inputs, &viewpoint) };
    let text = line(&command);
    assert!(text.starts_with(
        "--camera '{ position = [0.1, 0, 5], look_at = [0, 0, 0], projection = \"orthographic\", "
    ));
    assert!(!text.contains("--projection"), "{text}");
    // It parses to the same camera, except for its name.
    let typed = arguments(&command).pop().unwrap();
    let read = kiln::import::inline_camera(&typed, None).unwrap();
    assert_eq!(read, Camera { name: INLINE_NAME.into(), projection: Projection::Orthographic, ..moved });
}

#[test]
fn everything_else_is_said_where_it_differs() {
    let (mut scene, inputs) = (scene(), [PathBuf::from("a.toml")]);
    let of_scene = read("--noise 0.01 --colour display --numerics exact --samples 4").picture;
    scene.picture = of_scene.or(scene.picture);
    let options = "--time=-0.5 --variant red --up=-z --smooth 0.5 --clip Walk --hide pot/lid --isolate pot --isolate=-x \
         --ignore-required-extensions --allow-outside-references --environment garden.hdr --environment-rotation=-90 \
         --hide-environment --with glaze=every-bounce --without shadows --without textures --numerics watertight \
         --shading ambient --transport path --clamp 2.5 --filter tent --filter-radius 1.1 --noise 0.001 --min-samples 8 \
         --seed 4294967295 --sampler independent --colour linear --exposure=-1.5 --tone-map agx --light none --ground --cull \
         --background #ff8000";
    let read_back = read(options);
    let settings = read_back.settings().expect("settings");
    let (mut settings, import) = (RenderSettings { mesh_look: Look::Draft, ..settings }, read_back.import);
    let plain = plain(&scene, &inputs, &CameraSource::Scene(0));
    let command = RenderCommand { settings: &settings, import_options: &import, ..plain };
    assert_eq!(arguments(&command)[5..].join(" "), format!("{options} --draft"));
    // What the scene says is not repeated; a size and a limit are.
    settings = RenderSettings { mesh_look: Look::Studio, ..of_scene.into() };
    let import = ImportOptions { limits: Limits::DEFAULT.with(Counted::Nodes, 7), ..Default::default() };
    let command = RenderCommand { settings: &settings, import_options: &import, size: [320, 200], ..plain };
    assert_eq!(line(&command), "--size 320x200 --limit nodes=7");
}

/// The options of a command line, each as `--name`, `--name value` or `--name=value`.
fn read(line: &str) -> PictureOptions {
    let mut values: Vec<(String, Vec<String>)> = Vec::new();
    for word in line.split(' ') {
        match (word.strip_prefix("--"), values.last_mut()) {
            (Some(option), _) => {
                let (name, value) =
                    option.split_once('=').map_or((option, None), |(name, value)| (name, Some(value)));
                let known = values.iter().position(|(known, _)| known == name);
                let mut entry = known.map_or((name.to_owned(), Vec::new()), |at| values.remove(at));
                entry.1.extend(value.map(str::to_owned));
                values.push(entry);
            }
            (None, Some((_, texts))) => texts.push(word.to_owned()),
            (None, None) => panic!("{word}: a value without an option"),
        }
    }
    let mut options = PictureOptions::default();
    for (name, texts) in values {
        let is_bare = texts.is_empty();
        assert!(
            is_bare
                || PictureOptions::specs()
                    .iter()
                    .any(|spec| spec.name == name && spec.count != ValueCount::Switch)
        );
        let value = if is_bare { GivenValue::Switch(true) } else { GivenValue::Texts(texts) };
        options.set(&name, Some(value)).unwrap_or_else(|why| panic!("{name}: {why}"));
    }
    options
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// `sh` splits the line into the same arguments for any file and camera names.
    #[test]
    fn a_shell_reads_what_was_meant(file in "[^\0]{1,12}", name in "[^\0]{0,12}", spice in "['\"$`\\\\ \n!*~#-]{1,6}") {
        let mut scene = scene();
        scene.cameras[1].name = format!("{name}{spice}");
        let inputs = [PathBuf::from(format!("{spice}{file}")), PathBuf::from("-")];
        let command = plain(&scene, &inputs, &CameraSource::Scene(1));
        prop_assert_eq!(read_by_sh(&command_line(&command)), arguments(&command));
    }
}
