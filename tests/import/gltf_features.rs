//! Features and extensions of glTF, each in a file of its own with values worked out by hand; files that are invalid and
//! drawn nevertheless.

use glam::{DVec2, DVec3};
use kiln::error::{Error, Result, Warnings};
use kiln::import::load_with;
use kiln::render::RenderControl;
use kiln::scene::{Headlight, ImportOptions, Material, Mesh, PictureSettings, Samples, Scene, Shape};
use serde_json::{Value, json};

use crate::common::gltf::{Model, png_uri};

fn load(model: &Model, options: &ImportOptions) -> Result<(Scene, Vec<String>)> {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("model.glb");
    std::fs::write(&file, model.binary()).expect("the file is written");
    let mut warnings = Warnings::default();
    let scene = load_with(std::slice::from_ref(&file), options, &mut warnings)?;
    let prefix = format!("{}: ", file.display());
    let without = |message: &String| message.strip_prefix(&prefix).unwrap_or(message).to_owned();
    Ok((scene, warnings.messages().iter().map(without).collect()))
}

fn read(model: &Model) -> (Scene, Vec<String>) {
    load(model, &ImportOptions::default()).expect("a scene")
}

fn mesh(scene: &Scene) -> &Mesh {
    let Shape::Mesh(mesh) = &scene.objects[0].shape else { panic!("{:?}", scene.objects[0]) };
    mesh
}

/// Replaces the numbers of an attribute by `bytes`, of another component type.
fn with_bytes(model: &mut Model, attribute: &str, bytes: &[u8], component: u32, stride: usize) -> Value {
    let index = model.primitive()["attributes"][attribute].clone();
    let number = index.as_u64().expect("an index") as usize;
    model.set_bytes(number, bytes);
    let accessor = &mut model.json["accessors"][number];
    accessor["componentType"] = json!(component);
    let view = accessor["bufferView"].as_u64().expect("a buffer view") as usize;
    model.json["bufferViews"][view]["byteStride"] = json!(stride);
    index
}

/// KHR_mesh_quantization: positions of i16 as they are, of i8 normalised (-128 and -127 are -1), with a stride.
#[test]
fn quantized_positions() {
    let mut model = Model::triangle();
    let shorts: Vec<u8> = [[0i16, 0, 7, 0], [200, 0, 7, 0], [0, -300, 7, 0]]
        .iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let index = with_bytes(&mut model, "POSITION", &shorts, 5122, 8);
    model.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
    model.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let (scene, warnings) = read(&model);
    assert_eq!(warnings, [] as [&str; 0]);
    let expected = [[0.0, 0.0, 7.0], [200.0, 0.0, 7.0], [0.0, -300.0, 7.0]].map(DVec3::from);
    assert_eq!(mesh(&scene).positions, expected);
    let bytes: Vec<u8> = [[-128i8, 0, 127, 9], [127, 0, 127, 9], [0, -127, 127, 9]]
        .iter()
        .flatten()
        .map(|&x| x as u8)
        .collect();
    with_bytes(&mut model, "POSITION", &bytes, 5120, 4);
    model.json["accessors"][index.as_u64().expect("an index") as usize]["normalized"] = json!(true);
    model.json["extensionsRequired"] = json!([]);
    model.json["extensionsUsed"] = json!([]);
    let (scene, warnings) = read(&model);
    let expected = [[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, -1.0, 1.0]].map(DVec3::from);
    assert_eq!(mesh(&scene).positions, expected);
    let warning = "mesh 0, primitive 0: POSITION of type I8 Vec3 is not glTF without KHR_mesh_quantization";
    assert_eq!(warnings, [warning]);
}

/// Texture coordinates in i8 that are not normalised, as KHR_mesh_quantization allows them.
#[test]
fn quantized_texture_coordinates() {
    let mut model = Model::triangle();
    model.attribute("TEXCOORD_0", &[[0.0, 0.0]; 3]);
    with_bytes(&mut model, "TEXCOORD_0", &[3, 0, 0, 0, 254, 5, 0, 0, 0, 1, 0, 0], 5120, 4);
    model.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
    let (scene, _) = read(&model);
    assert_eq!(mesh(&scene).uvs[0].values, [[3.0, 0.0], [-2.0, 5.0], [0.0, 1.0]].map(DVec2::from));
}

