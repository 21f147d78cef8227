//! Cameras of options, of scene files, and those that are found for a mesh.

use serde_json::json;

use crate::common::gltf::Model;
use crate::helpers::{SCENE, check_error, image_bits, metadata};
use crate::workshop::{Workshop, text};

/// Given again, the automatic camera that metadata and `kiln info` print makes the same picture: of a mesh, of one beside a
/// camera, which alone would leave out ground and background, and of two meshes.
#[test]
fn an_automatic_camera_can_be_given_again() {
    let workshop =
        Workshop::with("a.obj", "v 0 0 0\nv 4 0 0\nv 0 3 0\nv 0 0 2\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
    workshop.write("b.obj", "v 9 0 0\nv 9.01 0 0\nv 9 0.01 0\nf 1 2 3\n");
    workshop.write(
        "eye.gltf",
        r#"{ "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "camera": 0 }],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }] }"#,
    );
    for (inputs, options) in [
        ("a.obj", ""),
        ("a.obj", "--view iso --azimuth=-30 --elevation 10 --zoom 1.5 --fov 50"),
        ("a.obj", "--projection orthographic --zoom 0.5"),
        ("a.obj eye.gltf", "--camera auto"),
        ("a.obj b.obj", ""),
    ] {
        let said = workshop.succeed(&format!("render {inputs} -o a.png --size 24x16 {options}"));
        assert_eq!(said.contains("b.obj is 0."), inputs.contains("b.obj"), "{said}");
        let table = metadata(&workshop, "a.png")("kiln:camera").expect("a camera");
        let given = table.replace(' ', "");
        workshop.succeed(&format!("render {inputs} -o b.png --size 24x16 --camera {given}"));
        workshop.succeed("compare a.png b.png");
        if options.is_empty() {
            assert_eq!(workshop.bytes("a.png"), workshop.bytes("b.png"), "{table}");
        }
    }
    workshop.succeed("render a.obj -o a.png --size 16x16");
    let table = metadata(&workshop, "a.png")("kiln:camera").expect("a camera");
    assert!(
        table.starts_with("{ name = \"auto\", position = [")
            && table.ends_with("vertical_fov = 30, fitted = true }"),
        "{table}"
    );
    let info = workshop.run("info a.obj --json");
    let report: serde_json::Value = serde_json::from_slice(&info.stdout).expect("JSON");
    assert_eq!(report["render"]["camera"], table.as_str());
    // The options change nothing of another camera.
    let said = workshop.succeed("render a.obj eye.gltf -o a.png --size 16x16 --azimuth 30");
    assert!(said.contains("warning: --azimuth changes nothing: the camera is `"), "{said}");
}

/// A camera whose name `--camera` reads as something else is recorded whole, so that it can be given again.
#[test]
fn a_camera_named_as_another_value_of_the_option_is_recorded_whole() {
    for name in ["auto", "{a"] {
        let scene = format!(
            "[[camera]]\nname = '{name}'\nposition = [0, 1, 9]\nlook_at = [0, 0, 0]\nvertical_fov = 50\n\
             [[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n"
        );
        let workshop = Workshop::with("a.toml", &scene);
        workshop.succeed("render a.toml -o a.png --size 24x16");
        let table = metadata(&workshop, "a.png")("kiln:camera").expect("a camera");
        workshop.succeed(&format!("render a.toml -o b.png --size 24x16 --camera {}", table.replace(' ', "")));
        assert_eq!(workshop.bytes("a.png"), workshop.bytes("b.png"), "{table}");
    }
}

#[test]
fn cameras_and_views() {
    let workshop = Workshop::with("scene.toml", SCENE);
    // A wedge without symmetry, so that every view differs.
    let wedge = "v 0 0 0\nv 3 0 0\nv 0 2 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    workshop.write("wedge.obj", wedge);
    let mut pictures = Vec::new();
    for view in ["front", "back", "left", "right", "top", "bottom", "iso"] {
        workshop.succeed(&format!("render wedge.obj -o a.png --size 32x32 --view {view} --draft"));
        let picture = workshop.pixels("a.png");
        // A fitted camera leaves a margin of 5 % on the tightest sides: of 32 pixels the outermost one, on every side.
        let background = *picture.get_pixel(0, 0);
        assert_eq!(background.0, [0x20, 0x22, 0x26], "{view}");
        let edge = |i: u32| [(i, 0), (i, 31), (0, i), (31, i)];
        assert!((0..32).flat_map(edge).all(|(x, y)| *picture.get_pixel(x, y) == background), "{view}");
        assert!(picture.pixels().filter(|p| **p != background).count() > 60, "{view} shows the wedge");
        assert!(!pictures.contains(&picture), "{view} looks like another view");
        pictures.push(picture);
    }
    let render = |arguments: &str| {
        workshop.succeed(&format!("render scene.toml -o a.png {arguments}"));
        workshop.pixels("a.png")
    };
    let (front, above, auto) = (render(""), render("--camera above"), render("--camera auto"));
    assert!(front == render("--camera front") && front == render("--camera 0"), "the first is the default");
    assert!(above == render("--camera 1") && above != front);
    assert!(auto != front && auto != above);
    assert!(front != render("--projection orthographic"));
    assert_eq!(render_own(&workshop, "scene.toml", FRONT), front);
    let (said, hint) = workshop.fail("render wedge.obj -o a.png --camera front", 2);
    assert_eq!((said.as_str(), hint.contains("--view")), ("there is no camera `front`", true));
}

/// The camera `front` of [`SCENE`] as an inline table.
const FRONT: &str = "{ position = [0, 0, 10], look_at = [0, 0, 0] }";

/// A picture by a camera given as an inline table.
fn render_own(workshop: &Workshop, scene: &str, camera: &str) -> image::RgbImage {
    let output = workshop.command("").args(["render", scene, "-o", "own.png", "--camera", camera]).output();
    let output = output.expect("the command starts");
    assert_eq!(output.status.code(), Some(0), "{camera}: {}", text(&output.stderr));
    workshop.pixels("own.png")
}

/// A camera of the scene and the same as an inline table give the same picture, bit for bit, also if the scene is
/// recentered.
#[test]
fn a_camera_in_braces_is_the_scenes_own() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let far = SCENE
        .replace("[0, 0, 10]", "[1e6, 0, 1000010]")
        .replace("[0, 10, 1]", "[1e6, 10, 1000001]")
        .replace("[0, 0, 0]", "[1e6, 0, 1e6]")
        .replace("[5, 5, 10]", "[1000005, 5, 1000010]");
    workshop.write("far.toml", far);
    let own = "{ position = [1e6, 10, 1000001], look_at = [1e6, 0, 1e6], projection = 'orthographic', up = [0.1, 1, 0] }";
    let section = format!(
        "[[camera]]\nname = 'x'\n{}",
        own.trim_matches(['{', '}']).replace("], ", "]\n").replace("', ", "'\n")
    );
    workshop.write("own.toml", section);
    let said = workshop.succeed("render far.toml own.toml -o a.exr --camera x");
    assert!(said.contains("moved to it"), "{said}");
    let output = workshop.command("").args(["render", "far.toml", "-o", "b.exr", "--camera", own]).output();
    assert_eq!(output.expect("the command starts").status.code(), Some(0));
    let pixels = |name: &str| image_bits(&workshop.path(name));
    assert_eq!(pixels("a.exr"), pixels("b.exr"));
    assert!(render_own(&workshop, "far.toml", own) != render_own(&workshop, "scene.toml", FRONT));
    // Every command that renders takes it, and reports errors in it before anything is read.
    for command in
        ["render no.toml -o a.png", "animate no.toml -o a.gif", "explain no.toml", "study no.toml -o d"]
    {
        let arguments: Vec<&str> =
            command.split(' ').chain(["--camera", "{ position = [0, 0, 1], lok_at = [0, 0, 0] }"]).collect();
        let output = workshop.command("").args(arguments).output().expect("the command starts");
        let said = text(&output.stderr);
        let (error, hint) = check_error(&said);
        assert_eq!(output.status.code(), Some(2), "{command}: {said}");
        assert!(error.contains("unknown key `lok_at`") && hint == "did you mean `look_at`?", "{said}");
    }
}

