//! OpenEXR files for other programs: windows of crops, camera matrices, planar depth, half floats, Cryptomatte.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::aov::{channels, kiln};
use exr::meta::MetaData;
use exr::meta::header::Header;
use exr::prelude::{AttributeValue, IntegerBounds, SampleType, Text, f16};
use glam::{DVec2, DVec4};

/// A plane at distance 2 from a camera with a right angle of view.
const PLANE: &str = "[image]\ncolour = 'linear'\n[[camera]]\nposition = [0, 0, 2]\nlook_at = [0, 0, 0]\n\
    vertical_fov = 90\n[[triangles]]\nvertices = [[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]]\n\
    indices = [[0, 1, 2], [0, 2, 3]]\n";

fn header(file: &Path) -> Header {
    MetaData::read_from_file(file, true).expect("it is an EXR picture").headers.remove(0)
}

/// A folder with a scene, and pictures of it.
struct Pictures(tempfile::TempDir);

impl Pictures {
    fn of(scene: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("a.toml"), scene).expect("a scene");
        Pictures(folder)
    }

    fn file(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Renders a file of 48 x 36 pixels.
    fn render(&self, name: &str, options: &[&str]) -> PathBuf {
        kiln(options).arg(self.file("a.toml")).arg("-o").arg(self.file(name)).assert().success();
        self.file(name)
    }

    /// The message and the exit code of a command with files of the folder.
    fn said(&self, command: &str, files: &[&str]) -> (String, Option<i32>) {
        let mut kiln = assert_cmd::Command::new(assert_cmd::cargo::cargo_bin!("kiln"));
        let output = kiln.arg(command).args(files).current_dir(self.0.path()).output().expect("it runs");
        (String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned(), output.status.code())
    }
}

/// A crop has its pixels at their place in the whole picture, and is compared as the pixels that it has.
#[test]
fn crops_are_placed_in_their_picture() {
    let pictures = Pictures::of(PLANE);
    let crop = ["--crop", "5,3,20,7"];
    let part = header(&pictures.render("crop.exr", &crop));
    let window = |x: i32, y: i32, width: usize, height: usize| IntegerBounds::new((x, y), (width, height));
    assert_eq!(part.shared_attributes.display_window, window(0, 0, 48, 36));
    assert_eq!(part.data_window(), window(5, 3, 20, 7));
    pictures.render("whole.exr", &[]);
    pictures.render("crop.png", &crop);
    // The plane has one colour: as PNG, it is rounded by at most half a step of 8 bits.
    assert_eq!(pictures.said("compare", &["crop.exr", "crop.exr"]).1, Some(0));
    assert_eq!(pictures.said("compare", &["crop.exr", "crop.png", "--fail-above", "max=0.002"]).1, Some(1));
    let (said, code) = pictures.said("compare", &["crop.exr", "whole.exr"]);
    assert!(said.contains("sizes differ") && said.contains("20 x 7") && code == Some(2), "{code:?} {said}");
    assert_eq!(pictures.said("verify", &["crop.exr"]).1, Some(0));
    let again = pictures.file("crop.exr");
    let written = || std::fs::metadata(&again).and_then(|about| about.modified()).expect("a time");
    let before = written();
    pictures.render("crop.exr", &[&crop[..], &["--skip-existing"]].concat());
    assert_eq!(written(), before);
}

