//! `kiln compare`, and `kiln render` to an error or a time, end to end.

use std::path::Path;

use crate::common::oversized_images;
use crate::workshop::Workshop;

/// A sphere before a grey background: edges, and a shading that varies.
const SCENE: &str = "
[image]
width = 64
height = 48
background = '#808080'
[[camera]]
position = [0, 0, 10]
look_at = [0, 0, 0]
[[light]]
type = 'point'
position = [5, 5, 10]
[material.red]
colour = '#f04030'
[[sphere]]
centre = [0, 0, 0]
radius = 2
material = 'red'
";

impl Workshop {
    fn json(&self, arguments: &str) -> serde_json::Value {
        serde_json::from_slice(&self.run(arguments).stdout).expect("JSON")
    }
}

/// An even picture with one pixel in another colour.
fn exr(file: &Path, size: usize, odd: [f32; 3]) {
    let pixel = |x, y| if (x, y) == (3, 2) { odd.into() } else { (0.5, 0.5, 0.5) };
    exr::prelude::write_rgb_file(file, size, size, pixel).expect("the picture is written");
}

/// An even PNG of 8 x 8 pixels, with an alpha channel or without.
fn png(file: &Path, colour: [u8; 3], alpha: Option<u8>) {
    let [r, g, b] = colour;
    match alpha {
        Some(alpha) => image::RgbaImage::from_pixel(8, 8, image::Rgba([r, g, b, alpha])).save(file),
        None => image::RgbImage::from_pixel(8, 8, image::Rgb(colour)).save(file),
    }
    .expect("the picture is written");
}

/// EXR of linear values, multiplied by alpha.
fn exr_with_alpha(file: &Path, value: f32, alpha: f32) {
    let value = value * alpha;
    exr::prelude::write_rgba_file(file, 8, 8, |_, _| (value, value, value, alpha)).expect("it is written");
}

#[test]
fn alpha_is_a_channel() {
    let shop = Workshop::with("scene.toml", SCENE);
    png(&shop.path("rgb.png"), [255, 0, 0], None);
    png(&shop.path("opaque.png"), [255, 0, 0], Some(255));
    png(&shop.path("half.png"), [255, 0, 0], Some(51));
    png(&shop.path("white.png"), [255; 3], Some(51));
    exr_with_alpha(&shop.path("white.exr"), 1.0, 0.2);
    exr_with_alpha(&shop.path("opaque.exr"), 1.0, 1.0);
    // An alpha of 255 equals no alpha channel.
    let same = shop.json("compare --json rgb.png opaque.png");
    assert_eq!((&same["verdict"], &same["errors"]["alpha"]), (&"same".into(), &serde_json::Value::Null));
    for (pair, values) in [("opaque.png half.png", "display"), ("opaque.exr white.exr", "linear")] {
        let (code, text, _) = shop.said(&format!("compare {pair}"));
        assert_eq!(code, 1, "{pair}");
        assert!(text.contains("of alpha (a fourth channel"), "{text}");
        let errors = shop.json(&format!("compare --json {pair}"))["errors"].clone();
        let figure = |name: &str| errors["figures"][name].as_f64().expect("a figure");
        assert_eq!(errors["values"], values);
        assert!((errors["alpha"].as_f64().expect("a figure") - 0.8).abs() < 1e-6, "{errors}");
        assert_eq!(figure("differing"), 1.0, "every pixel differs");
        assert!(figure("flip") > 0.05, "{errors}");
        assert!((figure("max") - 0.8).abs() < 1e-6, "{errors}");
        assert_eq!(shop.said(&format!("compare {pair} --fail-above max=0.5")).0, 2);
        assert_eq!(shop.said(&format!("compare {pair} --heat-map map.png")).0, 1);
        let map = image::open(shop.path("map.png")).expect("a picture").into_rgb8();
        assert_ne!(map.get_pixel(4, 4).0, [0, 0, 4], "the colour of no error");
    }
    // Of four channels alpha alone differs, by 0.8: sqrt(0.64 / 4) = 0.4.
    let errors = shop.json("compare --json opaque.png half.png")["errors"].clone();
    assert!((errors["figures"]["rmse"].as_f64().expect("a figure") - 0.4).abs() < 1e-6, "{errors}");
    // Colours of OpenEXR are multiplied by alpha, those of PNG are not; 51 / 255 = 0.2.
    let mixed = shop.json("compare --json white.png white.exr")["errors"].clone();
    assert_eq!(mixed["values"], "display");
    assert!(mixed["figures"]["max"].as_f64().expect("a figure") < 1e-6, "{mixed}");
    let different = shop.json("compare --json white.png opaque.exr")["errors"].clone();
    assert!((different["alpha"].as_f64().expect("a figure") - 0.8).abs() < 1e-6, "{different}");
}

