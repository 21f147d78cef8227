//! The command that renders what is seen: what a window shows, as one line for a shell.
//!
//! Only what differs from what `kiln render INPUT…` does by itself is said. Numbers are the shortest that are read back as the
//! same, so the picture is the same, to the bit.

use std::path::{Path, PathBuf};

use crate::film::ColourPipeline;
use crate::scene::{Camera, INLINE_NAME, Numerics, Projection, Sampling, Scene, default_size};
use crate::shading::ShadingMode;
use crate::world::StandardView;

/// What the inputs say of the picture themselves.
#[derive(Debug, Clone, Default)]
pub struct Said {
    cameras: Vec<Camera>,
    size: Option<[u32; 2]>,
    numerics: Numerics,
    colour: ColourPipeline,
    sampling: Sampling,
}

impl Said {
    /// Of a scene as it was loaded: before it is brought into range, and before anything is added to it.
    pub fn of(scene: &Scene) -> Self {
        Said {
            cameras: scene.cameras.clone(),
            size: scene.size,
            numerics: scene.numerics.unwrap_or_default(),
            colour: scene.colour.unwrap_or_default(),
            sampling: scene.sampling,
        }
    }

    /// The size of the picture that is rendered where none is given.
    pub fn size(&self, seen_from: SeenFrom) -> [u32; 2] {
        let camera = if let SeenFrom::Camera(camera) = seen_from { Some(camera) } else { None };
        default_size(self.size, camera)
    }
}

/// Where a picture is seen from.
#[derive(Debug, Clone, Copy)]
pub enum SeenFrom<'a> {
    /// A camera in the scene's own coordinates: one of the scene's, or any other.
    Camera(&'a Camera),
    /// A standard view, as [`crate::world::fitted_camera`] makes it of the scene for the picture's shape and projection.
    Standard(StandardView),
}

/// What is seen.
#[derive(Debug, Clone, Copy)]
pub struct Picture<'a> {
    /// The files of the scene, as they were named.
    pub inputs: &'a [PathBuf],
    /// What they say themselves.
    pub said: &'a Said,
    /// From where; the camera's own projection does not count.
    pub seen_from: SeenFrom<'a>,
    /// In which projection.
    pub projection: Projection,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// How far shading goes.
    pub shading: ShadingMode,
    /// Effects that were asked for, as `NAME` or `NAME=VALUE`.
    pub with: &'a [String],
    /// Effects that were turned off.
    pub without: &'a [String],
    /// The tier.
    pub numerics: Numerics,
    /// The colour pipeline.
    pub colour: ColourPipeline,
    /// What was chosen of sampling, over what the scene says.
    pub sampling: Sampling,
    /// The file to write.
    pub output: &'a Path,
}

/// The line, for any POSIX shell.
pub fn command_line(picture: &Picture) -> String {
    let words: Vec<String> = words(picture).iter().map(|word| quoted(word)).collect();
    words.join(" ")
}

/// The words of the command, unquoted.
pub fn words(picture: &Picture) -> Vec<String> {
    let mut words = vec!["kiln".to_owned(), "render".to_owned()];
    words.extend(picture.inputs.iter().map(|input| no_option(&input.to_string_lossy())));
    words.extend(["-o".to_owned(), no_option(&picture.output.to_string_lossy())]);
    let mut option = |name: &str, value: &str| {
        // What begins with a hyphen would be taken for an option.
        if value.starts_with('-') {
            words.push(format!("{name}={value}"));
        } else {
            words.extend([name.to_owned(), value.to_owned()]);
        }
    };
    let said = picture.said;
    let projection = seen_from(picture, &mut option);
    if picture.projection != projection {
        option("--projection", picture.projection.name());
    }
    if picture.size != said.size(picture.seen_from) {
        option("--size", &format!("{}x{}", picture.size[0], picture.size[1]));
    }
    if picture.shading != ShadingMode::default() {
        option("--shading", picture.shading.name());
    }
    picture.with.iter().for_each(|effect| option("--with", effect));
    picture.without.iter().for_each(|effect| option("--without", effect));
    if picture.numerics != said.numerics {
        option("--numerics", picture.numerics.name());
    }
    if picture.colour != said.colour {
        option("--colour", picture.colour.name());
    }
    // Field by field: what is said of nothing but the scene's is left to the scene.
    let Sampling { samples, filter, filter_radius, noise, min_samples, seed, first: _ } = picture.sampling;
    let scene = &said.sampling;
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
    ] {
        value.iter().for_each(|value| option(name, value));
    }
    words
}

/// Says what the picture is seen from, and gives the projection that it is then in by itself.
fn seen_from(picture: &Picture, option: &mut impl FnMut(&str, &str)) -> Projection {
    let cameras = &picture.said.cameras;
    match picture.seen_from {
        SeenFrom::Standard(StandardView::Auto) if cameras.is_empty() => Projection::default(),
        SeenFrom::Standard(StandardView::Auto) => {
            option("--camera", "auto");
            Projection::default()
        }
        SeenFrom::Standard(view) => {
            option("--view", view.name());
            Projection::default()
        }
        SeenFrom::Camera(camera) => {
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
                Some(known) if is_found_by(cameras, known) => {
                    option("--camera", &known.name);
                    known.projection
                }
                _ => {
                    let own =
                        Camera { name: INLINE_NAME.into(), projection: picture.projection, ..camera.clone() };
                    option("--camera", &own.to_inline());
                    picture.projection
                }
            }
        }
    }
}

/// Whether `--camera` with its name finds this camera.
fn is_found_by(cameras: &[Camera], camera: &Camera) -> bool {
    let first = cameras.iter().find(|other| other.name == camera.name);
    let means_another = camera.name == "auto" || camera.name.trim_start().starts_with('{');
    first == Some(camera) && !means_another
}