/// A row vector times the matrices gives a point's pixel and its place before the camera, for points that the AOV
/// `position` has, and a camera with a shift; in a scene of any size.
#[test]
fn matrices_lead_from_points_to_pixels() {
    for (projection, exponent) in [("perspective", 0), ("orthographic", 0), ("perspective", -16)] {
        let n = |value: i32| format!("{value}e{exponent}");
        let scene = format!(
            "[image]\ncolour = 'linear'\n[[camera]]\nposition = [{}, {}, {}]\nlook_at = [0, {}, 0]\n\
             projection = '{projection}'\nlens_shift = [0.25, -0.125]\nviewpoint_distance = {}\n\
             viewing_height = {}\n[[sphere]]\ncentre = [0, 0, 0]\nradius = {}\n\
             [[disk]]\ncentre = [0, 0, {}]\nnormal = [0, 0, 1]\nradius = {}\n",
            n(3),
            n(4),
            n(12),
            n(1),
            n(10),
            n(8),
            n(3),
            n(-5),
            n(40)
        );
        let pictures = Pictures::of(&scene);
        let file = pictures.render("a.exr", &["--aov", "position,depth,object"]);
        let all = channels(&file);
        let header = header(&file);
        assert_eq!(header.shared_attributes.pixel_aspect, 1.0);
        let layer = header.own_attributes;
        let matrices = [layer.world_to_camera, layer.world_to_normalized_device];
        let [camera, ndc] = matrices.map(|matrix| matrix.expect("a matrix").map(f64::from));
        let times = |point: DVec4, matrix: [f64; 16]| -> DVec4 {
            let rows = matrix.chunks_exact(4).map(|row| DVec4::new(row[0], row[1], row[2], row[3]));
            rows.zip(point.to_array()).map(|(row, value)| row * value).sum()
        };
        let size = 10f64.powi(exponent);
        let mut seen = [0; 2];
        for pixel in (0..48 * 36).filter(|&pixel| all["Object.X"][pixel] >= 0.0) {
            seen[all["Object.X"][pixel] as usize] += 1;
            let [x, y, z] = ["X", "Y", "Z"].map(|axis| f64::from(all[&format!("Position.{axis}")][pixel]));
            let at = times(DVec4::new(x, y, z, 1.0), ndc);
            let expected =
                DVec2::new((pixel % 48) as f64 + 0.5, (pixel / 48) as f64 + 0.5) / DVec2::new(48.0, 36.0);
            // Positions and matrices are f32: some units in the last place of coordinates up to 40, in a rectangle
            // that is 8 high.
            let found = DVec2::new(at.x, at.y) / at.w;
            assert!(
                (found - expected).length() < 1e-5,
                "{projection} {exponent} {pixel}: {found} {expected}"
            );
            let depth = f64::from(all["Depth.Z"][pixel]);
            let before = times(DVec4::new(x, y, z, 1.0), camera);
            assert!(
                (before.z - depth).abs() < 1e-5 * size * 40.0,
                "{projection} {exponent} {pixel}: {before} {depth}"
            );
            assert_eq!(before.w, 1.0);
        }
        assert!(seen[0] > 100 && seen[1] > 100, "{seen:?}");
    }
}

/// Across a plane that faces the camera, depth is 2 everywhere, in both channels that programs read as depth; the
/// distance of a point at (x, y) in a picture from -1 to 1 high is 2 sqrt(1 + x^2 + y^2).
#[test]
fn depth_is_along_the_line_of_sight() {
    let pictures = Pictures::of(PLANE);
    let of_aov = |options: &[&str]| channels(&pictures.render("a.exr", options));
    let all = of_aov(&["--aov", "depth,distance"]);
    for (pixel, (depth, found)) in all["Depth.Z"].iter().zip(&all["Distance.X"]).enumerate() {
        let [x, y] = [pixel % 48, pixel / 48].map(|i| i as f64 + 0.5);
        let (x, y) = ((x - 24.0) / 18.0, (y - 18.0) / 18.0);
        let distance = 2.0 * (1.0 + x * x + y * y).sqrt();
        assert!((depth - 2.0).abs() < 1e-6, "{depth}");
        assert!((f64::from(*found) - distance).abs() < 1e-6, "{distance}");
    }
    assert_eq!(all["Z"], all["Depth.Z"]);
    let parallel = of_aov(&["--aov", "depth,distance", "--projection", "orthographic"]);
    assert!(parallel["Z"].iter().chain(&parallel["Distance.X"]).all(|&depth| depth == 2.0));
    // A panorama has no plane of view.
    let around = of_aov(&["--aov", "depth,distance", "--projection", "panoramic"]);
    assert_eq!(around["Z"], around["Distance.X"]);
    assert_eq!(header(&pictures.file("a.exr")).own_attributes.world_to_camera, None);
}

