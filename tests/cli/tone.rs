//! Exposure, tone map and headlight end to end: values of PNG against those of EXR, the automatic exposure, shards and
//! frames, errors, and the warning of clipped pictures.

use crate::workshop::{Workshop, text};
use kiln::film::read::read_picture;
use kiln::film::tone::ToneMap;
use kiln::film::{ColourPipeline, DisplayTransform};
use serde_json::json;

use crate::common::gltf::Model;

/// A sphere that is much brighter than white where it faces the light.
const SCENE: &str = "
[image]
width = 40
height = 24
background = '#203040'
[[camera]]
position = [0, 0, 8]
look_at = [0, 0, 0]
[[light]]
type = 'directional'
direction = [-1, -1, -2]
intensity = 9
[material.clay]
colour = '#c06020'
[[sphere]]
centre = [0, 0, 0]
radius = 2
material = 'clay'
";

impl Workshop {
    #[track_caller]
    fn fails(&self, arguments: &str, code: i32, parts: [&str; 2]) {
        let said = self.code(arguments, code).1;
        assert!(parts.iter().all(|part| said.contains(part)), "{arguments}: {said}");
    }

    /// The values of an EXR.
    fn floats(&self, name: &str) -> Vec<[f32; 3]> {
        read_picture(&self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}")).values
    }

    fn colours(&self, name: &str) -> Vec<[u8; 3]> {
        let image = image::open(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}")).into_rgb8();
        image.pixels().map(|pixel| pixel.0).collect()
    }
}

/// A square covers the left of the picture up to the middle of column 20. Its own colour stays in PNG, whose alpha is
/// straight; EXR has it times alpha. Beside it all is 0.
#[test]
fn a_transparent_background_has_alpha_of_the_part_that_is_covered() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.write(
        "half.toml",
        "[image]\nwidth = 41\nheight = 9\nbackground = '#00ff00'\ncolour = 'linear'\n\
         [[camera]]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\nprojection = 'orthographic'\nviewing_height = 9\nviewpoint_distance = 5\n\
         [material.m]\ncolour = '#c06020'\n\
         [[triangles]]\nmaterial = 'm'\nvertices = [[-30, -30, 0], [0, -30, 0], [0, 30, 0], [-30, 30, 0]]\n\
         indices = [[0, 1, 2], [0, 2, 3]]\n",
    );
    let options = "--background transparent --shading flat --samples 64 --filter box";
    for file in ["a.png", "a.exr"] {
        workshop.succeed(&format!("render half.toml {options} -o {file}"));
    }
    let png = image::open(workshop.path("a.png")).expect("a picture").into_rgba8();
    let [inside, edge, outside] = [3, 20, 37].map(|x| png.get_pixel(x, 4).0);
    assert_eq!(inside, [0xc0, 0x60, 0x20, 255]);
    assert_eq!(outside, [0; 4]);
    // 64 stratified samples: at most a column of 8 is on the wrong side.
    assert!((f64::from(edge[3]) / 255.0 - 0.5).abs() <= 1.0 / 8.0, "{edge:?}");
    assert!(edge.iter().zip(inside).take(3).all(|(a, b)| a.abs_diff(b) <= 1), "{edge:?}");
    let exr = read_picture(&workshop.path("a.exr")).expect("a picture");
    let [inside, edge, outside] = [3, 20, 37].map(|x| exr.values[4 * 41 + x]);
    for channel in 0..3 {
        let share = edge[channel] / inside[channel];
        assert!((share - 0.5).abs() <= 1.0 / 8.0 && outside[channel] == 0.0, "{edge:?} of {inside:?}");
    }
    workshop.fails(
        "render half.toml --background transparent -o a.jpg",
        2,
        ["no alpha channel", ".png or .exr"],
    );
}

/// A ball of one colour without light, and a glass pane of alpha 1/2 beside it, before a transparent background.
const BALL: &str = "[image]\nwidth = 40\nheight = 24\ncolour = 'linear'\n\
    [[camera]]\nposition = [0, 0, 8]\nlook_at = [0, 0, 0]\n\
    [material.m]\ncolour = '#202020'\n[material.pane]\ncolour = '#202020'\nopacity = 0.5\n\
    [[sphere]]\ncentre = [-1, 0, 0]\nradius = 1.5\nmaterial = 'm'\n\
    [[triangles]]\nmaterial = 'pane'\nvertices = [[1, -1, 0], [3, -1.2, 0], [2, 1.7, 0]]\n";