/// The picture that a window shows is the one that its copied command line renders.
#[cfg(feature = "viewer")]
#[test]
fn what_is_seen_is_rendered_by_its_line() {
    use kiln::effects::PlanSettings;
    use kiln_viewer::{CameraSource, command_line, navigate};
    let workshop = Workshop::with("scene.toml", SCENE);
    let mut scene = crate::common::picture::load(&workshop.path("scene.toml"));
    let loaded = scene.clone();
    let mut camera = scene.cameras[0].clone();
    let target = camera.target;
    navigate::orbit(&mut camera, glam::DVec2::new(0.3, 0.2), target);
    navigate::zoom(&mut camera, 1.3);
    navigate::pan(&mut camera, glam::DVec2::new(0.1, -0.05), 1.5);
    let settings = kiln::job::RenderSettings { without: vec!["shadows".into()], ..Default::default() };
    let command = command_line::RenderCommand {
        inputs: &["scene.toml".into()],
        scene: &loaded,
        viewpoint: &CameraSource::Free(camera.clone()),
        projection: camera.projection,
        size: [48, 32],
        settings: &settings,
        import_options: &kiln::scene::ImportOptions::default(),
        output: "seen.png".as_ref(),
    };
    let words = command_line::arguments(&command);
    let output = workshop.command("").args(&words[1..]).output().expect("the command starts");
    assert_eq!(output.status.code(), Some(0), "{words:?}: {}", text(&output.stderr));
    scene.cameras[0] = camera;
    let prepared = crate::common::picture::prepare(scene, [48, 32], Default::default());
    let film = prepared.render(PlanSettings { without: vec!["shadows".into()], ..PlanSettings::default() }).0;
    assert_eq!(workshop.pixels("seen.png").into_raw(), film.to_rgb8(kiln::film::ColourPipeline::Display));
}

