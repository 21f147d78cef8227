//! Limits of memory and of what files hold.

use std::process::Command;

use crate::helpers::{SCENE, check_error};
use crate::workshop::{Workshop, text};

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
    let (code, said) = limited("render scene.toml --size 4800x4800 --aov all -o a.exr --progress none");
    assert_eq!(code, Some(1), "{said}");
    let (line, hint) = check_error(&said);
    assert!(
        line.starts_with("a picture of 4800 x 4800 pixels with ") && line.contains(" more channels needs "),
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

/// 3,000 stacks of 2 MiB do not fit into 2.9 GiB.
#[cfg(target_os = "linux")]
#[test]
fn threads_that_cannot_be_started_are_an_error() {
    let shop = Workshop::with("scene.toml", SCENE);
    let kiln = assert_cmd::cargo::cargo_bin!("kiln").display().to_string();
    for arguments in [
        "render scene.toml -o a.png",
        "render scene.toml -o a_#.png --frames 0",
        "animate scene.toml -o a.gif",
        "study scene.toml -o a",
        "bench",
    ] {
        let shell = format!("ulimit -v 3000000; exec '{kiln}' {arguments} --threads 3000");
        let output = Command::new("sh").current_dir(shop.0.path()).args(["-c", &shell]).output();
        let output = output.expect("the command starts");
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments}: {said}");
        let (line, hint) = check_error(&said);
        assert_eq!(line, "the system cannot start that many threads", "{arguments}");
        assert!(hint.starts_with("give a smaller number as --threads, or "), "{hint}");
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
    // bytes, in the film and twice in the writer, there with a second channel of the depth, and 3 bytes while the AOV is
    // computed, are 3.52 GiB.
    for (aovs, needs) in [("depth", "with 1 more channels needs 3.5 GiB"), ("effects", "")] {
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

/// Many objects: refused where they do not fit, before they are made. 300,000 groups take more than 700 bytes each,
/// 200 MiB, of the 192 MiB that 256M leave.
#[cfg(target_os = "linux")]
#[test]
fn objects_that_do_not_fit_are_refused() {
    let groups = |count: usize| {
        let group = |i: usize| format!("g {i}\nf 1 2 3\n");
        "v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_owned() + &(0..count).map(group).collect::<String>()
    };
    let shop = Workshop::with("many.obj", groups(300_000));
    shop.write("few.obj", groups(20_000));
    for command in ["info", "info --json", "render -o a.png"] {
        let (said, hint) = shop.fail(&format!("{command} many.obj --memory-limit 256M"), 3);
        assert!(said.starts_with("many.obj: reading its meshes needs "), "{said}");
        assert!(hint.ends_with("give --memory-limit 2G"), "{hint}");
    }
    shop.succeed("info few.obj --memory-limit 256M");
    // 20,000 x 4,200 bytes are 80 MiB.
    let (said, hint) = shop.fail("info few.obj --json --memory-limit 128M", 1);
    assert!(said.starts_with("the JSON of 20000 objects needs 81 MiB of memory; "), "{said}");
    assert!(hint.starts_with("leave --json out, or "), "{hint}");
}

/// Lists of 100,000 entries are read in a second; where an entry looks at all others, they take minutes.
#[test]
fn long_lists_are_read_in_linear_time() {
    const COUNT: usize = 100_000;
    let lines = |line: &dyn Fn(usize) -> String| (0..COUNT).map(line).collect::<String>();
    let vertices = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
    let elements = lines(&|i| format!("element e{i} 0\n"));
    let faces =
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let shop = Workshop::with("a.ply", format!("ply\nformat ascii 1.0\n{vertices}{elements}{faces}"));
    let cameras =
        lines(&|i| format!("[[camera]]\nname = '{i}'\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\n"));
    shop.write("cameras.toml", SCENE.to_owned() + &cameras);
    let lamp = |i: usize| format!("[[light]]\nname = '{}'\ntype = 'point'\nposition = [0, 0, 5]\n", i / 2);
    shop.write("lights.toml", SCENE.to_owned() + &lines(&lamp));
    let track = |_: usize| {
        "[[animation.track]]\nobject = 'ball'\nproperty = 'position'\nkeyframes = [[0, [0, 0, 0]]]\n"
            .to_owned()
    };
    shop.write("tracks.toml", SCENE.to_owned() + &lines(&track));
    shop.write("keys.toml", lines(&|i| format!("k{i} = 1\n")));
    // Each node of a chain has the last one as its second child.
    let node = |i: usize| format!("{{\"children\": [{}, {COUNT}]}}, ", i + 1);
    let nodes = (0..COUNT - 1).map(node).collect::<String>();
    shop.write(
        "chain.gltf",
        format!(
            r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0]}}], "nodes": [{nodes}{{}}, {{}}]}}"#
        ),
    );
    for (file, code) in [
        ("a.ply", 0),
        ("cameras.toml", 0),
        ("lights.toml", 0),
        ("tracks.toml", 0),
        ("keys.toml", 3),
        ("chain.gltf", 3),
    ] {
        shop.code(&format!("info {file}"), code);
    }
}