/// The channels R and A of an EXR.
fn colour_and_alpha(workshop: &Workshop, name: &str) -> Vec<[f32; 2]> {
    let image = kiln::film::channels::ExrChannels::open(&workshop.path(name)).expect("channels");
    let [colour, alpha] = ["R", "A"].map(|channel| image.channel(channel).expect("a channel"));
    colour.iter().zip(alpha).map(|(&colour, &alpha)| [colour, alpha]).collect()
}

/// Colour and alpha come from the same samples, also where their number differs from pixel to pixel: without light, the
/// colour is the material's times alpha. Both are sums of f64 rounded to f32, so that they differ by two such
/// roundings.
#[test]
fn colour_and_alpha_are_of_the_same_samples() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.write("ball.toml", BALL);
    let render = |options: &str| {
        workshop
            .succeed(&format!("render ball.toml --background transparent --shading flat {options} -o a.exr"));
        colour_and_alpha(&workshop, "a.exr")
    };
    let own = render("--samples 1")[12 * 40 + 14][0];
    for options in ["--samples 1", "--samples 16", "--noise 0.05", "--noise 0.02 --filter mitchell"] {
        let pixels = render(options);
        // Filters with negative lobes are cut off at 0 and 1 in alpha alone.
        let is_inside = |alpha: f32| !options.contains("mitchell") || (alpha > 0.0 && alpha < 1.0);
        for [colour, alpha] in pixels.iter().copied().filter(|&[_, alpha]| is_inside(alpha)) {
            assert!((colour - own * alpha).abs() <= own * f32::EPSILON, "{options}: {colour} {alpha}");
        }
        assert!(pixels.iter().any(|&[_, alpha]| alpha > 0.1 && alpha < 0.9), "{options}");
    }
    // A dark ball shows no noise of its own, its silhouette does: beside a light background. Fewer than 1 % of the
    // pixels are off by more than three times the level, none by more than ten times.
    let (noisy, limit) = (render("--noise 0.02 --samples 1024"), render("--samples 4096"));
    let off: Vec<f32> = noisy.iter().zip(&limit).map(|(a, b)| (a[1] - b[1]).abs()).collect();
    let beyond = |level: f32| off.iter().filter(|&&off| off > level).count();
    assert!(beyond(0.06) * 100 < off.len() && beyond(0.2) == 0, "{} {}", beyond(0.06), beyond(0.2));
}

/// The parts of a picture with a transparent background make the file of a single run.
#[test]
fn transparent_pictures_are_merged_from_shards() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.write("ball.toml", BALL);
    let options = "--background transparent --noise 0.05 --exposure 2 --tone-map agx";
    for (file, aov) in [("a.png", ""), ("a.exr", "--aov depth")] {
        workshop.succeed(&format!("render ball.toml {options} {aov} -o {file}"));
        let whole = workshop.bytes(file);
        for shard in 1..=3 {
            workshop.succeed(&format!("render ball.toml {options} {aov} -o {file} --shard {shard}/3"));
        }
        let merge = "merge a.3of3.shard a.1of3.shard a.2of3.shard -o";
        workshop.succeed(&format!("{merge} b.{}", &file[2..]));
        assert!(workshop.bytes(&format!("b.{}", &file[2..])) == whole, "{file}");
        workshop.fails(&format!("{merge} b.jpg"), 2, ["the shards have", "hint: name a file that ends in"]);
    }
}

