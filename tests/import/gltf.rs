//! Import of glTF files: scenes, errors and warnings of usual, unusual and broken ones.

use crate::common::borders::Folder;
use crate::common::gltf::{FLOAT, Model, UNSIGNED_SHORT, data_uri, png};
use crate::common::{self, repository};
use crate::helpers::*;
use glam::{DVec2, DVec3};
use kiln::film::Colour;
use kiln::scene::{
    Camera, Falloff, Focus, Interpolation, Lens, LightKind, Material, Mesh, Minify, Projection, Scene,
    TextureSlot,
};
use kiln::world::View;
use serde_json::{Value, json};

#[test]
fn gltf_with_a_buffer_whose_name_holds_a_space() {
    let (scene, warnings) = fixture("square.gltf");
    assert_eq!(warnings, [""; 0]);
    let (a, b, c, d) = (v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(1.0, 1.0, 0.0), v(0.0, 1.0, 0.0));
    assert_eq!(triangles(mesh(&scene, 0)), [[a, b, c], [a, c, d]]);
    assert_eq!(scene.objects[0].name, "square");
    assert!(mesh(&scene, 0).normals.is_none(), "without NORMAL the shading is flat");
}

/// gltf-json 1.4.1 panics at the first of them.
#[test]
fn gltf_primitives_that_name_what_is_not_there() {
    let mut model = Model::triangle();
    model.primitive()["attributes"]["POSITION"] = json!(99);
    assert_eq!(message(&model.fails()), "a.gltf: mesh 0, primitive 0: POSITION is accessor 99; there are 1");
    for (key, value) in
        [("indices", json!(99)), ("material", json!(99)), ("attributes", json!({"NORMAL": 7}))]
    {
        let mut model = Model::triangle();
        model.primitive()[key] = value;
        assert!(message(&model.fails()).starts_with("a.gltf: not a usable glTF file: meshes[0]"), "{key}");
    }
}

/// Sizes that are claimed without bytes in the file: accessors without a buffer view, one accessor used by many
/// primitives, and sizes in the headers of images.
#[test]
fn gltf_sizes_are_checked_before_memory_is_allocated() {
    let sparse = json!({ "count": 1, "indices": { "bufferView": 0, "componentType": 5123 }, "values": { "bufferView": 0 } });
    let claim =
        |count: u64| json!({ "componentType": FLOAT, "count": count, "type": "VEC3", "sparse": sparse });
    let mut positions = Model::triangle();
    positions.json["accessors"][0] = claim(1 << 28);
    positions.json["accessors"][0]["min"] = json!([0, 0, 0]);
    positions.json["accessors"][0]["max"] = json!([1, 1, 0]);
    let mut places = Model::triangle().with("extensionsUsed", json!(["EXT_mesh_gpu_instancing"]));
    places.json["accessors"].as_array_mut().expect("a list").push(claim(1 << 26));
    places.json["nodes"][0]["extensions"] =
        json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 1 } } });
    for model in [positions, places] {
        let e = model.fails();
        assert!(message(&e).starts_with("a.gltf: reading its meshes needs "), "{e}");
        assert!(message(&e).ends_with("; the limit for sizes in a file is 4.0 GiB"), "{e}");
        assert!(!e.hint().is_empty());
    }
    if cfg!(target_os = "linux") {
        let mut shared = Model::triangle();
        let many = shared.floats(&vec![[0f32; 3]; 1 << 16]);
        // 2^16 positions of 32 bytes, and 2^16 indices of 16, 2^18 times: 768 GiB.
        shared.json["meshes"][0]["primitives"] =
            json!(vec![json!({ "attributes": { "POSITION": many } }); 1 << 18]);
        let e = message(&shared.fails());
        assert!(e.starts_with("a.gltf: reading its meshes needs 768.0 GiB of memory; "), "{e}");
    }
    let uri = data_uri("image/png", &common::oversized_images::png(60_000, 60_000));
    let picture = Model::triangle().with("images", json!([{ "uri": uri }]));
    let e = picture.fails();
    assert!(message(&e).starts_with("a.gltf: image 0: a picture of 60000 x 60000 pixels needs "), "{e}");
}

#[test]
fn gltf_binary_and_byte_order_mark() {
    let folder = Folder::new();
    let (scene, _) = folder.load("a.glb", Model::triangle().binary());
    assert_eq!(triangles(mesh(&scene, 0)), [TRIANGLE]);
    let (scene, _) = folder.load("b.gltf", format!("\u{FEFF}{}", Model::triangle().text()));
    assert_eq!(triangles(mesh(&scene, 0)), [TRIANGLE]);
}

#[test]
fn gltf_nodes_move_turn_and_stretch_what_they_hold() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let mut model = Model::triangle();
    let normals_at = model.floats(&[[0.6, 0.0, 0.8], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]]);
    model.primitive()["attributes"]["NORMAL"] = json!(normals_at);
    // The outer node rotates by 90 degrees about z and translates by (10, 0, 0); the inner one scales by (2, 3, 1).
    model.json["nodes"] = json!([
        { "children": [1], "translation": [10, 0, 0], "rotation": [0, 0, half, half] },
        { "name": "inner", "mesh": 0, "scale": [2, 3, 1] },
    ]);
    let (scene, warnings) = model.load();
    assert_eq!(warnings, [""; 0]);
    // (x, y, z) -> scaled (2x, 3y, z) -> rotated (-3y, 2x, z) -> translated (10 - 3y, 2x, z).
    let [a, b, c] = triangles(mesh(&scene, 0))[0];
    assert_near(a, v(10.0, 0.0, 0.0));
    assert_near(b, v(10.0, 2.0, 0.0));
    assert_near(c, v(7.0, 0.0, 0.0));
    // Normals by the inverse transpose: (0.6, 0, 0.8) -> (0.3, 0, 0.8) -> rotated (0, 0.3, 0.8), of length sqrt(0.73).
    let [n, z, _] = normals(mesh(&scene, 0))[0];
    assert_near(n, v(0.0, 0.3, 0.8) / 0.73f64.sqrt());
    assert_near(z, DVec3::Z);
}

