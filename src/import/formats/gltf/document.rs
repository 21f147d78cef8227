//! glTF documents as JSON: parsed, repaired where viewers commonly draw what the format forbids, and validated.
//!
//! Everything that does not depend on buffers is changed here, in the JSON, so that the rest of the importer reads a
//! document that the `gltf` crate has validated.

use std::path::Path;

use gltf::json::validation::{Error as Fault, Validate};
use serde::Deserialize;
use serde_json::Value;

use crate::error::{Error, Result, Warnings, contain};
use crate::import::formats::gltf::check::fault;
use crate::import::formats::gltf::pointer::{self, PointerChannel};
use crate::import::formats::gltf::{Loader, instancing, layers, variants};
use crate::limits;

pub(super) const VISIBILITY: &str = "KHR_node_visibility";
pub(super) const TEXTURE_TRANSFORM: &str = "KHR_texture_transform";
pub(super) const QUANTIZATION: &str = "KHR_mesh_quantization";
pub(super) const XMP: &str = "KHR_xmp_json_ld";

const WEBP: &str = "EXT_texture_webp";
const BASIS: &str = "KHR_texture_basisu";

/// The extensions that are read, but those of [`layers::ALL`].
const EXTENSIONS: &[&str] = &[
    WEBP,
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_unlit",
    QUANTIZATION,
    instancing::NAME,
    pointer::NAME,
    variants::NAME,
    VISIBILITY,
    TEXTURE_TRANSFORM,
    XMP,
];

/// Those of the feature `codecs`.
#[cfg(feature = "codecs")]
const CODECS: &[&str] = &[BASIS, super::draco::NAME, super::meshopt::NAMES[0], super::meshopt::NAMES[1]];
#[cfg(not(feature = "codecs"))]
const CODECS: &[&str] = &[];

/// The extensions that name another image of a texture, the best first.
const TEXTURE_SOURCES: &[&str] = &[BASIS, WEBP];

/// Whether an extension is read.
pub(super) fn is_read(extension: &str) -> bool {
    [EXTENSIONS, CODECS, &layers::ALL].iter().any(|list| list.contains(&extension))
}

/// A parsed document.
pub(super) struct Json {
    /// The JSON, without the channels in `pointers`.
    pub(super) root: Value,
    /// The binary chunk of a GLB file.
    pub(super) blob: Option<Vec<u8>>,
    /// The channels of KHR_animation_pointer.
    pub(super) pointers: Vec<PointerChannel>,
}

fn unusable(file: &Path, why: impl std::fmt::Display) -> Error {
    Error::input(file, format!("not a usable glTF file: {why}"), "export it again as glTF 2.0")
}

fn damaged(file: &Path) -> Error {
    Error::input(file, "not a usable glTF file", "export it again as glTF 2.0")
}

/// The error for glTF 1.0, whose JSON has another structure.
fn version_1(file: &Path) -> Error {
    let hint =
        "convert it to glTF 2.0, for example with gltf-pipeline: `gltf-pipeline -i in.gltf -o out.glb`";
    Error::input(file, "a file of glTF 1.0; kiln reads glTF 2.0", hint)
}

