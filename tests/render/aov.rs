//! AOVs: the channels that `--aov` adds to an EXR file.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::atomic::AtomicBool;

use crate::common::picture::{Prepared, load, prepare};
use crate::common::repository;
use assert_cmd::Command;
use kiln::effects::{Choices, Plan};
use kiln::error::Error;
use kiln::render::RenderControl;
use kiln::render::aov::{self, AOVS, AovSelection, AovSource};
use kiln::scene::Numerics;
use kiln::shading::{ShadingMode, shade};

const SIZE: [u32; 2] = [48, 36];

fn kiln(arguments: &[&str]) -> Command {
    let mut command = Command::cargo_bin("kiln").expect("the command is built with the tests");
    command
        .current_dir(repository("."))
        .args(["render", "--progress", "none", "--size", "48x36"])
        .args(arguments);
    command
}

/// The channels of an EXR file by name, row by row from the top.
fn channels(file: &Path) -> BTreeMap<String, Vec<f32>> {
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
            assert_eq!(at("Depth.Z"), f32::INFINITY);
            assert_eq!(["Object.X", "Material.X", "Primitive.X"].map(at), [-1.0; 3]);
            assert_eq!(
                ["Position", "Normal", "GeometricNormal"].map(|layer| three(layer, xyz)),
                [[0.0; 3]; 3]
            );
            assert_eq!(three("Albedo", rgb), [0.0; 3]);
            continue;
        };
        let surface = prepared.world.interaction(ray, &hit);
        assert_eq!(at("Depth.Z"), hit.t as f32);
        assert_eq!(three("Position", xyz), surface.point.position.as_vec3().to_array());
        assert_eq!(three("Normal", xyz), surface.shading_normal.as_vec3().to_array());
        assert_eq!(three("GeometricNormal", xyz), surface.geometric_normal.as_vec3().to_array());
        let albedo = shade(&prepared.world, ShadingMode::Flat, &surface, &[]);
        assert_eq!(three("Albedo", rgb), albedo.as_vec3().to_array());
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
    assert_eq!(names("depth,object"), ["B", "Depth.Z", "G", "Object.X", "R"]);
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
    let plan = Plan::new(&prepared.world, &prepared.choices(Choices::default())).expect("a plan");
    let film = prepared.render(Choices::default()).0;
    let Prepared { world, view, .. } = &prepared;
    let source = AovSource {
        world,
        recentering: None,
        view,
        plan: &plan,
        window: film.window(),
        share: kiln::film::Share::ALL,
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
