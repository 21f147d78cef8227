//! AOVs: the channels that `--aov` adds to an EXR file.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::atomic::AtomicBool;

use crate::common::picture::{Prepared, load, prepare};
use crate::common::repository;
use assert_cmd::Command;
use kiln::effects::{Plan, PlanSettings};
use kiln::error::Error;
use kiln::render::RenderControl;
use kiln::render::aov::{self, AOVS, AovSelection, AovSource};
use kiln::scene::Numerics;
use kiln::shading::base_colour;

const SIZE: [u32; 2] = [48, 36];

pub(crate) fn kiln(arguments: &[&str]) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("kiln"));
    command
        .current_dir(repository("."))
        .args(["render", "--progress", "none", "--size", "48x36"])
        .args(arguments);
    command
}

/// The channels of an EXR file by name, row by row from the top.
pub(crate) fn channels(file: &Path) -> BTreeMap<String, Vec<f32>> {
    let picture = exr::prelude::read_first_flat_layer_from_file(file).expect("it is an EXR picture");
    let layer = picture.layer_data;
    assert_eq!((layer.size.x(), layer.size.y()), (SIZE[0] as usize, SIZE[1] as usize));
    let channels = layer.channel_data.list.into_iter();
    channels.map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect())).collect()
}

fn render(scene: &str, aov: &str, folder: &Path) -> BTreeMap<String, Vec<f32>> {
    let file = folder.join("a.exr");
    let scene = format!("scenes/{scene}.toml");
    kiln(&[&scene, "--aov", aov, "-o"]).arg(&file).assert().success();
    channels(&file)
}

#[test]
fn base_and_effects_add_up_to_the_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    let scenes = ["assignment", "effects/glaze", "effects/shadows", "effects/terminator"];
    for scene in scenes {
        let all = render(scene, "effects", folder.path());
        for letter in ["R", "G", "B"] {
            let parts: Vec<&Vec<f32>> = all
                .iter()
                .filter(|(name, _)| name.ends_with(&format!(".{letter}")))
                .map(|(_, v)| v)
                .collect();
            assert!(parts.len() > 1, "{scene} has no effect");
            for (i, &whole) in all[letter].iter().enumerate() {
                let sum: f64 = parts.iter().map(|part| f64::from(part[i])).sum();
                // Each part is rounded to half a step of f32 of the largest number that is subtracted, and their sum is
                // exact in f64.
                let sizes: f64 = parts.iter().map(|part| f64::from(part[i].abs())).sum();
                let bound = f64::from(f32::EPSILON) * (sizes + f64::from(whole.abs()));
                assert!((sum - f64::from(whole)).abs() <= bound, "{scene} {letter} {i}: {sum} {whole}");
            }
        }
    }
}

