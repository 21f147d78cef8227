//! Features and extensions of glTF, each in a file of its own with values worked out by hand; files that are invalid and
//! drawn nevertheless.

use glam::{DVec2, DVec3};
use kiln::bvh::Numerics;
use kiln::error::{Error, Result, Warnings};
use kiln::import::load_with;
use kiln::render::RenderControl;
use kiln::scene::{Headlight, ImportOptions, Material, Mesh, PictureSettings, Samples, Scene, Shape};
use serde_json::{Value, json};

use crate::common::borders::Folder;
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
        let options = ImportOptions { variant: variant.map(str::to_owned), ..ImportOptions::default() };
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
    assert_eq!(
        material.textures[kiln::scene::TextureSlot::Emission].map(|texture| texture.coordinates),
        Some(1)
    );
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

/// GLB file of these chunks. `stated`: length in its header.
fn glb(chunks: &[(&[u8; 4], &[u8])], stated: Option<u32>) -> Vec<u8> {
    let mut body = Vec::new();
    for (kind, data) in chunks {
        body.extend((data.len() as u32).to_le_bytes());
        body.extend(*kind);
        body.extend(*data);
    }
    let length = stated.unwrap_or(12 + body.len() as u32).to_le_bytes();
    [&b"glTF"[..], &2u32.to_le_bytes(), &length, &body].concat()
}

/// Clients ignore chunks of other types (section 4.4.3); the length that a header states is not needed to read a file.
#[test]
fn binary_files_with_other_chunks_bytes_or_lengths() {
    let model = Model::triangle();
    let mut json = model.json.clone();
    json["buffers"] = json!([{ "byteLength": model.bytes.len() }]);
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let (text, data) = (text.as_slice(), model.bytes.as_slice());
    type Chunk<'a> = (&'a [u8; 4], &'a [u8]);
    let [json, bin, junk]: [Chunk; 3] = [(b"JSON", text), (b"BIN\0", data), (b"JU\x1bK", &[1; 8])];
    let zeros = [text, &[0; 4]].concat();
    let marked = [b"\xEF\xBB\xBF", text].concat();
    let whole = glb(&[json, bin], None);
    let trailing = [&whole[..], b"\r\n"].concat();
    let unused = "its chunk `JU\\x1bK` of 8 bytes is not used";
    let padded = glb(&[(b"JSON", &text[..text.len() - 1]), bin], None);
    // The last byte of the text stands after its chunk, which begins the next one late.
    let text_end = 20 + text.len() - 1;
    let unaligned = [&padded[..text_end], b" ", &padded[text_end..]].concat();
    for (name, bytes, warned) in [
        ("as it should be", whole.clone(), None),
        ("after", glb(&[json, bin, junk], None), Some(unused)),
        ("between", glb(&[json, junk, bin], None), Some(unused)),
        ("before", glb(&[junk, bin, json], None), Some(unused)),
        ("of no bytes", glb(&[json, (b"NONE", &[]), bin], None), Some("its chunk `NONE` of 0 bytes")),
        ("too short", glb(&[json, bin], Some(100)), Some("its header states 100 bytes")),
        ("too long", glb(&[json, bin], Some(u32::MAX)), Some("its header states 4294967295")),
        ("bytes behind", trailing, Some("2 bytes after its last chunk are not used")),
        ("zeros in the text", glb(&[(b"JSON", &zeros), bin], None), None),
        ("a mark in the text", glb(&[(b"JSON", &marked), bin], None), None),
        ("padding that is not counted", unaligned, Some("its header states ")),
    ] {
        let folder = Folder::new();
        let (scene, warnings) = folder.load("a.glb", bytes);
        assert_eq!(mesh(&scene).positions.len(), 3, "{name}");
        match warned {
            None => assert_eq!(warnings, [] as [&str; 0], "{name}"),
            Some(expected) => assert!(warnings.iter().any(|w| w.contains(expected)), "{name}: {warnings:?}"),
        }
    }
    // Its positions are 36 bytes; one that ends within them cannot be used.
    let cut = &whole[..whole.len() - 1];
    let e = Folder::new().fails("a.glb", cut).to_string();
    assert!(e.ends_with("a.glb: buffer 0: has 35 bytes; byteLength is 36"), "{e}");
}

