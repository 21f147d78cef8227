//! Files with several instances of a mesh: the mesh is stored once, and the scene is the same as with a copy per
//! instance.

use std::fmt::Write;

use crate::common;
use crate::common::borders::Folder;
use crate::common::gltf::Model;
use crate::common::picture::{bits, equip, prepare};
use glam::DQuat;
use kiln::effects::PlanSettings;
use kiln::scene::{Numerics, Scene, Shape};
use serde_json::{Value, json};

/// The number of instances of a mesh of this many triangles in these tests, so that sharing saves more than 2^18
/// triangles: from there on meshes are shared.
const PLACES: usize = 400;
const SIDE: usize = 20;

/// An uneven square of `side * side * 2` triangles.
fn square(side: usize) -> Vec<[[f32; 3]; 3]> {
    let point = |i: usize, j: usize| {
        let height = ((i * 7 + j * 13) % 11) as f32 / 40.0;
        [i as f32 / side as f32 - 0.5, height, j as f32 / side as f32 - 0.5]
    };
    let tile = |k: usize| {
        let (i, j) = (k % side, k / side);
        let [a, b, c, d] = [point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    (0..side * side).flat_map(tile).collect()
}

fn obj(triangles: &[[[f32; 3]; 3]]) -> String {
    let mut text = String::from("vn 0 1 0\nvn 0.3 1 -0.2\nvn 0 2 0.5\n");
    for [x, y, z] in triangles.iter().flatten() {
        writeln!(text, "v {x} {y} {z}").unwrap();
    }
    for k in 0..triangles.len() {
        let [a, b, c] = [3 * k + 1, 3 * k + 2, 3 * k + 3];
        writeln!(text, "f {a}//1 {b}//2 {c}//3").unwrap();
    }
    text
}

/// The keys of the instance with this index.
fn place(i: usize) -> [String; 3] {
    let (x, z) = (i % 20, i / 20);
    let sign = if i.is_multiple_of(4) { "-" } else { "" };
    [
        format!("translate = [{}.25, {}.1, -{}.5]", x * 2, i % 3, z * 2),
        format!("rotate = [{}, {}, 10]", i * 7 % 360, i * 31 % 360),
        if i.is_multiple_of(2) {
            format!("scale = 1.{i}")
        } else {
            format!("scale = [{sign}1.5, 0.7, {i}e-2]")
        },
    ]
}

/// The same scene in three forms: one entry with all instances, one entry for each, and one file for each.
fn three_ways(mesh: &str) -> [(Scene, Vec<String>); 3] {
    let folder = Folder::new();
    folder.write("a.obj", mesh);
    let head = "[material.red]\ncolour = '#ff0000'\nglaze = { weight = 0.5 }\n[[light]]\ntype = 'directional'\ndirection = [1, -2, -1]\n";
    let mut texts = [head, head, head].map(String::from);
    for half in [0, 1] {
        let material = if half == 1 { "material = 'red'\n" } else { "" };
        let places = (half * PLACES / 2..(half + 1) * PLACES / 2).map(place);
        let listed: Vec<String> = places.clone().map(|keys| format!("{{ {} }}", keys.join(", "))).collect();
        writeln!(texts[0], "[[mesh]]\nfile = 'a.obj'\n{material}placements = [\n{},\n]", listed.join(",\n"))
            .unwrap();
        for (i, keys) in places.enumerate() {
            let own = format!("a{half}-{i}.obj");
            folder.write(&own, mesh);
            for (text, file) in texts[1..].iter_mut().zip(["a.obj", &own]) {
                writeln!(text, "[[mesh]]\nfile = '{file}'\n{material}{}", keys.join("\n")).unwrap();
            }
        }
    }
    texts.map(|text| folder.load("scene.toml", text))
}

fn is_shared(scene: &Scene) -> bool {
    scene.objects.iter().all(|object| matches!(object.shape, Shape::Placed(_)))
}

/// Asserts that two scenes have equal objects, bounds and cameras, and equal pictures.
fn assert_same(a: &Scene, b: &Scene) {
    let facts = |scene: &Scene| {
        let object = |object: &kiln::scene::Object| {
            let material = scene.materials[object.material.0 as usize].name().to_owned();
            (object.name.clone(), material, object.shape.primitive_count())
        };
        (scene.objects.iter().map(object).collect::<Vec<_>>(), scene.bounds(), scene.cameras.clone())
    };
    let [mut a, mut b] = [a.clone(), b.clone()];
    equip(&mut a);
    equip(&mut b);
    assert!(facts(&a) == facts(&b));
    let size = [80, 60];
    for numerics in [Numerics::Watertight, Numerics::Double] {
        let [a, b] = [&a, &b].map(|scene| {
            let prepared = prepare(scene.clone(), size, numerics);
            bits(&prepared.render(PlanSettings::default()).0, size)
        });
        assert!(a == b && a.iter().any(|pixel| *pixel != a[0]), "{}", numerics.name());
    }
}

#[test]
fn places_are_as_good_as_entries_and_entries_as_files() {
    let [(listed, none), (entries, _), (files, _)] = three_ways(&obj(&square(SIDE)));
    assert_eq!((listed.primitive_count(), none), (PLACES * SIDE * SIDE * 2, vec![]));
    assert!(is_shared(&listed) && is_shared(&entries) && !is_shared(&files));
    assert_same(&listed, &files);
    assert_same(&entries, &files);
}

#[test]
fn what_is_odd_in_a_shared_mesh_is_left_out_and_counted_alike() {
    // In every instance, triangles with a corner that is not finite are left out; those without area are kept.
    let mut text = obj(&square(SIDE));
    let first = 3 * square(SIDE).len() + 1;
    let mut add = |corners: [[f64; 3]; 3], nth: usize| {
        for [x, y, z] in corners {
            writeln!(text, "v {x} {y} {z}").unwrap();
        }
        let [a, b, c] = [0, 1, 2].map(|k| first + 3 * nth + k);
        writeln!(text, "f {a} {b} {c}").unwrap();
    };
    let on_a_line =
        |p: f64, q: f64, r: f64| [[p, q, r], [p * 2.0, q * 2.0, r * 2.0], [p * 4.0, q * 4.0, r * 4.0]];
    add([[f64::NAN, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], 0);
    add([[0.5, 0.5, 0.5], [1.0, 0.0, 0.0], [0.5, 0.5, 0.5]], 1);
    add(on_a_line(0.1, 0.2, 0.3), 2);
    add(on_a_line(0.0, 0.7, 0.0), 3);
    let [(listed, warnings), _, (files, expected)] = three_ways(&text);
    assert!(is_shared(&listed) && !is_shared(&files));
    assert_eq!(warnings, expected);
    assert_eq!(
        warnings[0],
        format!("scene.toml: left out {PLACES} triangle(s) with a vertex that is not a finite number")
    );
    assert_eq!(listed.primitive_count(), PLACES * (SIDE * SIDE * 2 + 3));
    assert_same(&listed, &files);
}

#[test]
fn small_meshes_are_copied() {
    let folder = Folder::new();
    folder.write("a.obj", obj(&square(2)));
    let (scene, _) =
        folder.load("a.toml", "[[mesh]]\nfile = 'a.obj'\nplacements = [{}, { translate = [1, 2, 3] }]\n");
    assert_eq!((scene.objects.len(), scene.primitive_count()), (2, 16));
    let Shape::Mesh(second) = &scene.objects[1].shape else { panic!("it is shared") };
    assert_eq!(second.positions[0].to_array(), [0.5, 2.0, 2.5]);
    // Without any instance nothing is drawn, but the file is read and checked.
    let (scene, _) = folder.load("a.toml", "[[mesh]]\nfile = 'a.obj'\nplacements = []\n");
    assert_eq!(scene.objects.len(), 0);
    folder.fails("a.toml", "[[mesh]]\nfile = 'b.obj'\nplacements = []\n");
}

#[test]
fn what_is_wrong_with_a_place_is_said_with_its_line() {
    let folder = Folder::new();
    folder.write("a.obj", obj(&square(2)));
    for (keys, message, hint) in [
        ("placements = [\n{},\n{ scale = 0 },\n]", "a.toml:5: `scale` is 0", "a mesh without size"),
        (
            "placements = [\n{},\n{ translate = [inf, 0, 0] }]",
            "a.toml:5: `translate` holds inf",
            "give a finite",
        ),
        (
            "placements = [\n{ rotation = [0, 0, 0] }]",
            "a.toml:4: unknown key `rotation`",
            "did you mean `rotate`?",
        ),
        ("placements = 3", "a.toml:3: `placements` is 3, expected a list", ""),
        (
            "scale = 2\nplacements = [{}]",
            "a.toml:1: `scale` beside `placements`",
            "give it in every placement",
        ),
        ("placement = [{}]", "a.toml:3: unknown key `placement`", "did you mean `placements`?"),
    ] {
        let e = folder.fails("a.toml", format!("[[mesh]]\nfile = 'a.obj'\n{keys}\n"));
        let text = e.to_string();
        assert!(text.contains(message), "{text}, expected {message}");
        assert!(e.hint().starts_with(hint), "{}, expected {hint}", e.hint());
    }
}

#[test]
fn more_than_can_be_numbered_is_an_error() {
    // 230 x 230 x 2 triangles in 40,600 instances are 4,295,480,000; indices end at 4,294,967,295.
    let folder = Folder::new();
    folder.write("a.obj", obj(&square(230)));
    let text = format!("[[mesh]]\nfile = 'a.obj'\nplacements = [{}]\n", "{}, ".repeat(40_600));
    let e = folder.fails("a.toml", text);
    assert!(e.to_string().ends_with("a.toml: 4295480000 triangles; the limit is 4294967295"), "{e}");
}

/// An uneven square in glTF, with normals.
fn model() -> Model {
    let corners: Vec<[f32; 3]> = square(SIDE).into_iter().flatten().collect();
    let mut model = Model::new(&corners);
    model.attribute("NORMAL", &corners.iter().map(|[x, _, z]| [*x, 1.0, z / 2.0]).collect::<Vec<_>>());
    model
}

/// The transform of the node with this index, in numbers of few digits.
fn transform(i: usize) -> ([f32; 3], [f32; 4], [f32; 3]) {
    let at = [(i % 20) as f32 * 2.5, (i % 3) as f32, (i / 20) as f32 * -1.75];
    let angle = i as f64 * 0.37;
    let rotation = DQuat::from_rotation_y(angle) * DQuat::from_rotation_x(0.2 * angle);
    (at, rotation.to_array().map(|x| x as f32), [1.0, 0.5 + (i % 5) as f32 / 4.0, 0.75])
}

fn nodes(mesh_of: impl Fn(usize) -> usize) -> Value {
    let node = |i: usize| {
        let (translation, rotation, scale) = transform(i);
        json!({ "name": "it", "mesh": mesh_of(i), "translation": translation, "rotation": rotation, "scale": scale })
    };
    (0..PLACES).map(node).collect()
}

#[test]
fn nodes_of_the_same_mesh_share_it() {
    let all: Vec<usize> = (0..PLACES).collect();
    let mut shared = model();
    shared.json["nodes"] = nodes(|_| 0);
    shared.json["scenes"] = json!([{ "nodes": all }]);
    let mut own = model();
    own.json["nodes"] = nodes(|i| i);
    own.json["scenes"] = json!([{ "nodes": all }]);
    own.json["meshes"] = vec![own.json["meshes"][0].clone(); PLACES].into();
    // All instances of one node.
    let mut instanced = model();
    let transforms: Vec<_> = (0..PLACES).map(transform).collect();
    instanced.attribute("_T", &transforms.iter().map(|t| t.0).collect::<Vec<_>>());
    instanced.attribute("_R", &transforms.iter().map(|t| t.1).collect::<Vec<_>>());
    instanced.attribute("_S", &transforms.iter().map(|t| t.2).collect::<Vec<_>>());
    let name = "EXT_mesh_gpu_instancing";
    let attributes = json!({ "TRANSLATION": 2, "ROTATION": 3, "SCALE": 4 });
    instanced.primitive()["attributes"] = json!({ "POSITION": 0, "NORMAL": 1 });
    instanced.json["nodes"][0]["extensions"] = json!({ name: { "attributes": attributes } });
    instanced.json["extensionsUsed"] = json!([name]);
    instanced.json["extensionsRequired"] = json!([name]);

    let folder = Folder::new();
    let [(shared, said), (own, _), (instanced, none)] =
        [shared, own, instanced].map(|model| folder.load("a.glb", model.binary()));
    assert_eq!((said.len(), none.len()), (0, 0), "{said:?} {none:?}");
    assert!(is_shared(&shared) && is_shared(&instanced) && !is_shared(&own));
    assert_same(&shared, &own);
    assert_same(&instanced, &own);
}

#[test]
fn a_file_that_shares_may_be_placed_again() {
    let mut shared = model();
    shared.json["nodes"] = nodes(|_| 0);
    shared.json["scenes"] = json!([{ "nodes": (0..PLACES).collect::<Vec<_>>() }]);
    let mut own = model();
    own.json["nodes"] = nodes(|i| i);
    own.json["scenes"] = shared.json["scenes"].clone();
    own.json["meshes"] = vec![own.json["meshes"][0].clone(); PLACES].into();
    let folder = Folder::new();
    folder.write("shared.glb", shared.binary());
    folder.write("own.glb", own.binary());
    folder.write("again.glb", own.binary());
    let entry = |file: &str, z: i32| {
        format!("[[mesh]]\nfile = '{file}.glb'\nrotate = [0, 30, 0]\nscale = 0.3\ntranslate = [0, 0, {z}]\n")
    };
    let (shared, _) = folder.load("a.toml", entry("shared", 0) + &entry("shared", 9));
    let (own, _) = folder.load("a.toml", entry("own", 0) + &entry("again", 9));
    assert!(is_shared(&shared) && !is_shared(&own));
    assert_same(&shared, &own);
}

#[test]
fn places_of_a_node_that_are_not_usable_are_errors() {
    let folder = Folder::new();
    for (attributes, message) in [
        (json!({}), "has no attributes"),
        (json!({ "TRANSLATION": 9 }), "it names an accessor that is not there"),
        (json!({ "ROTATION": 0 }), "its rotations are not quaternions"),
        (json!({ "TRANSLATION": 2 }), "its translations or scales are not three numbers each"),
        (json!({ "TRANSLATION": 0, "ROTATION": 2 }), "its attributes differ in number"),
    ] {
        let mut model = Model::new(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        model.attribute("NORMAL", &[[0.0, 0.0, 1.0]; 3]);
        model.attribute("COLOR_0", &[[1.0, 1.0, 1.0, 1.0]; 2]);
        model.primitive()["attributes"] = json!({ "POSITION": 0 });
        model.json["nodes"][0]["extensions"] =
            json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } });
        let e = folder.fails("a.glb", model.binary());
        assert!(e.to_string().ends_with(&format!("node 0, EXT_mesh_gpu_instancing: {message}")), "{e}");
    }
}

#[test]
fn the_sunflower_is_one_ball() {
    let scene = common::picture::load(&common::repository("scenes/sunflower.toml"));
    let is_ball =
        |shape: &Shape| matches!(shape, Shape::Placed(placed) if placed.mesh.triangles.len() == 320);
    assert_eq!(scene.objects.iter().filter(|object| is_ball(&object.shape)).count(), 850);
    // All of them are on the ground or above it.
    assert_eq!(scene.bounds().expect("something to see").0.y, 0.0);
}

#[test]
#[ignore = "needs KILN_MODELS"]
fn with_models_ten_thousand_bunnies_take_little_more_than_one() {
    let models = common::models();
    let folder = Folder::new();
    let file = models.join("stanford-bunny.obj");
    let peak = |places: usize| {
        let place = |i: usize| {
            let [x, z, angle] = [i % 100, i / 100, i * 37 % 360].map(|x| x as f64);
            format!("{{ translate = [{}, 0, -{}], rotate = [0, {angle}, 0] }}", x / 5.0, z / 5.0)
        };
        let places: Vec<String> = (0..places).map(place).collect();
        let text = format!(
            "[[camera]]\nposition = [10, 5, 6]\nlook_at = [10, 0, -5]\n[[light]]\ntype = 'point'\nposition = [0, 9, 9]\n\
             [[mesh]]\nfile = '{}'\nplacements = [\n{}\n]\n",
            file.display(),
            places.join(",\n")
        );
        let scene = folder.write("bunnies.toml", text);
        let statistics = scene.with_extension("json");
        assert_cmd::Command::new(assert_cmd::cargo::cargo_bin!("kiln"))
            .arg("render")
            .arg(&scene)
            .args(["--size", "160x120", "--progress", "none", "--stats"])
            .arg(&statistics)
            .arg("-o")
            .arg(scene.with_extension("png"))
            .assert()
            .success();
        let text = std::fs::read_to_string(statistics).expect("statistics");
        let statistics: Value = serde_json::from_str(&text).expect("JSON");
        (statistics["primitives"].as_u64(), statistics["peak_memory_bytes"].as_u64())
    };
    let (one, many) = (peak(1), peak(10_000));
    assert_eq!((one.0, many.0), (Some(69_451), Some(694_510_000)));
    if let (Some(one), Some(many)) = (one.1, many.1) {
        eprintln!("{} MiB more", (many - one) >> 20);
        assert!(many - one < 64 << 20, "{one} and {many} bytes");
    }
}