#[test]
fn values_are_those_of_the_rays() {
    let folder = tempfile::tempdir().expect("a folder");
    let all = render("effects/glaze", "all", folder.path());
    let prepared = prepare(load(&repository("scenes/effects/glaze.toml")), SIZE, Numerics::Watertight);
    let (mut background, compared) = (0, RefCell::new(BTreeSet::new()));
    let forward = glam::DVec3::new(0.15 - 0.4, 0.62 - 1.7, -5.4).normalize();
    for (i, (ray, hit)) in prepared.rays().iter().zip(prepared.hits()).enumerate() {
        let at = |name: &str| {
            compared.borrow_mut().insert(name.to_owned());
            all[name][i]
        };
        let three = |layer: &str, letters: [&str; 3]| letters.map(|letter| at(&format!("{layer}.{letter}")));
        let (xyz, rgb) = (["X", "Y", "Z"], ["R", "G", "B"]);
        assert_eq!(at("Samples.X"), 1.0);
        // The variance of one sample is not defined; it is stored as infinite.
        assert_eq!(three("Variance", rgb), [f32::INFINITY; 3]);
        assert!(at("NodeTests.X") >= 1.0);
        let Some(hit) = hit else {
            background += 1;
            assert_eq!(["Depth.Z", "Distance.X"].map(at), [f32::INFINITY; 2]);
            assert_eq!(covering(at), [[0.0; 6]; 2]);
            assert_eq!(["Object.X", "Material.X", "Primitive.X"].map(at), [-1.0; 3]);
            assert_eq!(["Position", "ShadingNormal", "Normal"].map(|layer| three(layer, xyz)), [[0.0; 3]; 3]);
            assert_eq!(["Albedo", "DenoisingAlbedo"].map(|layer| three(layer, rgb)), [[0.0; 3]; 2]);
            assert_eq!(three("DenoisingNormal", xyz), [0.0; 3]);
            continue;
        };
        let surface = prepared.world.interaction(ray, &hit);
        assert_eq!(at("Distance.X"), hit.t as f32);
        // The camera looks along `forward`, from where all rays begin.
        let depth = (surface.point.position - ray.origin()).dot(forward);
        assert!((f64::from(at("Depth.Z")) - depth).abs() < 1e-6 * hit.t, "{depth}");
        // A single sample covers the pixel.
        assert_eq!(covering(at), [[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]; 2]);
        assert_eq!(three("Position", xyz), surface.point.position.as_vec3().to_array());
        for layer in ["ShadingNormal", "DenoisingNormal"] {
            assert_eq!(three(layer, xyz), surface.shading_normal.as_vec3().to_array());
        }
        assert_eq!(three("Normal", xyz), surface.geometric_normal.as_vec3().to_array());
        let albedo = base_colour(&prepared.world, &surface, glam::DVec3::ONE);
        for layer in ["Albedo", "DenoisingAlbedo"] {
            assert_eq!(three(layer, rgb), albedo.as_vec3().to_array());
        }
        assert_eq!((at("Object.X"), at("Material.X")), (surface.object as f32, surface.material as f32));
        assert_eq!(at("Primitive.X"), hit.prim.0 as f32);
        // The point lies on the ray, up to the rounding of t and of the point to f32.
        let far = ray.at(hit.t) - surface.point.position;
        assert!(far.length() < 1e-5 * hit.t, "{far}");
    }
    assert!(background > 100, "some pixels see the background");
    for channel in AOVS.iter().flat_map(|aov| aov.channels) {
        assert!(compared.borrow().contains(*channel), "{channel} is compared with nothing");
    }
}

/// The coverages of the Cryptomattes of objects and materials, the largest first. Ids are not empty.
fn covering(at: impl Fn(&str) -> f32) -> [[f32; 6]; 2] {
    ["CryptoObject", "CryptoMaterial"].map(|layer| {
        std::array::from_fn(|rank| {
            let [id, part] = [["r", "g"], ["b", "a"]][rank % 2]
                .map(|letter| at(&format!("{layer}0{}.{letter}", rank / 2)));
            assert_eq!(id == 0.0, part == 0.0);
            part
        })
    })
}

/// Albedo is the picture without light on a black background: its textures, filter and samples. So are the denoising
/// AOVs, where nothing mirrors.
#[test]
fn albedo_is_the_picture_without_light() {
    let folder = tempfile::tempdir().expect("a folder");
    for options in [&[][..], &["--samples", "7"], &["--samples", "5", "--filter", "mitchell"]] {
        let render = |more: &[&str]| {
            let file = folder.path().join("a.exr");
            let scene = ["scenes/effects/textures.toml", "--background", "#000000", "--without", "glaze"];
            kiln(&[&scene, options, more, &["-o"]].concat()).arg(&file).assert().success();
            channels(&file)
        };
        let flat = render(&["--shading", "flat"]);
        let lit = render(&["--aov", "albedo,denoising-albedo"]);
        let colours: BTreeSet<u32> = lit["Albedo.R"].iter().map(|c| c.to_bits()).collect();
        assert!(colours.len() > 100, "{options:?}: {} colours", colours.len());
        for letter in ["R", "G", "B"] {
            let [albedo, same] =
                ["Albedo", "DenoisingAlbedo"].map(|layer| &lit[&format!("{layer}.{letter}")]);
            assert!(*albedo == flat[letter] && albedo == same, "{options:?} {letter}");
        }
    }
}