#[test]
fn exit_codes_say_how_far_pictures_are_apart() {
    let shop = Workshop::with("scene.toml", SCENE);
    exr(&shop.path("a.exr"), 8, [0.5; 3]);
    // One channel of 3 * 64 is 1/2 off: RMSE sqrt(0.25 / 192) = 0.0361, one pixel of 64 differs: 0.0156.
    exr(&shop.path("b.exr"), 8, [0.5, 1.0, 0.5]);
    exr(&shop.path("small.exr"), 6, [0.5; 3]);
    exr(&shop.path("nan.exr"), 8, [0.5, f32::NAN, 0.5]);
    std::fs::write(shop.path("text.png"), "no picture").unwrap();

    assert!(shop.code("compare a.exr a.exr --fail-above max=0", 0).0.contains("all the same"));
    shop.code("compare a.exr b.exr", 1);
    shop.code(
        "compare a.exr b.exr --fail-above rmse=0.0362 --fail-above differing=0.016 --fail-above max=0.5",
        1,
    );
    let (_, said) = shop.code("compare a.exr b.exr --fail-above RMSE=0.0360 --fail-above max=0.6", 2);
    assert_eq!(said, "kiln: rmse is 0.036084, above the limit of 0.036\n");
    let (out, said) = shop.code("compare a.exr small.exr", 2);
    assert_eq!(
        (out.as_str(), said.lines().next()),
        ("", Some("kiln: error: sizes differ: 8 x 8 pixels against 6 x 6"))
    );
    let (out, _) = shop.code("compare a.exr nan.exr", 2);
    assert!(
        out.contains("not finite: 0 pixel(s) of the first and 1 of the second, the first at (3, 2)"),
        "{out}"
    );
    shop.code("compare nan.exr nan.exr", 2);
    for bad in ["missing.png", "text.png"] {
        assert!(shop.code(&format!("compare a.exr {bad}"), 3).1.contains(bad));
    }
    for bad in ["flip", "flip=x", "noise=1", "max=-1"] {
        shop.code(&format!("compare a.exr b.exr --fail-above {bad}"), 2);
    }
}

#[test]
fn json_has_every_figure_and_its_definition() {
    let shop = Workshop::with("scene.toml", SCENE);
    exr(&shop.path("a.exr"), 8, [0.5; 3]);
    exr(&shop.path("b.exr"), 8, [0.5, 1.0, 0.5]);
    exr(&shop.path("nan.exr"), 8, [f32::NAN; 3]);
    let report = shop.json("compare a.exr b.exr --json");
    assert_eq!(
        (&report["verdict"], &report["errors"]["values"]),
        (&"within_limits".into(), &"linear".into())
    );
    assert_eq!(report["errors"]["figures"]["max"], 0.5);
    assert_eq!(report["errors"]["figures"]["worst"][0]["x"], 3);
    assert_eq!(report["definitions"].as_object().map(|all| all.len()), Some(7));
    let report = shop.json("compare a.exr nan.exr --json");
    assert_eq!(
        (&report["verdict"], &report["errors"]["figures"]),
        (&"above_limits".into(), &serde_json::Value::Null)
    );
    // sRGB encodes 0.5 as 0.735357 and 1 as 1.
    let shown = shop.json("compare a.exr b.exr --json --display");
    assert!((shown["errors"]["figures"]["max"].as_f64().unwrap() - 0.264_643).abs() < 1e-6, "{shown}");
}

