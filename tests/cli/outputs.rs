//! Outputs never overwrite a file that was read.

use std::path::Path;

#[cfg(target_os = "linux")]
use crate::helpers::check_error;
use crate::workshop::{Workshop, text};

const OBJ: &str = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 3/3 2/2\n";

const SCENE: &str = "
[image]
width = 8
height = 8
[[camera]]
position = [0, 0, 5]
look_at = [0, 0, 0]
[[light]]
type = 'point'
position = [5, 5, 10]
[[mesh]]
file = 'm.obj'
";

/// The files that are read.
const INPUTS: [&str; 6] = ["scene.toml", "m.obj", "m.mtl", "t.png", "t_0001.png", "e.exr"];

fn workshop() -> Workshop {
    let shop = Workshop::with("scene.toml", SCENE);
    shop.write("m.obj", OBJ);
    shop.write("m.mtl", "newmtl a\nmap_Kd t.png\nnewmtl b\nmap_Kd t_0001.png\n");
    for name in ["t.png", "t_0001.png"] {
        let image = image::RgbImage::from_pixel(2, 2, image::Rgb([200, 100, 50]));
        image.save(shop.path(name)).expect("the picture is written");
    }
    exr::prelude::write_rgb_file(shop.path("e.exr"), 4, 2, |_, _| (0.5f32, 0.5f32, 0.5f32))
        .expect("it is written");
    std::fs::create_dir(shop.path("sub")).expect("a folder");
    std::fs::create_dir(shop.path("study")).expect("a folder");
    std::fs::hard_link(shop.path("t.png"), shop.path("hard.png")).expect("a link");
    std::fs::hard_link(shop.path("m.obj"), shop.path("study/study.csv")).expect("a link");
    #[cfg(unix)]
    std::os::unix::fs::symlink("t.png", shop.path("soft.png")).expect("a link");
    shop
}

#[test]
fn what_was_read_is_not_overwritten() {
    let shop = workshop();
    let before = INPUTS.map(|name| shop.bytes(name));
    let mut commands = vec![
        "render scene.toml -o a.png --stats scene.toml",
        "render scene.toml -o a.png --stats m.obj",
        "render m.obj -o a.png --stats m.mtl",
        "render scene.toml -o t.png",
        "render m.obj -o ./t.png",
        "render m.obj -o sub/../t.png",
        "render m.obj -o hard.png",
        "render m.obj -o e.exr --environment e.exr",
        "render m.obj -o a.png --stats e.exr --environment e.exr",
        "render m.obj -o t_####.png --frames 0-2",
        "render m.obj -o t.png --frames 1",
        "animate m.obj -o t_%04d.png --frames 0-2",
        "animate m.obj -o t.png --frames 0-1",
        "compare t.png hard.png --heat-map t.png",
        "compare t.png t_0001.png --heat-map hard.png",
        "bench m.obj --page m.obj",
        "bench price m.obj --plot t.png",
        "study m.obj -o study",
    ];
    #[cfg(unix)]
    commands.extend(["render m.obj -o soft.png", "animate m.obj -o soft.png --frames 0-1"]);
    for arguments in commands {
        let arguments = match arguments.split(' ').next() {
            Some("render" | "animate") => format!("{arguments} --size 8x8 --samples 1"),
            _ => arguments.to_owned(),
        };
        let output = shop.run(&arguments);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {said}");
        assert!(said.contains(": read as an input, and would be overwritten\n"), "{arguments}: {said}");
        assert!(output.stdout.is_empty(), "{arguments}: before the results");
        for (name, before) in INPUTS.iter().zip(&before) {
            assert_eq!(&shop.bytes(name), before, "{arguments}: {name}");
        }
        assert!(!Path::new(&shop.path("a.png")).exists(), "{arguments}: before the picture is rendered");
    }
}

/// Every command writes what a symbolic link leads to, here over two links to a file that does not exist, and keeps the
/// link. Two outputs of a command through links to one file are refused.
#[cfg(unix)]
#[test]
fn links_are_written_through() {
    let shop = workshop();
    let small = "--size 8x8 --samples 1";
    for (arguments, ending) in [
        (format!("render m.obj -o link {small}"), "png"),
        (format!("render m.obj -o link {small}"), "jpg"),
        (format!("render m.obj -o link {small}"), "exr"),
        (format!("render m.obj -o a.png --stats link {small}"), "json"),
        (format!("render m.obj -o link --frames 0 {small}"), "png"),
        ("animate m.obj -o link --frames 0-1 --size 16x16 --samples 1".into(), "gif"),
        ("animate m.obj -o link --frames 0-1 --size 16x16 --samples 1".into(), "apng"),
        ("compare a.png a.png --heat-map link".into(), "png"),
        ("bench m.obj --page link --runs 1 --size 16 --engine kiln/bvh8/exact".into(), "html"),
    ] {
        let (link, target) = (format!("link.{ending}"), format!("sub/target.{ending}"));
        let _ = (std::fs::remove_file(shop.path(&link)), std::fs::remove_file(shop.path("sub/next")));
        std::os::unix::fs::symlink("sub/next", shop.path(&link)).expect("a link");
        std::os::unix::fs::symlink(format!("target.{ending}"), shop.path("sub/next")).expect("a link");
        let arguments = arguments.replace("link", &link);
        for _ in 0..2 {
            shop.succeed(&arguments);
            assert!(shop.path(&link).is_symlink() && shop.path("sub/next").is_symlink(), "{arguments}");
            assert!(!shop.path(&target).is_symlink() && !shop.bytes(&target).is_empty(), "{arguments}");
        }
        std::fs::remove_file(shop.path(&target)).expect("it was written");
    }
    std::os::unix::fs::symlink("loop.png", shop.path("loop.png")).expect("a link");
    let (said, _) = shop.fail(&format!("render m.obj -o loop.png {small}"), 4);
    assert_eq!(said, "loop.png: is a symbolic link that leads to itself; name a file");
    std::os::unix::fs::symlink("same.png", shop.path("p-m.png")).expect("a link");
    std::os::unix::fs::symlink("same.png", shop.path("p-scene.png")).expect("a link");
    let (said, _) = shop.fail("render m.obj scene.toml -o p-{name}.png", 2);
    assert!(
        said.starts_with("m.obj and scene.toml would be written to p-m.png and p-scene.png: one file, "),
        "{said}"
    );
}