/// A quarter of each pixel shows a square whose normal map tilts its normal (0, 0, 1) by a known angle: red 204 of 255
/// is 0.6, blue 230 is 0.804, so that the unit normal is (0.598, 0.0039, 0.801) up to the sign that the texture's axes
/// give. Its mean over the pixel is a quarter of that.
#[test]
fn normals_are_those_of_normal_maps_and_filtered() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name);
    image::RgbImage::from_pixel(1, 1, image::Rgb([204, 128, 230])).save(file("n.png")).expect("a map");
    std::fs::write(file("m.mtl"), "newmtl m\nKd 1 1 1\nnorm n.png\n").expect("materials");
    let side = |width: f64| {
        format!(
            "mtllib m.mtl\nv 0 0 0\nv {width} 0 0\nv {width} 18 0\nv 0 18 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
             usemtl m\nf 1/1 2/2 3/3 4/4\n"
        )
    };
    // The pixel in column 24, row 17 is from (0, 0) to (1, 1): covered up to x = 1/4, or wholly.
    let tilted = glam::DVec3::from([204.0, 128.0, 230.0].map(|c| 2.0 * c / 255.0 - 1.0)).normalize();
    for (width, share) in [(0.25, 0.25), (1.0, 1.0)] {
        std::fs::write(file("a.obj"), side(width)).expect("a mesh");
        let scene = "[[camera]]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\nprojection = 'orthographic'\n\
                     viewing_rectangle = [48, 36]\nviewpoint_distance = 1\n[[mesh]]\nfile = 'a.obj'\n";
        std::fs::write(file("a.toml"), scene).expect("a scene");
        let options =
            ["--samples", "256", "--filter", "box", "--aov", "shading-normal,denoising-normal", "-o"];
        kiln(&options).arg(file("a.exr")).arg(file("a.toml")).assert().success();
        let all = channels(&file("a.exr"));
        for layer in ["ShadingNormal", "DenoisingNormal"] {
            let normal = ["X", "Y", "Z"].map(|axis| f64::from(all[&format!("{layer}.{axis}")][17 * 48 + 24]));
            let off = glam::DVec3::from(normal) - share * tilted;
            // 256 Sobol points are in 16 columns of 16: at most one column is on the wrong side. Maps have 16 bits.
            let bound = if share == 1.0 { 1e-4 } else { 1.0 / 16.0 };
            assert!(
                off.abs().max_element() < bound,
                "{layer} {share}: {normal:?} instead of {}",
                share * tilted
            );
        }
    }
}

/// A smooth mirror at 45 degrees shows a red wall to its side, a pane of clear glass a blue one behind it: denoising
/// AOVs are those of the walls, the others those of mirror and glass.
#[test]
fn denoising_aovs_are_of_what_mirrors_and_glass_show() {
    let folder = tempfile::tempdir().expect("a folder");
    let (scene, output) = (folder.path().join("a.toml"), folder.path().join("a.exr"));
    let text = "[image]\ncolour = 'linear'\ntransport = 'path'\n\
        [[camera]]\nposition = [0, 0, 9]\nlook_at = [0, 0, 0]\nprojection = 'orthographic'\n\
        viewing_rectangle = [4, 3]\nviewpoint_distance = 1\n\
        [material.mirror]\ncolour = [255, 255, 255]\nmetallic = 1\nroughness = 0\n\
        [material.glass]\ncolour = [255, 255, 255]\nroughness = 0\nlayers = { transmission = 1, ior = 1 }\n\
        [material.red]\ncolour = [255, 0, 0]\nmetallic = 0\nroughness = 1\n\
        [material.blue]\ncolour = [0, 0, 255]\nmetallic = 0\nroughness = 1\n\
        [[triangles]]\nmaterial = 'mirror'\nvertices = [[-2, -9, 0], [0, -9, 2], [0, 9, 2], [-2, 9, 0]]\n\
        indices = [[0, 1, 2], [0, 2, 3]]\n\
        [[triangles]]\nmaterial = 'red'\nvertices = [[-5, -9, -9], [-5, -9, 9], [-5, 9, 9], [-5, 9, -9]]\n\
        indices = [[0, 1, 2], [0, 2, 3]]\n\
        [[triangles]]\nmaterial = 'glass'\nvertices = [[0, -9, 0], [2, -9, 0], [2, 9, 0], [0, 9, 0]]\n\
        indices = [[0, 1, 2], [0, 2, 3]]\n\
        [[triangles]]\nmaterial = 'blue'\nvertices = [[0, -9, -3], [2, -9, -3], [2, 9, -3], [0, 9, -3]]\n\
        indices = [[0, 1, 2], [0, 2, 3]]\n";
    std::fs::write(&scene, text).expect("a scene");
    let aov = "albedo,shading-normal,denoising-albedo,denoising-normal";
    // By one bounce, too: the walls are the last vertices.
    for depth in ["8", "1"] {
        let options = ["--samples", "4", "--filter", "box", "--aov", aov, "--depth", depth, "-o"];
        kiln(&options).arg(&output).arg(&scene).assert().success();
        check_denoising_aovs(&channels(&output));
    }
}