/// Parses a .gltf or .glb file and repairs its JSON; warns of each repair.
pub(super) fn parse(bytes: &[u8], file: &Path, warnings: &mut Warnings) -> Result<Json> {
    let (json, blob) = if bytes.starts_with(b"glTF\x01\0\0\0") {
        return Err(version_1(file));
    } else if bytes.starts_with(b"glTF") {
        let mut warn = |what: String| warnings.push(format!("{}: {what}", file.display()));
        glb_chunks(bytes, &mut warn).map_err(|why| unusable(file, why))?
    } else {
        (bytes, None)
    };
    let json = json.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(json);
    let json = &json[..json.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1)];
    // Bytes of a JSON object, as a map and in the validated document; measured with nodes and materials.
    const OBJECT: u64 = 1200;
    let objects = json.iter().filter(|&&byte| byte == b'{').count() as u64;
    limits::check(limits::product(&[objects, OBJECT]))
        .map_err(|excess| excess.at(file, format!("its JSON of {objects} objects")))?;
    let mut root: Value = serde_json::from_slice(json).map_err(|e| {
        let what = format!("its JSON ends or is damaged at line {}, column {}", e.line(), e.column());
        unusable(file, what)
    })?;
    // Some exporters write the version as a number.
    let version = root.pointer_mut("/asset/version");
    if let Some(number) = version.filter(|version| version.is_number()) {
        *number = Value::from(format!("{:.1}", number.as_f64().unwrap_or_default()));
    }
    // Its items have names rather than numbers in lists, and its version may be missing or that of a draft.
    let has_names = ["accessors", "bufferViews", "meshes", "nodes"].iter().any(|key| root[*key].is_object());
    let version = root["asset"]["version"].as_str().unwrap_or_default();
    if has_names || version.starts_with("1.") || version.starts_with("0.") || version == "1" {
        return Err(version_1(file));
    }
    // Section 3.2: the least version that the file needs, else the major version.
    let needed = ["minVersion", "version"].into_iter().find_map(|key| root["asset"][key].as_str());
    let number = |text: &str| -> Option<(u32, u32)> {
        let (major, minor) = text.split_once('.')?;
        Some((major.parse().ok()?, minor.parse().ok()?))
    };
    let is_min = root["asset"]["minVersion"].is_string();
    if let Some((needed, (major, minor))) = needed.and_then(|text| Some((text, number(text)?)))
        && (major > 2 || is_min && (major, minor) > (2, 0))
    {
        let what = format!("a file of glTF {needed}; kiln reads glTF 2.0");
        return Err(Error::input(file, what, "export it as glTF 2.0"));
    }
    tidy_all(&mut root);
    let pointers = pointer::take_channels(&mut root);
    check_channels(&root, file)?;
    repair(&mut root, |what| warnings.left_out(format!("{}: {what}", file.display())));
    Ok(Json { root, blob: blob.map(<[u8]>::to_vec), pointers })
}

/// The JSON and the binary chunk of a GLB file.
type GlbChunks<'a> = (&'a [u8], Option<&'a [u8]>);

/// Finds the JSON and binary chunks of a GLB file (glTF 2.0, section 4.4). The stated file length, chunks of other
/// types and trailing bytes are ignored; the binary chunk may be truncated by the end of the file.
///
/// # Errors
/// What is wrong.
fn glb_chunks<'a>(
    bytes: &'a [u8],
    warn: &mut impl FnMut(String),
) -> std::result::Result<GlbChunks<'a>, String> {
    const HEADER: usize = 12;
    const CUT: &str = "it ends within its header of 12 bytes";
    let number = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at.checked_add(4)?)?.try_into().ok()?));
    let version = number(4).ok_or(CUT)?;
    if version != 2 {
        return Err(format!("it is a GLB of version {version}; kiln reads version 2"));
    }
    let stated = number(8).ok_or(CUT)?;
    if (stated as usize) < HEADER {
        return Err(format!("its header of 12 bytes states a length of {stated}"));
    }
    if u64::from(stated) != bytes.len() as u64 {
        warn(format!("its header states {stated} bytes; the file has {}", bytes.len()));
    }
    let (mut json, mut binary) = (None, None);
    let mut at = HEADER;
    while at < bytes.len() {
        let head = bytes.get(at..at + 8).filter(|head| head[4..].iter().any(|&byte| byte != 0));
        let Some((length, kind)) = head.and_then(|head| Some((number(at)? as usize, &head[4..]))) else {
            break;
        };
        let (start, end) = (at + 8, (at + 8).saturating_add(length));
        let chunk = bytes.get(start..end);
        match (kind, chunk) {
            (b"JSON", Some(chunk)) if json.is_none() => json = Some(chunk),
            (b"BIN\0", _) if binary.is_none() => {
                if chunk.is_none() {
                    warn(format!(
                        "its binary chunk states {length} bytes; the file has {}",
                        bytes.len() - start
                    ));
                }
                binary = Some(chunk.unwrap_or(&bytes[start..]));
            }
            (_, Some(_)) => {
                warn(format!("its chunk `{}` of {length} bytes is not used", kind.escape_ascii()));
            }
            (_, None) => break,
        }
        // Some exporters state the chunk length without the padding that aligns the next chunk.
        let is_binary =
            |at: usize| bytes.get(at.saturating_add(4)..at.saturating_add(8)) == Some(&b"BIN\0"[..]);
        let aligned = end.saturating_add(3) & !3;
        at = if is_binary(aligned) { aligned } else { end };
    }
    if at < bytes.len() {
        warn(format!("{} bytes after its last chunk are not used", bytes.len() - at));
    }
    Ok((json.ok_or("its chunk of JSON is missing or cut")?, binary))
}