#[test]
fn gltf_mirrored_nodes_keep_the_outside_outside() {
    let mut model = Model::triangle();
    let normals_at = model.floats(&[[0.6, 0.0, 0.8]; 3]);
    model.primitive()["attributes"]["NORMAL"] = json!(normals_at);
    model.json["nodes"] = json!([{ "mesh": 0, "scale": [-2, 1, 1] }]);
    let (scene, _) = model.load();
    assert_eq!(triangles(mesh(&scene, 0)), [[DVec3::ZERO, v(-2.0, 0.0, 0.0), DVec3::Y]]);
    // A mirror at x = 0 with a scale of 2 along x takes the direction (0.6, 0, 0.8) of a normal to (-0.3, 0, 0.8). It
    // still points towards +z; the cofactor matrix without the sign of the determinant would reverse it.
    assert_near(normals(mesh(&scene, 0))[0][0], v(-0.3, 0.0, 0.8) / 0.73f64.sqrt());
}

#[test]
fn gltf_nodes_given_as_matrices_in_column_order() {
    // Columns: x -> (0, 2, 0), y -> (-1, 0, 0), z -> (0, 0, 1), then the translation (5, 6, 7).
    let matrix = json!([0, 2, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]);
    let (scene, _) = Model::triangle().with("nodes", json!([{ "mesh": 0, "matrix": matrix }])).load();
    assert_eq!(triangles(mesh(&scene, 0)), [[v(5.0, 6.0, 7.0), v(5.0, 8.0, 7.0), v(4.0, 6.0, 7.0)]]);
}

#[test]
fn gltf_base_colour_factor_picture_and_vertex_colours() {
    let png = std::fs::read(repository("assets/import/four.png")).expect("the fixture is there");
    let folder = Folder::new();
    folder.write("four.png", png);
    let mut model = Model::square();
    model.attribute("COLOR_0", &[[1.0, 1.0, 0.25]; 4]);
    let pbr = json!({ "baseColorFactor": [1, 0.5, 1, 1], "baseColorTexture": { "index": 0 } });
    let material = json!({ "name": "m", "pbrMetallicRoughness": pbr });
    let (scene, warnings) =
        folder.load("a.gltf", model.with_texture("four.png", &json!({}), &material).text());
    assert_eq!(warnings, [""; 0]);
    let Material::MetallicRoughness(material) = &scene.materials[0] else { panic!("{:?}", scene.materials) };
    assert_eq!(material.base_colour, Colour::Linear(v(1.0, 0.5, 1.0)));
    // The defaults of glTF.
    assert_eq!((material.metallic, material.roughness), (1.0, 1.0));
    assert_eq!(mesh(&scene, 0).colours.as_ref().expect("it has colours").values, [v(1.0, 1.0, 0.25); 4]);
    // In display values the factor 0.5 is 0.735357 (sRGB, IEC 61966-2-1) and the vertex colour 0.25 is 0.537099:
    // 255 * 0.735357 = 187.5, 255 * 0.537099 = 136.96.
    let [red, green, blue, white] = seen(scene, [0.0, 0.0], [1.0, 1.0], [2, 2])[..] else {
        panic!("four pixels were asked for")
    };
    assert_eq!((red, blue), ([255, 0, 0], [0, 0, 137]));
    assert_eq!((green, white), ([0, 188, 0], [255, 188, 137]));
}

/// A texture without an image, and one of a set of coordinates that the mesh lacks.
#[test]
fn gltf_textures_that_cannot_be_drawn_are_named() {
    let folder = Folder::new();
    folder.write("half.png", half_transparent_png());
    for (texture, set, expected) in [
        (
            json!({}),
            0,
            "a.gltf: texture left out: it names no image, or only one of a format that is not read",
        ),
        (json!({ "source": 0 }), 1, "a.gltf: `node 0` lacks the texture coordinates of its material `m`"),
    ] {
        let pbr = json!({ "baseColorTexture": { "index": 0, "texCoord": set } });
        let material = json!({ "name": "m", "pbrMetallicRoughness": pbr });
        let model = Model::square().with_texture("half.png", &json!({}), &material);
        let model = model.with("nodes", json!([{ "mesh": 0 }])).with("textures", json!([texture]));
        let (_, warnings) = folder.load("a.gltf", model.text());
        assert!(warnings.len() == 1 && warnings[0].contains(expected), "{warnings:?}");
    }
}