fn check_denoising_aovs(all: &BTreeMap<String, Vec<f32>>) {
    let three = |layer: &str, letters: [&str; 3], x: usize| {
        letters.map(|letter| all[&format!("{layer}.{letter}")][18 * 48 + x])
    };
    let half = 0.5f32.sqrt();
    // The mirror faces (-1, 0, 1); light along -z leaves it along -x, to the wall that faces +x.
    for (x, albedo, normal, behind, facing) in [
        (12, [1.0, 1.0, 1.0], [-half, 0.0, half], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
        (36, [1.0, 1.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]),
    ] {
        let close = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
        let (rgb, xyz) = (["R", "G", "B"], ["X", "Y", "Z"]);
        assert_eq!(three("Albedo", rgb, x), albedo);
        assert!(close(three("ShadingNormal", xyz, x), normal), "{:?}", three("ShadingNormal", xyz, x));
        assert_eq!(three("DenoisingAlbedo", rgb, x), behind);
        let found = three("DenoisingNormal", xyz, x);
        assert!(close(found, facing), "{found:?}");
    }
}

/// Panes of opacity 0.4 and 0.6 before a red wall: with one sample the albedo is of the first surface of at least one
/// half, with 256 Sobol points, of which 256 equal parts hold one each, of each by its opacity, to one sample.
#[test]
fn albedo_of_transparent_surfaces_is_that_of_the_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    let (scene, output) = (folder.path().join("a.toml"), folder.path().join("a.exr"));
    let square = |material: &str, from: i32, to: i32, z: i32| {
        format!(
            "[[triangles]]\nmaterial = '{material}'\nvertices = [[{from}, -9, {z}], [{to}, -9, {z}], \
             [{to}, 9, {z}], [{from}, 9, {z}]]\nindices = [[0, 1, 2], [0, 2, 3]]\n"
        )
    };
    let text = "[image]\ncolour = 'linear'\n[[camera]]\nposition = [0, 0, 9]\nlook_at = [0, 0, 0]\n\
        projection = 'orthographic'\nviewing_rectangle = [4, 3]\nviewpoint_distance = 1\n\
        [material.thin]\ncolour = [0, 255, 0]\nopacity = 0.4\n\
        [material.thick]\ncolour = [0, 0, 255]\nopacity = 0.6\n[material.red]\ncolour = [255, 0, 0]\n";
    let squares = [square("thin", -9, 0, 0), square("thick", 0, 9, 0), square("red", -9, 9, -3)];
    std::fs::write(&scene, text.to_owned() + &squares.concat()).expect("a scene");
    for (options, left, right, bound) in [
        (&[][..], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], 0.0),
        (&["--transport", "path"], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], 0.0),
        (&["--samples", "256"], [0.6, 0.4, 0.0], [0.4, 0.0, 0.6], 1.0 / 256.0),
    ] {
        kiln(&["--aov", "albedo", "-o"]).arg(&output).arg(&scene).args(options).assert().success();
        let all = channels(&output);
        for (x, expected) in [(8, left), (40, right)] {
            let found = ["R", "G", "B"].map(|letter| all[&format!("Albedo.{letter}")][18 * 48 + x]);
            let is_close = found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= bound);
            assert!(is_close, "{options:?} {x}: {found:?} instead of {expected:?}");
        }
    }
}

/// Depth and position are in the coordinates of the scene file, also for a scene that is recentered when prepared.
#[test]
fn depth_and_position_are_the_scenes_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let (near, far) = (folder.path().join("near.toml"), folder.path().join("far.toml"));
    // A triangle at distance 2 from the camera that fills its view, its middle at `x`.
    let text = |x: f64| {
        format!(
            "[[camera]]\nposition = [{x}, 0, 2]\nlook_at = [{x}, 0, 0]\nprojection = 'orthographic'\n\
             viewing_rectangle = [4, 3]\nviewpoint_distance = 1\n[[triangles]]\n\
             vertices = [[{}, -9, 0], [{}, -9, 0], [{x}, 9, 0]]\n",
            x - 9.0,
            x + 9.0
        )
    };
    std::fs::write(&near, text(0.0)).expect("written");
    std::fs::write(&far, text(1e6)).expect("written");
    let values = |scene: &Path| {
        let file = folder.path().join("a.exr");
        kiln(&["--aov", "depth,position"]).arg(scene).arg("-o").arg(&file).assert().success();
        channels(&file)
    };
    let (near, far) = (values(&near), values(&far));
    assert_eq!(near["Depth.Z"], vec![2.0; (SIZE[0] * SIZE[1]) as usize]);
    assert_eq!(near["Depth.Z"], far["Depth.Z"]);
    for (near, far) in near["Position.X"].iter().zip(&far["Position.X"]) {
        // f32 has steps of 1/16 at a million.
        assert!((near + 1e6 - far).abs() <= 0.0625, "{near} {far}");
    }
}

