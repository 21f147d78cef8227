//! End-to-end tests of the command: exit codes, output streams and files.

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::common::gltf::Model;
use crate::common::repository;
use crate::workshop::{Workshop, text};
#[cfg(unix)]
use rustix::process::{Pid, Signal, kill_process};
use serde_json::{Value, json};

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

    fn pixels(&self, name: &str) -> image::RgbImage {
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
fn clamps_and_grounds_are_checked() {
    let workshop = Workshop::with("scene.toml", SCENE);
    for (typed, said) in [("0", "0"), ("-1", "-1"), ("inf", "inf"), ("much", "much")] {
        let (error, hint) = workshop.fail(&format!("render scene.toml -o a.png --clamp {typed}"), 2);
        assert!(error.contains(said) && error.contains("--clamp"), "{error}; {hint}");
    }
    let said = workshop.succeed("render scene.toml -o a.png --clamp 4");
    assert!(said.contains("warning: a clamp of 4 changes nothing without path tracing"), "{said}");
    let explained = workshop.run("explain scene.toml --transport path --clamp 4");
    assert!(
        text(&explained.stdout).contains("indirect light is clamped to 4"),
        "{}",
        text(&explained.stdout)
    );
    workshop.write("empty.toml", "[[camera]]\nposition = [0, 0, 9]\nlook_at = [0, 0, 0]\n");
    for command in [
        "render empty.toml -o b.png --ground",
        "animate empty.toml -o b.mp4 --ground",
        "explain empty.toml --ground",
    ] {
        let (error, hint) = workshop.fail(command, 3);
        assert_eq!(error, "empty.toml: no object in it to put a ground under", "{command}");
        assert!(hint.contains("leave --ground"), "{hint}");
    }
    workshop.succeed("render scene.toml -o b.png --ground --view front");
    workshop.succeed("render scene.toml -o c.png --view front");
    // The sphere is at the same pixels, and the ground is below it.
    let (with, without) = (workshop.pixels("b.png"), workshop.pixels("c.png"));
    assert_eq!(with.get_pixel(12, 4), without.get_pixel(12, 4));
    assert_ne!(with.get_pixel(0, 15), without.get_pixel(0, 15));
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

// ----------------------------------------------------------------------------------------------- exit codes and errors

#[test]
fn wrong_usage_is_2() {
    let workshop = Workshop::with("scene.toml", SCENE);
    for (arguments, error, hint) in [
        ("", "no command given", "--help"),
        ("rendr scene.toml", "unrecognized subcommand 'rendr'", "render"),
        ("render", "required arguments", ""),
        ("render scene.toml", "required arguments were not provided: --output <OUT>", ""),
        ("render scene.toml -o a.png --siz 3x3", "unexpected argument '--siz'", "--size"),
        ("render scene.toml -o a.png --size 3", "give it as WIDTHxHEIGHT, such as 640x480", ""),
        ("render scene.toml -o a.png --size 0x5", "give a number of pixels from 1 to 65535", ""),
        ("render scene.toml -o a.png --crop 1,2,3", "give it as X,Y,WIDTH,HEIGHT", ""),
        ("render scene.toml -o a.png --threads 0", "invalid value '0'", ""),
        ("render scene.toml -o a.png --view side", "invalid value 'side'", "possible values"),
        ("render scene.toml -o a.png --shading fong", "invalid value 'fong'", "phong"),
        ("render scene.toml -o a.png --view iso --camera front", "cannot be used with", ""),
        ("render scene.toml -o a.png --filter mitchel", "invalid value 'mitchel'", "'mitchell'"),
        ("render scene.toml -o a.png --filter-radius 99", "give a radius in pixels from 0.01 to 32", ""),
        ("render scene.toml -o a.png --samples 0", "give a number of samples from 1 to 65536", ""),
        ("render scene.toml -o a.png --samples 65537", "give a number of samples from 1 to 65536", ""),
        ("render scene.toml -o a.png --noise 2", "give a standard error from 0.000001 to 1", ""),
        ("render scene.toml -o a.png --noise NaN", "give a standard error from 0.000001 to 1", ""),
        (
            "render scene.toml -o a.gif",
            "a.gif: not a picture format that can be written",
            ".png, .jpg or .exr",
        ),
        ("render scene.toml -o a", "a: not a picture format that can be written", ".png"),
        ("render scene.toml -o a.png --camera frnt", "there is no camera `frnt`", "did you mean `front`?"),
        ("render scene.toml -o a.png --camera 2", "there is no camera `2`", "known here: front, above"),
        (
            "render scene.toml -o a.png --with shadow",
            "there is no effect `shadow`",
            "did you mean `shadows`?",
        ),
        (
            "render scene.toml -o a.png --without zzz",
            "there is no effect `zzz`",
            "known here: textures, normal-maps",
        ),
        (
            "render scene.toml -o a.png --with glaze --without glaze=every-bounce",
            "--without takes no value: `glaze=every-bounce`",
            "`--without glaze`",
        ),
        (
            "render scene.toml -o a.png --noise 0.1 --min-samples 500",
            "the minimum of 500 samples per pixel is above the maximum of 256",
            "a higher --samples",
        ),
        (
            "render scene.toml -o a.png --with glaze --without glaze",
            "both with and without `glaze`",
            "one of the two",
        ),
        (
            "render scene.toml -o a.png --depth 3 --without path",
            "both --depth 3 and --without path",
            "one of the two",
        ),
        (
            "render scene.toml -o a.png --crop 20,0,5,5",
            "the crop reaches outside the picture of 24 x 16",
            "--size",
        ),
        ("render scene.toml -o a.png --crop 4294967295,0,1,1", "the crop reaches outside", ""),
        ("render scene.toml -o frame_####.png", "a pattern for several files", ""),
        ("render scene.toml -o frame_%04d.png", "a pattern for several files", ""),
        // The name of a folder is no pattern.
        ("render scene.toml -o a####%04d/frame_%04d.png", "a pattern for several files", ""),
        ("render - - -o a.png", "standard input can be read once", ""),
        ("render scene.toml -o a.png --stats ./a.png", "both the picture and its statistics", "another file"),
    ] {
        let (said, advice) = workshop.fail(arguments, 2);
        assert!(said.contains(error), "{arguments}: {said}");
        assert!(advice.contains(hint), "{arguments}: {advice}");
    }
    assert_eq!(workshop.names(), ["scene.toml"]);
}

/// Messages name the options that were typed.
#[test]
fn messages_name_what_was_typed() {
    let workshop = Workshop::with("scene.toml", SCENE);
    for (options, option) in [
        ("--depth 3", "--depth 3"),
        ("--with path=3", "--with path=3"),
        ("--with path", "--with path"),
        ("--depth 3 --with path=4", "--depth 3"),
    ] {
        let said = workshop.said(&format!("render scene.toml -o a.png {options}")).2;
        assert!(said.contains(&format!("warning: {option} changes nothing: ")), "{options}: {said}");
    }
    // A key of a scene file is not named as an option.
    workshop.write(
        "phong.toml",
        format!("{SCENE}\n[effects]\nshadows = true\n").replace("[image]", "[image]\nshading = 'phong'"),
    );
    let said = workshop.succeed("explain phong.toml");
    assert!(!said.contains("--shading"), "{said}");
}

/// The line of a key is not that of a comment with its name.
#[test]
fn a_key_in_a_comment_is_not_its_place() {
    let workshop = Workshop::with(
        "a.toml",
        "# min_samples\n[image]\n# min_samples = 1 was too few\nsamples = 4\n\n  \"min_samples\" = 9\n",
    );
    let (said, _) = workshop.fail("render a.toml -o a.png", 3);
    assert!(said.contains("a.toml:6: `min_samples` is 9, and `samples` 4"), "{said}");
}

/// A flat sheet has no open side; a room without a wall has.
#[test]
fn a_flat_shape_is_not_open_to_one_side() {
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
    let workshop = Workshop::with("sheet.obj", square);
    workshop.write("corner.obj", format!("{square}v 0 0 1\nv 1 0 1\nf 1 5 6 2\n"));
    let says = |file: &str| {
        workshop.said(&format!("render {file} -o a.png --size 8x8 --draft")).2.contains("open to one side")
    };
    assert!(!says("sheet.obj") && says("corner.obj"));
}

#[test]
fn inputs_that_cannot_be_used_are_3() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.write("bad.toml", "[image]\nwidht = 3\n");
    workshop.write("bad.obj", "v 0 0 0\nf 1 2 3\n");
    workshop.write("bad.glb", "glTF and nothing else");
    workshop.write("bad.3ds", "MM");
    workshop.write("bad.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\n");
    workshop.write("bad.stl", "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0\n");
    workshop.write("empty.stl", "solid\nendsolid\n");
    workshop.write("empty.obj", "");
    std::fs::create_dir(workshop.path("folder.obj")).expect("a folder can be made");
    workshop.write("filter.toml", "[image]\nfilter = 'gausian'\n");
    workshop.write("samples.toml", "[image]\n\nsamples = 70000\n");
    workshop.write("floor.toml", "[image]\nsamples = 8\nmin_samples = 16\n");
    workshop.write("noise.toml", "[image]\nnoise = 0\n");
    workshop.write("radius.toml", "[image]\nfilter_radius = -1\n");
    for (input, error, hint) in [
        ("filter.toml", "filter.toml:2: unknown value `gausian`", "did you mean `gaussian`?"),
        ("samples.toml", "samples.toml:3: `samples` is 70000", "give a number of samples from 1 to 65536"),
        ("floor.toml", "floor.toml:3: `min_samples` is 16, and `samples` 8", "at most as many"),
        ("noise.toml", "noise.toml:2: `noise` is 0", "give a standard error from 0.000001 to 1"),
        ("radius.toml", "radius.toml:2: `filter_radius` is -1", "give a radius in pixels from 0.01 to 32"),
        ("gone.obj", "gone.obj: no such file", "check the name and the folder"),
        ("folder.obj", "folder.obj: is a folder", "name a file in it"),
        ("bad.toml", "bad.toml:2: unknown key `widht`", "did you mean `width`?"),
        ("bad.obj", "bad.obj: has no triangles to draw", "kiln info"),
        ("bad.glb", "bad.glb: not a usable glTF file", "export it again"),
        ("bad.3ds", "bad.3ds: not a kind of file that kiln reads", ".glb, .ply, .stl"),
        ("bad.ply", "bad.ply:4: the header does not end with a line `end_header`", "export the file again"),
        ("bad.stl", "bad.stl:4: a vertex without three numbers", "correct the line"),
        ("empty.stl", "empty.stl: has no triangles to draw", "kiln info"),
        ("empty.obj", "empty.obj: has no triangles to draw", "kiln info"),
    ] {
        let (said, advice) = workshop.fail(&format!("render {input} -o a.png"), 3);
        assert!(said.starts_with(error), "{input}: {said}");
        assert!(advice.contains(hint), "{input}: {advice}");
    }
    // Files without triangles in any format; their contents are printed before the error.
    workshop.write("points.off", "OFF\n1 0 0\n0 0 0\n");
    let xyz = "property float x\nproperty float y\nproperty float z";
    workshop
        .write("points.ply", format!("ply\nformat ascii 1.0\nelement vertex 1\n{xyz}\nend_header\n0 0 0\n"));
    workshop.write("empty.gltf", r#"{"asset": {"version": "2.0"}}"#);
    for input in ["points.off", "points.ply", "empty.stl", "empty.obj", "empty.gltf"] {
        for json in ["", " --json"] {
            let output = workshop.run(&format!("info {input}{json}"));
            let said = text(&output.stderr);
            assert_eq!(output.status.code(), Some(3), "{input}: {said}");
            assert_eq!(check_error(&said).0, format!("{input}: has no triangles to draw"));
            assert!(!output.stdout.is_empty(), "{input}");
        }
    }
    let (said, _) = workshop.fail("info gone.obj", 3);
    assert_eq!(said, "gone.obj: no such file");
    assert!(!workshop.path("a.png").exists());
}

#[test]
fn outputs_that_cannot_be_written_are_4() {
    let workshop = Workshop::with("scene.toml", SCENE);
    std::fs::create_dir(workshop.path("folder.png")).expect("a folder can be made");
    let (said, _) = workshop.fail("render scene.toml -o gone/a.png", 4);
    assert_eq!(said, "gone/a.png: cannot be written: its folder does not exist");
    let (said, _) = workshop.fail("render scene.toml -o folder.png", 4);
    assert_eq!(said, "folder.png: is a folder; name a file in it");
    let (said, _) = workshop.fail("render scene.toml -o a.png --stats gone/a.json", 4);
    assert_eq!(said, "gone/a.json: cannot be written: its folder does not exist");
    // These errors are reported before anything is read or rendered.
    assert_eq!(workshop.names(), ["folder.png", "scene.toml"]);
}

#[test]
fn strict_makes_warnings_1() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.write("a.obj", "mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let said = workshop.succeed("render a.obj -o a.png --size 8x8");
    assert!(said.contains("kiln: warning: a.obj: materials left out: gone.mtl: no such file\n"), "{said}");
    let note = "kiln: note: no light and no camera in the files: light, ground and background are added; --draft adds \
                a headlight\n";
    assert!(said.contains(note), "{said}");
    let (said, hint) = workshop.fail("render a.obj -o a.png --size 8x8 --strict", 1);
    assert_eq!(said, "1 warning(s), and --strict was given");
    assert!(hint.contains("the picture was written"), "{hint}");
    // Without warnings, `--strict` changes nothing.
    workshop.succeed("render scene.toml -o a.png --strict");
}

#[test]
fn a_failed_run_keeps_the_picture_that_was_there() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.write("a.png", "an earlier picture");
    workshop.write("bad.obj", "v 0 0 0\nf 1 2 3\n");
    workshop.fail("render bad.obj -o a.png", 3);
    workshop.fail("render scene.toml -o a.png --camera none", 2);
    assert_eq!(workshop.bytes("a.png"), b"an earlier picture");
    assert_eq!(workshop.names(), ["a.png", "bad.obj", "scene.toml"]);
}

// ------------------------------------------------------------------------------------------------------------ pictures

#[test]
fn png_jpeg_and_exr_hold_the_same_picture() {
    let workshop = Workshop::with("scene.toml", SCENE);
    for name in ["a.png", "a.jpg", "a.exr"] {
        workshop.succeed(&format!("render scene.toml -o {name}"));
    }
    let png = workshop.pixels("a.png");
    assert_eq!(png.dimensions(), (24, 16));
    // The corners show the background, #202020; the middle shows the sphere.
    assert_eq!(png.get_pixel(0, 0).0, [0x20; 3]);
    assert!(png.get_pixel(12, 8).0[0] > 0x60, "{:?}", png.get_pixel(12, 8));
    // JPEG of quality 95 is near on average only, as its chroma has half the resolution.
    let jpeg = workshop.pixels("a.jpg");
    assert_eq!(jpeg.dimensions(), (24, 16));
    let apart: u64 = png.as_raw().iter().zip(jpeg.as_raw()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    assert!(apart / (png.as_raw().len() as u64) < 8, "{apart}");
    // In the pipeline `display`, 8-bit values are those of the film times 255, clamped, with halves rounded up.
    let mut expected = png.as_raw().chunks_exact(3);
    for pixel in exr_pixels(&workshop.path("a.exr"), (24, 16)) {
        let quantised = pixel.map(|c| (f64::from(c) * 255.0 + 0.5) as u8);
        assert_eq!(Some(&quantised[..]), expected.next());
    }
    assert_eq!(expected.next(), None);
}

/// The pixels of an OpenEXR picture, row by row from the top.
fn exr_pixels(file: &Path, size: (usize, usize)) -> Vec<[f32; 3]> {
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

/// The metadata of a PNG picture.
fn metadata(workshop: &Workshop, name: &str) -> impl Fn(&str) -> Option<String> {
    let file = std::fs::File::open(workshop.path(name)).expect("it was written");
    let reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("it is a PNG picture");
    move |key: &str| {
        let chunk = reader.info().utf8_text.iter().find(|chunk| chunk.keyword == key);
        chunk.map(|chunk| chunk.get_text().expect("it is UTF-8"))
    }
}

/// Given again, the automatic camera that metadata and `kiln info` print makes the same picture: of a mesh, of one beside a
/// camera, which alone would leave out ground and background, and of two meshes.
#[test]
fn an_automatic_camera_can_be_given_again() {
    let workshop =
        Workshop::with("a.obj", "v 0 0 0\nv 4 0 0\nv 0 3 0\nv 0 0 2\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
    workshop.write("b.obj", "v 9 0 0\nv 9.01 0 0\nv 9 0.01 0\nf 1 2 3\n");
    workshop.write(
        "eye.gltf",
        r#"{ "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "camera": 0 }],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }] }"#,
    );
    for (inputs, options) in [
        ("a.obj", ""),
        ("a.obj", "--view iso --azimuth=-30 --elevation 10 --zoom 1.5 --fov 50"),
        ("a.obj", "--projection orthographic --zoom 0.5"),
        ("a.obj eye.gltf", "--camera auto"),
        ("a.obj b.obj", ""),
    ] {
        let said = workshop.succeed(&format!("render {inputs} -o a.png --size 24x16 {options}"));
        assert_eq!(said.contains("b.obj is 0."), inputs.contains("b.obj"), "{said}");
        let table = metadata(&workshop, "a.png")("kiln:camera").expect("a camera");
        let given = table.replace(' ', "");
        workshop.succeed(&format!("render {inputs} -o b.png --size 24x16 --camera {given}"));
        workshop.succeed("compare a.png b.png");
        if options.is_empty() {
            assert_eq!(workshop.bytes("a.png"), workshop.bytes("b.png"), "{table}");
        }
    }
    workshop.succeed("render a.obj -o a.png --size 16x16");
    let table = metadata(&workshop, "a.png")("kiln:camera").expect("a camera");
    assert!(
        table.starts_with("{ name = \"auto\", position = [") && table.ends_with("vertical_fov = 30 }"),
        "{table}"
    );
    let info = workshop.run("info a.obj --json");
    let report: serde_json::Value = serde_json::from_slice(&info.stdout).expect("JSON");
    assert_eq!(report["render"]["camera"], table.as_str());
    // The options change nothing of another camera.
    let said = workshop.succeed("render a.obj eye.gltf -o a.png --size 16x16 --azimuth 30");
    assert!(said.contains("warning: azimuth changes nothing: the camera is `"), "{said}");
}

/// A camera whose name `--camera` reads as something else is recorded whole, so that it can be given again.
#[test]
fn a_camera_named_as_another_value_of_the_option_is_recorded_whole() {
    for name in ["auto", "{a"] {
        let scene = format!(
            "[[camera]]\nname = '{name}'\nposition = [0, 1, 9]\nlook_at = [0, 0, 0]\nvertical_fov = 50\n\
             [[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n"
        );
        let workshop = Workshop::with("a.toml", &scene);
        workshop.succeed("render a.toml -o a.png --size 24x16");
        let table = metadata(&workshop, "a.png")("kiln:camera").expect("a camera");
        workshop.succeed(&format!("render a.toml -o b.png --size 24x16 --camera {}", table.replace(' ', "")));
        assert_eq!(workshop.bytes("a.png"), workshop.bytes("b.png"), "{table}");
    }
}

#[test]
fn pictures_say_what_made_them() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.succeed("render scene.toml -o a.png --camera above --crop 1,2,3,4 --without shadows");
    let said = metadata(&workshop, "a.png");
    assert_eq!(said("kiln:samples"), None);
    for (key, value) in [
        ("kiln:camera", "above"),
        ("kiln:inputs", "scene.toml"),
        ("kiln:size", "24x16"),
        ("kiln:crop", "1,2,3,4"),
        ("kiln:colour", "display"),
        ("kiln:without", "shadows"),
    ] {
        assert_eq!(said(key).as_deref(), Some(value), "{key}");
    }
}

#[test]
fn names_in_other_alphabets_can_be_written() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.write("κάμινος.toml", SCENE.replace("'front'", "'窯 前'"));
    for name in ["a.png", "a.jpg", "a.exr"] {
        workshop.succeed(&format!("render κάμινος.toml -o {name}"));
    }
    let meta =
        exr::meta::MetaData::read_from_file(workshop.path("a.exr"), false).expect("it is an EXR picture");
    let key = exr::meta::attribute::Text::from("kiln:camera");
    let value = meta.headers[0].own_attributes.other.get(&key).cloned();
    let Some(exr::meta::attribute::AttributeValue::Text(value)) = value else { panic!("{value:?}") };
    assert_eq!(value.as_slice(), "窯 前".as_bytes());
}

#[test]
fn standard_output_carries_the_picture_and_only_that() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.succeed("render scene.toml -o a.png");
    let output = workshop.run("render scene.toml -o -");
    assert_eq!(output.status.code(), Some(0));
    assert!(output.stdout == workshop.bytes("a.png"), "the bytes are those of the file");
}

#[test]
fn standard_input_carries_a_scene_file_or_a_glb() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.succeed("render scene.toml -o a.png");
    let output = workshop.run_with("render - -o b.png", SCENE.as_bytes());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(workshop.pixels("a.png") == workshop.pixels("b.png"));
    let output = workshop.run_with("info - --json", &Model::triangle().binary());
    let report: Value = serde_json::from_slice(&output.stdout).expect("it is JSON");
    assert_eq!((&report["triangles"], &report["inputs"][0]), (&1.into(), &"-".into()));
    // Errors in standard input name the file `-`.
    let output = workshop.run_with("info -", b"[image]\nwidht = 1\n");
    assert_eq!(output.status.code(), Some(3));
    assert_eq!(check_error(&text(&output.stderr)).0, "-:2: unknown key `widht`");
}

