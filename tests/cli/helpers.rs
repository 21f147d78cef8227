//! What the tests of the command share: a scene, commands that must fail, the form of errors, pictures.

use std::path::Path;
use std::process::Output;

use crate::workshop::{Workshop, text};

/// A sphere over a quarter of the picture, under a point light, before a grey background, in the pipeline `display`.
pub(super) const SCENE: &str = "
[image]
width = 24
height = 16
background = '#202020'
colour = 'display'
[[camera]]
name = 'front'
position = [0, 0, 10]
look_at = [0, 0, 0]
[[camera]]
name = 'above'
position = [0, 10, 1]
look_at = [0, 0, 0]
[[light]]
type = 'point'
position = [5, 5, 10]
[material.red]
colour = '#c02010'
specular = 0.5
[[sphere]]
name = 'ball'
centre = [0, 0, 0]
radius = 2
material = 'red'
";

impl Workshop {
    /// Runs with `input` on standard input.
    pub(super) fn run_with(&self, arguments: &str, input: &[u8]) -> Output {
        let mut command = assert_cmd::Command::new(assert_cmd::cargo::cargo_bin!("kiln"));
        command.current_dir(self.0.path()).args(arguments.split_whitespace()).write_stdin(input);
        command.output().expect("the command starts")
    }

    /// Runs a command that must fail with `code`. Checks the form of its error, and returns message and hint.
    #[track_caller]
    pub(super) fn fail(&self, arguments: &str, code: i32) -> (String, String) {
        let output = self.run(arguments);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments}: {said}");
        assert_eq!(text(&output.stdout), "", "{arguments}: standard output carries only results");
        let error = check_error(&said);
        (error.0.to_owned(), error.1.to_owned())
    }

    pub(super) fn pixels(&self, name: &str) -> image::RgbImage {
        image::open(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}")).into_rgb8()
    }
}

/// Checks that the error is one line `kiln: error: ...` and at most one `hint: ...`, without Rust's debug output.
#[track_caller]
pub(super) fn check_error(said: &str) -> (&str, &str) {
    // Warnings and notes may precede the error, each on its own line.
    let is_other = |line: &&str| line.starts_with("kiln: warning: ") || line.starts_with("kiln: note: ");
    let mut lines = said.lines().skip_while(is_other);
    let error = lines.next().and_then(|line| line.strip_prefix("kiln: error: "));
    let error = error.unwrap_or_else(|| panic!("no error in: {said}"));
    let hint =
        lines.next().map_or("", |line| line.strip_prefix("hint: ").unwrap_or_else(|| panic!("{said}")));
    assert_eq!(lines.next(), None, "{said}");
    for foreign in
        ["panicked", "backtrace", "::", "Err(", "Some(", "Error {", "Os {", "os error", "unwrap", "src/"]
    {
        assert!(!said.contains(foreign), "`{foreign}` in: {said}");
    }
    assert!(!error.is_empty() && !error.ends_with([' ', '.']), "{said}");
    (error, hint)
}

#[test]
fn the_checker_of_errors_notices() {
    for bad in [
        "",
        "error: x\n",
        "kiln: error: \n",
        "kiln: error: x\nwhat else\n",
        "kiln: error: x\nhint: y\nhint: z\n",
        "kiln: error: thread panicked\n",
        "kiln: error: core::num\n",
    ] {
        assert!(std::panic::catch_unwind(|| check_error(bad)).is_err(), "{bad}");
    }
    assert_eq!(check_error("kiln: note: n\nkiln: error: x\nhint: y\n"), ("x", "y"));
}

/// The pixels of an OpenEXR picture, row by row from the top.
pub(super) fn exr_pixels(file: &Path, size: (usize, usize)) -> Vec<[f32; 3]> {
    let picture = exr::prelude::read_first_rgba_layer_from_file(
        file,
        |size, _| vec![[0f32; 3]; size.area()],
        move |pixels: &mut Vec<[f32; 3]>, at, (r, g, b, _): (f32, f32, f32, f32)| {
            pixels[at.y() * size.0 + at.x()] = [r, g, b];
        },
    )
    .expect("the picture can be read");
    assert_eq!((picture.layer_data.size.x(), picture.layer_data.size.y()), size);
    picture.layer_data.channel_data.pixels
}

/// The values of an EXR.
pub(super) fn image_bits(file: &Path) -> Vec<[u32; 3]> {
    let picture = kiln::film::read::read_picture(file).unwrap_or_else(|e| panic!("{e}"));
    picture.values.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

/// The metadata of a PNG picture.
pub(super) fn metadata(workshop: &Workshop, name: &str) -> impl Fn(&str) -> Option<String> {
    let file = std::fs::File::open(workshop.path(name)).expect("it was written");
    let reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("it is a PNG picture");
    move |key: &str| {
        let chunk = reader.info().utf8_text.iter().find(|chunk| chunk.keyword == key);
        chunk.map(|chunk| chunk.get_text().expect("it is UTF-8"))
    }
}