/// The pixels of a PNG are the display transform of those of the EXR of the same picture, which no option of it
/// changes. The background bypasses it, so an EXR has the radiance that is displayed as the background.
#[test]
fn png_is_the_display_transform_of_exr() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.succeed("render scene.toml -o plain.exr");
    let light = workshop.floats("plain.exr");
    assert!(light.iter().any(|pixel| pixel[0] > 2.0), "light above white");
    let mut seen = Vec::new();
    for map in ToneMap::ALL {
        for ev in [-1.5, 0.0] {
            let options = format!("--exposure {ev} --tone-map {}", map.name());
            workshop.succeed(&format!("render scene.toml -o a.exr {options}"));
            let same = |(a, b): (&[f32; 3], &[f32; 3])| a == b || *b == light[0];
            assert!(workshop.floats("a.exr").iter().zip(&light).all(same), "{options}");
            workshop.succeed(&format!("render scene.toml -o a.png {options}"));
            let display = DisplayTransform::new(ev, map);
            // The corner shows the background.
            let of = |&c: &[f32; 3]| match c == light[0] {
                true => [0x20, 0x30, 0x40],
                false => display.encode(ColourPipeline::Linear, c),
            };
            let expected: Vec<_> = light.iter().map(of).collect();
            assert_eq!(workshop.colours("a.png"), expected, "{options}");
            assert!(!seen.contains(&expected), "{options}");
            seen.push(expected);
        }
    }
    // The same by keys of the scene file.
    workshop.write("own.toml", SCENE.replace("[image]", "[image]\nexposure = -1.5\ntone_map = 'filmic'"));
    workshop.succeed("render own.toml -o own.png");
    let filmic = seen.iter().position(|pixels| *pixels == workshop.colours("own.png"));
    assert_eq!(filmic, Some(6), "-1.5 EV and the last tone map");
    // Options override the scene file, and options without effect are not in the metadata.
    workshop.succeed("render own.toml -o off.png --exposure 0 --tone-map none");
    assert_eq!(workshop.colours("off.png"), seen[1]);
    workshop.succeed("render scene.toml -o plain.png");
    workshop.succeed("render scene.toml -o same.png --exposure 0 --tone-map none --light head");
    assert_eq!(workshop.bytes("plain.png"), workshop.bytes("same.png"));
    // Options with an effect are in the metadata and the fingerprint.
    let whole = format!("{:?}", String::from_utf8_lossy(&workshop.bytes("own.png")));
    assert!(whole.contains("kiln:exposure") && whole.contains("kiln:tone-map"));
    assert!(workshop.succeed("render own.toml -o own.png --skip-existing").contains("exists with"));
    assert!(workshop.succeed("render own.toml -o own.png --skip-existing --exposure 2").contains("wrote"));
}

/// Crops have the pixels of the whole picture, and parts merge to the same bytes.
#[test]
fn crops_and_parts_have_the_exposure_of_the_whole() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let options = "--exposure 0.3 --tone-map agx --noise 0.02 --samples 16";
    workshop.succeed(&format!("render scene.toml -o whole.png {options} --threads 1"));
    workshop.succeed(&format!("render scene.toml -o crop.png {options} --crop 16,8,20,9"));
    let whole = workshop.colours("whole.png");
    let rows = (8..17).flat_map(|y| &whole[y * 40 + 16..y * 40 + 36]);
    assert!(rows.eq(workshop.colours("crop.png").iter()));
    for shard in 1..=3 {
        workshop.succeed(&format!("render scene.toml -o merged.png {options} --shard {shard}/3"));
    }
    workshop.succeed("merge merged.1of3.shard merged.2of3.shard merged.3of3.shard -o merged.png");
    assert_eq!(workshop.bytes("merged.png"), workshop.bytes("whole.png"));
}