#[test]
fn threads_and_presets_of_the_tree_do_not_change_a_byte() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let scene = repository("scenes/assignment.toml");
    let bytes = |options: &str| {
        workshop.succeed(&format!("render {} -o a.png --size 70x50 {options}", scene.display()));
        workshop.bytes("a.png")
    };
    let expected = bytes("--threads 1");
    let presets = kiln::bvh::Preset::ALL.map(|preset| format!("--bvh {}", preset.name()));
    for options in presets.iter().map(String::as_str).chain(["--threads 2", ""]) {
        assert!(bytes(options) == expected, "{options}");
    }
}

#[test]
fn four_crops_make_the_whole_picture() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let scene = repository("scenes/assignment.toml");
    let render = |name: &str, crop: &str| {
        workshop.succeed(&format!("render {} -o {name} --size 50x40 {crop}", scene.display()));
        workshop.pixels(name)
    };
    let whole = render("whole.png", "");
    let mut stitched = image::RgbImage::new(50, 40);
    // A crop whose borders are not those of tiles, which are 16 wide.
    for (x, y, width, height) in [(0, 0, 21, 13), (21, 0, 29, 13), (0, 13, 21, 27), (21, 13, 29, 27)] {
        let part = render("part.png", &format!("--crop {x},{y},{width},{height}"));
        assert_eq!(part.dimensions(), (width, height));
        image::imageops::replace(&mut stitched, &part, i64::from(x), i64::from(y));
    }
    assert!(whole == stitched);
}

