//! The `kiln render` command that renders the displayed picture, as one line for a POSIX shell.
//!
//! Options are written only where they differ from the defaults of `kiln render INPUT…`. Numbers are the shortest
//! decimal texts that parse to the same value, so the rendered picture is identical to the bit.

use std::path::{Path, PathBuf};

use crate::film::{ColourPipeline, DisplaySettings};
use crate::job::{Background, EnvironmentSettings, Look, RenderSettings};
use crate::scene::{
    Camera, Clip, ClipChoice, ClipTime, INLINE_NAME, ImportOptions, Numerics, Projection, Sampling, Scene,
    Transport, default_size, shell_quoted,
};
use crate::shading::ShadingMode;
use crate::world::StandardView;

/// Render settings that the inputs specify, which `kiln render` uses by default.
#[derive(Debug, Clone, Default)]
pub struct SceneDefaults {
    cameras: Vec<Camera>,
    size: Option<[u32; 2]>,
    numerics: Numerics,
    colour: ColourPipeline,
    sampling: Sampling,
    display: DisplaySettings,
    headlight: Option<bool>,
    transport: Option<Transport>,
    clamp: Option<f64>,
    has_ground: bool,
    has_look: bool,
}

impl SceneDefaults {
    /// Settings of a scene as loaded: before recentering, and before lights or cameras are added.
    pub fn of(scene: &Scene) -> Self {
        SceneDefaults {
            cameras: scene.cameras.clone(),
            size: scene.size,
            numerics: scene.numerics.unwrap_or_default(),
            colour: scene.colour.unwrap_or_default(),
            sampling: scene.sampling,
            display: scene.display,
            headlight: scene.headlight,
            transport: scene.transport,
            clamp: scene.clamp,
            has_ground: scene.has_ground == Some(true),
            has_look: scene.has_settings,
        }
    }

    /// Width and height in pixels that `kiln render` uses without `--size`.
    pub fn size(&self, viewpoint: CommandCamera) -> [u32; 2] {
        let camera = if let CommandCamera::Camera(camera) = viewpoint { Some(camera) } else { None };
        default_size(self.size, camera)
    }
}

/// Camera of the command.
#[derive(Debug, Clone, Copy)]
pub enum CommandCamera<'a> {
    /// Any camera in scene coordinates, of the scene or free.
    Camera(&'a Camera),
    /// A standard view, fitted by [`crate::world::fitted_camera`] to the picture's aspect ratio and projection.
    Standard(StandardView),
}