/// `extras` and names of any JSON type (section 3.12), in every object.
#[test]
fn extras_and_names_of_any_type() {
    for extras in [json!(1), json!("text"), json!([1, "a"]), json!(true), Value::Null, json!({ "a": 1 })] {
        let mut model = square(&json!({ "index": 0, "extras": extras }), [[0.0; 2]; 4]);
        model.json["cameras"] = json!([{ "type": "perspective", "extras": extras,
            "perspective": { "yfov": 1.0, "znear": 0.1, "extras": extras } }]);
        model.json["extensions"] = json!({ "X_of_someone": { "extras": extras } });
        for key in ["asset", "accessors", "bufferViews", "images", "materials", "meshes", "nodes", "scenes"] {
            match &mut model.json[key] {
                Value::Array(list) => list.iter_mut().for_each(|item| {
                    item["extras"] = extras.clone();
                    item["name"] = json!(7);
                }),
                item => item["extras"] = extras.clone(),
            }
        }
        model.primitive()["extras"] = extras.clone();
        model.json["extras"] = extras.clone();
        let (scene, warnings) = read(&model);
        assert_eq!(
            (scene.objects.len(), scene.images.len(), warnings.len()),
            (1, 1, 0),
            "{extras}: {warnings:?}"
        );
    }
}

/// The format of an image is detected from its bytes; equal images are decoded once.
#[test]
fn images_with_any_or_no_type() {
    let png = crate::common::gltf::png(1, &[[255, 0, 0, 255]]);
    for kind in [None, Some(json!("image/jpeg")), Some(json!("")), Some(json!(7)), Some(json!("image/png"))] {
        let mut model = Model::square().with_texture(
            "",
            &json!({}),
            &json!({
            "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }),
        );
        model.bytes.resize(model.bytes.len().next_multiple_of(4), 0);
        let offset = model.bytes.len();
        model.bytes.extend(&png);
        let views = model.json["bufferViews"].as_array_mut().expect("a list");
        views.push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": png.len() }));
        let view = views.len() - 1;
        let mut image = json!({ "bufferView": view });
        if let Some(kind) = &kind {
            image["mimeType"] = kind.clone();
        }
        model.json["images"] = json!([image, image]);
        let (scene, warnings) = read(&model);
        assert_eq!((scene.images.len(), warnings.len()), (1, 0), "{kind:?}: {warnings:?}");
        assert_eq!(scene.images[0].pixels, [[255u8, 0, 0]].into_iter().collect(), "{kind:?}");
    }
    // A type in a data URI, and a name of a file, that say otherwise.
    let uri = crate::common::gltf::data_uri("image/jpeg", &png);
    let folder = Folder::new();
    folder.write("picture.jpg", &png);
    for uri in [uri.as_str(), "picture.jpg"] {
        let material = json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } });
        let model = Model::square().with_texture(uri, &json!({}), &material);
        let (scene, warnings) = folder.load("a.gltf", model.text());
        assert_eq!((scene.images.len(), warnings.len()), (1, 0), "{uri}: {warnings:?}");
    }
}

/// Primitives without positions and invalid enumerated values do not affect the rest.
#[test]
fn primitives_without_positions_and_values_of_no_meaning() {
    let mut model = Model::triangle();
    let index = model.primitive()["attributes"]["POSITION"].clone();
    let primitives = model.json["meshes"][0]["primitives"].as_array_mut().expect("a list");
    primitives.insert(0, json!({ "attributes": { "NORMAL": index } }));
    let (scene, warnings) = read(&model);
    assert_eq!((scene.objects.len(), mesh(&scene).positions.len()), (1, 3));
    assert_eq!(warnings, ["it: a mesh without positions is not drawn"]);

    let mut model = square(&json!({ "index": 0 }), [[0.0; 2]; 4]);
    model.json["samplers"] =
        json!([{ "magFilter": 0, "minFilter": "LINEAR", "wrapS": 10496, "wrapT": null }]);
    model.json["bufferViews"][0]["target"] = json!(0);
    model.json["materials"][0]["alphaMode"] = json!("CUTOUT");
    let (scene, warnings) = read(&model);
    assert_eq!((scene.objects.len(), scene.images.len(), warnings.len()), (1, 1, 6), "{warnings:?}");
}