#[test]
fn cameras_and_views() {
    let workshop = Workshop::with("scene.toml", SCENE);
    // A wedge without symmetry, so that every view differs.
    let wedge = "v 0 0 0\nv 3 0 0\nv 0 2 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    workshop.write("wedge.obj", wedge);
    let mut pictures = Vec::new();
    for view in ["front", "back", "left", "right", "top", "bottom", "iso"] {
        workshop.succeed(&format!("render wedge.obj -o a.png --size 32x32 --view {view} --draft"));
        let picture = workshop.pixels("a.png");
        // A fitted camera leaves a margin of 5 % on the tightest sides: of 32 pixels the outermost one, on every side.
        let background = *picture.get_pixel(0, 0);
        assert_eq!(background.0, [0x20, 0x22, 0x26], "{view}");
        let edge = |i: u32| [(i, 0), (i, 31), (0, i), (31, i)];
        assert!((0..32).flat_map(edge).all(|(x, y)| *picture.get_pixel(x, y) == background), "{view}");
        assert!(picture.pixels().filter(|p| **p != background).count() > 60, "{view} shows the wedge");
        assert!(!pictures.contains(&picture), "{view} looks like another view");
        pictures.push(picture);
    }
    let render = |arguments: &str| {
        workshop.succeed(&format!("render scene.toml -o a.png {arguments}"));
        workshop.pixels("a.png")
    };
    let (front, above, auto) = (render(""), render("--camera above"), render("--camera auto"));
    assert!(front == render("--camera front") && front == render("--camera 0"), "the first is the default");
    assert!(above == render("--camera 1") && above != front);
    assert!(auto != front && auto != above);
    assert!(front != render("--projection orthographic"));
    assert_eq!(render_own(&workshop, "scene.toml", FRONT), front);
    let (said, hint) = workshop.fail("render wedge.obj -o a.png --camera front", 2);
    assert_eq!((said.as_str(), hint.contains("--view")), ("there is no camera `front`", true));
}