#[test]
fn heat_maps_are_hot_where_pictures_differ() {
    let shop = Workshop::with("scene.toml", SCENE);
    exr(&shop.path("a.exr"), 40, [0.5; 3]);
    exr(&shop.path("b.exr"), 40, [0.5, 1.0, 0.5]);
    shop.code("compare a.exr b.exr --heat-map heat.png", 1);
    let map = image::open(shop.path("heat.png")).unwrap().into_rgb8();
    let warmth = |x, y| map.get_pixel(x, y).0.iter().map(|&c| u32::from(c)).sum::<u32>();
    let hottest = map.enumerate_pixels().max_by_key(|(x, y, _)| warmth(*x, *y)).map(|(x, y, _)| (x, y));
    assert_eq!(hottest, Some((3, 2)));
    assert_eq!(map.get_pixel(39, 39).0, [0, 0, 4]);
    shop.code("compare a.exr b.exr --heat-map heat.jpg", 2);
}

/// How many samples the note says.
fn samples(said: &str) -> u32 {
    let before = said.split(
        [" sample a pixel", " samples a pixel"].into_iter().find(|name| said.contains(name)).expect("a note"),
    );
    let before = before.into_iter().next().expect("a note");
    before.rsplit(' ').next().and_then(|n| n.parse().ok()).unwrap_or_else(|| panic!("{said}"))
}

#[test]
fn accuracy_is_reached() {
    let shop = Workshop::with("scene.toml", SCENE);
    shop.code("render scene.toml -o truth.exr --samples 4096 --seed 9", 0);
    let mut counts = Vec::new();
    for (target, limit) in
        [("RMSE=0.01", "rmse=0.01"), ("RMSE=0.003", "rmse=0.003"), ("FLIP=0.005", "flip=0.005")]
    {
        let (_, said) = shop.code(&format!("render scene.toml -o a.exr --accuracy {target}"), 0);
        shop.code(&format!("compare truth.exr a.exr --display --fail-above {limit}"), 1);
        counts.push(samples(&said));
        shop.code(&format!("render scene.toml -o same.exr --accuracy {target}"), 0);
        assert_eq!(shop.run("compare same.exr a.exr").status.code(), Some(0), "{target}");
    }
    assert!(counts[0] < counts[1], "{counts:?}");
}

#[test]
fn a_loose_target_is_reached_by_two_samples() {
    let shop = Workshop::with("scene.toml", SCENE);
    shop.code("render scene.toml -o truth.exr --samples 1024 --seed 9", 0);
    let (_, said) = shop.code("render scene.toml -o a.exr --accuracy FLIP=0.2", 0);
    assert_eq!(samples(&said), 2, "{said}");
    shop.code("compare truth.exr a.exr --display --fail-above flip=0.2", 1);
}

#[test]
fn standard_input_is_no_picture() {
    let shop = Workshop::with("scene.toml", SCENE);
    let (_, said) = shop.code("compare - a.png", 2);
    assert!(said.contains("standard input"), "{said}");
}

#[test]
fn options_that_change_nothing_are_said_to() {
    let shop = Workshop::with("scene.toml", SCENE);
    for (options, idle) in [
        ("--min-samples 8 --samples 16", "--min-samples changes nothing"),
        ("--samples 4 --without antialiasing", "--samples changes nothing"),
        ("--noise 0.1 --without adaptive", "--noise changes nothing"),
    ] {
        for command in [
            "render scene.toml -o a.png",
            "render scene.toml --frames 0-1 -o f_#.png",
            "animate scene.toml --frames 0-1 -o f_#.jpg",
            "animate scene.toml --frames 0-1 -o a.y4m",
            "explain scene.toml",
        ] {
            let (_, said) = shop.code(&format!("{command} --size 8x8 {options}"), 0);
            assert!(said.contains(&format!("kiln: warning: {idle}")), "{command} {options}: {said}");
        }
    }
    for output in ["-o a.exr", "--frames 0-1 -o f_#.exr"] {
        let (_, said) = shop.code(&format!("render scene.toml --size 8x8 {output} --dither"), 0);
        assert!(said.contains("kiln: warning: --dither changes nothing"), "{output}: {said}");
    }
    // With one sample, the seed decides on random light.
    for options in ["--seed 3", "--seed 3 --transport path", "--noise 0.1 --min-samples 8"] {
        let (_, said) = shop.code(&format!("render scene.toml -o a.png {options}"), 0);
        assert!(!said.contains("changes nothing"), "{options}: {said}");
    }
}