/// Half floats are the nearest to the values of 32 bits, of colours and alpha alone.
#[test]
fn half_floats_are_for_colours() {
    let pictures = Pictures::of(&PLANE.replace("[0, 0, 2]", "[9, 0, 2]"));
    let options = ["--aov", "all", "--background", "transparent", "--samples", "4"];
    let whole = channels(&pictures.render("32.exr", &options));
    let file = pictures.render("16.exr", &[&options[..], &["--bits", "16"]].concat());
    let half = channels(&file);
    let types: BTreeMap<String, SampleType> =
        header(&file).channels.list.iter().map(|c| (c.name.to_string(), c.sample_type)).collect();
    for (name, values) in &whole {
        let layer = name.split('.').next().unwrap_or_default();
        let is_colour = ["R", "G", "B", "A", "Albedo", "DenoisingAlbedo", "Base"].contains(&layer);
        let is_colour = is_colour || layer.starts_with("Effect");
        assert_eq!(types[name], if is_colour { SampleType::F16 } else { SampleType::F32 }, "{name}");
        let expected = |value: f32| if is_colour { f16::from_f32(value).to_f32() } else { value };
        assert!(values.iter().zip(&half[name]).all(|(&value, &found)| found == expected(value)), "{name}");
    }
    assert!(whole["A"].iter().any(|alpha| (0.1..0.9).contains(alpha)), "an edge");
    for (name, bits, says) in [
        ("a.exr", "8", "error: .exr has 16 or 32 bits per channel, not 8\nhint: give --bits 16 or 32,"),
        ("a.jpg", "16", "error: .jpg has 8 bits per channel, not 16\nhint: give --bits 8,"),
        ("a.png", "32", "error: .png has 8 or 16 bits per channel, not 32\nhint: give --bits 8 or 16"),
        ("a.png", "12", "give 8, 16 or 32"),
    ] {
        let mut run = kiln(&["--bits", bits]);
        let run = run.arg(pictures.file("a.toml")).arg("-o").arg(pictures.file(name)).assert().code(2);
        let said = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
        assert!(said.contains(says) && !pictures.file(name).exists(), "{said}");
    }
}

/// Linear light has the primaries of sRGB; display values are no light.
#[test]
fn chromaticities_are_those_of_linear_light() {
    let pictures = Pictures::of(PLANE);
    let of = |colour: &str| {
        header(&pictures.render("a.exr", &["--colour", colour])).shared_attributes.chromaticities
    };
    let linear = of("linear").expect("chromaticities");
    assert_eq!([linear.red.0, linear.red.1, linear.white.0, linear.white.1], [0.64, 0.33, 0.3127, 0.3290]);
    assert_eq!([of("display"), of("u8")], [None, None]);
}

/// A red and a green square that meet at a quarter of a pixel, before nothing, and a half transparent blue one before
/// the right of the green one, with the name of the red one.
const SQUARES: &str = "[image]\ncolour = 'linear'\nbackground = '#000000'\n[[camera]]\nposition = [0, 0, 5]\n\
    look_at = [0, 0, 0]\nprojection = 'orthographic'\nviewing_rectangle = [48, 36]\nviewpoint_distance = 1\n\
    [material.\"red paint\"]\ncolour = '#ff0000'\n[material.green]\ncolour = '#00ff00'\n\
    [material.blue]\ncolour = '#0000ff'\nopacity = 0.5\n\
    [[triangles]]\nname = 'left'\nmaterial = 'red paint'\nindices = [[0, 1, 2], [0, 2, 3]]\n\
    vertices = [[-20, -9, 0], [0.25, -9, 0], [0.25, 9, 0], [-20, 9, 0]]\n\
    [[triangles]]\nname = 'mädchen'\nmaterial = 'green'\nindices = [[0, 1, 2], [0, 2, 3]]\n\
    vertices = [[0.25, -9, 0], [20, -9, 0], [20, 9, 0], [0.25, 9, 0]]\n\
    [[triangles]]\nname = 'left'\nmaterial = 'blue'\nindices = [[0, 1, 2], [0, 2, 3]]\n\
    vertices = [[10, -9, 1], [20, -9, 1], [20, 9, 1], [10, 9, 1]]\n";

/// For each pixel, the coverage of each id.
fn coverages(all: &BTreeMap<String, Vec<f32>>, layer: &str) -> Vec<BTreeMap<u32, f32>> {
    let of_pixel = |pixel: usize| {
        let value = |rank: usize, letter: &str| all[&format!("{layer}0{rank}.{letter}")][pixel];
        let pairs = (0..3).flat_map(|rank| [["r", "g"], ["b", "a"]].map(|pair| pair.map(|c| value(rank, c))));
        let pairs: Vec<[f32; 2]> = pairs.collect();
        assert!(pairs.is_sorted_by(|a, b| a[1] >= b[1]), "{pairs:?}");
        pairs.into_iter().filter(|[_, part]| *part > 0.0).map(|[id, part]| (id.to_bits(), part)).collect()
    };
    (0..all["R"].len()).map(of_pixel).collect()
}

