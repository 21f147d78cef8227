//! The `kiln render` command that renders the displayed picture, as one line for a POSIX shell.
//!
//! Options are written only where they differ from the defaults of `kiln render INPUT…`. Numbers are the shortest
//! decimal texts that parse to the same value, so the rendered picture is identical to the bit.

use std::path::{Path, PathBuf};

use super::request::{CameraSource, given};
use crate::job::RenderSettings;
use crate::scene::{
    Camera, ImportOptions, Look, PictureSettings, Projection, Scene, default_size, shell_quoted,
};
use crate::world::StandardView;

/// Settings of a `kiln render` command.
#[derive(Debug, Clone, Copy)]
pub struct RenderCommand<'a> {
    /// Input files as typed.
    pub inputs: &'a [PathBuf],
    /// The scene as loaded: before recentering, and before lights or cameras are added. `kiln render` uses its settings by
    /// default.
    pub scene: &'a Scene,
    /// Camera. Its own projection is overridden by `projection`.
    pub viewpoint: &'a CameraSource,
    /// Projection.
    pub projection: Projection,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// All other settings; camera, projection and size of these are not used.
    pub settings: &'a RenderSettings,
    /// What was asked of the input files.
    pub import_options: &'a ImportOptions,
    /// Output file.
    pub output: &'a Path,
}

impl RenderCommand<'_> {
    /// The camera, unless it is fitted.
    fn camera(&self) -> Option<&Camera> {
        match self.viewpoint {
            CameraSource::Scene(index) => self.scene.cameras.get(*index),
            CameraSource::Free(camera) => Some(camera),
            CameraSource::Fitted(_) => None,
        }
    }

    /// Width and height in pixels that `kiln render` uses without `--size`.
    pub fn default_size(&self) -> [u32; 2] {
        default_size(self.scene.picture.size(), self.camera(), self.projection)
    }
}

/// The command as one line, quoted for any POSIX shell.
pub fn command_line(command: &RenderCommand) -> String {
    let words: Vec<String> = arguments(command).iter().map(|word| shell_quoted(word)).collect();
    words.join(" ")
}

/// The arguments of the command including `kiln`, unquoted.
pub fn arguments(command: &RenderCommand) -> Vec<String> {
    let mut words = vec!["kiln".to_owned(), "render".to_owned()];
    words.extend(command.inputs.iter().map(|input| as_operand(&input.to_string_lossy())));
    words.extend(["-o".to_owned(), as_operand(&command.output.to_string_lossy())]);
    let mut option = |name: &str, value: &str| {
        // A separate value that begins with a hyphen would be parsed as an option; switches take none.
        if value.starts_with('-') || ["true", "false"].contains(&value) {
            words.push(format!("{name}={value}"));
        } else {
            words.extend([name.to_owned(), value.to_owned()]);
        }
    };
    let (scene, settings) = (command.scene, command.settings);
    let projection = camera_option(command, &mut option);
    if command.projection != projection {
        option("--projection", command.projection.name());
    }
    if command.size != command.default_size() {
        option("--size", &format!("{}x{}", command.size[0], command.size[1]));
    }
    settings.with.iter().for_each(|effect| option("--with", effect));
    settings.without.iter().for_each(|effect| option("--without", effect));
    let colour = settings.picture.colour.or(scene.picture.colour);
    let own =
        PictureSettings { width: None, height: None, look: None, colour, ..settings.picture }.displayable();
    let defaults = scene.picture.or(PictureSettings::defaults()).entries();
    let changed = own.entries().into_iter().filter(|entry| !defaults.contains(entry));
    for (name, value) in changed.chain(settings.environment.entries()) {
        option(&format!("--{name}"), &value);
    }
    let import = command.import_options.entries();
    for (name, value) in import.iter().filter_map(|(name, value)| Some((name, value.as_ref()?))) {
        option(&format!("--{name}"), value);
    }
    words.extend(import.iter().filter(|(_, value)| value.is_none()).map(|(name, _)| format!("--{name}")));
    let default = if scene.has_settings { Look::Draft } else { Look::Studio };
    let is_draft = settings.picture.look.unwrap_or(settings.mesh_look) == Look::Draft;
    if is_draft && scene.picture.look.unwrap_or(default) == Look::Studio {
        words.push("--draft".to_owned());
    }
    words
}