/// An accessor without a buffer view is zeros, but for what a sparse one replaces.
#[test]
fn accessors_without_a_buffer_view() {
    let mut model = Model::triangle();
    model.attribute("NORMAL", &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let number = model.primitive()["attributes"]["NORMAL"].clone();
    let number = number.as_u64().expect("an index") as usize;
    model.json["accessors"][number].as_object_mut().expect("an object").remove("bufferView");
    let (scene, warnings) = read(&model);
    assert_eq!(warnings, [] as [&str; 0]);
    assert_eq!(mesh(&scene).normals.as_ref().expect("normals").values, [DVec3::ZERO; 3]);
    // The first byte of the positions is 0: the first normal is replaced by the second position.
    let sparse = |offset: u32| {
        json!({ "count": 1, "indices": { "bufferView": 0, "byteOffset": offset, "componentType": 5121 },
            "values": { "bufferView": 0, "byteOffset": 12 } })
    };
    model.json["accessors"][number]["sparse"] = sparse(0);
    let (scene, _) = read(&model);
    assert_eq!(mesh(&scene).normals.as_ref().expect("normals").values, [DVec3::X, DVec3::ZERO, DVec3::ZERO]);
    // The last byte of the number 1.0 is 0x3f: an index out of range; drawn without normals.
    model.json["accessors"][number]["sparse"] = sparse(15);
    assert!(mesh(&read(&model).0).normals.is_none());
}

/// KHR_materials_variants: the materials of a variant by its name.
#[test]
fn variants_choose_materials() {
    let mut model = Model::triangle();
    model.json["materials"] = json!([{ "name": "leather" }, { "name": "cloth" }]);
    model.json["extensionsUsed"] = json!(["KHR_materials_variants"]);
    model.json["extensionsRequired"] = json!(["KHR_materials_variants"]);
    let variants = json!([{ "name": "summer" }, { "name": "winter" }]);
    model.json["extensions"] = json!({ "KHR_materials_variants": { "variants": variants } });
    let mappings = json!([{ "material": 1, "variants": [1] }]);
    let primitive = model.primitive();
    primitive["material"] = json!(0);
    primitive["extensions"] = json!({ "KHR_materials_variants": { "mappings": mappings } });
    let drawn = |variant: Option<&str>| {
        let mut options = ImportOptions::default();
        options.reading.variant = variant.map(str::to_owned);
        let (scene, warnings) = load(&model, &options)?;
        assert_eq!((warnings.len(), scene.variants.as_slice()), (0, &["summer".into(), "winter".into()][..]));
        Ok(scene.materials[scene.objects[0].material.0 as usize].name().to_owned())
    };
    assert_eq!(drawn(None).expect("a scene"), "leather");
    assert_eq!(drawn(Some("summer")).expect("a scene"), "leather");
    assert_eq!(drawn(Some("winter")).expect("a scene"), "cloth");
    let e: Error = drawn(Some("autumn")).expect_err("there is none");
    assert!(matches!(e, Error::Usage { .. }), "{e:?}");
    assert_eq!(e.to_string(), "no input has a variant `autumn`");
    assert_eq!(e.hint(), "their variants: `summer`, `winter`");
}

#[test]
fn required_extensions_are_ignored_where_asked() {
    let mut model = Model::triangle();
    model.json["extensionsRequired"] = json!(["VENDOR_thing"]);
    assert!(load(&model, &ImportOptions::default()).is_err());
    let options = ImportOptions { ignore_required_extensions: true, ..ImportOptions::default() };
    let (scene, warnings) = load(&model, &options).expect("a scene");
    assert_eq!(scene.objects.len(), 1);
    assert_eq!(warnings, ["requires glTF extensions that kiln does not read: VENDOR_thing; ignored"]);
}

/// What the format forbids and every viewer draws: positions without bounds, a stride of 0, custom attributes without
/// `_`. A scene without nodes is valid.
#[test]
fn invalid_files_that_are_drawn() {
    let mut model = Model::triangle();
    let accessor = model.json["accessors"][0].as_object_mut().expect("an object");
    accessor.retain(|key, _| key != "min" && key != "max");
    model.json["bufferViews"][0]["byteStride"] = json!(0);
    model.primitive()["attributes"]["BATCHID"] = json!(0);
    model.primitive()["attributes"]["_MINE"] = json!(0);
    let (scene, warnings) = read(&model);
    assert_eq!(mesh(&scene).positions, [DVec3::ZERO, DVec3::X, DVec3::Y]);
    let warning = "attribute BATCHID is not an attribute semantic of glTF; application-specific ones begin with `_`; not used";
    assert_eq!(warnings, [warning]);
    model.json["scenes"] = json!([{ "name": "empty" }]);
    assert_eq!(read(&model).0.objects.len(), 0);
}

/// Lists of the document whose items are no objects: an error of the file.
#[test]
fn items_that_are_no_objects() {
    let lists =
        ["accessors", "animations", "bufferViews", "materials", "meshes", "nodes", "scenes", "textures"];
    for key in lists {
        // serde takes a list for the fields of an object in order.
        let mut model = Model::triangle();
        model.json[key] = json!([[]]);
        drop(load(&model, &ImportOptions::default()));
        for item in [json!(1), Value::Null, json!("a")] {
            let mut model = Model::triangle();
            model.json[key] = json!([item]);
            let e = load(&model, &ImportOptions::default()).expect_err("it is not glTF");
            assert!(e.to_string().contains("not a usable glTF file: "), "{key} = [{item}]: {e}");
        }
    }
    // The same inside of a mesh and of an animation.
    let mut model = Model::triangle();
    model.json["meshes"] = json!([{ "primitives": [7] }]);
    assert!(load(&model, &ImportOptions::default()).is_err());
    model.json["animations"] = json!([{ "channels": [7], "samplers": [] }]);
    assert!(load(&model, &ImportOptions::default()).is_err());
}

/// A PNG of 2 by 2 texels as a data URI: red, green / blue, white.
fn texels() -> String {
    png_uri(2, &[[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255; 4]])
}

/// A square seen by an orthographic camera whose pixels are the texels of `texture`, an emission texture beside a black
/// base colour texture on set 0.
fn square(texture: &Value, set_1: [[f32; 2]; 4]) -> Model {
    let mut model = Model::new(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    // v grows downwards.
    model.attribute("TEXCOORD_0", &[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
    model.attribute("TEXCOORD_1", &set_1);
    let primitive = model.primitive();
    (primitive["mode"], primitive["material"]) = (json!(6), json!(0));
    let base = json!({ "baseColorTexture": { "index": 0 }, "baseColorFactor": [0, 0, 0, 1] });
    let material =
        json!({ "pbrMetallicRoughness": base, "emissiveTexture": texture, "emissiveFactor": [1, 1, 1] });
    model.json["materials"] = json!([material]);
    model.json["textures"] = json!([{ "source": 0, "sampler": 0 }]);
    model.json["samplers"] = json!([{ "magFilter": 9728, "minFilter": 9728 }]);
    model.json["images"] = json!([{ "uri": texels() }]);
    let camera = json!({ "xmag": 0.5, "ymag": 0.5, "znear": 0.1, "zfar": 9 });
    model.json["cameras"] = json!([{ "type": "orthographic", "orthographic": camera }]);
    let nodes = model.json["nodes"].as_array_mut().expect("a list");
    nodes.push(json!({ "camera": 0, "translation": [0.5, 0.5, 1] }));
    model.json["scenes"] = json!([{ "nodes": [0, 1] }]);
    model.json["extensionsUsed"] = json!(["KHR_texture_transform"]);
    model
}

/// The 2 by 2 pixels of a model without a light.
fn pixels(model: &Model) -> Vec<[u8; 3]> {
    let (scene, warnings) = read(model);
    assert_eq!(warnings, [] as [&str; 0]);
    let settings = PictureSettings {
        light: Some(Headlight::None),
        samples: Some(Samples::clamped(1)),
        ..PictureSettings::of_size([2, 2])
    }
    .into();
    let job = kiln::job::prepare(scene, &settings, &mut Warnings::default()).expect("a job");
    let film = job.render::<[f32; 3]>(&RenderControl::default()).expect("a picture").0;
    film.rows().map(|pixel| pixel.map(|channel| (255.0 * channel).round() as u8)).collect()
}

/// Textures on several sets of coordinates with their own transforms, pixel by pixel.
#[test]
fn textures_on_their_own_coordinates() {
    let [r, g, b, w] = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255; 3]];
    let upright = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
    let mirrored = upright.map(|[u, v]| [1.0 - u, v]);
    let transformed =
        |transform: Value| json!({ "index": 0, "extensions": { "KHR_texture_transform": transform } });
    let quarter = std::f64::consts::FRAC_PI_2;
    for (texture, set_1, expected) in [
        (json!({ "index": 0 }), mirrored, [r, g, b, w]),
        (json!({ "index": 0, "texCoord": 1 }), mirrored, [g, r, w, b]),
        (transformed(json!({ "texCoord": 1 })), mirrored, [g, r, w, b]),
        // A pixel at (u, v) shows the texel at (u + 1/2, v).
        (transformed(json!({ "offset": [0.5, 0] })), upright, [g, r, w, b]),
        (transformed(json!({ "offset": [0, 0.5] })), upright, [b, w, r, g]),
        // (u, v) becomes (v, -u): the pixels (1/4, 1/4), (3/4, 1/4), (1/4, 3/4), (3/4, 3/4) show the texels at (1/4,
        // 3/4), (1/4, 1/4), (3/4, 3/4), (3/4, 1/4).
        (transformed(json!({ "rotation": quarter })), upright, [b, r, w, g]),
        // Half the texture: all pixels show its first texel.
        (transformed(json!({ "scale": [0.5, 0.5] })), upright, [r, r, r, r]),
        // Scaled, turned and moved in this order: (u, v) becomes (v / 2 + 1/2, -u / 2): texels (5/8, -1/8), (5/8, -3/8),
        // (7/8, -1/8), (7/8, -3/8).
        (
            transformed(json!({ "scale": [0.5, 0.5], "rotation": quarter, "offset": [0.5, 0] })),
            upright,
            [w, w, w, w],
        ),
    ] {
        assert_eq!(pixels(&square(&texture, set_1)), expected, "{texture}");
    }
}

/// A texture on a set that the mesh does not have: coordinates of 0, and a warning.
#[test]
fn missing_sets_of_texture_coordinates() {
    let model = square(&json!({ "index": 0, "texCoord": 2 }), [[0.0; 2]; 4]);
    let (scene, warnings) = read(&model);
    let expected = "it: a texture of its material is on set 2 of texture coordinates, which it does not have";
    assert_eq!(warnings, [expected]);
    let Material::MetallicRoughness(material) = &scene.materials[0] else { panic!("{:?}", scene.materials) };
    assert_eq!(material.emission_texture.map(|texture| texture.coordinates), Some(1));
    assert_eq!(mesh(&scene).uvs[1].values, [DVec2::ZERO; 4]);
}

/// The rows of a table of `docs/gltf.md` below a heading: their cells.
fn table(heading: &str) -> Vec<Vec<String>> {
    let page = std::fs::read_to_string(crate::common::repository("docs/gltf.md")).expect("the page");
    let section = page.split(&format!("\n## {heading}\n")).nth(1).expect("the heading");
    let section = section.split("\n## ").next().expect("its text");
    let cells = |line: &str| line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect();
    let rows: Vec<Vec<String>> = section.lines().filter(|line| line.starts_with('|')).map(cells).collect();
    // Without the heading and the line below it.
    rows[2..].to_vec()
}

/// Each extension of the table does what it says: one that is read may be required, without a warning; one that is not
/// is named by a warning where it is used, and by an error where it is required.
#[test]
fn the_table_of_extensions_is_true() {
    let rows = table("Extensions");
    assert!(rows.len() > 30);
    for row in rows {
        let name = row[0].trim_matches('`');
        let mut model = Model::triangle();
        model.json["extensionsUsed"] = json!([name]);
        let (scene, warnings) = read(&model);
        assert_eq!(scene.objects.len(), 1, "{name}");
        model.json["extensionsRequired"] = json!([name]);
        let required = load(&model, &ImportOptions::default());
        match row[1].as_str() {
            "yes" | "partly" => {
                assert_eq!(warnings, [] as [&str; 0], "{name}");
                assert_eq!(required.expect("it is read").1, [] as [&str; 0], "{name}");
                assert!(row[1] == "yes" || !row[2].is_empty(), "{name}: which part?");
            }
            "no" => {
                assert_eq!(warnings, [format!("extension {name} is not used")]);
                let e = required.expect_err("it is not read").to_string();
                let end = format!(": requires glTF extensions that kiln does not read: {name}");
                assert!(e.ends_with(&end), "{e}");
            }
            other => panic!("{name}: {other}"),
        }
    }
}

/// Each feature of the format has a test, which exists, and one that is not whole has a note.
#[test]
fn the_table_of_the_format_names_tests() {
    let tests: String = ["import", "render"]
        .into_iter()
        .flat_map(|folder| {
            let folder = crate::common::repository(&format!("tests/{folder}"));
            std::fs::read_dir(folder).expect("the tests")
        })
        .map(|entry| std::fs::read_to_string(entry.expect("a file").path()).unwrap_or_default())
        .collect();
    for row in table("The format") {
        let test = row[2].trim_matches('`');
        assert!(tests.contains(&format!("\nfn {test}() {{")), "{}: there is no test {test}", row[0]);
        assert!(["yes", "partly", "no"].contains(&row[1].as_str()), "{}: {}", row[0], row[1]);
        assert!(row[1] == "yes" || !row[3].is_empty(), "{}: which part?", row[0]);
    }
}

/// A triangle seen from behind is drawn, whether it is `doubleSided` or not.
#[test]
fn the_same_mesh_from_both_sides() {
    let mut model = square(&json!({ "index": 0 }), [[0.0; 2]; 4]);
    let front = pixels(&model);
    // Half a turn about x through the middle of the square: seen from behind, upside down.
    model.json["nodes"][0]["rotation"] = json!([1, 0, 0, 0]);
    model.json["nodes"][0]["translation"] = json!([0, 1, 0]);
    let behind = pixels(&model);
    assert_eq!(behind, [front[2], front[3], front[0], front[1]]);
    model.json["materials"][0]["doubleSided"] = json!(true);
    assert_eq!(pixels(&model), behind);
}

/// KHR_node_visibility hides meshes and lights, not cameras.
#[test]
fn cameras_of_hidden_nodes_stay() {
    let mut model = Model::triangle();
    model.json["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }]);
    let hidden = json!({ "KHR_node_visibility": { "visible": false } });
    model.json["nodes"] = json!([{ "mesh": 0 }, { "mesh": 0, "camera": 0, "extensions": hidden }]);
    model.json["scenes"] = json!([{ "nodes": [0, 1] }]);
    model.json["extensionsUsed"] = json!(["KHR_node_visibility"]);
    let (scene, _) = read(&model);
    assert_eq!((scene.objects.len(), scene.cameras.len()), (1, 1));
}

/// A file says the least version that it needs by `minVersion`, else `version`; minor versions are compatible (section 3.2).
#[test]
fn versions_beyond_2_0_are_refused() {
    let of = |version: &str, least: Option<&str>| {
        let mut model = Model::triangle();
        model.json["asset"] = json!({ "version": version });
        if let Some(least) = least {
            model.json["asset"]["minVersion"] = json!(least);
        }
        load(&model, &ImportOptions::default()).map(|_| ()).map_err(|e| e.to_string())
    };
    assert!(of("2.0", None).is_ok() && of("2.3", None).is_ok() && of("2.3", Some("2.0")).is_ok());
    for (version, least, named) in
        [("3.0", None, "3.0"), ("2.5", Some("2.5"), "2.5"), ("3.1", Some("3.0"), "3.0")]
    {
        let e = of(version, least).expect_err("a later version");
        assert!(e.contains(&format!("a file of glTF {named}; kiln reads glTF 2.0")), "{e}");
    }
}

/// EXT_mesh_gpu_instancing with custom attributes alone: the node's mesh once.
#[test]
fn instances_without_places_are_the_node() {
    let mut model = Model::triangle();
    let index = model.primitive()["attributes"]["POSITION"].clone();
    let instancing = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "_ID": index } } });
    model.json["nodes"] = json!([{ "mesh": 0, "extensions": instancing }]);
    model.json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
    assert_eq!(read(&model).0.objects.len(), 1);
}
