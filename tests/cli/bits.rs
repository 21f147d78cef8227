//! Bits per channel and dithering of picture files: PNG of 16 bits against OpenEXR, in all commands that read it; errors
//! of formats that lack them; dithering by position.

use glam::DVec3;
use kiln::film::read::read_picture;
use kiln::film::rounding::{bits_of_pixel, dither, quantise};
use kiln::film::tone::ToneMap;
use kiln::film::{ColourPipeline, DisplayTransform};

use crate::common::repository;
use crate::workshop::Workshop;

/// A ball of a dark gradient, before a transparent background, with soft edges.
const BALL: &str = "[image]\nwidth = 40\nheight = 24\nbackground = 'transparent'\nsamples = 16\nfilter = 'box'\n\
    [[camera]]\nposition = [0, 0, 8]\nlook_at = [0, 0, 0]\n[[light]]\ntype = 'directional'\ndirection = [-1, -1, -2]\n\
    [material.m]\ncolour = '#403020'\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 2\nmaterial = 'm'\n";

/// Type and values of a PNG, also those of the channels that others decode.
fn png(workshop: &Workshop, name: &str) -> image::DynamicImage {
    image::open(workshop.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Every value of a PNG of 16 bits is that of the EXR after exposure, tone map and transfer function, rounded to 1/65535.
/// Colours are those divided by alpha.
#[test]
fn sixteen_bits_are_the_values_of_the_exr() {
    let workshop = Workshop::with("scene.toml", BALL);
    let display = "--exposure 1 --tone-map agx";
    for (pipeline, options, transform) in [
        (ColourPipeline::Linear, display.to_owned(), DisplayTransform::new(1.0, ToneMap::Agx)),
        (ColourPipeline::Linear, String::new(), DisplayTransform::default()),
        (ColourPipeline::Display, String::new(), DisplayTransform::default()),
    ] {
        let options = format!("{options} --colour {}", pipeline.name());
        // `display` has the kept colours of an unlit background; there is none here.
        for background in ["transparent", "#000000"] {
            let options = format!("{options} --background {background}");
            workshop.succeed(&format!("render scene.toml {options} -o a.exr"));
            workshop.succeed(&format!("render scene.toml {options} --bits 16 -o a.png"));
            let exr = read_picture(&workshop.path("a.exr")).expect("a picture");
            let alpha = exr.alpha.unwrap_or_else(|| vec![1.0; exr.values.len()]);
            let expected = exr.values.iter().zip(&alpha).map(|(colour, &alpha)| {
                let straight = if alpha > 0.0 { colour.map(|c| c / alpha) } else { [0.0; 3] };
                let shown = transform.displayed(pipeline, DVec3::from(straight.map(f64::from)));
                let [r, g, b] = shown.to_array().map(quantise::<u16>);
                [r, g, b, quantise(alpha.into())]
            });
            let expected: Vec<[u16; 4]> = expected.collect();
            let found = png(&workshop, "a.png");
            assert_eq!(found.color().has_alpha(), background == "transparent", "{options}");
            assert_eq!(found.color().bytes_per_pixel(), if background == "transparent" { 8 } else { 6 });
            let found: Vec<[u16; 4]> = found.into_rgba16().pixels().map(|pixel| pixel.0).collect();
            assert!(found == expected, "{options}");
            assert!(found.iter().any(|pixel| pixel[0] % 257 != 0), "{options}");
        }
    }
}

/// The pipeline `u8` rounds to 8 bits in each step, so that its values are multiples of 257 = 65535 / 255: those of the
/// PNG of 8 bits.
#[test]
fn sixteen_bits_of_the_pipeline_u8_are_multiples_of_257() {
    let workshop = Workshop::with("none", "");
    let scene = repository("scenes/assignment.toml").display().to_string();
    let render = format!("render {scene} --size 96x54 --colour u8");
    workshop.succeed(&format!("{render} -o a.png"));
    workshop.succeed(&format!("{render} --bits 16 -o b.png"));
    let [narrow, wide] = ["a.png", "b.png"].map(|name| png(&workshop, name));
    assert_eq!((narrow.color(), wide.color()), (image::ColorType::Rgb8, image::ColorType::Rgb16));
    let (narrow, wide) = (narrow.into_rgb8().into_raw(), wide.into_rgb16().into_raw());
    assert!(narrow.iter().zip(&wide).all(|(&a, &b)| u16::from(a) * 257 == b));
    assert!(narrow.iter().any(|&c| c > 0));
}

/// A picture of 16 bits is compared in 16 bits, skipped, verified and merged as one of 8 bits.
#[test]
fn commands_read_sixteen_bits() {
    let workshop = Workshop::with("scene.toml", BALL);
    let render = "render scene.toml --bits 16 --dither -o a.png";
    workshop.succeed(render);
    let whole = workshop.bytes("a.png");
    assert!(workshop.succeed(&format!("{render} --skip-existing")).contains("exists with"));
    assert!(workshop.succeed("render scene.toml -o a.png --skip-existing").contains("wrote"));
    workshop.succeed(render);
    assert!(workshop.code("verify scene.toml --bits 16 --dither -o a.png", 0).0.contains("1 of 1 valid"));
    workshop.code("verify scene.toml --bits 16 -o a.png", 1);
    for shard in 1..=3 {
        workshop.succeed(&format!("{render} --shard {shard}/3"));
    }
    workshop.succeed("merge a.1of3.shard a.2of3.shard a.3of3.shard -o merged.png");
    assert!(workshop.bytes("merged.png") == whole);
    // One step of one channel of one pixel: 1/65535.
    let mut other = png(&workshop, "a.png").into_rgba16();
    workshop.code("compare a.png merged.png", 0);
    other.get_pixel_mut(20, 12).0[1] += 1;
    other.save(workshop.path("other.png")).expect("a picture");
    let (report, _) = workshop.code("compare a.png other.png --json", 1);
    let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    let most = report["errors"]["figures"]["max"].as_f64().expect("a number");
    // Differences of f32 values below 1 are within 2^-24.
    assert!((most - 1.0 / 65535.0).abs() <= 2f64.powi(-24), "{most}");
}

#[test]
fn formats_say_which_bits_they_have() {
    let workshop = Workshop::with("scene.toml", BALL.replace("background = 'transparent'\n", ""));
    let animated = "[animation]\nfps = 2\nduration = 1\n";
    workshop.write("film.toml", format!("{BALL}{animated}").replace("background = 'transparent'\n", ""));
    for (arguments, message) in [
        ("render scene.toml -o a.jpg --bits 16", ".jpg has 8 bits per channel, not 16"),
        ("render scene.toml -o a.png --bits 32", ".png has 8 or 16 bits per channel, not 32"),
        ("render scene.toml -o - --bits 32", ".png has 8 or 16 bits per channel, not 32"),
        ("render scene.toml -o a.exr --bits 8", ".exr has 16 or 32 bits per channel, not 8"),
        ("render film.toml -o f_##.jpg --frames 0-1 --bits 16", ".jpg has 8 bits per channel, not 16"),
        ("animate film.toml -o a.gif --bits 16", "a film has 8 bits per channel, not 16"),
        ("animate film.toml -o a.mp4 --bits 16", "a film has 8 bits per channel, not 16"),
        ("animate film.toml -o - --bits 16", "a film has 8 bits per channel, not 16"),
        ("animate film.toml -o a.png --bits 32", "an animated .png has 8 or 16 bits per channel, not 32"),
        ("render scene.toml -o a.png --dither --colour u8", "`u8` rounds to 8 bits in each step"),
    ] {
        let said = workshop.code(arguments, 2).1;
        assert!(said.contains(message) && said.contains("hint: give --"), "{arguments}: {said}");
        assert_eq!(workshop.names(), ["film.toml", "scene.toml"], "{arguments}");
    }
    workshop.code("render scene.toml -o a.png --bits 12", 2);
    workshop.write("twelve.toml", BALL.replace("[image]", "[image]\nbits = 12"));
    let said = workshop.code("render twelve.toml -o a.png", 3).1;
    assert!(said.contains("give 8, 16 or 32 bits") && said.contains(":2"), "{said}");
    // The same by the scene file.
    workshop.write("wide.toml", BALL.replace("[image]", "[image]\nbits = 16\ndither = true"));
    workshop.succeed("render wide.toml -o a.png");
    assert_eq!(png(&workshop, "a.png").color(), image::ColorType::Rgba16);
    let said = workshop.succeed("render scene.toml --dither -o a.exr");
    assert!(said.contains("warning: --dither changes nothing"), "{said}");
}

/// The dithered picture is that of the EXR's values and the noise of each pixel's position, in any crop and on any number
/// of threads, in PNG and from shards; black stays black, and without the option nothing is dithered.
#[test]
fn dithering_depends_on_the_position_alone() {
    let workshop = Workshop::with("scene.toml", BALL.replace("background = 'transparent'\n", ""));
    workshop.succeed("render scene.toml -o a.exr");
    let exr = read_picture(&workshop.path("a.exr")).expect("a picture").values;
    let shown = |i: usize, crop: [u32; 4], bits: &dyn Fn([u32; 2]) -> [u32; 3]| {
        let place = [crop[0] + i as u32 % crop[2], crop[1] + i as u32 / crop[2]];
        let colour = DVec3::from(exr[(place[1] * 40 + place[0]) as usize].map(f64::from));
        let shown = DisplayTransform::default().displayed(ColourPipeline::Linear, colour).to_array();
        let bits = bits(place);
        [0, 1, 2].map(|channel| dither::<u8>(shown[channel], bits[channel]))
    };
    for (options, crop) in [("--threads 1", [0, 0, 40, 24]), ("--threads 3 --crop 5,3,31,17", [5, 3, 31, 17])]
    {
        workshop.succeed(&format!("render scene.toml --dither {options} -o a.png"));
        let found: Vec<[u8; 3]> = png(&workshop, "a.png").into_rgb8().pixels().map(|p| p.0).collect();
        let expected: Vec<[u8; 3]> =
            (0..found.len()).map(|i| shown(i, crop, &|place| bits_of_pixel(place))).collect();
        assert!(found == expected, "{options}");
        assert_eq!(found[0], [0; 3]);
        // The noise of other places gives another picture.
        let moved: Vec<_> =
            (0..found.len()).map(|i| shown(i, crop, &|[x, y]| bits_of_pixel([x + 1, y]))).collect();
        assert!(found != moved);
    }
    workshop.succeed("render scene.toml -o plain.png");
    let plain: Vec<[u8; 3]> = png(&workshop, "plain.png").into_rgb8().pixels().map(|p| p.0).collect();
    let rounded: Vec<[u8; 3]> = exr.iter().map(|&c| ColourPipeline::Linear.encode(c)).collect();
    assert!(plain == rounded);
    workshop.succeed("render scene.toml --dither=false -o plain.png");
    assert!(png(&workshop, "plain.png").into_rgb8().pixels().map(|p| p.0).eq(rounded));
}

/// A gradient of less than a step per 60 pixels has wide bands without dithering and none with it, in pictures with and
/// without alpha, JPEG and films.
#[test]
fn dithering_breaks_bands() {
    let wall = "[image]\nwidth = 512\nheight = 16\ncolour = 'display'\n[[camera]]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\n\
        viewpoint_distance = 1\nviewing_rectangle = [0.4, 0.0125]\n[[light]]\ntype = 'point'\nposition = [-30, 0, 12]\n\
        intensity = 0.3\n[material.wall]\ncolour = '#303030'\n[[triangles]]\nmaterial = 'wall'\n\
        vertices = [[-5, -5, 0], [5, -5, 0], [5, 5, 0], [-5, 5, 0]]\nindices = [[0, 1, 2], [0, 2, 3]]\n\
        [animation]\nfps = 2\nduration = 1\n";
    let workshop = Workshop::with("wall.toml", wall);
    let longest = |name: &str| {
        let image = png(&workshop, name).into_rgb8();
        let row: Vec<u8> = (0..512).map(|x| image.get_pixel(x, 8).0[0]).collect();
        row.chunk_by(|a, b| a == b).map(<[u8]>::len).max().expect("a pixel")
    };
    workshop.succeed("render wall.toml -o a.png");
    assert!(longest("a.png") >= 60, "{}", longest("a.png"));
    workshop.succeed("render wall.toml --dither -o a.png");
    let dithered = workshop.bytes("a.png");
    assert!(longest("a.png") < 40, "{}", longest("a.png"));
    workshop.succeed("render wall.toml --dither --background transparent -o a.png");
    assert!(longest("a.png") < 40, "{}", longest("a.png"));
    // Frames and films have the pixels of the picture.
    workshop.succeed("render wall.toml --dither --frames 0 -o frame.png");
    assert!(png(&workshop, "frame.png") == image::load_from_memory(&dithered).expect("a picture"));
    workshop.succeed("animate wall.toml --dither -o film.png --frames 0-1");
    assert!(png(&workshop, "film.png") == png(&workshop, "frame.png"));
    workshop.succeed("render wall.toml --dither -o a.jpg");
    workshop.succeed("render wall.toml -o b.jpg");
    assert!(workshop.bytes("a.jpg") != workshop.bytes("b.jpg"));
}