/// A picture of one surface of 188 without shading is (188 / 255 + 0.055) / 1.055 to the power 2.4 = 0.50289 in linear
/// light, so the automatic exposure is log2(0.18 / 0.50289) = -1.48226, rounded -1.48; the picture is then 0.50289 *
/// 2^-1.48 = 0.18028, which sRGB encodes as 0.46169, times 255 = 117.73: 118.
#[test]
fn the_automatic_exposure_of_a_uniform_picture() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.write(
        "grey.toml",
        "[image]\nwidth = 33\nheight = 20\nshading = 'flat'\n[material.grey]\ncolour = '#bcbcbc'\n\
        [[camera]]\nposition = [0, 0, 1]\nlook_at = [0, 0, 0]\n[[triangles]]\nmaterial = 'grey'\n\
        vertices = [[-99, -99, 0], [99, -99, 0], [0, 99, 0]]\nindices = [[0, 1, 2]]\n",
    );
    let said = workshop.succeed("render grey.toml -o a.png --exposure auto --threads 1");
    assert!(said.contains("kiln: note: the exposure is -1.48 EV"), "{said}");
    assert!(
        workshop.colours("a.png").iter().all(|&pixel| pixel == [118; 3]),
        "{:?}",
        workshop.colours("a.png")[0]
    );
    workshop.succeed("render grey.toml -o b.png --exposure auto --threads 2");
    assert_eq!(workshop.bytes("a.png"), workshop.bytes("b.png"));
    let bytes = workshop.bytes("a.png");
    assert!(String::from_utf8_lossy(&bytes).contains("auto (-1.48)"));
    // The same exposure, given as a number, gives the same pixels.
    workshop.succeed("render scene.toml -o auto.png --exposure auto --tone-map pbr-neutral");
    let said = workshop.succeed("render scene.toml -o auto.jpg --exposure auto --tone-map pbr-neutral");
    let ev =
        said.split("the exposure is ").nth(1).and_then(|rest| rest.split(' ').next()).expect("an exposure");
    workshop.succeed(&format!("render scene.toml -o typed.png --exposure {ev} --tone-map pbr-neutral"));
    assert_eq!(workshop.colours("auto.png"), workshop.colours("typed.png"));
}

#[test]
fn wrong_exposures_are_one_clear_line() {
    let workshop = Workshop::with("scene.toml", SCENE);
    for (options, what, hint) in [
        ("--exposure bright", "give a number of EV from -64 to 64, or \"auto\"", ""),
        ("--exposure 65", "invalid value '65'", "-64 to 64"),
        ("--tone-map agks", "invalid value 'agks'", "'agx'"),
        ("--light sun", "invalid value 'sun'", "possible values: head, none"),
        ("--exposure 1 --colour u8", "need the colour arithmetic `linear`, not `u8`", "--colour linear"),
        ("--tone-map agx --colour display", "`linear`, not `display`", "--exposure 0 --tone-map none"),
    ] {
        workshop.fails(&format!("render scene.toml -o a.png {options}"), 2, [what, hint]);
    }
    for (lines, what) in [
        ("\nexposure = 99", "own.toml:4: `exposure` is 99, expected EV from -64 to 64, or \"auto\""),
        ("\nexposure = 'car'", "own.toml:4: `exposure` is 'car', expected EV from -64 to 64, or \"auto\""),
        ("\ntone_map = 'agz'", "own.toml:4: unknown value `agz`"),
        ("\nheadlight = 1", "own.toml:4: `headlight` is 1, expected true or false"),
    ] {
        workshop.write("own.toml", SCENE.replace("[image]", &format!("[image]\n{lines}")));
        workshop.fails("render own.toml -o a.png", 3, [what, ""]);
    }
    workshop.write("own.toml", SCENE.replace("[image]", "[image]\ncolour = 'u8'\ntone_map = 'agx'"));
    workshop.fails("render own.toml -o a.png", 2, ["`linear`, not `u8`", "--tone-map none"]);
    assert!(!workshop.path("a.png").exists());
}

/// The exposure in EV that a run prints.
fn printed_exposure(printed: &str) -> &str {
    let rest = printed.split("the exposure is ").nth(1);
    rest.and_then(|rest| rest.split(' ').next()).unwrap_or_else(|| panic!("no exposure: {printed}"))
}