/// The opacity is the product of factor, texture and vertex alpha (glTF 2.0, section 3.9.4); `MASK` compares it with
/// the cutoff, 0.5 if not given, and `OPAQUE` ignores all of it.
#[test]
fn gltf_alpha_of_factor_picture_and_vertices() {
    let folder = Folder::new();
    folder.write("half.png", half_transparent_png());
    let load = |mode: &str, vertex_alpha: f32, cutoff: Option<f64>| {
        let mut model = Model::square();
        model.attribute("COLOR_0", &[[1.0, 1.0, 1.0, vertex_alpha]; 4]);
        let pbr = json!({ "baseColorFactor": [1, 1, 1, 0.5], "baseColorTexture": { "index": 0 } });
        let mut material = json!({ "pbrMetallicRoughness": pbr, "alphaMode": mode });
        if let Some(cutoff) = cutoff {
            material["alphaCutoff"] = json!(cutoff);
        }
        let nearest = json!({ "magFilter": 9728, "minFilter": 9728 });
        let model = model.with_texture("half.png", &nearest, &material);
        let (scene, warnings) = folder.load("a.gltf", model.text());
        assert_eq!(warnings, [""; 0]);
        Scene { background: Some(Colour::from_u8([0; 3])), ..scene }
    };
    let scene = load("OPAQUE", 0.5, None);
    assert!(scene.materials[0].opacity().is_none() && mesh(&scene, 0).alphas.is_none());
    assert_eq!(scene.images.len(), 1);
    // The background is black: the left half shows it, the right half is 0.5 * 0.8 * 0.5 of white, 0.2 * 255 = 51 in
    // display values.
    let scene = load("BLEND", 0.5, None);
    assert_eq!(mesh(&scene, 0).alphas.as_ref().expect("alphas").values, [0.5; 4]);
    let quarters = |scene| seen(scene, [0.0, 0.0], [1.0, 1.0], [2, 2]);
    assert_eq!(quarters(scene), [[0; 3], [51; 3], [0; 3], [51; 3]]);
    // 0.5 * 0.8 = 0.4 is below 0.5 and above 0.39.
    assert_eq!(quarters(load("MASK", 1.0, None)), [[0; 3]; 4]);
    assert_eq!(quarters(load("MASK", 1.0, Some(0.39))), [[0; 3], [255; 3], [0; 3], [255; 3]]);
}

#[test]
fn gltf_without_its_picture_keeps_its_geometry() {
    let mut model = Model::triangle();
    model.json["images"] =
        json!([{ "uri": "gone.png" }, { "uri": "../out.png" }, { "uri": "data:image/png;base64,AAAA" }]);
    model.json["textures"] = json!([{ "source": 0 }, { "source": 1 }, { "source": 2 }]);
    model.json["materials"] = json!([{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }]);
    model.primitive()["material"] = json!(0);
    let (scene, warnings) = model.load();
    assert_eq!(scene.primitive_count(), 1);
    assert_eq!(warnings[0], "gone.png: texture left out: no such file");
    assert_eq!(
        warnings[1],
        "a.gltf: image 1: texture left out: `../out.png` is outside the file's folder; --allow-outside-references reads it, too"
    );
    assert!(warnings[2].starts_with("a.gltf: image 2: texture left out: "), "{warnings:?}");
    assert_eq!(warnings.len(), 3);
}

/// glTF 2.0, section 3.8.4: 9728 NEAREST, 9729 LINEAR, 9984 to 9987 with MIPMAP; without a value the filter is not set.
/// A normal map has its scale, and tangents are computed for a mesh without them: on this triangle u increases along +x
/// and the texture's upward direction is +y.
#[test]
fn gltf_samplers_and_normal_maps() {
    use Interpolation::{Linear, Nearest};
    let minify = |within, between| Some(Minify { within, between });
    for (filters, magnify, minify) in [
        (json!({}), None, None),
        (json!({ "magFilter": 9728, "minFilter": 9728 }), Some(Nearest), minify(Nearest, None)),
        (json!({ "magFilter": 9729, "minFilter": 9729 }), Some(Linear), minify(Linear, None)),
        (json!({ "minFilter": 9984 }), None, minify(Nearest, Some(Nearest))),
        (json!({ "minFilter": 9985 }), None, minify(Linear, Some(Nearest))),
        (json!({ "minFilter": 9986 }), None, minify(Nearest, Some(Linear))),
        (json!({ "minFilter": 9987 }), None, minify(Linear, Some(Linear))),
    ] {
        let folder = Folder::new();
        folder.write("n.png", png(1, &[[128, 128, 255, 255]]));
        let mut model = Model::triangle();
        model.attribute("TEXCOORD_0", &[[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]]);
        let material = json!({ "normalTexture": { "index": 0, "scale": 0.5 } });
        let (scene, warnings) =
            folder.load("a.gltf", model.with_texture("n.png", &filters, &material).text());
        assert_eq!(warnings, [""; 0]);
        let map = scene.materials[0].textures()[TextureSlot::Normal].expect("a normal map");
        assert_eq!(scene.materials[0].textures().normal_scale, 0.5);
        assert_eq!((map.sampler.magnify, map.sampler.minify), (magnify, minify));
        let tangents = mesh(&scene, 0).tangents.as_ref().expect("tangents");
        assert_eq!(tangents.values, [glam::DVec4::new(1.0, 0.0, 0.0, 1.0); 3]);
        assert_eq!(normals(mesh(&scene, 0)), [[DVec3::Z; 3]]);
    }
}

/// Checks that the rectangle that a camera sees at a distance has its corners at those of the picture.
fn assert_sees(camera: &Camera, aspect: [u32; 2], rectangle: [DVec3; 2]) {
    let view = View::new(camera, camera.projection, aspect).expect("the camera has a direction");
    let size = DVec2::from(aspect.map(f64::from));
    let [lower_left, upper_right] = rectangle;
    for (point, expected) in [(lower_left, DVec2::new(0.0, size.y)), (upper_right, DVec2::new(size.x, 0.0))] {
        let (pixel, before) = view.project(point);
        assert!(
            before && (pixel - expected).abs().max_element() < 1e-4,
            "{point} is seen at {pixel}, not {expected}"
        );
    }
}

