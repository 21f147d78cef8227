//! glTF 2.0 importer, .gltf and .glb, on the `gltf` crate.
//!
//! Buffers and images are opened here, because `gltf::import` rejects the whole file for one missing image. The node
//! hierarchy is flattened into world space, at rest or posed by a clip at a time, with skins and morph targets. This file
//! walks the document; `document` parses and validates its JSON, `check` what refers to buffers, `animation` poses nodes,
//! `triangles` reads meshes, `look` materials, cameras and lights.

mod accessor;
mod animation;
mod check;
mod document;
#[cfg(feature = "codecs")]
mod draco;
mod instancing;
mod layers;
mod look;
#[cfg(feature = "codecs")]
mod meshopt;
mod pointer;
mod specular_glossiness;
mod texture;
mod triangles;
mod variants;

use std::collections::HashMap;

use glam::{DMat4, DVec3};
use serde_json::Value;

use crate::error::{Result, Warnings};
use crate::import::Source;
use crate::scene::{ImageId, Material, MaterialId, MetallicRoughness, Object, Scene, Shape};
use animation::Pose;
use check::{
    NodePlace, check_accessors, check_images, check_memory, load_buffers, node_places, warn_of_types,
};
use document::{Json, parse, validated};
use instancing::SharedMeshes;
use layers::AlphaUse;
use look::place_targets;
use triangles::deform;

/// Reads a .gltf or .glb file.
pub(crate) fn read(source: &Source, warnings: &mut Warnings) -> Result<Scene> {
    let (file, options) = (&source.file, &source.options);
    let Json { mut root, blob, pointers } = parse(&source.bytes, file, warnings)?;
    let variants = variants::names(&root);
    let variant = options.variant.as_ref().and_then(|asked| variants.iter().position(|name| name == asked));
    if let Some(variant) = variant {
        variants::choose(&mut root, variant);
    }
    let ignore_required = options.ignore_required_extensions;
    let document = validated(&root, file, ignore_required, warnings)?;
    check_accessors(&document, file)?;
    warn_of_types(&document, file, warnings);
    check_images(&document, &source.file)?;
    check_memory(&document, &source.file, &options.limits)?;
    let buffers = load_buffers(&document, &root, blob, source);
    #[cfg(feature = "codecs")]
    let buffers = meshopt::decode_views(&root, buffers, file)?;
    let mut loader = Loader {
        source,
        document: &document,
        root: &Value::Null,
        buffers,
        decoded: HashMap::new(),
        images: Vec::new(),
        scene: Scene::default(),
        warnings,
        plain: None,
        embedded: HashMap::new(),
        alphas: HashMap::new(),
        shared: SharedMeshes::default(),
    };
    loader.warn_of_unread(&document);
    #[cfg(feature = "codecs")]
    loader.decode_draco()?;
    loader.scene.clips = loader.clips(&pointers);
    loader.scene.variants = variants;
    loader.scene.metadata = document::metadata(&root);
    let posing = loader.posing_clips(&pointers);
    let mut are_set = false;
    for &(clip, time) in &posing {
        let Some(animation) = document.animations().nth(clip) else { continue };
        are_set |= loader.set_pointers(&mut root, &animation, &pointers, time);
    }
    let posed = are_set.then(|| validated(&root, file, ignore_required, &mut Warnings::default()));
    match &posed {
        Some(Ok(posed)) => loader.document = posed,
        Some(Err(e)) => loader.left_out(format!("properties that clips animate are at rest: {e}")),
        None => {}
    }
    loader.root = &root;
    loader.check_drawn()?;
    loader.images = loader.load_images()?;
    for material in loader.document.materials() {
        let material = loader.material(&material)?;
        loader.scene.add_material(material);
    }
    let pose = loader.pose_of_nodes(&posing);
    let nodes = node_places(loader.document, &pose, file, loader.warnings)?;
    let mut placed = Vec::new();
    for node in loader.document.nodes() {
        let Some(NodePlace { world_from_node, is_visible }) = &nodes[node.index()] else { continue };
        // Visibility does not affect cameras (KHR_node_visibility).
        if let Some(camera) = node.camera() {
            loader.camera(&camera, name_of(&node), world_from_node);
        }
        if *is_visible {
            let places = loader.places_of(&node, world_from_node)?;
            if let Some(mesh) = node.mesh() {
                loader.shared.count(&mesh, places.len());
            }
            placed.push((node, world_from_node, places));
        }
    }
    for (node, transform, places) in placed {
        loader.node(&node, transform, &places, &nodes, &pose)?;
    }
    for e in loader.buffers.iter().filter_map(|buffer| buffer.as_ref().err()) {
        loader.warnings.left_out_file(format!("{e}; what it holds is not used"));
    }
    let mut scene = loader.scene;
    place_targets(&mut scene);
    Ok(scene)
}