/// Checks the targets of animation channels, which the validation of gltf-json 1.4.1 leaves out (`Animation::validate`).
/// Channels without a node are ignored (section 5.8, animation.channel.target.node).
fn check_channels(root: &Value, file: &Path) -> Result<()> {
    fn list(value: &Value) -> &[Value] {
        value.as_array().map_or(&[], Vec::as_slice)
    }
    let nodes = list(&root["nodes"]).len() as u64;
    for (index, animation) in list(&root["animations"]).iter().enumerate() {
        for (number, channel) in list(&animation["channels"]).iter().enumerate() {
            let Some(node) = channel.pointer("/target/node").and_then(Value::as_u64) else { continue };
            let path = channel.pointer("/target/path").and_then(Value::as_str).unwrap_or_default();
            let what = if node >= nodes {
                format!("its target is node {node}; there are {nodes}")
            } else if !["translation", "rotation", "scale", "weights"].contains(&path) {
                "its `path` is none of `translation`, `rotation`, `scale` and `weights`".to_owned()
            } else {
                continue;
            };
            return Err(fault(file, format!("animation {index}, channel {number}"), what));
        }
    }
    Ok(())
}

/// The URI of the image of textures that name none.
pub(super) const NO_IMAGE: &str = "data:,";

/// The items of a list, none without it.
pub(super) fn items<'a>(parent: &'a mut Value, key: &str) -> impl Iterator<Item = &'a mut Value> {
    parent.get_mut(key).and_then(Value::as_array_mut).into_iter().flatten()
}

/// Changes in an object and all below it what the `gltf` crate refuses and viewers read: removes `extras`, which may
/// be of any type (section 3.12), and names that are not text; writes numbers without a fraction, such as `1.0`, as
/// integers, as numbers that the format defines as integers must be.
fn tidy(value: &mut Value) {
    // Greater integers may differ as floating-point numbers; -0.0 is no integer.
    const MOST: f64 = (1u64 << 53) as f64;
    match value {
        Value::Array(items) => items.iter_mut().for_each(tidy),
        Value::Object(object) => {
            object.remove("extras");
            if object.get("name").is_some_and(|name| !name.is_string()) {
                object.remove("name");
            }
            object.values_mut().for_each(tidy);
        }
        Value::Number(number) => {
            let float = number.as_f64().filter(|_| number.is_f64());
            if let Some(x) = float.filter(|x| x.is_sign_positive() && *x <= MOST && x.fract() == 0.0) {
                *number = (x as u64).into();
            }
        }
        _ => {}
    }
}

/// Applies [`tidy`] to a document. The `extras` of cameras stay: they may have the keys of a lens.
fn tidy_all(root: &mut Value) {
    for (key, list) in root.as_object_mut().into_iter().flatten() {
        if key != "cameras" {
            tidy(list);
            continue;
        }
        // The crate reads the projections of cameras as well.
        for camera in list.as_array_mut().into_iter().flatten().filter_map(Value::as_object_mut) {
            let lens = camera.remove("extras").filter(Value::is_object);
            camera.values_mut().for_each(tidy);
            camera.extend(lens.map(|lens| ("extras".to_owned(), lens)));
        }
    }
    if let Some(root) = root.as_object_mut() {
        root.remove("extras");
    }
}