/// A closed grey room with a lamp of a thousandth of a wall, path traced: most paths of one sample find no light, so
/// their log-average is far from that of the radiance. The exposure depends on the radiance alone.
#[test]
fn the_automatic_exposure_does_not_depend_on_samples_and_regions() {
    let workshop = Workshop::with(
        "room.toml",
        "[image]\nwidth = 48\nheight = 32\n\
         [[camera]]\nposition = [0, 0, 0.9]\nlook_at = [0, 0, -1]\n\
         [material.white]\ncolour = '#c0c0c0'\n\
         [material.lamp]\ncolour = '#000000'\nemission = '#ffffff'\nemission_intensity = 400\n\
         [[mesh]]\nfile = 'box.obj'\nmaterial = 'white'\n\
         [[sphere]]\ncentre = [0, 0.7, -0.3]\nradius = 0.03\nmaterial = 'lamp'\n",
    );
    let corners = (0..8).map(|i| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { 1 } else { -1 }));
    let vertices: String = corners.map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    workshop.write(
        "box.obj",
        format!("{vertices}f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n"),
    );
    let room = "render room.toml --transport path --exposure auto";
    let few = workshop.succeed(&format!("{room} --samples 1 -o few.png"));
    for options in ["--samples 64 -o many.png", "--samples 4 --noise 0.05 -o adaptive.png", "-o film.exr"] {
        let other = workshop.succeed(&format!("{room} {options}"));
        assert_eq!(printed_exposure(&other), printed_exposure(&few), "{options}");
    }
    // Nor on the grain: by a seed, a sampler, or a time at which nothing has moved.
    let still =
        "[animation]\nduration = 2\n[[animation.track]]\nobject = 'lamp'\nlerp = { to = [0, 0.7, -0.3] }\n";
    let clip = text(&workshop.bytes("room.toml")).replace("[[sphere]]", "[[sphere]]\nname = 'lamp'") + still;
    workshop.write("clip.toml", clip);
    for options in ["room.toml --seed 7", "room.toml --sampler independent --seed 8", "clip.toml --time 0.7"]
    {
        let other = format!("render {options} --transport path --exposure auto --samples 2 -o grain.png");
        assert_eq!(printed_exposure(&workshop.succeed(&other)), printed_exposure(&few), "{options}");
    }
    // 2048 samples per pixel of the whole picture at 0 EV, whose log-average has nearly no bias.
    workshop.succeed("render room.toml --transport path --samples 2048 --filter box -o limit.exr");
    let limit = kiln::film::tone::auto_exposure(workshop.floats("limit.exr").into_iter());
    let metered: f64 = printed_exposure(&few).parse().expect("a number");
    assert!((metered - limit).abs() <= 0.1, "{metered} {limit}");

    workshop.succeed(&format!("{room} --samples 4 -o whole.png"));
    workshop.succeed(&format!("{room} --samples 4 --crop 20,10,16,8 -o crop.png"));
    let (whole, crop) = (workshop.colours("whole.png"), workshop.colours("crop.png"));
    for (y, row) in (10..).zip(crop.chunks(16)) {
        assert_eq!(row, &whole[y * 48 + 20..][..16], "row {y}");
    }
    for shard in 1..=2 {
        workshop.succeed(&format!("{room} --samples 4 -o part.png --shard {shard}/2"));
    }
    workshop.succeed("merge part.1of2.shard part.2of2.shard -o merged.png");
    assert_eq!(workshop.bytes("merged.png"), workshop.bytes("whole.png"));
}

/// All frames have the exposure of frame 0, also a single frame and frames in shards. The sphere approaches the camera.
#[test]
fn frames_have_the_exposure_of_the_first() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let moving = "[animation]\nduration = 1\nfps = 4\n[[animation.track]]\nobject = 'ball'\n\
                  lerp = { to = [0, 0, 4], easing = 'linear' }\n";
    let scene = SCENE.replace("[[sphere]]", "[[sphere]]\nname = 'ball'");
    workshop.write("moving.toml", format!("{scene}{moving}"));
    let said = workshop.succeed("render moving.toml -o all_#.png --frames 0-3 --exposure auto");
    let ev =
        said.split("the exposure is ").nth(1).and_then(|rest| rest.split(' ').next()).expect("an exposure");
    workshop.succeed("render moving.toml -o one_#.png --frames 3 --exposure auto");
    workshop.succeed("render moving.toml -o shard_#.png --frames 0-3 --shard 2/2 --exposure auto");
    assert_eq!(workshop.bytes("one_3.png"), workshop.bytes("all_3.png"));
    assert_eq!(workshop.bytes("shard_3.png"), workshop.bytes("all_3.png"));
    workshop.succeed(&format!("render moving.toml -o typed_#.png --frames 0-3 --exposure {ev}"));
    assert_eq!(workshop.colours("typed_3.png"), workshop.colours("all_3.png"));
    // The automatic exposure of frame 3 as a picture differs.
    let near = scene.replace("centre = [0, 0, 0]", "centre = [0, 0, 3]");
    workshop.write("near.toml", &near);
    let said = workshop.succeed("render near.toml -o still.png --exposure auto");
    assert!(!said.contains(&format!("the exposure is {ev} EV")), "{said}");
}

