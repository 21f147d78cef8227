//! Mesh instancing: nodes that share a mesh, and EXT_mesh_gpu_instancing, which gives a node several placements.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3};
use serde_json::Value;

use crate::error::Result;
use crate::import::formats::gltf::Loader;
use crate::import::formats::gltf::animation::unit;
use crate::import::formats::gltf::check::fault;
use crate::scene::{Mesh, Placed, Placement, Shape};

/// Name of the extension.
pub(crate) const NAME: &str = "EXT_mesh_gpu_instancing";

/// The attributes that place an instance.
const ATTRIBUTES: [&str; 3] = ["TRANSLATION", "ROTATION", "SCALE"];

/// Cache of the meshes with several placements.
#[derive(Default)]
pub(super) struct SharedMeshes {
    /// Number of placements by mesh index.
    places: HashMap<usize, usize>,
    /// Meshes read so far, by mesh and primitive index.
    read: HashMap<(usize, usize), Option<Arc<Mesh>>>,
}

impl SharedMeshes {
    /// Adds placements of a mesh.
    pub(super) fn count(&mut self, mesh: &gltf::Mesh, places: usize) {
        *self.places.entry(mesh.index()).or_default() += places;
    }
}

/// The accessors of the extension of a node that place its mesh, of which the counts are the number of placements.
pub(super) fn accessors<'a>(
    node: &gltf::Node,
    document: &'a gltf::Document,
) -> impl Iterator<Item = gltf::Accessor<'a>> {
    let attributes = node.extension_value(NAME).map_or(&Value::Null, |value| &value["attributes"]);
    let indices =
        ATTRIBUTES.map(|key| attributes[key].as_u64().and_then(|index| usize::try_from(index).ok()));
    indices.into_iter().flatten().filter_map(|index| document.accessors().nth(index))
}

impl Loader<'_> {
    /// The shapes of a primitive in each of the given placements.
    pub(super) fn placed(
        &mut self,
        mesh: &gltf::Mesh,
        primitive: &gltf::Primitive,
        name: &str,
        weights: &[f64],
        places: &[DMat4],
    ) -> Result<Vec<Shape>> {
        // Nodes weigh the morph targets of a mesh differently.
        let is_shared = self.shared.places.get(&mesh.index()).is_some_and(|&places| places > 1)
            && primitive.morph_targets().len() == 0;
        let key = (mesh.index(), primitive.index());
        let known = self.shared.read.get(&key).filter(|_| is_shared);
        let own = match known {
            Some(shared) => shared.clone(),
            None => self.primitive(primitive, name, weights)?.map(Arc::new),
        };
        if is_shared {
            self.shared.read.insert(key, own.clone());
        }
        let Some(own) = own else { return Ok(Vec::new()) };
        if let [world_from_mesh] = places
            && !is_shared
        {
            let mut mesh = Arc::unwrap_or_clone(own);
            mesh.transform(world_from_mesh);
            return Ok(vec![Shape::Mesh(mesh)]);
        }
        let place = |matrix: &DMat4| Shape::Placed(Placed::new(Arc::clone(&own), Placement::new(*matrix)));
        Ok(places.iter().map(place).collect())
    }

    /// The placements of a node's mesh: those of the extension, or the node's own transform.
    pub(super) fn places_of(&self, node: &gltf::Node, world_from_node: &DMat4) -> Result<Vec<DMat4>> {
        let Some(value) = node.extension_value(NAME) else { return Ok(vec![*world_from_node]) };
        let fault =
            |what: &str| Err(fault(&self.source.file, format!("node {}, {NAME}", node.index()), what));
        let attributes = &value["attributes"];
        let accessor =
            |key| attributes[key].as_u64().map(|index| self.document.accessors().nth(index as usize));
        let accessors = ATTRIBUTES.map(accessor);
        if accessors.iter().any(|accessor| matches!(accessor, Some(None))) {
            return fault("it names an accessor that is not there");
        }
        let [translation, rotation, scale] = accessors.map(Option::flatten);
        let counts = [&translation, &rotation, &scale].map(|accessor| accessor.as_ref().map(|a| a.count()));
        let Some(count) = counts.into_iter().flatten().next() else {
            // Custom attributes alone do not place anything.
            let is_empty = attributes.as_object().is_none_or(|attributes| attributes.is_empty());
            return if is_empty { fault("has no attributes") } else { Ok(vec![*world_from_node]) };
        };
        if counts.into_iter().flatten().any(|other| other != count) {
            return fault("its attributes differ in number");
        }
        let vectors = |accessor: Option<gltf::Accessor>, default: DVec3| match accessor {
            None => Some(vec![default; count]),
            Some(accessor) => Some(self.vectors(&accessor)?.into_iter().map(DVec3::from_array).collect()),
        };
        let (Some(translations), Some(scales)) =
            (vectors(translation, DVec3::ZERO), vectors(scale, DVec3::ONE))
        else {
            return fault("its translations or scales are not three numbers each");
        };
        let rotations = match rotation {
            None => Some(vec![DQuat::IDENTITY; count]),
            Some(accessor) => self.vectors(&accessor).map(|all| all.into_iter().map(unit).collect()),
        };
        let Some(rotations) = rotations else { return fault("its rotations are not quaternions") };
        let place = |((translation, rotation), scale)| {
            *world_from_node * DMat4::from_scale_rotation_translation(scale, rotation, translation)
        };
        Ok(translations.into_iter().zip(rotations).zip(scales).map(place).collect())
    }
}