/// The camera `front` of [`SCENE`] as an inline table.
const FRONT: &str = "{ position = [0, 0, 10], look_at = [0, 0, 0] }";

/// A picture by a camera given as an inline table.
fn render_own(workshop: &Workshop, scene: &str, camera: &str) -> image::RgbImage {
    let output = workshop.command("").args(["render", scene, "-o", "own.png", "--camera", camera]).output();
    let output = output.expect("the command starts");
    assert_eq!(output.status.code(), Some(0), "{camera}: {}", text(&output.stderr));
    workshop.pixels("own.png")
}

/// A camera of the scene and the same as an inline table give the same picture, bit for bit, also if the scene is
/// recentered.
#[test]
fn a_camera_in_braces_is_the_scenes_own() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let far = SCENE
        .replace("[0, 0, 10]", "[1e6, 0, 1000010]")
        .replace("[0, 10, 1]", "[1e6, 10, 1000001]")
        .replace("[0, 0, 0]", "[1e6, 0, 1e6]")
        .replace("[5, 5, 10]", "[1000005, 5, 1000010]");
    workshop.write("far.toml", far);
    let own = "{ position = [1e6, 10, 1000001], look_at = [1e6, 0, 1e6], projection = 'orthographic', up = [0.1, 1, 0] }";
    let section = format!(
        "[[camera]]\nname = 'x'\n{}",
        own.trim_matches(['{', '}']).replace("], ", "]\n").replace("', ", "'\n")
    );
    workshop.write("own.toml", section);
    let said = workshop.succeed("render far.toml own.toml -o a.exr --camera x");
    assert!(said.contains("moved to it"), "{said}");
    let output = workshop.command("").args(["render", "far.toml", "-o", "b.exr", "--camera", own]).output();
    assert_eq!(output.expect("the command starts").status.code(), Some(0));
    let pixels = |name: &str| image_bits(&workshop.path(name));
    assert_eq!(pixels("a.exr"), pixels("b.exr"));
    assert!(render_own(&workshop, "far.toml", own) != render_own(&workshop, "scene.toml", FRONT));
    // Every command that renders takes it, and reports errors in it before anything is read.
    for command in
        ["render no.toml -o a.png", "animate no.toml -o a.gif", "explain no.toml", "study no.toml -o d"]
    {
        let arguments: Vec<&str> =
            command.split(' ').chain(["--camera", "{ position = [0, 0, 1], lok_at = [0, 0, 0] }"]).collect();
        let output = workshop.command("").args(arguments).output().expect("the command starts");
        let said = text(&output.stderr);
        let (error, hint) = check_error(&said);
        assert_eq!(output.status.code(), Some(2), "{command}: {said}");
        assert!(error.contains("unknown key `lok_at`") && hint == "did you mean `look_at`?", "{said}");
    }
}

/// The picture that a window shows is the one that its copied command line renders.
#[cfg(feature = "viewer")]
#[test]
fn what_is_seen_is_rendered_by_its_line() {
    use kiln::effects::Choices;
    use kiln::viewer::{CameraSource, command_line, navigate};
    let workshop = Workshop::with("scene.toml", SCENE);
    let mut scene = crate::common::picture::load(&workshop.path("scene.toml"));
    let loaded = scene.clone();
    let mut camera = scene.cameras[0].clone();
    navigate::orbit(&mut camera, glam::DVec2::new(0.3, 0.2));
    navigate::zoom(&mut camera, 1.3);
    navigate::pan(&mut camera, glam::DVec2::new(0.1, -0.05), 1.5);
    let settings = kiln::job::RenderSettings { without: vec!["shadows".into()], ..Default::default() };
    let command = command_line::RenderCommand {
        inputs: &["scene.toml".into()],
        scene: &loaded,
        viewpoint: &CameraSource::Free(camera.clone()),
        projection: camera.projection,
        size: [48, 32],
        settings: &settings,
        import_options: &kiln::scene::ImportOptions::default(),
        output: Path::new("seen.png"),
    };
    let words = command_line::arguments(&command);
    let output = workshop.command("").args(&words[1..]).output().expect("the command starts");
    assert_eq!(output.status.code(), Some(0), "{words:?}: {}", text(&output.stderr));
    scene.cameras[0] = camera;
    let prepared = crate::common::picture::prepare(scene, [48, 32], Default::default());
    let film = prepared.render(Choices { without: vec!["shadows".into()], ..Choices::default() }).0;
    assert_eq!(workshop.pixels("seen.png").into_raw(), film.to_rgb8(kiln::film::ColourPipeline::Display));
}