/// Corners and faces of a box, its triangles counterclockwise from outside.
fn block(name: &str, first: usize, [x, y, z]: [f64; 3], half: f64) -> String {
    let sign = |i: usize, bit: usize| if i >> bit & 1 == 1 { half } else { -half };
    let corner = |i: usize| format!("v {} {} {}\n", x + sign(i, 0), y + sign(i, 1), z + sign(i, 2));
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let face = |quad: [usize; 4]| {
        let [a, b, c, d] = quad.map(|i| i + first);
        format!("f {a} {b} {c} {d}\n")
    };
    format!("o {name}\n{}{}", (0..8).map(corner).collect::<String>(), quads.map(face).concat())
}

/// The camera of the one object is that of a file with it alone.
#[test]
fn a_camera_frames_one_object() {
    let workshop = Workshop::with("one.obj", block("one", 1, [5.0, 0.0, 0.0], 0.5));
    let two = block("one", 1, [5.0, 0.0, 0.0], 0.5) + &block("other", 9, [-5.0, 0.0, 0.0], 2.0);
    workshop.write("two.obj", two);
    let camera = |line: &str| {
        workshop.succeed(&format!("render {line} -o a.png --size 16x16"));
        metadata(&workshop, "a.png")("kiln:camera").expect("a camera")
    };
    for view in ["", "--view top", "--azimuth 30 --zoom 2"] {
        let alone = camera(&format!("one.obj {view}"));
        assert_eq!(camera(&format!("two.obj --look-at one {view}")), alone);
        assert_ne!(camera(&format!("two.obj {view}")), alone);
    }
    let (_, said) = workshop.code("render two.obj --look-at on -o a.png", 2);
    let (error, hint) = check_error(&said);
    assert!(error.contains("--look-at: no object is named `on`") && hint.contains("did you mean `one`"));
    let house = block("one", 1, [0.0; 3], 0.5) + &block("house", 9, [0.0; 3], 2.0);
    workshop.write("house.obj", house);
    let said = workshop.succeed("render house.obj --look-at one -o a.png --size 16x16");
    assert!(said.contains("`one` is hidden by other objects"), "{said}");
    let said = workshop.succeed("render two.obj --look-at one -o a.png --size 16x16");
    assert!(!said.contains("hidden"), "{said}");
    workshop.succeed("render two.obj --look-at one --frames 1 -o f_#.png --size 16x16");
    let said = workshop.succeed(
        "render two.obj --look-at one --camera {position=[0,0,9],look_at=[0,0,0]} -o a.png --size 16x16",
    );
    assert!(said.contains("--look-at changes nothing"), "{said}");
}