/// The keys of lists whose values the format enumerates and that have a default, with the values as JSON.
const ENUMERATED: &[(&str, &str, &[&str])] = &[
    ("samplers", "magFilter", &["9728", "9729"]),
    ("samplers", "minFilter", &["9728", "9729", "9984", "9985", "9986", "9987"]),
    ("samplers", "wrapS", &["33071", "33648", "10497"]),
    ("samplers", "wrapT", &["33071", "33648", "10497"]),
    ("bufferViews", "target", &["34962", "34963"]),
    ("materials", "alphaMode", &["\"OPAQUE\"", "\"MASK\"", "\"BLEND\""]),
];

/// Removes what the `gltf` crate refuses and the format tolerates or every viewer ignores.
fn repair(root: &mut Value, mut warn: impl FnMut(String)) {
    for &(list, key, known) in ENUMERATED {
        let mut unknown = 0;
        for item in items(root, list).filter_map(Value::as_object_mut) {
            if item.get(key).is_some_and(|value| !known.contains(&value.to_string().as_str())) {
                item.remove(key);
                unknown += 1;
            }
        }
        if unknown > 0 {
            warn(format!("`{key}` of {unknown} of its {list} has an invalid value; the default is used"));
        }
    }
    // The format of an image is detected from its bytes.
    for image in items(root, "images").filter_map(Value::as_object_mut) {
        if !image.get("mimeType").is_none_or(Value::is_string) {
            image.remove("mimeType");
        }
        if image.contains_key("bufferView") && !image.contains_key("uri") {
            image.entry("mimeType").or_insert_with(|| Value::from(""));
        }
    }
    for scene in items(root, "scenes").filter_map(Value::as_object_mut) {
        scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
    }
    for view in items(root, "bufferViews").filter_map(Value::as_object_mut) {
        if view.get("byteStride").and_then(Value::as_u64) == Some(0) {
            view.remove("byteStride");
        }
    }
    let strides = items(root, "bufferViews").filter_map(|view| view["byteStride"].as_u64());
    let outside = strides.filter(|stride| !(4..=252).contains(stride)).count();
    if outside > 0 {
        warn(format!(
            "`byteStride` of {outside} of its bufferViews is not from 4 to 252 as glTF has it; used"
        ));
    }
    remove_unknown(root, &mut warn);
    // A channel without a node is to be ignored (section 5.8, animation.channel.target.node).
    for animation in items(root, "animations") {
        if let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) {
            channels.retain(|channel| channel["target"]["node"].is_u64());
        }
    }
    let images = root.get("images").and_then(Value::as_array).map_or(0, Vec::len);
    let mut without_image = false;
    for texture in items(root, "textures").filter_map(Value::as_object_mut) {
        let extensions = texture.get("extensions").unwrap_or(&Value::Null);
        let mut sources = TEXTURE_SOURCES.iter().filter(|name| is_read(name));
        let of_extension = sources.find_map(|name| extensions[*name]["source"].as_u64());
        if let Some(source) = of_extension {
            texture.insert("source".to_owned(), source.into());
        } else if !texture.contains_key("source") {
            texture.insert("source".to_owned(), images.into());
            without_image = true;
        }
    }
    // The `gltf` crate wants an image for each texture.
    if without_image && let Some(root) = root.as_object_mut() {
        let images = root.entry("images").or_insert_with(|| Value::Array(Vec::new()));
        images
            .as_array_mut()
            .into_iter()
            .for_each(|images| images.push(serde_json::json!({ "uri": NO_IMAGE })));
    }
    let mut unknown = std::collections::BTreeSet::new();
    for mesh in items(root, "meshes") {
        for primitive in items(mesh, "primitives") {
            // Those without positions are left out.
            if let Some(primitive) = primitive.as_object_mut().filter(|all| !all.contains_key("attributes")) {
                primitive.insert("attributes".to_owned(), Value::Object(Default::default()));
            }
            if let Some(attributes) = primitive.get_mut("attributes").and_then(Value::as_object_mut) {
                attributes.retain(|name, _| {
                    let keep = is_attribute(name);
                    if !keep && !name.starts_with('_') {
                        unknown.insert(name.clone());
                    }
                    keep
                });
            }
        }
    }
    for name in unknown {
        warn(format!(
            "attribute {name} is not an attribute semantic of glTF; application-specific ones begin with `_`; not used"
        ));
    }
}