/// The values of an EXR.
fn image_bits(file: &Path) -> Vec<[u32; 3]> {
    let picture = kiln::film::read::read_picture(file).unwrap_or_else(|e| panic!("{e}"));
    picture.values.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

#[test]
fn size_is_the_users_then_the_scenes() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.succeed("render scene.toml -o a.png --size 7x5");
    assert_eq!(workshop.pixels("a.png").dimensions(), (7, 5));
    workshop.succeed("render scene.toml -o a.png");
    assert_eq!(workshop.pixels("a.png").dimensions(), (24, 16));
}

#[test]
fn a_mesh_beside_the_assignment_scene() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let scene = repository("scenes/assignment.toml");
    // A large triangle between the camera at (0, -200, 500) and its target, the tetrahedron at z = 1216.
    workshop.write("near.obj", "v -400 -400 900\nv 300 -400 900\nv -50 100 900\nf 1 2 3\n");
    workshop.write("far.obj", "v 0 90000 -900\nv 1 90000 -900\nv 0 90001 -900\nf 1 2 3\n");
    let render = |inputs: &str| {
        let said = workshop.succeed(&format!("render {} {inputs} -o a.png --size 32x32", scene.display()));
        (workshop.pixels("a.png"), said)
    };
    let (alone, _) = render("");
    let (with, said) = render("near.obj");
    assert!(alone.get_pixel(16, 16) != with.get_pixel(16, 16), "the triangle covers the middle");
    assert!(!said.contains("warning"), "{said}");
    let (same, said) = render("far.obj");
    assert!(alone == same, "what is nowhere in the picture does not change it");
    assert!(said.contains("kiln: warning: far.obj is nowhere in the picture"), "{said}");
}

/// The picture of a mesh does not depend on its position and size.
#[test]
fn far_and_extreme_meshes_look_as_near_ones() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let wedge = |scale: f64, offset: f64| {
        let corners = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.0]];
        let vertex =
            |c: [f64; 3]| format!("v {:e} {:e} {:e}\n", c[0] * scale + offset, c[1] * scale, c[2] * scale);
        let vertices: String = corners.into_iter().map(vertex).collect();
        format!("{vertices}f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    };
    workshop.write("near.obj", wedge(1.0, 0.0));
    workshop.succeed("render near.obj -o near.png --size 48x48");
    let near = workshop.pixels("near.png");
    // Scaling by powers of two is exact, and at an offset of 2^24 the corners are still integers.
    for (name, scale, offset) in
        [("far", 1.0, 16_777_216.0), ("tiny", 100f64.exp2().recip(), 0.0), ("huge", 55f64.exp2(), 0.0)]
    {
        workshop.write(&format!("{name}.obj"), wedge(scale, offset));
        let said = workshop.succeed(&format!("render {name}.obj -o a.png --size 48x48"));
        assert!(said.contains("kiln: note: the scene"), "{said}");
        let different = workshop.pixels("a.png").pixels().zip(near.pixels()).filter(|(a, b)| a != b).count();
        // The fitted camera is rounded differently, so an edge may be on the other side of a pixel centre.
        assert!(different <= 2, "{name}: {different} pixels differ");
    }
}

/// Files with points and lines only, or with a camera only, are errors; a scene file with a background only is not.
#[test]
fn files_without_triangles_are_refused() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.write("lines.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2\nl 1 2 3\np 1\n");
    let camera = json!({ "type": "perspective", "perspective": { "yfov": 1, "znear": 0.1 } });
    let mut lines = Model::new(&[[0.0; 3]; 2])
        .with("scenes", json!([{ "nodes": [0, 1] }]))
        .with("nodes", json!([{ "camera": 0 }, { "mesh": 0 }]))
        .with("cameras", json!([camera]));
    lines.primitive()["mode"] = json!(1);
    workshop.write("lines.gltf", lines.text());
    lines.json["nodes"][1] = json!({});
    workshop.write("camera.gltf", lines.text());
    for file in ["lines.obj", "lines.gltf", "camera.gltf", "camera.gltf lines.obj"] {
        let first = file.split(' ').next().unwrap_or_default();
        for command in ["render", "animate", "explain"] {
            let out = match command {
                "render" => "-o a.png",
                "animate" => "-o a.gif",
                _ => "",
            };
            let (said, hint) = workshop.fail(&format!("{command} {file} {out}"), 3);
            assert_eq!(said, format!("{first}: has no triangles to draw"), "{command}");
            assert!(hint.contains("points and lines"), "{hint}");
        }
        assert!(!workshop.path("a.png").exists());
    }
    // Together with a mesh they are a warning, and a file with a camera only is used for its camera.
    let said = workshop.succeed("render scene.toml lines.obj camera.gltf -o a.png");
    let warnings: Vec<&str> = said.lines().filter(|line| line.starts_with("kiln: warning: ")).collect();
    let expected = ["lines.obj: points and lines are not drawn", "lines.obj: has no triangles to draw"];
    assert_eq!(warnings, expected.map(|what| format!("kiln: warning: {what}")));
    workshop.write("mesh.toml", format!("{SCENE}[[mesh]]\nfile = 'lines.obj'\n"));
    let said = workshop.succeed("render mesh.toml -o a.png");
    assert!(said.contains("kiln: warning: lines.obj: has no triangles to draw\n"), "{said}");
    let background =
        "[image]\nbackground = '#102030'\n[[camera]]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\n";
    workshop.write("background.toml", background);
    let said = workshop.succeed("render background.toml -o a.png");
    assert!(
        said.contains("nothing is in the picture: the scene has no triangles and no spheres\n"),
        "{said}"
    );
    assert_eq!(workshop.pixels("a.png").get_pixel(3, 3).0, [0x10, 0x20, 0x30]);
}

#[test]
fn a_picture_of_nothing_says_so() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.write("away.toml", SCENE.replace("look_at = [0, 0, 0]", "look_at = [0, 0, 20]"));
    let said = workshop.succeed("render away.toml -o a.png");
    // 24 x 16 pixels, one primary ray each.
    assert!(said.contains("nothing is in the picture: none of 384 primary rays hits anything"), "{said}");
}

/// Only the last part of a path is the pattern of frames.
#[test]
fn a_folder_may_be_named_like_a_pattern() {
    let workshop = Workshop::with("scene.toml", SCENE);
    for folder in ["shot%04d", "take####"] {
        std::fs::create_dir(workshop.path(folder)).expect("a folder");
        workshop.succeed(&format!("render scene.toml -o {folder}/a.png"));
        workshop.succeed(&format!("render scene.toml --frames 3 -o {folder}/f_##.png"));
        assert!(workshop.path(folder).join("f_03.png").exists());
    }
}

