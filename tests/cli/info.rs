//! `kiln info`: defects of meshes, what materials use, sizes, cost, and what is left out.

use crate::common::repository;
use crate::helpers;
use crate::workshop::{Workshop, text};
use serde_json::{Value, json};

impl Workshop {
    /// The output of `kiln info` with these arguments, which must succeed.
    #[track_caller]
    fn info(&self, arguments: &str) -> String {
        self.code(&format!("info {arguments}"), 0).0
    }

    #[track_caller]
    fn json(&self, arguments: &str) -> Value {
        serde_json::from_str(&self.info(&format!("{arguments} --json"))).expect("it is JSON")
    }
}

/// A cube of quadrilaterals without the face z = 1, and a tetrahedron of side 1 at x = 5 whose triangles are wound
/// inwards, one of them twice. A curve is not drawn.
const BROKEN: &str = "
o box
v 0 0 0
v 1 0 0
v 0 1 0
v 1 1 0
v 0 0 1
v 1 0 1
v 0 1 1
v 1 1 1
f 1 5 7 3
f 2 4 8 6
f 1 2 6 5
f 3 7 8 4
f 1 3 4 2
o inside-out
v 5 0 0
v 6 0 0
v 5 1 0
v 5 0 1
f 9 10 11
f 9 12 10
f 9 11 12
f 10 12 11
curv 0 1 1 2
";

#[test]
fn a_broken_file_is_told_what_is_wrong_with_it() {
    let workshop = Workshop::with("broken.obj", BROKEN);
    let report = workshop.json("broken.obj");
    assert_eq!(report["schema"], 1);
    let geometry = &report["geometry"];
    // The box: 8 vertices, 12 edges and 5 diagonals; the hole has 4 edges. The tetrahedron: 4 vertices, 6 edges.
    for (key, expected) in [
        ("vertices", 12),
        ("edges", 23),
        ("components", 2),
        ("closed_components", 1),
        ("boundary_edges", 4),
        ("holes", 1),
        ("inverted_components", 1),
        ("non_manifold_edges", 0),
        ("inconsistent_edges", 0),
        ("t_junctions", 0),
        ("duplicate_triangles", 0),
        ("opposed_to_normals", 0),
    ] {
        assert_eq!(geometry[key], expected, "{key}");
    }
    let firsts = geometry["first"].as_object().expect("places");
    assert_eq!(firsts.keys().collect::<Vec<_>>(), ["boundary_edges", "inverted_components"]);
    assert_eq!(firsts["boundary_edges"]["object"], "box");
    assert_eq!(firsts["boundary_edges"]["position"][2], 1.0);
    assert_eq!(
        (&firsts["inverted_components"]["object"], &firsts["inverted_components"]["triangle"]),
        (&json!("inside-out"), &json!(0))
    );
    // Each object by itself, with the triangles that it has.
    let objects = report["objects"].as_array().expect("a list");
    let facts = |index: usize| {
        let keys = ["name", "primitives", "triangles", "closed"];
        keys.map(|key| objects[index][key].clone())
    };
    assert_eq!(facts(0), [json!("box"), json!(10), json!(10), json!(false)]);
    assert_eq!(facts(1), [json!("inside-out"), json!(4), json!(4), json!(true)]);
    let curve = "broken.obj:25: free-form curves and surfaces are not drawn";
    assert_eq!((&report["left_out"], &report["warnings"]), (&json!([curve]), &json!([curve])));
    // The first triangle of the tetrahedron is (5, 0, 0), (6, 0, 0), (5, 1, 0), whose middle is (16/3, 1/3, 0).
    let said = workshop.info("broken.obj");
    for line in [
        "object      box: 10 triangles, open\n",
        "object      inside-out: 4 triangles, closed\n",
        "geometry    12 vertices, 23 edges, 2 connected component(s), 1 of them closed\n",
        "geometry    4 boundary edge(s) of one triangle only, around 1 hole(s) or open side(s); the first in `box` at ",
        "inner walls of hollow bodies; the first in `inside-out` at (5.3333335, 0.33333334, 0)\n",
        &format!("warning     {curve}\n"),
    ] {
        assert!(said.contains(line), "{line} is not in: {said}");
    }
}

const SCENE: &str = "
[[camera]]
name = 'wide'
position = [0, 0, 10]
look_at = [0, 0, 0]
vertical_fov = 90
focus_distance = 2
[[camera]]
name = 'flat'
projection = 'orthographic'
position = [0, 0, 10]
look_at = [0, 0, 0]
viewing_height = 3
viewpoint_distance = 10
[[light]]
name = 'sun'
type = 'directional'
direction = [0, -1, -1]
intensity = 2.5
[material.glass]
colour = '#ffffff'
metallic = 0
roughness = 0
opacity = 0.5
layers = { transmission = 1, ior = 1.33, volume = true }
[material.lamp]
colour = '#ffffff'
emission = '#ffffff'
emission_intensity = 3
[[sphere]]
centre = [0, 0, 0]
radius = 1
material = 'glass'
";

