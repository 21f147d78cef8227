//! `kiln render` of several inputs to a picture each: names, failures, progress.

#[cfg(unix)]
use rustix::process::{Pid, Signal, kill_process};

use crate::helpers::SCENE;
use crate::workshop::{Workshop, text};

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// Two scenes, a mesh, and two files without a picture.
fn workshop() -> Workshop {
    let workshop = Workshop::with("a.toml", SCENE);
    workshop.write("b.toml", SCENE.replace("radius = 2", "radius = 1"));
    workshop.write("c d.obj", TRIANGLE);
    workshop.write("empty.obj", "v 0 0 0\n");
    workshop.write("broken.toml", "[image]\nwidht = 1\n");
    workshop
}

/// Runs with the words given, one of which may have a space.
fn said(workshop: &Workshop, words: &[&str]) -> (i32, String, String) {
    let output = workshop.command("").args(words).output().expect("the command starts");
    (output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr))
}

/// Each picture is that of its file alone, to the byte.
#[test]
fn pictures_are_those_of_single_commands() {
    let workshop = workshop();
    std::fs::create_dir(workshop.path("out")).expect("a folder");
    let (code, _, messages) = said(
        &workshop,
        &["render", "a.toml", "b.toml", "c d.obj", "-o", "out/p-{name}.png", "--size", "24x16"],
    );
    assert_eq!(code, 0, "{messages}");
    assert_eq!(messages.lines().filter(|line| line.contains("wrote")).count(), 1, "{messages}");
    assert!(
        messages.lines().last().is_some_and(|line| line.starts_with("kiln: wrote 3 picture(s) in ")),
        "{messages}"
    );
    for name in ["a.toml", "b.toml", "c d.obj"] {
        let (code, _, messages) = said(&workshop, &["render", name, "-o", "alone.png", "--size", "24x16"]);
        assert_eq!(code, 0, "{messages}");
        let stem = name.split('.').next().expect("a name");
        assert_eq!(workshop.bytes("alone.png"), workshop.bytes(&format!("out/p-{stem}.png")), "{name}");
    }
    // A folder, with and without a slash, also for one file.
    for folder in ["out/", "out"] {
        workshop.succeed(&format!("render a.toml -o {folder}"));
        assert_eq!(workshop.bytes("out/a.png"), workshop.bytes("out/p-a.png"));
        std::fs::remove_file(workshop.path("out/a.png")).expect("a picture");
    }
    // A folder as input is all files in it that are read; one that is missing as output is made.
    std::fs::create_dir(workshop.path("in")).expect("a folder");
    for (name, bytes) in [("b.toml", SCENE), ("a.OBJ", TRIANGLE), ("notes.txt", "no mesh")] {
        workshop.write(&format!("in/{name}"), bytes);
    }
    let (_, listed, _) = said(&workshop, &["render", "in", "-o", "new/deep/", "--list-outputs"]);
    assert_eq!((listed.as_str(), workshop.path("new").exists()), ("new/deep/a.png\nnew/deep/b.png\n", false));
    workshop.succeed("render in -o new/deep/ --size 8");
    let made = |name: &str| workshop.path(&format!("new/deep/{name}")).exists();
    assert!(made("a.png") && made("b.png") && !made("notes.png"));
    std::fs::create_dir(workshop.path("none")).expect("a folder");
    let (_, said_of_none) = workshop.code("render none -o out/", 3);
    assert!(said_of_none.contains("none: has no file of a format that is read"), "{said_of_none}");
    let listed = said(&workshop, &["render", "a.toml", "c d.obj", "-o", "out/{name}.exr", "--list-outputs"]);
    assert_eq!(listed, (0, "out/a.exr\nout/c d.exr\n".into(), String::new()));
}

/// Places in a name that nothing fills.
#[test]
fn a_name_with_unused_places_is_noted() {
    let workshop = workshop();
    let said = workshop.succeed("render a.toml -o f_##.png");
    assert!(said.contains("kiln: note: f_##.png names one picture; --frames numbers several\n"), "{said}");
    let said = workshop.succeed("render a.toml -o {nam}.png");
    assert!(said.contains("kiln: note: {nam}.png names one picture; {name} in it stands for"), "{said}");
}

/// Of several pictures, those before an interrupt are whole, and a note says how to go on.
#[cfg(unix)]
#[test]
fn an_interrupt_leaves_whole_pictures() {
    let workshop = workshop();
    // The second takes hours.
    let large = "[image]\nwidth = 4000\nheight = 4000\nsamples = 65536\n";
    workshop.write("slow.toml", format!("{large}[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n"));
    let mut command = workshop.command("render a.toml slow.toml -o {name}.png --progress plain");
    let child = command.stderr(std::process::Stdio::piped()).spawn().expect("the command starts");
    while !workshop.path("a.png").exists() {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    kill_process(Pid::from_child(&child), Signal::INT).expect("a signal");
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(130));
    let note = "kiln: note: 1 of 2 pictures are finished; --skip-existing goes on\n";
    assert!(text(&output.stderr).contains(note), "{}", text(&output.stderr));
    workshop.succeed("verify a.png");
    assert!(!workshop.names().iter().any(|name| name.starts_with("slow.png") || name.ends_with(".part")));
}