/// What no tier can draw is an error in a scene file as in a mesh, not a blank picture; a background alone is a picture.
#[test]
fn a_scene_of_objects_that_are_all_left_out_is_an_error() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let corners = "v 0 0 0\nv 1e19 0 0\nv 0 1e19 0\nf 1 2 3\n";
    workshop.write("mesh.obj", corners);
    workshop.write("one.obj", corners.replace("e19", ""));
    let scene = SCENE.split("[[sphere]]").next().expect("a text before it").to_owned();
    for (name, object) in [
        ("sphere.toml", "[[sphere]]\ncentre = [1e19, 0, 0]\nradius = 1\n"),
        ("radius.toml", "[[sphere]]\ncentre = [0, 0, 0]\nradius = 1e19\n"),
        ("mesh.toml", "[[mesh]]\nfile = 'mesh.obj'\n"),
        ("far.toml", "[[mesh]]\nfile = 'one.obj'\ntranslate = [0, 0, 1e19]\n"),
    ] {
        workshop.write(name, format!("{scene}{object}"));
        let (said, hint) = workshop.fail(&format!("render {name} -o a.png"), 3);
        assert_eq!(said, format!("{name}: all its objects are left out"));
        assert!(hint.contains("warnings"), "{hint}");
    }
    workshop.fail("render mesh.obj -o a.png", 3);
    workshop.write("empty.toml", scene);
    workshop.succeed("render empty.toml -o a.png");
}

// ----------------------------------------------------------------------------------------------- statistics, progress

/// The phases of `--stats` cover a run. Of 2,000 instances, fitting the camera was the longest, and in none of them.
#[test]
fn statistics_cover_all_of_the_time() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let side = 50;
    let mut obj = String::new();
    for i in 0..=side {
        for j in 0..=side {
            let [x, z] = [i, j].map(|k| f64::from(k) / f64::from(side));
            obj += &format!("v {x} {} {z}\n", (7.0 * x).sin() * (5.0 * z).cos());
        }
    }
    for i in 0..side {
        for j in 1..=side {
            let a = i * (side + 1) + j;
            let [b, c, d] = [a + 1, a + side + 1, a + side + 2];
            obj += &format!("f {a} {b} {d}\nf {a} {d} {c}\n");
        }
    }
    workshop.write("mesh.obj", obj);
    let places: String = (0..2000).map(|i| format!("{{ translate = [{i}, {}, 0] }},\n", i % 7)).collect();
    workshop.write("many.toml", format!("[[mesh]]\nfile = 'mesh.obj'\nplacements = [\n{places}]\n"));
    let start = Instant::now();
    workshop.succeed("render many.toml -o a.png --size 32x32 --stats a.json");
    let all = start.elapsed().as_secs_f64();
    let stats: Value = serde_json::from_slice(&workshop.bytes("a.json")).expect("it is JSON");
    let seconds = stats["seconds"].as_object().expect("an object").values();
    let known: f64 = seconds.map(|s| s.as_f64().expect("a number")).sum();
    assert!(known > 0.5 * all, "{known} of {all} seconds: {}", stats["seconds"]);
}

#[test]
fn statistics_are_json_with_the_documented_fields() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.succeed("render scene.toml -o a.png --stats a.json --threads 2");
    let stats: Value = serde_json::from_slice(&workshop.bytes("a.json")).expect("it is JSON");
    assert_eq!(stats["schema"], 1);
    for pointer in [
        "/seconds/load",
        "/seconds/prepare",
        "/seconds/build",
        "/seconds/render",
        "/seconds/write",
        "/rays/primary/hit",
        "/rays/shadow/cast",
        "/rays/glaze/cast",
        "/tests/nodes",
        "/tests/primitives",
        "/peak_memory_bytes",
    ] {
        let value = stats.pointer(pointer);
        assert!(value.is_some_and(|v| v.as_f64().is_some_and(|x| x >= 0.0)), "{pointer}: {value:?}");
    }
    for pointer in ["/numerics", "/structure/layout", "/instruction_set", "/settings/kiln:camera", "/kiln"] {
        assert!(stats.pointer(pointer).is_some_and(Value::is_string), "{pointer}");
    }
    // One primary ray a pixel: 24 * 16.
    assert_eq!(stats["rays"]["primary"]["cast"], 24 * 16);
    assert_eq!((&stats["threads"], &stats["primitives"]), (&2.into(), &1.into()));
    assert_eq!(stats["non_finite_pixels"], 0);
    assert_eq!(stats["effects"]["shadows"]["on"], true);
    // Rays and time of each effect, and its stages.
    for (effect, is_on) in [("shadows", true), ("terminator", false), ("glaze", false)] {
        for key in ["stages", "rays", "bytes", "thread_seconds"] {
            let figure = stats["effects"][effect][key].as_f64();
            let fits = if is_on { figure > Some(0.0) } else { figure == Some(0.0) };
            assert!(fits, "{effect} {key}: {figure:?}");
        }
        let stages = stats["stages"].as_array().expect("a list");
        assert_eq!(stages.iter().any(|stage| stage["effect"] == effect), is_on, "{effect}");
        assert!(stats["effects"][effect]["why"].is_string(), "{effect}");
    }
    // Without glaze there are no mirror rays and no stage for them.
    assert_eq!(
        (&stats["effects"]["glaze"]["on"], &stats["rays"]["glaze"]["cast"]),
        (&false.into(), &0.into())
    );
    workshop.succeed("render scene.toml -o a.png --stats a.json --without shadows");
    let stats: Value = serde_json::from_slice(&workshop.bytes("a.json")).expect("it is JSON");
    assert_eq!(
        (&stats["effects"]["shadows"]["on"], &stats["rays"]["shadow"]["cast"]),
        (&false.into(), &0.into())
    );
}

