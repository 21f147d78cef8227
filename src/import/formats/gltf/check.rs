//! Validation of glTF documents before their data is read.

use std::collections::HashSet;
use std::path::Path;

use glam::DMat4;
use gltf::Semantic;
use gltf::accessor::{DataType, Dimensions};

use serde_json::Value;

use crate::error::{Error, Place, Result, Warnings};
use crate::files;
use crate::import::Source;
use crate::import::files::uri::{self, Resource};
use crate::import::formats::gltf::animation::Pose;
use crate::import::formats::gltf::document::{QUANTIZATION, VISIBILITY};
use crate::import::formats::gltf::instancing;
use crate::limits;

/// The error for an item of a file.
pub(super) fn fault(file: &Path, item: impl Into<String>, what: impl Into<String>) -> Error {
    Error::input(Place::item(file, item.into()), what, "export the file again")
}

/// Checks the memory limit for meshes, placements and keyframes. Primitives may share accessors, and accessors without a buffer
/// view take no bytes in the file, so the file size does not bound memory.
pub(super) fn check_memory(document: &gltf::Document, file: &Path, most: &limits::Limits) -> Result<()> {
    limits::Counted::Nodes.check(document.nodes().len() as u64, most, file)?;
    // Bytes per vertex: positions, normals and colours are three f64, texture coordinates two, tangents four; joints
    // are 8 bytes, weights 16, and skinning matrices 128. An index is read as u32 and stored in a triangle.
    let bytes_of = |semantic: &Semantic| match semantic {
        Semantic::Joints(_) => 8 + 128,
        Semantic::Weights(_) => 16,
        _ => 32,
    };
    // A placement is three vectors and a matrix while it is read, then an object with its name per primitive.
    const PLACE: u64 = 3 * 32 + 128;
    let object = size_of::<crate::scene::Object>() as u64 + 32;
    let of_primitive = |primitive: &gltf::Primitive| {
        // A strip of n indices is n - 2 triangles.
        let order = primitive.indices().or_else(|| primitive.get(&Semantic::Positions));
        let order = order.map(|accessor| (accessor, 4 + 12));
        let attributes = primitive.attributes().map(|(semantic, accessor)| (accessor, bytes_of(&semantic)));
        attributes
            .chain(order)
            .map(|(accessor, each)| {
                (limits::product(&[accessor.count() as u64, each]), accessor.view().is_none())
            })
            .fold([0u64; 2], add)
    };
    // Bytes of a node: place, pose, and a named object or a light.
    const NODE: u64 = 3 * PLACE + 256;
    let nodes = limits::product(&[document.nodes().len() as u64, NODE + object]);
    let mut sums = [nodes, 0];
    // A mesh is read once for all nodes, and once for each node with a skin or morph targets.
    let mut times = vec![0u64; document.meshes().len()];
    for node in document.nodes() {
        let Some(mesh) = node.mesh() else { continue };
        let time = &mut times[mesh.index()];
        let is_own =
            node.skin().is_some() || mesh.primitives().any(|primitive| primitive.morph_targets().len() > 0);
        *time = if is_own { *time + 1 } else { (*time).max(1) };
        if let Some(accessor) = instancing::accessors(&node, document).next() {
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
    checked.map_err(|excess| excess.at(file, "reading its meshes"))
}

/// Adds bytes to those present in the file, or to those only declared.
fn add([there, claimed]: [u64; 2], (bytes, is_claimed): (u64, bool)) -> [u64; 2] {
    if is_claimed { [there, claimed.saturating_add(bytes)] } else { [there.saturating_add(bytes), claimed] }
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
            let what = "its elements do not lie inside its buffer view";
            return Err(fault(file, format!("accessor {}", accessor.index()), what));
        }
    }
    for mesh in document.meshes() {
        for primitive in mesh.primitives() {
            let wrong = |what: String| {
                fault(file, format!("mesh {}, primitive {}", mesh.index(), primitive.index()), what)
            };
            if primitive.indices().is_some_and(|indices| !is_index(&indices)) {
                return Err(wrong("its indices are not unsigned integers".into()));
            }
            if let Some(positions) = primitive.get(&Semantic::Positions)
                && !is_allowed(&Semantic::Positions, &positions)
            {
                return Err(wrong(format!("its positions are of type {}", type_of(&positions))));
            }
        }
    }
    Ok(())
}