/// A file that fails takes one line, and the others are rendered; the exit code is the greatest.
#[test]
fn files_that_fail_do_not_stop_the_others() {
    let workshop = workshop();
    let words = ["render", "broken.toml", "a.toml", "empty.obj", "b.toml", "-o", "{name}.png"];
    let (code, _, messages) = said(&workshop, &words);
    let errors: Vec<&str> = messages.lines().filter(|line| line.starts_with("kiln: error: ")).collect();
    assert_eq!(code, 3, "{messages}");
    assert!(
        errors[0].starts_with("kiln: error: broken.toml:2: unknown key `widht`; did you mean `width`?")
            && errors[1].starts_with("kiln: error: empty.obj: has no triangles to draw; ")
            && errors[2].starts_with("kiln: error: 2 of 4 pictures failed; wrote 2 picture(s) in "),
        "{messages}"
    );
    assert!(!messages.contains("hint:"), "{messages}");
    assert!(workshop.path("a.png").exists() && workshop.path("b.png").exists());
    // Finished pictures are skipped, and a program gets one event a picture.
    let (code, _, events) =
        said(&workshop, &[&words[..], &["--skip-existing", "--progress", "json"]].concat());
    let names: Vec<String> = events
        .lines()
        .map(|line| serde_json::from_str::<serde_json::Value>(line).expect("JSON"))
        .filter(|event| event["event"] != "progress")
        .map(|event| event["event"].as_str().expect("a name").to_owned())
        .collect();
    assert_eq!((code, names.join(" ").as_str()), (3, "failure picture failure picture error"), "{events}");
    assert!(
        events.contains("2 of 4 pictures failed; wrote 0 picture(s) in ") && events.contains("; 2 existed")
    );
    // A warning names its file; `--strict` counts it as a failure, and the picture is there.
    let (code, _, messages) =
        said(&workshop, &["render", "a.toml", "b.toml", "-o", "x-{name}.png", "--same-grain", "--strict"]);
    assert_eq!(code, 1);
    assert!(messages.contains("kiln: warning: a.toml: --same-grain changes nothing"), "{messages}");
    assert!(messages.contains("kiln: error: b.toml: 1 warning(s), and --strict was given; "), "{messages}");
    assert!(workshop.path("x-b.png").exists());
}

/// Refused before anything is rendered: inputs of one name, none, a folder that is not there, frames.
#[test]
fn names_are_checked_before_rendering() {
    let workshop = workshop();
    workshop.write("a.obj", TRIANGLE);
    workshop.write("c.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nmtllib c.mtl\nusemtl m\nf 1/1 2/1 3/1\n");
    workshop.write("c.mtl", "newmtl m\nmap_Kd c.png\n");
    image::RgbImage::new(1, 1).save(workshop.path("c.png")).expect("a picture");
    let names = workshop.names();
    for (arguments, code, message, hint) in [
        (
            "a.toml b.toml a.obj -o {name}.png",
            2,
            "a.toml and a.obj would both be written to a.png",
            "render one of them by a command of its own",
        ),
        (
            "a.toml b.toml -o out/{name}.png",
            4,
            "out/{name}.png: cannot be written: its folder does not exist; make it with mkdir -p out",
            "",
        ),
        (
            "a.toml - -o {name}.png",
            2,
            "-: no name for {name} of --output",
            "give --output the whole name, such as -o picture.png",
        ),
        (
            "a.toml b.toml -o {name}.png --stats s.json",
            2,
            "s.json: one file for the statistics of several pictures",
            "give its name a place for theirs, such as {name}.json",
        ),
        (
            "a.toml b.toml -o {name}_##.png --frames 1-3",
            2,
            "--frames with {name}_##.png: frames of several files",
            "give one file and a name with ####, such as frame_####.png",
        ),
    ] {
        assert_eq!(workshop.fail(&format!("render {arguments}"), code), (message.into(), hint.into()));
    }
    // A texture of the file has the name of its picture.
    let (said, hint) = workshop.fail("render c.obj -o {name}.png", 2);
    assert!(said.contains("c.png"), "{said} {hint}");
    // On macOS and Windows the second would replace the first; one command does the same everywhere.
    std::fs::create_dir(workshop.path("sub")).expect("a folder");
    workshop.write("sub/A.obj", TRIANGLE);
    let (said, _) = workshop.fail("render a.obj sub/A.obj -o {name}.png", 2);
    assert_eq!(
        said,
        "a.obj and sub/A.obj would be written to a.png and A.png: one file, where case does not count"
    );
    // The picture of one input and the statistics of another.
    let (said, _) = workshop.fail("render a.toml pa.obj -o p{name}.png --stats {name}.png", 2);
    assert_eq!(said, "a.toml and pa.obj would both be written to pa.png");
    std::fs::remove_dir_all(workshop.path("sub")).expect("a folder");
    assert_eq!(workshop.names(), names);
}