/// A WebP of a few bytes that claims 16383 x 16383 texels would take 13 seconds.
#[test]
fn a_webp_of_a_few_bytes_with_an_immense_size() {
    // A lossless bit stream: its signature, both sides less 1 in 14 bits each, and version 0.
    let sizes = (16382u32 | 16382 << 14).to_le_bytes();
    let stream = [&[0x2f][..], &sizes, &[0; 8]].concat();
    let mut file = b"RIFF".to_vec();
    file.extend((4 + 8 + stream.len() as u32 + 1).to_le_bytes());
    file.extend(b"WEBPVP8L");
    file.extend((stream.len() as u32).to_le_bytes());
    file.extend(stream);
    file.push(0);
    let uri = crate::common::gltf::data_uri("image/webp", &file);
    let model = Model::square().with_texture(
        &uri,
        &json!({}),
        &json!({
        "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }),
    );
    let (scene, warnings) = read(&model);
    assert_eq!(scene.images.len(), 0);
    assert_eq!(warnings, ["image 0: texture left out: 16383 x 16383 texels in 34 bytes: damaged"]);
}

/// A red card that faces away, in front of a green one that faces the camera, lit from the camera: with --cull, the
/// green one is visible, in the shadow of the red one, with its depth and object, in every tier and transport.
#[test]
fn culled_back_faces_are_hidden_from_the_camera_alone() {
    let mut model = Model::new(&[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]);
    let front = model.shorts(&[0, 1, 2, 0, 2, 3], "SCALAR", 6);
    let back = model.shorts(&[0, 2, 1, 0, 3, 2], "SCALAR", 6);
    let positions = model.primitive()["attributes"]["POSITION"].clone();
    let card = |indices: usize, material: usize| json!({ "primitives": [{ "attributes": { "POSITION": positions }, "indices": indices, "material": material }] });
    model.json["meshes"] = json!([card(front, 0), card(back, 1)]);
    let material = |colour: [f64; 4]| json!({ "pbrMetallicRoughness": { "baseColorFactor": colour, "metallicFactor": 0 } });
    model.json["materials"] = json!([material([0.0, 1.0, 0.0, 1.0]), material([1.0, 0.0, 0.0, 1.0])]);
    model.json["cameras"] = json!([{ "type": "orthographic",
        "orthographic": { "xmag": 0.5, "ymag": 0.5, "znear": 0.1, "zfar": 9 } }]);
    model.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    model.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "directional" }] } });
    model.json["nodes"] = json!([
        { "mesh": 0 }, { "mesh": 1, "translation": [0, 0, 1] },
        { "camera": 0, "translation": [0, 0, 4], "extensions": { "KHR_lights_punctual": { "light": 0 } } },
    ]);
    model.json["scenes"] = json!([{ "nodes": [0, 1, 2] }]);
    let file = Folder::new();
    let (scene, _) = file.load("a.gltf", model.text());
    let drawn = |cull: Option<bool>, without: &[&str], transport, numerics| {
        let picture = PictureSettings {
            cull,
            transport: Some(transport),
            numerics: Some(numerics),
            samples: Some(Samples::clamped(4)),
            ..PictureSettings::of_size([9, 9])
        };
        let mut settings = kiln::job::RenderSettings::from(picture);
        settings.without = without.iter().map(|&name| name.to_owned()).collect();
        let mut warnings = Warnings::default();
        let job = kiln::job::prepare(scene.clone(), &settings, &mut warnings).expect("a job");
        let (film, _) = job.render::<[f32; 3]>(&RenderControl::default()).expect("a picture");
        let names = ["depth".to_owned(), "object".to_owned()];
        let selection = kiln::render::aov::AovSelection::new(&names).expect("names of AOVs");
        let aovs = kiln::render::aov::channels(&job.aov_source(None), &selection, &RenderControl::default());
        let values = aovs.expect("AOVs").iter().map(|channel| channel.values[40]).collect::<Vec<_>>();
        (film.rows().nth(40).expect("the centre"), values, warnings.notes().join("\n"))
    };
    for transport in kiln::scene::Transport::ALL {
        for numerics in Numerics::ALL {
            let name = format!("{transport:?} {numerics:?}");
            let (all, values, notes) = drawn(None, &["shadows"], transport, numerics);
            // Dielectrics reflect 0.04 of white light.
            assert!(all[0] > 0.0 && all[1] < 0.05 * all[0], "{name}: {all:?}");
            assert_eq!(values, [3.0, 1.0], "{name}");
            assert!(notes.contains("100 % of what is seen are back faces"), "{notes}");
            let (lit, values, notes) = drawn(Some(true), &["shadows"], transport, numerics);
            // The ray continues behind the red card from an offset origin.
            assert!((values[0] - 4.0).abs() < 1e-5 && values[1] == 0.0, "{name}: {values:?}");
            assert!(!notes.contains("--cull"), "{notes}");
            let (shadowed, ..) = drawn(Some(true), &[], transport, numerics);
            let is_red = |colour: [f32; 3]| colour[0] > 0.05 * colour[1];
            assert!(
                !is_red(lit) && (shadowed[0] == 0.0 || !is_red(shadowed)),
                "{name}: {lit:?} {shadowed:?}"
            );
            // Path tracing always has shadows, and no ambient light.
            if transport == kiln::scene::Transport::Whitted {
                assert!(0.0 < shadowed[1] && shadowed[1] < lit[1], "{name}: {shadowed:?} {lit:?}");
            } else {
                assert_eq!(shadowed[1], 0.0, "{name}");
            }
        }
    }
}

