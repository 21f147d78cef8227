//! Validation of glTF documents before their data is read.

use std::collections::HashSet;
use std::path::Path;

use glam::DMat4;
use gltf::accessor::{DataType, Dimensions};

use super::animation::Pose;
use super::{instancing, layers};
use crate::error::{Error, Place, Result, Warnings, contain};
use crate::import::Source;
use crate::import::uri::{self, Resource};
use crate::limits;

/// Parses a document, which may require EXT_mesh_gpu_instancing although the `gltf` crate does not support it. A panic
/// of that crate is reported as an error of the file.
pub(super) fn open(bytes: &[u8], file: &Path) -> Result<gltf::Gltf> {
    let failed = || Error::input(file, "not a usable glTF file", "export it again as glTF 2.0");
    let without_pointers = contain(|| without_pointers(bytes)).flatten();
    let bytes = without_pointers.as_deref().unwrap_or(bytes);
    let read = || gltf::Gltf::from_slice_without_validation(bytes);
    let gltf::Gltf { document, blob } = contain(read).ok_or_else(failed)?.map_err(|e| explain(file, e))?;
    let mut json = document.into_json();
    json.extensions_required.retain(|name| name != instancing::NAME && !layers::ALL.contains(&name.as_str()));
    check_positions(&json, file)?;
    let document = contain(|| gltf::Document::from_json(json)).ok_or_else(failed)?;
    Ok(gltf::Gltf { document: document.map_err(|e| explain(file, e))?, blob })
}

/// The extension whose channels name a property instead of a node.
const ANIMATION_POINTER: &str = "KHR_animation_pointer";

/// The document without the channels of KHR_animation_pointer, which the `gltf` crate refuses because they name no node;
/// `None` where there are none, or the document cannot be read.
fn without_pointers(bytes: &[u8]) -> Option<Vec<u8>> {
    bytes
        .windows(ANIMATION_POINTER.len())
        .any(|window| window == ANIMATION_POINTER.as_bytes())
        .then_some(())?;
    let glb =
        if bytes.starts_with(b"glTF") { Some(gltf::binary::Glb::from_slice(bytes).ok()?) } else { None };
    let json = glb.as_ref().map_or(bytes, |glb| &glb.json);
    let mut root: serde_json::Value = serde_json::from_slice(json).ok()?;
    let animations = root.get_mut("animations").and_then(|list| list.as_array_mut());
    for animation in animations.into_iter().flatten() {
        if let Some(channels) = animation.get_mut("channels").and_then(|list| list.as_array_mut()) {
            channels.retain(|channel| channel["target"]["node"].is_u64());
        }
    }
    if let Some(required) = root.get_mut("extensionsRequired").and_then(|list| list.as_array_mut()) {
        required.retain(|name| name != ANIMATION_POINTER);
    }
    let json = serde_json::to_vec(&root).ok()?;
    match glb {
        Some(glb) => gltf::binary::Glb { json: json.into(), ..glb }.to_vec().ok(),
        None => Some(json),
    }
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
                let item = Place::item(file, format!("mesh {mesh_index}, primitive {index}"));
                let what = format!("POSITION is accessor {accessor}; there are {}", json.accessors.len());
                return Err(Error::input(item, what, "export the file again"));
            }
        }
    }
    Ok(())
}

/// Checks the memory limit for meshes, placements and keyframes. Primitives may share accessors, and accessors without a buffer
/// view take no bytes in the file, so the file size does not bound memory.
pub(super) fn check_memory(document: &gltf::Document, file: &Path) -> Result<()> {
    // Bytes per vertex: positions, normals and colours are three f64, texture coordinates two, tangents four; joints
    // are 8 bytes, weights 16, and skinning matrices 128. An index is read as u32 and stored in a triangle.
    let bytes_of = |semantic: &gltf::Semantic| match semantic {
        gltf::Semantic::Joints(_) => 8 + 128,
        gltf::Semantic::Weights(_) => 16,
        _ => 32,
    };
    // A placement is three vectors and a matrix while it is read, then an object with its name per primitive.
    const PLACE: u64 = 3 * 32 + 128;
    let object = size_of::<crate::scene::Object>() as u64 + 32;
    let of_primitive = |primitive: &gltf::Primitive| {
        // A strip of n indices is n - 2 triangles.
        let order = primitive.indices().or_else(|| primitive.get(&gltf::Semantic::Positions));
        let order = order.map(|accessor| (accessor, 4 + 12));
        let attributes = primitive.attributes().map(|(semantic, accessor)| (accessor, bytes_of(&semantic)));
        attributes
            .chain(order)
            .map(|(accessor, each)| {
                (limits::product(&[accessor.count() as u64, each]), accessor.view().is_none())
            })
            .fold([0u64; 2], add)
    };
    let mut sums = [0u64; 2];
    // A mesh is read once for all nodes, and once for each node with a skin or morph targets.
    let mut times = vec![0u64; document.meshes().len()];
    for node in document.nodes() {
        let Some(mesh) = node.mesh() else { continue };
        let time = &mut times[mesh.index()];
        let is_own =
            node.skin().is_some() || mesh.primitives().any(|primitive| primitive.morph_targets().len() > 0);
        *time = if is_own { *time + 1 } else { (*time).max(1) };
        if let Some(accessor) = instancing::first_accessor(&node, document) {
            let each = PLACE + object * mesh.primitives().len() as u64;
            let bytes = limits::product(&[accessor.count() as u64, each]);
            sums = add(sums, (bytes, accessor.view().is_none()));
        }
    }
    for (mesh, times) in document.meshes().zip(times) {
        for primitive in mesh.primitives() {
            let [there, claimed] = of_primitive(&primitive).map(|bytes| limits::product(&[bytes, times]));
            sums = add(add(sums, (there, false)), (claimed, true));
        }
    }
    // A keyframe is read as f64.
    for sampler in document.animations().flat_map(|animation| animation.samplers().collect::<Vec<_>>()) {
        for accessor in [sampler.input(), sampler.output()] {
            let numbers = accessor.dimensions().multiplicity() as u64;
            let bytes = limits::product(&[accessor.count() as u64, numbers, 8]);
            sums = add(sums, (bytes, accessor.view().is_none()));
        }
    }
    let [there, claimed] = sums;
    let checked = limits::check_claim(claimed).and_then(|()| limits::check(there.saturating_add(claimed)));
    checked.map_err(|excess| Error::input(file, format!("reading its meshes {excess}"), excess.hint()))
}

