//! Outputs never overwrite a file that was read.

use std::path::Path;

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