#[test]
fn progress_is_fit_for_a_log() {
    let workshop = Workshop::with("scene.toml", SCENE);
    for mode in ["auto", "plain", "json", "none"] {
        let said = workshop.succeed(&format!("render scene.toml -o a.png --progress {mode}"));
        assert!(!said.contains(['\u{1b}', '\r']), "{mode}: {said:?}");
        match mode {
            "none" => assert_eq!(said, ""),
            "json" => assert!(said.starts_with("{\"event\":\"done\""), "{said}"),
            _ => assert!(said.starts_with("kiln: wrote a.png (24 x 16; "), "{said}"),
        }
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_log_that_cannot_be_written_does_not_stop_the_work() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.write("bad.obj", "f 1 2 3\n");
    for (arguments, code) in [("render scene.toml -o a.png", 0), ("render bad.obj -o b.png", 3), ("rendr", 2)]
    {
        let full = std::fs::File::create("/dev/full").expect("Linux has it");
        let status = workshop.command("").args(arguments.split_whitespace()).stderr(full).status();
        assert_eq!(status.expect("the command starts").code(), Some(code), "{arguments}");
    }
    assert_eq!(workshop.pixels("a.png").dimensions(), (24, 16));
}

// ------------------------------------------------------------------------------------------------------------- signals

/// Waits for the end of the process, up to a time limit.
fn wait(child: &mut Child, limit: Duration) -> Option<std::process::ExitStatus> {
    let start = Instant::now();
    while start.elapsed() < limit {
        if let Some(status) = child.try_wait().expect("the child can be waited for") {
            return Some(status);
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let _ = child.kill();
    let _ = child.wait();
    None
}

#[cfg(unix)]
#[test]
fn signals_stop_a_long_render_and_leave_nothing_behind() {
    for (signal, code) in [(Signal::TERM, 143), (Signal::INT, 130)] {
        let workshop = Workshop::with("scene.toml", SCENE);
        workshop.write("a.png", "an earlier picture");
        let scene = repository("scenes/assignment.toml");
        let mut command = workshop.command("");
        command.args(["render", "-o", "a.png", "--size", "16000x16000", "--progress", "none"]).arg(&scene);
        let mut child = command.stderr(Stdio::piped()).spawn().expect("the command starts");
        std::thread::sleep(Duration::from_millis(600));
        assert!(child.try_wait().expect("the child can be waited for").is_none(), "the render is long");
        kill_process(Pid::from_child(&child), signal).expect("the command runs");
        let start = Instant::now();
        let status = wait(&mut child, Duration::from_secs(2));
        assert_eq!(status.and_then(|s| s.code()), Some(code), "{signal:?} after {:?}", start.elapsed());
        assert_eq!(workshop.names(), ["a.png", "scene.toml"]);
        assert_eq!(workshop.bytes("a.png"), b"an earlier picture");
    }
}

// ------------------------------------------------------------------------------------------------------ other commands

#[test]
fn info_says_what_a_file_holds() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let fixture = repository("assets/import/materials.obj");
    let output = workshop.run(&format!("info {}", fixture.display()));
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), String::new()));
    let said = text(&output.stdout);
    // Two squares of two triangles and two single triangles, which are four runs of one material each; the bounds are
    // (0,0,0) to (2,1,0).
    for line in [
        "objects     4 (6 triangles, 0 spheres)\n",
        "bounds      (0, 0, 0) to (2, 1, 0)\n",
        "size        (2, 1, 0)\n",
        "cameras     none\n",
    ] {
        assert!(said.contains(line), "{line} is not in: {said}");
    }
    let output = workshop.run(&format!("info {} scene.toml --json", fixture.display()));
    let report: Value = serde_json::from_slice(&output.stdout).expect("it is JSON");
    assert_eq!(report["schema"], 1);
    assert_eq!(
        (&report["triangles"], &report["spheres"], &report["primitives"]),
        (&6.into(), &1.into(), &7.into())
    );
    // The sphere extends from -2 to 2 on all axes.
    assert_eq!(report["bounds"]["min"], serde_json::json!([-2.0, -2.0, -2.0]));
    assert_eq!(report["bounds"]["max"], serde_json::json!([2.0, 2.0, 2.0]));
    assert_eq!(report["cameras"][1]["name"], "above");
    assert_eq!((&report["textures"][0]["width"], &report["textures"][0]["height"]), (&2.into(), &2.into()));
    assert_eq!(report["objects"][4]["input"], "scene.toml");
    // Warnings about a file are part of the result.
    workshop
        .write("odd.obj", "mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nf 1 2 3\nf 1 2 4\nf 1 1 2\n");
    let output = workshop.run("info odd.obj");
    let said = text(&output.stdout);
    assert!(said.contains("warning     odd.obj: materials left out: gone.mtl: no such file\n"), "{said}");
    assert!(said.contains("no area     1 triangle(s), kept because they may close T-vertices\n"), "{said}");
    let note = "note        odd.obj: left out 1 triangle(s) with two equal corners, which no ray hits\n";
    assert!(said.contains(note), "{said}");
}

#[test]
fn schema_names_every_key_of_a_scene_file() {
    let output = Workshop::with("scene.toml", SCENE).run("schema");
    assert_eq!(output.status.code(), Some(0));
    let schema: Value = serde_json::from_slice(&output.stdout).expect("it is JSON");
    for key in ["image", "camera", "ambient", "light", "material", "sphere", "triangles", "mesh", "effects"] {
        assert!(schema["properties"][key].is_object(), "{key}");
    }
}

#[test]
fn completions_help_and_version() {
    let workshop = Workshop::with("scene.toml", SCENE);
    for shell in ["bash", "zsh", "fish"] {
        let output = workshop.run(&format!("completions {shell}"));
        assert_eq!(output.status.code(), Some(0));
        let said = text(&output.stdout);
        assert!(said.contains("kiln") && said.contains("orthographic"), "{shell}");
    }
    for arguments in ["--help", "help render", "--version"] {
        let output = workshop.run(arguments);
        assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), String::new()), "{arguments}");
        assert!(!output.stdout.is_empty());
    }
}

/// Pipes and devices are refused as input: they may have no end.
#[cfg(unix)]
#[test]
fn only_regular_files_are_read() {
    let shop = Workshop::with("scene.toml", SCENE);
    let made = Command::new("mkfifo").args([shop.path("pipe.bin"), shop.path("pipe.obj")]).status();
    assert!(made.is_ok_and(|status| status.success()), "mkfifo");
    std::os::unix::fs::symlink("/dev/zero", shop.path("zero.obj")).expect("a link");
    shop.write(
        "a.gltf",
        r#"{"asset": {"version": "2.0"}, "buffers": [{"byteLength": 36, "uri": "pipe.bin"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "nodes": [{"mesh": 0}]}"#,
    );
    for (file, said) in [
        ("pipe.obj", "pipe.obj: is a pipe, not a regular file"),
        ("zero.obj", "zero.obj: is a device, not a regular file"),
        ("a.gltf", "a.gltf: buffer 0: pipe.bin: is a pipe, not a regular file"),
    ] {
        assert_eq!(shop.fail(&format!("info {file}"), 3).0, said);
        assert_eq!(shop.fail(&format!("render {file} -o a.png --progress none"), 3).0, said);
    }
    shop.write("scene.toml", "[[mesh]]\nfile = 'pipe.obj'\n");
    let (said, _) = shop.fail("info scene.toml", 3);
    assert!(said.starts_with("scene.toml:1: mesh pipe.obj: is a pipe"), "{said}");
}

/// Files that state a length of 0 but have contents, such as those of /proc, are refused.
#[cfg(target_os = "linux")]
#[test]
fn files_longer_than_they_say_are_not_read() {
    let shop = Workshop::with("scene.toml", SCENE);
    std::os::unix::fs::symlink("/proc/self/status", shop.path("long.obj")).expect("a link");
    let (said, _) = shop.fail("info long.obj", 3);
    assert!(said.starts_with("long.obj: is longer than the 0 bytes"), "{said}");
}

/// Output is renamed over its target, so that a pipe or device would be replaced: they are refused as output.
#[cfg(unix)]
#[test]
fn pipes_and_devices_are_not_replaced() {
    use std::os::unix::fs::FileTypeExt;
    let shop = Workshop::with("scene.toml", SCENE);
    shop.write("small.toml", "[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n");
    assert!(Command::new("mkfifo").arg(shop.path("pipe.png")).status().is_ok_and(|made| made.success()));
    let said = shop.fail("render small.toml -o pipe.png --size 8x8 --progress none", 4).0;
    assert_eq!(said, "pipe.png: is a device or a pipe; name a file");
    let kind = std::fs::metadata(shop.path("pipe.png")).expect("still there").file_type();
    assert!(kind.is_fifo());
}

/// The tier that a scene file names is used; the option overrides it.
#[test]
fn a_scene_file_names_its_tier() {
    let shop = Workshop::with("scene.toml", SCENE);
    shop.write("exact.toml", "[image]\nnumerics = 'exact'\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n");
    for (option, expected) in [("", "exact"), ("--numerics fast", "fast")] {
        let render = "render exact.toml -o a.png --size 8x8 --progress none --stats a.json";
        shop.succeed(&format!("{render} {option}"));
        let stats: Value = serde_json::from_slice(&shop.bytes("a.json")).expect("JSON");
        assert_eq!(stats["numerics"], expected);
    }
}