/// Adds bytes to those present in the file, or to those only declared.
fn add([there, claimed]: [u64; 2], (bytes, is_claimed): (u64, bool)) -> [u64; 2] {
    if is_claimed { [there, claimed.saturating_add(bytes)] } else { [there.saturating_add(bytes), claimed] }
}

fn explain(file: &Path, e: gltf::Error) -> Error {
    let text = e.to_string();
    let gltf::Error::Validation(faults) = e else {
        return Error::input(file, format!("not a usable glTF file: {text}"), "export it again as glTF 2.0");
    };
    let unread: Vec<String> = faults
        .iter()
        .filter(|(_, fault)| *fault == gltf::json::validation::Error::Unsupported)
        .filter_map(|(path, _)| {
            // The path has the form `extensionsRequired[0] = "NAME"`.
            let name = path.as_str().strip_prefix("extensionsRequired")?.split('"').nth(1)?;
            Some(name.to_owned())
        })
        .collect();
    if !unread.is_empty() {
        let what = format!("requires glTF extensions that kiln does not read: {}", unread.join(", "));
        let hint = "export it without compression or quantisation (for example with `gltf-transform copy` or \
                    `gltfpack -noq`)";
        return Error::input(file, what, hint);
    }
    let (path, fault) = &faults[0];
    let what = format!("not a usable glTF file: {path}: {fault}");
    Error::input(file, what, "export it again as glTF 2.0")
}

/// Checks accessors, which the `gltf` crate does not: missing views or sums beyond 64 bits make it panic or wrap
/// around, and strides shorter than an element or types that the format forbids make it read invalid data.
pub(super) fn check_accessors(document: &gltf::Document, file: &Path) -> Result<()> {
    let fits = |view: Option<gltf::buffer::View>, offset: usize, count: usize, size: usize| {
        let Some(view) = view else { return count > 0 };
        let stride = view.stride().unwrap_or(size);
        let steps = count.checked_sub(1).and_then(|steps| stride.checked_mul(steps));
        let end = steps.and_then(|bytes| bytes.checked_add(offset)?.checked_add(size));
        let inside = end.is_some_and(|end| end <= view.length());
        inside && stride >= size && view.offset().checked_add(view.length()).is_some()
    };
    for accessor in document.accessors() {
        let (count, size) = (accessor.count(), accessor.size());
        let mut usable = fits(accessor.view(), accessor.offset(), count, size);
        if let Some(sparse) = accessor.sparse() {
            let (indices, values) = (sparse.indices(), sparse.values());
            let index_size = indices.index_type().size();
            usable &= fits(Some(indices.view()), indices.offset(), sparse.count(), index_size);
            usable &= fits(Some(values.view()), values.offset(), sparse.count(), size);
        }
        if !usable {
            let item = Place::item(file, format!("accessor {}", accessor.index()));
            let what = "its elements do not lie inside its buffer view";
            return Err(Error::input(item, what, "export the file again"));
        }
    }
    for mesh in document.meshes() {
        for primitive in mesh.primitives() {
            let wrong = |what: String| {
                let item = format!("mesh {}, primitive {}", mesh.index(), primitive.index());
                Error::input(Place::item(file, item), what, "export the file again")
            };
            if primitive.indices().is_some_and(|indices| !is_index(&indices)) {
                return Err(wrong("its indices are not unsigned integers".into()));
            }
            for (semantic, accessor) in primitive.attributes() {
                if !is_allowed(&semantic, &accessor) {
                    let (kind, shape) = (accessor.data_type(), accessor.dimensions());
                    let name = semantic.to_string();
                    return Err(wrong(format!("{name} of type {kind:?} {shape:?} is not glTF")));
                }
            }
        }
    }
    Ok(())
}