/// A white square that fills the picture under a light of 5000 lux reflects about 5000 / pi: everything is clipped. The
/// exposure named takes the 99th percentile of luminance to just below 1.
#[test]
fn a_clipped_picture_under_physical_lights_names_an_exposure() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let square = [[-9f32, -9., 0.], [9., -9., 0.], [9., 9., 0.], [-9., -9., 0.], [9., 9., 0.], [-9., 9., 0.]];
    let gltf = |intensity: f64| {
        let light = json!({ "type": "directional", "intensity": intensity });
        let nodes = json!([
            { "mesh": 0 },
            { "extensions": { "KHR_lights_punctual": { "light": 0 } } },
            { "camera": 0, "translation": [0, 0, 5] }
        ]);
        let mut model = Model::new(&square);
        model.primitive()["material"] = json!(0);
        model
            .with("extensionsUsed", json!(["KHR_lights_punctual"]))
            .with("extensions", json!({ "KHR_lights_punctual": { "lights": [light] } }))
            .with("scenes", json!([{ "nodes": [0, 1, 2] }]))
            .with("nodes", nodes)
            .with("cameras", json!([{ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }]))
            .with("materials", json!([{ "pbrMetallicRoughness": { "metallicFactor": 0 } }]))
            .text()
    };
    workshop.write("bright.gltf", gltf(5000.0));
    let said = workshop.succeed("render bright.gltf --draft -o a.png --size 64x48");
    let ev = said.split("try `--exposure ").nth(1).and_then(|rest| rest.split('`').next());
    let ev: f64 = ev.unwrap_or_else(|| panic!("no exposure: {said}")).parse().expect("a number");
    assert_eq!(said.matches("kiln: warning: ").count(), 1, "{said}");
    workshop.succeed("render bright.gltf --draft -o a.exr --size 64x48");
    let luminance =
        |[r, g, b]: [f32; 3]| 0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b);
    let mut all: Vec<f64> = workshop.floats("a.exr").into_iter().map(luminance).collect();
    all.sort_by(f64::total_cmp);
    let percentile = all[all.len() * 99 / 100] * ev.exp2();
    assert!(percentile > 0.92 && percentile <= 1.0, "{percentile} at {ev}");
    // About log2(5000 / pi) = 10.6 stops.
    assert!((-11.5..-10.0).contains(&ev), "{ev}");
    for quiet in [&format!("--exposure {ev}"), "--tone-map agx", "--exposure 0", "-o a.exr"] {
        let output = if quiet.starts_with("-o") { "" } else { "-o b.png" };
        let said = workshop.succeed(&format!("render bright.gltf --draft {output} --size 64x48 {quiet}"));
        assert!(!said.contains("kiln: warning: "), "{quiet}: {said}");
    }
    let said = workshop.succeed("render bright.gltf --draft -o f_##.png --frames 0-1 --size 32x24");
    assert_eq!(said.matches("try `--exposure").count(), 1, "{said}");
    // A white surface under 1 lux reflects about 1 / pi.
    workshop.write("dim.gltf", gltf(1.0));
    assert!(!workshop.succeed("render dim.gltf --draft -o a.png --size 64x48").contains("warning"));
    // The default look meters both. Light of 0.187 is displayed as 0.42 (see `mean_exposure`); fill light adds 0.7 * 0.37,
    // of which white reflects 0.96 and some gloss: 0.43 to 0.45 less 0.04 is 0.68 in sRGB.
    for file in ["bright", "dim"] {
        let said = workshop.succeed(&format!("render {file}.gltf -o {file}.png --size 64x48"));
        assert!(said.contains("kiln: note: the exposure is") && !said.contains("warning"), "{said}");
        let crop = workshop.succeed(&format!("render {file}.gltf -o crop.png --size 64x48 --crop 8,8,16,16"));
        assert_eq!(crop.contains("the exposure is"), said.contains("the exposure is"), "{crop}");
        let shown = workshop.colours(&format!("{file}.png"));
        let mean = shown.as_flattened().iter().map(|&value| f64::from(value)).sum::<f64>()
            / (3 * shown.len()) as f64;
        assert!((0.65..0.7).contains(&(mean / 255.0)), "{file}: {mean}");
    }
    // Fill light is in proportion to the exposure: a light of 2^-12 gives the same picture at 12 EV more.
    workshop.write("same.gltf", gltf(5000.0 / 4096.0));
    workshop.succeed("render same.gltf -o same.png --size 64x48");
    assert_eq!(workshop.colours("same.png"), workshop.colours("bright.png"));
    // Without it the square is as metered.
    workshop.succeed("render bright.gltf -o none.png --size 64x48 --light none");
    let [red, ..] = workshop.colours("none.png")[24 * 64 + 32];
    assert!((red as f64 / 255.0 - 0.42).abs() < 0.01, "{red}");
    for (option, file) in [("--light head", "bright"), ("--light none --draft", "bright")] {
        let said = workshop.succeed(&format!("render {file}.gltf -o x.png --size 8x8 {option}"));
        assert!(said.contains("changes nothing: the files have lights"), "{option}: {said}");
    }
    // An environment of radiance 1 is nothing beside 5000 lux; the factor named is 2^-EV.
    let said =
        workshop.succeed("render bright.gltf -o x.png --size 8x8 --environment white --hide-environment");
    let ev: f64 = said
        .split("the exposure is ")
        .nth(1)
        .and_then(|rest| rest.split(' ').next())
        .expect("an EV")
        .parse()
        .expect("a number");
    let factor = (-ev).exp2().round();
    assert!(said.contains(&format!("--environment-intensity {factor} shows its white")), "{said}");
    let options = format!("--environment white --hide-environment --environment-intensity {factor}");
    let said = workshop.succeed(&format!("render bright.gltf -o y.png --size 8x8 {options}"));
    assert!(!said.contains("outshine"), "{said}");
}