#[test]
fn the_file_has_the_channels_of_the_selected_aovs() {
    let folder = tempfile::tempdir().expect("a folder");
    let names = |aov: &str| render("assignment", aov, folder.path()).into_keys().collect::<Vec<_>>();
    assert_eq!(names("depth,object"), ["B", "Depth.Z", "G", "Object.X", "R", "Z"]);
    let all = names("all");
    for aov in AOVS {
        assert!(aov.channels.iter().all(|channel| all.iter().any(|name| name == channel)), "{}", aov.name);
    }
    // Shadows and glaze; the scene has no smooth mesh.
    let layers = ["Base.R", "EffectGlaze.R", "EffectShadows.R"];
    assert!(layers.iter().all(|layer| all.iter().any(|name| name == layer)), "{all:?}");
    assert!(!all.iter().any(|name| name.starts_with("EffectTerminator")), "{all:?}");
}

#[test]
fn the_picture_itself_stays_the_same() {
    let folder = tempfile::tempdir().expect("a folder");
    let plain = folder.path().join("plain.exr");
    kiln(&["scenes/assignment.toml", "-o"]).arg(&plain).assert().success();
    let (plain, all) = (channels(&plain), render("assignment", "all", folder.path()));
    for letter in ["R", "G", "B"] {
        assert_eq!(plain[letter], all[letter]);
    }
}

#[test]
fn only_selected_aovs_are_computed() {
    let prepared = prepare(load(&repository("scenes/effects/glaze.toml")), SIZE, Numerics::Watertight);
    let plan = Plan::new(&prepared.world, &prepared.plan_settings(PlanSettings::default())).expect("a plan");
    let film = prepared.render(PlanSettings::default()).0;
    let Prepared { world, view, .. } = &prepared;
    let source = AovSource {
        world,
        recentering: None,
        view,
        plan: &plan,
        window: film.window(),
        shard: kiln::farm::Shard::ALL,
        film: Some(&film),
        display: Default::default(),
    };
    // Cancelled from the start: whatever is computed ends with an error.
    let control = RenderControl { cancel: &AtomicBool::new(true), progress: &|_, _| {}, time_stages: false };
    let select = |names: &[&str]| {
        AovSelection::new(&names.iter().map(|&n| n.into()).collect::<Vec<_>>()).expect("names")
    };
    assert!(aov::channels(&source, &select(&[]), &control).is_ok_and(|channels| channels.is_empty()));
    for name in ["depth", "effects"] {
        assert_eq!(
            aov::channels(&source, &select(&[name]), &control).err(),
            Some(Error::Interrupted),
            "{name}"
        );
    }
}

#[test]
fn equal_input_gives_equal_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    let bytes = |aov: &[&str], threads: &str| {
        let file = folder.path().join("a.exr");
        let mut command = kiln(&["scenes/assignment.toml", "--threads", threads, "-o"]);
        command.arg(&file).args(aov).assert().success();
        std::fs::read(&file).expect("it was written")
    };
    for aov in [&[][..], &["--aov", "all"]] {
        let first = bytes(aov, "1");
        // Names in the order of a hash map, which each process seeds anew, would agree by chance: once in n! runs for n
        // names.
        assert!((0..4).all(|i| bytes(aov, ["1", "2"][i % 2]) == first));
    }
    // The order of names, and names given twice, change nothing in the file.
    let [a, b] = ["depth,normal", "normal,depth,normal"].map(|aov| bytes(&["--aov", aov], "1"));
    assert!(a == b);
}

#[test]
fn wrong_formats_and_names_are_errors() {
    let folder = tempfile::tempdir().expect("a folder");
    let fails = |output: &str, aov: &str, line: &str| {
        let output = folder.path().join(output);
        let run = kiln(&["scenes/assignment.toml", "--aov", aov, "-o"]).arg(&output).assert().code(2);
        let said = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
        assert!(said.contains(line) && !output.exists(), "{said}");
    };
    fails("a.png", "depth", "only .exr holds AOVs");
    fails("a.exr", "depht", "there is no AOV `depht`\nhint: did you mean `depth`?");
}