/// A file with a second buffer, and the number of an accessor in it.
fn with_second_buffer(mut model: Model, buffer: &Value) -> (Model, usize) {
    let positions = model.floats(&[[0.0f32, 0.0, 1.0]; 3]);
    let view = model.json["accessors"][positions]["bufferView"].as_u64().expect("a buffer view") as usize;
    model.json["bufferViews"][view] = json!({ "buffer": 1, "byteLength": 36 });
    let uri = crate::common::gltf::data_uri("", &model.bytes);
    model.json["buffers"] = json!([{ "byteLength": model.bytes.len(), "uri": uri }, buffer]);
    (model, positions)
}

/// A buffer that cannot be loaded is an error where a mesh of the scene is in it, and a warning else.
#[test]
fn buffers_in_which_nothing_is_that_is_drawn() {
    for (buffer, what) in [
        (json!({ "byteLength": 36, "uri": "gone.bin" }), "gone.bin: no such file"),
        (json!({ "byteLength": 36 }), "the binary part of the file is missing"),
        (json!({ "byteLength": 36, "uri": "data:,a" }), "has 1 bytes; byteLength is 36"),
        (json!({ "byteLength": 36, "uri": "http://a/b" }), "`http://a/b` is not a relative path"),
    ] {
        let make = || with_second_buffer(Model::triangle(), &buffer);
        let warned = |change: &dyn Fn(&mut Model, usize)| {
            let (mut model, accessor) = make();
            change(&mut model, accessor);
            let (scene, warnings) = model.load();
            assert_eq!(mesh(&scene).positions, [DVec3::ZERO, DVec3::X, DVec3::Y]);
            let end = "what it holds is not used";
            let is_named =
                |w: &String| w.starts_with("a.gltf: buffer 1: ") && w.ends_with(end) && w.contains(what);
            assert!(warnings.iter().any(is_named), "{what}: {warnings:?}");
        };
        warned(&|_, _| {});
        // In a mesh that is in no node, in an image, and in a clip.
        warned(&|model, accessor| {
            let other = json!({ "primitives": [{ "attributes": { "POSITION": accessor } }] });
            model.json["meshes"].as_array_mut().expect("a list").push(other);
        });
        warned(&|model, accessor| {
            model.json["images"] = json!([{ "bufferView": accessor, "mimeType": "image/png" }]);
        });
        warned(&|model, accessor| {
            let channels = json!([{ "sampler": 0, "target": { "node": 0, "path": "translation" } }]);
            let samplers = json!([{ "input": 0, "output": accessor }]);
            model.json["animations"] = json!([{ "channels": channels, "samplers": samplers }]);
        });
        let fails = |change: &dyn Fn(&mut Model, usize)| {
            let (mut model, accessor) = make();
            change(&mut model, accessor);
            let e = model.fails().to_string();
            assert!(e.contains("a.gltf: buffer 1: ") && e.contains(what), "{e}");
        };
        for key in ["POSITION", "NORMAL", "TEXCOORD_0"] {
            fails(&|model, accessor| model.primitive()["attributes"][key] = json!(accessor));
        }
        fails(&|model, accessor| model.primitive()["targets"] = json!([{ "POSITION": accessor }]));
        fails(&|model, accessor| {
            let instancing =
                json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": accessor } } });
            model.json["nodes"][0]["extensions"] = instancing;
        });
    }
}