/// Settings of a `kiln render` command.
#[derive(Debug, Clone, Copy)]
pub struct RenderCommand<'a> {
    /// Input files as typed.
    pub inputs: &'a [PathBuf],
    /// Settings that the inputs specify.
    pub defaults: &'a SceneDefaults,
    /// Camera. Its own projection is overridden by `projection`.
    pub viewpoint: CommandCamera<'a>,
    /// Projection.
    pub projection: Projection,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// All other settings; camera, projection and size of these are not used.
    pub settings: &'a RenderSettings,
    /// What was asked of the input files.
    pub import_options: &'a ImportOptions,
    /// The clip that is played.
    pub clip: Option<&'a Clip>,
    /// Output file.
    pub output: &'a Path,
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
        // A separate value that begins with a hyphen would be parsed as an option.
        if value.starts_with('-') {
            words.push(format!("{name}={value}"));
        } else {
            words.extend([name.to_owned(), value.to_owned()]);
        }
    };
    let (defaults, settings) = (command.defaults, command.settings);
    let projection = camera_option(command, &mut option);
    if command.projection != projection {
        option("--projection", command.projection.name());
    }
    if command.size != defaults.size(command.viewpoint) {
        option("--size", &format!("{}x{}", command.size[0], command.size[1]));
    }
    if settings.shading != ShadingMode::default() {
        option("--shading", settings.shading.name());
    }
    settings.with.iter().for_each(|effect| option("--with", effect));
    settings.without.iter().for_each(|effect| option("--without", effect));
    if let Some(numerics) = settings.numerics.filter(|numerics| *numerics != defaults.numerics) {
        option("--numerics", numerics.name());
    }
    if let Some(colour) = settings.colour.filter(|colour| *colour != defaults.colour) {
        option("--colour", colour.name());
    }
    let Sampling { samples, filter, filter_radius, noise, min_samples, seed, sampler, first: _, total: _ } =
        settings.sampling;
    let scene = &defaults.sampling;
    let number = |n: Option<u32>, of_scene: Option<u32>| n.filter(|_| n != of_scene).map(|n| n.to_string());
    let real = |x: Option<f64>, of_scene: Option<f64>| x.filter(|_| x != of_scene).map(|x| x.to_string());
    let shape = filter.filter(|_| filter != scene.filter).map(|shape| shape.name().to_owned());
    for (name, value) in [
        ("--samples", number(samples, scene.samples)),
        ("--filter", shape),
        ("--filter-radius", real(filter_radius, scene.filter_radius)),
        ("--noise", real(noise, scene.noise)),
        ("--min-samples", number(min_samples, scene.min_samples)),
        ("--seed", number(seed, scene.seed)),
        ("--sampler", sampler.filter(|_| sampler != scene.sampler).map(|sampler| sampler.name().to_owned())),
    ] {
        value.iter().for_each(|value| option(name, value));
    }
    let display = settings.display.in_pipeline(settings.colour.unwrap_or(defaults.colour));
    if let Some(exposure) = display.exposure.filter(|_| display.exposure != defaults.display.exposure) {
        option("--exposure", &exposure.to_string());
    }
    if let Some(map) = display.tone_map.filter(|_| display.tone_map != defaults.display.tone_map) {
        option("--tone-map", map.name());
    }
    if let Some(headlight) = settings.headlight.filter(|_| settings.headlight != defaults.headlight) {
        option("--light", if headlight { "head" } else { "none" });
    }
    if let Some(transport) = settings.transport.filter(|_| settings.transport != defaults.transport) {
        option("--transport", transport.name());
    }
    if let Some(clamp) = settings.clamp.filter(|_| settings.clamp != defaults.clamp) {
        option("--clamp", &clamp.to_string());
    }
    let EnvironmentSettings { source, rotation, hide } = &settings.environment;
    source.iter().for_each(|source| option("--environment", source));
    rotation.iter().for_each(|degrees| option("--environment-rotation", &degrees.to_string()));
    match settings.background {
        Some(Background::Colour([r, g, b])) => option("--background", &format!("#{r:02x}{g:02x}{b:02x}")),
        Some(Background::Transparent) => option("--background", "transparent"),
        None => {}
    }
    let ImportOptions {
        pose,
        variant,
        ignore_required_extensions,
        allow_outside_references,
        up,
        smooth,
        limits,
    } = command.import_options;
    if let Some(ClipTime { clip, time }) = pose {
        option("--time", &time.to_string());
        match clip {
            ClipChoice::First => {}
            ClipChoice::Named(name) => option("--clip", name),
            ClipChoice::Index(index) => option("--clip", &index.to_string()),
        }
    }
    // The first clip is played without being named.
    if let Some(clip) = command.clip.filter(|clip| clip.index > 0) {
        option("--clip", &clip.index.to_string());
    }
    up.iter().for_each(|up| option("--up", up.name()));
    smooth.iter().for_each(|crease| option("--smooth", &crease.to_degrees().to_string()));
    variant.iter().for_each(|variant| option("--variant", variant));
    for (counted, most) in limits.changed() {
        option("--limit", &format!("{}={most}", counted.name()));
    }
    if *ignore_required_extensions {
        words.push("--ignore-required-extensions".to_owned());
    }
    if *allow_outside_references {
        words.push("--allow-outside-references".to_owned());
    }
    if *hide {
        words.push("--hide-environment".to_owned());
    }
    if settings.ground == Some(true) && !defaults.has_ground {
        words.push("--ground".to_owned());
    }
    if settings.look == Look::Draft && !defaults.has_look {
        words.push("--draft".to_owned());
    }
    words
}