/// Meshes without a camera are seen from +z, which may be their back: `info` and statistics say so, no render does.
#[test]
fn a_note_names_the_back() {
    let workshop = Workshop::with("box.obj", block("box", 1, [0.0; 3], 1.0));
    workshop.write("a.toml", "[[mesh]]\nfile = 'box.obj'\n");
    let is_noted = |line: &str| {
        let note = "the camera looks from +z; --azimuth 180 shows the back";
        let said = workshop.succeed(&format!("{line} --size 8x8 --stats s.json"));
        assert!(!said.contains(note), "{said}");
        String::from_utf8_lossy(&workshop.bytes("s.json")).contains(note)
    };
    assert!(is_noted("render box.obj -o a.png"));
    for line in [
        "render box.obj -o a.png --view front",
        "render box.obj -o a.png --azimuth 180",
        "render box.obj -o a.png --camera {position=[0,0,9],look_at=[0,0,0]}",
        "render box.obj -o a.png --projection panoramic",
        "render a.toml -o a.png",
    ] {
        assert!(!is_noted(line), "{line}");
    }
}

/// A rectangle in the plane z = 0 is a line from above.
#[test]
fn a_view_of_an_edge_is_noted() {
    let workshop = Workshop::with("a.obj", "v 0 0 0\nv 4 0 0\nv 4 3 0\nv 0 3 0\nf 1 2 3 4\n");
    let said = |view: &str| workshop.succeed(&format!("render a.obj -o a.png --size 32x32 --view {view}"));
    let note = "camera `top` sees the objects from their edge";
    assert!(said("top").contains(note) && !said("front").contains("edge"));
    workshop.write("a.toml", "[[mesh]]\nfile = 'a.obj'\n");
    let said = workshop.succeed("render a.toml -o a.png --size 32x32 --view top");
    assert!(said.contains(note), "{said}");
}

/// The sides of a pixel of `K` or of a rectangle over another picture. OpenEXR states their ratio from 1e-6 to 1e6;
/// beyond, nothing is rendered in any format.
#[test]
fn pixels_of_any_shape_are_refused_before_rendering() {
    let shop = Workshop::with("a.toml", SCENE);
    for (lens, is_usable) in [
        ("K=[1,1,0,0],image_size=[4294967295,1]", false),
        ("K=[1,1,0,0],image_size=[1,4294967295]", false),
        ("viewing_rectangle=[1e7,1],viewpoint_distance=1,oblong_pixels=true", false),
        ("K=[1,1,0,0],image_size=[1000000,1]", true),
    ] {
        let camera = format!("{{position=[0,0,9],look_at=[0,0,0],{lens}}}");
        for out in ["-o a.exr", "-o a.png", "-o a_#.exr --frames 0"] {
            let render = format!("render a.toml --size 8x8 --camera {camera} {out}");
            if is_usable {
                shop.succeed(&render);
                continue;
            }
            let (said, _) = shop.fail(&render, 2);
            assert_eq!(
                said,
                "camera `inline` has pixels more than a million times as wide as high, or as high as wide",
                "{render}"
            );
            assert_eq!(shop.names(), ["a.toml"]);
        }
    }
}