/// Removes references of nodes to lights and cameras that cannot be read. These are replaced by others, so that the
/// indices of the rest stay.
fn remove_unknown(root: &mut Value, warn: &mut impl FnMut(String)) {
    const LIGHTS: &str = "/extensions/KHR_lights_punctual";
    const LIGHT_TYPES: [&str; 3] = ["directional", "point", "spot"];
    let is_light = |light: &Value| LIGHT_TYPES.iter().any(|known| light["type"] == **known);
    let is_camera = |camera: &Value| {
        let kind = camera["type"].as_str().filter(|kind| ["perspective", "orthographic"].contains(kind));
        kind.is_some_and(|kind| camera[kind].is_object()) && gltf::json::Camera::deserialize(camera).is_ok()
    };
    let projection = serde_json::json!({ "yfov": 1, "znear": 1 });
    let camera = serde_json::json!({ "type": "perspective", "perspective": projection });
    let mut replace = |name: &str, item: &mut Value, is_known: bool, other: &Value| {
        if !is_known && item.is_object() {
            warn(format!("{name} is of a kind that glTF does not know, or not whole; left out"));
            *item = other.clone();
        }
        !is_known
    };
    let lights = root.pointer_mut(LIGHTS).into_iter().flat_map(|of_root| items(of_root, "lights"));
    let other = serde_json::json!({ "type": "point" });
    let lights: Vec<bool> = lights
        .enumerate()
        .map(|(index, light)| {
            // Its angles have defaults.
            if light["type"] == "spot" && light.get("spot").is_none() {
                light["spot"] = Value::Object(Default::default());
            }
            let is_known = is_light(light);
            replace(&format!("light {index}"), light, is_known, &other)
        })
        .collect();
    let cameras: Vec<bool> = items(root, "cameras")
        .enumerate()
        .map(|(index, item)| {
            let is_known = is_camera(item);
            replace(&format!("camera {index}"), item, is_known, &camera)
        })
        .collect();
    let is_in = |removed: &[bool], index: &Value| {
        let index = index.as_u64().and_then(|index| usize::try_from(index).ok());
        index.and_then(|index| removed.get(index).copied()).unwrap_or_default()
    };
    for node in items(root, "nodes").filter_map(Value::as_object_mut) {
        if node.get("camera").is_some_and(|index| is_in(&cameras, index)) {
            node.remove("camera");
        }
        if let Some(extensions) = node.get_mut("extensions").and_then(Value::as_object_mut)
            && extensions.get("KHR_lights_punctual").is_some_and(|light| is_in(&lights, &light["light"]))
        {
            extensions.remove("KHR_lights_punctual");
        }
    }
}

/// Whether an attribute is one of section 3.7.2.1.
fn is_attribute(name: &str) -> bool {
    let is_numbered = |(kind, number): (&str, &str)| {
        ["TEXCOORD", "COLOR", "JOINTS", "WEIGHTS"].contains(&kind) && number.parse::<u32>().is_ok()
    };
    ["POSITION", "NORMAL", "TANGENT"].contains(&name) || name.rsplit_once('_').is_some_and(is_numbered)
}