/// Pictures that exceed the memory are refused before they are rendered. A channel of 6,000 x 6,000 pixels takes four
/// bytes a pixel in the film, in the writer and in the file, 0.4 GiB: eight exceed the limit of 2.9 GiB, and `all` has
/// more. On a machine of less memory the hint would be another.
#[cfg(target_os = "linux")]
#[test]
fn pictures_that_do_not_fit_are_refused_with_what_they_need() {
    let shop = Workshop::with("scene.toml", SCENE);
    let limited = |arguments: &str| {
        let kiln = assert_cmd::cargo::cargo_bin!("kiln").display().to_string();
        let mut command = Command::new("sh");
        command.current_dir(shop.0.path()).env_remove("RUST_BACKTRACE");
        command.args(["-c", &format!("ulimit -v 3000000; exec '{kiln}' {arguments}")]);
        let output = command.output().expect("the command starts");
        (output.status.code(), text(&output.stderr))
    };
    let (code, said) = limited("render scene.toml --size 6000x6000 --aov all -o a.exr --progress none");
    assert_eq!(code, Some(1), "{said}");
    let (line, hint) = check_error(&said);
    assert!(
        line.starts_with("a picture of 6000 x 6000 pixels with ") && line.contains(" more channels needs "),
        "{said}"
    );
    assert!(line.ends_with(" GiB of 2.9 GiB are left (ulimit -v)"), "{said}");
    assert!(hint.contains("--size") && hint.contains("ulimit -v unlimited"), "{said}");
    assert_eq!(shop.names(), ["scene.toml"]);
    // The same limit by `--memory-limit`; 8,000 x 8,000 pixels of 3 bytes are 183.1 MiB.
    let large = "render scene.toml --size 8000x8000 -o b.png --progress none --memory-limit 128M";
    shop.succeed(&format!("{large} --crop 0,0,8000,2"));
    let (said, hint) = shop.fail(large, 1);
    assert!(said.starts_with("a picture of 8000 x 8000 pixels needs 184 MiB of memory; "), "{said}");
    assert!(said.ends_with(" MiB of 128 MiB are left (--memory-limit)"), "{said}");
    assert!(hint.ends_with("or give --memory-limit 2G"), "{hint}");
    for (limit, why) in [
        ("64M", "64 MiB of it are reserved for threads and encoders; give at least 128M"),
        ("1.5G", "give a whole number with K, M, G or T, such as 1536M or 16G"),
        ("4X", "give a whole number with K, M, G or T, such as 1536M or 16G"),
    ] {
        let (said, _) = shop.fail(&format!("render scene.toml -o c.png --memory-limit {limit}"), 2);
        assert_eq!(said, format!("invalid value '{limit}' for '--memory-limit <SIZE>': {why}"));
    }
}

/// One picture must fit into the limit. Frames of which two do not fit are rendered one after the other: 3,200 x 3,200
/// pixels of 3 bytes are 29 MiB, and 128 MiB hold one of them beside the program and the 64 MiB that are kept free.
#[cfg(target_os = "linux")]
#[test]
fn frames_that_do_not_fit_are_refused_by_what_one_needs() {
    let shop = Workshop::with("scene.toml", SCENE);
    let frames = "render scene.toml -o f_####.png --progress none --memory-limit 128M --without shadows";
    let (said, hint) = shop.fail(&format!("{frames} --frames 0-3 --size 8000x8000"), 1);
    assert!(said.starts_with("a picture of 8000 x 8000 pixels needs 184 MiB of memory; "), "{said}");
    assert!(hint.starts_with("give a smaller --size"), "{hint}");
    assert_eq!(shop.names(), ["scene.toml"]);
    shop.succeed(&format!("{frames} --frames 0-1 --size 3200x3200"));
    assert_eq!(shop.names(), ["f_0000.png", "f_0001.png", "scene.toml"]);
    // With AOVs, too, a frame needs as much as a still picture of the same effects: 8,000^2 pixels of 4 channels of 4
    // bytes, in the film and twice in the writer, and 3 bytes while the AOV is computed, are 3.04 GiB.
    for (aovs, needs) in [("depth", "with 1 more channels needs 3.0 GiB"), ("effects", "")] {
        let arguments = format!("{} --size 8000x8000 --aov {aovs}", frames.replace(".png", ".exr"));
        let (frame, _) = shop.fail(&format!("{arguments} --frames 0"), 1);
        let (still, _) = shop.fail(&arguments.replace("f_####", "a"), 1);
        let need = |said: &str| said.split_once(" of memory; ").map(|(need, _)| need.to_owned());
        assert_eq!(need(&frame), need(&still));
        assert!(
            frame.starts_with("a picture of 8000 x 8000 pixels with ") && frame.contains(needs),
            "{frame}"
        );
    }
}

/// Meshes whose reading or building needs more memory than the limit are refused before it is allocated.
#[cfg(target_os = "linux")]
#[test]
fn meshes_that_do_not_fit_are_refused_with_what_they_need() {
    let shop = Workshop::with("scene.toml", SCENE);
    let faces = |count: usize| "v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_owned() + &"f 1 2 3\n".repeat(count);
    shop.write("large.obj", faces(6_000_000));
    shop.write("small.obj", faces(150_000));
    // 6,000,000 x 12 bytes of triangles, and as much again for what is made of them: 137.3 MiB.
    for command in ["info large.obj", "render large.obj -o a.png"] {
        let (said, hint) = shop.fail(&format!("{command} --memory-limit 128M"), 3);
        assert!(said.starts_with("large.obj: reading its meshes needs 138 MiB of memory; "), "{said}");
        assert!(hint.ends_with("give --memory-limit 2G"), "{hint}");
    }
    // 150,000 x 416 bytes are 59.5 MiB; reading them takes 3.4.
    shop.succeed("info small.obj --memory-limit 128M");
    for command in ["render", "render --frames 0"] {
        let (said, hint) =
            shop.fail(&format!("{command} small.obj -o a.png --numerics exact --memory-limit 128M"), 1);
        let start = "the acceleration structure over 150000 primitives needs 60 MiB of memory; ";
        assert!(said.starts_with(start), "{said}");
        assert!(hint.ends_with("give --memory-limit 2G"), "{hint}");
    }
}

/// Each limit refuses what it counts and names the file; the next greater number lets it pass. The model has 96
/// triangles, an image of 16 x 16 texels and another of its alpha, and one node.
#[test]
fn limits_of_what_files_hold() {
    let shop = Workshop::with("scene.toml", SCENE);
    let model = crate::common::repository("assets/import/codecs/plain.glb");
    let model = model.to_str().expect("UTF-8");
    for (kind, count) in [("triangles", 96), ("texels", 512), ("nodes", 1)] {
        shop.succeed(&format!("info {model} --limit {kind}={count}"));
        let less = count - 1;
        let (said, hint) = shop.fail(&format!("info {model} --limit {kind}={less}"), 3);
        assert!(
            said.contains("plain.glb") && said.contains(&format!("{count} {kind}; the limit is {less}")),
            "{said}"
        );
        assert!(hint.ends_with(&format!("give --limit {kind}={count}")), "{hint}");
    }
    let (said, _) = shop.fail(&format!("info {model} --limit points=3"), 2);
    assert!(said.contains("give triangles=N, texels=N or nodes=N"), "{said}");
}
