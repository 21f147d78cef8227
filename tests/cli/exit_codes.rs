//! Exit codes of the command, and the form of its errors.

use serde_json::json;

use crate::common::gltf::Model;
use crate::helpers::{SCENE, check_error};
use crate::workshop::{Workshop, text};

#[test]
fn wrong_usage_is_2() {
    let workshop = Workshop::with("scene.toml", SCENE);
    for (arguments, error, hint) in [
        ("", "no command given", "--help"),
        ("rendr scene.toml", "unrecognized subcommand 'rendr'", "render"),
        ("render", "required arguments", ""),
        ("render scene.toml", "required arguments were not provided: --output <OUT>", ""),
        ("render scene.toml -o a.png --siz 3x3", "unexpected argument '--siz'", "--size"),
        ("render scene.toml -o a.png --size three", "give it as WIDTHxHEIGHT, such as 640x480", ""),
        ("render scene.toml -o a.png --size 0x5", "give a number of pixels from 1 to 65535", ""),
        ("render scene.toml -o a.png --crop 1,2,3", "give it as X,Y,WIDTH,HEIGHT", ""),
        ("render scene.toml -o a.png --threads 0", "invalid value '0'", ""),
        ("render scene.toml -o a.png --view side", "invalid value 'side'", "possible values"),
        ("render scene.toml -o a.png --shading fong", "invalid value 'fong'", "phong"),
        (
            "render scene.toml -o a.png --view iso --camera front",
            "both --camera and --view",
            "one of the two",
        ),
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
        said.contains("nothing is in the picture: the scene has no triangles, spheres or disks\n"),
        "{said}"
    );
    assert_eq!(workshop.pixels("a.png").get_pixel(3, 3).0, [0x10, 0x20, 0x30]);
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

#[test]
fn outputs_that_cannot_be_written_are_4() {
    let workshop = Workshop::with("scene.toml", SCENE);
    std::fs::create_dir(workshop.path("folder.png")).expect("a folder can be made");
    let (said, _) = workshop.fail("render scene.toml -o gone/a.png", 4);
    assert_eq!(said, "gone/a.png: cannot be written: its folder does not exist; make it with mkdir -p gone");
    let (said, _) = workshop.fail("render scene.toml -o folder.png", 4);
    assert_eq!(said, "folder.png: is a folder; name a file in it");
    let (said, _) = workshop.fail("render scene.toml -o a.png --stats gone/a.json", 4);
    assert_eq!(said, "gone/a.json: cannot be written: its folder does not exist; make it with mkdir -p gone");
    // These errors are reported before anything is read or rendered.
    assert_eq!(workshop.names(), ["folder.png", "scene.toml"]);
}

#[test]
fn strict_makes_warnings_1() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.write("a.obj", "mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let said = workshop.succeed("render a.obj -o a.png --size 8x8");
    assert!(said.contains("kiln: warning: a.obj: materials left out: gone.mtl: no such file\n"), "{said}");
    // That light is added is so at every picture of a mesh: `info` says it. A flat shape gets neither ground nor background.
    assert!(!said.contains("no light"), "{said}");
    let note = "no light and no camera in the files: light is added; --draft uses a headlight instead\n";
    let info = workshop.run("info a.obj");
    assert!(String::from_utf8_lossy(&info.stdout).contains(note), "{info:?}");
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