#[test]
fn gltf_cameras_see_the_same_rectangle() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    // A vertical angle of view of 90 degrees and an aspect ratio of 2; at (1, 2, 3), rotated by 90 degrees about y, so
    // that the camera looks along -x with -z to its right.
    let model = Model::triangle()
        .with("scenes", json!([{ "nodes": [0, 1, 2] }]))
        .with(
            "nodes",
            json!([
                { "mesh": 0 },
                { "name": "wide", "camera": 0, "translation": [1, 2, 3], "rotation": [0, half, 0, half] },
                { "name": "flat", "camera": 1, "translation": [0, 0, 10] },
            ]),
        )
        .with(
            "cameras",
            json!([
                { "type": "perspective",
                  "perspective": { "yfov": std::f64::consts::FRAC_PI_2, "aspectRatio": 2, "znear": 0.1 } },
                { "type": "orthographic",
                  "orthographic": { "xmag": 3, "ymag": 1.5, "znear": 0.1, "zfar": 100 } },
            ]),
        );
    let (scene, warnings) = model.load();
    assert_eq!(warnings, [""; 0]);
    let names: Vec<&str> = scene.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["wide", "flat"]);
    // At distance 5 its view is 10 units high and 20 wide: from the middle (-4, 2, 3), y goes from -3 to 7 and z
    // from 13 on the left to -7 on the right.
    assert_eq!(scene.cameras[0].projection, Projection::Perspective);
    assert_sees(&scene.cameras[0], [200, 100], [v(-4.0, -3.0, 13.0), v(-4.0, 7.0, -7.0)]);
    // xmag and ymag are half the width and half the height, at any distance.
    assert_eq!(scene.cameras[1].projection, Projection::Orthographic);
    assert_sees(&scene.cameras[1], [200, 100], [v(-3.0, -1.5, 4.0), v(3.0, 1.5, -7.0)]);
}

/// Blender exports a camera's custom properties as extras; other extras are not the lens's, and what is wrong is left out.
#[test]
fn gltf_cameras_have_the_lens_of_their_extras() {
    let camera = |extras: serde_json::Value| {
        let perspective = json!({ "yfov": 1.0, "znear": 0.1 });
        Model::triangle()
            .with("scenes", json!([{ "nodes": [0, 1] }]))
            .with("nodes", json!([{ "mesh": 0 }, { "name": "c", "camera": 0, "translation": [0, 0, 9] }]))
            .with("cameras", json!([{ "type": "perspective", "perspective": perspective, "extras": extras }]))
            .load()
    };
    let (scene, warnings) = camera(
        json!({ "aperture_radius": 0.5, "focus_at": [0, 1, 2], "blades": 7, "blade_rotation": 5, "owner": "me" }),
    );
    assert_eq!(warnings, [""; 0]);
    let lens = Lens { radius: 0.5, focus: Focus::Point(v(0.0, 1.0, 2.0)), blades: 7, blade_rotation: 5.0 };
    assert_eq!(scene.cameras[0].lens, Some(lens));
    let (scene, warnings) = camera(json!({ "owner": "me" }));
    assert_eq!((scene.cameras[0].lens, warnings.len()), (None, 0));
    for (wrong, why) in
        [(json!({ "f_stop": "wide" }), "invalid type"), (json!({ "f_stop": 0 }), "no f-number")]
    {
        let (scene, warnings) = camera(wrong);
        assert_eq!(scene.cameras[0].lens, None);
        assert!(warnings.len() == 1 && warnings[0].contains(why), "{warnings:?}");
    }
}

#[test]
fn gltf_punctual_lights() {
    let lights = json!({ "lights": [
        { "type": "point", "name": "a", "intensity": 10, "color": [1, 0.5, 0], "range": 7 },
        { "type": "directional", "intensity": 3 },
        { "type": "spot", "spot": { "innerConeAngle": 0.25, "outerConeAngle": 0.5 } },
    ] });
    let light = |i: u32| json!({ "KHR_lights_punctual": { "light": i } });
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let model = Model::triangle()
        .with("scenes", json!([{ "nodes": [0, 1, 2, 3] }]))
        .with(
            "nodes",
            json!([
                { "mesh": 0 },
                { "name": "lamp", "translation": [1, 2, 3], "extensions": light(0) },
                // A rotation by 90 degrees about x takes -z to +y, one about -x to -y, downwards.
                { "name": "sun", "rotation": [-half, 0, 0, half], "extensions": light(1) },
                { "name": "spot", "translation": [0, 5, 0], "rotation": [half, 0, 0, half], "extensions": light(2) },
            ]),
        )
        .with("extensions", json!({ "KHR_lights_punctual": lights }))
        .with("extensionsUsed", json!(["KHR_lights_punctual"]))
        .with("extensionsRequired", json!(["KHR_lights_punctual"]));
    let (scene, warnings) = model.load();
    assert_eq!(warnings, [""; 0]);
    let [lamp, sun, spot] = &scene.lights[..] else { panic!("{:?}", scene.lights) };
    // A diffuse surface reflects 1/pi of the candela or lux that reach it.
    let pi = std::f64::consts::PI;
    assert_eq!((lamp.name.as_str(), lamp.intensity), ("lamp", 10.0 / pi));
    assert_eq!(lamp.colour, Colour::Linear(v(1.0, 0.5, 0.0)));
    let falloff = Falloff::InverseSquare { range: Some(7.0) };
    assert_eq!(lamp.kind, LightKind::Point { position: v(1.0, 2.0, 3.0), falloff });
    let LightKind::Directional { direction, .. } = sun.kind else { panic!("{sun:?}") };
    assert_near(direction, -DVec3::Y);
    assert_eq!(sun.intensity, 3.0 / pi);
    let LightKind::Spot { position, direction, falloff, inner_angle, outer_angle } = spot.kind else {
        panic!("{spot:?}")
    };
    assert_near(position, v(0.0, 5.0, 0.0));
    assert_near(direction, DVec3::Y);
    assert_eq!((falloff, inner_angle, outer_angle), (Falloff::InverseSquare { range: None }, 0.25, 0.5));
}