/// What has no area is not in the picture of an automatic camera, nor in the ground, the turntable and the bounds:
/// faces of equal or collinear corners, stray vertices, nodes of a scale of 0, at rest and at a time of a clip, and
/// hidden nodes.
#[test]
fn what_cannot_be_seen_does_not_count() {
    let obj = block("box", 1, [0.0; 3], 1.0);
    let workshop = Workshop::with("box.obj", &obj);
    for (name, more) in [
        ("equal", "v 500 -300 0\nf 9 9 9\n"),
        ("edge", "v 500 -300 0\nf 1 9 9\n"),
        // Multiples of (0.1, -0.2, 0.3), which rounding takes off their line.
        ("line", "v 1 -2 3\nv 4.7 -9.4 14.1\nv 50.3 -100.6 150.9\nf 9 10 11\n"),
        ("stray", "v 500 -300 0\n"),
    ] {
        workshop.write(&format!("{name}.obj"), format!("{obj}{more}"));
    }
    let corners = |at: f32| [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, at]];
    let nodes = |name: &str, nodes: serde_json::Value| {
        let mut model = Model::new(&corners(0.5));
        model.json["nodes"] = nodes;
        let count = model.json["nodes"].as_array().expect("a list").len();
        model.json["scenes"] = json!([{ "nodes": (0..count).collect::<Vec<_>>() }]);
        model.json["extensionsUsed"] = json!(["KHR_node_visibility"]);
        let times = model.floats(&[[0.0], [1.0]]);
        let scales = model.floats(&[[0.0; 3], [1.0; 3]]);
        if count > 1 {
            model.json["animations"] = json!([{
                "samplers": [{ "input": times, "output": scales }],
                "channels": [{ "sampler": 0, "target": { "node": 1, "path": "scale" } }],
            }]);
        }
        workshop.write(name, model.text());
    };
    let far = [40, -30, 0];
    nodes("node.gltf", json!([{ "mesh": 0 }]));
    nodes("clip.gltf", json!([{ "mesh": 0 }, { "mesh": 0, "translation": far }]));
    nodes("scale.gltf", json!([{ "mesh": 0 }, {}, { "mesh": 0, "translation": far, "scale": [0, 0, 0] }]));
    nodes("flat.gltf", json!([{ "mesh": 0 }, {}, { "mesh": 0, "translation": far, "scale": [1, 0, 0] }]));
    let hidden = json!({ "KHR_node_visibility": { "visible": false } });
    nodes("hidden.gltf", json!([{ "mesh": 0 }, {}, { "mesh": 0, "translation": far, "extensions": hidden }]));
    let made = |line: String, output: &str| {
        workshop.succeed(&format!("{line} --size 24x24"));
        workshop.pixels(output).into_raw()
    };
    let bounds = |line: &str| {
        let (said, _) = workshop.code(&format!("info --json {line}"), 0);
        serde_json::from_str::<serde_json::Value>(&said).expect("JSON")["bounds"].clone()
    };
    for (base, others) in [
        ("box.obj", &["equal.obj", "edge.obj", "line.obj", "stray.obj"][..]),
        ("node.gltf", &["clip.gltf --time 0", "scale.gltf", "flat.gltf", "hidden.gltf"]),
    ] {
        for options in ["", "--view iso --draft", "--projection orthographic", "--projection panoramic"] {
            let render = |input: &str| made(format!("render {input} -o a.png {options}"), "a.png");
            let expected = render(base);
            others.iter().for_each(|input| assert!(render(input) == expected, "{input} {options}"));
        }
        others.iter().for_each(|input| assert_eq!(bounds(input), bounds(base), "{input}"));
    }
    let turned = |input: &str| made(format!("animate {input} -o f_#.png --frames 50"), "f_50.png");
    assert!(turned("equal.obj") == turned("box.obj") && turned("line.obj") == turned("box.obj"));
    // At its end the clip shows both, and nothing of an object of scale 0 can be looked at.
    assert_eq!(bounds("clip.gltf --time 1")["max"], json!([41.0, 1.0, 0.5]));
    workshop.write("all.obj", format!("{obj}o dot\nf 1 1 1\n"));
    let (_, said) = workshop.code("render all.obj --look-at dot -o a.png", 2);
    assert!(said.contains("--look-at: nothing of `dot` can be seen"), "{said}");
}