/// Warns of attributes of types that the format does not give them: those that cannot be read, and integers without the
/// extension that allows them.
pub(super) fn warn_of_types(document: &gltf::Document, file: &Path, warnings: &mut Warnings) {
    let is_quantized = document.extensions_used().any(|name| name == QUANTIZATION);
    for mesh in document.meshes() {
        for primitive in mesh.primitives() {
            for (semantic, accessor) in primitive.attributes() {
                let place =
                    format!("{}: mesh {}, primitive {}", file.display(), mesh.index(), primitive.index());
                let what =
                    format!("{place}: {} of type {} is not glTF", semantic.to_string(), type_of(&accessor));
                if !is_allowed(&semantic, &accessor) {
                    warnings.left_out(format!("{what}; not used"));
                } else if !is_quantized && !is_core(&semantic, &accessor) {
                    warnings.push(format!("{what} without {QUANTIZATION}"));
                }
            }
        }
    }
}

/// The type of an accessor, such as `F32 Vec3`.
fn type_of(accessor: &gltf::Accessor) -> String {
    format!("{:?} {:?}", accessor.data_type(), accessor.dimensions())
}

fn is_index(accessor: &gltf::Accessor) -> bool {
    matches!(accessor.data_type(), DataType::U8 | DataType::U16 | DataType::U32)
        && accessor.dimensions() == Dimensions::Scalar
}

/// Whether the type of an attribute is one that glTF 2.0 (section 3.7.2.1) allows for its semantic.
fn is_core(semantic: &Semantic, accessor: &gltf::Accessor) -> bool {
    let float_or_unsigned = matches!(accessor.data_type(), DataType::F32 | DataType::U8 | DataType::U16);
    match semantic {
        Semantic::Positions | Semantic::Normals | Semantic::Tangents => accessor.data_type() == DataType::F32,
        Semantic::TexCoords(_) => float_or_unsigned,
        _ => true,
    }
}

/// Whether the type of an attribute is one that glTF 2.0 or KHR_mesh_quantization allows for its semantic.
pub(super) fn is_allowed(semantic: &Semantic, accessor: &gltf::Accessor) -> bool {
    let (kind, shape) = (accessor.data_type(), accessor.dimensions());
    let float_or_unsigned = matches!(kind, DataType::F32 | DataType::U8 | DataType::U16);
    match semantic {
        Semantic::Positions | Semantic::Normals => kind != DataType::U32 && shape == Dimensions::Vec3,
        Semantic::Tangents => kind != DataType::U32 && shape == Dimensions::Vec4,
        Semantic::TexCoords(_) => kind != DataType::U32 && shape == Dimensions::Vec2,
        Semantic::Colors(_) => float_or_unsigned && matches!(shape, Dimensions::Vec3 | Dimensions::Vec4),
        Semantic::Joints(_) => matches!(kind, DataType::U8 | DataType::U16) && shape == Dimensions::Vec4,
        Semantic::Weights(_) => float_or_unsigned && shape == Dimensions::Vec4,
        #[allow(unreachable_patterns)]
        _ => true,
    }
}

/// Checks that each image has a URI or a buffer view, as the `gltf` crate assumes.
pub(super) fn check_images(document: &gltf::Document, file: &Path) -> Result<()> {
    for (index, image) in document.as_json().images.iter().enumerate() {
        if image.uri.is_none() && image.buffer_view.is_none() {
            return Err(fault(file, format!("image {index}"), "has neither `uri` nor `bufferView`"));
        }
    }
    Ok(())
}

/// The buffers of a document, or why they cannot be loaded.
pub(super) fn load_buffers(
    document: &gltf::Document,
    root: &Value,
    mut blob: Option<Vec<u8>>,
    source: &Source,
) -> Vec<Result<Vec<u8>>> {
    let mut load = |buffer: &gltf::Buffer| {
        let item = format!("buffer {}", buffer.index());
        let fault = |what: String| fault(&source.file, item.clone(), what);
        let data = match buffer.source() {
            gltf::buffer::Source::Bin if is_fallback(&root["buffers"][buffer.index()]) => {
                zeros(buffer, &source.file)?
            }
            gltf::buffer::Source::Bin => {
                blob.take().ok_or_else(|| fault("the binary part of the file is missing".into()))?
            }
            gltf::buffer::Source::Uri(text) => match uri::resolve(text, source).map_err(&fault)? {
                Resource::Data(data) => data,
                Resource::File(path) => source.files.read(&path).map_err(|e| {
                    let (what, hint) = files::explain(&e);
                    let item = Place::item(&source.file, item.clone());
                    Error::input(item, format!("{}: {what}", path.display()), hint)
                })?,
            },
        };
        if data.len() < buffer.length() {
            return Err(fault(format!("has {} bytes; byteLength is {}", data.len(), buffer.length())));
        }
        Ok(data)
    };
    let load = |buffer: gltf::Buffer| {
        load(&buffer).or_else(|e| {
            if is_decoded_into(root, buffer.index()) { zeros(&buffer, &source.file) } else { Err(e) }
        })
    };
    document.buffers().map(load).collect()
}