#[test]
fn gltf_strips_and_fans_keep_their_sides() {
    let strip = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
    let fan = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    // A unit square each, whose two triangles face +z: their area vectors are (0, 0, 0.5).
    for (mode, positions) in [(5, strip), (6, fan)] {
        let mut model = Model::triangle();
        let positions = model.floats(&positions);
        *model.primitive() = json!({ "attributes": { "POSITION": positions }, "mode": mode });
        let (scene, _) = model.load();
        let sides: Vec<DVec3> =
            triangles(mesh(&scene, 0)).iter().map(|[a, b, c]| (*b - *a).cross(*c - *a) / 2.0).collect();
        assert_eq!(sides, [v(0.0, 0.0, 0.5); 2], "mode {mode}");
    }
}

#[test]
fn gltf_points_and_lines_are_said_to_be_left_out() {
    for mode in 0..4 {
        let mut model = Model::triangle();
        model.primitive()["mode"] = json!(mode);
        let (scene, warnings) = model.load();
        assert_eq!(
            (scene.primitive_count(), warnings),
            (0, vec!["a.gltf: it: points and lines are not drawn".into()])
        );
    }
}

#[test]
fn gltf_skins_are_posed_as_their_joints_stand() {
    let mut model = Model::triangle();
    // Joint 0 is at its bind pose; joint 1 was bound at (0, 1, 0) and is at (0, 3, 0), which moves its vertices by
    // (0, 2, 0). The third vertex has a weight of 1/2 for each joint.
    let joints = model.shorts(&[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0], "VEC4", 3);
    let weights = model.floats(&[[1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0]]);
    let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let mut bound = identity;
    bound[13] = -1.0;
    let inverse = model.floats::<16>(&[identity, bound]);
    let attributes = &mut model.primitive()["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    model.json["skins"] = json!([{ "joints": [1, 2], "inverseBindMatrices": inverse }]);
    // The transform of the node itself is ignored for a skinned mesh (glTF 2.0, section 3.7.3.3).
    model.json["nodes"] = json!([
        { "mesh": 0, "skin": 0, "translation": [100, 0, 0] }, { "children": [2] }, { "translation": [0, 3, 0] },
    ]);
    model.json["scenes"] = json!([{ "nodes": [0, 1] }]);
    let (scene, warnings) = model.load();
    assert_eq!(warnings, [""; 0]);
    // (0,0,0) stays; (1,0,0) moves to (1,2,0); (0,1,0) by half of (0,2,0) to (0,2,0).
    assert_eq!(triangles(mesh(&scene, 0)), [[DVec3::ZERO, v(1.0, 2.0, 0.0), v(0.0, 2.0, 0.0)]]);
    // Joints or weights of some vertices alone.
    for attribute in ["JOINTS_0", "WEIGHTS_0"] {
        let accessor = model.primitive()["attributes"][attribute].as_u64().unwrap() as usize;
        model.json["accessors"][accessor]["count"] = json!(1);
        let (scene, warnings) = model.load();
        assert!(warnings[0].contains("fewer joints or weights than the mesh has positions"), "{warnings:?}");
        assert_eq!(scene.bounds(), Some((v(100.0, 0.0, 0.0), v(101.0, 1.0, 0.0))));
        model.json["accessors"][accessor]["count"] = json!(3);
    }
}

#[test]
fn gltf_uris_that_cannot_be_followed() {
    let length = Model::triangle().bytes.len();
    for (uri, expected) in [
        ("gone.bin", "no such file"),
        ("%FF.bin", "a.gltf: buffer 0: `%FF.bin` does not decode to a file name"),
        ("../a.bin", "a.gltf: buffer 0: `../a.bin` is outside the file's folder"),
        ("/etc/hostname", "a.gltf: buffer 0: `/etc/hostname` is outside the file's folder"),
        ("%2e%2e/a.bin", "a.gltf: buffer 0: `../a.bin` is outside the file's folder"),
        ("https://example.org/a.bin", "kiln reads local files only"),
        ("data:application/octet-stream;base64,AAAA", "a.gltf: buffer 0: has 3 bytes; byteLength is 36"),
        ("data:application/octet-stream;base64,!", "a damaged data URI"),
        ("data:;base64", "a data URI without a comma"),
        ("a/../../b", "a.gltf: buffer 0: `a/../../b` is outside the file's folder"),
    ] {
        let e = Model::triangle().with("buffers", json!([{ "byteLength": length, "uri": uri }])).fails();
        assert!(message(&e).contains(expected), "{uri}: {e}");
        assert!(!e.hint().is_empty());
    }
}

#[test]
fn gltf_accessors_that_reach_outside_are_errors() {
    // 36 bytes hold three positions; a fourth is outside of the buffer.
    let mut model = Model::triangle();
    model.json["accessors"][0]["count"] = json!(4);
    assert_eq!(message(&model.fails()), "a.gltf: accessor 0: its elements do not lie inside its buffer view");
    // A view that is longer than its buffer.
    let mut model = Model::triangle();
    model.json["bufferViews"][0]["byteOffset"] = json!(4);
    assert_eq!(message(&model.fails()), "a.gltf: it, primitive 0: its positions lie outside their buffer");
    let mut model = Model::triangle();
    let indices = model.shorts(&[0, 1, 2], "SCALAR", 30);
    model.primitive()["indices"] = json!(indices);
    assert_eq!(message(&model.fails()), "a.gltf: accessor 1: its elements do not lie inside its buffer view");
}

#[test]
fn gltf_numbers_that_make_no_sense_are_errors_and_no_panic() {
    for (key, value) in [
        ("count", json!(0)),
        ("count", json!(u64::MAX)),
        ("count", json!(u64::MAX / 12)),
        ("byteOffset", json!(u64::MAX)),
        ("type", json!("VEC2")),
    ] {
        let mut model = Model::triangle();
        model.json["accessors"][0][key] = value.clone();
        let e = model.fails();
        assert!(message(&e).starts_with("a.gltf: "), "{key} = {value}: {e}");
    }
    for (key, value) in
        [("byteOffset", json!(u64::MAX)), ("byteLength", json!(u64::MAX)), ("byteStride", json!(4))]
    {
        let mut model = Model::triangle();
        model.json["bufferViews"][0][key] = value.clone();
        let e = model.fails();
        assert!(message(&e).starts_with("a.gltf: "), "{key} = {value}: {e}");
    }
}

/// glTF 2.0, section 3.7.2.1, says which types an attribute may have; the `gltf` crate panics on some of the others and
/// reads garbage from the rest.
#[test]
fn gltf_attributes_of_types_that_the_format_does_not_give_are_not_used() {
    const BYTE: u32 = 5120;
    const UNSIGNED_INT: u32 = 5125;
    for (semantic, component, kind, bytes) in [
        ("NORMAL", FLOAT, "SCALAR", 4),
        ("TEXCOORD_0", UNSIGNED_INT, "VEC2", 4),
        ("TEXCOORD_0", FLOAT, "VEC3", 4),
        ("COLOR_0", BYTE, "VEC3", 1),
        ("COLOR_0", UNSIGNED_INT, "VEC4", 4),
        ("COLOR_0", FLOAT, "VEC2", 4),
        ("JOINTS_0", FLOAT, "VEC4", 4),
        ("WEIGHTS_0", BYTE, "VEC4", 1),
    ] {
        let mut model = Model::triangle();
        let lanes = kind.chars().last().and_then(|c| c.to_digit(10)).unwrap_or(1) as usize;
        let accessor = model.accessor(vec![0; 3 * lanes * bytes], component, 3, kind);
        model.primitive()["attributes"][semantic] = json!(accessor);
        let (scene, warnings) = model.load();
        let expected = format!("a.gltf: mesh 0, primitive 0: {semantic} of type ");
        let [warning] = warnings.as_slice() else { panic!("{warnings:?}") };
        assert!(warning.starts_with(&expected) && warning.ends_with(" is not glTF; not used"), "{warning}");
        let expected = Mesh { positions: TRIANGLE.to_vec(), triangles: vec![[0, 1, 2]], ..Mesh::default() };
        assert_eq!(*mesh(&scene, 0), expected);
    }
    for (component, bytes) in [(FLOAT, 12), (5122, 6)] {
        let mut model = Model::triangle();
        let indices = model.accessor(vec![0; bytes], component, 3, "SCALAR");
        model.primitive()["indices"] = json!(indices);
        let expected = "a.gltf: mesh 0, primitive 0: its indices are not unsigned integers";
        assert_eq!(message(&model.fails()), expected);
    }
    let model = Model::triangle().with("images", json!([{}]));
    assert_eq!(message(&model.fails()), "a.gltf: image 0: has neither `uri` nor `bufferView`");
}

#[test]
fn gltf_sparse_accessors_cannot_ask_for_the_moon() {
    let mut model = Model::triangle();
    let sparse = json!({ "count": 1, "indices": { "bufferView": 0, "componentType": UNSIGNED_SHORT },
        "values": { "bufferView": 0 } });
    let accessor = model.json["accessors"][0].as_object_mut().expect("an object");
    accessor.remove("bufferView");
    accessor.insert("sparse".into(), sparse);
    accessor.insert("count".into(), json!(1u64 << 40));
    assert!(message(&model.fails()).starts_with("a.gltf: reading its meshes needs "));
}

#[test]
fn gltf_indices_out_of_range() {
    // A vertex that is not finite: its triangle is left out and counted.
    let mut model = Model::triangle();
    let indices = model.shorts(&[0, 1, 2, 0, 1, 3], "SCALAR", 6);
    model.primitive()["indices"] = json!(indices);
    let (scene, warnings) = model.load();
    assert_eq!(triangles(mesh(&scene, 0)), [TRIANGLE]);
    assert_eq!(warnings, ["a.gltf: it: left out 1 triangle(s) with an index out of range"]);
    // Any other value that is not finite is an error.
    let e = Model::triangle().with("nodes", json!([{ "mesh": 7 }])).fails();
    assert_eq!(
        message(&e),
        "a.gltf: not a usable glTF file: nodes[0].mesh refers to an item that does not exist"
    );
}

#[test]
fn gltf_nodes_that_contain_themselves_are_an_error() {
    let cycles = [
        json!([{ "mesh": 0, "children": [0] }]),
        json!([{ "mesh": 0, "children": [1] }, { "children": [2] }, { "children": [1] }]),
        // Two references at every level: a walk of every path would take 2^depth steps.
        json!([{ "mesh": 0, "children": [1, 1] }, { "children": [0, 0] }]),
    ];
    for nodes in cycles {
        let e = Model::triangle().with("nodes", nodes.clone()).fails();
        assert!(message(&e).ends_with("the node is its own ancestor"), "{nodes}: {e}");
    }
}

#[test]
fn gltf_nodes_with_several_parents_are_drawn_once_and_do_not_hang() {
    // A chain of forty nodes, each of them twice a child of the one before: there are 2^40 paths to the last one.
    let mut nodes: Vec<Value> = (1..40).map(|next| json!({ "children": [next, next] })).collect();
    nodes.push(json!({ "name": "last", "mesh": 0 }));
    let (scene, warnings) = Model::triangle().with("nodes", json!(nodes)).load();
    assert_eq!(triangles(mesh(&scene, 0)), [TRIANGLE]);
    assert_eq!(scene.objects.len(), 1);
    assert!(
        warnings.contains(&"a.gltf: node 39 is in the scene more than once; drawn once".into()),
        "{warnings:?}"
    );
}

#[test]
fn gltf_long_chains_of_nodes_are_no_cycle() {
    // Each of 3000 nodes translates by (0, 0, 1).
    let mut nodes: Vec<Value> =
        (1..3000).map(|next| json!({ "children": [next], "translation": [0, 0, 1] })).collect();
    nodes.push(json!({ "mesh": 0, "translation": [0, 0, 1] }));
    let (scene, _) = Model::triangle().with("nodes", json!(nodes)).load();
    assert_eq!(triangles(mesh(&scene, 0))[0][0], v(0.0, 0.0, 3000.0));
}

#[test]
fn gltf_that_requires_what_kiln_does_not_read_says_what_to_do() {
    let model = Model::triangle()
        .with("extensionsUsed", json!(["KHR_mesh_quantization", "VENDOR_thing", "VENDOR_other"]))
        .with("extensionsRequired", json!(["KHR_mesh_quantization", "VENDOR_thing", "VENDOR_other"]));
    let e = model.fails();
    assert_eq!(
        message(&e),
        "a.gltf: requires glTF extensions that kiln does not read: VENDOR_thing, VENDOR_other"
    );
    assert!(e.hint().contains("--ignore-required-extensions"), "{}", e.hint());
    // An unknown extension that is used but not required is left out with a warning.
    let (_, warnings) = Model::triangle().with("extensionsUsed", json!(["VENDOR_thing"])).load();
    assert_eq!(warnings, ["a.gltf: extension VENDOR_thing is not used"]);
}

#[test]
fn gltf_material_extensions_are_read_within_their_ranges() {
    let extensions = json!({
        "KHR_materials_ior": { "ior": 1.33 },
        "KHR_materials_specular": { "specularFactor": 0.5, "specularColorFactor": [1, 2, 0.25] },
        "KHR_materials_transmission": { "transmissionFactor": 7, "transmissionTexture": { "index": 9 } },
        "KHR_materials_volume": { "thicknessFactor": 0.1, "attenuationColor": [0.5, 1, 3], "attenuationDistance": 4 },
        "KHR_materials_clearcoat": { "clearcoatFactor": 0.25, "clearcoatRoughnessFactor": -1 },
        "KHR_materials_sheen": { "sheenColorFactor": [0.1, 0.2, 0.3], "sheenRoughnessFactor": 0.75 },
        "KHR_materials_anisotropy": { "anisotropyStrength": 0.625, "anisotropyRotation": -7.5 },
    });
    let names: Vec<&String> = extensions.as_object().expect("an object").keys().collect();
    let model = Model::triangle()
        .with(
            "materials",
            json!([{ "extensions": extensions }, { "extensions": { "KHR_materials_ior": { "ior": 0.5 } } }]),
        )
        .with("extensionsUsed", json!(names))
        .with("extensionsRequired", json!(names));
    let (scene, warnings) = model.load();
    let layers = |index: usize| match &scene.materials[index] {
        Material::MetallicRoughness(material) => material.layers.clone(),
        Material::Phong(_) => panic!("a metallic-roughness material"),
    };
    let linear = |r, g, b| Colour::Linear(v(r, g, b));
    let expected = kiln::scene::Layers {
        ior: 1.33,
        specular: 0.5,
        specular_colour: linear(1.0, 2.0, 0.25),
        transmission: 1.0,
        volume: Some(kiln::scene::Volume {
            attenuation_colour: linear(0.5, 1.0, 1.0),
            attenuation_distance: 4.0,
        }),
        clearcoat: 0.25,
        clearcoat_roughness: 0.0,
        sheen_colour: linear(0.1, 0.2, 0.3),
        sheen_roughness: 0.75,
        anisotropy: 0.625,
        anisotropy_rotation: -7.5,
    };
    assert_eq!(layers(0), expected);
    // An index below 1 is invalid and replaced by the default of the format, 1.5.
    assert_eq!(layers(1), kiln::scene::Layers::default());
    assert_eq!(
        warnings,
        ["a.gltf: material without a name: its transmissionTexture does not exist; left out"]
    );
}

/// Alpha channels become grey images, one for all materials that read it. A slot whose factor is 0 has no texture, nor
/// has the thickness, which is measured by rays.
#[test]
fn gltf_textures_of_extensions() {
    use kiln::scene::TextureSlot::{
        Anisotropy, Clearcoat, ClearcoatRoughness, Occlusion, SheenColour, SheenRoughness, Specular,
        SpecularColour,
    };
    let folder = Folder::new();
    folder.write("a.png", png(1, &[[1, 2, 3, 4]]));
    image::RgbImage::from_pixel(1, 1, image::Rgb([1, 2, 3]))
        .save(folder.0.path().join("b.png"))
        .expect("a file");
    let by = |index: u32| json!({ "index": index });
    let extensions = json!({
        "KHR_materials_specular": { "specularTexture": by(0), "specularColorTexture": by(0) },
        "KHR_materials_transmission": { "transmissionFactor": 0, "transmissionTexture": by(0) },
        "KHR_materials_volume": { "thicknessFactor": 1, "thicknessTexture": by(0) },
        "KHR_materials_clearcoat": {
            "clearcoatFactor": 1, "clearcoatTexture": by(1), "clearcoatNormalTexture": by(1),
            "clearcoatRoughnessFactor": 1, "clearcoatRoughnessTexture": { "index": 1, "texCoord": 1 },
        },
        "KHR_materials_sheen": {
            "sheenColorFactor": [1, 1, 1], "sheenColorTexture": by(0),
            "sheenRoughnessFactor": 1, "sheenRoughnessTexture": by(0),
        },
        "KHR_materials_anisotropy": {
            "anisotropyStrength": 1, "anisotropyTexture": { "index": 1, "texCoord": 1 },
        },
    });
    // Without an alpha channel the specular factor is 1.
    let other = json!({ "KHR_materials_specular": { "specularTexture": by(1) } });
    let occlusion = |set: u32| json!({ "index": 1, "texCoord": set, "strength": 0.25 });
    let model = Model::triangle()
        .with("images", json!([{ "uri": "a.png" }, { "uri": "b.png" }]))
        .with("textures", json!([{ "source": 0 }, { "source": 1 }]))
        .with(
            "materials",
            json!([
                { "name": "m", "extensions": extensions, "occlusionTexture": occlusion(1) },
                { "extensions": other },
                { "occlusionTexture": occlusion(1) },
            ]),
        )
        .with("extensionsUsed", json!(extensions.as_object().expect("an object").keys().collect::<Vec<_>>()));
    let (scene, warnings) = folder.load("a.gltf", model.text());
    let textures = |i: usize| scene.materials[i].textures().iter();
    let found: Vec<_> = textures(0).map(|(slot, of)| (slot, of.image.0, of.coordinates)).collect();
    // Occlusion, on set 1, comes before the extensions; set 0 is the second one that the material uses.
    let expected = [
        (Occlusion, 1, 0),
        (Specular, 2, 1),
        (SpecularColour, 0, 1),
        (Clearcoat, 1, 1),
        (ClearcoatRoughness, 1, 0),
        (SheenColour, 0, 1),
        (SheenRoughness, 2, 1),
        (Anisotropy, 1, 0),
    ];
    assert_eq!(found, expected);
    assert_eq!(scene.images[2].pixels, [[4u8; 3]].into_iter().collect());
    assert!(scene.images[2].name.ends_with("image 0, alpha") && scene.images.len() == 3);
    assert_eq!(textures(1).count(), 0);
    // The only texture, so that the first coordinates of the mesh are of its set.
    let Material::MetallicRoughness(occluded) = &scene.materials[2] else { panic!("{:?}", scene.materials) };
    assert_eq!((textures(2).count(), occluded.textures.occlusion_strength), (1, 0.25));
    assert_eq!(warnings, ["a.gltf: 1 material(s) have a normal map of their clear coat; not used",]);
}

/// KHR_materials_pbrSpecularGlossiness takes precedence over the core model; the glossiness in the alpha channel
/// becomes roughness: 255 - 0.5 x 100 = 205.
#[test]
fn gltf_specular_glossiness_becomes_metallic_roughness() {
    let folder = Folder::new();
    folder.write("a.png", png(1, &[[1, 2, 3, 100]]));
    let name = "KHR_materials_pbrSpecularGlossiness";
    let value = json!({
        "diffuseFactor": [0.5, 2, 0.25, 1], "diffuseTexture": { "index": 0 }, "specularFactor": [0.1, 0.2, 0.3],
        "glossinessFactor": 0.5, "specularGlossinessTexture": { "index": 0 },
    });
    let pbr = json!({ "baseColorFactor": [0, 0, 0, 1], "metallicFactor": 1 });
    let model = Model::triangle()
        .with("images", json!([{ "uri": "a.png" }]))
        .with("textures", json!([{ "source": 0 }]))
        .with(
            "materials",
            json!([
                { "pbrMetallicRoughness": pbr, "extensions": { name: value } },
                { "extensions": { name: {} } },
            ]),
        )
        .with("extensionsUsed", json!([name]))
        .with("extensionsRequired", json!([name]));
    let (scene, warnings) = folder.load("a.gltf", model.text());
    assert_eq!(warnings, [""; 0]);
    let [Material::MetallicRoughness(m), Material::MetallicRoughness(plain)] = &scene.materials[..2] else {
        panic!("{:?}", scene.materials)
    };
    assert_eq!(m.base_colour, Colour::Linear(v(0.5, 1.0, 0.25)));
    assert_eq!(m.textures[TextureSlot::BaseColour].map(|t| t.image.0), Some(0));
    assert_eq!((m.metallic, m.roughness, m.layers.ior, m.layers.specular), (0.0, 1.0, 0.0, 1.0));
    assert_eq!(m.layers.specular_colour, Colour::Linear(v(0.1, 0.2, 0.3)));
    let slots: Vec<_> = m.textures.iter().map(|(slot, _)| slot).collect();
    assert_eq!(slots, [TextureSlot::BaseColour, TextureSlot::MetallicRoughness, TextureSlot::SpecularColour]);
    let roughness = m.textures[TextureSlot::MetallicRoughness].expect("the glossiness, converted").image.0;
    assert_eq!(scene.images[roughness as usize].pixels, [[205u8; 3]].into_iter().collect());
    // All defaults of the extension are 1: a mirror.
    assert_eq!((plain.metallic, plain.roughness, plain.layers.ior), (0.0, 0.0, 0.0));
    assert_eq!(plain.layers.specular_colour, Colour::Linear(DVec3::ONE));
}

#[test]
fn gltf_that_is_something_else() {
    assert_eq!(message(&Folder::new().fails("a.gltf", b"")), "a.gltf: is empty");
    for bytes in [&b"not json"[..], b"glTF\x02\0\0\0\xFF\xFF\xFF\xFF", b"{}"] {
        let e = Folder::new().fails("a.gltf", bytes);
        assert!(message(&e).starts_with("a.gltf: not a usable glTF file"), "{e}");
    }
}