#[test]
fn numbers_that_are_none_are_told_which_there_may_be() {
    let shop = Workshop::with("scene.toml", SCENE);
    for (options, wanted) in [
        ("--samples x", "give a number of samples from 1"),
        ("--samples -4", "give a number of samples from 1"),
        ("--threads 0.5", "give a whole number from 1 to 65535"),
        ("--seed -1", "give a whole number from 0 to 4294967295"),
        ("--noise much", "give a standard error"),
        ("--crop -1,0,4,4", "give it as X,Y,WIDTH,HEIGHT"),
        ("--size -8x8", "give a number of pixels"),
    ] {
        let (_, said) = shop.code(&format!("render scene.toml -o a.png {options}"), 2);
        assert!(said.contains(wanted), "{options}: {said}");
    }
}

#[test]
fn what_cannot_be_had_is_said() {
    let shop = Workshop::with("scene.toml", SCENE);
    let (_, said) = shop.code("render scene.toml -o a.png --accuracy FLIP=0.0001 --budget 0.05", 0);
    assert!(said.contains("kiln: warning: ") && said.contains("more do not fit into 0.05 s"), "{said}");
    let (_, said) = shop.code("render scene.toml -o a.png --budget 0.05", 0);
    assert!(said.contains("kiln: note: ") && samples(&said) >= 2, "{said}");
    for bad in [
        "--accuracy FLIP",
        "--budget -1",
        "--accuracy PSNR=1",
        "--accuracy RMSE=0",
        "--budget 0",
        "--budget 1 --samples 4",
        "--budget 1 --without antialiasing",
    ] {
        shop.code(&format!("render scene.toml -o b.png {bad}"), 2);
    }
}

/// A few hundred bytes must not make kiln allocate gigabytes.
#[test]
fn sizes_in_headers_are_checked_before_memory_is_allocated() {
    let shop = Workshop::with("scene.toml", SCENE);
    exr(&shop.path("a.exr"), 8, [0.5; 3]);
    std::fs::write(shop.path("large.exr"), oversized_images::exr(60_000, 60_000, &["B", "G", "R"])).unwrap();
    std::fs::write(shop.path("large.png"), oversized_images::png(60_000, 60_000)).unwrap();
    std::fs::write(shop.path("wide.png"), oversized_images::png(i32::MAX as u32, 1)).unwrap();
    for (name, size) in
        [("large.exr", "60000 x 60000"), ("large.png", "60000 x 60000"), ("wide.png", "2147483647 x 1")]
    {
        for pair in [format!("{name} a.exr"), format!("a.exr {name}")] {
            let (_, said) = shop.code(&format!("compare {pair}"), 3);
            let start = format!("kiln: error: {name}: a picture of {size} pixels needs ");
            assert!(said.starts_with(&start), "{said}");
            assert!(said.contains(" of memory; the limit for sizes in a file is 4.0 GiB\nhint: "), "{said}");
        }
    }
    // The limit can be raised, and lowered: 8,192 bytes of pixels a side are 64 MiB and more.
    let (_, said) = shop.code("compare large.exr a.exr --memory-limit 8T", 3);
    assert!(!said.contains("sizes in a file"), "{said}");
    std::fs::write(shop.path("small.png"), oversized_images::png(4096, 4096)).unwrap();
    let (_, said) = shop.code("compare small.png a.exr --memory-limit 128M", 3);
    assert!(said.contains("of 128 MiB are left (--memory-limit)"), "{said}");
}