struct Loader<'a> {
    source: &'a Source,
    document: &'a gltf::Document,
    /// The JSON of the document.
    root: &'a Value,
    /// The buffers, or why they cannot be loaded, which is an error where they are drawn from.
    buffers: Vec<Result<Vec<u8>>>,
    /// The components of accessors that are stored compressed, by the index of the accessor.
    decoded: HashMap<usize, Vec<f64>>,
    images: Vec<Option<ImageId>>,
    scene: Scene,
    warnings: &'a mut Warnings,
    plain: Option<MaterialId>,
    /// Embedded images by a hash of their bytes; `None` for unreadable ones.
    embedded: HashMap<blake3::Hash, Option<ImageId>>,
    /// Alpha channels of textures, by image and use.
    alphas: HashMap<(ImageId, AlphaUse), Option<ImageId>>,
    shared: SharedMeshes,
}

impl Loader<'_> {
    /// Warns of content that is not drawn or not used.
    fn left_out(&mut self, what: impl std::fmt::Display) {
        self.warnings.left_out(format!("{}: {what}", self.source.file.display()));
    }

    fn node(
        &mut self,
        node: &gltf::Node,
        world_from_node: &DMat4,
        places: &[DMat4],
        nodes: &[Option<NodePlace>],
        pose: &Pose,
    ) -> Result<()> {
        let name = name_of(node);
        if let Some(light) = node.light() {
            self.light(&light, name.clone(), world_from_node);
        }
        let Some(mesh) = node.mesh() else { return Ok(()) };
        // In order of placements, with all primitives of each, as if every placement were a node.
        let mut shapes: Vec<(usize, MaterialId, Shape)> = Vec::new();
        let weights = pose.weights(node);
        for primitive in mesh.primitives() {
            let pose = node.skin().and_then(|skin| self.pose(&skin, &primitive, nodes));
            let placed = match pose {
                Some(matrices) => {
                    let posed = self.primitive(&primitive, &name, &weights)?.map(|mut triangles| {
                        // Compressed meshes may have more vertices than their accessors say.
                        if triangles.positions.len() <= matrices.len() {
                            deform(&mut triangles, &matrices);
                        }
                        Shape::Mesh(triangles)
                    });
                    posed.into_iter().collect()
                }
                None => self.placed(&mesh, &primitive, &name, &weights, places)?,
            };
            if placed.is_empty() {
                continue;
            }
            let material = match primitive.material().index() {
                Some(index) => MaterialId(index as u32),
                None => self.plain_material(),
            };
            shapes.extend(placed.into_iter().enumerate().map(|(place, shape)| (place, material, shape)));
        }
        shapes.sort_by_key(|(place, ..)| *place);
        self.scene.objects.extend(shapes.into_iter().map(|(_, material, shape)| Object {
            name: name.clone(),
            input: 0,
            material,
            shape,
        }));
        Ok(())
    }

    fn plain_material(&mut self) -> MaterialId {
        let scene = &mut self.scene;
        *self.plain.get_or_insert_with(|| {
            scene.add_material(Material::MetallicRoughness(MetallicRoughness {
                metallic: 0.0,
                ..MetallicRoughness::default()
            }))
        })
    }
}

/// The name of a node, or its index.
fn name_of(node: &gltf::Node) -> String {
    node.name().map_or_else(|| format!("node {}", node.index()), str::to_owned)
}

fn dvec3(v: [f32; 3]) -> DVec3 {
    DVec3::from(v.map(f64::from))
}