#[test]
fn a_headlight_can_be_left_out() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let said = workshop.succeed("render a.obj --draft -o head.png --size 8x8 --light head");
    assert!(said.contains("added a headlight"), "{said}");
    workshop.succeed("render a.obj --draft -o default.png --size 8x8");
    assert_eq!(workshop.bytes("head.png"), workshop.bytes("default.png"));
    let said = workshop.succeed("render a.obj --draft -o none.png --size 8x8 --light none");
    assert!(!said.contains("headlight"), "{said}");
    let sum = |name: &str| workshop.colours(name).into_iter().flatten().map(u64::from).sum::<u64>();
    assert!(sum("none.png") < sum("head.png"), "{} {}", sum("none.png"), sum("head.png"));
    // The same by a key of the scene file, which the option overrides.
    workshop
        .write("dark.toml", "[image]\nbackground = '#202226'\nheadlight = false\n[[mesh]]\nfile = 'a.obj'\n");
    workshop.succeed("render dark.toml -o dark.png --size 8x8");
    assert_eq!(workshop.colours("dark.png"), workshop.colours("none.png"));
    workshop.succeed("render dark.toml -o lit.png --size 8x8 --light head");
    assert_eq!(workshop.colours("lit.png"), workshop.colours("head.png"));
    // The same for frames, and for fingerprints.
    workshop.succeed("render a.obj --draft -o f_#.png --frames 0 --size 8x8 --light none");
    let said = workshop.succeed("render a.obj --draft -o f_#.png --frames 0 --size 8x8 --skip-existing");
    assert!(said.contains("wrote 1 frame(s)"), "{said}");
    // A light of the file is kept.
    workshop.succeed("render scene.toml -o scene.png");
    workshop.succeed("render scene.toml -o scene-none.png --light none");
    assert_eq!(workshop.colours("scene.png"), workshop.colours("scene-none.png"));
}
