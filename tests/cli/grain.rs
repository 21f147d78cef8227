//! Grain: noise differs from frame to frame, depends on the exact time alone, and stays the same with `--same-grain`.

use serde_json::json;

use crate::common::gltf::Model;
use crate::workshop::Workshop;

/// A ball that stands still under a sky: only noise differs from frame to frame.
const STILL: &str = "[image]\nwidth = 24\nheight = 16\ntransport = 'path'\nsamples = 2\n\
    [[camera]]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\n[material.m]\ncolour = '#808080'\n\
    [[sphere]]\nname = 'ball'\ncentre = [0, 0, 0]\nradius = 1\nmaterial = 'm'\n[environment]\nsky = true\n\
    [animation]\nfps = 2\nduration = 2\n[[animation.track]]\nobject = 'ball'\nlerp = { to = [0, 0, 0] }\n";

fn pixels(workshop: &Workshop, name: &str) -> Vec<u8> {
    image::open(workshop.path(name)).unwrap_or_else(|e| panic!("{name}: {e}")).to_rgb8().into_raw()
}

/// Frame 0 has the grain of the picture, each further frame another one; alone, in a shard of the frames and as tiles, a
/// frame has the same bytes as among others.
#[test]
fn each_frame_has_its_own_grain() {
    let workshop = Workshop::with("scene.toml", STILL);
    workshop.succeed("render scene.toml -o still.png");
    workshop.succeed("render scene.toml --frames 0-4 -o f_##.png --threads 3");
    let frames: Vec<Vec<u8>> = (0..5).map(|i| pixels(&workshop, &format!("f_0{i}.png"))).collect();
    assert!(frames[0] == pixels(&workshop, "still.png"));
    for (i, j) in (0..5).flat_map(|j| (0..j).map(move |i| (i, j))) {
        let different = frames[i].iter().zip(&frames[j]).filter(|(a, b)| a != b).count();
        // Most pixels see the ball or the sky between their pixel's edges.
        assert!(different * 4 > frames[0].len(), "frames {i} and {j}: {different}");
    }
    workshop.succeed("render scene.toml --frames 3 -o alone.png --threads 1");
    workshop.succeed("animate scene.toml --frames 3 -o alone_##.png");
    workshop.succeed("render scene.toml --frames 0-4 --shard 4/5 -o shard_##.png");
    for name in ["alone.png", "alone_03.png", "shard_03.png"] {
        assert!(workshop.bytes(name) == workshop.bytes("f_03.png"), "{name}");
    }
    workshop.succeed("render scene.toml --frames 3 -o crop.png --crop 5,3,11,9");
    let whole = image::open(workshop.path("f_03.png")).expect("a picture").to_rgb8();
    let crop = image::imageops::crop_imm(&whole, 5, 3, 11, 9).to_image();
    assert!(crop.into_raw() == pixels(&workshop, "crop.png"));
    // The time of a frame decides, not its number: frame 2 at 4 fps is frame 1 at 2 fps.
    workshop.succeed("render scene.toml --frames 2 --fps 4 -o fast.png");
    assert!(pixels(&workshop, "fast.png") == frames[1]);
}

/// With `--same-grain` a scene that stands still has the same frames, those of time 0. The option is part of the
/// fingerprint.
#[test]
fn same_grain_keeps_the_noise() {
    let workshop = Workshop::with("scene.toml", STILL);
    workshop.succeed("render scene.toml -o still.png");
    workshop.succeed("render scene.toml --frames 0-2 --same-grain -o f_##.png");
    for i in 0..3 {
        assert!(pixels(&workshop, &format!("f_0{i}.png")) == pixels(&workshop, "still.png"), "frame {i}");
    }
    workshop.code("verify scene.toml --frames 0-2 --same-grain -o f_##.png", 0);
    workshop.code("verify scene.toml --frames 0-2 -o f_##.png", 1);
    let said = workshop.succeed("render scene.toml --frames 0-2 -o f_##.png --skip-existing");
    assert!(said.contains("wrote 3 frame(s)"), "{said}");
    workshop.write("own.toml", STILL.replace("[image]", "[image]\nsame_grain = true"));
    workshop.succeed("render own.toml --frames 2 -o own.png");
    assert!(pixels(&workshop, "own.png") == pixels(&workshop, "still.png"));
    let said = workshop.succeed("render scene.toml --same-grain -o a.png");
    assert!(said.contains("--same-grain changes nothing in a picture at time 0"), "{said}");
}