/// The text attributes of a Cryptomatte: its manifest.
fn manifest(file: &Path, key: &str, name: &str) -> BTreeMap<String, String> {
    let texts = header(file).own_attributes.other;
    let text = |what: &str| match &texts[&Text::from(format!("cryptomatte/{key}/{what}").as_str())] {
        AttributeValue::Text(text) => String::from_utf8(text.as_slice().to_vec()).expect("UTF-8"),
        other => panic!("{other:?}"),
    };
    assert_eq!(
        ["name", "hash", "conversion"].map(text),
        [name, "MurmurHash3_32", "uint32_to_float32"],
        "{key}"
    );
    serde_json::from_str(&text("manifest")).expect("a manifest")
}

/// Coverage has the samples and the filter of the picture: the picture without light is red where the matte of the red
/// material is 1. It is limited to 0 and 1 where the filter has negative lobes. Half transparent surfaces cover half.
#[test]
fn mattes_are_the_picture_of_their_object() {
    let pictures = Pictures::of(SQUARES);
    let flat = |options: &[&str]| {
        let options =
            [&["--aov", "cryptomatte-object,cryptomatte-material", "--shading", "flat"], options].concat();
        channels(&pictures.render("a.exr", &options))
    };
    for options in [
        &["--samples", "16"][..],
        &["--samples", "9", "--filter", "mitchell"],
        &["--samples", "256", "--filter", "box"],
        &[],
    ] {
        let all = flat(options);
        let file = pictures.file("a.exr");
        // Keys: the first 7 digits of the ids of the layers' names, from the module `mmh3`.
        let materials = manifest(&file, "be359d6", "CryptoMaterial");
        let objects = manifest(&file, "3ae39a5", "CryptoObject");
        // The bits of 6.2361298e25, the id of `mädchen` in the tests of Psyop's repository.
        assert_eq!(objects["mädchen"], "6a4e5613");
        assert_eq!(objects.keys().collect::<Vec<_>>(), ["left", "mädchen"]);
        let id = |names: &BTreeMap<String, String>, name: &str| {
            u32::from_str_radix(&names[name], 16).expect("an id")
        };
        let [of_objects, of_materials] =
            ["CryptoObject", "CryptoMaterial"].map(|layer| coverages(&all, layer));
        let mut edges = 0;
        for pixel in 0..48 * 36 {
            let mut rgb = ["R", "G", "B"].map(|letter| all[letter][pixel]);
            if options.is_empty() && rgb == [0.0, 0.5, 0.5] {
                // One sample sees one surface: the first with an opacity of at least 1/2.
                rgb = [0.0, 0.0, 1.0];
            }
            let part = |mattes: &[BTreeMap<u32, f32>], id| mattes[pixel].get(&id).copied().unwrap_or(0.0);
            let near = |a: f32, b: f32| (a - b).abs() <= 4.0 * f32::EPSILON;
            let are_near = |found: &[f32], of_picture: &[f32]| {
                let limited: Vec<f32> = of_picture.iter().map(|part| part.clamp(0.0, 1.0)).collect();
                let sum = limited.iter().sum::<f32>().max(1.0);
                assert!(
                    found.iter().zip(&limited).all(|(&found, part)| near(found, part / sum)),
                    "{options:?} {pixel}: {found:?} {of_picture:?}"
                );
            };
            let names = ["red paint", "green", "blue"];
            are_near(&names.map(|name| part(&of_materials, id(&materials, name))), &rgb);
            // Both objects named `left` are one.
            let [left, right] = ["left", "mädchen"].map(|name| part(&of_objects, id(&objects, name)));
            are_near(&[left, right], &[rgb[0] + rgb[2], rgb[1]]);
            edges += usize::from(rgb.iter().any(|part| (0.1..0.9).contains(part)));
            let (x, y) = (pixel % 48, pixel / 48);
            if (8..40).contains(&x) && (13..23).contains(&y) {
                assert!(near(left + right, 1.0), "{options:?} {pixel}: {left} {right}");
            } else if !(3..45).contains(&x) {
                assert_eq!(of_objects[pixel], BTreeMap::new(), "nothing is there");
            }
        }
        // One sample at a pixel's centre sees no edge.
        assert_eq!(edges > 30, !options.is_empty(), "{options:?}: {edges}");
        if options.contains(&"box") {
            // 256 Sobol points are in 16 columns of 16: at most one column is on the wrong side of the edge.
            let part = of_materials[17 * 48 + 24][&id(&materials, "red paint")];
            assert!((part - 0.25).abs() <= 1.0 / 16.0, "{part}");
            let half = of_materials[17 * 48 + 38][&id(&materials, "blue")];
            assert!((half - 0.5).abs() <= 1.0 / 16.0, "{half}");
        }
    }
}