/// A marker at the origin beside a building at coordinates of a map makes the building less than a pixel: 2 sqrt(3) of
/// 4000001 sqrt(2), 1,632,994 times as much. Without it, the picture is that of the building alone.
#[test]
fn objects_far_from_the_rest_are_named() {
    let at = [4e6, 0.0, -4e6];
    let workshop = Workshop::with("building.obj", block("building", 1, at, 1.0));
    let marker = "v 0 0 0\nv 0.5 0 0\nv 0 0.5 0\n";
    workshop.write("both.obj", block("building", 1, at, 1.0) + "o a marker\n" + marker + "f 9 10 11\n");
    workshop.write("one.obj", block("building", 1, at, 1.0) + marker + "f 9 10 11\n");
    let noted = |line: &str| {
        let said = workshop.succeed(&format!("render {line} -o a.png --size 16x16"));
        said.lines().find(|line| line.contains("far from the rest")).map(str::to_owned)
    };
    let note = noted("both.obj").expect("a note");
    let expected =
        "far from the rest, in a scene 1632994 times its size: `a marker`; --hide 'a marker' frames the rest";
    assert!(note.ends_with(expected), "{note}");
    let note = noted("one.obj").expect("a note");
    assert!(note.ends_with("`building`; remove what lies there from the file, or give a --camera"), "{note}");
    assert!(text(&workshop.run("info both.obj").stdout).contains("`a marker`"));
    let (_, said) = workshop.code("animate both.obj -o f_#.png --frames 0 --size 16x16", 0);
    assert!(said.contains("`a marker`"), "{said}");
    let mut hidden = workshop.command("render both.obj -o b.png --size 16x16 --hide");
    assert!(hidden.arg("a marker").status().expect("it runs").success());
    assert_eq!(noted("building.obj"), None);
    assert!(workshop.pixels("a.png") == workshop.pixels("b.png"));
    // A camera of one's own shows what it shows; two walls, as large as the way between them, are a corridor.
    assert_eq!(noted("both.obj --camera {position=[0,0,9],look_at=[0,0,0]}"), None);
    let wall = |first: usize, x: f64| {
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| first + i);
        format!("v {x} 0 0\nv {x} 9 0\nv {x} 9 9\nv {x} 0 9\nf {a} {b} {c} {d}\n")
    };
    workshop.write("corridor.obj", wall(1, 0.0) + "o other\n" + &wall(5, 9.0));
    assert_eq!(noted("corridor.obj"), None);
}

/// A square of 60 by 60 below two balls, whose bounds have a diagonal of sqrt(5^2 + 2^2 + 2^2) = 5.7: 84.9 / 5.7 = 14.8.
#[test]
fn objects_beside_which_all_others_are_small_are_named() {
    let ball = |x: f64| format!("[[sphere]]\nname = 'ball {x}'\ncentre = [{x}, 1, 0]\nradius = 1\n");
    let floor = |side: f64| {
        format!(
            "[[triangles]]\nname = 'floor'\nvertices = [[0, 0, 0], [{side}, 0, 0], [{side}, 0, {side}], [0, 0, {side}]]\n\
             indices = [[0, 1, 2], [0, 2, 3]]\n"
        )
    };
    let balls = ball(0.0) + &ball(3.0);
    let workshop = Workshop::with("large.toml", balls.clone() + &floor(60.0));
    workshop.write("small.toml", balls.clone() + &floor(6.0));
    workshop.write("balls.toml", balls);
    let warned = |line: &str| {
        let said = workshop.succeed(&format!("render {line} -o a.png --size 16x16"));
        said.lines().find(|line| line.contains("are small in the picture")).map(str::to_owned)
    };
    let warning = warned("large.toml --view front").expect("a warning");
    assert!(warning.contains("`floor` is 15 times as large as all other objects together"), "{warning}");
    assert!(warning.ends_with("--look-at 'ball 0' frames one of them"), "{warning}");
    for line in [
        "small.toml --view front",
        "balls.toml --view top",
        "large.toml --look-at floor",
        "large.toml --camera {position=[0,9,9],look_at=[0,0,0]}",
    ] {
        assert_eq!(warned(line), None, "{line}");
    }
}