/// A turntable of a scene that stands still, and a seed, change the grain as well.
#[test]
fn turntables_and_seeds_have_grain_of_their_own() {
    let workshop = Workshop::with("scene.toml", STILL.split("[animation]").next().expect("a scene"));
    // A sphere before a uniform sky looks the same from all sides.
    let scene = String::from_utf8(workshop.bytes("scene.toml")).expect("text");
    workshop.write("scene.toml", scene.replace("sky = true", "colour = '#8090a0'"));
    let animate = "animate scene.toml --duration 1 --fps 4";
    workshop.succeed(&format!("{animate} -o f_##.png"));
    workshop.succeed(&format!("{animate} -o g_##.png --same-grain"));
    workshop.succeed(&format!("{animate} -o h_##.png --seed 5"));
    assert!(pixels(&workshop, "f_00.png") == pixels(&workshop, "g_00.png"));
    for i in 1..4 {
        let [f, g, h] = ["f", "g", "h"].map(|name| pixels(&workshop, &format!("{name}_0{i}.png")));
        assert!(f != g && f != h && g != h, "frame {i}");
    }
}

/// GLB of a triangle that a clip moves for 1.5 seconds.
fn clip() -> Vec<u8> {
    let mut model = Model::triangle();
    let (times, places) = (model.floats(&[[0.0], [1.5]]), model.floats(&[[0.0; 3], [0.7, 0.3, 0.0]]));
    model.json["animations"] = json!([{
        "samplers": [{ "input": times, "output": places }],
        "channels": [{ "sampler": 0, "target": { "node": 0, "path": "translation" } }],
    }]);
    model.binary()
}

/// Frame 9 of a clip at 30 frames per second is the picture of `--time 0.3`, pose and grain. 9 / 45 * 1.5, the part of the
/// clip times its length, is the next f64, 0.30000000000000004.
#[test]
fn frame_n_of_a_clip_is_the_picture_at_n_over_fps() {
    assert_eq!((9.0f64 / 45.0 * 1.5).to_string(), "0.30000000000000004");
    let workshop = Workshop::with("clip.glb", clip());
    let options = "--size 24x16 --transport path --samples 2 --camera {position=[0,0,6],look_at=[0,0,0]} --exposure 0 --ground=false";
    workshop.succeed(&format!("render clip.glb {options} --frames 9 -o frame.png"));
    workshop.succeed(&format!("render clip.glb {options} --time 0.3 -o still.png"));
    assert!(pixels(&workshop, "frame.png") == pixels(&workshop, "still.png"));
    // The next f64 has other grain.
    workshop.succeed(&format!("render clip.glb {options} --time 0.30000000000000004 -o near.png"));
    assert!(pixels(&workshop, "near.png") != pixels(&workshop, "still.png"));
    workshop.succeed(&format!("render clip.glb {options} --time 0.30000000000000004 --same-grain -o a.png"));
    workshop.succeed(&format!("render clip.glb {options} --time 0.3 --same-grain -o b.png"));
    assert!(pixels(&workshop, "a.png") == pixels(&workshop, "b.png"));
    // A clip that has ended has the same pose at all times, and a fingerprint of each.
    workshop.succeed(&format!("render clip.glb {options} --time 2 -o end.png"));
    let said = workshop.succeed(&format!("render clip.glb {options} --time 3 -o end.png --skip-existing"));
    assert!(said.contains("wrote"), "{said}");
}