/// The validated document. Required extensions that are not read are an error, or a warning where they are to be
/// ignored.
pub(super) fn validated(
    root: &Value,
    file: &Path,
    ignore_required: bool,
    warnings: &mut Warnings,
) -> Result<gltf::Document> {
    let json = contain(|| gltf::json::Root::deserialize(root)).ok_or_else(|| damaged(file))?;
    let mut json = json.map_err(|_| unusable(file, unreadable(root)))?;
    json.extensions_required.retain(|name| !is_read(name));
    if !json.extensions_required.is_empty() {
        let names = json.extensions_required.join(", ");
        let what = format!("requires glTF extensions that kiln does not read: {names}");
        if !ignore_required {
            let hint = if cfg!(feature = "codecs") {
                "export it without them, or try --ignore-required-extensions"
            } else {
                "compressed meshes and textures need a kiln with the feature `codecs`; or export it without them"
            };
            return Err(Error::input(file, what, hint));
        }
        warnings.left_out(format!("{}: {what}; ignored", file.display()));
        json.extensions_required.clear();
    }
    check_positions(&json, file)?;
    let mut faults: Vec<(gltf::json::Path, Fault)> = Vec::new();
    contain(|| {
        json.validate(&json, gltf::json::Path::new, &mut |path, fault| {
            let path = path();
            if !is_tolerated(path.as_str(), &fault) {
                faults.push((path, fault));
            }
        });
    })
    .ok_or_else(|| damaged(file))?;
    match faults.first() {
        Some((path, fault)) => {
            let what = match fault {
                Fault::IndexOutOfBounds => "refers to an item that does not exist",
                Fault::Missing => "is missing",
                Fault::Oversize => "is too large",
                Fault::Invalid | Fault::Unsupported => "has a value that glTF does not know",
            };
            let path = path.as_str().replace("khrLightsPunctual", "KHR_lights_punctual");
            Err(unusable(file, format!("{path} {what}")))
        }
        None => Ok(gltf::Document::from_json_without_validation(json)),
    }
}

/// What of a document the `gltf` crate cannot read: an item of a list and its key.
fn unreadable(root: &Value) -> String {
    use gltf::json;
    /// What is wrong with an object.
    fn reason<T: serde::de::DeserializeOwned>(item: &Value) -> Option<String> {
        let e = T::deserialize(item).err()?.to_string();
        let Some(object) = item.as_object() else { return Some("is no object".to_owned()) };
        if let Some(key) = e.strip_prefix("missing field ") {
            return Some(format!("has no {key}"));
        }
        // Without the key that cannot be read, the object can be, or lacks it.
        let is_culprit = |key: &&String| {
            let mut others = item.clone();
            others.as_object_mut().map(|others| others.remove(*key));
            T::deserialize(&others)
                .map_or_else(|e| e.to_string() == format!("missing field `{key}`"), |_| true)
        };
        let key = object.keys().find(is_culprit);
        Some(key.map_or("cannot be read".to_owned(), |key| {
            format!("has `{}` of another type than glTF gives it", key.escape_default())
        }))
    }
    fn first<T: serde::de::DeserializeOwned>(root: &Value, key: &str) -> Option<String> {
        let items = root[key].as_array().filter(|_| root.get(key).is_some());
        let mut items = items.into_iter().flatten().enumerate();
        items.find_map(|(index, item)| Some(format!("{key}[{index}] {}", reason::<T>(item)?)))
    }
    first::<json::Accessor>(root, "accessors")
        .or_else(|| first::<json::Animation>(root, "animations"))
        .or_else(|| first::<json::Buffer>(root, "buffers"))
        .or_else(|| first::<json::buffer::View>(root, "bufferViews"))
        .or_else(|| first::<json::Image>(root, "images"))
        .or_else(|| first::<json::Material>(root, "materials"))
        .or_else(|| first::<json::Mesh>(root, "meshes"))
        .or_else(|| first::<json::Node>(root, "nodes"))
        .or_else(|| first::<json::texture::Sampler>(root, "samplers"))
        .or_else(|| first::<json::Scene>(root, "scenes"))
        .or_else(|| first::<json::Skin>(root, "skins"))
        .or_else(|| first::<json::Texture>(root, "textures"))
        .or_else(|| Some(format!("asset {}", reason::<json::Asset>(root.get("asset")?)?)))
        .or_else(|| Some(format!("its JSON {}", reason::<json::Root>(root)?)))
        .unwrap_or_else(|| "its JSON cannot be read".to_owned())
}