#[test]
fn materials_cameras_and_lights_are_described() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let report = workshop.json("scene.toml");
    let material = |name: &str| {
        let all = report["materials"].as_array().expect("a list");
        all.iter().find(|material| material["name"] == name).expect("the material")
    };
    let glass = material("glass");
    assert_eq!(
        (&glass["transmission"], &glass["ior"], &glass["objects"]),
        (&json!(1.0), &json!(1.33), &json!(1))
    );
    assert_eq!(
        (&glass["colour"], &glass["metallic"], &glass["roughness"]),
        (&json!([1.0, 1.0, 1.0]), &json!(0.0), &json!(0.0))
    );
    assert_eq!(glass["opacity"], json!({ "mode": "blend", "factor": 0.5, "cutoff": null }));
    assert_eq!(glass["volume"]["attenuation_distance"], Value::Null);
    assert!(glass.get("clearcoat").is_none() && glass.get("emission").is_none());
    // White is 1 in linear light.
    assert_eq!(
        (&material("lamp")["emission"], &material("lamp")["objects"]),
        (&json!([3.0, 3.0, 3.0]), &json!(0))
    );
    let of_camera = |index: usize| report["cameras"][index]["field_of_view"].as_f64();
    assert!(of_camera(0).is_some_and(|degrees| (degrees - 90.0).abs() < 1e-12) && of_camera(1).is_none());
    let lens = json!({ "radius": 0.0, "focus": { "distance": 2.0 }, "blades": 0, "blade_rotation": 0.0 });
    assert_eq!((&report["cameras"][0]["lens"], &report["cameras"][1]["lens"]), (&lens, &Value::Null));
    // Local shading, the default, does not draw glass.
    let left_out = report["left_out"].as_array().expect("a list");
    assert!(
        left_out.len() == 1 && left_out[0].as_str().is_some_and(|text| text.contains("`glass`")),
        "{left_out:?}"
    );
    let effects = report["effects"].as_array().expect("a list");
    let on: Vec<&Value> = effects.iter().filter(|e| e["on"] == true).map(|e| &e["name"]).collect();
    assert_eq!(on, ["alpha", "shadows"]);
    let said = workshop.info("scene.toml");
    for line in [
        "material    glass (metallic-roughness): colour (1, 1, 1); metallic 0; roughness 0; opacity by blend, factor \
         0.5; transmission 1; ior 1.33; volume\n",
        "material    lamp (phong): colour (1, 1, 1); emission (3, 3, 3); unused\n",
        "cameras     2: wide (perspective, 90.0 degrees high, aperture of radius 0, focus on a distance of 2), \
         flat (orthographic, 3 high)\n",
        "lights      1: sun (directional, intensity 2.5)\n",
        "effects     alpha, shadows\n",
    ] {
        assert!(said.contains(line), "{line} is not in: {said}");
    }
    // Spheres have no topology, but are closed.
    let sphere = &report["objects"][0];
    assert_eq!((&sphere["triangles"], &sphere["closed"]), (&json!(0), &json!(true)));
    assert!(said.contains(": sphere, closed\n"), "{said}");
    assert!(!said.contains("geometry "), "{said}");
}

/// The text has names; JSON has the paths as they were given.
#[test]
fn the_text_has_file_names_and_json_has_paths() {
    let workshop = Workshop::with("broken.obj", BROKEN);
    let folder = workshop.0.path().join("a folder");
    std::fs::create_dir(&folder).expect("a folder in it");
    std::fs::rename(workshop.0.path().join("broken.obj"), folder.join("broken.obj")).expect("it is moved");
    let path = folder.join("broken.obj").display().to_string();
    let info = |options: &str| {
        let output = workshop.command(&format!("info {options}")).arg(&path).output();
        text(&output.expect("the command starts").stdout)
    };
    let said = info("");
    assert!(said.starts_with("input       broken.obj\n"), "{said}");
    assert!(said.contains("\nwarning     broken.obj:25: free-form curves"), "{said}");
    assert!(!said.contains("a folder"), "{said}");
    let report: Value = serde_json::from_str(&info("--json")).expect("JSON");
    assert_eq!(report["inputs"], json!([path]));
    assert_eq!(report["objects"][0]["input"], json!(path));
    assert!(report["warnings"][0].as_str().is_some_and(|text| text.starts_with(&path)));
}