/// A file whose name is not taken for an option; `-` is standard input.
fn no_option(file: &str) -> String {
    if file.starts_with('-') && file != "-" { format!("./{file}") } else { file.to_owned() }
}

/// A word as a shell reads it back: POSIX.1-2017, Shell Command Language, section 2.2.2: between single quotes all is itself.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./:=,+@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use proptest::prelude::*;

    use super::*;
    use crate::film::FilterShape;

    /// What a shell makes of the line, in words.
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

    fn said() -> Said {
        let cameras =
            vec![camera("front", 0.0), camera("a'side", 1.0), camera("-x", 2.0), camera("auto", 3.0)];
        Said { cameras, size: Some([640, 480]), ..Said::default() }
    }

    fn plain<'a>(said: &'a Said, inputs: &'a [PathBuf], seen_from: SeenFrom<'a>) -> Picture<'a> {
        Picture {
            inputs,
            said,
            seen_from,
            projection: Projection::Perspective,
            size: said.size(seen_from),
            shading: ShadingMode::Full,
            with: &[],
            without: &[],
            numerics: said.numerics,
            colour: said.colour,
            sampling: Sampling::default(),
            output: Path::new("picture.png"),
        }
    }

    /// The line after its inputs and output, for one input without a surprise in its name.
    #[track_caller]
    fn line(picture: &Picture) -> String {
        let line = command_line(picture);
        assert_eq!(read_by_sh(&line), words(picture), "{line}");
        let rest = line.strip_prefix("kiln render a.toml -o picture.png").unwrap_or_else(|| panic!("{line}"));
        rest.trim_start().to_owned()
    }

    #[test]
    fn what_kiln_does_by_itself_is_not_said() {
        let (said, inputs) = (said(), [PathBuf::from("a.toml")]);
        let of = |camera: &Camera| line(&plain(&said, &inputs, SeenFrom::Camera(camera)));
        assert_eq!(of(&said.cameras[0]), "");
        assert_eq!(of(&said.cameras[1]), r"--camera 'a'\''side'");
        assert_eq!(of(&said.cameras[2]), "--camera=-x");
        // The name means something else.
        assert!(of(&said.cameras[3]).starts_with("--camera '{ position = [3, 0, 5], "));
        let parallel = Picture {
            projection: Projection::Orthographic,
            ..plain(&said, &inputs, SeenFrom::Camera(&said.cameras[1]))
        };
        assert_eq!(line(&parallel), r"--camera 'a'\''side' --projection orthographic");
        let of = |view| line(&plain(&said, &inputs, SeenFrom::Standard(view)));
        assert_eq!(
            (of(StandardView::Iso), of(StandardView::Auto)),
            ("--view iso".into(), "--camera auto".into())
        );
        let bare = Said::default();
        assert_eq!(line(&plain(&bare, &inputs, SeenFrom::Standard(StandardView::Auto))), "");
    }

    #[test]
    fn a_moved_camera_is_in_braces_with_its_projection() {
        let (said, inputs) = (said(), [PathBuf::from("a.toml")]);
        let moved = camera("front", 0.1);
        let picture = Picture {
            projection: Projection::Orthographic,
            ..plain(&said, &inputs, SeenFrom::Camera(&moved))
        };
        let text = line(&picture);
        assert!(text.starts_with(
            "--camera '{ position = [0.1, 0, 5], look_at = [0, 0, 0], projection = \"orthographic\", "
        ));
        assert!(!text.contains("--projection"), "{text}");
        // It is read back as the same camera, but for its name.
        let typed = words(&picture).pop().unwrap();
        let read = crate::import::inline_camera(&typed).unwrap();
        assert_eq!(read, Camera { name: INLINE_NAME.into(), projection: Projection::Orthographic, ..moved });
    }

    #[test]
    fn everything_else_is_said_where_it_differs() {
        let (mut said, inputs) = (said(), [PathBuf::from("a.toml")]);
        said.sampling = Sampling { samples: Some(4), noise: Some(0.01), ..Sampling::default() };
        said.numerics = Numerics::Exact;
        let plain = plain(&said, &inputs, SeenFrom::Camera(&said.cameras[0]));
        let picture = Picture {
            size: [320, 200],
            shading: ShadingMode::Ambient,
            with: &["glaze=every-bounce".into()],
            without: &["shadows".into(), "textures".into()],
            numerics: Numerics::Watertight,
            colour: ColourPipeline::U8,
            sampling: Sampling {
                samples: Some(4),
                filter: Some(FilterShape::Tent),
                filter_radius: Some(1.1),
                noise: Some(0.001),
                min_samples: Some(8),
                seed: Some(u32::MAX),
                first: None,
            },
            ..plain
        };
        assert_eq!(
            line(&picture),
            "--size 320x200 --shading ambient --with glaze=every-bounce --without shadows --without textures --numerics \
             watertight --colour u8 --filter tent --filter-radius 1.1 --noise 0.001 --min-samples 8 --seed 4294967295"
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        /// Whatever files and cameras are called, a shell reads what was meant.
        #[test]
        fn a_shell_reads_what_was_meant(file in "[^\0]{1,12}", name in "[^\0]{0,12}", spice in "['\"$`\\\\ \n!*~#-]{1,6}") {
            let mut said = said();
            said.cameras[1].name = format!("{name}{spice}");
            let inputs = [PathBuf::from(format!("{spice}{file}")), PathBuf::from("-")];
            let picture = plain(&said, &inputs, SeenFrom::Camera(&said.cameras[1]));
            prop_assert_eq!(read_by_sh(&command_line(&picture)), words(&picture));
        }
    }
}