fn is_index(accessor: &gltf::Accessor) -> bool {
    matches!(accessor.data_type(), DataType::U8 | DataType::U16 | DataType::U32)
        && accessor.dimensions() == Dimensions::Scalar
}

/// Whether the type of an attribute is one that glTF 2.0 (section 3.7.2.1) allows for its semantic.
fn is_allowed(semantic: &gltf::Semantic, accessor: &gltf::Accessor) -> bool {
    use gltf::Semantic;
    let (kind, shape) = (accessor.data_type(), accessor.dimensions());
    let float_or_unsigned = matches!(kind, DataType::F32 | DataType::U8 | DataType::U16);
    match semantic {
        Semantic::Positions | Semantic::Normals => kind == DataType::F32 && shape == Dimensions::Vec3,
        Semantic::Tangents => kind == DataType::F32 && shape == Dimensions::Vec4,
        Semantic::TexCoords(_) => float_or_unsigned && shape == Dimensions::Vec2,
        Semantic::Colors(_) => float_or_unsigned && matches!(shape, Dimensions::Vec3 | Dimensions::Vec4),
        Semantic::Joints(_) => matches!(kind, DataType::U8 | DataType::U16) && shape == Dimensions::Vec4,
        Semantic::Weights(_) => float_or_unsigned && shape == Dimensions::Vec4,
        #[allow(unreachable_patterns)]
        _ => true,
    }
}

/// Checks that each image has a URI, or a buffer view and a MIME type, as the `gltf` crate assumes.
pub(super) fn check_images(document: &gltf::Document, file: &Path) -> Result<()> {
    for (index, image) in document.as_json().images.iter().enumerate() {
        let fault = match (&image.uri, &image.buffer_view, &image.mime_type) {
            (Some(_), ..) | (None, Some(_), Some(_)) => continue,
            (None, Some(_), None) => "a picture in a buffer without its type",
            (None, None, _) => "a picture that is nowhere",
        };
        let item = Place::item(file, format!("image {index}"));
        return Err(Error::input(item, fault, "export the file again"));
    }
    Ok(())
}

pub(super) fn load_buffers(
    document: &gltf::Document,
    mut blob: Option<Vec<u8>>,
    source: &Source,
) -> Result<Vec<Vec<u8>>> {
    let load = |buffer: gltf::Buffer| {
        let item = format!("buffer {}", buffer.index());
        let fault = |what: String| {
            Error::input(Place::item(&source.file, item.clone()), what, "export the file again")
        };
        let data = match buffer.source() {
            gltf::buffer::Source::Bin => {
                blob.take().ok_or_else(|| fault("the binary part of the file is missing".into()))?
            }
            gltf::buffer::Source::Uri(text) => match uri::resolve(text).map_err(&fault)? {
                Resource::Data(data) => data,
                Resource::File(name) => {
                    let path = source.sibling(name);
                    source.files.read(&path).map_err(|e| {
                        let (what, hint) = limits::explain(&e);
                        let item = Place::item(&source.file, item.clone());
                        Error::input(item, format!("{}: {what}", path.display()), hint)
                    })?
                }
            },
        };
        if data.len() < buffer.length() {
            return Err(fault(format!("{} of {} bytes are there", data.len(), buffer.length())));
        }
        Ok(data)
    };
    document.buffers().map(load).collect()
}

/// World transform of each node, or `None` for nodes that are not in the scene.
///
/// Every node is visited once: walking all paths would not end in a cycle, and takes 2^n steps if n successive nodes
/// are each referenced twice.
pub(super) fn world_transforms(
    document: &gltf::Document,
    pose: &Pose,
    file: &Path,
    warnings: &mut Warnings,
) -> Result<Vec<Option<DMat4>>> {
    let mut world_from_node = vec![None; document.nodes().count()];
    let mut parent_of: Vec<Option<usize>> = vec![None; world_from_node.len()];
    let roots: Vec<gltf::Node> = match document.default_scene().or_else(|| document.scenes().next()) {
        Some(scene) => scene.nodes().collect(),
        None => {
            let children: HashSet<usize> =
                document.nodes().flat_map(|node| node.children().map(|child| child.index())).collect();
            document.nodes().filter(|node| !children.contains(&node.index())).collect()
        }
    };
    let mut open: Vec<(gltf::Node, DMat4, Option<usize>)> =
        roots.into_iter().rev().map(|node| (node, DMat4::IDENTITY, None)).collect();
    while let Some((node, world_from_parent, parent)) = open.pop() {
        let index = node.index();
        if world_from_node[index].is_some() {
            if std::iter::successors(parent, |&above| parent_of[above]).any(|above| above == index) {
                let item = Place::item(file, format!("node {index}"));
                return Err(Error::input(item, "the nodes contain themselves", "correct the hierarchy"));
            }
            let file = file.display();
            warnings.push(format!("{file}: node {index} is in the scene more than once; drawn once"));
            continue;
        }
        let transform = world_from_parent * pose.parent_from_node(&node);
        world_from_node[index] = Some(transform);
        parent_of[index] = parent;
        open.extend(node.children().map(|child| (child, transform, Some(index))));
    }
    Ok(world_from_node)
}
