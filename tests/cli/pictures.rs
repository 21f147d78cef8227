//! Pictures that the command writes: formats, metadata, sizes, and what does not change them.

use serde_json::Value;

use crate::common::repository;
use crate::helpers::{SCENE, exr_pixels, metadata};
use crate::workshop::Workshop;

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

#[test]
fn a_picture_of_nothing_says_so() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.write("away.toml", SCENE.replace("look_at = [0, 0, 0]", "look_at = [0, 0, 20]"));
    let said = workshop.succeed("render away.toml -o a.png");
    // 24 x 16 pixels, one primary ray each.
    assert!(said.contains("nothing is in the picture: none of 384 primary rays hits anything"), "{said}");
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

/// The command of the entry for file managers, with their placeholders filled in.
#[test]
fn the_thumbnailer_makes_a_thumbnail() {
    let entry = std::fs::read_to_string(repository("assets/kiln.thumbnailer")).expect("an entry");
    let line = entry.lines().find_map(|line| line.strip_prefix("Exec=kiln ")).expect("a command");
    let workshop = Workshop::with("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let said = workshop.succeed(&line.replace("%i", "a.obj").replace("%o", "a.png").replace("%s", "64"));
    assert_eq!(said, "");
    assert_eq!(workshop.pixels("a.png").dimensions(), (64, 64));
}