#[test]
fn of_many_objects_the_first_are_listed() {
    let mut text = String::new();
    for index in 0..18 {
        text += &format!("o part{index}\nv {index} 0 0\nv {index} 1 0\nv {index} 0 1\nf -3 -2 -1\n");
    }
    let workshop = Workshop::with("parts.obj", &text);
    let said = workshop.info("parts.obj");
    assert_eq!(said.matches("\nobject      part").count(), 16, "{said}");
    assert!(said.contains("\nobject      2 more, 0 of them closed; --json lists all\n"), "{said}");
    assert_eq!(workshop.json("parts.obj")["objects"].as_array().map(Vec::len), Some(18));
}

/// An image of 2 by 2 texels of 3 bytes, and the level of one texel of 6 bytes.
#[test]
fn textures_have_their_bytes() {
    let fixture = repository("assets/import/materials.obj").display().to_string();
    let workshop = Workshop::with("none", "");
    let report = workshop.json(&fixture);
    let texture = &report["textures"][0];
    assert_eq!((&texture["bytes"], &texture["mip_map_bytes"]), (&json!(12), &json!(6)));
    let memory = &report["memory"];
    assert_eq!((&memory["textures"], &memory["mip_maps"]), (&json!(12), &json!(6)));
    let bytes = |key: &str| memory[key].as_u64().unwrap_or(0);
    // 6 triangles of 12 bytes of indices at least.
    assert!(bytes("meshes") >= 72 && bytes("acceleration_structure") > 0);
    assert!(!cfg!(target_os = "linux") || bytes("peak") > bytes("acceleration_structure"));
    assert_eq!((&report["build"]["measured"], &report["build"]["error"]), (&json!(true), &Value::Null));
    let said = workshop.info(&fixture);
    assert!(said.contains("pictured (phong): colour (1, 1, 1); textures: base colour\n"), "{said}");
    assert!(said.contains("textures    1: four.png (2 x 2)\n"), "{said}");
}

#[test]
fn a_file_that_cannot_be_rendered_says_why() {
    let workshop = Workshop::with("points.obj", "v 0 0 0\np 1\n");
    // The contents are printed before the error.
    let said = workshop.code("info points.obj", 3).0;
    assert!(said.contains("render      not possible: points.obj: has no triangles to draw\n"), "{said}");
    let report: Value = serde_json::from_str(&workshop.code("info points.obj --json", 3).0).expect("JSON");
    assert_eq!(report["left_out"], json!(["points.obj: points and lines are not drawn"]));
    assert_eq!(report["build"]["error"], "points.obj: has no triangles to draw");
    assert_eq!((&report["effects"], &report["geometry"]["edges"]), (&Value::Null, &json!(0)));
}

#[test]
fn info_says_what_a_file_holds() {
    let workshop = Workshop::with("scene.toml", helpers::SCENE);
    let fixture = repository("assets/import/materials.obj");
    let output = workshop.run(&format!("info {}", fixture.display()));
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), String::new()));
    let said = text(&output.stdout);
    // Two squares of two triangles and two single triangles, which are four runs of one material each; the bounds are
    // (0,0,0) to (2,1,0).
    for line in [
        "objects     4 (6 triangles, 0 spheres)\n",
        "bounds      (0, 0, 0) to (2, 1, 0)\n",
        "size        (2, 1, 0)\n",
        "cameras     none\n",
    ] {
        assert!(said.contains(line), "{line} is not in: {said}");
    }
    let output = workshop.run(&format!("info {} scene.toml --json", fixture.display()));
    let report: Value = serde_json::from_slice(&output.stdout).expect("it is JSON");
    assert_eq!(report["schema"], 1);
    assert_eq!(
        (&report["triangles"], &report["spheres"], &report["primitives"]),
        (&6.into(), &1.into(), &7.into())
    );
    // The sphere extends from -2 to 2 on all axes.
    assert_eq!(report["bounds"]["min"], serde_json::json!([-2.0, -2.0, -2.0]));
    assert_eq!(report["bounds"]["max"], serde_json::json!([2.0, 2.0, 2.0]));
    assert_eq!(report["cameras"][1]["name"], "above");
    assert_eq!((&report["textures"][0]["width"], &report["textures"][0]["height"]), (&2.into(), &2.into()));
    assert_eq!(report["objects"][4]["input"], "scene.toml");
    // Warnings about a file are part of the result.
    workshop
        .write("odd.obj", "mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nf 1 2 3\nf 1 2 4\nf 1 1 2\n");
    let output = workshop.run("info odd.obj");
    let said = text(&output.stdout);
    assert!(said.contains("warning     odd.obj: materials left out: gone.mtl: no such file\n"), "{said}");
    assert!(said.contains("no area     1 triangle(s), kept because they may close T-vertices\n"), "{said}");
    let note = "note        odd.obj: 1 triangle(s) with two equal corners, which no ray hits\n";
    assert!(said.contains(note), "{said}");
}