/// Whether a validation error is ignored: primitives without positions are not drawn, bounds of positions are not used,
/// accessors without a buffer view are zeros, and strides are checked with the data.
fn is_tolerated(path: &str, fault: &Fault) -> bool {
    let of_positions = ["[\"POSITION\"].min", "[\"POSITION\"].max"].iter().any(|end| path.ends_with(end));
    let has_none = *fault == Fault::Missing && path.ends_with("[\"POSITION\"]");
    of_positions
        || has_none
        || (*fault == Fault::Invalid && path.ends_with("].byteStride"))
        || (*fault == Fault::Missing && path.starts_with("accessors[") && path.ends_with("].bufferView"))
}

/// Checks that primitives have positions. The validation of gltf-json 1.4.1 accesses them without a check
/// (`primitive_validate_hook` in its mesh.rs) and panics.
fn check_positions(json: &gltf::json::Root, file: &Path) -> Result<()> {
    use gltf::json::validation::Checked;
    let positions = Checked::Valid(gltf::Semantic::Positions);
    for (mesh_index, mesh) in json.meshes.iter().enumerate() {
        for (index, primitive) in mesh.primitives.iter().enumerate() {
            let accessor = primitive.attributes.get(&positions).map(|accessor| accessor.value());
            if let Some(accessor) = accessor.filter(|&accessor| accessor >= json.accessors.len()) {
                let what = format!("POSITION is accessor {accessor}; there are {}", json.accessors.len());
                return Err(fault(file, format!("mesh {mesh_index}, primitive {index}"), what));
            }
        }
    }
    Ok(())
}

/// What a document says of itself: generator, copyright, and its metadata by KHR_xmp_json_ld.
pub(super) fn metadata(root: &Value) -> Vec<(String, String)> {
    let asset = &root["asset"];
    let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let of_asset = ["generator", "copyright"].into_iter().filter_map(|key| Some((key, asset.get(key)?)));
    let packet = asset["extensions"][XMP]["packet"].as_u64().and_then(|packet| usize::try_from(packet).ok());
    let packet = packet.and_then(|packet| root["extensions"][XMP]["packets"].get(packet)?.as_object());
    // Names that begin with @ are of JSON-LD itself.
    let of_packet = packet.into_iter().flatten().filter(|(key, _)| !key.starts_with('@'));
    of_asset
        .chain(of_packet.map(|(key, value)| (key.as_str(), value)))
        .map(|(key, value)| (key.to_owned(), text(value)))
        .collect()
}

impl Loader<'_> {
    /// Warns of extensions that are used and not read.
    pub(super) fn warn_of_unread(&mut self, document: &gltf::Document) {
        for name in document.extensions_used().filter(|name| !is_read(name)) {
            self.left_out(format!("extension {name} is not used"));
        }
        let coats = document.materials().filter(layers::has_coat_normals).count();
        if coats > 0 {
            self.left_out(format!("{coats} material(s) have a normal map of their clear coat; not used"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metadata_of_the_asset_and_its_packet() {
        let packet =
            serde_json::json!({ "@context": {}, "dc:title": "Shoe", "dc:creator": { "@list": ["A"] } });
        let root = serde_json::json!({
            "asset": { "version": "2.0", "generator": "me", "extensions": { XMP: { "packet": 1 } } },
            "extensions": { XMP: { "packets": [{}, packet] } },
        });
        let found = metadata(&root);
        let found: Vec<(&str, &str)> =
            found.iter().map(|(key, value)| (key.as_str(), value.as_str())).collect();
        let creator = r#"{"@list":["A"]}"#;
        assert_eq!(found, [("generator", "me"), ("dc:creator", creator), ("dc:title", "Shoe")]);
    }

    #[test]
    fn attributes_of_the_format() {
        for name in ["POSITION", "TEXCOORD_0", "COLOR_12", "JOINTS_1"] {
            assert!(is_attribute(name), "{name}");
        }
        for name in ["BARYCENTRIC", "TEXCOORD", "TEXCOORD_x", "_ID", "POSITION_0", ""] {
            assert!(!is_attribute(name), "{name}");
        }
    }
}