/// Zeros for a buffer that only receives decoded views.
fn zeros(buffer: &gltf::Buffer, file: &Path) -> Result<Vec<u8>> {
    let length = buffer.length();
    let checked = limits::check_claim(length as u64);
    checked.map_err(|excess| excess.at(file, format!("buffer {}", buffer.index())))?;
    Ok(vec![0; length])
}

/// Whether all views of a buffer are compressed, so that nothing is read from it.
fn is_decoded_into(root: &Value, buffer: usize) -> bool {
    let views = root["bufferViews"].as_array().into_iter().flatten();
    let mut views = views.filter(|view| view["buffer"] == buffer).peekable();
    views.peek().is_some() && views.all(is_compressed)
}

#[cfg(feature = "codecs")]
fn is_compressed(view: &Value) -> bool {
    crate::import::formats::gltf::meshopt::extension(view).is_some()
}

#[cfg(not(feature = "codecs"))]
fn is_compressed(_: &Value) -> bool {
    false
}

/// Whether a buffer holds nothing but what compressed views are decoded to (EXT_meshopt_compression).
fn is_fallback(buffer: &Value) -> bool {
    let extensions = buffer["extensions"].as_object().into_iter().flatten();
    extensions.into_iter().any(|(_, extension)| extension["fallback"] == true)
}

/// Where a node is.
pub(super) struct NodePlace {
    pub(super) world_from_node: DMat4,
    /// Whether it and all above it are visible (KHR_node_visibility).
    pub(super) is_visible: bool,
}

/// The place of each node, or `None` for nodes that are not in the scene.
///
/// Every node is visited once: walking all paths would not end in a cycle, and takes 2^n steps if n successive nodes
/// are each referenced twice.
pub(super) fn node_places(
    document: &gltf::Document,
    pose: &Pose,
    file: &Path,
    warnings: &mut Warnings,
) -> Result<Vec<Option<NodePlace>>> {
    let mut places: Vec<Option<NodePlace>> = document.nodes().map(|_| None).collect();
    let mut is_open = vec![false; places.len()];
    let roots: Vec<gltf::Node> = match document.default_scene().or_else(|| document.scenes().next()) {
        Some(scene) => scene.nodes().collect(),
        None => {
            let children: HashSet<usize> =
                document.nodes().flat_map(|node| node.children().map(|child| child.index())).collect();
            document.nodes().filter(|node| !children.contains(&node.index())).collect()
        }
    };
    // What a node inherits; none at the end of its descendants.
    let mut open: Vec<(gltf::Node, Option<(DMat4, bool)>)> =
        roots.into_iter().rev().map(|node| (node, Some((DMat4::IDENTITY, true)))).collect();
    while let Some((node, inherited)) = open.pop() {
        let index = node.index();
        let Some((world_from_parent, is_parent_visible)) = inherited else {
            is_open[index] = false;
            continue;
        };
        if places[index].is_some() {
            if is_open[index] {
                let item = Place::item(file, format!("node {index}"));
                return Err(Error::input(item, "the node is its own ancestor", "correct the hierarchy"));
            }
            let file = file.display();
            warnings.push(format!("{file}: node {index} is in the scene more than once; drawn once"));
            continue;
        }
        let world_from_node = world_from_parent * pose.parent_from_node(&node);
        let own = node.extension_value(VISIBILITY).and_then(|value| value.get("visible")?.as_bool());
        let is_visible = is_parent_visible && own.unwrap_or(true);
        places[index] = Some(NodePlace { world_from_node, is_visible });
        is_open[index] = true;
        open.push((node.clone(), None));
        open.extend(node.children().map(|child| (child, Some((world_from_node, is_visible)))));
    }
    Ok(places)
}