/// Adds the camera option, and returns the projection that the command has without `--projection`.
fn camera_option(command: &RenderCommand, option: &mut impl FnMut(&str, &str)) -> Projection {
    let cameras = &command.defaults.cameras;
    match command.viewpoint {
        CommandCamera::Standard(StandardView::Auto) if cameras.is_empty() => Projection::default(),
        CommandCamera::Standard(StandardView::Auto) => {
            option("--camera", "auto");
            Projection::default()
        }
        CommandCamera::Standard(view) => {
            option("--view", view.name());
            Projection::default()
        }
        CommandCamera::Camera(camera) => {
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
                } = camera;
                (position, target, up) == (&known.position, &known.target, &known.up)
                    && (view_height, view_width, viewpoint_distance)
                        == (&known.view_height, &known.view_width, &known.viewpoint_distance)
            };
            match cameras.iter().find(same) {
                Some(known) if *known == cameras[0] => known.projection,
                Some(known) if is_found_by_name(cameras, known) => {
                    option("--camera", &known.name);
                    known.projection
                }
                _ => {
                    let own =
                        Camera { name: INLINE_NAME.into(), projection: command.projection, ..camera.clone() };
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

    use crate::scene::UpAxis;
    use glam::DVec3;
    use proptest::prelude::*;

    use super::*;
    use crate::film::FilterShape;
    use crate::film::tone::{Exposure, ToneMap};
    use crate::limits::{Counted, Limits};
    use crate::scene::PixelSampler;

    static NO_IMPORT_OPTIONS: ImportOptions = ImportOptions {
        pose: None,
        variant: None,
        ignore_required_extensions: false,
        allow_outside_references: false,
        up: None,
        smooth: None,
        limits: Limits::DEFAULT,
    };

    static STUDIO: LazyLock<RenderSettings> =
        LazyLock::new(|| RenderSettings { look: Look::Studio, ..RenderSettings::default() });

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

    fn defaults() -> SceneDefaults {
        let cameras =
            vec![camera("front", 0.0), camera("a'side", 1.0), camera("-x", 2.0), camera("auto", 3.0)];
        SceneDefaults { cameras, size: Some([640, 480]), ..SceneDefaults::default() }
    }

    fn plain<'a>(
        defaults: &'a SceneDefaults,
        inputs: &'a [PathBuf],
        viewpoint: CommandCamera<'a>,
    ) -> RenderCommand<'a> {
        RenderCommand {
            inputs,
            defaults,
            viewpoint,
            projection: Projection::Perspective,
            size: defaults.size(viewpoint),
            settings: &STUDIO,
            import_options: &NO_IMPORT_OPTIONS,
            clip: None,
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
        let (defaults, inputs) = (defaults(), [PathBuf::from("a.toml")]);
        let of = |camera: &Camera| line(&plain(&defaults, &inputs, CommandCamera::Camera(camera)));
        assert_eq!(of(&defaults.cameras[0]), "");
        assert_eq!(of(&defaults.cameras[1]), r"--camera 'a'\''side'");
        assert_eq!(of(&defaults.cameras[2]), "--camera=-x");
        // `auto` has another meaning.
        assert!(of(&defaults.cameras[3]).starts_with("--camera '{ position = [3, 0, 5], "));
        let parallel = RenderCommand {
            projection: Projection::Orthographic,
            ..plain(&defaults, &inputs, CommandCamera::Camera(&defaults.cameras[1]))
        };
        assert_eq!(line(&parallel), r"--camera 'a'\''side' --projection orthographic");
        let of = |view| line(&plain(&defaults, &inputs, CommandCamera::Standard(view)));
        assert_eq!(
            (of(StandardView::Iso), of(StandardView::Auto)),
            ("--view iso".into(), "--camera auto".into())
        );
        let bare = SceneDefaults::default();
        assert_eq!(line(&plain(&bare, &inputs, CommandCamera::Standard(StandardView::Auto))), "");
    }

    #[test]
    fn a_moved_camera_is_in_braces_with_its_projection() {
        let (defaults, inputs) = (defaults(), [PathBuf::from("a.toml")]);
        let moved = camera("front", 0.1);
        let command = RenderCommand {
            projection: Projection::Orthographic,
            ..plain(&defaults, &inputs, CommandCamera::Camera(&moved))
        };
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
        let (mut defaults, inputs) = (defaults(), [PathBuf::from("a.toml")]);
        defaults.sampling = Sampling { samples: Some(4), noise: Some(0.01), ..Sampling::default() };
        (defaults.numerics, defaults.colour) = (Numerics::Exact, ColourPipeline::Display);
        let plain = plain(&defaults, &inputs, CommandCamera::Camera(&defaults.cameras[0]));
        let settings = RenderSettings {
            shading: ShadingMode::Ambient,
            with: vec!["glaze=every-bounce".into()],
            without: vec!["shadows".into(), "textures".into()],
            numerics: Some(Numerics::Watertight),
            colour: Some(ColourPipeline::Linear),
            sampling: Sampling {
                samples: Some(4),
                filter: Some(FilterShape::Tent),
                filter_radius: Some(1.1),
                noise: Some(0.001),
                min_samples: Some(8),
                seed: Some(u32::MAX),
                sampler: Some(PixelSampler::Independent),
                first: None,
                total: None,
            },
            display: DisplaySettings { exposure: Some(Exposure::Ev(-1.5)), tone_map: Some(ToneMap::Agx) },
            headlight: Some(false),
            transport: Some(Transport::Path),
            clamp: Some(2.5),
            ground: Some(true),
            background: Some(Background::Colour([255, 128, 0])),
            environment: EnvironmentSettings {
                source: Some("garden one.hdr".into()),
                rotation: Some(-90.0),
                hide: true,
            },
            ..RenderSettings::default()
        };
        let command = RenderCommand {
            size: [320, 200],
            settings: &settings,
            import_options: &ImportOptions {
                pose: Some(ClipTime { clip: ClipChoice::Named("Walk".into()), time: -0.5 }),
                variant: Some("red shoe".into()),
                ignore_required_extensions: true,
                allow_outside_references: true,
                up: Some(UpAxis::MinusZ),
                smooth: Some(0.5f64.to_radians()),
                limits: Limits::DEFAULT.with(Counted::Nodes, 7),
            },
            ..plain
        };
        assert_eq!(
            line(&command),
            "--size 320x200 --shading ambient --with glaze=every-bounce --without shadows --without textures --numerics \
             watertight --colour linear --filter tent --filter-radius 1.1 --noise 0.001 --min-samples 8 --seed 4294967295 --sampler independent \
             --exposure=-1.5 --tone-map agx --light none --transport path --clamp 2.5 \
             --environment 'garden one.hdr' --environment-rotation=-90 --background '#ff8000' --time=-0.5 --clip Walk --up=-z --smooth 0.5 --variant 'red shoe' \
             --limit nodes=7 --ignore-required-extensions --allow-outside-references --hide-environment --ground --draft"
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        /// `sh` splits the line into the same arguments for any file and camera names.
        #[test]
        fn a_shell_reads_what_was_meant(file in "[^\0]{1,12}", name in "[^\0]{0,12}", spice in "['\"$`\\\\ \n!*~#-]{1,6}") {
            let mut defaults = defaults();
            defaults.cameras[1].name = format!("{name}{spice}");
            let inputs = [PathBuf::from(format!("{spice}{file}")), PathBuf::from("-")];
            let command = plain(&defaults, &inputs, CommandCamera::Camera(&defaults.cameras[1]));
            prop_assert_eq!(read_by_sh(&command_line(&command)), arguments(&command));
        }
    }
}