/// Every integer of the document as a number with a fraction of zero, and real numbers as they are.
#[test]
fn integers_with_a_fraction_of_zero() {
    fn with_fractions(value: &mut Value) {
        match value {
            Value::Array(items) => items.iter_mut().for_each(with_fractions),
            Value::Object(object) => object.values_mut().for_each(with_fractions),
            Value::Number(number) => *value = json!(number.as_f64().expect("a number")),
            _ => {}
        }
    }
    let metallic = json!({ "baseColorTexture": { "index": 0 }, "metallicFactor": 0.1, "roughnessFactor": 1 });
    let mut model = Model::square().with_texture(
        &png_uri(1, &[[255, 0, 0, 255]]),
        &json!({ "magFilter": 9728, "wrapS": 33071 }),
        &json!({
            "pbrMetallicRoughness": metallic,
            "extensions": { "KHR_materials_clearcoat": { "clearcoatFactor": 1 } },
        }),
    );
    model.json["nodes"][0]["translation"] = json!([-0.0, 0.1, 16_777_217.0]);
    model.json["nodes"].as_array_mut().expect("a list").push(json!({ "camera": 0 }));
    model.json["scenes"][0]["nodes"] = json!([0, 1]);
    model.json["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1, "znear": 1 } }]);
    let uri = crate::common::gltf::data_uri("", &model.bytes);
    model.json["buffers"] = json!([{ "byteLength": model.bytes.len(), "uri": uri }]);
    let described = |model: &Model, name: &str, bytes: Vec<u8>| {
        let (scene, warnings) = Folder::new().load(name, bytes);
        assert_eq!(warnings, [] as [&str; 0], "{}", model.json);
        format!("{:?} {:?} {:?}", scene.objects, scene.materials, scene.cameras)
    };
    let expected = described(&model, "a.gltf", model.text().into());
    assert!(expected.contains("16777216"), "a node has f32: {expected}");
    with_fractions(&mut model.json);
    assert!(model.text().contains("\"mesh\":0.0"), "{}", model.text());
    assert_eq!(described(&model, "a.gltf", model.text().into()), expected);
    let text = model.json.to_string().into_bytes();
    assert_eq!(described(&model, "a.glb", glb(&[(b"JSON", &text)], None)), expected);
    // A fraction that is not zero is no integer.
    model.json["nodes"][0]["mesh"] = json!(0.5);
    let e = model.fails().to_string();
    assert!(
        e.ends_with("not a usable glTF file: nodes[0] has `mesh` of another type than glTF gives it"),
        "{e}"
    );
}

/// Primitives without `attributes` are left out as those without positions.
#[test]
fn primitives_without_attributes() {
    let mut model = Model::triangle();
    let primitives = model.json["meshes"][0]["primitives"].as_array_mut().expect("a list");
    primitives.insert(0, json!({ "mode": 4 }));
    let (scene, warnings) = read(&model);
    assert_eq!((scene.objects.len(), mesh(&scene).positions.len()), (1, 3));
    assert_eq!(warnings, ["it: a mesh without positions is not drawn"]);
}

/// Lights and cameras that glTF does not know are left out; the others keep their indices. Angles of spots have
/// defaults.
#[test]
fn unknown_lights_and_cameras() {
    let mut model = Model::triangle();
    let lights = json!([{ "type": "area" }, { "type": "point", "intensity": 5 }, {}, { "type": "spot" }]);
    model.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": lights } });
    model.json["cameras"] = json!([
        { "type": "fisheye" },
        { "type": "perspective", "perspective": { "yfov": 1 } },
        { "type": "perspective", "perspective": { "yfov": 0.5, "znear": 0.1 } },
        { "type": "orthographic" },
    ]);
    let mut nodes = vec![json!({ "mesh": 0 })];
    nodes.extend(
        (0..4).map(|i| json!({ "camera": i, "extensions": { "KHR_lights_punctual": { "light": i } } })),
    );
    model.json["nodes"] = json!(nodes);
    model.json["scenes"] = json!([{ "nodes": [0, 1, 2, 3, 4] }]);
    for binary in [true, false] {
        let (scene, warnings) = if binary { read(&model) } else { model.load() };
        assert_eq!((scene.objects.len(), scene.lights.len(), scene.cameras.len()), (1, 2, 1));
        let what = "is of a kind that glTF does not know, or not whole; left out";
        let names = ["light 0", "light 2", "camera 0", "camera 1", "camera 3"];
        assert_eq!(warnings.len(), names.len(), "{warnings:?}");
        for (warning, name) in warnings.iter().zip(names) {
            assert!(warning.ends_with(&format!("{name} {what}")), "{warning}");
        }
    }
}

/// Strides that the format forbids: 3 for colours of three bytes, and 256 for positions.
#[test]
fn strides_beyond_the_format() {
    let mut model = Model::triangle();
    let plain = read(&model).0;
    let colours = model.floats(&[[0.0f32; 3]; 3]);
    let bytes = [255, 0, 0, 0, 255, 0, 0, 0, 255u8];
    model.set_bytes(colours, &bytes);
    model.json["accessors"][colours]["componentType"] = json!(5121);
    model.json["accessors"][colours]["normalized"] = json!(true);
    model.json["bufferViews"][1] = json!({ "buffer": 0, "byteOffset": 36, "byteLength": 9, "byteStride": 3 });
    model.primitive()["attributes"]["COLOR_0"] = json!(colours);
    let (scene, warnings) = read(&model);
    assert_eq!(mesh(&scene).colours.as_ref().expect("colours").values, [DVec3::X, DVec3::Y, DVec3::Z]);
    let what = "`byteStride` of 1 of its bufferViews is not from 4 to 252 as glTF has it; used";
    assert_eq!(warnings, [what]);
    // Elements that the stride leads beyond the view, and a stride that is less than an element.
    for stride in [2, 4] {
        let mut model = Model { json: model.json.clone(), bytes: model.bytes.clone() };
        model.json["bufferViews"][1]["byteStride"] = json!(stride);
        let e = model.fails().to_string();
        assert!(e.contains("accessor 1: its elements do not lie inside its buffer view"), "{e}");
    }
    let corner = |i: usize| model.bytes[12 * i..12 * i + 12].to_vec();
    let mut apart = Model { json: Model::triangle().json, bytes: vec![0; 524] };
    for i in 0..3 {
        apart.bytes[256 * i..256 * i + 12].copy_from_slice(&corner(i));
    }
    apart.json["bufferViews"][0] = json!({ "buffer": 0, "byteLength": 524, "byteStride": 256 });
    let (scene, warnings) = read(&apart);
    assert_eq!((mesh(&scene), warnings), (mesh(&plain), vec![what.to_owned()]));
}

/// glTF 1.0 says what it is and how to convert it, by its version or, as drafts lack one, by items that have names.
#[test]
fn the_first_version_is_named() {
    let mut files = vec![b"glTF\x01\0\0\0\x14\0\0\0".to_vec()];
    for asset in [
        json!({ "version": "1.0" }),
        json!({ "version": "1.0.1" }),
        json!({ "version": 1 }),
        json!({ "version": 0.8 }),
    ] {
        files.push(json!({ "asset": asset, "meshes": {} }).to_string().into());
        files.push(json!({ "asset": asset }).to_string().into());
    }
    files.push(json!({ "meshes": { "mesh_1": { "primitives": [] } } }).to_string().into());
    for file in files {
        let e = Folder::new().fails("a.gltf", &file);
        assert!(e.to_string().ends_with("a.gltf: a file of glTF 1.0; kiln reads glTF 2.0"), "{e}");
        assert!(e.hint().contains("gltf-pipeline -i in.gltf -o out.glb"), "{}", e.hint());
    }
    let mut model = Model::triangle();
    for version in [json!(2), json!(2.0)] {
        model.json["asset"]["version"] = version;
        assert_eq!(read(&model).0.objects.len(), 1);
    }
}

/// What cannot be read is said with its place, and not in the words of a library.
#[test]
fn places_of_what_is_no_gltf() {
    let cases: [(&str, Value, &str); 12] = [
        ("/accessors/0/count", Value::Null, "accessors[0] has `count` of another type than glTF gives it"),
        ("/accessors/0/count", json!(-3), "accessors[0] has `count` of another type than glTF gives it"),
        (
            "/accessors/0/componentType",
            json!("a"),
            "accessors[0] has `componentType` of another type than glTF gives it",
        ),
        (
            "/accessors/0/componentType",
            json!(7),
            "accessors[0].componentType has a value that glTF does not know",
        ),
        (
            "/accessors/0/bufferView",
            json!(7),
            "accessors[0].bufferView refers to an item that does not exist",
        ),
        ("/accessors/0", json!({}), "accessors[0] has no `count`"),
        ("/bufferViews/0", json!({ "buffer": 0 }), "bufferViews[0] has no `byteLength`"),
        ("/nodes/0", json!({ "matrix": [1, 2] }), "nodes[0] has `matrix` of another type than glTF gives it"),
        ("/meshes/0/primitives", json!(3), "meshes[0] has `primitives` of another type than glTF gives it"),
        ("/scenes/0", json!("a"), "scenes[0] is no object"),
        ("/asset", json!({}), "asset has no `version`"),
        ("/scene", json!("a"), "its JSON has `scene` of another type than glTF gives it"),
    ];
    for (pointer, value, expected) in cases {
        let mut model = Model::triangle();
        *model.json.pointer_mut(pointer).expect("it is there") = value;
        let texts = [model.fails().to_string(), Folder::new().fails("a.glb", model.binary()).to_string()];
        for text in texts {
            assert!(text.ends_with(&format!(": not a usable glTF file: {expected}")), "{pointer}: {text}");
        }
    }
}

/// What is wrong with the chunks of a GLB, at each place where the file may be cut.
#[test]
fn cut_binary_files_say_where() {
    let whole = Model::triangle().binary();
    let header = "it ends within its header of 12 bytes";
    let json = "its chunk of JSON is missing or cut";
    for (length, expected) in [(4, header), (11, header), (12, json), (19, json), (40, json)] {
        let e = Folder::new().fails("a.glb", &whole[..length]).to_string();
        assert!(e.ends_with(&format!("a.glb: not a usable glTF file: {expected}")), "{length}: {e}");
    }
}