/// A process that was killed, or one that runs, has left files: later commands name them in a note and keep them.
#[test]
fn unfinished_files_are_named_and_kept() {
    let shop = workshop();
    shop.write("sub/.kiln-abc.part", "a");
    shop.write("sub/.kiln-abd.part", "b");
    for arguments in [
        "render m.obj -o sub/a.png",
        "render m.obj scene.toml -o sub/{name}.png",
        "render m.obj -o sub/a_#.png --frames 0-1",
        "render m.obj -o a.png --stats sub/a.json",
        "animate m.obj -o sub/a.gif --frames 0-1",
    ] {
        let said = shop.succeed(&format!("{arguments} --size 8x8 --samples 1"));
        let notes: Vec<_> = said.lines().filter(|line| line.contains(".part")).collect();
        let note = "kiln: note: sub/.kiln-abc.part and 1 more: unfinished output of another process; ";
        assert!(matches!(notes[..], [only] if only.starts_with(note)), "{arguments}: {said}");
    }
    assert_eq!(
        (shop.bytes("sub/.kiln-abc.part"), shop.bytes("sub/.kiln-abd.part")),
        (b"a".into(), b"b".into())
    );
    shop.succeed("render m.obj -o a.png --size 8x8 --samples 1 --progress none");
}

/// A file that cannot grow, here by a limit of 512 or 1024 bytes: each writer says so in one line without the name of
/// its temporary file, which is gone. `tests/farm/full-disk` has a full disk.
#[cfg(target_os = "linux")]
#[test]
fn writers_say_what_stops_them() {
    let shop = workshop();
    let kiln = assert_cmd::cargo::cargo_bin!("kiln").display().to_string();
    let names = shop.names();
    let small = "--size 256x256 --samples 1 --progress none";
    for arguments in [
        format!("render scene.toml -o a.png {small}"),
        format!("render scene.toml -o a.jpg {small}"),
        format!("render scene.toml -o a.exr {small}"),
        format!("render scene.toml -o a.png --shard 1/2 {small}"),
        format!("render scene.toml -o a_#.png --frames 0 {small}"),
        "render scene.toml -o - --stats a.json --size 8x8 --progress none".into(),
        format!("animate m.obj -o a.gif --frames 0-3 {small}"),
        format!("animate m.obj -o a.png --frames 0-3 {small}"),
        format!("animate m.obj -o a.y4m --frames 0-3 {small}"),
        #[cfg(feature = "video")]
        format!("animate m.obj -o a.mp4 --frames 0-3 {small}"),
        "bench m.obj --page a.html --runs 1 --size 16 --engine kiln/bvh8/exact".into(),
    ] {
        // Rust does not ignore the signal of the limit.
        let shell = format!("trap '' XFSZ; ulimit -f 1; exec '{kiln}' {arguments} >/dev/null");
        let mut command = std::process::Command::new("sh");
        let output = command.current_dir(shop.0.path()).args(["-c", &shell]).output().expect("it starts");
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(4), "{arguments}: {said}");
        let (error, _) = check_error(&said);
        assert!(error.ends_with(": cannot be written: File too large"), "{arguments}: {said}");
        assert_eq!(shop.names(), names, "{arguments}");
    }
    for arguments in [
        "render scene.toml -o - --size 8x8 --progress none",
        "info m.obj --json",
        "animate m.obj -o - --frames 0 --size 16x16 --progress none",
    ] {
        let mut command = shop.command(arguments);
        let full = std::fs::File::options().write(true).open("/dev/full").expect("a device");
        let output = command.stdout(full).output().expect("it starts");
        let said = text(&output.stderr);
        assert_eq!(
            (output.status.code(), check_error(&said).0),
            (Some(4), "-: cannot be written: the disk is full")
        );
    }
}

#[test]
fn outputs_may_replace_outputs() {
    let shop = workshop();
    for _ in 0..2 {
        shop.succeed("render scene.toml -o a.png --stats a.json");
        shop.succeed("render scene.toml -o a.png --skip-existing");
        shop.succeed("render m.obj -o f_##.png --frames 0-1 --size 8x8 --samples 1 --skip-existing");
        shop.succeed("compare a.png t.png --heat-map map.png".replace("t.png", "a.png").as_str());
    }
}