/// A tree whose bark is a picture that has the name of another input's output, in each way to refer to a file.
fn referring() -> Workshop {
    let shop = Workshop::with("bark.obj", TRIANGLE);
    let textured =
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nmtllib t.mtl\nusemtl m\nf 1/1 2/2 3/3\n";
    shop.write("tree.obj", textured);
    shop.write("t.mtl", "newmtl m\nmap_Kd bark.png\n");
    shop.write("scene.toml", format!("{SCENE}[[mesh]]\nfile = 'tree.obj'\n"));
    shop.write("light.toml", format!("{SCENE}[environment]\nfile = 'bark.exr'\n"));
    shop.write(
        "scan.ply",
        "ply\nformat ascii 1.0\ncomment TextureFile bark.png\nelement vertex 3\nproperty float x\nproperty float y\n\
         property float z\nproperty float s\nproperty float t\nelement face 1\n\
         property list uchar int vertex_indices\nend_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n",
    );
    let positions = [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    shop.write("bark.bin", positions.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>());
    shop.write(
        "tree.gltf",
        r#"{"asset": {"version": "2.0"}, "buffers": [{"byteLength": 36, "uri": "bark.bin"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "images": [{"uri": "bark.png"}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0],
        "max": [1, 1, 0]}], "textures": [{"source": 0}], "nodes": [{"mesh": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}]}"#,
    );
    let image = image::RgbImage::from_fn(2, 2, |x, y| image::Rgb([200 * x as u8, 100 * y as u8, 50]));
    image.save(shop.path("bark.png")).expect("a picture");
    exr::prelude::write_rgb_file(shop.path("bark.exr"), 4, 2, |_, _| (0.5f32, 0.5f32, 0.5f32))
        .expect("a picture");
    shop
}

/// What the inputs refer to is known before the first picture is written.
#[test]
fn files_of_later_inputs_are_not_overwritten() {
    for (arguments, file) in [
        ("bark.obj tree.obj -o {name}.png", "bark.png"),
        ("tree.obj bark.obj -o {name}.png", "bark.png"),
        ("bark.obj scene.toml -o ./", "./bark.png"),
        ("bark.obj light.toml -o {name}.exr", "bark.exr"),
        ("bark.obj scan.ply -o {name}.png", "bark.png"),
        ("bark.obj tree.gltf -o {name}.png", "bark.png"),
        ("bark.obj tree.gltf -o x-{name}.png --stats {name}.bin", "bark.bin"),
        ("t.obj tree.obj -o x-{name}.png --stats {name}.mtl", "t.mtl"),
        ("bark.obj tree.obj -o {name}.png --shard 1/2", "bark.png"),
        ("bark.obj tree.obj -o {name}.png --skip-existing", "bark.png"),
    ] {
        let shop = referring();
        shop.write("t.obj", TRIANGLE);
        let before: Vec<_> = shop.names().into_iter().map(|name| (shop.bytes(&name), name)).collect();
        let (said, _) = shop.fail(&format!("render {arguments} --size 8x8 --samples 1"), 2);
        assert_eq!(said, format!("{file}: read as an input, and would be overwritten"), "{arguments}");
        let after: Vec<_> = shop.names().into_iter().map(|name| (shop.bytes(&name), name)).collect();
        assert!(before == after, "{arguments}");
    }
}

/// An input that cannot be read may refer to any picture; those that kiln made may be made again.
#[test]
fn files_of_broken_inputs_are_not_overwritten() {
    let shop = referring();
    shop.write("tree.obj", format!("v 0 0 none\n{TRIANGLE}"));
    let bark = shop.bytes("bark.png");
    let render = "render bark.obj tree.obj -o {name}.png --size 8x8 --samples 1";
    let (said, hint) = shop.fail(render, 2);
    assert!(said.starts_with("bark.png: may belong to an input that cannot be read (tree.obj:1: "), "{said}");
    assert_eq!(hint, "leave that input out, or give --output another folder");
    assert_eq!(shop.bytes("bark.png"), bark);
    std::fs::remove_file(shop.path("bark.png")).expect("it is there");
    for _ in 0..2 {
        let (_, said) = shop.code(render, 3);
        assert!(said.contains("1 of 2 pictures failed; wrote 1 picture(s)"), "{said}");
    }
}

/// A texture that is missing does not become a picture that the command has just written: the order of the inputs
/// changes no picture.
#[test]
fn pictures_of_a_command_are_not_read_by_it() {
    let mut pictures = Vec::new();
    for inputs in ["tree.obj bark.obj", "bark.obj tree.obj"] {
        let shop = referring();
        std::fs::remove_file(shop.path("bark.png")).expect("it is there");
        let said = shop.succeed(&format!("render {inputs} -o {{name}}.png --size 8x8 --samples 1"));
        assert!(said.contains("texture left out: "), "{said}");
        pictures.push(shop.pixels("tree.png").into_raw());
    }
    assert_eq!(pictures[0], pictures[1]);
    // A second time it is there, and read: it is not overwritten.
    let shop = referring();
    shop.fail("render tree.obj bark.obj -o {name}.png --size 8x8 --samples 1", 2);
}