/// Adds the camera option, and returns the projection that the command has without `--projection`.
fn camera_option(command: &RenderCommand, option: &mut impl FnMut(&str, &str)) -> Projection {
    let cameras = &command.scene.cameras;
    match (command.viewpoint, command.camera()) {
        (CameraSource::Fitted(view), _) => {
            match view {
                StandardView::Auto if command.scene.default_camera().is_none() => {}
                StandardView::Auto => option("--camera", "auto"),
                view => option("--view", view.name()),
            }
            Projection::default()
        }
        (_, None) => Projection::default(),
        (_, Some(camera)) => {
            let same = |known: &&Camera| {
                let Camera {
                    name: _,
                    projection: _,
                    position,
                    target,
                    up,
                    view_height,
                    view_width,
                    viewpoint_distance,
                    lens,
                } = camera;
                (position, target, up) == (&known.position, &known.target, &known.up)
                    && (view_height, view_width, viewpoint_distance, lens)
                        == (&known.view_height, &known.view_width, &known.viewpoint_distance, &known.lens)
            };
            match cameras.iter().find(same) {
                Some(known) if command.scene.default_camera() == Some(known) => known.projection,
                Some(known) if is_found_by_name(cameras, known) => {
                    option("--camera", &known.name);
                    known.projection
                }
                _ => {
                    let own = Camera { projection: command.projection, ..given(camera, command.scene) };
                    option("--camera", &own.to_inline());
                    command.projection
                }
            }
        }
    }
}

/// Whether `--camera` with the camera's name selects this camera.
fn is_found_by_name(cameras: &[Camera], camera: &Camera) -> bool {
    let first = cameras.iter().find(|other| other.name == camera.name);
    let means_another = camera.name == "auto" || camera.name.trim_start().starts_with('{');
    first == Some(camera) && !means_another
}

/// A file name that is not parsed as an option; `-` stays, as it means standard input.
fn as_operand(file: &str) -> String {
    if file.starts_with('-') && file != "-" { format!("./{file}") } else { file.to_owned() }
}

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use glam::DVec3;
    use proptest::prelude::*;

    use super::*;
    use crate::limits::{Counted, Limits};
    use crate::scene::INLINE_NAME;
    use clap::Parser;

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
        let cameras =
            vec![camera("front", 0.0), camera("a'side", 1.0), camera("-x", 2.0), camera("auto", 3.0)];
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
        let read = crate::import::inline_camera(&typed).unwrap();
        assert_eq!(read, Camera { name: INLINE_NAME.into(), projection: Projection::Orthographic, ..moved });
    }

    #[test]
    fn everything_else_is_said_where_it_differs() {
        let (mut scene, inputs) = (scene(), [PathBuf::from("a.toml")]);
        let read = |line: &str| Line::parse_from(std::iter::once("kiln").chain(line.split(' ')));
        let of_scene = read("--noise 0.01 --colour display --numerics exact --samples 4").settings.picture;
        scene.picture = of_scene.or(scene.picture);
        let options = "--with glaze=every-bounce --without shadows --without textures --numerics watertight \
             --shading ambient --transport path --clamp 2.5 --filter tent --filter-radius 1.1 --noise 0.001 --min-samples 8 \
             --seed 4294967295 --sampler independent --colour linear --exposure=-1.5 --tone-map agx --light none --ground=true --cull=true \
             --background #ff8000 --environment garden.hdr --environment-rotation=-90 --hide-environment=true --clip Walk \
             --time=-0.5 --variant red --up=-z --smooth 0.5 --ignore-required-extensions --allow-outside-references";
        let Line { mut settings, import } = read(options);
        let plain = plain(&scene, &inputs, &CameraSource::Scene(0));
        let command = RenderCommand { settings: &settings, import_options: &import, ..plain };
        assert_eq!(arguments(&command)[5..].join(" "), format!("{options} --draft"));
        // What the scene says is not repeated; a size and a limit are.
        settings = RenderSettings { mesh_look: Look::Studio, ..of_scene.into() };
        let import = ImportOptions { limits: Limits::DEFAULT.with(Counted::Nodes, 7), ..Default::default() };
        let command =
            RenderCommand { settings: &settings, import_options: &import, size: [320, 200], ..plain };
        assert_eq!(line(&command), "--size 320x200 --limit nodes=7");
    }

    /// The options of a command line.
    #[derive(clap::Parser)]
    struct Line {
        #[command(flatten)]
        settings: RenderSettings,
        #[command(flatten)]
        import: ImportOptions,
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
}
